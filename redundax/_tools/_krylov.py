"""Solutions of equations whose matrix A is known by its products alone.

x is sought among b, A b, A (A b), ... and leaves the least misfit b - A x, as that of GMRES does; images A v are kept
beside the directions v, so that no product is spent on misfits. It ends where the misfit is none, or where no other
direction is found.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int

_KEPT, _CYCLES = 60, 20  # directions of a cycle at most, and cycles
_ROUNDING = 1e3  # of products, by which a solution may miss
_UNSEEN = 1e-8, 1e2  # an image relative to the largest, at least so many roundings, that is none

Map = Callable[[Float[Array, " p"]], Float[Array, " p"]]


def krylov_solution(product: Map, right: Float[Array, " p"]) -> Float[Array, " p"]:
    """The solution of product(x) = right to rounding; its derivatives are those of a linear solution."""

    def solved(product: Map, right: Array) -> Array:
        return least_misfit(product, right)

    return jax.lax.custom_linear_solve(product, right, solved, transpose_solve=solved)


def least_misfit(
    product: Map, right: Float[Array, " p"], size: ArrayLike = 0.0, rounding: ArrayLike = 0.0, *, in_range: bool = False
) -> Float[Array, " p"]:
    """x, NaN where it is not found: among A b, A (A b), ... alone, all that A sees, if `in_range`.

    `size` is one of A, 0 where none is known, and `rounding` that of b.
    """
    kept, eps = min(_KEPT, right.size), float(jnp.finfo(right.dtype).eps)
    unseen = max(_UNSEEN[0], _UNSEEN[1] * eps)
    enough = jnp.maximum(_ROUNDING * eps * jnp.linalg.norm(right), rounding)
    first, largest = jnp.full((), 0 if in_range else 1), jnp.asarray(size, right.dtype)

    def onward(now: _Search) -> _Search:
        k, starts = jnp.maximum(now.products - 1, 0), now.products == 0
        image = product(now.ahead)
        largest = jnp.maximum(now.largest, jnp.linalg.norm(image))
        directions = jnp.where(starts, now.directions, now.directions.at[k].set(now.ahead))
        unit, length, along = _across(image, now.images)
        goes = ~starts & (length > unseen * largest)
        images = jnp.where(goes, now.images.at[k].set(unit), now.images)
        column = jnp.where(goes, along.at[k].set(length), 0.0)
        triangle = jnp.where(goes, now.triangle.at[:, k].set(column), now.triangle)
        misfit = now.misfit - jnp.where(goes, unit @ now.misfit, 0.0) * unit
        ahead, length, _ = _across(image, directions)
        ends = (length <= unseen * largest) | ~(jnp.linalg.norm(misfit) > enough)
        return _Search(directions, images, triangle, misfit, ahead, now.products + 1, largest, ends)

    def cycle(now: _Cycles) -> _Cycles:
        none = jnp.zeros((kept, right.size), right.dtype)
        ahead, _, _ = _across(now.misfit, none)
        start = _Search(none, none, jnp.eye(kept, dtype=right.dtype), now.misfit, ahead, first, largest, now.ends)
        end = jax.lax.while_loop(lambda now: ~now.ends & (now.products <= kept), onward, start)
        parts = jax.scipy.linalg.solve_triangular(end.triangle, end.images @ now.misfit)
        ends = ~(jnp.linalg.norm(end.misfit) > enough) | (end.ends & (end.products == 1))
        return _Cycles(now.x + parts @ end.directions, end.misfit, now.cycles + 1, ends)

    start = _Cycles(0.0 * right, right, jnp.zeros((), int), ~(jnp.linalg.norm(right) > enough))
    end = jax.lax.while_loop(lambda now: ~now.ends & (now.cycles < _CYCLES), cycle, start)
    return jnp.where(end.ends, end.x, jnp.nan)


class _Search(NamedTuple):
    """Orthonormal directions V, and Q and R with A V = Q R; what is left of b; what is multiplied next, and how
    many products there were; the largest image of a unit vector; and whether no other direction is seen."""

    directions: Float[Array, "k p"]
    images: Float[Array, "k p"]
    triangle: Float[Array, "k k"]
    misfit: Float[Array, " p"]
    ahead: Float[Array, " p"]
    products: Int[Array, ""]
    largest: Float[Array, ""]
    ends: Bool[Array, ""]


class _Cycles(NamedTuple):
    """The solution so far, what is left of b, and cycles; whether that is all."""

    x: Float[Array, " p"]
    misfit: Float[Array, " p"]
    cycles: Int[Array, ""]
    ends: Bool[Array, ""]


def _across(vector: Array, units: Array) -> tuple[Float[Array, " p"], Float[Array, ""], Float[Array, " k"]]:
    """The unit vector along the part of a vector across others, the length of that, and its parts along the others."""
    along = units @ vector
    across = vector - along @ units
    again = units @ across
    across, length = across - again @ units, jnp.linalg.norm(across)
    return across / jnp.where(length > 0, length, 1.0), length, along + again
