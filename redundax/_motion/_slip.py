"""Events: a joint that slips comes to a stop, or joints that stick are let go.

A step goes on with the senses held, smoothly through the event; at its end it is seen (`has_event`), and taken back:
bisection of the interpolated step brackets the event, and Newton's method on the time finds it,

    dt = -h / h',   y <- y(t + dt) by one step of order 8,

h a slip rate, or of a joint let go its slip acceleration with the friction of its sense. The end of the iteration is
the event, and its derivative that of the event. Joints let go start from there; where a slip rate is zero it is asked
which joints stick (`_stick`).

Where a joint has several slips with one friction h is the velocity of its surfaces, or their acceleration, along the
direction in which they slide as the step begins, or in which they are let go: that of what holds them. Beyond a stop
friction goes on as before it. Steps that end against that direction must pass a stop (`ends_well`), and Newton's method
stays within them, as friction turns the slip ever faster about a stop and h' is of its rounding there. The first
moments after a release are those of `_release`.

A mechanism at rest is looked at from time to time: loads that change may let it go.
"""

from collections.abc import Callable
from typing import NamedTuple, cast

import diffrax
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._equations._kinematics import between
from .._system._directions import Directions
from .._system._state import State
from .._tools._numbers import stop_gradient
from ._moving import NONE, Context, Equations, Linear, Moving, rechart, tolerance_of
from ._project import project
from ._stick import Mode, mode_of, next_mode

# Halvings of the step, steps that locate an event, into the bracket and then Newton's, and looks at rest.
_HALVINGS, _NEWTON, _LOOKS = 8, 5, 100
# Slip across the direction that comes to a stop, relative to the speed of the mechanism, at least so many roundings.
_BESIDE = 1e-8, 1e2


class Bracket(NamedTuple):
    """Where an event is, to a fraction of a step or of the time between two looks.

    - `low`, `high`: instants before and just after it; both the end where there is none.
    - `there`: what joints do at `high`.
    - `against`: slip rates against their sense, as lengths, of joints that stop; shape (p,).
    """

    low: Array
    high: Array
    there: Mode
    against: Float[Array, " p"]


def has_event(equations: Equations, state: State, linear: Linear, along: Array | None) -> Bool[Array, ""]:
    """Whether a joint slips against its sense, or joints that stick do not any longer."""
    there = mode_of(equations, state, linear, jnp.any(equations.sticking))
    small = tolerance_of(NONE, linear.rate) * equations.speed / equations.slip_size
    return jnp.any(is_released(equations, there)) | jnp.any(_against(equations, linear.rate, along) > small)


def ends_well(equations: Equations, rate: Float[Array, " p"], along: Float[Array, " p"]) -> Bool[Array, ""]:
    """Whether joints with several slips that slide against the directions of the step's start did so past a stop, and
    not beside it, where they turn round."""
    if equations.directions is None:
        return jnp.ones((), bool)
    directions, slow = equations.directions, tolerance_of(_BESIDE, rate) * equations.speed
    ahead = directions.along(rate, along)
    beside = rate - ahead * along / directions.arms
    passed = directions.every(jnp.abs(beside) * equations.slip_size <= slow)
    return jnp.all((ahead >= 0) | passed | ~directions.directed)


def is_released(equations: Equations, there: Mode) -> Bool[Array, " p"]:
    """Which joints that stick are let go."""
    return equations.sticking & (there.sense != 0)


def _against(equations: Equations, rate: Float[Array, " p"], along: Float[Array, " p"] | None) -> Float[Array, " p"]:
    """Rates at which joints slip against their sense; of those with a direction as of the slip that moves most."""
    against = jnp.where(jnp.asarray(equations.sensed), -rate * equations.sense, 0.0)
    if along is None or equations.directions is None:
        return against
    directions, sizes = equations.directions, equations.slip_size
    whole = -directions.along(rate, along) * directions.reach(sizes) / sizes
    return jnp.where(directions.directed, whole, against)


