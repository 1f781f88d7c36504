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

from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._equations._kinematics import constraint_motion
from .._equations._scaling import largest_violation
from .._solvers._active_set import size_of_parts
from .._solvers._friction_problem import Law
from .._system._directions import Directions
from .._system._friction import load_rows
from .._system._state import State
from .._tools._module import batch_any
from .._tools._no_answer import nan_where, without_derivative
from .._tools._numbers import stop_gradient, tolerance_of
from ._held_rank import AnyHeld
from ._linear import AnyLinear, Holding, Linear, least_friction
from ._moving import STILL, Equations, Solved

# Accelerations at an event, relative to the sum of the parts that cancel, and changes of friction after which sweeps
# have settled it; each with the roundings that it is at least.
_HELD, _SETTLED = (1e-7, 1e3), (1e-10, 1e3)
# Part of what friction could do that holds a joint for sure: ten times what sweeps leave.
_EASY = 1e-9, 1e4
# Accelerations that are none, relative to a speed squared over the size of the mechanism; and roundings, of those that
# friction by loads could cause, that are none.
_ROUNDING = 1e-12, 1e2
# Part of the speed of the mechanism that no joint has which a driver did not set off: it errs in the dense output of a
# step over the onset by a thousandth of that.
_MOVES = 1e-3
# Part of the accelerations that count as none that tells joints let go with others.
_FEW = 1e-2
# Times that it is asked which joints stick where joints with play stand as that makes them; two agree in most cases.
_ROUNDS = 3


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
    return mode_at(equations, state, held, equations.linear(state, held, closed=equations.loaded), wanted)


def mode_at(equations: Equations, state: State, held: AnyHeld, linear: AnyLinear, wanted: Bool[Array, ""]) -> Mode:
    """`next_mode`, given the equations at the state with joints as they slip before it, and with play as they stand."""
    mode = mode_of(equations, state, linear, wanted)
    if equations.play is None or not equations.loaded:
        return mode

    def again(_: Array, now: tuple[Mode, Bool[Array, ""]]) -> tuple[Mode, Bool[Array, ""]]:
        mode, _ = now
        there = mode_of(equations, state, equations.with_sense(mode.sense).linear(state, held), wanted)
        return there, jnp.all(there.sense == mode.sense)

    mode, same = jax.lax.fori_loop(0, _ROUNDS, again, (mode, jnp.zeros((), bool)))
    return mode._replace(decided=mode.decided & same)


def mode_of(equations: Equations, state: State, linear: AnyLinear, wanted: Bool[Array, ""]) -> Mode:
    """`next_mode`, given the equations at the state."""
    sensed, scale = jnp.asarray(equations.sensed), equations.scaling.coordinates
    slow, held = tolerance_of(STILL, linear.rate) * equations.speed, tolerance_of(_HELD, linear.rate)
    least = tolerance_of(_ROUNDING, slow) * equations.speed**2 / equations.scaling.size
    still, linear = _prescribed(equations, linear, least)
    (tau, caused, change, decided), limits, idle = _at_rest(equations, state, linear, still, wanted)
    acceleration = linear.slip + change.value
    size = size_of_parts(jnp.abs(linear.slip) + change.parts, equations.slip_size, still, held)
    most, without = (jnp.maximum(*map(jnp.abs, x)) for x in (limits, idle))
    slips, accelerations = linear.caused_at_most(most, jnp.abs(most - without))
    # Loads that press surfaces together, and that constraints bear, leave roundings of themselves; a brake leaves none.
    least = jnp.maximum(least, _ROUNDING[1] * float(jnp.finfo(least.dtype).eps) * jnp.max(accelerations / scale))
    caused_at_most = equations.slip_size * slips
    # where no load pulls along slips, these parts are rounding
    enough = jnp.maximum(held * size, tolerance_of(_EASY, linear.rate) * caused_at_most)
    sticks = still & equations.whole(jnp.abs(acceleration) * equations.slip_size <= enough)
    if equations.directions is not None:
        pulled = jnp.abs(acceleration) * equations.slip_size
        few = sticks & (pulled > _FEW * enough) & jnp.any(still & ~sticks & (pulled > enough))
        holds = _held_by(equations, cast(Linear, linear), tau, acceleration, sticks, few)
        sticks = sticks & ~_follows(equations.directions, holds, limits, few)
    begins, goes = equations.sense_of(linear.rate, acceleration)
    sense = jnp.where(still, jnp.where(sticks, 0.0, begins), goes)
    free = linear.response.free.acceleration
    moved = jnp.abs(free + caused.value)
    whole = jnp.abs(free) + caused.parts
    decided, rests = decided | ~jnp.any(still), jnp.zeros((), bool)
    if equations.touch is None:  # what rests does not ask for contacts, and drivers may run between two looks
        off, rate = (
            jnp.max(jnp.abs(x) / equations.scaling.rows, initial=0.0)
            for x in constraint_motion(equations.system, state)
        )
        stays = jnp.max(moved / scale) <= jnp.maximum(held * jnp.max(whole / scale), least)
        stays = stays & (rate <= slow) & (off <= largest_violation(off.dtype) * equations.scaling.size)
        rests = (jnp.max(jnp.abs(state.qd) / scale) <= slow) & stays & jnp.any(sticks)
    return Mode(jnp.where(sensed, sense, 1.0), tau, rests, decided)


