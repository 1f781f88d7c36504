"""Carriage on parallel guides.

Each guide beyond the first repeats two constraints, so k = 2 (guides - 1). Guide forces against each other at points
K_1 and K_k that lie x_1 and x_k along the guides turn the carriage; a guide moment x_1 - x_k balances them: for
x_1 != x_k this self-stress mixes forces with moments, and the minimum-norm loads depend on the length unit. With the
unit vector e along the guides

    m s'' = (f + m g) . e.
"""

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._bodies._body import Body
from .._bodies._loads import AppliedForce
from .._bodies._mechanism import Mechanism
from .._system._units import Units
from .._tools._module import figure, floats
from .._tools._value import AbstractModule
from ._parts import Numbers, at_least, checked, parallel_guides, point


class _Pose(AbstractModule):
    """Coordinates at the travel s."""

    angle: Float[Array, ""] = eqx.field(converter=figure("angle"))

    def __call__(self, s: Float[Array, ""]) -> Float[Array, "3"]:
        return jnp.stack([s * jnp.cos(self.angle), s * jnp.sin(self.angle), self.angle])


@checked
def carriage(
    guides: int = 2,
    gauge: ArrayLike = 0.4,
    offset: ArrayLike = 0.0,
    angle: ArrayLike = 0.0,
    mass: ArrayLike = 1.0,
    inertia: ArrayLike = 0.1,
    force: Numbers = (10.0, 0.0),
    at: Numbers = (0.0, 0.0),
    mu: Numbers | None = None,
    guide_length: ArrayLike | None = None,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """One body on parallel guides.

    Body "carriage"; guides K1, K2, ... on the ground. n = 3, m = 2 guides, rank 2, k = 2 (guides - 1), one degree of
    freedom. For the usual two guides m = 4 and k = 2, and no load of a guide is unique.

    ??? example

        ```python
        rx.mechanisms.carriage(mu=0.1, guide_length=0.1).state(s=0.0, rate=0.5)
        ```

    **Arguments:**

    - `guides`: number of guides, at least 1.
    - `gauge`: distance of the outermost guides, across them, m.
    - `offset`: distance of the outermost guided points, along the guides, m.
    - `angle`: of the guides from the horizontal, rad.
    - `mass`, `inertia`: kg, kg m^2 about the centre of mass, in the middle of the guided points.
    - `force`: applied force, global components, N.
    - `at`: its point of action in the frame of the carriage, x along the guides, m.
    - `mu`: friction coefficient of the guides; one number or one for each. No friction if not given.
    - `guide_length`: distance of the carriage's two contacts with a guide, m; needed with `mu`.
    - `gravity`: m/s^2, downwards.

    `state(s, rate=...)` gives the state at travel s (m) along the guides and its speed (m/s).
    """
    at_least("guides", guides, 1, "Without a guide the carriage is a free body.")
    gravity, angle = floats(gravity), floats(angle)
    return Mechanism(
        [Body("carriage", mass, inertia)],
        parallel_guides("carriage", guides, gauge, offset, angle, mu, guide_length),
        loads=[AppliedForce("carriage", force=force, point=at)],
        gravity=point(0.0, -gravity),
        pose=_Pose(angle),
        units=Units(),
    )
