"""A copy of a model's file with releases, and what is to be said of it"""

import dataclasses
import difflib
import pathlib
from collections.abc import Iterable, Sequence

import numpy as np

from .._tools._errors import RedundaxError
from ._audit import Audit
from ._choice import USABLE, Choice, in_words, listed
from ._description import missing_of
from ._edit import Changed, Edit
from ._formats import describe
from ._model import Model
from ._repair import Language, best_of, language
from ._tree import Tree
from ._urdf import closures_of

_LEAST = 1e-6  # singular values that count, relative to the largest
_LOOKS = 3  # positions beside, as of an audit


@dataclasses.dataclass(frozen=True)
class Fix:
    """A copy of a model with releases: its files, what they say, and what redundancy and freedom are left."""

    files: tuple[pathlib.Path, ...]
    freed: tuple[str, ...]
    redundancy: int
    freedom: int
    notes: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()

    def __str__(self) -> str:
        """What was done, in a line or more."""
        if not self.files:
            return f"no copy is written: {' '.join(self.notes)}"
        done = f"written: {', '.join(map(str, self.files))}"
        left = f"The copy has redundancy {self.redundancy}, freedom {self.freedom}."
        changed = ["What changed in the file:", *(f"  {line}" for line in self.lines)] if self.lines else []
        return "\n".join([done, *(f"  {each}" for each in self.freed), left, *self.notes, *changed])


def fix(model: Model, found: Audit, file: pathlib.Path, wanted: Sequence[str] = ()) -> Fix:
    """Write a copy of a model with what takes off redundancy and adds no motion.

    **Arguments:**

    - `file`: where to, with the ending of the model.
    - `wanted`: rows that are to be freed and no others, such as "B.axial"; what the audit proposes if not given.
    """
    says = language(model)
    edits = tuple(edit for each in found.repairs for edit in (each.choices[0].edits if each.choices else ()))
    worst = min((each.choices[0] for each in found.repairs if each.choices), key=lambda one: one.margin, default=None)
    if wanted:
        moves = _wanted(says.moves(model), wanted, found.rows, says)
        worst = best_of(found, found.along, moves) if found.along else None
        edits = worst.edits if worst else ()
    redundancy, freedom = found.figures
    if not found.is_decided:
        why = "undecided, as its positions do not agree or are not clear: no release is proved"
        why = "at a dead point, which tells nothing of the machine" if found.is_stuck else why
        return Fix((), (), redundancy, freedom, (f"the model is {why}.",))
    if not edits:
        why = f"nothing that takes off redundancy and adds no motion can be said in {says.name}: {says.lacks}."
        return Fix((), (), redundancy, freedom, (why if redundancy else "nothing is redundant.",))
    written = says.change(model, edits, file).write()
    left, expected = _figures(model, file), (redundancy - sum(len(edit.rows) for edit in edits), freedom)
    notes = [*_unfreed(wanted, edits)]
    if left != expected:
        figures = "redundancy {} and freedom {}".format(*expected)
        notes.append(f"{figures} were expected, so look at the copy before you use it.")
    if left[0] and not wanted:
        notes.append(f"{says.name} cannot say what would take off the rest: {says.lacks}.")
    if missing := missing_of(model.notes):
        them = "it" if len(missing) == 1 else "them"
        notes.append(
            f"These figures are without {listed(missing)}. What is freed repeats others with {them} too; whether more "
            "does is undecided."
        )
    notes += [written.note] if written.note else []
    notes += [*_warned(model, found, edits, worst)]
    words = tuple(in_words(edits, found.directions))
    return Fix(tuple(written.files), words, *left, tuple(notes), _changes(written, model.path, file))


def _unfreed(wanted: Sequence[str], edits: Sequence[Edit]) -> Iterable[str]:
    """Rows that were named and stay."""
    freed = {row for edit in edits for row in edit.rows}
    kept = [row for row in dict.fromkeys(wanted) if row not in freed]
    if kept:
        are, they = ("is", "it") if len(kept) == 1 else ("are", "they")
        yield f"{listed(kept, len(kept))} {are} not freed: {they} would add a motion."


