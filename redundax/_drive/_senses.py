"""Which way joints slip, also where they rest: the sense of the motion before an instant of rest, and of that after.

Friction at rest is any within its limits. What is known of it is the load with which the motion ended and the one with
which it goes on: friction in the sense of the slip before, and in that after. Where nothing moved before, it is the
sense after, and the other way round; where a joint never slips it has none.
"""

from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Bool, Float

from .._system._directions import directions_of
from .._system._friction import have_sense
from .._system._system import AbstractSystem
from .._tools._module import numpy_of
from .._tools._numbers import or_one, tolerance_of

# Slip rate beside those a hundredth of a step before and after, where it turns round, and beside the fastest of all
# slips at all times, where it is rounding; at least so many roundings.
_RESTS, NOISE = (1e-6, 1e2), (1e-11, 1e2)


class Senses(NamedTuple):
    """Which slips rest, and their senses of before and after; 0 of joints that never slip."""

    rests: Bool[Array, "times p"]
    before: Float[Array, "times p"]
    after: Float[Array, "times p"]

    @property
    def both(self) -> Float[Array, "times 2 p"]:
        """After and before."""
        xp = numpy_of(self.after)
        return xp.stack([self.after, self.before], axis=1)


def senses_of(system: AbstractSystem, slips: Float[Array, "times 3 p"], length: Array) -> Senses:
    """Of slip rates now, just before and just after each time."""
    xp = numpy_of(slips)
    slips, same = xp.asarray(slips), _same(system)
    fastest = xp.abs(slips) * xp.where(xp.asarray(system.slips.angular), xp.asarray(length), 1.0)
    fastest = xp.where(xp.isfinite(fastest), fastest, 0.0)
    noise = tolerance_of(NOISE, fastest) * xp.max(fastest, initial=0.0)
    joint = _largest_of_joints(fastest, same)
    now, early, late = (joint[:, k] for k in range(3))
    rests = (now <= noise) | (now <= tolerance_of(_RESTS, fastest) * xp.maximum(early, late))
    signs = signs_of(system, slips)
    starts = xp.where(early > noise, signs[:, 1], xp.where(rests, 0.0, signs[:, 0]))
    ends = xp.where(late > noise, signs[:, 2], xp.where(rests, 0.0, signs[:, 0]))
    moves_early, moves_late = (early > noise) | ~rests, (late > noise) | ~rests
    after = _filled(ends, moves_late, starts, moves_early, backward=False)
    before = _filled(starts, moves_early, ends, moves_late, backward=True)
    some_after, some_before = (_of_joints(x != 0, same) for x in (after, before))
    after, before = xp.where(some_after, after, before), xp.where(some_before, before, after)
    sliding = xp.where(rests, 0.0, signs[:, 0])
    return Senses(rests, xp.where(rests, before, sliding), xp.where(rests, after, sliding))


def never_slip(system: AbstractSystem, senses: Senses) -> Bool[np.ndarray, " p"]:
    """Which slips have friction that no motion gives a sense; it is taken as none."""
    rests = np.all((senses.after == 0) & (senses.before == 0), axis=0)
    joints = directions_of(system.friction) if rests.any() else None
    rests = rests & np.array(have_sense(system.friction), bool)
    return rests if joints is None else np.asarray(joints.every(rests))


def signs_of(system: AbstractSystem, slips: Float[Array, "... p"]) -> Float[Array, "... p"]:
    """Senses of slip rates: signs, and of surfaces the direction in which they slide."""
    xp = numpy_of(slips)
    directions = directions_of(system.friction) if system.friction else None
    if directions is None:
        return xp.sign(slips)
    largest = _largest_of_joints(xp.abs(slips), _same(system))
    along = slips / or_one(largest)
    return xp.where(np.asarray(directions.directed), along, xp.sign(slips))


def _same(system: AbstractSystem) -> np.ndarray | None:
    """For each slip which are of its joint; None where each is of its own."""
    directions = directions_of(system.friction) if system.friction else None
    return None if directions is None else np.asarray(directions.same)


def _largest_of_joints(sizes: Array, same: np.ndarray | None) -> Array:
    """For each slip the largest of all slips of its joint."""
    xp = numpy_of(sizes)
    return sizes if same is None else xp.max(xp.where(same, sizes[..., None, :], 0.0), axis=-1, initial=0.0)


def _of_joints(flags: Array, same: np.ndarray | None) -> Array:
    """For each slip whether it is so for any slip of its joint."""
    return flags if same is None else numpy_of(flags).any(flags[..., None, :] & same, axis=-1)


def _filled(own: Array, has: Array, others: Array, has_others: Array, *, backward: bool) -> Array:
    """Own senses, or where there are none the nearest of the others at later times, or at earlier ones."""
    xp = numpy_of(own)
    if backward:
        return _filled(own[::-1], has[::-1], others[::-1], has_others[::-1], backward=False)[::-1]
    count = len(own)
    places = xp.where(has_others, xp.arange(count)[:, None], count)[::-1]
    least = np.minimum.accumulate(places) if xp is np else jax.lax.cummin(places)
    following = xp.concatenate([least[::-1][1:], xp.full((1, own.shape[1]), count)])
    padded = xp.concatenate([others, xp.zeros((1, own.shape[1]), own.dtype)])
    return xp.where(has, own, xp.take_along_axis(padded, following, axis=0))
