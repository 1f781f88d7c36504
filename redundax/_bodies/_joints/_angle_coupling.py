"""Coupling of the angles of two bodies, as gears, belts and chains make it, without the forces of teeth or belts

phi_i + ratio phi_j - psi = 0.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._tools._module import figure
from .._body import name_of
from .._pose import Pose
from ._base import AbstractJoint, Row


class AngleCoupling(AbstractJoint[Pose]):
    """Coupling of the angles of two bodies. Its multiplier is minus the moment on body i, N m.

    It stands for what a gear, belt or chain does to the motion of bodies on fixed axes. It passes moments alone: no
    force of teeth or belt loads the bearings, so loads of the bearings lack that force. The moment on body j is
    `ratio` times that on body i; the ground must carry both axes. `GearPair` and `RackAndPinion` have the forces of
    teeth, on axes that may move.

    ??? example

        ```python
        rx.AngleCoupling("mesh", "pinion", "wheel", ratio=3.0)  # the wheel turns three times slower, the other way
        ```

    **Arguments:**

    - `name`: the row is called "name.angle".
    - `i`, `j`: names of the bodies.
    - `ratio`: of the rates -phi_i' / phi_j', for gears the teeth of j over those of i: positive for opposite senses,
      as in an external mesh; negative for equal senses, as with an internal mesh or a belt.
    - `angle`: psi, phi_i + ratio phi_j as assembled, rad.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("angle", "moment"),)
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True, converter=name_of)
    j: str = eqx.field(static=True, converter=name_of)
    ratio: Float[Array, ""] = eqx.field(converter=figure("ratio"))
    angle: Float[Array, ""] = eqx.field(converter=figure("angle"), default=0.0)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return jnp.stack([i.phi + self.ratio * j.phi - self.angle])
