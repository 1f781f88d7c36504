"""Inverse of a symmetric matrix restricted to a subspace that is known by its projector alone.

    G = V (V^T A V)^-1 V^T = sum of w w^T / (w^T A w),   P = V V^T

over directions w = v - G A v that are conjugate, with G so far: v is the column of what is left of P that has the
largest pivot, over its root. A subspace of one direction, as most mechanisms have of motions and of self-stress, needs
neither a product nor a factor of matrices. Of more, the sum is put between projectors again: cancellation leaves the
later columns of what is left of P less exact than P.

With G A G = G, P G = G and P A G = P on the subspace, its derivative is

    dG = T + T^T - G dA G,   T = (I - G A) dP G.

Where V^T A V is not positive definite G is zero, value and derivative, so that one bad sample leaves the gradient of
a batch alone; the flag beside it says so.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ._chunks import in_chunks
from ._module import of_any


@jax.custom_jvp
def restricted_inverse(
    matrix: Float[Array, "n n"], projector: Float[Array, "n n"], dimension: Int[Array, ""], kept: Float[Array, ""]
) -> tuple[Float[Array, "n n"], Bool[Array, ""]]:
    """G, and whether the restriction is positive definite.

    `dimension` is the rank of the projector, `kept` the smallest kept singular value of the matrix that it
    belongs to, relative to the largest: by its inverse rounding is magnified in P.
    """
    return in_chunks(_inverse, matrix, projector, dimension, kept)


class _Directions(NamedTuple):
    """How many directions were taken, the projector onto the others, G so far, and whether all had energy."""

    number: Int[Array, ""]
    left: Float[Array, "n n"]
    inverse: Float[Array, "n n"]
    definite: Bool[Array, ""]


def _inverse(matrix: Array, projector: Array, dimension: Array, kept: Array) -> tuple[Array, Array]:
    n = matrix.shape[0]
    rounding, dimension = n * jnp.finfo(matrix.dtype).eps, jnp.minimum(dimension, n)
    sizes = jnp.where(jnp.any(projector != 0, axis=1), jnp.abs(jnp.diagonal(matrix)), 0.0)
    unseen = (rounding / jnp.minimum(kept, 1.0)) ** 2 * jnp.sum(sizes)  # energy of the error of a direction

    def added(now: _Directions, *, first: bool = False) -> _Directions:
        pivots = jnp.diagonal(now.left)
        largest = jnp.max(pivots)
        v = now.left[jnp.argmax(pivots)] / jnp.sqrt(jnp.where(largest > 0, largest, 1.0))
        w, moved = v, matrix @ v
        for _ in range(0 if first else 2):  # the second time is refinement
            w = w - now.inverse @ moved
            moved = matrix @ w
        energy, wanted = w @ moved, now.number < dimension
        blur = 10 * (rounding * (jnp.abs(w) @ (jnp.abs(matrix) @ jnp.abs(w))) + unseen * (w @ w))
        good = energy > blur  # not if it is NaN
        more = now.inverse + jnp.outer(w, w) / jnp.where(good, energy, 1.0)
        inverse = jnp.where(wanted, more, now.inverse)
        return _Directions(now.number + 1, now.left - jnp.outer(v, v), inverse, now.definite & (good | ~wanted))

    def others() -> tuple[Array, Array]:
        end = jax.lax.while_loop(lambda now: of_any(now.number < dimension), added, first)
        inside = projector @ end.inverse @ projector  # where rounding has led directions after the first out of it
        return jnp.where(dimension > 1, inside, end.inverse), end.definite

    start = _Directions(jnp.zeros((), int), projector, jnp.zeros_like(matrix), jnp.ones((), bool))
    first = added(start, first=True)
    inverse, definite = jax.lax.cond(of_any(dimension > 1), others, lambda: (first.inverse, first.definite))
    return jnp.where(definite, inverse, 0.0), definite


@restricted_inverse.defjvp
def _restricted_inverse_jvp(primals: tuple, tangents: tuple) -> tuple:
    d_matrix, d_projector = tangents[:2]
    inverse, definite = out = restricted_inverse(*primals)
    matrix = jnp.where(definite, primals[0], 0.0)
    part = d_projector @ inverse
    part = part - inverse @ (matrix @ part)
    return out, (part + part.T - inverse @ d_matrix @ inverse, jnp.zeros(definite.shape, jax.dtypes.float0))
