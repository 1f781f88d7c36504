"""ASMT, in which FreeCAD's assembly workbench and OndselSolver write an assembly: parts, markers, joints, motions

A line that is indented by one tab more than another belongs to it. A marker is a point and axes in a reference point of
a part, and this in the part; a joint holds marker I to marker J. Numbers have the units of the program that wrote them,
and are taken as SI. After "TimeSeries" stands what a program has stored of a run: a row of numbers a line, of which the
first belongs to no time.

Joints that allow it span a tree from the ground, those with motions first; bodies are moved as little as closing them
asks. The others close loops.
"""

import dataclasses
import pathlib
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from .._bodies._body import GROUND
from .._bodies._space._rotation import quaternion
from .._tools._errors import RedundaxError
from .._tools._words import ended, short
from ._content import not_in_utf8
from ._description import SIZES, WITHOUT, Body, Description, End, Joint, Loop, Motor, Tie, unique
from ._formula import FUNCTIONS, law_of
from ._series import BodySeries, ReactionSeries, Series

FIRST_LINES = (b"freeCAD: 3D CAD with Motion Simulation  by  askoh.com", b"OndselSolver")
_KINDS = {  # of joints that are joints of `_description` or `_loop_rows`, and the value that these count from
    "RevoluteJoint": ("hinge", ""),
    "CylindricalJoint": ("cylindrical joint", ""),
    "TranslationalJoint": ("slide", ""),
    "SphericalJoint": ("ball", ""),
    "UniversalJoint": ("universal joint", ""),
    "PlanarJoint": ("planar joint", "offset"),
    "FixedJoint": ("fixed joint", ""),
    "ConstantVelocityJoint": ("constant-velocity joint", ""),
    "PointInLineJoint": ("point-on-line joint", ""),
    "PointInPlaneJoint": ("point-on-plane joint", "offset"),
    "ParallelAxesJoint": ("parallel-axes joint", ""),
    "SphSphJoint": ("distance joint", "distanceIJ"),
    "AngleJoint": ("angle joint", "theIzJz"),
    "PerpendicularJoint": ("angle joint", ""),
    "NoRotationJoint": ("no-rotation joint", ""),
}
_COUPLINGS = ("GearJoint", "RackPinionJoint", "ScrewJoint")  # of which each holds one row
_CLOSING = {"ball": "connect", "fixed joint": "weld"}  # what joints of a tree are called that close loops
_MOTIONS = {"RotationalMotion": ("RotationZ", "angle"), "TranslationalMotion": ("TranslationZ", "travel")}
_COORDINATES = {("hinge", "angle"): 0, ("slide", "travel"): 0, ("cylindrical joint", "angle"): 0}
_COORDINATES |= {("cylindrical joint", "travel"): 1, ("planar joint", "angle"): 2}
_ALIGNED = ("hinge", "cylindrical joint", "slide", "planar joint", "fixed joint")
_MOVED = 1e-6  # m or rad: more than the digits of a file
_TURNED = 1e-4  # of entries of a rotation matrix: as of files that programs wrote in single precision
_DEEPEST = 60


class Node(NamedTuple):
    """A line of the file, and those that belong to it."""

    text: str
    line: int
    inner: list["Node"]

    def all(self, text: str) -> Iterator["Node"]:
        """Those of its own lines that are a word."""
        return (each for each in self.inner if each.text == text)


class _Frame(NamedTuple):
    """A point and axes."""

    point: np.ndarray
    axes: np.ndarray

    def of(self, other: "_Frame") -> "_Frame":
        """A frame that is given in this one."""
        return _Frame(self.point + self.axes @ other.point, self.axes @ other.axes)

    def back(self) -> "_Frame":
        """The frame in which this one is where all are given."""
        return _Frame(-self.axes.T @ self.point, self.axes.T)


_NONE = _Frame(np.zeros(3), np.eye(3))


class _Held(NamedTuple):
    """A joint of the file: its name, its kind here, the markers that it holds, as part and place, and a value."""

    name: str
    kind: str
    i: tuple[int, _Frame]
    j: tuple[int, _Frame]
    value: float


def read_asmt(path: pathlib.Path) -> Description:
    """What a file of ASMT says."""
    return _Reader(path).description()


