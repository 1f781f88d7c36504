"""The mechanism of Section 5: two cranks, a coupler on them, and a slider that guides the coupler.

Bodies 1 and 3 are the cranks A-B and D-C, body 2 is the coupler B-C, and body 4 slides on the ground (joint K)
and along the coupler (joint L). n = m = 12, rank 11, one degree of freedom. Data of Tables 1 and 5, with
half the crank h = l sqrt(2), which alone closes the loops of Table 1.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._bodies._body import GROUND, Body
from .._bodies._joints import Revolute, Translational
from .._bodies._mechanism import Mechanism
from .._system._units import Units
from .._tools._module import figure, floats
from .._tools._value import AbstractModule
from ._parts import checked, rubbing


class _Pose(AbstractModule):
    """Coordinates at crank angle phi."""

    length: Float[Array, ""] = eqx.field(converter=figure("length"))

    def __call__(self, phi: Float[Array, ""]) -> Float[Array, " 12"]:
        length, half = self.length, self.length * math.sqrt(2.0)
        x, y = half * jnp.cos(phi), half * jnp.sin(phi)
        zero = jnp.zeros_like(x)
        centres = [x, y, 2 * x + 4 * length, 2 * y, x + 8 * length, y, 4 * length + zero, 2 * y]
        return jnp.stack([*centres, phi + zero, zero, phi + zero, zero])


@checked
def wojtyra2020(
    length: ArrayLike = 0.1,
    mass: ArrayLike = 1.0,
    mu_rho: ArrayLike | None = None,
    gravity: ArrayLike = 10.0,
    u: ArrayLike = 1.0,
) -> Mechanism:
    """The overconstrained mechanism of the paper's Section 5: (60), (61).

    ??? example

        ```python
        rx.mechanisms.wojtyra2020(mu_rho=0.02).state(phi=0.8, rate=1.0)
        ```

    **Arguments:**

    - `length`: l, m.
    - `mass`: m, kg; the cranks have 3 m, coupler and slider 9 m.
    - `mu_rho`: friction coefficient times pin radius of the four revolutes A to D, m; one number or four. No
      friction if not given; the paper has 0.02.
    - `gravity`: m/s^2, downwards.
    - `u`: length unit, Section 3: all numbers are turned into units of 1/u metres (10 for decimetres).

    `state(phi, rate=...)` gives the state at crank angle phi (rad) and crank rate (rad/s).
    """
    u, mass = floats(u), floats(mass)
    length, gravity = u * floats(length), u * floats(gravity)
    half, zero = length * math.sqrt(2.0), 0.0 * length
    light, heavy = 3 * mass, 9 * mass
    friction = rubbing("mu_rho", None if mu_rho is None else u * floats(mu_rho), 4)

    def point(x: ArrayLike) -> tuple[ArrayLike, ArrayLike]:
        return x, zero

    bodies = [
        Body("1", light, 2 * light * length**2 / 3),
        Body("2", heavy, 16 * heavy * length**2 / 3),
        Body("3", light, 2 * light * length**2 / 3),
        Body("4", heavy, 16 * heavy * length**2 / 3),
    ]
    joints = [
        Revolute("A", "1", GROUND, point_i=point(-half), point_j=point(zero), **friction[0]),
        Revolute("B", "2", "1", point_i=point(-4 * length), point_j=point(half), **friction[1]),
        Revolute("C", "3", "2", point_i=point(half), point_j=point(4 * length), **friction[2]),
        Revolute("D", "3", GROUND, point_i=point(-half), point_j=point(8 * length), **friction[3]),
        Translational("K", "4", GROUND, point_i=point(zero), point_j=point(4 * length), normal=(1.0, 0.0)),
        Translational("L", "4", "2", point_i=point(zero), point_j=point(zero), normal=(0.0, 1.0)),
    ]
    return Mechanism(bodies, joints, gravity=(zero, -gravity), pose=_Pose(length), units=Units(length=u))
