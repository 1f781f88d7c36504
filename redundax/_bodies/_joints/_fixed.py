"""Fixed joint: two bodies as one

r_i + R_i s_i - r_j - R_j s_j = 0,   phi_i - phi_j - psi = 0.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._tools._module import as_float
from .._pose import Pose
from ._base import AbstractJoint, Row


class Fixed(AbstractJoint):
    """Fixed joint. Its multipliers are minus force (N) and moment (N m) on body i, at `point_i`.

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

    row_kinds: ClassVar[tuple[Row, ...]] = (("x", "force"), ("y", "force"), ("angle", "moment"))
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    point_i: Float[Array, "2"] = eqx.field(converter=as_float)
    point_j: Float[Array, "2"] = eqx.field(converter=as_float)
    angle: Float[Array, ""] = eqx.field(converter=as_float, default=0.0)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        offset = i.point(self.point_i) - j.point(self.point_j)
        return jnp.append(offset, i.phi - j.phi - self.angle)
