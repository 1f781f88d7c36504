"""Which joints stick and which slip, and in which sense, from an instant on.

At an instant Coulomb friction of a joint without slip can take any value between those of its two senses. Friction tau
and the rates alpha of the slip rates then meet

    alpha = alpha_0 + A tau,   lo(rho) <= tau <= hi(rho),   alpha_j > 0 only at tau_j = lo_j,   alpha_j < 0 only at hi_j

with A = E^T A_tau symmetric positive semidefinite and rho = rho_0 + K tau. For given bounds these are the conditions of
optimality of min tau^T A tau / 2 + alpha_0^T tau, the principle of Gauss with friction. Projected Gauss-Seidel sweeps
solve it, the bounds following the loads. Joints that end with alpha_j = 0 stick; the others start in the sense of
alpha_j. It is one question for all joints: with one degree of freedom all stop together, and a joint at its bound is
held by the others.

Joints that slip have the friction of their sense, lo = hi.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._system._friction import friction_force, load_rows
from .._system._state import State
from .._tools._module import still
from ._held_rank import Held
from ._moving import Equations, Linear

# Slips that count as none, and slips and velocities at an event, relative to those of the mechanism; accelerations,
# relative to the sum of the parts that cancel; and changes of friction after which sweeps have settled it. Each with
# the roundings that it is at least.
NONE, _STILL, _HELD, _SETTLED = (1e-9, 10), (1e-6, 1e3), (1e-7, 1e3), (1e-10, 1e3)
_SWEEPS = 2000


def counted(tolerance: tuple[float, float], like: Array) -> float:
    """A tolerance, at least so many roundings."""
    return max(tolerance[0], tolerance[1] * float(jnp.finfo(like.dtype).eps))


class Onward(NamedTuple):
    """How it goes on: senses, 0 of joints that stick; friction; whether all rests; whether sticking was decided."""

    sense: Float[Array, " p"]
    tau: Float[Array, " p"]
    resting: Bool[Array, ""]
    decided: Bool[Array, ""]


def onward(equations: Equations, state: State, held: Held, wanted: Bool[Array, ""]) -> Onward:
    """How the motion goes on from an instant at which a slip rate is zero, if wanted; it has no derivative."""
    equations, state, held = still((equations, state, held))
    return settled(equations, state, equations.linear(state, held, closed=equations.loaded), wanted)


def settled(equations: Equations, state: State, linear: Linear, wanted: Bool[Array, ""]) -> Onward:
    """`onward`, given the equations at the state."""
    sensed = jnp.asarray(equations.sensed)
    slow, held = counted(_STILL, linear.rate) * equations.speed, counted(_HELD, linear.rate)
    still = sensed & ((jnp.abs(linear.rate) <= slow / equations.slip_size) | equations.sticking)
    tau, decided = _settled(equations, state, linear, still, wanted)
    acceleration = linear.slip[:, 0] + linear.slip[:, 1:] @ tau
    parts = jnp.abs(linear.slip[:, 0]) + jnp.abs(linear.slip[:, 1:]) @ jnp.abs(tau)
    size = jnp.max(jnp.where(still, parts * equations.slip_size, 0.0))
    sticks = still & (jnp.abs(acceleration) * equations.slip_size <= held * size)
    sense = jnp.where(still, jnp.where(sticks, 0.0, jnp.sign(acceleration)), jnp.sign(linear.rate))
    scale = equations.scaling.coordinates
    moved = jnp.abs(linear.acceleration[:, 0] + linear.acceleration[:, 1:] @ tau)
    whole = jnp.abs(linear.acceleration[:, 0]) + jnp.abs(linear.acceleration[:, 1:]) @ jnp.abs(tau)
    rests = jnp.max(jnp.abs(state.qd) / scale) <= slow
    stays = jnp.max(moved / scale) <= held * jnp.max(whole / scale)
    decided = decided | ~jnp.any(still)
    return Onward(jnp.where(sensed, sense, 1.0), tau, rests & stays & jnp.any(sticks), decided)


def _settled(
    equations: Equations, state: State, linear: Linear, still: Bool[Array, " p"], wanted: Bool[Array, ""]
) -> tuple[Float[Array, " p"], Bool[Array, ""]]:
    """tau of the conditions above, and whether it was found."""
    friction, rows = equations.system.friction, load_rows(equations.system.friction)
    loads, yielding = linear.multipliers[rows], equations.yielding(linear)
    pull = jnp.abs(linear.slip[:, 0]) * equations.slip_size
    reverses = jnp.isinf(yielding) & (pull > counted(_HELD, pull) * jnp.max(pull))  # whatever its friction
    yielding = jnp.where(reverses, jnp.finfo(pull.dtype).tiny, yielding)
    senses = [jnp.where(still, sense, jnp.sign(linear.rate)) for sense in (1.0, -1.0)]

    def bounds(tau: Array) -> tuple[Array, Array]:
        rho = loads[:, 0] + loads[:, 1:] @ tau
        one, two = (friction_force(friction, rho, linear.rate, sense, state) for sense in senses)
        return jnp.minimum(one, two), jnp.maximum(one, two)

    def sweep(carry: tuple) -> tuple:
        tau, _, _, count = carry
        low, high = bounds(tau)

        def one(j: Array, new: Array) -> Array:
            alpha = linear.slip[j, 0] + linear.slip[j, 1:] @ new
            return new.at[j].set(jnp.clip(new[j] - alpha / yielding[j], low[j], high[j]))

        new = jax.lax.fori_loop(0, tau.size, one, tau)
        size = jnp.max(jnp.maximum(jnp.abs(low), jnp.abs(high)) / equations.slip_size)
        return new, jnp.max(jnp.abs(new - tau) / equations.slip_size), size, count + 1

    enough = counted(_SETTLED, linear.rate)

    def going(carry: tuple) -> Array:
        _, change, size, count = carry
        return wanted & (change > enough * size) & (count < _SWEEPS)

    zero = jnp.zeros_like(linear.rate)
    first = (zero, jnp.full_like(state.t, jnp.inf), jnp.zeros_like(state.t), jnp.zeros((), int))
    tau, change, size, _ = jax.lax.while_loop(going, sweep, first)
    return tau, change <= enough * size
