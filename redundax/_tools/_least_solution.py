"""The least solution of equations whose symmetric positive semidefinite matrix A is known by its products alone.

    x = A^+ b:   the least of those that leave the least misfit b - A x

x is sought among A b, A (A b), ... and so has no part that A does not see; it leaves the least misfit. It ends where
that is none, or where no other direction is found. Where A x = b, and goes on to hold as A changes at one rank, x is
that of

    x + A y = 0,   A x = b

whose derivatives of any order are right, whichever y is taken.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int

from ._linear_map import LinearMap

_KEPT, _CYCLES = 60, 20  # directions of a cycle at most, and cycles
_ROUNDING = 1e3  # of products, by which a solution may miss
_UNSEEN = 1e-8, 1e2  # an image relative to the largest, at least so many roundings, that is none


@eqx.filter_custom_jvp
def least_solution(
    matrix: LinearMap, right: Float[Array, " p"], size: Float[Array, ""], rounding: ArrayLike = 0.0
) -> Float[Array, " p"]:
    """A^+ b, NaN where it is not found; `size` is one of A, `rounding` that of b."""
    return _solution(matrix, right, size, rounding, derives=False)


@least_solution.def_jvp
def _(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    return eqx.filter_jvp(_solution, primals, tangents)


def _solution(
    matrix: LinearMap, right: Array, size: Array, rounding: ArrayLike = 0.0, *, derives: bool = True
) -> Float[Array, " p"]:
    """x; y is sought for derivatives alone."""

    def product(unknowns: Array) -> Array:
        x, y = unknowns
        return jnp.stack([x + matrix @ y, matrix @ x])

    def solved(rights: Array, roundings: Array) -> Array:
        def onward(right: Array, rounding: Array) -> tuple[Array, Array]:
            found = _found(matrix.__matmul__, right, size, rounding)
            return -found, found

        _, found = jax.lax.scan(onward, rights[1] - matrix @ rights[0], roundings)
        return jnp.zeros_like(rights).at[: roundings.size].set(found).at[0].add(rights[0])

    both = jnp.zeros(2, right.dtype).at[0].set(rounding)
    return jax.lax.custom_linear_solve(
        product,
        jnp.stack([jnp.zeros_like(right), right]),
        lambda _, rights: solved(rights, both if derives else both[:1]),
        lambda _, rights: solved(rights, both),
        symmetric=True,
    )[0]


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


def _found(product: Callable, right: Array, size: Array, rounding: ArrayLike) -> Float[Array, " p"]:
    kept, eps = min(_KEPT, right.size), float(jnp.finfo(right.dtype).eps)
    unseen = max(_UNSEEN[0], _UNSEEN[1] * eps)
    enough = jnp.maximum(_ROUNDING * eps * jnp.linalg.norm(right), rounding)

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
        start = _Search(
            none, none, jnp.eye(kept, dtype=right.dtype), now.misfit, ahead, jnp.zeros((), int), size, now.ends
        )
        end = jax.lax.while_loop(lambda now: ~now.ends & (now.products <= kept), onward, start)
        parts = jax.scipy.linalg.solve_triangular(end.triangle, end.images @ now.misfit)
        ends = ~(jnp.linalg.norm(end.misfit) > enough) | (end.ends & (end.products == 1))
        return _Cycles(now.x + parts @ end.directions, end.misfit, now.cycles + 1, ends)

    start = _Cycles(0.0 * right, right, jnp.zeros((), int), ~(jnp.linalg.norm(right) > enough))
    end = jax.lax.while_loop(lambda now: ~now.ends & (now.cycles < _CYCLES), cycle, start)
    return jnp.where(end.ends, end.x, jnp.nan)


def _across(vector: Array, units: Array) -> tuple[Float[Array, " p"], Float[Array, ""], Float[Array, " k"]]:
    """The unit vector along the part of a vector across others, the length of that, and its parts along the others."""
    along = units @ vector
    across = vector - along @ units
    again = units @ across
    across, length = across - again @ units, jnp.linalg.norm(across)
    return across / jnp.where(length > 0, length, 1.0), length, along + again
