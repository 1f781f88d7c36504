"""Values and derivatives where there is no answer: NaN both, and nothing where the caller has masked them.

The gradient of a sum over a batch multiplies each derivative by a cotangent, which is 0 for what the caller masks, as
by `jnp.where(solution.result == successful, value, 0.0)`. Were a lost sample's derivative NaN as a number, 0 times it
would spoil the gradient of all; were it selected away, a value of NaN would come with a gradient that looks right. So
the transposed map passes 0 on as 0, and all else as NaN. That is no linear map, but JAX asks only for its transpose.

It cannot be had of second derivatives: those of what is linear are 0, of NaN too, and a masked sample may make them
NaN, as the tangent of its cotangent is a product with its value.
"""

from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, PyTree

from ._numbers import are_known, are_numbers, custom_jvp, is_number, stop_gradient, xp

T = TypeVar("T")


@custom_jvp
def nan_where(lost: Bool[Array, "..."], x: Array) -> Array:
    """x, or NaN where it is lost, and so are its derivatives: see `nan_derivative_where`."""
    return xp.where(lost, xp.nan, x)


@nan_where.defjvp
def _nan_where_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    return nan_where(*primals), nan_derivative_where(primals[0], tangents[1])


@jax.custom_jvp
def without_derivative(lost: Bool[Array, "..."], x: Array) -> Array:
    """x, with derivatives NaN where `lost` says that those computed are none: see `nan_derivative_where`."""
    return x


@without_derivative.defjvp
def _without_derivative_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    return without_derivative(*primals), nan_derivative_where(primals[0], tangents[1])


def is_differentiated(*trees: PyTree) -> Bool[Array, ""]:
    """Whether derivatives by any of these numbers are being taken, which may ask for more than the value does."""
    numbers = [x for x in jax.tree.leaves(trees) if eqx.is_inexact_array(x)]
    return xp.zeros((), bool) if are_known(numbers) else stop_gradient(_differentiated(numbers) > 0)


@jax.custom_jvp
def _differentiated(numbers: list[Array]) -> Array:
    return jnp.zeros(())


@_differentiated.defjvp
def _differentiated_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    return jnp.ones(()), jnp.zeros(())


def without_second_derivatives(lost: Bool[Array, "..."], tree: T) -> T:
    """The same, with second derivatives NaN where `lost` says that those computed are none."""
    if are_numbers(lost, tree):
        return tree
    return jax.tree.map(lambda x: _first_alone(lost, x) if eqx.is_inexact_array(x) else x, tree)


@jax.custom_jvp
def _first_alone(lost: Bool[Array, "..."], x: Array) -> Array:
    return x


@_first_alone.defjvp
def _first_alone_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    return _first_alone(*primals), without_derivative(primals[0], tangents[1])


def without_derivatives(figures: T, given: PyTree) -> T:
    """The same figures, which are found without derivatives: these are NaN, where those of what is given are taken."""
    if are_numbers(figures, given):
        return figures
    some = sum(jnp.sum(x) for x in jax.tree.leaves(given) if eqx.is_inexact_array(x))
    return jax.tree.map(lambda x: _of(x, jnp.asarray(some)), figures)


@jax.custom_jvp
def _of(x: Array, given: Array) -> Array:
    return x


@_of.defjvp
def _of_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    x, moved = primals[0], tangents[1]
    return _of(*primals), nan_derivative_where(jnp.ones((), bool), jnp.broadcast_to(moved, x.shape).astype(x.dtype))


def nan_derivative_where(lost: Bool[Array, "..."], tangent: Array) -> Array:
    """A tangent, NaN where it is lost; transposed, a cotangent of 0 stays 0 there and any other becomes NaN."""
    return jax.lax.custom_linear_solve(
        lambda x: x,
        tangent,
        solve=lambda _, x: jnp.where(lost, jnp.nan, x),
        transpose_solve=lambda _, x: jnp.where(lost & (x != 0), jnp.nan, x),
    )


def cut_where(failed: Bool[Array, ""], tree: T) -> T:
    """The same, without derivatives where a call has failed: what it computes there is lost, and 0 times it is NaN."""
    if is_number(failed):
        return tree
    return jax.tree.map(
        lambda x: jnp.where(failed, jax.lax.stop_gradient(x), x) if eqx.is_inexact_array(x) else x, tree
    )


def spoiled_where(failed: Bool[Array, ""], tree: T, given: PyTree, lose: Callable[..., Array] = nan_where) -> T:
    """The same, NaN where a call has failed, and so are its derivatives by all that was given; of tangents by
    `nan_derivative_where`."""
    if are_numbers(failed, tree):
        return jax.tree.map(lambda x: nan_where(failed, x), tree)
    some = sum(jnp.sum(x) for x in jax.tree.leaves(given) if eqx.is_inexact_array(x))
    return jax.tree.map(
        lambda x: jnp.where(failed, lose(failed, jnp.broadcast_to(some, x.shape).astype(x.dtype)), x), tree
    )
