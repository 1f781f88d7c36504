"""Derivatives of the constraints along the motion, by forward mode alone.

    Phi(s) = Phi(q [+] s qd, t + s):   Phi_q qd + Phi_t = Phi'(0),   gamma = -Phi''(0)      (3), (4), (5)

so that Phi_q qdd = gamma; two nested directional derivatives, no second-derivative tensor. A friction slip
s(q, t) gives in the same way its rate and its direction E = (ds/dq)^T.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._state import State
from ._system import AbstractSystem

_GAUSS_NEWTON = 6  # steps, whose error is squared each time from a turn of a radian on


class AlongMotion(NamedTuple):
    """Constraint residual (m,), its rate (m,) and gamma (m,), Eqs. (2) to (5)."""

    value: Float[Array, " m"]
    rate: Float[Array, " m"]
    gamma: Float[Array, " m"]


def along_motion(system: AbstractSystem, state: State) -> AlongMotion:
    """Phi, Phi_q qd + Phi_t and gamma at a state."""
    return _along(system, state, state.qd, jnp.ones_like(state.t))


def explicit_gamma(system: AbstractSystem, state: State) -> Float[Array, " m"]:
    """-Phi_tt, the part of gamma that prescribed motion alone is answerable for."""
    return _along(system, state, jnp.zeros_like(state.qd), jnp.ones_like(state.t)).gamma


def second_order(system: AbstractSystem, state: State) -> tuple[AlongMotion, Float[Array, " m"], Float[Array, " m"]]:
    """`along_motion`; `explicit_gamma`; and the second derivative of Phi as all angular coordinates turn.

    They turn each at another rate, so that no two cancel. All three are one derivative in three directions.
    """
    angular = system.coordinates.angular
    turning = np.where(angular, 1.0 + 0.5 * np.sin(np.arange(angular.size)), 0.0)
    rates = jnp.stack([state.qd, jnp.zeros_like(state.qd), jnp.asarray(turning, state.qd.dtype)])
    found = jax.vmap(lambda rate, time: _along(system, state, rate, time))(rates, jnp.array([1, 1, 0], state.qd.dtype))
    motion, explicit, turned = (jax.tree.map(lambda x, k=k: x[k], found) for k in range(3))
    return motion, explicit.gamma, -turned.gamma


def _along(system: AbstractSystem, state: State, rate: Array, time: Array) -> AlongMotion:
    """Phi, Phi' and -Phi'' as s grows from 0 in q [+] s rate, t + s time."""
    return _second(lambda s: system.constraint(system.retract(state.q, s * rate), state.t + s * time), state.t)


def _second(value: Callable[[Array], Array], like: Array) -> AlongMotion:
    zero, one = jnp.zeros_like(like), jnp.ones_like(like)
    (phi, first), (_, second) = jax.jvp(lambda s: jax.jvp(value, (s,), (one,)), (zero,), (one,))
    return AlongMotion(phi, first, -second)


def jacobian(system: AbstractSystem, state: State) -> Float[Array, "m n"]:
    """Constraint Jacobian Phi_q through the retraction."""
    return _jacobian_at(system, state, jnp.zeros_like(state.qd))


def change_of_jacobian(system: AbstractSystem, state: State, direction: Float[Array, " n"]) -> Float[Array, "m n"]:
    """Derivative of Phi_q as the position moves along a direction, at constant t."""
    moved = jnp.zeros_like(direction)
    return jax.jvp(lambda d: _jacobian_at(system, state, d), (moved,), (direction,))[1]


def _jacobian_at(system: AbstractSystem, state: State, d: Array) -> Array:
    return jax.jacfwd(lambda d: system.constraint(system.retract(state.q, d), state.t))(d)


def chart_rate(system: AbstractSystem, state: State) -> Float[Array, "..."]:
    """q', the rate of the coordinates: the derivative of q [+] s qd at s = 0."""
    zero = jnp.zeros_like(state.t)
    return jax.jvp(lambda s: system.retract(state.q, s * state.qd), (zero,), (jnp.ones_like(zero),))[1]


def chart_inverse(system: AbstractSystem, base: Array, d: Array, change: Array) -> Float[Array, " n"]:
    """The change of d that changes base [+] d by a given one, by least squares."""
    slope = jax.jacfwd(lambda e: system.retract(base, e))(d).reshape(-1, d.size)
    return jax.scipy.linalg.solve(slope.T @ slope, slope.T @ change.ravel(), assume_a="pos")


def displacement(system: AbstractSystem, base: Float[Array, "..."], q: Float[Array, "..."]) -> Float[Array, " n"]:
    """d with base [+] d nearest to q, by Gauss-Newton; not for turns beyond about a right angle."""
    if system.adds:
        return q - base

    def step(_: Array, d: Array) -> Array:
        return d + chart_inverse(system, base, d, q - system.retract(base, d))

    return jax.lax.fori_loop(0, _GAUSS_NEWTON, step, jnp.zeros(len(system.coordinates), q.dtype))


def between(system: AbstractSystem, first: State, second: State, t: Float[Array, ""]) -> State:
    """The state at a time by cubic interpolation of the displacement; internal states linear."""
    span = second.t - first.t
    whole = displacement(system, first.q, second.q)

    def moved(t: Array) -> Array:
        s = (t - first.t) / span
        return s**2 * (3 - 2 * s) * whole + span * (s * (1 - s) ** 2 * first.qd - s**2 * (1 - s) * second.qd)

    d, qd = jax.jvp(moved, (t,), (jnp.ones_like(t),))
    share = (t - first.t) / span
    memory = jax.tree.map(lambda a, b: a + share * (b - a), first.memory, second.memory)
    return State(system.retract(first.q, d), qd, t, memory)


def slip_motion(system: AbstractSystem, state: State) -> tuple[Float[Array, " p"], Float[Array, "n p"]]:
    """Slip rates and slip directions E of all friction groups: F = E tau, rate = E^T qd + s_t."""

    def slip(d: Array, t: Array) -> Array:
        return _slips(system, system.retract(state.q, d), t)

    zero = jnp.zeros_like(state.qd)
    _, rate = jax.jvp(slip, (zero, state.t), (state.qd, jnp.ones_like(state.t)))
    return rate, jax.jacrev(slip)(zero, state.t).T


def slip_gamma(system: AbstractSystem, state: State) -> Float[Array, " p"]:
    """gamma of the slips: the slip rates change by E^T qdd - gamma."""
    return _second(lambda s: _slips(system, system.retract(state.q, s * state.qd), state.t + s), state.t).gamma


def _slips(system: AbstractSystem, q: Array, t: Array) -> Float[Array, " p"]:
    return jnp.concatenate([group.slip(q, t) for group in system.friction])
