"""Rank of the constraints and the two projectors that the rank decides.

The rank is kinematic: it is decided on the scaled Jacobian

    K = D^-1 Phi_q S

of `_scaling`, which is free of units, so the spectrum does not move with the unit, and mass does not enter.
With the singular value decomposition K = U diag(sigma) V^T cut at rank r,

    K^+ = V sigma^-1 U^T,   P = I - U U^T  (self-stress, onto null K^T),   Z = I - V V^T  (motion, onto null K).

A batch, or a large matrix under `jit`, needs no decomposition where the spectrum has a wide gap. With c = |K|_F^2 and
a small delta, the iteration

    X = K^T (K K^T + delta c I)^-1,   X <- X (I + R),   R = I - K X

squares the relative error delta c / (sigma^2 + delta c) of each kept singular value and leaves what is rounding small.
As N^T R = N^T, P = R^T R is free of what rounding has made of X N; K^+ = X (I + R) (I - P), Z = I - K^+ K. That
tr P = |P|_F^2 proves that it projects onto a whole number of directions, |P K|_F bounds the singular values that it
drops from above, and 1 / |K^+| those that it keeps from below.
Where these bounds do not decide, the decomposition does; a chunk of a batch pays for it only if it holds such a sample.

Traced code knows the self-stress space and the space of motions only through P and Z: they have a fixed
shape, need no basis, and at constant rank have the derivatives (Golub and Pereyra)

    dP = -P dK K^+ - (P dK K^+)^T,   dZ = -K^+ dK Z - (K^+ dK Z)^T,
    dK^+ = -K^+ dK K^+ + K^+ K^+T dK^T P + Z dK^T K^+T K^+.

They follow from P K = 0, K Z = 0 and the Penrose conditions; repeated singular values do them no harm.
"""

from typing import NamedTuple

import jax
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int

from .._system._decision import CLEAR, Decision
from .._tools._chunks import in_chunks
from .._tools._compilation import is_single
from .._tools._errors import RedundaxError
from .._tools._lapack import one_by_one
from .._tools._module import batch_any, is_concrete
from .._tools._numbers import (
    are_numbers,
    cholesky,
    chosen_of,
    cond,
    custom_jvp,
    or_one,
    solve_triangular,
    stop_gradient,
    xp,
)
from .._tools._table import AbstractFigures
from .._tools._value import value

_DELTA = 0.45  # power of the rounding: large enough that the Cholesky factor exists, else as small as can be
_LARGE = 24  # rows and columns from which products take much less time than a decomposition
_STEPS = 1  # and one where the first error calls for it
_POWERS = 3  # steps towards the direction of the smallest kept singular value: any number gives a bound


@value
class Spectrum(AbstractFigures):
    """The rank decision and the evidence for it, all free of units.

    - `singular_values`: of the scaled Jacobian K, relative to the largest, descending.
    - `rank`: r, number of independent constraints.
    - `tolerance`: singular values above it count; it grows with the constraint violation.
    - `gap`: smallest kept over largest dropped singular value; infinite if none is dropped.
    - `decision`: whether the rank is clear: its margin is 10 where the smallest kept singular value is 10 times the
      tolerance and the largest dropped one is what violation and rounding explain.
    - `kept`: the smallest kept singular value, or a bound below it that is nearly as large.
    """

    singular_values: Float[Array, " s"]
    rank: Int[Array, ""]
    tolerance: Float[Array, ""]
    gap: Float[Array, ""]
    decision: Decision
    kept: Float[Array, ""]

    @property
    def ambiguous(self) -> Bool[Array, ""]:
        """Whether a singular value is too close to the tolerance to call, or the declared rank is impossible."""
        return ~self.decision.is_yes


class Split(NamedTuple):
    """K^+ (n, m), self-stress projector P (m, m) and motion projector Z (n, n)."""

    inverse: Float[Array, "n m"]
    stress: Float[Array, "m m"]
    motion: Float[Array, "n n"]


