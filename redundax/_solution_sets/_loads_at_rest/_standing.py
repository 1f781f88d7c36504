"""Equilibrium, friction and bounds of a mechanism at rest as a `Programme`.

At rest nothing accelerates, and dry friction is any within its limits:

    V^T M a = g + S^T tau = 0,   lo_j(rho) <= tau_j <= hi_j(rho),   lam = base(theta) + U tau,   rho = lam[rows]

over a case theta (`_cases`) and the friction tau. Where some slips move, these have all of their friction, and the
others do not accelerate: E_j^T a = gamma_j, a = a_0 + A tau.

Of compliances w_i between bounds the products y_i = w_i lam_i are unknowns, as N^T (W lam - d) = 0 is linear in them:

    min(w_1 lam_i, w_2 lam_i) <= y_i <= max(w_1 lam_i, w_2 lam_i),

which has the form of friction: the upper limit is convex in lam_i.
"""

from collections.abc import Sequence
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..._analysis._verdict import spectral_radius
from ..._equations._factorisation import Factorisation
from ..._equations._kinematics import slip_gamma, slip_motion
from ..._solvers._friction_problem import Law
from ..._system._state import State
from ..._system._system import AbstractSystem
from ..._tools._compilation import compiled
from .._cases import AbstractCases, Affine, Fractional
from .._solution_set import SolutionSet
from .._sticking._at_rest import drive, velocity_basis
from ._programme import Limits, Programme

_WIDER = 1 + 1e-9  # of bounds of friction, beyond rounding


class Affinely(NamedTuple):
    """y = matrix x + offset."""

    matrix: np.ndarray
    offset: np.ndarray

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return self.matrix @ x + self.offset

    def rows(self, rows: np.ndarray) -> "Affinely":
        """Some of y."""
        return Affinely(self.matrix[rows], self.offset[rows])

    def times(self, matrix: np.ndarray, offset: np.ndarray | float = 0.0) -> "Affinely":
        """matrix y + offset."""
        return Affinely(matrix @ self.matrix, matrix @ self.offset + offset)

    def plus(self, other: "Affinely") -> "Affinely":
        """The sum of both."""
        return Affinely(self.matrix + other.matrix, self.offset + other.offset)


class Unknowns(NamedTuple):
    """The unknowns x of size 1, and what they stand for.

    - `box`: least and largest x.
    - `case`: theta of `Affine` cases, z and y of `Fractional` ones.
    - `forces`: tau and the amount of each added load.
    - `friction`, `multipliers`, `acceleration`: tau, lam and a.
    """

    box: np.ndarray
    case: Affinely
    forces: Affinely
    friction: Affinely
    multipliers: Affinely
    acceleration: Affinely


class AddedLoad(NamedTuple):
    """A load of unknown amount: its forces (n,), and the largest amount. Its response is a last column of `unit`."""

    force: np.ndarray
    most: float


class _Limited(NamedTuple):
    """Quantities between limits that depend on loads, as in `Programme`."""

    bounded: Affinely
    read: Affinely
    reads: tuple[np.ndarray, ...]
    full: np.ndarray
    limits: Limits


class Standing(NamedTuple):
    """A programme, the meaning of its unknowns, the cases and whether outer bounds are proved."""

    programme: Programme
    unknowns: Unknowns
    cases: AbstractCases
    proved: bool

    def figures(self, x: np.ndarray) -> np.ndarray:
        """The case at x, in the units of the bounds."""
        found = self.unknowns.case(x)
        if not isinstance(self.cases, Fractional):
            return np.asarray(self.cases.figures(jnp.asarray(found)))
        wide = _wide(self.cases)
        products = found[self.cases.stress.shape[1] :]
        own = self.unknowns.multipliers(x)[np.asarray(self.cases.rows)[wide]]
        least, most = np.asarray(self.cases.least), np.asarray(self.cases.most)
        out = least.copy()
        out[wide] = np.clip(products / np.where(own != 0, own, 1.0), least[wide], most[wide])
        return out


