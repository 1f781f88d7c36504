"""Force and moment of a joint on its bodies, whatever the joint; and of an applied load: see `_joint_coordinates`."""

from collections.abc import Iterator

import jax
import numpy as np

from .._system._state import State
from ._joint_coordinates import coefficients
from ._mechanism import Mechanism
from ._pose import Wrench
from ._space._pose import Wrench as SpatialWrench
from ._stack import Stack


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


def load_wrenches(
    mechanism: Mechanism, stack: Stack, state: State
) -> tuple[Wrench, Wrench] | tuple[SpatialWrench, SpatialWrench]:
    """Wrenches of stacked loads on their bodies i and j, moments about the bodies' origins."""
    bodies = mechanism.frame.motions(mechanism.body, state)
    return stack.over(lambda load, i, j: load.wrenches(i, j, state.t), bodies)
