"""Releases that a model's file can say, and a copy of the file with them

With P the projector onto self-stress, freeing the rows R takes |R| off the redundancy and adds no motion iff P[R, R] is
regular: then every combination of them bears self-stress. Moves are picked one after the other, each with the
largest smallest eigenvalue of what is left of P[R, R] once those before are freed (Schur complement).
"""

import dataclasses
import pathlib
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from ._audit import Audit
from ._edit_mjcf import Edit, Written, mjcf_moves, write_mjcf
from ._edit_urdf import urdf_moves, write_urdf
from ._model import Model
from ._read import closures_of, read
from ._tree import tree_of

_LEAST = 1e-6  # eigenvalues of P[R, R], which are from 0 to 1


class Language(NamedTuple):
    """What a kind of file can say: its moves, how they are written, and what it has no words for."""

    moves: Callable[[Model], list[Edit]]
    write: Callable[[Model, Sequence[Edit], pathlib.Path], Written]
    lacks: str


MJCF = Language(mjcf_moves, write_mjcf, "MJCF cannot free single directions of a `connect` or `weld`")
URDF = Language(urdf_moves, write_urdf, "the loops of a URDF know SPHERICAL in place of hinges, and 3d in place of 6d")


@dataclasses.dataclass(frozen=True)
class Fix:
    """A copy of a model with releases: its files, what they say, and what redundancy and freedom are left."""

    files: tuple[pathlib.Path, ...]
    freed: tuple[str, ...]
    redundancy: int
    freedom: int
    note: str

    def __str__(self) -> str:
        """What was done, in a line or more."""
        if not self.files:
            return f"no copy is written: {self.note}"
        done = f"written: {', '.join(map(str, self.files))}: {'; '.join(self.freed)}"
        left = f"the copy has redundancy {self.redundancy}, freedom {self.freedom}"
        return "\n".join([done, f"{left}{f': {self.note}' if self.note else ''}"])


def fix(model: Model, found: Audit, file: pathlib.Path, wanted: Sequence[str] = ()) -> Fix:
    """Write a copy of a model with what takes off redundancy and adds no motion.

    **Arguments:**

    - `file`: where to, with the ending of the model.
    - `wanted`: rows that are to be freed and no others, such as "B.axial"; any if not given.
    """
    language = URDF if model.path.suffix.lower() == ".urdf" else MJCF
    moves = language.moves(model)
    if wanted:
        moves = _wanted(moves, wanted, found.rows, language)
    chosen = _chosen(found.regular.stress, moves, max(_LEAST, 10 * found.regular.blur), found.rows)
    freed = sum(len(move.rows) for move in chosen)
    redundancy, freedom = found.figures
    if not chosen:
        note = f"nothing that takes off redundancy and adds no motion can be said there; {language.lacks}."
        return Fix((), (), redundancy, freedom, note if redundancy else "nothing is redundant.")
    files, more = language.write(model, chosen, file)
    left = _figures(file)
    if left != (redundancy - freed, freedom):
        note = f"{(redundancy - freed, freedom)} were expected, so look at the copy before you use it."
    else:
        note = f"{language.lacks}." if left[0] and not wanted else ""
    return Fix(files, tuple(move.words for move in chosen), *left, " ".join(each for each in (note, more) if each))


def _wanted(moves: Iterable[Edit], wanted: Sequence[str], rows: Sequence[str], language: Language) -> list[Edit]:
    for row in wanted:
        if row not in rows:
            raise ValueError(
                f"Argument `release` names '{row}', which is no row of the model. It has {list(rows)[:8]}."
            )
    some = [move for move in moves if set(move.rows) <= set(wanted)]
    missing = set(wanted) - {row for move in some for row in move.rows}
    if missing:
        raise ValueError(f"Argument `release`: {sorted(missing)} cannot be freed in the file: {language.lacks}.")
    return some


def _chosen(stress: np.ndarray, moves: list[Edit], least: float, labels: Sequence[str]) -> list[Edit]:
    """The moves that take off most, from the best on or, where that leaves something, from any other."""
    place = {row: k for k, row in enumerate(labels)}
    blocks = [[place[row] for row in move.rows] for move in moves]
    best = _picked(stress, blocks, least, [])
    for first in range(len(blocks) if _size(best, blocks) < round(np.trace(stress)) else 0):
        best = max(best, _picked(stress, blocks, least, [first]), key=lambda picks: _size(picks, blocks))
    return [moves[k] for k in sorted(best)]


def _size(picks: Sequence[int], blocks: Sequence[Sequence[int]]) -> int:
    return sum(len(blocks[k]) for k in picks)


def _picked(stress: np.ndarray, blocks: list[list[int]], least: float, first: list[int]) -> list[int]:
    left, picks, wanted = stress.copy(), [], list(first)
    while True:
        sizes = [-1.0 if k in picks else _smallest(left, rows) for k, rows in enumerate(blocks)]
        k = wanted.pop() if wanted else int(np.argmax(np.round(sizes, 9))) if sizes else 0
        if not sizes or sizes[k] < least:
            return picks
        left = left - left[:, blocks[k]] @ np.linalg.solve(left[np.ix_(blocks[k], blocks[k])], left[blocks[k]])
        picks.append(k)


def _smallest(matrix: np.ndarray, rows: list[int]) -> float:
    block = matrix[np.ix_(rows, rows)]
    return float(block[0, 0] if len(rows) == 1 else np.linalg.eigvalsh(block)[0])


def _figures(file: pathlib.Path) -> tuple[int, int]:
    """Redundancy and freedom of a file, in the coordinates of its joints."""
    tree, _ = tree_of(read(file, closures_of(file, None))[0])
    positions, left = tree.closed()
    slopes = tree.system(positions)[1] * tree.scale()
    values = np.linalg.svd(slopes, compute_uv=False)
    rank = int(np.sum(values > max(_LEAST, 100 * left) * values.max(initial=0.0)))
    return slopes.shape[0] - rank, slopes.shape[1] - rank
