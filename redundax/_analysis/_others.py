"""Other solutions beside the one that an analysis starts from, some along each self-stress state.

    lam' = lam_MP(tau') + z_0 + a s_i,   tau' = law(lam'),   a = 1/2, -2 and 10 times the loads over the self-stress

z_0 is the self-stress of the given solution; moments count as forces, over a length of the mechanism. A derivative says
little of these solutions: at a joint that stands there twice, or one without load, it is zero by symmetry.
"""

from typing import cast

import numpy as np
from jaxtyping import Array, Float

from .._closures._closure import minimum_norm
from .._equations._factorisation import Factorisation
from .._solve._reduced import reduce
from .._solve._solution import Solution
from .._solvers._friction_problem import FrictionProblem
from .._solvers._solver import Newton
from .._system._results import RESULTS, differs
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._numbers import each, on_numbers, or_one, xp

_AMPLITUDES = 0.5, -2.0, 10.0  # a small one, and some that turn the loads of joints around


def other_solutions(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    solution: Solution,
    stress: np.ndarray,
    sense: Float[Array, " p"] | None,
) -> np.ndarray:
    """[qdd; lam; tau] of solutions along each of the self-stress states (k, m), shape (k, looks, n + m + p).

    NaN where none was found.
    """
    multipliers = np.asarray(solution.multipliers)
    as_forces = np.where(system.rows.angular, 1 / np.asarray(factor.length), 1.0)
    amplitude = np.abs(multipliers * as_forces).max() / np.abs(stress * as_forces).max(axis=1)
    amplitudes = np.outer(or_one(amplitude), _AMPLITUDES)
    added = xp.asarray(amplitudes[:, :, None] * stress[:, None])
    return np.asarray(_solved(system.anonymous, state, factor, solution, added, sense))


@on_numbers
def _solved(
    system: AbstractSystem, state: State, factor: Factorisation, solution: Solution, added: Array, sense: Array | None
) -> Array:
    """Solutions from a given one with self-stress added, (k, looks, m), by Newton's method."""
    reduced = reduce(system, state, factor, minimum_norm(added.shape[-1], added.dtype), sense=sense)
    problem, newton = cast(FrictionProblem, reduced.problem), Newton()
    present = solution.multipliers - reduced.response.at(solution.friction).multipliers

    def one(added: Array) -> Array:
        stress = present + added
        moved = problem.at(problem.rho0 + stress[reduced.rows])
        root = newton.run(moved, solution.friction)
        found = xp.concatenate([*reduced.response.at(root.tau, stress), root.tau])
        return xp.where(~differs(newton.result(root.progress), RESULTS.successful), found, xp.nan)

    return each(lambda some: each(one, some), added)
