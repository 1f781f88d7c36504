"""Sweeps tau <- law(rho0 + K tau) where friction is proved to contract strongly, whatever the loads.

The bound of `contraction_anywhere` asks for no sample: there is one solution, and sweeps reach it to rounding in less
than `_SWEEPS`. Few unknowns go through the loop as numbers, not as vectors, so that a batch lays each of them out in
one piece: a fused loop over the batch, with no product of small matrices in it.
"""

from functools import reduce

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._friction_problem import FrictionProblem
from ._iterate import Progress
from ._solver import Root

_STRONG = 0.5  # largest bound of the contraction
_SWEEPS, _TOGETHER = 60, 3  # 0.5^60 is below the rounding of float64; a test of convergence costs about a sweep
_FEW = 6  # unknowns as numbers, at most


def quick_sweeps(problem: FrictionProblem, start: Float[Array, " p"], rtol: Float[Array, ""]) -> Root:
    """The solution, or progress that has not converged where friction does not contract strongly."""
    strong = problem.contraction_anywhere() <= _STRONG
    if start.size > _FEW:
        return Root(start, Progress.begin(start.dtype), jnp.full((), jnp.inf, start.dtype))
    rho0, gain, load_size, size = (
        list(x) for x in (problem.rho0, problem.gain, problem.load_size, problem.friction_size)
    )

    def caused(tau: list) -> list:
        return [sum(k * t for k, t in zip(row, tau, strict=True)) for row in gain]

    def swept(tau: list) -> list:
        return list(problem.law(jnp.stack([free + more for free, more in zip(rho0, caused(tau), strict=True)])))

    def body(carry: tuple) -> tuple:
        steps, tau, _, _ = carry
        for _ in range(_TOGETHER - 1):
            tau = swept(tau)
        last, tau = tau, swept(tau)
        change = [new - old for new, old in zip(tau, last, strict=True)]
        return steps + _TOGETHER, tau, _largest(change, size), _largest(caused(change), load_size)

    def going(carry: tuple) -> Array:
        steps, _, residual, step = carry
        return strong & (steps < _SWEEPS) & ((residual > rtol) | (step > rtol))

    infinite = jnp.full((), jnp.inf, start.dtype)
    steps, tau, residual, step = jax.lax.while_loop(going, body, (jnp.zeros((), int), list(start), infinite, infinite))
    return Root(jnp.stack(tau), Progress(steps, residual, step, residual, jnp.zeros((), int)), infinite)


def _largest(change: list, size: list) -> Array:
    return reduce(jnp.maximum, [jnp.abs(x) / of for x, of in zip(change, size, strict=True)])
