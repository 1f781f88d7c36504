"""Convex solids as flat faces, of which pictures in space are made, whoever draws them

    brightness of a face = 0.62 + 0.38 max(n . l, 0)

with its outward normal n and the direction l to the light.
"""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import TypedDict, Unpack

import numpy as np

from ._pen import hull

_ROUND = 14  # sides of a cylinder


class Style(TypedDict, total=False):
    """What a solid may be, beside its colour."""

    opacity: float
    name: str
    has_edge: bool


@dataclasses.dataclass(frozen=True)
class Solid:
    """Corners (v, 3), and faces as the indices of their corners in order about the face; a flat one has one face.

    `name` is what it belongs to: "body door", "joint top"; `has_edge` whether it is seen apart from what it joins.
    """

    corners: np.ndarray
    faces: tuple[tuple[int, ...], ...]
    colour: str
    opacity: float = 1.0
    name: str = ""
    has_edge: bool = True

    def normals(self) -> np.ndarray:
        """Unit normals of the faces, outward, (faces, 3)."""
        out, middle = np.empty((len(self.faces), 3)), self.corners.mean(axis=0)
        number = np.array([len(face) for face in self.faces])
        for corners in np.unique(number):
            around = self.corners[np.array([face for face in self.faces if len(face) == corners])]
            normal = np.cross(around, np.roll(around, -1, axis=1)).sum(axis=1)
            normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
            inward = np.sum(normal * (around.mean(axis=1) - middle), axis=1) < 0
            out[number == corners] = np.where(inward[:, None], -normal, normal)
        return out

    def triangles(self) -> np.ndarray:
        """Corners of triangles that cover the faces, (triangles, 3)."""
        fans = [[(face[0], *face[k : k + 2]) for k in range(1, len(face) - 1)] for face in self.faces]
        return np.array([triangle for fan in fans for triangle in fan])


def unit(v: np.ndarray) -> np.ndarray:
    """v over its length."""
    return v / max(float(np.linalg.norm(v)), 1e-300)


