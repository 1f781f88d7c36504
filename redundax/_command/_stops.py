"""What joint limits bear that a model stands at, as stops that only push: `redundax audit --stops`."""

from typing import TypedDict, final

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


@final
class NoStops(TypedDict):
    """Of a file that limits nothing."""

    stops: dict[str, Stop]


@final
class Stops(TypedDict):
    """Redundancy and freedom with the stops that are closed, and what is wrong of them; and each by the joint's end."""

    redundancy: int
    freedom: int
    problem: str
    stops: dict[str, Stop]


def stops_of(model: Model, state: State) -> Stops | NoStops:
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


def stops_page(found: Stops | NoStops) -> list[str]:
    """The same in lines."""
    if "problem" not in found:
        return ["Stops: the file limits no hinge and no slide."]
    if found["problem"]:
        return [f"Stops: {found['problem']}"]
    stops = found["stops"]
    by_word = {word: [name for name, stop in stops.items() if stop["does"] == word] for word in Contact}
    lines = wrapped(
        f"With joint limits as stops, at rest and let go: {found['redundancy']} redundant, {found['freedom']} "
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
