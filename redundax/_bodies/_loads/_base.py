"""What a load is: a wrench on body i and one on body j, from their poses and rates."""

import abc
from typing import Any, ClassVar

from jaxtyping import Array, Float

from .._frame import AbstractFrame
from .._plane import PLANE
from .._stack import AbstractBetweenBodies


class AbstractLoad(AbstractBetweenBodies):
    """A load on the planar bodies i and j; a load on one body has the ground as j."""

    frame: ClassVar[AbstractFrame] = PLANE

    @abc.abstractmethod
    def wrenches(self, i: Any, j: Any, t: Float[Array, ""]) -> tuple[Any, Any]:
        """Wrenches on i and on j, a `Wrench` each, from the `Motion` of both."""