def bracket_event(
    equations: Equations,
    first: State,
    last: State,
    context: Context,
    resting: Bool[Array, ""],
    happened: Bool[Array, ""],
) -> Bracket:
    """The first event between two states, if one has happened; or where the loads let a mechanism at rest go."""
    equations, first, last, (held, _, along) = stop_gradient((equations, first, last, context))
    span = jnp.where(last.t > first.t, last.t - first.t, 1.0)

    def here(t: Array, wanted: Array) -> tuple[Mode, Float[Array, " p"]]:
        state = between(equations.system, first, last, (t - first.t) / span)
        linear = equations.linear(state, held, closed=equations.loaded)
        there = mode_of(equations, state, linear, jnp.any(equations.sticking) & wanted)
        return there, _against(equations, linear.rate, along) * equations.slip_size

    def look(carry: _Looking) -> _Looking:
        low, high, count = carry.found.low, carry.found.high, carry.looks
        next_look = first.t + (last.t - first.t) * ((count + 1) / _LOOKS)
        t = jnp.where(carry.halves, jnp.where(count == 0, high, (low + high) / 2), next_look)
        there, against = here(t, ~carry.ends)
        over = jnp.where(carry.halves & (count == 0), against > 0, carry.over)
        late, free = jnp.where(over, against, 0.0), is_released(equations, there)
        before = (carry.halves & (count > 0) & ~jnp.any(free) & jnp.all(late <= 0)) | (~carry.halves & there.resting)
        old, new = carry.found._replace(low=t), Bracket(low, t, there, late)
        found = jax.tree.map(lambda a, b: jnp.where(before, a, b), old, new)
        starts = ~carry.halves & ~there.resting & jnp.any(free)
        ends = jnp.where(carry.halves, count == _HALVINGS, (before & (count + 1 == _LOOKS)) | ~(before | starts))
        return _Looking(jnp.where(starts, 1, count + 1), found, over, carry.halves | starts, ends)

    zero, none = jnp.zeros_like(equations.sense), jnp.zeros((), bool)
    whole = Bracket(first.t, last.t, Mode(equations.sense, zero, ~none, none), zero)
    begin = _Looking(jnp.zeros((), int), whole, zero > 0, ~resting, ~(resting | happened))
    return jax.lax.while_loop(lambda carry: ~carry.ends, look, begin).found


class _Looking(NamedTuple):
    """How often it was looked, what was found, which joints slip against their sense at the end of the step, whether
    an event is closed in on by halves, and whether that is all."""

    looks: Array
    found: Bracket
    over: Bool[Array, " p"]
    halves: Bool[Array, ""]
    ends: Bool[Array, ""]


def locate(
    equations: Equations, bracket: Bracket, t: Array, y: Moving, context: Context, event: Bool[Array, ""]
) -> tuple[Array, Moving, Mode, Bool[Array, " p"] | None]:
    """The event of the bracket, from (t, y) after it, how it goes on from there, and which joints with several slips
    are let go.

    `event` says whether there is one: a batch looks where there is none.
    """
    fixed, last = stop_gradient(equations), t
    reverses, go = jnp.any(bracket.against > 0), is_released(fixed, bracket.there)
    joint = jnp.where(reverses, jnp.argmax(bracket.against), jnp.argmax(go))
    free = ~reverses & jnp.any(go)
    starts = equations.with_sense(jnp.where(free & go, bracket.there.sense, equations.sense))

    def newton(carry: _Newton, count: Array) -> tuple[_Newton, None]:
        t, y = carry.t, carry.y
        begins, begin = starts, context
        if equations.directions is not None and context.along is not None:
            begins = starts.with_sense(
                jnp.where(free & go & equations.directions.directed, _let_go(equations, y.at(t), context), starts.sense)
            )
            begin = context._replace(along=jnp.where(free & go, begins.sense, context.along))

        def chosen(rates: Array) -> Array:
            if equations.directions is None or begin.along is None:
                return rates[joint]
            return equations.directions.along(rates, begin.along)[joint]

        def ahead(slip: Array, rate: Array) -> _Ahead:
            h, width = chosen(jnp.where(free, slip, rate)), bracket.high - bracket.low
            secant = jax.lax.stop_gradient(h - carry.h) / jnp.where(width > 0, width, 1.0)
            slope = jnp.where(free, jnp.where(count == 2, secant, carry.slope), chosen(slip))
            dt = jnp.where(slope != 0, -h / jnp.where(slope != 0, slope, 1.0), 0.0)
            first = jnp.where(free, bracket.low, bracket.high) - t
            dt = jnp.where(count == 0, first, jnp.where(free & (count == 1), width, dt))
            if equations.directions is not None:
                within = jnp.clip(dt, last - 2**_HALVINGS * width - t, last - t)
                dt = jnp.where(free, dt, dt + jax.lax.stop_gradient(within - dt))
            return _Ahead(jnp.where(event, dt, 0.0), h, slope)

        y, (dt, h, slope) = _stepped((equations, context), (begins, begin), t, y, ahead)
        y = project(equations.system, t + dt, rechart(equations.system, y)[0], context.held)
        return _Newton(t + dt, y, h, slope), None

    zero = jnp.zeros_like(t)
    (t, y, *_), _ = jax.lax.scan(newton, _Newton(t, y, zero, zero), jnp.arange(_NEWTON))
    stopped = next_mode(fixed, y.at(t), context.held, event)
    sense = starts.sense
    if equations.directions is not None:
        let_go = _let_go(equations, y.at(t), context)
        turned = jnp.where(go, let_go, bracket.there.sense)
        sense = jnp.where(equations.directions.directed, turned, sense)
    going = bracket.there._replace(sense=sense, resting=jnp.zeros((), bool))
    onward = jax.tree.map(lambda a, b: jnp.where(free, a, b), going, stopped)
    if equations.directions is not None:  # what is left of slip has a direction
        qd = equations.with_sense(onward.sense).halted(y.at(t), context.held)
        y = y._replace(qd=jnp.where(event, qd, y.qd))
        return t, y, onward, event & free & go & equations.directions.directed
    return t, y, onward, None


