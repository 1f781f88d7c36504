"""Lower pairs in the plane, by what they lock: revolute, translational, pin in slot and fixed

    x, y             r_i + R_i s_i - r_j - R_j s_j = 0                                           (53)
    perpendicular    (r_j + R_j s_j - r_i - R_i s_i)^T R_j v_j = 0                               (57)
    angle            phi_i - phi_j - psi = 0                                                     (57)

with Jacobians (55), (58) and gamma (56), (59). A revolute has the friction moment (41) about its axis.
"""

from typing import ClassVar, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._tools._errors import RedundaxError
from ..._tools._module import figure, not_negative, optional_figure, part, positive, safe_norm, unit
from .._friction_model import AbstractFrictionModel
from .._pose import Pose, perpendicular
from ._base import AbstractPointJoint, Row, check_friction
from ._components import Components, picked, values
from ._rubbing import AbstractFrictionalJoint


def _offset(joint: AbstractPointJoint, i: Pose, j: Pose) -> Array:
    return i.point(joint.point_i) - j.point(joint.point_j)


def _travel(joint: "Translational | PinInSlot", i: Pose, j: Pose) -> Array:
    return _offset(joint, i, j) @ -perpendicular(j.rotate(joint.normal))


LOCKED: Components = {
    ("x", "y"): _offset,
    ("perpendicular",): lambda joint, i, j: (
        (j.point(joint.point_j) - i.point(joint.point_i)) @ j.rotate(joint.normal)
    )[None],
    ("angle",): lambda joint, i, j: (i.phi - j.phi - joint.angle)[None],
}
FORCE: tuple[Row, ...] = (("x", "force"), ("y", "force"))
PERPENDICULAR: Row = ("perpendicular", "force")
ANGLE: Row = ("angle", "moment")


class AbstractPair(AbstractPointJoint):
    """A joint whose rows are names of `LOCKED`."""

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return values(LOCKED, self.row_kinds, f"a `{type(self).__name__}`", self, i, j)


class Revolute(AbstractPair, AbstractFrictionalJoint):
    """Revolute joint (53). Its multipliers are minus the force on body i, in global components, N.

    ??? example

        ```python
        rx.Revolute("A", "lever", "ground", point_i=(-0.2, 0.0), point_j=(0.0, 1.0))
        friction = {"pin_radius": 0.01, "friction": rx.Coulomb(0.3)}
        rx.Revolute("A", "lever", "ground", point_i=(-0.2, 0.0), point_j=(0.0, 1.0), **friction)
        ```

    **Arguments:**

    - `name`: rows are called "name.x" and "name.y".
    - `i`, `j`: names of the bodies, or "ground".
    - `point_i`, `point_j`: the joint's centre in the local frames, m.
    - `pin_radius`: rho, radius at which pin and hole slide, m; needed for friction.
    - `friction`: `Coulomb` with its coefficient mu, or another model.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = FORCE
    slip_kind: ClassVar[str] = "angular"
    read_by_law: ClassVar[tuple[str, ...]] = ("friction", "pin_radius")
    pin_radius: Float[Array, ""] | None = eqx.field(converter=optional_figure("pin_radius"), default=None)
    friction: AbstractFrictionModel | None = None

    def __check_init__(self) -> None:
        check_friction(self.name, self.friction)
        if self.friction is not None and self.pin_radius is None:
            raise RedundaxError(
                f"Argument `pin_radius` of the revolute joint '{self.name}' must be given where the joint has "
                "friction, but it is None: friction acts at that radius. Give 1.0 where mu stands for mu times radius."
            )

        if self.pin_radius is not None:
            with part(f"joint '{self.name}'"):
                not_negative("pin_radius", self.pin_radius)

    @property
    def law(self) -> AbstractFrictionModel | None:
        """The moment about the pin."""
        return None if self.friction is None else self.friction.about(cast(Array, self.pin_radius))

    def pin(self) -> Array | None:
        return self.pin_radius

    def slip(self, i: Pose, j: Pose) -> Array:
        return i.phi - j.phi

    def normal_load(self, multipliers: Array) -> Array:
        return safe_norm(multipliers)


class Translational(AbstractPair, AbstractFrictionalJoint):
    """Translational joint (57): body i slides along a line of body j, perpendicular to `normal`.

    The multiplier "name.perpendicular" is the guide force on body i along the normal at `point_i`, N; "name.angle" is
    minus the guide moment on body i, N m. "name.travel" and friction, "tau name", count along the normal turned
    clockwise by a right angle, on body i: downwards for the normal (1, 0).

    ??? example

        ```python
        rx.Translational(
            "K", "slider", "ground", point_i=(0.0, 0.0), point_j=(0.0, 0.3), normal=(0.0, 1.0),
            guide_length=0.05, friction=rx.Coulomb(0.1),
        )
        ```

    **Arguments:**

    - `name`: rows are called "name.perpendicular" and "name.angle".
    - `i`, `j`: names of the bodies, or "ground".
    - `point_i`: middle of the slider in the frame of i, m.
    - `point_j`: a point of the line in the frame of j, m.
    - `normal`: v_j, unit vector of body j perpendicular to the line; it is normalised.
    - `angle`: psi, angle of body i relative to body j, rad.
    - `guide_length`: distance of the slider's two contacts, m; needed for friction.
    - `friction`: `Coulomb` with its coefficient mu, or another model.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (PERPENDICULAR, ANGLE)
    slip_kind: ClassVar[str] = "linear"
    vectors: ClassVar[tuple[str, ...]] = ("point_i", "point_j", "normal")
    normal: Float[Array, "2"] = eqx.field(converter=unit("normal"))
    angle: Float[Array, ""] = eqx.field(converter=figure("angle"), default=0.0)
    guide_length: Float[Array, ""] | None = eqx.field(converter=optional_figure("guide_length"), default=None)
    friction: AbstractFrictionModel | None = None

    def __check_init__(self) -> None:
        if self.friction is not None and self.guide_length is None:
            raise RedundaxError(
                f"Argument `guide_length` of the translational joint '{self.name}' must be given where the joint "
                "has friction, but it is None: the guide moment presses the slider's two ends."
            )
        if self.guide_length is not None:
            with part(f"joint '{self.name}'"):
                positive("guide_length", self.guide_length)

    def slip(self, i: Pose, j: Pose) -> Array:
        return _travel(self, i, j)

    def normal_load(self, multipliers: Array) -> Array:
        """|N1| + |N2| at the two ends of the guide, N1 + N2 and (N1 - N2) L / 2 being guide force and moment."""
        force, moment = picked(multipliers, self.row_kinds, ("perpendicular", "angle"))
        half, couple = force / 2, moment / cast(Array, self.guide_length)
        return jnp.abs(half + couple) + jnp.abs(half - couple)


