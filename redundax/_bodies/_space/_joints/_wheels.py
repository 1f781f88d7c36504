"""Wheels and knife edges in space, whose rows constrain velocities

    normal    n . (c - p_j) - r |n - (a . n) a| = 0          the lowest point of a thin disc in the plane: of position
    along     t . (v_i - v_j) = 0                            that point does not slip where the disc rolls
    across    s . (v_i - v_j) = 0                            nor across

c is the centre of the disc, a its axle, n the normal of the plane; the lowest point is c - r e with e along
n - (a . n) a, t is along a x n and s = n x t. As the wheel turns about a, counter-clockwise, it rolls along t. v_i and
v_j are velocities of the points of both bodies that touch. A blade along d has t along d - (d . n) n and the row across
alone. Rows are minus these, so that multipliers are the forces on body i along n, t and s.
"""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...._tools._errors import RedundaxError
from ...._tools._module import Numbers, as_float, numpy_of, replace_fields, safe_norm
from ..._joints._base import Row
from ..._joints._wheels import ORDER, AbstractRollingRows, check_wheel, in_order, parted
from .._body import Body
from .._placement import Placement, at_reference
from .._pose import Pose
from .._rotation import cross
from ._base import AbstractJointOfPlacements

_UP = (0.0, 0.0, 1.0)


class AbstractOnPlane(AbstractJointOfPlacements):
    """What touches a plane of body j: the axis z of its placement on body i is axle or blade, on body j the normal."""

    def directions(self) -> dict[str, Array]:
        return {"i": self.axes_i[..., 2], "j": self.axes_j[..., 2]}


class Wheel(AbstractRollingRows, AbstractOnPlane):  # pyright: ignore[reportIncompatibleVariableOverride]
    """A thin disc on body i, upright or tilted, that rolls on a plane of body j without slip.

    Its multipliers are the forces of the plane on body i where they touch, N: "name.normal" along the normal,
    "name.along" in the plane where the wheel rolls to as it turns counter-clockwise about its axle, and "name.across"
    in the plane to the left of that. The rows "along" and "across" constrain velocities alone, so that assembly leaves
    the way of the wheel free.

    ??? example

        ```python
        disc = rx.spatial.Body("disc", 2.0, inertia=(0.05, 0.1, 0.05), position=(0.0, 0.0, 0.3))
        rx.spatial.Wheel("tyre", disc, "ground", point=(0.0, 0.0, 0.3), axis=(0.0, 1.0, 0.0), radius=0.3)
        ```

    **Arguments:**

    - `name`: rows are called "name.normal", "name.along" and "name.across".
    - `i`, `j`: the bodies, or "ground"; their names do where `on_i` and `on_j` are given.
    - `point`: the centre of the disc, global, m, at the reference pose of the bodies.
    - `axis`: direction of the axle, likewise.
    - `radius`: of the disc, m.
    - `normal`: direction square to the plane, to the side of the disc, likewise; (0, 0, 1) if not given.
    - `floor`: a point of the plane, likewise; if not given the disc touches the plane at the reference pose.
    - `rows`: those that hold of normal, along and across. Without "across" the wheel slips sideways freely, without
      "along" it does where it rolls to, and without "normal" something else holds it on the plane.
    - `on_i`, `on_j`: in place of the global figures the `Placement` on each body: centre and axle, a point of the plane
      and its normal.
    - `one_sided`: whether the disc may leave the plane, and rolls only while it touches it.
    """

    radius: Float[Array, ""]
    rows: tuple[str, ...] = eqx.field(static=True)
    one_sided: bool = eqx.field(static=True, default=False)  # pyright: ignore[reportIncompatibleMethodOverride]

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point: Numbers | None = None,
        axis: Numbers | None = None,
        *,
        radius: Numbers,
        normal: Numbers | None = None,
        floor: Numbers | None = None,
        rows: Sequence[str] = ORDER,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
        one_sided: bool = False,
    ):
        self.radius, self.rows, self.one_sided = as_float(radius, "radius"), in_order(rows), one_sided  # pyright: ignore
        given_i, given_j = at_reference(name, point, axis), None
        if given_i is None and not (normal is None and floor is None):
            raise RedundaxError(
                f"Arguments `normal` and `floor` of the wheel '{name}' must be left out where `on_i` and `on_j` are "
                "given. Give the plane as `on_j`."
            )
        if given_i is not None:
            given_j = at_reference(name, point if floor is None else floor, _UP if normal is None else normal)
        if given_i is not None and given_j is not None and floor is None:
            xp = numpy_of(given_i.point, given_i.axes, given_j.axes, self.radius)
            a, n = (xp.asarray(given.axes)[:, 2] for given in (given_i, given_j))
            up = n - (a @ n) * a
            touching = xp.asarray(given_i.point) - xp.asarray(self.radius) * up / xp.linalg.norm(up)
            given_j = replace_fields(given_j, point=as_float(touching, "touching"))
        self.place_both(name, i, j, (given_i, given_j), (on_i, on_j))
        check_wheel(self.name, self.radius, self.rows, self.one_sided, ORDER)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        a, n = i.rotate(self.axes_i[:, 2]), j.rotate(self.axes_j[:, 2])
        height = n @ (i.point(self.point_i) - j.point(self.point_j)) - self.radius * safe_norm(n - (a @ n) * a)
        return self.only(normal=-height)

    def rolled(self, i: Pose, j: Pose, from_i: Pose, from_j: Pose) -> Array:
        a, n = from_i.rotate(self.axes_i[:, 2]), from_j.rotate(self.axes_j[:, 2])
        touching = from_i.point(self.point_i) - self.radius * _unit(n - (a @ n) * a)
        shift, t = parted(touching, i, j, from_i, from_j), _unit(cross(a, n))
        return self.only(along=-t @ shift, across=-cross(n, t) @ shift)


