"""Tables 2, 3 and 4 computed, each by one compiled call over all its rows.

The mechanism is built in the row's own length unit, so every row has the paper's numbers: accelerations
grow with u, forces with u, moments with u^2, and h and x0 are numbers in that unit.
"""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._bodies._mechanism import Mechanism
from .._closures._closure import AbstractClosure, Compliance, MinimumNorm
from .._solve._solution import Solution
from .._solve._solve import solve
from .._solvers._solver import AbstractSolver, FixedPoint, Newton
from .._system._results import RESULTS
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
    u = jnp.array([float(row.u) for row in printed.rows])
    start = jnp.array([float(row.start) for row in printed.rows])
    solutions = _SOLVED[key](u, start)
    values = np.concatenate([solutions.acceleration, solutions.multipliers, solutions.friction], axis=1)
    mechanism = wojtyra2020(mu_rho=None if key == "table2" else MU_RHO)
    return Table(
        printed,
        _entries(mechanism),
        _groups(mechanism),
        values,
        values / np.stack([_unit_factors(mechanism, row.u) for row in printed.rows]),
        np.asarray(solutions.stats.steps),
        failures([printed.case(row) for row in range(len(printed.rows))], solutions),
    )


@eqx.filter_jit
def with_guide_moment(
    u: Float[Array, " rows"], moment: Float[Array, " rows"]
) -> tuple[Float[Array, "rows entries"], Float[Array, "rows entries"], Solution]:
    """The frictional solutions whose moment in guide K has the given value, and their derivative by it.

    Compliance and misfit in the row of that moment alone say: W lam = d, that is lam_K = moment. So the
    moment is a coordinate on the one-parameter set of solutions.
    """

    def one(u: Array, moment: Array) -> tuple[Array, Array, Solution]:
        def figures(moment: Array) -> tuple[Array, Solution]:
            mechanism = wojtyra2020(u=u, mu_rho=MU_RHO)
            row = jnp.array([name == "K.angle" for name in mechanism.rows.labels], u.dtype)
            closure = Compliance(row, misfit=moment * row)
            solution = _solution(mechanism, closure, Newton())
            return jnp.concatenate([solution.acceleration, solution.multipliers, solution.friction]), solution

        return jax.jvp(figures, (moment,), (jnp.ones_like(moment),), has_aux=True)

    return jax.vmap(one)(u, moment)


def failures(cases: list[str], solutions: Solution) -> tuple[str, ...]:
    """A message for each row of a batch of solutions that failed."""
    failed = np.flatnonzero(np.asarray(solutions.result != RESULTS.successful)).tolist()
    results = [jax.tree.map(lambda x, row=row: x[row], solutions.result) for row in failed]
    return tuple(f"{cases[row]}: {RESULTS[result]}" for row, result in zip(failed, results, strict=True))


def _solution(
    mechanism: Mechanism,
    closure: AbstractClosure | None,
    solver: AbstractSolver,
    x0: Array | None = None,
) -> Solution:
    state = mechanism.state(phi=PHI, rate=RATE)
    return solve(mechanism, state, closure=closure, solver=solver, x0=x0)


@eqx.filter_jit
def _table2(u: Float[Array, " rows"], h: Float[Array, " rows"]) -> Solution:
    return jax.vmap(lambda u, h: _solution(wojtyra2020(u=u), MinimumNorm(h), Newton()))(u, h)


@eqx.filter_jit
def _table3(u: Float[Array, " rows"], h: Float[Array, " rows"]) -> Solution:
    def row(u: Array, h: Array) -> Solution:
        return _solution(wojtyra2020(u=u, mu_rho=MU_RHO), MinimumNorm(h), FixedPoint())

    return jax.vmap(row)(u, h)


@eqx.filter_jit
def _table4(u: Float[Array, " rows"], x0: Float[Array, " rows"]) -> Solution:
    def row(u: Array, x0: Array) -> Solution:
        return _solution(wojtyra2020(u=u, mu_rho=MU_RHO), None, Newton(), x0)

    return jax.vmap(row)(u, x0)


_SOLVED = {"table2": _table2, "table3": _table3, "table4": _table4}


def _entries(mechanism: Mechanism) -> tuple[str, ...]:
    accelerations = (f"{name}''" for name in mechanism.coordinates.labels)
    slips = (f"tau {name}" for group in mechanism.friction for name in group.slips.labels)
    return (*accelerations, *mechanism.rows.labels, *slips)


def _groups(mechanism: Mechanism) -> dict[str, slice]:
    """Columns of each kind; linear stands before angular, force before moment."""
    groups, start = {}, 0
    for names, axis in (
        (("linear", "angular"), mechanism.coordinates),
        (("forces", "moments"), mechanism.rows),
    ):
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
