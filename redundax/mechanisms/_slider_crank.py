"""Slider-crank linkage whose slider runs in one or more parallel guides.

Each guide beyond the first repeats two constraints: the guides can press against each other and twist the slider
between them, k = 2 (guides - 1). With crank a and rod b,

    x = a cos phi + (b^2 - a^2 sin^2 phi)^(1/2),   sin psi = -(a / b) sin phi.
"""

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._bodies._body import GROUND, Body
from .._bodies._joints import Revolute
from .._bodies._loads import AppliedForce
from .._bodies._mechanism import Mechanism
from .._system._units import Units
from .._tools._module import figure, floats
from .._tools._value import AbstractModule
from ._parts import Numbers, at_least, checked, parallel_guides, point, rubbing, uniform_rod


class _Pose(AbstractModule):
    """Coordinates at crank angle phi, NaN where the rod cannot reach."""

    crank: Float[Array, ""] = eqx.field(converter=figure("crank"))
    rod: Float[Array, ""] = eqx.field(converter=figure("rod"))

    def __call__(self, phi: Float[Array, ""]) -> Float[Array, " 9"]:
        pin = self.crank * jnp.stack([jnp.cos(phi), jnp.sin(phi)])
        reach = jnp.sqrt(self.rod**2 - pin[1] ** 2)
        slider = point(pin[0] + reach)
        angles = jnp.stack([phi, jnp.arctan2(-pin[1], reach), jnp.zeros_like(phi)])
        return jnp.concatenate([pin / 2, (pin + slider) / 2, slider, angles])


@checked
def slider_crank(
    guides: int = 2,
    crank: ArrayLike = 0.25,
    rod: ArrayLike = 0.52,
    gauge: ArrayLike = 0.1,
    crank_mass: ArrayLike = 1.0,
    rod_mass: ArrayLike = 1.0,
    slider_mass: ArrayLike = 2.0,
    slider_inertia: ArrayLike = 0.01,
    force: ArrayLike = 0.0,
    mu_rho: Numbers | None = None,
    mu: Numbers | None = None,
    guide_length: ArrayLike | None = None,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """A slider-crank linkage on parallel guides; with `guides=1` it is not overconstrained.

    Bodies "crank", "rod" (uniform) and "slider"; revolutes A (crank on the ground at the origin), B (rod on the crank)
    and C (slider on the rod), guides K1, K2, ... of the slider on the ground. n = 9, m = 6 + 2 guides, rank 8,
    k = 2 (guides - 1), one degree of freedom. The loads of A, B and C are unique; those of the guides only where
    there is one. For the usual two guides k = 2.

    ??? example

        ```python
        rx.mechanisms.slider_crank(guides=2, force=-50.0).state(phi=0.8, rate=1.0)
        ```

    **Arguments:**

    - `guides`: number of guides, at least 1.
    - `crank`, `rod`: lengths, m; the crank can turn round if the rod is longer.
    - `gauge`: distance of the outermost guides, m.
    - `crank_mass`, `rod_mass`, `slider_mass`: kg.
    - `slider_inertia`: about C, the slider's centre of mass, kg m^2; it never turns.
    - `force`: on the slider along x, N.
    - `mu_rho`: friction coefficient times pin radius of A, B, C, m; one number or three. No friction if not given.
    - `mu`: friction coefficient of the guides; one number or one for each. No friction if not given.
    - `guide_length`: distance of the slider's two contacts with a guide, m; needed with `mu`.
    - `gravity`: m/s^2, downwards.

    `state(phi, rate=...)` gives the state at crank angle phi (rad), 0 in the outer dead centre, and crank rate (rad/s).
    """
    at_least("guides", guides, 1, "Without a guide the slider is a third link of a pendulum.")
    a, b, gravity = floats(crank), floats(rod), floats(gravity)
    friction = rubbing("mu_rho", mu_rho, 3)
    bodies = [
        uniform_rod("crank", crank_mass, a),
        uniform_rod("rod", rod_mass, b),
        Body("slider", slider_mass, slider_inertia),
    ]
    joints = [
        Revolute("A", "crank", GROUND, point_i=point(-a / 2), point_j=point(0.0), **friction[0]),
        Revolute("B", "rod", "crank", point_i=point(-b / 2), point_j=point(a / 2), **friction[1]),
        Revolute("C", "slider", "rod", point_i=point(0.0), point_j=point(b / 2), **friction[2]),
        *parallel_guides("slider", guides, gauge, 0.0, 0.0, mu, guide_length),
    ]
    return Mechanism(
        bodies,
        joints,
        loads=[AppliedForce("slider", force=point(force))],
        gravity=point(0.0, -gravity),
        pose=_Pose(a, b),
        units=Units(),
    )
