"""The outputs of a report: verdict, value and range of each, on the joints' loads where there are bodies."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..._analysis._outputs import evaluated, outputs, sizes
from ..._analysis._report import Report
from ..._analysis._verdict import Judged, Verdict
from ..._solution_sets._family._solution_family import SolutionFamily
from ..._solve._solution import Solution
from ..._system._names import unit_of
from ..._system._state import State
from ..._system._system import AbstractSystem
from ..._system._units import with_unit
from ..._tools._table import apart
from ._blocks import Table

_KINDS = {
    "acceleration": "Accelerations",
    "reaction": "Joint loads",
    "multiplier": "Multipliers",
    "friction": "Friction",
}
_SAME = 1e-9  # relative to the largest of a table and kind, below which values do not differ
_LEAST = 1e-13  # the same of values that are known to differ
_ROUNDING = 1e-12  # the same of a state


class Span(NamedTuple):
    """What varies, from where to where."""

    name: str
    least: str
    largest: str
    unit: str

    def __str__(self) -> str:
        return f"{self.name}: {self.least} to {self.largest} {self.unit}".rstrip()


@dataclasses.dataclass(frozen=True)
class Outputs:
    """Outputs of one kind, under a title: names, coefficients, kinds and units, and what is judged of them.

    `value` (o,) is that of the solution, NaN where there is none, `found` (number, o) all that were looked at; both are
    0 where they are rounding. `differs` tells which have a range.
    """

    title: str
    names: tuple[str, ...]
    matrix: np.ndarray
    kinds: tuple[str, ...]
    units: tuple[str, ...]
    judged: tuple[Judged, ...]
    value: np.ndarray
    found: np.ndarray
    differs: np.ndarray

    def counted(self) -> str:
        """How many there are of each verdict, apart from those that are zero."""
        said = [
            Verdict.ZERO if one.with_friction is Verdict.UNIQUE and value == 0 else one.with_friction
            for one, value in zip(self.judged, self.value, strict=True)
        ]
        counts = {verdict.value: said.count(verdict) for verdict in Verdict if verdict is not Verdict.ZERO}
        parts = ", ".join(f"{count} {words}" for words, count in counts.items() if count)
        zeros = said.count(Verdict.ZERO)
        more = f"; {zeros} more {'is' if zeros == 1 else 'are'} zero" if zeros else ""
        return f"{self.title}: {parts}{more}." if parts else f"{self.title}: all are zero."

    def span(self, k: int) -> Span:
        """Least and largest of one, with the digits that tell them apart."""
        ends = apart(self.found[:, k].min(), self.found[:, k].max())
        return Span(self.names[k], *ends, self.units[k])

    def widest(self) -> list[Span]:
        """Of each kind that which varies most; the first where several do."""
        change, kinds = np.ptp(self.found, axis=0) * self.differs, np.array(self.kinds)
        largest = {kind: change[kinds == kind].max() for kind in dict.fromkeys(self.kinds)}
        firsts = [np.argmax((kinds == kind) & (change > (1 - _SAME) * x)) for kind, x in largest.items() if x > 0]
        return [self.span(int(k)) for k in firsts]

    def table(self) -> Table:
        """Values, and ranges where there are some; what a joint cannot carry is left out."""
        shown = [k for k, one in enumerate(self.judged) if one.with_friction is not Verdict.ZERO]
        kinds = list(map(with_unit, self.kinds, self.units))
        if not self.differs.any():
            rows = tuple((self.names[k], number(self.value[k]), kinds[k]) for k in shown)
            return Table(self.title, ("component", "value", "kind"), rows)
        ends = [self.span(k)[1:3] if self.differs[k] else ("", "") for k in range(len(self.names))]
        rows = tuple((self.names[k], number(self.value[k]), *ends[k], kinds[k]) for k in shown)
        return Table(self.title, ("component", "minimum norm", "least", "largest", "kind"), rows)


def all_outputs(
    system: AbstractSystem, state: State, report: Report, solution: Solution, families: Sequence[SolutionFamily]
) -> dict[str, Outputs]:
    """Accelerations, loads and friction by kind; joint loads stand for multipliers where there are some."""
    skipped = "multiplier" if "reaction" in report.verdicts else "reaction"
    given = outputs(system, state)
    x = np.concatenate([solution.acceleration, solution.multipliers, solution.friction])
    every = np.concatenate([x[None], *(family.values for family in families)])
    kinds = [kind for kind in _KINDS if kind != skipped and report.verdicts.get(kind)]
    return {kind: _outputs(system, report, kind, *given[kind], x, every) for kind in kinds}


def _outputs(
    system: AbstractSystem,
    report: Report,
    kind: str,
    names: list[str],
    matrix: np.ndarray,
    x: np.ndarray,
    every: np.ndarray,
) -> Outputs:
    known = system.names.reactions if kind == "reaction" else system.names.unknowns
    kinds = tuple(known.kinds[known.labels.index(name)] for name in names)
    judged = report.verdicts[kind]
    said = [one.with_friction for one in judged]
    value, found = evaluated(matrix, x), evaluated(matrix, every)
    size = sizes(np.nan_to_num(found).T, kinds, report.length).max(axis=1)
    rounding = size * np.array([_LEAST if one is Verdict.NOT_UNIQUE else _SAME for one in said])
    found, value = (np.where(np.abs(array) <= rounding, 0.0, array) for array in (found, value))
    differs = np.ptp(found, axis=0) > rounding
    differs &= np.array([one not in (Verdict.UNIQUE, Verdict.ZERO) for one in said])
    units = tuple(unit_of(each, system.names.units) for each in kinds)
    return Outputs(_KINDS[kind], tuple(names), matrix, kinds, units, judged, value, found, differs)


def clean(values: np.ndarray, kinds: Sequence[str], length: float) -> np.ndarray:
    """Values (..., o) with 0 for those that are rounding beside the others of their row."""
    rows = np.atleast_2d(values)
    return np.where(np.abs(rows) <= _ROUNDING * sizes(rows.T, kinds, length).T, 0.0, rows).reshape(np.shape(values))


def number(value: float) -> str:
    """Five digits, or that there is no value."""
    return "no value" if np.isnan(value) else f"{value + 0.0:.5g}"
