"""Limits of friction at rest as functions of the loads, and bounds of friction.

    |tau| <= (I - Gamma)^-1 (largest |limit| at the loads without friction),   Gamma_ij = max |d limit_i / d tau_j|

where the spectral radius of Gamma is well below 1, as no limit grows by more than Gamma |tau|.
"""

from typing import NamedTuple

import numpy as np

from ..._analysis._verdict import spectral_radius
from ..._solvers._friction_problem import Law
from ..._system._directions import directions_of
from ..._system._friction import have_sense
from ..._tools._module import replace_fields
from .._cases import AbstractCases, Affine
from .._solution_set import SolutionSet
from ._affine_map import AffineMap
from ._programme import Limits, LimitValues

_NOTHING = np.zeros(0)
_WIDER = 1 + 1e-9  # of bounds of friction, beyond rounding
_NONE = 1e-9  # size of friction that says nothing, relative to the largest
_NEAR_ONE = 0.99  # radius of Gamma from which bounds are so wide that programmes in sizes of them lose two digits


class Limited(NamedTuple):
    """Quantities between limits that depend on loads, as in `Programme`."""

    bounded: AffineMap
    read: AffineMap
    reads: tuple[np.ndarray, ...]
    full: np.ndarray
    limits: Limits
    balls: tuple[list[int], ...] = ()


class FrictionSizes(NamedTuple):
    """Sizes of friction, whether these are bounds, (I - Gamma)^-1 (that without friction); and what each load allows.

    - `friction`: of slips that share one, that of the arms of the largest.
    - `growth`: largest change of friction by a unit of each load, shape (p, l).
    - `added`: largest amounts of added loads.
    """

    friction: np.ndarray
    bounded: bool
    growth: np.ndarray
    added: np.ndarray


def sizes_of(solutions: SolutionSet, cases: AbstractCases, added: np.ndarray = _NOTHING) -> FrictionSizes:
    """Sizes of friction, with added loads up to given amounts."""
    law, rows = solutions.law, np.asarray(solutions.rows)
    if law is None:
        return FrictionSizes(np.zeros(0), True, np.zeros((0, 0)), added)
    endless = np.isinf(cases.upper)
    lower, upper = (np.where(endless, 0.0, end) for end in (cases.lower, cases.upper))
    bases, unit = cases.chosen(np.stack([lower, (lower + upper) / 2, upper]))
    unit = (unit if unit.ndim == 2 else unit[1])[rows, : len(law.rate) + len(added)]
    ways = _Ways.of(law)
    limits = [np.abs(np.stack(ways.limits(base[rows])[:2])).max(axis=0) for base in bases]
    slope = cases.slope[rows] if isinstance(cases, Affine) else np.zeros((len(rows), 0))
    changes = law.largest_changes(np.concatenate([np.eye(len(rows)), unit, slope], axis=1))
    parts = np.cumsum([len(rows), len(limits[0]), len(added)])
    growth, gamma, by_added, change = np.split(changes, parts, axis=1)
    known = isinstance(cases, Affine) and not endless.any() and np.all(np.isfinite(gamma))
    if known and spectral_radius(gamma) < _NEAR_ONE:
        given = limits[1] + change @ np.abs(upper - lower) / 2 + by_added @ added
        friction = np.linalg.solve(np.eye(len(gamma)) - gamma, given) * _WIDER
        return FrictionSizes(_shared(law, np.where(friction > 0, friction, 1.0)), True, growth, added)
    friction = np.max(limits, axis=0)
    largest = friction.max(initial=0.0) or 1.0
    friction = np.where(friction > _NONE * largest, friction, largest)
    return FrictionSizes(_shared(law, friction), False, growth, added)


def _shared(law: Law, sizes: np.ndarray) -> np.ndarray:
    """Sizes that are those of one force of the surfaces where slips share one friction."""
    directions = directions_of(law.groups)
    if directions is None:
        return sizes
    arms = np.asarray(directions.arms)
    return arms * np.max(np.where(directions.same, sizes / arms, 0.0), axis=1)


def friction_limits(
    solutions: SolutionSet, friction: AffineMap, multipliers: AffineMap, sizes: FrictionSizes
) -> list[Limited]:
    """The limits of friction, in sizes of it; the loads are in sizes of what they allow."""
    law = solutions.law
    if law is None:
        return []
    whole, most = sizes.friction, sizes.growth / sizes.friction[:, None]
    scale = most.max(axis=0, initial=0.0)
    scale = np.where((scale > 0) & np.isfinite(scale), scale, 1.0)  # infinite where no bound of a law is known
    read = multipliers.rows(np.asarray(solutions.rows)).over(1 / scale)
    ways = _Ways.of(law)
    high = ways.limits(1 / scale)[1]
    fixed = ~law.is_open | ~np.array(have_sense(law.groups))
    full = np.where(fixed, np.where(high >= 0, 1.0, -1.0), 0.0)

    def limits(loads: np.ndarray) -> LimitValues:
        low, high, by_low, by_high = ways.limits(loads / scale)
        size, below, above = whole[:, None] * scale, full[:, None] == 1, full[:, None] == -1
        return LimitValues(
            np.where(full == 1, np.inf, -low / whole),
            np.where(full == -1, np.inf, high / whole),
            np.where(below, 0.0, -by_low / size),
            np.where(above, 0.0, by_high / size),
        )

    reads = tuple(np.flatnonzero(row > 0) for row in most)
    directions = directions_of(law.groups)
    joints = [] if directions is None else [joint for joint in directions.joints if not fixed[joint[0]]]
    return [Limited(friction.over(whole), read, reads, full, limits, tuple(map(list, joints)))]


class _Ways(NamedTuple):
    """A law whose slips at rest have all of their friction one way, and the other; and the part of it in each slip.

    `Law.limits` of slips that share one friction are those of equal parts.
    """

    one: Law
    two: Law
    parts: np.ndarray

    @classmethod
    def of(cls, law: Law) -> "_Ways":
        parts, directions, is_open = np.ones(law.rate.shape), directions_of(law.groups), law.is_open
        if directions is not None:
            parts = np.where(is_open, np.sqrt(np.sum(directions.same, axis=1)), 1.0)
        one, two = (replace_fields(law, sense=np.where(is_open, sense, law.sense)) for sense in (1.0, -1.0))
        return cls(one, two, parts)

    def limits(self, loads: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Least and largest friction of slips that rest, that of those that move, and the derivatives by the loads."""
        (one, by_one), (two, by_two) = (way.linearised(loads) for way in self[:2])
        share = np.where(one == two, 0.5, one < two)[..., None]  # of corners the middle, as of a minimum
        slopes = share * by_one + (1 - share) * by_two, share * by_two + (1 - share) * by_one
        least, most = self.parts * np.minimum(one, two), self.parts * np.maximum(one, two)
        return least, most, *(self.parts[:, None] * slope for slope in slopes)
