"""A search for extremes of outputs over sets of cases, where friction depends on the case.

1. All solutions that a search finds at many cases (`sample`); the best are starts.
2. Sequential quadratic programming (SciPy's SLSQP) within the box and the limits on multipliers, with tau(theta) by
   Newton's method from the tau of the start; what is left beyond the limits is taken back on the line to the start.
3. Random steps (`_climb`).

Every value is attained by a solution within the limits, so that what is found lies inside the true band.
"""

import functools
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .._solve._all_solutions import search
from .._solvers._solver import Newton
from .._tools._numbers import chosen_of, or_one, xp
from ._cases import AbstractCases
from ._climb import climb
from ._solution_set import SolutionSet

_STEPS = 25  # of sequential quadratic programming
_NOWHERE = 1e6  # cost of a case without a solution; others are of size 1
_BACK = 30  # halvings of the way back to the start
_TRIED, _RADIUS = 24, 0.02  # random steps at a time, and their first size, relative to the box
WITHIN = 1e-9  # excess over a limit, relative to its width, that is rounding


class Found(NamedTuple):
    """Solutions found at cases.

    - `theta`: the case, shape (..., q).
    - `tau`: friction, shape (..., p).
    - `values`: [qdd; lam; tau], shape (..., n + m + p).
    - `excess`: largest excess over the limits.
    - `good`: whether it is a solution.
    """

    theta: np.ndarray
    tau: np.ndarray
    values: np.ndarray
    excess: np.ndarray
    good: np.ndarray

    def within(self) -> np.ndarray:
        """Which are solutions within the limits."""
        return within(self.good, self.excess)


def within(good: np.ndarray, excess: np.ndarray) -> np.ndarray:
    """Which good ones exceed no limit."""
    return good & (excess <= WITHIN)


def sample(
    solutions: SolutionSet,
    cases: AbstractCases,
    theta: Float[np.ndarray, "s q"],
    factors: Float[np.ndarray, "starts l"],
) -> Found:
    """Solutions found at many cases; arrays (s, starts + 1, ...)."""
    base, unit = cases.chosen(theta)
    if solutions.law is None:
        tau, good = np.zeros((len(theta), 1, 0)), np.ones((len(theta), 1), bool)
    else:
        tau, good = search(solutions.problem(base, unit), factors)
    many = unit[:, None] if unit.ndim == 3 else unit
    return _found(solutions, cases, np.repeat(theta[:, None], tau.shape[1], axis=1), (base[:, None], many), tau, good)


def _found(
    solutions: SolutionSet,
    cases: AbstractCases,
    theta: np.ndarray,
    chosen: tuple[np.ndarray, np.ndarray],
    tau: np.ndarray,
    good: np.ndarray,
) -> Found:
    values = solutions.outputs(*chosen, tau)
    n, m = solutions.response.free.acceleration.size, solutions.stress.shape[0]
    excess = np.max(cases.excess(values[..., n : n + m]), axis=-1, initial=-np.inf)
    return Found(theta, tau, values, excess, good & np.all(np.isfinite(values), axis=-1))


