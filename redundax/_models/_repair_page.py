"""What to do about redundancy, as text: two ways at most for what belongs together, or all that were found."""

import re
import shlex
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from .._tools._table import WIDTH
from ._audit import Audit
from ._choice import USABLE, Choice, Repair, in_words, listed, vector

Lines = Mapping[tuple[str, ...], Sequence[str]]  # what to write in a file, by the rows that it frees
_MOST = 4  # rows to be typed
_WRITTEN = 2  # changes of a file told in full
_VECTOR = re.compile(r"\([-\d.e+]+ [-\d.e+]+ [-\d.e+]+\)")


def wrapped(text: str, **how: Any) -> list[str]:
    """Lines of a text, with directions in one piece."""
    whole = _VECTOR.sub(lambda found: found[0].replace(" ", "\0"), text)
    return [line.replace("\0", " ") for line in textwrap.wrap(whole, WIDTH, **how)]


def mended(found: Audit, lines: Lines, language: str) -> Iterator[str]:
    """What to do: two ways at most for what belongs together."""
    if not found.figures[0]:
        return
    if not language:
        yield "To mend it, free what each line names, if your hardware has that play:"
        for group in found.groups:
            ways = [_together([row for _, shares in each.directions for row in shares]) for each in group.releases[:2]]
            yield from wrapped(f"- {' or: '.join(ways)}", initial_indent="  ", subsequent_indent="    ")
        return
    yield "To mend it, take the line that matches your hardware (directions in world axes):"
    several = len(found.repairs) > 1
    for number, repair in enumerate(found.repairs, 1):
        if several:
            yield f"{number}. of {listed(list(dict.fromkeys(row.rpartition('.')[0] for row in repair.rows)), 4)}:"
        for k, choice in enumerate(repair.choices):
            yield from _told(choice, repair, found, k, lines)
            yield from _rest(repair, found, language) if k == 0 else ()
        if not repair.choices:
            yield f"  - nothing that {language} can say; --all lists the rows to free"


def _told(choice: Choice, repair: Repair, found: Audit, k: int, lines: Lines) -> Iterator[str]:
    words = "; ".join(in_words(choice.edits, found.directions))
    left = repair.redundancy - len(choice.rows)
    after = f": redundant by {repair.redundancy} -> {left}" if left else ""
    where = f"{choice.at[0]} = {choice.at[1]:.3g}"
    poor = "" if choice.is_usable else f"; moves freely near {where}: not usable over the full motion"
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
        yield "  Each line frees it (from 0 to 1 how far from moving: here, least along the motion):"
        for k, release in enumerate(group.releases):
            free = [row for _, shares in release.directions for row in shares]
            margin = release.determinant ** (1 / len(free))
            least = group.margins[k] if group.margins else margin
            can = {row for rows in said if rows <= set(free) for row in rows}
            note = "" if not language or can == set(free) else f" (not possible in {language})"
            worse = " not over the full motion" if least <= USABLE else ""
            yield from wrapped(
                f"{_together(free)} {margin:.2f}, {least:.2f}{worse}{note}",
                initial_indent="    ",
                subsequent_indent="        ",
            )
