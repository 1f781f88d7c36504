"""What to do about redundancy, as text: two ways at most for what belongs together, or all that were found."""

import re
import shlex
import textwrap
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from typing import TypeVar

import numpy as np

from .._analysis._release import Release
from .._tools._table import WIDTH
from ._audit import Audit, Group
from ._choice import USABLE, Choice, Repair, in_words, listed, vector

Alike = TypeVar("Alike")
Lines = Mapping[tuple[str, ...], Sequence[str]]  # what to write in a file, by the rows that it frees
_MOST = 4  # rows to be typed
_BEST = "first what stays farthest from a further motion"
_WRITTEN = 2  # changes of a file told in full
VECTOR = re.compile(r"\([-\d.e+]+ [-\d.e+]+ [-\d.e+]+\)")
_WHOLE = re.compile(rf"{VECTOR.pattern}|(?:<- )?--release (?:'[^']*'|\S+)|\w+=\"[^\"]*\"")


def wrapped(
    text: str, *, initial_indent: str = "", subsequent_indent: str = "", break_on_hyphens: bool = True
) -> list[str]:
    """Lines of a text, with directions, attributes and what is to be typed in one piece."""
    whole = _WHOLE.sub(lambda found: found[0].replace(" ", "\0"), text)
    return [
        line.replace("\0", " ")
        for line in textwrap.wrap(whole, WIDTH, initial_indent=initial_indent, subsequent_indent=subsequent_indent)
    ]


def mended(found: Audit, lines: Lines, language: str, everything: bool = False) -> Iterator[str]:
    """What to do: two ways at most for what belongs together; what is alike once, or all of it if wanted."""
    if not found.figures[0]:
        return
    if not language:
        yield f"To mend it, free what each line names, if your hardware has that play; {_BEST} here:"
        for group, *others in kept_together(found.groups, lambda each: _group_form(each, found), everything):
            ways = [_together(_freed_by(each)) for each in group.releases[:2]]
            more = told_alike(others, lambda each: [row.rpartition(".")[0] for row in each.rows])
            yield from wrapped(f"- {' or: '.join(ways)}{more}", initial_indent="  ", subsequent_indent="    ")
        return
    yield "To mend it, take the line that matches your hardware (directions in world axes):"
    also = any(len(each.choices) > 1 for each in found.repairs)
    other = f"; after 'or' {_BEST.removeprefix('first ')}" if also else ""
    yield from wrapped(f"First what frees loops, then joints that carry least{other}.")
    alike = kept_together(found.repairs, lambda each: _form(each, found), everything)
    for number, (repair, *others) in enumerate(alike, 1):
        if len(found.repairs) > 1:
            yield from wrapped(f"{number}. of {listed(_joints_of(repair), 4)}{told_alike(others, _joints_of)}:")
        for k, choice in enumerate(repair.choices):
            yield from _told(choice, repair, found, k, lines)
            yield from _rest(repair, found, language) if k == 0 else ()
        if not repair.choices:
            yield f"  - nothing that {language} can say; --all lists the rows to free"


def kept_together(parts: Sequence[Alike], form: Callable[[Alike], Hashable], everything: bool) -> list[list[Alike]]:
    """Parts of the same form together, if they are three or more and not everything is to be told."""
    alike: dict[Hashable, list[Alike]] = {}
    for part in parts:
        alike.setdefault(form(part), []).append(part)
    told = [some for some in alike.values() if len(some) > 2 and not everything]
    first = {id(some[0]): some for some in told}
    rest = {id(part) for some in told for part in some[1:]}
    return [first.get(id(part), [part]) for part in parts if id(part) not in rest]


def told_alike(others: Sequence[Alike], joints: Callable[[Alike], Sequence[str]]) -> str:
    """How many more are as the one that is told, by the first joint of each."""
    if not others:
        return ""
    return (
        f", and alike {len(others)} more times (with {listed([joints(each)[0] for each in others])}; --all tells each)"
    )


def _joints_of(repair: Repair) -> list[str]:
    return list(dict.fromkeys(row.rpartition(".")[0] for row in repair.rows))


def _form(repair: Repair, found: Audit) -> str:
    """What repairs that are alike have in common: kinds of joints and what their changes free, in any direction."""
    choices = [
        (each.is_usable, [(edit.how, _rows_form(edit.rows, found)) for edit in each.edits]) for each in repair.choices
    ]
    return str((repair.redundancy, _rows_form(repair.rows, found), choices, _rows_form(repair.rest, found)))


