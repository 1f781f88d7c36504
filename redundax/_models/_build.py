"""Bodies, joints and loads of a mechanism in space, from the tree of a model

Bodies that the file fixes to each other are one. Between two joints of a body sits a body without mass. The reference
pose is that of the file, where all displacements of joints are 0.
"""

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from .._bodies._body import GROUND
from .._bodies._coupler import Coupler
from .._bodies._friction_model import ConstantFriction
from .._bodies._mechanism import Mechanism
from .._bodies._space._body import Body
from .._bodies._space._joints._drivers import AngleDriver, TravelDriver
from .._bodies._space._joints._pairs import Fixed, Free, Prismatic, Revolute, Spherical
from .._bodies._space._placement import Placement
from .._bodies._space._rotation import as_quaternion
from .._tools._optional import optional
from ._joint_loads import COORDINATES, armature, carried_armature, joint_loads
from ._plan import Link, Plan
from ._read import LEAST
from ._tree import Tie


def mechanism_of(plan: Plan) -> tuple[Mechanism, list[str]]:
    """The mechanism, and what of the joints is left out, a line each."""
    data = plan.tree.at(plan.model.qpos0)
    bodies: dict[str, Any] = {each.name: each for each in _bodies(plan, data)} | {GROUND: GROUND}
    loads, notes = joint_loads(plan, data, bodies)
    joints = [_joint(plan, data, bodies, link) for link in plan.links]
    for loop in plan.tree.loops:
        (i, on_i), (j, on_j) = (_placed(plan, data, end) for end in (loop.second, loop.first))
        joints.append((Fixed if loop.kind == "weld" else Spherical)(loop.name, i, j, on_i=on_i, on_j=on_j))
    single = [link for link in plan.links if link.kind in COORDINATES]
    by_joint = {link.joint: f"{link.name}.{COORDINATES[link.kind]}" for link in single}
    couplers = [
        Coupler(tie.name, by_joint[tie.first], by_joint[tie.second], polynomial=tie.polynomial)
        for tie in plan.tree.ties
        if tie.second >= 0
    ]
    by_number = {link.joint: link for link in plan.links}
    joints += [_lock(data, bodies, by_number[tie.first], tie) for tie in plan.tree.ties if tie.second < 0]
    movers = [body for name, body in bodies.items() if name != GROUND]
    gravity = tuple(plan.model.opt.gravity.tolist())
    weightless = [link.child for link in plan.links if not plan.is_between(link) and not bodies[link.child].mass]
    if weightless:
        notes.append(f"bodies without mass in the file: {', '.join(weightless)}; what they carry is found all the same")
    parts: dict[str, Any] = {"couplers": couplers, "loads": loads, "armature": armature(plan, data)}
    return Mechanism(movers, joints, **parts, gravity=gravity), notes


def position_of(plan: Plan, mechanism: Mechanism, positions: np.ndarray) -> np.ndarray:
    """Coordinates q of the mechanism at positions of the joints in MuJoCo's order."""
    data, poses = plan.tree.at(positions), {}
    for link in plan.links:
        body = int(plan.model.jnt_bodyid[link.joint])
        if not plan.is_between(link):
            poses[link.child] = data.xpos[body].copy(), data.xmat[body].reshape(3, 3).copy()
    for body in plan.movers:
        _between(plan, body, positions, poses)
    centres = dict(zip(mechanism.names.bodies, np.asarray(mechanism.frame.centres(mechanism.body)), strict=True))
    points = [poses[name][0] + poses[name][1] @ centre for name, centre in centres.items()]
    return np.concatenate([np.ravel(points), *(as_quaternion("orientation", poses[name][1]) for name in centres)])


def _between(plan: Plan, body: int, positions: np.ndarray, poses: dict) -> None:
    """Poses of the massless bodies: that of the body, with the joints after it undone from the last on."""
    mujoco, model = optional("mujoco", "models"), plan.model
    own = [link for link in plan.links if model.jnt_bodyid[link.joint] == body]
    for link, before in zip(own[:0:-1], own[-2::-1], strict=True):
        point, axes = poses[link.child]
        place, at = model.jnt_qposadr[link.joint], model.jnt_pos[link.joint]
        if link.kind == "slide":
            shift = float(positions[place] - model.qpos0[place])
            poses[before.child] = point - shift * axes @ model.jnt_axis[link.joint], axes
            continue
        quaternion, turn = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(9)
        if link.kind == "hinge":
            angle = float(positions[place] - model.qpos0[place])
            mujoco.mju_axisAngle2Quat(quaternion, model.jnt_axis[link.joint], angle)
        else:
            quaternion = positions[place : place + 4] / np.linalg.norm(positions[place : place + 4])
        mujoco.mju_quat2Mat(turn, quaternion)
        back = axes @ turn.reshape(3, 3).T
        poses[before.child] = point + axes @ at - back @ at, back


