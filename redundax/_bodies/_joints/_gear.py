"""Gears with involute teeth: a mesh is a crossed belt between base circles

    flank (b_i (phi_i - theta) + b_j (phi_j - theta)) + R (tan alpha - alpha) = const  modulo  2 pi b_i / z_i
    R = b_i + b_j,   cos alpha = |R| / d,   b = m z cos(alpha_0) / 2

with numbers of teeth z, module m, pressure angle alpha_0 of the teeth and alpha of the mesh; d and theta are length and
direction of the line from the gear axis on body i to that on body j. The row is minus that: its gradient is the line of
action, tangent to both base circles, and its multiplier the force along it that presses the teeth together. Teeth push:
a negative one belongs to the other flanks. A ring has z_j < 0 and with it b_j < 0.

Teeth slide on each other at |phi_i' - phi_j'| times the distance of their contact from the pitch point. Friction takes
the mean of that distance over the path of contact, which lasts eps_i p before and eps_j p beyond the pitch point,

    arm = p (1 - eps_i - eps_j + eps_i^2 + eps_j^2) / 2,   p = 2 pi b_i / z_i     (Ohlendorf's loss of a mesh)

so that it is a moment on body i and its opposite on body j. The force of friction, across the line of action, changes
its sign at the pitch point and has no mean: this ripple on the bearings is left out.

With backlash B, along the line of action, both flanks are there, each thinner by half of it: two gaps that add to B at
the standard centre distance, and two rows, minus these, that push alone.
"""

import abc
from typing import TYPE_CHECKING, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..._tools._errors import RedundaxError
from ..._tools._module import (
    Numbers,
    figure,
    is_concrete,
    not_negative,
    numpy_of,
    on_device,
    optional_figure,
    positive,
    safe_norm,
)
from ..._tools._numbers import Numeric
from .._friction_model import AbstractFrictionModel
from .._pose import Pose
from ._base import AbstractPointJoint, Row
from ._rubbing import AbstractFrictionalJoint

STANDARD_PRESSURE_ANGLE = np.pi / 9  # 20 degrees, ISO 53


def whole(value: Numbers) -> Int[Array, "..."]:
    """Whole numbers as an array."""
    if isinstance(value, jax.Array) and not is_concrete(value):
        return value
    array = np.asarray(value)
    if not np.issubdtype(array.dtype, np.integer):
        raise RedundaxError(
            f"Arguments such as `teeth` or `flank` must be whole numbers, but one is {value}. Give integers."
        )
    return on_device(array.astype(np.int32))


class AbstractMesh(AbstractPointJoint, AbstractFrictionalJoint):
    """Teeth in contact on one flank: one row whose multiplier is the force that presses them together, N; with backlash
    one for each flank, of which both may be open."""

    slip_kind: ClassVar[str] = "angular"
    read_by_law: ClassVar[tuple[str, ...]] = ("friction", "sliding_arm")
    if TYPE_CHECKING:  # as in `AbstractBetweenBodies`
        teeth: ClassVar[Int[Array, "..."]]
        module: ClassVar[Float[Array, ""]]
        pressure_angle: ClassVar[Float[Array, ""]]
        flank: ClassVar[Int[Array, ""]]
        sliding_arm: ClassVar[Float[Array, ""] | None]
        backlash: ClassVar[Float[Array, ""] | None]
    else:
        teeth: eqx.AbstractVar[Int[Array, "..."]]
        module: eqx.AbstractVar[Float[Array, ""]]
        pressure_angle: eqx.AbstractVar[Float[Array, ""]]
        flank: eqx.AbstractVar[Int[Array, ""]]
        sliding_arm: eqx.AbstractVar[Float[Array, ""] | None]
        backlash: eqx.AbstractVar[Float[Array, ""] | None]

    @property
    def row_kinds(self) -> tuple[Row, ...]:
        """That of the flank, or those of both."""
        return tuple((row, "force") for row in self.pushing)

    @property
    def pushing(self) -> tuple[str, ...]:
        """All of them."""
        return ("teeth",) if self.backlash is None else ("right", "left")

    @property
    def one_sided(self) -> bool:
        return self.backlash is not None

    @property
    @abc.abstractmethod
    def contact(self) -> tuple[Numeric, Numeric]:
        """eps_i and eps_j: paths of contact on both sides of the pitch point, of standard teeth, in base pitches."""

    @property
    def base_radii(self) -> Numeric:
        """Radii of the base circles, m, in the shape of `teeth`; negative for a ring."""
        return self.module * numpy_of(self.pressure_angle).cos(self.pressure_angle) / 2 * self.teeth

    @property
    def base_pitch(self) -> Numeric:
        """Distance of neighbouring teeth along the line of action, m."""
        return np.pi * self.module * numpy_of(self.pressure_angle).cos(self.pressure_angle)

    @property
    def law(self) -> AbstractFrictionModel | None:
        """The mean moment of sliding teeth."""
        if self.friction is None:
            return None
        arm = self.sliding_arm
        if arm is None:
            before, beyond = self.contact
            arm = self.base_pitch * (1 - before - beyond + before**2 + beyond**2) / 2
        return self.friction.about(arm)

    def slip(self, i: Pose, j: Pose) -> Array:
        return i.phi - j.phi

    def normal_load(self, multipliers: Array) -> Array:
        return jnp.sum(jnp.abs(multipliers))  # one flank carries

    def in_pitch(self, residual: Array) -> Array:
        """The residual to the nearest tooth."""
        return residual - self.base_pitch * jnp.round(residual / self.base_pitch)

    def of_flanks(self, rolled: Array, opening: Array) -> Float[Array, " rows"]:
        """Minus the gaps: by how far a tooth of i is from the middle of its space on j, as the right flank opens, and
        by how far both open with the distance."""
        if self.backlash is None:
            return jnp.stack([self.in_pitch(-(self.flank * rolled + opening))])
        turned, play = self.in_pitch(rolled), opening + self.backlash / 2
        return -jnp.stack([play + turned, play - turned])


