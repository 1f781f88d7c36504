"""Force and moment of a joint on its bodies, whatever the joint; and of an applied load

    force = -(d Phi / d r_i)^T lam,   moment about the body's origin = -(d Phi / d phi_i)^T lam

the part of -Phi_q^T lam that belongs to body i: -lam for a revolute joint, +lam along the normal and -lam about the
point of contact for a translational one; with j for i that on body j, which is opposite unless the ground takes a part,
as from a coupling of angles. The moment about another point p is that about r_i less (p - r_i) x force.
"""

from typing import Any

import jax
import numpy as np
from jaxtyping import Array

from .._system._state import State
from .._tools._compilation import compiled
from ._body import GROUND, Pose, poses
from ._joints import AbstractJoint
from ._loads import Motion, Wrench
from ._mechanism import Mechanism
from ._stack import Stack

# Arm of a force about a point that it passes through, relative to its distance from the body's origin: rounding, and
# how far a joint is from being closed. Share of a force along an axis that it is square to: how far a body is turned.
_CLOSED = 1e-9


def joint_wrenches(mechanism: Mechanism, state: State, multipliers: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each stack of joints the forces (size, 2), N, and moments about r_i (size,), N m, on the bodies i."""
    wrenches = zip(mechanism.rows_of_joints, _wrenches(mechanism, state), strict=True)
    found = [np.einsum("swr,sr->sw", by_row, multipliers[rows]) for rows, (by_row, *_) in wrenches]
    return [(each[:, :2], each[:, 2]) for each in found]


def joint_outputs(mechanism: Mechanism, state: State) -> tuple[list[str], np.ndarray]:
    """Names and coefficients of the multipliers, shape (3 joints, m), of each joint's force (x, y) and moment.

    They act on its body i, or on body j where i is the ground, in global components; the moment is about the joint's
    point on that body, or about the body's origin where it has none.
    """
    names, out = [], []
    bodies = (*mechanism.names.bodies, GROUND)
    stacks = zip(
        mechanism.joints, mechanism.names.joints, mechanism.rows_of_joints, _wrenches(mechanism, state), strict=True
    )
    for stack, joints, rows, (on_i, on_j, arms_i, arms_j) in stacks:
        of_i, of_j = np.asarray(stack.i), np.asarray(stack.j)
        for k, joint in enumerate(joints):
            i, j = bodies[of_i[k]], bodies[of_j[k]]
            on, by_row, arm = (j, on_j[k], arms_j[k]) if i == GROUND else (i, on_i[k], arms_i[k])
            whole = np.linalg.norm(by_row[:2], axis=0)
            force = np.where(np.abs(by_row[:2]) > _CLOSED * whole, by_row[:2], 0.0)
            moment, reach = moved(by_row[2], by_row[:2], arm), np.linalg.norm(arm) * whole
            moment = np.where(np.abs(moment) > _CLOSED * (np.abs(by_row[2]) + reach), moment, 0.0)
            wrench = np.zeros((3, len(mechanism.rows)))
            wrench[:, rows[k]] = np.vstack([force, moment])
            names += [f"{joint} {part} on {on}" for part in ("force x", "force y", "moment")]
            out.append(wrench)
    return names, np.concatenate(out)


def load_wrenches(stack: Any, state: State) -> tuple[Wrench, Wrench]:
    """Wrenches of stacked loads on their bodies i and j, moments about the bodies' origins."""
    bodies = Motion(poses(state.q), poses(state.qd))
    return stack.over(lambda load, i, j: load.wrenches(i, j, state.t), bodies)


def moved(moment: np.ndarray | float, force: np.ndarray, arm: np.ndarray) -> np.ndarray | float:
    """The moment of a wrench about a point at `arm` from where it is known."""
    return moment - arm[0] * force[1] + arm[1] * force[0]


def _wrenches(mechanism: Mechanism, state: State) -> list[tuple[np.ndarray, ...]]:
    """For each stack force and moment about their origins on the bodies i, and j, by the multipliers of the joint's own
    rows, (size, 3, rows) each, and where the joints' points on them, if any, are from these origins, (size, 2) each.
    """
    out = []
    for slope, *arms in jax.device_get(_slopes(mechanism.joints, state)):
        wrench = -slope.swapaxes(1, 2).astype(float)
        out.append((wrench[:, :3], wrench[:, 3:], *arms))
    return out


@compiled
def _slopes(joints: tuple[Stack, ...], state: State) -> list[tuple[Array, Array, Array]]:
    def of_joint(joint: AbstractJoint, i: Pose, j: Pose) -> tuple[Array, Array, Array]:
        return joint.jacobian(i, j, state.t), _point(joint, "point_i", i) - i.r, _point(joint, "point_j", j) - j.r

    return [stack.over(of_joint, poses(state.q).with_axes()) for stack in joints]


def _point(joint: AbstractJoint, name: str, pose: Pose) -> Array:
    local = getattr(joint, name, None)
    return pose.r if local is None else pose.point(local)
