"""What a print of a mechanism shows: bodies with mass and inertia, joints with their kind, bodies and friction."""

import textwrap
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from .._system._names import Names
from .._system._units import StatedUnits, with_unit
from .._tools._table import WIDTH, Group, figures, group, page
from ._body import GROUND, Body
from ._joint_friction import FrictionMembers
from ._stack import Stack

_MORE = "All of them: mechanism.names.bodies and mechanism.names.joints"
_KINDS = {"preload": ("force", 0), "velocity": ("linear", 1), "radius": ("linear", 0), "friction radius": ("linear", 0)}


def mechanism_page(
    names: Names,
    body: Body,
    joints: Sequence[Stack],
    friction: Sequence[FrictionMembers],
    loads: Sequence[Stack],
    gravity: Any,
) -> str:
    """The page of a mechanism with names whose numbers are known."""
    units = names.units
    stated = f"; units {units}" if str(units) else ""
    pulls = with_unit(f"({', '.join(figures(np.asarray(gravity)))})", units.of("linear", 2)).replace("),", ")")
    acting = [f"gravity {pulls}"] if np.any(np.asarray(gravity)) else []
    acting += [
        f"{type(load.element).__name__} on {place.removesuffix(f', {GROUND}').replace(', ', ' and ')}"
        for load in loads
        for place in _places(names, load)
    ]
    head = [
        f"Mechanism with {len(names.coordinates)} coordinates, {len(names.rows)} rows{stated}",
        *textwrap.wrap(f"Loads: {', '.join(acting) or 'none'}", WIDTH, max_lines=2, placeholder=" ..."),
    ]
    return "\n".join([*head, *page([_bodies(names, body)], [_joints(names, joints, friction)], _MORE)])


def _bodies(names: Names, body: Body) -> Group:
    mass, inertia = with_unit("mass", names.units.of("mass")), with_unit("inertia", names.units.of("inertia"))
    return group(("body", mass, inertia), names.bodies, *(figures(np.asarray(x)) for x in (body.mass, body.inertia)))


def _joints(names: Names, joints: Sequence[Stack], friction: Sequence[FrictionMembers]) -> Group:
    laws = {
        name: law
        for members in friction
        for name, law in zip(members.slips.labels, _laws(members, names.units), strict=True)
    }
    rows = [
        (name, type(stack.element).__name__, place, laws.get(name, "none"))
        for stack, own in zip(joints, names.joints, strict=True)
        for name, place in zip(own, _places(names, stack), strict=True)
    ]
    return Group(("joint", "kind", "bodies", "friction"), rows, "<<<<")


def _places(names: Names, stack: Stack) -> list[str]:
    """The two bodies of each, or the one where both are the same."""
    known = (*names.bodies, GROUND)
    pairs = zip(np.asarray(stack.i).tolist(), np.asarray(stack.j).tolist(), strict=True)
    return [", ".join(dict.fromkeys((known[i], known[j]))) for i, j in pairs]


def _laws(members: FrictionMembers, units: StatedUnits) -> list[str]:
    """Friction of each member, in words: of a revolute, mu times the radius of its pin is one length."""
    kind = type(getattr(members.model, "model", members.model)).__name__
    angular = bool(members.slips.angular.any())
    leaves = jax.tree_util.tree_flatten_with_path(members.model)[0]
    named = {jax.tree_util.keystr(path[-1:], simple=True): np.asarray(leaf) for path, leaf in leaves}
    if kind == "Coulomb" and angular:
        named["friction radius"] = named.pop("mu")
    out = []
    for k in range(len(members.slips)):
        parts = [
            f"{name} {value[k]:.4g} {units.of(*_KINDS[name]) if name in _KINDS else ''}".strip()
            for name, value in named.items()
            if value.ndim == 1 and value[k]
        ]
        out.append(f"{kind}: {', '.join(parts)}" if parts else kind)
    return out
