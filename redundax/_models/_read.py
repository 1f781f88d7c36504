"""Model files read by MuJoCo, without what constrains nothing: pictures, contacts, sensors and drives.

Bodies that the file fixes to others are kept by name, and what they weigh. Meshes are not read, so that missing files
do not matter; of bodies whose mass only they would give the mass is 0.
"""

import contextlib
import pathlib
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from .._tools._errors import RedundaxError
from .._tools._optional import optional
from ._closed_loops import add_closed_loops, add_drives, transmissions
from ._tree import WITHOUT, unique

LEAST = 1e-14  # kg and kg m^2: less is no mass at all, which MuJoCo takes for no moving body
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
_LEFT_OUT = {  # of a specification, and what to call it
    "sensors": "sensors",
    "pairs": "contact pairs",
    "excludes": "exclusions of contact",
    "skins": "skins",
    "flexes": "flexible bodies",
    "tuples": "tuples",
}


def closures_of(path: pathlib.Path, given: str | pathlib.Path | None) -> pathlib.Path | None:
    """The file of the loops of a URDF: the one given, or that beside it, if there is one."""
    beside = path.with_suffix(".yaml")
    if given is not None:
        return pathlib.Path(given)
    return beside if path.suffix.lower() == ".urdf" and beside.is_file() else None


def read(path: pathlib.Path, closures: pathlib.Path | None) -> tuple[Any, list[str]]:
    """MuJoCo's model of a file of MJCF or URDF, and what of it is left out, a line each."""
    mujoco = optional("mujoco", "models")
    if not path.is_file():
        raise RedundaxError(
            f"Argument `path`: there is no file '{path}'. Check the path and the folder that you are in."
        )
    if path.suffix.lower() not in (".xml", ".mjcf", ".urdf"):
        raise RedundaxError(f"Argument `path` must end in .xml, .mjcf or .urdf, but is '{path}'. Rename the file.")
    with _silent(mujoco):
        return _read(mujoco, path, closures)


@contextlib.contextmanager
def _silent(mujoco: Any) -> Iterator[None]:
    """No warnings of MuJoCo, on the screen or in a file of its own: what is wrong is told, and bodies without mass are
    not."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            yield
    finally:
        mujoco.set_mju_user_warning(before)


def _read(mujoco: Any, path: pathlib.Path, closures: pathlib.Path | None) -> tuple[Any, list[str]]:
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, RuntimeError, UnicodeError) as error:
        raise _unreadable(path, error) from error
    notes = []
    if closures is not None:
        notes += add_closed_loops(mujoco, spec, path, closures)
    if path.suffix.lower() == ".urdf" and not spec.actuators:
        notes += add_drives(mujoco, spec, transmissions(path))
    notes += _stripped(mujoco, spec)
    model = _compiled(spec, path, notes)
    for what, of in _NUMBERS.items():
        values = getattr(model, what)
        if not np.all(np.abs(values) < _LARGEST):
            raise RedundaxError(f"Argument `path`: '{path}' has {of} that are no numbers, or beyond all. Correct them.")
    return model, notes


def _stripped(mujoco: Any, spec: Any) -> list[str]:
    """Delete what needs other files or constrains nothing, and say so."""
    notes = []
    for equality in list(spec.equalities):
        kinds = mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_JOINT
        if equality.type not in kinds or not equality.active:
            why = f"its kind is not taken over{WITHOUT}" if equality.active else "it is not active"
            notes.append(f"constraint '{equality.name or equality.type.name}' is left out: {why}")
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
    _keep_positions(mujoco, spec)
    if shapes:
        notes.append(f"{_shapes(shapes)} from meshes")
        lighter = dict.fromkeys(_name(geom.parent) for geom in shapes if _weighs(spec, geom))
        notes += [f"mass that shapes from meshes give to {', '.join(lighter)}"] if lighter else []
    for each in (*shapes, *spec.meshes, *spec.hfields):
        spec.delete(each)
    for geom in spec.geoms:
        geom.material = ""
    for each in (*spec.materials, *spec.textures):
        spec.delete(each)
    floating = [_name(body) for body in spec.bodies if body.gravcomp]
    notes += [f"compensation of gravity of {', '.join(floating)}"] if floating else []
    if spec.option.viscosity or spec.option.density:
        notes.append("forces of the fluid around, of the density and viscosity in the file's options")
    if spec.geoms:
        notes.append(f"contact of {_shapes(spec.geoms)}")
    return notes


def _keep_positions(mujoco: Any, spec: Any) -> None:
    """Keep of keyframes what they say of joints, under a name each, and none that counts other joints."""
    sizes = {mujoco.mjtJoint.mjJNT_FREE: 7, mujoco.mjtJoint.mjJNT_BALL: 4}
    size = sum(sizes.get(joint.type, 1) for joint in spec.joints)
    taken, keys = [key.name for key in spec.keys if key.name], list(spec.keys)
    for name, key in zip(unique([f"keyframe {k}" for k in range(1, len(keys) + 1)], taken), keys, strict=True):
        if len(key.qpos) != size or not np.all(np.isfinite(key.qpos)):
            spec.delete(key)
            continue
        key.name = key.name or name
        for what in ("qvel", "act", "ctrl", "mpos", "mquat"):
            setattr(key, what, [])


def _weighs(spec: Any, geom: Any) -> bool:
    """Whether a body that moves has mass from this shape."""
    own = geom.parent.explicitinertial
    if not geom.meshname or geom.parent.name == "world":
        return False
    if spec.compiler.inertiafromgeom not in ((1,) if own else (1, 2)):
        return False
    group = spec.compiler.inertiagrouprange
    given = geom.mass if np.isfinite(geom.mass) else geom.density
    return bool(given > 0 and group[0] <= geom.group <= group[1])


def _name(body: Any) -> str:
    return body.name or "a body without a name"


def _shapes(found: Any) -> str:
    return f"{len(found)} shape{'s' * (len(found) != 1)}"


def _compiled(spec: Any, path: pathlib.Path, notes: list[str]) -> Any:
    spec.compiler.fusestatic = spec.compiler.discardvisual = False
    spec.compiler.boundmass = spec.compiler.boundinertia = LEAST
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
    why = " ".join(str(error).split()).rstrip(".") or type(error).__name__
    return RedundaxError(f"Argument `path`: '{path}' cannot be read: {why}. Correct the file.")
