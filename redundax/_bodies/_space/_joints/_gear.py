"""Wheels in mesh, by their numbers of teeth

    N_i a_i + N_j a_j = const   modulo  2 pi gcd(N_i, N_j)

a is the angle of a wheel about its axis, from the direction e that both axes share: that of the line of centres square
to parallel axes, that of the common normal n = z_i x z_j of others. e turns with the carrier of the axes, whichever
bodies carry them, so planets and differentials need no third body. Modulo that, turns need not be counted, and wheels
that start in mesh at one tooth stay there, wherever they are assembled. The row is divided by N_i: its multiplier is
minus the moment on body i about its axis.

The teeth press tangentially to both wheels where their pitch circles touch. Of parallel axes the line of centres sees
to that. Axes that cross would turn alone, without the force; the row has the offset of the axes too, which is zero in
their bearings,

    a_i + a_j N_j / N_i - (p_j - p_i) . n / ((p_j - p_i) . z_j)

whose slope is the force along n at the radius r_i = (p_j - p_i) . z_j / |n|: the planes through the points, square to
the axes, meet there. Worms slide along their teeth, whose force has no one tangent: only angles are coupled.
"""

from typing import ClassVar, Literal, get_args

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...._tools._errors import RedundaxError
from ...._tools._module import Numbers, as_float, is_concrete
from ..._friction_model import AbstractFrictionModel
from ..._joints import whole
from ..._joints._base import Row
from .._body import Body
from .._placement import Placement, at_reference
from .._pose import Pose
from ._base import AbstractPlacedJoint, refuse_friction

Axes = Literal["parallel", "crossing", "skew"]
_PARALLEL = 1e-6  # sine of the angle between axes
_FEW_DIGITS = 1e-3  # of points and axes, relative


