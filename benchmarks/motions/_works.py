"""What is run: one motion at many precisions, a batch of motions, and a very long one."""

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

import redundax as rx

from .._devices import batched
from .._programs import Programs, of_function
from . import _exudyn, _mujoco
from ._problems import (
    T1,
    Problem,
    a04,
    a05,
    andrews,
    crank,
    crank_angle,
    four_bar_in_space,
    n_four_bar,
    papers,
    rubbing,
    stiffness,
    three_cranks,
)

OURS = "redundax"


@dataclass(frozen=True)
class Row:
    """One program on one motion: seconds to compile and to run, steps, error of the crank angle at the end.

    `drift` and `energy` are the largest violation of the constraints and error of the energy, where they are known.
    """

    work: str
    program: str
    setting: str
    compilation: float
    seconds: float
    steps: int
    error: float
    drift: float = np.nan
    energy: float = np.nan


def one_motion(quick: bool) -> Iterator[Row]:
    """Time against error."""
    controls = (three_cranks(), andrews(), papers(), papers(0.02))
    for problem in (*controls, *(n_four_bar(loops) for loops in ((1,) if quick else (1, 2, 10)))):
        for rtol in (1e-5, 1e-7, 1e-9) if quick else (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10):
            yield ours(problem, rtol)
        if problem.loops:
            yield from _peers(problem, (1_000, 10_000) if quick else (1_000, 4_000, 16_000, 64_000, 256_000))


