"""The equations (7) of a large mechanism on a choice of independent rows, and the self-stress beside it.

    a = M^-1 (f - B^T mu),   S mu = B M^-1 f - g on the rows I that count,   S = B M^-1 B^T,   mu = 0 on the others, O

    N = [ -S_II^-1 S_IO ; I ]  spans the self-stress,   N^T y = y_O - S_OI S_II^-1 y_I

S_II is positive definite; its Cholesky factor and a step of refinement solve it. A row depends on those before it
where its pivot p is zero. The factor of S + t I exists at any rank, with

    p(t) = p + t (1 + |x|^2) + O(t^2),   x the combination of the others,   p = 2 p(t) - p(2 t),

whose rounding is that of 1 + |x|^2. The order is that of elimination, so N is sparse where the self-stress is local.

Derivatives in both modes are those of S_II itself, by the rule of a linear solution; the choice of rows has none.

Where bodies lack mass, (7) is solved with M + A for M, A some mass of theirs, and again for what that leaves of
f - M a: the error of a, among motions that the rows allow, falls each time by A over M + A. Where it does not, some
motion has no mass, and (14) does not hold.
"""

import functools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .._tools._linear_map import spectral_radius
from .._tools._value import AbstractModule
from ._cholesky import Fronts, factor, factor_diagonal, pivots, solution
from ._rows import Rows

SHIFT = 0.75  # power of the rounding: t, from which on the factor of S + t I exists at any rank
_ROUNDING, _PASSES = 10, 100  # changes that are rounding, and passes with M + A at most
_POWERS = 20  # of what a pass leaves of the error


class Gram(AbstractModule):
    """S of scaled rows, factorised on those that count.

    - `kept`: 1 for rows that count, else 0, shape (m,).
    """

    rows: Rows
    kept: Float[Array, " m"]
    fronts: tuple[Fronts, ...]

    @property
    def pivots(self) -> Float[Array, " m"]:
        """Diagonal of the factor, 1 for rows that do not count."""
        return pivots(self.rows.symbolic, self.fronts)

    def near(self, right: Float[Array, "m c"]) -> Float[Array, "m c"]:
        """`solution` without refinement and derivatives."""
        return solution(self.rows.symbolic, self.fronts, self.kept[:, None] * right)

    @eqx.filter_jit  # traced once, for the many places that it stands in
    def solution(self, right: Float[Array, "m c"], *, refines: bool = True) -> Float[Array, "m c"]:
        """S_II^-1 y_I, zero on O."""
        kept, symbolic = self.kept[:, None], self.rows.symbolic

        def product(mu: Array) -> Array:
            return kept * self.rows.gram(kept * mu) + (1 - kept) * mu

        def solved(product, right: Array) -> Array:
            if not refines:
                return solution(symbolic, self.fronts, right)

            def step(k: Array, mu: Array) -> Array:
                left = jax.lax.cond(k > 0, lambda: right - product(mu), lambda: right)
                return mu + solution(symbolic, self.fronts, left)

            return jax.lax.fori_loop(0, 2, step, jnp.zeros_like(right))

        return jax.lax.custom_linear_solve(product, kept * right, solved, symmetric=True)

    def respond(
        self, force: Float[Array, "n c"], gamma: Float[Array, "m c"], *, refines: bool = True
    ) -> tuple[Array, Array]:
        """a and mu."""
        if self.rows.mass is not None:
            right = jnp.concatenate([force, self.kept[:, None] * gamma])
            found = jax.lax.custom_linear_solve(self._balance, right, self._balanced, symmetric=True)
            return found[: len(force)], found[len(force) :]
        mu = self.solution(self.rows.times(self.rows.accelerations(force)) - gamma, refines=refines)
        return self.rows.accelerations(force - self.rows.transposed(mu)), mu

    def _balance(self, unknowns: Float[Array, "u c"]) -> Float[Array, "u c"]:
        """M a + B_I^T mu and B_I a; mu itself in place of the latter on O."""
        kept, rows, (a, mu) = self.kept[:, None], self.rows, self._parted(unknowns)
        forces = rows.inertia_force(a) + rows.transposed(kept * mu)
        return jnp.concatenate([forces, kept * rows.times(a) + (1 - kept) * mu])

    def _balanced(self, _: object, right: Float[Array, "u c"]) -> Float[Array, "u c"]:
        least = _ROUNDING * float(jnp.finfo(right.dtype).eps)

        def goes_on(now: _Passes) -> Array:
            better = (now.change < now.before) | (now.change > least**0.5)
            return (now.passes < 2) | ((now.passes < _PASSES) & (now.change > least) & better)

        def again(now: _Passes) -> _Passes:
            added = self._nearly(right - self._balance(now.found))
            found = now.found + added
            parts = zip(self._parted(added), self._parted(found), strict=True)
            change = functools.reduce(jnp.maximum, (_relative(*part) for part in parts))
            return _Passes(found, change, now.change, now.passes + 1)

        zero = jnp.zeros((), right.dtype)
        return jax.lax.while_loop(goes_on, again, _Passes(0.0 * right, zero, zero, jnp.zeros((), int))).found

    def _nearly(self, right: Float[Array, "u c"]) -> Float[Array, "u c"]:
        """The solution with M + A."""
        (force, gamma), kept = self._parted(right), self.kept[:, None]
        mu = self.near(self.rows.times(self.rows.accelerations(force)) - gamma)
        a = self.rows.accelerations(force - self.rows.transposed(mu))
        return jnp.concatenate([a, mu + (1 - kept) * gamma])

    def _parted(self, unknowns: Float[Array, "u c"]) -> tuple[Array, Array]:
        return unknowns[: -self.rows.count], unknowns[-self.rows.count :]

    def left_by_mass(self) -> Float[Array, ""]:
        """How much of the error of a the slowest motion keeps in a pass: 1 where it has no mass, 0 where all do."""
        if self.rows.mass is None:
            return jnp.zeros((), self.kept.dtype)
        like = jnp.zeros(self.rows.symbolic.columns.size + self.rows.count, self.kept.dtype)

        def left(error: Array) -> Array:
            return error - self._nearly(self._balance(error[:, None]))[:, 0]

        return spectral_radius(left, like, powers=_POWERS, last=1)

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


