"""Speed and error of `rx.solve` on the mechanism of Wojtyra et al. (2020), beside NumPy on the same work.

    python benchmarks/solve.py [--json] [--size 20000]

Each row: time per solve, ratio to the NumPy peer of the same block (measured in the same run, in turn), and
the largest error against the solution in 50-digit arithmetic, relative per kind of quantity.
"""

import argparse
import json
import pathlib
import sys
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "tests"))

from truth import exact, paper

import redundax as rx

PHI, RATE, MU_RHO = np.pi / 4, 1.0, 0.02
KINDS = {"linear": slice(0, 8), "angular": slice(8, 12), "force": slice(12, 22), "moment": slice(22, 24)}


def numpy_vectorised(h: np.ndarray) -> np.ndarray:
    """Fixed point (27) on the full unknown for all h at once, to 1e-12; shape (batch, 24)."""
    p = paper.Parameters()
    q, qd = paper.configuration(p, PHI, RATE)
    matrix = paper.matrix(p, q)
    inverse = paper.pinv_drop_one(matrix)
    null = np.eye(24) - inverse @ matrix
    constant = np.concatenate([paper.load(p), paper.gamma(p, q, qd)])
    base = (inverse @ constant)[:, None] + null.sum(axis=1)[:, None] * h
    gain = -p.mu_rho * paper.senses(qd)[:, None]
    spread = inverse[:, :12] @ paper.DISTRIBUTION
    x, tau = base, np.zeros((4, h.size))
    for _ in range(1000):
        new = gain * np.hypot(x[12:20:2], x[13:20:2])
        x = base + spread @ new
        if np.max(np.abs(new - tau)) < 1e-12:
            break
        tau = new
    return x.T


def times(runs: dict[str, Callable[[], object]], repeats: int = 7) -> dict[str, float]:
    """Median seconds of each run, measured in turn after a warm-up."""
    for run in runs.values():
        jax.block_until_ready(run())
    measured = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            start = time.perf_counter()
            jax.block_until_ready(run())
            measured[name].append(time.perf_counter() - start)
    return {name: float(np.median(values)) for name, values in measured.items()}


