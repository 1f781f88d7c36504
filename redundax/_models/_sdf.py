"""SDF, in which Gazebo and Drake have models: links, joints, frames, models in models

Poses are relative to frames by name, "relative_to", or to the model; of a joint to its child, of a frame to what it is
attached to. Axes are in the frame of the joint, or in one that `expressed_in` names. Names of models in models are
"model::link". Joints span a tree from the ground; others, as a second joint on a link, close loops.
"""

import dataclasses
import pathlib
import re
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from .._bodies._space._rotation import rotation
from .._tools._errors import RedundaxError
from .._tools._words import did_you_mean, ended, short
from ._assembly import NOWHERE, Assembly, Frame, Held
from ._content import document
from ._description import WITHOUT, Description, Joint, Tie, drive_rates, unique
from ._vectors import about_fixed_axes, axes_of

_KINDS = {
    "revolute": "hinge",
    "continuous": "hinge",
    "prismatic": "slide",
    "ball": "ball",
    "fixed": "fixed joint",
    "universal": "universal joint",
    "revolute2": "universal joint",
    "screw": "cylindrical joint",
}
_SILENT = ("pose", "static", "self_collide", "allow_auto_disable", "enable_wind", "plugin", "gripper", "link", "joint")
_SILENT += ("frame", "model", "include", "description", "author")
_SILENT += ("gravity", "physics", "light", "scene", "gui", "magnetic_field", "atmosphere", "spherical_coordinates")
_SILENT += ("wind", "audio", "state", "road", "population", "sdf", "actor", "material")  # of worlds
_GRAVITY = (0.0, 0.0, -9.8)  # SDF's own, where a file says nothing
_ENDLESS = 1e15  # rad or m: SDF's limits of joints that have none are 1e16
_LARGEST = 1e30  # of a length, and of what a file has of vectors
_SQUARE = 1e-3  # of the cosine of the axes of a cross, by which a file of few digits may be off
_HOLDING = re.compile("constraint|joint|bushing|weld|mimic|gear", re.IGNORECASE)
_DEEPEST = 60  # models in models, and frames on frames


class _Spring(NamedTuple):
    """What acts in a joint: limits of its first coordinate, and stiffness, where it is free, damping and friction."""

    limits: tuple[float, float] | None
    stiffness: float
    rest: float
    damping: float
    friction: float


class _Scope:
    """A model: its element, what is named in it, and the models in it."""

    def __init__(self, element: Any, prefix: str, above: "_Scope | None", is_static: bool):
        self.element, self.prefix, self.above = element, prefix, above
        self.is_static = is_static or (element.findtext("static") or "").strip() in ("1", "true")
        self.named = {each.get("name", ""): each for each in element if each.tag in ("link", "frame", "joint")}
        self.inner: dict[str, _Scope] = {}


def read_sdf(path: pathlib.Path) -> Description:
    """What a file of SDF says."""
    return _Reader(path).description()


