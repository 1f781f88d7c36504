"""Bands: the smallest and the largest value of outputs under what is known of preload, misfit or compliance.

    min and max of y = Y [qdd; lam; tau]   over all solutions of (25) whose self-stress is possible

`_bounds` says what is possible and `_extremes` finds the extremes: exactly where friction does not depend on the
self-stress, else by a search, whose result lies inside the true band.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array

from .._analysis._analyze import Report, analyze
from .._analysis._outputs import outputs as named_outputs
from .._analysis._outputs import plain, unknowns
from .._analysis._verdict import Verdict, spectral_radius
from .._enumerate import start_factors
from .._friction import largest_changes
from .._module import Numbers
from .._state import State
from .._system import AbstractSystem
from ._bounds import AbstractBounds
from ._cases import AbstractCases, Affine, Fractional, corners
from ._descent import Found, improved, sampled
from ._extremes import linear_extreme, vertex_extremes
from ._solution_family import solutions_of
from ._solution_set import SolutionSet

_CORNERS = 8  # entries of a case up to which all vertices of the box are looked at
_VERTICES = 16  # compliances up to which all vertices are, where that is exact
_SEEDS = 3  # starts for each extreme
_BATCH = 32  # starts that are improved at once: one compiled program
_APART = 0.1  # least distance of starts, relative to the box


@dataclasses.dataclass(frozen=True)
class Bands:
    """Smallest and largest values of outputs under bounds. `str()` gives a table, `to_dict()` data.

    - `names`, `kinds`: of the outputs; kinds are "linear", "angular", "force", "moment", "friction force" and
      "friction moment".
    - `lower`, `upper`: the bands, shape (outputs,); NaN where no solution within the bounds was found.
    - `exact`: which bands are proved, shape (outputs,); the others are inner estimates: all within them is attained,
      and more may be.
    - `bounds`: what was bounded: the name of the class.
    - `parameters`, `box`: names of the entries of a case, and their bounds, shape (q, 2).
    - `lower_case`, `upper_case`: the case that attains each extreme: amplitude, preload, misfit or compliance, shape
      (outputs, q).
    - `lower_solution`, `upper_solution`: [qdd; lam; tau] there, shape (outputs, n + m + p).
    - `solved`: share of the cases looked at that have a solution; below 1 some of what the bounds allow is impossible
      at this state, as past a fold of friction.

    ??? example

        ```python
        bands = rx.band(mechanism, state, "A.x", rx.AmplitudeBox({"A.x": (-40.0, 40.0)}))
        bands.lower, bands.upper, bands.exact  # shape (1,)
        ```
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    exact: np.ndarray
    bounds: str
    parameters: tuple[str, ...]
    box: np.ndarray
    lower_case: np.ndarray
    upper_case: np.ndarray
    lower_solution: np.ndarray
    upper_solution: np.ndarray
    solved: float

    @property
    def title(self) -> str:
        """What was bounded, in words."""
        parts = [f"{name} {low:.4g} to {high:.4g}" for name, (low, high) in zip(self.parameters, self.box, strict=True)]
        return f"{self.bounds}: {', '.join(parts)}"

    @property
    def empty(self) -> bool:
        """Whether no solution within the bounds was found."""
        return bool(np.isnan(self.lower).any())

    def to_dict(self) -> dict[str, Any]:
        """Plain Python data; figures that were not found become None."""
        out = {field.name: plain(getattr(self, field.name)) for field in dataclasses.fields(self)}
        return {**out, "empty": self.empty}

    def __str__(self) -> str:
        size = max(len(name) for name in self.names) + 2
        lines = [self.title]
        if self.empty:
            lines.append("NO SOLUTION within the bounds was found.")
            return "\n".join(lines)
        if self.solved < 1:
            lines.append(f"NO SOLUTION for {1 - self.solved:.0%} of the cases looked at.")
        lines.append(f"{'':{size}}{'least':>14}{'largest':>14}")
        for k, name in enumerate(self.names):
            what = "exact" if self.exact[k] else "inner estimate"
            lines.append(f"{name:{size}}{self.lower[k]:14.6g}{self.upper[k]:14.6g}  {what}")
        return "\n".join(lines)


