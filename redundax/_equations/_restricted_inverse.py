"""Inverse of a symmetric matrix restricted to a subspace that is known by its projector alone.

    G = V (V^T A V)^-1 V^T = P (P A P + w (I - P))^-1 P,   P = V V^T,   A positive semidefinite

Of one direction v, as most mechanisms have of motions and of self-stress, G = v v^T / (v^T A v) needs neither a product
nor a factor of matrices. Of more, P A P loses the small entries of an A whose entries differ by orders of magnitude;
steps G + G (I - A G) of refinement, which know A itself, bring them back.

Whether V^T A V is positive definite is asked of A itself along the direction that G magnifies most, the largest column
of G: one step of inverse iteration from the direction of least energy. P is tilted by rounding over the smallest kept
singular value; a direction without energy has the square of that tilt, because A is semidefinite. Of more directions
tr(G A) must be their number too, as it is not where rounding stands in for an energy.

With G A G = G, P G = G and P A G = P on the subspace, its derivative is

    dG = T + T^T - G dA G,   T = (I - G A) dP G.

Where V^T A V is not positive definite G is zero, value and derivative, so that one bad sample leaves the gradient of
a batch alone; the decision beside it says so.
"""

import jax
from jaxtyping import Array, Float, Int

from .._system._decision import CLEAR, Decision
from .._tools._chunks import in_chunks
from .._tools._module import batch_any
from .._tools._numbers import chosen_of, cond, custom_jvp, or_one, solve_triangular, xp

_STEPS = 2  # of refinement
_SETTLED = 0.01  # of a direction that tr(G A) may miss


@custom_jvp
def restricted_inverse(
    matrix: Float[Array, "n n"], projector: Float[Array, "n n"], dimension: Int[Array, ""], kept: Float[Array, ""]
) -> tuple[Float[Array, "n n"], Decision]:
    """G, and the decision whether the restriction is positive definite.

    `dimension` is the rank of the projector, `kept` the smallest kept singular value of the matrix that it belongs to,
    relative to the largest: by its inverse rounding is magnified in P.
    """
    return in_chunks(_inverse, matrix, projector, dimension, kept)


def _inverse(matrix: Array, projector: Array, dimension: Array, kept: Array) -> tuple[Array, Decision]:
    one = _of_one_direction(matrix, projector, kept)

    def of_several() -> tuple[Array, Array]:
        several = _of_several_directions(matrix, projector, dimension, kept)
        return chosen_of(dimension > 1, several, one)

    inverse, margin = cond(batch_any(dimension > 1), of_several, lambda: one)
    none = dimension <= 0
    decision = Decision(xp.where(none, xp.inf, margin))
    return xp.where(decision.is_yes & ~none, inverse, 0.0), decision


def _of_one_direction(matrix: Array, projector: Array, kept: Array) -> tuple[Array, Array]:
    """The inverse on the direction that the column of the largest pivot has, and the margin of its energy."""
    v = _largest_column(projector)
    beside = xp.where(v != 0, 1 - v**2, 0.0)
    energy, noise = _energy(matrix, v, beside, 2 * xp.abs(v) * beside, kept)
    return xp.outer(v, v) / or_one(energy), energy / noise


def _of_several_directions(matrix: Array, projector: Array, dimension: Array, kept: Array) -> tuple[Array, Array]:
    """The inverse on two directions or more, and the margin of the least energy."""
    one = xp.eye(matrix.shape[0], dtype=matrix.dtype)
    rounding = matrix.shape[0] * xp.finfo(matrix.dtype).eps
    restricted = projector @ matrix @ projector
    weight = xp.trace(restricted) / xp.maximum(dimension, 1).astype(matrix.dtype)
    weight = or_one(weight)
    regular = restricted / weight + (one - projector)
    shift = rounding * xp.diag(xp.diagonal(regular))  # without it a direction without energy often has no factor
    factor = xp.linalg.cholesky(regular + shift)
    half = solve_triangular(factor, projector, lower=True)
    start = half.T @ half / weight

    inverse, image = start, matrix @ start
    for _ in range(_STEPS):
        inverse = inverse + inverse @ (one - image)
        image = matrix @ inverse
    v, others = _largest_column(start), xp.abs(one - projector)
    beside = xp.where(xp.any(projector != 0, axis=1), xp.diagonal(others), 0.0)
    energy, noise = _energy(matrix, v, beside, others @ xp.abs(v), kept)
    margin = xp.where(xp.all(xp.isfinite(factor)), energy / noise, 0.0)  # no factor: an energy below zero
    settled = xp.abs(xp.trace(image) - dimension) <= _SETTLED
    return inverse, xp.where(settled, margin, xp.minimum(margin, 0.5 * CLEAR))


def _largest_column(matrix: Array) -> Array:
    """The column of the largest diagonal entry of a symmetric matrix, as a unit vector; zero if it is."""
    column = matrix[xp.argmax(xp.diagonal(matrix))]
    size = xp.linalg.norm(column)
    return column / or_one(size)


def _energy(matrix: Array, v: Array, beside: Array, turned: Array, kept: Array) -> tuple[Array, Array]:
    """v^T A v, and what rounding can make of it where it is zero.

    Entries of v are tilted by up to a rounding over `kept`, but not those that stand alone, a zero row of I - P, or
    have no part in the subspace: `beside` is the diagonal of I - P, 0 for the latter, and `turned` is |I - P| |v|.
    """
    rounding = matrix.shape[0] * xp.finfo(matrix.dtype).eps
    sizes = xp.minimum(100 * beside, 1.0) * xp.abs(xp.diagonal(matrix))
    tilt = (rounding / xp.minimum(kept, 1.0)) ** 2 * xp.minimum(100 * xp.sum(turned**2), 1.0)
    noise = 10 * (rounding * (xp.abs(v) @ (xp.abs(matrix) @ xp.abs(v))) + tilt * xp.sum(sizes))
    return v @ (matrix @ v), or_one(noise)


@restricted_inverse.defjvp
def _restricted_inverse_jvp(primals: tuple, tangents: tuple) -> tuple:
    d_matrix, d_projector = tangents[:2]
    inverse, decision = out = restricted_inverse(*primals)
    matrix = xp.where(decision.is_yes, primals[0], 0.0)
    part = d_projector @ inverse
    part = part - inverse @ (matrix @ part)
    change = part + part.T - inverse @ d_matrix @ inverse
    return out, (change, jax.tree.map(xp.zeros_like, decision))