def _let_go(equations: Equations, state: State, context: Context) -> Float[Array, " p"]:
    """Senses in which joints that stick are let go: against what holds them, where they have a direction."""
    directions = cast(Directions, equations.directions)
    linear = equations.linear(state, context.held, closed=equations.loaded)
    tau = equations.solved(state, linear, context.tau, context.along).tau
    return directions.unit(-tau / directions.arms)


class _Newton(NamedTuple):
    """Where the iteration is, h there before, and the slope of h of a joint that is let go."""

    t: Array
    y: Moving
    h: Array
    slope: Array


class _Ahead(NamedTuple):
    """How far to step, h, and its slope."""

    dt: Array
    h: Array
    slope: Array


def _stepped(
    whole: tuple[Equations, Context],
    first: tuple[Equations, Context],
    t: Array,
    y: Moving,
    ahead: Callable[[Float[Array, " p"], Float[Array, " p"]], _Ahead],
) -> tuple[Moving, _Ahead]:
    """One explicit step of the method of Dormand and Prince of order 8, which both modes of derivatives pass.

    How far it goes is told by rates of the slip rates, with the senses of `first`, and slip rates where it begins.
    """
    flat, unravel = jax.flatten_util.ravel_pytree(y)
    tableau = diffrax.Dopri8.tableau
    weights = [np.zeros(0), np.zeros(0), *tableau.a_lower]  # the first looks how far, the others are the method's
    stages = len(weights)
    lower = np.array([np.pad(row, (k > 0, stages - row.size - (k > 0))) for k, row in enumerate(weights)])
    lower = jnp.asarray(lower, flat.dtype)
    nodes = jnp.asarray(np.concatenate([np.zeros(2), tableau.c]), flat.dtype)

    def stage(k: Array, carry: tuple[Array, _Ahead]) -> tuple[Array, _Ahead]:
        slopes, told = carry
        (equations, context), (starts, begin) = whole, first
        there = equations.with_sense(jnp.where(k == 0, starts.sense, equations.sense))
        if context.along is not None and begin.along is not None:
            context = context._replace(along=jnp.where(k == 0, begin.along, context.along))
        at = unravel(flat + told.dt * lower[k] @ slopes)
        slope, slip, rate = there.instant(t + nodes[k] * told.dt, at, context)
        told = jax.tree.map(lambda a, b: jnp.where(k == 0, a, b), ahead(slip, rate), told)
        return slopes.at[k].set(jax.flatten_util.ravel_pytree(slope)[0]), told

    zero = jnp.zeros_like(t)
    start = jnp.zeros((stages, flat.size), flat.dtype), _Ahead(zero, zero, zero)
    slopes, told = jax.lax.fori_loop(0, stages, stage, start)
    return unravel(flat + told.dt * jnp.asarray(tableau.b_sol, flat.dtype) @ slopes[1:]), told