def band(
    system: AbstractSystem,
    state: State,
    outputs: Sequence[str] | str | None,
    bounds: AbstractBounds,
    *,
    samples: int = 256,
    starts: int = 8,
    seed: int = 0,
    sense: Numbers | None = None,
    rank: ArrayLike | None = None,
) -> Bands:
    """Smallest and largest values of outputs under what is known of preload, misfit or compliance.

    ??? example

        ```python
        bands = rx.band(mechanism, state, ["1.phi''", "A.x"], rx.AmplitudeBox({"A.x": (-40.0, 40.0)}))
        print(bands)
        ```

    **Arguments:**

    - `system`, `state`: concrete values; not inside `jit` or `vmap`.
    - `outputs`: names: "coordinate''" of accelerations, rows of multipliers, "tau slip" of friction and, for a
      `Mechanism`, those of `analyze(...).verdicts["reaction"]`; all accelerations if not given.
    - `bounds`: `AmplitudeBox`, `PreloadBox`, `PreloadNorm`, `MisfitBox` or `ComplianceBox`.
    - `samples`: random cases that are looked at where the band is not exact, beside vertices.
    - `starts`, `seed`: random initial loads for each of them, where the number of solutions is not proved.
    - `sense`, `rank`: as in `solve`.

    **Raises:** as `solution_family`; `ValueError` where bounds or outputs do not fit the system.
    """
    report = analyze(system, state, sense=sense, rank=rank)
    solutions = solutions_of(system, state, report, sense, rank)
    if not report.pivots:
        raise ValueError("Argument `system` must be overconstrained, but has no self-stress: its loads are unique.")
    names, kinds, matrix, unique = _wanted(system, state, outputs, report)
    cases = bounds.cases(system, state, report, solutions)
    proved = _proved(solutions, cases, report)
    exact_way = proved and not report.friction_reads and (isinstance(cases, Affine) or _few(cases))
    search = _Search(solutions, cases, start_factors(solutions.rows.size, 0 if proved else starts, seed))
    pairs = search.exactly(matrix, unique) if exact_way else search.inside(matrix, unique, samples, seed)
    lower, upper = (values for values, _, _ in pairs)
    return Bands(
        names=names,
        kinds=kinds,
        lower=lower,
        upper=upper,
        exact=unique | exact_way,
        bounds=type(bounds).__name__,
        parameters=cases.names,
        box=np.stack([cases.lower, cases.upper], axis=1),
        lower_case=pairs[0][1],
        upper_case=pairs[1][1],
        lower_solution=pairs[0][2],
        upper_solution=pairs[1][2],
        solved=search.solved,
    )


def _wanted(
    system: AbstractSystem, state: State, outputs: Sequence[str] | str | None, report: Report
) -> tuple[tuple[str, ...], tuple[str, ...], np.ndarray, np.ndarray]:
    """Names, kinds, coefficients and proved uniqueness of the outputs."""
    known = named_outputs(system, state)
    rows = {name: row for names, matrix in known.values() for name, row in zip(names, matrix, strict=True)}
    kinds = dict(zip(*unknowns(system), strict=True))
    kinds |= {name: "moment" if " moment on " in name else "force" for name in rows if name not in kinds}
    names = tuple(known["acceleration"][0] if outputs is None else [outputs] if isinstance(outputs, str) else outputs)
    unknown = [name for name in names if name not in rows]
    if unknown or not names:
        raise ValueError(
            f"Argument `outputs` must hold names of outputs, but holds {', '.join(unknown) or 'none'}. Accelerations "
            f"are like {next(iter(rows))!r}, multipliers {system.rows.labels[0]!r}; `analyze(...).verdicts` has all."
        )
    judged = {one.name: one.with_friction for group in report.verdicts.values() for one in group}
    unique = np.array([judged[name] is Verdict.UNIQUE for name in names])
    return names, tuple(kinds[name] for name in names), np.array([rows[name] for name in names]), unique


def _proved(solutions: SolutionSet, cases: AbstractCases, report: Report) -> bool:
    """Whether each case has one solution, by the spectral radius of its Gamma; see `_verdict`."""
    if solutions.law is None:
        return True
    if not isinstance(cases, Affine) and report.friction_reads:
        return False
    gain = cases.chosen(cases.lower)[1][solutions.rows]
    return spectral_radius(np.asarray(largest_changes(solutions.law.groups, gain))) < 1


def _few(cases: AbstractCases) -> bool:
    """Whether all vertices of the compliances that matter can be looked at."""
    return isinstance(cases, Fractional) and int(cases.matters.sum()) <= _VERTICES


_Extreme = tuple[np.ndarray, np.ndarray, np.ndarray]  # values (b,), cases (b, q), solutions (b, x)


