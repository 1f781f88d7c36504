"""Which joints stick and which slip, and in which sense, from an instant on.

At an instant Coulomb friction of a joint without slip can take any value between those of its two senses. Friction tau
and the rates alpha of the slip rates then meet

    alpha = alpha_0 + A tau,   lo(rho) <= tau <= hi(rho),   alpha_j > 0 only at tau_j = lo_j,   alpha_j < 0 only at hi_j

with A = E^T A_tau symmetric positive semidefinite and rho = rho_0 + K tau. For given bounds these are the conditions of
optimality of min tau^T A tau / 2 + alpha_0^T tau, the principle of Gauss with friction. Projected Gauss-Seidel sweeps
solve it, the bounds following the loads. Joints that end with alpha_j = 0 stick; the others start in the sense of
alpha_j. It is one question for all joints: with one degree of freedom all stop together, and a joint at its bound is
held by the others.

Joints that slip have the friction of their sense, lo = hi. Where a joint has several slips with one friction a ball
takes the place of the interval, and its surfaces start to slide against their friction.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._solvers._gauss_seidel import Swept, gauss_seidel
from .._system._friction import friction_force, load_rows
from .._system._state import State
from .._tools._module import stop_gradient
from ._held_rank import AnyHeld
from ._moving import Equations, Linear, tolerance_of

# Slips and velocities at an event, relative to those of the mechanism; accelerations, relative to the sum of the parts
# that cancel; and changes of friction after which sweeps have settled it. Each with the roundings that it is at least.
_STILL, _HELD, _SETTLED = (1e-6, 1e3), (1e-7, 1e3), (1e-10, 1e3)
# Accelerations that are none, relative to a speed squared over the size of the mechanism.
_ROUNDING = 1e-12, 1e2


class Mode(NamedTuple):
    """How it goes on: senses, 0 of joints that stick; friction; whether all rests; whether sticking was decided.

    Senses of joints with several slips and one friction are unit directions of the velocity of their surfaces.
    """

    sense: Float[Array, " p"]
    tau: Float[Array, " p"]
    resting: Bool[Array, ""]
    decided: Bool[Array, ""]


def next_mode(equations: Equations, state: State, held: AnyHeld, wanted: Bool[Array, ""]) -> Mode:
    """How the motion goes on from an instant at which a slip rate is zero, if wanted; it has no derivative."""
    equations, state, held = stop_gradient((equations, state, held))
    return mode_of(equations, state, equations.linear(state, held, closed=equations.loaded), wanted)


def mode_of(equations: Equations, state: State, linear: Linear, wanted: Bool[Array, ""]) -> Mode:
    """`next_mode`, given the equations at the state."""
    sensed = jnp.asarray(equations.sensed)
    slow, held = tolerance_of(_STILL, linear.rate) * equations.speed, tolerance_of(_HELD, linear.rate)
    slows = jnp.abs(linear.rate) <= slow / equations.slip_size
    still = sensed & (equations.whole(slows) | equations.sticking)
    if linear.is_large:
        wanted = wanted & jnp.any(still)
        linear = linear.by_matrices(equations.system, state, wanted)
    tau, decided = _sticking_friction(equations, state, linear, still, wanted)
    acceleration = linear.slip + linear.yields @ tau
    parts = jnp.abs(linear.slip) + jnp.abs(linear.yields) @ jnp.abs(tau)
    size = jnp.max(jnp.where(still, parts * equations.slip_size, 0.0))
    sticks = still & equations.whole(jnp.abs(acceleration) * equations.slip_size <= held * size)
    begins, goes = equations.sense_of(linear.rate, acceleration)
    sense = jnp.where(still, jnp.where(sticks, 0.0, begins), goes)
    scale = equations.scaling.coordinates
    free, unit = linear.response.free.acceleration, linear.response.unit.acceleration
    moved = jnp.abs(free + unit @ tau)
    whole = jnp.abs(free) + jnp.abs(unit) @ jnp.abs(tau)
    rests = jnp.max(jnp.abs(state.qd) / scale) <= slow
    least = tolerance_of(_ROUNDING, slow) * equations.speed**2 / equations.scaling.size
    stays = jnp.max(moved / scale) <= jnp.maximum(held * jnp.max(whole / scale), least)
    decided = decided | ~jnp.any(still)
    return Mode(jnp.where(sensed, sense, 1.0), tau, rests & stays & jnp.any(sticks), decided)


def _sticking_friction(
    equations: Equations, state: State, linear: Linear, still: Bool[Array, " p"], wanted: Bool[Array, ""]
) -> Swept:
    """tau of the conditions above, and whether it was found."""
    friction, rows = equations.system.friction, load_rows(equations.system.friction)
    yielding = equations.yielding(linear)
    rho0, gain = (part.multipliers[rows] for part in (linear.response.free, linear.response.unit))
    pull = jnp.abs(linear.slip) * equations.slip_size
    reverses = jnp.isinf(yielding) & (pull > tolerance_of(_HELD, pull) * jnp.max(pull))  # whatever its friction
    yielding = jnp.where(reverses, jnp.finfo(pull.dtype).tiny, yielding)
    senses = [jnp.where(still, sense, jnp.sign(linear.rate)) for sense in (1.0, -1.0)]
    rate, directions = linear.rate, equations.directions
    if directions is not None:  # at rest, so that senses count
        rate = jnp.where(directions.directed & still, 0.0, rate)

    def bounds(tau: Array) -> tuple[Array, Array]:
        rho = rho0 + gain @ tau
        one, two = (friction_force(friction, rho, rate, sense, state) for sense in senses)
        return jnp.minimum(one, two), jnp.maximum(one, two)

    enough, weight = tolerance_of(_SETTLED, linear.rate), 1 / equations.slip_size
    return gauss_seidel(bounds, linear.slip, linear.yields, yielding, weight, enough, wanted, directions)