class Gear(AbstractPlacedJoint):
    """Two wheels in mesh on parallel, crossing or skew axes, of any bodies. Row twist.

    Radii are those that the axes and numbers of teeth leave: wheels roll on each other. The force of the teeth is
    tangent to the wheels; its part along the line of centres, which the pressure angle adds, is left out. Axes of bevel
    wheels both point away from the apex, or both towards it. Skew axes, as of worms, have only their angles coupled:
    moments that turn the wheels, but no force of teeth on the bearings. In a plane `rx.GearPair` has whole teeth.

    ??? example

        ```python
        pinion = rx.spatial.Body("pinion", 0.1, inertia=(1e-4, 1e-4, 2e-4))
        wheel = rx.spatial.Body("wheel", 0.9, inertia=(9e-4, 9e-4, 2e-3), position=(0.08, 0.0, 0.0))
        rx.spatial.Gear("mesh", pinion, wheel, (0, 0, 0), (0, 0, 1), (0.08, 0, 0), (0, 0, 1), teeth=(20, 60))
        ```

    **Arguments:**

    - `name`, `i`, `j`: as of other joints.
    - `point_i`, `axis_i`, `point_j`, `axis_j`: a point on the axis of each wheel, of bevel wheels the middle of its
      pitch circle, and the direction of the axis, global, m, at the reference pose of the bodies, at which the wheels
      are in mesh.
    - `teeth`: whole numbers N_i and N_j; negative for a ring with internal teeth, which has the more.
    - `on_i`, `on_j`: in place of points and axes the `Placement` on each body; the wheels are in mesh where x of both
      is along the shared direction.
    - `axes`: "parallel", "crossing" or "skew", where placements are given; "parallel" if not given.
    - `friction`: none is known of joints of this kind.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("twist", "moment"),)
    teeth: Int[Array, "2"]
    angle: Float[Array, ""]
    axes: Axes = eqx.field(static=True)

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point_i: Numbers | None = None,
        axis_i: Numbers | None = None,
        point_j: Numbers | None = None,
        axis_j: Numbers | None = None,
        *,
        teeth: tuple[int, int],
        on_i: Placement | None = None,
        on_j: Placement | None = None,
        axes: Axes | None = None,
        friction: AbstractFrictionModel | None = None,
    ):
        refuse_friction(name, friction)
        given_i, given_j = at_reference(name, point_i, axis_i), at_reference(name, point_j, axis_j)
        self.place_both(name, i, j, (given_i, given_j), (on_i, on_j))
        self.teeth, self.angle = _teeth(name, teeth), as_float(0.0)
        if given_i is None or given_j is None:
            self.axes = _word(name, axes)
            return
        if axes is not None:
            raise RedundaxError(
                f"Argument `axes` of joint '{name}' must be left out where points and axes are given, but is {axes!r}: "
                "they say it. Leave it out."
            )
        ends = (given_i.point, given_i.axes), (given_j.point, given_j.axes)
        self.axes = _arrangement(name, *ends, self.teeth)
        self.angle = self._turn(*ends)

    def _turn(self, on_i: tuple[Array, Array], on_j: tuple[Array, Array]) -> Array:
        """N_i a_i + N_j a_j over N_i, less the offset of axes that cross, given global points and axes."""
        (p_i, axes_i), (p_j, axes_j) = on_i, on_j
        line, z_i, z_j = p_j - p_i, axes_i[:, 2], axes_j[:, 2]
        normal, is_parallel = jnp.cross(z_i, z_j), self.axes == "parallel"
        shared = line if is_parallel else normal
        a_i, a_j = (-jnp.arctan2(*(shared @ axes[:, :2])[::-1]) for axes in (axes_i, axes_j))
        sense = jnp.sign(z_i @ z_j) if is_parallel else 1.0  # of the angle about an axis that points the other way
        turn = a_i + sense * self.teeth[1] / self.teeth[0] * a_j
        return turn - (line @ normal) / (line @ z_j) if self.axes == "crossing" else turn

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        ends = ((i.point(self.point_i), i.axes @ self.axes_i), (j.point(self.point_j), j.axes @ self.axes_j))
        period = 2 * jnp.pi * jnp.gcd(*self.teeth) / jnp.abs(self.teeth[0])
        gap = self._turn(*ends) - self.angle
        return (gap - period * jnp.round(gap / period))[None]


def _teeth(name: str, teeth: tuple[int, int]) -> Int[Array, "2"]:
    numbers = whole(teeth)
    given = np.asarray(numbers)
    if given.shape != (2,) or not np.all(given) or (given.min() < 0 and not given.sum() < 0 < given.max()):
        raise RedundaxError(
            f"Argument `teeth` of joint '{name}' must be two whole numbers that are not 0, of which that of a ring is "
            f"negative and the larger, but is {teeth}. Give (20, 60), or (20, -60) for a ring."
        )
    return numbers


def _word(name: str, axes: Axes | None) -> Axes:
    if axes is not None and axes not in get_args(Axes):
        raise RedundaxError(
            f"Argument `axes` of joint '{name}' must be one of {get_args(Axes)}, but is {axes!r}. Name one."
        )
    return axes or "parallel"


def _arrangement(name: str, on_i: tuple[Array, Array], on_j: tuple[Array, Array], teeth: Array) -> Axes:
    """How axes lie, given global points and axes of wheels that can mesh there."""
    if not all(map(is_concrete, (*on_i, *on_j))):
        raise RedundaxError(
            f"Points and axes of joint '{name}' must be known numbers, but are traced. Give `on_i`, `on_j` and `axes`."
        )
    line = np.asarray(on_j[0]) - np.asarray(on_i[0])
    z_i, z_j = (np.asarray(axes)[:, 2] for _, axes in (on_i, on_j))
    normal, reach = np.cross(z_i, z_j), np.linalg.norm(line)
    sine = np.linalg.norm(normal)
    if sine <= _PARALLEL:
        if not np.linalg.norm(np.cross(z_i, line)) > _PARALLEL * reach:
            raise RedundaxError(
                f"Arguments `point_i` and `point_j` of joint '{name}' must be apart where axes are parallel, but are "
                "on one line along them. Give the middles of the wheels."
            )
        return "parallel"
    if abs(line @ normal) > _FEW_DIGITS * sine * reach:
        return "skew"
    radii = np.array([line @ z_j, -line @ z_i]) / sine
    across = radii * np.asarray(teeth)[::-1]
    if not (np.all(radii) and abs(across[0] - across[1]) <= _FEW_DIGITS * np.abs(across).max()):
        raise RedundaxError(
            f"Arguments `point_i` and `point_j` of joint '{name}' must be the middles of the pitch circles of bevel "
            f"wheels, whose radii are as {np.asarray(teeth).tolist()}, but those that touch have radii "
            f"{radii.tolist()}. Move the points along the axes; both axes point away from the apex."
        )
    return "crossing"