def _relative(change: Array, whole: Array) -> Array:
    """The largest change of a column, relative to the largest entry of it."""
    change, size = (jnp.max(jnp.abs(x), axis=0) for x in (change, whole))
    return jnp.max(change / jnp.where(size > 0, size, 1.0))


class _Passes(NamedTuple):
    """a and mu, how much they changed in the last pass and in that before, relative, and passes so far."""

    found: Float[Array, "u c"]
    change: Float[Array, ""]
    before: Float[Array, ""]
    passes: Int[Array, ""]


def gram(rows: Rows, kept: Float[Array, " m"]) -> Gram:
    """S of scaled rows, factorised on those that are kept."""
    return Gram(rows, kept, factor(rows.symbolic, jax.lax.stop_gradient(rows.entries(kept))))


def rank_pivots(rows: Rows) -> tuple[Float[Array, " m"], Float[Array, " m"], float]:
    """Squares p of the pivots of S, 1 + |x|^2 of each, and t; right where t (1 + |x|^2) is less than p."""
    rows = jax.lax.stop_gradient(rows)
    shift = float(jnp.finfo(rows.slopes.dtype).eps) ** SHIFT
    entries = rows.entries(jnp.ones(rows.count, rows.slopes.dtype))
    diagonal = rows.symbolic.beside[:, 0]

    def shifted(t: Array) -> Array:
        return factor_diagonal(rows.symbolic, entries.at[diagonal].add(t)) ** 2

    once, twice = jax.lax.map(shifted, shift * jnp.asarray([1.0, 2.0], entries.dtype))  # one factor after the other
    return 2 * once - twice, (twice - once) / shift, shift
