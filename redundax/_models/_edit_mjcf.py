"""Releases in MJCF: a joint more on a body for each direction that is freed, `connect` in place of `weld`, or no loop

The joint more comes before the one it frees, so that its axis is fixed to the parent, as the rows of joints are.
"""

import pathlib
from collections.abc import Iterator, Sequence

import numpy as np

from .._tools._errors import RedundaxError
from .._tools._optional import optional
from ._description import Joint, Loop, unique
from ._edit import Changed, Edit, deleted
from ._kinds import KINDS, TURNS
from ._mjcf import specification
from ._model import Model
from ._mujoco_model import body_ends
from ._mujoco_types import MujocoModel
from ._source import Element, Source, tag_of
from ._stress import AXES

_FREE = {
    "limited": "false",
    "stiffness": "0",
    "damping": "0",
    "springdamper": "0 0",
    "armature": "0",
    "frictionloss": "0",
}
_ANY = ("name", "class", "active", "solref", "solimp")  # attributes of any loop
_OF_JOINTS = ("joint", "tendon")  # equalities that tie joints
_EXACT = 1e-9  # misfit of a weld in the file whose anchor a connect can take over, m or rad


def mjcf_moves(model: Model) -> list[Edit]:
    """What MJCF can say, of the joints and loops of a model."""
    moves = []
    for joint in model.tree.joints:
        for row in KINDS[joint.kind].rows:
            moves.append(Edit((f"{joint.name}.{row}",), joint, "free", model.described.weight_on(joint)))
    for loop in model.tree.loops:
        if loop.kind == "weld" and model.misfits[loop.name] < _EXACT:
            moves.append(Edit(tuple(f"{loop.name}.{row}" for row in TURNS), loop, "point"))
            pair = _alike(model, loop)
            moves += [_coupling(model, loop, pair)] if pair else []
        moves.append(deleted(model, loop))
    return [*moves, *(deleted(model, tie) for tie in model.tree.ties)]


def _alike(model: Model, loop: Loop) -> tuple[int, int] | None:
    """The joints of the bodies that a weld holds, if they move alike: hinges on one axis, or slides along one, on the
    same body."""
    theirs, numbers = model.described.origin.model, [end.body - 1 for end in (loop.first, loop.second)]
    if min(numbers) < 0:
        return None
    joints = [model.tree.joints[number] for number in numbers]
    if [joint.kind for joint in joints] not in (["hinge"] * 2, ["slide"] * 2):
        return None
    if joints[0].parent.body != joints[1].parent.body:
        return None
    if any(theirs.body_jntnum[_body(model, joint)] != 1 or not theirs.joint(_number(joint)).name for joint in joints):
        return None
    along, other = (joint.parent.axes[:, 2] for joint in joints)
    apart = joints[1].parent.point - joints[0].parent.point if joints[0].kind == "hinge" else np.zeros(3)
    turned = np.abs(loop.first.axes.T @ along).max() < 1 - _EXACT  # no row of the weld is along the axis
    if np.abs([np.cross(along, other), np.cross(apart, along)]).max() > _EXACT or turned:
        return None
    return numbers[0], numbers[1]


def _coupling(model: Model, loop: Loop, pair: tuple[int, int]) -> Edit:
    """Of a weld of bodies whose joints are alike: couple these, so that each bears what it bears alone."""
    joint = model.tree.joints[pair[0]]
    kept = int(np.argmax(np.abs(loop.first.axes.T @ joint.parent.axes[:, 2]))) + 3 * (joint.kind == "hinge")
    rows = tuple(f"{loop.name}.{row}" for k, row in enumerate(KINDS["weld"].rows) if k != kept)
    return Edit(rows, loop, "couple", joints=pair)


def mjcf_change(model: Model, edits: Sequence[Edit], file: pathlib.Path) -> Changed:
    """The file of a model with changes; keyframes, which say nothing of joints that are new, are left out."""
    source = Source(model.path)
    told = [_change(source, model, edit) for edit in edits]
    is_longer = any(edit.how == "free" for edit in edits)
    keys = [each for each in source.root.all() if each.tag == "key"] if is_longer else []
    for key in keys:
        source.remove(key)
    notes = [f"It is without {_keyframes(len(keys))} of the file, which count fewer joints."] if keys else []
    every = len(specification(optional("mujoco", "models"), model.path)[0].keys) if is_longer else 0
    if every > len(keys):
        included = _keyframes(every - len(keys))
        notes.append(f"Take {included} out of the included files: they count fewer joints.")
    return Changed({file: source.changed()}, told, " ".join(notes))


def _keyframes(count: int) -> str:
    return f"{count} keyframe{'s' * (count > 1)}"


