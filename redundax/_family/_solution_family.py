"""Every frictional solution at a state, as a function of the self-stress.

    lam = lam_MP(tau) + z_1 s_1 + ... + z_k s_k,   tau = law(lam)                                  (9), (25)

The states s_i are the echelon rows of `analyze(...).self_stress`, each with the entry 1 at a multiplier of its own, so
that z_i is an amount of that multiplier. Where Gamma has a spectral radius below 1 each z has one solution (proved) and
is solved for. Elsewhere there can be several or none: every z is searched from many starts, and from each solution
found the curve through it is followed both ways to the neighbouring z (`_walk`), which finds the solutions that the
search has missed, shows where curves fold, and joins solutions to branches.
"""

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from .._analysis._analyze import Report, analyze
from .._analysis._outputs import plain, sizes, unknowns
from .._culprits import culprits
from .._enumerate import SEARCH_STARTS, start_factors
from .._friction import slip_kinds
from .._module import Numbers, as_float, replace
from .._results import RESULTS
from .._state import State
from .._system import AbstractSystem
from ._branches import Branches, trace
from ._solution_set import SolutionSet, solution_set

_STARTS = 32  # of the search at each z, at least


@dataclasses.dataclass(frozen=True)
class SolutionFamily:
    """Frictional solutions along one or two self-stress states. `str()` gives a page, `to_dict()` data.

    - `along`: for each state the multiplier that has the entry 1, which `z` is an amount of.
    - `stress`: the states, shape (k, m).
    - `axes`: for each state the amplitudes looked at, in units of its multiplier.
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
    - `values`: shape (solutions, n + m + p).
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
    axes: tuple[np.ndarray, ...]
    count: np.ndarray
    proved: bool
    z: np.ndarray
    branch: np.ndarray
    fold: np.ndarray
    lost: int
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    values: np.ndarray
    sizes: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        """Values of one acceleration, multiplier or friction, shape (solutions,)."""
        if name not in self.names:
            raise ValueError(
                f"Argument `name` must be one of {', '.join(self.names)}, but is {name!r}. "
                "Accelerations end in two primes, friction begins with tau."
            )
        return self.values[:, self.names.index(name)]

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

    def amplitude(self, multipliers: Numbers) -> np.ndarray:
        """z of solutions from elsewhere, shape (..., k), given their multipliers (..., m): where they lie here.

        It holds for minimum norm in the units of the system, whose solutions are orthogonal to the self-stress.
        """
        return np.linalg.lstsq(self.stress.T, np.asarray(multipliers).reshape(-1, self.stress.shape[1]).T)[0].T.reshape(
            *np.shape(multipliers)[:-1], len(self.stress)
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain Python data."""
        out = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {key: plain(value) for key, value in out.items()}

    def __str__(self) -> str:
        where = " and ".join(
            f"{name} from {axis[0]:.4g} to {axis[-1]:.4g}" for name, axis in zip(self.along, self.axes, strict=True)
        )
        lines = [f"Along the self-stress of {where} about the minimum norm:" if where else "No self-stress:"]
        lines.append(self._counted())
        if len(self.z):
            lines += self._table()
        return "\n".join(lines)

    def _counted(self) -> str:
        numbers, places = np.unique(self.count, return_counts=True)
        parts = [f"{number} at {place}" for number, place in zip(numbers, places, strict=True)]
        pieces = len(set(self.branch.tolist()))
        text = f"solutions {'(proved)' if self.proved else 'found'}: {', '.join(parts)} of {self.count.size} amplitudes"
        folds = ", ".join("/".join(f"{x:.6g}" for x in z) for z in self.z[self.fold])
        text += f"; {pieces} connected {'piece' if pieces == 1 else 'pieces'}" if pieces else ""
        text += f"; folds at {folds}" if folds else ""
        return text + (f"; lost at {self.lost} places" if self.lost else "")

    def _table(self) -> list[str]:
        wide = max(len(name) for name in self.names) + 2
        middle = int(np.argmin(np.linalg.norm(self.z, axis=1)))
        lines = [f"{'':{wide}}{'nearest 0':>14}{'least':>14}{'largest':>14}"]
        least, largest = self.values.min(axis=0), self.values.max(axis=0)
        for k, (name, size) in enumerate(zip(self.names, self.sizes, strict=True)):
            same = largest[k] - least[k] <= 1e-9 * size
            figures = (self.values[middle, k], least[k], largest[k])
            row = "".join(f"{x if abs(x) > 1e-12 * size else 0.0:14.6g}" for x in figures)
            lines.append(f"{name:{wide}}{row}  {'the same' if same else 'varies'}")
        return lines


