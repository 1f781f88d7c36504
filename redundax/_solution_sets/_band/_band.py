"""Bands: the smallest and the largest value of outputs under what is known of preload, misfit or compliance.

    min and max of y = Y [qdd; lam; tau]   over all solutions of (25) whose self-stress is possible

`_bounds` says what is possible and `_extremes` finds the extremes: exactly where friction does not depend on the
self-stress, else by a search, whose result lies inside the true band: no outer bound is known there. Where joints rest,
their friction is any within its limits, and `_loads_at_rest` finds inner and outer bounds.
"""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from jax.typing import ArrayLike

from ..._analysis._analyze import Report
from ..._analysis._outputs import plain
from ..._closures._closure import AbstractClosure, constant, elasticity
from ..._closures._play import without_play
from ..._equations._culprits import culprits
from ..._equations._factorisation import Factorisation
from ..._solve._all_solutions import start_factors
from ..._solve._solve import solve
from ..._system._export import bands_dataset
from ..._system._names import ByName, senses, unit_of
from ..._system._pushing import changing, in_words, pulling
from ..._system._results import RESULTS
from ..._system._state import State
from ..._system._system import AbstractSystem, check_system_at
from ..._system._units import with_unit
from ..._tools._errors import NoSolutionError, RedundaxError
from ..._tools._json import JSON
from ..._tools._module import check_seed, check_whole, finite, replace_fields
from ..._tools._questions import question
from ..._tools._table import figures, group, page, text_of
from .._at_rest import is_still, sense_of_start
from .._bounds import (
    AbstractBounds,
    Box,
    MisfitBox,
    Parameters,
    Pushing,
    cases_of,
    check_definite,
    checked_bounds,
    misfits_of,
    parts_of,
    title_of,
)
from .._cases import AbstractCases, Affine
from .._extremes import Ends
from .._family._solution_family import solutions_of
from .._loads_at_rest._band_at_rest import bands_at_rest
from .._pushing import Held, analyzed
from .._search import Search, best, few, proved_single
from .._solution_set import SolutionSet, solution_set
from ._one_by_one import one_by_one, searched, with_contacts
from ._wanted import Wanted, check_values, wanted_outputs
from ._with_play import SidesOfJoints, joints_of

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclasses.dataclass(frozen=True)
class Bands:
    """Smallest and largest values of outputs under bounds.

    `str()` gives a table, `to_dict()`, `to_pandas()` and `to_xarray()` data.

    - `names`, `kinds`: of the outputs; kinds are "linear", "angular", "force", "moment", "friction force" and
      "friction moment".
    - `units`: of the outputs, as in "m/s²"; "" where the system states none.
    - `lower`, `upper`: the bands, shape (outputs,); NaN where no solution within the bounds was found, or `nodes` were
      too few to find that end; infinite at rest where joints wedge themselves: their friction then holds any loads that
      it causes.
    - `exact`: which bands are proved, shape (outputs,); the others are inner bounds: their ends are attained, more may
      be. More `samples` and `starts`, or `nodes` at rest, search better.
    - `outer_lower`, `outer_upper`: outer bounds, proved not to be exceeded, shape (outputs,); infinite where none is
      known.
    - `bounds`: what was bounded: the name of the class.
    - `parameters`, `box`: names of the entries of a case, and their bounds, shape (q, 2).
    - `lower_case`, `upper_case`: the case that attains each extreme: amplitude, preload, misfit, compliance or play,
      shape (outputs, q).
    - `lower_solution`, `upper_solution`: [qdd; lam; tau] there, shape (outputs, n + m + p).
    - `solved`: share of the cases looked at that have a solution; below 1 some of what the bounds allow is impossible
      at this state, as past a fold of friction.
    - `sense`: of each slip, 1 or -1, and 0 where it rests, shape (p,).
    - `title`: all that was bounded, in words.
    - `stands`: where joints with friction rest, whether they may stay at rest: "yes", "no" (proved), "undecided",
      or "slips", where others move and those that rest may not go on to, but which way they slip is not known; None
      where all slip.
    - `pulling`: names of the rows of teeth that pull in some of what is possible: their other flanks touch there.

    ??? example

        ```python
        bands = rx.band(mechanism, state, "A.x", rx.AmplitudeBox({"A.x": (-40.0, 40.0)}))
        bands.lower, bands.upper, bands.exact  # shape (1,)
        ```
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    units: tuple[str, ...]
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
    outer_lower: np.ndarray
    outer_upper: np.ndarray
    sense: np.ndarray
    title: str
    stands: str | None = None
    pulling: tuple[str, ...] = ()

    @property
    def empty(self) -> bool:
        """Whether no solution within the bounds was found."""
        return bool(np.isnan([self.lower, self.upper]).all())

    def to_pandas(self) -> "pandas.DataFrame":
        """One row for each output, with its unit; needs pandas, of the extra `study`."""
        return self.to_xarray().to_dataframe()

    def to_xarray(self) -> "xarray.Dataset":
        """The bands along "output", with kinds and units beside; needs xarray, of the extra `study`."""
        return bands_dataset(self, ("output",), {})

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data; figures that were not found become None."""
        return {name: plain(getattr(self, name)) for name in (*(x.name for x in dataclasses.fields(self)), "empty")}

    def __str__(self) -> str:
        labels = [with_unit(name, unit) for name, unit in zip(self.names, self.units, strict=True)]
        lines = [self.title]
        if self.stands is not None:
            lines.append(_STANDS[self.stands])
        if self.empty and not np.isfinite([self.outer_lower, self.outer_upper]).any():
            return text_of(lines if self.stands is not None else [*lines, _EMPTY])
        if self.solved < 1:
            lines.append(f"NO SOLUTION for {1 - self.solved:.0%} of the cases looked at.")
        ends = [figures(end, np.stack([self.lower, self.upper])) for end in (self.lower, self.upper)]
        rows = group(
            ("", f"{'least':>14}", f"{'largest':>12}", ""), labels, *ends, [*map(self._kind, range(len(labels)))]
        )
        lines += page([rows._replace(sides="<>><")], [], "All of them: bands.to_pandas()")
        endless = np.isinf(self.lower) | np.isinf(self.upper)
        if np.any(endless) and self.bounds == Pushing.__name__:
            lines.append("Without end: that contacts push does not bound these. Give bounds of preload, or stiffness.")
        elif np.any(endless):
            lines.append("Without end: friction grows with the loads that it causes, so that joints wedge themselves.")
        if np.any((np.isinf(self.outer_lower) | np.isinf(self.outer_upper)) & ~self.exact & ~endless):
            lines.append("Inner estimates: all within is attained, more may be: no outer bound is known.")
        if self.pulling:
            lines.append(f"{changing(self.pulling)} within these bands: {in_words(self.pulling)}")
        return text_of(lines)

    def _kind(self, k: int) -> str:
        if self.exact[k]:
            return "exact"
        found = "not found" if np.isnan([self.lower[k], self.upper[k]]).any() else "inner"
        if np.isinf(self.outer_lower[k]) or np.isinf(self.outer_upper[k]):
            return found if found == "not found" else "inner estimate"
        return f"{found}; outer {self.outer_lower[k]:.6g} to {self.outer_upper[k]:.6g} (proved)"


