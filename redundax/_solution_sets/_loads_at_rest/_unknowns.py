"""Unknowns of a mechanism at rest: a case within bounds and friction, each of size 1.

Of compliances w_i between bounds the products y_i = w_i lam_i are unknowns, as N^T (W lam - d) = 0 is linear in them:

    min(w_1 lam_i, w_2 lam_i) <= y_i <= max(w_1 lam_i, w_2 lam_i),

which has the form of friction: the upper limit is convex in lam_i.
"""

from typing import NamedTuple, cast

import numpy as np

from .._cases import AbstractCases, Affine, Fractional
from .._solution_set import SolutionSet
from ._affine_map import AffineMap, stacked
from ._friction_limits import FrictionSizes, Limited
from ._programme import LimitValues


class Unknowns(NamedTuple):
    """The unknowns x of size 1, and what they stand for.

    - `box`: least and largest x.
    - `case`: theta of `Affine` cases, z and y of `Fractional` ones.
    - `forces`: tau and the amount of each added load.
    - `friction`, `multipliers`, `acceleration`: tau, lam and a.
    """

    box: np.ndarray
    case: AffineMap
    forces: AffineMap
    friction: AffineMap
    multipliers: AffineMap
    acceleration: AffineMap


class Bounded(NamedTuple):
    """Unknowns, and what bounds say of them: equations, inequalities (at most 0), a norm (at most 1), and limits."""

    unknowns: Unknowns
    equal: AffineMap
    within: AffineMap
    norm: AffineMap
    limited: list[Limited]


def bounded(cases: AbstractCases, solutions: SolutionSet, sizes: FrictionSizes) -> Bounded:
    """The unknowns of cases, with friction and added loads of given sizes."""
    if isinstance(cases, Affine):
        return _of_cases(cases, solutions, sizes)
    return _of_compliances(cast(Fractional, cases), solutions, sizes)


def figures_at(cases: AbstractCases, unknowns: Unknowns, x: np.ndarray) -> np.ndarray:
    """The case at x, in the units of the bounds."""
    found = unknowns.case(x)
    if not isinstance(cases, Fractional):
        return found
    wide, least, most = _wide(cases), cases.least, cases.most
    products, own = found[cases.stress.shape[1] :], unknowns.multipliers(x)[cases.rows[wide]]
    out = least.copy()
    out[wide] = np.clip(products / np.where(own != 0, own, 1.0), least[wide], most[wide])
    return out


def _of_cases(cases: Affine, solutions: SolutionSet, sizes: FrictionSizes) -> Bounded:
    """theta and tau; limits of multipliers, or their norm."""
    rows, least, most, width = cases.rows, cases.least, cases.most, cases.width
    endless = np.isinf(cases.upper)
    lower, upper = np.where(endless, [[-1.0], [1.0]] * _reach(cases, sizes), [cases.lower, cases.upper])
    middle, half, ends = (lower + upper) / 2, (upper - lower) / 2, np.where(endless, np.inf, 1.0)
    one_way = endless & np.isfinite(cases.lower)
    middle = np.where(one_way, cases.lower, middle)
    unknowns = _unknowns(solutions, middle, half, ends, sizes, (cases.start, cases.slope, cases.unit))
    unknowns.box[np.flatnonzero(one_way), 0] = 0.0
    own = unknowns.multipliers.rows(rows)
    none = own.rows(np.zeros(0, int))
    if cases.norm:
        return Bounded(unknowns, none, none, own.over(most), [])
    above, below = (own.times(np.diag(sign / width), -sign * end / width) for sign, end in ((1, most), (-1, least)))
    return Bounded(unknowns, none, stacked([above, below]), none, [])


def _reach(cases: Affine, sizes: FrictionSizes) -> np.ndarray:
    """The size of a case that changes multipliers by as much as there is."""
    loads = np.abs(cases.start) + np.abs(cases.unit) @ np.concatenate([sizes.friction, sizes.added])
    reach = np.abs(np.linalg.pinv(cases.slope)) @ loads
    return np.where(reach > 0, reach, 1.0)


def _of_compliances(cases: Fractional, solutions: SolutionSet, sizes: FrictionSizes) -> Bounded:
    """z, y and tau; N^T (W lam - d) = 0 and the limits of y."""
    stress, start, unit, rows = cases.stress, cases.start, cases.unit, cases.rows
    least, most, wide = cases.least, cases.most, _wide(cases)
    sized = np.concatenate([sizes.friction, sizes.added])
    bases, ways = cases.chosen(np.stack([cases.lower, cases.upper]))
    loads = np.max(np.abs(bases) + np.abs(ways) @ sized, axis=0)
    amplitude = np.abs(np.linalg.pinv(stress)) @ (loads + np.abs(start) + np.abs(unit) @ sized)
    amplitude = np.where(amplitude > 0, amplitude, 1.0)
    reach = np.where(loads > 1e-9 * loads.max(initial=0.0), loads, 1.0)[rows[wide]] * most[wide]
    case_size = np.concatenate([amplitude, reach])
    slope = np.concatenate([stress, np.zeros((len(stress), len(reach)))], axis=1)
    ends = np.full(len(case_size), np.inf)
    unknowns = _unknowns(solutions, np.zeros(len(case_size)), case_size, ends, sizes, (start, slope, unit))
    compliance = np.array(cases.compliance)
    compliance[rows[~wide], rows[~wide]] += least[~wide]
    products = unknowns.case.rows(np.arange(stress.shape[1], len(case_size)))
    energy = unknowns.multipliers.times(stress.T @ compliance, -stress.T @ cases.misfit)
    equal = energy.plus(products.times(stress[rows[wide]].T))
    ratio, count = least[wide] / most[wide], len(reach)

    def limits(loads: np.ndarray) -> LimitValues:
        up, down = np.maximum(ratio * loads, loads), np.maximum(-ratio * loads, -loads)
        slopes = np.where(loads > 0, -ratio, -1.0), np.where(loads > 0, 1.0, ratio)
        return LimitValues(down, up, *(slope[..., None] * np.eye(count) for slope in slopes))

    own = unknowns.multipliers.rows(rows[wide]).over(reach / most[wide])
    places = tuple(np.array([k]) for k in range(count))
    none = equal.rows(np.zeros(0, int))
    return Bounded(unknowns, equal, none, none, [Limited(products.over(reach), own, places, np.zeros(count), limits)])


def _wide(cases: Fractional) -> np.ndarray:
    """Compliances that vary and move the multipliers."""
    return cases.matters & (cases.most > cases.least)


def _unknowns(
    solutions: SolutionSet,
    middle: np.ndarray,
    half: np.ndarray,
    ends: np.ndarray,
    sizes: FrictionSizes,
    multipliers: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> Unknowns:
    """x = [case; friction], each of size 1."""
    sized = np.concatenate([sizes.friction, sizes.added])
    q, p, f = len(half), len(sizes.friction), len(sized)
    start, slope, unit = multipliers
    ends = np.concatenate([ends, np.full(p, 1.0 if sizes.bounded else np.inf), np.ones(f - p)])
    case = AffineMap(np.pad(np.diag(half), ((0, 0), (0, f))), middle)
    forces = AffineMap(np.pad(np.diag(sized), ((0, 0), (q, 0))), np.zeros(f))
    free, caused = solutions.response.free.acceleration, solutions.response.unit.acceleration
    return Unknowns(
        box=np.stack([-ends, ends], axis=1),
        case=case,
        forces=forces,
        friction=forces.rows(np.arange(p)),
        multipliers=case.times(slope, start).plus(forces.times(unit)),
        acceleration=forces.times(caused, free),
    )