class _Decided(NamedTuple):
    """The split, its rank, the smallest kept singular value and whether the rank is clear."""

    parts: Split
    rank: Int[Array, ""]
    kept: Float[Array, ""]
    decision: Decision


def checked_rank(rank: ArrayLike | None, rows: int, columns: int) -> ArrayLike | None:
    """A declared rank, if any; one that no Jacobian of this shape has is refused."""
    if rank is not None and is_concrete(rank):
        known = np.asarray(rank)
        if known.shape != () or known.dtype.kind not in "iuf" or known % 1 != 0 or not 0 <= known <= min(rows, columns):
            raise RedundaxError(
                f"Argument `rank` must be a whole number from 0 to {min(rows, columns)}, as there are {rows} rows and "
                f"{columns} coordinates, but is {rank!r}. Leave it out, and it is decided."
            )
    return rank


def split(
    scaled: Float[Array, "m n"], violation: Float[Array, ""], rank: Int[Array, ""] | None
) -> tuple[Split, Spectrum]:
    """Decide the rank of the scaled Jacobian, or take it declared; K^+, P and Z are differentiable at that rank.

    Off the manifold by a relative distance v, a permanently redundant row shows a singular value of the size of v, and
    the decomposition one of a few roundings. Where points have few digits that value is the change of their misfit
    along the motion, v the misfit itself, and now and then many times smaller. The tolerance is 30 times both; what
    is kept must lie 10 times above it, and what is dropped below 30 v and rounding, or the rank is ambiguous.
    """
    still, violation = stop_gradient((scaled, violation))
    rank = None if rank is None else xp.asarray(rank, int)
    tolerance = 30 * (_noise(still) + violation)
    alone = _decide_by_svd if is_single() or are_numbers(still) or min(scaled.shape) < _LARGE else None
    found = in_chunks(_decide, still, violation, tolerance, rank, alone=alone)
    values = _relative(_singular_values(still))
    dropped = _largest_dropped(values, found.rank)
    gap = xp.where(dropped > 0, _smallest_kept(values, found.rank) / or_one(dropped), xp.inf)
    return _following(scaled, found.parts), Spectrum(values, found.rank, tolerance, gap, found.decision, found.kept)


def _decide(scaled: Array, violation: Array, tolerance: Array, rank: Array | None) -> _Decided:
    """By multiplication, or where its bounds prove nothing by decomposition."""

    found, proved = _decide_by_products(scaled, violation, tolerance, rank)

    def decomposed() -> _Decided:
        unproved = xp.where(proved, 0.0, scaled)
        by_svd = _decide_by_svd(unproved, violation, tolerance, rank)
        return chosen_of(proved, found, by_svd)

    return cond(batch_any(~proved), decomposed, lambda: found)


_singular_values = one_by_one(
    lambda scaled: xp.linalg.svd(scaled, full_matrices=False)[1],  # the decomposition that decides, once more
    lambda scaled: xp.linalg.svd(scaled, compute_uv=False),
)


def _relative(values: Array) -> Array:
    return values / xp.maximum(values[0], xp.finfo(values.dtype).tiny)


def _smallest_kept(values: Array, rank: Array) -> Array:
    return xp.where(rank > 0, values[xp.clip(rank - 1, 0, values.size - 1)], xp.inf)


def _largest_dropped(values: Array, rank: Array) -> Array:
    return xp.append(values, xp.zeros((), values.dtype))[xp.clip(rank, 0, values.size)]


def _noise(scaled: Array) -> float:
    """Rounding of a decomposition, relative to sigma_1."""
    return max(scaled.shape) * float(xp.finfo(scaled.dtype).eps)


def _rounding(scaled: Array) -> float:
    """What a decomposition leaves of a singular value that is zero, relative to sigma_1: of 30 rows 2 to 16 roundings
    by OpenBLAS, more by one release of it than by another."""
    return max(10, *scaled.shape) * float(xp.finfo(scaled.dtype).eps)


