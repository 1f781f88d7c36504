"""How much load it takes to move a mechanism at rest, and which joints give way.

    V^T (M a_0 + s b) + S^T tau = 0,   |tau_j| within limits that depend on the loads:   least and largest s

over all cases within bounds. What slips and lifts at an end: `_giving_way`.

Contacts that only push open where stiffness would have them pull (`_opening`). Where friction reads no load that is not
unique, there are loads of any stiffness wherever any equilibrium with contacts that push is: these alone decide.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import numpy as np
from jax.typing import ArrayLike

from ..._analysis._outputs import plain
from ..._bodies._loads import AbstractLoad
from ..._closures._closure import AbstractClosure, Elasticity, MinimumNorm, elasticity
from ..._equations._factorisation import Factorisation
from ..._equations._response import Response
from ..._system._names import ByName
from ..._system._pushing import changing, in_words, pulling
from ..._system._state import State
from ..._system._system import AbstractSystem, check_system_at
from ..._tools._errors import NoSolutionError, RedundaxError
from ..._tools._json import JSON
from ..._tools._module import check_whole, replace_fields
from ..._tools._numbers import Numeric, xp
from ..._tools._questions import question
from ..._tools._table import text_of
from ..._tools._waiting import telling_of
from .._at_rest import NONE, ReducedForce, drive, velocity_basis
from .._bounds import AbstractBounds, Pushing, cases_of, checked_bounds, title_of
from .._cases import AbstractCases
from .._pushing import analyzed
from .._solution_set import SolutionSet, solution_set
from ._added_load import added_load, load_in_words, named_load
from ._extreme import Extreme, LoadsAtRest
from ._friction_limits import sizes_of
from ._giving_way import giving_way
from ._opening import opening
from ._standing import AddedLoad, standing

_MINIMUM_NORM = MinimumNorm()
_FIRST, _MORE, _LAST = 4.0, 8.0, 1e6  # amounts that are looked at, relative to what friction without it holds
_REACHED = 0.99  # share of the amounts looked at from which their end counts as reached
_STEP, _LONGEST = 1e-6, 0.125  # beyond amounts known to be borne: the least, relative to these, and the largest
_HALVED = 12  # how often, to find how far a gap reaches
_GAPS = 6  # that are followed back, as a long step may pass a nearer one
_WHATEVER = "\nWhatever that is, contacts that only push decide alone here what stands"


@dataclasses.dataclass(frozen=True)
class LimitLoad:
    """How much of a load a mechanism at rest can bear, either way, in the most favourable case within the bounds.

    What it bears in every case is not here: `sticking` tells whether it must stand, under a load that is there. `str()`
    gives a page, `to_dict()` data.

    - `load`, `units`: the load of amount 1, by name of coordinate, and the units of its forces and moments.
    - `lower`, `upper`: how far the amount may fall, and rise, from the load that is there, or any that is borne where
      that is not, until it moves: attained. NaN where no amount was found to be borne, infinite where all that were
      looked at are, as of a mechanism that locks itself.
    - `outer_lower`, `outer_upper`: outer bounds: from them to `looked` it moves, proved, whatever the preload within
      the bounds; infinite where none is known.
    - `looked`: amounts up to which it was looked, either way. More may jam it, and hold it again.
    - `slips`: names of the joints that give way beyond each, a pair: those at their limit in all states with that load.
    - `motion`: with one degree of freedom how it starts to move there: velocities, of power 1 with the load, shape
      (2, n); with more the way that the load drives most; NaN where it drives none.
    - `case`: the case of each: amplitude, preload, misfit or compliance, shape (2, q).
    - `multipliers`, `friction`: the loads of each, shapes (2, m) and (2, p).
    - `bounds`, `parameters`, `box`: what was bounded, the names of the entries of a case, and their bounds, (q, 2).
      There are none, q = 0, where contacts that only push decide alone what stands.
    - `title`: all that was bounded, in words.
    - `pulling`: names of the rows of teeth that pull at an end: their other flanks are in contact there.
    - `lifts`, `carries`: names of the closed one-sided contacts that have no load left at each end, and of the others:
      it tips about these, where nothing slips.

    ??? example

        ```python
        rest = mechanism.state(phi=0.8, rate=0.0)
        found = rx.limit_load(mechanism, rest, {"1.phi": 1.0}, rx.AmplitudeBox({"A.x": (-400.0, 400.0)}))
        found.lower, found.upper, found.slips  # N m on the crank
        ```
    """

    load: dict[str, float]
    lower: float
    upper: float
    outer_lower: float
    outer_upper: float
    looked: tuple[float, float]
    slips: tuple[tuple[str, ...], tuple[str, ...]]
    motion: np.ndarray
    case: np.ndarray
    multipliers: np.ndarray
    friction: np.ndarray
    bounds: str
    parameters: tuple[str, ...]
    box: np.ndarray
    title: str
    units: tuple[str, ...] = ()
    pulling: tuple[str, ...] = ()
    lifts: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    carries: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data; infinities and NaN become None."""
        return {field.name: plain(getattr(self, field.name)) for field in dataclasses.fields(self)}

    def __str__(self) -> str:
        lines = [load_in_words(self.load, self.units), self.title]
        if np.isnan(self.lower) and np.isnan(self.upper):
            none = f"Stands with no amount from {self.looked[0]:.4g} to {self.looked[1]:.4g} found."
            return text_of([*lines, none])
        choice = "Can stand, in the most favourable case," if np.ptp(self.box, axis=-1).any() else "Stands"
        lines.append(f"{choice} with amounts from {self.lower:.6g} to {self.upper:.6g}")
        ends = (self.lower, self.outer_lower, "below"), (self.upper, self.outer_upper, "above")
        way = zip(ends, self.slips, self.lifts, self.carries, self.looked, strict=True)
        for (inner, outer, side), slips, lifts, carries, looked in way:
            if np.isinf(inner):
                lines.append(f"{side}: locks itself, as far as {looked:.4g}")
                continue
            proof = (
                f"moves in every case from {outer:.6g} as far as it was looked, {looked:.4g}, proved"
                if np.isfinite(outer)
                else "no outer bound is known"
            )
            tips = f"{', '.join(lifts)} lift{'s' * (len(lifts) == 1)}, about {', '.join(carries) or 'nothing'}"
            gives = f"{', '.join(slips) or 'what no friction holds'} give{'s' * (len(slips) < 2)} way"
            bare = f"{', '.join(lifts)} {'has' if len(lifts) == 1 else 'have'} no load left"
            told = [gives] * bool(slips or not lifts) + [bare if slips else tips] * bool(lifts)
            lines.append(f"{side}: {'; '.join(told)} ({proof})")
        if self.pulling:
            lines.append(f"{changing(self.pulling)} at an end: {in_words(self.pulling)}")
        return text_of(lines)


