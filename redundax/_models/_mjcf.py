"""MJCF, read by MuJoCo, without what constrains nothing: pictures, contacts, sensors and drives; so is URDF

Of bodies that the file fixes to others it is kept what they weigh. Meshes are not read, so that missing files do not
matter; of bodies whose mass only they would give the mass is 0.
"""

import contextlib
import pathlib
import re
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from types import ModuleType

import numpy as np

from .._tools._errors import RedundaxError
from .._tools._optional import optional
from .._tools._words import did_you_mean
from ._content import document, not_in_utf8, refusal
from ._description import WITHOUT, Description, unique
from ._foreign import known_part
from ._mujoco_model import LEAST, described
from ._mujoco_types import MujocoModel, MujocoSpec, SpecBody, SpecGeom
from ._source import Source

_MOST_BODIES = 20_000  # MuJoCo reads them in 20 s, and four times as many in sixteen times that
_LARGEST = 1e30  # of any number of a model, in its units
_NUMBERS = {  # of a model, and of what they are
    "body_pos": "positions of bodies",
    "body_quat": "orientations of bodies",
    "body_mass": "masses",
    "body_ipos": "centres of mass",
    "body_inertia": "inertias",
    "jnt_pos": "positions of joints",
    "jnt_axis": "axes of joints",
    "jnt_stiffness": "springs of joints",
    "dof_damping": "dampers of joints",
    "dof_armature": "armatures",
    "qpos0": "positions of joints",
    "qpos_spring": "positions of springs",
    "site_pos": "positions of sites",
    "eq_data": "anchors of loops",
    "actuator_gear": "gears of drives",
    "wrap_prm": "coefficients of tendons",
}
_LEAVING = ("plugin", "'default'", "decoder")  # words of errors that a copy mends, the last of endings like .mjcf
_LEFT_OUT = {  # of a specification, and what to call it
    "sensors": "sensors",
    "pairs": "contact pairs",
    "excludes": "exclusions of contact",
    "skins": "skins",
    "flexes": "flexible bodies",
    "tuples": "tuples",
}


def read_mjcf(path: pathlib.Path) -> Description:
    """What a file of MJCF says."""
    return by_mujoco("MJCF", path, lambda spec: [])


def by_mujoco(
    form: str,
    path: pathlib.Path,
    change: Callable[[MujocoSpec], list[str]],
    closed: Sequence[tuple[str, str, str, str, bool]] = (),
    without: Sequence[str] = (),
) -> Description:
    """What a file says that MuJoCo reads.

    **Arguments:**

    - `form`: name of its format.
    - `change`: of MuJoCo's specification, before what constrains nothing is taken out; returns what is left out.
    - `closed`: loops besides those of MuJoCo: their names, their kinds, a site for each end, and whether the first is
      where the second is in the reference pose.
    - `without`: names of joints of a URDF that are taken out of what MuJoCo reads.
    """
    mujoco, content = optional("mujoco", "models"), path.read_bytes()
    if (size := max(content.count(b"<body"), content.count(b"<link"))) > _MOST_BODIES:
        why = "which MuJoCo would read for minutes, and whose matrices of constraints no machine holds"
        advice = "Cut out the part whose loops you ask for"
        raise refusal(path, f"has {size} bodies, {why}: {_MOST_BODIES} at most. {advice}")
    with _silent(mujoco) as warned:
        try:
            model, notes = _read(mujoco, path, change, without)
            bytes(model.names).decode()
        except UnicodeDecodeError as error:
            what = not_in_utf8(content) or "includes a file that is not in UTF-8"
            raise refusal(path, f"{what}. Save it in UTF-8, and have its first line say so") from error
    if any("'NaN'" in text for text in warned):
        raise refusal(path, "has a number that is nan. Correct it")
    return described(form, model, notes, closed)


@contextlib.contextmanager
def _silent(mujoco: ModuleType) -> Iterator[list[str]]:
    """No warnings of MuJoCo, on the screen or in a file of its own: they are collected."""
    before, warned = mujoco.get_mju_user_warning(), []
    mujoco.set_mju_user_warning(lambda text: warned.append(str(text)))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            yield warned
    finally:
        mujoco.set_mju_user_warning(before)


