"""Solutions over a grid of self-stress amplitudes, joined to branches.

Every solution at a grid point z has on each side, towards a neighbouring point, one solution that the curve through it
leads to (`_walk`): at the neighbour, or past a fold at z itself. Solutions are the nodes of a graph and these walks its
edges; its connected pieces are the branches. Walks start from all solutions that the search has found, and from those
that walks have found, until no walk is left.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable

import jax
import numpy as np

from .._solution_set import SolutionSet
from ._walk import search_along, walk

_CHUNK = 65536  # searches run at once
_WALKS = 256  # run at once by one program, which compiles for as long as thousands of them run
_LOST = -1


@dataclasses.dataclass(frozen=True)
class Branches:
    """Solutions found; see `SolutionFamily` for `count`, `z`, `branch`, `fold` and `lost`.

    - `tau`: friction, shape (solutions, p).
    """

    count: np.ndarray
    z: np.ndarray
    tau: np.ndarray
    branch: np.ndarray
    fold: np.ndarray
    lost: int


def trace(
    solutions: SolutionSet,
    axes: tuple[np.ndarray, ...],
    factors: np.ndarray,
    proved: bool,
    watch: Callable[[range], Iterable[int]],
) -> Branches:
    """All solutions that are found over the grid; they are taken for one piece where one each is proved."""
    shape = tuple(axis.size for axis in axes)
    points = np.array(list(itertools.product(*axes)), float).reshape(math.prod(shape), len(axes))
    place, tau = _search(solutions, points, factors, watch)
    order, lost = [[(points[k], t, False) for k, t in zip(place, tau, strict=True)]], 0
    if not proved:
        graph = _Graph(solutions, points, shape, place.tolist(), list(tau))
        graph.join(watch)
        place, order, lost = np.array(graph.place, int), graph.pieces(), graph.lost
    rows = [(*row, number) for number, piece in enumerate(order) for row in piece]
    return Branches(
        count=np.bincount(place, minlength=len(points)).reshape(shape),
        z=np.array([row[0] for row in rows]).reshape(len(rows), len(axes)),
        tau=np.array([row[1] for row in rows]).reshape(len(rows), solutions.angular_slips.size),
        branch=np.array([row[3] for row in rows], int),
        fold=np.array([row[2] for row in rows], bool),
        lost=lost,
    )


def _search(
    solutions: SolutionSet, points: np.ndarray, factors: np.ndarray, watch: Callable[[range], Iterable[int]]
) -> tuple[np.ndarray, np.ndarray]:
    """Indices of points and friction there, for every solution that differs."""
    size = max(1, _CHUNK // (1 + len(factors)))
    places, taus = [], []
    for start in watch(range(0, len(points), size)):
        tau, found = search_along(solutions, points[start : start + size], factors)
        at, which = np.nonzero(found)
        places.append(start + at)
        taus.append(tau[at, which])
    return np.concatenate(places), np.concatenate(taus)


class _Graph:
    """Solutions as nodes, by number; `links` leads from (node, axis, side) to the next node and the fold between."""

    def __init__(self, solutions: SolutionSet, points: np.ndarray, shape: tuple[int, ...], place: list, tau: list):
        self.solutions, self.points, self.shape, self.place, self.tau = solutions, points, shape, place, tau
        self.strides = [math.prod(shape[axis + 1 :]) for axis in range(len(shape))]
        self.at: dict[int, list[int]] = {}
        for node, where in enumerate(place):
            self.at.setdefault(where, []).append(node)
        self.links: dict[tuple[int, int, int], tuple[int, tuple | None]] = {}
        self.angular = solutions.angular_slips

    @property
    def lost(self) -> int:
        """Number of walks that ended nowhere."""
        return sum(other == _LOST for other, _ in self.links.values())

    def join(self, watch: Callable[[range], Iterable[int]]) -> None:
        """Walk from every node to all sides."""
        sides: tuple[int, ...] = (1,)  # most downward walks are upward ones of others
        while todo := self._open(sides) or (sides == (1,) and self._open((0, 1))):
            sides = (0, 1)
            for start in watch(range(0, len(todo), _WALKS)):
                self._walk(todo[start : start + _WALKS])

    def _open(self, sides: tuple[int, ...]) -> list[tuple[int, int, int]]:
        """Walks that stay in the grid and are not done."""
        out = []
        for node, where in enumerate(self.place):
            index = np.unravel_index(where, self.shape) if self.shape else ()
            for axis, side in itertools.product(range(len(self.shape)), sides):
                inside = 0 <= index[axis] + 2 * side - 1 < self.shape[axis]
                if inside and (node, axis, side) not in self.links:
                    out.append((node, axis, side))
        return out

    def _walk(self, todo: list[tuple[int, int, int]]) -> None:
        padded = [*todo, *(todo[-1:] * (_WALKS - len(todo)))]
        here = np.array([self.points[self.place[node]] for node, _, _ in padded])
        there = np.array([self.points[self._beside(*step)] for step in padded])
        tau = np.array([self.tau[node] for node, _, _ in padded])
        ends = jax.device_get(walk(self.solutions, tau, here, there - here))
        for k, step in enumerate(todo):
            node, axis, side = step
            where = self._beside(*step) if ends.arrived[k] else self.place[node]
            other = self._node(where, ends.tau[k]) if ends.arrived[k] or ends.returned[k] else _LOST
            fold = (here[k] + ends.fold[k] * (there[k] - here[k]), ends.fold_tau[k], True) if ends.folded[k] else None
            if other in (node, _LOST):
                self.links[step] = (_LOST, None)
                continue
            self.links[step] = (other, fold)
            self.links.setdefault((other, axis, side if where == self.place[node] else 1 - side), (node, fold))

    def _beside(self, node: int, axis: int, side: int) -> int:
        return self.place[node] + (2 * side - 1) * self.strides[axis]

    def _node(self, where: int, tau: np.ndarray) -> int:
        """The node at a point with this friction; a new one if there is none."""
        for node in self.at.get(where, []):
            if self._same(self.tau[node], tau):
                return node
        self.place.append(where)
        self.tau.append(tau)
        self.at.setdefault(where, []).append(len(self.place) - 1)
        return len(self.place) - 1

    def _same(self, one: np.ndarray, other: np.ndarray) -> bool:
        near = 10 * np.finfo(one.dtype).eps ** 0.5
        kinds = [kind for kind in (self.angular, ~self.angular) if kind.any()]
        return all(np.abs(one - other)[kind].max() <= near * np.abs(one[kind]).max() for kind in kinds)

    def pieces(self) -> list[list[tuple]]:
        """Rows (z, tau, fold) of each connected piece; along one axis in the order of the curve."""
        left, out = set(range(len(self.place))), []
        ends = sorted(left, key=lambda node: (len(self._exits(node)) > 1, self.place[node]))
        for node in ends:
            if node in left:
                out.append(self._curve(node, left) if len(self.shape) == 1 else self._piece(node, left))
        return out

    def _exits(self, node: int) -> list[tuple[int, int]]:
        steps = itertools.product(range(len(self.shape)), (1, 0))
        return [step for step in steps if self.links.get((node, *step), (_LOST, None))[0] != _LOST]

    def _row(self, node: int) -> tuple:
        return self.points[self.place[node]], self.tau[node], False

    def _curve(self, node: int, left: set[int]) -> list[tuple]:
        rows, exits = [], self._exits(node)
        side = exits[0][1] if exits else 1
        while node in left:
            left.remove(node)
            rows.append(self._row(node))
            other, fold = self.links.get((node, 0, side), (_LOST, None))
            if other == _LOST:
                break
            rows += [fold] if fold else []
            side = 1 - side if self.place[other] == self.place[node] else side
            node = other
        return rows

    def _piece(self, node: int, left: set[int]) -> list[tuple]:
        nodes, waiting, folds = [], [node], []
        left.discard(node)
        while waiting:
            node = waiting.pop()
            nodes.append(node)
            for step in self._exits(node):
                other, fold = self.links[(node, *step)]
                folds += [fold] if fold and node < other else []
                if other in left:
                    left.discard(other)
                    waiting.append(other)
        return [*(self._row(node) for node in sorted(nodes, key=lambda node: self.place[node])), *folds]
