"""Loops of a URDF, from a YAML file beside it

    closed_loop: [[A, B], ...]    frames, each the name of a link or of a joint, which stands for its child link
    type: [6d, 3d, ...]           6d: the frames coincide; 3d: their origins do
    joint_name, joint_type        joints to be replaced: SPHERICAL by a ball joint, UJOINT_XY by hinges about x, then y,
                                  FIXED by none
    name_mot                      joints that are driven, which constrains nothing

as in Gepetto/example-parallel-robots.
"""

import pathlib
from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

from .._tools._errors import RedundaxError
from .._tools._optional import optional

_AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


def add_closed_loops(mujoco: Any, spec: Any, path: pathlib.Path, closures: pathlib.Path) -> list[str]:
    """Add the loops and drives of the file `closures` to the specification of the file `path`, and say in a line each
    which joints are replaced or driven that there are not."""

    def refuse(why: str) -> RedundaxError:
        return RedundaxError(f"Argument `closures`: '{closures}' {why}.")

    loops = loops_in(closures)
    pairs, kinds = loops.get("closed_loop") or [], loops.get("type") or []
    names, replaced = loops.get("joint_name") or [], loops.get("joint_type") or []
    if not all(isinstance(each, list) for each in (pairs, kinds, names, replaced)):
        raise refuse("must hold lists under `closed_loop`, `type`, `joint_name` and `joint_type`. Put them in brackets")
    if len(pairs) != len(kinds) or len(names) != len(replaced):
        raise refuse("must have a `type` for each `closed_loop` and a `joint_type` for each `joint_name`. Add them")
    notes = [note for each in zip(names, replaced, strict=True) for note in _replaced(mujoco, spec, *each, refuse)]
    frames = {name: child for name, child in children(path).items() if spec.body(name) is None}
    for pair, kind in zip(pairs, kinds, strict=True):
        if not isinstance(pair, list) or len(pair) != 2 or str(kind).lower() not in ("3d", "6d"):
            raise refuse(f"has the loop {pair} of type {kind}. Give two frames, and the type 3d or 6d")
        _close(mujoco, spec, [str(name) for name in pair], str(kind).lower(), frames, refuse)
    driven = loops.get("name_mot") or []
    if not isinstance(driven, list):
        raise refuse("must hold a list under `name_mot`. Put it in brackets")
    return [*notes, *add_drives(mujoco, spec, [str(name) for name in driven])]


def add_drives(mujoco: Any, spec: Any, names: list[str]) -> list[str]:
    """Drive joints by name, and say which of them are not there."""
    for name in names:
        if spec.joint(name) is not None:
            spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
    return [f"drive of '{name}': there is no such joint" for name in names if spec.joint(name) is None]


def transmissions(path: pathlib.Path) -> list[str]:
    """Names of the joints that a URDF drives by a transmission."""
    joints = document(path).getroot().iterfind("transmission/joint")
    return list(dict.fromkeys(joint.get("name", "") for joint in joints))


def loops_in(closures: pathlib.Path) -> dict[str, Any]:
    """What a file of loops holds."""

    def refuse(why: str) -> RedundaxError:
        return RedundaxError(f"Argument `closures`: '{closures}' {why}.")

    yaml = optional("yaml", "models")
    try:
        loops = yaml.safe_load(closures.read_text(encoding="utf8"))
    except OSError as error:
        raise refuse(f"cannot be read: {error.strerror}. Check the path") from error
    except (yaml.YAMLError, UnicodeError) as error:
        raise refuse(f"is no YAML: {' '.join(str(error).split())}. Correct it") from error
    if not isinstance(loops, dict):
        raise refuse("must have the keys `closed_loop` and `type`. Add them")
    return loops


def document(path: pathlib.Path) -> Any:
    """A file of XML with its comments; MuJoCo reads some that are not well formed."""
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    try:
        return ElementTree.parse(path, parser)
    except (ElementTree.ParseError, ValueError) as error:
        raise RedundaxError(f"Argument `path`: '{path}' is no well-formed XML: {error}. Correct the file.") from error


def children(path: pathlib.Path) -> dict[str, str]:
    """Child link of every joint, fixed ones too, which MuJoCo does not name."""
    joints = document(path).getroot().findall("joint")
    return {joint.get("name", ""): child.get("link", "") for joint in joints for child in joint.findall("child")}


def _replaced(mujoco: Any, spec: Any, name: str, kind: str, refuse: Callable[[str], RedundaxError]) -> list[str]:
    """Replace a joint by one that is freer; what is to be said, where there is no such joint."""
    joint, axes = spec.joint(str(name)), str(kind).removeprefix("UJOINT_")
    if kind not in ("SPHERICAL", "FIXED") and (axes == kind or len(axes) != 2 or not set(axes) <= set(_AXES)):
        raise refuse(f"replaces the joint '{name}' by {kind}. Give SPHERICAL, UJOINT_XY or FIXED")
    if joint is None:
        return [f"joint '{name}', to be replaced by {kind}: there is no such joint"]
    body = joint.parent
    spec.delete(joint)
    if kind == "SPHERICAL":
        body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_BALL)
    for axis in axes if str(kind).startswith("UJOINT_") else "":
        body.add_joint(name=f"{name}_{axis}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=_AXES[axis])
    return []


def _close(
    mujoco: Any, spec: Any, pair: list[str], kind: str, frames: dict[str, str], refuse: Callable[[str], RedundaxError]
) -> None:
    for name in pair:
        body = spec.body(frames.get(name, name))
        if body is None:
            raise refuse(f"closes a loop at '{name}', which is no link or joint of the model. Correct the name")
        if spec.site(name) is None:
            body.add_site(name=name)
    equality = spec.add_equality(name=f"{'weld' if kind == '6d' else 'connect'} {' ~ '.join(pair)}")
    equality.type = mujoco.mjtEq.mjEQ_WELD if kind == "6d" else mujoco.mjtEq.mjEQ_CONNECT
    equality.objtype = mujoco.mjtObj.mjOBJ_SITE
    equality.name1, equality.name2 = pair
