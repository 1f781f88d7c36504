"""Bands where each case is solved by itself: joints with play that rub, and friction that is known within limits.

The middle of the box, its corners and random cases are looked at. From the best of each end steps go along one entry at
a time, halved where none is better. What is found is attained; more may be.
"""

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from ..._closures._closure import Elasticity, constant
from ..._closures._play import Play
from ..._equations._factorisation import Factorisation
from ..._solve._play import at_sides
from ..._solve._solution import Solution
from ..._solve._solve import solve, solve_factorised
from ..._solvers._continuation import Continuation
from ..._system._names import ByName, senses
from ..._system._results import RESULTS, is_one_of
from ..._system._state import State
from ..._system._system import AbstractSystem
from .._cases import corners
from .._extremes import Ends

_CORNERS = 6  # entries of a case up to which all corners of the box are looked at
_SHARE = 8  # of the samples of bands one in as many, as each is solved by itself
_FIRST, _LAST, _STAYS = 0.5, 1e-4, 2.0**-5  # steps, relative to the box; where none has been better, the last
_GAIN = 1e-9  # relative, that is no rounding


def one_by_one(
    system: AbstractSystem, state: State, factor: Factorisation, sense: ByName | None
) -> Callable[[Mapping[str, float], Elasticity, Play | None], np.ndarray]:
    """[qdd; lam; tau] for multiples of the friction of joints, a closure and play; NaN where there is no solution."""

    def alone(system: AbstractSystem, state: State, factor: Factorisation, chosen: Elasticity) -> Solution:
        return solve_factorised(system, state, factor, chosen, Continuation(), None, senses(system.slips, sense))

    def solved(factors: Mapping[str, float], chosen: Elasticity, play: Play | None) -> np.ndarray:
        own = (system.rubbing(factors) if factors else system).anonymous
        solution, _, settled = at_sides(play, alone)(own, state, factor, chosen)
        out = np.concatenate([solution.acceleration, solution.multipliers, solution.friction])
        return out if settled and is_one_of(solution.result, RESULTS.successful) else np.full_like(out, np.nan)

    return solved


def with_contacts(
    system: AbstractSystem, state: State, sense: ByName | None
) -> Callable[[Mapping[str, float], Elasticity, Play | None], np.ndarray]:
    """The same of a system with one-sided contacts, of which those that carry are found case by case."""

    def solved(factors: Mapping[str, float], chosen: Elasticity, play: Play | None) -> np.ndarray:
        own = system.rubbing(factors) if factors else system
        solution = solve(own, state, closure=constant(chosen, play), sense=sense, throw=False)
        return np.concatenate([solution.acceleration, solution.multipliers, solution.friction])

    return solved


def searched(
    attained: Callable[[np.ndarray], np.ndarray], box: np.ndarray, matrix: np.ndarray, samples: int, seed: int
) -> tuple[Ends, Ends, float]:
    """The least and the largest matrix [qdd; lam; tau] over a box of cases, (q, 2), and the share with a solution."""
    random, (lower, upper) = np.random.default_rng(seed), box.T
    q, span = len(box), upper - lower
    high = corners(np.zeros(q), np.ones(q)) if q <= _CORNERS else random.random((2**_CORNERS, q)) < 0.5
    shares = [np.full((1, q), 0.5), high, random.random((samples // _SHARE, q))]
    cases = np.unique(lower + np.concatenate(shares) * span, axis=0)
    solutions = np.array([attained(case) for case in cases])
    good = np.all(np.isfinite(solutions), axis=1)
    if not good.any():
        none = [np.full((len(matrix), *size), np.nan) for size in ((), cases.shape[1:], solutions.shape[1:])]
        return _end(none, -np.inf), _end(none, np.inf), 0.0
    share, values = float(good.mean()), np.where(good[:, None], solutions @ matrix.T, np.nan)
    varies = np.nanmax(values, axis=0) - np.nanmin(values, axis=0) > _GAIN * np.nanmax(np.abs(values), axis=0)

    def best(k: int, sign: float) -> tuple[float, np.ndarray, np.ndarray]:
        first = int(np.nanargmax(sign * values[:, k]))
        value, case, solution = float(values[first, k]), cases[first], solutions[first]
        step, last = _FIRST, _STAYS if varies[k] else 1.0
        while step >= last:
            better = False
            for move in np.concatenate([np.diag(span), -np.diag(span)]):
                ahead = np.clip(case + step * move, lower, upper)
                if np.array_equal(ahead, case):
                    continue
                found = attained(ahead)
                if sign * (found @ matrix[k]) > sign * value + _GAIN * abs(value):
                    value, case, solution, better = float(found @ matrix[k]), ahead, found, True
            step, last = (step, _LAST) if better else (step / 2, last)
        return value, case, solution

    found = [[best(k, sign) for k in range(len(matrix))] for sign in (-1.0, 1.0)]
    least, most = (map(np.array, zip(*end, strict=True)) for end in found)
    return _end(least, -np.inf), _end(most, np.inf), share


def _end(found: Iterable[np.ndarray], bound: float) -> Ends:
    value, case, solution = found
    return Ends(value, np.full(len(value), bound), case, solution)
