"""Projected Gauss-Seidel sweeps for friction at joints that stick or start to slip.

    alpha = alpha_0 + A tau,   lo(tau) <= tau <= hi(tau),   alpha_j > 0 only at tau_j = lo_j,   alpha_j < 0 only at hi_j

with A symmetric positive semidefinite, joint after joint

    tau_j <- clip(tau_j - alpha_j / A_jj, lo_j, hi_j),

the limits being those of the loads at the start of a sweep. Friction along a direction has a ball for an interval
(`_balls`): that of norm |hi|, where lo = -hi.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._system._directions import Directions
from ._balls import Balls

_SWEEPS = 2000


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
    enough: float,
    wanted: Bool[Array, ""] | bool = True,
    directions: Directions | None = None,
) -> Swept:
    """Friction of the conditions above; none where it is not wanted.

    **Arguments:**

    - `limits`: lo and hi at a friction.
    - `free`, `matrix`, `own`: alpha_0, A and its diagonal, infinite where a joint cannot slip.
    - `weight`: what makes frictions comparable.
    - `enough`: change of friction, relative to the largest limit, that ends it.
    - `directions`: joints whose slips share one friction.
    """
    balls = None if directions is None else Balls.of(directions, jnp.where(jnp.isinf(own)[:, None], 0.0, matrix))

    def sweep(carry: tuple) -> tuple:
        tau, _, _, count = carry
        low, high = limits(tau)

        def joint(j: Array, new: Array) -> Array:
            return new.at[j].set(jnp.clip(new[j] - (free[j] + matrix[j] @ new) / own[j], low[j], high[j]))

        new = jax.lax.fori_loop(0, tau.size, joint, tau) if balls is None else balls.swept(tau, joint, free, low, high)
        size = jnp.max(weight * jnp.maximum(jnp.abs(low), jnp.abs(high)), initial=0.0)
        return new, jnp.max(weight * jnp.abs(new - tau), initial=0.0), size, count + 1

    def going(carry: tuple) -> Array:
        _, change, size, count = carry
        return wanted & (change > enough * size) & (count < _SWEEPS)

    zero = jnp.zeros((), free.dtype)
    first = (jnp.zeros_like(free), zero + jnp.inf, zero, jnp.zeros((), int))
    tau, change, size, _ = jax.lax.while_loop(going, sweep, first)
    return Swept(tau, change <= enough * size)
