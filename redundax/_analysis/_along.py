"""What is unique along a motion: the analysis at its states, and what changes between them.

Positions at which the rank drops lie between states, so they are looked for where the smallest singular value that the
rank keeps has a minimum, on the cubic through the positions and velocities of the states beside it. How near that
curve is to the constraints says how small a singular value can be told from zero.
"""

import dataclasses
import itertools
from typing import cast

import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array

from .._closures._closure import AbstractClosure, MinimumNorm
from .._equations._factorisation import factorised
from .._equations._factorize import factorize_dense
from .._equations._kinematics import between
from .._equations._rank import Spectrum
from .._solve._contacts import as_held
from .._system._contact import is_closed, refuse_declared, rows_closed
from .._system._names import ByName
from .._system._state import State, states_of
from .._system._system import AbstractSystem, check_system
from .._tools._errors import RedundaxError
from .._tools._json import JSON
from .._tools._questions import question
from .._tools._table import text_of
from ._analyze import analyze, orthonormal
from ._outputs import plain
from ._release import Release, determinant
from ._report import Report, columns
from ._verdict import Verdict

_MINIMUM_NORM = MinimumNorm()
_NEAR = 0.01  # of the largest singular value: what is worth telling


@dataclasses.dataclass(frozen=True)
class Change:
    """What is no longer said of an output.

    - `start`, `end`: times of the two states between which it changes.
    - `name`: of the output; "rank", "problem", "rest" and "contact f1" too.
    - `before`, `after`: what is said at them.
    """

    start: float
    end: float
    name: str
    before: str
    after: str


@dataclasses.dataclass(frozen=True)
class Narrow:
    """A position in, or near to, which the rank drops.

    - `t`, `q`: time and coordinates.
    - `smallest`: smallest singular value that the rank keeps elsewhere, relative to the largest.
    - `drops`: whether it cannot be told from zero.
    """

    t: float
    q: np.ndarray
    smallest: float
    drops: bool

    def __str__(self) -> str:
        size = f"smallest singular value {self.smallest:.1e} of the largest"
        return f"t = {self.t:.6g}: {'the rank drops' if self.drops else 'nearly singular'} ({size})"


