"""What is known of preload, misfit or compliance, as bounds that `band` takes.

    amplitude    lam = lam_MP + N z,                          z in a box
    preload      lam in a box, or in an ellipsoid sum (lam_i / a_i)^2 <= 1
    misfit       N^T W lam = N^T d,                           d in a box, W given
    compliance   N^T W lam = N^T d,                           diagonal entries of W in a box, d given

Bounds are given by name: {"A.x": (lower, upper)}.
"""

import abc
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import numpy as np

from .._analysis._report import Report
from .._closures._closure import AbstractClosure, check_closure, elasticity
from .._closures._play import round_rows
from .._system._names import by_joint, index_of
from .._system._results import RESULTS
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._module import check_kind
from .._tools._numbers import Numeric, entries_set, or_one
from .._tools._value import AbstractModule
from ._cases import AbstractCases, Affine, Fractional
from ._solution_set import SolutionSet

T = TypeVar("T")

Box = Mapping[str, tuple[float, float]]
_NARROWEST = 1e-3  # width of bounds over the widest, below which it tells no more which rows are chosen
_ONE_BY_ONE = 4  # entries of a case, above which those of equal bounds are told together


class Disc(NamedTuple):
    """Two misfits in a disc, by their places among those that are bounded."""

    places: np.ndarray
    centre: np.ndarray
    radius: float


class Misfits(NamedTuple):
    """Rows whose misfit is bounded, the least and the largest of each, (q, 2), and which are in discs within these."""

    rows: np.ndarray
    box: np.ndarray
    discs: tuple[Disc, ...]


class Parameters(NamedTuple):
    """What varies of cases that are told by no `AbstractCases`, and between what, (q, 2)."""

    names: tuple[str, ...]
    box: np.ndarray


def title_of(bounds: "AbstractBounds | AbstractClosure", cases: AbstractCases | Parameters) -> str:
    """What was bounded: all that was given, of which some is the box of the cases and all else limits them."""
    if isinstance(bounds, Pushing):
        return "Contacts push, and no more is known of the loads"
    if isinstance(bounds, PreloadBox):
        return _in_words(type(bounds).__name__, [*bounds.box], np.array([*bounds.box.values()]))
    if isinstance(bounds, PreloadNorm):
        ends = np.array([*bounds.sizes.values()])
        return _in_words(type(bounds).__name__, [*bounds.sizes], np.stack([-ends, ends], axis=1))
    rubbing, round_ = (bounds.friction, bounds.radial) if isinstance(bounds, MisfitBox) else ({}, {})
    parts = {
        name: ends
        for name, ends in zip(cases.names, cases.box, strict=True)
        if name.rpartition(".")[0] not in round_ or name in getattr(bounds, "box", {})
    }
    parts |= {f"friction {name}": ends for name, ends in rubbing.items()}
    parts |= {f"radial {name}": (0.0, size) for name, size in round_.items()}
    return _in_words(type(bounds).__name__, [*parts], np.array([*parts.values()]).reshape(-1, 2))


def parts_of(bounds: "AbstractBounds | AbstractClosure") -> tuple[AbstractClosure | None, Box]:
    """The closure, if there is one, and bounds of friction."""
    if isinstance(bounds, AbstractClosure):
        return bounds, {}
    return getattr(bounds, "closure", None), bounds.friction if isinstance(bounds, MisfitBox) else {}


def misfits_of(bounds: "AbstractClosure | MisfitBox", labels: tuple[str, ...], own: Numeric) -> Misfits:
    """What is bounded of misfits, given those of the closure; of a closure nothing."""
    if isinstance(bounds, AbstractClosure):
        return Misfits(np.zeros(0, int), np.zeros((0, 2)), ())
    return bounds.misfits(labels, own)


def _in_words(bounds: str, parameters: Sequence[str], box: np.ndarray) -> str:
    """The name of their class, and the bounds of each of some quantities, (q, 2); many by equal bounds."""
    ranges = [f"{low:.4g} to {high:.4g}" for low, high in box]
    if len(ranges) <= _ONE_BY_ONE:
        parts = [f"{name} {within}" for name, within in zip(parameters, ranges, strict=True)]
        return f"{bounds}{': ' if parts else ''}{', '.join(parts)}"
    alike = {within: [] for within in ranges}
    for name, within in zip(parameters, ranges, strict=True):
        alike[within].append(name)
    return "\n  ".join([f"{bounds}:", *(f"{within}: {by_joint(names)}" for within, names in alike.items())])