def _decide_by_products(
    scaled: Array, violation: Array, tolerance: Array, rank: Array | None
) -> tuple[_Decided, Bool[Array, ""]]:
    """The decision by multiplication alone, and whether its bounds prove it."""
    m, n = scaled.shape
    one, eps = xp.eye(m, dtype=scaled.dtype), float(xp.finfo(scaled.dtype).eps)
    size, gram = _gram(scaled)
    half = _inverse_of_lower(cholesky(gram + eps**_DELTA * one))
    inverse = _transposed(half @ scaled / size) @ half
    left = one - scaled @ inverse
    more = _between(left) ** 2 ** (_STEPS + 1) > _noise(scaled)  # P and K^+ have squared it once more than R

    def step(inverse: Array, left: Array) -> tuple[Array, Array]:
        inverse = inverse + inverse @ left
        return inverse, one - scaled @ inverse

    for _ in range(_STEPS):
        inverse, left = step(inverse, left)

    def once_more(*ended: Array) -> tuple[Array, ...]:
        return tuple(xp.where(more, new, old) for new, old in zip(step(*ended), ended, strict=True))

    inverse, left = cond(batch_any(more), once_more, lambda *ended: ended, inverse, left)
    stress = _transposed(left) @ left
    inverse = inverse + inverse @ left
    inverse = inverse - inverse @ stress
    motion = _symmetric(xp.eye(n, dtype=scaled.dtype) - inverse @ scaled)
    largest = _largest(size, gram, 1)
    kept = 1 / (largest * _weakest(inverse))
    found = m - xp.round(xp.sum(xp.diagonal(stress))).astype(int)
    parts = _without_rounding(scaled, inverse, stress, motion, found, kept)
    proved = (
        (xp.abs(_between(stress)) <= _noise(scaled) / kept)
        & (xp.linalg.norm(parts.stress @ scaled) <= (_rounding(scaled) + violation) * largest)
        & (kept >= 10 * tolerance)
        & (True if rank is None else found == rank)
    )
    return _Decided(parts, found, kept, Decision(kept / tolerance)), proved


def _inverse_of_lower(factor: Array) -> Array:
    """L^-1 by halves, which takes less time than LAPACK does for the whole."""
    half = len(factor) // 2
    first, last = (
        solve_triangular(part, xp.eye(len(part), dtype=part.dtype), lower=True)
        for part in (factor[:half, :half], factor[half:, half:])
    )
    below = -last @ (factor[half:, :half] @ first)
    return xp.concatenate(
        [xp.concatenate([first, xp.zeros_like(factor[:half, half:])], axis=1), xp.concatenate([below, last], axis=1)]
    )


def _between(projector: Array) -> Array:
    """Sum of lambda (1 - lambda) over the eigenvalues, which lie between 0 and 1: 0 of a projector."""
    return xp.sum(xp.diagonal(projector)) - xp.sum(projector**2)


def _stress_of(image: Array) -> Array:
    """P from K K^+, with what rounding left in it of the range of K taken out once more."""
    stress = _symmetric(xp.eye(len(image), dtype=image.dtype) - image)
    return stress - 2 * _symmetric(stress @ image)


def _gram(matrix: Array) -> tuple[Array, Array]:
    """|A|_F^2, or 1 if it is zero, and A A^T over it."""
    size = xp.sum(matrix**2)
    size = or_one(size)
    return size, matrix @ _transposed(matrix) / size


def _transposed(matrix: Array) -> Array:
    """A^T as an array of its own: XLA's products of rows and columns take half as long as those of columns."""
    return jax.lax.optimization_barrier(matrix.T)


def _largest(size: Array, gram: Array, squares: int) -> Array:
    """A bound above the largest singular value, from A A^T; it is at most r^(1/2^(squares + 2)) too large."""
    for _ in range(squares):
        gram = gram @ gram
    return xp.sqrt(size) * xp.sum(gram**2) ** (0.25 / 2**squares)


