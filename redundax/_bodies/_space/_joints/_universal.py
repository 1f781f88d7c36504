"""Universal joint: p_i = p_j, z_i . z_j = 0, the pins of a cross, one on each body

Both pins carry the force F of the joint and its moment T about the normal n = z_i x z_j of the cross: each is a bearing
whose load square to the pin is F less its part along the pin, and whose bending moment is T n.
"""

from typing import ClassVar, Unpack, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from ...._tools._errors import RedundaxError
from ...._tools._module import Numbers, is_concrete
from ..._friction_model import AbstractFrictionModel
from ..._joints._base import Row
from ..._joints._components import picked
from .._contact import ContactLoad
from .._placement import at_reference
from .._pose import Pose
from .._rotation import axes_along
from ._components import AXIAL, RADIAL, TWIST
from ._frictional import AbstractContactJoint, At, End, Ends
from ._surfaces import PIN, PinRubs, Surfaces

_SQUARE = 1e-3  # rad, by which directions of few digits may be off


class Universal(AbstractContactJoint):
    """Cardan joint: a cross whose pins turn in both bodies. Rows radial_1, radial_2, axial, of which axial is along the
    pin of body j, and twist, about the normal of the cross; coordinates "angle_1" of the cross about the pin of body j,
    "angle_2" of body i about its own.

    Each pin has its own friction, "tau name.angle_1" and "tau name.angle_2".

    ??? example

        ```python
        shaft = rx.spatial.Body("shaft", 2.0, inertia=(0.1, 0.1, 0.01))
        rx.spatial.Universal("cross", shaft, "ground", point=(0, 0, 0), axis_i=(1, 0, 0), axis_j=(0, 1, 0))
        pins = {"pin_radius": 0.005, "bearing_length": 0.06, "thrust_radius": 0.004, "friction": rx.Coulomb(0.05)}
        rx.spatial.Universal("cardan", shaft, "ground", point=(0, 0, 0), axis_i=(1, 0, 0), axis_j=(0, 1, 0), **pins)
        ```

    **Arguments:**

    - `name`, `i`, `j`: as of other joints.
    - `point`: the middle of the cross, global, m, at the reference pose of the bodies.
    - `axis_i`, `axis_j`: directions of the pins on the bodies, likewise, square to each other; x and y if not given.
    - `on_i`, `on_j`: in place of these the `Placement` on each body, z along its pin, x along the other where angles
      are 0.
    - `pin_radius`, `thrust_radius`: of both pins, as of `Revolute`, m; needed for friction.
    - `bearing_length`: distance of the two bearings of a pin, m; needed for friction.
    - `friction`: `Coulomb` with its coefficient mu, or another model.
    - `contact`: the law for the normal load of each pin, and which terms it has.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (*RADIAL, AXIAL, TWIST)
    free_axes: ClassVar[str] = "across"
    coordinate_kinds: ClassVar[tuple[Row, ...]] = (("angle_1", "angular"), ("angle_2", "angular"))
    slip_kinds: ClassVar[tuple[Row, ...]] = coordinate_kinds
    surfaces: ClassVar[Surfaces] = PIN
    read_by_law: ClassVar[tuple[str, ...]] = ("friction", "pin_radius")
    pin_radius: Float[Array, ""] | None
    bearing_length: Float[Array, ""] | None
    thrust_share: Float[Array, ""] | None

    def __init__(
        self, name: str, i: End, j: End, point: At = None, axis_i: At = None, axis_j: At = None, **rubs: Unpack[PinRubs]
    ):
        if point is not None:
            axis_i = (1.0, 0.0, 0.0) if axis_i is None else axis_i
            axis_j = (0.0, 1.0, 0.0) if axis_j is None else axis_j
            _check_pins(name, axis_i, axis_j)
        given = at_reference(name, point, axis_i, axis_j), at_reference(name, point, axis_j, axis_i)
        self.make(name, i, j, given, **rubs)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        relative = self.relative(i, j)
        return jnp.append(relative.offset, relative.turn[2, 2])

    def coordinates(self, i: Pose, j: Pose) -> Float[Array, "2"]:
        """Angles at both pins."""
        turn = self.relative(i, j).turn
        return jnp.stack([jnp.arctan2(turn[1, 2], turn[0, 2]), jnp.arctan2(-turn[2, 1], turn[2, 0])])

    @property
    def reads_pose(self) -> bool:
        return True

    def slips(self, i: Pose, j: Pose) -> Array:
        return self.coordinates(i, j)

    def forces(
        self, model: AbstractFrictionModel, ends: Ends | None, loads: Array, rate: Array, sense: Array, memory: PyTree
    ) -> Float[Array, "2"]:
        """Friction moments at both pins."""
        normal = jnp.zeros(2, rate.dtype)
        if model.depends_on_load:
            normal = jnp.stack(
                [self.contact.normal_load(load, self.size) for load in self._pins(loads, cast(Ends, ends))]
            )
        return eqx.filter_vmap(model.force)(normal, rate, sense, memory)

    def largest_changes(
        self, model: AbstractFrictionModel, ends: Ends | None, change: Array, rate: Array, memory: PyTree
    ) -> Float[Array, "2"]:
        """Bounds of the changes of friction by a change of the multipliers."""
        if not model.depends_on_load:
            return jnp.zeros(2, rate.dtype)
        most = jnp.stack(
            [self.contact.largest_change(load, self.size) for load in self._pins(change, cast(Ends, ends))]
        )
        slope = eqx.filter_vmap(model.slope_bound)(rate, memory)
        return jnp.where(slope == 0, 0.0, slope * most)

    def memory_rates(self, model: AbstractFrictionModel, rate: Array, memory: PyTree) -> PyTree:
        """Rates of change of the internal states of both pins."""
        return eqx.filter_vmap(model.memory_rate)(rate, memory)

    def _pins(self, multipliers: Array, ends: tuple[Pose, Pose]) -> tuple[ContactLoad, ContactLoad]:
        """Loads of the pins of body j and of body i; the axes of the latter are n, -z_j and z_i."""
        zero, (twist,) = jnp.zeros((), multipliers.dtype), picked(multipliers, self.row_kinds, ("twist",))
        z = self.relative(*ends).turn[:, 2]
        normal = jnp.stack([z[1], -z[0], zero])
        force = picked(multipliers, self.row_kinds, ("radial_1", "radial_2", "axial"))
        across = jnp.stack([force @ normal, -force[2]])
        return (
            ContactLoad(force[:2], force[2], twist * normal[:2], zero),
            ContactLoad(across, force @ z, jnp.stack([twist, zero]), zero),
        )


def _check_pins(name: str, axis_i: Numbers, axis_j: Numbers) -> None:
    """Refuse pins that are not square to each other, and directions that are none."""
    one, other = (axes_along(argument, axis)[:, 2] for argument, axis in (("axis_i", axis_i), ("axis_j", axis_j)))
    if is_concrete(one) and is_concrete(other) and abs(float(one @ other)) > _SQUARE:
        raise RedundaxError(
            f"Arguments `axis_i` and `axis_j` of joint '{name}' must be square to each other, but have an angle of "
            f"{np.arccos(float(one @ other)):.6g} rad. Give the directions of the two pins of the cross."
        )
