"""Which joints of a mechanism at rest stick and which start to slip, case by case.

    alpha = S (g + S^T tau),   lo(rho) <= tau <= hi(rho),   alpha_j > 0 only at tau_j = lo_j,   alpha_j < 0 only at hi_j

with rho = rho_0 + K tau, as of `_stick` at an instant of a motion. For given limits these are the conditions of
optimality of min |g + S^T tau|^2, so that the acceleration is unique, and with lo' and hi' those of another case

    |change of g + S^T tau| <= sum_j |S_j| |change of the limits of j|,

of friction along a direction too, whose limits are balls.

Where the limits depend on tau, through Gamma of `_one_freedom`, each case has one solution tau (proved) if the spectral
radius of C is below 1, C_jj = Gamma_jj, C_jk = max(|S_j . S_k| / |S_j|^2, Gamma_jk): a sweep of Jacobi's,
tau_j <- clip(tau_j - alpha_j / |S_j|^2, lo_j, hi_j), then contracts in a weighted maximum norm. Sweeps of Gauss and
Seidel find it, least squares within bounds where masses are too unlike for them.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..._analysis._verdict import spectral_radius
from ..._solvers._gauss_seidel import gauss_seidel
from ..._system._directions import Directions
from ..._tools._compilation import compiled
from ..._tools._numbers import Numeric, or_one
from .._at_rest import NONE, ReducedForce, ball_sizes
from .._cases import AbstractCases
from .._solution_set import SolutionSet

_SETTLED = 1e-13  # change of friction, relative to the largest, after which sweeps have settled it
_FOUND = 1e-6  # error of the acceleration, relative to the parts that cancel, of what is taken for a solution
_HELD = 1e-8  # accelerations that are none, relative to the parts that cancel


class Limits(NamedTuple):
    """Limits of friction at cases, shape (s, p)."""

    low: np.ndarray
    high: np.ndarray


class LimitSamples(NamedTuple):
    """Limits of friction at cases, shape (s, p), multipliers, (s, m), and their largest excess over bounds, (s,)."""

    low: np.ndarray
    high: np.ndarray
    multipliers: np.ndarray
    excess: np.ndarray


def sample_limits(
    solutions: SolutionSet, cases: AbstractCases, theta: Float[np.ndarray, "s q"], tau: Float[np.ndarray, "s p"]
) -> LimitSamples:
    """Limits and multipliers at many cases, each with its friction."""
    multipliers = cases.multipliers(theta, tau)
    excess = np.max(cases.excess(multipliers), axis=1, initial=-np.inf)
    return LimitSamples(*_limits(solutions, multipliers), multipliers, excess)


def _limits(solutions: SolutionSet, multipliers: Numeric) -> tuple[Numeric, Numeric]:
    """lo and hi of friction."""
    law = solutions.law
    if law is None:
        return multipliers[..., :0], multipliers[..., :0]
    return law.limits(multipliers[..., solutions.rows], np.ones(law.rate.shape, bool))


@compiled
def slipping_friction(
    solutions: SolutionSet,
    load: Float[Numeric, " d"],
    slips: Float[Numeric, "p d"],
    base: Float[Numeric, "s m"],
    unit: Float[Numeric, "s m p"],
    directions: Directions | None,
) -> Float[Numeric, "s p"]:
    """Friction of the conditions above, as far as sweeps settle it."""
    free, matrix = slips @ load, slips @ slips.T
    own = jnp.where(jnp.diagonal(matrix) > 0, jnp.diagonal(matrix), jnp.inf)

    def one(base: Numeric, unit: Numeric) -> Numeric:
        if not free.size:
            return free

        def limits(tau: Numeric) -> tuple[Numeric, Numeric]:
            return _limits(solutions, base + unit @ tau)

        weight = jnp.sqrt(jnp.diagonal(matrix))
        return gauss_seidel(limits, free, matrix, own, weight, (0.0, _SETTLED), directions=directions).tau

    return jax.vmap(one)(base, unit)


class Started(NamedTuple):
    """How slip begins, case by case.

    - `sense`: in which each slip starts, 0 where it sticks; shape (s, p).
    - `moves`, `sure`: whether anything moves, and whether that is sure; shape (s,).
    - `error`: a bound of that of a = g + S^T tau; shape (s,).
    """

    sense: np.ndarray
    moves: np.ndarray
    sure: np.ndarray
    error: np.ndarray


def started(drive: ReducedForce, tau: np.ndarray, limits: Limits | LimitSamples) -> Started:
    """How slip begins under friction.

    What is left of the conditions bounds the error of a: |error|^2 <= 2 sum_j (tau_j alpha_j + limit_j |alpha_j|).
    """
    matrix, sizes = drive.slips @ drive.slips.T, np.linalg.norm(drive.slips, axis=1)
    left = drive.load + tau @ drive.slips
    alpha = left @ drive.slips.T
    low, high = limits.low, limits.high
    least = np.minimum(low * alpha, high * alpha)
    if drive.directions is not None:
        ball, directed = drive.directions, drive.directions.directed
        surface = np.asarray(ball.arms) * alpha
        along = np.sqrt(surface**2 @ ball.same)
        share = surface**2 / or_one(along)
        least = np.where(directed, -ball_sizes(ball, high) / np.asarray(ball.arms) * share, least)
    gap = (tau * alpha - least).sum(axis=1)
    error = np.sqrt(2 * np.maximum(gap, 0.0))
    own = np.abs(drive.slips @ drive.load) + np.abs(tau) @ np.abs(matrix)
    whole = np.linalg.norm(drive.load) + np.abs(tau) @ sizes
    held, found = max(_HELD, drive.rounding), _FOUND * np.sqrt(drive.rounding / NONE)
    none = np.maximum(held * own + drive.rounding / 100 * sizes * whole[:, None], sizes * error[:, None])
    moves = np.linalg.norm(left, axis=1) > np.maximum(held * whole, error)
    return Started(np.where(np.abs(alpha) > none, np.sign(alpha), 0.0), moves, error <= found * whole, error)


def least_accelerated(drive: ReducedForce, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Friction (s, p) of least |g + S^T tau| within limits."""
    from scipy.optimize import lsq_linear  # here, because its import takes a second

    tau = np.array(low, float)
    for own, most in zip(tau, high, strict=True):
        some = own < most
        if some.any():
            given = drive.load + own[~some] @ drive.slips[~some]
            own[some] = lsq_linear(drive.slips[some].T, -given, (own[some], most[some]), method="bvls", tol=1e-15).x
    return tau


def one_start(drive: ReducedForce, gamma: np.ndarray) -> bool:
    """Whether each case is proved to have one acceleration, with Gamma of all cases."""
    matrix = drive.slips @ drive.slips.T
    own, free = np.diag(matrix), np.diag(matrix) == 0
    if not np.any(gamma):
        return True
    if np.any(gamma[:, free]) or not np.all(np.isfinite(gamma)):
        return False
    if drive.directions is not None:
        return False
    kept = ~free
    sweep = np.abs(matrix[np.ix_(kept, kept)]) / own[kept][:, None] * (1 - np.eye(kept.sum()))
    return spectral_radius(np.maximum(sweep, gamma[np.ix_(kept, kept)])) < 1
