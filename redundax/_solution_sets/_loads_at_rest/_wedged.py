"""States at rest that a search from the start without friction misses: joints that wedge themselves.

Friction that grows with the loads that it causes can hold a mechanism once these loads are there. Such states are apart
from those that a search from no friction reaches; `LoadsAtRest` finds one if there is any.
"""

import numpy as np

from ..._equations._factorisation import Factorisation
from ..._system._state import State
from ..._system._system import AbstractSystem
from .._at_rest import Ends
from .._cases import AbstractCases, Affine
from .._solution_set import SolutionSet
from ._extreme import LoadsAtRest
from ._standing import standing

_CLEAR = 1e-8  # share of the limits by which friction must stay within them
_MOST = 400  # programmes


def wedged(
    system: AbstractSystem, state: State, factor: Factorisation, solutions: SolutionSet, cases: AbstractCases
) -> Ends | None:
    """One state that friction holds, with 1 / share - 1 as margin; None where none is found.

    It is looked for where limits of friction are seminorms of the loads, and cases add to these in proportion.
    """
    if not isinstance(cases, Affine) or not all(group.has_convex_limits for group in system.friction):
        return None
    found = standing(system, state, factor, solutions, cases)
    programme = found.programme.with_limits(1 - _CLEAR)
    x = LoadsAtRest(programme, most=_MOST).extreme(np.zeros(len(found.unknowns.box)), first=True).x
    if x is None:
        return None
    share = np.max(programme.used(x), initial=0.0)
    still = np.zeros((1, len(system.coordinates)))
    multipliers, tau = found.unknowns.multipliers(x)[None], found.unknowns.friction(x)[None]
    margin, senses = np.array([max(1 / share - 1, 0.0) if share > 0 else np.inf]), np.zeros_like(tau)
    return Ends(margin, found.figures(x)[None], still, multipliers, tau, np.array([share]), senses, solved=1.0)
