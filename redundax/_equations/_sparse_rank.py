"""Rank of a large mechanism: by the pivots of B M^-1 B^T, squares of the sines between a row and those before it.

What rounding makes of them grows with |x|^2, as where masses are of very different size; a pivot that is neither
rounding nor clearly more leaves the rank undecided.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._sparse._gram import Gram, rank_pivots
from .._sparse._rows import Rows
from .._system._decision import CLEAR, Decision
from ._rank import Spectrum

LEAST = 0.575  # power of the rounding: squares of pivots, 1e-9 in float64, from which rows count
_POWER = 8  # steps of inverse iteration for the least singular value


def decided(
    rows: Rows, violation: Array, rank: Array | None
) -> tuple[Float[Array, " m"], Spectrum, Float[Array, " m"]]:
    """Which rows count, the evidence, and the length of the self-stress that each other row makes, squared."""
    squares, growth, shift = rank_pivots(rows)
    eps, off = float(jnp.finfo(squares.dtype).eps), (30 * violation) ** 2
    tolerance, noise = eps**LEAST + off, growth * (10 * eps + off)
    ordered = jnp.sort(squares)[::-1]
    if rank is None:
        counts = squares > jnp.maximum(tolerance, noise)
    else:
        least = jnp.append(ordered, 0.0)[jnp.clip(rank - 1, 0, squares.size)]
        counts = (squares >= least) & (rank > 0)
    kept = jnp.min(jnp.where(counts, squares, jnp.inf))
    dropped = jnp.max(jnp.where(counts, 0.0, jnp.abs(squares)))
    gap = jnp.where(dropped > 0, jnp.sqrt(kept / jnp.where(dropped > 0, dropped, 1.0)), jnp.inf)
    if rank is None:
        clear = jnp.where(counts, squares / jnp.maximum(tolerance, growth * (shift + off)), jnp.inf)
        unexplained = jnp.where(counts, 0.0, jnp.abs(squares) / noise)
        margin = jnp.minimum(jnp.min(clear), CLEAR / jnp.max(unexplained, initial=eps))
    else:
        clear = jnp.where(counts, squares / noise, jnp.inf)
        margin = jnp.where(jnp.sum(counts) == rank, CLEAR * jnp.min(clear), 0.0)
    values = jnp.sqrt(jnp.maximum(ordered, 0.0) / jnp.maximum(ordered[0], jnp.finfo(ordered.dtype).tiny))
    return (
        counts.astype(squares.dtype),
        Spectrum(values, jnp.sum(counts), jnp.sqrt(tolerance), gap, Decision(margin), jnp.sqrt(kept)),
        growth,
    )


def with_least(spectrum: Spectrum, stress: Gram) -> Spectrum:
    """The same with `kept` the least singular value of the rows that count, by inverse iteration."""
    stress = jax.lax.stop_gradient(stress)
    start = stress.kept * jnp.asarray(np.cos(np.arange(stress.kept.size) ** 2), stress.kept.dtype)

    def step(_: Array, carry: tuple[Array, Array]) -> tuple[Array, Array]:
        found = stress.near(carry[0][:, None])[:, 0]
        size = jnp.linalg.norm(found)
        size = jnp.where(size > 0, size, 1.0)
        return found / size, size

    _, size = jax.lax.fori_loop(0, _POWER, step, (start / jnp.linalg.norm(start), jnp.ones((), start.dtype)))
    return eqx.tree_at(lambda found: found.kept, spectrum, jnp.minimum(spectrum.kept, 1 / jnp.sqrt(size)))