def improve(solutions: SolutionSet, cases: AbstractCases, costs: np.ndarray, found: Found) -> Found:
    """From each solution found a case with less cost^T [qdd; lam; tau]; costs (b, x) of size 1 over the box."""
    starts, tau = found.theta, found.tau

    def least(theta: np.ndarray) -> tuple[Found, np.ndarray]:
        """Of cases (b, tries, q) the best for each start, and its merit."""
        b, tries, q = theta.shape
        tried = _solved(solutions, cases, theta.reshape(b * tries, q), np.repeat(tau, tries, axis=0))
        value = np.sum(np.repeat(costs, tries, axis=0) * tried.values, axis=1)
        value = np.where(tried.excess <= WITHIN, value, 1e3 * (1 + tried.excess))
        merit = np.where(tried.good, value, np.inf).reshape(b, tries)
        best = np.arange(b) * tries + np.argmin(merit, axis=1)
        return Found(*(part[best] for part in tried)), merit.min(axis=1)

    ends = np.stack([_descend(solutions, cases, *start) for start in zip(costs, starts, tau, strict=True)])
    way = np.append(1 - 0.5 ** np.arange(_BACK), 1.0)[:, None]  # from the start to the end
    now, merit = least(starts[:, None] + way * (ends - starts)[:, None])

    def look(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nonlocal now, merit
        ahead, its_merit = least(theta)
        better = its_merit < merit
        now = chosen_of(better, ahead, now)
        merit = np.where(better, its_merit, merit)
        return now.theta, -merit

    climb(look, now.theta, -merit, cases, _RADIUS, _TRIED, np.random.default_rng(0))
    return now


def _solved(
    solutions: SolutionSet, cases: AbstractCases, theta: Float[np.ndarray, "b q"], tau: Float[np.ndarray, "b p"]
) -> Found:
    """The solution of each case by Newton's method from a friction."""
    chosen, good = cases.chosen(theta), np.ones(len(theta), bool)
    if solutions.rows.size:
        problem, newton = solutions.problem(*chosen).sized_at(tau), Newton()
        root = newton.run(problem, tau)
        good = np.asarray(root.progress.converged(newton.tolerance(tau.dtype)))
        tau = np.where(good[:, None], root.tau, tau)
    elif solutions.law is not None:
        tau = solutions.problem(*chosen).law(chosen[0][:, solutions.rows])
    return _found(solutions, cases, theta, chosen, tau, good)


def _with_slopes(
    solutions: SolutionSet, cases: AbstractCases, theta: np.ndarray, tau: np.ndarray
) -> tuple[np.ndarray, np.ndarray, bool]:
    """[qdd; lam; tau] and the excess over each limit, of one case; their slopes by it; whether it has a solution.

    dlam = B + U dtau,   dtau = (I - law' K)^-1 law' B[rows],   B the slopes under friction that stays
    """
    found = Found(*(part[0] for part in _solved(solutions, cases, theta[None], tau[None])))
    n, m = solutions.response.free.acceleration.size, solutions.stress.shape[0]
    lam, (_, unit) = found.values[n : n + m], cases.chosen(theta)
    by_case, by_tau = cases.slopes(theta, lam), np.zeros((tau.size, theta.size))
    if solutions.rows.size and solutions.law is not None:
        by_load = solutions.law.slope(lam[solutions.rows])
        loop = np.eye(tau.size) - by_load @ unit[solutions.rows]
        by_tau = xp.linalg.solve(loop, by_load @ by_case[solutions.rows])
    of_lam = by_case + unit @ by_tau
    parts = [solutions.response.unit.acceleration @ by_tau, of_lam, by_tau, cases.excess_slopes(lam, of_lam)]
    return np.concatenate([found.values, cases.excess(lam)]), np.concatenate(parts), bool(found.good)


def _descend(
    solutions: SolutionSet, cases: AbstractCases, cost: np.ndarray, theta: np.ndarray, tau: np.ndarray
) -> np.ndarray:
    """The case where the cost is least nearby, by sequential quadratic programming on shares of the box."""
    from scipy.optimize import minimize  # here, as its import takes time that few need

    lower, span, x = cases.lower, cases.upper - cases.lower, cost.size

    @functools.lru_cache(maxsize=2)
    def at(share: bytes) -> tuple[np.ndarray, np.ndarray, bool]:
        both, slopes, good = _with_slopes(solutions, cases, lower + span * np.frombuffer(share), tau)
        return both, slopes * span, good and bool(np.all(np.isfinite(slopes)))

    def merit(share: np.ndarray) -> tuple[float, np.ndarray]:
        both, slopes, good = at(share.tobytes())
        return (float(cost @ both[:x]), cost @ slopes[:x]) if good else (_NOWHERE, np.zeros(share.size))

    limits = {
        "type": "ineq",
        "fun": lambda share: np.nan_to_num(-at(share.tobytes())[0][x:], nan=-1.0),
        "jac": lambda share: np.nan_to_num(-at(share.tobytes())[1][x:]),
    }
    begin = np.where(span > 0, (theta - lower) / or_one(span), 0.5)
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
