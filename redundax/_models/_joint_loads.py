"""What acts in the joints of a model: springs, dampers and armature

Of a joint on the ground that turns, armature is an inertia about its axis, which the body carries wherever it is: the
mass matrix stays constant. Of other hinges, balls and slides it is that of the mechanism.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._bodies._body import GROUND
from .._bodies._space._loads import Bushing, LoadFunction, TorsionSpring
from .._bodies._space._placement import Placement
from .._bodies._space._pose import Motion, Wrench
from .._bodies._space._rotation import rotation
from ._plan import Link, Plan

COORDINATES = {"hinge": "angle", "slide": "travel"}


def joint_loads(plan: Plan, data: Any, bodies: dict) -> tuple[list[Any], list[str]]:
    """Springs and dampers of joints, and what else acts in them, which is left out, a line each."""
    model, loads, missing = plan.model, [], {}
    for link in plan.links:
        dof = int(model.jnt_dofadr[link.joint])
        stiffness, damping = float(model.jnt_stiffness[link.joint]), float(model.dof_damping[dof])
        friction = link.kind not in ("hinge", "slide") and model.dof_frictionloss[dof]
        lost = {"armature": link.kind == "free" and model.dof_armature[dof], "dry friction": friction}
        for what, name, at in (("springs", "jnt_stiffnesspoly", link.joint), ("dampers", "dof_dampingpoly", dof)):
            lost[f"what is not linear in the {what}"] = np.any(getattr(model, name, np.zeros(model.nv))[at])
        if stiffness or damping:
            load = _spring(plan, data, bodies, link, stiffness, damping)
            loads += [] if load is None else [load]
            lost["spring and damping"] = load is None
        for what, value in lost.items():
            missing.setdefault(what, []).extend([link.name] if value else [])
    return loads, [f"{what} of {', '.join(names)}" for what, names in missing.items() if names]


def carried_armature(plan: Plan, data: Any, link: Link) -> np.ndarray | None:
    """The inertia, global, by which the body on a joint has its armature; None if there is none or it cannot."""
    armature = float(plan.model.dof_armature[plan.model.jnt_dofadr[link.joint]])
    if not armature or link.parent != GROUND or link.kind not in ("hinge", "ball"):
        return None
    axis = data.xaxis[link.joint]
    return armature * (np.outer(axis, axis) if link.kind == "hinge" else np.eye(3))


def armature(plan: Plan, data: Any) -> dict[str, float]:
    """That of coordinates of joints or of balls, by their names, which no body carries."""
    found = {}
    for link in plan.links:
        value = float(plan.model.dof_armature[plan.model.jnt_dofadr[link.joint]])
        if value and link.kind != "free" and carried_armature(plan, data, link) is None:
            found[f"{link.name}.{COORDINATES[link.kind]}" if link.kind in COORDINATES else link.name] = value
    return found


def _spring(plan: Plan, data: Any, bodies: dict, link: Link, stiffness: float, damping: float) -> Any:
    """The spring with damper of a joint; None where it cannot be said."""
    pair = bodies[link.child], bodies[link.parent]
    place, axis, point = plan.model.jnt_qposadr[link.joint], data.xaxis[link.joint].copy(), data.xanchor[link.joint]
    rest = float(plan.model.qpos_spring[place] - plan.model.qpos0[place])  # of a hinge or slide
    if link.kind == "hinge" and (not stiffness or abs(rest) < np.pi):
        return TorsionSpring(*pair, axis=axis, stiffness=stiffness, free_angle=rest, damping=damping)
    if link.kind == "slide":
        along = np.diag([0.0, 0.0, 1.0])
        both: dict[str, Any] = {"translation": stiffness * along, "translation_damping": damping * along}
        ends = _local(pair[0], point, axis), _local(pair[1], point + rest * axis, axis)
        return Bushing(link.child, link.parent, on_i=ends[0], on_j=ends[1], **both)
    if link.kind == "ball":
        own, other = (np.eye(3) if body == GROUND else np.asarray(rotation(body.orientation)) for body in pair)
        free = other.T @ own @ np.asarray(rotation(plan.model.qpos_spring[place : place + 4]))
        given: Any = {"stiffness": stiffness, "damping": damping, "free": free}
        return LoadFunction(link.child, function=ball_spring, j=link.parent, parameters=given)
    return None


def _local(body: Any, point: np.ndarray, axis: np.ndarray) -> Placement:
    """A global placement in the frame of a body at the reference pose."""
    given = Placement(point, axis)
    if body == GROUND:
        return given
    turn = np.asarray(rotation(body.orientation)).T
    axes = turn @ np.asarray(given.axes)
    return Placement(turn @ (point - np.asarray(body.position)), axes[:, 2], axes[:, 0])


def ball_spring(i: Motion, j: Motion, t: Array, p: Any) -> tuple[Wrench, Wrench]:
    """Moment of a ball's spring, the stiffness times the turn from where it is free, and of its damper."""
    turn = p["free"].T @ j.pose.axes.T @ i.pose.axes  # seen in the axes of i
    vector = jnp.stack([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    square = vector @ vector
    is_small = square < 1e-16
    sine = jnp.sqrt(jnp.where(is_small, 1.0, square))
    ratio = jnp.where(is_small, 1.0, jnp.arctan2(sine, (jnp.trace(turn) - 1) / 2) / sine)
    moment = -p["stiffness"] * i.pose.axes @ (ratio * vector) - p["damping"] * (i.angular_velocity - j.angular_velocity)
    none = jnp.zeros(3)
    return Wrench(none, moment), Wrench(none, -moment)
