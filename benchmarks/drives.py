"""Drive torque of a rubbing four-bar at many times, beside NumPy on the same equations.

    python -m benchmarks.drives [--smallest] [--times 1000000]

The crank turns at constant speed; all four pins rub with the size of their load. The peer is one NumPy program of
arrays, for this mechanism alone: circles that intersect, nine equations of balance for eight pin forces and
the torque, in batches, and friction by fixed-point sweeps to rounding. Times are of CPU. Errors are differences of the
two torques, whose equations are written independently, relative to the peak. At none of the times a pin turns round.
Pinocchio, where it is installed, knows no such friction: it is asked without, by recursive Newton-Euler of the tree at
NumPy's positions, and told beside NumPy without friction.
"""

import argparse
import importlib.util
import time

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)
import redundax as rx  # noqa: E402

A, B, C, D = 0.1, 0.35, 0.3, 0.4  # crank, coupler, rocker, ground, m
MASS, INERTIA = np.array([0.5, 1.0, 0.8]), np.array([1e-3, 1e-2, 6e-3])  # kg, kg m^2
RUBBING, SPEED, GRAVITY = 0.002, 6.0, 9.81  # mu times pin radius, m; rad/s; m/s^2
# Of each body its pins: which, with which sign the pin's force acts on it, and at which end of the body.
PINS = ((0, (0, 1, -1)), (0, (1, -1, 1)), (1, (1, 1, -1)), (1, (2, -1, 1)), (2, (2, 1, 1)), (2, (3, 1, -1)))
SWEEPS, SETTLED = 60, 1e-14  # of friction, and its relative change that ends them


def mechanism():
    """The four-bar of redundax, and a guess of its first position."""
    rubs = {"pin_radius": 0.01, "friction": rx.Coulomb(RUBBING / 0.01)}
    bodies = [rx.Body(name, m, j) for name, m, j in zip(("crank", "coupler", "rocker"), MASS, INERTIA, strict=True)]
    joints = [
        rx.Revolute("A", "crank", "ground", (-A / 2, 0.0), (0.0, 0.0), **rubs),
        rx.Revolute("B", "coupler", "crank", (-B / 2, 0.0), (A / 2, 0.0), **rubs),
        rx.Revolute("C", "rocker", "coupler", (C / 2, 0.0), (B / 2, 0.0), **rubs),
        rx.Revolute("D", "rocker", "ground", (-C / 2, 0.0), (D, 0.0), **rubs),
    ]
    q, *_ = motion(np.zeros(1))
    return rx.Mechanism(bodies, joints, gravity=(0.0, -GRAVITY)), np.concatenate([q[0, :, :2].ravel(), q[0, :, 2]])


def motion(phi):
    """Positions (x, y, angle) of the bodies for crank angles, and their rates and accelerations."""
    tip = A * np.stack([np.cos(phi), np.sin(phi)])
    to = np.array([[D], [0.0]]) - tip
    length = np.hypot(*to)
    coupler = np.arctan2(to[1], to[0]) + np.arccos((B**2 + length**2 - C**2) / (2 * B * length))
    elbow = tip + B * np.stack([np.cos(coupler), np.sin(coupler)])
    rocker = np.arctan2(elbow[1], elbow[0] - D)
    angles = np.stack([phi, coupler, rocker])
    along, across = np.stack([np.cos(angles), np.sin(angles)]), np.stack([-np.sin(angles), np.cos(angles)])
    # A e_1' + B e_2' = C e_3', and once more: two equations for the rates and accelerations of coupler and rocker
    matrix = np.stack([B * across[:, 1], -C * across[:, 2]], axis=-1).transpose(1, 0, 2)
    rates = np.stack([np.full_like(phi, SPEED), *_solve(matrix, -A * SPEED * across[:, 0].T).T])
    bend = A * SPEED**2 * along[:, 0] + B * rates[1] ** 2 * along[:, 1] - C * rates[2] ** 2 * along[:, 2]
    changes = np.stack([np.zeros_like(phi), *_solve(matrix, bend.T).T])
    sizes = np.array([A, B, C])[:, None]
    starts = np.stack([np.zeros_like(tip), tip, np.array([[D], [0.0]]) + 0 * tip], axis=1)
    centres = starts + along * sizes / 2
    own = sizes / 2 * (across * changes - along * rates**2)  # of centres about the first pin of each body
    first = A * (across[:, 0] * changes[0] - along[:, 0] * rates[0] ** 2)
    own[:, 1] += first
    q = np.concatenate([centres, angles[None]]).transpose(2, 1, 0)
    return q, rates, own, changes, along * sizes / 2


def _solve(matrix, right):
    return np.linalg.solve(matrix, right[..., None])[..., 0]


