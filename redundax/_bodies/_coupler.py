"""Couplers, a coordinate of one joint as a polynomial of that of another, and stops, its limits

    c_1 - (p_0 + p_1 c_2 + p_2 c_2^2 + ...) = 0

One row, whose derivative is that of c_1 less the polynomial's slope times that of c_2: it reads the bodies of both
joints. Either may be a sum of coordinates with weights, whose angles stay within half a turn. Its multiplier is minus
the force or moment along c_1. An angle of a joint in space is from -pi to pi: the row is taken to the nearest of the
whole turns that leave the bodies where they are, which are

    c_1 an angle                           2 pi, and 2 pi / q where c_2 is another and p_1 = 1 / q, with only p_0 beside
    c_1 a travel of a constant ratio p_1   2 pi |p_1| where c_2 is an angle

Stops have rows c - most and least - c, whose contacts only push; their angles in space are from -pi to pi too.

Of other ratios of angles the second must stay within half a turn: several positions of the first would close the row.
"""

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, Int

from .._system._names import Names, index_of
from .._tools._errors import RedundaxError
from .._tools._module import Numbers, check_word, finite, floats, is_concrete, numpy_of, on_device, optional_float
from .._tools._table import are_known
from .._tools._value import AbstractModule
from ._coordinate import Coordinate, Place, Total
from ._frame import AbstractFrame, AbstractPose
from ._joints._base import Row
from ._stack import Stack, indices

_Terms = tuple[tuple[str, float], ...]  # coordinates by name, and their weights


class _Kind(NamedTuple):
    """What couplers that are computed together share: stacks and columns of the coordinates of both sides, kinds of
    single ones, whether they only push, and the shape of the polynomial."""

    columns: tuple[tuple[tuple[int, int], ...], ...]
    kinds: tuple[str, ...]
    one_sided: bool
    terms: tuple[int, ...]


class _Part(NamedTuple):
    """A row sign * (c_1 - p(c_2)), called "name.row"; whether it is a contact that only pushes."""

    name: str
    row: str
    first: _Terms
    second: _Terms
    polynomial: Float[Array, " terms"]
    sign: float = 1.0
    one_sided: bool = False


class Coupler(AbstractModule):
    """A coordinate of one joint as a polynomial of that of another, of any two joints of a mechanism.

    ??? example

        ```python
        rx.Coupler("rack", "left.angle", "right.angle", ratio=-1.0)  # fingers of a gripper that close together
        rx.Coupler("cam", "follower.travel", "shaft.angle", polynomial=(0.0, 0.01, 0.002))
        rx.Coupler("differential", "housing.angle", {"left.angle": 0.5, "right.angle": 0.5}, ratio=1.0)
        ```

    **Arguments:**

    - `name`: the row is called "name.coupling".
    - `first`, `second`: names of the coordinates, such as "hinge.angle" or "guide.travel", or weights of several by
      their names, finite and not 0, whose sum is meant.
    - `ratio`: of the first to the second, where it is constant.
    - `polynomial`: its coefficients, lowest power first, in place of `ratio`.

    Angles of joints in space are from -pi to pi. A coupler follows them round and round where its ratio is a whole
    number or one over a whole number, and where it moves a travel by a constant ratio. Otherwise keep the second angle,
    and all of sums, within half a turn, or make wheels in mesh of `rx.spatial.Gear`.
    """

    name: str = eqx.field(static=True)
    first: _Terms = eqx.field(static=True)
    second: _Terms = eqx.field(static=True)
    polynomial: Float[Array, " terms"]

    def __init__(
        self,
        name: str,
        first: str | Mapping[str, ArrayLike],
        second: str | Mapping[str, ArrayLike],
        ratio: Numbers | None = None,
        *,
        polynomial: Numbers | None = None,
    ):
        check_word("name", name)
        self.name, self.first, self.second = name, _terms(name, "first", first), _terms(name, "second", second)
        if (ratio is None) == (polynomial is None):
            raise RedundaxError(f"Coupler '{name}' must have either `ratio` or `polynomial`. Give one of both.")
        if first == second:
            raise RedundaxError(
                f"Coupler '{name}' must couple two coordinates, but has '{first}' twice. Name another as `second`, or "
                "hold one by a driver of constant value."
            )
        argument = "polynomial" if ratio is None else "ratio"
        given = floats(polynomial if ratio is None else ratio, argument)  # pyright: ignore[reportArgumentType]
        if given.ndim != (1 if ratio is None else 0):
            raise RedundaxError(
                f"Coupler '{name}' must have a number as `ratio` or a list of coefficients as `polynomial`, but has "
                f"one of shape {given.shape}. Give `polynomial=(0.0, 2.0)` for twice, say."
            )
        finite(argument, given, f"coupler '{name}'")
        if ratio is not None:
            given = numpy_of(given).stack([0.0 * given, given])
        if is_concrete(given):  # of lower degree than files write
            given = given[: max(2, len(np.trim_zeros(np.asarray(given), "b")))]
        self.polynomial = on_device(given)

    def parts(self) -> list[_Part]:
        return [_Part(self.name, "coupling", self.first, self.second, self.polynomial)]