def _read(
    mujoco: ModuleType, path: pathlib.Path, change: Callable[[MujocoSpec], list[str]], without: Sequence[str]
) -> tuple[MujocoModel, list[str]]:
    spec, notes = _without(mujoco, path, without) if without else specification(mujoco, path)
    _check_weights(spec, path)
    notes += change(spec)
    notes += _stripped(mujoco, spec)
    model = _compiled(spec, path, notes)
    for what, of in _NUMBERS.items():
        values = getattr(model, what)
        if not np.all(np.abs(values) < _LARGEST):
            raise refusal(path, f"has {of} that are no numbers, or beyond all. Correct them")
    return model, notes


def _without(mujoco: ModuleType, path: pathlib.Path, joints: Sequence[str]) -> tuple[MujocoSpec, list[str]]:
    """The specification of a URDF without the last joint of each of some names."""
    source = Source(path)
    for name in joints:
        source.remove([each for each in source.root.all() if each.tag == "joint" and each.get("name") == name][-1])
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / path.name
        copy.write_bytes(source.changed())
        return specification(mujoco, copy)


def specification(mujoco: ModuleType, path: pathlib.Path) -> tuple[MujocoSpec, list[str]]:
    """What MuJoCo makes of a file, without what it does not know and what constrains nothing, and what that is."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        if not spec.plugins:
            return spec, []
    except (ValueError, RuntimeError) as error:
        if not any(word in str(error) for word in _LEAVING):
            raise _unreadable(path, error) from error
    with tempfile.TemporaryDirectory() as folder:
        copy, notes = known_part(path, pathlib.Path(folder))
        try:
            return mujoco.MjSpec.from_file(str(copy)), notes
        except (ValueError, RuntimeError) as error:
            raise _unreadable(path, error) from error


def _check_weights(spec: MujocoSpec, path: pathlib.Path) -> None:
    """Refuse masses and inertias that no body has, which MuJoCo takes for none where it is told least ones."""
    for body in spec.bodies:
        inertia = np.concatenate([body.inertia, [] if np.isnan(body.fullinertia[0]) else body.fullinertia[:3]])
        for what, values in (("mass", np.array([body.mass])), ("inertia", inertia)):
            wrong = values[~((values >= 0) & (values < _LARGEST))]
            if wrong.size:
                advice = "Give a positive number, or 0 for a body that weighs nothing"
                raise refusal(path, f"gives '{_name(body)}' the {what} {wrong[0]:g}. {advice}")


def _stripped(mujoco: ModuleType, spec: MujocoSpec) -> list[str]:
    """Delete what needs other files or constrains nothing, and say so."""
    notes = []
    for equality in list(spec.equalities):
        kinds = (f"mjEQ_{word}" for word in ("CONNECT", "WELD", "JOINT", "TENDON"))
        if equality.type.name not in kinds or not equality.active:
            why = f"its kind is not taken over{WITHOUT}" if equality.active else "it is not active"
            kind = equality.type.name.removeprefix("mjEQ_").lower()
            notes.append(f"constraint '{equality.name or kind}' is left out: {why}")
            spec.delete(equality)
    shapes = [geom for geom in spec.geoms if geom.meshname or geom.hfieldname]  # primitives are fitted to meshes too
    for what in _LEFT_OUT:
        found = list(getattr(spec, what))
        notes += [f"{_LEFT_OUT[what]}: {len(found)}"] if found else []
        for each in found:
            spec.delete(each)
    for what in ("actuators", "tendons"):
        found = list(getattr(spec, what))
        notes += [f"{what}: {len(found)}, whose forces do not act here"] if found else []
    for actuator in spec.actuators:
        if actuator.trntype == mujoco.mjtTrn.mjTRN_BODY:  # holds by contact
            spec.delete(actuator)
    notes += _keep_positions(mujoco, spec)
    if shapes:
        notes.append(f"{_shapes(shapes)} from meshes")
        lighter = dict.fromkeys(_name(geom.parent) for geom in shapes if _weighs(spec, geom))
        notes += [f"mass that shapes from meshes give to {', '.join(lighter)}"] if lighter else []
    for each in (*shapes, *spec.meshes, *spec.hfields):
        spec.delete(each)
    for each in (*spec.geoms, *spec.sites, *spec.tendons):
        each.material = ""
    for each in (*spec.lights, *spec.materials, *spec.textures):
        spec.delete(each)
    if spec.option.viscosity or spec.option.density:
        notes.append("forces of the fluid around, of the density and viscosity in the file's options")
    if spec.geoms:
        notes.append(f"contact of {_shapes(spec.geoms)}")
    return notes


def _keep_positions(mujoco: ModuleType, spec: MujocoSpec) -> list[str]:
    """Keep of keyframes what they say of joints, under a name each, and tell of those that count other joints."""
    sizes = {mujoco.mjtJoint.mjJNT_FREE: 7, mujoco.mjtJoint.mjJNT_BALL: 4}
    size = sum(sizes.get(joint.type, 1) for joint in spec.joints)
    taken, keys, left = [key.name for key in spec.keys if key.name], list(spec.keys), []
    for name, key in zip(unique([f"keyframe {k}" for k in range(1, len(keys) + 1)], taken), keys, strict=True):
        if len(key.qpos) != size or not np.all(np.isfinite(key.qpos)):
            left += [key.name or name] if len(key.qpos) else []
            spec.delete(key)
            continue
        key.name = key.name or name
        for what in ("qvel", "act", "ctrl", "mpos", "mquat"):
            setattr(key, what, [])
    return [f"keyframes whose positions are not the {size} numbers of all joints: {', '.join(left)}"] if left else []


def _weighs(spec: MujocoSpec, geom: SpecGeom) -> bool:
    """Whether a body that moves has mass from this shape."""
    own = geom.parent.explicitinertial
    if not geom.meshname or geom.parent.name == "world":
        return False
    if spec.compiler.inertiafromgeom not in ((1,) if own else (1, 2)):
        return False
    group = spec.compiler.inertiagrouprange
    given = geom.mass if np.isfinite(geom.mass) else geom.density
    return bool(given > 0 and group[0] <= geom.group <= group[1])


def _name(body: SpecBody) -> str:
    return body.name or "a body without a name"


def _shapes(found: Sequence[SpecGeom]) -> str:
    return f"{len(found)} shape{'s' * (len(found) != 1)}"


def _compiled(spec: MujocoSpec, path: pathlib.Path, notes: list[str]) -> MujocoModel:
    spec.compiler.fusestatic = spec.compiler.discardvisual = False
    spec.compiler.boundmass = spec.compiler.boundinertia = LEAST
    spec.compiler.LRopt.mode = 0  # ranges of lengths of muscles, whose forces do not act
    try:
        return spec.compile()
    except (ValueError, RuntimeError) as error:
        if "balanceinertia" not in str(error):
            raise _unreadable(path, error) from error
    spec.compiler.balanceinertia = True
    notes.append("inertias that no body has are replaced by the mean of their principal values")
    try:
        return spec.compile()
    except (ValueError, RuntimeError) as error:
        raise _unreadable(path, error) from error


def _unreadable(path: pathlib.Path, error: Exception) -> RedundaxError:
    why, advice = " ".join(str(error).split()).rstrip(".,") or type(error).__name__, "Correct the file"
    if "parse error" in why and "depth" not in why.lower():
        try:
            document(path)
        except RedundaxError as better:  # with the place
            return better
    if "unrecognized" in why:
        advice = "Correct it; if the file is right for another version or program, take that out in a copy"
    elif "depth" in why.lower():
        advice = "Shorten chains of bodies in bodies to fewer than 500, or split the model"
    elif "Error opening file" in why:
        advice = "Put the file that it includes there, or name it by its path from the model"
    elif unknown := re.search("unknown element '([^']*)'", why):
        names = re.findall(r'name="([^"]*)"', path.read_text(encoding="utf-8", errors="replace"))
        advice = f"{advice}. {did_you_mean(unknown[1], names)}".rstrip()
    version = optional("mujoco", "models").__version__
    return refusal(path, f"cannot be read by MuJoCo {version}: {why}. {advice}")