class PinInSlot(AbstractPair, AbstractFrictionalJoint):
    """Pin in slot: a point of body i on a line of body j. Its multiplier is the force of the slot on body i along the
    normal, N. A foot on a floor is one that is `one_sided`.

    ??? example

        ```python
        rx.PinInSlot("S", "lever", "ground", point_i=(0.2, 0.0), point_j=(0.0, 0.0), normal=(0.0, 1.0))
        ```

    **Arguments:**

    - `name`: the row is called "name.perpendicular".
    - `i`, `j`: names of the bodies, or "ground".
    - `point_i`: the pin in the frame of i, m.
    - `point_j`: a point of the slot's line in the frame of j, m.
    - `normal`: vector of body j perpendicular to the slot; it is normalised.
    - `friction`: `Coulomb` with its coefficient mu, or another model.
    - `one_sided`: whether the point may leave the line on the side to which the normal points: the slot only pushes,
      and `solve` tells in `contacts` whether it does.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (PERPENDICULAR,)
    slip_kind: ClassVar[str] = "linear"
    vectors: ClassVar[tuple[str, ...]] = ("point_i", "point_j", "normal")
    normal: Float[Array, "2"] = eqx.field(converter=unit("normal"))
    friction: AbstractFrictionModel | None = None
    one_sided: bool = eqx.field(static=True, default=False)  # pyright: ignore[reportIncompatibleMethodOverride]

    @property
    def pushing(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Its one row, where it only pushes."""
        return ("perpendicular",) if self.one_sided else ()

    def slip(self, i: Pose, j: Pose) -> Array:
        return _travel(self, i, j)

    def normal_load(self, multipliers: Array) -> Array:
        return jnp.abs(multipliers[0])


class Fixed(AbstractPair):
    """Fixed joint: two bodies as one. Its multipliers are minus force (N) and moment (N m) on body i, at `point_i`.

    ??? example

        ```python
        rx.Fixed("weld", "lever", "arm", point_i=(0.2, 0.0), point_j=(-0.1, 0.0), angle=0.5)
        ```

    **Arguments:**

    - `name`: rows are called "name.x", "name.y" and "name.angle".
    - `i`, `j`: names of the bodies, or "ground".
    - `point_i`, `point_j`: the common point in the local frames, m.
    - `angle`: psi, angle of body i relative to body j, rad.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (*FORCE, ANGLE)
    angle: Float[Array, ""] = eqx.field(converter=figure("angle"), default=0.0)
