"""Changes of a file that free rows of joints, whatever its format"""

import pathlib
from typing import NamedTuple

from ._description import Joint, Loop, Tie
from ._model import Model


class Edit(NamedTuple):
    """What frees some rows: their names, what is changed, and how.

    - `how`: "free" a direction, a "ball" in place of a hinge, hold a "point" alone, "couple" two joints in place of a
      weld, "become" a joint of another kind, or "delete".
    - `weight`: the mass that hangs on a joint of the tree; of what closes a loop -1. `joints`: those that are coupled.
    - `kind`: what a joint becomes.
    """

    rows: tuple[str, ...]
    target: Joint | Loop | str
    how: str
    weight: float = -1.0
    joints: tuple[int, ...] = ()
    kind: str = ""

    @property
    def name(self) -> str:
        """Of what is changed."""
        return self.target if isinstance(self.target, str) else self.target.name


def deleted(model: Model, part: Loop | Tie) -> Edit:
    """What leaves out a loop, or what ties joints."""
    rows = tuple(row for row in model.mechanism.rows.labels if row.rpartition(".")[0] == part.name)
    return Edit(rows, part if isinstance(part, Loop) else part.name, "delete")


class Changed(NamedTuple):
    """A copy with changes: its files and what they hold, the changes in a line each, what else is to be said of it, and
    its text before and after where files do not show it."""

    files: dict[pathlib.Path, bytes]
    lines: list[str]
    note: str = ""
    texts: tuple[str, str] | None = None

    def write(self) -> "Changed":
        """The same, written."""
        for path, content in self.files.items():
            path.write_bytes(content)
        return self