class _Reader:
    """A file of ASMT that is being read."""

    def __init__(self, path: pathlib.Path):
        self._path = path
        content = path.read_bytes()
        if wrong := not_in_utf8(content):
            raise self._refuse(f"{wrong}. Save it in UTF-8")
        lines = content.decode("utf-8").splitlines()
        cut = next((k for k, line in enumerate(lines) if line.strip() == "TimeSeries"), len(lines))
        top = self._nodes(lines[1:cut])
        found = [node for node in top if node.text == "Assembly"]
        if len(found) != 1:
            raise self._refuse("has no line `Assembly`, or several. Export it again")
        self._root, self._rows = found[0], lines[cut + 1 :]
        self._notes: list[str] = []
        self._couplings: list[tuple[Node, str, tuple[int, _Frame], tuple[int, _Frame]]] = []
        self._name = self._word(self._root, "Name")
        parts = list(self._only(self._root, "Parts").all("Part"))
        self._parts = [self._word(part, "Name") for part in parts]
        self._markers: dict[str, tuple[int, _Frame]] = {}
        self._poses, self._weights = [_NONE], [(0.0, np.zeros(3), np.zeros((3, 3)))]
        for number, (part, name) in enumerate(zip([self._root, *parts], ["", *self._parts], strict=True)):
            prefix = f"/{self._name}/{name}/" if name else f"/{self._name}/"
            own = self._frame(part) if number else _NONE
            if number:
                self._poses.append(own)
                self._weights.append(self._weight(part))
            elif any(np.abs(got - none).max() > 0 for got, none in zip(self._frame(part), _NONE, strict=True)):
                raise self._refuse(f"moves its assembly `{self._name}` from the origin. Put it there")
            for point in self._only(part, "RefPoints").all("RefPoint"):
                for marker in self._only(point, "Markers").all("Marker"):
                    place = self._frame(point).of(self._frame(marker))
                    self._markers[prefix + self._word(marker, "Name")] = number, place

    def _refuse(self, why: str) -> RedundaxError:
        return RedundaxError(f"Argument `path`: '{self._path}' {ended(why)}")

    def _nodes(self, lines: list[str]) -> list[Node]:
        top: list[Node] = []
        open_at: list[list[Node]] = [top]
        for number, line in enumerate(lines, 2):
            text = line.strip()
            if not text:
                continue
            level = len(line) - len(line.lstrip("\t"))
            if level >= len(open_at) or level > _DEEPEST:
                raise self._refuse(f"is indented too far in line {number}. Export it again")
            node = Node(text, number, [])
            del open_at[level + 1 :]
            open_at[level].append(node)
            open_at.append(node.inner)
        return top

    def _only(self, node: Node, word: str) -> Node:
        found = next(node.all(word), None)
        if found is None:
            raise self._refuse(
                f"has no `{word}` in {short(node.text)} of line {node.line}: is it cut off? Export it again"
            )
        return found

    def _word(self, node: Node, word: str) -> str:
        inner = self._only(node, word).inner
        if len(inner) != 1:
            raise self._refuse(f"has no single `{word}` in {short(node.text)} of line {node.line}. Export it again")
        return inner[0].text

    def _numbers(self, node: Node, count: int) -> np.ndarray:
        try:
            found = np.array([float(word) for word in node.text.split()])
        except ValueError:
            found = np.zeros(0)
        if found.size != count or not np.all(np.abs(found) < 1e30):
            raise self._refuse(f"must have {count} numbers in line {node.line}, but has {short(node.text)}. Correct it")
        return found

    def _values(self, node: Node, word: str, count: int = 1) -> np.ndarray:
        inner = self._only(node, word).inner
        if len(inner) != 1:
            raise self._refuse(f"has no numbers for `{word}` of line {node.line}. Export it again")
        return self._numbers(inner[0], count)

    def _frame(self, node: Node) -> _Frame:
        rows = self._only(node, "RotationMatrix").inner
        axes = np.array([self._numbers(row, 3) for row in rows])
        if axes.shape != (3, 3) or np.abs(axes @ axes.T - np.eye(3)).max() > _TURNED or np.linalg.det(axes) < 0:
            raise self._refuse(f"has no rotation matrix in {short(node.text)} of line {node.line}. Correct it")
        left, _, right = np.linalg.svd(axes)
        return _Frame(self._values(node, "Position3D", 3), left @ right)

    def _weight(self, part: Node) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass, and centre and inertia in the frame of the part."""
        marker = self._only(part, "PrincipalMassMarker")
        place, mass = self._frame(marker), float(self._values(marker, "Mass")[0])
        moments = self._values(marker, "MomentOfInertias", 3)
        if mass < 0 or np.any(moments < 0):
            what = f"the mass {mass:g}" if mass < 0 else f"the inertia {moments.min():g}"
            name = self._word(part, "Name")
            raise self._refuse(f"gives '{name}' {what}. Give a positive number, or 0 for a body that weighs nothing")
        return mass, place.point, place.axes @ np.diag(moments) @ place.axes.T

    def _name_of(self, node: Node) -> str:
        """The name of a joint; its kind where the file gives none."""
        return self._word(node, "Name") if self._only(node, "Name").inner else node.text

    def _marker(self, node: Node, word: str) -> tuple[int, _Frame]:
        name = self._word(node, word)
        if name not in self._markers:
            raise self._refuse(f"holds the marker {short(name)} in line {node.line}, which is none. Correct the name")
        return self._markers[name]

    def _held(self) -> Iterator[_Held]:
        """Joints, and of those that are not taken over a note."""
        for node in self._only(self._only(self._root, "ConstraintSets"), "Joints").inner:
            name = self._name_of(node)
            kind, word = _KINDS.get(node.text, ("", ""))
            if not kind and node.text not in _COUPLINGS:
                self._notes.append(f"{node.text} '{name}' is left out: no joint here is of its kind{WITHOUT}")
                continue
            i, j = (self._marker(node, word) for word in ("MarkerI", "MarkerJ"))
            value = float(self._values(node, word)[0]) if word and any(node.all(word)) else 0.0
            if kind == "angle joint":
                value = np.pi / 2 if node.text == "PerpendicularJoint" else value
                kind = "parallel-axes joint" if abs(np.sin(value)) < _MOVED else kind
            if node.text in _COUPLINGS:
                self._couplings.append((node, name, i, j))
            elif i[0] == j[0]:
                self._notes.append(f"{node.text} '{name}' is left out: both of its markers are on one body")
            else:
                if kind in ("planar joint", "point-on-plane joint"):
                    i, value = (i[0], i[1].of(_Frame(np.array([0.0, 0.0, value]), np.eye(3)))), 0.0
                yield _Held(name, kind, i, j, value)

    def _motions(self) -> list[tuple[str, str, str, Callable[[Any], Any]]]:
        """Name, joint, coordinate and law of each motion."""
        found = []
        for node in self._only(self._only(self._root, "ConstraintSets"), "Motions").inner:
            name, (word, coordinate) = self._word(node, "Name"), _MOTIONS.get(node.text, ("", ""))
            if not word or not any(node.all("MotionJoint")):
                self._notes.append(f"{node.text} '{name}' is left out: it is no motion of a joint{WITHOUT}")
                continue
            text = self._word(node, word)
            law = law_of(text)
            if law is None:
                words = f"numbers, time, pi, signs and {', '.join(FUNCTIONS)}"
                raise self._refuse(f"moves '{name}' by {short(text)}, which is no formula of time. Use {words}")
            found.append((name, self._word(node, "MotionJoint").rpartition("/")[2], coordinate, law))
        return found

    def description(self) -> Description:
        """What the file says."""
        motions, held = self._motions(), list(self._held())
        names = unique([each.name for each in held], ())
        held = [each._replace(name=name) for each, name in zip(held, names, strict=True)]
        driven = {joint for _, joint, _, _ in motions}
        held.sort(key=lambda each: each.name not in driven)
        joints, numbers, loops = self._tree(held)
        end = {body: number for number, body in enumerate(numbers)}
        bodies = [Body.massless(GROUND, np.zeros(3), np.eye(3))]
        body_names = unique([self._parts[body - 1] for body in numbers[1:]], (GROUND,))
        for body, name in zip(numbers[1:], body_names, strict=True):
            pose, (mass, centre, inertia) = self._poses[body], self._weights[body]
            inertia = pose.axes @ inertia @ pose.axes.T
            bodies.append(Body(name, pose.point, pose.axes, mass, pose.point + pose.axes @ centre, inertia))
        closing = [
            Loop(each.name, _CLOSING.get(each.kind, each.kind), *self._ends(each, end), each.value) for each in loops
        ]
        ties = self._screws(joints, numbers)
        joints = self._limited(joints, held, numbers)
        if self._only(self._root, "ForceTorques").inner:
            self._notes.append(f"forces of the file: {len(self._only(self._root, 'ForceTorques').inner)}")
        motors = []
        for name, of, coordinate, law in motions:
            number = next((k for k, joint in enumerate(joints) if joint.name == of), None)
            if number is None or (joints[number].kind, coordinate) not in _COORDINATES:
                self._notes.append(f"motion '{name}' is left out: it is of no joint that a body hangs on")
                continue
            sign = self._sign(joints[number], held, numbers)
            place = _COORDINATES[joints[number].kind, coordinate]
            motors.append(Motor(name, number, place, law if sign > 0 else _reversed(law)))
        rates = np.zeros((len(motors), sum(SIZES[joint.kind][1] for joint in joints)))
        for row, motor in zip(rates, motors, strict=True):
            row[sum(SIZES[joint.kind][1] for joint in joints[: motor.joint]) + motor.coordinate] = 1.0
        gravity = self._numbers(self._only(self._root, "ConstantGravity").inner[0], 3)
        points = [body.centre for body in bodies] + [joint.child.point for joint in joints]
        return Description(
            "ASMT",
            tuple(bodies),
            tuple(joints),
            tuple(closing),
            ties,
            tuple(gravity.tolist()),
            tuple(motor.name for motor in motors),
            lambda positions: rates,
            np.array(points),
            {},
            tuple(self._notes),
            motors=tuple(motors),
            series=self._series(held, [GROUND, *body_names], end),
        )

    @staticmethod
    def _sign(joint: Joint, held: list[_Held], numbers: list[int]) -> int:
        """Of the file's coordinates of a joint, which are those of marker J as marker I sees it."""
        own = next(each for each in held if each.name == joint.name)
        return 1 if own.i[0] == numbers[joint.parent.body] else -1

    def _screws(self, joints: list[Joint], numbers: list[int]) -> tuple[Tie, ...]:
        """Screws as ties of travel and angle of the cylindrical joint that has their axis."""
        ties = []
        for node, name, i, j in self._couplings:
            pair = {i[0], j[0]}
            found = next(
                (
                    k
                    for k, joint in enumerate(joints)
                    if joint.kind == "cylindrical joint"
                    and {numbers[joint.child.body], numbers[joint.parent.body]} == pair
                    and self._is_along(joint, self._global(i))
                ),
                None,
            )
            if node.text != "ScrewJoint" or found is None:
                why = "it needs a cylindrical joint of its axis between its parts" if found is None else ""
                why = why if node.text == "ScrewJoint" else "forces of teeth are not taken over"
                self._notes.append(f"{node.text} '{name}' is left out: {why}{WITHOUT}")
                continue
            per_turn = float(self._values(node, "pitch")[0]) / (2 * np.pi)
            ties.append(Tie(name, found, found, np.array([0.0, per_turn]), (1, 0)))
        return tuple(ties)

    @staticmethod
    def _is_along(joint: Joint, frame: _Frame) -> bool:
        """Whether a marker is on the axis of a joint."""
        axis, apart = joint.parent.axes[:, 2], frame.point - joint.parent.point
        off = np.linalg.norm(np.cross(axis, frame.axes[:, 2])), np.linalg.norm(np.cross(axis, apart))
        return bool(max(off) < _TURNED)

    def _limited(self, joints: list[Joint], held: list[_Held], numbers: list[int]) -> list[Joint]:
        """The same with limits of hinges and slides."""
        ends: dict[str, dict[str, float]] = {}
        for node in (each for part in self._only(self._root, "ConstraintSets").all("Limits") for each in part.inner):
            law = law_of(self._word(node, "Limit"))
            if law is None:
                raise self._refuse(f"has the limit {short(self._word(node, 'Limit'))}, which is no number. Correct it")
            if not self._only(node, "MotionJoint").inner:
                self._notes.append(f"{node.text} '{self._name_of(node)}' is of no joint: it bears no load here")
                continue
            kind = "low" if ">" in self._word(node, "Type") else "high"
            ends.setdefault(self._word(node, "MotionJoint").rpartition("/")[2], {})[kind] = float(law(0.0))
        out = []
        for joint in joints:
            own = ends.pop(joint.name, {}) if joint.kind in ("hinge", "slide") else {}
            low, high = own.get("low", -np.inf), own.get("high", np.inf)
            if own and self._sign(joint, held, numbers) < 0:
                low, high = -high, -low
            out.append(dataclasses.replace(joint, limits=(low, high)) if own else joint)
        for name in ends:
            self._notes.append(f"limits of '{name}', which is no hinge or slide of the tree: they bear no load here")
        return out

    def _global(self, marker: tuple[int, _Frame]) -> _Frame:
        return self._poses[marker[0]].of(marker[1])

    def _ends(self, held: _Held, end: dict[int, int]) -> tuple[End, End]:
        """Both ends of a loop; axes that may point both ways agree."""
        i, j = self._global(held.i), self._global(held.j)
        like = "hinge" if held.kind == "parallel-axes joint" else held.kind
        if like in _ALIGNED:
            j = j._replace(axes=j.axes @ closed(like, i.back().of(j))[2])
        return End(end[held.i[0]], *i), End(end[held.j[0]], *j)

    def _tree(self, held: list[_Held]) -> tuple[list[Joint], list[int], list[_Held]]:
        """Joints that bodies hang on, parts by the numbers of their bodies, and what closes loops."""
        joints, numbers, left = [], [0], list(held)
        while len(numbers) < len(self._poses):
            found = next((e for e in left if e.kind in SIZES and (e.i[0] in numbers) != (e.j[0] in numbers)), None)
            if found is None:
                body = next(k for k in range(len(self._poses)) if k not in numbers)
                pose, name = self._poses[body], unique([f"free {self._parts[body - 1]}"], [each.name for each in held])
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

    def _hung(self, held: _Held, child: tuple[int, _Frame], parent: tuple[int, _Frame], numbers: list[int]) -> Joint:
        """A joint of the tree, with its child put where the joint is closed."""
        on, at = self._global(parent), self._global(child)
        seen = on.back().of(at)
        place, turned, own, reference = closed(held.kind, seen)
        marked = at._replace(axes=at.axes @ own)  # the marker, turned to where axes that may point both ways agree
        there = on.of(_Frame(place, turned))
        move = there.of(marked.back())
        size = max(float(np.abs(move.axes - np.eye(3)).max()), float(np.abs(there.point - at.point).max()))
        if size > _MOVED:
            self._notes.append(f"closing of '{held.name}' moved '{self._parts[child[0] - 1]}' by {size:.2g} (m or rad)")
        self._poses[child[0]] = move.of(self._poses[child[0]])
        ends = End(len(numbers), *there), End(numbers.index(parent[0]), *on)
        return Joint(held.name, held.kind, *ends, reference, reference)

    def _series(self, held: list[_Held], bodies: list[str], end: dict[int, int]) -> Series | None:
        """What is stored of a run; None if nothing is."""
        tables: dict[str, dict[str, np.ndarray]] = {}
        times, table = np.zeros(0), None
        for line in self._rows:
            word, *rest = line.split("\t")
            if word.endswith("Series") or "Series " in word:
                table = tables.setdefault((word.partition(" ")[2] or (rest or [""])[0]).strip(), {})
                continue
            if not line.strip() or word == "Number":
                continue
            row = [text for text in rest if text.strip()]
            try:
                values = np.array([float(text) for text in row[1:]])
            except ValueError as error:
                raise self._refuse(f"has no numbers in the row {short(word)} of its series. Export it again") from error
            if word == "Time":
                times = values
            elif table is not None:
                table[word.strip()] = values
        if not times.size:
            return None

        def three(table: dict[str, np.ndarray], words: str) -> np.ndarray:
            rows = [table.get(word, np.zeros(0)) for word in words.split()]
            if any(row.size != times.size for row in rows):
                raise self._refuse(f"must have {times.size} numbers in the rows {words} of its series. Export it again")
            return np.stack(rows, axis=-1)

        parts, reactions = {}, {}
        for number, name in enumerate(self._parts, 1):
            if table := tables.get(f"/{self._name}/{name}"):
                axes = np.array([_bryant(*angles) for angles in three(table, "Bryantx Bryanty Bryantz")])
                rates = three(table, "VX VY VZ"), three(table, "OmegaX OmegaY OmegaZ")
                parts[bodies[end[number]]] = BodySeries(three(table, "X Y Z"), axes, *rates)
        motions = {
            self._word(node, "Name"): self._word(node, "MotionJoint").rpartition("/")[2]
            for node in self._only(self._only(self._root, "ConstraintSets"), "Motions").inner
            if any(node.all("MotionJoint"))
        }
        for name in [*(each.name for each in held), *motions]:
            own = next((each for each in held if each.name == motions.get(name, name)), None)
            table = tables.get(f"/{self._name}/{name}")
            if own is not None and table:
                wrench = three(table, "FXonI FYonI FZonI"), three(table, "TXonI TYonI TZonI")
                reactions[name] = ReactionSeries(bodies[end[own.i[0]]], own.i[1].point, *wrench)
        return Series(times, parts, reactions)


def closed(kind: str, seen: _Frame) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
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
    angle = float(np.arctan2(axes[1, 0] - axes[0, 1], axes[0, 0] + axes[1, 1]))
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


def _reversed(law: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda t: -law(t)


def _bryant(x: float, y: float, z: float) -> np.ndarray:
    """Axes of a body turned about x, then about y and z of its own."""
    (a, b, c), (p, q, r) = np.cos([x, y, z]), np.sin([x, y, z])
    about_x = np.array([[1, 0, 0], [0, a, -p], [0, p, a]])
    about_y = np.array([[b, 0, q], [0, 1, 0], [-q, 0, b]])
    return about_x @ about_y @ np.array([[c, -r, 0], [r, c, 0], [0, 0, 1]])
