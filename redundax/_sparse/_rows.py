"""The Jacobian of a mechanism by rows and bodies, B, and its mass by bodies, M: products, none of them dense."""

from typing import cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._plan import Plan


class Rows(eqx.Module):
    """B and M^-1.

    - `slopes`: entries of B as in `Plan`, shape (e, s).
    - `inverse_mass`: of each body, shape (bodies, s, s); with more mass for those that lack some.
    - `mass`: M of each body where some lack mass, else `None`.
    """

    plan: Plan
    slopes: Float[Array, "e s"]
    inverse_mass: Float[Array, "bodies s s"]
    mass: Float[Array, "bodies s s"] | None = None

    @property
    def count(self) -> int:
        """m."""
        return len(self.plan.mates)

    def scaled(self, row_scale: Float[Array, " m"]) -> "Rows":
        """D^-1 B for B."""
        return Rows(self.plan, self.slopes / row_scale[self.plan.row][:, None], self.inverse_mass, self.mass)

    def times(self, v: Float[Array, "n c"]) -> Float[Array, "m c"]:
        """B v."""
        own = v[self.plan.columns[self.plan.body]]
        each = jnp.sum(self.slopes[:, :, None] * own, axis=1)
        return jnp.zeros((self.count, v.shape[1]), each.dtype).at[self.plan.row].add(each)

    def transposed(self, mu: Float[Array, "m c"]) -> Float[Array, "n c"]:
        """B^T mu."""
        each = self.slopes[:, :, None] * mu[self.plan.row][:, None]
        own = jnp.zeros((*self.plan.columns.shape, mu.shape[1]), each.dtype).at[self.plan.body].add(each)
        return self._of_bodies(own)

    def accelerations(self, force: Float[Array, "n c"]) -> Float[Array, "n c"]:
        """M^-1 f."""
        return self._of_bodies(self.inverse_mass @ force[self.plan.columns])

    def inertia_force(self, a: Float[Array, "n c"]) -> Float[Array, "n c"]:
        """M a, where some bodies lack mass."""
        return self._of_bodies(cast(Array, self.mass) @ a[self.plan.columns])

    def gram(self, mu: Float[Array, "m c"]) -> Float[Array, "m c"]:
        """S mu = B M^-1 B^T mu."""
        return self.times(self.accelerations(self.transposed(mu)))

    def diagonal(self) -> Float[Array, " m"]:
        """The diagonal of S: what a unit of each multiplier accelerates its own row.

        A row can have slopes of one body twice. Where they leave no more than rounding of each other, as where a row
        says nothing, it is that of slopes that do not.
        """
        plan, each = self.plan, self._of_pairs()
        row, other = plan.row[plan.first], plan.row[plan.second]
        whole, apart = (
            jnp.zeros(self.count, each.dtype).at[row].add(jnp.where(mask, each, 0.0))
            for mask in (row == other, plan.first == plan.second)
        )
        return jnp.where(whole > float(jnp.finfo(each.dtype).eps) ** 0.5 * apart, whole, apart)

    def entries(self, kept: Float[Array, " m"], beside: Float[Array, "m j"] | None = None) -> Float[Array, " size"]:
        """S in the fronts of the plan, with the row of I for rows that do not count; `beside`, among rows of a joint,
        is added."""
        plan = self.plan
        each = self._of_pairs() * (kept[plan.row[plan.first]] * kept[plan.row[plan.second]])
        found = jnp.zeros(plan.size, each.dtype).at[plan.place].add(each)
        found = found.at[plan.beside[:, 0]].add(1 - kept)
        return found if beside is None else found.at[plan.beside].add(beside, mode="drop")

    def _of_pairs(self) -> Float[Array, " pairs"]:
        """What each pair of slopes of one body adds to S."""
        moved = jnp.einsum("ejk,ek->ej", self.inverse_mass[self.plan.body], self.slopes)
        return jnp.sum(self.slopes[self.plan.first] * moved[self.plan.second], axis=1)

    def _of_bodies(self, own: Float[Array, "bodies s c"]) -> Float[Array, "n c"]:
        columns = self.plan.columns
        return jnp.zeros((columns.size, own.shape[2]), own.dtype).at[columns].set(own, unique_indices=True)
