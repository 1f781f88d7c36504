"""Pairs of bodies whose surfaces slide in several directions: sleeve, ball and plate, and what each leaves free

radial_1, radial_2, axial    forces along x, y and the axis z
bend_1, bend_2, twist        moments about x, y and the axis z
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...._tools._module import Numbers, optional_float, safe_norm
from ..._friction_model import AbstractFrictionModel
from ..._joints._base import Row
from .._body import Body
from .._contact import AbstractContact, ContactLoad, ContactSize, EndContacts
from .._overlap import Overlap, length_or_overlap
from .._placement import Placement, at_reference
from .._pose import Pose
from ._rows import ANGLE, AXIAL, BEND, RADIAL, TRAVEL
from ._sliding import AbstractSlidingJoint

_ENDS = EndContacts()


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
    free_axes: ClassVar[str] = "across"
    slip_kinds: ClassVar[tuple[Row, ...]] = (ANGLE, TRAVEL)
    bearing_length: Float[Array, ""] | Overlap | None
    shaft_radius: Float[Array, ""] | None
    friction: AbstractFrictionModel | None
    contact: AbstractContact

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point: Numbers | None = None,
        axis: Numbers | None = None,
        mark: Numbers | None = None,
        *,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
        shaft_radius: Numbers | None = None,
        bearing_length: Numbers | Overlap | None = None,
        friction: AbstractFrictionModel | None = None,
        contact: AbstractContact = _ENDS,
    ):
        self.place(name, i, j, at_reference(name, point, axis, mark), on_i, on_j)
        self.shaft_radius, self.bearing_length = optional_float(shaft_radius), length_or_overlap(bearing_length)
        self.rub(friction, contact, {"shaft_radius": shaft_radius}, {"bend": ("bearing_length", bearing_length)})

    @property
    def size(self) -> ContactSize:
        return ContactSize(None if isinstance(self.bearing_length, Overlap) else self.bearing_length)

    @property
    def overlap(self) -> Overlap | None:
        return self.bearing_length if isinstance(self.bearing_length, Overlap) else None

    @property
    def arms(self) -> Array:
        radius = jnp.asarray(self.shaft_radius)
        return jnp.stack([radius, jnp.ones_like(radius)])

    @property
    def coordinate_kinds(self) -> tuple[Row, ...]:
        return (ANGLE, TRAVEL)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        relative = self.relative(i, j)
        return jnp.concatenate([relative.shift, relative.tilt])

    def coordinates(self, i: Pose, j: Pose) -> Array:
        return self.slip(i, j)

    def slip(self, i: Pose, j: Pose) -> Array:
        relative = self.relative(i, j)
        return jnp.stack([relative.angle, relative.travel])


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
    slip_kinds: ClassVar[tuple[Row, ...]] = (("bend_1", "angular"), ("bend_2", "angular"), ("twist", "angular"))
    has_spin: ClassVar[bool] = True
    ball_radius: Float[Array, ""] | None
    friction: AbstractFrictionModel | None
    contact: AbstractContact

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point: Numbers | None = None,
        axis: Numbers | None = None,
        mark: Numbers | None = None,
        *,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
        ball_radius: Numbers | None = None,
        friction: AbstractFrictionModel | None = None,
    ):
        self.place(name, i, j, at_reference(name, point, axis, mark), on_i, on_j)
        self.ball_radius = optional_float(ball_radius)
        self.rub(friction, _ENDS, {"ball_radius": ball_radius}, {})

    @property
    def size(self) -> ContactSize:
        return ContactSize()

    def load(self, multipliers: Array) -> ContactLoad:
        zero = jnp.zeros((), multipliers.dtype)
        return ContactLoad(multipliers, zero, jnp.zeros(2, multipliers.dtype), zero)

    @property
    def law(self) -> AbstractFrictionModel | None:
        return None if self.friction is None else self.friction.about(jnp.asarray(self.ball_radius))

    @property
    def arms(self) -> Array:
        return jnp.ones(3, self.point_i.dtype)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return self.relative(i, j).offset

    def slip(self, i: Pose, j: Pose) -> Array:
        return self.relative(i, j).spin


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
    free_axes: ClassVar[str] = "across"
    slip_kinds: ClassVar[tuple[Row, ...]] = (("travel_1", "linear"), ("travel_2", "linear"), ANGLE)
    plate_length: Float[Array, ""] | None
    spin_radius: Float[Array, ""] | None
    friction: AbstractFrictionModel | None
    contact: AbstractContact

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point: Numbers | None = None,
        axis: Numbers | None = None,
        mark: Numbers | None = None,
        *,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
        plate_length: Numbers | None = None,
        spin_radius: Numbers | None = None,
        friction: AbstractFrictionModel | None = None,
        contact: AbstractContact = _ENDS,
    ):
        self.place(name, i, j, at_reference(name, point, axis, mark), on_i, on_j)
        self.plate_length, self.spin_radius = optional_float(plate_length), optional_float(spin_radius)
        self.rub(friction, contact, {"spin_radius": spin_radius}, {"bend": ("plate_length", plate_length)})

    @property
    def size(self) -> ContactSize:
        return ContactSize(self.plate_length)

    def load(self, multipliers: Array) -> ContactLoad:
        zero = jnp.zeros((), multipliers.dtype)
        pressed, tips = jnp.stack([multipliers[0], zero]), jnp.stack([zero, safe_norm(multipliers[1:])])
        return ContactLoad(pressed, zero, tips, zero)

    @property
    def arms(self) -> Array:
        radius = jnp.asarray(self.spin_radius)
        return jnp.stack([jnp.ones_like(radius), jnp.ones_like(radius), radius])

    @property
    def coordinate_kinds(self) -> tuple[Row, ...]:
        return (("travel_1", "linear"), ("travel_2", "linear"), ANGLE)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        relative = self.relative(i, j)
        return jnp.concatenate([relative.travel[None], relative.tilt])

    def coordinates(self, i: Pose, j: Pose) -> Array:
        return self.slip(i, j)

    def slip(self, i: Pose, j: Pose) -> Array:
        relative = self.relative(i, j)
        return jnp.concatenate([relative.shift, relative.angle[None]])