class Effort(NamedTuple):
    """How long bands are looked for, as in `band`."""

    samples: int
    starts: int
    seed: int
    nodes: int


def effort_of(samples: int, starts: int, seed: int, nodes: int) -> Effort:
    """The same, checked."""
    check_whole(0, samples=samples, starts=starts)
    check_seed(seed)
    check_whole(1, nodes=nodes)
    return Effort(samples, starts, seed, nodes)


_EMPTY = "NO SOLUTION within the bounds was found."
_STANDS = {
    "yes": "At rest: it can stand so, held by friction within its limits.",
    "no": "CANNOT STAND (proved): no friction within its limits holds it.",
    "slips": "NO SOLUTION with the joints that rest held at rest: they begin to slip. Give their `sense`.",
    "undecided": "UNDECIDED whether it can stand: it is at its limit, as far as rounding tells, or the search ended.",
}
_MEET = 1e-6  # distance of inner and outer bounds that is none, relative to the largest value


@question
def band(
    system: AbstractSystem,
    state: State,
    outputs: Sequence[str] | str | None,
    bounds: AbstractBounds | AbstractClosure | None = None,
    *,
    samples: int = 256,
    starts: int = 8,
    seed: int = 0,
    nodes: int = 400,
    sense: ByName | None = None,
    rank: ArrayLike | None = None,
    factor: Factorisation | None = None,
) -> Bands:
    """Smallest and largest values of outputs under what is known of preload, misfit or compliance.

    Where joints with friction rest, the bands are over all friction within its limits that lets them rest: what the
    joints may carry while the mechanism stands. They come as inner bounds, which are attained, and outer ones, which
    are proved, for friction proportional to loads as that of the models here; see `Bands`.

    ??? example

        ```python
        bands = rx.band(mechanism, state, ["1.phi''", "A.x"], rx.AmplitudeBox({"A.x": (-40.0, 40.0)}))
        print(bands)
        rest = mechanism.state(phi=0.8, rate=0.0)
        print(rx.band(mechanism, rest, ["A.x", "tau A"], rx.AmplitudeBox({"A.x": (-40.0, 40.0)})))
        ```

    **Arguments:**

    - `system`, `state`: concrete values; not inside `jit` or `vmap`.
    - `outputs`: names: "coordinate''" of accelerations, rows of multipliers, "tau slip" of friction and, for a
      `Mechanism`, "K.travel''" of joint coordinates and those of `analyze(...).verdicts["reaction"]`; None for all
      accelerations of coordinates.
    - `bounds`: `AmplitudeBox`, `PreloadBox`, `PreloadNorm`, `MisfitBox` or `ComplianceBox`; or a closure, for the
      loads that it picks. Joints of either that have play have any from none to as much, where none with friction rest.
      With one-sided contacts it may be left out: they push, which bounds much by itself. With these nothing with
      friction may move; at rest it is asked of those too that a motion would lift.
    - `samples`: random cases that are looked at where the band is not exact, beside vertices; an eighth of them where
      each is solved by itself, as joints with friction have play, or it is known within limits: a second or two.
    - `starts`, `seed`: random initial loads for each of them, where the number of solutions is not proved.
    - `nodes`: linear programmes at most for each extreme at rest, or with play; a few times as many where sleeves,
      balls or plates rest, which can take tens of seconds, and where pins have play.
    - `sense`, `rank`, `factor`: as in `solve`; joints at rest that are given a sense begin to slip. Contacts take
      neither `rank` nor `factor`.

    **Raises:** as `solution_family`; `ValueError` where bounds or outputs do not fit the system.
    """
    check_system_at(system, state)
    effort, bounds = effort_of(samples, starts, seed, nodes), checked_bounds(bounds, system)
    return bands_of(asked_at(system, state, outputs, effort, sense, rank, factor), bounds)


