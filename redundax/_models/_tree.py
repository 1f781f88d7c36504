"""The tree of bodies of a model: where joints put them, what loops leave open, and positions of joints that close them

A joint displaces all that hangs on it, in the reference pose, by a rotation R and a shift s: x goes to R x + s, and the
displacements of the joints above come after. A velocity of a joint moves a point x of what hangs on it by v + w x x.

Loops are closed by truncated Gauss-Newton steps in the positions of the joints, each the least that lessens the misfit,
so that bodies stay in their joints and joints of no loop where they are, however far the file is from closed.
"""

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .._bodies._space._rotation import between, rotation
from ._description import Description, End, Joint, Loop, Term
from ._kinds import KINDS
from ._loop_rows import LoopRows, count_of, loop_rows
from ._vectors import cross, turned, vector_of

_STEPS, _STARTS, _ENOUGH, _LONGEST = 200, 20, 5, 0.3  # the longest step: rad, and the share of the model's size
CLOSED = 1e-13  # a misfit relative to the size of the model, by rounding of some ten products
OPEN = 1e-4  # likewise: files of four digits close to that, and what misses by more does not close
DIGITS = 1e-6  # relative: numbers of a file may have no more digits, so that less tells nothing
_STILL = 1e-12  # steps that lead nowhere
_NEAR = 1e-3  # rad, or the share of the model's size
_REACH = 0.8  # rad, or the share of the model's size: the largest of random displacements of joints


class _Motion:
    """A turn about, or a slide along, an axis in the reference pose."""

    def __init__(self, is_turn: bool, axis: np.ndarray, point: np.ndarray):
        self.is_turn, self.axis, self.point = is_turn, axis, point
        x, y, z = axis
        self._skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        self._square = self._skew @ self._skew

    def by(self, amount: float) -> tuple[np.ndarray, np.ndarray]:
        """Rotation and shift."""
        if not self.is_turn:
            return np.eye(3), amount * self.axis
        turned = np.sin(amount) * self._skew + (1 - np.cos(amount)) * self._square
        return np.eye(3) + turned, -turned @ self.point


class Poses(NamedTuple):
    """Where joints put the bodies: of each its rotation, (bodies, 3, 3), and shift, (bodies, 3), from the reference
    pose; and what a unit of each velocity of joints moves the origin and turns, both (velocities, 3)."""

    turns: np.ndarray
    shifts: np.ndarray
    moves: np.ndarray
    spins: np.ndarray

    def point(self, end: End) -> np.ndarray:
        """Of an end, global."""
        return self.turns[end.body] @ end.point + self.shifts[end.body]

    def axes(self, end: End) -> np.ndarray:
        """Of an end, global."""
        return self.turns[end.body] @ end.axes

    def frame(self, end: End) -> tuple[np.ndarray, np.ndarray]:
        """Both."""
        return self.point(end), self.axes(end)


