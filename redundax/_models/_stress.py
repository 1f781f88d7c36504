"""Self-stress of a model at any position of its joints, in the rows of its mechanism

With G the derivative of the loops by the joints, the loops hold each other by Z with Z^T G = 0. Were a joint free along
one of its rows, the loops would move by c for each unit of it: its load under Z is c^T Z. So all rows have the loads
A Z, in scaled multipliers D A Z, and N is an orthonormal basis of them.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ._description import Joint, Loop
from ._loop_rows import LoopRows, loop_rows
from ._tree import Poses, Tree
from ._vectors import cross

AXES = {  # of rows: a force, 0, or moment, 1, and the joint's axis that it is along
    "radial_1": (0, 0),
    "radial_2": (0, 1),
    "axial": (0, 2),
    "bend_1": (1, 0),
    "bend_2": (1, 1),
    "twist": (1, 2),
}


_Bearing = tuple[slice, Loop, LoopRows]  # the rows of what bears, its ends, and what it bears by a unit of each row


class Stress:
    """Self-stress of a model: of rows by their names, with scales D, and directions of the rows."""

    def __init__(self, tree: Tree, labels: Sequence[str], scales: np.ndarray | None = None):
        self._tree, self._labels = tree, labels
        self._scales = np.ones(len(labels)) if scales is None else scales
        self._rows = [tuple(label.rpartition(".")[::2]) for label in labels]
        self._parts = {part.name: part for part in (*tree.joints, *tree.loops)}
        counts = [0, *np.cumsum([rows.residual.size for rows in tree.rows_of_loops(tree.reference)]).tolist()]
        self._places = {loop.name: slice(*ends) for loop, ends in zip(tree.loops, pairwise(counts), strict=True)}
        self._places |= {tie.name: slice(counts[-1] + k, counts[-1] + k + 1) for k, tie in enumerate(tree.ties)}
        hung = np.eye(len(tree.description.bodies), dtype=bool)  # [a, b]: whether b moves with a
        for joint in tree.joints:
            hung[:, joint.child.body] |= hung[:, joint.parent.body]
        self._hung = hung

    def basis(self, positions: np.ndarray, redundancy: int) -> np.ndarray:
        """N at positions of the joints, (rows, redundancy)."""
        slopes = self._tree.system(positions)[1] * self._tree.scale
        held = np.linalg.svd(slopes)[0][:, slopes.shape[0] - redundancy :]
        poses, rows = self._tree.at(positions), self._tree.rows_of_loops(positions)
        blocks, bearing = {}, self._bearing(poses, positions, rows)
        for part in (each for each in self._parts.values() if each.kind != "gear joint"):  # whose row is at the teeth
            blocks[part.name] = self._loop(part, rows) if isinstance(part, Loop) else self._joint(poses, part, bearing)
        own = [self._row(poses, blocks, name, word) for name, word in self._rows]
        loads = np.array(own).reshape(len(own), -1)
        return np.linalg.qr(self._scales[:, None] * (loads @ held))[0]

    def directions(self, positions: np.ndarray) -> dict[str, np.ndarray]:
        """What the rows of joints and loops are along, global, at positions of the joints."""
        poses, rows = self._tree.at(positions), zip(self._labels, self._rows, strict=True)
        return {
            label: self._along(poses, self._parts[name], word)
            for label, (name, word) in rows
            if word in AXES and name in self._parts
        }

    def _row(self, poses: Poses, blocks: dict[str, np.ndarray], name: str, word: str) -> np.ndarray:
        if name in blocks and word in AXES:
            return self._along(poses, self._parts[name], word) @ blocks[name][AXES[word][0]]
        share = np.zeros(self._tree.rows)
        share[self._places[name]] = 1.0
        return share

    def _along(self, poses: Poses, part: Joint | Loop, word: str) -> np.ndarray:
        """The direction of a row, global: an axis of the joint on its parent, or the normal of two axes."""
        ends = (part.first, part.second) if isinstance(part, Loop) else (part.parent, part.child)
        one, other = map(poses.axes, ends)
        if word == "twist" and part.kind in ("universal joint", "angle joint"):
            normal = cross(other[:, 2], one[:, 2])
            return normal / np.linalg.norm(normal)
        if word == "twist" and part.kind == "constant-velocity joint":
            middle = one[:, 2] + other[:, 2]
            return middle / np.linalg.norm(middle)
        return one[:, AXES[word][1]]

    def _joint(self, poses: Poses, joint: Joint, bearing: Sequence[_Bearing]) -> np.ndarray:
        """The loads of loops that forces and moments of a joint along the axes of the world bear, (2, 3, loads)."""
        found, anchor = np.zeros((2, 3, self._tree.rows)), poses.point(joint.child)
        for place, loop, own in bearing:
            for sign, end, point in zip((1.0, -1.0), (loop.first, loop.second), own.points, strict=True):
                if self._hung[joint.child.body, end.body]:
                    found[0, :, place] += sign * own.forces.T
                    found[1, :, place] += sign * (own.moments + cross(point - anchor, own.forces)).T
        return found

    def _bearing(self, poses: Poses, positions: np.ndarray, rows: Sequence[LoopRows]) -> list[_Bearing]:
        """What loops bear, and distances that are tied."""
        found = [(self._places[loop.name], loop, own) for loop, own in zip(self._tree.loops, rows, strict=True)]
        for tie, terms in zip(self._tree.ties, self._tree.terms(positions), strict=True):
            for term, weight in terms:
                if isinstance(term, Loop):
                    own = loop_rows(term, poses.frame(term.first), poses.frame(term.second))
                    found.append((self._places[tie.name], term, own._replace(forces=weight * own.forces)))
        return found

    def _loop(self, loop: Loop, rows: Sequence[LoopRows]) -> np.ndarray:
        """As `_joint`, of a loop, about the point of its second end."""
        found, place = np.zeros((2, 3, self._tree.rows)), self._places[loop.name]
        own = rows[next(k for k, each in enumerate(self._tree.loops) if each is loop)]
        found[0, :, place], found[1, :, place] = own.forces.T, own.moments.T
        return found


class Along:
    """Bases of the self-stress at the position that an audit is of, the first, and along motions from there."""

    def __init__(self, bases: np.ndarray, places: Sequence[tuple[str, float]]):
        self.bases, self.places = bases, places

    def margins(self, rows: Sequence[int]) -> np.ndarray:
        """At each position, of rows that are freed."""
        return self._margins(np.array([rows], int))[:, 0]

    def worst(self, rows: Sequence[int]) -> float:
        """The least margin."""
        return float(self.margins(rows).min())

    def worsts(self, blocks: Sequence[Sequence[int]]) -> list[float]:
        """The least margins of several sets of rows, each freed alone."""
        found = np.ones(len(blocks))
        for size in {len(rows) for rows in blocks}:
            alike = [k for k, rows in enumerate(blocks) if len(rows) == size]
            found[alike] = self._margins(np.array([blocks[k] for k in alike], int)).min(axis=0)
        return found.tolist()

    def _margins(self, sets: np.ndarray) -> np.ndarray:
        """At each position of sets of as many rows, (sets, rows): roots of the determinants of their products."""
        (count, size), (positions, _, left) = sets.shape, self.bases.shape
        if size > left:
            return np.zeros((positions, count))
        gram = np.empty((size, size, positions, count))
        for i in range(size):
            for j in range(i + 1):
                one, other = self.bases[:, sets[:, i]], self.bases[:, sets[:, j]]
                gram[i, j] = gram[j, i] = np.einsum("psk,psk->ps", one, other)
        if size == 1:
            squares = gram[0, 0]
        elif size == 2:
            squares = gram[0, 0] * gram[1, 1] - gram[0, 1] ** 2
        else:
            squares = np.linalg.det(gram.transpose(2, 3, 0, 1))
        return np.maximum(squares, 0.0) ** (0.5 / max(size, 1))

    def freed(self, rows: Sequence[int]) -> "Along":
        """With rows freed, one after the other: of the self-stress without it, which a reflection of it to the first
        axis leaves on the others."""
        bases = self.bases
        for row in rows[: bases.shape[2]]:
            v = bases[:, row].copy()
            v[:, 0] += np.copysign(np.linalg.norm(v, axis=1), v[:, 0])
            square = np.einsum("pk,pk->p", v, v)
            along = np.einsum("prk,pk->pr", bases, v) * (2 / np.where(square > 0, square, 1.0))[:, None]
            bases = bases[:, :, 1:] - along[:, :, None] * v[:, None, 1:]
        return Along(bases, self.places)

    def only(self, rows: Sequence[int]) -> "Along":
        """Of some rows alone."""
        return Along(self.bases[:, list(rows)], self.places)
