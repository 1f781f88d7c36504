"""Joints that hold directions alone, which files have: axes at an angle, z_i . z_j = cos, and no rotation at all"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...._tools._module import Numbers, as_float
from ..._joints._base import Row
from .._placement import Placement
from .._pose import Pose
from ._base import AbstractPlacedJoint
from ._components import BEND, TWIST


class NoRotation(AbstractPlacedJoint):
    """Two bodies that move without turning relative to each other. Rows bend_1, bend_2, twist."""

    row_kinds: ClassVar[tuple[Row, ...]] = (*BEND, TWIST)
    __init__ = AbstractPlacedJoint.__init__


class AngleOfAxes(AbstractPlacedJoint):
    """Axes of both bodies at an angle, rad, that is neither 0 nor half a turn. Row twist, about their common normal."""

    row_kinds: ClassVar[tuple[Row, ...]] = (TWIST,)
    angle: Float[Array, ""]

    def __init__(self, name: str, i: str, j: str, on_i: Placement, on_j: Placement, *, angle: Numbers):
        self.place(name, i, j, None, on_i, on_j)
        self.angle = as_float(angle, "angle")

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return (self.relative(i, j).turn[2, 2] - jnp.cos(self.angle))[None]
