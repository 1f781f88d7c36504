"""The index-1 equations (7) along a motion, with the rank and the row combinations held.

With rows scaled by D, B = D^-1 Phi_q, and N0 an orthonormal basis near the self-stress of B, U = I - N0 N0^T picks as
many combinations of rows as the rank r, and they are independent wherever no self-stress lies in their span:

    R = B M^-1 B^T + N0 N0^T,   X = R^-1 N0,
    a = M^-1 (f - B^T mu),   mu = R^-1 (I - N0 X^T) (B M^-1 f - g)            so that U (B a - g) = 0.

On the manifold X spans the self-stress with N0^T X = I, and U (B a - g) = 0 says the same as B a = g, whatever N0. Off
it, where the stages of a Runge-Kutta step lie, the redundant rows contradict the others by as much as the state is off;
held combinations leave them out, where a rank decided anew would count them as independent. R is positive definite: one
Cholesky factorisation a stage and no singular value decomposition. D makes the diagonal of B M^-1 B^T about 1. Off the
manifold N0^T X is I up to the square of how far it is, and N0^T mu is 0 up to as much of what the rows contradict.

Under the compliance W and misfit d of a closure, both scaled,

    mu + G (d - W mu),   G = X (X^T W X)^-1 X^T = H H^T,   H = X L^-T,   L L^T = X^T W X.

For W = I this H is an orthonormal basis of the self-stress, which is held from there on: it follows the motion and
keeps its rank without a decision. Where the rank is traced, so that N0 has no shape, the projector N0 N0^T stands for
N0, and X^T W X + w U for X^T W X.

Where M is singular, M + B^T B and f + B^T g stand for M and f: the same solutions, positive definite iff (14).
"""

from typing import cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._equations._factorisation import Factorisation
from .._equations._kinematics import AlongMotion, along_motion, model_at
from .._equations._matrices import matrices_of
from .._equations._rank import split
from .._equations._response import (
    AbstractFactorisation,
    AbstractPick,
    AbstractSolvedFactorisation,
    Response,
    times,
    total,
)
from .._equations._scaling import Scaling
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import replace_fields
from .._tools._numbers import are_numbers, cholesky, or_one, solve_triangular, stop_gradient, xp
from .._tools._value import AbstractModule
from ._held_sparse import SparseHeld, SparseHeldFactorisation, hold_sparse
from ._linear import Asked, Linear, linear_of

# Squares of entries of self-stress, which is O(1), that are none: those of rounding would move rows by anything.
_COUPLED = 1e-9


class Held(AbstractModule):
    """What is held while the motion goes on.

    - `basis`: N0, shape (m, k); where it has m columns the projector N0 N0^T.
    - `row_scale`: D, shape (m,).
    - `inverse_mass`: M^-1, shape (n, n), where it is constant and regular; of a diagonal M its diagonal, shape (n,).
    - `singular`: whether M may be singular.
    """

    basis: Float[Array, "m k"]
    row_scale: Float[Array, " m"]
    inverse_mass: Float[Array, "n n"] | Float[Array, " n"] | None
    singular: bool = eqx.field(static=True)

    @property
    def projector(self) -> Float[Array, "m m"]:
        """N0 N0^T."""
        return self.basis if _is_projector(self.basis) else self.basis @ self.basis.T

    @property
    def rank(self) -> dict[str, Array]:
        """Fields that hold the rank, which have no derivatives; those of the mass have."""
        return {"basis": self.basis}

    def factorised(self, system: AbstractSystem, state: State) -> "HeldFactorisation":
        """Assemble and factorise at a state."""
        rows = system.jacobian(state.q, state.t) / self.row_scale[:, None]
        inverse_mass = self.inverse_mass
        if inverse_mass is None:
            mass = system.mass(state.q, state.t)
            inverse_mass = _inverse(mass + rows.T @ rows if self.singular else mass)
        response = _times(inverse_mass, rows.T)
        factor = cholesky(rows @ response + self.projector)
        stress = _solved(factor, self.basis)
        return HeldFactorisation(self, rows, along_motion(system, state), inverse_mass, response, factor, stress)

    def anew(
        self, system: AbstractSystem, state: State, scale: Scaling, rank: Int[Array, ""], redundancy: int | None
    ) -> tuple["Held", Int[Array, ""]]:
        """A rank held at another state, and the rank found there; `redundancy` is m - rank where that is no traced
        number."""
        matrix = system.jacobian(state.q, state.t)
        position = xp.max(xp.abs(scale.violations(system.constraint(state.q, state.t))))
        parts, spectrum = split(scale.scaled(matrix), position, rank)
        found = xp.sum(spectrum.singular_values > spectrum.tolerance)
        return held_by(system, state, scale, parts.stress, redundancy, singular=self.singular), found