class Stop(AbstractModule):
    """Limits of a coordinate of a joint: contacts that only push it back.

    A multiplier is the force or moment with which a stop pushes, positive or zero; `solve` tells in `contacts` whether
    it does.

    ??? example

        ```python
        rx.Stop("doorstop", "hinge.angle", most=1.5)
        rx.Stop("ends", "guide.travel", least=-0.2, most=0.2)
        ```

    **Arguments:**

    - `name`: rows are called "name.least" and "name.most".
    - `coordinate`: name of the coordinate, such as "hinge.angle" or "guide.travel".
    - `least`, `most`: its limits, rad or m; one of them may be left out.
    """

    name: str = eqx.field(static=True)
    coordinate: str = eqx.field(static=True)
    least: Float[Array, ""] | None
    most: Float[Array, ""] | None

    def __init__(self, name: str, coordinate: str, least: Numbers | None = None, most: Numbers | None = None):
        if least is None and most is None:
            raise RedundaxError(f"Stop '{name}' must have `least` or `most`, but has neither. Give one, or both.")
        check_word("name", name)
        check_word("coordinate", coordinate)
        self.name, self.coordinate = name, coordinate
        self.least, self.most = optional_float(least, "least"), optional_float(most, "most")
        given = {"least": self.least, "most": self.most}
        limits = {argument: limit for argument, limit in given.items() if limit is not None}
        for argument, limit in limits.items():
            finite(argument, limit, f"stop '{name}'")
        both = [*limits.values()]
        if are_known(both) and not np.all(np.diff(np.stack(both), axis=0) > 0):
            raise RedundaxError(
                f"Stop '{name}' must have `least` below `most`, but has {least} and {most}. Exchange them, or give a "
                "`Coupler` for a coordinate that is held."
            )

    def parts(self) -> list[_Part]:
        limits, own = {"least": (self.least, -1.0), "most": (self.most, 1.0)}, ((self.coordinate, 1.0),)
        return [
            _Part(self.name, row, own, own, jnp.stack([at, 0.0 * at]), sign, one_sided=True)
            for row, (at, sign) in limits.items()
            if at is not None
        ]


