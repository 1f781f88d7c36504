"""Self-stress of a model at any position of its joints, in the rows of its mechanism

With G the derivative of the loops by the joints, the loops hold each other by Z with Z^T G = 0. Were a joint free along
one of its rows, the loops would move by c for each unit of it: its load under Z is c^T Z. So all rows have the loads
A Z, in scaled multipliers D A Z, and N is an orthonormal basis of them.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ._description import End, Joint, Loop
from ._loop_rows import LoopRows
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
        slopes = self._tree.system(positions)[1] * self._tree.scale()
        held = np.linalg.svd(slopes)[0][:, slopes.shape[0] - redundancy :]
        poses, rows = self._tree.at(positions), self._tree.rows_of_loops(positions)
        blocks = {}
        for part in (each for each in self._parts.values() if each.kind != "gear joint"):  # whose row is at the teeth
            blocks[part.name] = self._loop(part, rows) if isinstance(part, Loop) else self._joint(poses, part, rows)
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
        if name in blocks:
            return self._along(poses, self._parts[name], word) @ blocks[name][AXES[word][0]]
        share = np.zeros(self._tree.rows)
        share[self._places[name]] = 1.0
        return share

    def _along(self, poses: Poses, part: Joint | Loop, word: str) -> np.ndarray:
        """The direction of a row, global: an axis of the joint on its parent, or the normal of two axes."""
        one, other = (poses.axes(end) for end in _ends(part))
        if word == "twist" and part.kind in ("universal joint", "angle joint"):
            normal = cross(other[:, 2], one[:, 2])
            return normal / np.linalg.norm(normal)
        if word == "twist" and part.kind == "constant-velocity joint":
            middle = one[:, 2] + other[:, 2]
            return middle / np.linalg.norm(middle)
        return one[:, AXES[word][1]]

    def _joint(self, poses: Poses, joint: Joint, rows: Sequence[LoopRows]) -> np.ndarray:
        """The loads of loops that forces and moments of a joint along the axes of the world bear, (2, 3, loads)."""
        found, anchor = np.zeros((2, 3, self._tree.rows)), poses.point(joint.child)
        for loop, own in zip(self._tree.loops, rows, strict=True):
            for sign, end, point in zip((1.0, -1.0), (loop.first, loop.second), own.points, strict=True):
                if self._hung[joint.child.body, end.body]:
                    place = self._places[loop.name]
                    found[0, :, place] += sign * own.forces.T
                    found[1, :, place] += sign * (own.moments + cross(point - anchor, own.forces)).T
        return found

    def _loop(self, loop: Loop, rows: Sequence[LoopRows]) -> np.ndarray:
        """As `_joint`, of a loop, about the point of its second end."""
        found, place = np.zeros((2, 3, self._tree.rows)), self._places[loop.name]
        own = rows[next(k for k, each in enumerate(self._tree.loops) if each is loop)]
        found[0, :, place], found[1, :, place] = own.forces.T, own.moments.T
        return found


def _ends(part: Joint | Loop) -> tuple[End, End]:
    """The end whose axes the rows are in, and the other."""
    return (part.first, part.second) if isinstance(part, Loop) else (part.parent, part.child)


class Along:
    """Bases of the self-stress at the position that an audit is of, the first, and along motions from there."""

    def __init__(self, bases: np.ndarray, places: Sequence[tuple[str, float]]):
        self.bases, self.places = bases, places

    def margins(self, rows: Sequence[int]) -> np.ndarray:
        """At each position, of rows that are freed."""
        own = self.bases[:, list(rows)]
        if own.shape[1] > own.shape[2]:
            return np.zeros(len(own))
        squares = np.linalg.det(own @ own.transpose(0, 2, 1))
        return np.maximum(squares, 0.0) ** (0.5 / max(len(rows), 1))

    def worst(self, rows: Sequence[int]) -> float:
        """The least margin."""
        return float(self.margins(rows).min())

    def freed(self, rows: Sequence[int]) -> "Along":
        """With rows freed."""
        if not len(rows):
            return self
        motions = np.linalg.svd(self.bases[:, list(rows)])[2][:, len(rows) :]
        return Along(self.bases @ motions.transpose(0, 2, 1), self.places)