def _warned(model: Model, found: Audit, edits: Sequence[Edit], worst: Choice | None) -> Iterable[str]:
    """What a reader would take for granted of a copy, and must not."""
    if worst and worst.margin <= USABLE:
        yield f"It moves freely near {worst.where}: not usable over the full motion."
    is_play = all(edit.how not in ("delete", "couple") for edit in edits)
    built, other = ("has this play", "has none") if is_play else ("is built like this", "is not")
    yield (
        f"It is the model of a machine that really {built}. If yours {other}, its joint loads stay unknown: take the "
        "line that matches your hardware (--release)."
    )
    freed = {row for edit in edits for row in edit.rows}
    joints = list(dict.fromkeys(edit.name for edit in edits if edit.how in ("free", "ball")))
    touched = [set(each.rows) for each in found.repairs if freed & set(each.rows)]
    rows = {row for some in touched for row in some} - freed
    loops = [loop.name for loop in model.tree.loops if any(row.rpartition(".")[0] == loop.name for row in rows)]
    if joints and loops and model.described.format == "MJCF":
        give = "gives" if len(joints) == 1 else "give"
        yield (
            f"In MuJoCo, connect and weld are springs: there {listed(joints)} now {give} way as far as {listed(loops)} "
            f"{'does' if len(loops) == 1 else 'do'}. Stiffen solref and solimp of these if the copy sags."
        )


def _changes(written: Changed, before: pathlib.Path, after: pathlib.Path) -> tuple[str, ...]:
    """Lines of a file that are other in another."""
    old, new = written.texts or (path.read_text(encoding="utf8", errors="replace") for path in (before, after))
    lines = [*difflib.unified_diff(old.splitlines(), new.splitlines(), n=0, lineterm="")][2:]
    return tuple(line for line in lines if not line.startswith("@@"))


def _wanted(moves: Iterable[Edit], wanted: Sequence[str], rows: Sequence[str], says: Language) -> list[Edit]:
    for row in wanted:
        if row not in rows:
            raise RedundaxError(
                f"Argument `release` names '{row}', which is no row of the model. {_rows_there(row, rows)}"
            )
    some = [move for move in moves if set(move.rows) <= set(wanted)]
    missing = set(wanted) - {row for move in some for row in move.rows}
    if missing:
        raise RedundaxError(
            f"Argument `release`: {sorted(missing)} cannot be freed in {says.name}: {says.lacks}. Choose other rows."
        )
    return some


def _rows_there(row: str, rows: Sequence[str]) -> str:
    """The rows of the joint that a name begins with; or the joints."""
    joints: dict[str, list[str]] = {}
    for each in rows:
        joints.setdefault(each.rpartition(".")[0], []).append(each.rpartition(".")[2])
    named = row if row in joints else row.rpartition(".")[0]
    if named in joints:
        return f"{named} has {', '.join(joints[named])}."
    return f"Its joints and loops are {', '.join(joints)}."


def _figures(model: Model, file: pathlib.Path) -> tuple[int, int]:
    """Redundancy and freedom of a copy of a model, in the coordinates of its joints; as of the model itself where it is
    regular: at a singular position the rank is lower than at others."""
    tree = Tree(describe(file, closures_of(file, None)))
    positions, left = tree.closed(_same_position(model, tree))
    rank = 0
    for at in (positions, *tree.elsewhere(positions, left, _LOOKS)):
        values = np.linalg.svd(tree.system(at)[1] * tree.scale, compute_uv=False)
        rank = max(rank, int(np.sum(values > max(_LEAST, 100 * left) * values.max(initial=0.0))))
    return tree.rows - rank, tree.nv - rank


def _same_position(model: Model, copy: Tree) -> np.ndarray:
    """Where a copy is as its model is; joints that it has more, or of another kind, are at 0."""
    known = {joint.name: place for joint, place in zip(model.tree.joints, model.tree.places, strict=True)}
    positions = copy.reference.copy()
    for joint, place in zip(copy.joints, copy.places, strict=True):
        own = model.positions[known.get(joint.name, slice(0))]
        if own.size == place.stop - place.start:
            positions[place] = own
    return positions
