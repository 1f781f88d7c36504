"""A joint as it is drawn in space."""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class SpaceJoint:
    """A joint at the point `on_i` of body i and `on_j` of body j, with axes as columns, z along its own, on each.

    `spot` is where its symbol and name are on the picture, and `place` where that is in space; `teeth` those of wheels.
    `locks` are the names of its rows, `slides` is whether it is free along its axis, `reads_axis` whether it has one;
    `radius` is that of a wheel on a floor, which touches it at `on_j`, 0 of a blade.
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
    locks: frozenset[str]
    slides: bool
    reads_axis: bool
    teeth: np.ndarray | None = None
    radius: float | None = None
    axis: None = None  # names keep clear of it as of a pin

    @property
    def parts(self) -> tuple[bool, bool, bool, bool]:
        """Whether it locks offsets square to its axis, that along it, tilts of it, and turns about it."""
        ways = ({"radial_1", "radial_2"}, {"axial"}, {"bend_1", "bend_2"}, {"twist"})
        across, along, tilt, twist = (way <= self.locks for way in ways)
        return across, along, tilt, twist
