"""Friction of a joint that holds or starts to slip in several directions: the nearest to rest within a ball

    min f^T B f / 2 + g^T f,   |f| <= limit:   f = -(B + lambda)^-1 g,   lambda >= 0,   lambda > 0 only at the limit

so that the acceleration B f + g of its surfaces is against f, and zero where f is within the limit. On the eigenvectors
of B the size of f is a sum, and 1 / |f| nearly linear in lambda, which Newton's method finds from below.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._system._directions import Directions

_NEWTON = 12  # steps; each doubles the digits
_BLOCKED = 1e-12, 10  # eigenvalues, relative to the largest, at least so many roundings, that leave no slip
_ROUNDING = 1e-9, 1e3  # and accelerations there, relative to the parts that cancel, that are none


class Balls(NamedTuple):
    """Joints with several slips, padded with the slip p: arms, eigenvalues and vectors of B, and accelerations of their
    surfaces by all friction."""

    directions: Directions
    slips: np.ndarray
    arms: Float[Array, "b w"]
    values: Float[Array, "b w"]
    vectors: Float[Array, "b w w"]
    matrix: Float[Array, "b w p"]

    @classmethod
    def of(cls, directions: Directions, matrix: Float[Array, "p p"]) -> "Balls":
        """Given the slip accelerations by unit friction."""
        width, p = max(map(len, directions.joints)), matrix.shape[0]
        slips = np.array([[*joint, *[p] * (width - len(joint))] for joint in directions.joints])
        arms = directions.arms.at[slips].get(mode="fill", fill_value=0.0)
        rows = arms[..., None] * matrix.at[slips].get(mode="fill", fill_value=0.0)
        own = jnp.take_along_axis(rows, jnp.asarray(np.minimum(slips, p - 1))[:, None, :], axis=2) * arms[:, None, :]
        values, vectors = jnp.linalg.eigh((own + own.mT) / 2)
        return cls(directions, slips, arms, values, vectors, rows)

    def swept(
        self,
        tau: Float[Array, " p"],
        alone: Callable[[Array, Array], Array],
        free: Float[Array, " p"],
        low: Float[Array, " p"],
        high: Float[Array, " p"],
    ) -> Float[Array, " p"]:
        """Friction after joint by joint has found its own, those with one slip by `alone(j, tau)`."""
        slips, directed, held = jnp.asarray(self.slips), self.directions.directed, self.directions.any(low < high)
        tiny, none = (max(least, times * float(jnp.finfo(tau.dtype).eps)) for least, times in (_BLOCKED, _ROUNDING))

        def single(j: Array, new: Array) -> Array:
            return jnp.where(jnp.asarray(directed)[j], new, alone(j, new))

        def joint(b: Array, new: Array) -> Array:
            own, arms, vectors = slips[b], self.arms[b], self.vectors[b]

            def of(x: Array) -> Array:
                return x.at[own].get(mode="fill", fill_value=0)

            force = jnp.where(arms > 0, of(new) / jnp.where(arms > 0, arms, 1.0), 0.0)
            limit = jnp.linalg.norm(jnp.where(arms > 0, of(high) / jnp.where(arms > 0, arms, 1.0), 0.0))
            values = jnp.where(self.values[b] > tiny * jnp.max(self.values[b]), self.values[b], 0.0)
            pull = vectors.T @ (arms * of(free) + self.matrix[b] @ new) - values * (vectors.T @ force)
            whole = jnp.max(jnp.abs(arms * of(free)) + jnp.abs(self.matrix[b]) @ jnp.abs(new))
            pull = jnp.where((values == 0) & (jnp.abs(pull) <= none * whole), 0.0, pull)
            found = arms * (vectors @ nearest(values, pull, limit))
            return new.at[own].set(jnp.where(of(held), found, of(new)), mode="drop")

        begin = jnp.where(directed & ~held, low, tau)
        return jax.lax.fori_loop(0, len(self.slips), joint, jax.lax.fori_loop(0, tau.size, single, begin))


def nearest(values: Float[Array, " w"], pull: Float[Array, " w"], limit: Float[Array, ""]) -> Float[Array, " w"]:
    """f of the problem above for a diagonal B, zero where neither B nor g says anything."""
    size = jnp.where(limit > 0, limit, 1.0)

    def at(more: Array) -> tuple[Array, Array]:
        divided = values + more
        divided = jnp.where(divided > 0, divided, 1.0)
        force = jnp.where(pull != 0, -pull / divided, 0.0)
        return force, jnp.sum(force**2 / divided)

    def newton(_: Array, more: Array) -> Array:
        force, slope = at(more)
        squared = jnp.sum(force**2)
        change = squared / jnp.where(slope > 0, slope, 1.0) * (jnp.sqrt(squared) / size - 1)
        return jnp.maximum(more + change, 0.0)

    least = jnp.maximum(jnp.max(jnp.abs(pull) / size - values), 0.0)
    force, _ = at(jax.lax.fori_loop(0, _NEWTON, newton, least))
    found = jnp.linalg.norm(force)
    return force * jnp.where(found > limit, limit / jnp.where(found > 0, found, 1.0), 1.0)
