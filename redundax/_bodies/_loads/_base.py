"""What a load is: a wrench on body i and one on body j, from their poses and rates."""

import abc
from typing import ClassVar, Generic, TypeVar

from jaxtyping import Array, Float

from .._frame import AbstractFrame
from .._plane import PLANE
from .._stack import AbstractBetweenBodies

M = TypeVar("M")
W = TypeVar("W")


class AbstractLoad(Generic[M, W], AbstractBetweenBodies):
    """A load on the planar bodies i and j; a load on one body has the ground as j. M is the `Motion` of a body, W a
    `Wrench`."""

    frame: ClassVar[AbstractFrame] = PLANE

    @abc.abstractmethod
    def wrenches(self, i: M, j: M, t: Float[Array, ""]) -> tuple[W, W]:
        """Wrenches on i and on j, a `Wrench` each, from the `Motion` of both."""