def standing(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    solutions: SolutionSet,
    cases: AbstractCases,
    added: AddedLoad | None = None,
) -> Standing:
    """All that is possible at rest within bounds; `ValueError` where drivers accelerate the mechanism."""
    sizes = sizes_of(solutions, cases, _NOTHING if added is None else np.array([added.most]))
    if isinstance(cases, Affine):
        unknowns, equal, within, norm = _of_cases(cases, solutions, sizes)
        limited = []
    else:
        unknowns, equal, products = _of_compliances(cast(Fractional, cases), solutions, sizes)
        within, norm, limited = None, None, [products]
    limited = [*_friction(solutions, unknowns, sizes), *limited]
    balance, unknowns = _balance(system, state, factor, solutions, unknowns, added)
    none = Affinely(np.zeros((0, len(unknowns.box))), np.zeros(0))
    programme = Programme(
        equal=_right(balance if equal is None else _stacked([balance, equal])),
        within=_right(none if within is None else within),
        norm=tuple(none if norm is None else norm),
        box=unknowns.box,
        bounded=tuple(_stacked([none, *(part.bounded for part in limited)])),
        read=tuple(_stacked([none, *(part.read for part in limited)])),
        reads=_places(limited),
        full=np.concatenate([np.zeros(0), *(part.full for part in limited)]),
        limits=_joined(limited),
    )
    known = all(group.has_convex_limits for group in system.friction)
    return Standing(programme, unknowns, cases, known and all(reads.size <= 2 for reads in programme.reads))


class _Sizes(NamedTuple):
    """Sizes of friction, whether these are bounds, (I - Gamma)^-1 (that without friction); and what each load allows.

    - `growth`: largest change of friction by a unit of each load, shape (p, l).
    - `added`: largest amounts of added loads.
    """

    friction: np.ndarray
    bounded: bool
    growth: np.ndarray
    added: np.ndarray


_NOTHING = np.zeros(0)


def sizes_of(solutions: SolutionSet, cases: AbstractCases, added: np.ndarray = _NOTHING) -> _Sizes:
    """Sizes of friction, with added loads up to given amounts."""
    law, rows = solutions.law, np.asarray(solutions.rows)
    if law is None:
        return _Sizes(np.zeros(0), True, np.zeros((0, 0)), added)
    lower, upper = np.asarray(cases.lower), np.asarray(cases.upper)
    bases, unit = (np.asarray(x) for x in _chosen(cases, np.stack([lower, (lower + upper) / 2, upper])))
    unit = unit[:, :, : len(law.rate) + len(added)]
    limits = [np.abs(np.stack(_limits_at(law, jnp.asarray(base[rows]))[:2])).max(axis=0) for base in bases]
    slope = np.asarray(cases.slope)[rows] if isinstance(cases, Affine) else np.zeros((len(rows), 0))
    changes = np.asarray(_changes(law, jnp.asarray(np.concatenate([np.eye(len(rows)), unit[1][rows], slope], axis=1))))
    parts = np.cumsum([len(rows), len(limits[0]), len(added)])
    growth, gamma, by_added, change = np.split(changes, parts, axis=1)
    if isinstance(cases, Affine) and np.all(np.isfinite(gamma)) and spectral_radius(gamma) < 1:
        given = limits[1] + change @ np.abs(upper - lower) / 2 + by_added @ added
        friction = np.linalg.solve(np.eye(len(gamma)) - gamma, given) * _WIDER
        return _Sizes(np.where(friction > 0, friction, 1.0), True, growth, added)
    friction = np.max(limits, axis=0)
    largest = friction.max(initial=0.0) or 1.0
    return _Sizes(np.where(friction > 1e-9 * largest, friction, largest), False, growth, added)


@compiled
def _chosen(cases: AbstractCases, theta: Array) -> tuple[Array, Array]:
    return jax.vmap(cases.chosen)(theta)


@compiled
def _changes(law: Law, loads: Array) -> Array:
    return law.largest_changes(loads)


