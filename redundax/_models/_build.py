"""The mechanism in space of a description: its bodies, joints, loops and loads

The reference pose is that of the description, where all joints are closed.
"""

import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from .._bodies._body import GROUND
from .._bodies._coupler import Coupler, Stop
from .._bodies._friction_model import ConstantFriction
from .._bodies._mechanism import Mechanism
from .._bodies._space._body import Body
from .._bodies._space._joints._distance import Distance
from .._bodies._space._joints._drivers import AngleDriver, TravelDriver
from .._bodies._space._joints._gear import Gear
from .._bodies._space._joints._orientation import AngleOfAxes, NoRotation
from .._bodies._space._joints._pairs import (
    ConstantVelocity,
    Cylindrical,
    Fixed,
    Free,
    ParallelAxes,
    Planar,
    PointOnLine,
    PointOnPlane,
    Prismatic,
    Revolute,
    Spherical,
)
from .._bodies._space._joints._rolled import Rack, Thread
from .._bodies._space._joints._universal import Universal
from .._bodies._space._loads._applied import AppliedForce
from .._bodies._space._placement import Placement
from .._bodies._space._rotation import as_quaternion
from ._description import Description, End, Joint, Loop, Motor, Tie
from ._joint_loads import armature, carried_armature, joint_loads
from ._loop_rows import ROLLED, teeth_of
from ._tree import Tree

COORDINATES = {  # of joints, in the order of their positions
    "hinge": ("angle",),
    "slide": ("travel",),
    "cylindrical joint": ("angle", "travel"),
    "universal joint": ("angle_1", "angle_2"),
    "planar joint": ("travel_1", "travel_2", "angle"),
}
_KINDS: dict[str, Callable[..., Any]] = {
    "hinge": Revolute,
    "slide": Prismatic,
    "ball": Spherical,
    "connect": Spherical,
    "weld": Fixed,
    "fixed joint": Fixed,
    "cylindrical joint": Cylindrical,
    "universal joint": Universal,
    "planar joint": Planar,
    "point-on-line joint": PointOnLine,
    "point-on-plane joint": PointOnPlane,
    "parallel-axes joint": ParallelAxes,
    "constant-velocity joint": ConstantVelocity,
    "no-rotation joint": NoRotation,
}


def mechanism_of(described: Description, *, driven: bool = False, stopped: bool = False) -> tuple[Mechanism, list[str]]:
    """The mechanism, with or without the file's motions by laws of time and the limits of its joints as stops, and what
    of its joints is left out, a line each."""
    bodies: dict[str, Any] = {body.name: body for body in _bodies(described)}
    loads, notes = joint_loads(described, {GROUND: GROUND, **bodies})
    for number, point, force in described.lifts:
        body = described.bodies[number]
        loads.append(AppliedForce(body.name, force, on_i=body.axes.T @ (point - body.position)))
    joints = [_joint(described, joint) for joint in described.joints]
    joints += [_loop(described, loop) for loop in described.loops]
    couplers: list[Any] = [
        Coupler(tie.name, *(coordinate(described, tie, which) for which in (0, 1)), polynomial=tie.polynomial)
        for tie in described.ties
        if tie.second >= 0
    ]
    couplers += list(_stops(described)) if stopped else []
    joints += [_lock(described, tie) for tie in described.ties if tie.second < 0]
    joints += [_motion(described, motor) for motor in described.motors if driven]
    weightless = [
        described.child(joint)
        for joint in described.joints
        if not described.is_between(joint) and not described.body(joint.child).mass
    ]
    if weightless:
        notes.append(f"bodies without mass in the file: {', '.join(weightless)}; what they carry is found all the same")
    parts: dict[str, Any] = {"couplers": couplers, "loads": loads, "armature": armature(described)}
    return Mechanism(list(bodies.values()), joints, **parts, gravity=described.gravity), notes


def coordinate(described: Description, tie: Tie, which: int) -> str:
    """The name of the first or second coordinate that is tied."""
    joint = described.joints[(tie.first, tie.second)[which]]
    return f"{joint.name}.{COORDINATES[joint.kind][tie.coordinates[which]]}"


