"""What joints that close loops hold, row by row, as forces and moments

Of a loop between an end p, with axes x, y, z, and another p', x', y', z', a row is a residual g whose rate is

    g' = f . (v(a) - v'(b)) + m . (w - w')

of the velocities of the two bodies at points a and b and of their turns: the row bears a force along f there, and a
moment m.
"""

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from ._description import Loop
from ._vectors import cross, vector_of

_KINDS = {  # force along axes of the first end; axes of the first and the second end that stay at the angle of `value`
    "hinge": ((0, 1, 2), ((0, 2), (1, 2))),
    "slide": ((0, 1), ((0, 2), (1, 2), (1, 0))),
    "cylindrical joint": ((0, 1), ((0, 2), (1, 2))),
    "universal joint": ((0, 1, 2), ((2, 2),)),
    "planar joint": ((2,), ((0, 2), (1, 2))),
    "point-on-line joint": ((0, 1), ()),
    "point-on-plane joint": ((2,), ()),
    "parallel-axes joint": ((), ((0, 2), (1, 2))),
    "angle joint": ((), ((2, 2),)),
    "no-rotation joint": ((), ((0, 2), (1, 2), (1, 0))),
}
ROLLED = {"rack joint": 0, "thread joint": 2}  # the axis of the first end along which a turn about z travels
MOST_TEETH = 1000  # of a wheel whose size alone a file tells


class LoopRows(NamedTuple):
    """Residuals g, (rows,), m or rad; the forces f and moments m, (rows, 3), global; and the points a and b."""

    residual: np.ndarray
    forces: np.ndarray
    moments: np.ndarray
    points: tuple[np.ndarray, np.ndarray]


def loop_rows(loop: Loop, first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> LoopRows:
    """The rows of a loop whose ends are at these points, with these axes, global."""
    (point, axes), (other, others) = first, second
    if loop.kind in ("connect", "weld"):
        residual, count = point - other, 3
        if loop.kind == "weld":
            residual, count = np.concatenate([residual, vector_of(axes @ others.T)]), 6
        return LoopRows(residual, np.eye(count, 3), np.eye(count, 3, -3), (point, other))
    apart = other - point
    if loop.kind == "distance joint":
        length = float(np.linalg.norm(apart))
        return LoopRows(np.array([length - loop.value]), -apart[None] / length, np.zeros((1, 3)), (point, other))
    if loop.kind == "constant-velocity joint":  # what both shafts turn about the normal of their plane is the same
        turns = cross(axes[:, 0], others[:, 1]) + cross(axes[:, 1], others[:, 0])
        angle = np.array([axes[:, 0] @ others[:, 1] + axes[:, 1] @ others[:, 0]])
        moments = np.concatenate([np.zeros((3, 3)), turns[None]])
        return LoopRows(np.concatenate([axes.T @ apart, angle]), -np.eye(4, 3) @ axes.T, moments, (other, other))
    if loop.kind in ROLLED or loop.kind == "gear joint":
        return _meshing(loop, (point, axes), (other, others))
    along, pairs = _KINDS[loop.kind]
    shift = axes.T[list(along)]
    offset, cosine = (loop.value, 0.0) if along else (0.0, np.cos(loop.value) if len(pairs) == 1 else 0.0)
    turns = np.array([cross(axes[:, one], others[:, two]) for one, two in pairs]).reshape(-1, 3)
    cosines = np.array([axes[:, one] @ others[:, two] - cosine for one, two in pairs])
    none = np.zeros((len(along), 3)), np.zeros((len(pairs), 3))
    return LoopRows(
        np.concatenate([shift @ apart - offset, cosines]),
        np.concatenate([-shift, none[1]]),
        np.concatenate([none[0], turns]),
        (other, other),
    )


def teeth_of(loop: Loop) -> tuple[int, int]:
    """Numbers of teeth of the wheels on the second and the first end, by the ratio of the radii of first and second."""
    ratio = Fraction(loop.value).limit_denominator(MOST_TEETH)
    return ratio.denominator, ratio.numerator


def _meshing(loop: Loop, first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> LoopRows:
    """Wheels, a rack or a thread, as `Gear`, `Rack` and `Thread` have them."""
    (point, axes), (other, others) = first, second
    z = axes[:, 2]
    if loop.kind in ROLLED:  # x + R a = 0, modulo turns
        way, turn = axes[:, ROLLED[loop.kind]], axes.T @ others
        angle = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
        gap = np.remainder(way @ (other - point) / loop.value + angle + np.pi, 2 * np.pi) - np.pi
        return LoopRows(np.array([loop.value * gap]), -way[None], -loop.value * z[None], (other, other))
    teeth = teeth_of(loop)
    line = point - other
    line = line - (line @ z) * z
    own, far = (-np.arctan2(line @ each[:, 1], line @ each[:, 0]) for each in (others, axes))
    period = 2 * np.pi / abs(teeth[0])
    gap = own + teeth[1] / teeth[0] * far
    touch = other + line * teeth[0] / sum(teeth)
    tangent = cross(z, line) * sum(teeth) / teeth[0] / (line @ line)
    return LoopRows(np.array([gap - period * np.round(gap / period)]), -tangent[None], np.zeros((1, 3)), (touch, touch))
