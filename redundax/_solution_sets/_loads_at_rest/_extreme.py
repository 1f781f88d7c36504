"""Inner and outer bounds of what a programme allows: cones of loads are split where its limits are exceeded most."""

import copy
import heapq
import itertools
from collections.abc import Iterator
from typing import NamedTuple, cast

import numpy as np

from ._programme import NOTHING, Optimum, Programme, Rays
from ._relaxation import Relaxation

_GAP = 1e-7  # between both bounds that is none
_ROUNDING = 1e-9  # of a programme, in figures of size 1
_TIGHTENED = 4  # rounds in which the ranges of loads are narrowed
_EDGE = 0.02  # share of a cone that a split leaves at least
_WIDEST = np.pi - 1e-3  # opening of a cone, which is no cone from pi on
_WIDER = 1e-6  # angle by which a cone exceeds the loads found, which makes it one of two rays
_FLATTEST = 20.0  # tangent of half the opening of a cone of several loads, beyond which all loads are as good


class Extreme(NamedTuple):
    """A largest value.

    - `value`, `x`: the largest that was attained, and where; -inf and None where nothing possible was found.
    - `bound`: proved not to be exceeded; -inf where nothing is possible.
    """

    value: float
    x: np.ndarray | None
    bound: float


class _Node(NamedTuple):
    """Cones, with the largest value over them and where it is; in order of the negative bound."""

    order: float
    number: int
    found: Optimum
    cones: list[Rays]

    @classmethod
    def of(cls, found: Optimum, cones: list[Rays], numbers: Iterator[int]) -> "_Node":
        return cls(-found.value, next(numbers), found, cones)

    @property
    def bound(self) -> float:
        return self.found.value

    @property
    def x(self) -> np.ndarray | None:
        return self.found.x


class LoadsAtRest:
    """The set of a programme.

    - `start`: cones that hold all that is possible; `found`: where the last extreme is.
    """

    def __init__(self, programme: Programme, *, most: int = 400):
        """`most` programmes are solved for each extreme."""
        self.relaxed, self.most = Relaxation(programme), most
        self.found: np.ndarray | None = None
        self.start: list[Rays] = [None] * len(programme.reads)
        self._tighten()

    def narrowed(self, box: np.ndarray) -> "LoadsAtRest":
        """The part of the set in a narrower box, whose cones and limits hold for it too."""
        part = copy.copy(self)
        part.found, part.relaxed = None, self.relaxed.narrowed(box)
        return part

    def extreme(self, cost: np.ndarray, *, first: bool = False, beyond: float = -np.inf) -> Extreme:
        """The largest c^T x, as far as it is beyond a value; with `first` any that is possible."""
        relaxed = self.relaxed
        size = np.abs(cost).max(initial=0.0) or 1.0
        cost, beyond, best, left, solved, order = cost / size, beyond / size, NOTHING, -np.inf, 1, itertools.count()
        relaxed.cuts.clear()
        for planes in relaxed.planes:
            planes.clear()
        if self.found is not None:
            best, solved = relaxed.inner(cost, self.found)
        queue = [_Node.of(relaxed.outer(cost, self.start), self.start, order)]

        def matters(bound: float) -> bool:
            least = max(best.value, beyond)
            return bool(bound > -np.inf and (least == -np.inf or bound > least + _GAP * max(1.0, abs(least))))

        while queue and matters(queue[0].bound) and solved < self.most and not (first and best.x is not None):
            node = heapq.heappop(queue)
            if node.x is not None and (node.number < 8 or node.number % 16 == 0):
                found, steps = relaxed.inner(cost, node.x)
                best, solved = max(best, found, key=_value_of), solved + steps
            if relaxed.leaves(node.found, node.cones):
                solved += 1
                heapq.heappush(queue, _Node.of(relaxed.outer(cost, node.cones), node.cones, order))
                continue
            if self._kept(node.found):
                best = max(best, node.found, key=_value_of)
                continue
            cones = self._split(node.cones, node.found)
            if not cones:
                left = max(left, node.bound)
            for cone in cones:
                found, solved = relaxed.outer(cost, cone), solved + 1
                if matters(found.value):
                    heapq.heappush(queue, _Node.of(found, cone, order))
                else:
                    left = max(left, found.value)
        self.found = best.x
        bound = max([best.value, left, *(node.bound for node in queue)])
        wider = _ROUNDING * max(1.0, abs(bound)) if np.isfinite(bound) and cost.any() else 0.0
        return Extreme(size * best.value, best.x, size * (bound + wider))

    def reach(self, sign: float, x: np.ndarray, end: float) -> float:
        """How far the last unknown, times its sign, goes on from possible loads to an end within what is possible."""
        box, cost, place = self.relaxed.programme.box.copy(), np.zeros(len(x)), sign * x[-1]
        box[-1], cost[-1] = sorted((sign * place, sign * end)), sign
        return max(place, self.relaxed.narrowed(box).inner(cost, x)[0].value)

    def _kept(self, found: Optimum) -> bool:
        """Whether limits are kept where a programme found its largest value, and far out if that has no bound."""
        ways = [(found.x, False), (found.ray, True)][: 1 if np.isfinite(found.value) else 2]
        return all(x is not None and self._keeps(self.relaxed.excess(x, far)) for x, far in ways)

    def _keeps(self, excess: np.ndarray) -> bool:
        return bool(np.all(excess <= self.relaxed.kept))

    def _split(self, cones: list[Rays], found: Optimum) -> list[list[Rays]]:
        """Cones that together hold those of a node, apart where the worst limit is; none if none can be split."""
        own, settled = self.relaxed.own, self._settled
        far = found.ray is not None and not self._keeps(self.relaxed.excess(found.ray, True))
        x = found.ray if far else found.x
        excess = np.full(len(self.start), np.inf) if x is None else self.relaxed.excess(x, far)
        for j in np.argsort(-excess):
            if settled[j] or excess[j] <= self.relaxed.kept[j] or (x is None and cones[j] is not None):
                continue
            if cones[j] is None:
                parts = [np.diag(signs) for signs in itertools.product((1.0, -1.0), repeat=len(own[j].offset))]
            else:
                loads = own[j].along(cast(np.ndarray, x)) if far else own[j](cast(np.ndarray, x))
                parts = _parts(cast(np.ndarray, cones[j]), loads)
            if parts:
                return [[*cones[:j], part, *cones[j + 1 :]] for part in parts]
        return []

    @property
    def _settled(self) -> np.ndarray:
        """Limits that are the same at all loads that are possible."""
        return np.array([not len(own.offset) for own in self.relaxed.own], bool)

    def _tighten(self) -> None:
        """Narrow the loads that each limit depends on, and with them the limits, from the widest."""
        own = self.relaxed.own
        down, up = self.relaxed.programme.limits(np.zeros(len(self.relaxed.programme.read.offset)))[:2]
        constant = self._settled
        self.relaxed.sides[constant] = np.stack([up, down], axis=1)[constant]
        for _ in range(_TIGHTENED):
            ranges = [np.array([self._range(*row) for row in zip(*loads, strict=True)]).reshape(-1, 2) for loads in own]
            if any(np.any(np.isnan(ends)) for ends in ranges):
                return
            before = self.relaxed.sides.copy()
            self._take(ranges)
            if np.all(self.relaxed.sides > 0.9 * before):
                return

    def _range(self, row: np.ndarray, offset: float) -> list[float]:
        """Least and largest row @ x + offset; NaN where nothing is possible."""
        found = [sign * self.relaxed.outer(sign * row, self.start).value for sign in (-1, 1)]
        return [np.nan, np.nan] if found[1] == -np.inf or found[0] == np.inf else [end + offset for end in found]

    def _take(self, ranges: list[np.ndarray]) -> None:
        """Limits and cones of the loads within their ranges: a convex limit is largest at a vertex."""
        for j, own in enumerate(ranges):
            if len(own) == 1 and np.isinf(own).any():
                self.start[j] = _ray(own[0])
            if not len(own) or not np.all(np.isfinite(own)):
                continue
            vertices = np.array(list(itertools.product(*own)))
            self.relaxed.sides[j] = np.minimum(self.relaxed.sides[j], self.relaxed.limits_at(j, vertices).max(axis=0))
            self.start[j] = _cone(vertices)


