"""Friction that holds a mechanism with one degree of freedom, case by case.

With s the sense in which it would start without friction, e^T tau the acceleration that friction causes along the
freedom, relative to the one without friction, and the share t of its limit that every joint needs,

    tau = t law(rho0 + K tau, s),   1 + e^T tau = 0.
"""

import numpy as np
from jaxtyping import Float

from ..._tools._numbers import solution
from .._cases import AbstractCases
from .._solution_set import SolutionSet

_STEPS = 40  # of Newton's method
_SETTLED = 1e-14  # last of them, relative to the largest


def held(
    solutions: SolutionSet,
    cases: AbstractCases,
    effect: Float[np.ndarray, " p"],
    theta: Float[np.ndarray, "s q"],
    start: Float[np.ndarray, "s p"],
) -> tuple[Float[np.ndarray, "s p"], Float[np.ndarray, " s"]]:
    """tau and t by Newton's method, whatever it ends with, from friction in proportion to a start; NaN for the first
    sweep."""
    problem = solutions.problem(*cases.chosen(theta))
    start = np.where(np.all(np.isfinite(start), axis=1)[:, None], start, problem.law(problem.rho0))
    size = problem.sized_at(start).friction_size
    by_share = np.pad(effect * size, ((0, 0), (0, 1)))[:, None]
    x = -1 / (start @ effect)[:, None] * np.pad(start / size, ((0, 0), (0, 1)), constant_values=1.0)
    for _ in range(_STEPS):
        y, t = x[:, :-1], x[:, -1:]
        force, slope = problem.linearised(problem.loads(size * y))
        by_y = np.eye(effect.size) - t[..., None] * slope * size[:, None] / size[..., None]
        matrix = np.append(np.append(by_y, -(force / size)[..., None], axis=2), by_share, axis=1)
        change = solution(matrix, np.append(y - t * force / size, 1 + (size * y) @ effect[:, None], axis=1))
        x = x - change
        if not np.any(np.abs(change).max(axis=1) > _SETTLED * np.abs(x).max(axis=1)):
            break
    return size * x[:, :-1], x[:, -1]
