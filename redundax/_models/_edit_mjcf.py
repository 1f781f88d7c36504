"""Releases in MJCF: a joint more on a body for each direction that is freed, `connect` in place of `weld`, or no loop

The joint more comes before the one it frees, so that its axis is fixed to the parent, as the rows of joints are.
"""

import pathlib
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from .._bodies._space._placement import Placement
from .._tools._errors import RedundaxError
from .._tools._optional import optional
from ._model import Model
from ._plan import Link
from ._read import specification
from ._source import Element, Source, tag_of
from ._stress import AXES
from ._tree import Loop, root_of, unique

ROWS = {
    "hinge": ("radial_1", "radial_2", "axial", "bend_1", "bend_2"),
    "slide": ("radial_1", "radial_2", "bend_1", "bend_2", "twist"),
    "ball": ("radial_1", "radial_2", "axial"),
    "connect": ("radial_1", "radial_2", "axial"),
    "weld": ("radial_1", "radial_2", "axial", "bend_1", "bend_2", "twist"),
}
TURNS = ("bend_1", "bend_2", "twist")
_FREE = {
    "limited": "false",
    "stiffness": "0",
    "damping": "0",
    "springdamper": "0 0",
    "armature": "0",
    "frictionloss": "0",
}
_ANY = ("name", "class", "active", "solref", "solimp")  # attributes of any loop
_EXACT = 1e-9  # misfit of a weld in the file whose anchor a connect can take over, m or rad


class Edit(NamedTuple):
    """What frees some rows: their names, what is changed, and how.

    - `how`: "free" a direction, a "ball" in place of a hinge, hold a "point" alone, "couple" two joints in place of a
      weld, or "delete".
    - `weight`: the mass that hangs on a joint of the tree; of what closes a loop -1. `joints`: those that are coupled.
    """

    rows: tuple[str, ...]
    target: Link | Loop | str
    how: str
    weight: float = -1.0
    joints: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        """Of what is changed."""
        return self.target if isinstance(self.target, str) else self.target.name


class Written(NamedTuple):
    """The files of a copy, and what else is to be said of it."""

    files: tuple[pathlib.Path, ...]
    note: str = ""


def hanging(model: Model, link: Link) -> float:
    """The mass that a joint of the tree carries."""
    return float(model.tree.model.body_subtreemass[model.tree.model.jnt_bodyid[link.joint]])


def mjcf_moves(model: Model) -> list[Edit]:
    """What MJCF can say, of the joints and loops of a model."""
    moves = []
    for link in model.plan.links:
        for row in ROWS.get(link.kind, ()):
            moves.append(Edit((f"{link.name}.{row}",), link, "free", hanging(model, link)))
    for loop in model.tree.loops:
        if loop.kind == "weld" and model.misfits[loop.name] < _EXACT:
            moves.append(Edit(tuple(f"{loop.name}.{row}" for row in TURNS), loop, "point"))
            pair = _alike(model, loop)
            moves += [_coupling(model, loop, pair)] if pair else []
        moves.append(Edit(tuple(f"{loop.name}.{row}" for row in ROWS[loop.kind]), loop, "delete"))
    for tie in model.tree.ties:
        rows = tuple(row for row in model.mechanism.rows.labels if row.rpartition(".")[0] == tie.name)
        moves.append(Edit(rows, tie.name, "delete"))
    return moves


def _alike(model: Model, loop: Loop) -> tuple[int, int] | None:
    """The joints of the bodies that a weld holds, if they move alike: hinges on one axis, or slides along one, on the
    same body."""
    theirs, data = model.tree.model, model.tree.at(model.tree.model.qpos0)
    bodies = [root_of(theirs, end.body) for end in (loop.first, loop.second)]
    if any(theirs.body_jntnum[body] != 1 for body in bodies):
        return None
    first, second = (int(theirs.body_jntadr[body]) for body in bodies)
    kinds = [model.tree.joint_kind(joint) for joint in (first, second)]
    parents = {root_of(theirs, int(theirs.body_parentid[body])) for body in bodies}
    if kinds not in (["hinge"] * 2, ["slide"] * 2) or len(parents) > 1:
        return None
    if not all(theirs.joint(joint).name for joint in (first, second)):
        return None
    along, other = data.xaxis[first], data.xaxis[second]
    apart = np.cross(data.xanchor[second] - data.xanchor[first], along) if kinds[0] == "hinge" else np.zeros(3)
    turned = np.abs(_frame(model, loop).T @ along).max() < 1 - _EXACT  # no row of the weld is along the axis
    if np.abs([np.cross(along, other), apart]).max() > _EXACT or turned:
        return None
    return first, second


