"""A search for extremes of outputs over sets of cases, where friction depends on the case.

1. All solutions that a search finds at many cases (`sample`); the best are starts.
2. BFGS on theta = lower + (upper - lower) sin^2 u, whose derivative vanishes at the ends of the box, with tau(theta) by
   Newton's method from the tau of the start. Limits on multipliers enter by an augmented Lagrangian (Powell, Hestenes,
   Rockafellar), and what is left beyond them is taken back on the line to the start.
3. Friction laws have corners, such as |N_1| + |N_2| of a guide at N_1 = 0, and extremes lie there: random steps follow,
   of a size that grows with success and shrinks without.

Every value is attained by a solution within the limits, so that what is found lies inside the true band.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._solve._all_solutions import search
from .._solvers._solver import Newton, Root, closed_root
from .._tools._compilation import compiled
from ._cases import AbstractCases
from ._solution_set import SolutionSet

_MARGIN = 0.01  # of the box, by which starts are moved inside: at its ends sin^2 is stationary
_STEPS = 60  # of BFGS
_ROUNDS, _WEIGHT = 8, 100.0  # of the augmented Lagrangian
_BACK = 30  # halvings of the way back to the start
_TRIES, _TRIED = 60, 24  # rounds of random steps, and steps in each
_RADIUS, _GROWN, _SHRUNK = 0.02, 1.5, 0.6  # their first size, relative to the box, and how it changes
WITHIN = 1e-9  # excess over a limit, relative to its width, that is rounding


class Found(NamedTuple):
    """Solutions found at cases, on the device or as NumPy arrays.

    - `theta`: the case, shape (..., q).
    - `tau`: friction, shape (..., p).
    - `values`: [qdd; lam; tau], shape (..., n + m + p).
    - `excess`: largest excess over the limits.
    - `good`: whether it is a solution.
    """

    theta: Array | np.ndarray
    tau: Array | np.ndarray
    values: Array | np.ndarray
    excess: Array | np.ndarray
    good: Array | np.ndarray

    def within(self) -> np.ndarray:
        """Which are solutions within the limits."""
        return within(self.good, self.excess)


def within(good: Array | np.ndarray, excess: Array | np.ndarray) -> np.ndarray:
    """Which good ones exceed no limit."""
    return np.asarray(good) & (np.asarray(excess) <= WITHIN)


@compiled
def sample(
    solutions: SolutionSet, cases: AbstractCases, theta: Float[Array, "s q"], factors: Float[Array, "starts l"]
) -> Found:
    """Solutions found at many cases; arrays (s, starts + 1, ...)."""

    def one(theta: Array) -> Found:
        base, unit = cases.chosen(theta)
        if solutions.law is None:
            tau, good = jnp.zeros((1, 0), base.dtype), jnp.ones(1, bool)
        else:
            tau, good = search(solutions.problem(base, unit), factors)
        return jax.vmap(lambda tau, good: _found(solutions, cases, theta, tau, good))(tau, good)

    return jax.vmap(one)(theta)


def _found(solutions: SolutionSet, cases: AbstractCases, theta: Array, tau: Array, good: Array) -> Found:
    base, unit = cases.chosen(theta)
    values = solutions.outputs(base, unit, tau)
    excess = jnp.max(cases.excess(base + unit @ tau), initial=-jnp.inf)
    return Found(theta, tau, values, excess, good & jnp.all(jnp.isfinite(values)))


@compiled
def improve(
    solutions: SolutionSet,
    cases: AbstractCases,
    costs: Float[Array, "b x"],
    theta: Float[Array, "b q"],
    tau: Float[Array, "b p"],
) -> Found:
    """From each start (theta, tau) a case with less costs^T [qdd; lam; tau], costs of size 1 over the box."""
    return jax.vmap(lambda *start: _improve(solutions, cases, *start))(costs, theta, tau)


def _improve(solutions: SolutionSet, cases: AbstractCases, cost: Array, theta: Array, tau: Array) -> Found:
    @jax.jit  # traced once
    def at(theta: Array, tau: Array) -> Found:
        root = _root(solutions, cases, theta, tau)
        good = jnp.array(True) if root is None else root.progress.converged(Newton().tolerance(tau.dtype))
        return _found(solutions, cases, theta, tau if root is None else jnp.where(good, root.tau, tau), good)

    def merit(found: Found) -> Array:
        inside = jnp.where(found.excess <= WITHIN, cost @ found.values, 1e3 * (1 + found.excess))
        return jnp.where(found.good, inside, jnp.inf)

    def best(found: Found) -> Found:
        return jax.tree.map(lambda x: x[jnp.argmin(jax.vmap(merit)(found))], found)

    end = _descend(solutions, cases, at, cost, theta, tau)
    way = jnp.append(1 - 0.5 ** jnp.arange(_BACK, dtype=theta.dtype), 1.0)  # from the start to the end
    found = best(jax.vmap(lambda share: at(theta + share * (end - theta), tau))(way))

    def round_(carry: tuple[Found, Array], key: Array) -> tuple[tuple[Found, Array], None]:
        found, radius = carry
        step = radius * (cases.upper - cases.lower) * jax.random.normal(key, (_TRIED, theta.size), theta.dtype)
        place, tau = jnp.clip(found.theta + step, cases.lower, cases.upper), jnp.asarray(found.tau)
        tried = best(jax.vmap(lambda theta: at(theta, tau))(place))
        better = merit(tried) < merit(found)
        found = jax.tree.map(lambda new, old: jnp.where(better, new, old), tried, found)
        return (found, radius * jnp.where(better, _GROWN, _SHRUNK)), None

    radius = jnp.full((), _RADIUS, theta.dtype)
    return jax.lax.scan(round_, (found, radius), jax.random.split(jax.random.key(0), _TRIES))[0][0]


def _root(solutions: SolutionSet, cases: AbstractCases, theta: Array, tau: Array) -> Root | None:
    """Friction of a case, by Newton's method from tau; None without friction."""
    if solutions.law is None:
        return None
    problem = solutions.problem(*cases.chosen(theta)).sized_at(tau)
    return closed_root(problem, tau, Newton())