@question
def limit_load(
    system: AbstractSystem,
    state: State,
    load: ByName | AbstractLoad,
    bounds: AbstractBounds | AbstractClosure | None = None,
    *,
    nodes: int = 400,
    rank: ArrayLike | None = None,
    factor: Factorisation | None = None,
) -> LimitLoad:
    """How much of a load a mechanism at rest can bear before it moves, beside the loads that it has.

    Within bounds that is the most favourable case: beyond these amounts it moves whatever the preload. Give bounds of
    one value, or a closure, for one case.

    ??? example

        ```python
        rest = mechanism.state(phi=0.8, rate=0.0)
        print(rx.limit_load(mechanism, rest, rx.AppliedForce("1", moment=1.0)))  # multiples of 1 N m on the crank
        print(rx.limit_load(mechanism, rest, {"1.phi": 1.0}))  # the same
        ```

    **Arguments:**

    - `system`, `state`: concrete values, at rest; not inside `jit` or `vmap`.
    - `load`: an `AppliedForce` or another load of mechanisms as it is at the state; or generalised forces by name of
      coordinate, N or N m, or an array of shape (n,).
    - `bounds`: what is known of preload, misfit or compliance, as of `band`; or a closure, for the loads that it picks,
      `MinimumNorm()` if not given. With one-sided contacts that they push is enough: where stiffness would have one
      pull, it opens and the others take over. Where friction does not depend on how they share the load, bounds and
      closure do not matter, as of a table without friction. Where it does, 6 contacts at most are followed, by closures
      and `MisfitBox`, and bounds of loads hold for all amounts.
    - `nodes`: linear programmes at most for each end; a few times as many where sleeves, balls or plates rest,
      which can take tens of seconds.
    - `rank`, `factor`: as in `solve`.

    **Returns:** a `types.LimitLoad`.

    **Raises:** `ValueError` where the state moves or the load drives no motion; `RuntimeError` as `band`.
    """
    check_system_at(system, state)
    check_whole(1, nodes=nodes)
    bounds = checked_bounds(bounds, system, _MINIMUM_NORM)
    state, names = replace_fields(state, memory=()), system.names
    (system, factor, pushing), report = analyzed(system, state, rank, factor, lifting=True)
    if report.problem:
        raise NoSolutionError(report.problem)
    force = added_load(system, state, load)
    start, ways = drive(system, state, factor), velocity_basis(system, factor)
    own = force @ ways
    own = np.where(np.linalg.norm(own) > NONE * np.linalg.norm(force), own, 0.0)
    if not pushing and not own.any():
        raise RedundaxError(
            "Argument `load` must drive a motion that the joints leave, but does none. "
            "Name a coordinate that moves; what holds a locked mechanism is a multiplier, which `band` bounds."
        )
    solutions = _with_load(
        solution_set(system, state, factor, report.self_stress, None),
        _response(factor, elasticity(_MINIMUM_NORM, system, state), force),
    )
    solutions = replace_fields(solutions, pushing=pushing)
    cases = cases_of(bounds, system, state, report, solutions)
    title, parameters, box = title_of(bounds, cases), cases.names, cases.box
    if not pushing:
        all_cases = [cases]
    elif report.friction_reads:
        all_cases = opening(bounds, cases, system, state, solutions)
    else:
        title += "" if isinstance(bounds, Pushing) else _WHATEVER
        all_cases = [cases_of(Pushing(), system, state, report, solutions)]
        parameters, box = (), np.zeros((0, 2))  # no case matters
    given = AddedLoad(start, own, _scale(solutions, all_cases[0], start, own)), np.asarray(force)
    with telling_of(f"linear programmes, at most {nodes} for each range of amounts, as `nodes` says"):
        ends = [_end(sign, system, state, factor, solutions, all_cases, given, nodes) for sign in (-1.0, 1.0)]
    multipliers = np.stack([end.multipliers for end in ends])
    words = dict(zip(names.one_sided, names.contacts, strict=True))
    named, units = named_load(system, force)
    return LimitLoad(
        load=named,
        lower=ends[0].value,
        upper=ends[1].value,
        outer_lower=ends[0].bound,
        outer_upper=ends[1].bound,
        looked=(ends[0].looked, ends[1].looked),
        slips=(ends[0].slips, ends[1].slips),
        lifts=(_named(words, ends[0].lifts), _named(words, ends[1].lifts)),
        carries=(_named(words, ends[0].carries), _named(words, ends[1].carries)),
        motion=np.stack([end.motion for end in ends]),
        case=np.stack([end.case[: len(parameters)] for end in ends]),
        multipliers=multipliers,
        friction=np.stack([end.friction for end in ends]),
        bounds=type(bounds).__name__,
        parameters=parameters,
        box=box,
        title=title,
        units=units,
        pulling=pulling(system.names, multipliers),
    )


