"""Hinge: p_i = p_j and parallel axes

with friction mu R_pin N about the axis. N is that of the contact law, an axial force being R_thrust / R_pin of itself.
"""

from typing import ClassVar, cast

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...._tools._module import Numbers
from ..._friction_model import AbstractFrictionModel
from ..._joints._base import Row
from .._body import Body
from .._contact import AbstractContact, ContactSize, EndContacts
from .._placement import Placement, at_reference
from .._pose import Pose
from ._frictional import AbstractFrictionalJoint, pin_bearing
from ._rows import ANGLE, AXIAL, BEND, RADIAL

_ENDS = EndContacts()


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
    free_axes: ClassVar[str] = "across"
    slip_kind: ClassVar[str] = "angular"
    pin_radius: Float[Array, ""] | None
    bearing_length: Float[Array, ""] | None
    thrust_share: Float[Array, ""] | None
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
        pin_radius: Numbers | None = None,
        bearing_length: Numbers | None = None,
        thrust_radius: Numbers | None = None,
        friction: AbstractFrictionModel | None = None,
        contact: AbstractContact = _ENDS,
    ):
        self.place(name, i, j, at_reference(name, point, axis, mark), on_i, on_j)
        self.pin_radius, self.bearing_length, self.thrust_share = pin_bearing(pin_radius, bearing_length, thrust_radius)
        by_term = {"axial": ("thrust_radius", thrust_radius), "bend": ("bearing_length", bearing_length)}
        self.rub(friction, contact, {"pin_radius": pin_radius}, by_term)

    @property
    def law(self) -> AbstractFrictionModel | None:
        return None if self.friction is None else self.friction.about(cast(Array, self.pin_radius))

    @property
    def size(self) -> ContactSize:
        return ContactSize(self.bearing_length, self.thrust_share)

    @property
    def coordinate_kinds(self) -> tuple[Row, ...]:
        return (ANGLE,)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        relative = self.relative(i, j)
        return jnp.concatenate([relative.offset, relative.tilt])

    def coordinates(self, i: Pose, j: Pose) -> Array:
        return self.slip(i, j)[None]

    def slip(self, i: Pose, j: Pose) -> Array:
        return self.relative(i, j).angle
