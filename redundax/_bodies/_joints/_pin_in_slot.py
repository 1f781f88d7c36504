"""Pin in slot: a point of body i on a line of body j

(r_j + R_j s_j - r_i - R_i s_i)^T R_j v_j = 0.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._tools._module import as_float, unit
from .._friction_model import AbstractFrictionModel
from .._pose import Pose, perpendicular
from ._base import AbstractFrictionalJoint, Row


class PinInSlot(AbstractFrictionalJoint):
    """Pin in slot. Its multiplier is the force of the slot on body i along the normal, N.

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
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("perpendicular", "force"),)
    slip_kind: ClassVar[str] = "linear"
    vectors: ClassVar[tuple[str, ...]] = ("point_i", "point_j", "normal")
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    point_i: Float[Array, "2"] = eqx.field(converter=as_float)
    point_j: Float[Array, "2"] = eqx.field(converter=as_float)
    normal: Float[Array, "2"] = eqx.field(converter=unit)
    friction: AbstractFrictionModel | None = None

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        offset = j.point(self.point_j) - i.point(self.point_i)
        return jnp.stack([offset @ j.rotate(self.normal)])

    def slip(self, i: Pose, j: Pose) -> Array:
        axis = -perpendicular(j.rotate(self.normal))
        return (i.point(self.point_i) - j.point(self.point_j)) @ axis

    def normal_load(self, multipliers: Array) -> Array:
        return jnp.abs(multipliers[0])
