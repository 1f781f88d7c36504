"""Sweeps tau <- law(rho0 + K tau) where friction is proved to contract strongly, whatever the loads.

The bound c of `contraction_anywhere` asks for no sample: there is one solution, and log(rtol) / log(c) sweeps reach it.
Most samples contract faster, so that half of these go untested, two at a time, which spares a copy of each; and the
others until a test ends them, but where a kind of friction that is zero at the first sweep leaves it no size to compare
with. Few unknowns go through the loop as numbers, not as vectors: a fused loop, with no product of small matrices in
it. Of many the loads of a batch are one product of large matrices.
"""

from collections.abc import Callable
from functools import reduce

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._tools._by_number import FEW, dot, rows
from ._friction_problem import FrictionProblem
from ._iterate import Progress
from ._solver import Root

STRONG = 0.5  # largest bound of the contraction
_SWEEPS, _TOGETHER = 60, 3  # 0.5^60 is below the rounding of float64; a test of convergence costs about a sweep
_LOADS = 12  # as numbers, at most


def quick_sweeps(
    problem: FrictionProblem, start: Float[Array, " p"], rtol: Float[Array, ""], *, in_batch: bool
) -> Root:
    """The solution, or progress that has not converged where friction does not contract strongly.

    Written out number by number for a batch alone, as that takes long to compile. A change of friction bounds that of
    the loads, by their sizes: it stands for the step too.
    """
    infinite, none = jnp.full((), jnp.inf, start.dtype), jnp.zeros((), int)
    bound = problem.contraction_anywhere()
    strong = bound <= STRONG
    enough = jnp.log(rtol) / jnp.log(bound)
    untested = jnp.where(strong, enough / 2 - _TOGETHER, 0.0)
    begin, per_size, swept = _numbers(problem, start) if in_batch and few(problem) else _vectors(problem, start)

    def tested(carry: tuple) -> tuple:
        steps, tau, _ = carry
        for _ in range(_TOGETHER - 1):
            tau = swept(tau)
        last, tau = tau, swept(tau)
        change = [new - old for new, old in zip(tau, last, strict=True)]
        return steps + _TOGETHER, tau, largest(change, per_size)

    def going(carry: tuple) -> Array:
        steps, _, residual = carry
        short = (residual > rtol) | (problem.unsized & (steps < enough))
        return strong & (steps < _SWEEPS) & short

    steps, tau = jax.lax.while_loop(lambda c: c[0] < untested, lambda c: (c[0] + 2, swept(swept(c[1]))), (none, begin))
    steps, tau, residual = jax.lax.while_loop(going, tested, (steps, tau, infinite))
    return Root(jnp.stack(tau).reshape(start.shape), Progress(steps, residual, residual, residual, none), infinite)


def _numbers(problem: FrictionProblem, start: Array) -> tuple[list[Array], list[Array], Callable[[list], list]]:
    """Friction, 1 / its size and a sweep, number by number."""
    law, rho0, gain = problem.law.apart(), list(problem.rho0), rows(problem.gain)

    @jax.jit  # traced once
    def swept(tau: list) -> list:
        return list(law(jnp.stack([free + dot(row, tau) for free, row in zip(rho0, gain, strict=True)])))

    return list(start), list(1 / problem.friction_size), swept


def _vectors(problem: FrictionProblem, start: Array) -> tuple[list[Array], list[Array], Callable[[list], list]]:
    """The same in one vector."""

    @jax.jit
    def swept(tau: list) -> list:
        return [problem.law(problem.loads(*tau))]

    return [start], [1 / problem.friction_size], swept


def few(problem: FrictionProblem) -> bool:
    """Whether unknowns and loads are few enough to be numbers."""
    loads, unknowns = problem.gain.shape
    return unknowns <= FEW and loads <= _LOADS


def largest(change: list, per_size: list) -> Array:
    """Largest change relative to its size."""
    return reduce(jnp.maximum, [jnp.max(jnp.abs(x) * per) for x, per in zip(change, per_size, strict=True)])