def _weakest(inverse: Array) -> Array:
    """A bound above the largest singular value of K^+: nearly that where it stands out, else at most r^(1/4) times it.

    Of a unit vector v and A = K^+ K^+T it is that of the matrix ( l  e ; e  b ), l = v^T A v, e = |A v - l v|, as
    b = (|A|_F^2 - l^2 - 2 e^2)^(1/2) bounds A square to v. Steps of the power method give v.
    """
    size, gram = _gram(inverse)
    v = gram[xp.argmax(xp.diagonal(gram))]
    for _ in range(_POWERS):
        v = gram @ (v / or_one(xp.linalg.norm(v)))
    v = v / or_one(xp.linalg.norm(v))
    image = gram @ v
    along = v @ image
    off = xp.sum((image - along * v) ** 2)
    beside = xp.sqrt(xp.maximum(xp.sum(gram**2) - along**2 - 2 * off, 0.0))
    return xp.sqrt(size * ((along + beside) / 2 + xp.sqrt(((along - beside) / 2) ** 2 + off)))


def _symmetric(matrix: Array) -> Array:
    return (matrix + matrix.T) / 2


def _decide_by_svd(scaled: Array, violation: Array, tolerance: Array, rank: Array | None) -> _Decided:
    """The decision by singular value decomposition."""
    u, sigma, vt = xp.linalg.svd(scaled, full_matrices=False)
    values = _relative(sigma)
    found = xp.sum(values > tolerance) if rank is None else rank
    kept = _smallest_kept(values, found)
    if rank is None:
        dropped = _largest_dropped(values, found)
        explained = CLEAR * (_rounding(scaled) + 30 * violation) / or_one(dropped)
        margin = xp.minimum(kept / tolerance, xp.where(dropped > 0, explained, xp.inf))
    else:
        possible = (rank >= 0) & (rank <= values.size)
        margin = xp.where(possible, CLEAR * kept / (3 * _noise(scaled)), 0.0)
    counted = xp.arange(sigma.size) < found
    inverse = vt.T @ (xp.where(counted, 1 / xp.where(counted, sigma, 1.0), 0.0)[:, None] * u.T)
    stress, motion = (xp.eye(side.shape[0], dtype=u.dtype) - (side * counted) @ side.T for side in (u, vt.T))
    product = _stress_of(scaled @ (2 * inverse - inverse @ (scaled @ inverse)))
    left, other = (xp.linalg.norm(projector @ scaled) for projector in (stress, product))
    # A decomposition leaves ten roundings, products, as batches take them, one over `kept`.
    stress = xp.where(other <= 2 * left, product, stress)
    return _Decided(_without_rounding(scaled, inverse, stress, motion, found, kept), found, kept, Decision(margin))


def _without_rounding(scaled: Array, inverse: Array, stress: Array, motion: Array, rank: Array, kept: Array) -> Split:
    """The split; rows and columns of projectors that are rounding are zero, as a soft row would magnify them."""

    def cleaned(projector: Array) -> Array:
        true = (xp.linalg.norm(projector, axis=1) > _noise(scaled) / kept) & (rank < projector.shape[0])
        return xp.where(true[:, None] & true, projector, 0.0)

    return Split(inverse, cleaned(stress), cleaned(motion))


@custom_jvp
def _following(scaled: Array, parts: Split) -> Split:
    """The split with its derivative at constant rank."""
    return parts


@_following.defjvp
def _following_jvp(primals: tuple, tangents: tuple) -> tuple[Split, Split]:
    change = tangents[0]  # derivation: module docstring
    inverse, stress, motion = out = _following(*primals)
    stress_part = stress @ change @ inverse
    motion_part = inverse @ change @ motion
    inverse_dot = (
        -inverse @ change @ inverse + inverse @ inverse.T @ change.T @ stress + motion @ change.T @ inverse.T @ inverse
    )
    return out, Split(inverse_dot, -stress_part - stress_part.T, -motion_part - motion_part.T)