@dataclasses.dataclass(frozen=True)
class MotionReport:
    """Redundancy and uniqueness along a motion. `str()` gives a page, `to_dict()` data.

    - `t`: times of the states, shape (states,).
    - `reports`: what `analyze` says at each.
    - `rank`, `smallest`: rank at each, and the singular value that decides the largest of these ranks, relative to the
      largest singular value.
    - `changes`: what is said differently at two successive states.
    - `narrow`: positions between states at which the rank drops or nearly does, by time.
    - `releases`: as in a `Report`, with the least |det N_S| over the motion; directions are constant in the rows.

    Of one-sided contacts those are rows at each state that are closed there and do not lift. `changes` tells what
    contacts do; between two states at which others are closed no rank is looked for, and no release is advised.

    ??? example

        ```python
        angles = jnp.array([0.6, 0.8, 1.0])
        states = jax.vmap(lambda phi: mechanism.state(phi=phi, rate=1.0, t=phi))(angles)
        report = rx.analyze_along(mechanism, states)
        report.rank, report.smallest  # at each state
        [(change.start, change.name, change.after) for change in report.changes]
        [(place.t, place.drops) for place in report.narrow]  # none on this way
        ```
    """

    t: np.ndarray
    reports: tuple[Report, ...]
    rank: np.ndarray
    smallest: np.ndarray
    changes: tuple[Change, ...]
    narrow: tuple[Narrow, ...]
    releases: tuple[Release, ...]

    def always(self, kind: str, verdict: Verdict) -> tuple[str, ...]:
        """Names of the outputs of a kind with this verdict, friction included, at every state."""
        said = [
            {judged.name for judged in report.verdicts.get(kind, ()) if judged.with_friction is verdict}
            for report in self.reports
        ]
        names = (judged.name for judged in self.reports[0].verdicts.get(kind, ()))
        return tuple(name for name in names if all(name in one for one in said))

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data."""
        return {
            "t": plain(self.t),
            "rank": plain(self.rank),
            "smallest": plain(self.smallest),
            "changes": [dataclasses.asdict(change) for change in self.changes],
            "narrow": [{**dataclasses.asdict(found), "q": plain(found.q)} for found in self.narrow],
            "releases": [dataclasses.asdict(release) for release in self.releases],
            "reports": [report.to_dict() for report in self.reports],
        }

    def __str__(self) -> str:
        m, n = len(self.reports[0].rows), len(self.reports[0].coordinates)
        ranks = " or ".join(str(rank) for rank in np.unique(self.rank))
        lines = [
            f"{self.t.size} states from t = {self.t[0]:.6g} to {self.t[-1]:.6g}: {n} coordinates, {m} constraints of "
            f"rank {ranks}"
        ]
        between = "them" if len(set(map(_closed, self.reports))) == 1 else "states with the same contacts"
        lines += [f"  {found}" for found in self.narrow] or [f"  the rank drops nowhere between {between}"]
        lines += ["Changes:", *self._changes()] if self.changes else ["Nothing changes."]
        for kind in self.reports[0].verdicts:
            for verdict in Verdict:
                if names := self.always(kind, verdict):
                    lines += [f"{kind.capitalize()}, {verdict.value} at every state:", *columns(list(names))]
        if self.releases:
            lines.append("Releases, first what stays farthest from a further motion, by the least")
            lines.append("|det N_S| over all states (1 is best, 0 adds a freedom somewhere):")
            lines += [f"    {release}" for release in self.releases]
        return text_of(lines)

    def _changes(self) -> list[str]:
        """Changes from state to state, those that say the same together."""
        groups: dict[tuple, list[str]] = {}
        for change in self.changes:
            groups.setdefault((change.start, change.end, change.before, change.after), []).append(change.name)
        lines = []
        for (start, end, before, after), names in groups.items():
            lines += [f"  t = {start:.6g} to {end:.6g}, {before} -> {after}:", *columns(names)]
        return lines


@question
def analyze_along(
    system: AbstractSystem,
    states: State,
    *,
    closure: AbstractClosure = _MINIMUM_NORM,
    sense: ByName | None = None,
    rank: ArrayLike | None = None,
) -> MotionReport:
    """Rank, self-stress and uniqueness of a system along a motion.

    ??? example

        ```python
        angles = jnp.array([0.6, 0.8, 1.0])
        states = jax.vmap(lambda phi: mechanism.state(phi=phi, rate=1.0, t=phi))(angles)
        report = rx.analyze_along(mechanism, states)
        print(report)
        ```

    **Arguments:**

    - `system`: a `Mechanism` or `System`.
    - `states`: at least two successive states, each array with an axis for them in front, as
      `Trajectory.states` gives them; concrete values. States with NaN are left out.
    - `closure`, `sense`, `rank`: as in `analyze`.

    **Raises:** `ValueError` for fewer than two states.
    """
    check_system(system)
    each = states_of(states)
    if len(each) < 2:
        raise RedundaxError(
            f"Argument `states` must hold two finite states at least, but has {len(each)}. "
            "Simulate longer, or give more states."
        )
    refuse_declared(system.names, rank=rank)
    system = system.whole
    held = [_at(system, state, closure, sense, rank) for state in each]
    reports, row_scales = [report for _, report, _ in held], [np.asarray(scale) for *_, scale in held]
    ranks, t = np.array([report.rank for report in reports]), np.array([float(state.t) for state in each])
    runs = [[*run] for _, run in itertools.groupby(range(len(each)), lambda k: _closed(reports[k]))]
    most = np.concatenate([np.full(len(run), ranks[run].max()) for run in runs])
    smallest = np.array([one.singular_values[max(rank - 1, 0)] for one, rank in zip(reports, most, strict=True)])
    narrow = [_narrow(held[run[0]][0], [each[k] for k in run], smallest[run], int(most[run[0]])) for run in runs]
    return MotionReport(
        t=t,
        reports=tuple(reports),
        rank=ranks,
        smallest=smallest,
        changes=_changes(t, reports),
        narrow=tuple(itertools.chain(*narrow)),
        releases=_releases(reports, row_scales) if len(runs) == 1 else (),
    )


def _at(
    system: AbstractSystem, state: State, closure: AbstractClosure, sense: ByName | None, rank: ArrayLike | None
) -> tuple[AbstractSystem, Report, Array]:
    """The system at a state, of one with one-sided contacts that whose closed ones hold; its report and row scales."""
    if not system.names.one_sided:
        factor = factorize_dense(system, state, rank)
        return system, analyze(system, state, closure=closure, sense=sense, factor=factor), factor.row_scale
    report = analyze(system, state, closure=closure, sense=sense)
    system = as_held(system, rows_closed(system.names, report.contacts)[1])
    return system, report, factorize_dense(system, state, None).row_scale


def _closed(report: Report) -> tuple[bool, ...]:
    return tuple(map(is_closed, report.contacts.values()))


def _changes(t: np.ndarray, reports: list[Report]) -> tuple[Change, ...]:
    out = []
    for k, (before, after) in enumerate(zip(map(_said, reports[:-1]), map(_said, reports[1:]), strict=True)):
        for name in before:
            if name in after and before[name] != after[name]:
                out.append(Change(float(t[k]), float(t[k + 1]), name, before[name], after[name]))
    return tuple(out)


def _said(report: Report) -> dict[str, str]:
    """What a report says, by name."""
    out = {
        "rank": str(report.rank),
        "problem": report.problem or "none",
        "rest": "a joint rests" if report.at_rest else "none",
    }
    out |= {f"contact {name}": word for name, word in report.contacts.items()}
    for kind, judged in report.verdicts.items():
        out |= {f"{kind} {one.name}": one.with_friction.value for one in judged}
    return out


def _narrow(system: AbstractSystem, states: list[State], smallest: np.ndarray, rank: int) -> tuple[Narrow, ...]:
    """Minima of the singular value that decides the rank, between states at which the same contacts are closed."""
    from scipy.optimize import fminbound

    if not rank or len(states) < 2:
        return ()

    anonymous, last = system.anonymous.without_friction, len(states) - 1

    def at(place: float) -> tuple[State, Spectrum]:
        first = min(int(place), last - 1)
        state = between(anonymous, states[first], states[first + 1], np.asarray(place - first))
        return state, factorised(anonymous, state, np.asarray(rank)).spectrum

    def value(place: float) -> float:
        return float(at(place)[1].singular_values[rank - 1])

    padded, out = np.concatenate([[np.inf], smallest, [np.inf]]), []
    for k in np.flatnonzero((smallest <= padded[:-2]) & (smallest < padded[2:])):
        place = fminbound(value, max(k - 1, 0), min(k + 1, last), xtol=1e-10)
        there, spectrum = at(cast(float, place))
        least = float(spectrum.singular_values[rank - 1])
        if least < _NEAR:
            out.append(Narrow(float(there.t), np.asarray(there.q), least, bool(least <= spectrum.tolerance)))
    return tuple(out)


def _releases(reports: list[Report], row_scales: list[np.ndarray]) -> tuple[Release, ...]:
    """All releases advised somewhere, by their least determinant."""
    if len({report.redundancy for report in reports}) > 1:
        return ()
    bases = [orthonormal(scale, report.self_stress) for report, scale in zip(reports, row_scales, strict=True)]
    best: dict[tuple[str, ...], Release] = {}
    for advised in [release.directions for report in reports for release in report.releases]:
        least = min(determinant(advised, basis, reports[0].rows) for basis in bases)
        where = tuple(f"{joint}: {', '.join(shares)}" for joint, shares in advised)
        if where not in best or least > best[where].determinant:
            best[where] = Release(advised, least)
    return tuple(sorted(best.values(), key=lambda release: -release.determinant))
