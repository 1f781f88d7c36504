"""One-sided contacts of a phase: which rows hold, and the first instant at which others would.

A contact that is open ends the phase where its gap is closed, one that holds where its load passes zero, and one that
only touches, because the others hold it closed, where the closure would load it: where its strain against them

    s = W lam - d - Phi_q u,   Phi_q u = W lam - d in the rows that hold,

passes zero. One that holds ends it too where other rows take it away, as a driver that sets off: rows that contradict
each other, X^T gamma beyond rounding, have no loads that could pass zero. Soft laws leave a gap before that tells. An
open contact that the rows that hold decide, as a driver that puts a part down, need not pass zero: it closes where it
comes to rest without gap, rate and acceleration. Each is a margin, positive while the phase goes on. Rows that do not
hold are zeros (`opened`), so that one program serves all phases. A step that passes an event is not taken; the next one
ends there, by the dense output.
"""

from collections.abc import Callable
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._equations._kinematics import along_motion
from .._solve._contacts import OUTSIDE
from .._tools._numbers import as_program, chosen_of, or_one, tolerance_of, xp
from ._held_rank import HeldFactorisation, factorize_held
from ._moving import NONE, Context, Equations, Moving, Touch, rechart
from ._project import CLOSED
from ._scalars import Scalar

# Looks within a step, for contacts that close and open again within one, and halvings of what lies between two of them:
# what is left of a step is below the accuracy of its dense output.
_LOOKS, _HALVINGS = 8, 36
# Margins beyond which an event is passed: at the end of a step, which is projected, what rounding explains, of loads
# that of a solve; within one what its dense output may be off by.
GAP, _SIGN, _WITHIN = (1e-12, 1e3), (1e-9, 1e3), (1e-6, 1e4)
# Part of a step by which the next one ends later than the event found, so that the event lies within it.
_LATER = 2.0**-40
# Margins that a step which ends at an event leaves at most.
_OFF = 1e-4, 1e5
# Gap below which contacts that others hold closed do not: above what the rows that hold are off by after a step.
_APART = 1e-8, 1e3
# Share of accelerations by which others take a contact away, where steps end and what they leave is projected; and what
# steps within make of it at most, as they are off the constraints.
TAKEN, _TAKEN_WITHIN = (1e-8, 1e3), (1e-5, 1e6)
# Share of accelerations by which a contact that others put down still moves: rounding.
_CALM = 1e-12, 1e3


class Margins(NamedTuple):
    """Gaps relative to the size of the mechanism, loads relative to the largest or strains to theirs, accelerations by
    which others leave a contact, relative to all, or at the end of a step the gap by which they did, and by how much
    more than rounding others still move it; infinite of contacts that are asked for the other. And gaps of those that
    hold, minus infinite of others."""

    gap: Float[Array, "*looks c"]
    push: Float[Array, "*looks c"]
    left: Float[Array, "*looks c"]
    moves: Float[Array, "*looks c"]
    held: Float[Array, "*looks c"]

    @property
    def least(self) -> Float[Array, "*looks c"]:
        """The least of those that pass zero."""
        return jnp.minimum(jnp.minimum(self.gap, self.push), self.left)

    def passed(self, gap: float, push: float, left: float) -> Bool[Array, "*looks c"]:
        """Whether one is below zero by more than it may be."""
        return (self.gap < -gap) | (self.push < -push) | (self.left < -left)


class Hit(NamedTuple):
    """When contacts open, close or change their load next, infinite where none does; and which."""

    time: Float[Array, ""]
    which: Bool[Array, " c"]


def no_hit(touch: Touch, like: Scalar) -> Hit:
    """No event ahead."""
    return Hit(xp.full_like(like, xp.inf), touch.rests != touch.rests)


def open_overlaps(equations: Equations, t: Array, y: Moving) -> Float[Array, " c"]:
    """By how much contacts that do not hold overlap, relative to the size of the mechanism."""
    system, kept = equations.system, equations.touching.kept
    rows = np.array(system.names.one_sided)
    value = equations.scaling.violations(system.opened(jnp.ones_like(kept)).constraint(y.q, t))
    return jax.lax.stop_gradient(jnp.where(kept, 0.0, jnp.maximum(value, 0.0))[rows])


