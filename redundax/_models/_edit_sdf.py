"""Releases in SDF: a joint of another type, or left out; all else of a file stays byte for byte"""

import pathlib
import re
from collections.abc import Sequence
from typing import cast
from xml.sax.saxutils import quoteattr

import numpy as np

from ._description import Joint, Loop
from ._edit import Changed, Edit
from ._edit_pairs import pair_moves, place_of, without_limits
from ._model import Model
from ._sdf import SdfPlace
from ._source import Element, Source
from ._stress import AXES

_TYPES = {"ball": "ball", "universal joint": "universal"}
_TYPE = re.compile(r"(\btype\s*=\s*)(\"[^\"]*\"|'[^']*')")


def sdf_moves(model: Model) -> list[Edit]:
    """What SDF can say, of the joints and loops of a model."""
    return pair_moves(model, _TYPES)


def sdf_change(model: Model, edits: Sequence[Edit], file: pathlib.Path) -> Changed:
    """The file of a model with changes."""
    source = Source(model.path)
    told = [_change(source, model, edit) for edit in edits]
    return Changed({file: source.changed()}, told, without_limits(edits))


def _change(source: Source, model: Model, edit: Edit) -> str:
    """Change a file as an edit says, and tell the change in a line."""
    place = place_of(model, edit).at
    element = [each for each in source.root.all() if each.tag == "joint"][place.number]
    was = source.text(element)
    if edit.how == "delete":
        source.remove(element)
        return f"delete {was}"
    now = _TYPE.sub(lambda found: found[1] + quoteattr(_TYPES[edit.kind]), was, count=1)
    source.put(element.start, now, element.opened)
    axes = [each for each in element.children if each.tag in ("axis", "axis2")]
    more = _cross(source, axes, edit, place) if edit.kind == "universal joint" else ""
    for each in axes:
        if not more or each.tag == "axis2":
            source.remove(each)
    return f"{now} {more}{' ' * bool(more)}in place of {was}"


def _cross(source: Source, axes: Sequence[Element], edit: Edit, place: SdfPlace) -> str:
    """Write the second axis of a cross before that of a hinge; the first axis of the file is on the parent."""
    own, other = ("axis2", "axis") if place.is_turned else ("axis", "axis2")
    more = f"<{own}><xyz>{_direction(edit, place.axes)}</xyz></{own}>"
    first = next(each for each in axes if each.tag == "axis")
    source.put_before(first, more)
    _rename(source, first, other)
    return f"with {more}"


def _direction(edit: Edit, axes: np.ndarray) -> str:
    """What the row that is freed turns about, in the axes of the joint."""
    target = cast(Joint | Loop, edit.target)
    above = target.first if isinstance(target, Loop) else target.parent
    along = axes.T @ above.axes[:, AXES[edit.rows[0].rpartition(".")[2]][1]]
    return " ".join(f"{0.0 if abs(value) < 1e-15 else value:.15g}" for value in along)


def _rename(source: Source, element: Element, tag: str) -> None:
    """Give an element another tag, if it is another."""
    if tag == element.tag:
        return
    size = len(element.tag) + 1
    source.put(element.start, f"<{tag}", element.start + size)
    if element.opened < element.end:
        last = source.content.rindex(b"</", element.opened, element.end)
        source.put(last, f"</{tag}", last + size + 1)