def _prescribed(
    equations: Equations, linear: AnyLinear, least: Float[Array, ""]
) -> tuple[Bool[Array, " p"], AnyLinear]:
    """Which joints are still, and the equations; where constraints alone prescribe slips, none of those that move, and
    none begins to slip by the little that the dense output of a step leaves of rates."""
    still, free = equations.still(linear.rate), linear.free
    rate, pull = (jnp.abs(x) * equations.slip_size for x in (linear.rate, linear.slip))
    moves = rate > _MOVES * equations.speed
    begins = moves | (pull > jnp.maximum(rate**2 / equations.scaling.size, least))  # what rates alone cause is none
    still = still & equations.whole(free | ~moves)
    return still, linear._replace(slip=jnp.where(free | begins, linear.slip, 0.0))


def within_limits(
    equations: Equations, state: State, linear: AnyLinear, solved: Solved
) -> tuple[Float[Array, " m"], Float[Array, " p"]]:
    """Multipliers and friction, where joints that stick have no more than they can: the least that holds them may be
    more than one has as others have less. Others then do what it cannot, by which there is no derivative."""
    still, given = equations.sticking, (solved.multipliers, solved.tau)
    if solved.tau.size < 2:
        return given
    fixed, state, linear, (multipliers, tau) = stop_gradient((equations, state, linear, given))
    rows = load_rows(fixed.system.friction)
    law = Law.of(fixed.system, jnp.where(still, 0.0, linear.rate), fixed.sense, state)
    low, high = law.limits(multipliers[rows], still)
    few = tolerance_of(_SETTLED, tau) * jnp.max(jnp.abs(jnp.where(still, high - low, 0.0)))
    over = still & ((tau > high + few) | (tau < low - few))
    begin = jnp.clip(tau, low, high)
    if fixed.directions is not None:
        most = low - few, high + few
        over = jnp.where(fixed.directions.directed, _follows(fixed.directions, tau, most, still), over)
        begin = jnp.zeros_like(tau)
    wanted, response = jnp.any(over & still), linear.response
    shifted = linear._replace(slip=linear.slip + linear.yields @ begin)

    def limits(caused: Array) -> tuple[Array, Array]:
        low, high = law.limits(response.at(begin).multipliers[rows] + caused, still)
        return low - begin, high - begin

    def held() -> tuple[Array, Array]:
        tolerance = tolerance_of(_HELD, tau), tolerance_of(_SETTLED, tau)
        more = shifted.sticking(rows, limits, still, fixed.slip_size, tolerance, fixed.directions, wanted)
        friction = nan_where(~more.found, begin + more.tau)
        return response.at(friction).multipliers, friction

    within = jax.lax.cond(batch_any(wanted), held, lambda: (multipliers, tau))
    change = jax.tree.map(lambda a, b: jnp.where(wanted, a - b, 0.0), within, (multipliers, tau))
    return jax.tree.map(lambda a, b: without_derivative(wanted, a + b), given, change)


def _at_rest(
    equations: Equations, state: State, linear: AnyLinear, still: Bool[Array, " p"], wanted: Bool[Array, ""]
) -> tuple[Holding, tuple[Array, Array], tuple[Array, Array]]:
    """Friction of joints that stick or start to slip, if wanted, and of those that slip; its limits, and those without
    loads."""
    rows, rate, directions = load_rows(equations.system.friction), linear.rate, equations.directions
    rho0 = linear.response.free.multipliers[rows]
    if directions is not None:  # at rest, so that senses count
        rate = jnp.where(directions.directed & still, 0.0, rate)
    law = Law.of(equations.system, rate, jnp.sign(linear.rate), state)

    def limits(caused: Array) -> tuple[Array, Array]:
        return law.limits(rho0 + caused, still)

    tolerance = tolerance_of(_HELD, linear.rate), tolerance_of(_SETTLED, linear.rate)
    found = linear.sticking(rows, limits, still, equations.slip_size, tolerance, directions, wanted)
    return found, linear.limits_at(found.tau, rows, limits), law.limits(jnp.zeros_like(rho0), still)


def _held_by(
    equations: Equations,
    linear: Linear,
    tau: Float[Array, " p"],
    acceleration: Float[Array, " p"],
    sticks: Bool[Array, " p"],
    asked: Bool[Array, " p"],
) -> Float[Array, " p"]:
    """Friction that leaves joints that stick no acceleration: sweeps leave one, which tells nothing of their limits."""

    def held() -> Float[Array, " p"]:
        return tau - least_friction(linear.yields, sticks, equations.slip_size) @ acceleration

    return jax.lax.cond(batch_any(jnp.any(asked)), held, lambda: tau)


def _follows(
    directions: Directions, holds: Float[Array, " p"], limits: tuple[Array, Array], few: Bool[Array, " p"]
) -> Bool[Array, " p"]:
    """Which joints with several slips are let go with others, although they accelerate `few`, as they are near to where
    these turn about: to hold them takes more friction than they have."""
    low, high = limits
    radius, force = (high - low) / 2 / directions.arms, (holds - (high + low) / 2) / directions.arms
    whole = jnp.where(directions.same, radius**2, 0.0).sum(axis=1)
    needs = jnp.where(directions.same, force**2, 0.0).sum(axis=1)
    return directions.any(few) & (needs > whole) & directions.directed & (whole > 0)
