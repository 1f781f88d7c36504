"""How a mechanism starts to move at the largest load that it bears: what slips, and what lifts.

A contact lifts that has no load in any state with that load, and a joint slips whose friction is at its limit in all of
them. Any one state may have more at their limits: friction of joints against each other moves nothing.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..._equations._factorisation import Factorisation
from ..._equations._kinematics import slip_motion
from ..._system._directions import Directions, directions_of
from ..._system._state import State
from ..._system._system import AbstractSystem
from .._at_rest import NONE, velocity_basis
from ._extreme import LoadsAtRest
from ._programme import LimitValues, Programme
from ._standing import Standing

_SLIPS = 1e-6  # rate of a slip that is none, relative to the largest
_AT_LIMIT = 1e-7  # what is left of a limit that is none, relative to the friction
_UNLOADED = 1e-5  # share of the largest load that is none: what amounts 1e-7 from the end leave, by levers up to 100
_LEFT = 1e-4  # of the largest friction: what a joint has left of its limit that need not slip
_MOST = 60  # programmes for a joint


class GivingWay(NamedTuple):
    """Names of the slips, velocities of power 1 with the load, and rows of contacts that lift, and of the others."""

    slips: tuple[str, ...]
    motion: np.ndarray
    lifts: tuple[int, ...]
    carries: tuple[int, ...]


def giving_way(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    sets: Sequence[tuple[Standing, LoadsAtRest]],
    x: np.ndarray,
    force: np.ndarray,
    pushing: tuple[int, ...],
) -> GivingWay:
    """That at the largest amount of the load `force`, which the first of some sets has at x."""
    ends = [(own, part.narrowed(_box(own.programme, x))) for own, part in sets]
    ends = [ends[0], *(end for end in ends[1:] if end[1].extreme(_none(end[0]), first=True).bound > -np.inf)]
    lifts, programme = _lifting(ends, x, pushing), sets[0][0].programme
    turns = np.where(system.slips.angular, np.asarray(factor.length), 1.0)
    ways = velocity_basis(system, factor, lifts)
    slips = _slips(system, state, ways, turns)
    resting, bare = _resting([own for own, _ in ends], x, len(slips), bool(lifts))
    across, own = _across(slips, directions_of(system.friction), programme, x, resting), force @ ways
    free = _free(slips, np.concatenate([slips[resting], *across]))
    if not len(free):  # friction that holds most has a part across the only slip
        free = _free(slips, slips[resting])
    drives = free @ own
    power = drives @ drives
    if power > NONE * (own @ own):
        reduced = free.T @ drives / power
        rates, motion = np.abs(slips @ reduced) * turns, ways @ reduced
    else:  # the load takes friction away from a motion that it does not drive
        rates, motion = np.linalg.norm(slips @ free.T, axis=1) * turns, np.full(len(force), np.nan)
    opening = -np.asarray(factor.jacobian)[list(lifts)] @ motion
    if np.any(opening < -_SLIPS * np.abs(opening).max(initial=0.0)):  # into the floor: it moves in another way
        motion = np.full(len(force), np.nan)
    names = itertools.compress(system.slips.labels, (rates > _SLIPS * rates.max(initial=0.0)) & ~resting & ~bare)
    return GivingWay(tuple(names), motion, lifts, tuple(row for row in pushing if row not in lifts))


def _box(programme: Programme, x: np.ndarray) -> np.ndarray:
    box = programme.box.copy()
    box[-1] = x[-1] - _AT_LIMIT * np.abs(x[-1]), x[-1] + _AT_LIMIT * np.abs(x[-1])
    return box


def _none(own: Standing) -> np.ndarray:
    """The cost of a question whether anything is possible."""
    return np.zeros(len(own.programme.box))


def _lifting(ends: Sequence[tuple[Standing, LoadsAtRest]], x: np.ndarray, pushing: tuple[int, ...]) -> tuple[int, ...]:
    """Rows of contacts that have no load in any of some states."""
    loads = ends[0][0].unknowns.multipliers(x)
    none = _UNLOADED * np.abs(loads).max(initial=0.0)
    lifts = [row for row in pushing if loads[row] <= none]
    for own, part in ends if lifts else ():
        read = own.unknowns.multipliers
        lifts = [row for row in lifts if part.extreme(read.matrix[row]).bound + read.offset[row] <= none]
    return tuple(lifts)


def _slips(system: AbstractSystem, state: State, ways: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Slip rates of velocities, one by one in columns; 0 where they are rounding."""
    if not len(system.slips):
        return np.zeros((0, ways.shape[1]))
    slips = np.asarray(slip_motion(system.anonymous, state)[1]).T @ ways
    reach = np.linalg.norm(slips, axis=1) * turns
    return np.where((reach > NONE * reach.max(initial=0.0))[:, None], slips, 0.0)


