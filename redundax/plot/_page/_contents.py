"""The report of a mechanism in words, tables and pictures, from its analysis and family of solutions."""

from collections.abc import Sequence

import numpy as np

from ..._analysis._outputs import evaluated, outputs, sizes
from ..._analysis._report import Report, count_of
from ..._analysis._verdict import Judged, Verdict
from ..._solution_sets._family._solution_family import SolutionFamily
from ..._solve._solution import Solution
from ..._system._names import unit_of
from ..._system._pushing import in_words
from ..._system._results import RESULTS, is_one_of
from ..._system._state import State
from ..._system._system import AbstractSystem
from ..._system._units import StatedUnits, with_unit
from ._blocks import Block, Code, Items, Page, Section, Table, Text
from ._pictures import drawing, family_picture, spectrum_picture

_KINDS = {
    "acceleration": "Accelerations",
    "reaction": "Joint loads on the named bodies, without friction",
    "multiplier": "Multipliers",
    "friction": "Friction",
}
_PICTURES = 4  # self-stress states drawn, and families along them, at most
_SAME = 1e-9  # relative to the largest of a table and kind, below which values do not differ
_LEAST = 1e-13  # the same of values that are known to differ


def contents(
    title: str,
    system: AbstractSystem,
    state: State,
    report: Report,
    solution: Solution,
    families: Sequence[SolutionFamily],
    about: str,
    made: str,
) -> Page:
    """The report of a system at a state.

    - `report`, `solution`, `families`: from `analyze`, from `solve`, and along each self-stress state, all under the
      closure that `about` tells in words.
    - `made`: how the report was made, for the last section.
    """
    sections = [
        Section("In short", _short(report)),
        Section("The mechanism", (*drawing(system, state), Text(_units(report)), *_state(system, state))),
        Section("What is redundant", _redundant(report)),
    ]
    if report.pivots:
        sections.append(Section("Self-stress", _self_stress(system, state, report)))
    if report.verdicts:
        sections.append(Section("What is unique and what is not", _verdicts(report)))
    if report.releases:
        sections.append(Section("How to remove the redundancy", _releases(report)))
    sections.append(Section("Motion and loads", _values(system, state, report, solution, families, about)))
    sections.append(Section("How this report was made", (Code(made),)))
    return Page(title, tuple(sections))


def _units(report: Report) -> str:
    if report.units:
        return f"Figures are in the units of the model: {report.units}."
    return "Figures are in the units that the model is written in, which it does not state."


def _short(report: Report) -> tuple[Block, ...]:
    counts = (
        f"{count_of(len(report.rows), 'constraint')} of rank {report.rank}: {report.redundancy} redundant, "
        f"{count_of(report.freedom, 'degree')} of freedom."
    )
    if report.problem:
        return Items((counts,)), Text(f"Problem: {report.problem}", warning=True)
    items = [counts]
    items += [_share(title, report.verdicts[kind]) for kind, title in _listed(report)]
    blocks: list[Block] = [Items(tuple(items))]
    if report.left_out:
        blocks.append(Text(report.left_out, warning=True))
    if report.pulling:
        blocks.append(Text(in_words(report.pulling), warning=True))
    if report.singular_position:
        singular = "Singular position: the rank is higher beside it, and what follows holds only here."
        if report.undetermined:
            names = ", ".join(report.undetermined)
            singular = (
                "Singular position: the velocity decides the branch of motion. Without a value are multipliers that "
                f"are unbounded beside it or have no limit known: {names}."
            )
        return *blocks, Text(singular, warning=True)
    return tuple(blocks)


def _share(title: str, judged: Sequence[Judged]) -> str:
    """How many components are unique, of those that a joint can carry."""
    said = [one.with_friction for one in judged]
    zeros = said.count(Verdict.ZERO)
    text = f"{title}: {said.count(Verdict.UNIQUE)} of {len(said) - zeros} components are unique (proved)."
    return text + (f" {zeros} more are zero, because the joint carries none." if zeros else "")


def _state(system: AbstractSystem, state: State) -> tuple[Block, ...]:
    names, kinds = system.coordinates.labels, system.coordinates.kinds
    caption = f"The state, at t = {_number(float(state.t))}"
    q, qd = (tuple(map(_number, np.ravel(values))) for values in (state.q, state.qd))
    if system.adds:
        rows = tuple(zip(names, q, qd, kinds, strict=True))
        return (Table(caption, ("coordinate", "position", "velocity", "kind"), rows),)
    chart = tuple((str(number), value) for number, value in enumerate(q))
    rows = tuple(zip(names, qd, kinds, strict=True))
    return (
        Table(f"{caption}, in its chart", ("entry", "position"), chart),
        Table("Velocities", ("velocity", "value", "kind"), rows),
    )


