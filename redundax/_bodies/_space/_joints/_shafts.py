"""Constant velocity joint of shafts at an angle: p_i = p_j, and body i turns about the axes by as much as body j

so that there is no twist about the bisector of the axes.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from ..._joints._base import Row
from .._pose import Pose
from ._base import AbstractPlacedJoint
from ._rows import AXIAL, RADIAL, TWIST


class ConstantVelocity(AbstractPlacedJoint):
    """Homokinetic joint: shafts at an angle turn alike, and their points stay together. Rows radial_1, radial_2, axial,
    twist.


    ??? example

        ```python
        shaft = rx.spatial.Body("shaft", 2.0, inertia=(0.1, 0.1, 0.01))
        rx.spatial.ConstantVelocity("joint", shaft, "ground", point=(0, 0, 0), axis=(0, 0, 1))
        ```
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (*RADIAL, AXIAL, TWIST)
    free_axes: ClassVar[str] = "across"
    __init__ = AbstractPlacedJoint.__init__

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        relative = self.relative(i, j)
        return jnp.append(relative.offset, relative.angle)
