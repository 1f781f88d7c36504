"""Releases in MJCF: a joint more on a body for each direction that is freed, `connect` in place of `weld`

The joint more comes before the one it frees, so that its axis is fixed to the parent, as the rows of joints are.
"""

import pathlib
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from .._bodies._space._placement import Placement
from .._tools._optional import optional
from ._closed_loops import document
from ._model import Model
from ._plan import Link
from ._tree import Loop, unique

_FREED = {  # rows of joints: the kind and axis of the joint that frees them, and in words
    "radial_1": ("slide", 0, "slide across its axis"),
    "radial_2": ("slide", 1, "slide across its axis"),
    "axial": ("slide", 2, "slide along its axis"),
    "bend_1": ("hinge", 0, "tilt"),
    "bend_2": ("hinge", 1, "tilt"),
    "twist": ("hinge", 2, "turn about its axis"),
}
_ROWS = {
    "hinge": ("radial_1", "radial_2", "axial", "bend_1", "bend_2"),
    "slide": ("radial_1", "radial_2", "bend_1", "bend_2", "twist"),
    "ball": ("radial_1", "radial_2", "axial"),
}
TURNS = ("bend_1", "bend_2", "twist")
_FREE = {"limited": "false", "stiffness": "0", "damping": "0", "armature": "0", "frictionloss": "0"}
_EXACT = 1e-9  # misfit of a weld in the file whose anchor a connect can take over, m or rad


class Edit(NamedTuple):
    """What frees some rows: their names, what is changed, and in words."""

    rows: tuple[str, ...]
    target: Link | Loop | str
    words: str


class Written(NamedTuple):
    """The files of a copy, and what else is to be said of it."""

    files: tuple[pathlib.Path, ...]
    note: str = ""


def mjcf_moves(model: Model) -> list[Edit]:
    """What MJCF can say, of the joints and loops of a model."""
    moves = []
    for link in model.plan.links:
        for row in _ROWS.get(link.kind, ()):
            moves.append(Edit((f"{link.name}.{row}",), link, f"{link.name} may {_FREED[row][2]} ({row})"))
    for loop in model.tree.loops:
        if loop.kind == "weld" and model.misfits[loop.name] < _EXACT:
            rows = tuple(f"{loop.name}.{row}" for row in TURNS)
            moves.append(Edit(rows, loop, f"'{loop.name}' holds a point alone"))
    for tie in model.tree.ties:
        rows = tuple(row for row in model.mechanism.rows.labels if row.rpartition(".")[0] == tie.name)
        moves.append(Edit(rows, tie.name, f"'{tie.name}' is left out"))
    return moves


def write_mjcf(model: Model, edits: Sequence[Edit], file: pathlib.Path) -> Written:
    """Write the file of a model with changes; keyframes, which say nothing of joints that are new, are left out."""
    copy = document(model.path)
    root = copy.getroot()
    for edit in edits:
        if isinstance(edit.target, Link):
            element = _joint(root, model, edit.target)
            parent = _parents(root)[element]
            more = _freed(model, edit.target, edit.rows[0].rpartition(".")[2])
            _insert(root, parent, list(parent).index(element), more)
        else:
            element = _equality(root, model, edit.target if isinstance(edit.target, str) else edit.target.name)
            _loosened(_parents(root)[element], element, edit.target)
    is_longer = any(isinstance(edit.target, Link) for edit in edits)
    keys = [(each, key) for each in root.iter("keyframe") for key in each.iterfind("key")] if is_longer else []
    for parent, key in keys:
        parent.remove(key)
    copy.write(file, encoding="utf-8")
    notes = [f"it is without {_keyframes(keys)} of the file, which count fewer joints."] if keys else []
    included = optional("mujoco", "models").MjSpec.from_file(str(file)).keys if is_longer else []
    notes += [f"take {_keyframes(included)} out of the included files: they count fewer joints."] if included else []
    return Written((file,), " ".join(notes))


def _keyframes(keys: Sequence[Any]) -> str:
    return f"{len(keys)} keyframe{'s' * (len(keys) > 1)}"