def _value_of(found: Optimum) -> float:
    return found.value


def _parts(rays: np.ndarray, loads: np.ndarray) -> list[np.ndarray]:
    """A cone, split along loads: each part has these in place of one ray. A single ray is split no more."""
    n = len(loads)
    if n < 2:
        return []
    share = np.maximum(np.linalg.solve(rays, loads), 0.0)
    share = share / share.sum() if share.sum() > 0 else np.full(n, 1 / n)
    share = np.where(share < _EDGE, 0.0, share)
    if np.count_nonzero(share) < 2:  # beside a ray, from where a part of the widest opening is taken
        near = share.argmax()
        share = np.zeros(n)
        share[[near, (rays[:, near] @ rays).argmin()]] = 1 - _EDGE, _EDGE
    ray = rays @ share
    ray = ray / np.linalg.norm(ray)
    return [np.where(np.arange(n) == k, ray[:, None], rays) for k in np.flatnonzero(share)]


def _cone(points: np.ndarray) -> Rays:
    """The narrowest cone that holds the vertices of a box, None where that holds the zero."""
    middle = points.mean(axis=0)
    if points.shape[1] > 2:
        return _simplex_cone(points, middle)
    if points.shape[1] == 1:
        return _ray(np.array([points.min(), points.max()]))
    if np.all(points.min(axis=0) <= 0) and np.all(points.max(axis=0) >= 0):
        return None
    along = middle / np.linalg.norm(middle)
    angle = np.arctan2(along[0] * points[:, 1] - along[1] * points[:, 0], points @ along)
    least, most = angle.min() - _WIDER, angle.max() + _WIDER
    if most - least > _WIDEST:
        return None
    return np.stack([_turned(along, least), _turned(along, most)], axis=1)


def _ray(ends: np.ndarray) -> Rays:
    """The cone of a single load between ends; None if both signs are possible, beyond rounding."""
    least, most = ends
    return np.array([[1.0]]) if least >= -_ROUNDING else np.array([[-1.0]]) if most <= _ROUNDING else None


def _simplex_cone(points: np.ndarray, middle: np.ndarray) -> Rays:
    """A cone about the middle, whose rays are corners of a simplex in a plane square to that; None if it is wide."""
    n, size = len(middle), np.linalg.norm(middle)
    along = middle / (size or 1.0)
    if not np.min(points @ along) > 0:
        return None
    square = np.linalg.svd(along[None])[2][1:]
    reach = np.linalg.norm(points @ square.T, axis=1) / (points @ along)
    radius = (n - 1) * (reach.max() + _WIDER)
    if radius > _FLATTEST:
        return None
    corners = np.linalg.svd(np.eye(n) - 1 / n)[0][:, : n - 1] * np.sqrt(n / (n - 1))  # of a regular simplex, unit
    rays = along[:, None] + radius * square.T @ corners.T
    return rays / np.linalg.norm(rays, axis=0)


def _turned(vector: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]]) @ vector
