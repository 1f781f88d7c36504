"""An audit as text, for somebody who has never heard of redundancy: the verdict, what to do, then the figures."""

import itertools
from collections.abc import Iterator, Sequence
from typing import TypedDict

import numpy as np

from .._tools._table import WIDTH
from ._audit import Audit, Look, Part
from ._choice import listed, series, vector
from ._description import missing_of
from ._drives import Drives
from ._repair_page import VECTOR, Lines, all_releases, kept_together, mended, told_alike, wrapped
from ._travel import Travel

_ROWS = {
    "axial": "force along the axis",
    "radial": "forces across it",
    "bend": "moments about directions across it",
    "twist": "moment about it",
    "coupling": "what couples two joints",
}
_MOST = 4  # singular positions and loops listed
_WITHOUT_AXIS = ("connect", "weld", "ball", "fixed joint")
_ROUNDING = 1e-11  # of singular values
_SIDEWAYS = "a sideways load, along "
_SPAN = 1e-6  # of directions of loads that are not unique


class About(TypedDict):
    """What there is to be said of a file.

    - `joints`, `loops`: names by kinds; `position`: in words, and `keyframe`, where it is one of the `keyframes`.
    - `misfit_in_file`, `misfit`: of its loops as the file has them, and as they were closed, m or rad.
    - `moved`: by how much joints were moved for that, by their names; `found_at_random`: whether not from there.
    - `outside_limits`: joints beyond their limits.
    - `whole`: whether all that constrains is taken over; `left_out`: what is not, a line each.
    - `soft`: whether the program of the file makes springs of loops.
    """

    bodies: int
    joints: dict[str, list[str]]
    loops: dict[str, list[str]]
    position: str
    keyframe: str | None
    keyframes: list[str]
    misfit_in_file: float
    misfit: float
    moved: dict[str, float]
    found_at_random: bool
    outside_limits: list[dict[str, str | float]]
    whole: bool
    left_out: list[str]
    soft: bool


def audit_page(
    found: Audit, about: About | None, *, lines: Lines, language: str = "", allowed: int = 0, everything: bool = False
) -> str:
    """What is redundant, what that means, and what to do.

    **Arguments:**

    - `about`: what is to be said of the file; `language`: its kind; `lines`: what to write in it, by rows freed.
    - `allowed`: redundancy that is no fault; `everything`: all releases that were found, too.
    """
    first, where = [*_verdict(found, about, allowed, everything)], about["position"] if about else "the state given"
    if not found.is_stuck:
        first += [
            *_positions(found, where),
            *(_drives(found, found.drives, where) if found.drives and found.drives.names else ()),
        ]
    text = ["\n".join(line for each in first for line in wrapped(each))]
    if not found.is_stuck and found.is_decided:
        text += ["\n".join(mended(found, lines, language, everything))]
        text += ["\n".join(all_releases(found, language))] if everything else []
        text += ["\n".join(_joints(found, where, everything))]
    figures = [*_figures(found, everything)]
    text.append("\n".join(line for each in figures for line in wrapped(each, subsequent_indent="  ")))
    return "\n\n".join(each for each in text if each)


def _verdict(found: Audit, about: About | None, allowed: int, everything: bool) -> Iterator[str]:
    redundancy = found.figures[0]
    missing = missing_of(about["left_out"]) if about else []
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
        yield from _unknown(found, everything)
        yield (
            "A simulator prints one of many such loads: do not size parts or train controllers by them. The motion is "
            "right, unless those joints have friction."
        )
    elif missing:
        yield "Nothing is redundant in what was read, which does not say that nothing is."
    elif about and not about["loops"]:
        yield "NOT REDUNDANT: no loops (no connect, weld or joint equality was found), so there is nothing to check."
    else:
        yield "NOT REDUNDANT: no constraint repeats others. Every joint load of this model is unique."


