"""Linear maps that are known by their products alone, where matrices would be too large."""

from collections.abc import Callable
from typing import overload

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from ._value import AbstractModule

_POWERS, _LAST = 8, 4  # of a map, and those whose growth is its spectral radius


class LinearMap(AbstractModule):
    """`function(*given, vector)`, linear in the vector."""

    function: Callable[..., Array] = eqx.field(static=True)
    given: tuple[PyTree, ...]

    @overload
    def __matmul__(self, other: "LinearMap") -> "LinearMap": ...
    @overload
    def __matmul__(self, other: Array) -> Array: ...
    def __matmul__(self, other: "Array | LinearMap") -> "Array | LinearMap":
        """What it makes of a vector, or of what another map makes."""
        if isinstance(other, LinearMap):
            return LinearMap(_after, (self, other))
        return self.function(*self.given, other)


def _after(outer: LinearMap, inner: LinearMap, vector: Float[Array, " p"]) -> Float[Array, " p"]:
    return outer @ (inner @ vector)


def spectral_radius(
    product: Callable[[Float[Array, " p"]], Float[Array, " p"]],
    like: Float[Array, " p"],
    *,
    powers: int = _POWERS,
    last: int = _LAST,
) -> Array:
    """An estimate, no bound: how much the last of some powers of the map let a vector without pattern grow."""
    start = jnp.cos(jnp.arange(like.size, dtype=like.dtype) ** 2)

    def powered(vector: Array, _: None) -> tuple[Array, Array]:
        image = product(vector)
        size = jnp.linalg.norm(image)
        return jnp.where(size > 0, image / jnp.where(size > 0, size, 1.0), 0.0), size

    sizes = jax.lax.scan(powered, start / jnp.linalg.norm(start), None, length=powers)[1]
    return jnp.prod(sizes[-last:]) ** (1 / last)
