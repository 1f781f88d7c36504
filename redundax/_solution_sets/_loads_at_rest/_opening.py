"""Contacts that open where stiffness would have them pull.

    N^T (W lam - d - r) = 0,   lam_i >= 0,   r_i >= 0,   lam_i r_i = 0   of each contact i,

r being its gap, which acts as a misfit. Every set of contacts that are open is a set of cases: there lam_i = 0.
"""

import itertools
from typing import cast

import numpy as np

from ..._closures._closure import AbstractClosure
from ..._system._state import State
from ..._system._system import AbstractSystem
from ..._tools._errors import RedundaxError
from ..._tools._module import replace_fields
from .._bounds import AbstractBounds, MisfitBox, closed_by
from .._cases import AbstractCases, Affine, Fractional
from .._solution_set import SolutionSet

_MOST = 6  # contacts: 64 sets of them


def opening(
    bounds: AbstractBounds | AbstractClosure,
    cases: AbstractCases,
    system: AbstractSystem,
    state: State,
    solutions: SolutionSet,
) -> list[AbstractCases]:
    """The cases with all contacts closed, and where stiffness picks the loads those with each set of them open."""
    closure = bounds.closure if isinstance(bounds, MisfitBox) else bounds
    # Contacts outside the self-stress have a load of their own, which no gap changes.
    rows = [row for row in solutions.pushing if np.any(solutions.stress[row])]
    by_stiffness = isinstance(closure, AbstractClosure)
    if rows and (isinstance(cases, Fractional) or (by_stiffness and len(rows) > _MOST)):
        raise RedundaxError(
            f"Argument `bounds` must be a closure or a `MisfitBox`, with {_MOST} contacts at most, where contacts may "
            f"open and friction depends on how they share the load, but is {type(bounds).__name__}, with {len(rows)}. "
            "Leave it out for what contacts that push bear at most, or bound loads, as by a `PreloadBox`."
        )
    if not by_stiffness or not rows:
        return [cases]
    gaps = closed_by(closure, system, state, solutions, np.array(rows, int))[1]
    sets = itertools.chain.from_iterable(itertools.combinations(range(len(rows)), k) for k in range(1, len(rows) + 1))
    return [cases, *(_open(cast(Affine, cases), rows, gaps, list(places)) for places in sets)]


def _open(cases: Affine, rows: list[int], gaps: np.ndarray, places: list[int]) -> Affine:
    """Cases in which some contacts are open."""
    none = np.zeros(len(places))
    return replace_fields(
        cases,
        names=(*cases.names, *("gap" for _ in places)),
        lower=np.concatenate([cases.lower, none]),
        upper=np.concatenate([cases.upper, none + np.inf]),
        slope=np.concatenate([cases.slope, gaps[:, places]], axis=1),
        rows=np.array([rows[place] for place in places]),
        least=none,
        most=none,
    )
