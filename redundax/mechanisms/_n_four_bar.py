"""N-four-bar linkage: parallel cranks in a row, each joined to the next by a coupler of its own.

With N loops there are N + 1 cranks and N couplers on 3 N + 1 revolutes: n = 6 N + 3, m = 6 N + 2, and one degree of
freedom, so that no constraint is redundant, except where phi = 0 or pi. There every coupler can carry an axial
force of its own against the cranks beside it, k = N, and may start to turn, N + 1 degrees of freedom; the benchmark
lets the linkage pass through this position. It swings as a physical pendulum,

    (sum (J_c + m_c l^2 / 4) + sum m_b l^2) phi'' = -g (sum m_c / 2 + sum m_b) l cos phi.
"""

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._bodies._joints import Revolute
from .._bodies._mechanism import Mechanism
from .._system._units import Units
from .._tools._module import figure, floats
from .._tools._value import AbstractModule
from ._parts import Numbers, at_least, checked, crank_poses, each, in_a_row, pivoted_cranks, point, rubbing, uniform_rod


class _Pose(AbstractModule):
    """Coordinates at crank angle phi."""

    pivots: Float[Array, " cranks"] = eqx.field(converter=figure("pivots"))
    length: Float[Array, ""] = eqx.field(converter=figure("length"))

    def __call__(self, phi: Float[Array, ""]) -> Float[Array, " n"]:
        centres, tips = crank_poses(self.pivots, self.length, phi)
        couplers = (tips[1:] + tips[:-1]) / 2
        angles = jnp.full_like(self.pivots, phi)
        return jnp.concatenate([centres.ravel(), couplers.ravel(), angles, jnp.zeros_like(angles[1:])])


@checked
def n_four_bar(
    loops: int = 2,
    crank: ArrayLike = 1.0,
    spacing: Numbers = 1.0,
    crank_mass: Numbers = 1.0,
    coupler_mass: Numbers = 1.0,
    mu_rho: Numbers | None = None,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """N four-bar loops in a row, a benchmark of the IFToMM for singular positions; a large scene for large N.

    Bodies "crank 1" to "crank N+1" and "coupler 1" to "coupler N", uniform rods; revolutes A1 to AN+1 of the cranks
    on the ground, and of coupler c Bc on crank c and Cc on crank c + 1. n = 6 N + 3, m = 6 N + 2 = rank: k = 0, one
    degree of freedom. At phi = 0 and pi, rank 5 N + 2, k = N and N + 1 degrees of freedom to first order.

    ??? example

        ```python
        rx.mechanisms.n_four_bar(loops=3).state(phi=0.8, rate=1.0)
        ```

    **Arguments:**

    - `loops`: N, at least 1.
    - `crank`: length of the cranks, m.
    - `spacing`: distance of neighbouring pivots, m; one number or N.
    - `crank_mass`: kg; one number or N + 1.
    - `coupler_mass`: kg; one number or N.
    - `mu_rho`: friction coefficient times pin radius of all A, then of B1, C1, B2, C2, ..., m; one number or 3 N + 1.
      No friction if not given.
    - `gravity`: m/s^2, downwards.

    `state(phi, rate=...)` gives the state at crank angle phi (rad), from the line of pivots, and crank rate (rad/s).
    """
    at_least("loops", loops, 1, "One loop is a four-bar linkage of two cranks and a coupler.")
    length, gravity = floats(crank), floats(gravity)
    gaps = each("spacing", spacing, loops, "gap")
    pivots = in_a_row(gaps)
    friction = rubbing("mu_rho", mu_rho, 3 * loops + 1)
    masses = each("crank_mass", crank_mass, loops + 1, "crank")
    bodies, joints = pivoted_cranks(pivots, length, masses, friction[: loops + 1])
    tip, couplers, upper = point(length / 2), [], []
    for c, (gap, mass) in enumerate(zip(gaps, each("coupler_mass", coupler_mass, loops, "coupler"), strict=True)):
        coupler = uniform_rod(f"coupler {c + 1}", mass, gap)
        couplers.append(coupler)
        first, second = friction[loops + 1 + 2 * c : loops + 3 + 2 * c]
        upper += [
            Revolute(f"B{c + 1}", coupler.name, bodies[c].name, point_i=point(-gap / 2), point_j=tip, **first),
            Revolute(f"C{c + 1}", coupler.name, bodies[c + 1].name, point_i=point(gap / 2), point_j=tip, **second),
        ]
    bodies, joints, pose = [*bodies, *couplers], [*joints, *upper], _Pose(pivots, length)
    return Mechanism(bodies, joints, gravity=point(0.0, -gravity), pose=pose, units=Units())
