"""The closure (W, d) on a large mechanism: x = G d, the self-stress with N^T (W x - d) = 0, from

    W x + S_:I nu = d,   S_I: x = 0

With the factor of S + e W for small e, whose rows all count, x is found by

    c = e (S + e W)^-1 (d - W x),   c <- c - y  with  S y = S (x + c),   x <- x + c

The first takes e / (l + e) of what d has along each eigenvalue l of S by W, which is all of a self-stress, but for
eps / e that rounding takes and the next pass finds. The second takes the rest, by conjugate gradients that the same
factor leads: a few steps. N is never formed. W couples rows of one joint.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .._tools._by_number import sum_few
from .._tools._lapack import in_order
from .._tools._value import AbstractModule
from ._cholesky import Fronts, factor, pivots, solution
from ._gram import Gram
from ._rows import Rows

_WEIGHT = 0.4  # power of the rounding: e
_STEPS = 60  # after which x is final where c is found, and twice as many at most
_ROUNDING = 10  # times eps: S x of a self-stress


class Compliance(AbstractModule):
    """A compliance W of scaled rows, with its size taken out, as entries of each row with its mates, shape (m, j)."""

    rows: Rows
    entries: Float[Array, "m j"]
    size: Float[Array, ""]

    def times(self, mu: Float[Array, "m c"]) -> Float[Array, "m c"]:
        """W mu / size."""
        padded = jnp.concatenate([mu, jnp.zeros((1, mu.shape[1]), mu.dtype)])
        return sum_few(self.entries[:, :, None] * padded[self.rows.symbolic.mates], axis=1)


def scaled_compliance(rows: Rows, entries: Float[Array, "m j"], row_scale: Float[Array, " m"]) -> Compliance:
    """D^-1 W D^-1."""
    padded = jnp.append(row_scale, 1.0)
    entries = entries / row_scale[:, None] / padded[rows.symbolic.mates]
    size = jax.lax.stop_gradient(jnp.max(jnp.abs(entries)))
    size = jnp.where(size > 0, size, 1.0)
    return Compliance(rows, entries / size, size)


class Picking(AbstractModule):
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
            right = jnp.concatenate([misfit, jnp.zeros_like(misfit)], axis=1)
            return jax.lax.custom_linear_solve(self._product, right, self._solved, symmetric=True)[:, :1]

        return jax.lax.cond(jnp.any(self.gram.kept == 0), found, lambda: jnp.zeros_like(misfit))

    def _product(self, unknowns: Float[Array, "m 2"]) -> Float[Array, "m 2"]:
        """W x + S_:I nu and S_I: x; nu itself in place of the latter on O."""
        kept, (x, nu) = self.gram.kept[:, None], jnp.split(unknowns, 2, axis=1)
        of_x, of_nu = jnp.split(self.gram.rows.gram(jnp.concatenate([x, kept * nu], axis=1)), 2, axis=1)
        return jnp.concatenate([self.compliance.times(x) + of_nu, kept * of_x + (1 - kept) * nu], axis=1)

    def _solved(self, _: object, right: Float[Array, "m 2"]) -> Float[Array, "m 2"]:
        misfit, uneven = jnp.split(right, 2, axis=1)
        even = jax.lax.cond(jnp.any(uneven != 0), lambda: self.gram.solution(uneven), lambda: jnp.zeros_like(uneven))
        x = even + self._picked(misfit - self.compliance.times(even))
        nu = self.gram.solution(misfit - self.compliance.times(x))
        return jnp.concatenate([x, nu + (1 - self.gram.kept)[:, None] * uneven], axis=1)

    def _picked(self, misfit: Float[Array, "m 1"]) -> Float[Array, "m 1"]:
        """x."""
        rows, weight = self.gram.rows, _weight(misfit)
        rounding = _ROUNDING * float(jnp.finfo(misfit.dtype).eps)

        def largest(x: Array) -> Array:
            return jnp.max(jnp.abs(x))

        size = largest(misfit)

        def step(now: _Pass) -> _Pass:
            x = now.x + jnp.where(now.ends, now.c, 0.0)
            right = jnp.where(now.ends, weight * (misfit - self.compliance.times(x)), now.left)
            ahead = solution(rows.symbolic, self.fronts, right)
            energy = jnp.sum(right * ahead)
            along = ahead + jnp.where(now.ends, 0.0, _ratio(energy, now.energy)) * now.along
            image = rows.gram(jnp.where(now.ends, x + ahead, along))
            length = _ratio(energy, jnp.sum(along * image))
            c = jnp.where(now.ends, ahead, now.c - length * along)
            left = jnp.where(now.ends, image, now.left - length * image)
            along = jnp.where(now.ends, 0.0, along)
            change = largest(c)
            scale = rounding * (size + largest(x) + change)
            ends = largest(left) <= scale
            last = jnp.where(now.ends, now.change, now.last)
            found = ends & ((change**2 <= scale * jnp.maximum(last, change)) | (now.steps >= _STEPS))
            return _Pass(x, c, left, along, energy, change, last, ends, found, now.steps + 1)

        none, true = jnp.zeros_like(misfit), jnp.asarray(True)
        zero, count = jnp.zeros((), misfit.dtype), jnp.zeros((), int)
        start = _Pass(none, none, none, none, zero, zero, zero, true, ~true, count)
        end = jax.lax.while_loop(lambda now: ~now.found & (now.steps < 2 * _STEPS), step, start)
        return jnp.where(end.ends, end.x + end.c, jnp.nan)


class _Pass(NamedTuple):
    """x, c, S (x + c), direction and energy of the last step, the size of c, that of the last c that was found, whether
    c is found, and x, and steps so far."""

    x: Float[Array, "m 1"]
    c: Float[Array, "m 1"]
    left: Float[Array, "m 1"]
    along: Float[Array, "m 1"]
    energy: Float[Array, ""]
    change: Float[Array, ""]
    last: Float[Array, ""]
    ends: Bool[Array, ""]
    found: Bool[Array, ""]
    steps: Int[Array, ""]


def _ratio(part: Array, whole: Array) -> Array:
    return jnp.where(whole > 0, part / jnp.where(whole > 0, whole, 1.0), 0.0)


def picking(gram: Gram, compliance: Compliance) -> tuple[Picking, Float[Array, ""]]:
    """G, and the least square of a pivot of S + e W of a row that does not count, over e."""
    rows, weight = gram.rows, _weight(compliance.entries)
    once = jnp.where(rows.symbolic.beside < rows.symbolic.size, weight * compliance.entries, 0.0)

    def whole() -> tuple[Fronts, ...]:
        return factor(rows.symbolic, in_order(rows.entries(jnp.ones_like(gram.kept), once), jnp.sum(gram.pivots)))

    fronts = jax.lax.cond(jnp.any(gram.kept == 0), whole, lambda: gram.fronts)
    fronts = jax.lax.stop_gradient(fronts)
    least = jnp.min(jnp.where(gram.kept > 0, 1.0, pivots(rows.symbolic, fronts) ** 2 / weight))
    return Picking(gram, compliance, fronts), least


def _weight(like: Array) -> float:
    return float(jnp.finfo(like.dtype).eps) ** _WEIGHT
