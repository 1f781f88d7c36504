"""Stiffness: an explicit solver whose steps are bounded by its stability, and not by their error.

Two stages at one instant differ by what is the least smooth. By how much their rates differ tells the largest
eigenvalue of the equations,

    |lambda| = |Delta qdd| / |Delta qd|   or   |lambda|^2 = |Delta qdd| / |Delta q|

(E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.2). Where |h lambda| is at the boundary of
stability step by step, and many steps are left, an implicit solver takes over.
"""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._equations._kinematics import velocity
from ._moving import Equations, Moving
from ._scalars import Scalar

# |h lambda| that counts: the solver is stable up to 5.2 in the left half plane. Its last three stages are at one time.
_BOUNDARY, _STAGES = 4.5, (11, 12)
# How many steps more are stiff than are not when it counts; and steps left that are worth compiling another solver.
STIFF, _WORTH = 20, 3_000


class Watched(diffrax.Dopri8):
    """Dopri8, whose steps are watched for stiffness."""


def is_worth(stiff: Array, t: Scalar, step: Scalar, end: Array) -> Array:
    """Whether another solver takes over: by the steps that are stiff, and those left."""
    return (stiff >= STIFF) & (end - t > _WORTH * step)


def stiff_steps(before: Array, equations: Equations, y: Moving, rates: Moving, dt: Array) -> Float[Array, ""]:
    """How many steps more are stiff than are not, given those before and the increments of the stages of this one."""
    system, scale, first = equations.system, equations.scaling.coordinates, _STAGES[0]
    lower = diffrax.Dopri8.tableau.a_lower
    apart = lower[first] - np.append(lower[first - 1], 0.0)

    def moved(x: Array) -> Array:
        return jnp.tensordot(jnp.asarray(apart, x.dtype), x[: len(apart)], 1)

    off = moved(rates.q)
    off = off if system.adds else velocity(system, y.q, off)
    changes = moved(rates.qd), rates.qd[_STAGES[1]] - rates.qd[first]
    length, speed, change = (jnp.linalg.norm(x / scale) for x in (off, *changes))
    is_stiff = (change > _BOUNDARY * speed) | (dt * change > _BOUNDARY**2 * length)
    is_stiff = is_stiff & (speed > 100 * jnp.finfo(speed.dtype).eps * equations.speed)  # above rounding
    return jax.lax.stop_gradient(jnp.maximum(before + jnp.where(is_stiff, 1.0, -1.0), 0.0).astype(before.dtype))
