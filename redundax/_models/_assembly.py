"""Parts held together by joints, each where the file has it: made a tree from the ground, and loops

A joint holds a frame I on one part to a frame J on another. Joints that allow it span a tree from the ground, in the
order in which they come; bodies are moved as little as closing them asks. The others close loops.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .._bodies._body import GROUND
from .._bodies._space._rotation import quaternion
from ._description import CLOSING, Body, End, Joint, Loop, unique
from ._kinds import KINDS
from ._vectors import about_z

_CLOSING = {"ball": "connect", "fixed joint": "weld"}  # what joints of a tree are called that close loops
_ALIGNED = ("hinge", "cylindrical joint", "slide", "planar joint", "fixed joint")
_MOVED = 1e-6  # m or rad: more than the digits of a file


class Frame(NamedTuple):
    """A point and axes."""

    point: np.ndarray
    axes: np.ndarray

    def of(self, other: "Frame") -> "Frame":
        """A frame that is given in this one."""
        return Frame(self.point + self.axes @ other.point, self.axes @ other.axes)

    def back(self) -> "Frame":
        """The frame in which this one is where all are given."""
        return Frame(-self.axes.T @ self.point, self.axes.T)


NOWHERE = Frame(np.zeros(3), np.eye(3))


class Held(NamedTuple):
    """A joint of the file: its name, its kind here, the markers that it holds, as part and place, a value, and of a
    hinge or slide the least and the largest position of J as I sees it."""

    name: str
    kind: str
    i: tuple[int, Frame]
    j: tuple[int, Frame]
    value: float
    limits: tuple[float, float] | None = None
    said: Any = None  # what the reader of the format keeps of it


class Assembly:
    """Parts and the joints between them.

    - `poses`: where the file has the parts, of which the first is the ground; joints of the tree are closed in them.
    - `joints`: of the tree; `numbers`: which part each of its bodies is; `left`: joints that close loops.
    - `signs`: of coordinates of J as I sees it, by names of joints of the tree, which have those of their child as the
      parent sees it.
    - `notes`: what closing has moved, a line each.
    """

    def __init__(self, parts: Sequence[str], poses: Sequence[Frame], held: Sequence[Held]):
        self._parts, self.poses, self.notes = parts, list(poses), []
        self.signs: dict[str, int] = {}
        self.joints, self.numbers, self.left = self._tree(held)
        self.ends = {part: number for number, part in enumerate(self.numbers)}

    def bodies(self, weights: list[tuple[float, np.ndarray, np.ndarray]]) -> tuple[Body, ...]:
        """The bodies of the tree, by mass, centre and inertia of each part in its frame."""
        found = [Body.massless(GROUND, np.zeros(3), np.eye(3))]
        names = unique([self._parts[part - 1] for part in self.numbers[1:]], (GROUND,))
        for part, name in zip(self.numbers[1:], names, strict=True):
            pose, (mass, centre, inertia) = self.poses[part], weights[part]
            inertia = pose.axes @ inertia @ pose.axes.T
            found.append(Body(name, pose.point, pose.axes, mass, pose.point + pose.axes @ centre, inertia))
        return tuple(found)

    def loops(self) -> tuple[Loop, ...]:
        """What closes loops."""
        return tuple(
            Loop(each.name, _CLOSING.get(each.kind, each.kind), *self._loop_ends(each), each.value, each.limits)
            for each in self.left
        )

    def place(self, marker: tuple[int, Frame]) -> Frame:
        """Where a frame of a part is."""
        return self.poses[marker[0]].of(marker[1])

    def _loop_ends(self, held: Held) -> tuple[End, End]:
        """Both ends of a loop; axes that may point both ways agree."""
        i, j = self.place(held.i), self.place(held.j)
        like = "hinge" if held.kind == "parallel-axes joint" else held.kind
        if like in _ALIGNED:
            j = j._replace(axes=j.axes @ closed(like, i.back().of(j))[2])
        return End(self.ends[held.i[0]], *i), End(self.ends[held.j[0]], *j)

    def _tree(self, held: Sequence[Held]) -> tuple[list[Joint], list[int], list[Held]]:
        """Joints that bodies hang on, parts by the numbers of their bodies, and what closes loops."""
        joints, numbers, left = [], [0], list(held)
        while len(numbers) < len(self.poses):
            found = next((e for e in left if _carries(e) and (e.i[0] in numbers) != (e.j[0] in numbers)), None)
            if found is None:
                body = next(k for k in range(len(self.poses)) if k not in numbers)
                pose, name = self.poses[body], unique([f"free {self._parts[body - 1]}"], [each.name for each in held])
                at = np.concatenate([pose.point, np.asarray(quaternion(pose.axes))])
                ends = End(len(numbers), *pose), End(0, *pose)
                joints.append(Joint(name[0], "free", *ends, at, at))
            else:
                left.remove(found)
                ends = (found.j, found.i) if found.i[0] in numbers else (found.i, found.j)
                joints.append(self._hung(found, ends[0], ends[1], numbers))
                body = ends[0][0]
            numbers.append(body)
        return joints, numbers, left

    def _hung(self, held: Held, child: tuple[int, Frame], parent: tuple[int, Frame], numbers: list[int]) -> Joint:
        """A joint of the tree, with its child put where the joint is closed."""
        on, at = self.place(parent), self.place(child)
        seen = on.back().of(at)
        place, turned, own, reference = closed(held.kind, seen)
        marked = at._replace(axes=at.axes @ own)  # the marker, turned to where axes that may point both ways agree
        there = on.of(Frame(place, turned))
        move = there.of(marked.back())
        size = max(float(np.abs(move.axes - np.eye(3)).max()), float(np.abs(there.point - at.point).max()))
        if size > _MOVED:
            self.notes.append(f"{CLOSING}'{held.name}' moved '{self._parts[child[0] - 1]}' by {size:.2g} (m or rad)")
        self.poses[child[0]] = move.of(self.poses[child[0]])
        ends = End(len(numbers), *there), End(numbers.index(parent[0]), *on)
        limits, self.signs[held.name] = held.limits, 1 if parent[0] == held.i[0] else -1
        if limits is not None and self.signs[held.name] < 0:
            limits = -limits[1], -limits[0]
        return Joint(held.name, held.kind, *ends, reference, reference, limits)


def _carries(held: Held) -> bool:
    """Whether a body may hang on a joint."""
    return held.kind in KINDS and KINDS[held.kind].may_carry


def closed(kind: str, seen: Frame) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Where a joint of a kind that is nearest closed has its child, as its parent sees it: point and axes; a turn of
    the child's marker, whose axes may point both ways; and the positions of the joint."""
    point, axes = seen
    if kind in ("ball", "universal joint"):
        if kind == "ball":
            return np.zeros(3), axes, np.eye(3), np.array([1.0, 0.0, 0.0, 0.0])
        z = axes[:, 2] * [1.0, 1.0, 0.0]
        z /= np.linalg.norm(z)
        x = axes[:, 0] - (axes[:, 0] @ z) * z
        x /= np.linalg.norm(x)
        return np.zeros(3), np.stack([x, np.cross(z, x), z], axis=1), np.eye(3), np.zeros(2)
    own = np.diag([1.0, -1.0, -1.0]) if axes[2, 2] < 0 else np.eye(3)
    axes = axes @ own
    angle = about_z(axes)
    if kind in ("slide", "fixed joint"):
        if abs(angle) > np.pi / 2:
            own = own @ np.diag([-1.0, -1.0, 1.0])
        angle = 0.0
    turned = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    x, y, z = point
    places = {
        "hinge": ((0, 0, 0), [angle]),
        "slide": ((0, 0, z), [z]),
        "cylindrical joint": ((0, 0, z), [angle, z]),
        "planar joint": ((x, y, 0), [x, y, angle]),
        "fixed joint": ((0, 0, 0), []),
    }
    place, reference = places[kind]
    return np.array(place, float), turned, own, np.array(reference, float)
