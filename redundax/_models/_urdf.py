"""What of a URDF MuJoCo would misread or drop without a word: names that are not there, and loops

URDF is a tree: each link is the child of one joint at most. Programs close loops by elements of their own, which no
other one reads; these are found by their names, or by naming two links.
"""

import functools
import pathlib
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from xml.etree.ElementTree import Element

import numpy as np

from .._tools._errors import RedundaxError
from .._tools._words import did_you_mean, short
from ._closed_loops import add_closed_loops, add_drives, list_under, loops_in, transmissions
from ._content import document, refusal
from ._description import WITHOUT, Description
from ._mjcf import by_mujoco
from ._mujoco_types import MujocoSpec
from ._sdf_include import is_true
from ._urdf_loops import loops_of, second_parents

_KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_SINGLE = ("revolute", "continuous", "prismatic")
_READ = {  # by MuJoCo: elements, and what of them
    "link": ("inertial", "visual", "collision"),
    "joint": ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic", "calibration", "safety_controller"),
}
_FREE = ("material", "mujoco", "transmission", "sensor", "soft_body", "frame", "fixed_frame")  # of loops
_FREE += ("passive_joint", "virtual_joint", "group", "group_state", "chain", "end_effector")
_FREE += ("disable_collisions", "collision_filter_group")
_GROUND = "world"  # a link of this name is the ground
_HOLDING = ("gazebo", "ros2_control", "plugin")  # of much else
_LOOPS = re.compile("mimic|loop|constraint|closure|weld|coupl|gearbox|bushing|attach", re.IGNORECASE)
_JOINTS = re.compile(f"joint|hinge|pivot|screw|{_LOOPS.pattern}", re.IGNORECASE)


def closures_of(path: pathlib.Path, given: str | pathlib.Path | None) -> pathlib.Path | None:
    """The file of the loops of a URDF: the one given, or that beside it, if there is one."""
    if path.suffix.lower() != ".urdf":
        if given is None:
            return None
        raise RedundaxError(
            f"Argument `closures` must be left out for '{path}': it gives loops to a URDF alone. Write loops in the "
            "file itself."
        )
    if given is not None:
        return pathlib.Path(given)
    beside = [path.with_suffix(ending) for ending in (".yaml", ".yml")]
    return next((file for file in beside if file.is_file()), None)


def read_urdf(path: pathlib.Path, closures: pathlib.Path | None) -> Description:
    """What a URDF says, with the file of its loops."""
    root = document(path)
    check_urdf(path, root)
    given = {} if closures is None else loops_in(closures)
    pairs = [list(map(str, pair)) for pair in list_under(given, "closed_loop") if isinstance(pair, list)]
    own = loops_of(root, {link.get("name", "") for link in root.iterfind("link")})
    held_by = _carriers(_joints(root))
    beside = [{held_by.get(name, name) for name in pair} for pair in pairs]
    own = [loop for loop in own if {held_by.get(end.link, end.link) for end in (loop.first, loop.second)} not in beside]
    closed = []
    for k, loop in enumerate(own):
        one, two = (f"{loop.name} at {end.link} {k}" for end in (loop.first, loop.second))
        closed.append((loop.name, loop.kind, one, two, loop.first.point is None))

    def changed(spec: MujocoSpec) -> list[str]:
        notes = [] if closures is None else add_closed_loops(spec, path, closures)
        for loop, (_, _, one, two, _) in zip(own, closed, strict=True):
            for end, name in ((loop.first, one), (loop.second, two)):
                body = spec.body(end.link) or spec.worldbody
                body.add_site(name=name, pos=np.zeros(3) if end.point is None else end.point, quat=end.turn)
        for name in _lifted(root):
            if (body := spec.body(name)) is not None:
                body.gravcomp = 1.0
        notes += unread(path, root, pairs, [loop.element for loop in own])
        return notes + (add_drives(spec, transmissions(path)) if not spec.actuators else [])

    twice = [loop.name for loop in own if loop.element in list(root) and loop.element.tag == "joint"]
    return by_mujoco("URDF", path, changed, closed, twice)


