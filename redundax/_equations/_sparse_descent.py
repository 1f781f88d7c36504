"""Levenberg-Marquardt for the position of a large mechanism, from where its Newton steps finish.

    (K K^T + l I) mu = r,   d = -K^T mu,   q <- q [+] S d,   l = nu max|r|

that is (K^T K + l I) d = -K^T r with a sparse factor, which exists at any rank. nu follows from how
much of the predicted decrease of |r|^2 a step brings; convergence is quadratic also where constraints are redundant
(Fan, Yuan 2005, doi.org/10.1007/s00607-004-0083-1).
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .._sparse._cholesky import factor, solution
from .._sparse._gram import SHIFT
from ._pseudoinverse import SparseRows

_STEPS, _SETTLED = 500, 1e-8


class _Reached(NamedTuple):
    """A position, its residual, nu, the size of the last step, and steps so far."""

    q: Float[Array, "..."]
    residual: Float[Array, " m"]
    nu: Float[Array, ""]
    change: Float[Array, ""]
    steps: Int[Array, ""]


def sparse_descent(
    q: Float[Array, "..."],
    residual: Callable[[Array], Array],
    rows: Callable[[Array], SparseRows],
    moved: Callable[[Array, Array], Array],
) -> Float[Array, "..."]:
    """A position where the residual is least, from q; `rows` gives K at a position, and `moved` q [+] S d."""
    eps = float(jnp.finfo(q.dtype).eps)
    settled, least = max(_SETTLED, 10 * eps), eps**SHIFT

    def goes_on(now: _Reached) -> Array:
        return (now.steps < _STEPS) & (now.change > settled) & jnp.all(jnp.isfinite(now.residual))

    def step(now: _Reached) -> _Reached:
        at, r = rows(now.q), now.residual
        largest = jnp.max(jnp.abs(r))
        d = -_damped(at, r, jnp.maximum(now.nu * largest, least))
        q = moved(now.q, d)
        ahead = residual(q)
        before = jnp.sum(r**2)
        share = (before - jnp.sum(ahead**2)) / (before - jnp.sum((r + at.times(d)) ** 2))
        good = share > 1e-4  # nor where it is NaN
        nu = now.nu * jnp.where(share > 0.75, 0.25, jnp.where(share > 0.25, 1.0, 4.0))
        nu = jnp.maximum(nu, least / jnp.where(largest > 0, largest, 1.0))
        q, r = jnp.where(good, q, now.q), jnp.where(good, ahead, r)
        return _Reached(q, r, nu, jnp.max(jnp.abs(d)), now.steps + 1)

    one = jnp.ones((), q.dtype)
    return jax.lax.while_loop(goes_on, step, _Reached(q, residual(q), one, one, jnp.zeros((), int))).q


def _damped(rows: SparseRows, r: Float[Array, " m"], damping: Float[Array, ""]) -> Float[Array, " n"]:
    """(K^T K + l I)^-1 K^T r."""
    symbolic, count = rows.own.symbolic, rows.own.count
    entries = rows.own.entries(jnp.ones(count, r.dtype)).at[symbolic.beside[:, 0]].add(damping)
    fronts, across = factor(symbolic, entries), rows.of_given
    mu = solution(symbolic, fronts, r[:count, None])[:, 0]
    found = rows.transposed(mu[:, None])[:, 0]
    if not rows.given.size:
        return found
    turned = solution(symbolic, fronts, across)
    inner = rows.given @ rows.given.T + damping * jnp.eye(len(rows.given), dtype=r.dtype) - across.T @ turned
    given = jax.scipy.linalg.solve(inner, r[count:] - across.T @ mu, assume_a="pos")
    return found - rows.transposed((turned @ given)[:, None])[:, 0] + rows.given.T @ given
