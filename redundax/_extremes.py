"""Extremes of outputs over sets of cases.

Where the friction does not depend on the case, lam is affine in it, and outputs are bounded exactly:

    Affine, box:        linear programme   min c^T theta,  theta in a box,  limits on lam
    Affine, ellipsoid:  c^T theta over |v_0 + V theta| <= 1: theta_0 -+ r R^-1 w / |w|,  V = Q R,  w = R^-T c,
                        theta_0 = -R^-1 Q^T v_0,  r^2 = 1 - |v_0 + V theta_0|^2
    Fractional:         the vertices of the box

Elsewhere the best solutions that a search finds at many cases are starts for BFGS on theta = lower + (upper - lower)
sin^2 u, whose derivative vanishes at the ends of the box, with tau(theta) by Newton's method from the tau of the start;
limits on multipliers enter by an augmented Lagrangian (Powell, Hestenes, Rockafellar). Every value is attained by a
solution, so that what is found lies inside the true band: an inner estimate.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import scipy.optimize
from jaxtyping import Array, Float

from ._cases import AbstractCases, Affine, Fractional, corners, multipliers_of
from ._enumerate import search
from ._solution_set import SolutionSet
from ._solver import Newton, closed_root

_MARGIN = 0.01  # of the box, by which starts are moved inside: at its ends sin^2 is stationary
_STEPS = 100
_ROUNDS, _WEIGHT = 12, 100.0  # of the augmented Lagrangian
_WITHIN = 1e-9  # excess over a limit, relative to its width, that is rounding


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
        return np.asarray(self.good) & (np.asarray(self.excess) <= _WITHIN)


def linear_extreme(cases: Affine, tau: np.ndarray, cost: np.ndarray) -> np.ndarray | None:
    """The case with the least cost^T lam under friction that does not depend on it; None if there is no case."""
    start = np.asarray(cases.start + cases.unit @ jnp.asarray(tau))
    slope, lower, upper = (np.asarray(x) for x in (cases.slope, cases.lower, cases.upper))
    rows, least, most = (np.asarray(x) for x in (cases.rows, cases.least, cases.most))
    if cases.norm:
        return _over_ellipsoid(start[rows] / most, slope[rows] / most[:, None], cost @ slope)
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    width = np.where(most > least, most - least, 1.0)
    at, by = (start[rows] + slope[rows] @ middle) / width, slope[rows] * half / width[:, None]
    objective = cost @ slope * half
    size = np.abs(objective).max(initial=0.0) or 1.0
    if not rows.size:
        return middle - half * np.sign(objective)
    limits = np.concatenate([most / width - at, at - least / width])
    found = scipy.optimize.linprog(objective / size, np.concatenate([by, -by]), limits, bounds=(-1, 1))
    return middle + half * found.x if found.status == 0 else None


def _over_ellipsoid(start: np.ndarray, slope: np.ndarray, cost: np.ndarray) -> np.ndarray | None:
    q, r = np.linalg.qr(slope)
    centre = -np.linalg.solve(r, q.T @ start)
    room = 1 - np.sum((start + slope @ centre) ** 2)
    if room < 0:
        return None
    wanted = np.linalg.solve(r.T, cost)
    size = np.linalg.norm(wanted)
    return centre - np.sqrt(room) * np.linalg.solve(r, wanted / (size or 1.0))


def vertex_extremes(cases: Fractional, tau: np.ndarray, costs: np.ndarray) -> np.ndarray:
    """For each row of `costs` (b, m) the vertex with the least costs^T lam, shape (b, q)."""
    matters = np.asarray(jnp.any(cases.stress[cases.rows] != 0, axis=1))  # other rows do not move the multipliers
    few = eqx.tree_at(
        lambda cases: (cases.lower, cases.upper, cases.rows),
        cases,
        (cases.lower[matters], cases.upper[matters], cases.rows[matters]),
    )
    all_of = corners(few)
    values = np.asarray(multipliers_of(few, all_of, jnp.asarray(tau))) @ costs.T
    out = np.tile(np.asarray(cases.lower), (len(costs), 1))
    out[:, matters] = np.asarray(all_of)[np.argmin(values, axis=0)]
    return out


@eqx.filter_jit
def sampled(
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


@eqx.filter_jit
def improved(
    solutions: SolutionSet,
    cases: AbstractCases,
    costs: Float[Array, "b x"],
    theta: Float[Array, "b q"],
    tau: Float[Array, "b p"],
) -> Found:
    """From each start (theta, tau) a case with less costs^T [qdd; lam; tau], costs of size 1 over the box."""
    return jax.vmap(lambda *start: _improved(solutions, cases, *start))(costs, theta, tau)


def _improved(solutions: SolutionSet, cases: AbstractCases, cost: Array, theta: Array, tau: Array) -> Found:
    span = cases.upper - cases.lower
    share = jnp.where(span > 0, (theta - cases.lower) / jnp.where(span > 0, span, 1.0), 0.5)
    start = jnp.arcsin(jnp.sqrt(jnp.clip(share, _MARGIN, 1 - _MARGIN)))

    def solution(u: Array) -> Found:
        theta = cases.lower + span * jnp.sin(u) ** 2
        base, unit = cases.chosen(theta)
        if solutions.law is None:
            return _found(solutions, cases, theta, tau, jnp.array(True))
        newton, problem = Newton(), solutions.problem(base, unit).sized_at(jax.lax.stop_gradient(tau))
        root = closed_root(problem, tau, newton)
        good = root.progress.converged(newton.tolerance(tau.dtype))
        return _found(solutions, cases, theta, jnp.where(good, root.tau, tau), good)

    def over(at: Found) -> Array:
        n, m = solutions.free.acceleration.size, solutions.stress.shape[0]
        return cases.excess(jnp.asarray(at.values)[n : n + m])

    def lagrangian(u: Array, multipliers: Array) -> Array:
        at = solution(u)
        push = jnp.sum(jnp.maximum(0.0, multipliers + _WEIGHT * over(at)) ** 2 - multipliers**2) / (2 * _WEIGHT)
        return jnp.where(at.good, cost @ at.values + push, 1e6)

    def round_(carry: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], None]:
        u, multipliers = carry
        best = optx.minimise(lagrangian, optx.BFGS(1e-12, 1e-12), u, multipliers, max_steps=_STEPS, throw=False).value
        return (best, jnp.maximum(0.0, multipliers + _WEIGHT * over(solution(best)))), None

    none = jnp.zeros_like(cases.excess(solutions.free.multipliers))
    (end, _), _ = jax.lax.scan(round_, (start, none), None, length=_ROUNDS if none.size else 1)
    return solution(end)