def check_urdf(path: pathlib.Path, root: Element) -> None:
    """Refuse a URDF whose names do not fit, or that is no tree, and say how its loop is given."""
    refuse = functools.partial(refusal, path)
    _check_expanded(root, refuse)
    links = [each.get("name", "") for each in root.iterfind("link")]
    for what in ("link", "joint"):
        (name, count), *_ = Counter(each.get("name", "") for each in root.iterfind(what)).most_common(1) or [("", 0)]
        if count > 1:
            raise refuse(f"has {count} {what}s called {short(name)}. Rename them")
    joints, known = _joints(root), {*links, _GROUND}
    parent_of: dict[str, tuple[str, str]] = {}
    second = [loop.element for loop in second_parents(root)]
    for joint in root.iterfind("joint"):
        name, kind, what = joint.get("name", ""), joint.get("type", ""), f"has the joint {short(joint.get('name', ''))}"
        if kind not in _KINDS:
            ball = "A ball joint is a continuous one that a file of closures replaces by SPHERICAL. "
            raise refuse(
                f"{what} of type {short(kind)}. {did_you_mean(kind, _KINDS) or ball}URDF has {', '.join(_KINDS)}"
            )
        parent, child = (_end(joint, end) for end in ("parent", "child"))
        if kind == "floating" and parent != _GROUND:
            only = f"only what floats on the ground, a link called '{_GROUND}', is read"
            raise refuse(f"{what} that floats on {short(parent)}: {only}. Rename that link, or the type of the joint")
        for end, link in (("parent", parent), ("child", child)):
            if link not in known:
                hint = did_you_mean(link, links) or "Correct the name, or add the link. "
                raise refuse(f"{what} with the {end} {short(link)}, which is no link. {hint}")
        for mimic in joint.iterfind("mimic"):
            if (wrong := mimic.get("joint", "")) not in joints or wrong == name:
                others = [each for each in joints if each != name]
                hint = did_you_mean(wrong, others) or "Correct the name"
                raise refuse(f"{what} mimic {short(wrong)}, which is no other joint. {hint}")
        if child in parent_of and joint not in second:
            raise refuse(_looped(path, child, f"the child of both '{parent_of[child][1]}' and '{name}'", name))
        parent_of.setdefault(child, (parent, name))
    hung = {_GROUND}
    for link in links:
        passed: dict[str, None] = {}
        while link in parent_of and link not in hung and link not in passed:
            passed[link] = None
            link = parent_of[link][0]
        if link in passed:
            raise refuse(_looped(path, link, f"above itself, by the joint '{parent_of[link][1]}'", parent_of[link][1]))
        hung.update(passed)


def unread(
    path: pathlib.Path, root: Element, closed: Sequence[Sequence[str]], taken: Sequence[Element] = ()
) -> list[str]:
    """What of a URDF is not read, and may constrain or press, a line each, where no loop that a file of closures has
    holds the same links; `closed` are the frames of those loops, `taken` elements that are read."""
    links, joints = {each.get("name", "") for each in root.iterfind("link")}, _joints(root)
    held_by = _carriers(joints)
    pairs = [{held_by.get(name, name) for name in pair} for pair in closed]
    advice, found = f"give it as a loop in a file of closures, as {path.with_suffix('.yaml').name}", []
    for element in root:
        own = _local(element.tag)
        if "spring" in own:
            found.append(f"{_told(element, links, joints)}, whose forces do not act here")
            continue
        if element.tag in _READ:
            inner = [
                part for each in element if each.tag not in _READ[element.tag] for part in _within(each, links, joints)
            ]
        elif own in _HOLDING:
            inner = list(_within(element, links, joints))
        else:
            is_loop = own not in _FREE and (_JOINTS.search(own) or len(_named(element, links)) > 1)
            inner = [element] if is_loop else []
        found += [
            f"{_told(each, links, joints)} is left out: {advice}{WITHOUT}"
            for each in inner
            if each not in taken and {held_by.get(name, name) for name in _named(each, links)} not in pairs
        ]
    for name, joint in joints.items():
        for other in (mimic.get("joint", "") for mimic in joint.iterfind("mimic")):
            one, two = joint.get("type"), joints[other].get("type")
            if one != "fixed" and not {one, two} <= set(_SINGLE):
                found.append(f"mimic of {name} by {other} is left out: it couples {one} and {two} joints{WITHOUT}")
    sprung = [each.get("reference", "") for each in root.iterfind("gazebo") if each.find("springStiffness") is not None]
    if sprung:
        found.append(f"springs that Gazebo has in {_listed(sprung)}")
    empty = [name for name, joint in joints.items() if _is_empty(joint)]
    if empty:
        found.append(f"limits of {_listed(empty)}, which leave no travel: taken as none, not as a lock")
    held = {_end(joint, "child") for joint in root.iterfind("joint")}
    loose = [each.get("name", "") for each in root.iterfind("link") if each.get("name", "") not in held][1:]
    if loose:
        found.append(f"links that no joint holds rest on the ground: {_listed(loose)}")
    return found


