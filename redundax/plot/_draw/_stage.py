"""What drawings in the plane and in space share: what there is to draw, and how it is drawn."""

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ..._bodies._mechanism import Mechanism
from ..._system._state import State
from ..._system._units import StatedUnits
from ._arrows import Arrow, Arrows
from ._labels import Label
from ._pen import Pen


@runtime_checkable
class Stage(Protocol):
    """Names, joints, and places on the picture, (2,), of a mechanism at a state."""

    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def joints(self) -> Sequence[Any]: ...
    @property
    def units(self) -> StatedUnits: ...
    @property
    def ground(self) -> int: ...
    @property
    def gravity(self) -> np.ndarray: ...
    @property
    def weight(self) -> float: ...
    def joint_points(self, body: int) -> np.ndarray: ...
    def points(self) -> np.ndarray: ...
    @property
    def spacing(self) -> float: ...


@runtime_checkable
class Artist(Protocol):
    """Draws mechanisms of one kind; `margins` are those of new axes: left, lower, right and upper, points."""

    margins: tuple[float, float, float, float]

    def scene(self, mechanism: Mechanism, state: State) -> Any:
        """What there is to draw, a `Stage`."""

    def loads(self, stage: Any, mechanism: Mechanism, state: State, multipliers: np.ndarray) -> list[Arrow]:
        """Loads of the joints."""
        ...

    def applied(self, stage: Any) -> list[Arrow]:
        """Applied forces and moments."""
        ...

    def dress(self, axes: Any, stage: Any) -> None:
        """Titles of the axes."""

    def surround(self, pen: Pen, stage: Any, places: np.ndarray, ceiling: float) -> None:
        """Draw what stays the same at all times, clear of these places and below the height `ceiling`."""

    def paint(self, pen: Pen, stage: Any, groups: list[Arrows]) -> tuple[list[np.ndarray], list[Label]]:
        """Draw all; outlines of the bodies, and labels with the values of arrows."""
        ...
