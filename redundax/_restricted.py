"""Inverse of a symmetric matrix restricted to a subspace that is known by its projector alone.

    G = V (V^T A V)^-1 V^T = P (P A P + w (I - P))^-1 P,   P = V V^T

P A P loses the small entries of an A whose entries differ by orders of magnitude; one step G + G (I - A G) of
refinement, which knows A itself, brings them back.

With G A G = G, P G = G and P A G = P on the subspace, its derivative is

    dG = T + T^T - G dA G,   T = (I - G A) dP G.

Where V^T A V is not positive definite G is zero, value and derivative, so that one bad sample leaves the gradient of
a batch alone; the flag beside it says so.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ._chunks import in_chunks


@jax.custom_jvp
def restricted_inverse(
    matrix: Float[Array, "n n"], projector: Float[Array, "n n"], dimension: Int[Array, ""], after: Float[Array, ""]
) -> tuple[Float[Array, "n n"], Bool[Array, ""]]:
    """G, and whether the restriction is positive definite.

    `after` is a finite number that must be computed first: two LAPACK calls that XLA runs at the same time can wait
    for each other for good on small CPUs.
    """
    return in_chunks(_inverse, matrix, projector, dimension, after)


def _inverse(matrix: Array, projector: Array, dimension: Array, after: Array) -> tuple[Array, Array]:
    restricted = projector @ matrix @ projector
    weight = jnp.trace(restricted) / jnp.maximum(dimension, 1)
    other = jnp.eye(matrix.shape[0], dtype=matrix.dtype) - projector
    rounding = 10 * matrix.shape[0] * jnp.finfo(matrix.dtype).eps
    parts = jnp.abs(projector)
    noise = rounding * jnp.sum((parts @ jnp.abs(matrix)) * parts, axis=1)  # of each diagonal entry of P A P
    some = weight > jnp.max(noise)  # else all of it is rounding of a restriction that is zero
    weight = jnp.where(some & (dimension > 0), weight, jnp.maximum(jnp.max(noise), 1.0))
    regular = restricted / weight + other
    factor = jnp.linalg.cholesky(regular + 0.0 * after)
    half = jax.scipy.linalg.solve_triangular(factor, projector, lower=True)
    blur = noise / weight + rounding * jnp.abs(jnp.diagonal(other))
    large = jnp.all(jnp.diagonal(factor) ** 2 > 100 * blur)  # false for NaN, which a minimum can lose
    definite = large & (some | (dimension <= 0))
    inverse = half.T @ half / weight
    for _ in range(2):
        inverse = inverse + inverse @ (jnp.eye(matrix.shape[0], dtype=matrix.dtype) - matrix @ inverse)
    return jnp.where(definite, inverse, 0.0), definite


@restricted_inverse.defjvp
def _restricted_inverse_jvp(primals: tuple, tangents: tuple) -> tuple:
    matrix = primals[0]
    d_matrix, d_projector = tangents[:2]
    inverse, definite = out = restricted_inverse(*primals)
    part = d_projector @ inverse
    part = part - inverse @ (matrix @ part)
    return out, (part + part.T - inverse @ d_matrix @ inverse, jnp.zeros(definite.shape, jax.dtypes.float0))
