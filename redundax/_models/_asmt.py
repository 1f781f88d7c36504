"""ASMT, in which FreeCAD's assembly workbench and OndselSolver write an assembly: parts, markers, joints, motions

A line that is indented by one tab more than another belongs to it. A marker is a point and axes in a reference point of
a part, and this in the part; a joint holds marker I to marker J. Numbers have the units of the program that wrote them,
and are taken as SI. After "TimeSeries" stands what a program has stored of a run: a row of numbers a line, of which the
first belongs to no time.

Joints that allow it span a tree from the ground, those with motions first; bodies are moved as little as closing them
asks. The others close loops.
"""

import pathlib
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from .._tools._errors import RedundaxError
from .._tools._numbers import Numeric
from .._tools._words import short
from ._assembly import NOWHERE, Frame, Held
from ._content import not_in_utf8
from ._description import Description, Motor, Place
from ._formula import FUNCTIONS, law_of
from ._kinds import coordinates_of
from ._loop_rows import MOST_TEETH, ROLLED
from ._reader import AbstractReader, named
from ._series import BodySeries, ReactionSeries, Series
from ._vectors import about_fixed_axes, about_z

FIRST_LINES = (b"freeCAD: 3D CAD with Motion Simulation  by  askoh.com", b"OndselSolver", b"FreeCADMbD")
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
    "LineInPlaneJoint": ("point-on-plane joint", "offset"),
    "ParallelAxesJoint": ("parallel-axes joint", ""),
    "SphSphJoint": ("distance joint", "distanceIJ"),
    "AngleJoint": ("angle joint", "theIzJz"),
    "PerpendicularJoint": ("angle joint", ""),
    "NoRotationJoint": ("no-rotation joint", ""),
    "GearJoint": ("gear joint", "radiusI"),
    "RackPinionJoint": ("rack joint", "pitchRadius"),
    "ScrewJoint": ("thread joint", "pitch"),
}
_RODS = {  # of joints between the ends of a rod without mass: what its ends are, on I and on J
    "RevCylJoint": ("cylindrical joint", "hinge"),
    "CylSphJoint": ("cylindrical joint", "ball"),
    "RevRevJoint": ("hinge", "hinge"),
}
_UNREAD = {"CurveCurveContact": "cams, whose curves press each other, are not read"}
WORDS = {kind: word for word, (kind, _) in reversed(_KINDS.items())}  # of kinds of joints
_MOTIONS = {"RotationalMotion": ("RotationZ", "angle"), "TranslationalMotion": ("TranslationZ", "travel")}
_PARALLEL = 1e-6  # sine of an angle: more than the digits of a file
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


def read_asmt(path: pathlib.Path) -> Description:
    """What a file of ASMT says."""
    return _Reader(path).description()


