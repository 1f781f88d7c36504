"""The index-1 equations (7) along a motion, with the rank and the row combinations held.

With rows scaled by D, B = D^-1 Phi_q, and P0 a projector near the self-stress of B, U = I - P0 picks as many
combinations of rows as the rank r, and they are independent wherever no self-stress lies in their span:

    R = U B M^-1 B^T U + P0,
    a = M^-1 (f - B^T mu),   mu = U R^-1 U (B M^-1 f - g)                 so that U (B a - g) = 0.

On the manifold U (B a - g) = 0 says the same as B a = g, whatever P0. Off it, where the stages of a Runge-Kutta step
lie, the redundant rows contradict the others by as much as the state is off; held combinations leave them out, where a
rank decided anew would count them as independent. R is positive definite: one Cholesky factorisation a stage and no
singular value decomposition. D makes the diagonal of B M^-1 B^T about 1.

The self-stress at the state follows from P0 too: X = P0 - U R^-1 U B M^-1 B^T P0 spans it, and under the compliance W
and misfit d of a closure, both scaled,

    mu + G (d - W mu),   G = X (X^T W X + w U)^-1 X^T.

For W = I this G is the orthogonal projector onto the self-stress, which is held from there on: it follows the motion
and keeps its rank without a decision.

Where M is singular, M + B^T B and f + B^T g stand for M and f: the same solutions, positive definite iff (14).
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .._equations._kinematics import AlongMotion, along_motion
from .._equations._rank import split
from .._equations._scaling import Scaling
from .._system._state import State
from .._system._system import AbstractSystem


class Held(eqx.Module):
    """What is held while the motion goes on.

    - `projector`: P0, shape (m, m).
    - `row_scale`: D, shape (m,).
    - `inverse_mass`: M^-1, shape (n, n), where it is constant and regular; of a diagonal M its diagonal, shape (n,).
    - `singular`: whether M may be singular.
    """

    projector: Float[Array, "m m"]
    row_scale: Float[Array, " m"]
    inverse_mass: Float[Array, "n n"] | Float[Array, " n"] | None
    singular: bool = eqx.field(static=True)


class Kinetics(NamedTuple):
    """The matrices at a state, factorised; rows scaled.

    - `rows`: B, shape (m, n).
    - `motion`: Phi, its rate and gamma, not scaled.
    - `inverse_mass`, `response`: M^-1, shape (n, n) or its diagonal, and M^-1 B^T, shape (n, m).
    - `gram`: B M^-1 B^T, shape (m, m).
    - `factor`, `whitening`: the lower Cholesky factor L of R, and L^-1 for more than one solve; shape (m, m).
    """

    rows: Float[Array, "m n"]
    motion: AlongMotion
    inverse_mass: Float[Array, "n n"] | Float[Array, " n"]
    response: Float[Array, "n m"]
    gram: Float[Array, "m m"]
    factor: Float[Array, "m m"]
    whitening: Float[Array, "m m"]

    @property
    def pivots(self) -> Float[Array, " m"]:
        """Diagonal of L."""
        return jnp.diagonal(self.factor)


@eqx.filter_jit  # traced once, for the many places that it stands in
def kinetics(system: AbstractSystem, state: State, held: Held) -> Kinetics:
    """Assemble and factorise at a state."""
    rows = system.jacobian(state.q, state.t) / held.row_scale[:, None]
    inverse_mass = held.inverse_mass
    if inverse_mass is None:
        mass = system.mass(state.q, state.t)
        inverse_mass = _inverse(mass + rows.T @ rows if held.singular else mass)
    response = _times(inverse_mass, rows.T)
    gram = rows @ response
    out = jnp.eye(gram.shape[0], dtype=gram.dtype) - held.projector
    factor, whitening = _whitened(out @ gram @ out + held.projector)
    return Kinetics(rows, along_motion(system, state), inverse_mass, response, gram, factor, whitening)


def _whitened(matrix: Array) -> tuple[Array, Array]:
    """The Cholesky factor L, and L^-1: two LAPACK calls, which a batch pays for one by one."""
    factor = jnp.linalg.cholesky(matrix, symmetrize_input=False)
    one = jnp.eye(matrix.shape[0], dtype=matrix.dtype)
    return factor, jax.scipy.linalg.solve_triangular(factor, one, lower=True)


def _times(inverse_mass: Array, force: Float[Array, "n p"]) -> Float[Array, "n p"]:
    """M^-1 times columns."""
    return inverse_mass @ force if inverse_mass.ndim == 2 else inverse_mass[:, None] * force


def _inverse(matrix: Array) -> Array:
    _, whitening = _whitened((matrix + matrix.T) / 2)
    return whitening.T @ whitening


def respond(
    parts: Kinetics, held: Held, force: Float[Array, "n p"], gamma: Float[Array, "m p"], *, once: bool = False
) -> tuple[Float[Array, "n p"], Float[Array, "m p"]]:
    """Accelerations a and scaled multipliers mu of M a + B^T mu = force, U (B a - gamma) = 0, for each column.

    `once` says that nothing else is asked of the matrices.
    """
    if held.singular:
        force = force + parts.rows.T @ gamma
    free = _times(parts.inverse_mass, force)
    mu = held_inverse(parts, held, parts.rows @ free - gamma, once=once)
    return free - parts.response @ mu, mu


def held_inverse(
    parts: Kinetics, held: Held, residual: Float[Array, "m ..."], *, once: bool = False
) -> Float[Array, "m ..."]:
    """U R^-1 U of a scaled residual; M^-1 B^T times it is the least change that meets the held rows.

    `once` as in `respond`.
    """
    inside = residual - held.projector @ residual
    if once:
        mu = jax.scipy.linalg.cho_solve((parts.factor, True), inside)
    else:
        mu = parts.whitening.T @ (parts.whitening @ inside)
    return mu - held.projector @ mu


def stress_response(
    parts: Kinetics, held: Held, compliance: Float[Array, "m m"] | None
) -> tuple[Float[Array, "m m"], Float[Array, ""]]:
    """G: scaled self-stress that a scaled misfit causes under a scaled compliance, I if None; and |B^T X|."""
    spanned = held.projector - held_inverse(parts, held, parts.gram @ held.projector)
    return _spanned_response(spanned, held.projector, compliance), jnp.max(jnp.abs(parts.rows.T @ spanned))


def _spanned_response(spanned: Array, projector: Array, compliance: Array | None) -> Float[Array, "m m"]:
    """X (X^T W X + w (I - P))^-1 X^T for an X that spans the self-stress with X P = X."""
    inside = spanned.T @ (spanned if compliance is None else compliance @ spanned)
    size = jnp.trace(inside) / (2 * jnp.maximum(jnp.trace(projector), 1.0))
    size = jnp.where(size > 0, size, 1.0)
    kept = jnp.eye(inside.shape[0], dtype=inside.dtype) - projector
    half = _whitened(inside / size + kept)[1] @ spanned.T
    return half.T @ half / size


def hold(
    system: AbstractSystem, state: State, scale: Scaling, rank: Int[Array, ""], *, singular: bool
) -> tuple[Held, Int[Array, ""]]:
    """Hold a rank at a state, and the rank found there; `singular` says whether M may be singular."""
    matrix = system.jacobian(state.q, state.t)
    position = jnp.max(jnp.abs(system.constraint(state.q, state.t)) / scale.rows) / scale.size
    parts, spectrum = split(matrix * scale.coordinates / scale.rows[:, None], position, rank)
    found = jnp.sum(spectrum.singular_values > spectrum.tolerance)
    return held_by(system, state, scale, parts.stress, singular=singular), found


def held_by(
    system: AbstractSystem, state: State, scale: Scaling, stress: Float[Array, "m m"], *, singular: bool
) -> Held:
    """Hold the rank that the projector onto the self-stress of the scaled rows has; `singular` as in `hold`."""
    matrix, mass = system.jacobian(state.q, state.t), system.mass(state.q, state.t)
    if singular:  # rows as heavy as M, so that M + B^T B is well conditioned
        heavy = jnp.trace(mass) / mass.shape[0] / jnp.mean(jnp.sum(matrix**2, axis=1))
        mass = mass + heavy * matrix.T @ matrix
    if system.diagonal_mass and not singular:
        own = jnp.diagonal(mass)
        inverse_mass = 1 / jnp.where(own > 0, own, jnp.nan)
    else:
        inverse_mass = _inverse(mass + 0.0 * stress[0, 0])  # two LAPACK calls side by side can hang
    row_scale = jnp.sqrt(jnp.sum(matrix.T * _times(inverse_mass, matrix.T), axis=0))
    row_scale = jnp.where(row_scale > 0, row_scale, 1.0)
    projector = _spanned_response((row_scale / scale.rows)[:, None] * stress, stress, None)
    held = jax.lax.stop_gradient((projector, row_scale))
    constant = system.constant_mass and not singular
    return Held(*held, inverse_mass if constant else None, singular)


def renewed(held: Held, parts: Kinetics) -> tuple[Held, Float[Array, ""]]:
    """The same rank held by the self-stress found here, and how much the rows that it leaves out contribute."""
    projector, excess = jax.lax.stop_gradient(stress_response(parts, held, None))
    return Held(projector, held.row_scale, held.inverse_mass, held.singular), excess
