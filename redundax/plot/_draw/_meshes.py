"""Wheels that roll on each other as a picture shows them: pitch circles, lines of racks and belts, and of action.

The pitch point of teeth divides the line of centres by z_i : z_j; the line of action leans by the pressure angle of the
mesh from the common tangent there, to the side on which the force of the flank turns body i. Wheels of a coupling touch
if they turn in opposite senses, and have a belt otherwise.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..._bodies._joints import AbstractJoint, AngleCoupling, GearPair, RackAndPinion
from ..._bodies._space._joints._gear import Gear

Vectors = Sequence[np.ndarray]

_Z = np.array([0.0, 0.0, 1.0])
_PARALLEL = 1e-6  # sine of the angle between axes, up to which they are parallel: files give them with six digits


class Circle(NamedTuple):
    """A circle about an axis, on a body."""

    centre: np.ndarray
    axis: np.ndarray
    radius: float
    body: int


class Line(NamedTuple):
    """A line between two points (2, 3), of a body where that carries it; a pitch line is `dashed`."""

    ends: np.ndarray
    body: int | None = None
    dashed: bool = False


@dataclasses.dataclass(frozen=True)
class Mesh:
    """Circles and lines of a joint, and where teeth touch, if it has any."""

    circles: tuple[Circle, ...] = ()
    lines: tuple[Line, ...] = ()
    pitch: np.ndarray | None = None


def mesh_of(
    element: AbstractJoint, k: int, bodies: tuple[int, int], points: Vectors, axes: Vectors, normal: np.ndarray
) -> Mesh:
    """Of member k of stacked elements, between points and axes z of both bodies; `normal` is that of a rack."""
    if isinstance(element, Gear):
        return _wheels(np.asarray(element.teeth, float)[k], bodies, points, axes)
    if isinstance(element, AngleCoupling):
        return _coupled(float(np.asarray(element.ratio)[k]), bodies, points)
    if isinstance(element, GearPair | RackAndPinion):
        given = element.teeth, element.flank, element.pressure_angle, element.module
        teeth, flank, angle, module = (np.asarray(each, float)[k] for each in given)
        if isinstance(element, GearPair):
            return _pair(bodies, points, teeth, flank, module * np.cos(angle) / 2)
        return _rack(bodies, points[0], normal, module * teeth / 2, flank, angle)
    return Mesh()


def _wheels(teeth: np.ndarray, bodies: tuple[int, int], points: Vectors, axes: Vectors) -> Mesh:
    """Of axes in space; bevel wheels lie on the cones whose apex is where the axes come nearest to each other."""
    (p, q), (z, w), (own, other) = points, axes, teeth
    across = np.cross(z, w)
    if np.linalg.norm(across) < _PARALLEL:
        line = (q - p) - z * ((q - p) @ z)
        share = float(np.linalg.norm(line)) / abs(own + other) if own + other else 0.0
        return _circles(bodies, (p, p + line), axes, (share * abs(own), share * abs(other)))
    along_z, along_w, _ = np.linalg.solve(np.stack([z, -w, across], axis=1), q - p)
    size = np.linalg.norm(across)
    radii = abs(along_z * size / (abs(other / own) + z @ w)), abs(along_w * size / (abs(own / other) + z @ w))
    return _circles(bodies, points, axes, radii)


def _coupled(ratio: float, bodies: tuple[int, int], points: Vectors) -> Mesh:
    line = points[1] - points[0]
    distance = float(np.linalg.norm(line))
    if distance == 0:
        return Mesh()
    whole = distance if ratio > 0 else 0.5 * distance
    first, second = whole / (1 + abs(ratio)), whole * abs(ratio) / (1 + abs(ratio))
    tilt, belts = (first - second) / distance, []
    for side in (1.0, -1.0) if ratio < 0 else ():
        normal = (tilt * line + side * np.sqrt(1 - tilt**2) * np.cross(_Z, line)) / distance
        belts.append(Line(np.array([points[0] + first * normal, points[1] + second * normal])))
    return _circles(bodies, points, (_Z, _Z), (first, second), belts)


def _pair(bodies: tuple[int, int], points: Vectors, teeth: np.ndarray, flank: float, base: float) -> Mesh:
    offset, whole = points[1] - points[0], teeth.sum()
    distance = float(np.linalg.norm(offset)) or 1.0
    along, cosine = np.sign(whole) * offset / distance, min(abs(whole) * base / distance, 1.0)
    action = flank * cosine * np.cross(_Z, along) - np.sqrt(1 - cosine**2) * along
    radii = distance * np.abs(teeth / whole)
    pitch = points[0] + offset * teeth[0] / whole
    return _circles(bodies, points, (_Z, _Z), radii, [Line(_around(pitch, 0.4 * radii.min() * action))], pitch)


def _rack(
    bodies: tuple[int, int], centre: np.ndarray, normal: np.ndarray, radius: float, flank: float, angle: float
) -> Mesh:
    pitch, along = centre - radius * normal, np.cross(_Z, normal)
    action = np.sin(angle) * normal - flank * np.cos(angle) * along
    rack = Line(_around(pitch, -2 * radius * along), bodies[1], True)
    lines = [Line(_around(pitch, 0.4 * radius * action)), rack]
    return _circles(bodies, (centre,), (_Z,), (radius,), lines, pitch)


def _around(middle: np.ndarray, half: np.ndarray) -> np.ndarray:
    return np.array([middle - half, middle + half])


def _circles(
    bodies: tuple[int, int],
    centres: Vectors,
    axes: Vectors,
    radii: Sequence[float] | np.ndarray,
    lines: Sequence[Line] = (),
    pitch: np.ndarray | None = None,
) -> Mesh:
    found = tuple(map(Circle, centres, axes, map(float, radii), bodies))
    return Mesh(found, tuple(lines), pitch)