def check_mesh(mesh: AbstractMesh) -> None:
    """Refuse numbers that no teeth have."""
    for name in ("module", "pressure_angle"):
        positive(name, getattr(mesh, name))
    if is_concrete(mesh.pressure_angle) and np.asarray(mesh.pressure_angle) >= np.pi / 2:
        raise RedundaxError(
            f"Argument `pressure_angle` of '{mesh.name}' must be below pi / 2, but is {mesh.pressure_angle}. Give "
            "radians, pi / 9 for 20 degrees."
        )
    if is_concrete(mesh.flank) and abs(int(mesh.flank)) != 1:
        raise RedundaxError(
            f"Argument `flank` of '{mesh.name}' must be 1 or -1, but is {mesh.flank}. Give 1 where the force on its "
            "teeth turns body i counterclockwise."
        )
    for name in ("sliding_arm", "backlash"):
        if (value := getattr(mesh, name)) is not None:
            not_negative(name, value)
    if mesh.backlash is not None and is_concrete(mesh.flank) and int(mesh.flank) != 1:
        raise RedundaxError(
            f"Argument `flank` of '{mesh.name}' must be left out where `backlash` is given, but is {mesh.flank}: "
            "both flanks are there then."
        )


def tip_path(radius: Numeric, other: Numeric, module: Numeric, pressure_angle: Numeric) -> Numeric:
    """Path of contact from the pitch point to the tip of standard teeth, m; the radius of a ring is negative.

    It ends where the line of action touches the base circle of the other gear, if that is no ring.
    """
    xp = numpy_of(radius, other, module, pressure_angle)
    base, tip = radius * xp.cos(pressure_angle), radius + module
    path = xp.abs(xp.sqrt(xp.maximum(tip**2 - base**2, 0.0)) - xp.abs(radius) * xp.sin(pressure_angle))
    return xp.where(other > 0, xp.minimum(path, xp.abs(other) * xp.sin(pressure_angle)), path)