def _frame(model: Model, loop: Loop) -> np.ndarray:
    """Axes of the rows of a loop in the file's position, global."""
    return model.tree.at(model.tree.model.qpos0).xmat[loop.first.body].reshape(3, 3) @ loop.first.axes


def _coupling(model: Model, loop: Loop, pair: tuple[int, int]) -> Edit:
    """Of a weld of bodies whose joints are alike: couple these, so that each bears what it bears alone."""
    along = model.tree.at(model.tree.model.qpos0).xaxis[pair[0]].copy()
    kept = int(np.argmax(np.abs(_frame(model, loop).T @ along))) + 3 * (model.tree.joint_kind(pair[0]) == "hinge")
    rows = tuple(f"{loop.name}.{row}" for k, row in enumerate(ROWS["weld"]) if k != kept)
    return Edit(rows, loop, "couple", joints=pair)


def write_mjcf(model: Model, edits: Sequence[Edit], file: pathlib.Path) -> Written:
    """Write the file of a model with changes; keyframes, which say nothing of joints that are new, are left out."""
    source = Source(model.path)
    for edit in edits:
        _change(source, model, edit)
    is_longer = any(edit.how == "free" for edit in edits)
    keys = [each for each in source.root.all() if each.tag == "key"] if is_longer else []
    for key in keys:
        source.remove(key)
    file.write_bytes(source.changed())
    notes = [f"It is without {_keyframes(keys)} of the file, which count fewer joints."] if keys else []
    included = specification(optional("mujoco", "models"), file)[0].keys if is_longer else []
    notes += [f"Take {_keyframes(included)} out of the included files: they count fewer joints."] if included else []
    return Written((file,), " ".join(notes))


def mjcf_lines(model: Model, edits: Sequence[Edit]) -> list[str]:
    """What to write where, a line for each change; none for what stands in an included file."""
    source, lines = Source(model.path), []
    for edit in edits:
        try:
            lines.append(_change(source, model, edit))
        except ValueError:
            continue
    return lines


def _keyframes(keys: Sequence[Any]) -> str:
    return f"{len(keys)} keyframe{'s' * (len(keys) > 1)}"


def _change(source: Source, model: Model, edit: Edit) -> str:
    """Change a file as an edit says, and tell the change in a line."""
    if isinstance(edit.target, Link):
        element = _joint(source, model, edit.target)
        more = tag_of("joint", _freed(source, model, edit.target, edit.rows[0].rpartition(".")[2]))
        _insert(source, element, more)
        body = int(model.tree.model.jnt_bodyid[edit.target.joint])
        where = "" if element.get("name") else f" in body {model.tree.model.body(body).name or body}"
        return f"{more} before {source.text(element)}{where}"
    element = _equality(source, model, edit.name)
    if edit.how == "delete" or not isinstance(edit.target, Loop):
        source.remove(element)
        return f"delete {source.text(element)}"
    if edit.how == "couple":
        theirs = model.tree.model
        axes = model.tree.at(theirs.qpos0).xaxis[list(edit.joints)]
        words = {key: text for key, text in element.attributes.items() if key in _ANY}
        words |= {f"joint{k}": theirs.joint(joint).name for k, joint in enumerate(edit.joints, 1)}
        tie = tag_of("joint", words | {"polycoef": f"0 {np.sign(axes[0] @ axes[1]):.0f} 0 0 0"})
        source.put(element.start, tie, element.end)
        return f"{tie} in place of {source.text(element)}"
    kept = {key: text for key, text in element.attributes.items() if key not in ("relpose", "torquescale", "anchor")}
    if "site1" not in kept:
        kept["anchor"] = _numbers(edit.target.first.point)
    point = tag_of("connect", kept)
    source.put(element.start, point, element.end)
    return f"{point} in place of {source.text(element)}"


