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
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from .._bodies._space._rotation import rotation
from .._tools._words import did_you_mean, short
from ._assembly import NOWHERE, Frame, Held
from ._content import refusal
from ._description import Description, Joint, Place, Tie
from ._reader import AbstractReader, named
from ._sdf_include import Includes, is_true, sdf_document
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
_SQUARE = 1e-3  # of the cosine of the axes of a cross, by which a file of few digits may be off
_HOLDING = re.compile("constraint|joint|bushing|weld|mimic|gear", re.IGNORECASE)
_MIMIC = {"multiplier": 1.0, "offset": 0.0, "reference": 0.0}  # numbers of a joint that mimics another
_DEEPEST = 60  # models in models, and frames on frames


class _Spring(NamedTuple):
    """What acts in a joint: stiffness, where it is free, damping and friction."""

    stiffness: float
    rest: float
    damping: float
    friction: float


class SdfPlace(NamedTuple):
    """Where a joint is: its number among the elements of its kind, the axes of its frame, and whether its child holds
    its parent in the tree."""

    number: int
    axes: np.ndarray
    is_turned: bool


class _Scope:
    """A model: its element, what is named in it, and the models in it."""

    def __init__(self, element: Element, prefix: str, above: "_Scope | None", is_static: bool):
        self.element, self.prefix, self.above = element, prefix, above
        self.is_static = is_static or is_true(element.findtext("static"))
        self.named = {each.get("name", ""): each for each in element if each.tag in ("link", "frame", "joint")}
        self.inner: dict[str, _Scope] = {}
        self.placing: set[str] = set()  # frames of models, which are nowhere while what places them is looked for


def read_sdf(path: pathlib.Path) -> Description:
    """What a file of SDF says."""
    return _Reader(path).description()


