"""Changes of a file that take off redundancy, in words and as data."""

import dataclasses
import re
from collections.abc import Container, Iterator, Mapping, Sequence

import numpy as np

from .._tools._json import JSON
from ._description import Joint
from ._edit import Edit
from ._kinds import KINDS

LEAST = 1e-3  # margins: of what adds no motion
USABLE = 0.02  # and of what stays clear of it along the motion
_NUMBER = re.compile(r"(\d+)", re.ASCII)
_WORDS = {  # a direction of a joint that is freed
    "radial_1": "slides across its axis along",
    "radial_2": "slides across its axis along",
    "axial": "slides along its axis",
    "bend_1": "tilts about",
    "bend_2": "tilts about",
    "twist": "turns about its axis",
}


@dataclasses.dataclass(frozen=True)
class Choice:
    """Changes that are made together: the least margin along the motion, and where it is, a joint and its position."""

    edits: tuple[Edit, ...]
    margin: float
    at: tuple[str, float]

    @property
    def rows(self) -> tuple[str, ...]:
        """What they free; each takes off one redundancy."""
        return tuple(row for edit in self.edits for row in edit.rows)

    @property
    def where(self) -> str:
        """The position where the margin is least; the motion may not have led away from the first."""
        return f"{self.at[0]} = {self.at[1]:.3g}" if self.at[0] else "this very position"

    @property
    def is_usable(self) -> bool:
        """Whether the copy stays clear of a further motion wherever the joints were moved."""
        return self.margin > USABLE


@dataclasses.dataclass(frozen=True)
class Repair:
    """What can be done about some dependent groups, as the file can say it.

    - `choices`: the first is what `--fix` takes; another, if there is one, does as much.
    - `rest`: rows that would have to be freed besides, which the file cannot say; `sayable`: rows that it can
      free, those together that go together.
    """

    redundancy: int
    rows: tuple[str, ...]
    choices: tuple[Choice, ...]
    rest: tuple[str, ...]
    sayable: tuple[tuple[str, ...], ...]

    def to_dict(self, directions: Mapping[str, np.ndarray]) -> dict[str, JSON]:
        """As data."""
        return {
            "redundancy": self.redundancy,
            "choices": [
                {
                    "change": in_words(each.edits, directions),
                    "rows": list(each.rows),
                    "margin": each.margin,
                    "usable": each.is_usable,
                }
                for each in self.choices
            ],
            "rows_the_file_cannot_free": list(self.rest),
        }


def vector(along: np.ndarray) -> str:
    """A direction in world axes, as text."""
    return f"({' '.join(f'{0.0 if abs(x) < 5e-4 else x:.3g}' for x in along)})"


def series(names: Sequence[str]) -> list[str]:
    """Names, those that differ by numbers that count on together: "leg 1 to leg 6" for three or more."""
    left, told = dict.fromkeys(names), []
    while left:
        name = next(iter(left))
        numbers = range(1, len(_NUMBER.split(name)), 2)
        run = max((_run(left, name, places) for places in (*([k] for k in numbers), numbers)), key=len)
        run = run if len(run) > 2 else [name]
        told.append(f"{run[0]} to {run[-1]}" if len(run) > 1 else name)
        left = {name: None for name in left if name not in run}
    return told


def _run(names: Container[str], name: str, places: Sequence[int]) -> list[str]:
    """A name and those of some names that count on from it, by its numbers at these places."""
    run = []
    while name in names and name not in run:
        run.append(name)
        parts = _NUMBER.split(name)
        for k in places:
            parts[k] = f"{int(parts[k]) + 1:0{len(parts[k])}}"
        name = "".join(parts)
    return run


def listed(names: Sequence[str], most: int = 6) -> str:
    """Names as a sentence has them: "A, B and C"; of many the first alone."""
    names = series(names)
    if len(names) > most:
        names = [*names[: most - 1], f"{len(names) - most + 1} more"]
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def in_words(edits: Sequence[Edit], directions: Mapping[str, np.ndarray]) -> list[str]:
    """What changes: joint by joint, or those together that change alike."""
    told: dict[str, list[str]] = {}
    for name in dict.fromkeys(edit.name for edit in edits):
        own = [edit for edit in edits if edit.name == name]
        told.setdefault(_change(own, directions), []).append(name)
    return [sentence for change, names in told.items() for sentence in _sentence(change, names)]


def _sentence(change: str, names: Sequence[str]) -> Iterator[str]:
    one, _, many = change.partition("|")
    if many:
        yield f"{listed(names, len(names))} {one if len(names) == 1 else many}"
    else:
        yield from (f"{name} {one}" for name in names)


def _change(edits: Sequence[Edit], directions: Mapping[str, np.ndarray]) -> str:
    target, how = edits[0].target, edits[0].how
    if how == "delete":
        return "is deleted: nothing passes through it then|are deleted: nothing passes through them then"
    if how == "ball":
        return "becomes a ball joint|become ball joints"
    if how == "point":
        return "holds a point alone|hold points alone"
    if how == "couple":
        return "becomes a joint equality, which bears nothing else|become joint equalities, which bear nothing else"
    rows = [row for edit in edits for row in edit.rows]
    if how == "become":
        kind = f"{edits[0].kind.removesuffix(' joint')} joint"
        return f"becomes a {kind}, which {_freed(edits, directions)}"
    if isinstance(target, Joint) and len(rows) == len(KINDS[target.kind].rows):
        return "carries nothing then: it is free in all directions|carry nothing then: they are free in all directions"
    return _freed(edits, directions)


def _freed(edits: Sequence[Edit], directions: Mapping[str, np.ndarray]) -> str:
    target, rows = edits[0].target, [row for edit in edits for row in edit.rows]
    told: dict[str, list[str]] = {}
    for row in rows:
        is_ball = isinstance(target, Joint) and target.kind == "ball"  # it has no axis
        words = "slides along" if is_ball else _WORDS[row.rpartition(".")[2]]
        told.setdefault(words, []).append(vector(directions[row]) if row in directions else "")
    return listed([f"{words} {' and '.join(along)}".rstrip() for words, along in told.items()])
