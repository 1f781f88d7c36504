"""Friction of joints that hold or start to slip in several directions, by an interior-point method.

    alpha = alpha_0 + A tau,   alpha_b + lambda_b tau_b = 0,   lambda_b s_b = 0,   s_b = (R_b^2 - |tau_b|^2) / 2 >= 0

for each joint b, with its limit R_b(tau), whose loads depend on friction, and lambda_b >= 0: the conditions of
`_gauss_seidel`, which approach limits of several joints of one body ever more slowly. Newton's method on these with
lambda_b s_b = mu goes to mu of zero all the faster, be it held or not. Joints with an interval are balls about its
middle, and those with one friction alone have that.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._system._directions import Directions
from .._tools._numbers import or_one

_STEPS = 60
# Part of the way to where a slack or multiplier is zero that a step takes.
_WITHIN = 0.995
# By how much changes of friction that no slip feels are held back.
_NEAR = 1e-9
# The smaller of both of each joint, and what equations miss, relative to their parts, where it ends; at least so many
# roundings.
_OPEN, _MISSED = (1e-11, 1e2), (1e-11, 1e3)
# How often joints that slip are put on their limits, which friction moves. It takes the last digits of their slack, of
# which the root bounds the error of accelerations.
_LAST = 8


class Interior(NamedTuple):
    """Friction, and whether it was found."""

    tau: Float[Array, " p"]
    found: Bool[Array, ""]


class _Point(NamedTuple):
    """Friction, slacks and multipliers of joints; what equations miss, the largest of what ends at zero, and steps."""

    force: Float[Array, " p"]
    slack: Float[Array, " p"]
    multiplier: Float[Array, " p"]
    missed: Array
    open: Array
    steps: Array


# Accelerations, friction about the middles, and slacks, by friction.
_Conditions: TypeAlias = Callable[[Array], tuple[Array, Array, Array]]


def interior(
    limits: Callable[[Float[Array, " p"]], tuple[Float[Array, " p"], Float[Array, " p"]]],
    free: Float[Array, " p"],
    matrix: Float[Array, "p p"],
    blocked: Bool[Array, " p"],
    weight: Float[Array, " p"],
    directions: Directions,
    wanted: Bool[Array, ""] | bool = True,
) -> Interior:
    """Friction of the conditions above; none where it is not wanted.

    Arguments are those of `gauss_seidel`; blocked are slips that constraints leave none.
    """
    same, arms, eps = jnp.asarray(directions.same), directions.arms, float(jnp.finfo(free.dtype).eps)
    enough = [max(least, times * eps) for least, times in (_OPEN, _MISSED)]
    low, high = limits(jnp.zeros_like(free))
    free, matrix = jnp.where(blocked, 0.0, arms * free), jnp.where(blocked[:, None], 0.0, arms[:, None] * matrix * arms)
    blocked = directions.every(blocked)
    held = directions.any(low < high) & ~blocked
    size = jnp.max(weight * jnp.maximum(jnp.abs(low), jnp.abs(high)), initial=0.0)
    each = jnp.where(same, weight * arms, 0.0).max(axis=1)  # alike in all directions of a joint
    unit = or_one(size) / each  # of friction
    pull = jnp.max(jnp.where(held, unit * (jnp.abs(free) + jnp.abs(matrix) @ unit), 0.0), initial=0.0)
    pull = or_one(pull)
    free, matrix = unit * free / pull, unit[:, None] * matrix * unit / pull
    which = same & held[:, None] & held

    def within(force: Array) -> tuple[Array, Array]:
        """Middles, or the friction of joints that slip, and squares of radii by joint."""
        low, high = (limit / (unit * arms) for limit in limits(unit * arms * force))
        middle, half = (low + high) / 2, jnp.where(held, (high - low) / 2, 0.0)
        rest = jnp.where(blocked, jnp.clip(0.0, low, high), low)
        return jnp.where(held, middle, rest), jnp.where(same, half**2, 0.0).sum(axis=1)

    def equations(force: Array) -> tuple[Array, Array, Array]:
        """alpha; friction about the middles; and slacks, as they should be."""
        middle, squared = within(force)
        about = force - middle
        room = (squared - jnp.where(which, about**2, 0.0).sum(axis=1)) / 2
        return jnp.where(held, free + matrix @ force, 0.0), about, jnp.where(held, room, 1.0)

    def going(point: _Point) -> Array:
        done = (point.open <= enough[0]) & (point.missed <= enough[1])
        return wanted & ~done & (point.steps < _STEPS) & jnp.isfinite(point.open + point.missed)

    middle, squared = within(jnp.zeros_like(free))
    slack, zero = jnp.where(held, jnp.maximum(squared / 2, 1e-3), 1.0), jnp.zeros((), free.dtype)
    begin = _Point(
        middle,
        slack,
        jnp.where(held, 1.0, 0.0),
        zero + 1e300 if free.dtype == jnp.float64 else zero + 1e30,
        zero,
        jnp.zeros((), int),
    )
    tied = jnp.asarray(same / jnp.sum(same, axis=1, keepdims=True), free.dtype)
    end = jax.lax.while_loop(going, lambda now: _stepped(equations, now, held, tied, enough[0]), begin)

    def off(force: Array) -> tuple[Array, Array, Array, Array]:
        """Friction about the middles of joints that slip, their radii and sizes, and how far off that is."""
        middle, squared = within(force)
        about = jnp.where(held & (end.multiplier > end.slack), force - middle, 0.0)
        size = jnp.sqrt(jnp.where(which, about**2, 0.0).sum(axis=1))
        radius = jnp.where(size > 0, jnp.sqrt(squared), 0.0)
        return about, radius, size, jnp.max(jnp.abs(radius - size), initial=0.0)

    def on_limit(_: Array, force: Array) -> Array:
        about, radius, size = off(force)[:3]
        return force + about * (radius / or_one(size) - 1)

    last = jax.lax.fori_loop(0, _LAST, on_limit, end.force)
    tau = arms * unit * jnp.where(off(last)[3] < off(end.force)[3], last, end.force)
    low, high = limits(tau)
    loaded = directions.any(low < high) & ~blocked  # by friction, too
    found = (end.open <= enough[0]) & (end.missed <= enough[1]) & jnp.any(held) & ~jnp.any(loaded & ~held)
    return Interior(tau, found)


def _missing(equations: _Conditions, point: _Point, held: Bool[Array, " p"]) -> tuple[Array, Array, Array]:
    """Friction about the middles, and what balance and slacks miss."""
    alpha, about, room = equations(point.force)
    balance = jnp.where(held, alpha + point.multiplier * about, about)
    return about, balance, jnp.where(held, room - point.slack, 0.0)


def _stepped(
    equations: _Conditions, point: _Point, held: Bool[Array, " p"], tied: Float[Array, "p p"], enough: float
) -> _Point:
    """A step of Newton's method to a smaller product of slacks and multipliers, predicted and corrected (Mehrotra).

    Those of a joint are `tied` to their mean, as rounding would have them part.
    """
    about, balance, off = _missing(equations, point, held)
    slopes = jax.jacfwd(equations)(point.force)
    slack, multiplier = point.slack, point.multiplier
    own = jnp.where(held, 1.0, 0.0)
    ratio = own * multiplier / slack
    stiff = (
        slopes[0] + jnp.where(held, multiplier, 1.0)[:, None] * slopes[1] - (own * about * ratio)[:, None] * slopes[2]
    )
    lu = jax.scipy.linalg.lu_factor(stiff + _NEAR * jnp.eye(own.size, dtype=own.dtype))

    def direction(target: Array) -> tuple[Array, Array, Array]:
        aim = own * (target / slack - multiplier - ratio * off)
        change = jax.scipy.linalg.lu_solve(lu, -balance - about * aim * own)
        moved = off + own * (slopes[2] @ change)
        return change, moved, own * ((target - multiplier * moved) / slack - multiplier)

    def part(change: tuple[Array, Array, Array]) -> Array:
        ways = [
            jnp.where(held & (d < 0), -x / jnp.where(d < 0, d, -1.0), jnp.inf)
            for x, d in ((slack, change[1]), (multiplier, change[2]))
        ]
        return jnp.minimum(1.0, _WITHIN * jnp.min(jnp.minimum(*ways), initial=jnp.inf))

    # Of products, a tenth of what is asked for: with less slack beside large multipliers equations are stiff.
    least = enough / 10 * jnp.maximum(multiplier, enough)

    def mean(slack: Array, multiplier: Array) -> Array:
        return jnp.sum(jnp.where(held, jnp.maximum(slack * multiplier - least, 0.0), 0.0)) / jnp.maximum(own.sum(), 1.0)

    before, first = mean(slack, multiplier), direction(jnp.zeros_like(slack))
    far = part(first)
    ahead = mean(slack + far * first[1], multiplier + far * first[2])
    centre = jnp.clip((ahead / or_one(before)) ** 3, 1e-4, 1.0) * before
    centre = jnp.maximum(centre, least)
    last = direction(centre - far * far * first[1] * first[2])
    go = part(last)
    after = point._replace(
        force=point.force + go * last[0],
        slack=tied @ (slack + go * last[1]),
        multiplier=tied @ (multiplier + go * last[2]),
    )
    _, balance, off = _missing(equations, after, held)
    missed = jnp.maximum(jnp.max(jnp.abs(balance), initial=0.0), jnp.max(jnp.abs(off), initial=0.0))
    open_ = jnp.max(jnp.where(held, jnp.minimum(after.slack, after.multiplier), 0.0), initial=0.0)
    return after._replace(missed=missed, open=open_, steps=point.steps + 1)
