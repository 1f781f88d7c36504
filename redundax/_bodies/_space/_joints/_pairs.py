"""Lower pairs in space, by what they lock: the components of the relative pose that their rows name

Those that rub name their surfaces; friction is mu N about or along what they leave free, N by the contact law.
"""

from typing import ClassVar, Unpack

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._body import name_of
from ..._friction_model import AbstractFrictionModel
from ..._joints._base import Row
from .._overlap import Overlap
from .._placement import Placement, at_reference
from .._pose import Pose
from ._base import AbstractJoint, AbstractPlacedJoint
from ._components import ANGLE, AXIAL, BEND, RADIAL, SPIN, TRAVEL, TRAVELS, TWIST
from ._frictional import AbstractFrictionalJoint, AbstractSlidingJoint, At, End
from ._surfaces import (
    BALL,
    GUIDE,
    PIN,
    PLATE,
    POINT,
    SLEEVE,
    BallRubs,
    GuideRubs,
    PinRubs,
    PlateRubs,
    SleeveRubs,
    Surfaces,
)


class Revolute(AbstractFrictionalJoint):
    """Hinge: body i turns about an axis of body j. Rows radial_1, radial_2, axial, bend_1, bend_2; coordinate "angle".

    ??? example

        ```python
        door = rx.spatial.Body("door", 20.0, inertia=(6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0))
        rx.spatial.Revolute("top", door, "ground", point=(0.0, 0.0, 1.8), axis=(0.0, 0.0, 1.0))
        bearing = {"pin_radius": 0.006, "bearing_length": 0.05, "thrust_radius": 0.008, "friction": rx.Coulomb(0.2)}
        rx.spatial.Revolute("low", door, "ground", point=(0.0, 0.0, 0.2), axis=(0.0, 0.0, 1.0), **bearing)
        ```

    **Arguments:** those of the other pairs, `point` being the middle of the bearing, and

    - `pin_radius`: at which pin and hole slide, m; needed for friction.
    - `bearing_length`: distance of both ends of the bearing, which bending moments press, m; needed for friction.
    - `thrust_radius`: at which an axial force rubs, m; needed for friction.
    - `friction`: `Coulomb` with its coefficient mu, or another model.
    - `contact`: the law for the normal load, and which terms it has.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (*RADIAL, AXIAL, *BEND)
    coordinate_kinds: ClassVar[tuple[Row, ...]] = (ANGLE,)
    free_axes: ClassVar[str] = "across"
    slip_kind: ClassVar[str] = "angular"
    surfaces: ClassVar[Surfaces] = PIN
    read_by_law: ClassVar[tuple[str, ...]] = ("friction", "pin_radius")
    pin_radius: Float[Array, ""] | None
    bearing_length: Float[Array, ""] | None
    thrust_share: Float[Array, ""] | None

    def __init__(
        self, name: str, i: End, j: End, point: At = None, axis: At = None, mark: At = None, **rubs: Unpack[PinRubs]
    ):
        self.make(name, i, j, [at_reference(name, point, axis, mark)] * 2, **rubs)


class Prismatic(AbstractFrictionalJoint):
    """Slider: body i slides along an axis of body j. Rows radial_1, radial_2, bend_1, bend_2, twist; coordinate
    "travel".

    ??? example

        ```python
        ram = rx.spatial.Body("ram", 50.0, inertia=(1.0, 1.0, 1.0))
        rx.spatial.Prismatic("guide", ram, "ground", point=(0.2, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        rubs = {"guide_length": 0.1, "twist_radius": 0.03, "friction": rx.Coulomb(0.1)}
        rx.spatial.Prismatic("gib", ram, "ground", point=(0.2, 0.0, 0.0), axis=(0.0, 0.0, 1.0), **rubs)
        ```

    **Arguments:** those of the other pairs, `point` being the middle of the slider, which goes with body i, and

    - `guide_length`: distance of the slider's two contacts, which bending moments press, m, or an `Overlap` where it
      changes with the travel; needed for friction.
    - `twist_radius`: distance from the axis at which a twisting moment presses, m; needed for friction.
    - `friction`: `Coulomb` with its coefficient mu, or another model.
    - `contact`: the law for the normal load, and which terms it has.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (*RADIAL, *BEND, TWIST)
    coordinate_kinds: ClassVar[tuple[Row, ...]] = (TRAVEL,)
    free_axes: ClassVar[str] = "across"
    slip_kind: ClassVar[str] = "linear"
    surfaces: ClassVar[Surfaces] = GUIDE
    guide_length: Float[Array, ""] | Overlap | None
    twist_radius: Float[Array, ""] | None

    def __init__(
        self, name: str, i: End, j: End, point: At = None, axis: At = None, mark: At = None, **rubs: Unpack[GuideRubs]
    ):
        self.make(name, i, j, [at_reference(name, point, axis, mark)] * 2, **rubs)