def _by_name(argument: str, example: str, what: str, read: Callable[[Any], T]) -> Callable[..., Mapping[str, T]]:
    """What reads the values of an argument that has one for each name, and says `what` these must be."""

    def values(given: Any) -> Mapping[str, T]:
        try:
            return {name: read(value) for name, value in given.items()}
        except (AttributeError, TypeError, ValueError) as error:
            raise RedundaxError(
                f"Argument `{argument}` must give {what} by name, but is {given!r}. Write {example}, say."
            ) from error

    return values


def _pairs(argument: str = "box", example: str = '{"A.x": (-40.0, 40.0)}') -> Callable[..., Box]:
    def read(ends: Any) -> tuple[float, float]:
        lower, upper = ends
        return float(lower), float(upper)

    return _by_name(argument, example, "the least and the largest value", read)


def _numbers(argument: str = "sizes", example: str = '{"A.x": 40.0}') -> Callable[..., Mapping[str, float]]:
    return _by_name(argument, example, "a number", float)


class AbstractBounds(AbstractModule):
    """What is known of the loads that the equations leave open."""

    @abc.abstractmethod
    def cases(self, system: AbstractSystem, state: State, report: Report, solutions: SolutionSet) -> AbstractCases:
        """All cases within the bounds."""


class Pushing(AbstractBounds):
    """No bounds but that contacts push."""

    def cases(self, system: AbstractSystem, state: State, report: Report, solutions: SolutionSet) -> Affine:
        ends = np.full(len(report.pivots), np.inf)
        return _affine(report.pivots, -ends, ends, solutions, solutions.response.free.multipliers, solutions.stress)


class AmplitudeBox(AbstractBounds):
    """Bounds on the self-stress, as an amount beside the minimum norm.

    ??? example

        ```python
        bounds = rx.AmplitudeBox({"A.x": (-40.0, 40.0)})  # N
        rx.band(mechanism, state, "B.x", bounds)
        ```

    **Arguments:**

    - `box`: for self-stress states, by the multiplier that has the entry 1 in them (`analyze(...).pivots`), least and
      largest amplitude in units of that multiplier; states without an entry have amplitude 0.
    """

    box: Box = eqx.field(static=True, converter=_pairs())

    def cases(self, system: AbstractSystem, state: State, report: Report, solutions: SolutionSet) -> Affine:
        places, lower, upper = _box("box", self.box, report.pivots)
        slope = solutions.stress[:, places]
        return _affine(tuple(self.box), lower, upper, solutions, solutions.response.free.multipliers, slope)


class PreloadBox(AbstractBounds):
    """Bounds on multipliers, as from preload, measurement or what a joint can carry.

    ??? example

        ```python
        bounds = rx.PreloadBox({"A.x": (-60.0, 0.0)})  # N
        rx.band(mechanism, state, "B.x", bounds)
        ```

    **Arguments:**

    - `box`: for rows, least and largest multiplier, in its units; the others have no bounds. Together they must bound
      every self-stress state.
    """

    box: Box = eqx.field(static=True, converter=_pairs())

    def cases(self, system: AbstractSystem, state: State, report: Report, solutions: SolutionSet) -> Affine:
        rows, lower, upper = _box("box", self.box, report.rows)
        return _by_pivots(report, solutions, rows, lower, upper, norm=False)


class PreloadNorm(AbstractBounds):
    """A bound on a norm of multipliers, sum (lam_i / size_i)^2 <= 1.

    ??? example

        ```python
        bounds = rx.PreloadNorm({"K.angle": 20.0, "L.angle": 20.0})  # N m
        rx.band(mechanism, state, "A.x", bounds, samples=32)
        ```

    **Arguments:**

    - `sizes`: for rows, the size of the multiplier, in its units, so that forces and moments can be compared. Together
      they must bound every self-stress state.
    """

    sizes: Mapping[str, float] = eqx.field(static=True, converter=_numbers())

    def __check_init__(self) -> None:
        for name, size in self.sizes.items():
            if not 0 < size < np.inf:
                raise RedundaxError(
                    f"Argument `sizes` must hold finite sizes above 0, but that of {name} is {size}. Give a size, or "
                    "bound a load that is known by a `PreloadBox`."
                )

    def cases(self, system: AbstractSystem, state: State, report: Report, solutions: SolutionSet) -> Affine:
        box = {name: (-size, size) for name, size in self.sizes.items()}
        rows, lower, upper = _box("sizes", box, report.rows)
        return _by_pivots(report, solutions, rows, lower, upper, norm=True)


