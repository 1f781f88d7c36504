"""Linear equations of a machine that its drives hold: the scaled Jacobian K = D^-1 Phi_q S has full column rank.

    [ W    K ] [ lam ]   [ d ]
    [ K^T  0 ] [  y  ] = [ f ]

gives the loads that carry f and are nearest to the misfit d in the compliance W, and with W = I and f = 0 the least
squares y = K^+ d: rates and accelerations. With K = Q1 R and N = Q2, the rest of the orthogonal Q, which is the
self-stress,

    lam = Q1 R^-T f + N (N^T W N)^-1 N^T (d - W Q1 R^-T f),   y = R^-1 Q1^T (d - W lam).

Solutions are differentiated as such, whatever decomposition gave them.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

_ITERATIONS = 4  # of a value that stands apart from the others where it matters


class Held(NamedTuple):
    """K, and of known numbers its parts R, Q1 and N."""

    matrix: Float[Array, "m n"]
    upper: Float[Array, "n n"]
    range: Float[Array, "m n"]
    stress: Float[Array, "m k"]

    @classmethod
    def of(cls, matrix: Float[Array, "m n"]) -> "Held":
        """The parts of a matrix of full column rank."""
        q, r = jnp.linalg.qr(jax.lax.stop_gradient(matrix), mode="complete")
        n = matrix.shape[1]
        return cls(matrix, r[:n], q[:, :n], q[:, n:])

    @property
    def weakest(self) -> Float[Array, ""]:
        """The least singular value over the size of K, by inverse iteration: vectors cost less than an inverse."""
        x = jnp.cos(jnp.arange(self.upper.shape[0], dtype=self.upper.dtype) ** 2)  # along no axis
        growth = jnp.ones((), x.dtype)
        for _ in range(_ITERATIONS):
            x = _upper(self.upper, jax.scipy.linalg.solve_triangular(self.upper, x / jnp.linalg.norm(x), trans=1))
            growth = jnp.linalg.norm(x)
        weakest = 1 / (jnp.linalg.norm(self.upper) * jnp.sqrt(growth))
        return jnp.where(jnp.isnan(weakest), 0.0, weakest)  # of a column that is 0

    def across(self, right: Float[Array, "..."]) -> Float[Array, "..."]:
        """The least loads that carry f."""
        return self.range @ jax.scipy.linalg.solve_triangular(self.upper, right, trans=1)

    def least_squares(self, right: Float[Array, " m"]) -> Float[Array, " n"]:
        """K^+ d."""
        _, found = self.carried(None, right, jnp.zeros_like(self.matrix[0]))
        return found

    def carried(
        self, compliance: Float[Array, "m m"] | None, misfit: Float[Array, " m"], load: Float[Array, " n"]
    ) -> tuple[Float[Array, " m"], Float[Array, " n"]]:
        """lam and y of the equations; without a compliance of W = I."""

        m = misfit.size

        def product(x: Array) -> Array:
            lam, y = x[:m], x[m:]
            return jnp.concatenate(
                [(lam if compliance is None else compliance @ lam) + self.matrix @ y, self.matrix.T @ lam]
            )

        def solve(_: object, given: Array) -> Array:
            softness = None if compliance is None else jax.lax.stop_gradient(compliance)
            d, f = given[:m], given[m:]
            lam = self.across(f)
            if self.stress.shape[1]:
                off = d - (lam if softness is None else softness @ lam)
                lam = lam + self.stress @ _definite(self.restricted(softness), self.stress.T @ off)
            off = d - (lam if softness is None else softness @ lam)
            return jnp.concatenate([lam, _upper(self.upper, self.range.T @ off)])

        found = jax.lax.custom_linear_solve(product, jnp.concatenate([misfit, load]), solve, symmetric=True)
        return found[:m], found[m:]

    def restricted(self, compliance: Float[Array, "m m"] | None) -> Float[Array, "k k"]:
        """N^T W N."""
        moved = self.stress if compliance is None else compliance @ self.stress
        return self.stress.T @ moved


def _upper(matrix: Array, right: Array) -> Array:
    return jax.scipy.linalg.solve_triangular(matrix, right)


def _definite(matrix: Array, right: Array) -> Array:
    """The solution by Cholesky's factor, scaled to a unit diagonal; NaN of a matrix that is not positive definite."""
    size = 1 / jnp.sqrt(jnp.diagonal(matrix))
    factor = jnp.linalg.cholesky(matrix * size[:, None] * size)
    return size * jax.scipy.linalg.cho_solve((factor, True), size * right)
