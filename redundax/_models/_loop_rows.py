"""What joints that close loops hold, row by row, as forces and moments

Of a loop between an end p, with axes x, y, z, and another p', x', y', z', a row is a residual g whose rate is

    g' = f . (v(a) - v'(b)) + m . (w - w')

of the velocities of the two bodies at points a and b and of their turns: the row bears a force along f there, and a
moment m.
"""

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
