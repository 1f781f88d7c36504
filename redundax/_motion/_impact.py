"""What happens where contacts close, open or change their load: an impact, and which contacts hold from there on.

Velocities after an impact are the nearest to those before, in the metric of the mass, that no contact forbids,

    M (v+ - v-) + Phi_q^T P = 0,   Phi_q v+ + Phi_t = 0,   0 <= P  _|_  Phi_q v+ + Phi_t <= -e max(Phi_q v- + Phi_t, 0)

where the last is of the contacts that are closed, whose rates are positive as they close. It is the problem of `solve`
for accelerations, with M v- for the load, and has one answer for regular mass. Each contact that has an impulse obeys
Newton's law of restitution. A rebound whose height is rounding is none.

What it takes is the kinetic energy before, less that after, and what drivers do by their impulses, whose rates are the
same before and after: Phi_t . P.
"""

from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Bool, Float

from .._closures._closure import Elasticity
from .._equations._factorisation import Factorisation
from .._equations._gaps import model_of_all
from .._equations._kinematics import prescribed_rate, slip_motion
from .._equations._scaling import Scaling, largest_violation, scaling
from .._solve._contacts import CLEAR, ActiveSet, Asked, active_set, contradicted, of_rows, size_along
from .._solve._play import at_sides
from .._solvers._friction_problem import Law
from .._system._contact import Contact, code_of, rows_that_hold
from .._system._friction import Friction, load_rows
from .._system._results import RESULTS, differs
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import replace_fields
from .._tools._numbers import are_known, cond, entries_set, scan, stop_gradient, take, tolerance_of, xp
from ._linear import least_friction
from ._moving import NONE, Equations, Touch
from ._rubbing import AtInstant, Instant, at_instant
from ._stick import Mode
from ._touch import GAP, TAKEN

# Gap, relative to the size of the mechanism, below which contacts close together: positions are not known better.
TOGETHER = 1e-8, 1e2
# Relative rate by which a row that holds may miss what it should have after an impact.
_MISSED = 1e-8, 1e3


class Before(NamedTuple):
    """What is known of an instant.

    - `closed`: contacts that are closed; others are too whose gap is less than `near`, relative to the size of the
      mechanism.
    - `loaded`: those to begin with, where there is no impact.
    - `leaves`: those that held so far and change: open where others have taken them away by a gap.
    """

    closed: Bool[Array, " c"]
    loaded: Bool[Array, " c"]
    leaves: Bool[Array, " c"]
    near: float


class After(NamedTuple):
    """How it goes on: the state, its factorisation, which contacts hold, which joints stick, where any can; whether
    that is found, and the friction of an impact known; the impulses of contacts, the energy that they took, whether
    there was an impact, and the bound of the contraction of friction in it."""

    state: State
    factor: Factorisation
    touch: Touch
    mode: Mode | None
    found: Bool[Array, ""]
    known: Bool[Array, ""]
    impulses: Float[Array, " c"]
    lost: Float[Array, ""]
    work: Float[Array, ""]
    strikes: Bool[Array, ""]
    contraction: Float[Array, ""]


class _Now(NamedTuple):
    """Velocities after an impact so far, and the rows that hold in it."""

    qd: Float[Array, " n"]
    kept: Bool[Array, " m"]


class _Turn(NamedTuple):
    """What a turn has solved, of which rows, and the active set that it has found."""

    solution: AtInstant
    factor: Factorisation
    kept: Bool[Array, " m"]
    active: ActiveSet
    found: Bool[Array, ""]


# Turns: an impact with the rows that push, the same with those beside that end at rest, and how it goes on.
_TURNS = np.arange(3)
_HOLDS, _GOES_ON = _TURNS[1:]


