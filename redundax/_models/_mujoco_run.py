"""A run of a model in MuJoCo, and the loads of joints that its constraint forces make

What closes loops bears J^T f, with f of MuJoCo's solver; what the tree holds is the wrench between a body and the one
that it hangs on, without what acts along the joint's own coordinate.
"""

from types import ModuleType

import numpy as np

from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._optional import optional
from ._description import End, Joint, Loop
from ._mujoco_model import TORQUE_SCALE, Origin, body_ends
from ._mujoco_types import MujocoData, MujocoModel
from ._series import BodySeries, ReactionSeries, Series
from ._tree import Poses, Tree

_MOST = 201  # times that are kept
_UNSTABLE = 1e10  # rad/s^2 or m/s^2: what MuJoCo itself takes for unstable


def run(tree: Tree, positions: np.ndarray, seconds: float) -> Series:
    """Positions and velocities of all bodies and loads of all joints and loops over time, from rest at positions of the
    joints; without contact, limits of joints and drives, which redundax leaves out too.

    **Raises:** `RedundaxError` for a model that MuJoCo does not run, `NoSolutionError` where it becomes unstable.
    """
    origin = tree.description.origin
    if not isinstance(origin, Origin):
        raise RedundaxError(
            f"Argument `path` must be a model that MuJoCo runs, but is {tree.description.format}. Name a log of it."
        )
    lost = [loop.name for loop in tree.loops if loop.name not in origin.equalities]
    if lost:
        raise RedundaxError(
            f"Argument `path` must have loops that MuJoCo has, but '{lost[0]}' is none. Write it as `connect` or "
            "`weld` of MJCF, or in a file of closures."
        )
    mujoco = optional("mujoco", "models")
    model = origin.model.__copy__()
    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= int(flags.mjDSBL_CONTACT | flags.mjDSBL_LIMIT | flags.mjDSBL_ACTUATION)
    data = mujoco.MjData(model)
    data.qpos[:] = positions
    steps = max(1, round(seconds / model.opt.timestep))
    every = max(1, -(-steps // (_MOST - 1)))
    times, states, parts = [], [], []
    for step in range(steps + 1):
        if step % every == 0:
            mujoco.mj_forward(model, data)
            mujoco.mj_rnePostConstraint(model, data)
            if not np.all(np.isfinite(data.qacc)) or np.abs(data.qacc).max(initial=0.0) > _UNSTABLE:
                raise NoSolutionError(
                    f"MuJoCo's run becomes unstable at t = {data.time:.4g}. Give the file a shorter timestep."
                )
            times.append(data.time)
            states.append(_states(tree, data))
            parts.append(_loads(mujoco, tree, origin, model, data))
        mujoco.mj_step(model, data)
    bodies = {
        name: BodySeries(*(np.stack([state[name][k] for state in states]) for k in range(4))) for name in states[0]
    }
    reactions = {
        name: ReactionSeries(on, point, *(np.stack([part[name][k] for part in parts]) for k in (2, 3)))
        for name, (on, point, _, _) in parts[0].items()
    }
    return Series(np.array(times), bodies, reactions)


def _states(tree: Tree, data: MujocoData) -> dict[str, tuple[np.ndarray, ...]]:
    """Position, axes, velocity and angular velocity of each body."""
    poses, found = tree.at(data.qpos.copy()), {}
    for k, body in enumerate(tree.description.bodies[1:], 1):
        place = poses.turns[k] @ body.position + poses.shifts[k]
        moves, spins = tree.velocities_at(poses, k, place)
        found[body.name] = place, poses.turns[k] @ body.axes, moves @ data.qvel, spins @ data.qvel
    return found


def _loads(
    mujoco: ModuleType, tree: Tree, origin: Origin, model: MujocoModel, data: MujocoData
) -> dict[str, tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """Of joints and loops the body, the point in its frame, the force and the moment about it, global."""
    poses = tree.at(data.qpos.copy())
    found = {}
    for number, joint in enumerate(tree.joints):
        if joint.kind != "free":
            wrench = _of_joint(model, data, number, joint, poses)
            found[joint.name] = (*_placed(tree, joint.child), *wrench)
    for loop in tree.loops:
        wrench = _of_loop(mujoco, model, data, origin.equalities[loop.name], loop)
        if loop.kind == "distance joint":  # MuJoCo's row is the length of a tendon
            apart = poses.point(loop.first) - poses.point(loop.second)
            wrench = wrench[0].sum() * apart / np.linalg.norm(apart), np.zeros(3)
        found[loop.name] = (*_placed(tree, loop.first), *wrench)
    return found


def _placed(tree: Tree, end: End) -> tuple[str, np.ndarray]:
    body = tree.description.body(end)
    return body.name, body.axes.T @ (end.point - body.position)


def _of_joint(
    model: MujocoModel, data: MujocoData, number: int, joint: Joint, poses: Poses
) -> tuple[np.ndarray, np.ndarray]:
    """What the body on a joint is held by: MuJoCo's wrench is about the centre of mass of the whole tree."""
    body = int(model.jnt_bodyid[number])
    moment, force = data.cfrc_int[body, :3].copy(), data.cfrc_int[body, 3:].copy()
    point, axis = poses.point(joint.child), poses.axes(joint.child)[:, 2]
    moment += np.cross(data.subtree_com[model.body_rootid[body]] - point, force)
    if joint.kind == "ball":
        return force, np.zeros(3)
    if joint.kind == "slide":
        return force - axis * (axis @ force), moment
    return force, moment - axis * (axis @ moment)


def _of_loop(
    mujoco: ModuleType, model: MujocoModel, data: MujocoData, number: int, loop: Loop
) -> tuple[np.ndarray, np.ndarray]:
    """On the first body of a loop: the rows of MuJoCo are the offset of the first point from the second, and for a weld
    the vector part of conj(p) p' of the orientations p of the second and p' of the first."""
    rows = (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY) & (data.efc_id == number)
    own = np.asarray(data.efc_force)[rows]
    if not own.size:  # MuJoCo leaves out what no joint of its tree can move
        return np.zeros(3), np.zeros(3)
    if own.size < 6:
        return own[:3].copy(), np.zeros(3)
    moment = np.zeros(3)
    if loop.kind == "weld":
        first, second = _orientations(mujoco, model, data, number)
        back, half = np.zeros(4), 0.5 * float(model.eq_data[number, TORQUE_SCALE])
        mujoco.mju_negQuat(back, second)
        for k in range(3):
            one, two, unit = np.zeros(4), np.zeros(4), np.eye(4)[k + 1]
            mujoco.mju_mulQuat(one, back, unit)
            mujoco.mju_mulQuat(two, one, first)
            moment[k] = half * (two[1:] @ own[3:6])
    return own[:3].copy(), moment


def _orientations(
    mujoco: ModuleType, model: MujocoModel, data: MujocoData, number: int
) -> tuple[np.ndarray, np.ndarray]:
    """Of both ends of a weld, as quaternions."""
    ends = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
    if model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE:
        found = np.zeros((2, 4))
        for place, site in zip(found, ends, strict=True):
            mujoco.mju_mat2Quat(place, data.site_xmat[site])
        return found[0], found[1]
    first, (_, _, axes) = np.zeros(4), body_ends("weld", *ends, model.eq_data[number])[0]
    relative = np.zeros(4)
    mujoco.mju_mat2Quat(relative, axes.ravel())
    mujoco.mju_mulQuat(first, data.xquat[ends[0]], relative)
    return first, data.xquat[ends[1]].copy()
