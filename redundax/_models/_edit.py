"""Changes of a file that free rows of joints, whatever its format"""

import pathlib
from typing import NamedTuple

from ._description import Joint, Loop

ROWS = {
    "hinge": ("radial_1", "radial_2", "axial", "bend_1", "bend_2"),
    "slide": ("radial_1", "radial_2", "bend_1", "bend_2", "twist"),
    "ball": ("radial_1", "radial_2", "axial"),
    "connect": ("radial_1", "radial_2", "axial"),
    "weld": ("radial_1", "radial_2", "axial", "bend_1", "bend_2", "twist"),
}
TURNS = ("bend_1", "bend_2", "twist")


class Edit(NamedTuple):
    """What frees some rows: their names, what is changed, and how.

    - `how`: "free" a direction, a "ball" in place of a hinge, hold a "point" alone, "couple" two joints in place of a
      weld, or "delete".
    - `weight`: the mass that hangs on a joint of the tree; of what closes a loop -1. `joints`: those that are coupled.
    """

    rows: tuple[str, ...]
    target: Joint | Loop | str
    how: str
    weight: float = -1.0
    joints: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        """Of what is changed."""
        return self.target if isinstance(self.target, str) else self.target.name


class Written(NamedTuple):
    """The files of a copy, and what else is to be said of it."""

    files: tuple[pathlib.Path, ...]
    note: str = ""