def _group_form(group: Group, found: Audit) -> str:
    """As `_form`, of groups of rows."""
    freed = [_rows_form(_freed_by(each), found) for each in group.releases[:2]]
    return str((group.redundancy, _rows_form(group.rows, found), freed))


def _rows_form(rows: Sequence[str], found: Audit) -> list[tuple[str, list[str]]]:
    """Kinds of joints, and their rows without the number that tells one direction from another."""
    kinds, joints = {part.name: part.kind for part in found.parts}, {}
    for name, _, own in (row.rpartition(".") for row in rows):
        joints.setdefault(name, set()).add(own.partition("_")[0])
    return sorted((kinds.get(name, ""), sorted(own)) for name, own in joints.items())


def _freed_by(release: Release) -> list[str]:
    return [row for _, shares in release.directions for row in shares]


def _told(choice: Choice, repair: Repair, found: Audit, k: int, lines: Lines) -> Iterator[str]:
    words = "; ".join(in_words(choice.edits, found.directions))
    left = repair.redundancy - len(choice.rows)
    after = f": redundant by {repair.redundancy} -> {left}" if left else ""
    poor = "" if choice.is_usable else f"; moves freely near {choice.where}: not usable over the full motion"
    rows = choice.rows
    how = (
        "  <- --fix takes it"
        if k == 0
        else f"  <- --release {shlex.quote(','.join(rows))}"
        if len(rows) <= _MOST
        else "  <- its rows for --release are in --json"
    )
    yield from wrapped(
        f"{'- ' if k == 0 else '- or: '}{words}{after}{poor}{how}", initial_indent="  ", subsequent_indent="    "
    )
    written = [line for edit in choice.edits for line in lines.get(edit.rows, ())]
    for line in written if k == 0 and len(written) <= _WRITTEN else ():
        yield from wrapped(line, initial_indent="      ", subsequent_indent="        ", break_on_hyphens=False)


def _rest(repair: Repair, found: Audit, language: str) -> Iterator[str]:
    if repair.rest:
        rows = listed([_row(row, found.directions) for row in repair.rest])
        yield from wrapped(
            f"The rest would need play in {rows}, which {language} cannot express.",
            initial_indent="    ",
            subsequent_indent="    ",
        )


def _row(row: str, directions: Mapping[str, np.ndarray]) -> str:
    if row not in directions:
        return row
    is_moment = row.rpartition(".")[2].startswith(("bend", "twist"))
    return f"{row} ({'moment about' if is_moment else 'force along'} {vector(directions[row])})"


def _together(rows: Sequence[str]) -> str:
    """Rows, joint by joint."""
    joints: dict[str, list[str]] = {}
    for row in rows:
        joint, _, own = row.rpartition(".")
        joints.setdefault(joint, []).append(own)
    return ", ".join(
        f"{joint} ({', '.join(own)})" if len(own) > 1 else f"{joint}.{own[0]}" for joint, own in joints.items()
    )


def all_releases(found: Audit, language: str) -> Iterator[str]:
    """All releases that were found, and what their rows are along."""
    said = [set(rows) for each in found.repairs for rows in each.sayable]
    for number, group in enumerate(found.groups, 1):
        head = f"Group {number} of loads that depend on each other, redundant by {group.redundancy}: "
        rows = "; ".join(_row(row, found.directions) for row in group.rows)
        yield from wrapped(head + rows, subsequent_indent="  ")
        first = f"first what {language} can say, of these {_BEST}" if language else _BEST
        yield from wrapped(
            f"Each line frees it; {first}, by the least along the motion (from 0 to 1, here and least along it):",
            initial_indent="  ",
            subsequent_indent="  ",
        )
        free = [_freed_by(each) for each in group.releases]
        can = [{row for rows in said if rows <= set(own) for row in rows} == set(own) for own in free]
        for k in sorted(range(len(free)), key=lambda k: not can[k]):
            margin = group.releases[k].determinant ** (1 / len(free[k]))
            least = group.margins[k] if group.margins else margin
            note = "" if not language or can[k] else f" (not possible in {language})"
            worse = " not over the full motion" if least <= USABLE else ""
            yield from wrapped(
                f"{_together(free[k])} {margin:.2f}, {least:.2f}{worse}{note}",
                initial_indent="    ",
                subsequent_indent="        ",
            )
