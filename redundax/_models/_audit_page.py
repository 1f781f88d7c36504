"""An audit as text, for somebody who has never heard of redundancy."""

import textwrap
from collections.abc import Iterator, Sequence

from .._analysis._bearing_words import best_in_words
from .._tools._table import WIDTH
from ._audit import Audit, Group, Look, Part
from ._drives import Drives
from ._travel import Travel

_ROWS = {
    "axial": "force along the axis",
    "radial": "forces across it",
    "bend": "moments about directions across it",
    "twist": "moment about it",
    "coupling": "what couples two joints",
}
_MOST = 4  # singular positions listed
_ROUNDING = 1e-11  # of singular values


def audit_page(found: Audit) -> str:
    """What is redundant, what is unique, and what to release."""
    told = [*_verdict(found), *_positions(found)]
    told += [*_travel(found.travel)] if found.travel else []
    told += [*_drives(found.drives)] if found.drives else []
    lines = [line for each in told for line in textwrap.wrap(each, WIDTH)]
    return "\n".join([*lines, "", *_joints(found), *_dependent(found.groups, found.rows)])


def _verdict(found: Audit) -> Iterator[str]:
    redundancy, freedom = found.figures
    look, rows = found.regular, len(found.rows)
    if not found.is_decided:
        yield "UNDECIDED: see the positions below."
    elif redundancy:
        yield (
            f"REDUNDANT by {redundancy}: joints and loops set {rows} conditions on the velocities of the bodies, and "
            f"{redundancy} of them {'follow' if redundancy > 1 else 'follows'} from the others. So the loads of some "
            "joints, marked below, cannot be found from this model: in the machine they depend on clearances, "
            "elasticity and assembly, and what a simulator prints for them is one choice of many: do not size parts or "
            "train controllers by it. Its motion is right all the same, unless those joints have friction."
        )
    else:
        yield f"NOT REDUNDANT: the {rows} conditions of joints and loops are independent. Every joint load is unique."
    yield (
        f"{rows} conditions (rows), {look.rank} independent (rank): redundancy {redundancy}, freedom {freedom}: "
        f"{_motions(freedom)} ({_gap(look)})."
    )


def _motions(freedom: int) -> str:
    return f"{freedom or 'no'} independent motion{'s' * (freedom != 1)}, all spins counted"


def _positions(found: Audit) -> Iterator[str]:
    redundancy, freedom = found.figures
    here, count = found.here, len(found.others)
    if not found.is_decided:
        yield f"Here: redundancy {here.redundancy}, freedom {here.freedom} ({_gap(here)})."
        others = ", ".join(f"{look.redundancy} and {look.freedom} ({_gap(look)})" for look in found.others)
        yield f"Redundancy and freedom at others, which do not agree or are not clear: {others or 'none found'}."
    elif here.is_singular:
        yield (
            f"This position is singular: redundancy {here.redundancy} and freedom {here.freedom} here, but "
            f"{redundancy} and {freedom} at {count} others, which are those of the machine. What follows is said of "
            "the first of them."
        )
    elif count:
        yield f"It is so at {count} other positions too: it belongs to the machine, not to the position."
    else:
        yield "No other position was found to compare with." if freedom else "It cannot move."


def _travel(travel: Travel) -> Iterator[str]:
    named = list(travel.ranges.items())
    if not named:
        yield "Its loops do not move in themselves."
        return
    moved = ", ".join(f"{name} from {low:+.3g} to {high:+.3g}" for name, (low, high) in named[:_MOST])
    more = f", and {len(named) - _MOST} more" if len(named) > _MOST else ""
    limits = ", within joint limits" if travel.is_limited else ""
    brackets = ", what has brackets from there" if any(name.endswith("]") for name, _ in named) else ""
    how = f"Moved from there along its freedoms{limits} ({moved}{more}; rad or m, as the file counts{brackets})"
    if not travel.singular:
        yield f"{how}, it stays so: no singular position on the way (smallest singular value kept {travel.least:.1e})."
        return
    places = [
        f"{each.joint} {each.at:+.4g} (redundancy {each.redundancy}, freedom {each.freedom})"
        for each in travel.singular[:_MOST]
    ]
    left = f", and {len(travel.singular) - _MOST} more" if len(travel.singular) > _MOST else ""
    yield f"{how}, it passes singular positions at {', '.join(places)}{left}: near them loads grow without bound."