class _End(NamedTuple):
    """One end of the loads that are borne, as in `LimitLoad`."""

    value: float
    bound: float
    looked: float
    slips: tuple[str, ...]
    motion: np.ndarray
    case: np.ndarray
    multipliers: np.ndarray
    friction: np.ndarray
    lifts: tuple[int, ...] = ()
    carries: tuple[int, ...] = ()


def _named(names: dict[int, str], rows: tuple[int, ...]) -> tuple[str, ...]:
    return tuple(names[row] for row in rows)


def _end(
    sign: float,
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    solutions: SolutionSet,
    all_cases: Sequence[AbstractCases],
    given: tuple[AddedLoad, np.ndarray],
    nodes: int,
) -> _End:
    """The end of the amounts that are borne; they are looked at up to bounds that grow until none is reached."""
    (first, force), most = given, _FIRST
    start, empty = None, 0.0
    extreme, looked, at = Extreme(-np.inf, None, -np.inf), None, 0
    while True:
        added = first._replace(most=most * first.most)
        sets = [standing(system, state, factor, solutions, cases, added) for cases in all_cases]
        parts = [LoadsAtRest(part.programme, most=nodes) for part in sets]
        amounts = _Amounts(parts, sign)
        if start is None:
            some, none = amounts.start(empty / most)
            start, empty = None if some is None else most * some, most if none else empty
        if start is not None:
            extreme, looked, at = amounts.first_end(start / most)
        reached = extreme.x is None or looked is None
        if not reached or most >= _LAST:
            break
        most *= _MORE
    size, n, m = most * first.most, len(system.coordinates), len(system.rows)
    if extreme.x is None or looked is None:
        value = np.nan if extreme.x is None else sign * np.inf
        lost = [np.full(length, np.nan) for length in (n, all_cases[0].lower.size, m, len(system.slips))]
        return _End(value, sign * np.inf, sign * size, (), lost[0], lost[1], lost[2], lost[3])
    found = sets[at]
    in_order = [(sets[k], parts[k]) for k in sorted(range(len(sets)), key=lambda k: k != at)]
    way = giving_way(system, state, factor, in_order, extreme.x, sign * force, solutions.pushing)
    own = found.unknowns
    return _End(
        sign * extreme.value * size + 0.0,
        sign * (extreme.bound * size if found.proved and extreme.bound < looked else np.inf),
        float(sign * looked * size),
        way.slips,
        way.motion,
        found.figures(extreme.x),
        own.multipliers(extreme.x),
        own.friction(extreme.x),
        way.lifts,
        way.carries,
    )


