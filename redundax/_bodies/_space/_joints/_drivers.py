"""Drivers in space: the angle about an axis and the travel along it as functions of time (2)

angle - f(t) = 0, the difference from -pi to pi,   travel - f(t) = 0
"""

from collections.abc import Callable
from typing import ClassVar

from jaxtyping import Array

from ...._tools._module import Numbers
from ..._joints._base import Row
from ..._law_of_time import check_law, law_of_time
from .._body import Body
from .._placement import Placement, at_reference
from .._pose import Pose
from ._base import AbstractPlacedJoint


class AngleDriver(AbstractPlacedJoint):
    """Motor of the angle about an axis. Its multiplier "name.twist" is minus the driving moment on body i, N m.

    Turns are not counted: assemble near the turn that is meant.

    ??? example

        ```python
        crank = rx.spatial.Body("crank", 1.0, inertia=(0.1, 0.1, 0.01))
        rx.spatial.AngleDriver("motor", crank, "ground", (0, 0, 0), (0, 0, 1), angle=rx.Polynomial([0.5, 2.0]))
        ```

    **Arguments:** those of other joints, and

    - `angle`: number, or function of time in jax.numpy, rad; `rx.Polynomial` for one with parameters that compile
      nothing new.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("twist", "moment"),)
    angle: Callable[[Array], Array]

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point: Numbers | None = None,
        axis: Numbers | None = None,
        mark: Numbers | None = None,
        *,
        angle: Callable[[Array], Array] | Numbers,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
    ):
        self.place(name, i, j, at_reference(name, point, axis, mark), on_i, on_j)
        self.angle = law_of_time(angle, "angle")
        check_law("angle", name, self.angle)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return self.relative(i, j).angle_from(self.angle(t))[None]


class TravelDriver(AbstractPlacedJoint):
    """Actuator of the travel along an axis of body j. Its multiplier "name.axial" is minus the driving force on body i,
    N.

    ??? example

        ```python
        ram = rx.spatial.Body("ram", 50.0, inertia=(1.0, 1.0, 1.0))
        rx.spatial.TravelDriver("piston", ram, "ground", (0, 0, 0), (0, 0, 1), travel=rx.Polynomial([0.0, 0.1]))
        ```

    **Arguments:** those of other joints, and

    - `travel`: number, or function of time in jax.numpy, m; `rx.Polynomial` for one with parameters that compile
      nothing new.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("axial", "force"),)
    travel: Callable[[Array], Array]

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point: Numbers | None = None,
        axis: Numbers | None = None,
        mark: Numbers | None = None,
        *,
        travel: Callable[[Array], Array] | Numbers,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
    ):
        self.place(name, i, j, at_reference(name, point, axis, mark), on_i, on_j)
        self.travel = law_of_time(travel, "travel")
        check_law("travel", name, self.travel)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return (self.relative(i, j).travel - self.travel(t))[None]