def _drives(drives: Drives) -> Iterator[str]:
    yield _shared(drives)
    if drives.dead:
        yield f"This position is a dead point of {', '.join(drives.dead)}: here their forces are not determined."


def _shared(drives: Drives) -> str:
    count, freedoms = len(drives.names), "freedom is" if drives.idle == 1 else "freedoms are"
    idle = f" {drives.idle} {freedoms} left to no drive." if drives.idle else ""
    if not count:
        return "Drives: the file names none."
    if not drives.is_decided:
        return f"Drives ({', '.join(drives.names)}): UNDECIDED which of their forces are unique."
    if drives.loose:
        return (
            f"Drives: {count}, which is {drives.redundancy} more than they can move independently. The motion does not "
            f"determine the forces of {', '.join(drives.loose)}: they can work against each other, and your controller "
            f"decides how they share.{idle}"
        )
    return f"Drives: the motion determines the force of each ({', '.join(drives.names)}).{idle}"


def _gap(look: Look) -> str:
    counts = (
        f", as all below {look.digits:.0e}: files have no more digits" if look.dropped > _ROUNDING < look.digits else ""
    )
    dropped = f", largest dropped {look.dropped:.1e}{counts}" if look.dropped else ""
    note = "" if look.is_decided else ", too near to call"
    return f"smallest singular value kept {look.kept:.1e}{dropped}{note}"


def _joints(found: Audit) -> list[str]:
    if not any(part.loose or part.here_alone for part in found.parts):
        return ["Joint loads, without friction: all unique."]
    cells = [("joint", "kind", "force", "moment", "not unique", "unique at this position alone")]
    cells += [_cells(part) for part in found.parts]
    if not any(part.here_alone for part in found.parts):
        cells = [row[:-1] for row in cells]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    rows = ["  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells]
    used = {row.partition("_")[0] for part in found.parts for row in part.loose}
    words = textwrap.wrap("; ".join(f"{row}: {what}" for row, what in _ROWS.items() if row in used), WIDTH)
    return ["Joint loads, without friction: in how many directions each is unique", *rows, *words]


def _cells(part: Part) -> tuple[str, ...]:
    force, moment = (f"{own} of {of}" if of else "-" for own, of in (part.force, part.moment))
    return part.name, part.kind, force, moment, ", ".join(part.loose) or "-", ", ".join(part.here_alone)


def _together(rows: Sequence[str]) -> str:
    """Rows, joint by joint."""
    joints: dict[str, list[str]] = {}
    for row in rows:
        joint, _, own = row.rpartition(".")
        joints.setdefault(joint, []).append(own)
    return ", ".join(
        f"{joint} ({', '.join(own)})" if len(own) > 1 else f"{joint}.{own[0]}" for joint, own in joints.items()
    )


def _dependent(groups: Sequence[Group], rows: Sequence[str]) -> list[str]:
    lines = []
    for number, group in enumerate(groups, 1):
        head = f"Dependent group {number}, redundancy {group.redundancy}: {_together(group.rows)}"
        lines += ["", *textwrap.wrap(head, WIDTH, subsequent_indent="    ")]
        if group.releases:
            lines.append("To mend it, free what one of these lines names, best first: nothing is redundant then, and")
            lines.append("nothing more moves (in brackets how far from moving, 0 to 1):")
        for release in group.releases:
            words = _together([row for _, shares in release.directions for row in shares])
            lines += textwrap.wrap(
                f"{words} ({release.determinant:.2g})", WIDTH, initial_indent="    ", subsequent_indent="        "
            )
        lines += best_in_words(group.releases, rows)
    return lines
