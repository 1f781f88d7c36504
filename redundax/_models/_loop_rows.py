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
from ._kinds import KINDS
from ._vectors import about_z, cross, vector_of

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
        along = apart / (length or 1.0)  # what a rope runs through has none
        return LoopRows(np.array([length - loop.value]), -along[None], np.zeros((1, 3)), (point, other))
    if loop.kind == "constant-velocity joint":  # what both shafts turn about the normal of their plane is the same
        turns = cross(axes[:, 0], others[:, 1]) + cross(axes[:, 1], others[:, 0])
        angle = np.array([axes[:, 0] @ others[:, 1] + axes[:, 1] @ others[:, 0]])
        moments = np.concatenate([np.zeros((3, 3)), turns[None]])
        return LoopRows(np.concatenate([axes.T @ apart, angle]), -np.eye(4, 3) @ axes.T, moments, (other, other))
    if loop.kind in ROLLED or loop.kind == "gear joint":
        return _meshing(loop, (point, axes), (other, others))
    along, pairs = KINDS[loop.kind][:2]
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


def count_of(loop: Loop, first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> float:
    """Where the second end of a hinge or slide is as the first sees it, rad or m; of a hinge the turn in the middle of
    its limits."""
    (point, axes), (other, others) = first, second
    if loop.kind == "slide":
        return float(axes[:, 2] @ (other - point))
    middle, turn = np.mean(loop.limits or 0.0), about_z(axes.T @ others)
    return turn + 2 * np.pi * float(np.round((middle - turn) / (2 * np.pi))) if np.isfinite(middle) else turn


def teeth_of(loop: Loop) -> tuple[int, int]:
    """Numbers of teeth of the wheels on the second and the first end, by the ratio of the radii of first and second."""
    ratio = Fraction(loop.value).limit_denominator(MOST_TEETH)
    return ratio.denominator, ratio.numerator


def _meshing(loop: Loop, first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> LoopRows:
    """Wheels, a rack or a thread, as `Gear`, `Rack` and `Thread` have them."""
    (point, axes), (other, others) = first, second
    z = axes[:, 2]
    if loop.kind in ROLLED:  # x + R a = 0, modulo turns
        way = axes[:, ROLLED[loop.kind]]
        gap = np.remainder(way @ (other - point) / loop.value + about_z(axes.T @ others) + np.pi, 2 * np.pi) - np.pi
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