def _parents(root: ElementTree.Element) -> dict[ElementTree.Element, ElementTree.Element]:
    return {child: parent for parent in root.iter() for child in parent}


def _insert(root: ElementTree.Element, parent: ElementTree.Element, place: int, more: ElementTree.Element) -> None:
    """Insert an element that is told in the frame of its body; `frame` elements around the place are split."""
    while parent.tag == "frame":
        frame, parent = parent, _parents(root)[parent]
        outer = list(parent).index(frame)
        if place:
            rest = ElementTree.Element("frame", {name: text for name, text in frame.attrib.items() if name != "name"})
            rest[:], frame[place:] = frame[place:], []
            rest.text, rest.tail, frame.tail = frame.text, frame.tail, frame.text
            outer += 1
            parent.insert(outer, rest)
        place = outer
    more.tail = parent[place - 1].tail if place else parent.text
    parent.insert(place, more)


def _freed(model: Model, link: Link, row: str) -> ElementTree.Element:
    """The joint that frees a row of another."""
    data, theirs = model.tree.at(model.tree.model.qpos0), model.tree.model
    body = int(theirs.jnt_bodyid[link.joint])
    axis = (0.0, 0.0, 1.0) if link.kind == "ball" else data.xaxis[link.joint]
    kind, column, _ = _FREED[row]
    along = data.xmat[body].reshape(3, 3).T @ np.asarray(Placement(data.xanchor[link.joint], axis).axes)[:, column]
    point = theirs.jnt_pos[link.joint]
    words = {"name": f"{link.name} {row}", "type": kind, "pos": _numbers(point), "axis": _numbers(along)}
    return ElementTree.Element("joint", words | _FREE)


def _loosened(parent: ElementTree.Element, element: ElementTree.Element, target: Loop | Link | str) -> None:
    """A weld as a connect at the same point; a coupling left out."""
    if not isinstance(target, Loop):
        parent.remove(element)
        return
    element.tag = "connect"
    for name in ("relpose", "torquescale", "anchor"):
        element.attrib.pop(name, None)
    if "site1" not in element.attrib:
        element.set("anchor", _numbers(target.first.point))


def _joint(root: ElementTree.Element, model: Model, link: Link) -> ElementTree.Element:
    theirs = model.tree.model
    name, body = theirs.joint(link.joint).name, int(theirs.jnt_bodyid[link.joint])
    for element in root.iterfind("worldbody//body"):
        joints = list(_joints(element))
        if name:
            found = [child for child in joints if child.get("name") == name]
        else:
            place = link.joint - int(theirs.body_jntadr[body])
            found = joints[place : place + 1] if element.get("name") == theirs.body(body).name else []
        if found:
            return found[0]
    raise ValueError(f"The joint '{link.name}' is not in '{model.path}' itself. Change the file that it includes.")


def _joints(element: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """Joints of a body, in its frames too, in order."""
    for child in element:
        if child.tag in ("joint", "freejoint"):
            yield child
        elif child.tag == "frame":
            yield from _joints(child)


def _equality(root: ElementTree.Element, model: Model, name: str) -> ElementTree.Element:
    elements, names = [each for each in root.iterfind("equality/*") if each.get("active") != "false"], []
    for element in elements:
        pair = [element.get(word, "0" if element.tag == "joint" else "world") for word in _ends(element)]
        word = "couple" if element.tag == "joint" else element.tag
        names.append(element.get("name") or f"{word} {' ~ '.join(pair)}")
    for element, own in zip(elements, unique(names, ()), strict=True):
        if own == name:
            return element
    raise ValueError(f"The loop '{name}' is not in '{model.path}' itself. Change the file that it includes.")


def _ends(element: ElementTree.Element) -> tuple[str, str]:
    if element.tag == "joint":
        return "joint1", "joint2"
    return ("site1", "site2") if "site1" in element.attrib else ("body1", "body2")


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{0.0 if abs(value) < 1e-15 else value:.17g}" for value in values)
