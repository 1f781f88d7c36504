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

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .._equations._kinematics import AlongMotion, along_motion
from .._equations._rank import split
from .._equations._response import AbstractFactorisation, Pick, Response
from .._equations._scaling import Scaling
from .._system._state import State
from .._system._system import AbstractSystem
from ._held_sparse import SparseHeld, SparseHeldFactorisation, factorize_sparse, hold_sparse


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


class HeldFactorisation(AbstractFactorisation[Array]):
    """The equations at a state, factorised with the rank held; rows scaled.

    - `held`: what is held.
    - `rows`: B, shape (m, n).
    - `motion`: Phi, its rate and gamma, not scaled.
    - `inverse_mass`, `response`: M^-1, shape (n, n) or its diagonal, and M^-1 B^T, shape (n, m).
    - `gram`: B M^-1 B^T, shape (m, m).
    - `factor`, `whitening`: the lower Cholesky factor L of R, and L^-1 for more than one solve; shape (m, m).
    """

    held: Held
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

    def respond(
        self, forces: Float[Array, "n p"], gamma: Float[Array, "m p"] | None = None, *, once: bool = False
    ) -> Response:
        """As of any factorisation, with U (B a - D^-1 gamma) = 0; `once` says that nothing else is asked of it."""
        scale = self.held.row_scale[:, None]
        gamma = jnp.zeros((len(self.rows), forces.shape[1]), forces.dtype) if gamma is None else gamma / scale
        if self.held.singular:
            forces = forces + self.rows.T @ gamma
        free = _times(self.inverse_mass, forces)
        mu = self.held_inverse(self.rows @ free - gamma, once=once)
        return Response(free - self.response @ mu, mu / scale)

    def held_inverse(self, residual: Float[Array, "m ..."], *, once: bool = False) -> Float[Array, "m ..."]:
        """U R^-1 U of a scaled residual; M^-1 B^T times it is the least change that meets the held rows."""
        projector = self.held.projector
        inside = residual - projector @ residual
        if once:
            mu = jax.scipy.linalg.cho_solve((self.factor, True), inside)
        else:
            mu = self.whitening.T @ (self.whitening @ inside)
        return mu - projector @ mu

    def close(self, compliance: Float[Array, "m m"]) -> tuple[Pick, Array]:
        """As of any factorisation; the evidence is |B^T X|."""
        scale = self.held.row_scale
        response, excess = self.stress_response(compliance / scale[:, None] / scale)
        return Pick(response / scale[:, None] / scale, compliance, passes=1), excess

    def stress_response(self, compliance: Float[Array, "m m"] | None) -> tuple[Float[Array, "m m"], Float[Array, ""]]:
        """G of scaled rows under a scaled compliance, I if None; and |B^T X|."""
        projector = self.held.projector
        spanned = projector - self.held_inverse(self.gram @ projector)
        return _spanned_response(spanned, projector, compliance), jnp.max(jnp.abs(self.rows.T @ spanned))

    def nearest(self, off: Float[Array, " m"]) -> Float[Array, " n"]:
        """The least change by which the held rows change as much."""
        return self.response @ self.held_inverse(off / self.held.row_scale)

    def renewed(self, held: Any) -> tuple[Held, Float[Array, ""]]:
        """The same rank held by the self-stress found here, and how much the rows that it leaves out contribute."""
        projector, excess = jax.lax.stop_gradient(self.stress_response(None))
        return eqx.tree_at(lambda held: held.projector, held, projector), excess


AnyHeld = Held | SparseHeld
AnyHeldFactorisation = HeldFactorisation | SparseHeldFactorisation


@eqx.filter_jit  # traced once, for the many places that it stands in
def factorize_held(system: AbstractSystem, state: State, held: AnyHeld) -> AnyHeldFactorisation:
    """Assemble and factorise at a state."""
    if isinstance(held, SparseHeld):
        return factorize_sparse(system, state, held)
    rows = system.jacobian(state.q, state.t) / held.row_scale[:, None]
    inverse_mass = held.inverse_mass
    if inverse_mass is None:
        mass = system.mass(state.q, state.t)
        inverse_mass = _inverse(mass + rows.T @ rows if held.singular else mass)
    response = _times(inverse_mass, rows.T)
    gram = rows @ response
    out = jnp.eye(gram.shape[0], dtype=gram.dtype) - held.projector
    factor, whitening = _whitening(out @ gram @ out + held.projector)
    return HeldFactorisation(held, rows, along_motion(system, state), inverse_mass, response, gram, factor, whitening)


def _whitening(matrix: Array) -> tuple[Array, Array]:
    """The Cholesky factor L, and L^-1: two LAPACK calls, which a batch pays for one by one."""
    factor = jnp.linalg.cholesky(matrix, symmetrize_input=False)
    one = jnp.eye(matrix.shape[0], dtype=matrix.dtype)
    return factor, jax.scipy.linalg.solve_triangular(factor, one, lower=True)


def _times(inverse_mass: Array, force: Float[Array, "n p"]) -> Float[Array, "n p"]:
    """M^-1 times columns."""
    return inverse_mass @ force if inverse_mass.ndim == 2 else inverse_mass[:, None] * force


def _inverse(matrix: Array) -> Array:
    _, whitening = _whitening((matrix + matrix.T) / 2)
    return whitening.T @ whitening


def _spanned_response(spanned: Array, projector: Array, compliance: Array | None) -> Float[Array, "m m"]:
    """X (X^T W X + w (I - P))^-1 X^T for an X that spans the self-stress with X P = X."""
    inside = spanned.T @ (spanned if compliance is None else compliance @ spanned)
    size = jnp.trace(inside) / (2 * jnp.maximum(jnp.trace(projector), 1.0))
    size = jnp.where(size > 0, size, 1.0)
    kept = jnp.eye(inside.shape[0], dtype=inside.dtype) - projector
    half = _whitening(inside / size + kept)[1] @ spanned.T
    return half.T @ half / size


def hold(
    system: AbstractSystem, state: State, scale: Scaling, rank: Int[Array, ""], *, singular: bool
) -> tuple[AnyHeld, Int[Array, ""]]:
    """Hold a rank at a state, and the rank found there; `singular` says whether M may be singular."""
    if system.plan is not None:
        return hold_sparse(system, state, rank)
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