def _unknown(found: Audit, everything: bool) -> Iterator[str]:
    """Which loads are not unique: groups of the same joints together, and those once that are alike."""
    rows: dict[tuple[str, ...], list[str]] = {}
    for group in found.groups:
        joints = tuple(dict.fromkeys(row.rpartition(".")[0] or row for row in group.rows))
        rows.setdefault(joints, []).extend(group.rows)
    kinds = {part.name: part.kind for part in found.parts}
    split = {joints: _split(found, own) for joints, own in rows.items()}
    alike = kept_together(
        list(rows), lambda joints: (*(kinds[name] for name in joints), VECTOR.sub("", split[joints])), everything
    )
    told: dict[str, list[str]] = {}
    for joints, *others in alike:
        own = ", each in directions of its own" if any(split[each] != split[joints] for each in others) else ""
        more = told_alike(others, list)
        told.setdefault(split[joints], []).append(f"between {listed(joints)}{more}{own}")
    planar = len(set(split.values())) == 1 and next(iter(told)).startswith(_SIDEWAYS)
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


def _positions(found: Audit, where: str) -> Iterator[str]:
    redundancy, freedom = found.figures
    here, count = found.here, len(found.others)
    if not found.is_decided:
        yield f"At {where}: redundancy {here.redundancy}, freedom {here.freedom} ({_gap(here)})."
        others = ", ".join(f"{look.redundancy} and {look.freedom} ({_gap(look)})" for look in found.others)
        yield f"Redundancy and freedom at others: {others or 'none found'}."
    elif here.is_singular:
        yield (
            f"{_capital(where)} is singular: redundancy {here.redundancy} and freedom {here.freedom} there, but "
            f"{redundancy} and {freedom} at {count} other{'s' * (count > 1)}. What is said here is so at "
            f"{'the first of them' if count > 1 else 'that one'}."
        )
    elif not freedom:
        yield "It cannot move."
    else:
        moved = found.travel if found.travel and found.travel.ranges else None
        if redundancy or moved:
            limits = f"outside limits of {listed(list(dict.fromkeys(itertools.chain(*found.outside))))}"
            far = f", {_of_them(len(found.outside), count)}{limits}" if found.outside else ""
            many = f"{count} other position{'s' * (count > 1)}{far}"
            same = f"Same at {many}" if count else "No other position was found to compare with"
            on = f"{',' * bool(far)} and along the motion" if moved and moved.moved and not moved.singular else ""
            yield f"{same}{on}."
        if moved and not moved.moved:
            yield f"No motion was looked at: {_unmoved(moved)}."
    if found.travel and found.travel.singular:
        yield _singular(found.travel)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _of_them(some: int, count: int) -> str:
    return "" if count == 1 else f"{'all' if some == count else some} of them "


def _unmoved(travel: Travel) -> str:
    """Why no joint could be moved."""
    names = listed(list(travel.ranges))
    if not travel.stops:
        return f"{names} could not be moved, as the loops would not close"
    return f"limits of joints keep {names} in place: {listed(_limits(travel))} (rad or m, as the file counts)"


def _limits(travel: Travel) -> list[str]:
    """Those that stopped joints, joint by joint."""
    limits: dict[str, list[float]] = {}
    for joint, limit in travel.stops:
        limits.setdefault(joint, []).append(limit)
    return [f"{joint} at {' and '.join(map(_at, sorted(own)))}" for joint, own in limits.items()]


def _singular(travel: Travel) -> str:
    places = [
        f"{each.joint} = {each.at:.4g} (redundancy {each.redundancy}, freedom {each.freedom})"
        for each in travel.singular[:_MOST]
    ]
    left = f", and {len(travel.singular) - _MOST} more" if len(travel.singular) > _MOST else ""
    return f"The motion passes singular positions, near which loads grow without bound: {', '.join(places)}{left}."


def _drives(found: Audit, drives: Drives, where: str) -> Iterator[str]:
    yield f"{' '.join(_shared(found, drives))}{_idle(found, drives)}"
    if drives.dead:
        forces = "its force is" if len(drives.dead) == 1 else "their forces are"
        yield f"{_capital(where)} is a dead point of {listed(drives.dead)}: there {forces} not determined."
    for drive, joint, at in drives.turns:
        yield f"On the way {joint} turns back at {_at(at)}, a dead point of {drive}, near which its force has no bound."