class MisfitBox(AbstractBounds):
    """Bounds on the misfit of joints of given compliance.

    ??? example

        ```python
        bounds = rx.MisfitBox(rx.Compliance(W=jnp.full(12, 1e-8)), {"A.x": (-1e-6, 1e-6)})  # m
        rx.band(mechanism, state, "A.x", bounds, samples=32)
        ```

    **Arguments:**

    - `closure`: the compliance, and the misfit of rows without an entry in `box`. Play of its joints is a bound too:
      from none to as much.
    - `box`: for rows, least and largest misfit, m for force-type and rad for moment-type rows; none if not given.
    - `friction`: for joints, by name, the least and the largest multiple of the friction that their models give:
      {"K": (0.5, 2.0)} where a coefficient of 0.1 may be from 0.05 to 0.2.
    - `radial`: for pins and sleeves, by name, how far the middle of a hole may be off, m, to any side: their misfit is
      in a disc about that of the closure. Of `band` and `band_along` where joints have no friction.
    """

    closure: AbstractClosure
    box: Box = eqx.field(static=True, converter=_pairs(), default_factory=dict)
    friction: Box = eqx.field(static=True, converter=_pairs("friction", '{"K": (0.5, 2.0)}'), default_factory=dict)
    radial: Mapping[str, float] = eqx.field(
        static=True, converter=_numbers("radial", '{"A": 20e-6}'), default_factory=dict
    )

    def __check_init__(self) -> None:
        check_closure(self.closure)
        for name, size in self.radial.items():
            if not 0 <= size < np.inf:
                raise RedundaxError(
                    f"Argument `radial` must hold finite lengths of at least 0, but that of {name} is {size}. Give how "
                    "far it may be off to any side."
                )
        for name, (least, most) in self.friction.items():
            if not 0 <= least <= most < np.inf:
                raise RedundaxError(
                    "Argument `friction` must hold finite multiples (least, largest) of at least 0, but that of "
                    f'{name} is {(least, most)}. Write {{"K": (0.5, 2.0)}}, say.'
                )

    @property
    def of_misfits(self) -> "MisfitBox | AbstractClosure":
        """The same without limits of friction."""
        if not self.friction:
            return self
        return MisfitBox(self.closure, self.box, radial=self.radial) if self.box or self.radial else self.closure

    def misfits(self, labels: tuple[str, ...], own: Numeric) -> "Misfits":
        """What is bounded of the misfits of all rows, given those of the closure."""
        rows, box, discs = np.zeros(0, int), np.zeros((0, 2)), list[Disc]()
        if self.box or not (self.friction or self.radial):
            rows, lower, upper = _box("box", self.box, labels)
            box = np.stack([lower, upper], axis=1)
        for name, size in self.radial.items():
            both = round_rows(labels, name)
            if not both or set(both) & set(rows):
                raise RedundaxError(
                    f"Argument `radial` must name pins and sleeves that `box` does not bound, but names {name}. Bound "
                    "rows of other joints by `box`."
                )
            centre = np.asarray(own)[list(both)]
            discs += [Disc(np.arange(2) + len(rows), centre, size)]
            rows, box = np.r_[rows, both], np.r_[box, centre[:, None] + [[-size, size]] * 2]
        return Misfits(rows, box, tuple(discs))

    def cases(self, system: AbstractSystem, state: State, report: Report, solutions: SolutionSet) -> Affine:
        if self.radial:
            raise RedundaxError(
                "Argument `bounds` must hold no `radial`, except in `band` and `band_along` where joints have no "
                "friction. Bound the rows one by one, by `box`: as much to either side holds all of the disc."
            )
        if self.friction:
            raise RedundaxError(
                "Argument `bounds` must hold no `friction`, except in `band` and `band_along`. Set it in the joints."
            )
        rows, lower, upper = _box("box", self.box, report.rows)
        start, response, unit = closed_by(self.closure, system, state, solutions, rows)
        return _affine(tuple(self.box), lower, upper, solutions, start, response, unit)


