"""Extremes of outputs at rest."""

from typing import NamedTuple

import numpy as np

from ..._equations._factorisation import Factorisation
from ..._system._state import State
from ..._system._system import AbstractSystem
from ..._tools._waiting import telling_of
from .._cases import AbstractCases
from .._extremes import Ends
from .._solution_set import SolutionSet
from ._extreme import LoadsAtRest
from ._standing import Standing, standing

_CLEAR = 1e-8  # share of the limits by which a mechanism must stand, or fail to, beyond rounding
_ROUNDING = 1e-12  # of an output that does not vary


class BandsAtRest(NamedTuple):
    """Both ends, and whether the mechanism may stand: "yes", "no" or "undecided"."""

    lower: Ends
    upper: Ends
    stands: str


def bands_at_rest(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    solutions: SolutionSet,
    cases: AbstractCases,
    matrix: np.ndarray,
    most: int,
    both: int,
) -> BandsAtRest:
    """The extremes of matrix [qdd; lam; tau] over all that is possible, with at most `most` programmes for each.

    Of the first `both` outputs; of those that follow the least values alone.
    """
    with telling_of(f"linear programmes, at most {most} for each end, as `nodes` says"):
        found = standing(system, state, factor, solutions, cases)
        loads = LoadsAtRest(found.programme, most=most)
        stands = _stands(found, loads, most)
        largest = np.where(np.arange(len(matrix))[:, None] < both, matrix, 0.0)
        ends = [_ends(found, loads, part, stands) for part in (-matrix, largest)]
    lower = ends[0]._replace(value=-ends[0].value, bound=-ends[0].bound)
    return BandsAtRest(lower, ends[1], stands)


def _stands(found: Standing, loads: LoadsAtRest, most: int) -> str:
    """Whether anything is possible, and is so too where all limits of friction are a little less, or more."""
    none = np.zeros(len(found.unknowns.box))
    some = loads.extreme(none, first=True)
    factor = 1 - _CLEAR if some.x is not None else 1 + _CLEAR
    other = LoadsAtRest(found.programme.with_limits(factor), most=most).extreme(none, first=True)
    if some.x is not None:
        return "yes" if other.x is not None else "undecided"
    return "no" if other.bound == -np.inf and found.proved else "undecided"


def _ends(found: Standing, loads: LoadsAtRest, matrix: np.ndarray, stands: str) -> Ends:
    parts = [found.unknowns.acceleration, found.unknowns.multipliers, found.unknowns.friction]
    b, q, size = len(matrix), found.cases.lower.size, matrix.shape[1]
    out = Ends(np.full(b, np.nan), np.full(b, np.nan), np.full((b, q), np.nan), np.full((b, size), np.nan))
    if stands == "no":
        return out
    slope = np.concatenate([part.matrix for part in parts])
    offset = np.concatenate([part.offset for part in parts])
    for k, row in enumerate(matrix):
        cost = row @ slope
        extreme = loads.extreme(np.where(np.abs(cost) > _ROUNDING * (np.abs(row) @ np.abs(slope)), cost, 0.0))
        out.bound[k] = row @ offset + extreme.bound if found.proved else np.inf
        if extreme.x is not None:
            out.value[k] = row @ offset + extreme.value
        if extreme.x is not None and np.isfinite(extreme.value):
            out.case[k], out.solution[k] = found.figures(extreme.x), slope @ extreme.x + offset
    return out
