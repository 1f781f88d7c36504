"""What acts in the joints of a model: springs, dampers and armature

Of a joint on the ground that turns, armature is an inertia about its axis, which the body carries wherever it is: the
mass matrix stays constant. Of other hinges, balls and slides it is that of the mechanism.
"""

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._bodies._body import GROUND
from .._bodies._loads import AbstractLoad
from .._bodies._space._body import Body
from .._bodies._space._loads import Bushing, LoadFunction, TorsionSpring
from .._bodies._space._placement import Placement
from .._bodies._space._pose import Motion, Wrench
from .._bodies._space._rotation import rotation
from ._description import Description, Joint


def joint_loads(described: Description, bodies: Mapping[str, Body | str]) -> tuple[list[AbstractLoad], list[str]]:
    """Springs and dampers of joints, and what else acts in them, which is left out, a line each."""
    loads, missing = [], {}
    for joint in described.joints:
        untaken = joint.untaken
        if joint.stiffness or joint.damping:
            load = _spring(described, bodies, joint)
            loads += [] if load is None else [load]
            untaken += ("spring and damping",) if load is None else ()
        for what in untaken:
            missing.setdefault(what, []).append(joint.name)
    return loads, [f"{what} of {', '.join(names)}" for what, names in missing.items()]


def carried_armature(described: Description, joint: Joint) -> np.ndarray | None:
    """The inertia, global, by which the body on a joint has its armature; None if there is none or it cannot."""
    if not joint.armature or described.parent(joint) != GROUND or joint.kind not in ("hinge", "ball"):
        return None
    axis = joint.parent.axes[:, 2]
    return joint.armature * (np.outer(axis, axis) if joint.kind == "hinge" else np.eye(3))


def armature(described: Description) -> dict[str, float]:
    """That of coordinates of joints or of balls, by their names, which no body carries."""
    words = {"hinge": ".angle", "slide": ".travel", "ball": ""}
    return {
        f"{joint.name}{words[joint.kind]}": joint.armature
        for joint in described.joints
        if joint.armature and carried_armature(described, joint) is None
    }


def _spring(described: Description, bodies: Mapping[str, Body | str], joint: Joint) -> AbstractLoad | None:
    """The spring with damper of a joint; None where it cannot be said."""
    pair, stiffness = (bodies[described.child(joint)], bodies[described.parent(joint)]), joint.stiffness
    damping = joint.damping
    axis, point = joint.parent.axes[:, 2], joint.parent.point
    rest = float(joint.rest[0] - joint.reference[0])  # of a hinge or slide
    if joint.kind == "hinge" and (not stiffness or abs(rest) < np.pi):
        return TorsionSpring(*pair, axis=axis, stiffness=stiffness, free_angle=rest, damping=damping)
    if joint.kind == "slide":
        along = np.diag([0.0, 0.0, 1.0])
        return Bushing(
            described.child(joint),
            described.parent(joint),
            on_i=_local(pair[0], point, axis),
            on_j=_local(pair[1], point + rest * axis, axis),
            translation=stiffness * along,
            translation_damping=damping * along,
        )
    if joint.kind == "ball":
        own, other = (np.eye(3) if isinstance(body, str) else np.asarray(rotation(body.orientation)) for body in pair)
        free = other.T @ own @ np.asarray(rotation(joint.rest))
        given = {"stiffness": stiffness, "damping": damping, "free": free}
        return LoadFunction(described.child(joint), function=ball_spring, j=described.parent(joint), parameters=given)
    return None


def _local(body: Body | str, point: np.ndarray, axis: np.ndarray) -> Placement:
    """A global placement in the frame of a body at the reference pose."""
    given = Placement(point, axis)
    if isinstance(body, str):
        return given
    turn = np.asarray(rotation(body.orientation)).T
    axes = turn @ np.asarray(given.axes)
    return Placement(turn @ (point - np.asarray(body.position)), axes[:, 2], axes[:, 0])


def ball_spring(i: Motion, j: Motion, t: Array, p: Mapping[str, Array]) -> tuple[Wrench, Wrench]:
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