class Asked(NamedTuple):
    """What bands are asked of: the system as it is and with the contacts that are closed, its report, the state, names
    of outputs, senses of slip, and how long to look."""

    whole: AbstractSystem
    at: Held
    report: Report
    state: State
    outputs: Sequence[str] | str | None
    sense: ByName | None
    effort: Effort


def asked_at(
    system: AbstractSystem,
    state: State,
    outputs: Sequence[str] | str | None,
    effort: Effort,
    sense: ByName | None,
    rank: ArrayLike | None,
    factor: Factorisation | None,
) -> Asked:
    """The same; where no senses are given those in which drives, or the motion that goes on, start what rests."""
    at, report = analyzed(system, state, rank, factor, sense=sense)
    if sense is None and report.at_rest and system.friction:
        sense = sense_of_start(at.system, state, at.factor)
        own = None if report.contacts else at.factor
        at, report = (at, report) if sense is None else analyzed(system, state, rank, own, sense=sense)
    return Asked(system, at, report, state, outputs, sense, effort)


def bands_of(asked: Asked, bounds: AbstractBounds | AbstractClosure) -> Bands:
    """`band`, given what it is asked of."""
    system, at, report, state, _, sense, effort = asked
    closure, rubbing = parts_of(bounds)
    if rubbing and not system.friction:
        raise RedundaxError("Argument `bounds` must hold no `friction` where no joint has any. Give joints some first.")
    play = None if closure is None or not report.pivots else closure.clearances(system)
    if play is not None and not isinstance(bounds, AbstractClosure | MisfitBox):
        raise RedundaxError(
            f"Argument `bounds` must have no play in a {type(bounds).__name__}: what joints may carry is known for one "
            "compliance at a time there. Give the closure itself, or a `MisfitBox` of it."
        )
    has_sides = play is not None or at.pushing or (isinstance(bounds, MisfitBox) and bounds.radial)
    of_joints = report.pivots and not system.friction and has_sides
    if of_joints and isinstance(bounds, AbstractClosure | MisfitBox):
        return _of_joints(asked, bounds)
    bounds = bounds if report.pivots else without_play(bounds)
    if system.friction and play is not None and report.at_rest:
        raise RedundaxError(
            "Argument `bounds` must have no play where joints with friction rest: what they may carry there is known "
            "for one play at a time. Leave such states out, or give `sense`, with which they begin to slip."
        )
    if rubbing and report.at_rest:
        asked = asked._replace(at=_at_most(at, state, rubbing, sense))
    whole, (system, factor, _) = system, asked.at
    moves = report.contacts and system.friction and not report.at_rest and not report.problem
    if moves and not isinstance(bounds, AbstractClosure | MisfitBox):
        if sense is None and is_still(system, state, factor):
            at, report = analyzed(whole, state, None, None, lifting=True)
            return _at_rest(asked._replace(at=at, report=report), bounds)
        _refuse_moving(bounds)
    if (report.at_rest or report.contacts) and not moves:
        return _at_rest(asked, bounds)
    if moves or rubbing or (system.friction and play is not None):
        return _by_solving(asked, cast(Any, bounds))
    samples, starts, seed, _ = effort
    solutions, wanted = _moving(asked)
    matrix, unique = wanted.matrix, wanted.unique
    if not report.pivots and report.undetermined:
        raise RedundaxError(
            "Argument `state` must be one with a self-stress that lasts beside it, but is at a singular position where "
            "all vanishes: its accelerations are unique, and the loads that it touches have no value. Use `solve`."
        )
    cases = cases_of(bounds, system, state, report, solutions)
    proved = proved_single(solutions, cases, report)
    exact_way = proved and not report.friction_reads and (isinstance(cases, Affine) or few(cases))
    search = Search(solutions, cases, start_factors(solutions.rows.size, 0 if proved else starts, seed))
    if exact_way:
        pairs = search.exactly(matrix, unique)
    else:
        found = search.found(matrix, unique, samples, seed)
        pairs = best(found, matrix, unique, 1.0), best(found, matrix, unique, -1.0)
    exact = (unique | exact_way) & ~np.isnan(pairs[0][0])
    ends = [
        Ends(value, np.where(exact, value, none), cases.figures(theta), solutions.shown(at))
        for none, (value, theta, at) in zip((-np.inf, np.inf), pairs, strict=True)
    ]
    return _bands(system, wanted, (bounds, cases), solutions, ends, exact, solved=search.solved)


