"""Friction that holds a mechanism with one degree of freedom, case by case.

Held at rest, with s the sense in which it would start without friction, e^T tau the acceleration that friction causes
along the freedom, relative to the one without friction, and the share t of its limit that every joint needs,

    tau = t law(rho0 + K tau, s),   1 + e^T tau = 0,   0 <= t <= 1.

Newton's method on (tau, t); what it ends with is checked, so that a state called held is one.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..._tools._numbers import product, solution
from .._cases import AbstractCases
from .._descent import within
from .._solution_set import SolutionSet

_STEPS = 40  # of Newton's method
_ROUNDING = 1e-9  # of the share and of the equations


class Held(NamedTuple):
    """States that friction holds.

    - `theta`, `tau`, `multipliers`: the case, shape (..., q), friction, shape (..., p), and lam, shape (..., m).
    - `share`: t.
    - `excess`: largest excess over the limits.
    - `good`: whether it is such a state.
    """

    theta: np.ndarray
    tau: np.ndarray
    multipliers: np.ndarray
    share: np.ndarray
    excess: np.ndarray
    good: np.ndarray

    def within(self) -> np.ndarray:
        """Which are held within the limits."""
        return within(self.good, self.excess)


def held(
    solutions: SolutionSet,
    cases: AbstractCases,
    effect: Float[np.ndarray, " p"],
    theta: Float[np.ndarray, "s q"],
    start: Float[np.ndarray, "s p"],
) -> Held:
    """The held states of cases, by Newton's method from friction in proportion to a start, NaN for the first sweep."""
    base, unit = cases.chosen(theta)
    if solutions.law is None:
        return _state(cases, theta, base, start, np.full(len(theta), np.inf), np.zeros(len(theta), bool))
    problem = solutions.problem(base, unit)
    start = np.where(np.all(np.isfinite(start), axis=1)[:, None], start, problem.law(problem.rho0))
    size = problem.sized_at(start).friction_size

    def equations(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The residual and its slope."""
        tau = size * x[:, :-1]
        force, slope = problem.linearised(problem.loads(tau))
        left = np.append(x[:, :-1] - x[:, -1:] * force / size, 1 + tau @ effect[:, None], axis=1)
        by_y = np.eye(effect.size) - x[:, -1:, None] * slope * size[:, None] / size[..., None]
        above = np.append(by_y, -(force / size)[..., None], axis=2)
        return left, np.append(above, np.pad(effect * size, ((0, 0), (0, 1)))[:, None], axis=1)

    x = -1 / (start @ effect)[:, None] * np.pad(start / size, ((0, 0), (0, 1)), constant_values=1.0)
    for _ in range(_STEPS):
        left, slope = equations(x)
        x = x - solution(slope, left)
    left = np.abs(equations(x)[0])
    good = np.all(left[:, :-1] <= _ROUNDING * np.abs(x[:, :-1]).max(axis=1, keepdims=True), axis=1)
    good &= (left[:, -1] <= _ROUNDING) & (x[:, -1] >= 0) & (x[:, -1] <= 1 + _ROUNDING)
    tau = size * x[:, :-1]
    return _state(cases, theta, base + product(unit, tau), tau, x[:, -1], good)


def _state(
    cases: AbstractCases,
    theta: np.ndarray,
    multipliers: np.ndarray,
    tau: np.ndarray,
    share: np.ndarray,
    good: np.ndarray,
) -> Held:
    excess = np.max(cases.excess(multipliers), axis=-1, initial=-np.inf)
    return Held(theta, tau, multipliers, share, excess, good)