def position_of(tree: Tree, mechanism: Mechanism, positions: np.ndarray) -> np.ndarray:
    """Coordinates q of the mechanism at positions of the joints."""
    poses, place = tree.at(positions), {body.name: k for k, body in enumerate(tree.description.bodies)}
    centres = dict(zip(mechanism.names.bodies, np.asarray(mechanism.frame.centres(mechanism.body)), strict=True))
    points, turns = [], []
    for name, centre in centres.items():
        body, k = tree.description.bodies[place[name]], place[name]
        points.append(poses.turns[k] @ (body.position + body.axes @ centre) + poses.shifts[k])
        turns.append(as_quaternion("orientation", poses.turns[k] @ body.axes))
    return np.concatenate([np.ravel(points), *turns])


def _bodies(described: Description) -> Iterator[Body]:
    for joint in described.joints:
        body = described.body(joint.child)
        inertia, rotor = body.inertia, carried_armature(described, joint)
        where = {
            "centre": body.axes.T @ (body.centre - body.position),
            "position": body.position,
            "orientation": body.axes,
        }
        with warnings.catch_warnings():
            if rotor is not None:
                warnings.simplefilter("ignore", UserWarning)  # no body has the inertia of one with a geared rotor
                inertia = inertia + rotor
            yield Body(body.name, body.mass, body.axes.T @ inertia @ body.axes, **where)


def placed(described: Description, end: End) -> Placement:
    """Where an end is on its body."""
    body = described.body(end)
    axes = body.axes.T @ end.axes
    return Placement(body.axes.T @ (end.point - body.position), axes[:, 2], axes[:, 0])


def _held(described: Description, name: str, i: End, j: End) -> dict[str, Any]:
    """What constructors of joints between two ends take."""
    return {
        "name": name,
        "i": described.body(i).name,
        "j": described.body(j).name,
        "on_i": placed(described, i),
        "on_j": placed(described, j),
    }


def _joint(described: Description, joint: Joint) -> Any:
    if joint.kind == "free":
        return Free(joint.name, described.child(joint), described.parent(joint))
    rubs: dict[str, Any] = {"friction": ConstantFriction(joint.friction)} if joint.friction else {}
    if rubs and joint.kind == "hinge":  # no load changes it: its moment is the force at a radius of 1 m
        rubs["pin_radius"] = 1.0
    return _KINDS[joint.kind](**_held(described, joint.name, joint.child, joint.parent), **rubs)


def _loop(described: Description, loop: Loop) -> Any:
    first = loop.first
    if loop.kind == "distance joint":
        held = _held(described, loop.name, loop.second, first)
        points = {on: held.pop(on).point for on in ("on_i", "on_j")}
        return Distance(**held, **points, distance=loop.value)
    if loop.kind == "angle joint":
        return AngleOfAxes(**_held(described, loop.name, loop.second, first), angle=loop.value)
    if loop.kind == "gear joint":
        return Gear(**_held(described, loop.name, loop.second, first), teeth=teeth_of(loop))
    if loop.kind in ROLLED:
        kind = Rack if loop.kind == "rack joint" else Thread
        return kind(**_held(described, loop.name, loop.second, first), radius=loop.value)
    if loop.kind == "point-on-plane joint":
        first = first._replace(point=first.point + loop.value * first.axes[:, 2])
    return _KINDS[loop.kind](**_held(described, loop.name, loop.second, first))


def _motion(described: Description, motor: Motor) -> Any:
    """What moves a joint by its law of time."""
    joint = described.joints[motor.joint]
    held = _held(described, motor.name, joint.child, joint.parent)
    if COORDINATES[joint.kind][motor.coordinate] == "angle":
        return AngleDriver(**held, angle=motor.law)
    return TravelDriver(**held, travel=motor.law)


def _stops(described: Description) -> Iterator[Stop]:
    """Limits of hinges and slides, which a mechanism counts from the reference pose."""
    for joint in described.joints:
        if joint.limits is None or joint.kind not in ("hinge", "slide"):
            continue
        low, high = (limit - float(joint.reference[0]) for limit in joint.limits)
        if joint.kind == "hinge" and high - low >= 2 * np.pi:  # angles are counted from -pi to pi
            continue
        ends = {"least": low, "most": high}
        given = {end: at for end, at in ends.items() if np.isfinite(at)}
        if given:
            yield Stop(f"stop of {joint.name}", f"{joint.name}.{COORDINATES[joint.kind][0]}", **given)


def _lock(described: Description, tie: Tie) -> Any:
    """What holds a hinge or slide at a displacement."""
    joint, at = described.joints[tie.first], float(tie.polynomial[0])
    held = _held(described, tie.name, joint.child, joint.parent)
    return AngleDriver(**held, angle=at) if joint.kind == "hinge" else TravelDriver(**held, travel=at)
