"""Every frictional solution at a state, as a function of the self-stress.

    lam = lam_0(tau) + z_1 s_1 + ... + z_k s_k,   tau = law(lam)                                   (9), (25)

The states s_i are the echelon rows of `analyze(...).self_stress`, each with the entry 1 at a multiplier of its own, so
that z_i is an amount of that multiplier; lam_0 is the pick of a closure, minimum norm unless said. Where Gamma has a
spectral radius below 1 each z has one solution (proved) and is solved for. Elsewhere there can be several or none:
every z is searched from many starts, and from each solution found the curve through it is followed both ways to the
neighbouring z (`_walk`), which finds the solutions that the search has missed, shows where curves fold, and joins
solutions to branches.
"""

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from jax.typing import ArrayLike

from ..._analysis._outputs import plain, sizes
from ..._analysis._report import Report
from ..._closures._closure import AbstractClosure, MinimumNorm, check_closure, elasticity
from ..._equations._culprits import culprits
from ..._equations._factorisation import Factorisation
from ..._solve._all_solutions import SEARCH_STARTS, start_factors
from ..._system._names import ByName, index_of, senses, unit_of
from ..._system._results import RESULTS
from ..._system._state import State
from ..._system._system import AbstractSystem, check_system_at
from ..._system._units import with_unit
from ..._tools._errors import NoSolutionError, RedundaxError
from ..._tools._json import JSON
from ..._tools._module import Numbers, as_float, check_callable, check_seed, check_whole, names_in, replace_fields
from ..._tools._numbers import computed
from ..._tools._questions import question
from ..._tools._table import text_of
from .._bounds import check_definite
from .._pushing import analyzed, pulling_rows
from .._solution_set import SolutionSet, solution_set
from ._branches import Branches, trace
from ._preload import in_words, preload

_MINIMUM_NORM = MinimumNorm()
_STARTS = 32  # of the search at each z, at least


