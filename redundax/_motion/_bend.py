"""Bends of friction, as of |N| where a guide begins to press its other side: with derivatives steps end there.

What a step goes past a bend its error tells by the square, as velocities are off by that, but derivatives are off by as
much itself: by a thousandth at a tolerance of 1e-8. Between the loads at the ends of a step friction bends where it is
its two tangents, which meet on it. Steps come near to that, one after the other, until one ends just before it. A tiny
one crosses it, as stages at its ends count, too. A tiny one also tells loads where they are not known: as a motion
begins, past events, and past instants at which loads jump.

Loads themselves bend where joints with play come to a side of it or leave one. Then false position on the dense output
of the step tells when, or for friction when

    g rho(t) = g rho,   g = d tau / d rho after - before
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._closures._play import Play
from .._solvers._friction_problem import Law
from ._crossing import Bend

# Least change of a slope that is a bend, relative to the slopes; and what friction may be off its tangents where they
# meet, relative to the chord: a circular arc is off by half of it.
_LEAST, _STRAIGHT = 1e-3, 0.1
# Part of the largest load up to which a joint with play has none: more would tell late that it comes to a side.
_LOADED = 1e-14
# How near to a bend, relative to the looks at a motion, steps end and the one begins that crosses it; the same with
# play, whose sides are not told within some 1e-10 of a change; and most turns of false position.
_NEAR, _NEAR_SIDES, _TURNS = 1e-7, 1e-6, 30


class _Bracket(NamedTuple):
    """Times before and after a root, the values there, and how often it was halved."""

    low: Array
    high: Array
    below: Array
    above: Array
    turn: Array


def bend(
    law: Law,
    rows: Int[Array, " l"],
    play: Play | None,
    at: Callable[[Array], Float[Array, " m"]],
    begin: tuple[Array, Float[Array, " m"], Bool[Array, ""]],
    end: tuple[Array, Float[Array, " m"]],
    sticking: Bool[Array, " p"],
    apart: Array,
) -> tuple[Array, Bool[Array, ""], Bend]:
    """When a step should end for the first bend of the friction of slips that do not stick, or of loads by play,
    between times at which multipliers are given, the first if they are known, infinite where there is none; whether the
    step is a tiny one across it, or one that tells loads where they are not known; and the bend that it crosses."""
    (start, first, known), (stop, last) = begin, end
    ends = _felt(law, first[rows]), _felt(law, last[rows])
    parts = jnp.where(sticking, jnp.inf, _parts(law, *ends))
    slip, part = jnp.argmin(parts), jnp.min(parts)
    found, least = known & (part < jnp.inf), (_NEAR if play is None else _NEAR_SIDES) * apart
    near = jnp.maximum(least, 10 * jnp.finfo(stop.dtype).eps * jnp.abs(stop))
    t, through = start + part * (stop - start), _through(law, slip, ends)
    if play is not None:
        before, after = ends
        at_bend = before + jnp.where(found, part, 0.0) * (after - before)
        bends, found = found, found | (known & ~_same_sides(play, first, last))

        def value(multipliers: Float[Array, " m"]) -> Array:
            side = jnp.where(_same_sides(play, first, multipliers), 1.0, -1.0)
            return jnp.where(bends, through @ (multipliers[rows] - at_bend), side)

        t = _root(lambda t: value(at(t)), (start, value(first)), (stop, value(last)), near, found)
    wanted, short = found | ~known, stop - start <= 4 * near
    aim = jnp.where(found & (t - start > near), t - near / 2, start + 2 * near)
    several = (jnp.sum(parts < jnp.inf) > 1) | (play is not None)
    crossed = Bend(found & short, jnp.zeros_like(last).at[rows].add(through), several)
    return jnp.where(wanted & ~short, aim, jnp.inf), wanted & short, crossed


def _felt(law: Law, loads: Float[Array, " l"]) -> Float[Array, " l"]:
    """Loads, of contacts that would pull none: where they begin to they open, which is an event of its own."""
    return loads if law.pushing is None else jnp.where(law.pushing, jnp.maximum(loads, 0.0), loads)


def _through(law: Law, slip: Array, ends: tuple[Array, Array]) -> Float[Array, " l"]:
    """By how much more the friction of a slip changes with loads at the end than at the begin: what of them passes zero
    where it bends."""
    before, after = (jax.grad(lambda x: law.force(x)[slip])(loads) for loads in ends)
    return after - before


def _root(
    value: Callable[[Array], Array], begin: tuple[Array, Array], end: tuple[Array, Array], near: Array, wanted: Array
) -> Array:
    """When a function of time passes zero, if wanted, given it at two times."""

    def narrower(now: _Bracket) -> _Bracket:
        t = now.low + now.below / (now.below - now.above) * (now.high - now.low)
        t = jnp.clip(t, now.low + near / 8, now.high - near / 8)
        there = value(t)
        earlier = (there > 0) == (now.below > 0)  # the end that stays counts for half, so that both ends move
        return _Bracket(
            jnp.where(earlier, t, now.low),
            jnp.where(earlier, now.high, t),
            jnp.where(earlier, there, now.below / 2),
            jnp.where(earlier, now.above / 2, there),
            now.turn + 1,
        )

    def going(now: _Bracket) -> Array:
        wide = (now.high - now.low > near / 4) & (now.below != 0) & (now.above != 0)
        return wanted & wide & (now.turn < _TURNS)

    (start, below), (stop, above) = begin, end
    root = jax.lax.while_loop(going, narrower, _Bracket(start, stop, below, above, jnp.zeros((), int)))
    return (root.low + root.high) / 2


def _parts(law: Law, before: Float[Array, " l"], after: Float[Array, " l"]) -> Float[Array, " p"]:
    """At what part of the way from loads to others the friction of each slip bends; infinite where it does not."""
    way = after - before

    def tangent(loads: Float[Array, " l"]) -> tuple[Array, Array]:
        return jax.jvp(law.force, (loads,), (way,))

    (one, first), (two, last) = tangent(before), tangent(after)
    change = last - first
    bends = jnp.abs(change) > _LEAST * (jnp.abs(first) + jnp.abs(last))
    part = jnp.where(bends, (one - two + last) / jnp.where(bends, change, 1.0), -1.0)
    there = jnp.diagonal(jax.vmap(lambda x: law.force(before + x * way))(part))
    straight = jnp.abs(there - (one + part * first)) <= _STRAIGHT * jnp.abs(part * (1 - part) * change)
    return jnp.where(bends & straight & (part > 0) & (part < 1), part, jnp.inf)


def _same_sides(play: Play, one: Float[Array, " m"], other: Float[Array, " m"]) -> Bool[Array, ""]:
    """Whether joints with play stand at the same sides, by their loads."""

    def sides(multipliers: Float[Array, " m"]) -> Float[Array, " g"]:
        loads, least = [multipliers[np.array(rows)] for rows in play.rows], _LOADED * jnp.max(jnp.abs(multipliers))
        sizes = jnp.stack([x[0] if x.size == 1 else jnp.max(jnp.abs(x)) for x in loads])
        return jnp.where(jnp.abs(sizes) > least, jnp.sign(sizes), 0.0)

    return jnp.all(sides(one) == sides(other))