class HeldPick(AbstractPick):
    """The pick by a root of G.

    - `root`: H, shape (m, k).
    - `compliance`: W, shape (m, m).
    """

    root: Float[Array, "m k"]
    compliance: Float[Array, "m m"]

    def __call__(self, multipliers: Array) -> Array:
        return multipliers - self.root @ (self.root.T @ (self.compliance @ multipliers))

    def caused(self, misfit: Array, rows: Array | None = None) -> Array:
        return (self.root if rows is None else self.root[rows]) @ times(self.root.T, misfit)

    def bound(self, misfit: Array) -> Array:
        return total(self.root @ self.root.T) * total(misfit)


class HeldFactorisation(AbstractFactorisation[Array]):
    """The equations at a state, factorised with the rank held; rows scaled.

    - `held`: what is held.
    - `rows`: B, shape (m, n).
    - `motion`: Phi, its rate and gamma, not scaled.
    - `inverse_mass`, `response`: M^-1, shape (n, n) or its diagonal, and M^-1 B^T, shape (n, m).
    - `factor`: the lower Cholesky factor of R, shape (m, m).
    - `stress`: X, shape (m, k).
    """

    held: Held
    rows: Float[Array, "m n"]
    motion: AlongMotion
    inverse_mass: Float[Array, "n n"] | Float[Array, " n"]
    response: Float[Array, "n m"]
    factor: Float[Array, "m m"]
    stress: Float[Array, "m k"]

    @property
    def pivots(self) -> Float[Array, " m"]:
        """Diagonal of the factor."""
        return jnp.diagonal(self.factor)

    def respond(self, forces: Float[Array, "n p"], gamma: Float[Array, "m p"] | None = None) -> Response:
        """As of any factorisation, with U (B a - D^-1 gamma) = 0."""
        scale = self.held.row_scale[:, None]
        gamma = jnp.zeros((len(self.rows), forces.shape[1]), forces.dtype) if gamma is None else gamma / scale
        if self.held.singular:
            forces = forces + self.rows.T @ gamma
        free = _times(self.inverse_mass, forces)
        mu = self.held_inverse(self.rows @ free - gamma)
        return Response(free - self.response @ mu, mu / scale)

    def held_inverse(self, residual: Float[Array, "m ..."]) -> Float[Array, "m ..."]:
        """R^-1 (I - N0 X^T) of a scaled residual; M^-1 B^T times it is the least change that meets the held rows."""
        return _solved(self.factor, residual - self.held.basis @ (self.stress.T @ residual))

    def close(self, compliance: Float[Array, "m m"]) -> tuple[HeldPick, Array]:
        """As of any factorisation; the evidence is |B^T X| by M^-1, free of units where M is regular."""
        stress = self.stress / self.held.row_scale[:, None]
        return HeldPick(_root(stress, self.held.basis, compliance), compliance), self._excess

    def nearest(self, off: Float[Array, " m"]) -> Float[Array, " n"]:
        """The least change by which the held rows change as much."""
        return self.response @ self.held_inverse(off / self.held.row_scale)

    def renewed(self) -> tuple[Held, Float[Array, ""]]:
        """The same rank held by the self-stress found here, and how much the rows that it leaves out contribute."""
        basis, excess = jax.lax.stop_gradient((_orthonormal(self.stress, self.held.basis), self._excess))
        return replace_fields(self.held, basis=basis), excess

    def completed(self, rows: tuple[int, ...], off: Float[Array, " m"]) -> Float[Array, " m"]:
        """A change of rows with positions, and the least of `rows`, of velocity, that no self-stress contradicts."""
        if not rows or not self.stress.shape[1]:
            return off
        places, scale = np.array(rows), self.held.row_scale
        own, contradiction = self.stress[places], self.stress.T @ (off / scale)
        own = jnp.where(jnp.sum(own**2) > _COUPLED, own, 0.0)
        moved = own @ (jnp.linalg.pinv(own.T @ own, rtol=_COUPLED, hermitian=True) @ contradiction)
        return off.at[places].add(-scale[places] * moved)

    def linear(self, asked: Asked) -> Linear:
        """What load and unit friction cause, without rounding of slips that the held rows forbid."""
        linear = linear_of(self, asked)
        free = jnp.sum(linear.directions * _times(self.inverse_mass, linear.directions), axis=0)
        return linear.without_rounding(free, asked.gamma, self.held.row_scale)

    @property
    def _excess(self) -> Float[Array, ""]:
        left = self.rows.T @ self.stress
        return jnp.sqrt(jnp.max(jnp.sum(left * _times(self.inverse_mass, left), axis=0), initial=0.0))


AnyHeld = Held | SparseHeld
AnyHeldFactorisation = HeldFactorisation | SparseHeldFactorisation


