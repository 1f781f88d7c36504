"""An audit as text, for somebody who has never heard of redundancy: the verdict, what to do, then the figures."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from .._tools._table import WIDTH
from ._audit import Audit, Look, Part
from ._choice import listed, vector
from ._drives import Drives
from ._repair_page import Lines, all_releases, mended, wrapped
from ._travel import Travel
from ._tree import WITHOUT

_ROWS = {
    "axial": "force along the axis",
    "radial": "forces across it",
    "bend": "moments about directions across it",
    "twist": "moment about it",
    "coupling": "what couples two joints",
}
_MOST = 4  # singular positions listed
_ROUNDING = 1e-11  # of singular values
_SIDEWAYS = "a sideways load, along "
_SPAN = 1e-6  # of directions of loads that are not unique


def audit_page(
    found: Audit,
    about: Mapping[str, Any],
    *,
    lines: Lines,
    language: str = "",
    allowed: int = 0,
    everything: bool = False,
) -> str:
    """What is redundant, what that means, and what to do.

    **Arguments:**

    - `about`: what is to be said of the file; `language`: its kind; `lines`: what to write in it, by rows freed.
    - `allowed`: redundancy that is no fault; `everything`: all releases that were found, too.
    """
    first = [*_verdict(found, about, allowed)]
    if not found.is_stuck:
        first += [
            *_positions(found),
            *(_drives(found, found.drives) if found.drives and found.drives.names else ()),
        ]
    text = ["\n".join(line for each in first for line in wrapped(each))]
    if not found.is_stuck and found.is_decided:
        text += ["\n".join(mended(found, lines, language))]
        text += ["\n".join(all_releases(found, language))] if everything else []
        text += ["\n".join(_joints(found))]
    figures = [*_figures(found)]
    text.append("\n".join(line for each in figures for line in wrapped(each, subsequent_indent="  ")))
    return "\n\n".join(each for each in text if each)


def _verdict(found: Audit, about: Mapping[str, Any], allowed: int) -> Iterator[str]:
    redundancy = found.figures[0]
    missing = [note.partition(" is left out")[0] for note in about.get("left_out", ()) if note.endswith(WITHOUT)]
    if found.is_stuck:
        yield (
            "UNDECIDED: in this file the mechanism is at a dead point, and cannot be moved away from it. Nothing found "
            "here holds of the machine. Give the file another position, with links that are not in line. No repair is "
            "proposed."
        )
        return
    if missing:
        are, them = ("is", "it") if len(missing) == 1 else ("are", "them")
        yield f"UNDECIDED: {listed(missing)} {are} not taken over. Without {them}:"
    if not found.is_decided:
        yield "UNDECIDED: the positions below do not agree, or are not clear."
    elif redundancy:
        accepted = f", allowed {allowed}: accepted" if allowed >= redundancy else ""
        what = "constraint repeats" if redundancy == 1 else "constraints repeat"
        yield (
            f"REDUNDANT by {redundancy}{accepted}: {redundancy} {what} what others already enforce, so that parts are "
            "held twice."
        )
        yield from _unknown(found)
        yield (
            "A simulator prints one of many such loads: do not size parts or train controllers by them. The motion is "
            "right, unless those joints have friction."
        )
    elif missing:
        yield "Nothing is redundant in what was read, which does not say that nothing is."
    elif about and not about.get("loops"):
        yield "NOT REDUNDANT: no loops (no connect, weld or joint equality was found), so there is nothing to check."
    else:
        yield "NOT REDUNDANT: no constraint repeats others. Every joint load of this model is unique."


def _unknown(found: Audit) -> Iterator[str]:
    """Which loads are not unique: groups of the same joints together."""
    rows: dict[tuple[str, ...], list[str]] = {}
    for group in found.groups:
        joints = tuple(dict.fromkeys(row.rpartition(".")[0] or row for row in group.rows))
        rows.setdefault(joints, []).extend(group.rows)
    told: dict[str, list[str]] = {}
    for joints, own in rows.items():
        told.setdefault(_split(found, own), []).append(f"between {listed(joints)}")
    planar = all(what.startswith(_SIDEWAYS) for what in told) and len(told) == 1
    known = f"Known: loads in the plane across {next(iter(told))[len(_SIDEWAYS) :]}, in world axes. " if planar else ""
    for what, between in told.items():
        verb = ", splits" if what.startswith(_SIDEWAYS) else " split"
        yield f"{known}Not known: how {what}{verb} {', and '.join(between)}."


def _split(found: Audit, rows: Sequence[str]) -> str:
    """In words, what of the loads of some rows is not unique."""
    forces, moments = (_span(found, rows, words) for words in (("radial", "axial"), ("bend", "twist")))
    if len(forces) == 1 and (not len(moments) or np.abs(moments @ forces[0]).max() < _SPAN**0.5):
        return f"{_SIDEWAYS}{vector(forces[0])}"
    what = [_kinds("forces", "along", forces), _kinds("moments", "about", moments)]
    return " and ".join(each for each in what if each) or "loads"


def _kinds(what: str, way: str, span: np.ndarray) -> str:
    if len(span) == 2:
        across = np.cross(*span)
        return f"{what} {'' if way == 'along' else 'about axes '}across {vector(_signed(across))}"
    if len(span) == 1:
        return f"{what} {way} {vector(span[0])}"
    return what if len(span) else ""


def _signed(along: np.ndarray) -> np.ndarray:
    return along * np.sign(along[np.argmax(np.abs(along))])


def _span(found: Audit, rows: Sequence[str], words: Sequence[str]) -> np.ndarray:
    """World directions of the loads of some rows that are not unique, as rows."""
    own = [row for row in rows if row.rpartition(".")[2].startswith(tuple(words)) and row in found.directions]
    places, total = [found.rows.index(row) for row in own], np.zeros((3, 3))
    joints = np.array([row.rpartition(".")[0] for row in own])
    for joint in dict.fromkeys(joints.tolist()):
        mine = np.flatnonzero(joints == joint)
        axes = np.array([found.directions[own[k]] for k in mine])
        block = [places[k] for k in mine]
        total += axes.T @ found.regular.stress[np.ix_(block, block)] @ axes
    sizes, along = np.linalg.eigh(total)
    return np.array([_signed(each) for each in along.T[sizes > _SPAN]]).reshape(-1, 3)


def _positions(found: Audit) -> Iterator[str]:
    redundancy, freedom = found.figures
    here, count = found.here, len(found.others)
    if not found.is_decided:
        yield f"Here: redundancy {here.redundancy}, freedom {here.freedom} ({_gap(here)})."
        others = ", ".join(f"{look.redundancy} and {look.freedom} ({_gap(look)})" for look in found.others)
        yield f"Redundancy and freedom at others: {others or 'none found'}."
    elif here.is_singular:
        yield (
            f"The position of the file is singular: redundancy {here.redundancy} and freedom {here.freedom} there, but "
            f"{redundancy} and {freedom} at {count} other{'s' * (count > 1)}. What is said here is so at "
            f"{'the first of them' if count > 1 else 'that one'}."
        )
    elif not freedom:
        yield "It cannot move."
    else:
        moved = found.travel if found.travel and found.travel.ranges else None
        if redundancy or moved:
            many = f"{count} other position{'s' * (count > 1)}"
            same = f"Same at {many}" if count else "No other position was found to compare with"
            yield f"{same}{'' if not moved or moved.singular else ' and along the motion'}."
    if found.travel and found.travel.singular:
        yield _singular(found.travel)


def _singular(travel: Travel) -> str:
    places = [
        f"{each.joint} = {each.at:.4g} (redundancy {each.redundancy}, freedom {each.freedom})"
        for each in travel.singular[:_MOST]
    ]
    left = f", and {len(travel.singular) - _MOST} more" if len(travel.singular) > _MOST else ""
    return f"The motion passes singular positions, near which loads grow without bound: {', '.join(places)}{left}."


def _drives(found: Audit, drives: Drives) -> Iterator[str]:
    yield f"{_shared(drives)}{_idle(found, drives)}"
    if drives.dead:
        yield f"This position is a dead point of {listed(drives.dead)}: here their forces are not determined."


def _idle(found: Audit, drives: Drives) -> str:
    if not drives.idle:
        return ""
    count = f" {drives.idle} independent motion{'s are' if drives.idle > 1 else ' is'} left to no drive"
    if not found.idle:
        return f"{count}."
    return f"{count}: with drives at rest, {listed(found.idle)} can still move."


def _shared(drives: Drives) -> str:
    count = len(drives.names)
    if not drives.is_decided:
        return f"Drives ({', '.join(drives.names)}): UNDECIDED which of their forces are unique."
    if drives.loose:
        return (
            f"Drives: {count}, which is {drives.redundancy} more than they can move independently. The motion does not "
            f"determine the forces of {', '.join(drives.loose)}: they can work against each other, and your controller "
            "decides how they share."
        )
    return f"Drives: the motion determines the force of each ({', '.join(drives.names)})."


def _joints(found: Audit) -> Iterator[str]:
    """Which loads are unique; joints of which the same is to be said together."""
    if not any(part.loose or part.here_alone for part in found.parts):
        return
    told: dict[tuple[str, ...], list[str]] = {}
    for part in found.parts:
        told.setdefault(_cells(part), []).append(part.name)
    cells = [("kind", "forces", "moments", "not unique", "unique at this position alone"), *told]
    shown = [k for k in range(5) if k != 4 or any(row[4] for row in told)]
    widths = [max(len(row[k]) for row in cells) for k in shown]
    yield "Joint loads, without friction: how many are unique"
    for row, names in zip(cells, (["joints"], *told.values()), strict=True):
        start = "".join(f"{row[k]:{width}}  " for k, width in zip(shown, widths, strict=True))
        indent = " " * (len(start) if len(start) < WIDTH - 30 else 8)
        yield from wrapped(start + ", ".join(names), subsequent_indent=indent)
    used = {row.partition("_")[0] for part in found.parts for row in part.loose}
    notes = [f"{row}: {what}" for row, what in _ROWS.items() if row in used]
    notes += ["*: one combination of those named is unique"] if any(_is_mixed(part) for part in found.parts) else []
    yield from wrapped("; ".join(notes))


def _is_mixed(part: Part) -> bool:
    """Whether more rows are not unique than dimensions."""
    return len(part.loose) > sum(of - own for own, of in (part.force, part.moment))


def _cells(part: Part) -> tuple[str, ...]:
    force, moment = (f"{own} of {of}" if of else "-" for own, of in (part.force, part.moment))
    loose = ", ".join(part.loose) + (" *" if _is_mixed(part) else "")
    return part.kind, force, moment, loose or "-", ", ".join(part.here_alone)


def _figures(found: Audit) -> Iterator[str]:
    redundancy, freedom = found.figures
    look = found.regular
    yield (
        f"Figures: {len(found.rows)} constraints (rows), {look.rank} of them independent (rank), redundancy "
        f"{redundancy}; freedom {freedom}: {freedom or 'no'} independent motion{'s' * (freedom != 1)}, spins of single "
        f"parts counted. Of the matrix of constraints: {_gap(look)}."
    )
    moved = found.travel
    if moved and moved.ranges and not found.is_stuck:
        named = list(moved.ranges.items())
        ways = ", ".join(f"{name} from {low:+.3g} to {high:+.3g}" for name, (low, high) in named[:_MOST])
        more = f", and {len(named) - _MOST} more" if len(named) > _MOST else ""
        limits = " within joint limits" if moved.is_limited else ""
        start = "; what has brackets from the start" if any(name.endswith("]") for name, _ in named) else ""
        yield (
            f"Moved{limits}: {ways}{more} (rad or m, as the file counts{start}). Of the matrix of loops on the way, in "
            f"joint coordinates: smallest singular value kept {moved.least:.1e}."
        )


def _gap(look: Look) -> str:
    counts = (
        f", as all below {look.digits:.0e}: files have no more digits" if look.dropped > _ROUNDING < look.digits else ""
    )
    dropped = f", largest dropped {look.dropped:.1e}{counts}" if look.dropped else ""
    note = "" if look.is_decided else ", too near to call"
    return f"smallest singular value kept {look.kept:.1e}{dropped}{note}"
