"""What is measured: medians of programs that run in turn, and errors against 50 digits."""

import dataclasses
import time
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np

# [qdd; lam; tau] of the paper's mechanism.
KINDS = {
    "linear": slice(0, 8),
    "angular": slice(8, 12),
    "force": slice(12, 22),
    "moment": slice(22, 24),
    "friction": slice(24, 28),
}
PHI, RATE, MU_RHO = np.pi / 4, 1.0, 0.02


@dataclasses.dataclass(frozen=True)
class Program:
    """A way to solve for many values of one number.

    - `run`: solves for all `values`.
    - `truth`: [qdd; lam; tau] at 50 digits of a value.
    - `rows`: what a run found at some samples, (samples, 28), NaN where it was not asked.
    """

    name: str
    run: Callable[[], Any]
    values: np.ndarray
    truth: Callable[[float], np.ndarray]
    rows: Callable[[Any, np.ndarray], np.ndarray]


@dataclasses.dataclass(frozen=True)
class Row:
    """One line of the table: how many solves, seconds for one of them, and the error."""

    work: str
    program: str
    solves: int
    seconds: float
    error: float


def compare(work: str, programs: Sequence[Program], repeats: int = 5, kinds: dict[str, slice] = KINDS) -> list[Row]:
    """Run all programs in turn; errors at five samples of each, of the kinds of their entries."""
    seconds = times([program.run for program in programs], repeats)
    return [
        Row(work, program.name, len(program.values), value / len(program.values), _error_of(program, kinds))
        for program, value in zip(programs, seconds, strict=True)
    ]


def _error_of(program: Program, kinds: dict[str, slice]) -> float:
    samples = np.unique(np.linspace(0, len(program.values) - 1, 5).astype(int))
    true = np.stack([program.truth(float(program.values[sample])) for sample in samples])
    return error(program.rows(program.run(), samples), true, kinds)


def times(runs: Sequence[Callable[[], Any]], repeats: int) -> list[float]:
    """Median seconds of each run, measured in turn after a warm-up."""
    for run in runs:
        jax.block_until_ready(run())
    measured = [[] for _ in runs]
    for _ in range(repeats):
        for run, values in zip(runs, measured, strict=True):
            start = time.perf_counter()
            jax.block_until_ready(run())
            values.append(time.perf_counter() - start)
    return [float(np.median(values)) for values in measured]


def error(found: np.ndarray, true: np.ndarray, kinds: dict[str, slice] = KINDS) -> float:
    """Largest error of any kind, relative to the largest true value of the kind; what is not there does not count."""
    found, true = np.asarray(found, float), np.asarray(true, float)
    worst = []
    for part in kinds.values():
        there = ~np.isnan(found[:, part])
        if there.any() and np.any(true[:, part]):
            off = np.where(there, np.abs(found - true)[:, part], 0.0)
            worst.append(np.max(np.max(off, 1) / np.max(np.abs(true[:, part]), 1)))
    return float(max(worst))


def whole(acceleration: Any = None, multipliers: Any = None, friction: Any = None) -> np.ndarray:
    """Rows [qdd; lam; tau], NaN where a part was not asked for."""
    parts = [np.asarray(part) for part in (acceleration, multipliers, friction) if part is not None]
    out = np.full((len(parts[0]), 28), np.nan)
    for part, place in ((acceleration, slice(0, 12)), (multipliers, slice(12, 24)), (friction, slice(24, 28))):
        if part is not None and np.asarray(part).shape[1]:
            out[:, place] = np.asarray(part)
    return out