class Tree:
    """The joints of a description, with its loops and ties.

    - `nq`, `nv`: how many positions and velocities its joints have; `places`, `dofs`: of each joint, as slices.
    - `below`: which velocities move a body, (bodies, nv); `size`: a length of it, m.
    """

    def __init__(self, description: Description):
        self.description, self.joints = description, description.joints
        self.loops, self.ties = description.loops, description.ties
        sizes = np.array([KINDS[joint.kind].sizes for joint in self.joints]).reshape(-1, 2)
        ends = np.concatenate([np.zeros((1, 2), int), np.cumsum(sizes, axis=0)])
        self.nq, self.nv = ends[-1].tolist()
        self.places, self.dofs = (
            [slice(*pair) for pair in zip(at[:-1].tolist(), at[1:].tolist(), strict=True)] for at in ends.T
        )
        self.joint_of_dof = np.repeat(np.arange(len(self.joints)), sizes[:, 1])
        self.reference = np.concatenate([np.zeros(0), *(joint.reference for joint in self.joints)])
        self._motions = [_motions(joint) for joint in self.joints]
        self._last: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self.below = np.zeros((len(description.bodies), self.nv), dtype=bool)
        for joint, dofs in zip(self.joints, self.dofs, strict=True):
            self.below[joint.child.body] = self.below[joint.parent.body]
            self.below[joint.child.body, dofs] = True
        parts = [description.points, *(end.point[None] for each in self.loops for end in (each.first, each.second))]
        self.size = max(float(np.ptp(np.concatenate(parts), axis=0).max(initial=0.0)), 1e-3)

    @property
    def movers(self) -> list[int]:
        """Bodies of the file that move, by their numbers: those between joints of one body move with it."""
        return [joint.child.body for joint in self.joints if not self.description.is_between(joint)]

    def slack(self, part: Joint | Loop) -> float:
        """By how much the count of a hinge or slide may pass a limit, as the digits of its file tell no less."""
        return DIGITS * (self.size if part.kind == "slide" else 1.0)

    def at(self, positions: np.ndarray) -> Poses:
        """Poses of all bodies, and what velocities of the joints move."""
        count = len(self.description.bodies)
        turns, shifts = np.empty((count, 3, 3)), np.zeros((count, 3))
        turns[0] = np.eye(3)
        axes, points, is_turn = np.zeros((self.nv, 3)), np.zeros((self.nv, 3)), np.zeros((self.nv, 1), dtype=bool)
        for joint, place, dofs, motions in zip(self.joints, self.places, self.dofs, self._motions, strict=True):
            turn, shift, own = turns[joint.parent.body], shifts[joint.parent.body], positions[place]
            body, dof = joint.child.body, dofs.start
            if joint.kind in ("ball", "free"):
                frame = self.description.bodies[body]
                axes_then, point = frame.axes, joint.child.point if joint.kind == "ball" else frame.position
                if joint.kind == "ball":
                    there, turn = turn @ point + shift, turn @ axes_then @ rotation(own) @ axes_then.T
                else:
                    there, turn = own[:3], rotation(own[3:]) @ axes_then.T
                    axes[dof : dof + 3], dof = np.eye(3), dof + 3
                shift = there - turn @ point
                axes[dof : dof + 3], points[dof : dof + 3] = (turn @ axes_then).T, there
                is_turn[dof : dof + 3] = True
            for motion, amount in zip(motions, own - joint.reference, strict=False):
                axes[dof], points[dof], is_turn[dof] = turn @ motion.axis, turn @ motion.point + shift, motion.is_turn
                by, move = motion.by(float(amount))
                turn, shift, dof = turn @ by, turn @ move + shift, dof + 1
            turns[body], shifts[body] = turn, shift
        return Poses(turns, shifts, np.where(is_turn, cross(points, axes), axes), np.where(is_turn, axes, 0.0))

    def velocities(self, poses: Poses, end: End) -> tuple[np.ndarray, np.ndarray]:
        """Of the point of an end, and of its body as it turns, by the velocities of the joints, both (3, nv)."""
        return self.velocities_at(poses, end.body, poses.point(end))

    def velocities_at(self, poses: Poses, body: int, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same of a global point of a body."""
        moves = np.where(self.below[body][:, None], poses.moves + cross(poses.spins, point), 0.0)
        return moves.T, np.where(self.below[body][:, None], poses.spins, 0.0).T

    def misfit(self, positions: np.ndarray) -> float:
        """The largest misfit, relative to the size of the model."""
        return float(np.abs(self.system(positions)[0]).max(initial=0.0)) / self.size

    def misfits(self, positions: np.ndarray) -> dict[str, float]:
        """How far each loop is from closed, m or rad, the larger."""
        parts = [*(rows.residual for rows in self.rows_of_loops(positions)), *self._lags(positions)]
        names = [part.name for part in (*self.loops, *self.ties)]
        return {name: float(np.abs(part).max()) for name, part in zip(names, parts, strict=True)}

    def closed(self, start: np.ndarray | None = None, *, only_near: bool = False) -> tuple[np.ndarray, float]:
        """Joint positions that close all loops as well as the digits of the file allow, by the least steps from those
        given, or those of the file; and the largest misfit left, relative to the size of the model. Where that does not
        close them, and not `only_near`, they are the nearest found otherwise. A misfit of digits moves no joint far."""
        start = np.array(self.reference if start is None else start)
        found = self.descend(start)
        if self.misfit(start) <= DIGITS and self._distance(start, found[0]) > _NEAR:
            found = self.descend(start, rcond=DIGITS / _NEAR)
        return found if only_near or found[1] <= OPEN else self._nearest(start, found)

    def _nearest(self, start: np.ndarray, found: tuple[np.ndarray, float]) -> tuple[np.ndarray, float]:
        """As `closed`, the nearest of some positions that joints of loops reach from random displacements; where none
        closes, the one that misses least, of these and the one given."""
        random, closed, in_loops = np.random.default_rng(0), [], self.in_loops()
        for trial in range(_STARTS):
            way = random.normal(scale=0.1 + trial / _STARTS, size=self.nv)
            other = self.descend(self.moved(start, np.where(in_loops, way, 0.0)))
            found = min(found, other, key=lambda each: each[1])
            closed += [self._drawn(other, start)] if other[1] <= OPEN else []
            if len(closed) == _ENOUGH:
                break
        best = [each for each in closed if each[1] <= max(found[1], DIGITS)]
        return min(best, key=lambda each: self._distance(start, each[0]), default=found)

    def _drawn(self, found: tuple[np.ndarray, float], start: np.ndarray) -> tuple[np.ndarray, float]:
        """From a closed position, one that is closed as well and nearer to another, by steps along the motions."""
        best, (positions, _), scale = found, found, self.scale
        for _ in range(_STEPS):
            residual, slope = self.system(positions)
            wish = self.difference(positions, start) / scale
            step = wish - np.linalg.lstsq(slope * scale, residual + slope * scale @ wish, rcond=DIGITS)[0]
            length = float(np.abs(step).max())
            positions = self.moved(positions, scale * step * min(1.0, _LONGEST / max(length, _STILL)))
            if length < _LONGEST:
                nearer = self.descend(positions)
                if nearer[1] > OPEN or self._distance(start, nearer[0]) > (1 - DIGITS) * self._distance(start, best[0]):
                    break
                best, (positions, _) = nearer, nearer
        return best

    def _distance(self, start: np.ndarray, positions: np.ndarray) -> float:
        return float(np.linalg.norm(self.difference(start, positions) / self.scale))

    def in_loops(self) -> np.ndarray:
        """Which velocities of joints move some loop or tie in itself, (nv,)."""
        found, tied = np.zeros(self.nv, dtype=bool), (each for tie in self.ties for each in (*tie.first, *tie.second))
        for part in (*self.loops, *(term for term, _ in tied)):
            if isinstance(part, Loop):
                found |= self.below[part.first.body] ^ self.below[part.second.body]
            else:
                found[self.dofs[part]] = True
        return found

    def elsewhere(
        self, positions: np.ndarray, left: float, count: int, is_within: Callable[[np.ndarray], bool] | None = None
    ) -> list[np.ndarray]:
        """Other positions that close the loops as well as these do, or as the digits of the file allow, from random
        displacements along the motions, those first that are within limits; fewer where they are not found."""
        random, found, beyond, scale = np.random.default_rng(1), [], [], self.scale
        _, values, basis = np.linalg.svd(self.system(positions)[1] * scale)
        free = basis[int(np.sum(values > DIGITS * values.max(initial=0.0))) :]
        for trial in range(4 * count):
            reach, way = _REACH / (1 + trial // count), random.normal(size=self.nv)
            way = free.T @ (free @ way) if len(free) else way  # what cannot move may close otherwise
            start = self.moved(positions, reach * scale * way / np.abs(way).max())
            other, misfit = self.descend(start)
            if misfit <= max(10 * left, DIGITS / 10) and np.abs(other - positions).max() > 1e-3 * reach:
                (found if is_within is None or is_within(other) else beyond).append(other)
            if len(found) == count:
                break
        return (found + beyond)[:count]

    def motion(self, positions: np.ndarray, freedom: int) -> tuple[np.ndarray, float]:
        """Velocities of the joints, relative to `scale`, that the loops leave, (nv, freedom); and the smallest singular
        value kept, relative to the largest."""
        _, values, basis = np.linalg.svd(self.system(positions)[1] * self.scale)
        rank = self.nv - freedom
        return basis[rank:].T, float(values[rank - 1] / values[0]) if rank else 1.0

    def drives(self, positions: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
        """Names of the drives, and their rates by the velocities of the joints, (drives, nv)."""
        return self.description.drives, self.description.rates(positions)

    def descend(self, positions: np.ndarray, steps: int = _STEPS, rcond: float = DIGITS) -> tuple[np.ndarray, float]:
        """Positions that close the loops, from these on, and the largest misfit left, relative to the size."""
        left = 0.0
        for _ in range(steps if self.loops or self.ties else 0):
            residual, slope = self.system(positions)
            left = float(np.abs(residual).max()) / self.size
            if left < CLOSED:
                break
            step = -np.linalg.lstsq(slope, residual, rcond=rcond)[0]
            length = float(np.abs(step / self.scale).max())
            if length < _STILL:
                break
            step *= min(1.0, _LONGEST / length)
            positions = self.moved(positions, step)
        return positions, left

    def moved(self, positions: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Positions after a step of velocities for a unit of time; those of balls and free bodies turn about their own
        axes."""
        positions = np.array(positions)
        for joint, place, dofs in zip(self.joints, self.places, self.dofs, strict=True):
            own = positions[place]
            if joint.kind in ("ball", "free"):
                own[-4:] = turned(own[-4:], step[dofs][-3:])
                own[:-4] += step[dofs][:-3]
            else:
                own += step[dofs]
        return positions

    @functools.cached_property
    def rows(self) -> int:
        """How many conditions the loops and ties set."""
        return self.system(self.reference)[0].size

    def difference(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Displacements that lead from one position to another, as velocities for a unit of time."""
        step = np.zeros(self.nv)
        for joint, place, dofs in zip(self.joints, self.places, self.dofs, strict=True):
            one, other, own = before[place], after[place], step[dofs]
            if joint.kind in ("ball", "free"):
                own[-3:] = vector_of(between(one[-4:], other[-4:]))
                own[:-3] = other[:-4] - one[:-4]
            else:
                own[:] = other - one
        return step

    @functools.cached_property
    def scale(self) -> np.ndarray:
        """Of a long step of each joint: the size of the model for one that slides or floats, 1 for one that turns."""
        each = zip(self.joints, self.dofs, strict=True)
        slides = [np.full(dofs.stop - dofs.start, joint.kind == "free") for joint, dofs in each]
        for found, motions in zip(slides, self._motions, strict=True):
            found[: len(motions)] = [not motion.is_turn for motion in motions]
        return np.where(np.concatenate([np.zeros(0, bool), *slides]), self.size, 1.0)

    @functools.cached_property
    def limited(self) -> tuple[Joint | Loop, ...]:
        """Hinges and slides that have limits, of the tree and then of loops."""
        return tuple(part for part in (*self.joints, *self.loops) if part.limits and part.kind in ("hinge", "slide"))

    def counts(self, positions: np.ndarray) -> np.ndarray:
        """Where these are, rad or m as the file counts."""
        places = {joint.name: place.start for joint, place in zip(self.joints, self.places, strict=True)}
        found = [positions[places[part.name]] for part in self.limited if isinstance(part, Joint)]
        if loops := [part for part in self.limited if isinstance(part, Loop)]:
            poses = self.at(positions)
            found += [count_of(loop, *(poses.frame(end) for end in (loop.first, loop.second))) for loop in loops]
        return np.array(found)

    def rows_of_loops(self, positions: np.ndarray) -> list[LoopRows]:
        """What each loop holds at positions of the joints."""
        poses = self.at(positions)
        return [loop_rows(loop, *(poses.frame(end) for end in (loop.first, loop.second))) for loop in self.loops]

    def system(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual of all loops and ties, and its derivative by the velocities of the joints."""
        if self._last is None or not np.array_equal(self._last[0], positions):  # a descent ends where the next look is
            self._last = positions.copy(), *self._system(positions)
        return self._last[1:]

    def _system(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        poses, residuals, slopes = self.at(positions), [np.zeros(0)], [np.zeros((0, self.nv))]
        for loop in self.loops:
            rows = _rows(poses, loop)
            residuals.append(rows.residual)
            slopes.append(self._slopes(poses, loop, rows))
        for terms in self.terms(positions):
            row = np.zeros((1, self.nv))
            for term, weight in terms:
                if isinstance(term, Loop):
                    row += weight * self._slopes(poses, term, _rows(poses, term))
                else:
                    row[0, self.dofs[term].start] += weight
            slopes.append(row)
        return np.concatenate([*residuals, *self._lags(positions)]), np.concatenate(slopes)

    def _slopes(self, poses: Poses, loop: Loop, rows: LoopRows) -> np.ndarray:
        """Rates of rows by the velocities of the joints."""
        one, other = (
            self.velocities_at(poses, end.body, point)
            for end, point in zip((loop.first, loop.second), rows.points, strict=True)
        )
        return rows.forces @ (one[0] - other[0]) + rows.moments @ (one[1] - other[1])

    def terms(self, positions: np.ndarray) -> list[list[Term]]:
        """Of each tie what its row is of, and how much a unit of that changes it."""
        found = []
        for tie in self.ties:
            slope = float(np.polyval(np.polyder(tie.polynomial[::-1]), self._displacement(positions, tie.second)))
            both = ((tie.first, 1.0), (tie.second, -slope))
            found.append([(term, by * weight) for terms, by in both for term, weight in terms])
        return found

    def _displacement(self, positions: np.ndarray, terms: Sequence[Term]) -> float:
        """The sum of displacements of joints and distances, times their weights."""
        away, found = positions - self.reference, 0.0
        for term, weight in terms:
            if isinstance(term, Loop):
                found += weight * float(_rows(self.at(positions), term).residual[0])
            else:
                found += weight * float(away[self.places[term].start])
        return found

    def _lags(self, positions: np.ndarray) -> list[np.ndarray]:
        """What ties miss."""
        sums = [[self._displacement(positions, terms) for terms in (tie.first, tie.second)] for tie in self.ties]
        polynomials = [tie.polynomial[::-1] for tie in self.ties]
        return [np.array([one - np.polyval(by, other)]) for (one, other), by in zip(sums, polynomials, strict=True)]


def _rows(poses: Poses, loop: Loop) -> LoopRows:
    return loop_rows(loop, poses.frame(loop.first), poses.frame(loop.second))


def _motions(joint: Joint) -> list[_Motion]:
    ends = {"child": joint.child, "parent": joint.parent}
    return [
        _Motion(is_turn, ends[end].axes[:, column], joint.child.point)
        for _, is_turn, end, column in KINDS[joint.kind].coordinates
    ]
