"""Rack and pinion: a mesh whose second gear is infinitely large

    flank (b phi + x cos(alpha)) + y sin(alpha) = const  modulo  2 pi b / z,   b = m z cos(alpha) / 2

with phi the angle of the pinion relative to the rack, and the pinion's axis at x along the rack and y off it in the
frame of the rack. Sign, flanks and friction are those of a pair of gears; eps_j p = m / sin(alpha).
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..._tools._errors import RedundaxError
from ..._tools._module import figure, numpy_of, optional_figure, unit
from ..._tools._numbers import Numeric
from .._friction_model import AbstractFrictionModel
from .._pose import Pose, perpendicular
from ._gear import STANDARD_PRESSURE_ANGLE, AbstractMesh, check_mesh, tip_path, whole


class RackAndPinion(AbstractMesh):
    """A pinion on a rack, with the force of their teeth. Its multiplier is that force along the line of action, N.

    It is positive where the teeth push; flanks and friction are as of `GearPair`. Where the pitch circle of the pinion,
    of radius m z / 2, rolls on the rack's line both flanks touch.

    ??? example

        ```python
        rx.RackAndPinion(
            "drive", "pinion", "rack", point_i=(0.0, 0.0), point_j=(0.0, 0.01), normal=(0.0, 1.0), teeth=20,
            module=0.002,
        )
        ```

    **Arguments:**

    - `name`: the row is called "name.teeth". Force and moment of the reaction on the pinion act at its axis.
    - `i`, `j`: names of the bodies of the pinion and the rack, or "ground".
    - `point_i`: the pinion's axis in the frame of i, m.
    - `point_j`: a point of the rack's pitch line, in the middle of a tooth, in the frame of j, m.
    - `normal`: vector of body j perpendicular to that line, from the rack to the pinion; it is normalised.
    - `teeth`: whole number of the pinion.
    - `module`, `pressure_angle`, `flank`, `sliding_arm`, `friction`, `backlash`: as of `GearPair`.
    - `angle_i`: where the middle of a tooth of the pinion is in its frame, from the x axis, rad.
    """

    vectors: ClassVar[tuple[str, ...]] = ("point_i", "point_j", "normal")
    normal: Float[Array, "2"] = eqx.field(converter=unit("normal"))
    teeth: Int[Array, ""] = eqx.field(converter=whole)
    module: Float[Array, ""] = eqx.field(converter=figure("module"))
    pressure_angle: Float[Array, ""] = eqx.field(converter=figure("pressure_angle"), default=STANDARD_PRESSURE_ANGLE)
    flank: Int[Array, ""] = eqx.field(converter=whole, default=1)
    angle_i: Float[Array, ""] = eqx.field(converter=figure("angle_i"), default=0.0)
    sliding_arm: Float[Array, ""] | None = eqx.field(converter=optional_figure("sliding_arm"), default=None)
    friction: AbstractFrictionModel | None = None
    backlash: Float[Array, ""] | None = eqx.field(converter=optional_figure("backlash"), default=None)

    def __check_init__(self) -> None:
        check_mesh(self)
        if np.shape(self.teeth) != () or np.asarray(self.teeth) <= 0:
            raise RedundaxError(
                f"Argument `teeth` of '{self.name}' must be a positive number, that of the pinion, but is {self.teeth}."
                " Give one for the pinion, which is body i."
            )

    @property
    def contact(self) -> tuple[Numeric, Numeric]:
        xp, radius = numpy_of(self.module, self.pressure_angle), self.module / 2 * self.teeth
        own = tip_path(radius, -1.0, self.module, self.pressure_angle)  # nothing of the rack ends it
        sine = xp.sin(self.pressure_angle)
        other = xp.minimum(self.module / sine, radius * sine)
        return own / self.base_pitch, other / self.base_pitch

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        offset = i.point(self.point_i) - j.point(self.point_j)
        along, off = offset @ j.rotate(-perpendicular(self.normal)), offset @ j.rotate(self.normal)
        towards_rack = jnp.arctan2(-self.normal[1], -self.normal[0])
        rolled = self.base_radii * (i.phi + self.angle_i - j.phi - towards_rack)
        shifted = along * jnp.cos(self.pressure_angle) - self.base_pitch / 2
        above = off - self.module * self.teeth / 2
        return self.of_flanks(rolled + shifted, above * jnp.sin(self.pressure_angle))