class _Reader(AbstractReader):
    """A file of ASMT that is being read."""

    form = "ASMT"

    def _begin(self, path: pathlib.Path) -> None:
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
        self._name = self._word(self._root, "Name")
        self._markers: dict[str, tuple[int, Frame]] = {}
        if any(np.abs(got - none).max() > 0 for got, none in zip(self._frame(self._root), NOWHERE, strict=True)):
            raise self._refuse(f"moves its assembly `{self._name}` from the origin. Put it there")
        for part in (self._root, *self._only(self._root, "Parts").all("Part")):
            number, prefix = 0, f"/{self._name}/"
            if part is not self._root:
                number = self._add(self._word(part, "Name"), self._frame(part), self._weight(part))
                prefix += f"{self._parts[-1]}/"
            for point in self._only(part, "RefPoints").all("RefPoint"):
                for marker in self._only(point, "Markers").all("Marker"):
                    place = self._frame(point).of(self._frame(marker))
                    self._markers[prefix + self._word(marker, "Name")] = number, place

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

    def _row(self, node: Node, count: int = 3) -> np.ndarray:
        return self._numbers(node.text, count, f"line {node.line}")

    def _values(self, node: Node, word: str, count: int = 1) -> np.ndarray:
        inner = self._only(node, word).inner
        if len(inner) != 1:
            raise self._refuse(f"has no numbers for `{word}` of line {node.line}. Export it again")
        return self._row(inner[0], count)

    def _frame(self, node: Node) -> Frame:
        rows = self._only(node, "RotationMatrix").inner
        axes = np.array([self._row(row) for row in rows])
        if axes.shape != (3, 3) or np.abs(axes @ axes.T - np.eye(3)).max() > _TURNED or np.linalg.det(axes) < 0:
            raise self._refuse(f"has no rotation matrix in {short(node.text)} of line {node.line}. Correct it")
        left, _, right = np.linalg.svd(axes)
        return Frame(self._values(node, "Position3D", 3), left @ right)

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

    def _marker(self, node: Node, word: str) -> tuple[int, Frame]:
        name = self._word(node, word)
        if name not in self._markers:
            raise self._refuse(f"holds the marker {short(name)} in line {node.line}, which is none. Correct the name")
        return self._markers[name]

    def _held(self) -> Iterator[Held]:
        """Joints with their lines, if they may be changed, and of those that are not taken over a note."""
        for node in self._only(self._only(self._root, "ConstraintSets"), "Joints").inner:
            name = self._name_of(node)
            if node.text not in (*_KINDS, *_RODS):
                self._leave_out(f"{node.text} '{name}'", _UNREAD.get(node.text, "no joint here is of its kind"))
                continue
            i, j = (self._marker(node, word) for word in ("MarkerI", "MarkerJ"))
            kind, word = _KINDS.get(node.text, ("", "distanceIJ"))
            value = float(self._values(node, word)[0]) if word and any(node.all(word)) else 0.0
            if i[0] == j[0]:
                self._leave_out(f"{node.text} '{name}'", "both of its markers are on one body", constrains=False)
                continue
            if kind in ("planar joint", "point-on-plane joint"):
                i, value = (i[0], i[1].of(Frame(np.array([0.0, 0.0, value]), np.eye(3)))), 0.0
            if node.text == "LineInPlaneJoint":
                yield Held(f"direction of {name}", "angle joint", i, j, np.pi / 2)
            if kind == "angle joint":
                value = np.pi / 2 if node.text == "PerpendicularJoint" else value
                kind = "parallel-axes joint" if abs(np.sin(value)) < _PARALLEL else kind
            if node.text in _RODS:
                found = self._rod(name, _RODS[node.text], i, j, value)
                why = "its rod has no length"
            else:
                held = Held(name, kind, i, j, value, said=node.line if node.text != "LineInPlaneJoint" else 0)
                held = self._meshed(node, held) if kind in ("gear joint", *ROLLED) else held
                found = [held] if held else []
                why = "its axes do not point the same way, or its sizes are those of a belt, or of no teeth"
            if not found:
                self._leave_out(f"{node.text} '{name}'", why)
            yield from found

    def _rod(
        self, name: str, kinds: tuple[str, str], i: tuple[int, Frame], j: tuple[int, Frame], length: float
    ) -> list[Held]:
        """What is at a distance from an axis, as the ends of a rod that starts square from it; none without length."""
        if not length > 0:
            return []
        on = self._poses[i[0]].of(i[1])
        x, y, z = on.back().of(self._poses[j[0]].of(j[1])).point
        turn = Frame(np.zeros(3), about_fixed_axes(np.array([0.0, 0.0, float(np.arctan2(y, x))])))
        above = Frame(np.array([0.0, 0.0, z if kinds[0] != "hinge" else 0.0]), np.eye(3))
        rod = self._add(f"rod of {name}", on.of(above).of(turn))
        ends = [(rod, Frame(np.array([at, 0.0, 0.0]), np.eye(3))) for at in (0.0, length)]
        return [Held(name, kinds[0], i, ends[0], 0.0), Held(f"far end of {name}", kinds[1], ends[1], j, 0.0)]

    def _meshed(self, node: Node, held: Held) -> Held | None:
        """A gear, rack or thread that is closed where the file has it, by a turn of its markers about their axes."""
        i, j = (self._poses[part].of(at) for part, at in (held.i, held.j))
        seen = i.back().of(j)
        other = float(self._values(node, "radiusJ")[0]) if held.kind == "gear joint" else 1.0
        # FreeCAD writes a belt as gears of which one radius is negative: its forces are not those of teeth.
        if (
            not held.value
            or (held.kind == "gear joint" and not held.value / (other or np.inf) > 0)
            or np.abs(seen.axes[:, 2] - [0.0, 0.0, 1.0]).max() > _TURNED
        ):
            return None
        now = about_z(seen.axes)
        if held.kind == "gear joint":
            ratio = held.value / other
            along = float(np.arctan2(-seen.point[1], -seen.point[0]))  # from J to I
            turns, value = (along, along - now), ratio
            teeth = Fraction(ratio).limit_denominator(MOST_TEETH)
            if not np.linalg.norm(seen.point[:2]) > 0 or abs(float(teeth) - ratio) > _PARALLEL * abs(ratio):
                return None
        else:
            value = held.value if held.kind == "rack joint" else -held.value / (2 * np.pi)
            turns = (0.0, -float(seen.point[ROLLED[held.kind]]) / value - now)
        i, j = (
            (part, at.of(Frame(np.zeros(3), about_fixed_axes(np.array([0.0, 0.0, turn])))))
            for (part, at), turn in zip((held.i, held.j), turns, strict=True)
        )
        return held._replace(i=i, j=j, value=value)

    def _motions(self) -> list[tuple[str, str, str, Callable[[Numeric], Numeric]]]:
        """Name, joint, coordinate and law of each motion."""
        found = []
        for node in self._only(self._only(self._root, "ConstraintSets"), "Motions").inner:
            name, (word, coordinate) = self._word(node, "Name"), _MOTIONS.get(node.text, ("", ""))
            if not word or not any(node.all("MotionJoint")):
                self._leave_out(f"{node.text} '{name}'", "it is no motion of a joint")
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
        motions, held = self._motions(), named(list(self._held()))
        used = {text.rpartition("/")[2] for text in _texts(self._only(self._root, "ConstraintSets"), "MotionJoint")}
        places = {each.name: Place(each.said, each.name in used) for each in held if each.said}
        driven = {joint for _, joint, _, _ in motions}
        held = self._limited(sorted(held, key=lambda each: each.name not in driven))
        assembly = self._assembled(held)
        joints, bodies = assembly.joints, assembly.bodies(self._weights)
        if self._only(self._root, "ForceTorques").inner:
            self._notes.append(f"forces of the file: {len(self._only(self._root, 'ForceTorques').inner)}")
        motors = []
        for name, of, coordinate, law in motions:
            number = next((k for k, joint in enumerate(joints) if joint.name == of), None)
            if number is None or coordinate not in coordinates_of(joints[number].kind):
                self._leave_out(f"motion '{name}'", "it is of no joint that a body hangs on", constrains=False)
                continue
            place = coordinates_of(joints[number].kind).index(coordinate)
            motors.append(Motor(name, number, place, law if assembly.signs[of] > 0 else _reversed(law)))
        try:
            series = self._series(held, [body.name for body in bodies], assembly.ends)
        except RedundaxError as error:  # which an audit needs none of
            series = None
            self._notes.append(f"stored run of a file that {str(error).partition(repr(str(self._path)))[2].strip()}")
        return self._described(
            assembly,
            self._values(self._root, "ConstantGravity", 3),
            [motor[:3] for motor in motors],
            motors=tuple(motors),
            series=series,
            origin=places,
        )

    def _limited(self, held: list[Held]) -> list[Held]:
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
        for each in held:
            own = ends.pop(each.name, {}) if each.kind in ("hinge", "slide") else {}
            limits = own.get("low", -np.inf), own.get("high", np.inf)
            out.append(each._replace(limits=limits) if own else each)
        for name in ends:
            self._notes.append(f"limits of '{name}', which is no hinge or slide: they bear no load here")
        return out

    def _series(self, held: list[Held], bodies: list[str], end: dict[int, int]) -> Series | None:
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
                turns = three(table, "Bryantx Bryanty Bryantz")  # about x, then about y and z of its own
                axes = np.array([about_fixed_axes(-angles).T for angles in turns])
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


def _texts(node: Node, word: str) -> Iterator[str]:
    """What stands under a word anywhere in a node."""
    for each in node.inner:
        yield from (inner.text for inner in each.inner if each.text == word)
        yield from _texts(each, word)


def _reversed(law: Callable[[Numeric], Numeric]) -> Callable[[Numeric], Numeric]:
    return lambda t: -law(t)
