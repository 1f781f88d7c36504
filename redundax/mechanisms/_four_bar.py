"""Four-bar linkage with its coupler doubled: two equal couplers side by side on the same pins.

Either coupler alone closes the loop, and together they can carry an axial force e s and -e s, so k = 1. With crank
a, coupler b, rocker c and ground d, B = a (cos phi, sin phi), D = (d, 0), f = |D - B|, the pin C lies at

    C = B + x (D - B) + y Omega (D - B),   x = (b^2 - c^2 + f^2) / (2 f^2),   y = +-(b^2 / f^2 - x^2)^(1/2).
"""

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._bodies._body import GROUND
from .._bodies._joints import Revolute
from .._bodies._mechanism import Mechanism
from .._bodies._pose import perpendicular
from .._system._units import Units
from .._tools._module import figure, floats
from .._tools._value import AbstractModule
from ._parts import Numbers, checked, each, point, rubbing, uniform_rod


class _Pose(AbstractModule):
    """Coordinates at crank angle phi, NaN where the loop cannot be closed."""

    crank: Float[Array, ""] = eqx.field(converter=figure("crank"))
    coupler: Float[Array, ""] = eqx.field(converter=figure("coupler"))
    rocker: Float[Array, ""] = eqx.field(converter=figure("rocker"))
    ground: Float[Array, ""] = eqx.field(converter=figure("ground"))
    side: float = eqx.field(static=True)

    def __call__(self, phi: Float[Array, ""]) -> Float[Array, " 12"]:
        b = self.crank * jnp.stack([jnp.cos(phi), jnp.sin(phi)])
        d = point(self.ground)
        diagonal = d - b
        square = diagonal @ diagonal
        along = (self.coupler**2 - self.rocker**2 + square) / (2 * square)
        across = self.side * jnp.sqrt(self.coupler**2 / square - along**2)
        c = b + along * diagonal + across * perpendicular(diagonal)
        rods = c - b, c - d
        coupler, rocker = (jnp.arctan2(v[1], v[0]) for v in rods)
        centres = [b / 2, (c + d) / 2, (b + c) / 2, (b + c) / 2]
        return jnp.concatenate([*centres, jnp.stack([phi, rocker, coupler, coupler])])


@checked
def doubled_four_bar(
    crank: ArrayLike = 0.25,
    coupler: ArrayLike = 0.52,
    rocker: ArrayLike = 0.5,
    ground: ArrayLike = 0.33,
    crank_mass: ArrayLike = 1.0,
    coupler_mass: Numbers = 1.0,
    rocker_mass: ArrayLike = 1.0,
    crossed: bool = False,
    mu_rho: Numbers | None = None,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """A four-bar linkage with two equal couplers side by side.

    Bodies "crank", "rocker", "coupler 1" and "coupler 2", uniform rods; revolutes A (crank on the ground at the
    origin), D (rocker on the ground), B1, B2 (couplers on the crank) and C1, C2 (couplers on the rocker). n = m = 12,
    rank 11, k = 1, one degree of freedom. The loads of A and D are unique, those of the couplers are not.

    ??? example

        ```python
        rx.mechanisms.doubled_four_bar(mu_rho=0.001).state(phi=0.8, rate=1.0)
        ```

    **Arguments:**

    - `crank`, `coupler`, `rocker`, `ground`: lengths of the links, m; as given the crank can turn round.
    - `crank_mass`, `rocker_mass`: kg.
    - `coupler_mass`: kg; one number or two; 0 leaves accelerations unique.
    - `crossed`: whether the loop is closed on the right of the line from B to D instead of the left.
    - `mu_rho`: friction coefficient times pin radius of A, D, B1, C1, B2, C2, m; one number or six. No friction if not
      given.
    - `gravity`: m/s^2, downwards, that is across the line from A to D.

    `state(phi, rate=...)` gives the state at crank angle phi (rad) and crank rate (rad/s).
    """
    a, b, c, d, gravity = (floats(x) for x in (crank, coupler, rocker, ground, gravity))
    masses = each("coupler_mass", coupler_mass, 2, "coupler")
    friction = rubbing("mu_rho", mu_rho, 6)
    bodies = [
        uniform_rod("crank", crank_mass, a),
        uniform_rod("rocker", rocker_mass, c),
        uniform_rod("coupler 1", masses[0], b),
        uniform_rod("coupler 2", masses[1], b),
    ]
    joints = [
        Revolute("A", "crank", GROUND, point_i=point(-a / 2), point_j=point(0.0), **friction[0]),
        Revolute("D", "rocker", GROUND, point_i=point(-c / 2), point_j=point(d), **friction[1]),
        Revolute("B1", "coupler 1", "crank", point_i=point(-b / 2), point_j=point(a / 2), **friction[2]),
        Revolute("C1", "coupler 1", "rocker", point_i=point(b / 2), point_j=point(c / 2), **friction[3]),
        Revolute("B2", "coupler 2", "crank", point_i=point(-b / 2), point_j=point(a / 2), **friction[4]),
        Revolute("C2", "coupler 2", "rocker", point_i=point(b / 2), point_j=point(c / 2), **friction[5]),
    ]
    pose = _Pose(a, b, c, d, -1.0 if crossed else 1.0)
    return Mechanism(bodies, joints, gravity=point(0.0, -gravity), pose=pose, units=Units())
