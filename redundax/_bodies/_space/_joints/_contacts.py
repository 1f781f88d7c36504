"""Joints that hold one or two directions alone: a point on a line or plane, and parallel axes."""

from typing import ClassVar

from jaxtyping import Array

from ..._joints._base import Row
from .._pose import Pose
from ._base import AbstractPlacedJoint


class PointOnLine(AbstractPlacedJoint):
    """A point of body i on the axis of body j. Rows radial_1, radial_2; coordinate "travel".

    ??? example

        ```python
        ram = rx.spatial.Body("ram", 50.0, inertia=(1.0, 1.0, 1.0))
        rx.spatial.PointOnLine("bush", ram, "ground", point=(0.2, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        ```
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("radial_1", "force"), ("radial_2", "force"))
    free_axes: ClassVar[str] = "across"
    __init__ = AbstractPlacedJoint.__init__

    @property
    def coordinate_kinds(self) -> tuple[Row, ...]:
        return (("travel", "linear"),)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return self.relative(i, j).shift

    def coordinates(self, i: Pose, j: Pose) -> Array:
        return self.relative(i, j).travel[None]


class PointOnPlane(AbstractPlacedJoint):
    """A point of body i in the plane of body j that is square to the axis. Row axial.

    ??? example

        ```python
        plate = rx.spatial.Body("plate", 2.0, inertia=(0.1, 0.1, 0.2))
        rx.spatial.PointOnPlane("foot", plate, "ground", point=(0.5, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        ```
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("axial", "force"),)
    __init__ = AbstractPlacedJoint.__init__

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return self.relative(i, j).travel[None]


class ParallelAxes(AbstractPlacedJoint):
    """Axes of both bodies parallel, of the same sense. Rows bend_1, bend_2; coordinate "angle".

    ??? example

        ```python
        plate = rx.spatial.Body("plate", 2.0, inertia=(0.1, 0.1, 0.2))
        rx.spatial.ParallelAxes("level", plate, "ground", point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        ```
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("bend_1", "moment"), ("bend_2", "moment"))
    free_axes: ClassVar[str] = "across"
    __init__ = AbstractPlacedJoint.__init__

    @property
    def coordinate_kinds(self) -> tuple[Row, ...]:
        return (("angle", "angular"),)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return self.relative(i, j).tilt

    def coordinates(self, i: Pose, j: Pose) -> Array:
        return self.relative(i, j).angle[None]
