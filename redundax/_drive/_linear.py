"""Linear equations of a machine that its drives hold: the scaled Jacobian K = D^-1 Phi_q S has full column rank.

    [ W    K ] [ lam ]   [ d ]
    [ K^T  0 ] [  y  ] = [ f ]

gives the loads that carry f and are nearest to the misfit d in the compliance W, and with W = I and f = 0 the least
squares y = K^+ d: rates and accelerations. With K = Q1 R and N = Q2, the rest of the orthogonal Q, which is the
self-stress,

    lam = Q1 R^-T f + N (N^T W N)^-1 N^T (d - W Q1 R^-T f),   y = R^-1 Q1^T (d - W lam).

Inverses of triangles are kept, so that solutions are products: fewer calls of LAPACK, and none beside another, which
in a batch can wait for each other for good. Solutions are differentiated as such, whatever decomposition gave them.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._tools._lapack import in_order

_ALONE = 7  # columns of a right-hand side for which OpenBLAS takes one thread: more of them hinder a batch's own
_ITERATIONS = 4  # of a value that stands apart from the others where it matters


class Softness(NamedTuple):
    """A compliance W; of known numbers L^-1 with N^T W N = L L^T, and whether that is definite beyond rounding."""

    matrix: Float[Array, "m m"]
    inverse: Float[Array, "k k"]
    decides: Bool[Array, ""]


class Held(NamedTuple):
    """K, and of known numbers R^-1, Q1 and N, and the size of K."""

    matrix: Float[Array, "m n"]
    inverse: Float[Array, "n n"]
    range: Float[Array, "m n"]
    stress: Float[Array, "m k"]
    size: Float[Array, ""]

    @classmethod
    def of(cls, matrix: Float[Array, "m n"]) -> "Held":
        """The parts of a matrix of full column rank."""
        q, r = jnp.linalg.qr(jax.lax.stop_gradient(matrix), mode="complete")
        n = matrix.shape[1]
        inverse = _inverse(in_order(r[:n], q[0, 0]))
        return cls(matrix, inverse, q[:, :n], q[:, n:], jnp.linalg.norm(r))

    @property
    def weakest(self) -> Float[Array, ""]:
        """The least singular value over the size of K, by inverse iteration."""
        x = jnp.cos(jnp.arange(self.inverse.shape[0], dtype=self.inverse.dtype) ** 2)  # along no axis
        growth = jnp.ones((), x.dtype)
        for _ in range(_ITERATIONS):
            x = self.inverse @ (self.inverse.T @ (x / jnp.linalg.norm(x)))
            growth = jnp.linalg.norm(x)
        weakest = 1 / (self.size * jnp.sqrt(growth))
        return jnp.where(jnp.isnan(weakest), 0.0, weakest)  # of a column that is 0

    def across(self, right: Float[Array, "..."]) -> Float[Array, "..."]:
        """The least loads that carry f."""
        return self.range @ (self.inverse.T @ right)

    def least_squares(self, right: Float[Array, " m"]) -> Float[Array, " n"]:
        """K^+ d."""
        return self.carried(None, right, jnp.zeros_like(self.matrix[0]))[1]

    def softness(self, compliance: Float[Array, "m m"]) -> Softness:
        """A compliance and what it says of the self-stress."""
        W = jax.lax.stop_gradient(compliance)
        restricted, k = self.stress.T @ W @ self.stress, self.stress.shape[1]
        if not k:
            return Softness(compliance, restricted, jnp.ones((), bool))
        size = 1 / jnp.sqrt(jnp.diagonal(restricted))  # to a unit diagonal
        factor = jnp.linalg.cholesky(in_order(restricted * size[:, None] * size, self.inverse[0, 0]))
        inverse = _inverse(factor.T).T
        least = 1 / jnp.sum(inverse**2)  # of the eigenvalues, or less; NaN is none
        return Softness(compliance, inverse * size, least > 100 * k * jnp.finfo(W.dtype).eps)

    def carried(
        self, softness: Softness | None, misfit: Float[Array, " m"], load: Float[Array, " n"]
    ) -> tuple[Float[Array, " m"], Float[Array, " n"]]:
        """lam and y of the equations; without a softness of W = I."""
        m = misfit.size

        def product(x: Array) -> Array:
            lam, y = x[:m], x[m:]
            return jnp.concatenate(
                [(lam if softness is None else softness.matrix @ lam) + self.matrix @ y, self.matrix.T @ lam]
            )

        def solve(_: object, given: Array) -> Array:
            d, f = given[:m], given[m:]
            lam = self.across(f)
            if softness is None:
                lam = lam + self.stress @ (self.stress.T @ d)
                return jnp.concatenate([lam, self.inverse @ (self.range.T @ (d - lam))])
            W = jax.lax.stop_gradient(softness.matrix)
            off = self.stress.T @ (d - W @ lam)
            lam = lam + self.stress @ (softness.inverse.T @ (softness.inverse @ off))
            return jnp.concatenate([lam, self.inverse @ (self.range.T @ (d - W @ lam))])

        found = jax.lax.custom_linear_solve(product, jnp.concatenate([misfit, load]), solve, symmetric=True)
        return found[:m], found[m:]


def _inverse(upper: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """The inverse of an upper triangle by halves, whose least parts are one call of LAPACK."""
    n, one = upper.shape[0], jnp.eye(_ALONE, dtype=upper.dtype)
    levels = max(0, math.ceil(math.log2(n / _ALONE)))
    width = -(-n // 2**levels)
    whole = jnp.eye(width * 2**levels, dtype=upper.dtype).at[:n, :n].set(upper)

    def blocks(width: int, beside: int) -> Float[Array, "count width width"]:
        """Those on the diagonal, or those beside every second of them."""
        places = range(0, len(whole), width * (1 + beside))
        return jnp.stack([whole[k : k + width, k + beside * width : k + (1 + beside) * width] for k in places])

    found = jax.vmap(lambda block: jax.scipy.linalg.solve_triangular(block, one[:width, :width]))(blocks(width, 0))
    while len(found) > 1:
        first, last = found[::2], found[1::2]
        corner = -first @ blocks(first.shape[1], 1) @ last
        above, below = (jnp.concatenate(pair, axis=2) for pair in ((first, corner), (jnp.zeros_like(corner), last)))
        found = jnp.concatenate([above, below], axis=1)
    return found[0, :n, :n]
