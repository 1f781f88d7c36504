"""Bands of the loads of joints with play and of contacts, whose sides are not known: linear programmes, side by side.

With r = d + Phi_q u - W lam, u the displacement, loads are those of joints whose play is up to c, as the module on play
of `_solve` says of one that is known:

    N^T (W lam + r - d) = 0,   d in a box, or two of it in a disc,
    r_g = c' lam_g / |lam_g|, or |r_g| <= c' where lam_g = 0,   0 <= c' <= c      of rows with play, up to three
    lam >= 0, 0 <= r <= c,   or   lam = 0, r <= c                                of contacts

Each row has two sides, and two or three in a disc or ball have cones of directions in which both lam_g and r_g are,
given by their edges. On one side all is linear. What is not decided is left wider, |r_g| <= c, which gives outer
bounds, and where a programme ends beyond what is possible, that row is decided, the one way and the other (branch and
bound).
"""

import heapq
import itertools
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np

from ..._closures._closure import Elasticity
from ..._closures._play import Play
from .._bounds import Misfits, Parameters
from .._loads_at_rest._programme import TOLERANCE

_APART = 1e-8  # a share of loads and clearances that is no rounding of a programme
_MET = 1e-7  # of the largest value, within which both bounds are one
_CLOSED, _OPEN = "closed", "open"
_EDGE = 0.1  # share of the angle between two edges that a split leaves at least
_CUTS = 8  # planes in a row at a node: where the loads do not tell a place in the disc they would go all around it
_TRIED = 8  # nodes from which loads are looked for by a solve, and of later ones each sixteenth; as many of planes


Attained = Callable[[np.ndarray, np.ndarray], np.ndarray]  # loads at misfits and plays, NaN where they have none


class Group(NamedTuple):
    """Rows with sides that go together: their places among those, how much play they have, and whether they push."""

    places: tuple[int, ...]
    play: float
    pushes: bool


class Joints(NamedTuple):
    """What is known of the joints.

    - `start`, `stress`: lam_0 and N.
    - `elasticity`: W and d; `misfits`: what is bounded of d.
    - `rows`, `groups`: all rows that have sides.
    """

    start: np.ndarray
    stress: np.ndarray
    elasticity: Elasticity
    misfits: Misfits
    rows: np.ndarray
    groups: tuple[Group, ...]

    @property
    def boxed(self) -> np.ndarray:
        """Rows whose misfit is bounded."""
        return self.misfits.rows

    @property
    def box(self) -> np.ndarray:
        """By what, (q, 2)."""
        return self.misfits.box

    def parameters(self, labels: tuple[str, ...]) -> Parameters:
        """Misfits and plays."""
        names = [*(labels[row] for row in self.boxed), *(f"play {self.name(group, labels)}" for group in self.played)]
        ends = [*self.box, *([0.0, group.play] for group in self.played)]
        return Parameters(tuple(names), np.array(ends).reshape(-1, 2))

    @property
    def played(self) -> list[Group]:
        """Groups that have play."""
        return [group for group in self.groups if group.play > 0]

    def name(self, group: Group, labels: tuple[str, ...]) -> str:
        """Of its joint, or of its row if that has play alone."""
        first = labels[int(self.rows[group.places[0]])]
        return first if len(group.places) == 1 else first.rpartition(".")[0]

    def play_of(self, plays: np.ndarray) -> Play | None:
        """Of these groups, that much."""
        if not self.played:
            return None
        return Play(cast(Any, plays), tuple(tuple(self.rows[list(group.places)].tolist()) for group in self.played))

    def elasticity_at(self, misfits: np.ndarray) -> Elasticity:
        """W, and d with these of the rows between bounds."""
        misfit = np.array(np.broadcast_to(self.elasticity.misfit, self.start.shape))
        misfit[self.boxed] = misfits
        return Elasticity(self.elasticity.compliance, cast(Any, misfit))


class End(NamedTuple):
    """The largest value attained, -inf where none was; what none exceeds; the loads there, misfits and plays."""

    value: float
    bound: float
    multipliers: np.ndarray
    case: np.ndarray


