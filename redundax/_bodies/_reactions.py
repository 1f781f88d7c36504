"""Force and moment of a joint on its bodies, whatever the joint; and of an applied load

    force = -(d Phi / d r_i)^T lam,   moment about the body's origin = -(d Phi / d phi_i)^T lam

the part of -Phi_q^T lam that belongs to body i: -lam for a revolute joint, +lam along the normal and -lam about the
point of contact for a translational one; with j for i that on body j, which is opposite unless the ground takes a part,
as from a coupling of angles. The moment about another point p is that about r_i less (p - r_i) x force.
"""

from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from .._system._state import State
from .._tools._compilation import compiled
from ._joint_coordinates import coefficients
from ._mechanism import Mechanism
from ._pose import poses
from ._stack import Stack


def joint_wrenches(mechanism: Mechanism, state: State, multipliers: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each stack of joints the forces (size, 2), N, and moments about r_i (size,), N m, on the bodies i."""
    stacks = zip(mechanism.rows_of_joints, jax.device_get(_on_i(mechanism.joints, state)), strict=True)
    found = [np.einsum("swr,sr->sw", by_row, multipliers[rows]) for rows, by_row in stacks]
    return [(each[:, :2], each[:, 2]) for each in found]


def joint_outputs(mechanism: Mechanism, state: State) -> tuple[list[str], np.ndarray]:
    """Names of the reactions of all joints, and their coefficients of the multipliers, shape (outputs, m)."""
    out = []
    for rows, matrix in _by_joint(mechanism, state):
        wrench = np.zeros((len(matrix), len(mechanism.rows)))
        wrench[:, rows] = matrix
        out.append(wrench)
    return list(mechanism.names.reactions.labels), np.concatenate(out)


def reactions(mechanism: Mechanism, state: State, multipliers: np.ndarray) -> np.ndarray:
    """The reactions of `joint_outputs`, (outputs,), joint by joint."""
    return np.concatenate([matrix @ multipliers[rows] for rows, matrix in _by_joint(mechanism, state)])


def _by_joint(mechanism: Mechanism, state: State) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Rows of each joint, and the coefficients of its reactions."""
    found = jax.device_get(coefficients(mechanism.joint_coordinates, state))
    for all_rows, parts in zip(mechanism.rows_of_joints, found, strict=True):
        for rows, matrix, reads in zip(all_rows, *parts, strict=True):
            yield rows, np.where(reads, matrix, 0.0)


def load_wrenches(mechanism: Mechanism, stack: Any, state: State) -> tuple[Any, Any]:
    """Wrenches of stacked loads on their bodies i and j, moments about the bodies' origins."""
    bodies = mechanism.frame.motions(mechanism.body, state)
    return stack.over(lambda load, i, j: load.wrenches(i, j, state.t), bodies)


def moment_about(moment: np.ndarray | np.floating | float, force: np.ndarray, arm: np.ndarray) -> Any:
    """The moment of a wrench about a point at `arm` from where it is known."""
    return moment - arm[0] * force[1] + arm[1] * force[0]


@compiled
def _on_i(joints: tuple[Stack, ...], state: State) -> list[Any]:
    """Force and moment about the origin of each body i by the multipliers of its joint's rows, (size, 3, rows)."""
    body = poses(state.q).with_axes()
    return [stack.over(lambda joint, i, j: -joint.jacobian(i, j, state.t).T[:3], body) for stack in joints]
