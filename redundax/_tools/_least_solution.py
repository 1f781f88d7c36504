"""The least solution of equations whose symmetric positive semidefinite matrix A is known by its products alone.

    x = A^+ b:   the least of those that leave the least misfit b - A x

x is sought among A b, A (A b), ... and so has no part that A does not see. Where A x = b, and goes on to hold as A
changes at one rank, x is that of

    x + A y = 0,   A x = b

whose derivatives of any order are right, whichever y is taken.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from ._krylov import least_misfit
from ._linear_map import LinearMap


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

    def sought(right: Array, rounding: ArrayLike) -> Float[Array, " p"]:
        return least_misfit(matrix.__matmul__, right, size, rounding, in_range=True)

    def value(_: object, rights: Array) -> Array:  # x for none on the right of the first
        return jnp.zeros_like(rights).at[0].set(sought(rights[1], rounding))

    def both(_: object, rights: Array) -> Array:
        def onward(right: Array, rounding: Array) -> tuple[Array, Array]:
            found = sought(right, rounding)
            return -found, found

        roundings = jnp.zeros(2, right.dtype).at[0].set(rounding)
        _, found = jax.lax.scan(onward, rights[1] - matrix @ rights[0], roundings)
        return found.at[0].add(rights[0])

    rights = jnp.stack([jnp.zeros_like(right), right])
    return jax.lax.custom_linear_solve(
        product, rights, both if derives else value, transpose_solve=both, symmetric=True
    )[0]