def _idle(found: Audit, drives: Drives) -> str:
    if not drives.idle:
        return ""
    count = f" {drives.idle} independent motion{'s are' if drives.idle > 1 else ' is'} left to no drive"
    spins = f"{len(found.spins)} of them spins of single parts" if drives.idle > 1 else "a spin of a single part"
    if drives.idle == len(found.spins):
        spins = "spins of single parts" if drives.idle > 1 else spins
        return (
            f"{count}: {spins}, {'which move' if drives.idle > 1 else 'which moves'} nothing else ({_spinning(found)})."
        )
    some = f", {spins}" if found.spins else ""
    return (
        f"{count}{some}: with drives at rest, {listed(found.idle)} can still move." if found.idle else f"{count}{some}."
    )


def _shared(found: Audit, drives: Drives) -> Iterator[str]:
    """What the motion determines of the forces of drives: of those that move nothing, and of the others."""
    moving = [name for name in drives.names if name not in drives.locked]
    head = f"Drive{'s' * (len(drives.names) > 1)}"
    if not drives.is_decided:
        what = "which of their forces are" if len(drives.names) > 1 else "whether its force is"
        yield f"{head} ({listed(drives.names)}): UNDECIDED {what} unique."
        return
    if drives.locked:
        one = len(drives.locked) == 1
        what = f"move{'s' * one} nothing, as what {'it acts' if one else 'they act'} on is held"
        if not found.figures[1]:
            what = f"work{'s' * one} against a locked mechanism"
        loads = "its force loads" if one else "their forces load"
        yield f"{head}: {listed(drives.locked)} {what}: {loads} joints alone."
    shared = [name for name in drives.loose if name not in drives.locked]
    others = "The others" if drives.locked else head
    if shared:
        more = drives.redundancy - len(drives.locked)
        yield (
            f"{others}: {len(moving)}, which is {more} more than they can move independently. The motion does not "
            f"determine the forces of {listed(shared)}: they can work against each other, and your controller decides "
            "how they share."
        )
    elif len(moving) > 1:
        yield f"{others}: the motion determines the force of each ({', '.join(series(moving))})."
    elif moving:
        yield f"{'The other' if drives.locked else head}: the motion determines the force of {moving[0]}."


def _joints(found: Audit, where: str, everything: bool) -> Iterator[str]:
    """Which loads are unique; joints of which the same is to be said together."""
    if not any(part.loose or part.here_alone for part in found.parts):
        return
    told: dict[tuple[str, ...], list[str]] = {}
    for part in found.parts:
        told.setdefault(_cells(part), []).append(part.name)
    cells = [("kind", "forces", "moments", "not unique", "unique here alone"), *told]
    shown = [k for k in range(5) if k != 4 or any(row[4] for row in told)]
    widths = [max(len(row[k]) for row in cells) for k in shown]
    yield "Joint loads, without friction: how many are unique"
    for row, names in zip(cells, (["joints"], *told.values()), strict=True):
        start = "".join(f"{row[k]:{width}}  " for k, width in zip(shown, widths, strict=True))
        indent = " " * (len(start) if len(start) < WIDTH - 30 else 8)
        yield from wrapped(start + ", ".join(names if everything else series(names)), subsequent_indent=indent)
    used = {row.partition("_")[0] for part in found.parts for row in part.loose}
    notes = [f"{row}: {what}" for row, what in _ROWS.items() if row in used]
    notes += ["*: a combination of those named is unique"] if any(part.known for part in found.parts) else []
    here = where if found.regular is found.here else "the first of the other positions"
    notes += [f"here alone: at {here}, and not at others"] if 4 in shown else []
    yield from wrapped("; ".join(notes))
    yield from wrapped("; ".join(_known(found, everything)))
    if not everything:  # which lists the directions of all rows
        yield from wrapped("".join(_without_axis(found)))


def _without_axis(found: Audit) -> Iterator[str]:
    """What the rows of a point or of a rigid loop are along, which have no axis that a reader could know."""
    parts = [part for part in found.parts if part.kind in _WITHOUT_AXIS and part.loose]
    for k, part in enumerate(parts[:_MOST]):
        own = [f"{row} {vector(found.directions[f'{part.name}.{row}'])}" for row in part.loose]
        yield f"{'; ' if k else 'Directions of '}{part.name}: {', '.join(own)}"
    if len(parts) > _MOST:
        yield f"; {len(parts) - _MOST} more in --all"


