"""Parallelogram linkage: one coupler on N equal parallel cranks.

A crank without load carries an axial force s_c alone, and the coupler is in equilibrium under N of them in one
direction: sum s_c = 0 and sum s_c X_c sin phi = 0. So k = N - 2, and k = N - 1 where phi = 0 or pi.
As the coupler only translates, the linkage swings as a physical pendulum,

    (sum (J_c + m_c l^2 / 4) + m l^2) phi'' = -g (sum m_c l / 2 + m l) cos phi.
"""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._bodies._body import GROUND
from .._bodies._joints import AngleDriver, Revolute
from .._bodies._law_of_time import Polynomial
from .._bodies._mechanism import Mechanism
from .._system._units import Units
from .._tools._module import figure, floats
from .._tools._value import AbstractModule
from ._parts import Numbers, at_least, checked, crank_poses, each, in_a_row, pivoted_cranks, point, rubbing, uniform_rod


class _Pose(AbstractModule):
    """Coordinates at crank angle phi; the coupler's centre is in its middle."""

    pivots: Float[Array, " cranks"] = eqx.field(converter=figure("pivots"))
    length: Float[Array, ""] = eqx.field(converter=figure("length"))

    def __call__(self, phi: Float[Array, ""]) -> Float[Array, " n"]:
        centres, tips = crank_poses(self.pivots, self.length, phi)
        coupler = (tips[0] + tips[-1]) / 2
        angles = jnp.full_like(self.pivots, phi)
        return jnp.concatenate([centres.ravel(), coupler, angles, jnp.zeros_like(angles[:1])])


