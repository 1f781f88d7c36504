"""Random mechanisms with 50 digits: exact geometry from the floats that were drawn, the rank as counted.

The same numbers are derived once more in mpmath, so that redundant constraints depend on each other to 50 digits and
the library is given the rounded mechanism. How much an answer can be trusted shows in how far the exact one moves when
every number that was drawn moves by a rounding: those mechanisms have the same rank.
"""

from collections.abc import Callable

import numpy as np
from truth import exact
from truth.exact import mp

from .library import Answers, Problem
from .samples import Arithmetic, Raw

_number = np.frompyfunc(mp.mpf, 1, 1)
_PERTURBATIONS, _MARGIN = 4, 10
_NOTHING = 1e-40
Parts = dict[str, np.ndarray]


@exact.exactly
def _onto_null(jacobian: np.ndarray, vector: np.ndarray, rank: int) -> np.ndarray:
    full, column = mp.matrix(jacobian[0].tolist()), mp.matrix(vector[0].tolist())
    if rank == full.cols:
        return 0 * vector
    rows = exact.independent_rows(full, rank)
    free = mp.matrix([[full[row, k] for k in range(full.cols)] for row in rows])
    column -= free.T * exact.solve_columns(free * free.T, free * column)
    return np.array([[*column]], dtype=object)


DIGITS = Arithmetic(
    _number, np.frompyfunc(mp.cos, 1, 1), np.frompyfunc(mp.sin, 1, 1), np.frompyfunc(mp.sqrt, 1, 1), _onto_null
)


def of(problem: Problem) -> exact.Sample:
    """A problem of one sample derived in `DIGITS`."""
    return exact.Sample(problem.structure, problem.parameters, problem.equations)


@exact.exactly
def solution(problem: Problem, start: np.ndarray, given: exact.Sample | None = None) -> Parts:
    """Its answer; Newton's method for friction begins at `start`.

    `given` is that of the same problem with any misfit, which what is costly does not depend on."""
    compliance, misfit = problem.compliance[0].tolist(), problem.misfit[0].tolist()
    found = (given or of(problem)).solve(compliance, misfit, start=start.tolist())
    return _parts(problem, found.acceleration, found.multipliers, [*found.friction])


def _parts(problem: Problem, acceleration, multipliers, tau: list) -> Parts:
    """Floats of each kind."""
    structure = problem.structure
    linear = 2 * len(structure.bodies)
    kinds = np.array([kind for *_, kind in structure.rows])
    sliding = np.array([structure.joints[k].kind != "revolute" for k in structure.frictional], bool)
    qdd, lam, tau_ = (np.array([float(x) for x in part]) for part in (acceleration, multipliers, tau))
    parts = {
        "linear": qdd[:linear],
        "angular": qdd[linear:],
        "force": lam[kinds == "force"],
        "moment": lam[kinds == "moment"],
        "friction force": tau_[sliding],
        "friction moment": tau_[~sliding],
    }
    return {kind: part for kind, part in parts.items() if part.size}


@exact.exactly
def errors(
    make: Callable[[Raw, Arithmetic], Problem], raw: Raw, sample: int, answers: Answers
) -> dict[str, tuple[float, float]]:
    """Error of each kind over its bound: 10 times what rounding of the drawn numbers does to the exact answer, and of
    the sums of as many terms as there are unknowns; and the relative error.

    `make` derives the problem from numbers in an arithmetic.
    """
    one = {name: value[sample : sample + 1] for name, value in raw.items()}
    start = answers.tau[sample]
    problem = make(one, DIGITS)
    truth: Parts = solution(problem, start)
    rng = np.random.default_rng(sample)
    moved = {kind: np.zeros(()) for kind in truth}
    eps = np.finfo(float).eps
    sums = eps * np.sqrt(problem.structure.n + problem.structure.m)
    for _ in range(_PERTURBATIONS):
        signs = {name: rng.choice([-1, 1], value.shape) for name, value in one.items()}
        near = {name: DIGITS.number(value) * (1 + signs[name] * mp.mpf(eps)) for name, value in one.items()}
        other = solution(make(near, DIGITS), start)
        moved = {kind: np.maximum(moved[kind], np.max(np.abs(other[kind] - truth[kind]))) for kind in truth}
    found = _parts(problem, answers.acceleration[sample], answers.multipliers[sample], [*start])
    ratios = {}
    for kind, true in truth.items():
        bound = _MARGIN * (moved[kind] + sums * np.max(np.abs(true)))
        error = np.max(np.abs(found[kind] - true))
        if error < _NOTHING:  # exact zeros
            ratios[kind] = 0.0, 0.0
        else:
            ratios[kind] = float(error / bound), float(error / np.max(np.abs(true)))
    return ratios
