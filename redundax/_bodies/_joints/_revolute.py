"""Revolute joint

    r_i + R_i s_i - r_j - R_j s_j = 0                                                       (53)

with Jacobian (55), gamma (56) and friction moment (41) about its axis.
"""

from typing import ClassVar, cast

import equinox as eqx
from jaxtyping import Array, Float

from ..._tools._errors import RedundaxError
from ..._tools._module import as_float, not_negative, optional_float, part, safe_norm
from .._friction_model import AbstractFrictionModel
from .._pose import Pose
from ._base import AbstractFrictionalJoint, Row, check_friction


class Revolute(AbstractFrictionalJoint):
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

    row_kinds: ClassVar[tuple[Row, ...]] = (("x", "force"), ("y", "force"))
    slip_kind: ClassVar[str] = "angular"
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    point_i: Float[Array, "2"] = eqx.field(converter=as_float)
    point_j: Float[Array, "2"] = eqx.field(converter=as_float)
    pin_radius: Float[Array, ""] | None = eqx.field(converter=optional_float, default=None)
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

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return i.point(self.point_i) - j.point(self.point_j)

    def slip(self, i: Pose, j: Pose) -> Array:
        return i.phi - j.phi

    def normal_load(self, multipliers: Array) -> Array:
        return safe_norm(multipliers)