class Couplings(AbstractModule):
    """Couplers of coordinates of the same kinds: both coordinates, and of which of them whole turns change nothing, of
    the first by a `share`; rows, and columns of all four bodies, of which those beyond the last are of the ground."""

    first: Total
    second: Total
    turns: Literal["first", "second", "neither"] = eqx.field(static=True)
    polynomial: Float[Array, "size terms"]
    sign: Float[Array, " size"]
    share: Float[Array, " size"]
    rows: Int[Array, " size"]
    columns: Int[Array, "size columns"]

    def residuals(self, joints: Sequence[Stack], bodies: AbstractPose) -> Float[Array, "size 1"]:
        first, second = (each.value(joints, bodies) for each in (self.first, self.second))
        gap = self.sign * (first - jax.vmap(_value)(self.polynomial, second))
        if self.turns == "neither":
            return gap[:, None]
        period = 2 * jnp.pi * (1 / self.share if self.turns == "first" else jnp.abs(self.polynomial[:, 1]))
        return (gap - period * jnp.round(gap / jnp.where(period > 0, period, 1.0)))[:, None]

    def slopes(self, joints: Sequence[Stack], bodies: AbstractPose) -> Float[Array, "size columns"]:
        """Derivatives by the velocities of all bodies."""
        slope = jax.vmap(jax.grad(_value, argnums=1))(self.polynomial, self.second.value(joints, bodies))
        parts = self.first.slopes(joints, bodies), -slope[:, None] * self.second.slopes(joints, bodies)
        return self.sign[:, None] * jnp.concatenate(parts, axis=1)

    def bodies(self, joints: Sequence[Stack]) -> np.ndarray:
        """All of each, (size, bodies); concrete values."""
        return np.concatenate([end.bodies(joints) for end in (self.first, self.second)], axis=1)

    def words(self, names: Names, joints: Sequence[Stack]) -> list[tuple[str, str, str]]:
        """Name, kind and both coordinates of each."""
        ends = [[_told(names, joints, end, k) for k in range(self.rows.size)] for end in (self.first, self.second)]
        rows = [names.rows.labels[row].rpartition(".") for row in np.asarray(self.rows).tolist()]
        return [
            (name, "Coupler", ", ".join(pair)) if row == "coupling" else (f"{name}.{row}", "Stop", pair[0])
            for (name, _, row), pair in zip(rows, zip(*ends, strict=True), strict=True)
        ]


def _terms(name: str, argument: str, given: str | Mapping[str, ArrayLike]) -> _Terms:
    """Coordinates and weights of an argument."""
    if isinstance(given, str):
        return ((given, 1.0),)
    if not isinstance(given, Mapping) or not given or not all(map(_is_number, given.values())):
        raise RedundaxError(
            f"Argument `{argument}` of coupler '{name}' must be the name of a coordinate, or weights of several by "
            f'their names, but is {given!r}. Write "A.angle" or {{"A.angle": 1.0, "B.angle": 2.0}}, say.'
        )
    terms = tuple((each, float(np.asarray(weight))) for each, weight in given.items())
    for each, weight in terms:
        if not np.isfinite(weight) or not weight:
            raise RedundaxError(
                f"Argument `{argument}` of coupler '{name}' must have finite weights other than 0, but has {weight:g} "
                f"of '{each}'. Correct it, or leave that coordinate out."
            )
    return terms


def _is_number(value: object) -> bool:
    """Whether a value is a known number, of Python, NumPy or JAX."""
    if isinstance(value, np.ndarray | jax.Array):
        return is_concrete(value) and value.ndim == 0 and value.dtype.kind in "iuf"
    return isinstance(value, Real)


def _told(names: Names, joints: Sequence[Stack], end: Total, k: int) -> str:
    """One of some sums in words."""
    told = []
    for part, weight in zip(end.parts, np.asarray(end.weights)[k].tolist(), strict=True):
        what = joints[part.kind].element.coordinate_kinds[part.column][0]
        own = f"{names.joints[part.kind][int(np.asarray(part.members)[k])]}.{what}"
        told.append(own if weight == 1 else f"{weight:g} {own}")
    return " + ".join(told)


def _value(polynomial: Array, x: Array) -> Array:
    return jnp.polyval(polynomial[::-1], x)


class CoupledRow:
    """What a coupler or a stop is among the rows of a mechanism."""

    def __init__(self, part: _Part, kind: str):
        self.name = part.name
        self.row_kinds: tuple[Row, ...] = ((part.row, kind),)
        self.pushing, self.one_sided = (part.row,) * part.one_sided, part.one_sided
        self.velocity_rows: tuple[str, ...] = ()


