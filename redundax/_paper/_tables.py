"""Tables 2, 3 and 4 computed, row by row: one compiled program serves all rows of a table.

The mechanism is built in the row's own length unit, so every row has the paper's numbers: accelerations
grow with u, forces with u, moments with u^2, and h and x0 are numbers in that unit.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Array, Float

from .._analysis._verdict import family
from .._bodies._mechanism import Mechanism
from .._closures._closure import Compliance, MinimumNorm, elasticity
from .._equations._factorize import factorize_dense
from .._solve._solution import Solution
from .._solve._solve import solve
from .._solvers._solver import FixedPoint, Newton
from .._system._results import RESULTS, is_one_of
from .._system._units import Units
from ..mechanisms import wojtyra2020
from ._printed import TABLES, PrintedTable

MU_RHO = 0.02  # m, friction radius of the revolutes A to D
PHI = math.pi / 4  # rad, crank angle
RATE = 1.0  # rad/s, crank rate


@dataclasses.dataclass(frozen=True)
class Table:
    """A computed table.

    - `printed`: the printed table with its cases.
    - `entries`: names of the columns of `values`: coordinates, rows, and slips where there is friction.
    - `groups`: columns of the linear and angular accelerations, forces, moments and friction moments.
    - `values`: computed figures in the units of each row, shape (rows, entries).
    - `metric`: the same in metres, shape (rows, entries).
    - `steps`: iterations of each row.
    - `failures`: messages of the rows that could not be solved.
    """

    printed: PrintedTable
    entries: tuple[str, ...]
    groups: dict[str, slice]
    values: np.ndarray
    metric: np.ndarray
    steps: np.ndarray
    failures: tuple[str, ...]

    def rows(self) -> list[dict[str, float | list[float]]]:
        """One dictionary for each row, with full precision."""
        return [
            {
                "u": float(case.u),
                self.printed.start: float(case.start),
                **{name: values[columns].tolist() for name, columns in self.groups.items()},
            }
            for case, values in zip(self.printed.rows, self.values, strict=True)
        ]


def tables() -> dict[str, list[dict[str, float | list[float]]]]:
    """Tables 2, 3 and 4 as computed, in the precision that JAX is set to.

    Every row holds `u`, `h` or `x0`, `linear` and `angular` accelerations, multipliers `forces` and
    `moments`, and in Tables 3 and 4 the friction moments `tau`, all in the units of the row.
    """
    return {key: table(key).rows() for key in TABLES}


def table(key: str) -> Table:
    """Compute "table2", "table3" or "table4"."""
    printed = TABLES[key]
    solutions = [_solve(key, float(row.u), float(row.start)) for row in printed.rows]
    values = np.stack([np.concatenate(_figures(solution)) for solution in solutions])
    mechanism = wojtyra2020(mu_rho=None if key == "table2" else MU_RHO)
    return Table(
        printed,
        mechanism.names.unknowns.labels,
        _groups(mechanism),
        values,
        values / np.stack([_unit_factors(mechanism, row.u) for row in printed.rows]),
        np.stack([solution.stats.steps for solution in solutions]),
        failures([printed.case(row) for row in range(len(printed.rows))], solutions),
    )


def with_guide_moment(
    u: Sequence[float], moment: Float[np.ndarray, " rows"]
) -> tuple[Float[np.ndarray, "rows entries"], Float[np.ndarray, "rows entries"], list[Solution]]:
    """The frictional solutions whose moment in guide K has the given value, and their derivative by it.

    Compliance and misfit in the row of that moment alone say: W lam = d, that is lam_K = moment. So the
    moment is a coordinate on the one-parameter set of solutions. The derivative is that along the self-stress, by
    which friction changes, relative to its change of the moment.
    """

    def one(u: float, moment: float) -> tuple[np.ndarray, np.ndarray, Solution]:
        mechanism = wojtyra2020(u=u, mu_rho=MU_RHO)
        state = mechanism.state(phi=PHI, rate=RATE)
        n, guide = len(mechanism.coordinates), mechanism.rows.labels.index("K.angle")
        row = 1e-6 * np.eye(len(mechanism.rows))[guide]  # rad/(N m): of any size
        factor, closure = factorize_dense(mechanism, state), Compliance(row, misfit=moment * row)
        solution = solve(mechanism, state, closure=closure, factor=factor, throw=False)
        stress = np.asarray(factor.split.stress)[:, [guide]] / np.asarray(factor.row_scale)[:, None]
        chosen = elasticity(closure, mechanism, state)
        own = family(mechanism, state, factor, chosen, stress, solution, lambda: np.zeros(0), None)
        along = np.concatenate([own.response @ own.slope, own.slope])
        along[n : n + len(row)] += stress
        return np.concatenate(_figures(solution)), along[:, 0] / along[n + guide], solution

    values, slope, solutions = zip(*map(one, u, moment), strict=True)
    return np.stack(values), np.stack(slope), list(solutions)


def failures(cases: Sequence[str], solutions: Sequence[Solution]) -> tuple[str, ...]:
    """A message for each solution that failed."""
    ended = zip(cases, (solution.result for solution in solutions), strict=True)
    return tuple(f"{case}: {RESULTS[result]}" for case, result in ended if not is_one_of(result, RESULTS.successful))


def _solve(key: str, u: float, start: float) -> Solution:
    """Of a row, from its h or x0."""
    mechanism = wojtyra2020(u=u, mu_rho=None if key == "table2" else MU_RHO)
    state = mechanism.state(phi=PHI, rate=RATE)
    if key == "table4":
        return solve(mechanism, state, closure=None, solver=Newton(), x0=start, throw=False)
    solver = Newton() if key == "table2" else FixedPoint()
    return solve(mechanism, state, closure=MinimumNorm(start), solver=solver, throw=False)


def _figures(solution: Solution) -> tuple[Array, Array, Array]:
    return solution.acceleration, solution.multipliers, solution.friction


def _groups(mechanism: Mechanism) -> dict[str, slice]:
    """Columns of each kind; linear stands before angular, force before moment."""
    groups, start = {}, 0
    for names, axis in ((("linear", "angular"), mechanism.coordinates), (("forces", "moments"), mechanism.rows)):
        for name, count in zip(names, (np.sum(~axis.angular), np.sum(axis.angular)), strict=True):
            groups[name] = slice(start, start + int(count))
            start += int(count)
    slips = sum(len(group.slips) for group in mechanism.friction)
    return {**groups, "tau": slice(start, start + slips)} if slips else groups


def _unit_factors(mechanism: Mechanism, u: float) -> np.ndarray:
    """How much each entry grows by the change of the length unit, Eq. (16)."""
    units = Units(length=u)
    return np.concatenate(
        [
            units.of(mechanism.coordinates),
            units.of_force(mechanism.rows),
            *(units.of_force(group.slips) for group in mechanism.friction),
        ]
    )
