"""Tables as text: groups of rows under headings of their own, side by side where they fit, the middle of long ones left
out."""

import dataclasses
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from ._module import is_concrete

WIDTH = 80  # of a terminal
LINES = 26  # of a page, beside what is said above it


def text_of(lines: Iterable[str]) -> str:
    """Lines as one text; what is wider than a terminal goes on in lines below, four columns further in."""
    folded = []
    for line in "\n".join(lines).split("\n"):
        indent = " " * (len(line) - len(line.lstrip()) + 4)
        below = textwrap.TextWrapper(WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
        folded += below.wrap(line) if len(line) > WIDTH else [line]
    return "\n".join(folded)


class AbstractFigures:
    """Figures that a print shows, a line each: of many the least and the largest, inside of transformations shapes."""

    def __repr__(self) -> str:
        if not are_known(self):
            return eqx.tree_pformat(self)
        return f"{type(self).__name__}({', '.join(f'{name}={text}' for name, text in _texts(self))})"

    def __str__(self) -> str:
        if not are_known(self):
            return eqx.tree_pformat(self)
        lines = list(_lines(self))
        width = max(len(name) for name, _ in lines)
        return "\n".join(f"{name:{width}}  {text}" for name, text in lines)


def _texts(figures: AbstractFigures) -> list[tuple[str, str]]:
    fields = dataclasses.fields(figures)  # pyright: ignore[reportArgumentType]
    return [(field.name, _text(getattr(figures, field.name))) for field in fields]


def _lines(figures: AbstractFigures, of: str = "") -> Iterator[tuple[str, str]]:
    for name, text in _texts(figures):
        value = getattr(figures, name)
        yield from _lines(value, f"{of}{name}.") if isinstance(value, AbstractFigures) else [(of + name, text)]


def _text(value: object) -> str:
    if not isinstance(value, np.ndarray | jax.Array):
        return repr(value)
    array = np.asarray(value)
    if array.dtype == bool:
        return str(array.item()) if array.ndim == 0 else f"{array.sum()} of {array.size} true"
    known = array[~np.isnan(array)]
    ends = [f"{end(known) + 0:.6g}" for end in (np.min, np.max)] if known.size else ["nan"]
    return " to ".join(dict.fromkeys(ends))


class Group(NamedTuple):
    """Rows under one heading, cell by cell, which stand to the left "<" or to the right ">": all but the first, if not
    said."""

    heading: tuple[str, ...]
    rows: list[tuple[str, ...]]
    sides: str = ""


def group(heading: Sequence[str], *columns: Sequence[str]) -> Group:
    """A group from its columns."""
    return Group(tuple(heading), list(zip(*columns, strict=True)))


def page(left: Sequence[Group], right: Sequence[Group], more: str) -> list[str]:
    """Two tables, beside each other or below; `more` says how to see what is left out."""
    tables = [[one for one in side if one.rows] for side in (left, right)]
    shown = [_table(side, LINES) for side in tables]
    widths = [max(map(len, lines), default=0) for lines in shown]
    room = LINES
    if all(widths) and sum(widths) + 4 <= WIDTH:
        longest = max(map(len, shown))
        first, second = ([*lines, *[""] * (longest - len(lines))] for lines in shown)
        lines = [f"{a:{widths[0] + 4}}{b}".rstrip() for a, b in zip(first, second, strict=True)]
    else:
        room = (LINES - all(widths)) // max(1, sum(map(bool, tables)))
        first, second = (_table(side, room) for side in tables)
        lines = [*first, *[""] * all(widths), *second]
    is_cut = any(_most(side, room) < len(one.rows) for side in tables for one in side)
    return [*lines, more] if is_cut else lines


def figures(values: np.ndarray, beside: np.ndarray | None = None, digits: int = 6) -> list[str]:
    """Numbers as text; what is rounding beside the largest, of these or of others, is 0."""
    values = np.asarray(values)
    return [f"{x:.{digits}g}" for x in without_rounding(values, values if beside is None else beside).tolist()]


def without_rounding(values: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """Numbers, of which those that are rounding beside the largest of others are 0."""
    others = np.abs(beside)
    rounding = 100 * np.finfo(values.dtype).eps * others[np.isfinite(others)].max(initial=0.0)
    return np.where(np.abs(values) <= rounding, 0.0, values)


def apart(low: float, high: float, digits: int = 5) -> tuple[str, str]:
    """Two numbers with so many digits, or as many as tell them apart."""
    texts = [(f"{low + 0.0:.{most}g}", f"{high + 0.0:.{most}g}") for most in range(digits, 16, 3)]
    return next((pair for pair in texts if pair[0] != pair[1]), texts[-1])


def are_known(tree: PyTree) -> bool:
    """Whether all leaves are arrays whose numbers are there to be shown."""
    return all(isinstance(x, np.ndarray | jax.Array) and is_concrete(x) for x in jax.tree.leaves(tree))


def _most(groups: Sequence[Group], lines: int) -> int:
    """How many rows each group may have, so that a table has this many lines."""
    room = lines + 1 - 2 * len(groups)
    fits = (most for most in range(room, 3, -1) if sum(min(most, len(one.rows)) for one in groups) <= room)
    return next(fits, 3)


def _table(groups: Sequence[Group], lines: int) -> list[str]:
    most = _most(groups, lines)
    gap = ("",) * max((len(one.heading) for one in groups), default=0)
    rows = [row for one in groups for row in (gap, one.heading, *_some(one.rows, most))][1:]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = groups[0].sides or "<" + ">" * len(gap) if groups else ""
    return [
        "  ".join(f"{cell:{side}{width}}" for cell, side, width in zip(row, sides, widths, strict=False)).rstrip()
        for row in rows
    ]


def _some(rows: list[tuple[str, ...]], most: int) -> list[tuple[str, ...]]:
    """The first and the last, and how many are left out between them."""
    if len(rows) <= most:
        return rows
    last = (most - 1) // 2
    first = most - 1 - last
    gap = (f"... {len(rows) - most + 1} more", *[""] * (len(rows[0]) - 1))
    return [*rows[:first], gap, *rows[len(rows) - last :]]