@checked
def parallelogram(
    cranks: int = 3,
    crank: ArrayLike = 0.5,
    spacing: Numbers = 0.4,
    crank_mass: Numbers = 1.0,
    coupler_mass: ArrayLike = 4.0,
    mu_rho: Numbers | None = None,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """A coupler on N equal parallel cranks, overconstrained for N > 2.

    Bodies "crank 1" to "crank N" and "coupler", uniform rods; revolutes A1 to AN on the ground and B1 to BN on the
    coupler. n = 3 N + 3, m = 4 N, rank 3 N + 2, k = N - 2, one degree of freedom.

    At phi = 0 and pi, where all bodies are in line, rank 3 N + 1, k = N - 1 and two degrees of freedom to first order:
    there the coupler may start to turn, for N = 2 onto a second branch of motion, for N > 2 not beyond first order, so
    that such velocities are inadmissible. In this position (7) alone does not keep the coupler parallel, so the
    accelerations of a linkage that is not symmetric differ from their limit.

    ??? example

        ```python
        rx.mechanisms.parallelogram(cranks=4).state(phi=0.8, rate=1.0)
        ```

    **Arguments:**

    - `cranks`: N, at least 2.
    - `crank`: length of the cranks, m.
    - `spacing`: distance of neighbouring pivots, m; one number or N - 1.
    - `crank_mass`: kg; one number or N.
    - `coupler_mass`: kg.
    - `mu_rho`: friction coefficient times pin radius of A1 to AN, B1 to BN, m; one number or 2 N. No friction if not
      given.
    - `gravity`: m/s^2, downwards.

    `state(phi, rate=...)` gives the state at crank angle phi (rad), from the line of pivots, and crank rate (rad/s).
    """
    return _linkage(cranks, crank, spacing, crank_mass, coupler_mass, mu_rho, gravity, None)


@checked
def driven_parallelogram(
    cranks: int = 2,
    crank: ArrayLike = 0.5,
    spacing: Numbers = 0.4,
    crank_mass: Numbers = 1.0,
    coupler_mass: ArrayLike = 4.0,
    mu_rho: Numbers | None = None,
    gravity: ArrayLike = 9.81,
    angle: Callable[[Array], Array] | None = None,
) -> Mechanism:
    """A parallelogram linkage with a driver on each of its N cranks: redundantly driven.

    Bodies and revolutes as in `parallelogram`; drivers M1 to MN of the cranks. n = 3 N + 3, m = 5 N, rank 3 N + 3,
    k = 2 N - 3, no degree of freedom; the same at phi = 0 and pi. For N = 2 the drivers can work against each
    other: the self-stress is a force along the coupler with the moments -l sin phi and l sin phi of the drivers.

    ??? example

        ```python
        driven = rx.mechanisms.driven_parallelogram(angle=rx.Polynomial([0.8, 2.0]))
        driven.state(phi=0.8, rate=2.0)
        ```

    **Arguments:**

    - `cranks` to `gravity`: as for `parallelogram`.
    - `angle`: law of motion of all cranks, a function of time, rad; `Polynomial` for one with parameters that
      compile nothing new. phi = t if not given.

    `state(phi, rate=..., t=...)` gives the state at crank angle phi; it satisfies the drivers if phi = angle(t) and
    rate = d angle/dt at that time.
    """
    law = Polynomial([0.0, 1.0]) if angle is None else angle
    return _linkage(cranks, crank, spacing, crank_mass, coupler_mass, mu_rho, gravity, law)


@checked
def swing(
    rods: int = 3,
    length: ArrayLike = 1.0,
    spacing: Numbers = 0.5,
    mass: ArrayLike = 1.0,
    mu_rho: Numbers | None = None,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """A platform on N parallel massless rods: a singular mass matrix that is harmless.

    Bodies "crank 1" to "crank N", without mass and inertia, and "coupler", the platform, a uniform rod; joints and
    counts as in `parallelogram`, but rank M = 3. The platform has mass in every motion that the joints allow, so
    condition (14) holds and accelerations are unique: those of a simple pendulum, phi'' = -(g / l) cos phi.

    ??? example

        ```python
        rx.mechanisms.swing(rods=3).state(phi=-1.2, rate=0.5)
        ```

    **Arguments:**

    - `rods`: N, at least 2.
    - `length`: length of the rods, m.
    - `spacing`: distance of neighbouring rods, m; one number or N - 1.
    - `mass`: mass of the platform, kg.
    - `mu_rho`, `gravity`: as for `parallelogram`.

    `state(phi, rate=...)` gives the state at rod angle phi (rad) and its rate; the swing hangs at phi = -pi/2.
    """
    at_least("rods", rods, 2, "A platform on one rod is a double pendulum: give it a second rod.")
    return _linkage(rods, length, spacing, 0.0, mass, mu_rho, gravity, None)


def _linkage(
    count: int,
    crank: ArrayLike,
    spacing: Numbers,
    crank_mass: Numbers,
    coupler_mass: ArrayLike,
    mu_rho: Numbers | None,
    gravity: ArrayLike,
    law: Callable[[Array], Array] | None,
) -> Mechanism:
    at_least("cranks", count, 2, "A coupler on one crank is a double pendulum: give it a second crank.")
    length, gravity = floats(crank), floats(gravity)
    gaps = each("spacing", spacing, count - 1, "gap")
    pivots = in_a_row(gaps)
    friction = rubbing("mu_rho", mu_rho, 2 * count)
    bodies, ground = pivoted_cranks(pivots, length, each("crank_mass", crank_mass, count, "crank"), friction[:count])
    upper = [
        Revolute(
            f"B{c + 1}", "coupler", bodies[c].name, point_i=point(x - pivots[-1] / 2), point_j=point(length / 2), **own
        )
        for c, (x, own) in enumerate(zip(pivots, friction[count:], strict=True))
    ]
    drivers = [] if law is None else [AngleDriver(f"M{c + 1}", bodies[c].name, GROUND, angle=law) for c in range(count)]
    return Mechanism(
        [*bodies, uniform_rod("coupler", coupler_mass, pivots[-1])],
        [*ground, *upper, *drivers],
        gravity=point(0.0, -gravity),
        pose=_Pose(pivots, length),
        units=Units(),
    )
