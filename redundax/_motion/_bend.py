"""Bends of friction, as of |N| where a guide begins to press its other side: with derivatives steps end there.

What a step goes past a bend its error tells by the square, as velocities are off by that, but derivatives are off by as
much itself: by a thousandth at a tolerance of 1e-8. Between the loads at the ends of a step friction bends where it is
its two tangents, which meet on it. Steps come near to that, one after the other, until one ends just before it. A tiny
one crosses it, as stages at its ends count, too. A tiny one also tells loads where they are not known: as a motion
begins, past events, and past instants at which loads jump.

Applied loads that users write bend, too, as k max(x, 0) of a bumper, and under given loads some friction: that of
bristles where a slip turns round, of a slider that comes out of its guide, and of models of users. On the dense output
of the step they are looked for entry by entry: large ones that are smooth hide no small one that bends.

Loads of joints bend where joints with play come to a side of it or leave one. Then false position on the dense output
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

# Least change of a slope that is a bend, relative to the slopes; and what friction may be off its tangents where they
# meet, relative to the chord: a circular arc is off by half of it.
_LEAST, _STRAIGHT = 1e-3, 0.1
# Least change of a load by a change of its slope that is a bend, relative to its size; and the part of what slopes
# change by in a step that is one: of a half of a smooth load it is little more than half, of its quarter a quarter.
_TOLD, _MUCH = 1e-12, 0.3
# Part of the largest load up to which a joint with play has none: more would tell late that it comes to a side.
_LOADED = 1e-14
# How often the way between two loads is split at most: a guide bends twice, others hardly more, and few in one step.
_SPLITS = 12
# How near to a bend, relative to the looks at a motion, steps end and the one begins that crosses it; the same with
# play, whose sides are not told within some 1e-10 of a change; and most turns of false position.
_NEAR, _NEAR_SIDES, _TURNS = 1e-7, 1e-6, 30
# Part of the way to a bend that a step leaves, so that none of its stages, less accurate than its end, is past it.
_BEFORE = 0.05


class _Bracket(NamedTuple):
    """Times before and after a root, the values there, and how often it was halved."""

    low: Array
    high: Array
    below: Array
    above: Array
    turn: Array


class _Halved(NamedTuple):
    """Times, and the slopes of a function there; what they change by in both halves of the whole, infinite until that
    is known; and for which entries much of it is in between."""

    low: Array
    high: Array
    first: Array
    last: Array
    change: Array
    much: Array


class Bent(NamedTuple):
    """When something bends, infinite where it does not.

    - `weights`: those of what passes zero there among multipliers, for second derivatives; shape (m,).
    - `several`: whether it is not that alone, so that second derivatives are not known.
    """

    time: Float[Array, ""]
    weights: Float[Array, " m"]
    several: Bool[Array, ""]


def nearness(play: Play | None, apart: Array, t: Array) -> Array:
    """How near to a bend steps end, where looks at a motion are so far apart."""
    return jnp.maximum((_NEAR if play is None else _NEAR_SIDES) * apart, 10 * jnp.finfo(t.dtype).eps * jnp.abs(t))


def bend_of_friction(
    law: Law,
    rows: Int[Array, " l"],
    play: Play | None,
    at: Callable[[Array], Float[Array, " m"]],
    begin: tuple[Array, Float[Array, " m"]],
    end: tuple[Array, Float[Array, " m"]],
    sticking: Bool[Array, " p"],
    near: Array,
) -> Bent:
    """The first bend of the friction of slips that do not stick, or of loads by play, between times at which
    multipliers are given."""
    (start, first), (stop, last) = begin, end
    ends = _felt(law, first[rows]), _felt(law, last[rows])
    slip, part, count = _first_bend(law, *ends, sticking)
    found, t, through = part < jnp.inf, start + part * (stop - start), _through(law, slip, ends)
    if play is not None:
        before, after = ends
        at_bend = before + jnp.where(found, part, 0.0) * (after - before)
        bends, found = found, found | ~_same_sides(play, first, last)

        def value(multipliers: Float[Array, " m"]) -> Array:
            side = jnp.where(_same_sides(play, first, multipliers), 1.0, -1.0)
            return jnp.where(bends, through @ (multipliers[rows] - at_bend), side)

        t = _root(lambda t: value(at(t)), (start, value(first)), (stop, value(last)), near, found)
    several = (count > 1) | (play is not None)
    return Bent(jnp.where(found, t, jnp.inf), jnp.zeros_like(last).at[rows].add(through), several)


def bend_in_time(
    function: Callable[[Array], Float[Array, " n"]], begin: Array, end: Array, near: Array
) -> Float[Array, ""]:
    """When an entry of a function of time bends, infinite where none does: halves in which its slope changes by more
    are looked at as long as that is much of what it changes by in all, that entry first of which more is in one half.
    """

    def slope(t: Array) -> tuple[Array, Array]:
        return jax.jvp(function, (t,), (jnp.ones_like(t),))

    def halved(now: _Halved) -> _Halved:
        t = (now.low + now.high) / 2
        there = slope(t)[1]
        left, right = jnp.abs(there - now.first), jnp.abs(now.last - there)
        change = jnp.where(jnp.isinf(now.change), left + right, now.change)
        much = now.much & (change > least)
        entry = jnp.argmax(jnp.where(much, jnp.maximum(left, right) / jnp.where(much, change, 1.0), -1.0))
        earlier = left[entry] >= right[entry]
        low, high = jnp.where(earlier, now.low, t), jnp.where(earlier, t, now.high)
        first, last = jnp.where(earlier, now.first, there), jnp.where(earlier, there, now.last)
        return _Halved(low, high, first, last, change, much & (jnp.abs(last - first) > _MUCH * change))

    def going(now: _Halved) -> Array:
        return jnp.any(now.much) & (now.high - now.low > near / 4)

    norm = jnp.linalg.norm
    (one, first), (two, last) = slope(begin), slope(end)
    told = _TOLD * (norm(first) + norm(last) + (norm(one) + norm(two)) / (end - begin))
    least = _LEAST * (jnp.abs(first) + jnp.abs(last)) + told
    start = _Halved(begin, end, first, last, jnp.full_like(first, jnp.inf), first == first)
    found = jax.lax.while_loop(going, halved, start)
    return jnp.where(jnp.any(found.much), (found.low + found.high) / 2, jnp.inf)


def ahead(
    bends: Array, known: Bool[Array, ""], begin: Array, end: Array, near: Array
) -> tuple[Float[Array, ""], Bool[Array, ""]]:
    """When a step should end for a bend, infinite where it need not; and whether it is a tiny one across it, or one
    that tells loads where they are not known."""
    found, short = bends < jnp.inf, end - begin <= 4 * near
    aim = jnp.where(found & (bends - begin > near), _just_before(bends, begin, near), begin + 2 * near)
    wanted = found | ~known
    return jnp.where(wanted & ~short, aim, jnp.inf), wanted & short


def before_opening(opens: Array, begin: Array, near: Array) -> Float[Array, ""]:
    """When a step should end for a contact that opens at a time, infinite where it begins just before that or at none:
    its own friction bends there, and that of others may at the same instant."""
    return jnp.where(opens - begin > near, _just_before(opens, begin, near), jnp.inf)


def _just_before(t: Array, begin: Array, near: Array) -> Array:
    return t - jnp.maximum(near / 2, _BEFORE * (t - begin))


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


class _Span(NamedTuple):
    """Parts of the way from loads to others between which the friction of each slip may bend, its values and slopes
    there; the slip that bends first and at what part, infinite as long as that is not found; and how often it was
    split."""

    low: Array
    high: Array
    values: tuple[Array, Array]
    slopes: tuple[Array, Array]
    slip: Array
    part: Array
    splits: Array


def _first_bend(
    law: Law, before: Float[Array, " l"], after: Float[Array, " l"], sticking: Bool[Array, " p"]
) -> tuple[Int[Array, ""], Float[Array, ""], Int[Array, ""]]:
    """The slip whose friction bends first, of those that do not stick, at what part of the way from loads to others,
    infinite where none does; and how many bend on it.

    Where tangents meet first it is looked at all. Where one bends more than once, as that of a guide with a moment, its
    tangents meet between bends: these are looked for on either side.
    """
    way = after - before

    def tangent(part: Array) -> tuple[Array, Array]:
        return jax.jvp(law.force, (before + part * way,), (way,))

    def bent(one: Array, other: Array) -> Array:
        return ~sticking & (jnp.abs(other - one) > _LEAST * (jnp.abs(one) + jnp.abs(other)))

    def meetings(now: _Span) -> Array:
        """At what parts tangents of slips meet; infinite where they do not between their ends."""
        (one, two), (first, last), bends = now.values, now.slopes, bent(*now.slopes)
        part = (one - two + last * now.high - first * now.low) / jnp.where(bends, last - first, 1.0)
        return jnp.where(bends & (part > now.low) & (part < now.high), part, jnp.inf)

    def going(now: _Span) -> Array:
        return (now.part == jnp.inf) & (jnp.min(meetings(now)) < jnp.inf) & (now.splits < _SPLITS)

    def narrower(now: _Span) -> _Span:
        (one, two), (first, last), parts = now.values, now.slopes, meetings(now)
        slip, part = jnp.argmin(parts), jnp.min(parts)
        there, slope = tangent(part)
        chord = (part - now.low) * (now.high - part) / (now.high - now.low) * (last - first)
        straight = jnp.abs(there - one - first * (part - now.low)) <= _STRAIGHT * jnp.abs(chord)
        inside, earlier = (part > now.low) & (part < now.high), bent(first, slope)
        below, above = inside & ~earlier, inside & earlier
        return _Span(
            jnp.where(below, part, now.low),
            jnp.where(above, part, now.high),
            (jnp.where(below, there, one), jnp.where(above, there, two)),
            (jnp.where(below, slope, first), jnp.where(above, slope, last)),
            slip,
            jnp.where(straight[slip], part, jnp.inf),
            now.splits + 1,
        )

    none = jnp.zeros(law.rate.shape, way.dtype)
    begin, end = tangent(jnp.zeros((), way.dtype)), tangent(jnp.ones((), way.dtype))
    slopes, no = (begin[1], end[1]), jnp.zeros((), int)
    span = _Span(none, none + 1, (begin[0], end[0]), slopes, no, jnp.full((), jnp.inf, way.dtype), no)
    found = jax.lax.while_loop(going, narrower, span)
    return found.slip, found.part, jnp.sum(bent(*slopes))


def _same_sides(play: Play, one: Float[Array, " m"], other: Float[Array, " m"]) -> Bool[Array, ""]:
    """Whether joints with play stand at the same sides, by their loads."""

    def sides(multipliers: Float[Array, " m"]) -> Float[Array, " g"]:
        loads, least = [multipliers[np.array(rows)] for rows in play.rows], _LOADED * jnp.max(jnp.abs(multipliers))
        sizes = jnp.stack([x[0] if x.size == 1 else jnp.max(jnp.abs(x)) for x in loads])
        return jnp.where(jnp.abs(sizes) > least, jnp.sign(sizes), 0.0)

    return jnp.all(sides(one) == sides(other))
