"""Inverse of a symmetric matrix restricted to a subspace that is known by its projector alone.

    G = V (V^T A V)^-1 V^T = P (P A P + w (I - P))^-1 P,   P = V V^T

Of one direction v, as most mechanisms have of motions and of self-stress, G = v v^T / (v^T A v) needs neither a product
nor a factor of matrices. Of more, P A P loses the small entries of an A whose entries differ by orders of magnitude;
two steps G + G (I - A G) of refinement, which know A itself, bring them back.

With G A G = G, P G = G and P A G = P on the subspace, its derivative is

    dG = T + T^T - G dA G,   T = (I - G A) dP G.

Where V^T A V is not positive definite G is zero, value and derivative, so that one bad sample leaves the gradient of
a batch alone; the flag beside it says so.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ._chunks import in_chunks
from ._module import of_any


@jax.custom_jvp
def restricted_inverse(
    matrix: Float[Array, "n n"],
    projector: Float[Array, "n n"],
    dimension: Int[Array, ""],
    kept: Float[Array, ""],
    after: Float[Array, ""],
) -> tuple[Float[Array, "n n"], Bool[Array, ""]]:
    """G, and whether the restriction is positive definite.

    `dimension` is the rank of the projector, `kept` the smallest kept singular value of the matrix that it belongs to,
    relative to the largest: by its inverse rounding is magnified in P. `after` is a finite number that must be computed
    first: two LAPACK calls that XLA runs at the same time can wait for each other for good on small CPUs.
    """
    return in_chunks(_inverse, matrix, projector, dimension, kept, after)


def _inverse(
    matrix: Array, projector: Array, dimension: Array, kept: Array, after: Array
) -> tuple[Array, Bool[Array, ""]]:
    one = _of_one_direction(matrix, projector, dimension, kept)

    def of_several() -> tuple[Array, Array]:
        several = _of_several_directions(matrix, projector, dimension, after)
        return jax.tree.map(lambda a, b: jnp.where(dimension > 1, a, b), several, one)

    inverse, definite = jax.lax.cond(of_any(dimension > 1), of_several, lambda: one)
    return jnp.where(definite, inverse, 0.0), definite


def _of_one_direction(matrix: Array, projector: Array, dimension: Array, kept: Array) -> tuple[Array, Bool[Array, ""]]:
    """The inverse on the direction that the column of the largest pivot has, or on none."""
    rounding = matrix.shape[0] * jnp.finfo(matrix.dtype).eps
    pivots = jnp.diagonal(projector)
    largest = jnp.max(pivots)
    v = projector[jnp.argmax(pivots)] / jnp.sqrt(jnp.where(largest > 0, largest, 1.0))
    energy = v @ (matrix @ v)
    sizes = jnp.where(jnp.any(projector != 0, axis=1), jnp.abs(jnp.diagonal(matrix)), 0.0)
    blur = rounding * (jnp.abs(v) @ (jnp.abs(matrix) @ jnp.abs(v)))
    blur = 10 * (blur + (rounding / jnp.minimum(kept, 1.0)) ** 2 * jnp.sum(sizes))  # energy of the error of v
    some, none = energy > blur, dimension <= 0  # NaN is not
    inverse = jnp.outer(v, v) / jnp.where(some, energy, 1.0)
    return jnp.where(none, 0.0, inverse), some | none


def _of_several_directions(
    matrix: Array, projector: Array, dimension: Array, after: Array
) -> tuple[Array, Bool[Array, ""]]:
    """The inverse on two directions or more."""
    restricted = projector @ matrix @ projector
    weight = jnp.trace(restricted) / jnp.maximum(dimension, 1)
    other = jnp.eye(matrix.shape[0], dtype=matrix.dtype) - projector
    rounding = 10 * matrix.shape[0] * jnp.finfo(matrix.dtype).eps
    parts = jnp.abs(projector)
    noise = rounding * jnp.sum((parts @ jnp.abs(matrix)) * parts, axis=1)  # of each diagonal entry of P A P
    some = weight > jnp.max(noise)  # else all of it is rounding of a restriction that is zero
    weight = jnp.where(some, weight, jnp.maximum(jnp.max(noise), 1.0))
    regular = restricted / weight + other
    factor = jnp.linalg.cholesky(regular + 0.0 * after)
    half = jax.scipy.linalg.solve_triangular(factor, projector, lower=True)
    blur = noise / weight + rounding * jnp.abs(jnp.diagonal(other))
    large = jnp.all(jnp.diagonal(factor) ** 2 > 100 * blur)  # false for NaN, which a minimum can lose
    inverse = half.T @ half / weight
    for _ in range(2):
        inverse = inverse + inverse @ (jnp.eye(matrix.shape[0], dtype=matrix.dtype) - matrix @ inverse)
    return inverse, large & some


@restricted_inverse.defjvp
def _restricted_inverse_jvp(primals: tuple, tangents: tuple) -> tuple:
    d_matrix, d_projector = tangents[:2]
    inverse, definite = out = restricted_inverse(*primals)
    matrix = jnp.where(definite, primals[0], 0.0)
    part = d_projector @ inverse
    part = part - inverse @ (matrix @ part)
    return out, (part + part.T - inverse @ d_matrix @ inverse, jnp.zeros(definite.shape, jax.dtypes.float0))
