"""Springs with dampers between two bodies in space

torsion    moment on i   -(c (alpha - alpha0) + d alpha') g,   g = (z_i + z_j) / (1 + z_i . z_j),   alpha' = omega . g
bushing    force on i    -(C u + D u')   at its point on i,   u its offset from that on j
           moment on i   -E^T (C r + D r'),   E = I - [r]x / 2 + r r^T / 4,   r' = E omega

all seen from j, with the angular velocity omega of i, and r = 2 tan(half the angle) along the axis of the turn. E and g
make the moments do the work that the springs store, however far they turn.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...._tools._errors import RedundaxError
from ...._tools._module import Numbers, as_float, as_matrix, is_concrete, one_number
from ..._loads._spring import AbstractSpringDamper
from .._body import Body
from .._joints._base import Relative
from .._placement import Placement, at_reference, between_points, placed
from .._pose import Motion, Wrench
from .._rotation import cross
from ._base import AbstractLoad

_ROUNDING = 1e-6  # of figures of few digits


class SpringDamper(AbstractSpringDamper, AbstractLoad):
    """Linear spring with damper between a point of body i and a point of body j in space.

    ??? example

        ```python
        flap = rx.spatial.Body("flap", 2.0, inertia=(0.1, 0.1, 0.2))
        rx.spatial.SpringDamper(flap, "ground", (0.5, 0.0, 0.0), (0.5, 0.0, 1.0), stiffness=500.0, free_length=0.8)
        ```

    **Arguments:**

    - `i`, `j`: the bodies, or "ground"; their names do where `on_i` and `on_j` are given.
    - `point_i`, `point_j`: its ends, global, m, at the reference pose of the bodies.
    - `stiffness`: c, N/m.
    - `free_length`: l0, m.
    - `damping`: d, N s/m.
    - `on_i`, `on_j`: in place of the points those in the local frames, m.
    """

    def __init__(
        self,
        i: Body | str,
        j: Body | str,
        point_i: Numbers | None = None,
        point_j: Numbers | None = None,
        *,
        stiffness: Numbers,
        free_length: Numbers = 0.0,
        damping: Numbers = 0.0,
        on_i: Numbers | None = None,
        on_j: Numbers | None = None,
    ):
        place = between_points("SpringDamper", i, j, (point_i, point_j, on_i, on_j), "load")
        self.i, self.j, self.point_i, self.point_j = place.i, place.j, place.on_i.point, place.on_j.point
        self.stiffness, self.damping, self.free_length = stiffness, damping, free_length


class TorsionSpring(AbstractLoad):
    """Torsion spring with damper about an axis of two bodies, as that of a joint.

    The angle is that of a joint with this axis, from -pi to pi: keep it within half a turn, where it jumps.

    ??? example

        ```python
        door = rx.spatial.Body("door", 20.0, inertia=(6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0))
        rx.spatial.TorsionSpring(door, "ground", axis=(0.0, 0.0, 1.0), stiffness=3.0, free_angle=0.1)
        ```

    **Arguments:**

    - `i`, `j`: the bodies, or "ground"; their names do where `on_i` and `on_j` are given.
    - `axis`: direction of the axis, global, at the reference pose of the bodies, where the angle is 0.
    - `stiffness`: c, N m/rad.
    - `free_angle`: alpha0, rad.
    - `damping`: d, N m s/rad.
    - `on_i`, `on_j`: in place of `axis` the `Placement` on each body; only its axes count.
    """

    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    axes_i: Float[Array, "3 3"]
    axes_j: Float[Array, "3 3"]
    stiffness: Float[Array, ""]
    free_angle: Float[Array, ""]
    damping: Float[Array, ""]

    def __init__(
        self,
        i: Body | str,
        j: Body | str,
        axis: Numbers | None = None,
        *,
        stiffness: Numbers,
        free_angle: Numbers = 0.0,
        damping: Numbers = 0.0,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
    ):
        given = None if axis is None else Placement((0.0, 0.0, 0.0), axis)
        place = placed("TorsionSpring", i, j, (given, given), (on_i, on_j), "load")
        self.i, self.j, self.axes_i, self.axes_j = place.i, place.j, place.on_i.axes, place.on_j.axes
        self.stiffness, self.damping = as_float(stiffness, "stiffness"), as_float(damping, "damping")
        self.free_angle = as_float(free_angle, "free_angle")
        for name in ("stiffness", "free_angle", "damping"):
            one_number(name, getattr(self, name))

    def wrenches(self, i: Motion, j: Motion, t: Array) -> tuple[Wrench, Wrench]:
        axes_i, axes_j = i.pose.axes @ self.axes_i, j.pose.axes @ self.axes_j
        none = jnp.zeros_like(i.pose.r)
        angle = Relative(none, axes_j.T @ axes_i).angle
        slope = (axes_i[:, 2] + axes_j[:, 2]) / (1 + axes_i[:, 2] @ axes_j[:, 2])
        rate = (i.angular_velocity - j.angular_velocity) @ slope
        moment = -(self.stiffness * (angle - self.free_angle) + self.damping * rate) * slope
        return Wrench(none, moment), Wrench(none, -moment)


class Bushing(AbstractLoad):
    """Elastic joint: a spring with damper in all six directions between a point and axes of two bodies.

    Its turn is 2 tan(half the angle) about the axis of the turn, so the angle for small ones; it must stay within half
    a turn. Loads of stiff bushings come near those of joints under `rx.ElasticJoints`, as the motion becomes stiff.

    ??? example

        ```python
        engine = rx.spatial.Body("engine", 150.0, inertia=(8.0, 10.0, 12.0))
        rubber = {"translation": (2e5, 2e5, 6e5), "rotation": 300.0, "translation_damping": 500.0}
        rx.spatial.Bushing(engine, "ground", point=(0.3, 0.2, -0.1), **rubber)
        ```

    **Arguments:**

    - `i`, `j`: the bodies, or "ground"; their names do where `on_i` and `on_j` are given.
    - `point`, `axis`, `mark`: where it sits and which axes it has, z along the axis, as of a joint: global, at the
      reference pose of the bodies, where it is free of load.
    - `translation`, `rotation`: stiffness, N/m and N m/rad: one number, three along and about the axes x, y, z on body
      j, or a matrix (3, 3) in these axes.
    - `translation_damping`, `rotation_damping`: likewise, N s/m and N m s/rad.
    - `on_i`, `on_j`: in place of `point` and `axis` the `Placement` on each body.
    """

    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    point_i: Float[Array, "3"]
    axes_i: Float[Array, "3 3"]
    point_j: Float[Array, "3"]
    axes_j: Float[Array, "3 3"]
    translation: Float[Array, "3 3"]
    rotation: Float[Array, "3 3"]
    translation_damping: Float[Array, "3 3"]
    rotation_damping: Float[Array, "3 3"]

    def __init__(
        self,
        i: Body | str,
        j: Body | str,
        point: Numbers | None = None,
        axis: Numbers | None = None,
        mark: Numbers | None = None,
        *,
        translation: Numbers = 0.0,
        rotation: Numbers = 0.0,
        translation_damping: Numbers = 0.0,
        rotation_damping: Numbers = 0.0,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
    ):
        given = at_reference("Bushing", point, axis, mark, "load")
        place = placed("Bushing", i, j, (given, given), (on_i, on_j), "load")
        self.i, self.j = place.i, place.j
        (self.point_i, self.axes_i), (self.point_j, self.axes_j) = ((on.point, on.axes) for on in place[2:])
        self.translation, self.rotation = _stores("translation", translation), _stores("rotation", rotation)
        self.translation_damping = _stores("translation_damping", translation_damping)
        self.rotation_damping = _stores("rotation_damping", rotation_damping)

    def wrenches(self, i: Motion, j: Motion, t: Array) -> tuple[Wrench, Wrench]:
        relative, axes = Relative.between(self, i.pose, j.pose), j.pose.axes @ self.axes_j
        end = i.pose.point(self.point_i)
        speed = i.point_velocity(self.point_i) - j.velocity - cross(j.angular_velocity, end - j.pose.r)
        force = -axes @ (self.translation @ relative.offset + self.translation_damping @ (axes.T @ speed))
        r, spin = relative.rotation, axes.T @ (i.angular_velocity - j.angular_velocity)
        rate = spin - cross(r, spin) / 2 + r * (r @ spin) / 4
        stress = self.rotation @ r + self.rotation_damping @ rate
        moment = -axes @ (stress + cross(r, stress) / 2 + r * (r @ stress) / 4)
        on_i, arm_j = i.wrench(force, self.point_i), end - j.pose.r
        return Wrench(force, on_i.moment + moment), Wrench(-force, -cross(arm_j, force) - moment)


def _stores(argument: str, value: Numbers) -> Float[Array, "3 3"]:
    """A matrix of stiffness or damping, refused where it would give energy."""
    matrix = as_matrix(argument, value, 3)
    if is_concrete(matrix) and np.all(np.isfinite(matrix)):
        given = np.asarray(matrix)
        size = np.abs(given).max()
        if np.abs(given - given.T).max() > _ROUNDING * size or np.linalg.eigvalsh(given).min() < -_ROUNDING * size:
            raise RedundaxError(
                f"Argument `{argument}` of a bushing must be symmetric without negative principal values, but is "
                f"{given.tolist()}: it would give energy. Write other laws as `rx.spatial.LoadFunction`."
            )
    return matrix
