"""What a print of a mechanism shows: bodies with mass and inertia, joints with their kind, bodies and friction."""

import textwrap
from collections.abc import Sequence

import jax
import numpy as np
from jaxtyping import Array

from .._system._names import Names
from .._system._units import StatedUnits, with_unit
from .._tools._table import WIDTH, Group, figures, group, page, text_of
from ._armature import Armature
from ._body import GROUND, AbstractBody
from ._joint_friction import FrictionMembers
from ._stack import Stack

_MORE = "All of them: mechanism.names.bodies and mechanism.names.joints"
_KINDS = {"preload": ("force", 0), "velocity": ("linear", 1), "radius": ("linear", 0), "friction radius": ("linear", 0)}


def mechanism_page(
    names: Names,
    body: AbstractBody,
    joints: Sequence[Stack],
    friction: Sequence[FrictionMembers],
    loads: Sequence[Stack],
    gravity: Array,
    armature: Sequence[Armature],
    couplers: Sequence[tuple[str, str, str]],
) -> str:
    """The page of a mechanism with names whose numbers are known; of couplers name, kind and coordinates."""
    units = names.units
    stated = f"; units {units}" if str(units) else ""
    pulls = with_unit(f"({', '.join(figures(np.asarray(gravity)))})", units.of("linear", 2)).replace("),", ")")
    acting = [f"gravity {pulls}"] if np.any(np.asarray(gravity)) else []
    acting += [
        f"{type(load.element).__name__} on {place.removesuffix(f', {GROUND}').replace(', ', ' and ')}"
        for load in loads
        for place in _places(names, load)
    ]
    rotors = [words for each in armature for words in each.words(names, joints)]
    head = [
        f"Mechanism with {len(names.coordinates)} coordinates, {len(names.rows)} rows{stated}",
        *textwrap.wrap(f"Loads: {', '.join(acting) or 'none'}", WIDTH, max_lines=2, placeholder=" ..."),
        *textwrap.wrap(f"Armature: {', '.join(rotors)}" if rotors else "", WIDTH, max_lines=2, placeholder=" ..."),
    ]
    return text_of([*head, *page([_bodies(names, body)], [_joints(names, joints, friction, couplers)], _MORE)])


def _bodies(names: Names, body: AbstractBody) -> Group:
    """Mass and inertia; in space about the axes of the body, without its products."""
    mass, unit, inertia = np.asarray(body.mass), names.units.of("inertia"), np.asarray(body.inertia)
    if inertia.ndim == 3:
        inertia = np.diagonal(inertia, axis1=1, axis2=2)
    axes = [""] if inertia.ndim == 1 else [f" {axis}" for axis in "xyz"]
    headings = [with_unit(f"inertia{axis}", unit) for axis in axes]
    columns = (figures(column) for column in (mass, *np.atleast_2d(inertia.T)))
    return group(("body", with_unit("mass", names.units.of("mass")), *headings), names.bodies, *columns)


def _joints(
    names: Names, joints: Sequence[Stack], friction: Sequence[FrictionMembers], couplers: Sequence[tuple[str, str, str]]
) -> Group:
    laws = {
        name: law for members in friction for name, law in zip(members.joints, _laws(members, names.units), strict=True)
    }
    rows = [
        (name, type(stack.element).__name__, place, laws.get(name, "none"))
        for stack, own in zip(joints, names.joints, strict=True)
        for name, place in zip(own, _places(names, stack), strict=True)
    ]
    rows += [(*coupled, "none") for coupled in couplers]
    return Group(("joint", "kind", "bodies", "friction"), rows, "<<<<")


def _places(names: Names, stack: Stack) -> list[str]:
    """The two bodies of each, or the one where both are the same."""
    known = (*names.bodies, GROUND)
    pairs = zip(np.asarray(stack.i).tolist(), np.asarray(stack.j).tolist(), strict=True)
    return [", ".join(dict.fromkeys((known[i], known[j]))) for i, j in pairs]


def _laws(members: FrictionMembers, units: StatedUnits) -> list[str]:
    """Friction of each member, in words: of a revolute, mu times the radius of its pin is one length."""
    kind = type(getattr(members.model, "model", members.model)).__name__
    angular = bool(members.slips.angular.all())
    leaves = jax.tree_util.tree_flatten_with_path(members.model)[0]
    named = {jax.tree_util.keystr(path[-1:], simple=True): np.asarray(leaf) for path, leaf in leaves}
    if kind == "Coulomb" and angular:
        named["friction radius"] = named.pop("mu")
    out = []
    for k in range(len(members.joints)):
        parts = [
            f"{name} {value[k]:.4g} {units.of(*_KINDS[name]) if name in _KINDS else ''}".strip()
            for name, value in named.items()
            if value.ndim == 1 and value[k]
        ]
        out.append(f"{kind}: {', '.join(parts)}" if parts else kind)
    return out