def _resting(sets: Sequence[Standing], x: np.ndarray, count: int, lifts: bool) -> tuple[np.ndarray, np.ndarray]:
    """Slips whose friction is below its limit somewhere; and those of contacts that lift, which have none."""
    programme = sets[0].programme
    resting = _left(programme, x)[:count] > _AT_LIMIT
    down, up = (part[:count] for part in programme.limits(programme.read(x))[:2])
    size = np.where(np.isfinite(down + up), down + up, 0.0) / 2
    largest, full = size.max(initial=0.0), programme.full[:count] != 0
    bare = lifts & ~full & (size <= _UNLOADED * largest)
    resting &= ~bare
    joints = [ball for ball in programme.balls if ball[0] < count]
    joints += [[k] for k in range(count) if not any(k in ball for ball in joints)]
    tight = [joint for joint in joints if largest > 0 and not (resting | full | bare)[joint[0]]]

    def have_left(places: list[int]) -> bool:
        """Whether friction of these may be below its limits with this load."""
        less = np.zeros(len(programme.full))
        less[places] = _LEFT * largest
        return any(
            LoadsAtRest(_with_less(own.programme, less, x), most=_MOST).extreme(_none(own), first=True).x is not None
            for own in sets
        )

    if tight and have_left(list(itertools.chain(*tight))):
        below = tight
    else:
        below = [joint for joint in tight if have_left(joint)] if len(tight) > 1 else []
    resting[list(itertools.chain(*below))] = True
    return resting, bare


def _with_less(programme: Programme, less: np.ndarray, x: np.ndarray) -> Programme:
    """The part with the amount of x, with limits that are smaller by some."""

    def limits(loads: np.ndarray) -> LimitValues:
        down, up, by_down, by_up = programme.limits(loads)
        return LimitValues(down - less, up - less, by_down, by_up)

    return programme._replace(limits=limits, box=_box(programme, x))


def _across(
    slips: np.ndarray, directions: Directions | None, programme: Programme, x: np.ndarray, resting: np.ndarray
) -> list[np.ndarray]:
    """Slips across the friction of each joint at its limit: where slips share one friction, they are against it."""
    if directions is None:
        return []
    bounded, velocities = programme.bounded(x), np.asarray(directions.arms)[:, None] * slips
    sizes = {ball[0]: np.linalg.norm(bounded[ball]) for ball in programme.balls}
    loaded = [ball for ball in programme.balls if not resting[ball[0]] and sizes[ball[0]] > _AT_LIMIT]
    along = [bounded[ball] / sizes[ball[0]] for ball in loaded]
    return [velocities[ball] - np.outer(u, u @ velocities[ball]) for ball, u in zip(loaded, along, strict=True)]


def _free(slips: np.ndarray, rests: np.ndarray) -> np.ndarray:
    """A basis of the motions without some slips, row by row."""
    _, sizes, basis = np.linalg.svd(rests) if len(rests) else (0, np.zeros(0), np.eye(slips.shape[1]))
    return basis[np.sum(sizes > NONE * np.abs(slips).max(initial=0.0)) :]


def _left(programme: Programme, x: np.ndarray) -> np.ndarray:
    """What is left of the limits of each friction, for balls of all of it."""
    down, up = programme.limits(programme.read(x))[:2]
    bounded = programme.bounded(x)
    left = np.minimum(up - bounded, down + bounded)
    for ball in programme.balls:
        left[ball] = up[ball[0]] - np.linalg.norm(bounded[ball])
    return left