def solution_family(
    system: AbstractSystem,
    state: State,
    *,
    along: Sequence[str] | str | None = None,
    z: Numbers | Sequence[Numbers] | None = None,
    samples: int = 201,
    starts: int | None = None,
    seed: int = 0,
    sense: Numbers | None = None,
    rank: ArrayLike | None = None,
    watch: Callable[[Sequence[Any]], Iterable[Any]] = iter,
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
      two; `samples` of them if not given, up to the largest multiplier at minimum norm over the largest entry of the
      state.
    - `samples`: number of amplitudes for one state; odd ones include 0. Two states share it: each has about its root.
    - `starts`: number of random initial loads for the search at each z, where the number of solutions is not proved;
      if not given 1000 in all, as in `frictional_solutions`, and at least 32, since walks from neighbours search too.
    - `seed`: of their random numbers.
    - `sense`, `rank`: as in `solve`.
    - `watch`: passes the steps of the work on, one by one, and may tell how far it is.

    **Raises:** `RuntimeError` where the equations cannot be trusted at all, whatever the friction, or a joint is at
    rest, as `solve` does; `ValueError` for arguments that do not fit the system.
    """
    report = analyze(system, state, sense=sense, rank=rank)
    solutions = solutions_of(system, state, report, sense, rank)
    chosen = _chosen(report, along)
    stress = report.self_stress[chosen]
    axes = _axes(np.asarray(solutions.free.multipliers), stress, z, samples)
    solutions = replace(solutions, stress=jnp.asarray(stress.T))
    proved = report.spectral_radius is None or report.spectral_radius < 1
    if starts is None:
        starts = max(_STARTS, -(-SEARCH_STARTS // math.prod(axis.size for axis in axes)))
    factors = start_factors(solutions.rows.size, 0 if proved else starts, seed)
    branches = trace(solutions, axes, factors, proved, watch)
    names, kinds = unknowns(system)
    values = _values(solutions, branches)
    return SolutionFamily(
        along=tuple(report.pivots[state] for state in chosen),
        stress=stress,
        axes=axes,
        count=branches.count,
        proved=proved,
        z=branches.z,
        branch=branches.branch,
        fold=branches.fold,
        lost=branches.lost,
        names=names,
        kinds=kinds,
        values=values,
        sizes=sizes(values.T, kinds, report.length).max(axis=1, initial=0.0),
    )


def solutions_of(
    system: AbstractSystem, state: State, report: Report, sense: Numbers | None, rank: ArrayLike | None
) -> SolutionSet:
    """The set of solutions with all self-stress of a report; raises where there is a problem or a joint rests."""
    if report.problem:
        raise RuntimeError(report.problem)
    if report.at_rest:
        result = RESULTS.friction_at_rest
        raise RuntimeError(RESULTS[result] + culprits(system, state, result))
    count = len(slip_kinds(system.friction))
    senses = None if sense is None else jnp.broadcast_to(as_float(sense), (count,))
    return solution_set(system, state, jnp.asarray(report.self_stress), senses, rank)


def _chosen(report: Report, along: Sequence[str] | str | None) -> list[int]:
    pivots = report.pivots
    if along is None:
        if len(pivots) > 2:
            raise ValueError(
                f"Argument `along` must name one or two of the {len(pivots)} self-stress states, but is not given. "
                f"They are those of {', '.join(pivots)}."
            )
        return list(range(len(pivots)))
    along = [along] if isinstance(along, str) else list(along)
    wrong = [name for name in along if name not in pivots]
    if wrong or not 1 <= len(set(along)) == len(along) <= 2:
        raise ValueError(
            f"Argument `along` must name one or two different self-stress states, of {', '.join(pivots) or 'none'}, "
            f"but is {along}. Take them from `analyze(...).pivots`."
        )
    return [pivots.index(name) for name in along]


def _axes(
    multipliers: np.ndarray, stress: np.ndarray, z: Numbers | Sequence[Numbers] | None, samples: int
) -> tuple[np.ndarray, ...]:
    if z is None:
        largest = float(np.abs(multipliers).max()) or 1.0
        each = samples if len(stress) == 1 else max(2, 2 * round(samples**0.5 / 2) + 1)
        return tuple(np.linspace(-1, 1, each) * largest / np.abs(row).max() for row in stress)
    axes = (z,) if len(stress) == 1 else tuple(z)  # pyright: ignore[reportArgumentType]
    if len(axes) != len(stress):
        raise ValueError(
            f"Argument `z` must hold one array for each of {len(stress)} states, but holds {len(axes)}. "
            "Give as many arrays, or name fewer states in `along`."
        )
    out = tuple(np.asarray(as_float(axis), float) for axis in axes)  # pyright: ignore[reportArgumentType]
    if any(axis.ndim != 1 or not axis.size or np.any(np.diff(axis) <= 0) for axis in out):
        raise ValueError(
            "Argument `z` must hold increasing amplitudes, but some do not increase. "
            "Sort them, and drop those that occur twice."
        )
    return out


def _values(solutions: SolutionSet, branches: Branches) -> np.ndarray:
    outputs = jax.vmap(lambda z, tau: solutions.outputs(solutions.along(z), solutions.unit.multipliers, tau))
    return np.asarray(outputs(jnp.asarray(branches.z), jnp.asarray(branches.tau)))
