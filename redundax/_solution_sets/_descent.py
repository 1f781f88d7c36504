"""A search for extremes of outputs over sets of cases, where friction depends on the case.

1. All solutions that a search finds at many cases (`sample`); the best are starts.
2. Sequential quadratic programming (SciPy's SLSQP) within the box and the limits on multipliers, with tau(theta) by
   Newton's method from the tau of the start; what is left beyond the limits is taken back on the line to the start.
3. Friction laws have corners, such as |N_1| + |N_2| of a guide at N_1 = 0, and extremes lie there: random steps follow,
   of a size that grows with success and shrinks without.

Every value is attained by a solution within the limits, so that what is found lies inside the true band.
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._solve._all_solutions import search
from .._solvers._continuation import Continuation
from .._solvers._solver import AbstractSolver, Newton, closed_root
from .._tools._compilation import compiled
from ._at_rest import in_batches
from ._cases import AbstractCases
from ._solution_set import SolutionSet

_STEPS = 25  # of sequential quadratic programming
_NOWHERE = 1e6  # cost of a case without a solution; others are of size 1
_BATCH = 256  # cases of one call of a program
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


def sample(
    solutions: SolutionSet, cases: AbstractCases, theta: Float[Array, "s q"], factors: Float[Array, "starts l"]
) -> Found:
    """Solutions found at many cases; arrays (s, starts + 1, ...).

    Where Newton's method settles all of them, no program is compiled that follows the branch from zero friction.
    """
    found = _sample(solutions, cases, theta, factors, Continuation().first)
    if np.all(np.asarray(found.good)[:, 0]):
        return found
    return _sample(solutions, cases, theta, factors, Continuation())


@compiled
def _sample(
    solutions: SolutionSet, cases: AbstractCases, theta: Array, factors: Array, default: AbstractSolver
) -> Found:
    def one(theta: Array) -> Found:
        base, unit = cases.chosen(theta)
        if solutions.law is None:
            tau, good = jnp.zeros((1, 0), base.dtype), jnp.ones(1, bool)
        else:
            tau, good = search(solutions.problem(base, unit), factors, default)
        return jax.vmap(lambda tau, good: _found(solutions, cases, theta, tau, good))(tau, good)

    return jax.vmap(one)(theta)


def _found(solutions: SolutionSet, cases: AbstractCases, theta: Array, tau: Array, good: Array) -> Found:
    base, unit = cases.chosen(theta)
    values = solutions.outputs(base, unit, tau)
    excess = jnp.max(cases.excess(base + unit @ tau), initial=-jnp.inf)
    return Found(theta, tau, values, excess, good & jnp.all(jnp.isfinite(values)))


def improve(solutions: SolutionSet, cases: AbstractCases, costs: np.ndarray, found: Found) -> Found:
    """From each solution found a case with less cost^T [qdd; lam; tau]; costs (b, x) of size 1 over the box.

    All starts go on together on NumPy's arrays; one program answers for cases by the batch, another for slopes.
    """
    lower, upper = np.asarray(cases.lower), np.asarray(cases.upper)
    tau, random = np.asarray(found.tau), np.random.default_rng(0)

    def least(theta: np.ndarray) -> tuple[Found, np.ndarray]:
        """Of cases (b, tries, q) the best for each start, and its merit."""
        b, tries, q = theta.shape
        begin = np.repeat(tau, tries, axis=0)
        tried = in_batches(lambda *own: _solved(solutions, cases, *own), _BATCH, theta.reshape(b * tries, q), begin)
        value = np.sum(np.repeat(costs, tries, axis=0) * tried.values, axis=1)
        value = np.where(tried.excess <= WITHIN, value, 1e3 * (1 + tried.excess))
        merit = np.where(tried.good, value, np.inf).reshape(b, tries)
        best = np.arange(b) * tries + np.argmin(merit, axis=1)
        return Found(*(part[best] for part in tried)), merit.min(axis=1)

    starts = np.asarray(found.theta)
    ends = np.stack([_descend(solutions, cases, *start) for start in zip(costs, starts, tau, strict=True)])
    way = np.append(1 - 0.5 ** np.arange(_BACK), 1.0)[:, None]  # from the start to the end
    now, merit = least(starts[:, None] + way * (ends - starts)[:, None])
    radius = np.full(len(starts), _RADIUS)
    for _ in range(_TRIES):
        step = (radius[:, None, None] * (upper - lower)) * random.standard_normal((len(starts), _TRIED, lower.size))
        ahead, its_merit = least(np.clip(now.theta[:, None] + step, lower, upper))
        better = its_merit < merit
        pairs = zip(ahead, now, strict=True)
        now = Found(*(np.where(better.reshape(-1, *[1] * (new.ndim - 1)), new, old) for new, old in pairs))
        merit, radius = np.where(better, its_merit, merit), radius * np.where(better, _GROWN, _SHRUNK)
    return now


@compiled
def _solved(
    solutions: SolutionSet, cases: AbstractCases, theta: Float[Array, "b q"], tau: Float[Array, "b p"]
) -> Found:
    """The solution of each case, (b, q), by Newton's method from a friction, (b, p)."""
    return jax.vmap(lambda *start: _at(solutions, cases, *start))(theta, tau)


