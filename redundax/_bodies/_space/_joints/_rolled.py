"""Travel by a turn, modulo whole turns, which files have of racks and of threads: x + R a = 0"""

from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ...._tools._module import Numbers, as_float
from ..._joints._base import Row
from .._placement import Placement
from .._pose import Pose
from ._base import AbstractPlacedJoint
from ._components import AXIAL, RADIAL


class AbstractRolled(AbstractPlacedJoint):
    """A body i whose offset along an axis of body j is -R by a radian of its turn about z: a row of that force."""

    along: eqx.AbstractClassVar[int]
    radius: Float[Array, ""]

    def __init__(self, name: str, i: str, j: str, on_i: Placement, on_j: Placement, *, radius: Numbers):
        self.place(name, i, j, None, on_i, on_j)
        self.radius = as_float(radius, "radius")

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        relative = self.relative(i, j)
        return (self.radius * relative.angle_from(-relative.offset[self.along] / self.radius))[None]


class Rack(AbstractRolled):
    """A pinion i on a rack j along its x. Row radial_1, the force of the teeth."""

    row_kinds: ClassVar[tuple[Row, ...]] = RADIAL[:1]
    along: ClassVar[int] = 0
    __init__ = AbstractRolled.__init__


class Thread(AbstractRolled):
    """A thread alone, without a guide. Row axial."""

    row_kinds: ClassVar[tuple[Row, ...]] = (AXIAL,)
    along: ClassVar[int] = 2
    __init__ = AbstractRolled.__init__
