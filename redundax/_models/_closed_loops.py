"""Loops of a URDF, from a YAML file beside it

    closed_loop: [[A, B], ...]    frames, each the name of a link or of a joint, which stands for its child link
    type: [6d, 3d, ...]           6d: the frames coincide; 3d: their origins do
    joint_name, joint_type        joints to be replaced: SPHERICAL by a ball joint, UJOINT_XY by hinges about x, then y,
                                  FIXED by none
    name_mot                      joints that are driven, which constrains nothing

as in Gepetto/example-parallel-robots.
"""

import difflib
import pathlib
from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING

from .._tools._errors import RedundaxError
from .._tools._optional import optional
from .._tools._words import did_you_mean, short
from ._content import document, not_in_utf8, refusal
from ._mujoco_types import MujocoSpec, SpecBody

if TYPE_CHECKING:
    import yaml

_AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
KEYS = ("closed_loop", "type", "joint_name", "joint_type", "name_mot")
_LARGEST = 10**6  # bytes: thousands of loops
_DEEPEST = 10  # of lists in lists: loops take three
_MOST = 8  # names that a message lists
_ALIKE = 0.75  # of words, one of which is a slip for the other


def add_closed_loops(spec: MujocoSpec, path: pathlib.Path, closures: pathlib.Path) -> list[str]:
    """Add the loops and drives of the file `closures` to the specification of the file `path`, and say in a line each
    what of it is not read, and which joints are driven that there are not."""
    return _Closures(spec, path, closures).added()


class _Closures:
    """A file of loops that is being added to a specification."""

    def __init__(self, spec: MujocoSpec, path: pathlib.Path, closures: pathlib.Path):
        self._mujoco, self._spec, self._loops = optional("mujoco", "models"), spec, loops_in(closures)
        self._refuse = partial(refusal, closures, argument="closures")
        self._closures, self._children = closures, children(path)

    def added(self) -> list[str]:
        """What is not read of it, a line each, once all else is added."""
        refuse = self._refuse
        pairs, kinds, names, replaced, driven = map(self._list, KEYS)
        for (key, values), (other, types) in (
            (("closed_loop", pairs), ("type", kinds)),
            (("joint_name", names), ("joint_type", replaced)),
        ):
            if len(values) != len(types):
                raise refuse(
                    f"must have a `{other}` for each `{key}`, but has {len(types)} for {len(values)}. Make them as many"
                )
        names = self._names("joint_name", names)
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise refuse(f"names the joint {short(twice)} twice under `joint_name`. Name it once")
        for name, kind in zip(names, self._names("joint_type", replaced), strict=True):
            self._replace(name, kind.upper())
        frames = {name: child for name, child in self._children.items() if self._spec.body(name) is None}
        for pair, kind in zip(pairs, self._names("type", kinds), strict=True):
            if not isinstance(pair, list) or len(pair) != 2 or kind.lower() not in ("3d", "6d"):
                raise refuse(
                    f"has the loop {short(pair)} of type {short(kind)}. Give two frames, and the type 3d or 6d"
                )
            self._close(self._names("closed_loop", pair), kind.lower(), frames)
        driven, known = self._names("name_mot", driven), self._joints()
        for name in driven:
            if name not in known:
                raise refuse(f"drives the joint {short(name)}, which is no joint that moves. {self._hint(name)}")
        others = [short(key) for key in self._loops if key not in KEYS]
        unread = [f"of '{self._closures}': {', '.join(others[:_MOST])}"] if others else []
        return [*unread, *add_drives(self._spec, driven)]

    def _joints(self) -> list[str]:
        return [each.name for each in self._spec.joints if each.name]

    def _hint(self, name: str) -> str:
        known = self._joints()
        return did_you_mean(name, known) or f"There are {', '.join(known[:_MOST])}"

    def _list(self, key: str) -> list[object]:
        value = self._loops.get(key)
        if value is not None and not isinstance(value, list):
            raise self._refuse(f"must hold a list under `{key}`, but holds {short(value)}. Put it in brackets")
        return value or []

    def _names(self, key: str, values: list[object]) -> list[str]:
        for value in values:
            if not isinstance(value, str | int) or isinstance(value, bool):
                raise self._refuse(f"must hold names under `{key}`, but holds {short(value)}. Put names in quotes")
        return [str(value) for value in values]

    def _replace(self, name: str, kind: str) -> None:
        """Replace a joint by one that is freer."""
        spec, refuse = self._spec, self._refuse
        joint, axes = spec.joint(name), kind.removeprefix("UJOINT_")
        if kind not in ("SPHERICAL", "FIXED") and (axes == kind or len(axes) != 2 or not set(axes) <= set(_AXES)):
            raise refuse(f"replaces the joint {short(name)} by {short(kind)}. Give SPHERICAL, UJOINT_XY or FIXED")
        if joint is None:
            if name in self._children:
                raise refuse(f"replaces the joint {short(name)}, which is fixed or planar. Make it a revolute one")
            raise refuse(f"replaces the joint {short(name)}, which is not in the model. {self._hint(name)}")
        body = joint.parent
        spec.delete(joint)
        if kind == "SPHERICAL":
            body.add_joint(name=name, type=self._mujoco.mjtJoint.mjJNT_BALL)
        for axis in axes if kind.startswith("UJOINT_") else "":
            body.add_joint(name=f"{name}_{axis}", type=self._mujoco.mjtJoint.mjJNT_HINGE, axis=_AXES[axis])

    def _close(self, pair: list[str], kind: str, frames: dict[str, str]) -> None:
        mujoco, spec, refuse, carriers = self._mujoco, self._spec, self._refuse, []
        for name in pair:
            body = spec.body(frames.get(name, name))
            if body is None:
                known = [*(each.name for each in spec.bodies if each.name), *frames]
                hint = did_you_mean(name, known) or "Correct the name. "
                raise refuse(f"closes a loop at {short(name)}, which is no link or joint of the model. {hint}")
            if spec.site(name) is None:
                body.add_site(name=name)
            carriers.append(_carrier(body))
        if carriers[0] is carriers[1] or carriers[0].name == carriers[1].name:
            raise refuse(
                f"closes a loop between {short(pair[0])} and {short(pair[1])}, which are one body. Correct a name"
            )
        equality = spec.add_equality(name=f"{'weld' if kind == '6d' else 'connect'} {' ~ '.join(pair)}")
        equality.type = mujoco.mjtEq.mjEQ_WELD if kind == "6d" else mujoco.mjtEq.mjEQ_CONNECT
        equality.objtype = mujoco.mjtObj.mjOBJ_SITE
        equality.name1, equality.name2 = pair


