"""The equations (7) of a large mechanism on a choice of independent rows, and the self-stress beside it.

    a = M^-1 (f - B^T mu),   S mu = B M^-1 f - g on the rows I that count,   S = B M^-1 B^T,   mu = 0 on the others, O

    N = [ -S_II^-1 S_IO ; I ]  spans the self-stress,   N^T y = y_O - S_OI S_II^-1 y_I

S_II is positive definite; its Cholesky factor and a step of refinement solve it. A row depends on those before it
where its pivot p is zero. The factor of S + t I exists at any rank, with

    p(t) = p + t (1 + |x|^2) + O(t^2),   x the combination of the others,   p = 2 p(t) - p(2 t),

whose rounding is that of 1 + |x|^2. The order is that of elimination, so N is sparse where the self-stress is local.

Derivatives in both modes are those of S_II itself, by the rule of a linear solution; the choice of rows has none.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._cholesky import Fronts, factor, factor_diagonal, pivots, solution
from ._rows import Rows

_SHIFT = 0.75  # power of the rounding: t


class Gram(eqx.Module):
    """S of scaled rows, factorised on those that count.

    - `kept`: 1 for rows that count, else 0, shape (m,).
    """

    rows: Rows
    kept: Float[Array, " m"]
    fronts: tuple[Fronts, ...]

    @property
    def pivots(self) -> Float[Array, " m"]:
        """Diagonal of the factor, 1 for rows that do not count."""
        return pivots(self.rows.plan, self.fronts)

    def near(self, right: Float[Array, "m c"]) -> Float[Array, "m c"]:
        """`solution` without refinement and derivatives."""
        return solution(self.rows.plan, self.fronts, self.kept[:, None] * right)

    @eqx.filter_jit  # traced once, for the many places that it stands in
    def solution(self, right: Float[Array, "m c"], *, refines: bool = True) -> Float[Array, "m c"]:
        """S_II^-1 y_I, zero on O."""
        kept, plan = self.kept[:, None], self.rows.plan

        def product(mu: Array) -> Array:
            return kept * self.rows.gram(kept * mu) + (1 - kept) * mu

        def solved(product, right: Array) -> Array:
            if not refines:
                return solution(plan, self.fronts, right)

            def step(k: Array, mu: Array) -> Array:
                left = jax.lax.cond(k > 0, lambda: right - product(mu), lambda: right)
                return mu + solution(plan, self.fronts, left)

            return jax.lax.fori_loop(0, 2, step, jnp.zeros_like(right))

        return jax.lax.custom_linear_solve(product, kept * right, solved, symmetric=True)

    def respond(
        self, force: Float[Array, "n c"], gamma: Float[Array, "m c"], *, refines: bool = True
    ) -> tuple[Array, Array]:
        """a and mu."""
        mu = self.solution(self.rows.times(self.rows.accelerations(force)) - gamma, refines=refines)
        return self.rows.accelerations(force - self.rows.transposed(mu)), mu

    def nearest(self, off: Float[Array, "m c"]) -> Float[Array, "n c"]:
        """The change of least M-norm by which the rows that count change as much."""
        return self.rows.accelerations(self.rows.transposed(self.near(off)))

    def stress(self, z: Float[Array, "m c"]) -> Float[Array, "m c"]:
        """N z, of the entries of z on O."""
        z = (1 - self.kept)[:, None] * z
        return z - self.solution(self.rows.gram(z))

    def across(self, y: Float[Array, "m c"]) -> Float[Array, "m c"]:
        """N^T y, on O."""

        def found() -> Array:
            return (1 - self.kept)[:, None] * (y - self.rows.gram(self.solution(y)))

        return jax.lax.cond(jnp.any(self.kept == 0), found, lambda: jnp.zeros_like(y))


def gram(rows: Rows, kept: Float[Array, " m"]) -> Gram:
    """S of scaled rows, factorised on those that are kept."""
    return Gram(rows, kept, factor(rows.plan, jax.lax.stop_gradient(rows.entries(kept))))


def rank_pivots(rows: Rows) -> tuple[Float[Array, " m"], Float[Array, " m"], float]:
    """Squares p of the pivots of S, 1 + |x|^2 of each, and t; right where t (1 + |x|^2) is less than p."""
    rows = jax.lax.stop_gradient(rows)
    shift = float(jnp.finfo(rows.slopes.dtype).eps) ** _SHIFT
    entries = rows.entries(jnp.ones(rows.count, rows.slopes.dtype))
    diagonal = rows.plan.beside[:, 0]

    def shifted(t: Array) -> Array:
        return factor_diagonal(rows.plan, entries.at[diagonal].add(t)) ** 2

    once, twice = jax.lax.map(shifted, shift * jnp.asarray([1.0, 2.0], entries.dtype))  # one factor after the other
    return 2 * once - twice, (twice - once) / shift, shift
