"""The wait before the first answer: seconds of CPU and programs compiled of a process that asks once.

    python -m benchmarks.first_calls [--smallest] [--runs 3]

Every work is a process of its own, import included, with no programs kept from others. The peer is a lean program: the
paper's method for the press of README.md written out in JAX, without a check or a verdict. Errors are those of the
ram's acceleration against that of this program, whose mechanics is written independently.
"""

import argparse
import os
import statistics
import subprocess
import sys
import textwrap

COUNT = """
import time
begun = time.process_time()
import jax
import jax.monitoring
import jax.numpy as jnp
compiled = []
jax.monitoring.register_event_duration_secs_listener(
    lambda event, duration, **_: compiled.append(duration) if "backend_compile" in event else None
)
jax.config.update("jax_enable_x64", True)
value = float("nan")
"""
TOLD = """
print(time.process_time() - begun, len(compiled), float(value))
"""
LEAN = """
centre = jnp.array([[-0.1, 0.0], [-0.25, 0.0], [0.0, 0.1]])

def place(q, body, point):
    c, s = jnp.cos(q[6 + body]), jnp.sin(q[6 + body])
    return q[2 * body : 2 * body + 2] + jnp.array([[c, -s], [s, c]]) @ jnp.asarray(point)

def constraint(q):
    pins = [
        place(q, 0, (-0.1, 0.0)),
        place(q, 1, (-0.25, 0.0)) - place(q, 0, (0.1, 0.0)),
        place(q, 2, (0.0, 0.1)) - place(q, 1, (0.25, 0.0)),
    ]
    guides = [place(q, 2, (side, 0.0))[0] - side for side in (-0.3, 0.3)]
    return jnp.concatenate([*pins, jnp.stack([*guides, q[8], q[8]])])

def closed(q):
    def step(q):
        rows, value = jax.jacfwd(constraint)(q), constraint(q)
        rows = jnp.concatenate([rows, jnp.eye(9)[6:7]])
        return q - jnp.linalg.pinv(rows) @ jnp.append(value, q[6] - 0.6)
    return jax.lax.fori_loop(0, 30, lambda _, q: step(q), q)

mass = jnp.array([2.0, 2.0, 1.5, 1.5, 10.0, 10.0, 0.01, 0.02, 0.3])
load = jnp.array([0.0, -2.0, 0.0, -1.5, 0.0, -10.0, 0.0, 0.0, 0.0]) * 9.81 + jnp.zeros(9).at[6].set(-5.0)

def solved(q):
    rows = jax.jacfwd(constraint)(q)
    qd = jnp.linalg.pinv(jnp.concatenate([rows, jnp.eye(9)[6:7]])) @ jnp.zeros(11).at[10].set(-1.0)
    gamma = -jax.jvp(lambda q: jax.jvp(constraint, (q,), (qd,))[1], (q,), (qd,))[1]
    A = jnp.block([[jnp.diag(mass), rows.T], [rows, jnp.zeros((10, 10))]])
    inverse, mu, length = jnp.linalg.pinv(A), 0.1, 0.08

    def friction(lam):  # (42), of both guides
        force = [mu * (jnp.abs(lam[6 + k] / 2 + lam[8 + k] / length) + jnp.abs(lam[6 + k] / 2 - lam[8 + k] / length))
                 for k in range(2)]
        return jnp.zeros(9).at[5].set(-jnp.sign(qd[5]) * sum(force))

    def step(carry):
        x, _ = carry
        new = inverse @ jnp.append(load + friction(x[9:]), gamma)
        return new, jnp.max(jnp.abs(new - x))

    x = inverse @ jnp.append(load, gamma)
    return jax.lax.while_loop(lambda carry: carry[1] > 1e-12, step, (x, jnp.inf))[0]

q = jax.jit(closed)(jnp.array([0.1, 0.1, 0.3, -0.1, 0.0, -0.5, 0.6, -1.2, 0.0]))
value = jax.jit(solved)(q)[5]
"""
PRESS = """
import redundax as rx
guide = {"normal": (1.0, 0.0), "guide_length": 0.08, "friction": rx.Coulomb(0.1)}
press = rx.Mechanism(
    [rx.Body("crank", mass=2.0, inertia=0.01), rx.Body("rod", 1.5, 0.02), rx.Body("ram", 10.0, 0.3)],
    [
        rx.Revolute("O", "crank", "ground", point_i=(-0.1, 0.0), point_j=(0.0, 0.0)),
        rx.Revolute("P", "rod", "crank", (-0.25, 0.0), (0.1, 0.0)),
        rx.Revolute("Q", "ram", "rod", (0.0, 0.1), (0.25, 0.0)),
        rx.Translational("L", "ram", "ground", (-0.3, 0.0), (-0.3, 0.0), **guide),
        rx.Translational("R", "ram", "ground", (0.3, 0.0), (0.3, 0.0), **guide),
    ],
    loads=[rx.AppliedForce("crank", moment=-5.0)],
    gravity=(0.0, -9.81),
)
guess = {"crank.y": 0.1, "rod.x": 0.1, "rod.y": -0.1, "ram.y": -0.5, "rod.phi": -1.2}
state = rx.assemble(press, guess, positions={"crank.phi": 0.6}, rates={"crank.phi": -1.0})
value = rx.solve(press, state)["ram.y''"]
"""
QUESTIONS = """
print_ = str(rx.analyze(press, state))
joints = rx.ElasticJoints(press, {"L": (1e-8, 1e-6), "R": (1e-8, 1e-6)})
fit = rx.MisfitBox(joints, {"L.perpendicular": (-1e-5, 1e-5)})
rx.solve(press, state, closure=joints)["L force x on ram"]
rx.band(press, state, ["L force x on ram", "ram.y''"], fit)
"""
PAPER = """
import redundax as rx
mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
rx.solve(mechanism, mechanism.state(phi=0.8, rate=1.0))
"""
BRICARD = """
import redundax as rx
linkage = rx.mechanisms.bricard()
str(rx.analyze(linkage, rx.assemble(linkage)))
"""
MOTION = """
import redundax as rx
mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
rx.simulate(mechanism, mechanism.state(phi=0.8, rate=1.0), 0.05)
"""
WORKS = {
    "lean program: press, one solve": LEAN,
    "press: assemble and solve": PRESS,
    "README: three questions of the press": PRESS + QUESTIONS,
    "the paper's mechanism, one solve": PAPER,
    "Bricard's linkage: assemble, analyze": BRICARD,
    "the paper's mechanism, a first motion": MOTION,
}