def _redundant(report: Report) -> tuple[Block, ...]:
    blocks: list[Block] = [spectrum_picture(report)]
    if not report.redundancy:
        return *blocks, Text("No constraint is redundant: rigid-body theory determines every joint load.")
    for group in report.groups:
        blocks.append(
            Text(f"These constraints depend on each other, and none of them is the redundant one: {', '.join(group)}.")
        )
    return tuple(blocks)


def _self_stress(system: AbstractSystem, state: State, report: Report) -> tuple[Block, ...]:
    loaded = np.flatnonzero(np.any(report.self_stress != 0, axis=0))
    rows = tuple(
        (report.rows[k], *(_number(value) for value in report.self_stress[:, k]), system.rows.kinds[k]) for k in loaded
    )
    states = tuple(f"state {number}" for number in range(len(report.self_stress)))
    text = (
        "A self-stress state is a set of joint loads in balance without any applied load. Its amount is set by how the "
        "parts fit and give, which rigid bodies do not know: any multiple may be added to the loads below."
    )
    table = Table("Multipliers of the self-stress states", ("multiplier", *states, "kind"), rows)
    drawn = [drawing(system, state, self_stress=stress) for stress in report.self_stress[:_PICTURES]]
    return Text(text), *(picture for pictures in drawn for picture in pictures), table


def _verdicts(report: Report) -> tuple[Block, ...]:
    blocks: list[Block] = [Text(report.left_out)] if report.left_out else []
    for kind, title in _listed(report):
        groups: dict[tuple[str, str], list[str]] = {}
        for judged in report.verdicts[kind]:
            key = judged.with_friction.value, _why(judged, report)
            groups.setdefault(key, []).append(judged.name)
        order = [verdict.value for verdict in Verdict]
        told = sorted(groups.items(), key=lambda group: order.index(group[0][0]))
        rows = tuple((verdict, ", ".join(names), why) for (verdict, why), names in told)
        blocks.append(Table(title, ("verdict", "components", "why"), rows))
    if report.friction_reads:
        names = ", ".join(report.friction_reads)
        blocks.append(Text(f"Friction depends on multipliers that are not unique: {names}."))
    return tuple(blocks)


def _why(judged: Judged, report: Report) -> str:
    verdict = judged.with_friction
    if verdict is Verdict.UNIQUE:
        frictionless = report.spectral_radius is None
        reaches = "no self-stress" if frictionless else "neither self-stress nor friction that varies with it"
        return f"the same in every solution: {reaches} reaches it"
    if verdict is Verdict.ZERO:
        return "the joint can carry no such load at this position"
    if verdict is Verdict.NO_CHANGE:
        return (
            "friction that varies with the self-stress reaches it; no solution that was looked at changes it: no proof"
        )
    if verdict is Verdict.UNDECIDED:
        resting = "a joint with friction rests, where friction can take any value up to its bound"
        return resting if report.at_rest else "friction is not proved to have one solution"
    if not judged.moved_by:
        return "no mass determines it: condition (14) fails"
    states = ", ".join(map(str, judged.moved_by))
    through = " through friction" if judged.without_friction is Verdict.UNIQUE else ""
    return f"changes with self-stress state {states}{through}"


def _releases(report: Report) -> tuple[Block, ...]:
    rows = tuple(
        ("; ".join(_direction(*direction) for direction in release.directions), f"{release.determinant:.3f}")
        for release in report.releases
    )
    text = (
        "Each line removes all redundancy and adds no degree of freedom: let the joint give way in the direction "
        "named, by play or by a joint of another kind. The larger the measure, 1 at most, the farther is the new "
        "mechanism from a position where it gains a motion."
    )
    return Text(text), Table("Directions to release", ("joint and direction", "measure"), rows)


def _direction(joint: str, shares: dict[str, float]) -> str:
    if len(shares) == 1:
        return f"{joint}: {next(iter(shares))}"
    return f"{joint}: {' '.join(f'{share:+.3g} {row}' for row, share in shares.items())}"