def settle(equations: Equations, state: State, restitution: Float[Array, " c"], before: Before) -> After:
    """An impact if contacts approach, and which of them hold from there on."""
    system = equations.system
    model, rows = model_of_all(system, state), np.array(system.names.one_sided)
    jacobian, scales = model.jacobian, scaling(system, model)
    rate = take(model.motion.rate / scales.rows, rows)
    gap = -take(scales.violations(model.motion.value), rows)
    near = (before.closed | (gap < before.near)) & ~(before.leaves & (gap > tolerance_of(GAP, gap)))
    slow = tolerance_of(NONE, rate) * equations.speed
    strikes = xp.any(near & (rate > slow))
    rebound = restitution * xp.maximum(rate, 0.0)
    calm = (2 * tolerance_of(GAP, rebound)) ** 0.5 * equations.speed  # it would rise by no more than counts as a gap
    bounce = xp.where(rebound > calm, rebound * take(scales.rows, rows), 0.0)
    right = jacobian @ state.qd - model.motion.rate
    right = entries_set(right, rows, take(right, rows) - bounce)
    chosen, play = equations.closing(state), equations.play
    # What an impact leaves of the slip of joints that stuck is not known from before.
    sense = xp.where(strikes, 1.0, equations.sense)
    known = are_known(equations, state, restitution)
    caches = [{} if known else None for _ in range(2)]

    def turn(now: _Now, place: Array | np.integer) -> tuple[_Now, _Turn]:
        last = place == _GOES_ON
        at = replace_fields(state, qd=xp.where(last, now.qd, state.qd))
        wanted = cond(last, lambda: model_of_all(system, at).motion.gamma, lambda: right)
        # Impulses are beyond what misfit and play make of loads.
        fits = Elasticity(chosen.compliance, xp.where(last, chosen.misfit, 0.0))
        loose = None if play is None else replace_fields(play, clearance=xp.where(last, play.clearance, 0.0))
        there = equations.with_sense(xp.where(last, sense, equations.sense))
        instant = Instant(~last, model.mass @ state.qd, wanted, there)
        parts = rate + take(jacobian @ (now.qd - state.qd) / scales.rows, rows)
        closed = near & (~last | (parts >= -slow))
        taken = xp.where(last, tolerance_of(TAKEN, rate), largest_violation(rate.dtype))
        asked = Asked(closed, closed & (~last | strikes | before.loaded), (jacobian, wanted, scales), last, taken)
        alone = at_sides(loose, partial(at_instant, stop_gradient(instant)))
        of_set = of_rows(alone, caches[int(last)] if known else None)
        active = active_set(system, at, fits, of_set, asked)
        kept = xp.where(place == _HOLDS, now.kept, active.kept)
        if play is not None:  # of which the part crosses a clearance, as this contact has just lost its load
            idle = take(equations.touching.kept, rows) & ~before.loaded & active.decided
            idle = idle & (active.contacts == code_of(Contact.touches)) & last & ~strikes
            kept = kept & ~entries_set(xp.zeros_like(kept), rows, idle)
        factor, solution, _, found = of_set(system, at, fits, kept, instant)
        stays = near & (take((right - jacobian @ solution.acceleration) / scales.rows, rows) < calm)  # as for rebounds
        onward = _Now(
            xp.where(strikes & ~last, solution.acceleration, now.qd),
            active.kept | rows_that_hold(system.names, stays, stays),
        )
        found = found & ~differs(solution.result, RESULTS.successful)
        return onward, _Turn(solution, factor, kept, active, found)

    begin = _Now(state.qd, xp.zeros_like(right, bool))
    now, (*impact, end) = scan(turn, begin, _TURNS[_GOES_ON:] if known and not strikes else _TURNS)
    impulses, well, rubs, contraction = _struck(impact, system, (jacobian, right, scales), equations.speed, calm)
    impulses = xp.where(strikes, impulses, 0.0)
    work = prescribed_rate(system.opened(xp.ones_like(end.kept)), state.q, state.t) @ impulses
    sound = xp.ones((), bool) if equations.has_sense else _is_sound(end, (jacobian, end.factor.gamma, scales))
    rests = (end.active.contacts == code_of(Contact.touches)) & ~take(end.kept, rows) & end.active.decided
    mode, idle, qd = end.solution.mode, xp.zeros(len(equations.sensed), bool), now.qd
    if mode is not None:
        idle = _idle(equations, state, end.kept)
        mode = mode._replace(sense=xp.where(idle, 1.0, mode.sense))
        qd = _halted(equations, replace_fields(state, qd=qd), end, mode)
    return After(
        replace_fields(state, qd=qd),
        end.factor,
        Touch(end.kept, stop_gradient(rests), stop_gradient(end.factor.spectrum.rank), idle, xp.zeros_like(gap)),
        mode,
        end.active.settled & end.found & sound & (well | ~strikes),
        ~(strikes & rubs),
        take(impulses, rows),
        (state.qd @ model.mass @ state.qd - qd @ model.mass @ qd) / 2 + work,
        work,
        strikes,
        xp.where(strikes, contraction, 0.0),
    )