def axes_of(axis: np.ndarray) -> np.ndarray:
    """Right-handed axes as columns, of which the last is along `axis`."""
    z = unit(axis)
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x = unit(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def box(
    centre: np.ndarray, axes: np.ndarray, size: Sequence[float] | np.ndarray, colour: str, **style: Unpack[Style]
) -> Solid:
    """A box of the given size (3,) along its axes, the columns of (3, 3)."""
    half = np.asarray(size) / 2
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    rings = [np.column_stack([square, np.full(4, level)]) for level in (-1.0, 1.0)]
    return _prism(centre + (np.concatenate(rings) * half) @ axes.T, 4, colour, **style)


def rod(
    start: np.ndarray, end: np.ndarray, radius: float, colour: str, sides: int = 8, **style: Unpack[Style]
) -> Solid:
    """A cylinder between two points, cut in pieces along it, so that its faces can be sorted by depth."""
    pieces = int(np.clip(np.linalg.norm(end - start) / max(4.0 * radius, 1e-300), 1, 40))
    levels = [start + share * (end - start) for share in np.linspace(0.0, 1.0, pieces + 1)]
    around = radius * _circle(axes_of(end - start), sides)
    faces = [
        (low + a, low + b, low + sides + b, low + sides + a)
        for low in range(0, pieces * sides, sides)
        for a, b in _pairs(sides)
    ]
    caps = [tuple(range(sides)), tuple(range(pieces * sides, (pieces + 1) * sides))]
    corners = np.concatenate([level + around for level in levels])
    return Solid(corners, (*faces, *caps), colour, **style)


def cone(
    start: np.ndarray,
    end: np.ndarray,
    first: float,
    last: float,
    colour: str,
    sides: int = _ROUND,
    **style: Unpack[Style],
) -> Solid:
    """A cone between two points with the radius at each."""
    ring = _circle(axes_of(end - start), sides)
    return _prism(np.concatenate([start + first * ring, end + last * ring]), sides, colour, **style)


def cylinder(
    centre: np.ndarray, axis: np.ndarray, half: float, radius: float, colour: str, **style: Unpack[Style]
) -> Solid:
    """A cylinder about a centre, `half` its length to either side."""
    return rod(centre - half * axis, centre + half * axis, radius, colour, _ROUND, **style)


def ball(centre: np.ndarray, radius: float, colour: str, *, steps: int = 6, **style: Unpack[Style]) -> Solid:
    """A sphere; with two steps an octahedron."""
    sides = 2 * steps
    heights = np.linspace(-np.pi / 2, np.pi / 2, steps + 1)[1:-1]
    angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    rings = [
        np.column_stack([np.cos(h) * np.cos(angle), np.cos(h) * np.sin(angle), 0 * angle + np.sin(h)]) for h in heights
    ]
    corners = np.concatenate([[[0.0, 0.0, -1.0]], *rings, [[0.0, 0.0, 1.0]]])
    turn, last = _pairs(sides), len(corners) - 1
    faces = [(0, 1 + b, 1 + a) for a, b in turn] + [(last, last - sides + a, last - sides + b) for a, b in turn]
    for level in range(len(rings) - 1):
        low = 1 + level * sides
        faces += [(low + a, low + b, low + sides + b, low + sides + a) for a, b in turn]
    return Solid(centre + radius * corners, tuple(faces), colour, **style)


def ring(
    centre: np.ndarray, axis: np.ndarray, radius: float, thickness: float, colour: str, **style: Unpack[Style]
) -> list[Solid]:
    """A circle about an axis, of short rods."""
    around = _circle(axes_of(axis), 36)
    return path(centre + radius * np.concatenate([around, around[:1]]), thickness, colour, **style)


def path(points: np.ndarray, radius: float, colour: str, **style: Unpack[Style]) -> list[Solid]:
    """A line through points, of rods."""
    style = {**style, "has_edge": False}
    return [rod(a, b, radius, colour, 5, **style) for a, b in itertools.pairwise(points)]


def arrow(
    tail: np.ndarray, tip: np.ndarray, width: float, colour: str, *, heads: int = 1, **style: Unpack[Style]
) -> list[Solid]:
    """An arrow with one head, or two for a moment; a short one is all head."""
    along, length = unit(tip - tail), float(np.linalg.norm(tip - tail))
    head = min(4.0 * width, 0.8 * length / heads)
    neck = tip - heads * head * along
    shaft = rod(tail, neck, min(width, head / 3) / 2, colour, **style)
    starts = [tip - (k + 1) * head * along for k in range(heads)]
    return [shaft, *(cone(start, start + head * along, 0.4 * head, 0.0, colour, 10, **style) for start in starts)]


def hull_solids(points: np.ndarray, thickness: float, colour: str, edge: str, name: str) -> list[Solid]:
    """What points span: a bar, a plate with a rim, or a body with edges, translucent; `thickness` is that of bars."""
    middle = points.mean(axis=0)
    _, size, directions = np.linalg.svd(points - middle)
    size = np.append(size, np.zeros(3))[:3]
    rank = int(np.sum(size > max(1e-6 * size[0], 0.3 * thickness)))
    if rank == 0:
        return [ball(middle, 2.0 * thickness, colour, name=name)]
    if rank == 1:
        along = (points - middle) @ directions[0]
        start, end = (middle + share * directions[0] for share in (along.min(), along.max()))
        return [rod(start, end, thickness, colour, name=name)]
    return (
        _plate(points, directions, thickness, colour, edge, name)
        if rank == 2
        else _polyhedron(points, thickness, colour, edge, name)
    )


def _plate(
    points: np.ndarray, directions: np.ndarray, thickness: float, colour: str, edge: str, name: str
) -> list[Solid]:
    middle = points.mean(axis=0)
    corners = middle + hull((points - middle) @ directions[:2].T) @ directions[:2]
    rim = path(np.concatenate([corners, corners[:1]]), 0.4 * thickness, edge, name=name)
    return [Solid(corners, (tuple(range(len(corners))),), colour, 0.4, name), *rim]


def _polyhedron(points: np.ndarray, thickness: float, colour: str, edge: str, name: str) -> list[Solid]:
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    sides: dict[tuple[float, ...], set[int]] = {}  # triangles of one plane are one face
    for triangle, plane in zip(hull.simplices, np.round(hull.equations[:, :3], 6) + 0.0, strict=True):
        sides.setdefault(tuple(plane), set()).update(int(k) for k in triangle)
    faces = tuple(_in_order(points, sorted(found), np.array(plane)) for plane, found in sides.items())
    edges = {(min(a, b), max(a, b)) for face in faces for a, b in zip(face, (*face[1:], face[0]), strict=True)}
    rim = [rod(points[a], points[b], 0.4 * thickness, edge, 5, name=name) for a, b in sorted(edges)]
    return [Solid(points, faces, colour, 0.4, name), *rim]


def _in_order(points: np.ndarray, corners: list[int], normal: np.ndarray) -> tuple[int, ...]:
    """Corners of a convex face about its middle."""
    flat = (points[corners] - points[corners].mean(axis=0)) @ axes_of(normal)[:, :2]
    return tuple(corners[k] for k in np.argsort(np.arctan2(flat[:, 1], flat[:, 0])))


def _prism(corners: np.ndarray, sides: int, colour: str, **style: Unpack[Style]) -> Solid:
    """The solid between two polygons of as many corners."""
    faces = [(a, b, sides + b, sides + a) for a, b in _pairs(sides)]
    caps = (tuple(range(sides)), tuple(range(sides, 2 * sides)))
    return Solid(corners, (*faces, *caps), colour, **style)


def _circle(axes: np.ndarray, sides: int) -> np.ndarray:
    """Corners on the unit circle about the last of the axes, (sides, 3)."""
    angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    return np.cos(angle)[:, None] * axes[:, 0] + np.sin(angle)[:, None] * axes[:, 1]


def _pairs(sides: int) -> list[tuple[int, int]]:
    """Neighbours about a circle."""
    return [(k, (k + 1) % sides) for k in range(sides)]
