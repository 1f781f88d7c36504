"""Which loads and accelerations of the minimum norm do not depend on the units, and why.

    lam(S) = (I - G S^2) lam_p,   G = N (N^T S^2 N)^-1 N^T,   S = factors of the multipliers      (16)

A change of the unit of length or angle scales S of force-type rows against that of moment-type rows. It leaves the pick
alone, whatever the loads, exactly in the groups of dependent rows of one type: there S is a common factor. (For one
dependent row: p' ~ p iff eta has no entry of the other type, Section 3.2.) With friction that must hold of every load
that friction reads, or the output be unique over all solutions. Mass and time units scale all of S alike.
"""

import dataclasses

import numpy as np

from .._analysis._analyze import analyze
from .._analysis._report import Report
from .._analysis._verdict import Verdict
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import RedundaxError
from .._tools._json import JSON
from .._tools._table import text_of


@dataclasses.dataclass(frozen=True)
class UnitVerdict:
    """One output: its name, whether it is `invariant` under a change of units, and the reason.

    ??? example

        ```python
        verdict = rx.units.unit_certificate(mechanism, state).multipliers[0]
        verdict.name, verdict.invariant, verdict.reason
        ```
    """

    name: str
    invariant: bool
    reason: str


@dataclasses.dataclass(frozen=True)
class UnitCertificate:
    """What of the minimum-norm solution is the same in all units; `str()` gives a page, `to_dict()` data.

    - `multipliers`, `accelerations`: a verdict on each. Not invariant means that there are loads and units for which
      it changes.

    ??? example

        ```python
        certificate = rx.units.unit_certificate(mechanism, state)
        [verdict.name for verdict in certificate.multipliers if verdict.invariant]
        ```
    """

    multipliers: tuple[UnitVerdict, ...]
    accelerations: tuple[UnitVerdict, ...]

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data."""
        return dataclasses.asdict(self)

    def __str__(self) -> str:
        lines = ["Under minimum norm, in other units of length or angle:"]
        for what in ("multipliers", "accelerations"):
            for invariant in (True, False):
                reasons: dict[str, list[str]] = {}
                for verdict in getattr(self, what):
                    if verdict.invariant is invariant:
                        reasons.setdefault(verdict.reason, []).append(verdict.name)
                word = "the same" if invariant else "may CHANGE"
                lines += [f"  {what} {', '.join(names)}: {word}, {reason}" for reason, names in reasons.items()]
        return text_of([*lines, "Under a compliance with units (Compliance, ElasticJoints) all are the same."])


def unit_certificate(system: AbstractSystem, state: State) -> UnitCertificate:
    """Which multipliers and accelerations of the minimum-norm solution at a state are the same in all units, and why.

    ??? example

        ```python
        print(rx.units.unit_certificate(mechanism, state))
        ```

    **Raises:** `ValueError` where the equations at the state cannot be trusted.
    """
    report = analyze(system, state)
    if report.problem:
        raise RedundaxError(f"Argument `state` must be one that can be analysed, but: {report.problem}")
    dependent = set(report.unit_dependent)
    read = [name for name in report.friction_reads if name in dependent]
    kinds = dict(zip(system.rows.labels, system.rows.kinds, strict=True))
    rows = _alone(report, kinds)
    accelerations = [UnitVerdict(f"{name}''", True, "unique without friction") for name in report.coordinates]
    if read:
        why = f"friction depends on the multipliers {', '.join(read)}, which change"
        rows = [
            _with_friction(verdict, judged.with_friction, why) for verdict, judged in _pairs(rows, report, "multiplier")
        ]
        accelerations = [
            _with_friction(verdict, judged.with_friction, why)
            for verdict, judged in _pairs(accelerations, report, "acceleration")
        ]
    return UnitCertificate(tuple(rows), tuple(accelerations))


def _pairs(verdicts: list[UnitVerdict], report: Report, kind: str) -> zip:
    return zip(verdicts, report.verdicts[kind], strict=True)


def _alone(report: Report, kinds: dict[str, str]) -> list[UnitVerdict]:
    """Without friction, of every row."""
    own = [{report.rows[k] for k in np.flatnonzero(state)} for state in report.self_stress]
    found = {row: UnitVerdict(row, True, "unique without friction") for row in report.unique_multipliers}
    found |= {row: UnitVerdict(row, False, "it has no value at this singular position") for row in report.undetermined}
    for group in report.groups:
        forces, moments = ([row for row in group if kinds[row] == kind] for kind in ("force", "moment"))
        mixed = [str(k) for k, state in enumerate(own) if state & set(forces) and state & set(moments)]
        states = f"self-stress state {mixed[0]}" if len(mixed) == 1 else f"self-stress states {' and '.join(mixed)}"
        why = f"{states} of its group: forces {', '.join(forces)} with moments {', '.join(moments)}"
        for row in group:
            alike = f"its dependent group holds {kinds[row]}-type rows alone"
            found[row] = UnitVerdict(row, not mixed, why if mixed else alike)
    return [found[row] for row in report.rows]


def _with_friction(alone: UnitVerdict, judged: Verdict, why: str) -> UnitVerdict:
    """With friction that reads loads which change."""
    if judged is Verdict.UNIQUE:
        return UnitVerdict(alone.name, True, "unique over all solutions with friction")
    return UnitVerdict(alone.name, False, why if alone.invariant else alone.reason)
