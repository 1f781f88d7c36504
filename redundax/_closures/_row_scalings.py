"""Generalised inverses that weight the constraint rows by their own numbers, for comparison.

    K = diag(e) Phi_q diag(f),   lam = e mu,   least |mu|:   W = diag(1 / e^2), d = 0

row-normalised ([26]): f = 1 and e such that the rows of K have unit length; unit-consistent (Uhlmann): e and f such
that in every row and column of K the entries that are not zero have the geometric mean 1, by least squares of
log |K_ij| = log |Phi_ij| + r_i + c_j. Neither is a property of the joints: the first changes with units, and both with
the axes in which the constraints are written and with the points whose coordinates describe the bodies.
"""

import jax.numpy as jnp
from jaxtyping import Array

from .._equations._kinematics import model_at
from .._equations._scaling import scaling
from .._system._state import State
from .._system._system import AbstractSystem
from ._closure import AbstractClosure

_ZERO = 1e-10  # entry of the scaled Jacobian that is rounding


class RowNormalised(AbstractClosure):
    """The least norm of the multipliers of rows scaled to unit length.

    ??? example

        ```python
        rx.solve(mechanism, state, closure=rx.RowNormalised()).multipliers
        ```
    """

    def compliance(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        matrix = system.jacobian(state.q, state.t)
        return jnp.diag(jnp.sum(matrix**2, axis=1)), jnp.zeros_like(matrix[:, 0])


class UnitConsistent(AbstractClosure):
    """Uhlmann's unit-consistent inverse of the Jacobian: the same load in all units, but not in all axes.

    ??? example

        ```python
        rx.solve(mechanism, state, closure=rx.UnitConsistent()).multipliers
        ```
    """

    def compliance(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        model = model_at(system, state)
        matrix, scales = model.jacobian, scaling(system, model)
        some = jnp.abs(scales.scaled(matrix)) > _ZERO
        logs = jnp.where(some, jnp.log(jnp.where(some, jnp.abs(matrix), 1.0)), 0.0)
        counts = some.astype(matrix.dtype)
        # normal equations of the least squares, singular in one direction for each block of the matrix
        normal = jnp.block([[jnp.diag(counts.sum(axis=1)), counts], [counts.T, jnp.diag(counts.sum(axis=0))]])
        right = -jnp.concatenate([logs.sum(axis=1), logs.sum(axis=0)])
        log_e = (jnp.linalg.pinv(normal, hermitian=True) @ right)[: matrix.shape[0]]
        return jnp.diag(jnp.exp(-2 * log_e)), jnp.zeros_like(matrix[:, 0])
