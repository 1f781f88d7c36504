"""LAPACK's calls in a program one after the other: side by side, two can wait for each other for good on few cores."""

from collections.abc import Callable

import jax
from jaxtyping import Array

from ._numbers import are_numbers


def in_order(x: Array, earlier: Array) -> Array:
    """x, computed after a finite number."""
    return x if are_numbers(x, earlier) else x + 0.0 * jax.lax.stop_gradient(earlier)


def one_by_one(alone: Callable[[Array], Array], each: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """A decomposition whose batch runs sample after sample, by `each`: batched, it could run beside another one."""
    traced = jax.custom_batching.custom_vmap(alone)

    @traced.def_vmap
    def _(_size: int, _batched: list[bool], samples: Array) -> tuple[Array, bool]:
        return jax.lax.map(each, samples), True

    return lambda x: alone(x) if are_numbers(x) else traced(x)
