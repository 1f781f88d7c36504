"""Releases by joints of other kinds, in formats whose files hold two bodies by a joint that has its kind as a word"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import cast

from ._description import Joint, Loop, Place
from ._edit import Edit, deleted
from ._kinds import KINDS, TURNS
from ._model import Model

_DRIVEN = {"hinge": "cylindrical joint", "slide": "cylindrical joint"}  # what keeps a coordinate that is driven


def pair_moves(model: Model, kinds: Collection[str]) -> list[Edit]:
    """What a format can say that has words for some kinds: joints that leave more free, and loops left out."""
    found, places = [], _places(model)
    for part in (*model.tree.joints, *model.tree.loops):
        if part.name not in places:
            continue
        weight = -1.0 if isinstance(part, Loop) else model.described.weight_on(part)
        for rows, kind in _freer(part.kind, kinds):
            if not places[part.name].is_used or kind == _DRIVEN.get(part.kind):
                names = tuple(f"{part.name}.{row}" for row in rows)
                found.append(Edit(names, part, "become", weight, kind=kind))
        if isinstance(part, Loop) and not places[part.name].is_used:
            found.append(deleted(model, part))
    return found


def place_of(model: Model, edit: Edit) -> Place:
    """Where the file has the joint that is changed."""
    return _places(model)[edit.name]


def _places(model: Model) -> Mapping[str, Place]:
    return model.described.origin


def _freer(kind: str, kinds: Collection[str]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Kinds that leave more free than one, and the rows that they free."""
    held = KINDS[kind].rows if kind in KINDS else ()
    for other, rows in ((other, KINDS[other].rows) for other in KINDS if other in kinds):
        if set(rows) < set(held):
            yield tuple(row for row in held if row not in rows), other
    if kind == "hinge" and "universal joint" in kinds:
        yield from (((row,), "universal joint") for row in TURNS[:2])


def without_limits(edits: Sequence[Edit]) -> str:
    """Whose limits a copy is without."""
    bounded = [edit.name for edit in edits if edit.kind and cast(Joint | Loop, edit.target).limits]
    return f"It is without the limits of {', '.join(bounded)}." if bounded else ""
