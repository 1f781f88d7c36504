"""Whether redundancy stays as it is along motions of the joints

Independent joints, those that are driven first, are moved to both sides, in steps that close the loops, within the
limits of the joints, which the last steps, halved, come near. With G the derivative of the loops by the joints and r
its rank, the r-th singular value of G is 0 where the rank is lower. So it is followed, and minima that stand out are
narrowed down by golden sections: they are singular positions, or come very near one, where the value all but vanishes
beside those of the steps around it. Joints that move no loop in itself change nothing, and rest.
"""

import dataclasses
import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.linalg

from .._tools._json import JSON
from ._description import Loop
from ._tree import CLOSED, DIGITS, Tree

_STEP, _STEPS, _LONGEST = 0.1, 240, 6.4  # of the joint that moves most, rad or sizes; in all; of one way
_SECTIONS, _ROUND, _GOLDEN = 40, 16, 0.5 * (5**0.5 - 1)  # to a kink, and to a smooth end, whose error is their square
_DIP, _SINGULAR = 0.5, 1e-2  # a value beside its neighbours, at a step and at its least
_CORRECTIONS = 20  # of a step
_HELD = 1e-9  # rates that loops and joints feel
_DRIVEN = 1e3  # joints that are driven lead
_HALVED = 6  # times a step that a limit stops: to within 2e-3 of it
_MOTION = (
    1e-3  # rad, or the share of the model's size: a range that is less is no motion, but what loops and steps give
)
_SETTLED = 30.0  # see `resolution`
_SINGLE = ("hinge", "slide")


@dataclasses.dataclass(frozen=True)
class Singular:
    """A position where the rank is lower: the joint that was moved, where it is, and redundancy and freedom.

    `at` counts as `ranges` of `Travel` do; `positions` of all joints are as `guess` of the model takes them.
    """

    joint: str
    at: float
    redundancy: int
    freedom: int
    positions: dict[str, list[float]]


class Way(NamedTuple):
    """Positions of all joints as one is moved, (n, q); where that one is, and the smallest value kept, (n,)."""

    joint: str
    at: np.ndarray
    positions: np.ndarray
    kept: np.ndarray


@dataclasses.dataclass(frozen=True)
class Travel:
    """What was met along motions of the joints.

    - `ranges`: the least and the largest position of each independent joint that was moved, rad or m, as the file
      counts them; of one direction of a ball or free joint, the displacement from the start.
    - `singular`: positions where redundancy was another; `least`: the smallest singular value kept at the others.
    - `is_limited`: whether joints have limits, within which they were moved; `stops`: those that ended a way, the joint
      and its limit.
    - `moved`: names of those that went so far that something was looked at; `turns`: where one turned back on its way,
      before it was stopped.
    - `ways`: the positions that were looked at.
    """

    ranges: dict[str, tuple[float, float]]
    singular: tuple[Singular, ...]
    least: float
    is_limited: bool
    stops: tuple[tuple[str, float], ...] = ()
    moved: tuple[str, ...] = ()
    turns: tuple[tuple[str, float], ...] = ()
    ways: tuple[Way, ...] = dataclasses.field(default=(), repr=False, compare=False)

    def to_dict(self) -> dict[str, JSON]:
        """As data."""
        return {
            "ranges": {name: list(each) for name, each in self.ranges.items()},
            "singular_positions": [dataclasses.asdict(each) for each in self.singular],
            "smallest_kept": self.least,
            "within_limits": self.is_limited,
            "limits_that_stop": [{"joint": joint, "limit": limit} for joint, limit in self.stops],
            "moved": list(self.moved),
            "turns_back": [{"joint": joint, "at": at} for joint, at in self.turns],
        }


def resolution(left: float) -> float:
    """How exactly positions of joints are known, rad or sizes: what is nearer to 0 is told as 0.

    Loops are closed to a misfit e relative to the size. At a singular position a joint changes it by its square alone,
    so that e settles the joint to its root, times the root of size by length of a link, and of rounding in the search.
    """
    return _SETTLED * max(left, CLOSED) ** 0.5


class _Point(NamedTuple):
    """A position, the way on, the singular values of the loops relative to the largest, of the rank kept, and where
    joints with limits are, turns counted."""

    positions: np.ndarray
    way: np.ndarray
    values: np.ndarray
    counts: np.ndarray

    @property
    def kept(self) -> float:
        """The smallest."""
        return float(self.values[-1]) if self.values.size else 1.0


