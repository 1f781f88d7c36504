"""Wheels and knife edges in the plane, whose rows constrain velocities

    normal    n . (c - p_j) - r = 0                          the lowest point of the disc on the line, a row of position
    along     t . (v_i - v_j) = 0                            the point of body i that touches does not slip on body j
    across    s . (v_i - v_j) = 0                            the point of a blade does not move across it

n is the normal of the line, t the line, from which n is a quarter turn counter-clockwise; s is that from the blade.
Rows are minus these, so that multipliers are the forces on body i along n, t and s.
"""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._tools._errors import RedundaxError
from ..._tools._module import figure, names_in, part, positive, unit
from .._body import name_of
from .._frame import P
from .._pose import Pose, perpendicular
from ._base import AbstractJoint, AbstractPointJoint, Row

ORDER = ("normal", "along", "across")


def in_order(rows: Sequence[str] | str) -> tuple[str, ...]:
    """Rows in their order, and what is none behind."""
    given = tuple(names_in("rows", rows))
    return *(row for row in ORDER if row in given), *(row for row in given if row not in ORDER)


def check_wheel(name: str, radius: Array, rows: tuple[str, ...], one_sided: bool, known: tuple[str, ...]) -> None:
    """Refuse rows that a wheel does not have, no radius, and a contact that opens where there is none."""
    with part(f"joint '{name}'"):
        positive("radius", radius)
    if not rows or set(rows) - set(known):
        raise RedundaxError(
            f"Argument `rows` of the wheel '{name}' must hold some of {', '.join(known)}, but is {rows!r}. "
            "Name those that hold."
        )
    if one_sided and "normal" not in rows:
        raise RedundaxError(
            f"Argument `one_sided` of the wheel '{name}' must be left out where it has no row \"normal\", "
            f"which is what opens, but `rows` is {rows!r}. Add that row."
        )


def parted(touching: Array, i: P, j: P, from_i: P, from_j: P) -> Array:
    """How the points of both bodies that touch at a global point have parted."""
    return i.point(from_i.local(touching)) - j.point(from_j.local(touching))


class AbstractRollingRows:
    """The rows that a wheel was given, all forces: of the contact, which pushes, and of rolling."""

    rows: tuple[str, ...]

    @property
    def row_kinds(self) -> tuple[Row, ...]:
        """Those that hold."""
        return tuple((row, "force") for row in self.rows)

    @property
    def pushing(self) -> tuple[str, ...]:
        """That of the contact."""
        return tuple(row for row in self.rows if row == "normal")

    @property
    def velocity_rows(self) -> tuple[str, ...]:
        """Those of rolling."""
        return tuple(row for row in self.rows if row != "normal")

    def only(self, **values: Array) -> Array:
        """Values of some rows, and zeros of the others that hold."""
        zero = jnp.zeros_like(next(iter(values.values())))
        return jnp.stack([values.get(row, zero) for row in self.rows])


class Wheel(AbstractRollingRows, AbstractPointJoint):  # pyright: ignore[reportIncompatibleVariableOverride]
    """A disc on body i that rolls on a line of body j without slip, seen from the side.

    Its multipliers are the forces of the line on body i: "name.normal" along the normal, N, "name.along" along the
    line, from which the normal is a quarter turn counter-clockwise, N. The row "along" constrains velocities alone, so
    that assembly leaves the turn of the wheel free.

    ??? example

        ```python
        rx.Wheel("front", "disc", "ground", point_i=(0.0, 0.0), point_j=(0.0, 0.0), normal=(0.0, 1.0), radius=0.3)
        ```

    **Arguments:**

    - `name`: rows are called "name.normal" and "name.along".
    - `i`, `j`: names of the bodies, or "ground".
    - `point_i`: the disc's centre in the frame of i, m.
    - `point_j`: a point of the line in the frame of j, m.
    - `normal`: vector of body j square to the line, to the side of the disc; it is normalised.
    - `radius`: of the disc, m.
    - `rows`: those that hold; without "along" it slips freely, without "normal" something else holds it on the line.
    - `one_sided`: whether the disc may leave the line, and rolls only while it touches it.
    """

    vectors: ClassVar[tuple[str, ...]] = ("point_i", "point_j", "normal")
    normal: Float[Array, "2"] = eqx.field(converter=unit("normal"))
    radius: Float[Array, ""] = eqx.field(converter=figure("radius"))
    rows: tuple[str, ...] = eqx.field(static=True, converter=in_order, default=("normal", "along"))
    one_sided: bool = eqx.field(static=True, default=False)  # pyright: ignore[reportIncompatibleMethodOverride]

    def __check_init__(self) -> None:
        check_wheel(self.name, self.radius, self.rows, self.one_sided, ("normal", "along"))

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        height = j.rotate(self.normal) @ (i.point(self.point_i) - j.point(self.point_j)) - self.radius
        return self.only(normal=-height)

    def rolled(self, i: Pose, j: Pose, from_i: Pose, from_j: Pose) -> Array:
        n = from_j.rotate(self.normal)
        touching = from_i.point(self.point_i) - self.radius * n
        return self.only(along=perpendicular(n) @ parted(touching, i, j, from_i, from_j))


class KnifeEdge(AbstractJoint[Pose]):
    """A blade, a skate or a wheel seen from above: a point of body i moves on body j along the blade alone.

    Its multiplier is the force on body i across the blade, to its left, N. The row constrains velocities alone.

    ??? example

        ```python
        rx.KnifeEdge("skate", "sleigh", "ground", point_i=(-0.4, 0.0), direction=(1.0, 0.0))
        ```

    **Arguments:**

    - `name`: the row is called "name.across".
    - `i`, `j`: names of the bodies, or "ground".
    - `point_i`: the blade's point in the frame of i, m.
    - `direction`: vector of body i along the blade; it is normalised.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("across", "force"),)
    velocity_rows: ClassVar[tuple[str, ...]] = ("across",)
    vectors: ClassVar[tuple[str, ...]] = ("point_i", "direction")
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True, converter=name_of)
    j: str = eqx.field(static=True, converter=name_of)
    point_i: Float[Array, "2"] = eqx.field(converter=figure("point_i"))
    direction: Float[Array, "2"] = eqx.field(converter=unit("direction"))

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return jnp.zeros(1, i.r.dtype)

    def rolled(self, i: Pose, j: Pose, from_i: Pose, from_j: Pose) -> Array:
        shift = parted(from_i.point(self.point_i), i, j, from_i, from_j)
        return -(perpendicular(from_i.rotate(self.direction)) @ shift)[None]
