"""Friction that holds a mechanism with one degree of freedom, case by case.

Held at rest, with s the sense in which it would start without friction, e^T tau the acceleration that friction causes
along the freedom, relative to the one without friction, and the share t of its limit that every joint needs,

    tau = t law(rho0 + K tau, s),   1 + e^T tau = 0,   0 <= t <= 1.

Newton's method on (tau, t); what it ends with is checked, so that a state called held is one.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._tools._compilation import compiled
from .._cases import AbstractCases
from .._descent import within
from .._solution_set import SolutionSet

_STEPS = 40  # of Newton's method
_ROUNDING = 1e-9  # of the share and of the equations


class Held(NamedTuple):
    """States that friction holds, on the device or as NumPy arrays.

    - `theta`, `tau`, `multipliers`: the case, shape (..., q), friction, shape (..., p), and lam, shape (..., m).
    - `share`: t.
    - `excess`: largest excess over the limits.
    - `good`: whether it is such a state.
    """

    theta: Array | np.ndarray
    tau: Array | np.ndarray
    multipliers: Array | np.ndarray
    share: Array | np.ndarray
    excess: Array | np.ndarray
    good: Array | np.ndarray

    def within(self) -> np.ndarray:
        """Which are held within the limits."""
        return within(self.good, self.excess)


@compiled
def held(
    solutions: SolutionSet,
    cases: AbstractCases,
    effect: Float[Array, " p"],
    theta: Float[Array, "s q"],
    start: Float[Array, "s p"],
) -> Held:
    """The held states of cases, by Newton's method from friction in proportion to a start, NaN for the first sweep."""
    return jax.vmap(lambda theta, start: _held(solutions, cases, effect, theta, start))(theta, start)


def _held(solutions: SolutionSet, cases: AbstractCases, effect: Array, theta: Array, start: Array) -> Held:
    base, unit = cases.chosen(theta)
    if solutions.law is None:
        return _state(cases, theta, base, start, jnp.full((), jnp.inf, base.dtype), jnp.zeros((), bool))
    problem = solutions.problem(base, unit)
    first = problem.law(problem.rho0)
    start = jnp.where(jnp.all(jnp.isfinite(start)), start, first)
    size = problem.sized_at(start).friction_size

    def residual(x: Array) -> Array:
        tau = size * x[:-1]
        return jnp.append(x[:-1] - x[-1] * problem.law(problem.loads(tau)) / size, 1 + effect @ tau)

    def newton(_: Array, x: Array) -> Array:
        return x - jnp.linalg.solve(jax.jacfwd(residual)(x), residual(x))

    share = -1 / (effect @ start)
    x = jax.lax.fori_loop(0, _STEPS, newton, share * jnp.append(start / size, 1.0))
    small = _ROUNDING * jnp.append(jnp.max(jnp.abs(x[:-1])) * jnp.ones_like(size), 1.0)
    good = jnp.all(jnp.abs(residual(x)) <= small) & (x[-1] >= 0) & (x[-1] <= 1 + _ROUNDING)
    return _state(cases, theta, base + unit @ (size * x[:-1]), size * x[:-1], x[-1], good)


def _state(cases: AbstractCases, theta: Array, multipliers: Array, tau: Array, share: Array, good: Array) -> Held:
    return Held(theta, tau, multipliers, share, jnp.max(cases.excess(multipliers), initial=-jnp.inf), good)