class _Amounts:
    """Amounts, times a sign and relative to the largest that are looked at, that any of some sets allows."""

    def __init__(self, sets: Sequence[LoadsAtRest], sign: float):
        self.sets, self.sign, self.order = sets, sign, list(range(len(sets)))

    def between(self, low: float, high: float, *, first: bool = False) -> tuple[Extreme, int]:
        """The largest, or any, and whose it is."""
        best, at, bound = Extreme(-np.inf, None, -np.inf), self.order[0], -np.inf
        for k in list(self.order):
            relaxed = self.sets[k].relaxed
            box, cost = relaxed.programme.box.copy(), np.zeros(len(relaxed.programme.box))
            box[-1], cost[-1] = sorted((self.sign * low, self.sign * high)), 0.0 if first else self.sign
            found = self.sets[k].narrowed(box).extreme(cost, first=first, beyond=best.value)
            bound = max(bound, found.bound)
            if found.value > best.value:
                best, at = found, k
                self.order.sort(key=lambda other: other != k)  # it is asked first from here on
            if first and found.x is not None:
                break
        return best._replace(bound=bound), at

    def start(self, empty: float) -> tuple[float | None, bool]:
        """Zero, or where that is not borne any that is, beyond those known to be `empty`; and whether none is, proved.

        Among more amounts rounding is larger than what is missing to bear the few that are known not to be borne.
        """
        ways = [(empty, 1.0), (-1.0, -empty)] if empty else [(0.0, 0.0), (-1.0, 1.0)]
        bound = -np.inf
        for low, high in ways:
            found, _ = self.between(low, high, first=True)
            if found.x is not None:
                return float(self.sign * found.x[-1]), False
            bound = found.bound if not empty else max(bound, found.bound)
        return None, bound == -np.inf

    def first_end(self, start: float) -> tuple[Extreme, float | None, int]:
        """The largest that can be reached from a start without one that was found not to be borne.

        Loads are followed as far as what is convex beside them reaches, and a step further others are sought; the first
        amount without any bounds those that are looked at. With it, how far amounts were looked at, None where all of
        them are borne; and whose extreme it is.
        """
        looked = 1.0
        extreme, at = self.between(start, looked)
        for _ in range(_GAPS):
            gap = self._first_gap(start, min(extreme.value, looked))
            if gap is None:
                break
            looked = gap
            extreme, at = self.between(start, gap)
        return extreme, None if looked == 1.0 and extreme.value > _REACHED else looked, at

    def _first_gap(self, place: float, end: float) -> float | None:
        """How far the first amounts from a place to an end reach of which none was found to be borne."""
        step = 0.0
        while place < end:
            found, at = self.between(place, place, first=True)
            if found.bound == -np.inf:
                ends = place + (end - place) * 0.5 ** np.arange(_HALVED)
                return next((far for far in ends if self.between(place, far, first=True)[0].bound == -np.inf), place)
            reached = place if found.x is None else self.sets[at].reach(self.sign, found.x, end)
            least = _STEP * max(abs(place), 1e-2)
            step = least if reached > place + least else min(max(2 * step, least), _LONGEST)
            place = max(place, reached) + step
        return None


def _scale(solutions: SolutionSet, cases: AbstractCases, start: ReducedForce, own: np.ndarray) -> float:
    """The amount that friction without it holds, about."""
    friction = sizes_of(solutions, cases).friction
    size, unit = np.linalg.norm(own), solutions.response.unit.multipliers[:, -1]
    if not size > 0:  # it moves nothing while all contacts are closed
        return float(np.abs(solutions.response.free.multipliers).max() / (np.abs(unit).max() or 1.0)) or 1.0
    held = np.abs(start.load @ own) / size + np.abs(start.slips @ own) @ friction / size
    return float(held / size) or 1.0


def _with_load(solutions: SolutionSet, load: Response) -> SolutionSet:
    """The solutions with the response to a load as a last column of that to unit friction."""
    more = Response(*(xp.concatenate(parts, axis=1) for parts in zip(solutions.response.unit, load, strict=True)))
    return eqx.tree_at(lambda solutions: solutions.response.unit, solutions, more)


def _response(factor: Factorisation, chosen: Elasticity, force: Numeric) -> Response:
    """The response to a load, a column, under a closure."""
    pick, _ = factor.close(chosen[0])
    found = factor.respond(force[:, None])
    return Response(found.acceleration, pick(found.multipliers))
