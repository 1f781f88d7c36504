"""Gear pair on fixed axes

phi_i + ratio phi_j - psi = 0.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._body import Pose
from .._module import as_float
from ._base import AbstractJoint, Row


class Gear(AbstractJoint):
    """Gear pair. Its multiplier is minus the gear moment on body i, N m; the ground must carry both axes.

    ??? example

        ```python
        rx.Gear("mesh", "pinion", "wheel", ratio=3.0)  # the wheel turns three times slower, the other way
        ```

    **Arguments:**

    - `name`: the row is called "name.angle".
    - `i`, `j`: names of the wheels' bodies.
    - `ratio`: teeth of j over teeth of i, positive for an external mesh (opposite senses), negative for an
      internal mesh or a belt.
    - `angle`: psi, phi_i + ratio phi_j as assembled, rad.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("angle", "moment"),)
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    ratio: Float[Array, ""] = eqx.field(converter=as_float)
    angle: Float[Array, ""] = eqx.field(converter=as_float, default=0.0)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return jnp.stack([i.phi + self.ratio * j.phi - self.angle])
