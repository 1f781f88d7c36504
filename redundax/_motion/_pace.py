"""How long steps are where derivatives are taken of how surfaces slide.

Friction F turns surfaces whose velocity is v: what lies across v changes at a rate of

    (v' - A F) / |v|

along the slide. As they come to a stop nothing bounds that rate, and steps of a straight slide do not see it, but its
derivatives do: by a step from full speed to the stop they were off by any factor. So steps are no longer than what
friction turns surfaces in, but for the last before a stop, which begins slow: in it the direction of friction changes
as that did by then (`Context.stopping`).
"""

from typing import NamedTuple, cast

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._system._directions import Directions
from .._tools._numbers import or_one, tolerance_of
from ._moving import NONE, Equations
from ._slip import PAST, Seen

# By what friction turns surfaces in a step, so that derivatives follow; by what part of the time until they stop a step
# is as long; how slow they are, relative to the mechanism, as the step begins in which they do: its square is what
# derivatives miss; and by how much they are seen to slide back at its end, in slips that count as none.
_TURN, _NEARER, _SLOW, _BACK = 2.0, 31 / 32, 2.0**-12, 4.0


class Pace(NamedTuple):
    """How far steps go from a time on.

    - `turns`: until when they follow how friction turns surfaces.
    - `ahead`: until when the next one goes at most, past the stop of surfaces that are slow.
    - `stops`: when those stop, infinite of others; shape (p,).
    - `slow`: which surfaces may stop in the next step, shape (p,).
    """

    turns: Array
    ahead: Array
    stops: Float[Array, " p"]
    slow: Bool[Array, " p"]


def no_pace(like: Float[Array, " p"]) -> Pace:
    """Any."""
    every = jnp.full_like(like, jnp.inf)
    return Pace(jnp.full_like(like, jnp.inf, shape=()), jnp.full_like(like, jnp.inf, shape=()), every, every > 0)


def pace(equations: Equations, t: Array, found: Seen) -> Pace:
    """The pace from what was found at a time."""
    directions = cast(Directions, equations.directions)
    may, none = equations.directed & equations.may_stick & ~equations.sticking, equations.is_none(found.rate)
    slides, along = may & ~none, directions.unit(directions.arms * found.rate)
    speed, gains = (directions.along(x, along) for x in (found.rate, found.solved.slip))
    left = jnp.where(slides & (gains < 0), -speed / jnp.where(gains < 0, gains, 1.0), jnp.inf)
    size = speed * directions.reach(equations.slip_size)
    slow = (left < jnp.inf) & (size <= _SLOW * equations.speed)
    turning = turned_by(equations, found.solved.tau, cast(tuple[Array, Array], found.yields)[1])
    turn = jnp.where(slides & (turning > 0), _TURN * speed / or_one(turning), jnp.inf)
    turns = jnp.minimum(turn, _NEARER * left)
    seen = _BACK * tolerance_of(NONE, speed) * equations.speed / jnp.where(slow, size, 1.0)
    past = (1 + jnp.maximum(2 * PAST, seen)) * left
    return Pace(
        t + jnp.min(turns), t + jnp.min(jnp.where(slow, past, turns)), jnp.where(slow, t + left, jnp.inf), slow | none
    )


def turned_by(equations: Equations, tau: Float[Array, " p"], yields: Float[Array, "p p"]) -> Float[Array, " p"]:
    """Acceleration of surfaces by friction across them, as large as their own may be; `yields` is that by unit ones."""
    directions = cast(Directions, equations.directions)
    arms, same = directions.arms, jnp.asarray(directions.same)
    force = jnp.sqrt(jnp.sum(jnp.where(same, (tau / arms) ** 2, 0.0), axis=1))
    rows = jnp.sum(jnp.where(same, jnp.abs(arms[:, None] * yields * arms), 0.0), axis=1)
    return force * jnp.max(jnp.where(same, rows, 0.0), axis=1)
