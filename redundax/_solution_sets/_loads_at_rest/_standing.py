"""Equilibrium, friction and bounds of a mechanism at rest as a `Programme`.

At rest nothing accelerates, and dry friction is any within its limits:

    V^T M a = g + S^T tau = 0,   lo_j(rho) <= tau_j <= hi_j(rho),   lam = base(theta) + U tau,   rho = lam[rows]

over a case theta (`_cases`) and the friction tau. Where some slips move, these have all of their friction, and the
others do not accelerate: E_j^T a = gamma_j, a = a_0 + A tau.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..._equations._factorisation import Factorisation
from ..._equations._kinematics import slip_gamma, slip_motion
from ..._system._friction import have_sense
from ..._system._state import State
from ..._system._system import AbstractSystem
from .._at_rest import ReducedForce, drive, is_still
from .._cases import AbstractCases
from .._solution_set import SolutionSet
from ._affine_map import AffineMap, stacked
from ._friction_limits import Limited, friction_limits, sizes_of
from ._programme import Limits, LimitValues, Programme
from ._unknowns import Unknowns, bounded, figures_at


class AddedLoad(NamedTuple):
    """A load of unknown amount: V^T b beside the start without it, and the largest amount.

    Its response is a last column of `unit`.
    """

    start: ReducedForce
    drive: np.ndarray
    most: float


class Standing(NamedTuple):
    """A programme, the meaning of its unknowns, the cases and whether outer bounds are proved."""

    programme: Programme
    unknowns: Unknowns
    cases: AbstractCases
    proved: bool

    def figures(self, x: np.ndarray) -> np.ndarray:
        """The case at x, in the units of the bounds."""
        return figures_at(self.cases, self.unknowns, x)


def standing(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    solutions: SolutionSet,
    cases: AbstractCases,
    added: AddedLoad | None = None,
) -> Standing:
    """All that is possible at rest within bounds; `ValueError` where drivers accelerate the mechanism."""
    sizes = sizes_of(solutions, cases, np.zeros(0) if added is None else np.array([added.most]))
    found = bounded(cases, solutions, sizes)
    balance, unknowns = _balance(system, state, factor, solutions, found.unknowns, added)
    limited = [*friction_limits(solutions, unknowns.friction, unknowns.multipliers, sizes), *found.limited]
    none, pushes = found.equal.rows(np.zeros(0, int)), unknowns.multipliers.rows(np.array(solutions.pushing, int))
    programme = Programme(
        equal=_right(stacked([balance, found.equal])),
        within=_right(stacked([found.within, pushes.times(-np.eye(len(solutions.pushing)))])),
        norm=found.norm,
        box=unknowns.box,
        bounded=stacked([none, *(part.bounded for part in limited)]),
        read=stacked([none, *(part.read for part in limited)]),
        reads=_places(limited),
        full=np.concatenate([np.zeros(0), *(part.full for part in limited)]),
        limits=_joined(limited),
        balls=_balls(limited),
    )
    return Standing(programme, unknowns, cases, all(group.has_convex_limits for group in system.friction))


def _balance(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    solutions: SolutionSet,
    unknowns: Unknowns,
    added: AddedLoad | None,
) -> tuple[AffineMap, Unknowns]:
    """What vanishes: all accelerations at rest, those of the slips that rest where others move, or nothing."""
    law = solutions.law
    if law is None and added is None:
        return unknowns.acceleration.rows(np.zeros(0, int)), unknowns
    if is_still(system, state, factor) and (law is None or np.all(law.is_open)):
        start = drive(system, state, factor) if added is None else added.start
        n = len(system.coordinates)
        still = unknowns.acceleration.times(np.zeros((n, n)))
        drives = start.slips.T
        if added is not None:
            drives = np.column_stack([drives, added.drive])
        return unknowns.forces.times(drives, start.load), unknowns._replace(acceleration=still)
    resting = np.array(have_sense(system.friction))
    resting = resting & law.is_open if law is not None else resting
    directions, gamma = slip_motion(system.anonymous, state)[1], slip_gamma(system.anonymous, state)
    return unknowns.acceleration.times(directions[:, resting].T, -gamma[resting]), unknowns


def _right(part: AffineMap) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and right side of y = 0, or y <= 0, in rows of size 1."""
    size = np.abs(part.matrix).max(axis=1, initial=0.0)
    size = np.where(size > 0, size, 1.0)
    return part.matrix / size[:, None], -part.offset / size


def _places(parts: Sequence[Limited]) -> tuple[np.ndarray, ...]:
    """The loads that each limit reads, among those of all parts."""
    out, first = [], 0
    for part in parts:
        out += [reads + first for reads in part.reads]
        first += len(part.read.offset)
    return tuple(out)


def _balls(parts: Sequence[Limited]) -> tuple[list[int], ...]:
    """Those of all parts, among the quantities of all."""
    starts = itertools.accumulate((len(part.full) for part in parts), initial=0)
    return tuple([start + k for k in ball] for part, start in zip(parts, starts, strict=False) for ball in part.balls)


def _joined(parts: Sequence[Limited]) -> Limits:
    """The limits of all parts."""
    columns = list(itertools.accumulate((len(part.read.offset) for part in parts), initial=0))
    rows = list(itertools.accumulate((len(part.full) for part in parts), initial=0))

    def limits(loads: np.ndarray) -> LimitValues:
        shape = *loads.shape[:-1], rows[-1]
        out = LimitValues(*(np.zeros(shape) for _ in range(2)), *(np.zeros((*shape, columns[-1])) for _ in range(2)))
        for part, row, column in zip(parts, itertools.pairwise(rows), itertools.pairwise(columns), strict=True):
            own = part.limits(loads[..., slice(*column)])
            for whole, found in zip(out[:2], own[:2], strict=True):
                whole[..., slice(*row)] = found
            for whole, found in zip(out[2:], own[2:], strict=True):
                whole[..., slice(*row), slice(*column)] = found
        return out

    return limits
