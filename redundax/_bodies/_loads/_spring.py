"""Springs with dampers between two bodies

tension        c (l - l0) + d dl/dt   along the line of the two points
moment on i    -c (alpha - alpha0) - d dalpha/dt,   alpha = phi_i - phi_j
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._tools._module import figure, one_number, safe_norm
from .._body import name_of
from .._pose import Motion, Wrench
from ._base import AbstractLoad


class AbstractSpringDamper(AbstractLoad):
    """A spring with damper between two points, in the plane or in space."""

    i: str = eqx.field(static=True, converter=name_of)
    j: str = eqx.field(static=True, converter=name_of)
    point_i: Float[Array, " axes"] = eqx.field(converter=figure("point_i"))
    point_j: Float[Array, " axes"] = eqx.field(converter=figure("point_j"))
    stiffness: Float[Array, ""] = eqx.field(converter=figure("stiffness"))
    free_length: Float[Array, ""] = eqx.field(converter=figure("free_length"), default=0.0)
    damping: Float[Array, ""] = eqx.field(converter=figure("damping"), default=0.0)

    def __check_init__(self) -> None:
        for name in ("stiffness", "free_length", "damping"):
            one_number(name, getattr(self, name))

    def wrenches(self, i: Any, j: Any, t: Array) -> tuple[Any, Any]:
        offset = i.pose.point(self.point_i) - j.pose.point(self.point_j)
        length = safe_norm(offset)
        line = offset / jnp.where(length > 0, length, 1.0)
        speed = (i.point_velocity(self.point_i) - j.point_velocity(self.point_j)) @ line
        tension = self.stiffness * (length - self.free_length) + self.damping * speed
        return i.wrench(-tension * line, self.point_i), j.wrench(tension * line, self.point_j)


class SpringDamper(AbstractSpringDamper):
    """Linear spring with damper between a point of body i and a point of body j.

    ??? example

        ```python
        rx.SpringDamper(
            "lever", "ground", (0.2, 0.0), (0.2, 0.5), stiffness=500.0, free_length=0.4, damping=2.0
        )
        ```

    **Arguments:**

    - `i`, `j`: names of the bodies, or "ground".
    - `point_i`, `point_j`: its ends in the local frames, m.
    - `stiffness`: c, N/m.
    - `free_length`: l0, m.
    - `damping`: d, N s/m.
    """


class TorsionSpring(AbstractLoad[Motion, Wrench]):
    """Torsion spring with damper between two bodies.

    ??? example

        ```python
        rx.TorsionSpring("lever", "ground", stiffness=3.0, free_angle=0.1)
        ```

    **Arguments:**

    - `i`, `j`: names of the bodies, or "ground".
    - `stiffness`: c, N m/rad.
    - `free_angle`: alpha0, rad.
    - `damping`: d, N m s/rad.
    """

    i: str = eqx.field(static=True, converter=name_of)
    j: str = eqx.field(static=True, converter=name_of)
    stiffness: Float[Array, ""] = eqx.field(converter=figure("stiffness"))
    free_angle: Float[Array, ""] = eqx.field(converter=figure("free_angle"), default=0.0)
    damping: Float[Array, ""] = eqx.field(converter=figure("damping"), default=0.0)

    def __check_init__(self) -> None:
        for name in ("stiffness", "free_angle", "damping"):
            one_number(name, getattr(self, name))

    def wrenches(self, i: Motion, j: Motion, t: Array) -> tuple[Wrench, Wrench]:
        angle, rate = i.pose.phi - j.pose.phi, i.rate.phi - j.rate.phi
        moment = -self.stiffness * (angle - self.free_angle) - self.damping * rate
        none = jnp.zeros_like(i.pose.r)
        return Wrench(none, moment), Wrench(none, -moment)