def _change(source: Source, model: Model, edit: Edit) -> str:
    """Change a file as an edit says, and tell the change in a line."""
    theirs = model.described.origin.model
    if isinstance(edit.target, Joint):
        element = _joint(source, model, edit.target)
        more = tag_of("joint", _freed(source, model, edit.target, edit.rows[0].rpartition(".")[2]))
        _insert(source, element, more)
        body = _body(model, edit.target)
        where = "" if element.get("name") else f" in body {theirs.body(body).name or body}"
        return f"{more} before {source.text(element)}{where}"
    element = _equality(source, model, edit.name)
    if edit.how == "delete" or not isinstance(edit.target, Loop):
        source.remove(element)
        return f"delete {source.text(element)}"
    if edit.how == "couple":
        axes = [model.tree.joints[joint].parent.axes[:, 2] for joint in edit.joints]
        words = {key: text for key, text in element.attributes.items() if key in _ANY}
        words |= {f"joint{k}": theirs.joint(joint).name for k, joint in enumerate(edit.joints, 1)}
        tie = tag_of("joint", words | {"polycoef": f"0 {np.sign(axes[0] @ axes[1]):.0f} 0 0 0"})
        source.put(element.start, tie, element.end)
        return f"{tie} in place of {source.text(element)}"
    kept = {key: text for key, text in element.attributes.items() if key not in ("relpose", "torquescale", "anchor")}
    if "site1" not in kept:
        data = theirs.eq_data[model.described.origin.equalities[edit.name]]
        kept["anchor"] = _numbers(body_ends("weld", 0, 0, data)[0][1])
    point = tag_of("connect", kept)
    source.put(element.start, point, element.end)
    return f"{point} in place of {source.text(element)}"


def _number(joint: Joint) -> int:
    """Of a joint, as MuJoCo counts them."""
    return joint.child.body - 1


def _body(model: Model, joint: Joint) -> int:
    """Of the body of the file that a joint moves, as MuJoCo counts them."""
    return int(model.described.origin.model.jnt_bodyid[_number(joint)])


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


def _freed(source: Source, model: Model, joint: Joint, row: str) -> dict[str, str]:
    """Attributes of the joint that frees a row of another: those of defaults undone, if there may be some."""
    kind, column = AXES[row]
    along = model.described.body(joint.child).axes.T @ joint.parent.axes[:, column]
    point = model.described.origin.model.jnt_pos[_number(joint)]
    elements = list(source.root.all())
    given = {name for each in elements if each.tag == "joint" and _in_defaults(each) for name in each.attributes}
    if "range" in given:
        given.add("limited")
    if any(each.tag == "include" for each in elements):
        given |= {"pos", *_FREE}
    place = {"pos": _numbers(point)} if np.any(point) or "pos" in given else {}
    words = {"name": f"{joint.name} {row}", "type": ("slide", "hinge")[kind], **place, "axis": _numbers(along)}
    return words | {name: text for name, text in _FREE.items() if name in given}


def _in_defaults(element: Element) -> bool:
    return element.parent is not None and (element.parent.tag == "default" or _in_defaults(element.parent))


def _joint(source: Source, model: Model, joint: Joint) -> Element:
    theirs, number, body = model.described.origin.model, _number(joint), _body(model, joint)
    name = theirs.joint(number).name
    bodies = [each for each in source.root.all() if each.tag == "body"]
    if name:
        found = [each for own in bodies for each in _joints(own) if each.get("name") == name]
    else:
        place = number - int(theirs.body_jntadr[body])
        found = [each for own in _same(bodies, theirs, body) for each in [*_joints(own)][place : place + 1]]
    if found:
        return found[0]
    raise RedundaxError(f"The joint '{joint.name}' is not in '{model.path}' itself. Change the file that it includes.")


def _same(bodies: Sequence[Element], theirs: MujocoModel, body: int) -> list[Element]:
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
        pair = [element.get(word, "0" if element.tag in _OF_JOINTS else "world") for word in _ends(element)]
        word = "couple" if element.tag == "joint" else element.tag
        names.append(element.get("name") or f"{word} {' ~ '.join(pair)}")
    for element, own in zip(elements, unique(names, ()), strict=True):
        if own == name:
            return element
    raise RedundaxError(f"The loop '{name}' is not in '{model.path}' itself. Change the file that it includes.")


def _ends(element: Element) -> tuple[str, str]:
    if element.tag in _OF_JOINTS:
        return f"{element.tag}1", f"{element.tag}2"
    return ("site1", "site2") if "site1" in element.attributes else ("body1", "body2")


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{0.0 if abs(value) < 1e-15 else value:.15g}" for value in values)