def _bodies(plan: Plan, data: Any) -> Iterator[Body]:
    for link in plan.links:
        body = int(plan.model.jnt_bodyid[link.joint])
        position, axes = data.xpos[body].copy(), data.xmat[body].reshape(3, 3).copy()
        mass, centre, inertia = 0.0, position, np.zeros((3, 3))
        if not plan.is_between(link):
            mass, centre, inertia = _weight(plan, data, body)
        where = {"centre": axes.T @ (centre - position), "position": position, "orientation": axes}
        rotor = carried_armature(plan, data, link)
        with warnings.catch_warnings():
            if rotor is not None:
                warnings.simplefilter("ignore", UserWarning)  # no body has the inertia of one with a geared rotor
                inertia = inertia + rotor
            yield Body(link.child, mass, axes.T @ inertia @ axes, **where)


def _weight(plan: Plan, data: Any, root: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre and inertia about it of a body and of all that are fixed to it, global."""
    members = [k for k in range(1, plan.model.nbody) if plan.root(k) == root]
    masses = np.where(plan.model.body_mass[members] > 2 * LEAST, plan.model.body_mass[members], 0.0)
    centres, total = data.xipos[members], float(masses.sum())
    if not total:
        return 0.0, data.xpos[root].copy(), np.zeros((3, 3))
    centre, inertia = masses @ centres / total, np.zeros((3, 3))
    for k, mass, arm in zip(members, masses, centres - centre, strict=True):
        axes, own = data.ximat[k].reshape(3, 3), plan.model.body_inertia[k]
        inertia += axes @ np.diag(np.where(own > 2 * LEAST, own, 0.0)) @ axes.T
        inertia += mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return total, centre, (inertia + inertia.T) / 2


def _joint(plan: Plan, data: Any, bodies: dict, link: Link) -> Any:
    if link.kind == "free":
        return Free(link.name, link.child, link.parent)
    where: dict[str, Any] = {"point": data.xanchor[link.joint].copy()}
    if link.kind in COORDINATES:
        where["axis"] = data.xaxis[link.joint].copy()
        where |= _dry_friction(float(plan.model.dof_frictionloss[plan.model.jnt_dofadr[link.joint]]), link)
    kind = {"ball": Spherical, "slide": Prismatic, "hinge": Revolute}[link.kind]
    return kind(link.name, bodies[link.child], bodies[link.parent], **where)


def _dry_friction(size: float, link: Link) -> dict[str, Any]:
    """That of a hinge or slide, which no load changes; its moment is the force at a radius of 1 m."""
    if not size:
        return {}
    friction = {"friction": ConstantFriction(size)}
    return friction | {"pin_radius": 1.0} if link.kind == "hinge" else friction


def _lock(data: Any, bodies: dict, link: Link, tie: Tie) -> Any:
    """What holds a hinge or slide at a displacement."""
    where = data.xanchor[tie.first].copy(), data.xaxis[tie.first].copy()
    pair, at = (bodies[link.child], bodies[link.parent]), float(tie.polynomial[0])
    if link.kind == "hinge":
        return AngleDriver(tie.name, *pair, *where, angle=at)
    return TravelDriver(tie.name, *pair, *where, travel=at)


def _placed(plan: Plan, data: Any, end: Any) -> tuple[str, Placement]:
    """The body of the mechanism at an end of a loop, and where on it the loop closes."""
    root = plan.root(end.body)
    axes, own = data.xmat[end.body].reshape(3, 3), data.xmat[root].reshape(3, 3)
    point, turned = data.xpos[end.body] + axes @ end.point - data.xpos[root], own.T @ axes @ end.axes
    return plan.body_names[root], Placement(own.T @ point, turned[:, 2], turned[:, 0])