def main() -> None:
    """Print a table of all works."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.first_calls", description=__doc__)
    parser.add_argument("--smallest", action="store_true", help="the press alone, once")
    parser.add_argument("--runs", type=int, default=3, help="processes of each work, in turn; 3 if not given")
    given = parser.parse_args()
    names = list(WORKS)[: 2 if given.smallest else None]
    runs = {name: [] for name in names}
    for _ in range(1 if given.smallest else given.runs):
        for name in names:
            runs[name].append(asked(WORKS[name]))
    lean = [statistics.median(column) for column in zip(*runs[names[0]], strict=True)]
    print(f"{'work':40} {'CPU, s':>8} {'of lean':>8} {'programs':>9} {'error':>9}")
    for name, rows in runs.items():
        seconds, programs, value = (statistics.median(column) for column in zip(*rows, strict=True))
        error = f"{abs(value - lean[2]) / abs(lean[2]):9.0e}" if value == value else ""
        print(f"{name:40} {seconds:8.2f} {seconds / lean[0]:8.2f} {programs:9.0f} {error}")


def asked(work: str) -> tuple[float, ...]:
    """Seconds of CPU, programs and the value of a process."""
    code = COUNT + textwrap.dedent(work) + TOLD
    options = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "JAX_ENABLE_COMPILATION_CACHE": "false"}
    done = subprocess.run([sys.executable, "-c", code], env=options, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(done.stderr)
    return tuple(map(float, done.stdout.split()[-3:]))


if __name__ == "__main__":
    main()