def add_drives(spec: MujocoSpec, names: list[str]) -> list[str]:
    """Drive joints by name, and say which of them are not there."""
    mujoco = optional("mujoco", "models")
    for name in names:
        if spec.joint(name) is not None:
            spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
    return [f"drive of '{name}': there is no such joint" for name in names if spec.joint(name) is None]


def transmissions(path: pathlib.Path) -> list[str]:
    """Names of the joints that a URDF drives by a transmission."""
    joints = document(path).iterfind("transmission/joint")
    return list(dict.fromkeys(joint.get("name", "") for joint in joints))


def loops_in(closures: pathlib.Path) -> dict[str, object]:
    """What a file of loops holds."""
    yaml, refuse = optional("yaml", "models"), partial(refusal, closures, argument="closures")
    if not closures.is_file():  # to read what is a pipe or a device may last for ever
        raise refuse("is no file. Name a file" if closures.exists() else "is not there. Check the path")
    try:
        content = closures.read_bytes()
    except OSError as error:
        raise refuse(f"cannot be read: {error.strerror}. Check who may read it") from error
    if len(content) > _LARGEST:
        raise refuse(f"has {len(content) / 1e6:.0f} MB, too much for loops. Name the file of the loops")
    try:
        _check_events(yaml.parse(content, Loader=yaml.SafeLoader), refuse)
        loops = yaml.safe_load(content)
    except RedundaxError:
        raise
    except yaml.MarkedYAMLError as error:
        place = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise refuse(f"is no YAML: {place}{' '.join(str(error.problem).split())}. Correct it") from error
    except yaml.reader.ReaderError as error:
        raise refuse(f"{not_in_utf8(content) or 'is no text'}. Save it in UTF-8") from error
    except (ValueError, OverflowError) as error:  # of numbers and dates
        why = str(error).partition(";")[0]
        raise refuse(f"holds a number or date that is none: {why}. Put names in quotes") from error
    if not isinstance(loops, dict):
        held = "is empty" if loops is None else f"holds {short(loops)}"
        raise refuse(f"must have the keys `closed_loop` and `type`, but {held}. Add them")
    for key in map(str, loops):
        near = difflib.get_close_matches(key.lower(), KEYS, 1, _ALIKE)
        if near and key not in KEYS:
            raise refuse(f"has the key {short(key)}, which is none. Did you mean `{near[0]}`?")
    if not any(key in loops for key in KEYS):
        raise refuse(
            f"has none of the keys `closed_loop`, `type`, `joint_name`, `joint_type`, `name_mot`: it has "
            f"{', '.join(short(key) for key in [*loops][:_MOST])}. Rename it if it is not about loops"
        )
    return loops


def _check_events(events: "Iterable[yaml.Event]", refuse: Callable[[str], RedundaxError]) -> None:
    """Refuse what grows when it is read, is nested for ever, or is said twice, of which the first would be lost."""
    import yaml

    depth, items, keys = 0, 0, []
    for event in events:
        if isinstance(event, yaml.AliasEvent):
            raise refuse(f"repeats a value by *{short(event.anchor)[1:-1]}. Write the value itself")
        starts = isinstance(event, yaml.CollectionStartEvent)
        if depth == 1 and (starts or isinstance(event, yaml.ScalarEvent)):
            keys += [event.value] if items % 2 == 0 and not starts else []
            items += 1
        depth += starts - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            raise refuse(f"has lists in lists, more than {_DEEPEST} deep. Give pairs of names")
    twice = next((key for key in KEYS if keys.count(key) > 1), None)
    if twice:
        raise refuse(f"has the key `{twice}` twice. Put all in one list")


def list_under(loops: dict[str, object], key: str) -> list[object]:
    """What a file of loops has under a key, where it is a list."""
    found = loops.get(key)
    return found if isinstance(found, list) else []


def children(path: pathlib.Path) -> dict[str, str]:
    """Child link of every joint of a URDF, fixed ones too, which MuJoCo does not name."""
    joints = document(path).findall("joint")
    return {joint.get("name", ""): child.get("link", "") for joint in joints for child in joint.findall("child")}


def _carrier(body: SpecBody) -> SpecBody:
    """The body with joints that carries a body fixed to it, or the ground."""
    while not list(body.joints) and body.parent is not None and body.name != "world":
        body = body.parent
    return body