def _is_sound(end: _Turn, at: tuple[Array, Array, Scaling]) -> Bool[Array, ""]:
    """Whether the equations hold at an instant, but for what rows contradict each other where one has just been put
    down or is about to be taken away."""
    contradicts = (RESULTS.inconsistent_constraints, RESULTS.inadmissible_velocity, RESULTS.ambiguous_constraints)
    off = xp.max(xp.abs(contradicted(end.kept, at, end.factor)))
    little = off <= tolerance_of(TAKEN, off) * size_along(at, end.factor, end.solution)
    result = end.factor.result
    each = [~differs(result, RESULTS.successful), *(little & ~differs(result, each) for each in contradicts)]
    return xp.any(xp.stack(each))


def _struck(
    impact: list[_Turn], system: AbstractSystem, at: tuple[Array, Array, Scaling], speed: Array, calm: Array
) -> tuple[Float[Array, " m"], Bool[Array, ""], Bool[Array, ""], Float[Array, ""]]:
    """Impulses, whether velocities after an impact are found, whether joints are loaded whose friction has no law of
    impulses, and the bound of the contraction of friction; of none where there is no impact."""
    if not impact:
        return xp.zeros(len(system.rows)), xp.ones((), bool), xp.zeros((), bool), xp.zeros_like(speed)
    (jacobian, right, scales), (strikes, holds) = at, impact
    missed = xp.where(holds.kept, jacobian @ holds.solution.acceleration - right, 0.0) / scales.rows
    # Redundant contacts may rebound in ways that contradict the rest of others, by no more than rebounds that are none.
    meets = xp.all(xp.abs(missed) <= xp.maximum(tolerance_of(_MISSED, missed) * speed, calm))
    multipliers = strikes.solution.multipliers
    whole = xp.abs(multipliers * scales.rows)
    rubs = xp.any(take(whole, _without_impulse(system)) > CLEAR * xp.max(whole))
    impulses = xp.where(strikes.kept, multipliers, 0.0)
    contraction = xp.maximum(strikes.solution.contraction, holds.solution.contraction)
    return impulses, strikes.active.settled & strikes.found & holds.found & meets, rubs, contraction


def _halted(equations: Equations, state: State, end: _Turn, mode: Mode) -> Float[Array, " n"]:
    """Velocities without what is left of slips of joints that stick, taken away by the least friction."""
    rate, directions = slip_motion(equations.system.opened(end.kept), state)
    ways, factor = stop_gradient((directions, end.factor))
    unit = factor.respond(ways).acceleration
    sticks = equations.whole(mode.sense == 0)
    least = least_friction(ways.T @ unit, sticks, equations.slip_size)
    return state.qd - unit @ (least @ xp.where(sticks, rate, 0.0))


def _idle(equations: Equations, state: State, kept: Bool[Array, " m"]) -> Bool[Array, " p"]:
    """Whose friction is none, as rows that load it do not hold."""
    system, none = equations.system, xp.zeros_like(equations.sense)
    law = Law.of(*stop_gradient((system, none, none + 1.0, state)))
    holds = take(kept, load_rows(system.friction))
    held, every = (law(xp.where(which, xp.ones_like(state.t), 0.0)) for which in (holds, holds | ~holds))
    return (held == 0) & (every != 0)


def _without_impulse(system: AbstractSystem) -> np.ndarray:
    """Rows that load friction whose impulse is not known."""
    groups = [g for g in system.friction if not g.has_sense or isinstance(g, Friction)]
    return np.array(load_rows(groups) if groups else [], int)