class ComplianceBox(AbstractBounds):
    """Bounds on the compliance of rows; ranges over decades are searched evenly by their logarithm.

    ??? example

        ```python
        bounds = rx.ComplianceBox(rx.Compliance(W=jnp.full(12, 1e-8)), {"A.x": (1e-9, 1e-7)})  # m/N
        rx.band(mechanism, state, "A.x", bounds, samples=32)
        ```

    **Arguments:**

    - `closure`: the misfit, and the compliance of rows without an entry in `box`.
    - `box`: for rows, least and largest diagonal entry of W, m/N for force-type and rad/(N m) for moment-type rows.
    """

    closure: AbstractClosure
    box: Box = eqx.field(static=True, converter=_pairs())

    def __check_init__(self) -> None:
        check_closure(self.closure)

    def cases(self, system: AbstractSystem, state: State, report: Report, solutions: SolutionSet) -> Fractional:
        rows, lower, upper = _box("box", self.box, report.rows)
        if lower.min(initial=0.0) < 0:
            raise RedundaxError(
                f"Argument `box` must not hold negative compliances, but holds {lower.min():.4g}. Give at least 0."
            )
        compliance, misfit = elasticity(self.closure, system, state)
        _check_apart(compliance, solutions)
        compliance = entries_set(compliance, (rows, rows), 0.0)
        least = entries_set(compliance, (rows, rows), lower)
        check_definite(solutions.stress.T @ least @ solutions.stress)
        return Fractional(
            tuple(self.box),
            np.zeros(len(rows)),
            1.0 * (upper > lower),
            lower,
            upper,
            solutions.response.free.multipliers,
            solutions.response.unit.multipliers,
            solutions.stress,
            compliance,
            np.broadcast_to(misfit, compliance.shape[:1]),
            rows,
        )


def checked_bounds(
    bounds: Any, system: AbstractSystem, otherwise: AbstractClosure | None = None
) -> AbstractBounds | AbstractClosure:
    """Bounds that are some; that contacts push where there are some and nothing else is given."""
    if bounds is None:
        bounds = Pushing() if system.names.one_sided else otherwise
    check_bounds(bounds)
    return bounds


def check_bounds(bounds: object) -> None:
    """Refuse what is neither bounds nor a closure."""
    advice = 'Give `rx.PreloadBox({"A.x": (-40.0, 40.0)})` or other bounds, or a closure for the loads that it picks.'
    check_kind("bounds", bounds, AbstractBounds | AbstractClosure, "bounds or a closure", advice)


def cases_of(
    bounds: AbstractBounds | AbstractClosure,
    system: AbstractSystem,
    state: State,
    report: Report,
    solutions: SolutionSet,
) -> AbstractCases:
    """All cases within bounds, or the one that a closure picks."""
    if isinstance(bounds, AbstractClosure):
        return one_case(bounds, system, state, solutions)
    return bounds.cases(system, state, report, solutions)


def one_case(closure: AbstractClosure, system: AbstractSystem, state: State, solutions: SolutionSet) -> Affine:
    """The one case that a closure picks."""
    nothing = np.zeros(0)
    start, response, unit = closed_by(closure, system, state, solutions, nothing.astype(int))
    return _affine((), nothing, nothing, solutions, start, response, unit)