class Cylindrical(AbstractSlidingJoint):
    """Shaft in a sleeve: turns about and slides along an axis. Rows radial_1, radial_2, bend_1, bend_2; coordinates
    "angle" and "travel".

    Friction is against the velocity (shaft_radius times the rate of the angle, rate of the travel): its moment is "tau
    name.angle", its force "tau name.travel".

    ??? example

        ```python
        ram = rx.spatial.Body("ram", 50.0, inertia=(1.0, 1.0, 1.0))
        rx.spatial.Cylindrical("column", ram, "ground", point=(0.2, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        rubs = {"shaft_radius": 0.02, "bearing_length": 0.1, "friction": rx.Coulomb(0.1)}
        rx.spatial.Cylindrical("sleeve", ram, "ground", point=(0.2, 0.0, 0.0), axis=(0.0, 0.0, 1.0), **rubs)
        ```

    **Arguments:** those of the other pairs, `point` being the middle of the sleeve where it is body i, and

    - `shaft_radius`, `bearing_length`: of the shaft, and distance of both ends of the sleeve, m, or an `Overlap` where
      it changes with the travel; needed for friction.
    - `friction`: `Coulomb` with its coefficient mu, or another model.
    - `contact`: the law for the normal load, and which terms it has.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (*RADIAL, *BEND)
    coordinate_kinds: ClassVar[tuple[Row, ...]] = (ANGLE, TRAVEL)
    free_axes: ClassVar[str] = "across"
    slip_kinds: ClassVar[tuple[Row, ...]] = (ANGLE, TRAVEL)
    surfaces: ClassVar[Surfaces] = SLEEVE
    bearing_length: Float[Array, ""] | Overlap | None
    shaft_radius: Float[Array, ""] | None

    def __init__(
        self, name: str, i: End, j: End, point: At = None, axis: At = None, mark: At = None, **rubs: Unpack[SleeveRubs]
    ):
        self.make(name, i, j, [at_reference(name, point, axis, mark)] * 2, **rubs)


class Spherical(AbstractSlidingJoint):
    """Ball joint: two points together. Rows radial_1, radial_2, axial; the axis says their directions alone.

    Friction is a moment against the relative angular velocity, as in industrial programs: "tau name.bend_1", "tau
    name.bend_2" and "tau name.twist" about the axes of the joint.

    ??? example

        ```python
        rod = rx.spatial.Body("rod", 1.0, inertia=(0.1, 0.1, 0.0))
        rx.spatial.Spherical("ball", rod, "ground", point=(0.0, 0.0, 0.0))
        rx.spatial.Spherical("eye", rod, "ground", point=(0.0, 0.0, 0.0), ball_radius=0.01, friction=rx.Coulomb(0.1))
        ```

    **Arguments:** those of the other pairs, and

    - `ball_radius`: m; needed for friction.
    - `friction`: `Coulomb` with its coefficient mu, or another model.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (*RADIAL, AXIAL)
    free_axes: ClassVar[str] = "all"
    slip_kinds: ClassVar[tuple[Row, ...]] = SPIN
    has_spin: ClassVar[bool] = True
    surfaces: ClassVar[Surfaces] = BALL
    ball_radius: Float[Array, ""] | None

    def __init__(
        self, name: str, i: End, j: End, point: At = None, axis: At = None, mark: At = None, **rubs: Unpack[BallRubs]
    ):
        self.make(name, i, j, [at_reference(name, point, axis, mark)] * 2, **rubs)


class Planar(AbstractSlidingJoint):
    """Plate on a table square to the axis. Rows axial, bend_1, bend_2; coordinates "travel_1" and "travel_2" along x
    and y, and "angle".

    Friction is against the velocity (rates of both travels, spin_radius times the rate of the angle). A moment presses
    both sides of the plate: |N_1| + |N_2| with N_1,2 = F / 2 +- |M| / plate_length.

    ??? example

        ```python
        plate = rx.spatial.Body("plate", 2.0, inertia=(0.1, 0.1, 0.2))
        rx.spatial.Planar("table", plate, "ground", point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        rubs = {"plate_length": 0.3, "spin_radius": 0.1, "friction": rx.Coulomb(0.1)}
        rx.spatial.Planar("slab", plate, "ground", point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), **rubs)
        ```

    **Arguments:** those of the other pairs, `point` being the middle of the plate where it is body i, and

    - `plate_length`: distance of two sides of the plate, which moments press, m; needed for friction.
    - `spin_radius`: at which friction acts as the plate spins, m; 2/3 of the radius of a disc; needed for friction.
    - `friction`: `Coulomb` with its coefficient mu, or another model.
    - `contact`: the law for the normal load, and which terms it has; `radial` is the force on the table.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (AXIAL, *BEND)
    coordinate_kinds: ClassVar[tuple[Row, ...]] = (*TRAVELS, ANGLE)
    free_axes: ClassVar[str] = "across"
    slip_kinds: ClassVar[tuple[Row, ...]] = (*TRAVELS, ANGLE)
    surfaces: ClassVar[Surfaces] = PLATE
    plate_length: Float[Array, ""] | None
    spin_radius: Float[Array, ""] | None

    def __init__(
        self, name: str, i: End, j: End, point: At = None, axis: At = None, mark: At = None, **rubs: Unpack[PlateRubs]
    ):
        self.make(name, i, j, [at_reference(name, point, axis, mark)] * 2, **rubs)


class Fixed(AbstractPlacedJoint):
    """Two bodies as one. Rows radial_1, radial_2, axial, bend_1, bend_2, twist.

    ??? example

        ```python
        plate = rx.spatial.Body("plate", 2.0, inertia=(0.1, 0.1, 0.2))
        rx.spatial.Fixed("weld", plate, "ground", point=(0.0, 0.0, 0.0))
        ```
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (*RADIAL, AXIAL, *BEND, TWIST)
    free_axes: ClassVar[str] = "all"
    __init__ = AbstractPlacedJoint.__init__