def margins(
    equations: Equations, t: Array, y: Moving, context: Context, within: Bool[Array, ""] | bool = False
) -> Margins:
    """Those of all contacts at an instant, which may lie within a step."""
    system, scale, touch = equations.system, equations.scaling, equations.touching
    rows, state, kept = np.array(system.names.one_sided), y.at(t), touch.kept
    every = system.opened(jnp.ones_like(kept))
    motion = along_motion(every, state)
    gap, rate = -scale.violations(motion.value)[rows], (motion.rate / scale.rows)[rows] / equations.speed
    factor = cast(HeldFactorisation, factorize_held(system, state, context.held))
    linear, fits = equations.fitted(state, context.held, factor)
    solved = equations.solved(state, linear, context.tau, context.along)
    force = scale.rows * solved.multipliers
    size = or_one(jnp.maximum(jnp.max(jnp.abs(force)), jnp.max(jnp.abs(scale.coordinates * linear.load))))
    compliance, misfit = fits(solved.multipliers)
    bent = compliance @ solved.multipliers - misfit
    jacobian = every.jacobian(y.q, t)
    strain = bent - jacobian @ factor.nearest(jnp.where(kept, bent, 0.0))
    holds = kept[rows]
    push = jnp.where(holds, force[rows] / size, strain[rows] / or_one(jnp.max(jnp.abs(bent))))
    apart = jnp.maximum(jnp.where(touch.rests, tolerance_of(_APART, gap), 0.0), touch.overlap)
    gamma, mass = factor.motion.gamma, jnp.diagonal(system.mass(y.q, t))
    free = jnp.abs(linear.load) + jnp.abs(jacobian).T @ jnp.abs(solved.multipliers)
    parts = jnp.abs(solved.acceleration) + jnp.where(mass > 0, free / or_one(mass), 0.0)
    size = jnp.max((jnp.abs(jacobian) @ parts + jnp.abs(gamma)) / scale.rows)
    own = factor.held.row_scale
    taken = (own / scale.rows * (factor.stress @ (factor.stress.T @ (gamma / own))))[rows] / or_one(size)
    held = jnp.where(holds, gap, -jnp.inf)
    left = jnp.where(holds, 2 * tolerance_of(TAKEN, gap) - taken, jnp.inf)
    # Soft laws take positions apart before accelerations tell; as great where it is as much beyond what counts.
    parted = (2 - held / tolerance_of(GAP, gap)) * tolerance_of(TAKEN, gap)
    left = jnp.where(within, left, jnp.minimum(left, parted))
    into = ((jacobian @ solved.acceleration - motion.gamma) / scale.rows)[rows] / or_one(size)
    near, slow = (jnp.where(within, tolerance_of(_WITHIN, gap), tolerance_of(own, gap)) for own in (GAP, NONE))
    each = jnp.abs(gap) / near, jnp.abs(rate) / slow, jnp.abs(into) / tolerance_of(_CALM, gap)
    idle = holds | touch.rests | ~_decided(factor, jacobian[rows], scale.coordinates)
    moves = jnp.where(idle, jnp.inf, jnp.max(jnp.stack(each), axis=0) - 1)
    gap, push = jnp.where(holds, jnp.inf, gap + apart), jnp.where(holds | touch.rests, push, jnp.inf)
    return Margins(gap, push, left, moves, held)


def _decided(factor: HeldFactorisation, contacts: Float[Array, "c n"], sizes: Float[Array, " n"]) -> Bool[Array, " c"]:
    """Which contacts move with the rows that hold."""
    left = contacts - (contacts @ factor.response) @ factor.held_inverse(factor.rows)
    whole, free = (jnp.linalg.norm(each * sizes, axis=1) for each in (contacts, left))
    return free < OUTSIDE * or_one(whole)