def _moving(asked: Asked) -> tuple[SolutionSet, Wanted]:
    """All solutions where joints move, and the outputs, which have values there."""
    _, (system, factor, _), report, state, outputs, sense, _ = asked
    solutions = solutions_of(system, state, factor, report, sense)
    wanted = wanted_outputs(system, state, outputs, report)
    check_values(wanted.names, wanted.matrix, solutions)
    return solutions, wanted


def _refuse_moving(bounds: AbstractBounds) -> None:
    but = "left out" if isinstance(bounds, Pushing) else f"a {type(bounds).__name__}"
    raise RedundaxError(
        "Argument `bounds` must be a closure or a `MisfitBox` where one-sided contacts stand beside joints with "
        f"friction that move, but is {but}. Or give the contacts that carry as joints."
    )


def _of_joints(asked: Asked, bounds: AbstractClosure | MisfitBox) -> Bands:
    """The bands of elastic joints that have play or push, without friction."""
    whole, (system, factor, pushing), report, state, outputs, _, effort = asked
    if report.problem:
        raise NoSolutionError(report.problem)
    solutions = solution_set(system, state, factor, report.self_stress, None)
    if solutions.undetermined is not None:
        raise NoSolutionError(RESULTS[RESULTS.singular_position])
    wanted = wanted_outputs(system, state, outputs, report)
    closure = cast(AbstractClosure, parts_of(bounds)[0])
    elastic = elasticity(closure, system, state, play=True)
    finite("misfit", elastic.misfit, "the closure")
    misfits = misfits_of(bounds, report.rows, elastic.misfit)
    check_definite(solutions.stress.T @ elastic.compliance @ solutions.stress)
    free = solutions.response.free
    joints = joints_of(free.multipliers, solutions.stress, elastic, misfits, closure.clearances(system), pushing)

    def attained(misfits: np.ndarray, plays: np.ndarray) -> np.ndarray:
        own = constant(joints.elasticity_at(misfits), joints.play_of(plays))
        return np.asarray(solve(whole, state, closure=own, throw=False).multipliers)

    sides, n, m = SidesOfJoints(joints, attained, effort.nodes), len(free.acceleration), len(free.multipliers)
    base, ends = wanted.matrix[:, :n] @ free.acceleration, []
    for sign in (-1.0, 1.0):
        own = [sides.extreme(sign * row[n : n + m]) for row in wanted.matrix]
        value, bound = (base + sign * np.array([getattr(end, name) for end in own]) for name in ("value", "bound"))
        at = np.stack([np.r_[free.acceleration, end.multipliers] for end in own])
        ends.append(Ends(np.where(np.isfinite(value), value, np.nan), bound, np.stack([end.case for end in own]), at))
    limits = bounds, joints.parameters(report.rows)
    return _bands(system, wanted, limits, solutions, ends, _met(*ends), solved=1.0)