def _values(
    system: AbstractSystem,
    state: State,
    report: Report,
    solution: Solution,
    families: Sequence[SolutionFamily],
    about: str,
) -> tuple[Block, ...]:
    if not is_one_of(solution.result, RESULTS.successful):
        return (Text(f"No values: {RESULTS[solution.result]}", warning=True),)
    blocks: list[Block] = []
    if report.redundancy:
        blocks.append(
            Text(
                f"Values are those of {about} (Moore-Penrose inverse): a convention, not physics, for what is not "
                "unique. Loads to rely on need the joints' compliance: rx.Compliance or rx.ElasticJoints."
            )
        )
    if report.unit_dependent:
        names = ", ".join(report.unit_dependent)
        blocks.append(
            Text(f"The unit of length of the norm matters to {names}; this one is a length of the mechanism.")
        )
    if families:
        blocks.append(Text(_looked_at(families)))
    if not report.undetermined:
        blocks += drawing(system, state, multipliers=np.asarray(solution.multipliers))
    x = np.concatenate([solution.acceleration, solution.multipliers, solution.friction])
    found = np.concatenate([x[None], *(family.values for family in families)])
    given = outputs(system, state)
    for kind, title in _listed(report):
        names, matrix = given[kind]
        said = [judged.with_friction for judged in report.verdicts[kind]]
        kinds = _kinds(kind, names, system)
        value, others = evaluated(matrix, x), evaluated(matrix, found)
        blocks.append(_ranges(title, names, kinds, system.names.units, report.length, said, value, others))
    if report.spectral_radius is not None:
        blocks += [family_picture(family) for family in families[:_PICTURES]]
    return tuple(blocks)


def _ranges(
    title: str,
    names: Sequence[str],
    kinds: Sequence[str],
    units: StatedUnits,
    length: float,
    said: Sequence[Verdict],
    value: np.ndarray,
    found: np.ndarray,
) -> Table:
    """Values of minimum norm, and where the solutions (number, outputs) differ the least and the largest."""
    size = sizes(np.nan_to_num(found).T, kinds, length).max(axis=1)
    rounding = size * np.array([_LEAST if one is Verdict.NOT_UNIQUE else _SAME for one in said])
    found, value = (np.where(np.abs(array) <= rounding, 0.0, array) for array in (found, value))
    differs, told = np.ptp(found, axis=0) > rounding, [with_unit(kind, unit_of(kind, units)) for kind in kinds]
    differs &= np.array([one not in (Verdict.UNIQUE, Verdict.ZERO) for one in said])
    ends = zip(found.min(axis=0), found.max(axis=0), strict=True)
    rows = [
        (name, _number(value[k]), *(_apart(low, high) if differs[k] else ("", "")), told[k])
        for k, (name, (low, high)) in enumerate(zip(names, ends, strict=True))
    ]
    if not differs.any():
        return Table(title, ("component", "value", "kind"), tuple((row[0], row[1], row[4]) for row in rows))
    return Table(title, ("component", "minimum norm", "least", "largest", "kind"), tuple(rows))


def _apart(low: float, high: float) -> tuple[str, str]:
    """Two numbers with the digits that tell them apart."""
    texts = [(f"{low + 0.0:.{digits}g}", f"{high + 0.0:.{digits}g}") for digits in (5, 8, 11, 14)]
    return next((pair for pair in texts if pair[0] != pair[1]), texts[-1])


def _kinds(kind: str, names: Sequence[str], system: AbstractSystem) -> list[str]:
    known = system.names.reactions if kind == "reaction" else system.names.unknowns
    return [known.kinds[known.labels.index(name)] for name in names]


def _looked_at(families: Sequence[SolutionFamily]) -> str:
    ends = [(family.along[0], *(_number(end) for end in family.axes[0][[0, -1]])) for family in families]
    ranges = ", ".join(f"{low} to {high} of {name}" for name, low, high in ends)
    assumption = families[0].assumption or "These amplitudes were given."
    text = (
        f"Least and largest are over self-stress added, one state at a time: {ranges}. {assumption} "
        "rx.band bounds what preload, misfit or compliance known to you leave open."
    )
    count = np.concatenate([family.count for family in families])
    missing, several = np.sum(count == 0), np.sum(count > 1)
    text += f" At {missing} amplitudes no solution was found." if missing else ""
    return text + (f" At {several} amplitudes there are several." if several else "")


def _listed(report: Report) -> list[tuple[str, str]]:
    """The kinds of outputs to tell of: joint loads stand for multipliers where there are some."""
    skipped = "multiplier" if "reaction" in report.verdicts else "reaction"
    return [(kind, title) for kind, title in _KINDS.items() if kind != skipped and report.verdicts.get(kind)]


def _number(value: float) -> str:
    return "no value" if np.isnan(value) else f"{value + 0.0:.5g}"
