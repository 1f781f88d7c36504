"""Extremes over the loads at rest: linear programmes in cones of the loads that friction depends on.

    max c^T x   with   A x = a,   B x <= b,   |V x + v| <= 1,   x in a box,
                       -down_j(rho_j) <= t_j <= up_j(rho_j),   t = T x + t_0,   rho = R x + rho_0

Every limit is a constant and a seminorm N of at most two loads. More load allows more friction, so that the set is not
convex. In a cone of loads with the rays v_i, and beside any loads rho*,

    N'(rho*) rho <= N(rho) <= sum_i w_i N(v_i),   rho = sum_i w_i v_i,   w_i >= 0.

With the right side as limit a linear programme holds all that is possible in the cone: it gives an outer bound. With
the left side it holds only what is possible: an inner one. Cones are split along the load that the programme found,
where its limit is exact then, until both bounds meet or `most` programmes are solved.

A slip that moves has all of its friction: `full` says at which limit. The lower bound N'(rho*) rho <= N is a cut then.
"""

import heapq
import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

Limits = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]
Rays = np.ndarray | None  # of a cone, shape (loads, loads), column by column; None for all loads

_TOLERANCE = 1e-10  # of the programmes, whose figures are of size 1
_KEPT = 1e-9  # by how much a limit may be exceeded, relative to the size of its friction
_GAP = 1e-7  # between both bounds that is none
_ROUNDS = 40  # of cuts, and of steps to a better inner bound
_TIGHTENED = 4  # rounds in which the ranges of loads are narrowed
_EDGE = 0.02  # share of a cone that a split leaves at least
_WIDER = 1e-6  # angle by which a cone exceeds the loads found, which makes it one of two rays


class Programme(NamedTuple):
    """What is possible, in figures of size 1; see the module.

    - `equal`, `within`: A, a and B, b; `norm`: V, v, without rows if there is none.
    - `box`: least and largest x, shape (x, 2); may be infinite.
    - `bounded`: T, t_0; `read`: R, rho_0; `reads`: the loads that each limit depends on.
    - `full`: 0 within limits, 1 at `up`, -1 at `-down`; the other limit is infinite then.
    - `limits`: down, up and their derivatives by rho.
    """

    equal: tuple[np.ndarray, np.ndarray]
    within: tuple[np.ndarray, np.ndarray]
    norm: tuple[np.ndarray, np.ndarray]
    box: np.ndarray
    bounded: tuple[np.ndarray, np.ndarray]
    read: tuple[np.ndarray, np.ndarray]
    reads: tuple[np.ndarray, ...]
    full: np.ndarray
    limits: Limits


class Extreme(NamedTuple):
    """A largest value.

    - `value`, `x`: the largest that was attained, and where; -inf and None where nothing possible was found.
    - `bound`: proved not to be exceeded; -inf where nothing is possible.
    - `duals`: of A x = a, at the programme that attained the value.
    """

    value: float
    x: np.ndarray | None
    bound: float
    duals: np.ndarray | None


class _Row(NamedTuple):
    """left^T x <= right."""

    left: np.ndarray
    right: float


class _Optimum(NamedTuple):
    """Of a linear programme: infinite without bound, -inf without solution."""

    value: float
    x: np.ndarray | None
    duals: np.ndarray | None


class _Node(NamedTuple):
    """Cones, with the largest value over them and where it is; in order of the negative bound."""

    order: float
    number: int
    bound: float
    x: np.ndarray | None
    duals: np.ndarray | None
    cones: list[Rays]

    @classmethod
    def of(cls, found: _Optimum, cones: list[Rays], numbers: Iterator[int]) -> "_Node":
        return cls(-found.value, next(numbers), found.value, found.x, found.duals, cones)


_NONE = _Optimum(-np.inf, None, None)