def closed_by(
    closure: AbstractClosure, system: AbstractSystem, state: State, solutions: SolutionSet, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Multipliers without friction, by misfits of `rows`, else left out, and by friction under a closure."""
    compliance, misfit = elasticity(closure, system, state)
    _check_apart(compliance, solutions)
    if not (np.all(np.isfinite(compliance)) and np.all(np.isfinite(misfit))):
        raise NoSolutionError(RESULTS[RESULTS.not_finite])
    stress, free, unit = solutions.stress, solutions.response.free.multipliers, solutions.response.unit.multipliers
    energy = stress.T @ compliance @ stress
    check_definite(energy)
    each, others = np.eye(len(free))[:, rows], entries_set(np.broadcast_to(misfit, free.shape), rows, 0.0)
    wanted = np.concatenate([(others - compliance @ free)[:, None], each, -compliance @ unit], axis=1)
    caused = stress @ np.linalg.solve(energy, stress.T @ wanted)
    return free + caused[:, 0], caused[:, 1 : 1 + len(rows)], unit + caused[:, 1 + len(rows) :]


def _box(argument: str, box: Box, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Indices among the names, lower and upper bounds."""
    if not names:
        raise RedundaxError(
            f"Argument `{argument}` must bound self-stress, but there is none: no constraint is redundant here, and "
            "joint loads are unique without bounds. Use `rx.solve`."
        )
    if not box:
        raise RedundaxError(
            f"Argument `{argument}` must have keys among {', '.join(names) or 'none'}, but has none. Add one."
        )
    found = [index_of(argument, name, names) for name in box]
    values = np.array(list(box.values()))
    right = (values[:, 0] <= values[:, 1]) & np.isfinite(values).all(axis=1)
    if not right.all():
        wrong = ", ".join(name for name, good in zip(box, right, strict=True) if not good)
        raise RedundaxError(
            f"Argument `{argument}` must hold finite bounds (lower, upper) that increase, but those of {wrong} do not. "
            "Put the smaller one first."
        )
    return np.array(found), values[:, 0], values[:, 1]


def _affine(
    names: tuple[str, ...],
    lower: np.ndarray,
    upper: np.ndarray,
    solutions: SolutionSet,
    start: np.ndarray,
    slope: np.ndarray,
    unit: np.ndarray | None = None,
) -> Affine:
    nothing = np.zeros(0)
    unit = solutions.response.unit.multipliers if unit is None else unit
    return Affine(names, lower, upper, start, slope, unit, nothing.astype(int), nothing, nothing)


def _by_pivots(
    report: Report, solutions: SolutionSet, rows: np.ndarray, lower: np.ndarray, upper: np.ndarray, *, norm: bool
) -> Affine:
    """Cases by the multipliers of k rows that the self-stress reaches independently, those with the narrowest bounds.

    lam = lam_p + T (theta - lam_p[rows]),   T = N N[rows]^-1.
    """
    _check_given(report, rows, solutions)
    stress, free, unit = solutions.stress, solutions.response.free.multipliers, solutions.response.unit.multipliers
    width = upper - lower
    width = np.maximum(width, _NARROWEST * width.max(initial=0.0) or 1.0)
    chosen = _independent(stress[rows] / width[:, None])
    if len(chosen) < stress.shape[1]:
        each = stress / np.linalg.norm(stress, axis=0)
        left = each @ np.linalg.svd(each[rows[chosen]])[2][len(chosen) :].T
        raise RedundaxError(
            "Argument `bounds` must bound every self-stress state, but the rows given leave "
            f"{left.shape[1]} of {stress.shape[1]} without bounds. "
            f"Add bounds of {', '.join(report.rows[row] for row in _independent(left))}, say."
        )
    pivots, others = rows[chosen], np.setdiff1d(np.arange(len(rows)), [] if norm else chosen)
    move = stress @ np.linalg.inv(stress[pivots]) if len(pivots) else stress
    names = tuple(report.rows[row] for row in pivots)
    limits = rows[others], lower[others], upper[others]
    start, unit = free - move @ free[pivots], unit - move @ unit[pivots]
    return Affine(names, lower[chosen], upper[chosen], start, move, unit, *limits, norm=norm)


def _check_given(report: Report, rows: np.ndarray, solutions: SolutionSet) -> None:
    """Refuse bounds on multipliers that have no value at a singular position."""
    none = [report.rows[row] for row in rows if solutions.undetermined is not None and solutions.undetermined[row]]
    if none:
        raise RedundaxError(
            f"Argument `bounds` must bound multipliers that have a value, but at this singular position {none} have "
            "none. Leave them out, or move the state."
        )


def _check_apart(compliance: Numeric, solutions: SolutionSet) -> None:
    """Refuse a compliance that couples self-stress with multipliers that have no value at a singular position."""
    if solutions.undetermined is None:
        return
    lost = solutions.undetermined
    lasting = np.any(solutions.stress != 0, axis=1) & ~lost
    if np.any(compliance[np.ix_(lasting, lost)]):
        raise RedundaxError(
            "Argument `bounds` must have a compliance that leaves loads without a value alone, but at this singular "
            "position it couples self-stress with them. Move the state beside the position."
        )


def _independent(matrix: np.ndarray) -> list[int]:
    """Rows that span the row space, the largest first (pivoted Gram-Schmidt)."""
    rest, chosen = matrix.copy(), []
    whole = np.linalg.norm(matrix, axis=1).max(initial=0.0)
    for _ in range(matrix.shape[1]):
        sizes = np.linalg.norm(rest, axis=1)
        row = int(np.argmax(sizes))
        if not sizes[row] > 1e-10 * whole:
            break
        direction = rest[row] / sizes[row]
        rest = rest - np.outer(rest @ direction, direction)
        rest[row] = 0.0
        chosen.append(row)
    return chosen


def check_definite(matrix: np.ndarray) -> None:
    """Refuse a closure that does not determine the self-stress, given N^T W N."""
    if not matrix.size:
        return
    scale = np.sqrt(np.abs(np.diag(matrix)))
    scaled = matrix / or_one(scale)[:, None] / or_one(scale)
    if not np.linalg.eigvalsh(scaled)[0] > 1e-12:
        raise NoSolutionError(RESULTS[RESULTS.indeterminate_closure])