def first_hit(
    equations: Equations, times: tuple[Array, Array], last: Moving, between: Callable[[Array], Moving], context: Context
) -> tuple[Hit, Bool[Array, ""]]:
    """The first event in a step from one time to another, given its end and its dense output; and whether it is one
    that no step can pass, as rows contradict each other beyond."""
    start, end = times
    width = end - start

    def at(look: tuple[Array, Array]) -> Margins:
        t, ends = look
        y = rechart(equations.system, between(t))[0]
        return margins(equations, t, chosen_of(ends, last, y), context, ~ends)

    parts = jnp.arange(1, _LOOKS + 1, dtype=width.dtype) / _LOOKS
    seen = jax.lax.map(at, (start + width * parts, parts == 1))
    rough, fine = tolerance_of(_WITHIN, width), [tolerance_of(each, width) for each in (GAP, _SIGN, TAKEN)]
    taken = tolerance_of(_TAKEN_WITHIN, width)
    at_end, rests = (parts == 1)[:, None], seen.moves[-1] < 0
    passed = jnp.where(at_end, seen.passed(*fine) | rests, seen.passed(rough, rough, taken))
    found, which = jnp.any(passed), passed[jnp.argmax(jnp.any(passed, axis=1))]

    def beyond_of(seen: Margins) -> Bool[Array, "*looks c"]:
        return which & jnp.where(rests, seen.moves < 0, seen.least < 0)

    first = jnp.argmax(jnp.any(beyond_of(seen), axis=1))

    def halve(now: tuple[Array, ...]) -> tuple[Array, ...]:
        low, high, which, held, count = now
        middle = (low + high) / 2
        there = at((middle, jnp.zeros((), bool)))
        past = beyond_of(there)
        beyond = jnp.any(past)
        bracket = jnp.where(beyond, low, middle), jnp.where(beyond, middle, high)
        return *bracket, jnp.where(beyond, past, which), jnp.where(beyond, there.held, held), count + 1

    bracket = start + width * first / _LOOKS, start + width * (first + 1) / _LOOKS
    begin = *bracket, which, seen.held[first], jnp.zeros((), int)
    _, high, which, held, _ = jax.lax.while_loop(lambda now: found & (now[-1] < _HALVINGS), halve, begin)
    closes = jnp.max(held) <= tolerance_of(CLOSED, width) / 2  # else a step to there fails: shorter ones find it before
    contradicts = found & closes & jnp.any(which & (seen.left < 0))
    return Hit(jnp.where(found, jnp.minimum(high + _LATER * width, end), jnp.inf), which & found), contradicts


@as_program
def arrived(
    equations: Equations, t: Array, y: Moving, context: Context, which: Bool[Array, " c"]
) -> tuple[Array, Moving]:
    """When an event is that a step has ended at, by a step of Newton's method on the time, and the state then.

    So the time has the derivatives of the margin that passes zero, dt = -dh / h'. Of a contact it is the one that is
    the least time away: another may be as small, and not pass.
    """
    change = jax.lax.stop_gradient(equations.derivative(t, y, context))
    along = jnp.ones_like(t), change
    each, slope = jax.jvp(lambda t, y: jnp.stack(margins(equations, t, y, context, True)[:3]), (t, y), along)
    slope = jax.lax.stop_gradient(slope)
    # What others put down has no slope but of rounding.
    falls = jnp.where(jnp.arange(len(each)) == 0, tolerance_of(NONE, t) * equations.speed / equations.scaling.size, 0.0)
    # Nor has what a gap has told of accelerations that have not: these are then as far from zero as at first.
    off = jnp.where(jnp.arange(len(each)) == 2, tolerance_of(TAKEN, each), tolerance_of(_OFF, each))
    sound = which & (slope < -falls[:, None]) & (jnp.abs(each) <= off[:, None])
    shifts = jnp.where(sound, -each / jnp.where(sound, slope, 1.0), jnp.inf)
    nearest = jnp.argmin(jnp.abs(shifts), axis=0)
    shift = jnp.min(jnp.take_along_axis(shifts, nearest[None], axis=0))
    shift = jnp.where(jnp.any(sound), shift, 0.0)
    return t + shift, rechart(equations.system, jax.tree.map(lambda x, rate: x + shift * rate, y, change))[0]