class KnifeEdge(AbstractOnPlane):
    """A blade, a skate or a wheel without spin: a point of body i moves on a plane of body j along the blade alone.

    Its multiplier "name.across" is the force on body i in the plane, across the blade to its left, N. The row
    constrains velocities alone; it holds no height, which a `PointOnPlane` does.

    ??? example

        ```python
        sleigh = rx.spatial.Body("sleigh", 2.0, inertia=(0.1, 0.2, 0.3))
        rx.spatial.KnifeEdge("skate", sleigh, "ground", point=(-0.4, 0.0, 0.0), direction=(1.0, 0.0, 0.0))
        ```

    **Arguments:**

    - `name`: the row is called "name.across".
    - `i`, `j`: the bodies, or "ground"; their names do where `on_i` and `on_j` are given.
    - `point`: the blade's point, global, m, at the reference pose of the bodies.
    - `direction`: along the blade, likewise; not square to the plane.
    - `normal`: direction square to the plane, likewise; (0, 0, 1) if not given.
    - `on_i`, `on_j`: in place of these the `Placement` on each body, with the blade and the normal as their axes.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("across", "force"),)
    velocity_rows: ClassVar[tuple[str, ...]] = ("across",)

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point: Numbers | None = None,
        direction: Numbers | None = None,
        *,
        normal: Numbers | None = None,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
    ):
        given = at_reference(name, point, direction), None if point is None else at_reference(name, point, normal)
        self.place_both(name, i, j, given, (on_i, on_j))

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return jnp.zeros(1, i.r.dtype)

    def rolled(self, i: Pose, j: Pose, from_i: Pose, from_j: Pose) -> Array:
        d, n = from_i.rotate(self.axes_i[:, 2]), from_j.rotate(self.axes_j[:, 2])
        shift = parted(from_i.point(self.point_i), i, j, from_i, from_j)
        return -(_unit(cross(n, d)) @ shift)[None]


def _unit(v: Float[Array, "3"]) -> Float[Array, "3"]:
    """v / |v|, and zero of zero."""
    size = safe_norm(v)
    return v / jnp.where(size > 0, size, 1.0)
