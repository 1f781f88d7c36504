"""Cholesky factor of a symmetric positive definite matrix, and solutions: by batches of dense fronts.

From the leaves to the roots, of each front with own rows p and border q

    A_pp = L L^T,   B = A_qp L^-T,   A_qq - B B^T  is left for the front above.

Without a pivot search: no program is safer for such a matrix. L^-1 is kept, so that solutions are products: LAPACK
calls that XLA runs side by side can wait for each other for good on few cores, and those of one factor follow each
other. Rows that are left out have the row of I.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._symbolic import Symbolic

T = TypeVar("T")


class Fronts(NamedTuple):
    """L^-1, shape (fronts, p, p), and B, shape (fronts, q, p), of one height."""

    inverse: Array
    border: Array


def factor(symbolic: Symbolic, entries: Float[Array, " size"]) -> tuple[Fronts, ...]:
    """The factor of the matrix with these entries; NaN where it is not positive definite."""

    def kept(own: Array, border: Array) -> tuple[Fronts, Array]:
        one = jnp.broadcast_to(jnp.eye(own.shape[-1], dtype=own.dtype), own.shape)
        inverse = jax.lax.linalg.triangular_solve(own, one, left_side=True, lower=True)
        border = border @ inverse.swapaxes(1, 2)
        return Fronts(inverse, border), border

    return _eliminated(symbolic, entries, kept)


def factor_diagonal(symbolic: Symbolic, entries: Float[Array, " size"]) -> Float[Array, " m"]:
    """Diagonal of L, by row, without the factor."""

    def kept(own: Array, border: Array) -> tuple[Array, Array]:
        border = jax.lax.linalg.triangular_solve(own, border, left_side=False, lower=True, transpose_a=True)
        return jnp.diagonal(own, axis1=1, axis2=2).ravel(), border

    return jnp.concatenate(_eliminated(symbolic, entries, kept))[symbolic.position]


def _eliminated(
    symbolic: Symbolic, entries: Float[Array, " size"], kept: Callable[[Array, Array], tuple[T, Array]]
) -> tuple[T, ...]:
    """What is kept of each height, given L and A_qp, and with it B."""
    found, begin = [], 0
    left = jnp.zeros(0, entries.dtype)
    for level in symbolic.levels:
        (count, p), q = level.pad.shape, level.border.shape[1]
        size = count * (p + q) ** 2
        fronts = entries[begin : begin + size]
        if found:
            fronts = fronts.at[level.target].add(left[level.source])
        fronts = fronts.reshape(count, p + q, p + q)
        begin += size
        padding = level.pad[:, :, None] * jnp.eye(p, dtype=entries.dtype)
        own = jnp.linalg.cholesky(fronts[:, :p, :p] + padding, symmetrize_input=False)
        part, border = kept(own, fronts[:, p:, :p])
        rest = fronts[:, p:, p:] - border @ border.swapaxes(1, 2)
        left = jnp.concatenate([left, rest.ravel()])
        found.append(part)
    return tuple(found)


def solution(symbolic: Symbolic, found: tuple[Fronts, ...], right: Float[Array, "m c"]) -> Float[Array, "m c"]:
    """What the factored matrix makes to the columns on the right, one after the other: products of batches of small
    matrices with few columns take longer than with one each."""
    if right.shape[1] == 1:
        return _solution(symbolic, found, right)
    return jax.lax.map(lambda column: _solution(symbolic, found, column[:, None])[:, 0], right.T).T


def _solution(symbolic: Symbolic, found: tuple[Fronts, ...], right: Float[Array, "m c"]) -> Float[Array, "m c"]:
    columns = right.shape[1]
    none = jnp.zeros((1, columns), right.dtype)
    below, forward = jnp.concatenate([right, none])[symbolic.own], []
    for level, fronts in zip(symbolic.levels, found, strict=True):
        count, p = level.pad.shape
        y = fronts.inverse @ below[: count * p].reshape(count, p, columns)
        below = below[count * p :]
        if level.border.size:
            below = below.at[level.border].add(-(fronts.border @ y), mode="drop")
        forward.append(y)
    above = none
    for level, fronts, y in zip(symbolic.levels[::-1], found[::-1], forward[::-1], strict=True):
        if level.border.size:
            y = y - fronts.border.swapaxes(1, 2) @ above[level.border]
        own = fronts.inverse.swapaxes(1, 2) @ y
        above = jnp.concatenate([own.reshape(-1, columns), above])
    return above[symbolic.position]


def pivots(symbolic: Symbolic, found: tuple[Fronts, ...]) -> Float[Array, " m"]:
    """Diagonal of L, by row, of a factor that stands."""
    parts = [jnp.diagonal(fronts.inverse, axis1=1, axis2=2).ravel() for fronts in found]
    return 1 / jnp.concatenate(parts)[symbolic.position]
