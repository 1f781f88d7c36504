"""What a joint in space is, and one that sits at a point and axis of both bodies

    offset = A_j^T R_j^T (p_i - p_j),   turn = A_j^T R_j^T R_i A_i

p and A are its point and its axes, z along its own axis, on each body: the placement of body i as body j's sees it.
Rows are in the axes on body j. Their multipliers are minus the force and moment on body i; rows of turns have the
relative angular velocity omega as their rate where the joint is closed, so that these multipliers are moments; that of
`ConstantVelocity`, whose shafts are at an angle, has omega . (z_i + z_j) / (1 + z_i . z_j).
"""

import abc
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...._tools._module import Numbers
from ..._frame import AbstractFrame
from ..._friction_model import AbstractFrictionModel
from ..._joints import AbstractJoint as AbstractAnyJoint
from .._body import Body
from .._frame import SPACE
from .._placement import Placement, at_reference, placed
from .._pose import Pose
from .._rotation import multiplied, times


class AbstractJoint(AbstractAnyJoint):
    """A joint between the bodies i and j in space.

    A new kind of joint gives `row_kinds`, the name and kind ("force" or "moment") of each of its rows, force-type
    first, and `residual`.

    ??? example

        ```python
        import equinox as eqx

        class SameHeight(rx.spatial.AbstractJoint):  # of the origins of both bodies
            row_kinds = (("z", "force"),)
            name: str = eqx.field(static=True)
            i: str = eqx.field(static=True)
            j: str = eqx.field(static=True)

            def residual(self, i, j, t):
                return (i.r - j.r)[2:]

        SameHeight("rail", "carriage", "ground")
        ```
    """

    frame: ClassVar[AbstractFrame] = SPACE

    @abc.abstractmethod
    def residual(self, i: Pose, j: Pose, t: Float[Array, ""]) -> Float[Array, " rows"]:
        """Constraint residual, one entry for each of `row_kinds`."""


class Relative(NamedTuple):
    """Offset and turn of a joint's placement on body i from that on body j, in the axes on j."""

    offset: Float[Array, "3"]
    turn: Float[Array, "3 3"]

    @classmethod
    def between(cls, placed: Any, i: Pose, j: Pose) -> "Relative":
        """That of a joint or load with `point_i`, `axes_i`, `point_j` and `axes_j`."""
        back = multiplied(j.axes, placed.axes_j).T
        offset = i.point(placed.point_i) - j.point(placed.point_j)
        return cls(times(back, offset), multiplied(back, multiplied(i.axes, placed.axes_i)))

    @property
    def shift(self) -> Float[Array, "2"]:
        """Offset square to the axis."""
        return self.offset[:2]

    @property
    def travel(self) -> Float[Array, ""]:
        """Offset along the axis."""
        return self.offset[2]

    @property
    def tilt(self) -> Float[Array, "2"]:
        """Tilt of the axis about x and y: 2 tan(half the angle), about the axis of the tilt."""
        x, y, z = self.turn[:, 2]
        return jnp.stack([-y, x]) * (2 / (1 + z))

    @property
    def rotation(self) -> Float[Array, "3"]:
        """Turn about x, y and z: 2 tan(half the angle), about the axis of the turn."""
        (_, xy, xz), (yx, _, yz), (zx, zy, _) = self.turn
        return jnp.stack([zy - yz, xz - zx, yx - xy]) * (2 / (1 + jnp.trace(self.turn)))

    @property
    def spin(self) -> Float[Array, "3"]:
        """Zero, with the relative angular velocity as its rate: not that of any coordinates."""
        return _spin(self.turn)

    @property
    def twist(self) -> tuple[Array, Array]:
        """Sine and cosine of the turn about the axis, both times the same positive number."""
        return self.turn[1, 0] - self.turn[0, 1], self.turn[0, 0] + self.turn[1, 1]

    @property
    def angle(self) -> Float[Array, ""]:
        """Turn about the axis, from -pi to pi."""
        return jnp.arctan2(*self.twist)

    def angle_from(self, angle: Array) -> Float[Array, ""]:
        """Turn about the axis beyond an angle of any number of turns, from -pi to pi."""
        (sine, cosine), s, c = self.twist, jnp.sin(angle), jnp.cos(angle)
        return jnp.arctan2(sine * c - cosine * s, cosine * c + sine * s)


