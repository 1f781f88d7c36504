"""The Jacobian of a mechanism by rows and bodies, B, and its mass by bodies, M: products, none of them dense."""

from typing import cast

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._tools._by_number import sum_few
from .._tools._value import AbstractModule
from ._symbolic import Symbolic


class Rows(AbstractModule):
    """B and M^-1.

    - `slopes`: entries of B as in `Symbolic`, zero for none, shape (m, w, s).
    - `inverse_mass`: of each body, shape (bodies, s, s); with more mass for those that lack some.
    - `mass`: M of each body where some lack mass, else `None`.
    """

    symbolic: Symbolic
    slopes: Float[Array, "m w s"]
    inverse_mass: Float[Array, "bodies s s"]
    mass: Float[Array, "bodies s s"] | None = None

    @property
    def count(self) -> int:
        """m."""
        return len(self.symbolic.mates)

    def scaled(self, row_scale: Float[Array, " m"]) -> "Rows":
        """D^-1 B for B."""
        return Rows(self.symbolic, self.slopes / row_scale[:, None, None], self.inverse_mass, self.mass)

    def times(self, v: Float[Array, "n c"]) -> Float[Array, "m c"]:
        """B v."""
        own = v[self.symbolic.columns][self.symbolic.body]
        return sum_few(sum_few(self.slopes[..., None] * own, axis=2), axis=1)

    def transposed(self, mu: Float[Array, "m c"]) -> Float[Array, "n c"]:
        """B^T mu."""
        each = self.slopes[..., None] * mu[:, None, None]
        own = jnp.zeros((*self.symbolic.columns.shape, mu.shape[1]), each.dtype).at[self.symbolic.body].add(each)
        return self._of_bodies(own)

    def accelerations(self, force: Float[Array, "n c"]) -> Float[Array, "n c"]:
        """M^-1 f."""
        return self._of_bodies(self.inverse_mass @ force[self.symbolic.columns])

    def inertia_force(self, a: Float[Array, "n c"]) -> Float[Array, "n c"]:
        """M a, where some bodies lack mass."""
        return self._of_bodies(cast(Array, self.mass) @ a[self.symbolic.columns])

    def gram(self, mu: Float[Array, "m c"]) -> Float[Array, "m c"]:
        """S mu = B M^-1 B^T mu."""
        return self.times(self.accelerations(self.transposed(mu)))

    def diagonal(self) -> Float[Array, " m"]:
        """The diagonal of S: what a unit of each multiplier accelerates its own row.

        A row can have slopes of one body twice. Where they leave no more than rounding of each other, as where a row
        says nothing, it is that of slopes that do not.
        """
        body = self.symbolic.body
        each = sum_few(self.slopes[:, :, None] * self._moved()[:, None])
        whole = sum_few(sum_few(jnp.where(body[:, :, None] == body[:, None], each, 0.0)))
        apart = sum_few(jnp.diagonal(each, axis1=1, axis2=2))
        return jnp.where(whole > float(jnp.finfo(each.dtype).eps) ** 0.5 * apart, whole, apart)

    def entries(self, kept: Float[Array, " m"], beside: Float[Array, "m j"] | None = None) -> Float[Array, " size"]:
        """S in the fronts, with the row of I for rows that do not count; `beside`, among rows of a joint, is
        added."""
        symbolic, (_, w, s) = self.symbolic, self.slopes.shape
        pairs = self.slopes.reshape(-1, s)[symbolic.first] * self._moved().reshape(-1, s)[symbolic.second]
        each = sum_few(pairs) * (kept[symbolic.first // w] * kept[symbolic.second // w])
        found = jnp.zeros(symbolic.size, each.dtype).at[symbolic.place].add(each)
        found = found.at[symbolic.beside[:, 0]].add(1 - kept)
        return found if beside is None else found.at[symbolic.beside].add(beside, mode="drop")

    def _moved(self) -> Float[Array, "m w s"]:
        """What each slope accelerates of its body."""
        return sum_few(self.inverse_mass[self.symbolic.body] * self.slopes[:, :, None])

    def _of_bodies(self, own: Float[Array, "bodies s c"]) -> Float[Array, "n c"]:
        columns = self.symbolic.columns
        return jnp.zeros((columns.size, own.shape[2]), own.dtype).at[columns].set(own, unique_indices=True)
