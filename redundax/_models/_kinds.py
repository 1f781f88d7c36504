"""Kinds of joints of files: what each holds, whose rows have names of `rx.spatial`, and what coordinates it leaves"""

from typing import NamedTuple

TURNS = ("bend_1", "bend_2", "twist")
_POINT = ("radial_1", "radial_2", "axial")
_BENT = ((0, 2), (1, 2))


class Coordinate(NamedTuple):
    """A coordinate: its name, whether it is a turn, and about or along which axis of which end."""

    name: str
    is_turn: bool
    end: str = "parent"
    column: int = 2


class Kind(NamedTuple):
    """What a joint holds: forces along axes of its first end, and angles between axes of its first and second; what it
    leaves; and of one that a body may hang on, how many numbers its positions and its velocities have."""

    along: tuple[int, ...] = ()
    angles: tuple[tuple[int, int], ...] = ()
    coordinates: tuple[Coordinate, ...] = ()
    sizes: tuple[int, int] = (0, 0)
    may_carry: bool = True

    @property
    def rows(self) -> tuple[str, ...]:
        """Their names."""
        turns = (TURNS[_BENT.index(pair)] if pair in _BENT else TURNS[2] for pair in self.angles)
        return (*(_POINT[k] for k in self.along), *turns)


_ANGLE, _TRAVEL = Coordinate("angle", True), Coordinate("travel", False)
_CROSS = Coordinate("angle_1", True), Coordinate("angle_2", True, "child")
_PLANE = Coordinate("travel_1", False, column=0), Coordinate("travel_2", False, column=1), _ANGLE
KINDS = {
    "fixed joint": Kind((0, 1, 2), (*_BENT, (1, 0))),
    "hinge": Kind((0, 1, 2), _BENT, (_ANGLE,), (1, 1)),
    "slide": Kind((0, 1), (*_BENT, (1, 0)), (_TRAVEL,), (1, 1)),
    "cylindrical joint": Kind((0, 1), _BENT, (_ANGLE, _TRAVEL), (2, 2)),
    "universal joint": Kind((0, 1, 2), ((2, 2),), _CROSS, (2, 2)),
    "constant-velocity joint": Kind((0, 1, 2), ((2, 2),), may_carry=False),
    "ball": Kind((0, 1, 2), sizes=(4, 3)),
    "planar joint": Kind((2,), _BENT, _PLANE, (3, 3)),
    "point-on-line joint": Kind((0, 1), may_carry=False),
    "point-on-plane joint": Kind((2,), may_carry=False),
    "parallel-axes joint": Kind((), _BENT, may_carry=False),
    "angle joint": Kind((), ((2, 2),), may_carry=False),
    "no-rotation joint": Kind((), (*_BENT, (1, 0)), may_carry=False),
    "free": Kind(sizes=(7, 6)),
    "connect": Kind((0, 1, 2), may_carry=False),
    "weld": Kind((0, 1, 2), (*_BENT, (1, 0)), may_carry=False),
}


def coordinates_of(kind: str) -> tuple[str, ...]:
    """Names of the coordinates of a kind, in the order of its positions."""
    return tuple(each.name for each in KINDS[kind].coordinates)