def _joints(root: Element) -> dict[str, Element]:
    return {each.get("name", ""): each for each in root.iterfind("joint")}


def _lifted(root: Element) -> Iterator[str]:
    """Links that Gazebo's gravity leaves alone, by their names."""
    for each in root.iterfind("gazebo"):
        if is_true(each.findtext("turnGravityOff")) or not is_true(each.findtext("gravity", "true")):
            yield each.get("reference", "")


def _is_empty(joint: Element) -> bool:
    """Whether limits that are given leave a joint no travel; those that are no numbers are told by MuJoCo."""
    limit = joint.find("limit")
    if limit is None or joint.get("type") not in ("revolute", "prismatic"):
        return False
    try:
        return float(limit.get("lower", "-inf")) >= float(limit.get("upper", "inf"))
    except ValueError:
        return False


def _carriers(joints: dict[str, Element]) -> dict[str, str]:
    """The link that carries a link fixed to it, or the child of a joint, by their names."""
    fixed = {_end(joint, "child"): _end(joint, "parent") for joint in joints.values() if joint.get("type") == "fixed"}
    found = {}
    for name in [*(_end(joint, "child") for joint in joints.values()), *joints]:
        own = _end(joints[name], "child") if name in joints and name not in found else name
        while own in fixed:
            own = fixed[own]
        found.setdefault(name, own)
    return found


def _check_expanded(root: Element, refuse: Callable[[str], RedundaxError]) -> None:
    """Refuse a template."""
    for element in root.iter():
        texts = [text for name, text in element.attrib.items() if name != "filename"]
        signs = [text for text in texts if "${" in text or "$(" in text]
        if signs or element.tag.startswith("xacro:"):
            shown = short(signs[0]) if signs else f"<{element.tag}>"
            raise refuse(f"is a template, with {shown}. Expand it: xacro FILE.xacro > FILE.urdf")


def _looped(path: pathlib.Path, link: str, what: str, joint: str) -> str:
    """Why a loop in the tree of links is none that URDF can say, and how it is given."""
    own = f"{link}_2"
    return (
        f"closes a loop: the link '{link}' is {what}, but a URDF is a tree. Give '{joint}' a child of its own, "
        f'<link name="{own}"/>, and write the loop to {path.with_suffix(".yaml").name} beside the file: '
        f"{{closed_loop: [[{own}, {link}]], type: [6d]}}. Where they do not meet at the frame of '{link}', name in its "
        f"place a link that is fixed to '{link}' where they do"
    )


def _within(element: Element, links: set[str], joints: dict[str, Element]) -> Iterator[Element]:
    """The outermost elements that may be loops: joints between links, and what is called like one and names a part."""
    if _local(element.tag) == "joint":
        mimics = any("mimic" in each.attrib.values() for each in element.iterfind("param"))
        if mimics or not (element.find("parent") is None or element.find("child") is None):
            yield from () if mimics and _is_read(element, joints) else (element,)
            return
    names = (_local(element.tag), element.get("name", ""), element.get("filename", ""))
    if any(map(_LOOPS.search, names)) and _named(element, {*links, *joints}):
        is_said = any("mimic" in name.lower() for name in names) and _is_read(element, joints)
        yield from () if is_said else (element,)
        return
    for child in element:
        yield from _within(child, links, joints)


def _is_read(element: Element, joints: dict[str, Element]) -> bool:
    """Whether this says again what a joint says of itself, that it mimics another."""
    return any(joints[name].find("mimic") is not None for name in _named(element, joints))


def _named(element: Element, names: Collection[str]) -> list[str]:
    """Those of some names that an element has as values or text, in order."""
    texts = (text.strip() for each in element.iter() for text in (*each.attrib.values(), each.text or ""))
    return list(dict.fromkeys(text for text in texts if text in names))


def _told(element: Element, links: set[str], joints: dict[str, Element]) -> str:
    own = f" {short(element.get('name'))}" if element.get("name") else ""
    ends = [name for name in _named(element, links) or _named(element, joints) if name != element.get("name")]
    return f"<{element.tag}>{own}{f' of {_listed(ends)}' if ends else ''}"


def _listed(names: Sequence[str]) -> str:
    return " and ".join(names[:2]) + (f" and {len(names) - 2} more" if len(names) > 2 else "")


def _end(joint: Element, end: str) -> str:
    found = joint.find(end)
    return "" if found is None else found.get("link", "")


def _local(tag: str) -> str:
    return tag.rpartition(":")[2]
