"""Releases in ASMT: the word of a joint's kind, or a joint left out; all other lines of an assembly stay"""

import pathlib
from collections.abc import Sequence

from ._asmt import WORDS
from ._edit import Changed, Edit
from ._edit_pairs import pair_moves, place_of
from ._model import Model

_KINDS = ("cylindrical joint", "ball", "point-on-line joint", "planar joint", "point-on-plane joint", "hinge", "slide")
_OFFSET = ("planar joint", "point-on-plane joint")  # kinds with one more number


def asmt_moves(model: Model) -> list[Edit]:
    """What ASMT can say, of the joints and loops of a model."""
    return pair_moves(model, _KINDS)


def asmt_change(model: Model, edits: Sequence[Edit], file: pathlib.Path) -> Changed:
    """The file of a model with changes, without the run that it stores."""
    lines, told = model.path.read_bytes().decode("utf8").splitlines(keepends=True), []
    run = next((k for k, line in enumerate(lines) if line.strip() == "TimeSeries"), len(lines))
    note = "It is without the run that the file stores, which is of the other machine." if run < len(lines) else ""
    before, lines = "".join(lines[:run]), lines[:run]
    for edit in edits:
        first, after = _block(lines, place_of(model, edit).at)
        was = lines[first].strip()
        if edit.how == "delete":
            told.append(f"delete lines {first + 1} to {after}, {was}")
            lines[first:after] = [""] * (after - first)
            continue
        new = WORDS[edit.kind]
        told.append(f"{new} in place of {was} in line {first + 1}")
        margin, _, end = lines[first].partition(was)
        lines[first] = f"{margin}{new}{end}"
        if edit.kind in _OFFSET and "offset" not in {line.strip() for line in lines[first:after]}:
            lines[after - 1] += f"{margin}\toffset{end}{margin}\t\t0.0{end}"
    now = "".join(lines)
    return Changed({file: now.encode("utf8")}, told, note, (before, now))


def _block(lines: Sequence[str], number: int) -> tuple[int, int]:
    """The first line of a joint, by its number from 1 on, and the first after it."""
    level = _level(lines[number - 1])
    after = next((k for k in range(number, len(lines)) if lines[k].strip() and _level(lines[k]) <= level), len(lines))
    return number - 1, after


def _level(line: str) -> int:
    return len(line) - len(line.lstrip("\t"))