@dataclasses.dataclass(frozen=True)
class SolutionFamily:
    """Frictional solutions along one or two self-stress states. `str()` gives a page, `to_dict()` data.

    - `along`: for each state the multiplier that has the entry 1, which `z` is an amount of.
    - `stress`: the states, shape (k, m).
    - `weights`, `offset`: z of multipliers lam is weights lam - offset, shapes (k, m) and (k,).
    - `about`: whose solution has no self-stress added: the closure in words.
    - `axes`: for each state the amplitudes looked at, in units of its multiplier.
    - `assumption`: what these amplitudes assume, in words; empty where they were given.
    - `count`: number of solutions found at each point of these axes.
    - `proved`: whether that number is proved, by a spectral radius of Gamma below 1, or the best of a search.
    - `z`: amplitudes of the solutions, shape (solutions, k).
    - `branch`: which connected piece each solution lies on, from 0; along one state the solutions of a piece stand in
      the order in which the curve passes through them.
    - `fold`: which solutions are those where the curve turns back; they lie between the amplitudes of `axes`, and are
      not counted.
    - `lost`: number of places where a curve could not be followed on, because it runs to infinity or has a corner.
    - `names`, `kinds`: of accelerations, multipliers and friction; kinds are "linear", "angular", "force", "moment",
      "friction force" and "friction moment".
    - `units`: of the same, as in "m/s²"; "" where the system states none.
    - `values`: shape (solutions, n + m + p); NaN for multipliers that have no value at a singular position.
    - `sizes`: what rounding of each is measured against, shape (n + m + p,): the largest value of its kind, friction
      among the loads, or a hundredth of the other kind's, times or over a length of the mechanism.

    ??? example

        ```python
        family = rx.solution_family(mechanism, state, along="A.x", samples=21)
        family["1.phi''"].min(), family["1.phi''"].max()  # rad/s^2
        family.count  # 1 at each of the 21 amplitudes
        ```
    """

    along: tuple[str, ...]
    stress: np.ndarray
    weights: np.ndarray
    offset: np.ndarray
    about: str
    axes: tuple[np.ndarray, ...]
    assumption: str
    count: np.ndarray
    proved: bool
    z: np.ndarray
    branch: np.ndarray
    fold: np.ndarray
    lost: int
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    sizes: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        """Values of one acceleration, multiplier or friction, shape (solutions,)."""
        return self.values[:, index_of("name", name, self.names)]

    @property
    def acceleration(self) -> np.ndarray:
        """qdd, shape (solutions, n)."""
        return self.values[:, : self._n]

    @property
    def multipliers(self) -> np.ndarray:
        """lam, shape (solutions, m)."""
        return self.values[:, self._n : self._n + self.stress.shape[1]]

    @property
    def friction(self) -> np.ndarray:
        """tau, shape (solutions, p)."""
        return self.values[:, self._n + self.stress.shape[1] :]

    @property
    def _n(self) -> int:
        return sum(kind in ("linear", "angular") for kind in self.kinds)

    @property
    def _amounts(self) -> list[str]:
        """Units of z."""
        return [self.units[self.names.index(name)] for name in self.along]

    def amplitude(self, multipliers: Numbers) -> np.ndarray:
        """z of solutions from elsewhere, shape (..., k), given their multipliers (..., m): where they lie here."""
        return np.asarray(multipliers) @ self.weights.T - self.offset

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data."""
        out = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {key: plain(value) for key, value in out.items()}

    def __str__(self) -> str:
        kinds = dict(zip(self.names, self.kinds, strict=True))
        where = " and ".join(
            f"{name}, a {kinds[name]}, from {axis[0]:.4g} to {axis[-1]:.4g} {unit}".rstrip()
            for name, axis, unit in zip(self.along, self.axes, self._amounts, strict=True)
        )
        lines = [f"Along the self-stress of {where} about {self.about}:" if where else "No self-stress:"]
        lines += [*([self.assumption] if self.assumption else []), self._counted()]
        if len(self.z):
            lines += self._table()
        return text_of(lines)

    def _counted(self) -> str:
        numbers, places = np.unique(self.count, return_counts=True)
        parts = [f"{number} at {place}" for number, place in zip(numbers, places, strict=True)]
        pieces = len(set(self.branch.tolist()))
        text = f"solutions {'(proved)' if self.proved else 'found'}: {', '.join(parts)} of {self.count.size} amplitudes"
        folds = ", ".join(
            "/".join(f"{x:.6g} {unit}".rstrip() for x, unit in zip(z, self._amounts, strict=True))
            for z in self.z[self.fold]
        )
        text += f"; {pieces} connected {'piece' if pieces == 1 else 'pieces'}" if pieces else ""
        text += f"; folds at {folds}" if folds else ""
        return text + (f"; lost at {self.lost} places" if self.lost else "")

    def _table(self) -> list[str]:
        labels = [with_unit(name, unit) for name, unit in zip(self.names, self.units, strict=True)]
        wide = max(map(len, labels)) + 2
        middle = int(np.argmin(np.linalg.norm(self.z, axis=1)))
        lines = [f"{'':{wide}}{'nearest 0':>13}{'least':>13}{'largest':>13}"]
        least, largest = self.values.min(axis=0), self.values.max(axis=0)
        for k, (label, size) in enumerate(zip(labels, self.sizes, strict=True)):
            same = largest[k] - least[k] <= 1e-9 * size
            word = "no value" if np.isnan(least[k]) else "the same" if same else "varies"
            figures = (self.values[middle, k], least[k], largest[k])
            row = "".join(f"{0.0 if abs(x) <= 1e-12 * size else x:13.6g}" for x in figures)
            lines.append(f"{label:{wide}}{row}  {word:8}  {self.kinds[k].removeprefix('friction ')}")
        return lines


@question
def solution_family(
    system: AbstractSystem,
    state: State,
    *,
    along: Sequence[str] | str | None = None,
    z: Numbers | Sequence[Numbers] | None = None,
    closure: AbstractClosure = _MINIMUM_NORM,
    samples: int = 201,
    starts: int | None = None,
    seed: int = 0,
    sense: ByName | None = None,
    rank: ArrayLike | None = None,
    factor: Factorisation | None = None,
    watch: Callable[[range], Iterable[int]] = iter,
) -> SolutionFamily:
    """Every frictional solution that is found along one or two self-stress states, and how many there are.

    ??? example

        ```python
        family = rx.solution_family(mechanism, state, along="A.x", samples=21)
        print(family)
        ```

    **Arguments:**

    - `system`, `state`: concrete values; not inside `jit` or `vmap`.
    - `along`: one or two self-stress states by the multiplier that has the entry 1 in them, see
      `analyze(...).pivots`; all if not given, which must then be at most two.
    - `z`: increasing amplitudes, in units of these multipliers: an array for one state, a sequence of two arrays for
      two. If not given, `samples` of them up to an assumed preload, the same in all units: self-stress as large as the
      largest joint load without friction, where a moment counts as a force at the length of its guide, or else at a
      length of the mechanism. It is no bound.
    - `closure`: whose solution has z = 0.
    - `samples`: number of amplitudes for one state; odd ones include 0. Two states share it: each has about its root.
    - `starts`: number of random initial loads for the search at each z, where the number of solutions is not proved;
      if not given 1000 in all, as in `frictional_solutions`, and at least 32, since walks from neighbours search too.
    - `seed`: of their random numbers.
    - `sense`, `rank`, `factor`: as in `solve`.
    - `watch`: passes the steps of the work on, one by one, and may tell how far it is.

    One-sided contacts are those that are closed and do not lift in the closure's solution; what is left are the
    solutions in which they push. Others, in which some of them lift, are not looked for.

    **Raises:** `RuntimeError` where the equations cannot be trusted at all, whatever the friction, or a joint is at
    rest, as `solve` does; `ValueError` for arguments that do not fit the system.
    """
    check_system_at(system, state)
    check_closure(closure)
    check_whole(1, samples=samples)
    check_whole(0, starts=0 if starts is None else starts)
    check_seed(seed)
    check_callable("watch", watch)
    (system, factor, pushing), report = analyzed(system, state, rank, factor, closure=closure, sense=sense)
    solutions = solutions_of(system, state, factor, report, sense, closure)
    solutions = replace_fields(solutions, pushing=pushing)
    known = _Known(system, state, factor, report, closure, solutions)
    return _family(known, _chosen(report, along), _Search(z, samples, starts, seed, watch))


@computed
def families_of(
    system: AbstractSystem,
    state: State,
    report: Report,
    factor: Factorisation,
    *,
    closure: AbstractClosure = _MINIMUM_NORM,
    z: Numbers | None = None,
    samples: int = 201,
    watch: Callable[[range], Iterable[int]] = iter,
) -> list[SolutionFamily]:
    """`solution_family` along each of the self-stress states of a report, which is that of the closure."""
    solutions = solutions_of(system, state, factor, report, None, closure)
    known, search = _Known(system, state, factor, report, closure, solutions), _Search(z, samples, None, 0, watch)
    return [_family(known, [number], search) for number in range(len(report.self_stress))]


class _Known(NamedTuple):
    """What does not depend on which states are looked along."""

    system: AbstractSystem
    state: State
    factor: Factorisation
    report: Report
    closure: AbstractClosure
    solutions: SolutionSet


class _Search(NamedTuple):
    """How to look along states, as in `solution_family`."""

    z: Numbers | Sequence[Numbers] | None
    samples: int
    starts: int | None
    seed: int
    watch: Callable[[range], Iterable[int]]


def _family(known: _Known, chosen: list[int], search: _Search) -> SolutionFamily:
    """The family along the states of a report that are chosen by number."""
    system, state, factor, report, closure, solutions = known
    stress = report.self_stress[chosen]
    if search.z is None:
        assumed = preload(system, factor, report.self_stress)
        axes, assumption = assumed.axes(stress, search.samples), str(assumed) if chosen else ""
    else:
        axes, assumption = _axes(stress, search.z), ""
    weights, offset = _measure(closure, system, state, stress)
    solutions = replace_fields(solutions, stress=stress.T)
    proved = report.spectral_radius is None or report.spectral_radius < 1
    starts = search.starts
    if starts is None:
        starts = max(_STARTS, -(-SEARCH_STARTS // math.prod(axis.size for axis in axes)))
    factors = start_factors(solutions.rows.size, 0 if proved else starts, search.seed)
    branches = trace(solutions, axes, factors, proved, search.watch)
    names, kinds = system.names.unknowns.labels, system.names.unknowns.kinds
    unknowns = solutions.along(branches.z), solutions.response.unit.multipliers, branches.tau
    branches, values = _that_push(solutions, axes, branches, solutions.shown(solutions.outputs(*unknowns)))
    return SolutionFamily(
        along=tuple(report.pivots[state] for state in chosen),
        stress=stress,
        weights=weights,
        offset=offset,
        about=in_words(closure),
        axes=axes,
        assumption=assumption,
        count=branches.count,
        proved=proved,
        z=branches.z,
        branch=branches.branch,
        fold=branches.fold,
        lost=branches.lost,
        names=names,
        kinds=kinds,
        units=tuple(unit_of(kind, system.names.units) for kind in kinds),
        values=values,
        sizes=sizes(np.nan_to_num(values).T, kinds, report.length).max(axis=1, initial=0.0),
    )


def solutions_of(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    report: Report,
    sense: ByName | None,
    closure: AbstractClosure = _MINIMUM_NORM,
) -> SolutionSet:
    """The set of solutions with all self-stress of a report; raises where there is a problem or a joint rests."""
    if report.problem:
        raise NoSolutionError(report.problem)
    if report.at_rest:
        result = RESULTS.friction_at_rest
        raise NoSolutionError(RESULTS[result] + culprits(system, state, factor, result))
    return solution_set(system, state, factor, report.self_stress, senses(system.slips, sense), closure)


def _chosen(report: Report, along: Sequence[str] | str | None) -> list[int]:
    pivots = report.pivots
    if along is None:
        if len(pivots) > 2:
            raise RedundaxError(
                f"Argument `along` must name one or two of the {len(pivots)} self-stress states, but is not given. "
                f"They are those of {', '.join(pivots)}."
            )
        return list(range(len(pivots)))
    along = names_in("along", along)
    places = [index_of("along", name, pivots, " of self-stress states, `analyze(...).pivots`") for name in along]
    if not 1 <= len(set(places)) == len(places) <= 2:
        raise RedundaxError(
            f"Argument `along` must name one or two different self-stress states, of {', '.join(pivots) or 'none'}, "
            f"but is {along}. Take them from `analyze(...).pivots`."
        )
    return places


def _measure(
    closure: AbstractClosure, system: AbstractSystem, state: State, stress: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """N^T (W lam - d) = N^T W N z solved for z: its coefficients of lam and its offset."""
    compliance, misfit = elasticity(closure, system, state)
    energy = stress @ compliance @ stress.T
    check_definite(energy)
    given = stress @ np.broadcast_to(misfit, len(compliance))
    return np.linalg.solve(energy, stress @ compliance), np.linalg.solve(energy, given)


def _axes(stress: np.ndarray, z: Numbers | Sequence[Numbers]) -> tuple[np.ndarray, ...]:
    axes = (z,) if len(stress) == 1 or not isinstance(z, Iterable) else tuple(z)
    if len(axes) != len(stress):
        raise RedundaxError(
            f"Argument `z` must hold one array for each of {len(stress)} states, but holds {len(axes)}. "
            "Give as many arrays, or name fewer states in `along`."
        )
    out = tuple(np.asarray(as_float(axis, "z"), float) for axis in axes)  # pyright: ignore[reportArgumentType]
    if any(axis.ndim != 1 or not axis.size or np.any(np.diff(axis) <= 0) for axis in out):
        raise RedundaxError(
            "Argument `z` must hold increasing amplitudes, but some do not increase. "
            "Sort them, and drop those that occur twice."
        )
    return out


def _that_push(
    solutions: SolutionSet, axes: tuple[np.ndarray, ...], branches: Branches, values: np.ndarray
) -> tuple[Branches, np.ndarray]:
    """The solutions in which no contact pulls, and their values."""
    n = solutions.response.free.acceleration.size
    pulls = pulling_rows(values[:, n : n + len(solutions.stress)], solutions.pushing).any(axis=1)
    if not pulls.any():
        return branches, values
    count = branches.count.copy()
    for z in branches.z[pulls & ~branches.fold]:
        count[tuple(int(np.argmin(np.abs(axis - own))) for axis, own in zip(axes, z, strict=True))] -= 1
    z, tau, branch, fold = (x[~pulls] for x in (branches.z, branches.tau, branches.branch, branches.fold))
    return Branches(count, z, tau, np.unique(branch, return_inverse=True)[1], fold, branches.lost), values[~pulls]