def _at(solutions: SolutionSet, cases: AbstractCases, theta: Array, tau: Array) -> Found:
    good = jnp.array(True)
    if solutions.law is not None:
        problem = solutions.problem(*cases.chosen(theta)).sized_at(tau)
        root = closed_root(problem, tau, Newton())
        good = root.progress.converged(Newton().tolerance(tau.dtype))
        tau = jnp.where(good, root.tau, tau)
    return _found(solutions, cases, theta, tau, good)


@compiled
def _with_slopes(solutions: SolutionSet, cases: AbstractCases, theta: Any, tau: Any) -> tuple[Array, Array, Array]:
    """[qdd; lam; tau] and the excess over each limit, of one case; their slopes by it; whether it has a solution."""
    n, m = solutions.response.free.acceleration.size, solutions.stress.shape[0]

    def figures(theta: Array) -> tuple[Array, tuple[Array, Array]]:
        found = _at(solutions, cases, theta, tau)
        values = jnp.asarray(found.values)
        both = jnp.concatenate([values, cases.excess(values[n : n + m])])
        return both, (both, jnp.asarray(found.good))

    slopes, (both, good) = jax.jacfwd(figures, has_aux=True)(theta)
    return both, slopes, good


def _descend(
    solutions: SolutionSet, cases: AbstractCases, cost: np.ndarray, theta: np.ndarray, tau: np.ndarray
) -> np.ndarray:
    """The case where the cost is least nearby, by sequential quadratic programming on shares of the box."""
    from scipy.optimize import minimize  # here, as its import takes time that few need

    lower, span, x = np.asarray(cases.lower), np.asarray(cases.upper) - np.asarray(cases.lower), cost.size

    @functools.lru_cache(maxsize=2)
    def at(share: bytes) -> tuple[np.ndarray, np.ndarray, bool]:
        both, slopes, good = jax.device_get(_with_slopes(solutions, cases, lower + span * np.frombuffer(share), tau))
        return both, slopes * span, bool(good) and bool(np.all(np.isfinite(slopes)))

    def merit(share: np.ndarray) -> tuple[float, np.ndarray]:
        both, slopes, good = at(share.tobytes())
        return (float(cost @ both[:x]), cost @ slopes[:x]) if good else (_NOWHERE, np.zeros(share.size))

    limits = {
        "type": "ineq",
        "fun": lambda share: np.nan_to_num(-at(share.tobytes())[0][x:], nan=-1.0),
        "jac": lambda share: np.nan_to_num(-at(share.tobytes())[1][x:]),
    }
    begin = np.where(span > 0, (theta - lower) / np.where(span > 0, span, 1.0), 0.5)
    has_limits = np.size(at(begin.tobytes())[0]) > x
    end = minimize(
        merit,
        begin,
        jac=True,
        bounds=[(0.0, 1.0)] * begin.size,
        constraints=[limits] if has_limits else [],
        method="SLSQP",
        options={"maxiter": _STEPS, "ftol": 1e-10},
    )
    return lower + span * np.clip(np.nan_to_num(end.x, nan=0.5), 0.0, 1.0)