def _at_most(at: Held, state: State, friction: Box, sense: ByName | None) -> Held:
    """Where joints rest, their friction is all within the largest limits."""
    if sense is not None or not is_still(at.system, state, at.factor):
        raise RedundaxError(
            "Argument `bounds` must hold no `friction` where some joints with friction rest and others move. Leave "
            "such states out, or give `sense` to those that rest, with which they begin to slip."
        )
    return at._replace(system=at.system.rubbing({name: most for name, (_, most) in friction.items()}))


def _by_solving(asked: Asked, bounds: AbstractClosure | MisfitBox) -> Bands:
    """The bands of joints that move with friction, have play, or friction within limits, or stand beside contacts."""
    whole, (system, factor, _), report, state, _, sense, effort = asked
    solutions, wanted = _moving(asked)
    closure, rubbing = cast(tuple[AbstractClosure, Box], parts_of(bounds))
    elastic = elasticity(closure, system, state, play=True)
    misfits = misfits_of(bounds, report.rows, elastic.misfit)
    if misfits.discs:
        cases_of(bounds, system, state, report, solutions)  # which refuses them
    check_definite(solutions.stress.T @ elastic.compliance @ solutions.stress)
    given = solutions.response.free.multipliers, solutions.stress, elastic, misfits
    joints = joints_of(*given, closure.clearances(system) if report.pivots else None, ())
    names, ends = joints.parameters(report.rows)
    names = (*names, *(f"friction {name}" for name in rubbing))
    cases = Parameters(names, np.array([*ends, *rubbing.values()]).reshape(-1, 2))
    solved = with_contacts(whole, state, sense) if report.contacts else one_by_one(system, state, factor, sense)

    def attained(case: np.ndarray) -> np.ndarray:
        own, plays, factors = np.split(case, np.cumsum([len(misfits.rows), len(joints.played)]))
        return solved(dict(zip(rubbing, factors, strict=True)), joints.elasticity_at(own), joints.play_of(plays))

    *ends, share = searched(attained, cases.box, wanted.matrix, effort.samples, effort.seed)
    exact = wanted.unique & (not rubbing and not report.contacts) & np.isfinite(ends[0].value)
    ends = [end._replace(bound=np.where(exact, end.value, end.bound)) for end in ends]
    return _bands(system, wanted, (bounds, cases), solutions, ends, exact, solved=share)