def coupled_rows(couplers: Sequence[Coupler | Stop], places: dict[str, Place]) -> list[CoupledRow]:
    """The rows of couplers and stops, those of one kind together, given where the coordinates of joints are."""
    found = []
    for part in [part for each in couplers for part in each.parts()]:
        given = (("coordinate", part.first),) if part.one_sided else (("first", part.first), ("second", part.second))
        for argument, name in ((argument, name) for argument, terms in given for name, _ in terms):
            index_of(argument, name, list(places), " of joint coordinates")
    for part in [part for members in _alike(couplers, places).values() for part in members]:
        found.append(CoupledRow(part, "moment" if places[next(iter(dict(part.first)))][3] == "angular" else "force"))
    return found


def _alike(couplers: Sequence[Coupler | Stop], places: dict[str, Place]) -> dict[_Kind, list[_Part]]:
    """Those of the same kinds together."""
    found: dict[_Kind, list[_Part]] = {}
    for part in [part for each in couplers for part in each.parts()]:
        both = [[places[name] for name, _ in terms] for terms in (part.first, part.second)]
        columns = tuple(tuple(place[:2] for place in end) for end in both)
        is_sum = any([weight for _, weight in terms] != [1.0] for terms in (part.first, part.second))
        kinds = () if is_sum or part.one_sided else tuple(end[0][3] for end in both)
        kind = _Kind(columns, kinds, part.one_sided, part.polynomial.shape)
        found.setdefault(kind, []).append(part)
    return found


def _total(terms: Sequence[_Terms], columns: Sequence[tuple[int, int]], places: dict[str, Place]) -> Total:
    """Sums of coordinates of the same columns of stacks."""
    each = [Coordinate(*column, indices([places[own[k][0]][2] for own in terms])) for k, column in enumerate(columns)]
    return Total(tuple(each), on_device(floats([[weight for _, weight in own] for own in terms])))


def couplings(
    couplers: Sequence[Coupler | Stop],
    places: dict[str, Place],
    rows: Sequence[int],
    joints: Sequence[Stack],
    frame: AbstractFrame,
    count: int,
) -> tuple[Couplings, ...]:
    """Couplers of the same kinds together, at the given rows of a mechanism of `count` bodies."""
    found, start = [], 0
    for (of_ends, kinds, _, terms), members in _alike(couplers, places).items():
        given = [part.first for part in members], [part.second for part in members]
        ends = [_total(each, at, places) for each, at in zip(given, of_ends, strict=True)]
        columns = np.concatenate([end.columns(joints, frame, count) for end in ends], axis=1)
        polynomials = [part.polynomial for part in members]
        polynomial = on_device(numpy_of(polynomials).stack(polynomials))
        at = indices(rows[start : start + len(members)]), indices(columns)
        start += len(members)
        turns = "neither" if frame.adds or not kinds else _turns(kinds, terms)
        sign = on_device(np.array([part.sign for part in members], polynomial.dtype))
        found.append(Couplings(ends[0], ends[1], turns, polynomial, sign, _shares(polynomial, kinds), *at))
    return tuple(found)


def _turns(kinds: Sequence[str], terms: tuple[int, ...]) -> Literal["first", "second", "neither"]:
    """Which coordinate in space may count some of its turns or none."""
    if kinds[0] == "angular":
        return "first"
    return "second" if kinds[1] == "angular" and terms == (2,) else "neither"


def _shares(polynomial: Float[Array, "size terms"], kinds: Sequence[str]) -> Float[Array, " size"]:
    """q of couplers of angles by 1 / q, and 1 of others."""
    xp = numpy_of(polynomial)
    one = xp.ones(polynomial.shape[0])
    if list(kinds) != ["angular", "angular"] or polynomial.shape[1] != 2:
        return on_device(one)
    ratio = xp.abs(xp.asarray(polynomial)[:, 1])
    share = xp.round(1 / xp.where(ratio > 0, ratio, 1.0))
    is_share = (share > 0) & (xp.abs(ratio * share - 1) <= 4 * xp.finfo(ratio.dtype).eps)
    return on_device(xp.where(is_share, share, one))