class _Reader:
    """A file of SDF that is being read."""

    def __init__(self, path: pathlib.Path):
        self._path = path
        if b"<!DOCTYPE" in path.read_bytes() or b"<!ENTITY" in path.read_bytes():
            raise RedundaxError(
                f"Argument `path`: '{path}' declares a document type or entities, which SDF has none of. Take them out."
            )
        root = document(path)
        worlds = list(root.iterfind("world"))
        if len(worlds) > 1:
            raise self._refuse(f"has {len(worlds)} worlds. Leave one of them")
        self._world = worlds[0] if worlds else root
        if include := next(iter(root.iter("include")), None):
            what = short((include.findtext("uri") or "").strip())
            raise self._refuse(f"includes {what}, another file, which is not read. Print it whole by `gz sdf -p FILE`")
        if self._world.find("model") is None:
            raise RedundaxError(f"Argument `path`: '{path}' has no <model>. Name a file with one.")
        self._notes: list[str] = []
        self._scopes: list[_Scope] = []
        self._scope(self._world, "", None, False, 0)
        self._parts, self._poses, self._weights = [], [NOWHERE], [(0.0, np.zeros(3), np.zeros((3, 3)))]
        self._numbers_of: dict[tuple[int, str], int] = {}
        for scope in self._scopes:
            for name, element in scope.named.items():
                if element.tag == "link":
                    self._add_link(scope, name, element)

    def _refuse(self, why: str) -> RedundaxError:
        return RedundaxError(f"Argument `path`: '{self._path}' {ended(why)}")

    def _name(self, element: Any) -> str:
        name = (element.get("name") or "").strip()
        if not name:
            raise self._refuse(f"has a <{element.tag}> without a name. Give it one")
        return name

    def _scope(self, element: Any, prefix: str, above: _Scope | None, is_static: bool, depth: int) -> _Scope:
        if depth > _DEEPEST:
            raise self._refuse(f"has models in models more than {_DEEPEST} deep. Write it flat")
        scope = _Scope(element, prefix, above, is_static)
        names = [self._name(each) for each in element if each.tag in ("link", "frame", "joint", "model")]
        if twice := [name for name, count in Counter(names).items() if count > 1]:
            raise self._refuse(f"has the name {short(twice[0])} twice in a model. Rename one")
        self._scopes.append(scope)
        several = len(element.findall("model")) > 1 or element.find("joint") is not None
        for each in element.iterfind("model"):
            name = self._name(each)
            within = f"{prefix}{name}::" if above is not None or several else ""
            scope.inner[name] = self._scope(each, within, scope, scope.is_static, depth + 1)
        return scope

    def _numbers(self, text: str | None, count: int, what: str, largest: float = _LARGEST) -> np.ndarray:
        words = (text or "").split()
        try:
            found = np.array([float(word) for word in words])
        except ValueError:
            found = np.zeros(0)
        if found.size != count or not np.all(np.abs(found) < largest):
            raise self._refuse(f"must have {count} numbers in {what}, but has {short(text)}. Correct it")
        return found

    def _number(self, element: Any, word: str, default: float) -> float:
        text = None if element is None else element.findtext(word)
        if text is None or text.strip().lower() in ("inf", "-inf", "+inf"):
            return default if text is None else float(text)
        return float(self._numbers(text, 1, f"<{word}>", np.inf)[0])

    def _frame(self, element: Any) -> Frame:
        """The pose of an element, as it is written."""
        pose = element.find("pose")
        if pose is None or not (pose.text or "").strip():
            return NOWHERE
        is_quaternion = pose.get("rotation_format") == "quat_xyzw"
        values = self._numbers(pose.text, 7 if is_quaternion else 6, f"the pose of '{element.get('name', '')}'")
        if is_quaternion:
            return Frame(values[:3], rotation(values[[6, 3, 4, 5]]))
        angles = np.deg2rad(values[3:]) if pose.get("degrees") in ("1", "true") else values[3:]
        return Frame(values[:3], about_fixed_axes(angles))

    def _lookup(self, scope: _Scope, name: str, what: str) -> tuple[_Scope, str]:
        """The scope and own name of what a name stands for."""
        first, mark, rest = name.partition("::")
        if mark and first in scope.inner:
            return self._lookup(scope.inner[first], rest, what)
        if name in scope.named or name in ("__model__", ""):
            return scope, name
        if name in scope.inner:
            return scope.inner[name], "__model__"
        known = [*scope.named, *scope.inner]
        hint = did_you_mean(name, known)
        raise self._refuse(f"names {short(name)} in {what}, which is none. {hint or 'Correct the name'}")

    def _pose_of(self, scope: _Scope, name: str, depth: int = 0) -> Frame:
        """Where something named is, global."""
        if depth > _DEEPEST:
            raise self._refuse(f"has frames that are relative to each other in a ring, as {short(name)}. Correct them")
        if name in ("__model__", ""):
            return self._pose_of_model(scope, depth)
        element = scope.named[name]
        pose = element.find("pose")
        given = "" if pose is None else (pose.get("relative_to") or "").strip()
        if not given and element.tag == "joint":
            given = (element.findtext("child") or "").strip()
        if not given and element.tag == "frame":
            given = (element.get("attached_to") or "").strip()
        if given == "world":
            return self._frame(element)
        base = self._pose_of(*self._lookup(scope, given, f"'{name}'"), depth + 1)
        return base.of(self._frame(element))

    def _pose_of_model(self, scope: _Scope, depth: int) -> Frame:
        if scope.above is None:  # the world
            return NOWHERE
        pose = scope.element.find("pose")
        given = "" if pose is None else (pose.get("relative_to") or "").strip()
        if placed := (scope.element.get("placement_frame") or "").strip():
            raise self._refuse(f"places a model by its frame {short(placed)}, which is not read. Give the model's pose")
        own = self._frame(scope.element)
        return (
            own if given == "world" else self._pose_of(*self._lookup(scope.above, given, "a pose"), depth + 1).of(own)
        )

    def _add_link(self, scope: _Scope, name: str, element: Any) -> None:
        place = self._pose_of(scope, name)
        self._numbers_of[id(scope), name] = 0 if scope.is_static else len(self._poses)
        if scope.is_static:
            return
        self._poses.append(place)
        self._parts.append(f"{scope.prefix}{name}")
        inertial = element.find("inertial")
        mass, inside = self._number(inertial, "mass", 1.0), NOWHERE if inertial is None else self._frame(inertial)
        given = None if inertial is None else inertial.find("inertia")
        if inertial is None or inertial.get("auto") in ("1", "true"):
            self._notes.append(f"mass of '{self._parts[-1]}', which the file does not say: 1 kg and 1 kg m^2 as of SDF")
        moments = {word: self._number(given, word, float(word in ("ixx", "iyy", "izz"))) for word in _MOMENTS}
        if mass < 0 or min(moments[word] for word in ("ixx", "iyy", "izz")) < 0:
            raise self._refuse(f"gives '{self._parts[-1]}' a negative mass or inertia. Give a positive number")
        xx, xy, xz, yy, yz, zz = (moments[word] for word in _MOMENTS)
        inertia = inside.axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ inside.axes.T
        self._weights.append((mass, inside.point, inertia if mass else np.zeros((3, 3))))

    def _link_of(self, scope: _Scope, name: str, what: str, depth: int = 0) -> tuple[_Scope, str]:
        """The link that something named is on."""
        if depth > _DEEPEST:
            raise self._refuse(f"attaches frames to each other in a ring, as {short(name)}. Correct them")
        scope, own = self._lookup(scope, name, what)
        if own in ("__model__", ""):
            links = [each for each, element in scope.named.items() if element.tag == "link"]
            own = scope.element.get("canonical_link") or (links[0] if links else "")
            if not own and scope.inner:
                return self._link_of(next(iter(scope.inner.values())), "__model__", what, depth + 1)
            return self._link_of(scope, own, what, depth + 1)
        element = scope.named[own]
        if element.tag == "link":
            return scope, own
        further = element.findtext("child") if element.tag == "joint" else element.get("attached_to")
        return self._link_of(scope, (further or "__model__").strip(), what, depth + 1)

    def _end(self, scope: _Scope, name: str, at: Frame, what: str) -> tuple[int, Frame]:
        """A global frame on the part that something named is on."""
        if name == "world":
            return 0, at
        of, link = self._link_of(scope, name, what)
        part = self._numbers_of[id(of), link]
        return part, self._poses[part].back().of(at)  # of the ground global

    def _axis(self, scope: _Scope, joint: Any, frame: Frame, word: str) -> np.ndarray:
        """The direction of an axis, global."""
        xyz = joint.find(f"{word}/xyz")
        if xyz is None:
            return frame.axes @ np.array([0.0, 0.0, 1.0])
        axis = self._numbers(xyz.text, 3, f"an axis of '{joint.get('name')}'")
        if not np.linalg.norm(axis) > 0:
            raise self._refuse(f"gives '{joint.get('name')}' the axis 0 0 0. Give a direction")
        given = (xyz.get("expressed_in") or "").strip()
        is_old = (joint.findtext(f"{word}/use_parent_model_frame") or "").strip() in ("1", "true")
        if given == "world":
            axes = np.eye(3)
        elif given or is_old:
            axes = self._pose_of(*self._lookup(scope, given or "__model__", f"an axis of '{joint.get('name')}'")).axes
        else:
            axes = frame.axes
        return axes @ axis / np.linalg.norm(axis)

    def _spring(self, joint: Any) -> _Spring:
        limit, dynamics = (joint.find(f"axis/{word}") for word in ("limit", "dynamics"))
        low, high = self._number(limit, "lower", -np.inf), self._number(limit, "upper", np.inf)
        low, high = (-np.inf if low < -_ENDLESS else low), (np.inf if high > _ENDLESS else high)
        words = ("spring_stiffness", "spring_reference", "damping", "friction")
        ends = (low, high) if np.isfinite(low) or np.isfinite(high) else None
        return _Spring(ends, *(self._number(dynamics, word, 0.0) for word in words))

    def _held(self) -> Iterator[tuple[Held, _Spring, Any]]:
        """Joints, with what acts in them, and of those that are not taken over a note."""
        for scope in self._scopes:
            for element in scope.element.iterfind("joint"):
                name, kind = f"{scope.prefix}{self._name(element)}", _KINDS.get(element.get("type", ""), "")
                ends = [(element.findtext(word) or "").strip() for word in ("parent", "child")]
                if not all(ends):
                    raise self._refuse(f"has no parent or child in the joint '{name}'. Give both")
                place = self._pose_of(scope, self._name(element))
                axes = [self._axis(scope, element, place, word) for word in ("axis", "axis2")]
                if kind == "universal joint" and abs(axes[0] @ axes[1]) > _SQUARE:
                    kind = ""
                if not kind:
                    self._notes.append(f"joint '{name}' is left out: {element.get('type')} is not taken over{WITHOUT}")
                    continue
                marks = [Frame(place.point, axes_of(axes[k])) for k in (0, int(kind == "universal joint"))]
                i, j = (self._end(scope, end, mark, f"'{name}'") for end, mark in zip(ends, marks, strict=True))
                if i[0] == j[0]:
                    self._notes.append(f"joint '{name}' is left out: both of its ends are on one body")
                else:
                    yield Held(name, kind, i, j, 0.0), self._spring(element), element
            yield from self._constraints(scope)

    def _constraints(self, scope: _Scope) -> Iterator[tuple[Held, _Spring, Any]]:
        """Loops in words of Drake's, and notes of what is not read."""
        none = _Spring(None, 0.0, 0.0, 0.0, 0.0)
        for k, element in enumerate(scope.element):
            if element.tag == "drake:ball_constraint":
                name = f"{scope.prefix}ball constraint {k}"
                words = {each.tag.partition("ball_constraint_")[2]: (each.text or "").strip() for each in element}
                ends = []
                for body, point in (("body_A", "p_AP"), ("body_B", "p_BQ")):
                    at = Frame(self._numbers(words.get(point), 3, f"{point} of a ball constraint"), np.eye(3))
                    base = self._pose_of(*self._lookup(scope, words.get(body, ""), f"'{name}'"))
                    ends.append(self._end(scope, words.get(body, ""), base.of(at), f"'{name}'"))
                yield Held(name, "ball", ends[0], ends[1], 0.0), none, element
            elif element.tag not in _SILENT and (":" not in element.tag or _HOLDING.search(element.tag)):
                of = scope.element.get("name")
                self._notes.append(f"<{element.tag}> of '{of}' is left out: it is not read{WITHOUT}")
            joins = any(element.find(word) is not None for word in ("child_link", "child_model"))
            if element.tag == "plugin" and joins:
                self._notes.append(f"plugin '{element.get('name')}' is left out: it joins models{WITHOUT}")

    def description(self) -> Description:
        """What the file says."""
        found = list(self._held())
        names = unique([held.name for held, _, _ in found], ())
        held = [each._replace(name=name) for (each, _, _), name in zip(found, names, strict=True)]
        acting = {each.name: spring for each, (_, spring, _) in zip(held, found, strict=True)}
        elements = {each.name: element for each, (_, _, element) in zip(held, found, strict=True)}
        assembly = Assembly(self._parts, self._poses, held)
        self._notes += assembly.notes
        joints = [self._acted(assembly, joint, acting.get(joint.name), held) for joint in assembly.joints]
        self._notes += [f"springs, dampers and friction of '{each.name}', which closes a loop" for each in assembly.left
                        if any(acting[each.name][1:])]  # fmt: skip
        signs = {joint.name: assembly.sign(joint, held) for joint in joints if joint.name in acting}
        bodies = assembly.bodies(self._weights)
        shapes = sum(1 for _ in self._world.iter("collision"))
        self._notes += [f"contact of {shapes} shape{'s' * (shapes > 1)}"] if shapes else []
        gravity = self._world.findtext("gravity")
        x, y, z = _GRAVITY if gravity is None else self._numbers(gravity, 3, "<gravity>").tolist()
        points = [body.centre for body in bodies] + [joint.child.point for joint in joints]
        return Description(
            "SDF",
            bodies,
            tuple(joints),
            assembly.loops(),
            tuple(self._ties(joints, elements, signs)),
            (x, y, z),
            (),
            lambda positions: drive_rates(joints, ()),
            np.array(points),
            {},
            tuple(self._notes),
        )

    def _acted(self, assembly: Assembly, joint: Joint, spring: _Spring | None, held: list[Held]) -> Joint:
        """A joint with what acts in it; positions of a hinge or slide are those of the child as the parent sees it."""
        if spring is None or joint.kind not in ("hinge", "slide"):
            return joint
        sign, limits = assembly.sign(joint, held), spring.limits
        if limits is not None and sign < 0:
            limits = -limits[1], -limits[0]
        return dataclasses.replace(
            joint,
            limits=limits,
            rest=np.array([sign * spring.rest]),
            stiffness=spring.stiffness,
            damping=spring.damping,
            friction=spring.friction,
        )

    def _ties(self, joints: list[Joint], elements: dict[str, Any], signs: dict[str, int]) -> Iterator[Tie]:
        """Screws, whose travel follows their angle, and joints that mimic others."""
        numbers = {joint.name: k for k, joint in enumerate(joints)}
        for name, element in elements.items():
            if element.get("type") == "screw":
                if name not in numbers:
                    self._notes.append(f"thread of '{name}' is left out: its joint closes a loop{WITHOUT}")
                    continue
                number, lead = numbers[name], np.array([0.0, self._lead(element)])
                yield Tie(f"thread of {name}", number, number, lead, (1, 0))
            axis = element.find("axis")
            mimic = None if axis is None else axis.find("mimic")
            if mimic is None:
                continue
            other = f"{name.rpartition('::')[0]}::{mimic.get('joint', '')}".removeprefix("::")
            both = [numbers[each] for each in (name, other) if each in numbers]
            if len(both) < 2 or any(joints[k].kind not in ("hinge", "slide") for k in both):
                why = "it is not of two hinges or slides of the tree"
                self._notes.append(f"mimic of '{name}' is left out: {why}{WITHOUT}")
                continue
            ratio = self._number(mimic, "multiplier", 1.0) * signs[name] * signs[other]
            yield Tie(f"{name} as {other}", both[0], both[1], np.array([0.0, ratio]))

    def _lead(self, element: Any) -> float:
        """Travel of a screw by a radian: a pitch is a travel by a turn, the older one an angle by a travel."""
        if element.find("screw_thread_pitch") is not None:
            return self._number(element, "screw_thread_pitch", 1.0) / (2 * np.pi)
        old = self._number(element, "thread_pitch", 1.0)
        if not old:
            raise self._refuse(f"gives '{element.get('name')}' a thread without pitch. Give a number")
        return -1.0 / old


_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