class _Path:
    """Positions of a model that its loops allow, where its freedom is known."""

    def __init__(self, tree: Tree, freedom: int, left: float):
        self.tree, self.freedom, self.rank = tree, freedom, tree.nv - freedom
        self._most = max(10 * left, DIGITS / 10)
        self._ranges = np.array([part.limits for part in tree.limited]).reshape(-1, 2)
        self._turns = np.array([isinstance(part, Loop) and part.kind == "hinge" for part in tree.limited], bool)
        self.stops: dict[tuple[str, float], None] = {}  # joints and their limits that stopped a step

    def at(self, positions: np.ndarray, way: np.ndarray, counts: np.ndarray | None = None) -> _Point:
        _, values, basis = np.linalg.svd(self.tree.system(positions)[1] * self.tree.scale)
        motion = basis[np.sum(values[: self.rank] > _HELD * values[:1]) :]  # at a singular position straight on
        on = motion.T @ (motion @ way)
        counts = self.tree.counts(positions) if counts is None else counts
        return _Point(positions, on / (np.abs(on).max() or 1.0), values[: self.rank] / values[0], counts)

    def step(self, here: _Point, length: float) -> _Point | None:
        """A step on, where the loops close and the joints are within their limits."""
        start = self.tree.moved(here.positions, length * self.tree.scale * here.way)
        moved, misfit = self.tree.descend(start, _CORRECTIONS)
        if misfit > self._most:
            return None
        steps = self.tree.counts(moved) - here.counts
        counts = here.counts + steps - 2 * np.pi * self._turns * np.round(steps / (2 * np.pi))
        return None if self._stopped(here.counts, counts) else self.at(moved, here.way, counts)

    def on(self, here: _Point) -> _Point | None:
        """A step on, shorter where a limit stops it."""
        for share in range(_HALVED + 1):
            self._hit = ()
            there = self.step(here, _STEP / 2**share)
            if there is not None or not self._hit:
                return there
        self.stops |= dict.fromkeys(self._hit)
        return None

    def both_ways(self, start: _Point, count: int) -> tuple[list[_Point], int]:
        """Positions on one path that leads on through a position, from so many steps before it on; and its place."""
        sides = []
        for here in (start._replace(way=-start.way), start):
            points = [here]
            while len(points) <= count and (there := self.on(points[-1])) is not None:
                points.append(there)
            sides.append(points[1:])
        back = [point._replace(way=-point.way) for point in reversed(sides[0])]
        return [*back, start, *sides[1]], len(back)

    def singular(self, before: _Point, middle: _Point, after: _Point) -> _Point | None:
        """The position at which the rank is lower within two steps, if the middle one has the smallest value."""
        if not before.kept > middle.kept <= after.kept or middle.kept > _DIP * max(before.kept, after.kept):
            return None
        best = self.least(before, middle, lambda point: point.kept, _SECTIONS)
        return best if best.kept < _SINGULAR * min(before.kept, after.kept) else None

    def least(self, before: _Point, middle: _Point, of: Callable[[_Point], float], sections: int) -> _Point:
        """The position within two steps where something is least that is so about the middle one."""
        best, low, high = middle, 0.0, 2 * _STEP
        for _ in range(sections):
            tries = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
            found = [self.step(before, length) for length in tries]
            left, right = (np.inf if each is None else of(each) for each in found)
            low, high = (low, tries[1]) if left < right else (tries[0], high)
            best = min((each for each in (*found, best) if each is not None), key=of)
        return best

    def range_of(self, points: list[_Point], at: np.ndarray, dof: int) -> tuple[float, float]:
        """The least and the largest position of a joint along a path, also between steps, where it turns round."""
        low, high = (self._within(self._end(points, at, dof, sign), dof) for sign in (1.0, -1.0))
        return low, high

    def _within(self, end: float, dof: int) -> float:
        """The limit of a joint where an end passes it by no more than a step may."""
        joint = self.tree.joints[int(self.tree.joint_of_dof[dof])]
        if joint.limits is None or joint.kind not in _SINGLE:
            return end
        inside = float(np.clip(end, *joint.limits))
        return inside if abs(end - inside) <= DIGITS else end

    def _end(self, points: list[_Point], at: np.ndarray, dof: int, sign: float) -> float:
        k = int(np.argmin(sign * at))
        if not 0 < k < len(points) - 1:
            return float(at[k])
        before = points[k - 1]
        turn = self.least(before, points[k], lambda point: sign * _moved(self.tree, before, point, dof), _ROUND)
        return float(at[k - 1]) + _moved(self.tree, before, turn, dof)

    def figures(self, point: _Point, beside: _Point) -> tuple[int, int]:
        """Redundancy and freedom at a singular position, by the values beside it."""
        lost = int(np.sum(point.values < _SINGULAR * beside.kept))
        return self.tree.rows - self.rank + lost, self.freedom + lost

    def _stopped(self, here: np.ndarray, there: np.ndarray) -> bool:
        """Whether joints are farther beyond their limits than before; which they are is kept."""
        low, high = self._ranges.T
        before, after = (np.maximum(np.stack([low - at, at - high], axis=1), 0.0) for at in (here, there))
        places = np.argwhere(after > before + DIGITS)
        self._hit = tuple((self.tree.limited[k].name, float(self._ranges[k, side])) for k, side in places)
        return bool(self._hit)


