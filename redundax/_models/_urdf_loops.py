"""Loops that stand in a URDF itself: `loop_joint`, `drake:ball_constraint`, joints in `gazebo`, links of two joints

    <loop_joint name type><axis xyz/><link1 link xyz rpy/><link2 link xyz rpy/></loop_joint>
    <drake:ball_constraint> ..._body_A name, ..._body_B name, ..._p_AP value, ..._p_BQ value </drake:ball_constraint>
    <gazebo><joint name type><parent/><child/><pose/><axis><xyz/></axis></joint></gazebo>
    <joint> whose child is that of a joint before

A joint in `gazebo` stands in the frame of its child, and holds of its parent what coincides as the file has them; the
second joint of a link stands in the frame of its parent, and holds of the link what coincides likewise. What of these
is not complete is not read.
"""

from collections.abc import Iterator
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from .._bodies._space._rotation import quaternion
from ._content import numbers_in
from ._vectors import about_fixed_axes, axes_of

_KINDS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "fixed": "weld"}
_KINDS |= {"ball": "connect", "spherical": "connect"}


class Held(NamedTuple):
    """What a loop holds of a link: a point and axes in its frame; both None of what coincides with the other end."""

    link: str
    point: np.ndarray | None = None
    axes: np.ndarray | None = None

    @property
    def turn(self) -> np.ndarray:
        """The axes as a quaternion."""
        return np.asarray(quaternion(np.eye(3) if self.axes is None else self.axes))


class UrdfLoop(NamedTuple):
    """A loop, and the element that says so."""

    element: Element
    name: str
    kind: str
    first: Held
    second: Held


def loops_of(root: Element, links: set[str]) -> list[UrdfLoop]:
    """The loops of a URDF whose links are these and "world"."""
    found = [*_loop_joints(root), *_ball_constraints(root), *_of_gazebo(root), *second_parents(root)]
    known = {*links, "world"}
    return [
        each for each in found if {each.first.link, each.second.link} <= known and each.first.link != each.second.link
    ]


def second_parents(root: Element) -> Iterator[UrdfLoop]:
    """Joints whose child hangs on a joint before."""
    hung: set[str] = set()
    for joint in root.iterfind("joint"):
        parent, child = (_of(joint, end, "link") for end in ("parent", "child"))
        kind, origin = _KINDS.get(joint.get("type", "")), joint.find("origin")
        place = _frame(origin.get("xyz"), origin.get("rpy")) if origin is not None else _frame(None, None)
        axis = _axis(_of(joint, "axis", "xyz") or "1 0 0")
        if child in hung and kind and place is not None and axis is not None:
            point, axes = place
            held = Held(parent, point, axes @ axis)
            yield UrdfLoop(joint, joint.get("name", ""), kind, Held(child), held)
        hung.add(child)


def _loop_joints(root: Element) -> Iterator[UrdfLoop]:
    for element in root.iterfind("loop_joint"):
        ends = [end for end in element if end.tag in ("link1", "link2")]  # the page of Isaac Sim has `link1` twice
        kind, axis = _KINDS.get(element.get("type", "")), _axis(_of(element, "axis", "xyz") or "1 0 0")
        if len(ends) != 2 or kind is None or axis is None or not all(end.get("xyz") for end in ends):
            continue
        held = []
        for end in ends:
            if (place := _frame(end.get("xyz"), end.get("rpy"))) is not None:
                held.append(Held(end.get("link", ""), place[0], place[1] @ axis))
        if len(held) == 2:
            yield UrdfLoop(element, element.get("name", ""), kind, *held)


def _ball_constraints(root: Element) -> Iterator[UrdfLoop]:
    word = "drake:ball_constraint"
    for element in root.iterfind("*"):
        if element.tag != word:
            continue
        inner = {each.tag: each for each in element}
        names = [inner[f"{word}_body_{end}"].get("name", "") for end in "AB" if f"{word}_body_{end}" in inner]
        points = [
            numbers_in(inner[f"{word}_p_{end}"].get("value"), 3) for end in ("AP", "BQ") if f"{word}_p_{end}" in inner
        ]
        if len(names) == len(points) == 2 and all(names) and all(point is not None for point in points):
            held = [Held(name, point, np.eye(3)) for name, point in zip(names, points, strict=True)]
            yield UrdfLoop(element, f"ball_constraint {' ~ '.join(names)}", "connect", *held)


def _of_gazebo(root: Element) -> Iterator[UrdfLoop]:
    for element in root.iterfind("gazebo/joint"):
        kind, xyz = _KINDS.get(element.get("type", "")), element.find("axis/xyz")
        parent, child = ((element.findtext(end) or "").strip() for end in ("parent", "child"))
        pose = numbers_in(element.findtext("pose") or "0 0 0 0 0 0", 6)
        axis = _axis(xyz.text) if xyz is not None and not xyz.attrib else None
        if kind in ("weld", "connect"):
            axis = np.eye(3)
        if kind is None or pose is None or axis is None or not element.get("name"):
            continue
        point, axes = pose[:3], about_fixed_axes(pose[3:])
        yield UrdfLoop(element, element.get("name", ""), kind, Held(parent), Held(child, point, axes @ axis))


def _of(element: Element, child: str, name: str) -> str:
    found = element.find(child)
    return "" if found is None else found.get(name, "")


def _frame(xyz: str | None, rpy: str | None) -> tuple[np.ndarray, np.ndarray] | None:
    point, angles = numbers_in(xyz or "0 0 0", 3), numbers_in(rpy or "0 0 0", 3)
    return None if point is None or angles is None else (point, about_fixed_axes(angles))


def _axis(text: str | None) -> np.ndarray | None:
    """Axes whose z is along a direction."""
    axis = numbers_in(text, 3)
    return None if axis is None or not np.any(axis) else axes_of(axis / np.linalg.norm(axis))
