"""Where a joint sits on a body: a point, and axes of which z is the joint's own

Joints are given by placements on both bodies, or by a global point and axis at the reference pose of the bodies.
"""

from collections.abc import Sequence
from typing import NamedTuple

from jaxtyping import Array, Float

from ..._tools._errors import RedundaxError
from ..._tools._module import Numbers, check_kind, finite, numpy_of, on_device, part, replace_fields
from ..._tools._value import AbstractModule
from .._body import GROUND, name_of
from ._body import Body
from ._frame import SPACE
from ._rotation import axes_along, rotation


class Placement(AbstractModule):
    """Point and axes of a joint in the local frame of a body.

    ??? example

        ```python
        rx.spatial.Placement((0.0, 0.0, 1.8), axis=(0.0, 0.0, 1.0))
        ```

    **Arguments:**

    - `point`: m.
    - `axis`: direction of the joint's axis, z; it is normalised.
    - `mark`: a direction whose part square to the axis is x, from which the angle of a joint counts; x of the body if
      not given, but y of it for axes within 27.8 degrees of its x, to either side. Of an axis that may tilt across
      that cone give a mark: x would jump there, and there alone.
    """

    point: Float[Array, "3"]
    axes: Float[Array, "3 3"]

    def __init__(self, point: Numbers, axis: Numbers = (0.0, 0.0, 1.0), mark: Numbers | None = None):
        self.point = SPACE.vector("point", point)
        finite("point", self.point)
        self.axes = on_device(axes_along("axis", axis, mark))


class Place(NamedTuple):
    """Names of two bodies and the placements of a joint on them."""

    i: str
    j: str
    on_i: Placement
    on_j: Placement


def at_reference(
    joint: str, point: Numbers | None, axis: Numbers | None, mark: Numbers | None = None, what: str = "joint"
) -> Placement | None:
    """A global placement; None where there is no point, beside which no direction counts."""
    if point is not None:
        with part(f"{what} '{joint}'"):
            return Placement(point, (0.0, 0.0, 1.0) if axis is None else axis, mark)
    if axis is not None or mark is not None:
        raise RedundaxError(
            f"{what.capitalize()} '{joint}' has a global direction without a global point, so that it would count for "
            "nothing. Give `point` too, or the direction in the `Placement` on each body."
        )
    return None


def placed(
    joint: str,
    i: Body | str,
    j: Body | str,
    given: Sequence[Placement | None],
    own: Sequence[Placement | None],
    what: str = "joint",
) -> Place:
    """Both placements: from global ones at the reference pose, or from those on the bodies."""
    name, counts = f"{what} '{joint}'", [sum(each is not None for each in pair) for pair in (given, own)]
    if sorted(counts) != [0, 2]:
        has = "neither" if not any(counts) else "both" if all(counts) else "only one of two"
        raise RedundaxError(
            f"{what.capitalize()} '{joint}' must be given by global points at the reference pose or by `on_i` and "
            f"`on_j`, but has {has}. Give one kind, and all of it."
        )
    for argument, on in zip(("on_i", "on_j"), own, strict=True):
        if on is not None:
            with part(name):
                advice = "Give `rx.spatial.Placement(point, axis=...)`."
                check_kind(argument, on, Placement, "a placement on the body", advice)
    if counts[0]:
        own = _local(name, "i", i, given[0]), _local(name, "j", j, given[1])  # pyright: ignore[reportArgumentType]
    return Place(name_of(i), name_of(j), *own)  # pyright: ignore[reportArgumentType]


def between_points(
    joint: str, i: Body | str, j: Body | str, points: Sequence[Numbers | None], what: str = "joint"
) -> Place:
    """Placements of which only the points count: both global ones, then both in the local frames."""
    arguments, owner = ("point_i", "point_j", "on_i", "on_j"), f"{what} '{joint}'"
    given_i, given_j, on_i, on_j = (
        None if point is None else Placement(SPACE.vector(argument, point, owner))
        for argument, point in zip(arguments, points, strict=True)
    )
    return placed(joint, i, j, (given_i, given_j), (on_i, on_j), what)


def _local(name: str, which: str, body: Body | str, at: Placement) -> Placement:
    """A global placement in the local frame of a body at its reference pose."""
    if isinstance(body, str):
        if body == GROUND:
            return at
        raise RedundaxError(
            f"Argument `{which}` of {name} must be the body itself where a global point or axis is given, but is its "
            f"name '{body}'. Give the `Body`, whose reference pose is needed."
        )
    with part(name):
        check_kind(which, body, Body, "a body", 'Give the `Body` itself, or "ground".')
    xp = numpy_of(body.orientation, body.position, at.point, at.axes)
    position, point, axes = (xp.asarray(x) for x in (body.position, at.point, at.axes))
    turn = xp.asarray(rotation(body.orientation)).T
    return replace_fields(at, point=on_device(turn @ (point - position)), axes=on_device(turn @ axes))