def travel(tree: Tree, positions: np.ndarray, freedom: int, left: float = 0.0) -> Travel | None:
    """Move the joints from a position on where the freedom is known and loops miss by `left`; None without loops."""
    if not freedom or not (tree.loops or tree.ties):
        return None
    motion, least = tree.motion(positions, freedom)
    first = np.where(tree.drives(positions)[1].any(axis=0), _DRIVEN, 1.0)
    *_, order = scipy.linalg.qr(motion.T * first, pivoting=True, mode="r")
    leaders = order[:freedom]
    ways = motion @ np.linalg.inv(motion[leaders])
    path, ranges, found, walked, moved, turns = _Path(tree, freedom, left), {}, [], [], [], []
    held = np.abs(tree.system(positions)[1] * tree.scale).max(axis=0) > _HELD
    felt = [
        (leader, way) for leader, way in zip(leaders.tolist(), ways.T, strict=True) if np.any(np.abs(way[held]) > _HELD)
    ]
    settled = (resolution(left) * tree.scale).tolist()
    count = int(np.clip(_STEPS // (2 * max(len(felt), 1)), 6, _LONGEST / _STEP))
    for leader, way in sorted(felt, key=lambda each: each[0]):
        points, place = path.both_ways(path.at(positions, way), count)
        steps = [_moved(tree, *two, leader) for two in itertools.pairwise(points)]
        at = np.concatenate([[0.0], np.cumsum(steps)])
        at += _start(tree, positions, leader) - at[place]
        at[np.abs(at) < settled[leader]] = 0.0
        name = _name(tree, leader)
        for k, three in enumerate(zip(points, points[1:], points[2:], strict=False)):
            if (there := path.singular(*three)) is not None:
                where = _rounded(float(at[k]) + _moved(tree, three[0], there, leader), settled[leader])
                joints = zip(tree.joints, tree.places, strict=True)
                every = {joint.name: there.positions[own].tolist() for joint, own in joints}
                found.append(Singular(name, where, *path.figures(there, three[0]), every))
        least = min(least, *(point.kept for point in points))
        low, high = (_rounded(end, settled[leader]) for end in path.range_of(points, at, leader))
        ranges[name], moved = (low, high), [*moved, *[name] * bool(high - low > _MOTION * tree.scale[leader])]
        least_move = max(settled[leader], _MOTION * tree.scale[leader])
        for end, is_end in ((low, at - at.min() < least_move), (high, at.max() - at < least_move)):
            turns += [(name, end)] * (not is_end[0] and not is_end[-1])
        walked.append(Way(name, at, *(np.array([getattr(p, of) for p in points]) for of in ("positions", "kept"))))
    stops = tuple((joint, _rounded(limit, DIGITS)) for joint, limit in path.stops)
    return Travel(ranges, tuple(found), least, bool(tree.limited), stops, tuple(moved), tuple(turns), tuple(walked))


def _rounded(at: float, resolution: float) -> float:
    """A position, 0 where it is nearer to that than it is known."""
    return 0.0 if abs(at) < resolution else at


def _start(tree: Tree, positions: np.ndarray, dof: int) -> float:
    """Where a joint is along one of its velocities, as the file counts; balls and free bodies are counted from here."""
    joint = int(tree.joint_of_dof[dof])
    if tree.joints[joint].kind in ("ball", "free"):
        return 0.0
    return float(positions[tree.places[joint].start + dof - tree.dofs[joint].start])


def _moved(tree: Tree, here: _Point, there: _Point, dof: int) -> float:
    """Displacement of a joint between neighbouring positions, along one of its velocities."""
    return float(tree.difference(here.positions, there.positions)[dof])


def _name(tree: Tree, dof: int) -> str:
    """Of one velocity of a joint."""
    joint = int(tree.joint_of_dof[dof])
    name, dofs = tree.joints[joint].name, tree.dofs[joint]
    return name if dofs.stop - dofs.start == 1 else f"{name}[{dof - dofs.start}]"