def errors(x: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """Largest error of each kind, relative to the largest entry of that kind, over a batch (batch, 24)."""
    x, truth = np.atleast_2d(x), np.atleast_2d(truth)
    return {
        kind: float(np.max(np.max(np.abs(x - truth)[:, part], 1) / np.max(np.abs(truth[:, part]), 1)))
        for kind, part in KINDS.items()
    }


def truth(h: float, friction: bool) -> np.ndarray:
    """[qdd; lam] from 50-digit arithmetic."""
    mechanism = exact.wojtyra2020()
    solution = mechanism.solve(misfit=[h] * mechanism.m, friction=friction)
    parts = (exact.floats(solution.acceleration), exact.floats(solution.multipliers))
    return np.concatenate([part.ravel() for part in parts])


def stacked(solution: rx.Solution) -> np.ndarray:
    """[qdd; lam] of a solution or a batch of them."""
    return np.concatenate([solution.acceleration, solution.multipliers], axis=-1)


def single(friction: bool) -> list[dict]:
    """One call at h = 0."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=MU_RHO if friction else None)
    state = mechanism.state(PHI, rate=RATE)
    p = paper.Parameters()
    q, qd = paper.configuration(p, PHI, RATE)
    solve = jax.jit(lambda mechanism, state: rx.solve(mechanism, state))

    def peer() -> np.ndarray:
        return paper.fixed_point(p, q, qd)[-1] if friction else paper.solve(p, q, qd)

    seconds = times({"NumPy": peer, "redundax": lambda: solve(mechanism, state)}, repeats=201)
    name = "one call, friction" if friction else "one call, no friction"
    found = {"NumPy": peer(), "redundax": stacked(solve(mechanism, state))}
    return rows(name, seconds, 1, {key: errors(x, truth(0.0, friction)) for key, x in found.items()}, "NumPy")


def sweep_h(size: int) -> list[dict]:
    """Fixed point over many h, every solution returned whole."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=MU_RHO)
    state = mechanism.state(PHI, rate=RATE)
    h = np.linspace(-100.0, 100.0, size)
    sample = np.linspace(0, size - 1, 5).astype(int)

    def batched(solver: rx.AbstractSolver) -> Callable[[], rx.Solution]:
        run = jax.jit(jax.vmap(lambda h: rx.solve(mechanism, state, closure=rx.MinimumNorm(h), solver=solver)))
        values = jnp.asarray(h)
        return lambda: run(values)

    runs = {
        "NumPy vectorised": lambda: numpy_vectorised(h),
        "redundax vmap, fixed point": batched(rx.FixedPoint()),
        "redundax vmap, Newton": batched(rx.Newton()),
        "redundax vmap, default": batched(rx.Continuation()),
    }
    seconds = times(runs)
    p = paper.Parameters()
    q, qd = paper.configuration(p, PHI, RATE)
    start = time.perf_counter()
    looped = [paper.fixed_point(p, q, qd, h=value)[-1] for value in h[:100]]
    seconds = {"NumPy loop": (time.perf_counter() - start) * size / len(looped), **seconds}
    exactly = np.stack([truth(value, True) for value in h[sample]])
    found = {key: errors(np.asarray(_array(run()))[sample], exactly) for key, run in runs.items()}
    found = {"NumPy loop": errors(looped[0], exactly[0]), **found}
    return rows(f"h sweep of {size}", seconds, size, found, "NumPy vectorised")


def sweep_u(size: int) -> list[dict]:
    """No friction, a new length unit in every sample: NumPy assembles and inverts (7) each time."""
    u = np.geomspace(1e-2, 1e2, size)

    def peer() -> np.ndarray:
        out = []
        for value in u:
            p = paper.Parameters(u=value)
            q, qd = paper.configuration(p, PHI, RATE)
            out.append(paper.solve(p, q, qd))
        return np.stack(out)

    def one(u: jax.Array) -> rx.Solution:
        mechanism = rx.mechanisms.wojtyra2020(u=u)
        return rx.solve(mechanism, mechanism.state(PHI, rate=RATE))

    run, values = jax.jit(jax.vmap(one)), jnp.asarray(u)
    seconds = times({"NumPy loop": peer, "redundax vmap": lambda: run(values)}, repeats=3)
    sample = np.linspace(0, size - 1, 5).astype(int)
    exactly = np.stack([_unit_truth(value) for value in u[sample]])
    found = {"NumPy loop": peer()[sample], "redundax vmap": stacked(run(values))[sample]}
    return rows(
        f"u sweep of {size}", seconds, size, {key: errors(x, exactly) for key, x in found.items()}, "NumPy loop"
    )


def _unit_truth(u: float) -> np.ndarray:
    mechanism = exact.wojtyra2020(u=u)
    solution = mechanism.solve(friction=False)
    parts = (exact.floats(solution.acceleration), exact.floats(solution.multipliers))
    return np.concatenate([part.ravel() for part in parts])


def _array(result: rx.Solution | np.ndarray) -> np.ndarray:
    return stacked(result) if isinstance(result, rx.Solution) else result


def rows(work: str, seconds: dict, size: int, found: dict, peer: str) -> list[dict]:
    """Rows of the table: microseconds per solve, speed relative to the peer, errors."""
    return [
        {
            "work": work,
            "program": name,
            "us_per_solve": 1e6 * value / size,
            "speed_over_peer": seconds[peer] / value,
            **found[name],
        }
        for name, value in seconds.items()
    ]


def main() -> None:
    """Run all blocks and print the table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--size", type=int, default=20000, help="samples in the h sweep (default 20000)")
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    table = [*single(False), *single(True), *sweep_h(arguments.size), *sweep_u(max(arguments.size // 10, 1))]
    if arguments.json:
        print(json.dumps(table, indent=2))
        return
    print(f"{'work':24}{'program':28}{'us/solve':>10}{'speed':>9}  " + "".join(f"{kind:>9}" for kind in KINDS))
    for row in table:
        kinds = "".join(f"{row[kind]:9.1e}" for kind in KINDS)
        print(f"{row['work']:24}{row['program']:28}{row['us_per_solve']:10.3f}{row['speed_over_peer']:8.2f}x  {kinds}")
    print("speed: relative to NumPy (one call), NumPy vectorised (h sweep), NumPy loop (u sweep).")
    print("linear to moment: largest error of each kind against 50-digit arithmetic, relative.")


if __name__ == "__main__":
    main()