def _descend(
    solutions: SolutionSet,
    cases: AbstractCases,
    at: Callable[[Array, Array], Found],
    cost: Array,
    theta: Array,
    tau: Array,
) -> Array:
    """theta by BFGS and the augmented Lagrangian."""
    import optimistix as optx  # here, as its import takes time that few need

    n, m = solutions.response.free.acceleration.size, solutions.stress.shape[0]
    span = cases.upper - cases.lower
    share = jnp.where(span > 0, (theta - cases.lower) / jnp.where(span > 0, span, 1.0), 0.5)
    start = jnp.arcsin(jnp.sqrt(jnp.clip(share, _MARGIN, 1 - _MARGIN)))

    def case(u: Array) -> Array:
        return cases.lower + span * jnp.sin(u) ** 2

    def over(found: Found) -> Array:
        return cases.excess(jnp.asarray(found.values)[n : n + m])

    def lagrangian(u: Array, multipliers: Array) -> Array:
        found = at(case(u), tau)
        push = jnp.sum(jnp.maximum(0.0, multipliers + _WEIGHT * over(found)) ** 2 - multipliers**2) / (2 * _WEIGHT)
        return jnp.where(found.good, cost @ found.values + push, 1e6)

    def round_(carry: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], None]:
        u, multipliers = carry
        u = optx.minimise(lagrangian, optx.BFGS(1e-12, 1e-12), u, multipliers, max_steps=_STEPS, throw=False).value
        return (u, jnp.maximum(0.0, multipliers + _WEIGHT * over(at(case(u), tau)))), None

    none = jnp.zeros_like(cases.excess(solutions.response.free.multipliers))
    return case(jax.lax.scan(round_, (start, none), None, length=_ROUNDS if none.size else 1)[0][0])
