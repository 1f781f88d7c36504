"""The nature of a position: how much self-stress is there at this position only, and which loads are unique only here.

With K the scaled Jacobian, N and V bases of self-stress and motions, dK(w) the change of K along a motion w,

    N^T dK(w) z   is zero for all motions w, z   where the rank is the same beside the position,
    dP = -P dK K^+ - (P dK K^+)^T                is the change of the self-stress,
    dK(w) z = (Phi''[w + z] - Phi''[w] - Phi''[z]) / 2   but for what no self-stress sees

where the last holds of rows that have a Phi, and with rows of velocity dK(w) is formed whole.

The span of N^T dK(w) V over all w is the self-stress that vanishes beside the position: to second order, so what is
found is there at least. All of it is linear in w: the motions that show no more than those before them are a subspace,
and unless that is the whole space, one of no symmetry is not in it. So a few motions, one after another, tell what all
of them do, each by one matrix of the size of K, from second derivatives along directions.
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Array, Bool, Float

from .._equations._factorisation import Factorisation
from .._equations._kinematics import change_of_jacobian, second_derivative
from .._system._state import State
from .._system._system import AbstractSystem

_CHANGES = 1e-4  # relative change of a projector that is more than the blur of a state beside the manifold
_IDLE = 2  # motions in a row that show no more: one by chance with odds of `_CHANGES`, both with its square


def local_self_stress(system: AbstractSystem, state: State, factor: Factorisation) -> int:
    """How many self-stress states are there at this position alone, at least; known numbers."""
    motions, seen, counts = _basis(factor.split.motion, int(factor.freedom)), np.zeros((int(factor.redundancy), 0)), [0]
    for bends, _ in _changes(system, state, factor, motions):
        axes, sizes, _ = np.linalg.svd(np.hstack([seen, bends @ motions]), full_matrices=False)
        seen = axes * sizes
        counts.append(int(np.sum(sizes > _CHANGES * sizes[0])))
        if counts[-1] == len(seen) or counts[-_IDLE:] == counts[-_IDLE - 1 : -1]:
            break
    return counts[-1]


def unique_only_here(
    system: AbstractSystem, state: State, factor: Factorisation, unique: Bool[np.ndarray, " m"]
) -> Bool[np.ndarray, " m"]:
    """Which of the unique multipliers are so at this position alone; known numbers."""
    found, largest, idle = np.zeros_like(unique), 0.0, 0
    motions, inverse = _basis(factor.split.motion, int(factor.freedom)), np.asarray(factor.split.inverse, float)
    for bends, size in _changes(system, state, factor, motions):
        largest, before = max(largest, size), found
        turned = np.linalg.norm(bends @ inverse, axis=0)
        found = found | (unique & (turned > _CHANGES * largest))
        idle = 0 if np.any(found & ~before) else idle + 1
        if idle == _IDLE:
            break
    return found


def _changes(
    system: AbstractSystem, state: State, factor: Factorisation, motions: Float[np.ndarray, "n f"]
) -> Iterator[tuple[Float[np.ndarray, "k n"], float]]:
    """N^T dK(w) and the largest entry of dK(w), for each w of a basis; none where there is no self-stress."""
    stress, system = _basis(factor.split.stress, int(factor.redundancy)), system.without_friction
    columns, rows = (np.asarray(scale, float) for scale in (factor.scaling.coordinates, factor.row_scale))
    if not stress.size or not motions.size:
        return

    def bend(direction: np.ndarray) -> np.ndarray:
        along = (columns * direction).astype(factor.gamma.dtype)
        return np.asarray(second_derivative(system, state, along, np.zeros_like(state.t)), float) / rows

    if system.velocity_rows:
        for motion in motions.T:
            along = (columns * motion).astype(factor.gamma.dtype)
            change = np.asarray(change_of_jacobian(system, state, along, np.zeros_like(state.t)), float)
            change = change * columns / rows[:, None]
            yield stress.T @ change, float(np.abs(change).max())
        return

    axes = np.eye(len(columns))
    own = np.stack([bend(axis) for axis in axes], axis=1)
    for motion in motions.T:
        both = np.stack([bend(motion + axis) for axis in axes], axis=1)
        change = (both - own - bend(motion)[:, None]) / 2
        yield stress.T @ change, float(np.abs(change).max())


def _basis(projector: Float[Array, "d d"], rank: int) -> Float[np.ndarray, "d r"]:
    """An orthonormal basis of no symmetry of the range of a projector; none where a declared rank is impossible."""
    random = np.random.default_rng(11).normal(size=(len(projector), max(rank, 0)))
    return np.linalg.qr(np.asarray(projector, float) @ random)[0]