def _of_cases(cases: Affine, solutions: SolutionSet, sizes: _Sizes) -> tuple[Unknowns, None, Affinely, Affinely | None]:
    """Unknowns theta and tau, what limits multipliers say of them, and their norm."""
    lower, upper, slope, start, unit = (
        np.asarray(x, float) for x in (cases.lower, cases.upper, cases.slope, cases.start, cases.unit)
    )
    rows, least, most = (np.asarray(x) for x in (cases.rows, cases.least, cases.most))
    middle, half, ends = (lower + upper) / 2, (upper - lower) / 2, np.ones(len(lower))
    unknowns = _unknowns(solutions, middle, half, ends, sizes, (start, slope, unit))
    own = unknowns.multipliers.rows(rows)
    if cases.norm:
        return unknowns, None, _stacked([own.rows(np.zeros(0, int))]), own.times(np.diag(1 / most))
    width = np.where(most > least, most - least, 1.0)
    above = own.times(np.diag(1 / width), -most / width)
    below = own.times(np.diag(-1 / width), least / width)
    return unknowns, None, _stacked([above, below]), None


def _of_compliances(cases: Fractional, solutions: SolutionSet, sizes: _Sizes) -> tuple[Unknowns, Affinely, _Limited]:
    """Unknowns z, y and tau, N^T (W lam - d) = 0 and the limits of y."""
    stress, start, unit, rows = (np.asarray(x) for x in (cases.stress, cases.start, cases.unit, cases.rows))
    least, most, wide = np.asarray(cases.least), np.asarray(cases.most), _wide(cases)
    sized = np.concatenate([sizes.friction, sizes.added])
    ends = np.stack([cases.lower, (cases.lower + cases.upper) / 2, cases.upper])
    loads = np.max(
        [np.abs(base) + np.abs(way) @ sized for base, way in zip(*map(np.asarray, _chosen(cases, ends)), strict=True)],
        axis=0,
    )
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
    energy = unknowns.multipliers.times(stress.T @ compliance, -stress.T @ np.asarray(cases.misfit))
    equal = energy.plus(products.times(stress[rows[wide]].T))
    ratio, count = least[wide] / most[wide], len(reach)

    def limits(loads: np.ndarray) -> tuple[np.ndarray, ...]:
        up, down = np.maximum(ratio * loads, loads), np.maximum(-ratio * loads, -loads)
        return down, up, np.diag(np.where(loads > 0, -ratio, -1.0)), np.diag(np.where(loads > 0, 1.0, ratio))

    own = unknowns.multipliers.rows(rows[wide]).times(np.diag(most[wide] / reach))
    places = tuple(np.array([k]) for k in range(count))
    limited = _Limited(products.times(np.diag(1 / reach)), own, places, np.zeros(count), limits)
    return unknowns, equal, limited


def _wide(cases: Fractional) -> np.ndarray:
    """Compliances that vary and move the multipliers."""
    return np.asarray(cases.matters & (cases.most > cases.least))


