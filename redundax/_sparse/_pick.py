"""The closure (W, d) on a large mechanism: mu + N z with N^T (W (mu + N z) - d) = 0.

N^T W N, of one unknown for each redundant row, is never formed: conjugate gradients solve it, led by

    N^T W N  near  e ((S + e W)^-1)_OO ^-1     for small e,

whose error is e over the least eigenvalue of S, so that a few steps reach rounding. W couples rows of one joint.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._cholesky import Fronts, factor, pivots, solution
from ._gram import Gram
from ._rows import Rows

_WEIGHT = 0.4  # power of the rounding: e
_STEPS, _FAILED = 60, 1e-10  # at most; a residual that is no solution


class Compliance(eqx.Module):
    """A compliance W of scaled rows, with its size taken out, as entries of each row with its mates, shape (m, j)."""

    rows: Rows
    entries: Float[Array, "m j"]
    size: Float[Array, ""]

    def times(self, mu: Float[Array, "m c"]) -> Float[Array, "m c"]:
        """W mu / size."""
        padded = jnp.concatenate([mu, jnp.zeros((1, mu.shape[1]), mu.dtype)])
        return jnp.sum(self.entries[:, :, None] * padded[self.rows.plan.mates], axis=1)


def scaled_compliance(rows: Rows, entries: Float[Array, "m j"], row_scale: Float[Array, " m"]) -> Compliance:
    """D^-1 W D^-1."""
    padded = jnp.append(row_scale, 1.0)
    entries = entries / row_scale[:, None] / padded[rows.plan.mates]
    size = jax.lax.stop_gradient(jnp.max(jnp.abs(entries)))
    size = jnp.where(size > 0, size, 1.0)
    return Compliance(rows, entries / size, size)


class Picking(eqx.Module):
    """G = N (N^T W N)^-1 N^T of scaled rows and multipliers."""

    gram: Gram
    compliance: Compliance
    fronts: tuple[Fronts, ...]

    def response(self, misfit: Float[Array, "m c"]) -> Float[Array, "m c"]:
        """G d times the size of W, column by column; nothing is computed where there is no self-stress."""
        if misfit.shape[1] > 1:
            return jax.lax.map(lambda column: self._response(column[:, None])[:, 0], misfit.T).T
        return self._response(misfit)

    @eqx.filter_jit  # traced once, for the many places that it stands in
    def _response(self, misfit: Float[Array, "m 1"]) -> Float[Array, "m 1"]:
        def found() -> Array:
            return self.gram.stress(self._inverse(self.gram.across(misfit)))

        return jax.lax.cond(jnp.any(self.gram.kept == 0), found, lambda: jnp.zeros_like(misfit))

    def _inverse(self, right: Float[Array, "m c"]) -> Float[Array, "m c"]:
        others, plan = (1 - self.gram.kept)[:, None], self.gram.rows.plan

        def product(z: Array) -> Array:
            inside = self.gram.across(self.compliance.times(self.gram.stress(z)))
            return inside + (1 - others) * z

        def near(right: Array) -> Array:
            return others * _weight(right) * solution(plan, self.fronts, right) + (1 - others) * right

        def solved(product: Callable, right: Array) -> Array:
            return _conjugate_gradients(product, near, right)

        return jax.lax.custom_linear_solve(product, right, solved, symmetric=True)


def picking(gram: Gram, compliance: Compliance) -> tuple[Picking, Float[Array, ""]]:
    """G, and the least square of a pivot of S + e W of a row that does not count, over e."""
    rows, weight = gram.rows, _weight(compliance.entries)
    once = jnp.where(rows.plan.beside < rows.plan.size, weight * compliance.entries, 0.0)
    after = 0.0 * jnp.sum(gram.pivots)  # one factor after the other

    def whole() -> tuple[Fronts, ...]:
        return factor(rows.plan, rows.entries(jnp.ones_like(gram.kept), once) + after)

    fronts = jax.lax.cond(jnp.any(gram.kept == 0), whole, lambda: gram.fronts)
    fronts = jax.lax.stop_gradient(fronts)
    least = jnp.min(jnp.where(gram.kept > 0, 1.0, pivots(rows.plan, fronts) ** 2 / weight))
    return Picking(gram, compliance, fronts), least


def _conjugate_gradients(product: Callable, near: Callable, right: Float[Array, "m c"]) -> Float[Array, "m c"]:
    """The solution of product(z) = right, or NaN; both stand in a program once."""
    size = jnp.sum(right**2, axis=0)
    least = float(jnp.finfo(right.dtype).eps) ** 2 * size

    def goes_on(carry: _Gradients) -> Array:
        return (carry.steps < _STEPS) & jnp.any(jnp.sum(carry.left**2, axis=0) > least)

    def step(carry: _Gradients) -> _Gradients:
        ahead = near(carry.left)
        energy = jnp.sum(carry.left * ahead, axis=0)
        along = ahead + _ratio(energy, carry.energy) * carry.along
        image = product(along)
        length = _ratio(energy, jnp.sum(along * image, axis=0))
        return _Gradients(carry.z + length * along, carry.left - length * image, along, energy, carry.steps + 1)

    none = jnp.zeros_like(right)
    start = _Gradients(none, right, none, jnp.zeros_like(right[0]), jnp.zeros((), int))
    end = jax.lax.while_loop(goes_on, step, start)
    failed = max(_FAILED, 1e3 * float(jnp.finfo(right.dtype).eps))
    return jnp.where(jnp.sum(end.left**2, axis=0) <= failed**2 * size, end.z, jnp.nan)


class _Gradients(NamedTuple):
    """Solution, residual, direction, energy of the last residual, and steps so far."""

    z: Array
    left: Array
    along: Array
    energy: Array
    steps: Array


def _ratio(part: Array, whole: Array) -> Array:
    return jnp.where(whole > 0, part / jnp.where(whole > 0, whole, 1.0), 0.0)


def _weight(like: Array) -> float:
    return float(jnp.finfo(like.dtype).eps) ** _WEIGHT
