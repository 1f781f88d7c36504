"""A joint as it is drawn in space."""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class SpaceJoint:
    """A joint at the point `on_i` of body i and `on_j` of body j, with axes as columns, z along its own, on each.

    `spot` is where its symbol and name are on the picture, and `place` where that is in space; `teeth` those of wheels.
    """

    name: str
    kind: type
    i: int
    j: int
    on_i: np.ndarray
    on_j: np.ndarray
    axes_i: np.ndarray
    axes_j: np.ndarray
    place: np.ndarray
    spot: np.ndarray
    teeth: np.ndarray | None = None
    axis: None = None  # names keep clear of it as of a pin
