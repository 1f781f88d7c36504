"""The audit of a mechanism: what is redundant and unique at a position, and whether others agree

With P the projector onto self-stress in scaled multipliers, of the rows r of a joint's force, or of its moment,

    len(r) - rank P[r]    dimensions are unique.

Rows of different dependent groups have no entry of P in common. Each position is decided by itself; they must agree.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Array

from .._analysis._release import Release, releases
from .._equations._evidence import ScaledMotion, probe, singularity_by
from .._equations._rank import Spectrum, Split, split
from .._equations._scaled_kinematics import ScaledKinematics, scaled_kinematics
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._json import JSON
from .._tools._module import replace_fields
from .._tools._numbers import Numeric, computed, xp
from ._choice import Repair
from ._drives import Drives
from ._stress import Along
from ._travel import Travel

_MOST_BLUR = 1e-2
_LISTED = 60  # releases of a dependent group
_NEAR = 10.0  # times as large or small is not clearly another


@dataclasses.dataclass(frozen=True)
class Look:
    """Redundancy of a system at one position.

    - `rank`, `redundancy`, `freedom`: as in a `Report`; `kept`, `dropped`: the singular values beside the gap.
    - `digits`: singular values below count as 0, because the numbers of a file have no more digits.
    - `is_decided`: whether the rank is clear; `is_singular`: whether it is lower here than beside this position.
    - `stress`: P, shape (m, m); `blur`: what of it is rounding and misfit; `scales`: of multipliers, (m,).
    """

    rank: int
    redundancy: int
    freedom: int
    kept: float
    dropped: float
    is_decided: bool
    is_singular: bool
    stress: np.ndarray
    blur: float
    scales: np.ndarray
    digits: float = 0.0

    @property
    def figures(self) -> tuple[int, int]:
        """Redundancy and freedom."""
        return self.redundancy, self.freedom

    @property
    def unique(self) -> np.ndarray:
        """Which multipliers are unique, (m,)."""
        return np.linalg.norm(self.stress, axis=1) <= self.blur

    def dimensions(self, rows: Sequence[int]) -> list[int]:
        """How many dimensions of the multipliers of some rows are unique, and of how many."""
        return [len(self.known(rows)), len(rows)]

    def known(self, rows: Sequence[int]) -> np.ndarray:
        """The combinations of multipliers of some rows of one kind that are unique, of unit length, one a row."""
        if not rows:
            return np.zeros((0, 0))
        left, values, _ = np.linalg.svd(self.stress[list(rows)])
        of_scaled = left[:, int(np.sum(values > self.blur)) :]
        return np.linalg.qr(of_scaled * self.scales[list(rows), None])[0].T

    def groups(self) -> list[np.ndarray]:
        """Rows that are coupled by self-stress, group by group."""
        left, found = set(np.flatnonzero(~self.unique).tolist()), []
        while left:
            group, fresh = set(), {min(left)}
            while fresh:
                group |= fresh
                fresh = set(np.flatnonzero((np.abs(self.stress[sorted(fresh)]) > self.blur).any(axis=0))) & left - group
            found.append(np.array(sorted(group)))
            left -= group
        return found


@dataclasses.dataclass(frozen=True)
class Part:
    """What is unique of the reaction of a joint.

    - `force`, `moment`: unique dimensions, and of how many.
    - `loose`: names of its multipliers that are not unique; `here_alone`: of those that are so at this position alone.
    - `known`: combinations of those that are not unique which are, "force" or "moment" and coefficients by name.
    """

    name: str
    kind: str
    force: list[int]
    moment: list[int]
    loose: tuple[str, ...]
    here_alone: tuple[str, ...]
    known: tuple[tuple[str, dict[str, float]], ...] = ()


@dataclasses.dataclass(frozen=True)
class Group:
    """Rows coupled by self-stress, how many of them are redundant, and the best releases.

    - `margins`: of each release the least along the motion, 0 where it adds one.
    """

    redundancy: int
    rows: tuple[str, ...]
    releases: tuple[Release, ...]
    margins: tuple[float, ...] = ()


@dataclasses.dataclass(frozen=True)
class Audit:
    """What an audit finds at a position, `here`, and at others; joints, dependent groups and drives are those of
    `regular`, where motions of the joints start.

    - `directions`: what rows are along there, in world axes; `idle`: bodies that can move while drives rest, if some
      cannot.
    - `repairs`: what the file can say; `along`: the self-stress wherever the joints were moved.
    - `spins`: bodies that turn and move nothing else, as rods between two balls do, for each such freedom.
    - `outside`: joints that are beyond their limits, for each of the other positions where some are.
    """

    rows: tuple[str, ...]
    here: Look
    others: tuple[Look, ...]
    parts: tuple[Part, ...]
    groups: tuple[Group, ...]
    drives: Drives | None = None
    travel: Travel | None = None
    directions: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    repairs: tuple[Repair, ...] = ()
    idle: tuple[str, ...] = ()
    along: Along | None = None
    spins: tuple[tuple[str, ...], ...] = ()
    outside: tuple[tuple[str, ...], ...] = ()

    @property
    def regular(self) -> Look:
        """The first position that is not singular, if there is one: what is said of the machine is so there."""
        return _regular(self.here, self.others)

    @property
    def figures(self) -> tuple[int, int]:
        """Redundancy and freedom of the machine."""
        return self.regular.figures

    @property
    def is_stuck(self) -> bool:
        """Whether it can move by its rank, but cannot be moved to another position: a dead point."""
        return not self.others and self.here.freedom > 0 and not (self.travel and self.travel.moved)

    @property
    def is_decided(self) -> bool:
        """Whether all positions agree; one that is singular may differ from the others."""
        if self.is_stuck:
            return False
        looks = (self.here, *self.others)
        regular = [look for look in looks if not look.is_singular]
        return all(look.is_decided for look in looks) and bool(regular) and len({each.figures for each in regular}) == 1

    def to_dict(self) -> dict[str, JSON]:
        """All of it as data."""
        looks: list[JSON] = [
            {
                "rank": look.rank,
                "redundancy": look.redundancy,
                "freedom": look.freedom,
                "smallest_kept": look.kept,
                "largest_dropped": look.dropped,
                "decided": look.is_decided,
                "singular_position": look.is_singular,
            }
            for look in (self.here, *self.others)
        ]
        groups: list[JSON] = [
            {
                "redundancy": group.redundancy,
                "rows": list(group.rows),
                "releases": [
                    {
                        "directions": [list(each) for each in one.directions],
                        "determinant": one.determinant,
                        **({"margin": margin} if margin is not None else {}),
                    }
                    for one, margin in zip(group.releases, group.margins or [None] * _LISTED, strict=False)
                ],
            }
            for group in self.groups
        ]
        return {
            "rows": len(self.rows),
            "redundancy": self.figures[0],
            "freedom": self.figures[1],
            "spins": [list(each) for each in self.spins],
            "freedom_without_spins": self.figures[1] - len(self.spins),
            "decided": self.is_decided,
            "positions": looks,
            "parts": {part.name: _part_as_dict(part) for part in self.parts},
            "groups": groups,
            **({"repairs": [each.to_dict(self.directions) for each in self.repairs]} if self.repairs else {}),
            "directions": {row: along.tolist() for row, along in self.directions.items()},
            **({"stuck": True} if self.is_stuck else {}),
            **({"drives": self.drives.to_dict()} if self.drives else {}),
            **({"travel": self.travel.to_dict()} if self.travel else {}),
        }


def _part_as_dict(part: Part) -> dict[str, JSON]:
    return {
        "kind": part.kind,
        "unique_dimensions": {"force": part.force, "moment": part.moment},
        "not_unique": list(part.loose),
        "unique_combinations": [{"kind": kind, "shares": shares} for kind, shares in part.known],
        "unique_at_this_position_alone": list(part.here_alone),
    }


@computed
def audit(system: AbstractSystem, state: State, others: Sequence[State], digits: float = 0.0) -> Audit:
    """The audit of a system at a state, and at others.

    **Arguments:**

    - `digits`: singular values below count as 0, relative to the largest; near it nothing is decided.
    """
    here, *beside = (_look(system, each, digits) for each in (state, *others))
    shown = _regular(here, beside)
    if here.figures == shown.figures:  # the digits of a file can pass for a rank that is lower here
        here = shown = dataclasses.replace(here, is_singular=here.is_singular and here is shown)
    loose = np.any([~look.unique for look in (here, *beside) if look.figures == shown.figures], axis=0)
    return Audit(system.rows.labels, here, tuple(beside), _parts(system, shown, loose), _groups(system, shown))


def _regular(here: Look, others: Sequence[Look]) -> Look:
    return next((look for look in (here, *others) if not look.is_singular), here)


class _Decided(NamedTuple):
    """The rank and what it decides, the motion at the state, and along what bends tell whether it is singular."""

    spectrum: Spectrum
    is_ambiguous: Array
    parts: Split
    motion: ScaledMotion
    probe: Array


def _decided(at: ScaledKinematics, state: State, rank: Numeric | None) -> _Decided:
    parts, spectrum = split(at.scaled, at.position, rank)
    motion = at.moving(state, xp.zeros_like(state.qd), xp.zeros_like(at.position))
    return _Decided(spectrum, spectrum.ambiguous, parts, motion, probe(motion, parts, at.scales))


def _is_singular(found: _Decided, at: ScaledKinematics, probed: ScaledKinematics) -> Array:
    bend = -probed.motion.gamma / at.scales.rows
    return singularity_by(bend, found.motion, found.parts, at.position, at.scales).is_yes


def _look(system: AbstractSystem, state: State, digits: float) -> Look:
    """The constraints alone decide, so that friction needs no program."""
    system = system.whole.anonymous.without_friction
    at = scaled_kinematics(system, state)
    found, is_clear = _decided(at, state, None), True
    if digits > found.spectrum.tolerance:
        known = found.spectrum.singular_values
        count, least, most = (int(np.sum(known > digits * by)) for by in (1, _NEAR, 1 / _NEAR))
        is_clear = least == most
        if found.is_ambiguous or count != found.spectrum.rank:
            found = _decided(at, state, np.asarray(count))
    probed = scaled_kinematics(system, replace_fields(state, qd=found.probe))
    values, rank = np.append(found.spectrum.singular_values, 0.0), int(found.spectrum.rank)
    rows, columns = at.jacobian.shape
    misfit = max(max(rows, columns) * float(np.finfo(values.dtype).eps), float(at.position))
    return Look(
        rank,
        redundancy=rows - rank,
        freedom=columns - rank,
        kept=float(values[rank - 1]) if rank else np.inf,
        dropped=float(values[rank]) if rank < values.size else 0.0,
        is_decided=is_clear and not bool(found.is_ambiguous),
        is_singular=bool(_is_singular(found, at, probed)),
        stress=np.asarray(found.parts.stress),
        blur=min(100 * misfit / min(float(found.spectrum.kept), 1.0), _MOST_BLUR),
        digits=digits,
        scales=np.asarray(at.scales.rows),
    )


def _parts(system: AbstractSystem, here: Look, loose: np.ndarray) -> tuple[Part, ...]:
    members: dict[str, list[int]] = {}
    for k, row in enumerate(system.rows.labels):
        members.setdefault(row.rpartition(".")[0] or row, []).append(k)
    kinds, parts, words = system.rows.kinds, [], _kinds(system)
    for name, rows in members.items():
        force, moment = ([k for k in rows if kinds[k] == wanted] for wanted in ("force", "moment"))
        own, elsewhere = ([k for k in rows if flags[k]] for flags in (~here.unique, loose & here.unique))
        labels = [label.rpartition(".")[2] for label in system.rows.labels]
        known = []
        for kind, of_kind in (("force", force), ("moment", moment)):
            left = [k for k in own if k in of_kind]
            known += [
                (kind, dict(zip([labels[k] for k in left], one, strict=True))) for one in here.known(left).tolist()
            ]
        parts.append(
            Part(
                name,
                words.get(name, ""),
                here.dimensions(force),
                here.dimensions(moment),
                tuple(labels[k] for k in own),
                tuple(labels[k] for k in elsewhere),
                tuple(known),
            )
        )
    return tuple(parts)


def _kinds(system: AbstractSystem) -> dict[str, str]:
    """The class of each joint, of a mechanism."""
    stacks = zip(getattr(system, "joints", ()), system.names.joints, strict=True)
    kinds = {name: type(stack.element).__name__ for stack, names in stacks for name in names}
    coupled = (row for row in system.rows.labels if row.endswith(".coupling"))
    return {row.removesuffix(".coupling"): "Coupler" for row in coupled} | kinds


def _groups(system: AbstractSystem, here: Look) -> tuple[Group, ...]:
    found = []
    for rows in here.groups():
        block = here.stress[np.ix_(rows, rows)]
        count = int(np.round(np.trace(block)))
        basis = np.linalg.eigh(block)[1][:, rows.size - count :]
        names, kinds = (tuple(every[k] for k in rows) for every in (system.rows.labels, system.rows.kinds))
        found.append(Group(count, names, releases(basis, names, kinds, by_row=True, most=_LISTED)))
    return tuple(found)