class GearPair(AbstractMesh):
    """Two gears in mesh, with the force of their teeth. Its multiplier is that force along the line of action, N.

    It is positive where the teeth push. Where it is negative the other flanks are in contact: `Solution.pulling` names
    the row, and `solve` warns; change the sign of `flank`. Bodies may move in any way, as planets on a carrier do.

    Teeth are of the standard profile, half a pitch thick at the pitch circles: they mesh without backlash at the centre
    distance m (z_i + z_j) / 2, and touch on the flank given at any other. Between the base circles, at a distance of at
    most |b_i + b_j|, no teeth reach each other: the row is not met there.

    With `backlash` both flanks push alone, in rows "name.right" and "name.left", and between them the teeth are apart:
    `solution.contacts` tells which carries. `assemble(..., closed="mesh.right")` lays one on.

    `AngleCoupling` couples angles alone, for belts and chains and where no force of teeth is asked for.

    ??? example

        ```python
        mesh = rx.GearPair("mesh", "pinion", "wheel", (0.0, 0.0), (0.0, 0.0), teeth=(20, 60), module=0.002)
        rx.GearPair("ring", "planet", "ground", (0.0, 0.0), (0.0, 0.0), teeth=(18, -60), module=0.002, flank=-1)
        ```

    **Arguments:**

    - `name`: the row is called "name.teeth". The force and the moment of the reaction act at the gear's axis: the
      moment is the torque of the mesh.
    - `i`, `j`: names of the bodies, or "ground"; in an internal mesh the ring is j.
    - `point_i`, `point_j`: the gear axes in the local frames, m.
    - `teeth`: whole numbers z_i and z_j; that of a ring, with internal teeth, is negative.
    - `module`: m, pitch diameter over number of teeth, m.
    - `pressure_angle`: alpha_0 of the teeth, rad; 20 degrees if not given.
    - `flank`: 1 for right flanks, whose force turns body i counterclockwise, -1 for left ones.
    - `angle_i`, `angle_j`: where the middle of a tooth is in the local frames, from the x axis, rad. Without them, one
      tooth of each gear is on the x axis of its body: `assemble` turns bodies into mesh.
    - `sliding_arm`: mean distance of the contact from the pitch point, m, for friction; that of teeth with an addendum
      of one module if not given. The mean loss of an ideal pair is mu arm (1 / b_i + 1 / b_j) of its power.
    - `friction`: `Coulomb` with its coefficient mu, or another model: the mean of a tooth's way through the mesh.
    - `backlash`: along the line of action, m, at the standard centre distance: how far teeth are apart on one flank
      where they touch on the other. Without it they stay on the flank given.
    """

    teeth: Int[Array, "2"] = eqx.field(converter=whole)
    module: Float[Array, ""] = eqx.field(converter=figure("module"))
    pressure_angle: Float[Array, ""] = eqx.field(converter=figure("pressure_angle"), default=STANDARD_PRESSURE_ANGLE)
    flank: Int[Array, ""] = eqx.field(converter=whole, default=1)
    angle_i: Float[Array, ""] = eqx.field(converter=figure("angle_i"), default=0.0)
    angle_j: Float[Array, ""] = eqx.field(converter=figure("angle_j"), default=0.0)
    sliding_arm: Float[Array, ""] | None = eqx.field(converter=optional_figure("sliding_arm"), default=None)
    friction: AbstractFrictionModel | None = None
    backlash: Float[Array, ""] | None = eqx.field(converter=optional_figure("backlash"), default=None)

    def __check_init__(self) -> None:
        check_mesh(self)
        given = np.asarray(self.teeth)
        if given.shape != (2,) or given[0] <= 0 or given[1] == 0 or (given[1] < 0 and given.sum() >= 0):
            raise RedundaxError(
                f"Argument `teeth` of '{self.name}' must be two numbers, the first positive, and of a ring, which is "
                f"negative, larger than the other, but is {given}. Name the ring as `j`."
            )

    @property
    def contact(self) -> tuple[Numeric, Numeric]:
        radii = self.module / 2 * self.teeth
        own, other = radii[0], radii[1]
        paths = (tip_path(*pair, self.module, self.pressure_angle) for pair in ((own, other), (other, own)))
        own, other = (path / self.base_pitch for path in paths)
        return own, other

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        line = j.point(self.point_j) - i.point(self.point_i)
        distance, own, other = safe_norm(line), *self.base_radii
        apart = distance > 0
        theta = jnp.arctan2(jnp.where(apart, line[1], 0.0), jnp.where(apart, line[0], 1.0))
        rolled = own * (i.phi + self.angle_i - theta) + other * (j.phi + self.angle_j - theta)
        # A tooth of i in a gap of j, both on the line of centres: beyond i, and on this side of j unless that is a ring
        between = self.base_pitch / 2 * (self.teeth[1] + 1 + jnp.where(other < 0, self.teeth[0], 0))
        radius, size = own + other, jnp.abs(own + other)
        reaches = distance > size
        height = jnp.sqrt(jnp.where(reaches, distance**2 - size**2, 1.0))
        opening = jnp.sign(radius) * (height - size * jnp.arctan2(height, size))
        closed = radius * (jnp.tan(self.pressure_angle) - self.pressure_angle)
        rows = self.of_flanks(rolled - between, opening - closed)
        return jnp.where(reaches, rows, self.base_pitch + size - distance)
