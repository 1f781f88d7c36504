"""Force and moment of a joint on its bodies, whatever the joint; and of an applied load

    force = -(d Phi / d r_i)^T lam,   moment about the body's origin = -(d Phi / d phi_i)^T lam

the part of -Phi_q^T lam that belongs to body i: -lam for a revolute joint, +lam along the normal and -lam about the
point of contact for a translational one; with j for i that on body j, which is opposite unless the ground takes a part,
as from a coupling of angles. The moment about another point p is that about r_i less (p - r_i) x force.
"""

from typing import Any

import jax
import numpy as np

from .._system._state import State
from .._tools._compilation import compiled
from ._body import poses
from ._joint_coordinates import loads_by_row
from ._loads import Motion, Wrench
from ._mechanism import Mechanism
from ._stack import Stack

# Arm of a force about a point that it passes through, relative to its distance from the body's origin: rounding, and
# how far a joint is from being closed. Share of a force along an axis that it is square to: how far a body is turned.
_CLOSED = 1e-9


def joint_wrenches(mechanism: Mechanism, state: State, multipliers: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each stack of joints the forces (size, 2), N, and moments about r_i (size,), N m, on the bodies i."""
    wrenches = zip(mechanism.rows_of_joints, _wrenches(mechanism, state), strict=True)
    found = [np.einsum("swr,sr->sw", by_row, multipliers[rows]) for rows, ((by_row, _), _) in wrenches]
    return [(each[:, :2], each[:, 2]) for each in found]


def joint_outputs(mechanism: Mechanism, state: State) -> tuple[list[str], np.ndarray]:
    """Names and coefficients of the multipliers, shape (3 joints, m), of each joint's force (x, y) and moment.

    They act on its body i, or on body j where i is the ground, in global components; the moment is about the joint's
    point on that body, or about the body's origin where it has none.
    """
    out, ground = [], len(mechanism.names.bodies)
    stacks = zip(mechanism.joints, mechanism.rows_of_joints, _wrenches(mechanism, state), strict=True)
    for stack, rows, (on_i, on_j) in stacks:
        on_ground = np.asarray(stack.i) == ground
        for k in range(len(rows)):
            by_row, arm = (part[k] for part in (on_j if on_ground[k] else on_i))
            whole = np.linalg.norm(by_row[:2], axis=0)
            force = np.where(np.abs(by_row[:2]) > _CLOSED * whole, by_row[:2], 0.0)
            moment, reach = moment_about(by_row[2], by_row[:2], arm), np.linalg.norm(arm) * whole
            moment = np.where(np.abs(moment) > _CLOSED * (np.abs(by_row[2]) + reach), moment, 0.0)
            wrench = np.zeros((3, len(mechanism.rows)))
            wrench[:, rows[k]] = np.vstack([force, moment])
            out.append(wrench)
    return list(mechanism.names.reactions.labels), np.concatenate(out)


def load_wrenches(stack: Any, state: State) -> tuple[Wrench, Wrench]:
    """Wrenches of stacked loads on their bodies i and j, moments about the bodies' origins."""
    bodies = Motion(poses(state.q), poses(state.qd))
    return stack.over(lambda load, i, j: load.wrenches(i, j, state.t), bodies)


def moment_about(moment: np.ndarray | float, force: np.ndarray, arm: np.ndarray) -> np.ndarray | float:
    """The moment of a wrench about a point at `arm` from where it is known."""
    return moment - arm[0] * force[1] + arm[1] * force[0]


def _wrenches(mechanism: Mechanism, state: State) -> list[tuple[tuple[np.ndarray, np.ndarray], ...]]:
    """For each stack `loads_by_row` of its joints: (size, 3, rows) and (size, 2) for the bodies i, and for the j."""
    return jax.tree.map(lambda x: x.astype(float), jax.device_get(_by_row(mechanism.joints, state)))


@compiled
def _by_row(joints: tuple[Stack, ...], state: State) -> list[Any]:
    body = poses(state.q).with_axes()
    return [stack.over(lambda joint, i, j: loads_by_row(joint, i, j, state.t), body) for stack in joints]
