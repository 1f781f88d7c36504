"""Motions of 10 s: drift, energy error, error against a scalar equation, steps and time.

    python benchmarks/simulate.py [--loops 1 2]

The truth is the one equation of motion of the crank angle, integrated by SciPy to 1e-13: for parallel cranks
phi'' = -k cos phi. N-four-bar is problem A02 of the multibody benchmark library: cranks vertical at the start, tips at
1 m/s. All of them pass singular positions.
"""

import argparse
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

import redundax as rx

T1 = 10.0


def scalar(acceleration: Callable, phi: float, rate: float) -> float:
    """The angle at the end."""
    run = solve_ivp(
        lambda t, y: [y[1], acceleration(*y)], (0, T1), [phi, rate], method="DOP853", rtol=1e-13, atol=1e-14
    )
    return run.y[0, -1]


def parallel_cranks(inertia: float, weight: float) -> Callable:
    """phi'' of cranks with couplers that only translate."""
    return lambda phi, rate: -weight / inertia * np.cos(phi)


def problems(loops: list[int]) -> dict:
    """Mechanism, crank angle, its rate, index of the angle, its acceleration."""
    length = 0.5
    out = {
        "three-crank parallelogram": (
            rx.mechanisms.parallelogram(3),
            np.pi / 2,
            -1.0,
            8,
            parallel_cranks(3 * length**2 / 3 + 4 * length**2, 9.81 * length * (1.5 + 4)),
        ),
    }
    for n in loops:
        out[f"{n}-four-bar"] = (
            rx.mechanisms.n_four_bar(n),
            np.pi / 2,
            -1.0,
            4 * n + 2,
            parallel_cranks((n + 1) / 3 + n, 9.81 * ((n + 1) / 2 + n)),
        )
    return out


def measure(problem: tuple, rtol: float) -> list[float]:
    """Steps, seconds to compile, milliseconds to run, error, drift and energy error."""
    mechanism, phi, rate, index, acceleration = problem
    state = mechanism.state(phi, rate=rate)

    def run() -> rx.Trajectory:
        return jax.block_until_ready(rx.simulate(mechanism, state, T1, ts=[T1], rtol=rtol, throw=False))

    times = []
    for _ in range(6):
        start = time.perf_counter()
        result = run()
        times.append(time.perf_counter() - start)
    stats = result.stats
    return [
        int(stats.steps + stats.rejected),
        times[0],
        1e3 * float(np.median(times[1:])),
        abs(float(result.q[0, index]) - scalar(acceleration, phi, rate)),
        float(jnp.maximum(stats.position_violation, stats.velocity_violation)),
        float(stats.energy_error),
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--loops", type=int, nargs="*", default=[1, 2])
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    columns = "".join(f"{name:>10}" for name in ("rtol", "steps", "compile s", "run ms", "error", "drift", "energy"))
    print(f"{'motion of 10 s':28}{columns}")
    for name, problem in problems(arguments.loops).items():
        for rtol in (1e-6, 1e-8, 1e-10):
            steps, compiled, ran, error, drift, energy = measure(problem, rtol)
            whole = f"{rtol:10.0e}{steps:10}{compiled:10.1f}{ran:10.1f}"
            print(f"{name:28}{whole}{error:10.1e}{drift:10.1e}{energy:10.1e}")


if __name__ == "__main__":
    main()