class LoadsAtRest:
    """The set of a programme, with what is found of it on the way: cuts, and cones to begin with."""

    def __init__(self, programme: Programme, *, most: int = 400):
        """`most` programmes are solved for each extreme."""
        self.programme, self.most = programme, most
        self.sides = np.full((len(programme.reads), 2), np.inf)
        self.cuts: list[_Row] = []
        self.found: np.ndarray | None = None
        self.known: dict[tuple[int, bytes], np.ndarray] = {}
        self.start: list[Rays] = [None] * len(programme.reads)
        self._tighten()

    def extreme(self, cost: np.ndarray, *, first: bool = False) -> Extreme:
        """The largest c^T x; with `first` any that is possible."""
        size = np.abs(cost).max(initial=0.0) or 1.0
        cost, best, left, solved, order = cost / size, _NONE, -np.inf, 1, itertools.count()
        self.cuts.clear()
        if self.found is not None:
            best, solved = self._inner(cost, self.found)
        queue = [_Node.of(self._outer(cost, self.start), self.start, order)]

        def matters(bound: float) -> bool:
            return bound > -np.inf and (best.x is None or bound > best.value + _GAP * max(1.0, abs(best.value)))

        while queue and matters(queue[0].bound) and solved < self.most and not (first and best.x is not None):
            node = heapq.heappop(queue)
            cuts = [] if node.x is None else self._violated(node.x)
            if cuts:
                self.cuts += cuts
                solved += 1
                heapq.heappush(queue, _Node.of(self._outer(cost, node.cones), node.cones, order))
                continue
            excess = np.full(len(self.start), np.inf) if node.x is None else self._excess(node.x)
            if np.all(excess <= _KEPT):
                best = max(best, _Optimum(node.bound, node.x, node.duals), key=_value)
                continue
            if node.x is not None and (node.number < 8 or node.number % 16 == 0):
                found, steps = self._inner(cost, node.x)
                best, solved = max(best, found, key=_value), solved + steps
            cones = self._split(node.cones, node.x, excess)
            if not cones:
                left = max(left, node.bound)
            for cone in cones:
                found, solved = self._outer(cost, cone), solved + 1
                if matters(found.value):
                    heapq.heappush(queue, _Node.of(found, cone, order))
        self.found = best.x
        bound = max([best.value, left, *(node.bound for node in queue)])
        return Extreme(size * best.value, best.x, size * bound, best.duals)

    def _outer(self, cost: np.ndarray, cones: Sequence[Rays]) -> _Optimum:
        """The largest that the limits over cones allow."""
        rows = [row for j, rays in enumerate(cones) for row in self._over_cone(j, rays)]
        return self._solve(cost, rows)

    def _inner(self, cost: np.ndarray, x: np.ndarray) -> tuple[_Optimum, int]:
        """A local extreme of what is possible, from loads beside it, and the number of programmes."""
        best, count = _NONE, 0
        while count < _ROUNDS:
            count += 1
            tangents = self._tangents(x)
            self.cuts += [_Row(-row.left, -row.right) for row, full in tangents if full]
            found = self._convex(cost, [row for row, _ in tangents])
            if found.x is None:
                break
            x = found.x
            good = bool(np.all(self._excess(x) <= _KEPT))
            settled = best.x is not None and found.value <= best.value + _TOLERANCE * max(1.0, abs(best.value))
            if good and found.value > best.value:
                best = found
            if good and settled:
                break
        return best, count

    def _convex(self, cost: np.ndarray, rows: list[_Row]) -> _Optimum:
        """The largest c^T x under the rows, and cuts until what is convex is kept."""
        for _ in range(_ROUNDS):
            found = self._solve(cost, rows)
            cuts = [] if found.x is None else self._violated(found.x)
            if not cuts:
                break
            self.cuts += cuts
        return found

    def _solve(self, cost: np.ndarray, rows: list[_Row]) -> _Optimum:
        from scipy.optimize import linprog  # here, because its import takes a second

        own, rows = self.programme, [*rows, *self.cuts]
        left = np.array([*own.within[0], *(row.left for row in rows)]).reshape(-1, len(cost))
        right = np.array([*own.within[1], *(row.right for row in rows)])
        size = np.abs(left).max(axis=1, initial=0.0)
        size = np.where(size > 0, size, 1.0)
        for presolve in (True, False):
            found = linprog(
                -cost,
                left / size[:, None],
                right / size,
                *own.equal,
                bounds=own.box,
                options={
                    "primal_feasibility_tolerance": _TOLERANCE,
                    "dual_feasibility_tolerance": _TOLERANCE,
                    "presolve": presolve,
                },
            )
            if found.status == 0:
                return _Optimum(-found.fun, found.x, found.eqlin.marginals)
            if found.status == 2:
                return _NONE
        return _Optimum(np.inf, None, None)

    def _violated(self, x: np.ndarray) -> list[_Row]:
        """Cuts that x does not keep: of the ellipsoid, and of slips that have all of their friction."""
        matrix, offset = self.programme.norm
        cuts, at = [], matrix @ x + offset
        length = np.linalg.norm(at)
        if length > 1 + _KEPT:
            cuts.append(_Row(at @ matrix / length, 1 - at @ offset / length))
        cuts += [
            _Row(-row.left, -row.right) for row, full in self._tangents(x) if full and row.right - row.left @ x > _KEPT
        ]
        return cuts

    def _tangents(self, x: np.ndarray) -> list[tuple[_Row, bool]]:
        """Of all limits at the loads of x, upper then lower; and whether the friction is that limit."""
        own = self.programme
        (T, t), (R, r) = own.bounded, own.read
        loads = R @ x + r
        down, up, by_down, by_up = own.limits(loads)
        out = []
        for sign, limit, slope in ((1.0, up, by_up), (-1.0, down, by_down)):
            left, right = sign * T - slope @ R, limit - slope @ (loads - r) - sign * t
            rows = zip(left, right, own.full, limit, strict=True)
            out += [(_Row(a, float(b)), bool(full == sign)) for a, b, full, most in rows if most < np.inf]
        return out

    def _excess(self, x: np.ndarray) -> np.ndarray:
        """By how much limits are exceeded, and full friction is missed."""
        both = self._shortage(x).reshape(2, -1)
        full = self.programme.full
        missed = np.where(full == 1, both[0], np.where(full == -1, both[1], -np.inf))
        return np.maximum(np.max(-both, axis=0), missed)

    def _shortage(self, x: np.ndarray) -> np.ndarray:
        """What is left to the upper limits, then to the lower ones."""
        own = self.programme
        down, up = own.limits(own.read[0] @ x + own.read[1])[:2]
        t = own.bounded[0] @ x + own.bounded[1]
        return np.concatenate([up - t, down + t])

    def _over_cone(self, j: int, rays: Rays) -> list[_Row]:
        """The limits of one friction over a cone of its loads, and the cone."""
        own = self.programme
        (T, t), (R, r), reads = own.bounded, own.read, own.reads[j]
        if rays is None or not reads.size:
            return [
                _Row(s * T[j], side - s * t[j]) for s, side in zip((1, -1), self.sides[j], strict=True) if side < np.inf
            ]
        weights = np.linalg.inv(rays)
        shares, given = weights @ R[reads], weights @ r[reads]
        out = [_Row(-share, more) for share, more in zip(shares, given, strict=True)]
        for sign, limit in zip((1, -1), self._limits_along(j, rays), strict=True):
            if limit[0] < np.inf:
                out.append(_Row(sign * T[j] - limit[1:] @ shares, limit[0] + limit[1:] @ given - sign * t[j]))
        return out

    def _limits_along(self, j: int, rays: np.ndarray) -> np.ndarray:
        """The upper and the lower limit without load, and by how much each ray raises them: (2, 1 + rays)."""
        none = self._limits_at(j, np.zeros(len(rays)))
        raised = [self._limits_at(j, ray) - np.where(np.isinf(none), 0.0, none) for ray in rays.T]
        return np.stack([none, *raised], axis=1)

    def _split(self, cones: list[Rays], x: np.ndarray | None, excess: np.ndarray) -> list[list[Rays]]:
        """Cones that together hold those of a node, apart where the worst limit is; none if none can be split."""
        reads, settled = self.programme.reads, self._settled
        for j in np.argsort(-excess):
            if settled[j] or excess[j] <= _KEPT or (x is None and cones[j] is not None):
                continue
            if cones[j] is None:
                parts = [np.diag(signs) for signs in itertools.product((1.0, -1.0), repeat=reads[j].size)]
            else:
                parts = self._halves(cones[j], x, reads[j])
            if parts:
                return [[*cones[:j], part, *cones[j + 1 :]] for part in parts]
        return []

    def _halves(self, rays: np.ndarray, x: np.ndarray, reads: np.ndarray) -> list[np.ndarray]:
        """A cone of two loads, split along that of x."""
        if reads.size < 2:
            return []
        matrix, offset = self.programme.read
        share = np.linalg.solve(rays, matrix[reads] @ x + offset[reads])
        share = np.maximum(share, 0.0)
        share = share / share.sum() if share.sum() > 0 else np.full(2, 0.5)
        ray = rays @ np.clip(share, _EDGE, 1 - _EDGE)
        ray = ray / np.linalg.norm(ray)
        return [np.stack([rays[:, 0], ray], axis=1), np.stack([ray, rays[:, 1]], axis=1)]

    @property
    def _settled(self) -> np.ndarray:
        """Limits that are the same at all loads that are possible."""
        return np.array([not reads.size for reads in self.programme.reads], bool)

    def _tighten(self) -> None:
        """Narrow the loads that each limit depends on, and with them the limits, from the widest."""
        matrix, offset = self.programme.read
        down, up = self.programme.limits(np.zeros(len(offset)))[:2]
        constant = self._settled
        self.sides[constant] = np.stack([up, down], axis=1)[constant]
        for _ in range(_TIGHTENED):
            found = np.array([[self._outer(s * row, self.start).value for s in (-1, 1)] for row in matrix])
            if np.any(found == -np.inf):
                return
            ranges = (found * [-1, 1] + offset[:, None]).reshape(-1, 2)
            before = self.sides.copy()
            self._take(ranges)
            if np.all(self.sides > 0.9 * before):
                return

    def _take(self, ranges: np.ndarray) -> None:
        """Limits and cones of the loads within their ranges: a convex limit is largest at a vertex."""
        for j, reads in enumerate(self.programme.reads):
            own = ranges[reads]
            if not reads.size or not np.all(np.isfinite(own)):
                continue
            vertices = np.array(list(itertools.product(*own)))
            values = np.stack([self._limits_at(j, vertex) for vertex in vertices])
            self.sides[j] = np.minimum(self.sides[j], values.max(axis=0))
            self.start[j] = _cone(vertices)

    def _limits_at(self, j: int, loads: np.ndarray) -> np.ndarray:
        """The upper and the lower limit of one friction."""
        key = j, loads.tobytes()
        if key not in self.known:
            point = np.zeros(len(self.programme.read[1]))
            point[self.programme.reads[j]] = loads
            down, up = self.programme.limits(point)[:2]
            self.known[key] = np.array([up[j], down[j]])
        return self.known[key]


def _value(found: _Optimum) -> float:
    return found.value


def _cone(points: np.ndarray) -> Rays:
    """The narrowest cone that holds the vertices of a box, None where that holds the zero."""
    middle = points.mean(axis=0)
    if points.shape[1] == 1:
        return np.sign(middle)[:, None] if points.min() > 0 or points.max() < 0 else None
    if np.all(points.min(axis=0) <= 0) and np.all(points.max(axis=0) >= 0):
        return None
    along = middle / np.linalg.norm(middle)
    angle = np.arctan2(along[0] * points[:, 1] - along[1] * points[:, 0], points @ along)
    least, most = angle.min() - _WIDER, angle.max() + _WIDER
    return np.stack([_turned(along, least), _turned(along, most)], axis=1)


def _turned(vector: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]]) @ vector
