"""What joint limits bear that a model stands at, as stops that only push: `redundax audit --stops`."""

from typing import Required, TypedDict

from .._analysis._analyze import analyze
from .._analysis._outputs import plain
from .._models._choice import listed
from .._models._model import Model
from .._models._repair_page import wrapped
from .._solve._solve import solve
from .._system._contact import Contact
from .._system._state import State
from .._tools._json import JSON

_MOST = 8  # stops named


class Stop(TypedDict):
    """What a stop does, and what it bears: a force or a moment, and whether that is unique."""

    does: str
    load: JSON
    kind: str
    unique: bool


class Stops(TypedDict, total=False):
    """Redundancy and freedom with the stops that are closed, and what is wrong of them, where there are some; and each
    by the joint's end."""

    redundancy: int
    freedom: int
    problem: str
    stops: Required[dict[str, Stop]]


def stops_of(model: Model, state: State) -> Stops:
    """As plain data."""
    mechanism = model.stopped
    names = mechanism.names
    if not names.one_sided:
        return {"stops": {}}
    report, found = analyze(mechanism, state), solve(mechanism, state, throw=False)
    loads = dict(zip(names.rows.labels, found.multipliers.tolist(), strict=True))
    return {
        "redundancy": report.redundancy,
        "freedom": report.freedom,
        "problem": report.problem,
        "stops": {
            row.removeprefix("stop of "): {
                "does": str(word),
                "load": plain(loads[row]),
                "kind": names.rows.kinds[place],
                "unique": row in report.unique_multipliers,
            }
            for place, word in zip(names.one_sided, report.contacts.values(), strict=True)
            for row in [names.rows.labels[place]]
        },
    }


def stops_page(found: Stops) -> list[str]:
    """The same in lines."""
    stops = found["stops"]
    if not stops:
        return ["Stops: the file limits no hinge and no slide."]
    if problem := found.get("problem"):
        return [f"Stops: {problem}"]
    by_word = {word: [name for name, stop in stops.items() if stop["does"] == word] for word in Contact}
    lines = wrapped(
        f"With joint limits as stops, at rest and let go: {found.get('redundancy')} redundant, {found.get('freedom')} "
        "free; "
        f"{len(by_word[Contact.open])} of {len(stops)} stops are open.",
        subsequent_indent="  ",
    )
    for name in by_word[Contact.carries][:_MOST]:
        stop = stops[name]
        unit = "N m" if stop["kind"] == "moment" else "N"
        why = "unique" if stop["unique"] else "not unique: of least norm"
        lines.append(f"  {name} carries {stop['load']:.6g} {unit}, {why}")
    if others := len(by_word[Contact.carries]) - _MOST:
        lines += [f"  and {others} more carry"] if others > 0 else []
    lines += [f"  {listed(by_word[word], _MOST)}: {word}" for word in (Contact.touches, Contact.lifts) if by_word[word]]
    return lines