class _Reader(AbstractReader):
    """A file of SDF that is being read."""

    form = "SDF"

    def _begin(self, path: pathlib.Path) -> None:
        root = sdf_document(path)
        self._root, worlds = root, list(root.iterfind("world"))
        if len(worlds) > 1:
            raise self._refuse(f"has {len(worlds)} worlds. Leave one of them")
        self._world = worlds[0] if worlds else root
        self._own = list(root.iter("joint"))  # those that stand in the file itself
        included = Includes(path, root)
        self._lost = included.lost
        self._notes += included.notes
        if self._world.find("model") is None:
            if self._lost:
                uri, why = next(iter(self._lost.items()))
                raise self._refuse(f"has no <model> but what it includes, {short(uri)}: {why}. Bring a file of that")
            raise refusal(path, "has no <model>. Name a file with one")
        self._scopes: list[_Scope] = []
        self._scope(self._world, "", None, False, 0)
        self._numbers_of: dict[tuple[int, str], int] = {(id(self._scopes[0]), ""): 0}
        self._axes_of: dict[int, np.ndarray] = {}  # of the frames of joints, by their elements
        for scope in self._scopes:
            for name, element in scope.named.items():
                if element.tag == "link":
                    self._add_link(scope, name, element)

    def _name(self, element: Element) -> str:
        name = (element.get("name") or "").strip()
        if not name:
            raise self._refuse(f"has a <{element.tag}> without a name. Give it one")
        return name

    def _scope(self, element: Element, prefix: str, above: _Scope | None, is_static: bool, depth: int) -> _Scope:
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

    def _number(self, element: Element | None, word: str, default: float) -> float:
        text = None if element is None else element.findtext(word)
        if word in ("lower", "upper") and (text or "").strip().lower() in ("inf", "-inf", "+inf"):
            return float(text or default)
        return default if text is None else float(self._numbers(text, 1, f"<{word}>", np.inf)[0])

    def _frame(self, element: Element) -> Frame:
        """The pose of an element, as it is written."""
        pose = element.find("pose")
        if pose is None or not (pose.text or "").strip():
            return NOWHERE
        is_quaternion = pose.get("rotation_format") == "quat_xyzw"
        values = self._numbers(pose.text, 7 if is_quaternion else 6, f"the pose of '{element.get('name', '')}'")
        if is_quaternion:
            return Frame(values[:3], rotation(values[[6, 3, 4, 5]]))
        angles = np.deg2rad(values[3:]) if is_true(pose.get("degrees")) else values[3:]
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
        hint = did_you_mean(name, [*scope.named, *scope.inner]) or "Correct the name"
        for uri, why in list(self._lost.items())[:1]:
            hint = f"Bring {short(uri)}, which it includes: {why}"
        raise self._refuse(f"names {short(name)} in {what}, which is none. {hint}")

    def _pose_of(self, scope: _Scope, name: str, depth: int = 0) -> Frame:
        """Where something named is, global."""
        if depth > _DEEPEST:
            raise self._refuse(f"has frames that are relative to each other in a ring, as {short(name)}. Correct them")
        if name in ("__model__", ""):
            return self._pose_of_model(scope, depth)
        if name in scope.placing:
            return NOWHERE
        element, own = scope.named[name], self._placed(scope, name, scope.named[name], depth)
        given = _relative_to(element)
        if not given and element.tag == "joint":
            given = (element.findtext("child") or "").strip()
        if not given and element.tag == "frame":
            given = (element.get("attached_to") or "").strip()
        if given == "world":
            return own
        return self._pose_of(*self._lookup(scope, given, f"'{name}'"), depth + 1).of(own)

    def _pose_of_model(self, scope: _Scope, depth: int) -> Frame:
        if scope.above is None or "__model__" in scope.placing:  # the world, or where a frame is in the model
            return NOWHERE
        own, given = self._placed(scope, "__model__", scope.element, depth), _relative_to(scope.element)
        if given == "world":
            return own
        return self._pose_of(*self._lookup(scope.above, given, "a pose"), depth + 1).of(own)

    def _placed(self, scope: _Scope, name: str, element: Element, depth: int) -> Frame:
        """The pose that an element gives; of a model the one with which a frame of it is where the pose says."""
        own, placed = self._frame(element), (element.get("placement_frame") or "").strip()
        if placed:
            scope.placing.add(name)
            own = own.of(self._pose_of(*self._lookup(scope, placed, "a placement"), depth + 1).back())
            scope.placing.remove(name)
        return own

    def _add_link(self, scope: _Scope, name: str, element: Element) -> None:
        self._numbers_of[id(scope), name], whole = 0, f"{scope.prefix}{name}"
        if scope.is_static:
            return
        if is_true(element.findtext("kinematic")):
            self._notes.append(f"motion from outside of '{whole}': it rests where the file has it")
            return
        inertial = element.find("inertial")
        mass, inside = self._number(inertial, "mass", 1.0), NOWHERE if inertial is None else self._frame(inertial)
        given = None if inertial is None else inertial.find("inertia")
        if inertial is None or is_true(inertial.get("auto")):
            self._notes.append(f"mass of '{whole}', which the file does not say: 1 kg and 1 kg m^2 as of SDF")
        moments = {word: self._number(given, word, float(word in ("ixx", "iyy", "izz"))) for word in _MOMENTS}
        if mass < 0 or min(moments[word] for word in ("ixx", "iyy", "izz")) < 0:
            raise self._refuse(f"gives '{whole}' a negative mass or inertia. Give a positive number")
        xx, xy, xz, yy, yz, zz = (moments[word] for word in _MOMENTS)
        inertia = inside.axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ inside.axes.T
        weight = mass, inside.point, inertia if mass else np.zeros((3, 3))
        self._numbers_of[id(scope), name] = self._add(whole, self._pose_of(scope, name), weight)
        if not is_true(element.findtext("gravity", "true")):
            self._carried.append(self._numbers_of[id(scope), name])

    def _link_of(self, scope: _Scope, name: str, what: str, depth: int = 0) -> tuple[_Scope, str]:
        """The link that something named is on."""
        if depth > _DEEPEST:
            raise self._refuse(f"attaches frames to each other in a ring, as {short(name)}. Correct them")
        scope, own = self._lookup(scope, name, what)
        if own in ("__model__", "") and scope.above is None:
            return scope, ""  # of the world itself
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

    def _axis(self, scope: _Scope, joint: Element, frame: Frame, word: str) -> np.ndarray:
        """The direction of an axis, global."""
        xyz = joint.find(f"{word}/xyz")
        if xyz is None:
            return frame.axes @ np.array([0.0, 0.0, 1.0])
        axis = self._numbers(xyz.text, 3, f"an axis of '{joint.get('name')}'")
        if not np.linalg.norm(axis) > 0:
            raise self._refuse(f"gives '{joint.get('name')}' the axis 0 0 0. Give a direction")
        given = (xyz.get("expressed_in") or "").strip()
        is_old = is_true(joint.findtext(f"{word}/use_parent_model_frame"))
        if given == "world":
            axes = np.eye(3)
        elif given or is_old:
            axes = self._pose_of(*self._lookup(scope, given or "__model__", f"an axis of '{joint.get('name')}'")).axes
        else:
            axes = frame.axes
        return axes @ axis / np.linalg.norm(axis)

    def _limits(self, joint: Element) -> tuple[float, float] | None:
        limit = joint.find("axis/limit")
        low, high = self._number(limit, "lower", -np.inf), self._number(limit, "upper", np.inf)
        low, high = (-np.inf if low < -_ENDLESS else low), (np.inf if high > _ENDLESS else high)
        return (low, high) if np.isfinite(low) or np.isfinite(high) else None

    def _spring(self, joint: Element, axis: str) -> _Spring:
        words = "spring_stiffness", "spring_reference", "damping", "friction"
        dynamics = joint.find(f"{axis}/dynamics")
        return _Spring(*(self._number(dynamics, word, 0.0) for word in words))

    def _held(self) -> Iterator[Held]:
        """Joints, with what acts in them and their elements, and of those that are not taken over a note."""
        for scope in self._scopes:
            for element in scope.element.iterfind("joint"):
                name, kind = f"{scope.prefix}{self._name(element)}", _KINDS.get(element.get("type", ""), "")
                ends = [(element.findtext(word) or "").strip() for word in ("parent", "child")]
                if not all(ends):
                    raise self._refuse(f"has no parent or child in the joint '{name}'. Give both")
                place = self._pose_of(scope, self._name(element))
                self._axes_of[id(element)] = place.axes
                axes = [self._axis(scope, element, place, word) for word in ("axis", "axis2")]
                why = "" if kind else f"{element.get('type')} is not taken over"
                if kind == "universal joint" and abs(axes[0] @ axes[1]) > _SQUARE:
                    why = "its two axes are not square"
                if why:
                    self._leave_out(f"joint '{name}'", why)
                    continue
                marks = [Frame(place.point, axes_of(axes[k])) for k in (0, int(kind == "universal joint"))]
                i, j = (self._end(scope, end, mark, f"'{name}'") for end, mark in zip(ends, marks, strict=True))
                if i[0] == j[0]:
                    self._leave_out(f"joint '{name}'", "both of its ends are on one body", constrains=False)
                else:
                    limits = self._limits(element)
                    if limits is not None and kind not in ("hinge", "slide"):
                        self._notes.append(f"limits of '{name}': they bear no load here")
                        limits = None
                    one, other = (self._spring(element, axis) for axis in ("axis", "axis2"))
                    spring = other if kind == "universal joint" and not any(one) else one
                    yield Held(name, kind, i, j, 0.0, limits, (spring, element))
            yield from self._constraints(scope)

    def _constraints(self, scope: _Scope) -> Iterator[Held]:
        """Loops in words of Drake's, and notes of what is not read."""
        for k, element in enumerate(scope.element):
            if element.tag == "drake:ball_constraint":
                name = f"{scope.prefix}ball constraint {k}"
                words = {each.tag.partition("ball_constraint_")[2]: (each.text or "").strip() for each in element}
                ends = []
                for body, point in (("body_A", "p_AP"), ("body_B", "p_BQ")):
                    at = Frame(self._numbers(words.get(point), 3, f"{point} of a ball constraint"), np.eye(3))
                    base = self._pose_of(*self._lookup(scope, words.get(body, ""), f"'{name}'"))
                    ends.append(self._end(scope, words.get(body, ""), base.of(at), f"'{name}'"))
                yield Held(name, "ball", ends[0], ends[1], 0.0, said=(_Spring(0.0, 0.0, 0.0, 0.0), element))
            elif element.tag not in _SILENT and (":" not in element.tag or _HOLDING.search(element.tag)):
                self._leave_out(f"<{element.tag}> of '{scope.element.get('name')}'", "it is not read")
            joins = any(element.find(word) is not None for word in ("child_link", "child_model"))
            if element.tag == "plugin" and joins:
                self._leave_out(f"plugin '{element.get('name')}'", "it joins models")

    def description(self) -> Description:
        """What the file says."""
        held = named(list(self._held()))
        acting, elements = ({each.name: each.said[k] for each in held} for k in (0, 1))
        for each in [each for each in held if elements[each.name].get("type") == "screw"]:
            lead = self._lead(elements[each.name])
            if lead:
                held.append(each._replace(name=f"thread of {each.name}", kind="thread joint", value=-lead))
        assembly = self._assembled(held)
        signs = assembly.signs
        assembly.joints = [_acted(joint, acting.get(joint.name), signs.get(joint.name, 1)) for joint in assembly.joints]
        self._notes += [f"springs, dampers and friction of '{each.name}', which closes a loop" for each in assembly.left
                        if each.name in acting and any(acting[each.name])]  # fmt: skip
        gravity, ties = self._world.findtext("gravity"), tuple(self._ties(assembly.joints, elements, signs))
        return self._described(
            assembly,
            _GRAVITY if gravity is None else self._numbers(gravity, 3, "<gravity>"),
            shapes=sum(1 for _ in self._world.iter("collision")),
            ties=ties,
            origin=self._places(elements, acting, signs),
        )

    def _places(
        self, elements: dict[str, Element], acting: dict[str, _Spring], signs: dict[str, int]
    ) -> dict[str, Place]:
        """Where the joints are, and which of them something acts in or names, by a word of its own."""
        said = {(each.text or "").strip() for each in self._root.iter()}
        for each in self._root.iter():
            said |= {text.strip() for name, text in each.items() if (each.tag, name) != ("joint", "name")}
        found = {}
        for name, element in elements.items():
            if element not in self._own or element.tag != "joint":
                continue
            own = element.get("name")
            is_used = any(acting[name]) or own in said or element.find("axis/mimic") is not None
            is_used |= _KINDS[element.get("type", "")] == "hinge" and element.find("axis") is None
            place = SdfPlace(self._own.index(element), self._axes_of[id(element)], signs.get(name, 1) < 0)
            found[name] = Place(place, is_used or element.get("type") == "screw")
        return found

    def _ties(self, joints: list[Joint], elements: dict[str, Element], signs: dict[str, int]) -> Iterator[Tie]:
        """Joints that mimic others."""
        numbers = {joint.name: k for k, joint in enumerate(joints)}
        for name, element in elements.items():
            if element.find("axis2/mimic") is not None:
                self._leave_out(f"mimic of '{name}'", "it is of a second axis")
            mimic = element.find("axis/mimic")
            if mimic is None:
                continue
            other = f"{name.rpartition('::')[0]}::{mimic.get('joint', '')}".removeprefix("::")
            if other == name:
                raise self._refuse(
                    f"makes the joint '{name}' mimic itself. Name another joint, or take the <mimic> out"
                )
            both = [numbers[each] for each in (name, other) if each in numbers]
            if len(both) < 2 or any(joints[k].kind not in ("hinge", "slide") for k in both):
                self._leave_out(f"mimic of '{name}'", "it is not of two hinges or slides of the tree")
                continue
            slope, offset, start = (self._number(mimic, *each) for each in _MIMIC.items())
            polynomial = signs[name] * np.array([offset - slope * start, signs[other] * slope])
            yield Tie(f"{name} as {other}", ((both[0], 1.0),), ((both[1], 1.0),), polynomial)

    def _lead(self, element: Element) -> float:
        """Travel of a screw by a radian: a pitch is a travel by a turn, the older one an angle by a travel."""
        if element.find("screw_thread_pitch") is not None:
            return self._number(element, "screw_thread_pitch", 1.0) / (2 * np.pi)
        old = self._number(element, "thread_pitch", 1.0)
        if not old:
            raise self._refuse(f"gives '{element.get('name')}' a thread without pitch. Give a number")
        return -1.0 / old


def _relative_to(element: Element) -> str:
    """What an element says its pose is relative to."""
    pose = element.find("pose")
    return "" if pose is None else (pose.get("relative_to") or "").strip()


def _acted(joint: Joint, spring: _Spring | None, sign: int) -> Joint:
    """A joint with what acts in it; positions of a hinge or slide are those of the child as the parent sees it."""
    if spring is None or not any(spring):
        return joint
    if joint.kind not in ("hinge", "slide"):
        return dataclasses.replace(joint, untaken=("spring, damping and friction",))
    return dataclasses.replace(joint, **spring._asdict() | {"rest": np.array([sign * spring.rest])})


_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