def _at_rest(asked: Asked, bounds: AbstractBounds | AbstractClosure) -> Bands:
    """The bands of a mechanism whose joints rest, or some of them, or have no friction."""
    _, (system, factor, pushing), report, state, outputs, sense, effort = asked
    if report.problem:
        raise NoSolutionError(report.problem)
    still = is_still(system, state, factor)
    if still:
        state = replace_fields(state, memory=())  # bristles that bend let it move, so they do not count
    solutions = solution_set(system, state, factor, report.self_stress, senses(system.slips, sense))
    solutions = replace_fields(solutions, pushing=pushing)
    turns = np.where(system.slips.angular, np.asarray(factor.length), 1.0)
    if solutions.law is not None and np.any(factor.motion_of(solutions.law.rate * turns).is_undecided):
        raise NoSolutionError(RESULTS[RESULTS.ambiguous_rest] + culprits(system, state, factor, RESULTS.ambiguous_rest))
    if solutions.undetermined is not None:
        raise NoSolutionError(RESULTS[RESULTS.singular_position])
    wanted = wanted_outputs(system, state, outputs, report)
    within = bounds.of_misfits if isinstance(bounds, MisfitBox) else bounds
    cases = cases_of(within, system, state, report, solutions)
    *ends, stands = bands_at_rest(system, state, factor, solutions, cases, wanted.matrix, effort.nodes, wanted.asked)
    bands = _bands(system, wanted, (bounds, cases), solutions, ends, _met(*ends), solved=float(stands == "yes"))
    stands = "slips" if stands == "no" and not still else stands
    return dataclasses.replace(bands, stands=stands if system.friction else None)


def _met(lower: Ends, upper: Ends) -> np.ndarray:
    """Where inner and outer bounds of both ends are one, (outputs,)."""
    inner, outer = np.stack([lower.value, upper.value]), np.stack([lower.bound, upper.bound])
    size = np.abs(inner).max(axis=0)
    enough = _MEET * np.where((size > 0) & np.isfinite(size), size, 1.0)
    with np.errstate(invalid="ignore"):  # of two infinite ends
        return np.where(inner == outer, 0.0, np.abs(outer - inner)).max(axis=0) <= enough


def _bands(
    system: AbstractSystem,
    wanted: Wanted,
    limits: tuple[AbstractBounds | AbstractClosure, AbstractCases | Parameters],
    solutions: SolutionSet,
    ends: Sequence[Ends],
    exact: np.ndarray,
    *,
    solved: float,
) -> Bands:
    """The bands of the outputs alone; those of the teeth, which come after them, tell which of these pull."""
    (lower, upper), (bounds, cases), asked = ends, limits, slice(wanted.asked)
    n, m = len(system.coordinates), len(system.rows)
    values = [(part + wanted.offset)[asked] for part in (lower.value, upper.value, lower.bound, upper.bound)]
    return Bands(
        names=wanted.names[asked],
        kinds=wanted.kinds[asked],
        units=tuple(unit_of(kind, system.names.units) for kind in wanted.kinds[asked]),
        lower=values[0],
        upper=values[1],
        exact=exact[asked],
        bounds=type(bounds).__name__,
        parameters=cases.names,
        box=cases.box,
        lower_case=lower.case[asked],
        upper_case=upper.case[asked],
        lower_solution=lower.solution[asked],
        upper_solution=upper.solution[asked],
        solved=solved,
        outer_lower=values[2],
        outer_upper=values[3],
        sense=np.zeros(0) if solutions.law is None else np.asarray(solutions.law.sense),
        title=title_of(bounds, cases),
        pulling=pulling(system.names, np.concatenate([lower.solution, upper.solution])[:, n : n + m]),
    )
