"""The outputs of a system by name, as rows of a matrix on its unknowns.

    y = Y [qdd; lam; tau]

Accelerations are called "coordinate''", multipliers, with the sign of the paper, as their rows, friction "tau slip"; a
`Mechanism` has the force (global components) and the moment of every joint on a body too, "joint force x on body".
"""

from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._bodies._mechanism import Mechanism
from .._bodies._reactions import joint_outputs
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._compilation import compiled
from .._tools._json import JSON

_SHARE = 1e-2


def outputs(system: AbstractSystem, state: State) -> dict[str, tuple[list[str], np.ndarray]]:
    """Names and coefficients (outputs, n + m + p) of each "acceleration", "multiplier", "friction" and "reaction"."""
    n, m = len(system.coordinates), len(system.rows)
    names = system.names.unknowns.labels
    identity = np.eye(len(names))
    parts = {"acceleration": slice(0, n), "multiplier": slice(n, n + m), "friction": slice(n + m, None)}
    out = {kind: (list(names[part]), identity[part]) for kind, part in parts.items()}
    base = system.undriven  # whose rows come before those of drives
    if isinstance(base, Mechanism):
        joints, wrenches = joint_outputs(base, state)
        out["reaction"] = joints, np.pad(wrenches, ((0, 0), (n, len(names) - n - wrenches.shape[1])))
    return out


def joint_accelerations(system: AbstractSystem, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations of the joint coordinates: coefficients of [qdd; lam; tau], (c, n + m + p), and their rest (c,)."""
    slopes, rest = (np.asarray(part, float) for part in _joint_accelerations(system.anonymous, state))
    return np.pad(slopes, ((0, 0), (0, len(system.rows) + len(system.slips)))), rest


@compiled
def _joint_accelerations(system: AbstractSystem, state: State) -> tuple[Array, Array]:
    def found(acceleration: Array) -> Array:
        return system.joint_coordinates.motion(state, acceleration).acceleration

    none = jnp.zeros_like(state.qd)
    return jax.jacfwd(found)(none), found(none)


def evaluated(matrix: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Y x of values x, shape (..., n + m + p): NaN only for outputs that read an x that is."""
    lost = np.isnan(values)
    found = np.where(lost, 0.0, values) @ matrix.T
    return np.where(lost.astype(int) @ (matrix != 0).T > 0, np.nan, found)


def sizes(matrix: np.ndarray, kinds: Sequence[str], length: float | np.ndarray) -> np.ndarray:
    """What rounding of each entry is measured against: the largest of its column and kind, friction among the loads.

    Where nothing of a kind moves that is rounding too, so it is at least a share of the other kind, times a length.
    """
    kind_of, out = np.array([kind.removeprefix("friction ") for kind in kinds]), np.abs(matrix)
    for pair, lever in ((("linear", "angular"), length), (("force", "moment"), 1 / length)):
        largest = [out[kind_of == kind].max(axis=0, initial=0.0) for kind in pair]
        floors = _SHARE * largest[1] * lever, _SHARE * largest[0] / lever
        for kind, own, floor in zip(pair, largest, floors, strict=True):
            out[kind_of == kind] = np.maximum(own, floor)
    return out


def plain(value: JSON | np.ndarray | tuple) -> JSON:
    """Arrays and tuples as lists, NaN as None: data for JSON."""
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