def _unknowns(
    solutions: SolutionSet,
    middle: np.ndarray,
    half: np.ndarray,
    ends: np.ndarray,
    sizes: _Sizes,
    multipliers: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> Unknowns:
    """x = [case; friction], each of size 1."""
    sized = np.concatenate([sizes.friction, sizes.added])
    q, p, f = len(half), len(sizes.friction), len(sized)
    start, slope, unit = multipliers
    ends = np.concatenate([ends, np.full(p, 1.0 if sizes.bounded else np.inf), np.ones(f - p)])
    case = Affinely(np.pad(np.diag(half), ((0, 0), (0, f))), middle)
    forces = Affinely(np.pad(np.diag(sized), ((0, 0), (q, 0))), np.zeros(f))
    free, caused = (np.asarray(x.acceleration) for x in (solutions.response.free, solutions.response.unit))
    return Unknowns(
        box=np.stack([-ends, ends], axis=1),
        case=case,
        forces=forces,
        friction=forces.rows(np.arange(p)),
        multipliers=case.times(slope, start).plus(forces.times(unit)),
        acceleration=forces.times(caused, free),
    )


def _balance(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    solutions: SolutionSet,
    unknowns: Unknowns,
    added: AddedLoad | None,
) -> tuple[Affinely, Unknowns]:
    """What vanishes: all accelerations at rest, those of the slips that rest where others move."""
    rates = np.abs(np.asarray(state.qd)) * np.where(system.coordinates.angular, np.asarray(factor.length), 1.0)
    if not bool(factor.motion_of(jnp.asarray(rates.max(initial=0.0))).is_yes):
        start = drive(system, state, factor)
        still = unknowns.acceleration.times(np.zeros((len(rates), len(rates))))
        drives = start.slips.T
        if added is not None:
            drives = np.column_stack([drives, velocity_basis(system, factor).T @ added.force])
        return unknowns.forces.times(drives, start.load), unknowns._replace(acceleration=still)
    resting = np.asarray(cast(Law, solutions.law).sense == 0)
    directions, gamma = (np.asarray(x) for x in _slips(system.anonymous(), state))
    return unknowns.acceleration.times(directions[:, resting].T, -gamma[resting]), unknowns


def _friction(solutions: SolutionSet, unknowns: Unknowns, sizes: _Sizes) -> list[_Limited]:
    """The limits of friction, in sizes of it; the loads are in sizes of what they allow."""
    law = solutions.law
    if law is None:
        return []
    sizes, most = sizes.friction, sizes.growth / sizes.friction[:, None]
    scale = most.max(axis=0, initial=0.0)
    scale = np.where(scale > 0, scale, 1.0)
    loads = unknowns.multipliers.rows(np.asarray(solutions.rows)).times(np.diag(scale))
    low, high, _, _ = _limits_at(law, jnp.asarray(np.ones(len(scale)) / scale))
    fixed = np.asarray(low == high)
    full = np.where(fixed, np.where(np.asarray(high) >= 0, 1.0, -1.0), 0.0)

    def limits(loads: np.ndarray) -> tuple[np.ndarray, ...]:
        low, high, by_low, by_high = (np.asarray(x) for x in _limits_at(law, jnp.asarray(loads / scale)))
        down, up = np.where(full == 1, np.inf, -low / sizes), np.where(full == -1, np.inf, high / sizes)
        size = sizes[:, None] * scale
        return (
            down,
            up,
            np.where(full[:, None] == 1, 0.0, -by_low / size),
            np.where(full[:, None] == -1, 0.0, by_high / size),
        )

    reads = tuple(np.flatnonzero(row > 0) for row in most)
    return [_Limited(unknowns.friction.times(np.diag(1 / sizes)), loads, reads, full, limits)]


@compiled
def _slips(system: AbstractSystem, state: State) -> tuple[Array, Array]:
    return slip_motion(system, state)[1], slip_gamma(system, state)


@compiled
def _limits_at(law: Law, loads: Array) -> tuple[Array, Array, Array, Array]:
    """Least and largest friction of slips that rest, and that of those that move, and the derivatives by the loads."""

    def limits(loads: Array) -> tuple[Array, Array]:
        one, two = (
            eqx.tree_at(lambda law: law.sense, law, jnp.where(law.sense == 0, sense, law.sense))(loads)
            for sense in (1.0, -1.0)
        )
        return jnp.minimum(one, two), jnp.maximum(one, two)

    return *limits(loads), *jax.jacfwd(limits)(loads)


def _stacked(parts: Sequence[Affinely]) -> Affinely:
    return Affinely(*(np.concatenate([part[k] for part in parts]) for k in range(2)))


def _right(part: Affinely) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and right side of y = 0, or y <= 0, in rows of size 1."""
    size = np.abs(part.matrix).max(axis=1, initial=0.0)
    size = np.where(size > 0, size, 1.0)
    return part.matrix / size[:, None], -part.offset / size


def _places(parts: Sequence[_Limited]) -> tuple[np.ndarray, ...]:
    """The loads that each limit reads, among those of all parts."""
    out, first = [], 0
    for part in parts:
        out += [reads + first for reads in part.reads]
        first += len(part.read.offset)
    return tuple(out)


def _joined(parts: Sequence[_Limited]) -> Limits:
    """The limits of all parts."""
    from scipy.linalg import block_diag

    ends = np.cumsum([len(part.read.offset) for part in parts])

    def limits(loads: np.ndarray) -> tuple[np.ndarray, ...]:
        found = [part.limits(own) for part, own in zip(parts, np.split(loads, ends[:-1]), strict=True)]
        if not found:
            return np.zeros(0), np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0))
        down, up, by_down, by_up = zip(*found, strict=True)
        return np.concatenate(down), np.concatenate(up), block_diag(*by_down), block_diag(*by_up)

    return limits
