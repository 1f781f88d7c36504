"""The report of a mechanism in words, tables and pictures, from its analysis and families of solutions."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from ..._analysis._outputs import evaluated, sizes
from ..._analysis._report import Report, count_of
from ..._analysis._verdict import Judged, Verdict
from ..._solution_sets._family._solution_family import SolutionFamily
from ..._solve._solution import Solution
from ..._system._pushing import in_words
from ..._system._results import RESULTS, is_one_of
from ..._system._state import State
from ..._system._system import AbstractSystem
from ..._system._units import with_unit
from ..._tools._table import figures
from ._blocks import Block, Code, Items, Page, Section, Table, Text
from ._pictures import drawing, family_picture, spectrum_picture
from ._values import Outputs, all_outputs, clean, number

_PICTURES = 4  # self-stress states drawn, and families along them, at most

_STATES_NAMED = 4  # amplitudes of self-stress states that the page begins with


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
    every = all_outputs(system, state, report, solution, families)
    sections = [
        Section("In short", _short(report, every, families)),
        Section(
            "The mechanism", (*drawing(system, state, "The mechanism at this state", report), Text(_units(report)))
        ),
        Section("Motion and loads", _values(system, state, report, solution, every, families, about)),
    ]
    if every:
        sections.append(Section("What is unique and what is not", _verdicts(report, every)))
    sections.append(Section("What is redundant", _redundant(system, state, report, every)))
    if report.releases:
        sections.append(Section("How to remove the redundancy", _releases(report)))
    sections.append(Section("The state", _state(system, state, report)))
    sections.append(Section("How this report was made", (Code(made),)))
    return Page(title, tuple(sections))


def _units(report: Report) -> str:
    if report.units:
        return f"Figures are in the units of the model: {report.units}."
    return "Figures are in the units that the model is written in, which it does not state."


def _short(report: Report, every: Mapping[str, Outputs], families: Sequence[SolutionFamily]) -> tuple[Block, ...]:
    counts = (
        f"{count_of(len(report.rows), 'constraint')} of rank {report.rank}: {report.redundancy} redundant, "
        f"{count_of(report.freedom, 'degree')} of freedom."
    )
    if report.problem:
        return Items((counts,)), Text(f"Problem: {report.problem}", warning=True)
    friction = "Joints have friction, and all that follows is with it."
    friction = friction if report.spectral_radius is not None else "The model has no friction."
    blocks: list[Block] = [Items((counts, friction, *(one.counted() for one in every.values())))]
    spans = [str(span) for one in every.values() for span in one.widest()]
    if spans:
        blocks += [Text(f"{_added(families)}, these vary most:"), Items(tuple(spans))]
    warnings = [report.left_out, in_words(report.pulling) if report.pulling else "", _singular(report)]
    return *blocks, *(Text(warning, warning=True) for warning in warnings if warning)


def _added(families: Sequence[SolutionFamily]) -> str:
    """Which self-stress the ranges are over, of many states the first."""
    amounts = [
        f"{np.abs(one.axes[0]).max():.4g} {one.units[one.names.index(name)]}".rstrip() + f" at {name}"
        for one in families
        for name in one.along
    ]
    given = "which is assumed as no preload is known" if families[0].assumption else "as was asked for"
    left = len(amounts) - _STATES_NAMED
    more = f", or likewise along {count_of(left, 'more state')}" if left > 0 else ""
    return f"Where self-stress is added, up to {' or '.join(amounts[:_STATES_NAMED])}{more}, {given}"


def _singular(report: Report) -> str:
    if not report.singular_position:
        return ""
    if not report.undetermined:
        return "Singular position: the rank is higher beside it, and what follows holds only here."
    return (
        "Singular position: the velocity decides the branch of motion. Without a value are multipliers that "
        f"are unbounded beside it or have no limit known: {', '.join(report.undetermined)}."
    )


def _values(
    system: AbstractSystem,
    state: State,
    report: Report,
    solution: Solution,
    every: Mapping[str, Outputs],
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
        blocks.append(Text(f"With another unit of length the norm gives other values to {names}."))
    if families:
        blocks.append(Text(_looked_at(families)))
    if "reaction" in report.verdicts:
        apart = " The friction of a joint is listed apart, and not drawn." if system.friction else ""
        blocks.append(Text(f"Joint loads act on the body that is named.{apart}"))
    if not report.undetermined:
        blocks += drawing(system, state, "Joint loads", report, multipliers=np.asarray(solution.multipliers))
    blocks += [one.table() for one in every.values()]
    if report.spectral_radius is not None:
        names = [name for one in every.values() for name in one.names]
        blocks += [family_picture(_told(one, every, report.length), names) for one in families[:_PICTURES]]
    return tuple(blocks)


def _told(family: SolutionFamily, every: Mapping[str, Outputs], length: float) -> SolutionFamily:
    """A family with these outputs beside its own."""
    more = [one for one in every.values() if not set(one.names) <= set(family.names)]
    values = [evaluated(one.matrix, family.values) for one in more]
    found = zip(values, more, strict=True)
    size = [sizes(np.nan_to_num(each).T, one.kinds, length).max(axis=1, initial=0.0) for each, one in found]
    return dataclasses.replace(
        family,
        names=sum((one.names for one in more), family.names),
        kinds=sum((one.kinds for one in more), family.kinds),
        units=sum((one.units for one in more), family.units),
        values=np.hstack([family.values, *values]),
        sizes=np.concatenate([family.sizes, *size]),
    )


def _looked_at(families: Sequence[SolutionFamily]) -> str:
    text = f"Least and largest are over self-stress added, one state at a time. {families[0].assumption} "
    text += "rx.band bounds what preload, misfit or compliance known to you leave open."
    count = np.concatenate([family.count for family in families])
    missing, several = np.sum(count == 0), np.sum(count > 1)
    text += f" At {missing} amplitudes no solution was found." if missing else ""
    return text + (f" At {several} amplitudes there are several." if several else "")


def _verdicts(report: Report, every: Mapping[str, Outputs]) -> tuple[Block, ...]:
    blocks: list[Block] = [Text(report.left_out)] if report.left_out else []
    order = [verdict.value for verdict in Verdict]
    for one in every.values():
        groups: dict[tuple[str, str], list[str]] = {}
        for judged in one.judged:
            key = judged.with_friction.value, _why(judged, report)
            groups.setdefault(key, []).append(judged.name)
        told = sorted(groups.items(), key=lambda group: order.index(group[0][0]))
        rows = tuple((verdict, ", ".join(names), why) for (verdict, why), names in told)
        blocks.append(Table(one.title, ("verdict", "components", "why"), rows))
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
    if judged.without_friction is Verdict.UNDECIDED:
        return "it reads a load that is unbounded beside this singular position, or has no limit known there"
    if verdict is Verdict.UNDECIDED:
        resting = "a joint with friction rests, where friction can take any value up to its bound"
        return resting if report.at_rest else "friction is not proved to have one solution"
    if not judged.moved_by:
        return "no mass determines it: condition (14) fails"
    states = f"state{'' if len(judged.moved_by) == 1 else 's'} {', '.join(map(str, judged.moved_by))}"
    through = " through friction" if judged.without_friction is Verdict.UNIQUE else ""
    return f"changes with self-stress {states}{through}"


def _redundant(system: AbstractSystem, state: State, report: Report, every: Mapping[str, Outputs]) -> tuple[Block, ...]:
    picture = spectrum_picture(report)
    if not report.redundancy:
        return Text("No constraint is redundant: rigid-body theory determines every joint load."), picture
    each = "These constraints depend on each other, and none of them is the redundant one:"
    groups = [Text(f"{each} {', '.join(group)}.") for group in report.groups]
    if not groups:
        groups = [Text("At this position alone constraints depend on each other: beside it there is no self-stress.")]
    return *groups, *_self_stress(system, state, report, every), picture


def _self_stress(
    system: AbstractSystem, state: State, report: Report, every: Mapping[str, Outputs]
) -> tuple[Block, ...]:
    if not report.pivots:
        return ()
    amounts = ", ".join(f"state {number} of {pivot}" for number, pivot in enumerate(report.pivots))
    text = (
        "A self-stress state is a set of joint loads in balance without any applied load. Its amount is set by how the "
        "parts fit and give, which rigid bodies do not know: any multiple may be added to the loads above. "
        f"Each is shown for an amount of 1: {amounts}."
    )
    drawn = [
        drawing(system, state, f"Self-stress state {number}", self_stress=stress)
        for number, stress in enumerate(report.self_stress[:_PICTURES])
    ]
    loads = every.get("reaction", every.get("multiplier"))
    table = () if loads is None else (_stress_table(system, report, loads),)
    return Text(text), *(picture for pictures in drawn for picture in pictures), *table


def _stress_table(system: AbstractSystem, report: Report, loads: Outputs) -> Table:
    """The loads of an amount of 1 of each state."""
    unknowns = np.pad(report.self_stress, ((0, 0), (len(system.coordinates), len(system.slips))))
    found = clean(evaluated(loads.matrix, unknowns), loads.kinds, report.length)
    rows = tuple(
        (loads.names[k], *map(number, found[:, k]), loads.kinds[k]) for k in np.flatnonzero(np.any(found, axis=0))
    )
    states = tuple(f"state {number}" for number in range(len(found)))
    return Table(f"{loads.title} of the self-stress states", ("component", *states, "kind"), rows)


def _releases(report: Report) -> tuple[Block, ...]:
    rows = tuple(str(release).rpartition(": ")[::2] for release in report.releases)
    text = (
        "Each line removes all redundancy and adds no degree of freedom: let the joint give way in the direction "
        "named, by play or by a joint of another kind. The larger the measure, 1 at most, the farther is the new "
        "mechanism from a position where it gains a motion."
    )
    return Text(text), Table("Directions to release", ("joint and direction", "measure"), rows)


def _state(system: AbstractSystem, state: State, report: Report) -> tuple[Block, ...]:
    names, kinds, units = system.coordinates.labels, system.coordinates.kinds, system.names.units
    caption = f"The state, at t = {number(float(state.t))} {units.of('time')}".rstrip()
    q, qd = (np.ravel(values) for values in (state.q, state.qd))
    rates = tuple(map(number, clean(qd, kinds, report.length)))
    both = tuple(
        with_unit(kind, ", ".join(filter(None, (units.of(kind, rate) for rate in range(1 - system.adds, 2)))))
        for kind in kinds
    )
    if system.adds:
        rows = tuple(zip(names, map(number, clean(q, kinds, report.length)), rates, both, strict=True))
        return (Table(caption, ("coordinate", "position", "velocity", "kind"), rows),)
    chart = tuple((str(place), value) for place, value in enumerate(figures(q, digits=5)))
    return (
        Table(f"{caption}, in its chart", ("entry", "position"), chart),
        Table("Velocities", ("velocity", "value", "kind"), tuple(zip(names, rates, both, strict=True))),
    )