def in_space(quick: bool) -> Iterator[Row]:
    """Time against error of Bricard's mechanism, a four-bar and the stiff governor."""
    smooth = (1e-6, 1e-8) if quick else (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
    counts = (1_000, 4_000) if quick else (1_000, 4_000, 16_000, 64_000)
    for problem, tolerances in ((a04(), smooth), (four_bar_in_space(), smooth), (a05(), (1e-5, 1e-6))):
        for rtol in tolerances:
            yield ours(problem, rtol)
        if not _exudyn.missing():
            for steps in counts:
                seconds, found = _exudyn.run_in_space(problem, steps)
                error = float(np.abs(found - problem.end).max())
                yield Row(problem.name, _exudyn.NAME, f"{steps} steps", 0.0, seconds, steps, error)


def friction(quick: bool) -> Iterator[Row]:
    """A motion with dry friction in the plane, and the same in space."""
    for problem in rubbing():
        for rtol in (1e-7,) if quick else (1e-5, 1e-7, 1e-9):
            yield ours(problem, rtol)


_warmed: set[str] = set()  # problems whose motions have run for long enough to be programs
_WARM = 10.0  # seconds


def ours(
    problem: Problem, rtol: float, solver: rx.Radau | None = None, clock: Callable[[], float] = time.perf_counter
) -> Row:
    """A line of redundax, by its own choice of solver if none is given."""
    mechanism, state, t1 = problem.mechanism, problem.state, problem.t1

    def run() -> rx.types.Trajectory:
        return rx.simulate(mechanism, state, t1, ts=[t1], rtol=rtol, solver=solver, throw=False)

    first, seconds, found = timed(run, clock=clock, warm=0.0 if problem.name in _warmed else _WARM)
    _warmed.add(problem.name)
    stats = found.stats
    return Row(
        problem.name,
        OURS if solver is None else f"{OURS}, Radau()",
        f"rtol {rtol:.0e}",
        first - seconds,
        seconds,
        int(stats.steps + stats.rejected),
        float(problem.error(np.asarray(found.q[0]))),
        float(jnp.maximum(stats.position_violation, stats.velocity_violation)),
        float(stats.energy_error),
    )


def timed(run: Callable, repeats: int = 3, clock: Callable[[], float] = time.perf_counter, warm: float = 0.0) -> tuple:
    """Seconds of the first call, median of the last ones, and the value; after so many seconds at least."""
    times, value = [], None
    while len(times) <= repeats or sum(times) < warm:
        start = clock()
        value = jax.block_until_ready(run())
        times.append(clock() - start)
    return times[0], float(np.median(times[-repeats:])), value


def _peers(problem: Problem, counts: Sequence[int]) -> Iterator[Row]:
    angle = crank_angle(stiffness(problem.loops), np.pi / 2, -1.0)
    runs: dict[str, Callable] = {}
    if not _exudyn.missing():
        runs[_exudyn.NAME] = _exudyn.run
    if not _mujoco.missing():
        for name, integrator in _mujoco.INTEGRATORS.items():
            runs[name] = lambda loops, steps, integrator=integrator: _mujoco.run(loops, steps, integrator)
    for name, run in runs.items():
        for steps in counts:
            found = [run(problem.loops, steps) for _ in range(3 if steps < 64_000 else 1)]
            seconds = float(np.median([seconds for seconds, _ in found]))
            error = abs(found[0][1] - angle)
            setting = f"{steps} steps" + (", stopped" if np.isnan(error) else "")
            yield Row(problem.name, name, setting, 0.0, seconds, steps, error)


def compilation() -> dict[str, Programs]:
    """Programs of the paper's motion and of its derivatives by the rate at the start, compiled without a cache."""
    problem, rate = papers(), jnp.ones(())

    def angle(adjoint: diffrax.AbstractAdjoint | None, rate: jax.Array) -> jax.Array:
        start = rx.State(problem.state.q, rate * problem.state.qd)
        return rx.simulate(problem.mechanism, start, T1, ts=[T1], rtol=1e-7, adjoint=adjoint, throw=False).q[0, 8]

    onward, back = partial(angle, diffrax.ForwardMode()), partial(angle, None)
    return {
        "motion": of_function(back, rate),
        "motion, derivative forward": of_function(jax.jacfwd(onward), rate),
        "motion, derivative reverse": of_function(jax.grad(back), rate),
    }


def batch(quick: bool) -> Iterator[Row]:
    """Motions of 1-four-bar from different rates: seconds of one, in a batch on all cores; the largest error."""
    problem, count = n_four_bar(1), -(-(50 if quick else 1000) // jax.device_count()) * jax.device_count()
    rates = np.linspace(-1.1, -0.9, count)
    some = np.linspace(0, count - 1, 8).astype(int)
    exact = np.array([crank_angle(stiffness(1), np.pi / 2, rate) for rate in rates[some]])
    for setting, options in {
        "rtol 1e-7": {"rtol": 1e-7},
        "rtol 1e-8": {"rtol": 1e-8},
        "1000 steps of Dopri5": {"rtol": None, "dt0": T1 / 1000, "solver": diffrax.Dopri5()},
    }.items():
        run = batched(lambda rate, options=options: _last(problem, rate, options))
        first, seconds, (angles, steps) = timed(lambda run=run: run(rates), 1)
        error = np.abs(np.asarray(angles)[some] - exact).max()
        yield Row(f"{count} motions", OURS, setting, first - seconds, seconds / count, int(np.mean(steps)), error)
    if not _exudyn.missing():
        for steps in (10_000,) if quick else (10_000, 64_000):
            with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
                list(pool.map(_exudyn.run, [1, 1], [100, 100]))  # starts the processes
                start = time.perf_counter()
                found = list(pool.map(_exudyn.run, [1] * len(some), [steps] * len(some), rates[some]))
                seconds = (time.perf_counter() - start) / len(some)
            error = np.abs(np.array([angle for _, angle in found]) - exact).max()
            yield Row(f"{count} motions", f"{_exudyn.NAME}, 2 processes", f"{steps} steps", 0.0, seconds, steps, error)


def _last(problem: Problem, rate: jax.Array, options: dict) -> tuple[jax.Array, jax.Array]:
    """Crank angle at the end, and steps."""
    state = problem.mechanism.state(np.pi / 2, rate=rate)
    found = rx.simulate(problem.mechanism, state, T1, ts=[T1], throw=False, max_steps=100_000, **options)
    return found.q[0, crank(1)], found.stats.steps + found.stats.rejected


def long_run(quick: bool) -> Iterator[Row]:
    """Constant steps: does drift stay at rounding and the energy bounded?"""
    problem = n_four_bar(1)
    for steps in (1_000, 10_000) if quick else (10_000, 100_000, 1_000_000):
        end = 0.01 * steps
        run = rx.simulate(
            problem.mechanism,
            problem.state,
            end,
            ts=[end],
            rtol=None,
            dt0=0.01,
            solver=diffrax.Dopri5(),
            max_steps=steps + 1,
            throw=False,
        )
        drift = float(jnp.maximum(run.stats.position_violation, run.stats.velocity_violation))
        energy = float(run.stats.energy_error)
        yield Row("many steps of 0.01 s", OURS, "Dopri5", 0.0, np.nan, int(run.stats.steps), np.nan, drift, energy)
