"""Translational joint

    (r_j + R_j s_j - r_i - R_i s_i)^T R_j v_j = 0,   phi_i - phi_j - psi = 0                  (57)

with Jacobian (58) and gamma (59).
"""

from typing import ClassVar, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._tools._errors import RedundaxError
from ..._tools._module import as_float, optional_float, unit
from .._friction_model import AbstractFrictionModel
from .._pose import Pose, perpendicular
from ._base import AbstractFrictionalJoint, Row


class Translational(AbstractFrictionalJoint):
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

    row_kinds: ClassVar[tuple[Row, ...]] = (("perpendicular", "force"), ("angle", "moment"))
    slip_kind: ClassVar[str] = "linear"
    vectors: ClassVar[tuple[str, ...]] = ("point_i", "point_j", "normal")
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    point_i: Float[Array, "2"] = eqx.field(converter=as_float)
    point_j: Float[Array, "2"] = eqx.field(converter=as_float)
    normal: Float[Array, "2"] = eqx.field(converter=unit)
    angle: Float[Array, ""] = eqx.field(converter=as_float, default=0.0)
    guide_length: Float[Array, ""] | None = eqx.field(converter=optional_float, default=None)
    friction: AbstractFrictionModel | None = None

    def __check_init__(self) -> None:
        if self.friction is not None and self.guide_length is None:
            raise RedundaxError(
                f"Argument `guide_length` of the translational joint '{self.name}' must be given where the joint "
                "has friction, but it is None: the guide moment presses the slider's two ends."
            )

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        offset = j.point(self.point_j) - i.point(self.point_i)
        return jnp.stack([offset @ j.rotate(self.normal), i.phi - j.phi - self.angle])

    def slip(self, i: Pose, j: Pose) -> Array:
        axis = -perpendicular(j.rotate(self.normal))
        return (i.point(self.point_i) - j.point(self.point_j)) @ axis

    def normal_load(self, multipliers: Array) -> Array:
        """|N1| + |N2| at the two ends of the guide, N1 + N2 and (N1 - N2) L / 2 being guide force and moment."""
        half, couple = multipliers[0] / 2, multipliers[1] / cast(Array, self.guide_length)
        return jnp.abs(half + couple) + jnp.abs(half - couple)