class PointOnLine(AbstractPlacedJoint):
    """A point of body i on the axis of body j. Rows radial_1, radial_2; coordinate "travel".

    ??? example

        ```python
        ram = rx.spatial.Body("ram", 50.0, inertia=(1.0, 1.0, 1.0))
        rx.spatial.PointOnLine("bush", ram, "ground", point=(0.2, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        ```
    """

    row_kinds: ClassVar[tuple[Row, ...]] = RADIAL
    coordinate_kinds: ClassVar[tuple[Row, ...]] = (TRAVEL,)
    free_axes: ClassVar[str] = "across"
    __init__ = AbstractPlacedJoint.__init__


class PointOnPlane(AbstractSlidingJoint):
    """A point of body i in the plane of body j that is square to the axis. Row axial; coordinates "travel_1" and
    "travel_2" along x and y.

    Friction is against the velocity of the point along the plane: "tau name.travel_1" and "tau name.travel_2".

    ??? example

        ```python
        plate = rx.spatial.Body("plate", 2.0, inertia=(0.1, 0.1, 0.2))
        rx.spatial.PointOnPlane("foot", plate, "ground", point=(0.5, 0.0, 0.0), axis=(0.0, 0.0, 1.0), one_sided=True)
        ```

    **Arguments:** those of the other pairs, and

    - `friction`: `Coulomb` with its coefficient mu, or another model.
    - `one_sided`: whether the point may leave the plane on the side to which the axis points, as a foot does a floor:
      the plane only pushes, its multiplier is positive where it does, and `solve` tells in `contacts` whether it does.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (AXIAL,)
    coordinate_kinds: ClassVar[tuple[Row, ...]] = TRAVELS
    slip_kinds: ClassVar[tuple[Row, ...]] = TRAVELS
    surfaces: ClassVar[Surfaces] = POINT
    one_sided: bool = eqx.field(static=True, default=False)  # pyright: ignore[reportIncompatibleMethodOverride]

    def __init__(
        self,
        name: str,
        i: End,
        j: End,
        point: At = None,
        axis: At = None,
        mark: At = None,
        *,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
        friction: AbstractFrictionModel | None = None,
        one_sided: bool = False,
    ):
        self.one_sided = one_sided  # pyright: ignore[reportIncompatibleMethodOverride]
        self.make(name, i, j, [at_reference(name, point, axis, mark)] * 2, on_i, on_j, friction=friction)

    @property
    def pushing(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Its one row, where it only pushes."""
        return ("axial",) if self.one_sided else ()

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        travel = self.relative(i, j).travel[None]
        return -travel if self.one_sided else travel


class ParallelAxes(AbstractPlacedJoint):
    """Axes of both bodies parallel, of the same sense. Rows bend_1, bend_2; coordinate "angle".

    ??? example

        ```python
        plate = rx.spatial.Body("plate", 2.0, inertia=(0.1, 0.1, 0.2))
        rx.spatial.ParallelAxes("level", plate, "ground", point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        ```
    """

    row_kinds: ClassVar[tuple[Row, ...]] = BEND
    coordinate_kinds: ClassVar[tuple[Row, ...]] = (ANGLE,)
    free_axes: ClassVar[str] = "across"
    __init__ = AbstractPlacedJoint.__init__


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


class Free(AbstractJoint):
    """No hold at all: a body that floats. It has no rows.

    ??? example

        ```python
        ball = rx.spatial.Body("ball", 0.4, inertia=(1e-3, 1e-3, 1e-3))
        rx.spatial.Free("flight", ball, "ground")
        ```

    **Arguments:**

    - `name`: any word.
    - `i`, `j`: the body that floats, and any other or "ground"; their names do.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = ()
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True, converter=name_of)
    j: str = eqx.field(static=True, converter=name_of)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return jnp.zeros(0)
