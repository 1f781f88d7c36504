"""The report of an analysis: what is unique at a state and what is not, as text, data and JSON."""

import dataclasses
import json
import re
from collections.abc import Collection

import numpy as np

from .._system._pushing import in_words
from .._tools._json import JSON
from .._tools._table import WIDTH, text_of
from ._bearing_words import best_in_words
from ._release import Release
from ._verdict import Judged, Verdict

_FEW = 6.0  # lost digits that are worth a word
_STATES, _NAMES = 3, 30  # self-stress states and names of one list that a page shows


@dataclasses.dataclass(frozen=True)
class Report:
    """Redundancy and uniqueness of a system at a state. `str()` gives a page, `to_dict()` and `to_json()` data.

    - `coordinates`, `rows`: their names.
    - `velocity_rows`: names of the rows that constrain velocities alone, as those of wheels.
    - `rank`, `redundancy`, `freedom`: r, k = m - r and n - r, of all rows.
    - `holonomic_rank`: rank of the rows that have positions, of all where no row constrains velocities alone.
    - `singular_values`, `gap`: spectrum of the scaled Jacobian, free of units, and the ratio across the rank.
    - `tolerance`: singular values above it count, relative to the largest.
    - `self_stress`: k self-stress states, shape (k, m), in units of the multipliers: loads that the joints can
      carry without any external load. `rx.plot.draw` takes their index, from 0. At a singular position where the
      velocity decides the branch those that vanish beside it are left out.
    - `groups`: dependent groups: rows that are coupled by self-stress. None of a group is "the redundant one".
    - `unit_dependent`: rows whose minimum-norm multiplier changes with the unit of length or angle: those of groups
      that hold force-type and moment-type rows (Section 3). Under `Compliance` none does.
    - `unique_multipliers`: names of the multipliers that are unique without friction.
    - `unique_only_here`: those of them that are unique at this position only.
    - `singular_position`: whether the rank is lower here than at positions beside it: then nothing is called unique
      and what is said of self-stress holds only here, unless the velocity decides the branch of motion.
    - `local_self_stress`: how many of the self-stress states, at least, vanish beside a singular position.
    - `undetermined`: names of the multipliers that have no value at a singular position under the closure, because
      they are unbounded beside it or their limit is not known.
    - `lost_digits`: decimal digits that accelerations and loads lose to the smallest kept singular value.
    - `unique_accelerations`: whether accelerations are unique without friction.
    - `at_rest`: whether a joint with friction rests, where its friction is set-valued and what it moves undecided.
    - `verdicts`: what is proved, over all solutions, of each "acceleration", "multiplier", "friction" and, for a
      `Mechanism`, "reaction": the components of every joint's force, global, and its moment about the joint's point,
      on the body that is named. Multipliers have the sign of the paper.
    - `spectral_radius`: of Gamma_ij = |d tau_i / d rho| |d rho_i / d tau_j| under the closure: below 1 the frictional
      equations are proved to have one solution for each misfit of it; None without friction.
    - `releases`: directions within joints whose release removes all redundancy and adds no degree of freedom.
    - `friction_reads`: names of the multipliers that are not unique and that friction depends on.
    - `couplings`: names of the joints that are an `AngleCoupling`: what is said of bearings leaves out the forces of
      their teeth or belts.
    - `pulling`: names of the rows of teeth that pull in the solution of the closure: their other flanks are in contact.
    - `contacts`: what each one-sided contact does, by name: "carries", "touches", "lifts" or "open". All else is said
      of the joints and of the contacts that do not lift.
    - `ranges`: of the loads that are not unique what one-sided contacts leave, by name, least and largest, whatever
      the joints are made of; infinite where nothing bounds it. Without friction only.
    - `units`: those that the model states, as in "m, rad, kg, s, N"; empty where it states none.
    - `length`: a length of the mechanism, by which moments are compared with forces, and turns with shifts.
    - `problem`: why the equations at this state cannot be trusted; empty if they can.

    ??? example

        ```python
        report = rx.analyze(mechanism, state)
        report.rank, report.redundancy, report.freedom  # 11, 1, 1
        report.unique_multipliers  # ("K.perpendicular", "L.perpendicular"), without friction
        report.to_json()
        ```
    """

    coordinates: tuple[str, ...]
    rows: tuple[str, ...]
    velocity_rows: tuple[str, ...]
    rank: int
    holonomic_rank: int
    redundancy: int
    freedom: int
    singular_values: np.ndarray
    gap: float
    tolerance: float
    self_stress: np.ndarray
    groups: tuple[tuple[str, ...], ...]
    unit_dependent: tuple[str, ...]
    unique_multipliers: tuple[str, ...]
    unique_only_here: tuple[str, ...]
    singular_position: bool
    local_self_stress: int
    undetermined: tuple[str, ...]
    lost_digits: float
    unique_accelerations: bool
    at_rest: bool
    verdicts: dict[str, tuple[Judged, ...]]
    spectral_radius: float | None
    releases: tuple[Release, ...]
    friction_reads: tuple[str, ...]
    couplings: tuple[str, ...]
    pulling: tuple[str, ...]
    contacts: dict[str, str]
    ranges: dict[str, tuple[float, float]]
    length: float
    units: str
    problem: str

    @property
    def unique_reactions(self) -> tuple[str, ...]:
        """Names of the joints whose whole reaction is unique without friction: rows are called "joint.row"."""
        joints = dict.fromkeys(row.rpartition(".")[0] for row in self.rows if "." in row)
        unique = set(self.unique_multipliers)
        free = {row.rpartition(".")[0] for row in self.rows if row not in unique}
        return tuple(joint for joint in joints if joint not in free)

    @property
    def holonomic_redundancy(self) -> int:
        """How many of the self-stress states are there without rows of velocity."""
        return min(len(self.rows) - len(self.velocity_rows) - self.holonomic_rank, self.redundancy)

    @property
    def pivots(self) -> tuple[str, ...]:
        """For each self-stress state the first multiplier that has the entry 1 in it and 0 in all others."""
        size = np.abs(self.self_stress)
        alone = (self.self_stress == 1.0) & (size.sum(axis=0) == size)
        return tuple(self.rows[int(np.argmax(row))] for row in alone)

    @property
    def left_out(self) -> str:
        """What the equations leave out, in words; empty if there is nothing to tell."""
        if not self.couplings:
            return ""
        return (
            f"Angles alone are coupled by {', '.join(self.couplings)}: no force of teeth or belts loads the bearings. "
            "A `GearPair` has that of teeth."
        )

    def dependencies(self) -> tuple[tuple[str, dict[str, float]], ...]:
        """For each self-stress state one row and the coefficients eta (17) with which the others make it.

        Phi_q of the row is the sum of eta_j times Phi_q of the rows j; any row of the state can take its place.
        """
        out = []
        for state, pivot in zip(self.self_stress, self.pivots, strict=True):
            others = [j for j in np.flatnonzero(state) if self.rows[j] != pivot]
            out.append((pivot, {self.rows[j]: -float(state[j]) for j in others}))
        return tuple(out)

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data; infinities become None."""
        out = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        out["verdicts"] = {kind: [judged.to_dict() for judged in all_of] for kind, all_of in self.verdicts.items()}
        out["releases"] = [dataclasses.asdict(release) for release in self.releases]
        out["spectral_radius"] = _finite(self.spectral_radius)
        out["singular_values"] = self.singular_values.tolist()
        out["self_stress"] = [dict(zip(self.rows, state.tolist(), strict=True)) for state in self.self_stress]
        out["unique_reactions"] = self.unique_reactions
        out["gap"] = _finite(self.gap)
        out["ranges"] = {name: [_finite(bound) for bound in both] for name, both in self.ranges.items()}
        return out

    def to_json(self) -> str:
        """`to_dict` as JSON text."""
        return json.dumps(self.to_dict(), indent=2)

    @property
    def heading(self) -> str:
        """The first lines of the page: counts, the rank's margin, units, and what to know before all else."""
        lines = [
            f"{len(self.coordinates)} coordinates, {len(self.rows)} constraints of rank {self.rank}: "
            f"{self.redundancy} redundant, {count_of(self.freedom, 'degree')} of freedom",
            f"Least singular value kept: {self.singular_values[max(self.rank - 1, 0)]:.2g} of the largest, "
            + (
                f"{self.gap:.1e} times any dropped"
                if np.isfinite(self.gap)
                else "those dropped are zero"
                if len(self.singular_values) > self.rank
                else "none dropped"
            ),
        ]
        if self.velocity_rows:
            own, freedom = self.holonomic_redundancy, len(self.coordinates) - self.holonomic_rank
            lines.append(
                f"{len(self.velocity_rows)} of the constraints are on velocities alone: without them "
                f"{own} redundant, {count_of(freedom, 'degree')} of freedom; with them {self.redundancy - own} more "
                f"redundant, {freedom - self.freedom} less of freedom"
            )
        if self.units:
            lines.append(f"Units: {self.units}")
        if self.problem:
            lines.append(f"PROBLEM: {self.problem}")
        if self.singular_position:
            lines.append(
                f"SINGULAR POSITION: the rank is higher beside it, where at least {self.local_self_stress} of the "
                f"{count_of(self.redundancy, 'self-stress state')} vanish. "
                + (
                    "The velocity decides the branch of motion, and with it the accelerations."
                    if self.undetermined
                    else "No acceleration and no load is called unique."
                )
            )
        elif self.lost_digits >= _FEW:
            lines.append(
                f"NEAR A SINGULAR POSITION: accelerations and loads lose {self.lost_digits:.0f} of their digits."
            )
        if self.left_out:
            lines.append(f"LEFT OUT: {self.left_out}")
        if self.pulling:
            lines.append(f"CHANGE OF FLANK: {in_words(self.pulling)}")
        return text_of(lines)

    def __str__(self) -> str:
        lines = [self.heading, *best_in_words(self.releases, self.rows)]
        for number, state in enumerate(self.self_stress[:_STATES]):
            lines.append(f"Self-stress state {number}, multipliers:")
            lines += columns([f"{name} {value:+.6g}" for name, value in zip(self.rows, state, strict=True) if value])
        if len(self.self_stress) > _STATES:
            lines.append(f"{count_of(len(self.self_stress) - _STATES, 'more state')}: `report.self_stress`")
        if len(self.groups) > 1:
            lines.append("Dependent groups of rows:")
            lines += [line for group in self.groups for line in columns(list(group))]
        lines.append("Without friction:")
        lines.append(f"  accelerations: {'unique' if self.unique_accelerations else 'NOT unique, (14) fails'}")
        told = {*self.unique_multipliers, *self.undetermined}
        free = [name for name in self.rows if name not in told]
        lines += _listed("  unique multipliers:", self.unique_multipliers)
        if self.unique_only_here:
            lines += _listed("  of these unique only at this position:", self.unique_only_here)
        lines += _listed("  not unique:", free)
        if self.undetermined:
            lines += _listed("  without a value here, unbounded beside it or of unknown limit:", self.undetermined)
        if self.unit_dependent and {*self.unit_dependent} == {*free, *self.undetermined}:
            lines.append("  of all these the minimum norm depends on the unit of length")
        elif self.unit_dependent:
            lines += _listed("  of these the minimum norm depends on the unit of length:", self.unit_dependent)
        if any("." in row for row in self.rows):
            lines += _listed("  joints whose whole reaction is unique:", self.unique_reactions)
        lines += self._pushing()
        lines += self._with_friction()
        if self.releases:
            lines.append("To remove the redundancy and add no freedom, release one of these.")
            lines.append("First what stays farthest from a further motion, by |det N_S| (1 is best):")
            lines += [f"    {release}" for release in self.releases]
        return text_of(lines)

    def _pushing(self) -> list[str]:
        """What contacts do, and what pushing alone leaves."""
        lines = ["Contacts:"] if self.contacts else []
        for word in dict.fromkeys(self.contacts.values()):
            lines += _listed(f"  {word}:", [name for name, own in self.contacts.items() if own == word])
        if self.ranges:
            lines.append("Whatever the stiffness, as contacts only push:")
            joints = {re.split(" force | moment ", name)[0] for name in self.ranges if " on " in name}
            told = {name: both for name, both in self.ranges.items() if name.rpartition(".")[0] not in joints}
            bounded = {name: both for name, both in told.items() if np.isfinite(both).all()}
            lines += columns([f"{name} {_between(*both)}" for name, both in bounded.items()])
            if len(bounded) < len(told):
                lines += _listed("  not bounded:", [name for name in told if name not in bounded])
        return lines

    def _with_friction(self) -> list[str]:
        if self.spectral_radius is None or self.problem:
            return []
        lines = ["With friction:"]
        if self.at_rest:
            lines.append("  a joint is at rest, where friction can take any value up to its bound")
        else:
            radius = f"spectral radius {self.spectral_radius:.2g}"
            one = "one solution for each stiffness and fit"
            lines.append(
                f"  {one} (proved: {radius} < 1)" if self.spectral_radius < 1 else f"  not proved: {one} ({radius})"
            )
            if self.spectral_radius >= 1:
                lines.append(
                    "  above 1 joints may wedge themselves: `rx.sticking` and `rx.limit_load` ask that at rest"
                )
        for kind, what in (("acceleration", "accelerations"), ("friction", "friction"), ("multiplier", "multipliers")):
            for verdict in Verdict:
                names = [judged.name for judged in self.verdicts[kind] if judged.with_friction is verdict]
                if names:
                    lines += _listed(f"  {what}, {verdict.value}:", names)
        if self.friction_reads:
            lines += _listed("  because friction depends on", self.friction_reads)
        return lines


def _between(low: float, high: float) -> str:
    """Both bounds, or the one value that they leave."""
    return f"{low:.6g}" if high == low else f"{low:.6g} to {high:.6g}"


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def count_of(number: int, word: str) -> str:
    """As in "1 degree" and "2 degrees"."""
    return f"{number} {word}" + ("" if number == 1 else "s")


def _listed(head: str, names: Collection[str]) -> list[str]:
    return [f"{head} none"] if not names else [head, *columns(list(names))]


def columns(items: list[str]) -> list[str]:
    """Names in columns, as indented lines; of many the first."""
    shown, more = items[:_NAMES], len(items) - _NAMES
    cell = max((len(item) for item in shown), default=0) + 2
    per_line = max(1, (WIDTH - 4) // cell)
    lines = [
        "    " + "".join(item.ljust(cell) for item in shown[start : start + per_line]).rstrip()
        for start in range(0, len(shown), per_line)
    ]
    return [*lines, f"    and {more} more"] if more > 0 else lines