def joints_of(
    start: np.ndarray,
    stress: np.ndarray,
    elasticity: Elasticity,
    misfits: Misfits,
    play: Play | None,
    pushing: tuple[int, ...],
) -> Joints:
    """That of rows with play or contacts, those whose load is not unique."""
    redundant = np.any(stress != 0, axis=1)
    of_row = np.zeros(len(start)) if play is None else np.asarray(play.of_rows(len(start)))
    parts = [((row,), float(of_row[row]), True) for row in pushing]
    if play is not None:
        both = zip(play.rows, np.asarray(play.clearance), strict=True)
        parts += [(rows, float(c), False) for rows, c in both if rows[0] not in pushing and c > 0]
    parts = [part for part in parts if redundant[list(part[0])].any()]
    rows = [row for own, _, _ in parts for row in own]
    places = iter(range(len(rows)))
    groups = tuple(Group(tuple(itertools.islice(places, len(own))), c, pushes) for own, c, pushes in parts)
    return Joints(start, stress, elasticity, misfits, np.array(rows, int), groups)


class _Node(NamedTuple):
    """Sides that are decided, with the largest value on them and where it is; in order of the negative value."""

    order: float
    number: int
    cuts: int
    sides: tuple[Any, ...]
    x: np.ndarray | None


class SidesOfJoints:
    """Extremes over all that is possible; x = [z; misfits; lam; r], lam and r of rows that have sides, each in a size
    of its kind."""

    def __init__(self, joints: Joints, attained: Attained, most: int):
        """`attained` gives the loads at misfits and plays; for each extreme `most` nodes are looked at."""
        self.joints, self.attained, self.most = joints, attained, most
        W, d = (np.asarray(part) for part in joints.elasticity_at(np.zeros(len(joints.boxed))))
        N, rows, boxed = joints.stress, joints.rows, joints.boxed
        k, q, s = N.shape[1], len(boxed), len(rows)
        play = max((group.play for group in joints.groups), default=0.0)
        reach = float(np.abs(d).max(initial=0.0) + np.abs(joints.box).max(initial=0.0) + play)
        energy = N.T @ W @ N
        caused = float(np.abs(N @ np.linalg.solve(energy, N.T)).max(initial=0.0)) * reach
        self.load = float(np.abs(joints.start).max(initial=0.0)) + caused or 1.0
        self.gap = float(np.abs(W).max(initial=0.0)) * self.load + reach or 1.0
        self.per_z, self.parts = self.load / np.abs(N).max(axis=0, initial=0.0), np.cumsum([k, q, s])
        each = np.eye(len(joints.start))[:, boxed]
        own = np.hstack([N[rows] * self.per_z, np.zeros((s, q)), -np.eye(s) * self.load, np.zeros((s, s))])
        fits = np.hstack([energy * self.per_z, -N.T @ each * self.gap, np.zeros((k, s)), N[rows].T * self.gap])
        left, right = np.vstack([own, fits]), np.r_[-joints.start[rows], N.T @ (d - W @ joints.start)]
        size = np.abs(left).max(axis=1, initial=0.0)
        self.equal = left / size[:, None], right / size
        within, free = self._within(energy) / self.per_z[:, None], [[-np.inf, np.inf]] * (2 * s)
        self.free = np.array([*within, *(joints.box / self.gap), *free])
        self.planes: list[tuple[np.ndarray, float]] = []  # rows, and what these times x are at most

    def _within(self, energy: np.ndarray) -> np.ndarray:
        """Bounds of z, (k, 2), as the energy of the loads is no more than that of any that are possible.

        With the loads y of joints without play that also pull, and those x that are attained without play,
        |lam - y| <= sqrt(|x - y|^2 + 2 c |x|) in the metric of W; y is within e of that of the middle of the misfits.
        """
        joints, N, inverse = self.joints, self.joints.stress, np.linalg.inv(energy)
        middle, half = joints.box.mean(axis=1), np.ptp(joints.box, axis=1) / 2
        W, d = (np.asarray(part) for part in joints.elasticity_at(middle))
        y = inverse @ N.T @ (d - W @ joints.start)
        x = self.attained(middle, np.zeros(len(joints.played)))
        if not np.all(np.isfinite(x)):
            return np.tile([-np.inf, np.inf], (len(y), 1))
        change = np.linalg.lstsq(N, x - joints.start, rcond=None)[0] - y
        off = float(half @ np.sqrt(np.einsum("ij,jk,ik->i", N, inverse, N)[joints.boxed]))
        play = sum(g.play * float(np.linalg.norm(x[joints.rows[list(g.places)]])) for g in joints.played)
        reach = off + np.sqrt((np.sqrt(change @ energy @ change) + off) ** 2 + 2 * play)
        ends = (1 + _APART) * reach * np.sqrt(np.diag(inverse))
        return np.stack([y - ends, y + ends], axis=1)

    def extreme(self, cost: np.ndarray) -> End:
        """The largest cost @ lam."""
        own = (cost @ self.joints.stress) * self.per_z
        size = float(np.abs(own).max(initial=0.0)) or 1.0
        scaled, base = np.r_[own / size, np.zeros(len(self.free) - len(own))], float(cost @ self.joints.start)
        best, nodes, queue = End(-np.inf, -np.inf, np.full_like(cost, np.nan), self.no_case), 1, list[_Node]()
        nothing = _APART * self.load * float(np.abs(cost).max(initial=0.0))

        def put(sides: tuple[Any, ...], number: int, cuts: int = 0) -> None:
            value, x = self._solve(scaled, sides)
            if value > -np.inf:
                heapq.heappush(queue, _Node(-value, number, cuts, sides, x))

        def better(loads: np.ndarray, case: np.ndarray) -> None:
            nonlocal best
            if np.all(np.isfinite(loads)) and cost @ loads > best.value:
                best = End(float(cost @ loads), np.inf, loads, case)

        def look(number: int, case: np.ndarray) -> None:
            if number < _TRIED or number % (2 * _TRIED) == 0:
                better(self.attained(*np.split(case, [len(self.joints.boxed)])), case)

        put((None,) * len(self.joints.groups), 0)
        while queue and nodes < self.most:
            value, number, cuts, sides, x = queue[0]
            if x is None or base - size * value <= best.value + max(_MET * abs(best.value), nothing):
                break
            heapq.heappop(queue)
            off = [self._off(group, x) for group in self.joints.groups]
            possible = max(off, default=0.0) <= _APART
            if (possible or cuts < _CUTS) and self._cut_misfits(x):
                look(nodes, self._case(x))
                put(sides, number, cuts + 1)
                nodes += 1
            elif possible:
                better(self.joints.start + self.joints.stress @ (self.per_z * x[: self.parts[0]]), self._case(x))
            elif cuts < _CUTS and self._cut(x):
                put(sides, number, cuts + 1)
            else:
                look(number, self._case(x))
                k = int(np.argmax(off))
                for side in self._ways(self.joints.groups[k], sides[k], x):
                    put((*sides[:k], side, *sides[k + 1 :]), nodes)
                    nodes += 1
        ahead = base - size * queue[0][0] if queue else -np.inf
        value, bound = (0.0 if abs(x) <= nothing else x for x in (best.value, max(best.value, ahead)))
        return best._replace(value=value, bound=bound)

    @property
    def no_case(self) -> np.ndarray:
        return np.full(len(self.joints.boxed) + len(self.joints.played), np.nan)

    def _solve(self, cost: np.ndarray, sides: tuple[Any, ...]) -> tuple[float, np.ndarray | None]:
        """The largest cost @ x on sides, and where; infinite and None where nothing bounds it."""
        from scipy.optimize import linprog  # here, because its import takes a second

        bounds, rows, right = self.free.copy(), *map(list, zip(*self.planes, strict=True) if self.planes else ([], []))
        for group, side in zip(self.joints.groups, sides, strict=True):
            loads, gaps = (self.parts[which] + np.array(group.places) for which in (1, 2))
            most = group.play / self.gap
            bounds[gaps] = [-most, most]
            if group.pushes:
                bounds[loads] = [0.0, 0.0 if side == _OPEN else np.inf]
                bounds[gaps, 0] = 0.0 if side == _CLOSED else -np.inf
            elif len(group.places) == 1 and side is not None:
                bounds[loads] = [0.0, np.inf] if side > 0 else [-np.inf, 0.0]
                bounds[gaps] = [0.0, most] if side > 0 else [-most, 0.0]
            elif side is not None:
                ends = -np.linalg.inv(side)
                ends /= np.linalg.norm(ends, axis=1, keepdims=True)
                rows += [self._row(group, normal, gap=gap) for normal in ends for gap in (False, True)]
                right += [0.0] * 2 * len(ends)
        over = (np.array(rows), np.array(right)) if rows else (None, None)
        for presolve in (True, False):  # a presolve takes rounding for a contradiction
            tight = {"primal_feasibility_tolerance": TOLERANCE, "dual_feasibility_tolerance": TOLERANCE}
            found = linprog(-cost, *over, *self.equal, bounds, options={**tight, "presolve": presolve})
            if found.status == 0:
                return -found.fun, found.x
        return (-np.inf if found.status == 2 else np.inf), None

    def _row(self, group: Group, direction: np.ndarray, *, gap: bool) -> np.ndarray:
        out = np.zeros(len(self.free))
        out[self.parts[2 if gap else 1] + np.array(group.places)] = direction
        return out

    def _of(self, group: Group, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Loads and gaps."""
        return tuple(x[self.parts[which] + np.array(group.places)] for which in (1, 2))  # pyright: ignore[reportReturnType]

    def _case(self, x: np.ndarray) -> np.ndarray:
        """Misfits and plays, in their units; misfits beyond a disc at its edge."""
        misfits = self.gap * x[self.parts[0] : self.parts[1]]
        for places, centre, radius in self.joints.misfits.discs:
            off = misfits[places] - centre
            misfits[places] = centre + off * min(1.0, radius / (float(np.linalg.norm(off)) or 1.0))
        gaps = [(self.gap * float(np.linalg.norm(self._of(group, x)[1])), group.play) for group in self.joints.played]
        return np.r_[misfits, [min(each) for each in gaps]]

    def _off(self, group: Group, x: np.ndarray) -> float:
        """By how much it is beyond what is possible, relative."""
        load, gap = self._of(group, x)
        size, most = float(np.linalg.norm(load)), group.play / self.gap
        if group.pushes:
            return min(size, max(float(-gap[0]), 0.0))
        along = load / (size or 1.0)
        apart = float(np.linalg.norm(gap - max(float(along @ gap), 0.0) * along)) / most
        return max(min(size, apart), float(np.linalg.norm(gap)) / most - 1.0)

    def _cut(self, x: np.ndarray) -> bool:
        """Whether a gap is outside of its disc; a plane keeps it out then."""
        found = [(group, self._of(group, x)[1]) for group in self.joints.groups if len(group.places) > 1]
        out = [(group, gap) for group, gap in found if np.linalg.norm(gap) > (1 + _APART / 2) * group.play / self.gap]
        for group, gap in out:
            self.planes.append((self._row(group, gap / np.linalg.norm(gap), gap=True), group.play / self.gap))
        return bool(out)

    def _cut_misfits(self, x: np.ndarray) -> bool:
        """The same of misfits."""
        cut = False
        for places, centre, radius in self.joints.misfits.discs:
            off = x[self.parts[0] + places] - centre / self.gap
            size = float(np.linalg.norm(off))
            if size > (1 + _APART / 2) * radius / self.gap and radius > 0:
                row, along = np.zeros(len(self.free)), off / size
                row[self.parts[0] + places] = along
                self.planes.append((row, float(along @ centre + radius) / self.gap))
                cut = True
        return cut

    def _ways(self, group: Group, side: Any, x: np.ndarray) -> list[Any]:
        """The sides that are left."""
        if group.pushes:
            return [_CLOSED, _OPEN]
        if len(group.places) == 1:
            return [1, -1]
        if side is None:
            return [np.diag(signs) for signs in itertools.product((1.0, -1.0), repeat=len(group.places))]
        widest = list(
            min(itertools.combinations(range(len(side)), 2), key=lambda pair: np.prod(side[:, pair], axis=1).sum())
        )
        parts = np.linalg.solve(side, self._of(group, x)[0])[widest]
        share = parts[1] / (parts.sum() or 1.0)
        middle = side[:, widest] @ (parts if _EDGE < share < 1 - _EDGE else np.ones(2))
        out = [side.copy(), side.copy()]
        for own, end in zip(out, widest, strict=True):
            own[:, end] = middle / np.linalg.norm(middle)
        return out