def _known(found: Audit, everything: bool) -> Iterator[str]:
    """What is unique of forces and moments of joints whose rows alone are not."""
    parts = [part for part in found.parts if part.known]
    for k, part in enumerate(parts if everything else parts[:_MOST]):
        told = []
        for kind, shares in part.known:
            rows = [found.directions.get(f"{part.name}.{row}") for row in shares]
            if any(row is None for row in rows):  # of a mechanism that is in no file of a model
                told.append(f"{kind} {' '.join(f'{share:+.3g} {row}' for row, share in shares.items())}")
                continue
            way = vector(_signed(np.array([*shares.values()]) @ np.array(rows)))
            told.append(f"{kind} {'about' if kind == 'moment' else 'along'} {way}")
        yield f"{'' if k else 'Unique of those: '}{part.name}: {', '.join(told)}"
    if len(parts) > _MOST and not everything:
        yield f"{len(parts) - _MOST} more in --all"


def _cells(part: Part) -> tuple[str, ...]:
    force, moment = (f"{own} of {of}" if of else "-" for own, of in (part.force, part.moment))
    loose = ", ".join(part.loose) + (" *" if part.known else "")
    return part.kind, force, moment, loose or "-", ", ".join(part.here_alone)


def _figures(found: Audit, everything: bool) -> Iterator[str]:
    redundancy, freedom = found.figures
    look = found.regular
    yield (
        f"Figures: {len(found.rows)} constraints (rows), {look.rank} of them independent (rank), redundancy "
        f"{redundancy}; freedom {freedom}: {freedom or 'no'} independent motion{'s' * (freedom != 1)}"
        f"{_spins(found)}. Of the matrix of constraints: {_gap(look)}."
    )
    if found.travel and found.travel.moved and not found.is_stuck:
        yield _moved(found.travel, len(found.travel.moved) if everything else _MOST)


def _spins(found: Audit) -> str:
    """Which of the motions turn one part alone."""
    count, freedom = len(found.spins), found.figures[1]
    if not count:
        return ""
    only = f"{count} of which only spin{'s a part' if count == 1 else ' single parts'} between others"
    return f", {only} ({_spinning(found)}), so {freedom - count or 'none'} without"


def _spinning(found: Audit) -> str:
    """Names of what spins, alike ones together."""
    if len({len(each) for each in found.spins}) == 1:
        return " with ".join(listed(part) for part in zip(*found.spins, strict=True))
    return listed([" with ".join(each) for each in found.spins])


def _moved(travel: Travel, most: int) -> str:
    """How far joints were moved, and what stopped them."""
    alike: dict[str, list[str]] = {}
    for name in travel.moved:
        alike.setdefault(f"from {_at(travel.ranges[name][0])} to {_at(travel.ranges[name][1])}", []).append(name)
    ways = [f"{name} {way}" for way, names in alike.items() for name in series(names)]
    more = f", and {len(ways) - most} more" if len(ways) > most else ""
    stays = [name for name in travel.ranges if name not in travel.moved]
    not_moved = f"; {listed(stays)} could not be moved" if stays else ""
    limits = f", as far as limits allow ({listed(_limits(travel), most + 1)})" if travel.stops else ""
    start = "; what has brackets from the start" if any(name.endswith("]") for name in travel.moved) else ""
    return (
        f"Moved{limits}: {', '.join(ways[:most])}{more}{not_moved} (rad or m, as the file counts{start}). Of the "
        f"matrix of loops on the way, in joint coordinates: smallest singular value kept {travel.least:.1e}."
    )


def _at(position: float) -> str:
    return f"{position:+.3g}" if position else "0"


def _gap(look: Look) -> str:
    counts = (
        f", as all below {look.digits:.0e}: files have no more digits" if look.dropped > _ROUNDING < look.digits else ""
    )
    dropped = f", largest dropped {look.dropped:.1e}{counts}" if look.dropped else ""
    note = "" if look.is_decided else ", too near to call"
    return f"smallest singular value kept {look.kept:.1e}{dropped}{note}"
