"""Projected Gauss-Seidel sweeps for friction at joints that stick or start to slip.

    alpha = alpha_0 + A tau,   lo(tau) <= tau <= hi(tau),   alpha_j > 0 only at tau_j = lo_j,   alpha_j < 0 only at hi_j

with A symmetric positive semidefinite, joint after joint

    tau_j <- clip(tau_j - alpha_j / A_jj, lo_j, hi_j),

the limits being those of the loads at the start of a sweep. Friction along a direction has a ball for an interval
(`_balls`): that of norm |hi|, where lo = -hi. Of several sweeps stand in only where `_interior` finds none.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._system._directions import Directions
from ._balls import Balls
from ._interior import interior

_SWEEPS = 2000
# Sweeps after which one goes farther.
_EVERY = 10
# Part of accelerations that count as none by which friction may still change them after all sweeps.
_NONE = 0.1


class Swept(NamedTuple):
    """Friction, and whether sweeps settled it."""

    tau: Float[Array, " p"]
    settled: Bool[Array, ""]


def gauss_seidel(
    limits: Callable[[Float[Array, " p"]], tuple[Float[Array, " p"], Float[Array, " p"]]],
    free: Float[Array, " p"],
    matrix: Float[Array, "p p"],
    own: Float[Array, " p"],
    weight: Float[Array, " p"],
    tolerance: tuple[float, float],
    wanted: Bool[Array, ""] | bool = True,
    directions: Directions | None = None,
) -> Swept:
    """Friction of the conditions above; none where it is not wanted.

    **Arguments:**

    - `limits`: lo and hi at a friction.
    - `free`, `matrix`, `own`: alpha_0, A and its diagonal, infinite where a joint cannot slip.
    - `weight`: what makes frictions comparable.
    - `tolerance`: accelerations that are none, relative to the sum of their parts; and the change of friction, relative
      to the largest limit, that ends it. Where frictions do all but the same, sweeps go on long after accelerations
      are none: that is enough, too.
    - `directions`: joints whose slips share one friction.
    """
    (zero, enough), balls, within = tolerance, None, None
    if directions is not None:
        balls = Balls.of(directions, jnp.where(jnp.isinf(own)[:, None], 0.0, matrix))
        if len(directions.joints) > 1:
            within = interior(limits, free, matrix, jnp.isinf(own), weight, directions, wanted)
            wanted = wanted & ~within.found

    def sweep(carry: tuple) -> tuple:
        tau, _, _, count = carry
        low, high = limits(tau)

        def joint(j: Array, new: Array) -> Array:
            return new.at[j].set(jnp.clip(new[j] - (free[j] + matrix[j] @ new) / own[j], low[j], high[j]))

        if balls is None:
            new = jax.lax.fori_loop(0, tau.size, joint, tau)
            new = jnp.where(count % _EVERY == _EVERY - 1, _farther(tau, new, free, matrix, (low, high)), new)
        else:
            new = balls.swept(tau, joint, free, low, high)
        size = jnp.max(weight * jnp.maximum(jnp.abs(low), jnp.abs(high)), initial=0.0)
        return new, jnp.max(weight * jnp.abs(new - tau), initial=0.0), size, count + 1

    def going(carry: tuple) -> Array:
        _, change, size, count = carry
        return wanted & (change > enough * size) & (count < _SWEEPS)

    none = jnp.zeros((), free.dtype)
    first = (jnp.zeros_like(free), none + jnp.inf, none, jnp.zeros((), int))
    tau, change, size, _ = jax.lax.while_loop(going, sweep, first)
    parts = jnp.max((jnp.abs(free) + jnp.abs(matrix) @ jnp.abs(tau)) / weight, initial=0.0)
    slow = change * jnp.max(jnp.where(jnp.isinf(own), 0.0, own) / weight**2, initial=0.0) <= _NONE * zero * parts
    settled = (change <= enough * size) | slow
    if within is None:
        return Swept(tau, settled)
    return Swept(jnp.where(within.found, within.tau, tau), within.found | settled)


def _farther(
    tau: Float[Array, " p"],
    new: Float[Array, " p"],
    free: Float[Array, " p"],
    matrix: Float[Array, "p p"],
    limits: tuple[Float[Array, " p"], Float[Array, " p"]],
) -> Float[Array, " p"]:
    """As far as a sweep leads to less of tau^T A tau / 2 + alpha_0^T tau within limits: frictions that do all but the
    same creep, by as little as they differ."""
    low, high = limits
    way = jnp.where((new > low) & (new < high), new - tau, 0.0)
    room = jnp.where(way > 0, high - new, jnp.where(way < 0, low - new, jnp.inf)) / jnp.where(way != 0, way, 1.0)
    bent, falls = way @ matrix @ way, -(way @ (free + matrix @ new))
    least = jnp.where(bent > 0, falls / jnp.where(bent > 0, bent, 1.0), 0.0)
    return new + jnp.clip(least, 0.0, jnp.min(room)) * way
