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

from .._kinematics import between, slip_motion
from .._state import State
from ._moving import Context, Equations, Linear, Moving, charted, projected
from ._stick import NONE, Onward, counted, onward, settled

# Halvings of the step, and steps of Newton's method, that locate an event.
_HALVINGS, _NEWTON = 8, 4


class Bracket(NamedTuple):
    """An instant just after an event, what joints do there, the joint, whether it is let go, and the slope of h."""

    end: Array
    there: Onward
    joint: Array
    released: Bool[Array, ""]
    slope: Array


def happened(equations: Equations, state: State, linear: Linear) -> Bool[Array, ""]:
    """Whether a joint slips against its sense, or joints that stick do not any longer."""
    there = settled(equations, state, linear, jnp.any(equations.sticking))
    small = counted(NONE, linear.rate) * equations.speed / equations.slip_size
    return jnp.any(released(equations, there)) | jnp.any(_against(equations, linear.rate) > small)


def released(equations: Equations, there: Onward) -> Bool[Array, " p"]:
    """Which joints that stick are let go."""
    return equations.sticking & (there.sense != 0)


def _against(equations: Equations, rate: Float[Array, " p"]) -> Float[Array, " p"]:
    """Rates at which joints slip against their sense."""
    return jnp.where(jnp.asarray(equations.sensed), -rate * equations.sense, 0.0)


def locate(
    equations: Equations, start: tuple[Array, Moving], t: Array, y: Moving, context: Context, event: Bool[Array, ""]
) -> tuple[Array, Moving, Onward]:
    """The first event of the step from `start` to (t, y), and how it goes on from there.

    `event` says whether there is one: a batch looks where there is none.
    """
    fixed, ends, rank = jax.lax.stop_gradient((equations, (start[1].at(start[0]), y.at(t)), context))
    bracket = _bracket(fixed, *ends, rank, event)
    mode = equations.with_sense(jnp.where(bracket.released, _after(fixed, bracket.there), equations.sense))

    def newton(carry: tuple[Array, Moving, Array], _: None) -> tuple[tuple[Array, Moving, Array], None]:
        t, y, dt = carry
        stepped = charted(equations.system, _stepped(equations, t, y, dt, context))[0]
        y = projected(equations.system, t + dt, stepped, context.held)[0]
        slip, rate = _slip(mode, y.at(t + dt), context)
        h = jnp.where(bracket.released, slip, rate)[bracket.joint]
        slope = jnp.where(bracket.released, bracket.slope, slip[bracket.joint])
        return (t + dt, y, jnp.where(event, -h / jnp.where(event, slope, 1.0), 0.0)), None

    (t, y, _), _ = jax.lax.scan(newton, (t, y, bracket.end - t), None, length=_NEWTON)
    stopped = onward(fixed, y.at(t), context.held, event)
    going = bracket.there._replace(sense=mode.sense, resting=jnp.zeros((), bool))
    return t, y, jax.tree.map(lambda a, b: jnp.where(bracket.released, a, b), going, stopped)


def _after(equations: Equations, there: Onward) -> Float[Array, " p"]:
    """Senses with which joints that are let go start."""
    return jnp.where(released(equations, there), there.sense, equations.sense)


def _slip(equations: Equations, state: State, context: Context) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
    """Rates of the slip rates, and slip rates."""
    linear = equations.linear(state, context.held, closed=equations.loaded)
    return equations.solved(state, linear, context.tau).slip, linear.rate


def _bracket(
    equations: Equations,
    first: State,
    last: State,
    context: Context,
    event: Bool[Array, ""],
) -> Bracket:
    """The first event to a fraction of the step, interpolated; a reversal where there are both."""

    def at(t: Array) -> State:
        return between(equations.system, first, last, (t - first.t) / (last.t - first.t))

    over = _against(equations, slip_motion(equations.system, last)[0]) > 0

    def halved(carry: tuple) -> tuple:
        k, low, high, there, against = carry
        t = jnp.where(k == 0, high, (low + high) / 2)
        state = at(t)
        linear = equations.linear(state, context.held, closed=equations.loaded)
        here = settled(equations, state, linear, event & jnp.any(equations.sticking))
        late = jnp.where(over, _against(equations, linear.rate), 0.0)
        before = (k > 0) & ~jnp.any(released(equations, here)) & jnp.all(late <= 0)
        ends = (t, high, there, against), (low, t, here, late * equations.slip_size)
        return k + 1, *jax.tree.map(lambda a, b: jnp.where(before, a, b), *ends)

    zero, none = jnp.zeros_like(equations.sense), jnp.zeros((), bool)
    whole = jnp.zeros((), int), first.t, last.t, Onward(equations.sense, zero, none, none), zero
    _, low, high, there, against = jax.lax.while_loop(lambda c: event & (c[0] <= _HALVINGS), halved, whole)
    reverses, go = jnp.any(against > 0), released(equations, there)
    joint = jnp.where(reverses, jnp.argmax(against), jnp.argmax(go))
    after = equations.with_sense(_after(equations, there))
    ends = at(low), at(high)
    slips = jax.lax.map(lambda state: _slip(after, state, context)[0], jax.tree.map(lambda *x: jnp.stack(x), *ends))
    slope = (slips[1] - slips[0])[joint] / jnp.where(event, high - low, 1.0)
    return Bracket(high, there, joint, ~reverses & jnp.any(go), slope)


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
