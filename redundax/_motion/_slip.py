"""Events: a joint that slips comes to a stop, or joints that stick are let go.

A step goes on with the senses held, smoothly through the event; at its end it is seen (`happened`), and taken back:
bisection of the interpolated step brackets the event, and Newton's method on the time finds it,

    dt = -h / h',   y <- y(t + dt) by one step of order 8,

h a slip rate, or of a joint let go its slip acceleration with the friction of its sense. The end of the iteration is
the event, and its derivative that of the event. Joints let go start from there; where a slip rate is zero it is asked
which joints stick (`_stick`).
"""

from typing import NamedTuple

import diffrax
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._kinematics import slip_motion
from .._state import State
from ._moving import Context, Equations, Linear, Moving, projected
from ._stick import NONE, Onward, counted, onward, settled

# Halvings of the step, and steps of Newton's method, that locate an event.
_HALVINGS, _NEWTON = 8, 4


class Bracket(NamedTuple):
    """An instant just after an event, the slope of h up to it, the joint, and whether it is let go."""

    end: Array
    slope: Array
    joint: Array
    released: Bool[Array, ""]


def happened(equations: Equations, state: State, linear: Linear) -> tuple[Float[Array, ""], Onward]:
    """1 where a joint slips against its sense or joints that stick do not any longer, else 0; and the senses there."""
    some = jnp.any(equations.sticking)
    there = settled(equations, state, linear, some)
    there = there._replace(sense=jnp.where(some, there.sense, equations.sense))
    event = jnp.any(_let_go(equations, there) | _reversed(equations, linear.rate))
    return event.astype(state.t.dtype), there


def _reversed(equations: Equations, rate: Float[Array, " p"]) -> Bool[Array, " p"]:
    small = counted(NONE, rate) * equations.speed / equations.slip_size
    return jnp.asarray(equations.sensed) & (rate * equations.sense < -small)


def _let_go(equations: Equations, there: Onward) -> Bool[Array, " p"]:
    return equations.sticking & (there.sense != 0)


def locate(
    equations: Equations,
    start: tuple[Array, Moving],
    t: Array,
    y: Moving,
    context: Context,
    there: Onward,
    event: Bool[Array, ""],
) -> tuple[Array, Moving, Onward]:
    """The first event of the step from `start` to (t, y), and how it goes on from there.

    `there` are the senses at the end of the step; `event` says whether there is one: a batch looks where there is none.
    """
    fixed, end, rank, there = jax.lax.stop_gradient((equations, (t, y), context, there))
    let_go = _let_go(fixed, there)
    after = fixed.with_sense(jnp.where(let_go, there.sense, fixed.sense))
    bracket = _bracket(fixed, after, let_go, start, end, rank, event)
    mode = equations.with_sense(jnp.where(bracket.released, after.sense, equations.sense))

    def newton(carry: tuple[Array, Moving, Array], _: None) -> tuple[tuple[Array, Moving, Array], None]:
        t, y, dt = carry
        y = projected(equations.system, t + dt, _stepped(equations, t, y, dt, context), context.held)[0]
        slip, rate = _slip(mode, y.at(t + dt), context)
        h = jnp.where(bracket.released, slip, rate)[bracket.joint]
        slope = jnp.where(bracket.released, bracket.slope, slip[bracket.joint])
        return (t + dt, y, jnp.where(event, -h / jnp.where(event, slope, 1.0), 0.0)), None

    (t, y, _), _ = jax.lax.scan(newton, (t, y, bracket.end - t), None, length=_NEWTON)
    stopped = onward(fixed, y.at(t), context.held, event)
    onwards = Onward(after.sense, there.tau, jnp.zeros((), bool), there.decided)
    return t, y, jax.tree.map(lambda a, b: jnp.where(bracket.released, a, b), onwards, stopped)


def _slip(equations: Equations, state: State, context: Context) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
    """Rates of the slip rates, and slip rates."""
    linear = equations.linear(state, context.held, closed=equations.loaded)
    return equations.solved(state, linear, context.tau).slip, linear.rate


def _bracket(
    equations: Equations,
    after: Equations,
    let_go: Bool[Array, " p"],
    begin: tuple[Array, Moving],
    end: tuple[Array, Moving],
    context: Context,
    event: Bool[Array, ""],
) -> Bracket:
    """The first event to a fraction of the step, interpolated; h is taken so that it is positive before the event."""
    over = _reversed(equations, slip_motion(equations.system, end[1].at(end[0]))[0])

    def heights(t: Array) -> Array:
        slip, rate = _slip(after, _between(begin, end, t), context)
        of_one = jnp.where(let_go, -slip * after.sense, rate * equations.sense)
        return jnp.where(over | let_go, of_one * equations.slip_size, jnp.inf)

    def halved(carry: tuple) -> tuple:
        k, low, high, at_low, at_high = carry
        t = jnp.where(k == 0, low, jnp.where(k == 1, high, (low + high) / 2))
        found = heights(t)
        before = (k == 0) | (k > 1) & jnp.all(found > 0)
        ends = (t, high, found, at_high), (low, t, at_low, found)
        return k + 1, *jax.tree.map(lambda a, b: jnp.where(before, a, b), *ends)

    none = jnp.zeros_like(equations.sense)
    first = jnp.zeros((), int), begin[0], end[0], none, none
    _, low, high, at_low, at_high = jax.lax.while_loop(lambda c: event & (c[0] < 2 + _HALVINGS), halved, first)
    joint = jnp.argmin(at_high)
    released = let_go[joint]
    sign = jnp.where(released, -after.sense, equations.sense) * equations.slip_size
    slope = (at_high - at_low)[joint] / (high - low) / sign[joint]
    return Bracket(high, slope, joint, released)


def _between(begin: tuple[Array, Moving], end: tuple[Array, Moving], t: Array) -> State:
    """The state by cubic interpolation of positions and velocities of both ends, linear of internal states."""
    (t0, y0), (t1, y1) = begin, end
    span = t1 - t0

    def position(t: Array) -> Array:
        s = (t - t0) / span
        ends = (1 + 2 * s) * (1 - s) ** 2 * y0.q + s**2 * (3 - 2 * s) * y1.q
        return ends + span * (s * (1 - s) ** 2 * y0.qd - s**2 * (1 - s) * y1.qd)

    q, qd = jax.jvp(position, (t,), (jnp.ones_like(t),))
    share = (t - t0) / span
    return State(q, qd, t, tuple(jax.tree.map(lambda a, b: a + share * (b - a), y0.memory, y1.memory)))


def _stepped(equations: Equations, t: Array, y: Moving, dt: Array, context: Context) -> Moving:
    """One explicit step of the method of Dormand and Prince of order 8, which both modes of derivatives pass."""
    flat, unravel = jax.flatten_util.ravel_pytree(y)
    tableau = diffrax.Dopri8.tableau
    weights = [np.zeros(0), *tableau.a_lower]
    stages = len(weights)
    lower = jnp.asarray(np.array([np.pad(row, (0, stages - row.size)) for row in weights]), flat.dtype)
    nodes = jnp.asarray(np.append(0.0, tableau.c), flat.dtype)

    def stage(k: Array, slopes: Array) -> Array:
        slope = equations.derivative(t + nodes[k] * dt, unravel(flat + dt * lower[k] @ slopes), context)
        return slopes.at[k].set(jax.flatten_util.ravel_pytree(slope)[0])

    slopes = jax.lax.fori_loop(0, stages, stage, jnp.zeros((stages, flat.size), flat.dtype))
    return unravel(flat + dt * jnp.asarray(tableau.b_sol, flat.dtype) @ slopes)