def _insert(source: Source, element: Element, more: str) -> None:
    """Insert an element that is told in the frame of its body; `frame` elements around the place are split."""
    before = element
    while before.parent and before.parent.tag == "frame" and before.parent.children[0] is before:
        before = before.parent
    frames, parent = [], before.parent
    while parent is not None and parent.tag == "frame":
        frames, parent = [parent, *frames], parent.parent
    again = [{name: text for name, text in frame.attributes.items() if name != "name"} for frame in frames]
    opened = [tag_of("frame", attributes, ">") for attributes in again]
    source.put_before(before, "".join(["</frame>" * len(frames), more, *opened]))


def _freed(source: Source, model: Model, link: Link, row: str) -> dict[str, str]:
    """Attributes of the joint that frees a row of another: those of defaults undone, if there may be some."""
    data, theirs = model.tree.at(model.tree.model.qpos0), model.tree.model
    body = int(theirs.jnt_bodyid[link.joint])
    axis = (0.0, 0.0, 1.0) if link.kind == "ball" else data.xaxis[link.joint]
    kind, column = AXES[row]
    along = data.xmat[body].reshape(3, 3).T @ np.asarray(Placement(data.xanchor[link.joint], axis).axes)[:, column]
    point = theirs.jnt_pos[link.joint]
    elements = list(source.root.all())
    given = {name for each in elements if each.tag == "joint" and _in_defaults(each) for name in each.attributes}
    if "range" in given:
        given.add("limited")
    if any(each.tag == "include" for each in elements):
        given |= {"pos", *_FREE}
    place = {"pos": _numbers(point)} if np.any(point) or "pos" in given else {}
    words = {"name": f"{link.name} {row}", "type": ("slide", "hinge")[kind], **place, "axis": _numbers(along)}
    return words | {name: text for name, text in _FREE.items() if name in given}


def _in_defaults(element: Element) -> bool:
    return element.parent is not None and (element.parent.tag == "default" or _in_defaults(element.parent))


def _joint(source: Source, model: Model, link: Link) -> Element:
    theirs = model.tree.model
    name, body = theirs.joint(link.joint).name, int(theirs.jnt_bodyid[link.joint])
    bodies = [each for each in source.root.all() if each.tag == "body"]
    if name:
        found = [joint for each in bodies for joint in _joints(each) if joint.get("name") == name]
    else:
        place = link.joint - int(theirs.body_jntadr[body])
        found = [joint for each in _same(bodies, theirs, body) for joint in [*_joints(each)][place : place + 1]]
    if found:
        return found[0]
    raise RedundaxError(f"The joint '{link.name}' is not in '{model.path}' itself. Change the file that it includes.")


def _same(bodies: Sequence[Element], theirs: Any, body: int) -> list[Element]:
    """The element of a body: by name, or by its place where all bodies of the model stand in the file, as named."""
    if name := theirs.body(body).name:
        return [each for each in bodies if each.get("name") == name]
    written = [(each.get("name"), [joint.get("name") for joint in _joints(each)]) for each in bodies]
    joints: list[list[str]] = [[] for _ in range(theirs.nbody)]
    for joint in range(theirs.njnt):
        joints[theirs.jnt_bodyid[joint]].append(theirs.joint(joint).name)
    read = [(theirs.body(k).name, joints[k]) for k in range(1, theirs.nbody)]
    return [bodies[body - 1]] if written == read else []


def _joints(element: Element) -> Iterator[Element]:
    """Joints of a body, in its frames too, in order."""
    for child in element.children:
        if child.tag in ("joint", "freejoint"):
            yield child
        elif child.tag == "frame":
            yield from _joints(child)


def _equality(source: Source, model: Model, name: str) -> Element:
    elements = [each for each in source.root.all() if each.parent and each.parent.tag == "equality"]
    elements, names = [each for each in elements if each.get("active") != "false" and not _in_defaults(each)], []
    for element in elements:
        pair = [element.get(word, "0" if element.tag == "joint" else "world") for word in _ends(element)]
        word = "couple" if element.tag == "joint" else element.tag
        names.append(element.get("name") or f"{word} {' ~ '.join(pair)}")
    for element, own in zip(elements, unique(names, ()), strict=True):
        if own == name:
            return element
    raise RedundaxError(f"The loop '{name}' is not in '{model.path}' itself. Change the file that it includes.")


def _ends(element: Element) -> tuple[str, str]:
    if element.tag == "joint":
        return "joint1", "joint2"
    return ("site1", "site2") if "site1" in element.attributes else ("body1", "body2")


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{0.0 if abs(value) < 1e-15 else value:.15g}" for value in values)