def torque_by_pinocchio(phi):
    """The same without friction."""
    import pinocchio

    model, turn = pinocchio.Model(), np.eye(3)
    model.gravity.linear = np.array([0.0, -GRAVITY, 0.0])
    above = 0
    for k, (place, length) in enumerate((((0.0, 0.0), A), ((A, 0.0), B), ((D, 0.0), C))):
        at = pinocchio.SE3(turn, np.array([*place, 0.0]))
        above = model.addJoint(above if k < 2 else 0, pinocchio.JointModelRZ(), at, f"joint {k}")
        inertia = pinocchio.Inertia(MASS[k], np.array([length / 2, 0, 0]), np.diag([INERTIA[k]] * 3))
        model.appendBodyToJoint(above, inertia, pinocchio.SE3.Identity())
    data, (q, rates, _, changes, _) = model.createData(), motion(phi)
    crank, coupler, rocker = np.stack([q[:, :, 2].T, rates, changes], axis=2)
    given = np.stack([crank, coupler - crank, rocker], axis=1)  # angles of joints, rates and changes
    found = np.array([pinocchio.rnea(model, data, *each) for each in given.transpose(0, 2, 1)])
    return np.sum(found * given[:, :, 1], axis=1) / SPEED


def torque_by_numpy(phi, rubbing=RUBBING):
    """The torque on the crank for crank angles."""
    _, rates, accelerations, changes, half = motion(phi)
    count = phi.size
    matrix = np.zeros((count, 9, 9))  # rows x, y, moment of each body; unknowns A, B, C, D (on the first body), torque
    for body, (pin, sign, end) in PINS:
        arm = end * half[:, body]
        for axis in range(2):
            matrix[:, 3 * body + axis, 2 * pin + axis] += sign
        matrix[:, 3 * body + 2, 2 * pin] += -sign * arm[1]
        matrix[:, 3 * body + 2, 2 * pin + 1] += sign * arm[0]
    matrix[:, 2, 8] = 1.0
    need = np.zeros((count, 9))
    for body in range(3):
        need[:, 3 * body] = MASS[body] * accelerations[0, body]
        need[:, 3 * body + 1] = MASS[body] * (accelerations[1, body] + GRAVITY)
        need[:, 3 * body + 2] = INERTIA[body] * changes[body]
    inverse = np.linalg.inv(matrix)
    slips = np.stack([rates[0], rates[1] - rates[0], rates[2] - rates[1], rates[2]])
    on = np.zeros((4, 9))  # moments of friction on bodies: of A, B, C and D on the first, and back on the other
    for pin, (first, other) in enumerate(((0, None), (1, 0), (2, 1), (2, None))):
        on[pin, 3 * first + 2] = 1.0
        if other is not None:
            on[pin, 3 * other + 2] = -1.0
    tau = np.zeros((count, 4))
    for _ in range(SWEEPS):
        found = np.einsum("nij,nj->ni", inverse, need - tau @ on)
        new = -rubbing * np.hypot(found[:, 0:8:2], found[:, 1:8:2]) * np.sign(slips.T)
        change, tau = np.abs(new - tau).max(), new
        if change <= SETTLED * np.abs(tau).max():
            break
    return np.einsum("nij,nj->ni", inverse, need - tau @ on)[:, 8]


def main():
    """Print times and errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--smallest", action="store_true", help="a hundred times only")
    parser.add_argument("--times", type=int, default=1_000_000, help="of three turns of the crank (default 1000000)")
    arguments = parser.parse_args()
    count = 100 if arguments.smallest else arguments.times
    machine, guess = mechanism()
    ts = np.linspace(0.01, 0.01 + 6 * np.pi / SPEED, count)
    begun = time.process_time()
    by_numpy = torque_by_numpy(SPEED * ts)
    numpy_time = time.process_time() - begun
    if importlib.util.find_spec("pinocchio"):
        begun = time.process_time()
        found = torque_by_pinocchio(SPEED * ts)
        took = time.process_time() - begun
        begun = time.process_time()
        wanted = torque_by_numpy(SPEED * ts, 0.0)
        alone = time.process_time() - begun
        error = np.abs(found - wanted).max() / np.abs(wanted).max()
        times = [1e6 * each / count for each in (alone, took)]
        print("without friction: NumPy {:.2f}, Pinocchio {:.2f} us a time, {:.1e}".format(*times, error))
    law = {"A.angle": rx.Polynomial([0.0, SPEED])}
    print(f"{count} times of a rubbing four-bar: positions, velocities, pin forces and the torque of the motor")
    print(f"NumPy, one program of arrays          {numpy_time:8.3f} s of CPU {1e6 * numpy_time / count:8.2f} us a time")
    for what in ("redundax.drive, the first call", "redundax.drive, the next call"):
        begun = time.process_time()
        run = rx.drive(machine, law, ts, guess)
        took = time.process_time() - begun
        error = np.abs(np.asarray(run["A.angle torque"]) - by_numpy).max() / np.abs(by_numpy).max()
        print(f"{what:36}  {took:8.3f} s of CPU {1e6 * took / count:8.2f} us a time  largest difference {error:.1e}")
    print(f"peak {float(run.peak['A.angle']):.6f} N m, rms {float(run.rms['A.angle']):.6f} N m")


if __name__ == "__main__":
    main()
