"""Senses of slip: when they change, and whether a mechanism at rest sticks.

A motion goes on with the senses of slip held, smoothly through the instant at which a slip rate is zero; the step that
passed it is taken back by Newton's method on the time,

    dt = -rate / rate',   y <- y(t + dt) by one step of order 8,

whose end is the event and whose derivative is that of the event. There one joint reverses while the others slip on; or,
with one degree of freedom, all stop together. At rest a slip in the senses s is possible if the accelerations that
friction in these senses leaves are in these senses. Both senses are tried. If neither is possible the mechanism sticks:
with tau = sigma law(lam), the accelerations at sigma = 1 and -1 do not leave rest, and between them, by continuity,
there are admissible friction forces that hold it.
"""

from typing import NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._kinematics import slip_motion
from .._state import State
from ._held_rank import Held, kinetics, respond
from ._moving import Context, Equations, Moving, projected

# Slip and velocity that count as none, relative to those of the mechanism.
_NONE = 1e-9
# Steps of Newton's method on the time of an event.
_NEWTON = 4


class Onward(NamedTuple):
    """How it goes on from an event: senses, whether it sticks, and whether these senses are consistent."""

    sense: Float[Array, " p"]
    stuck: Bool[Array, ""]
    consistent: Bool[Array, ""]


def slip_rates(equations: Equations, t: Array, y: Moving) -> Float[Array, " p"]:
    """Slip rates of all joints."""
    return slip_motion(equations.system, State(y.q, y.qd, t))[0]


def _slip_accelerations(equations: Equations, t: Array, y: Moving, context: Context) -> Float[Array, " p"]:
    """Rates of the slip rates along the motion with the senses of the equations."""
    slope = equations.derivative(t, y, context)
    ones = jnp.ones_like(t)
    return jax.jvp(lambda t, y: slip_rates(equations, t, y), (t, y), (ones, slope))[1]


def reversed_slip(equations: Equations, t: Array, y: Moving) -> Bool[Array, " p"]:
    """Which joints slip against their sense."""
    small = _NONE * equations.speed / equations.slip_size
    return slip_rates(equations, t, y) * equations.sense < -small


def back_to_event(equations: Equations, t: Array, y: Moving, context: Context) -> tuple[Array, Moving]:
    """The first instant before t at which a joint that now slips against its sense had no slip."""
    over = reversed_slip(equations, t, y)
    since = jnp.where(over, slip_rates(equations, t, y) / _slip_accelerations(equations, t, y, context), -jnp.inf)
    joint = jnp.argmax(since)

    def newton(carry: tuple[Array, Moving], _: None) -> tuple[tuple[Array, Moving], None]:
        t, y = carry
        dt = -slip_rates(equations, t, y)[joint] / _slip_accelerations(equations, t, y, context)[joint]
        there = _stepped(equations, t, y, dt, context)
        return (t + dt, projected(equations.system, t + dt, there, context.held)[0]), None

    return jax.lax.scan(newton, (t, y), None, length=_NEWTON)[0]


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


def onward(equations: Equations, t: Array, y: Moving, held: Held, one_freedom: Array) -> Onward:
    """How the motion goes on from an instant at which a slip rate is zero, or from rest."""
    rates, small = slip_rates(equations, t, y), 1e3 * _NONE * equations.speed / equations.slip_size
    still = jnp.abs(rates) <= small
    rest = jnp.max(jnp.abs(y.qd) / equations.scaling.coordinates) <= 1e3 * _NONE * equations.speed
    free = jnp.sign(_free_slip(equations, t, y, held))
    one = jnp.where(rest, free, jnp.where(still, -equations.sense, jnp.sign(rates)))
    other = jnp.where(rest, -free, jnp.where(still, equations.sense, jnp.sign(rates)))
    both = jnp.stack([one, other])
    goes_one, goes_other = jax.lax.map(lambda sense: _goes(equations, t, y, held, sense, still), both)
    sense = jnp.where(goes_one | ~goes_other, one, other)
    goes = goes_one | goes_other
    return Onward(sense, rest & one_freedom & ~goes, goes | rest & one_freedom)


def _free_slip(equations: Equations, t: Array, y: Moving, held: Held) -> Float[Array, " p"]:
    """Slip accelerations without friction."""
    state = State(y.q, y.qd, t)
    parts = kinetics(equations.system, state, held)
    gamma = parts.motion.gamma / held.row_scale
    a, _ = respond(parts, held, equations.system.load(state)[:, None], gamma[:, None])
    return slip_motion(equations.system, state)[1].T @ a[:, 0]


def _goes(equations: Equations, t: Array, y: Moving, held: Held, sense: Array, still: Array) -> Bool[Array, ""]:
    """Whether the joints at rest start in the given senses when friction acts in them."""
    trial = eqx.tree_at(lambda e: e.sense, equations, sense)
    change = _slip_accelerations(trial, t, y, Context(held, None)) * sense
    size = jnp.max(jnp.where(still, jnp.abs(change), 0.0))
    return (size > 0) & jnp.all(~still | (change >= -1e-6 * size))