@eqx.filter_jit  # traced once, for the many places that it stands in
def factorize_held(system: AbstractSystem, state: State, held: AnyHeld) -> AnyHeldFactorisation:
    """Assemble and factorise at a state."""
    return held.factorised(system, state)


def _is_projector(basis: Array) -> bool:
    return basis.shape[0] == basis.shape[1]


def _solved(factor: Array, right: Array) -> Array:
    """R^-1 of columns, by the Cholesky factor of R."""
    return jax.scipy.linalg.cho_solve((factor, True), right) if right.size else right


def _whitening(matrix: Array) -> Array:
    """The inverse of the lower Cholesky factor: two LAPACK calls, which a batch pays for one by one."""
    return solve_triangular(cholesky(matrix), xp.eye(matrix.shape[0], dtype=matrix.dtype), lower=True)


def _times(inverse_mass: Array, force: Float[Array, "n p"]) -> Float[Array, "n p"]:
    """M^-1 times columns."""
    return inverse_mass @ force if inverse_mass.ndim == 2 else inverse_mass[:, None] * force


def _inverse(matrix: Array) -> Array:
    whitening = _whitening((matrix + matrix.T) / 2)
    return whitening.T @ whitening


def _root(spanned: Array, basis: Array, compliance: Array | None) -> Float[Array, "m k"]:
    """H of an X that spans the self-stress, with X P = X where the projector P is given for a basis; W = I if None."""
    if not basis.shape[1]:
        return spanned
    inside = spanned.T @ (spanned if compliance is None else compliance @ spanned)
    if not _is_projector(basis):
        return spanned @ _whitening(inside).T
    size = xp.trace(inside) / (2 * xp.maximum(xp.trace(basis), 1.0))
    size = or_one(size)
    kept = xp.eye(inside.shape[0], dtype=inside.dtype) - basis
    return spanned @ _whitening(inside / size + kept).T / xp.sqrt(size)


def _orthonormal(spanned: Array, basis: Array) -> Float[Array, "m k"]:
    """A basis of what X spans, or the projector onto it, as the one that is given."""
    root = _root(spanned, basis, None)
    return root @ root.T if _is_projector(basis) else root


def _basis_of(projector: Float[Array, "m m"], redundancy: int | None) -> Float[Array, "m k"]:
    """An orthonormal basis of so many columns, or the projector itself."""
    m = len(projector)
    return projector if redundancy is None or redundancy == m else xp.linalg.eigh(projector)[1][:, m - redundancy :]


def hold(
    system: AbstractSystem,
    state: State,
    factor: AbstractSolvedFactorisation,
    redundancy: int | None = None,
    *,
    singular: bool = False,
) -> AnyHeld:
    """Hold the rank of a factorisation at its state; `redundancy` is m - rank where that is no traced number, and
    `singular` says whether M may be singular."""

    def dense(factor: AbstractSolvedFactorisation) -> AnyHeld:
        stress = cast(Factorisation, factor).split.stress
        return held_by(system, state, factor.scaling, stress, redundancy, singular=singular)

    def sparse(factor: AbstractSolvedFactorisation) -> AnyHeld:
        return hold_sparse(system, state, factor.spectrum.rank)[0]

    return matrices_of(system).run(dense, sparse)(factor)


def held_by(
    system: AbstractSystem,
    state: State,
    scale: Scaling,
    stress: Float[Array, "m m"],
    redundancy: int | None,
    *,
    singular: bool,
) -> Held:
    """Hold the rank that the projector onto the self-stress of the scaled rows has; the rest as of `hold`."""
    basis = _basis_of(stress, redundancy)
    if are_numbers(state):
        matrix, mass, *_ = model_at(system.without_friction, state)
    else:
        matrix, mass = system.jacobian(state.q, state.t), system.mass(state.q, state.t)
    if singular:  # rows as heavy as M, so that M + B^T B is well conditioned
        heavy = xp.trace(mass) / mass.shape[0] / xp.mean(xp.sum(matrix**2, axis=1))
        mass = mass + heavy * matrix.T @ matrix
    if system.diagonal_mass and not singular:
        own = xp.diagonal(mass)
        inverse_mass = 1 / xp.where(own > 0, own, xp.nan)
    else:
        inverse_mass = _inverse(mass + 0.0 * xp.sum(basis))  # two LAPACK calls side by side can hang
    row_scale = xp.sqrt(xp.sum(matrix.T * _times(inverse_mass, matrix.T), axis=0))
    row_scale = or_one(row_scale)
    basis = _orthonormal((row_scale / scale.rows)[:, None] * basis, basis)
    held = stop_gradient((basis, row_scale))
    constant = system.constant_mass and not singular
    return Held(*held, inverse_mass if constant else None, singular)
