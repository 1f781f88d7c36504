"""Nut on a spindle: travel - h angle = 0 modulo the pitch p, h = p / (2 pi)

    slip = (h travel + r^2 angle) / w,   w = sqrt(r^2 + h^2),   N = |F_axial| w / (r cos flank) + the rest

r being the mean radius of the thread, whose flanks slide along their helix. To raise a load F takes the moment
F r tan(lead + friction angle).
"""

from typing import ClassVar, Unpack

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...._tools._errors import RedundaxError
from ...._tools._module import Numbers, as_float, is_concrete, one_number
from ..._joints._base import Row
from .._contact import ContactSize
from .._placement import at_reference
from .._pose import Pose
from ._components import ANGLE, AXIAL, BEND, RADIAL, TRAVEL
from ._frictional import AbstractFrictionalJoint, At, End
from ._surfaces import THREAD, Surfaces, ThreadRubs


class Screw(AbstractFrictionalJoint):
    """Nut on a spindle: travels by `pitch` a turn. Rows radial_1, radial_2, axial, bend_1, bend_2; coordinates "angle",
    from -pi to pi, and "travel".

        axial = pitch / (2 pi) times (2 pi travel / pitch - angle), the difference from -pi to pi

    so that turns need not be counted: a travel of whole pitches is closed at the same angle. Friction, "tau name", is
    a force along the helix of the thread, N, positive with the angle.

    ??? example

        ```python
        nut = rx.spatial.Body("nut", 0.5, inertia=(1e-3, 1e-3, 1e-3))
        rx.spatial.Screw("spindle", nut, "ground", point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), pitch=0.005)
        rubs = {"thread_radius": 0.009, "bearing_length": 0.03, "friction": rx.Coulomb(0.12)}
        rx.spatial.Screw("jack", nut, "ground", point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), pitch=0.005, **rubs)
        ```

    **Arguments:** those of the other pairs, `point` being the middle of the nut where it is body i, and

    - `pitch`: travel along the axis by a turn about it, m; negative for a left-handed thread.
    - `thread_radius`: mean radius of the thread, m; needed for friction.
    - `flank_angle`: of the flanks from a square thread's, rad: half the angle of the thread.
    - `bearing_length`: distance of both ends of the nut, which bending moments press, m; needed for friction.
    - `friction`: `Coulomb` with its coefficient mu, or another model.
    - `contact`: the law for the normal load, and which terms it has.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (*RADIAL, AXIAL, *BEND)
    coordinate_kinds: ClassVar[tuple[Row, ...]] = (ANGLE, TRAVEL)
    free_axes: ClassVar[str] = "across"
    slip_kind: ClassVar[str] = "linear"
    surfaces: ClassVar[Surfaces] = THREAD
    pitch: Float[Array, ""]
    thread_radius: Float[Array, ""] | None
    flank_angle: Float[Array, ""]
    bearing_length: Float[Array, ""] | None

    def __init__(
        self,
        name: str,
        i: End,
        j: End,
        point: At = None,
        axis: At = None,
        mark: At = None,
        *,
        pitch: Numbers,
        flank_angle: Numbers = 0.0,
        **rubs: Unpack[ThreadRubs],
    ):
        self.make(name, i, j, [at_reference(name, point, axis, mark)] * 2, **rubs)
        self.pitch, self.flank_angle = as_float(pitch, "pitch"), as_float(flank_angle, "flank_angle")
        one_number("pitch", self.pitch)
        if is_concrete(self.pitch) and not np.asarray(self.pitch):
            raise RedundaxError(
                f"Argument `pitch` of joint '{name}' must not be 0. Make a joint without travel a `Revolute`."
            )

    @property
    def size(self) -> ContactSize:
        if self.thread_radius is None:
            return ContactSize(self.bearing_length)
        along = jnp.hypot(self.thread_radius, self._lead)
        return ContactSize(self.bearing_length, along / (self.thread_radius * jnp.cos(self.flank_angle)))

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        relative = self.relative(i, j)
        axial = -self._lead * relative.angle_from(relative.travel / self._lead)
        return jnp.concatenate([relative.shift, axial[None], relative.tilt])

    def slip(self, i: Pose, j: Pose) -> Array:
        relative, radius = self.relative(i, j), jnp.asarray(self.thread_radius)
        along = jnp.hypot(radius, self._lead)
        return (self._lead * relative.travel + radius**2 * relative.angle) / along

    @property
    def _lead(self) -> Array:
        """Travel by a radian, m."""
        return self.pitch / (2 * jnp.pi)
