"""What a load in space is."""

from typing import ClassVar

from ..._frame import AbstractFrame
from ..._loads import AbstractLoad as AbstractAnyLoad
from .._frame import SPACE
from .._pose import Motion, Wrench


class AbstractLoad(AbstractAnyLoad[Motion, Wrench]):
    """A load on the bodies i and j in space; a load on one body has the ground as j."""

    frame: ClassVar[AbstractFrame] = SPACE
