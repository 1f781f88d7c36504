"""Self-stress of a model at any position of its joints, in the rows of its mechanism

With G the derivative of the loops by the joints, the loops hold each other by Z with Z^T G = 0. Were a joint free along
one of its rows, the loops would move by c for each unit of it: its load under Z is c^T Z. So all rows have the loads
A Z, in scaled multipliers D A Z, and N is an orthonormal basis of them.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from .._bodies._space._placement import Placement
from .._tools._optional import optional
from ._plan import Link, Plan
from ._tree import End, Loop

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

    def __init__(self, plan: Plan, labels: Sequence[str], scales: np.ndarray | None = None):
        self._plan, self._tree = plan, plan.tree
        self._scales = np.ones(len(labels)) if scales is None else scales
        self._labels = labels
        self._rows = [tuple(label.rpartition(".")[::2]) for label in labels]
        self._parts = {part.name: part for part in (*plan.links, *plan.tree.loops)}
        self._mujoco, model = optional("mujoco", "models"), plan.model
        self._below = np.eye(model.nbody, dtype=bool)  # [a, b]: whether b moves with a
        for body in range(1, model.nbody):
            self._below[:, body] |= self._below[:, model.body_parentid[body]]
        places, loops, first = {}, plan.tree.loops, 0
        for loop in loops:
            places[loop.name], first = first, first + (6 if loop.kind == "weld" else 3)
        self._places = places | {tie.name: first + k for k, tie in enumerate(plan.tree.ties)}
        data = plan.tree.at(model.qpos0)
        self._fixed = {}
        for link in plan.links:
            along = (0.0, 0.0, 1.0) if link.kind in ("ball", "free") else data.xaxis[link.joint].copy()
            axes = np.asarray(Placement(data.xanchor[link.joint].copy(), along).axes)
            self._fixed[link.joint] = self._before(data, link).T @ axes

    def basis(self, positions: np.ndarray, redundancy: int) -> np.ndarray:
        """N at positions of the joints, (rows, redundancy)."""
        slopes = self._tree.system(positions)[1] * self._tree.scale()
        held = np.linalg.svd(slopes)[0][:, slopes.shape[0] - redundancy :]
        data, blocks = self._tree.at(positions), {}
        for part in self._parts.values():
            blocks[part.name] = self._loop(data, part) if isinstance(part, Loop) else self._link(data, part)
        own = [blocks[name][AXES[word]] if name in blocks else self._tie(name) for name, word in self._rows]
        loads = np.array(own).reshape(len(own), -1)
        return np.linalg.qr(self._scales[:, None] * (loads @ held))[0]

    def directions(self, positions: np.ndarray) -> dict[str, np.ndarray]:
        """What the rows of joints and loops are along, global, at positions of the joints."""
        data, axes = self._tree.at(positions), {}
        for part in self._parts.values():
            axes[part.name] = _placed(data, part.first)[1] if isinstance(part, Loop) else self._axes(data, part)
        rows = zip(self._labels, self._rows, strict=True)
        return {label: axes[name][:, AXES[word][1]] for label, (name, word) in rows if word in AXES and name in axes}

    def _link(self, data: Any, link: Link) -> np.ndarray:
        """The loads of loops that forces and moments of a joint along its axes bear, (2, 3, loads)."""
        axes, anchor = self._axes(data, link), self._anchor(data, link)
        body, found = int(self._plan.model.jnt_bodyid[link.joint]), np.zeros((2, 3, self._tree.rows))
        for loop in self._tree.loops:
            for sign, end in ((1.0, loop.first), (-1.0, loop.second)):
                if self._below[body, end.body]:
                    first = self._places[loop.name]
                    x, y, z = _placed(data, end)[0] - anchor
                    found[0, :, first : first + 3] += sign * axes.T
                    found[1, :, first : first + 3] += sign * axes.T @ [[0, -z, y], [z, 0, -x], [-y, x, 0]]
                    if loop.kind == "weld":
                        found[1, :, first + 3 : first + 6] += sign * axes.T
        return found

    def _loop(self, data: Any, loop: Loop) -> np.ndarray:
        """As `_link`, of a loop."""
        found, first = np.zeros((2, 3, self._tree.rows)), self._places[loop.name]
        found[0, :, first : first + 3] = axes = _placed(data, loop.first)[1].T
        if loop.kind == "weld":
            found[1, :, first + 3 : first + 6] = axes
        return found

    def _tie(self, name: str) -> np.ndarray:
        share = np.zeros(self._tree.rows)
        share[self._places[name]] = 1.0
        return share

    def _anchor(self, data: Any, link: Link) -> np.ndarray:
        """The point of a joint on its body, global; of one that slides MuJoCo has it where it began."""
        anchor = data.xanchor[link.joint].copy()
        if link.kind == "slide":
            place = self._plan.model.jnt_qposadr[link.joint]
            anchor += (data.qpos[place] - self._plan.model.qpos0[place]) * data.xaxis[link.joint]
        return anchor

    def _axes(self, data: Any, link: Link) -> np.ndarray:
        return self._before(data, link) @ self._fixed[link.joint]

    def _before(self, data: Any, link: Link) -> np.ndarray:
        """Axes that are fixed to what a joint joins its body to: those of the body, with joints from it on undone."""
        model, mujoco = self._plan.model, self._mujoco
        body = int(model.jnt_bodyid[link.joint])
        axes = data.xmat[body].reshape(3, 3).copy()
        last = int(model.body_jntadr[body] + model.body_jntnum[body]) - 1
        for joint in range(last, link.joint - 1, -1):
            place, kind, turn = int(model.jnt_qposadr[joint]), self._tree.joint_kind(joint), np.zeros(9)
            if kind == "slide":
                continue
            quaternion = np.array([1.0, 0.0, 0.0, 0.0])
            if kind == "hinge":
                angle = float(data.qpos[place] - model.qpos0[place])
                mujoco.mju_axisAngle2Quat(quaternion, model.jnt_axis[joint], angle)
            else:
                first = place + (3 if kind == "free" else 0)
                quaternion = data.qpos[first : first + 4] / np.linalg.norm(data.qpos[first : first + 4])
            mujoco.mju_quat2Mat(turn, quaternion)
            axes = axes @ turn.reshape(3, 3).T
        return axes


def _placed(data: Any, end: End) -> tuple[np.ndarray, np.ndarray]:
    """Point and axes of an end of a loop, global."""
    axes = data.xmat[end.body].reshape(3, 3)
    return data.xpos[end.body] + axes @ end.point, axes @ end.axes


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