@jax.custom_jvp
def _spin(turn: Float[Array, "3 3"]) -> Float[Array, "3"]:
    return jnp.zeros(3, turn.dtype)


@_spin.defjvp
def _spin_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    """[omega]x = T' T^T, whose derivatives are those of the angular velocity."""
    rate = multiplied(tangents[0], primals[0].T)
    omega = jnp.stack([rate[2, 1] - rate[1, 2], rate[0, 2] - rate[2, 0], rate[1, 0] - rate[0, 1]]) / 2
    return jnp.zeros(3, omega.dtype), omega


class AbstractPlacedJoint(AbstractJoint):
    """A joint that sits at a point and axis of both bodies.

    A new kind of joint gives `row_kinds` and `residual`, from `relative`.

    ??? example

        ```python
        class BallAtHeight(rx.spatial.AbstractPlacedJoint):  # free to slide square to its axis
            row_kinds = (("axial", "force"),)

            def residual(self, i, j, t):
                return self.relative(i, j).offset[2:]

        here, there = rx.spatial.Placement((0, 0, 0)), rx.spatial.Placement((0, 0, 1))
        BallAtHeight("ball", "carriage", "ground", on_i=here, on_j=there)
        ```

    **Arguments:**

    - `name`: rows are called by it, as in "name.axial".
    - `i`, `j`: the bodies, or "ground"; their names do where `on_i` and `on_j` are given.
    - `point`: global, m, at the reference pose of the bodies.
    - `axis`: direction of the joint's axis, z, likewise; (0, 0, 1) if not given.
    - `mark`: direction whose part square to the axis is x of the joint, likewise; a global axis if not given.
    - `on_i`, `on_j`: in place of `point` and `axis` the `Placement` on each body.
    - `friction`: none is known of joints of this kind.
    """

    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    point_i: Float[Array, "3"]
    axes_i: Float[Array, "3 3"]
    point_j: Float[Array, "3"]
    axes_j: Float[Array, "3 3"]

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point: Numbers | None = None,
        axis: Numbers | None = None,
        mark: Numbers | None = None,
        *,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
        friction: AbstractFrictionModel | None = None,
    ):
        refuse_friction(name, friction)
        self.place(name, i, j, at_reference(name, point, axis, mark), on_i, on_j)

    def place(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        given: Placement | None,
        on_i: Placement | None,
        on_j: Placement | None,
    ) -> None:
        """Set the fields of a joint that is being made, at one place."""
        self.place_both(name, i, j, (given, given), (on_i, on_j))

    def place_both(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        given: tuple[Placement | None, Placement | None],
        own: tuple[Placement | None, Placement | None],
    ) -> None:
        """The same of a joint with a global placement for each body."""
        self.name, (self.i, self.j, on_i, on_j) = name, placed(name, i, j, given, own)
        (self.point_i, self.axes_i), (self.point_j, self.axes_j) = ((on.point, on.axes) for on in (on_i, on_j))

    def relative(self, i: Pose, j: Pose) -> Relative:
        """The placement on body i as that on body j sees it."""
        return Relative.between(self, i, j)


def refuse_friction(name: str, friction: object) -> None:
    """Friction of joints that know none."""
    if friction is not None:
        raise ValueError(
            f"Argument `friction` of joint '{name}' must be left out, but is {type(friction).__name__}: joints of its "
            "kind know none. Revolutes, sliders, screws, sleeves, balls, plates and crosses do. Give one of these, or "
            "a force of the velocity by `rx.spatial.LoadFunction`."
        )
