"""K^+ of the rows that an assembly must meet, those of constraints and of values that are given.

    K = D^-1 [ Phi_q ; H ] S  with the scales of `_scaling`, at the decided rank

Of a large mechanism the constraints' part K_c has a factor of K_c K_c^T on the rows I that count, N spans its
self-stress (`_gram`), and Z = I - K_c^+ K_c:

    K_c^+ r = K_I^T (K_I K_I^T)^-1 (r - N z)_I,   N^T N z = N^T r,
    K^+ [ r ; s ] = d + Z H^T (H Z H^T)^+ (s - H d),   d = K_c^+ r,

where H are few rows. Where given values contradict constraints, these are met and those missed. Where points of few
digits leave what the rank drops, as K_c Z, a second step with what the first leaves takes it out.
"""

from typing import cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._sparse._gram import Gram, gram
from .._sparse._rows import Rows
from .._sparse._symbolic import Symbolic
from .._system._system import AbstractSystem
from .._tools._krylov import least_misfit
from .._tools._value import AbstractModule
from ._rank import split
from ._scaling import Scaling
from ._sparse_rank import LEAST, decided, with_least

_ROUNDING = 1e3  # of N^T r


class DensePseudoinverse(AbstractModule):
    """K and K^+; `kept` is the least singular value that it inverts, relative to the largest."""

    rows: Float[Array, "m n"]
    inverse: Float[Array, "n m"]
    kept: Float[Array, ""]

    def __call__(self, r: Float[Array, " m"]) -> Float[Array, " n"]:
        return self.inverse @ r

    def times(self, d: Float[Array, " n"]) -> Float[Array, " m"]:
        """K d."""
        return self.rows @ d


def dense_pseudoinverse(rows: Float[Array, "m n"], violation: Float[Array, ""]) -> DensePseudoinverse:
    """That of the rows at a relative violation."""
    parts, spectrum = split(rows, violation, None)
    return DensePseudoinverse(rows, parts.inverse, spectrum.kept)


class SparseRows(AbstractModule):
    """K of a large mechanism.

    - `own`: D^-1 Phi_q, with S^2 for its inverse mass.
    - `given`: rows H, scaled, shape (h, n).
    - `columns`: S, shape (n,).
    """

    own: Rows
    given: Float[Array, "h n"]
    columns: Float[Array, " n"]

    def times(self, d: Float[Array, " n"]) -> Float[Array, " m"]:
        """K d."""
        return jnp.concatenate([self.own.times((self.columns * d)[:, None])[:, 0], self.given @ d])

    @property
    def of_given(self) -> Float[Array, "m h"]:
        """K_c H^T."""
        return self.own.times(self.columns[:, None] * self.given.T)

    def transposed(self, mu: Float[Array, "m c"]) -> Float[Array, "n c"]:
        """K_c^T mu."""
        return self.columns[:, None] * self.own.transposed(mu)


def sparse_rows(system: AbstractSystem, q: Array, t: Array, scale: Scaling, given: Float[Array, "h n"]) -> SparseRows:
    """Those at a position, and given ones, scaled."""
    symbolic = cast(Symbolic, system.symbolic)
    squares = scale.coordinates[symbolic.columns] ** 2
    slopes, _ = system.by_bodies(q, t)
    own = Rows(symbolic, slopes, squares[:, :, None] * jnp.eye(squares.shape[1], dtype=squares.dtype))
    return SparseRows(own.scaled(scale.rows), given, scale.coordinates)


class SparsePseudoinverse(AbstractModule):
    """K^+ of a large mechanism.

    - `stress`: the factor of K_I K_I^T, and N.
    - `free`: Z H^T, shape (n, h).
    - `inner`: (H Z H^T)^+, shape (h, h).
    - `kept`: as of dense rows, of the constraints alone.
    """

    rows: SparseRows
    stress: Gram
    free: Float[Array, "n h"]
    inner: Float[Array, "h h"]
    kept: Float[Array, ""]

    def __call__(self, r: Float[Array, " m"]) -> Float[Array, " n"]:
        def step(_: Array, d: Array) -> Array:
            return d + self._nearly(r - self.times(d))

        return jax.lax.fori_loop(0, 2, step, jnp.zeros_like(self.rows.columns))

    def _nearly(self, r: Float[Array, " m"]) -> Float[Array, " n"]:
        own, given = r[: self.rows.own.count], r[self.rows.own.count :]
        d = _nearest(self.rows, self.stress, self._met(own)[:, None])[:, 0]
        return d + self.free @ (self.inner @ (given - self.rows.given @ d))

    def times(self, d: Float[Array, " n"]) -> Float[Array, " m"]:
        """K d."""
        return self.rows.times(d)

    def _met(self, r: Float[Array, " m"]) -> Float[Array, " m"]:
        """x = r - N z, the part of r that some d meets:  x + N z = r,  N^T x = 0."""
        stress, kept = self.stress, self.stress.kept

        def spread(z: Array) -> Array:
            return stress.stress(z[:, None])[:, 0]

        def across(y: Array) -> Array:
            return stress.across(y[:, None])[:, 0]

        def product(unknowns: Array) -> Array:
            x, z = unknowns
            return jnp.stack([x + spread(z), across(x) + kept * z])

        def solved(_: object, right: Array) -> Array:
            r, s = right
            rounding = _ROUNDING * float(jnp.finfo(r.dtype).eps) * jnp.linalg.norm(r)
            z = least_misfit(lambda z: across(spread(z)) + kept * z, across(r) - (1 - kept) * s, rounding=rounding)
            return jnp.stack([r - spread(z), z + kept * s])

        right = jnp.stack([r, jnp.zeros_like(r)])
        return jax.lax.custom_linear_solve(product, right, solved, symmetric=True)[0]


def sparse_pseudoinverse(rows: SparseRows, violation: Float[Array, ""]) -> SparsePseudoinverse:
    """That of the rows at a relative violation."""
    kept, spectrum, _ = decided(rows.own, jax.lax.stop_gradient(violation), None)
    stress = gram(rows.own, kept)
    free, inner = rows.given.T, jnp.zeros((0, 0), kept.dtype)
    if rows.given.size:
        free = free - _nearest(rows, stress, rows.of_given)
        inner = _inner(rows.given, free, violation)
    return SparsePseudoinverse(rows, stress, free, inner, with_least(spectrum, stress).kept)


def _inner(given: Float[Array, "h n"], free: Float[Array, "n h"], violation: Array) -> Float[Array, "h h"]:
    """(H Z H^T)^+: of values that constraints determine, rounding beside H H^T, zero."""
    length = jnp.linalg.norm(given, axis=1)
    length = jax.lax.stop_gradient(jnp.where(length > 0, length, 1.0))
    square = given @ free / length[:, None] / length
    least = float(jnp.finfo(square.dtype).eps) ** LEAST + (30 * violation) ** 2
    beside_one = jax.scipy.linalg.block_diag(square, jnp.ones((1, 1), square.dtype))
    parts, _ = split(beside_one, least / 30, None)  # which takes 30 times a violation for none
    return parts.inverse[:-1, :-1] / length[:, None] / length


def _nearest(rows: SparseRows, stress: Gram, r: Float[Array, "m c"]) -> Float[Array, "n c"]:
    """K_I^T (K_I K_I^T)^-1 r_I."""
    return rows.transposed(stress.solution(r))
