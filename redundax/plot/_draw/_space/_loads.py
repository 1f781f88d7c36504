"""Applied loads in space as they are drawn: springs, and forces and moments of the others at this state."""

import dataclasses
from typing import Any

import numpy as np

from ...._bodies._mechanism import Mechanism
from ...._bodies._reactions import load_wrenches
from ...._bodies._space._loads import AppliedForce, Bushing, SpringDamper, TorsionSpring
from ...._system._state import State
from .._scene import joining
from ._fields import points_of, stacked
from ._joint import SpaceJoint

_SPRINGS = (SpringDamper, TorsionSpring, Bushing)


@dataclasses.dataclass(frozen=True)
class SpaceLoad:
    """A spring between two points or about the axis z of `axes`, or (`kind` is AppliedForce) a force and a moment at
    `on_i`; `is_stiff` is false for a damper.
    """

    kind: type
    i: int
    on_i: np.ndarray
    on_j: np.ndarray
    axes: np.ndarray
    to_ground: bool = False
    is_stiff: bool = True
    force: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    moment: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))


def space_loads(
    mechanism: Mechanism,
    stack: Any,
    state: State,
    bodies: tuple[np.ndarray, np.ndarray, np.ndarray],
    joints: dict[int, list[SpaceJoint]],
) -> list[SpaceLoad]:
    """Loads of a stack; `bodies` are origins, axes and centres of mass, the ground's last, `joints` those of each."""
    r, axes, centres = bodies
    element, i, j, ground = stack.element, np.asarray(stack.i), np.asarray(stack.j), len(r) - 1
    if not isinstance(element, _SPRINGS):
        return _applied(mechanism, stack, state, bodies)
    turns, stiffness, out = stacked(element.axes_on("j"), (3, 3)), getattr(element, "stiffness", None), []
    on_i, on_j = (points_of(element.point_on(end), body, r, axes) for end, body in (("i", i), ("j", j)))
    for k, (one, other) in enumerate(zip(i, j, strict=True)):
        spot = _pin(int(one), int(other), joints, centres)
        a, b = spot if on_i is None else on_i[k], spot if on_j is None else on_j[k]
        own = axes[other] if turns is None else axes[other] @ turns[k]
        is_stiff = stiffness is None or bool(stiffness[k] != 0)
        out.append(SpaceLoad(type(element), int(one), a, b, own, ground in (one, other), is_stiff))
    return out


def _pin(i: int, j: int, joints: dict[int, list[SpaceJoint]], centres: np.ndarray) -> np.ndarray:
    """Where two bodies are joined, else where one of them is joined to anything."""
    found = joining(i, j, joints)
    return centres[min(i, j)] if found is None else found.place


def _applied(
    mechanism: Mechanism, stack: Any, state: State, bodies: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> list[SpaceLoad]:
    """Forces and moments of a load at its point if it has one, else at the body's centre of mass."""
    (r, axes, centres), out = bodies, []
    for which, wrench in zip((stack.i, stack.j), load_wrenches(mechanism, stack, state), strict=True):
        own, force, moment = np.asarray(which), np.asarray(wrench.force, float), np.asarray(wrench.moment, float)
        points = points_of(getattr(stack.element, "point", None), own, r, axes)
        for k, body in enumerate(own):
            if body == len(centres) or not (np.any(force[k]) or np.any(moment[k])):
                continue
            at = centres[body] if points is None else points[k]
            about = moment[k] - np.cross(at - r[body], force[k])
            is_small = np.linalg.norm(about) <= 1e-6 * np.linalg.norm(force[k]) * np.linalg.norm(at - r[body])
            about = np.zeros(3) if is_small else about
            out.append(SpaceLoad(AppliedForce, int(body), at, at, axes[body], force=force[k], moment=about))
    return out