class _Search:
    """The extremes of outputs over a set of cases."""

    def __init__(self, solutions: SolutionSet, cases: AbstractCases, factors: Array):
        self.solutions, self.cases, self.factors, self.solved = solutions, cases, factors, 1.0

    def exactly(self, matrix: np.ndarray, unique: np.ndarray) -> tuple[_Extreme, _Extreme]:
        """Where friction does not depend on the case; of unique outputs any case serves."""
        cases = self.cases
        tau = np.asarray(self._sampled(cases.lower[None]).tau[0])
        n, m = self.solutions.free.acceleration.size, self.solutions.stress.shape[0]
        out = []
        for sign in (1.0, -1.0):
            costs = sign * matrix[:, n : n + m]
            if isinstance(cases, Fractional):
                theta = vertex_extremes(cases, tau, costs)
            elif isinstance(cases, Affine):
                ends = [linear_extreme(cases, tau, cost) for cost in costs]
                theta = np.array([np.full(cases.lower.size, np.nan) if end is None else end for end in ends])
            else:
                raise TypeError(
                    f"Argument `cases` must be affine or fractional, but is {type(cases).__name__}. "
                    "Give what the method `cases` of bounds returns."
                )
            if out:
                theta = np.where(unique[:, None], out[0][1], theta)
            found = self._sampled(jnp.asarray(theta))
            out.append((np.sum(matrix * found.values, axis=1), theta, np.asarray(found.values)))
        return out[0], out[1]

    def _sampled(self, theta: Array) -> Found:
        """The first solution of each case, as NumPy arrays."""
        found = jax.device_get(sampled(self.solutions, self.cases, theta, self.factors[:0]))
        return Found(*(part[:, 0] for part in found))

    def inside(self, matrix: np.ndarray, unique: np.ndarray, samples: int, seed: int) -> tuple[_Extreme, _Extreme]:
        """The best of a search."""
        found = jax.device_get(sampled(self.solutions, self.cases, self._cases(samples, seed), self.factors))
        self.solved = float(np.mean(found.good.any(axis=1)))
        found = Found(*(part.reshape(-1, *part.shape[2:])[found.good.ravel()] for part in found))
        values = found.values @ matrix.T
        if not len(values):
            return self._best(found, matrix, unique, 1.0), self._best(found, matrix, unique, -1.0)
        spread, size = np.ptp(values, axis=0), np.abs(values).max(axis=0)
        moving = np.flatnonzero(~unique & (spread > 1e-12 * size))
        starts = []
        for k in moving:
            for cost in (1 / spread[k], -1 / spread[k]):
                starts += [(cost * matrix[k], start) for start in self._starts(found, cost * values[:, k])]
        better = self._improved(found, starts)
        whole = Found(*(np.concatenate(pair) for pair in zip(found, better, strict=True)))
        return self._best(whole, matrix, unique, 1.0), self._best(whole, matrix, unique, -1.0)

    def _cases(self, samples: int, seed: int) -> Array:
        """Middle and vertices of the box, and random cases."""
        lower, upper = self.cases.lower, self.cases.upper
        random, q = np.random.default_rng(seed), lower.size
        share = np.linspace(0.0, 1.0, samples)[:, None] if q == 1 else random.random((samples, q))
        ends = corners(self.cases) if q <= _CORNERS else jnp.where(random.random((2**_CORNERS, q)) < 0.5, lower, upper)
        return jnp.concatenate([((lower + upper) / 2)[None], ends, lower + jnp.asarray(share) * (upper - lower)])

    def _starts(self, found: Found, cost: np.ndarray) -> list[int]:
        """Solutions of little cost that lie apart, those within the limits first."""
        span = np.asarray(self.cases.upper - self.cases.lower)
        largest = np.abs(found.tau).max(axis=0, initial=0.0)
        place = np.concatenate(
            [found.theta / np.where(span > 0, span, 1.0), found.tau / np.where(largest > 0, largest, 1.0)], axis=1
        )
        chosen: list[int] = []
        for k in np.argsort(cost + 10 * np.maximum(found.excess, 0.0)):
            if all(np.abs(place[k] - place[other]).max() > _APART for other in chosen):
                chosen.append(int(k))
            if len(chosen) == _SEEDS:
                break
        return chosen

    def _improved(self, found: Found, starts: list[tuple[np.ndarray, int]]) -> Found:
        parts = [Found(*(part[:0] for part in found))]
        for first in range(0, len(starts), _BATCH):
            own = starts[first : first + _BATCH]
            padded = [*own, *(own[-1:] * (_BATCH - len(own)))]
            costs = jnp.asarray(np.array([cost for cost, _ in padded]))
            at = np.array([start for _, start in padded])
            theta, tau = jnp.asarray(found.theta[at]), jnp.asarray(found.tau[at])
            better = jax.device_get(improved(self.solutions, self.cases, costs, theta, tau))
            parts.append(Found(*(part[: len(own)] for part in better)))
        return Found(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def _best(self, found: Found, matrix: np.ndarray, unique: np.ndarray, sign: float) -> _Extreme:
        """Least (1) or largest (-1) value of each output over the solutions within the limits; any of unique ones."""
        within = Found(*(part[found.within()] for part in found))
        if not len(within.good):
            b = len(matrix)
            return np.full(b, np.nan), np.full((b, found.theta.shape[1]), np.nan), np.full((b, matrix.shape[1]), np.nan)
        values = within.values @ matrix.T
        best = np.where(unique, 0, np.argmin(sign * values, axis=0))
        least = values[best, np.arange(len(matrix))]
        return np.asarray(least), np.asarray(within.theta[best]), np.asarray(within.values[best])
