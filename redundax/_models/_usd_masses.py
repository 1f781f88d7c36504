"""Masses of USD: what a body says itself, or its shapes by their densities

A shape is its volume V, its centre c and its second moments S = integral of (x - c)(x - c)^T, which a map x -> A x + b
takes to |det A| V, A c + b and |det A| A S A^T. Of density rho its inertia is rho (tr(S) 1 - S).
"""

from types import ModuleType
from typing import NamedTuple

import numpy as np

from ._usd_types import UsdMesh, UsdPrim

_FAR = 1e30  # of a point of a mesh, which may be anything else in a file that is spoiled


class Shape(NamedTuple):
    """Volume, centre and second moments."""

    volume: float
    centre: np.ndarray
    moments: np.ndarray

    def mapped(self, linear: np.ndarray, shift: np.ndarray) -> "Shape":
        """The same after a map."""
        size = abs(float(np.linalg.det(linear)))
        return Shape(size * self.volume, linear @ self.centre + shift, size * linear @ self.moments @ linear.T)


def shape_of(prim: UsdPrim, UsdGeom: ModuleType) -> Shape | None:
    """A shape in its own axes; None of one that encloses no volume that is known here."""

    def value(name: str) -> float:
        return float(prim.GetAttribute(name).Get())

    kind, none = prim.GetTypeName(), np.zeros(3)
    if kind == "Cube":
        size = value("size")
        return Shape(size**3, none, size**5 / 12 * np.eye(3))
    if kind == "Sphere":
        r = value("radius")
        volume = 4 / 3 * np.pi * r**3
        return Shape(volume, none, volume * r**2 / 5 * np.eye(3))
    if kind == "Mesh":
        return _mesh(UsdGeom.Mesh(prim))
    if kind not in ("Cylinder", "Capsule", "Cone"):
        return None
    r, h, place = value("radius"), value("height"), "XYZ".index(prim.GetAttribute("axis").Get())
    volume, axis = np.pi * r**2 * h, np.eye(3)[place]
    across, along, centre = volume * r**2 / 4, volume * h**2 / 12, none
    if kind == "Cone":  # with its tip at h / 2
        volume, centre = volume / 3, -h / 4 * axis
        across, along = volume * 3 / 20 * r**2, volume * 3 / 80 * h**2
    if kind == "Capsule":
        ends = 4 / 3 * np.pi * r**3
        volume, across = volume + ends, across + ends * r**2 / 5
        along += ends * (r**2 / 5 + 3 / 8 * r * h + h**2 / 4)
    return Shape(volume, centre, across * np.eye(3) + (along - across) * np.outer(axis, axis))


def _mesh(mesh: UsdMesh) -> Shape | None:
    """Of tetrahedra from the origin to each triangle of the faces."""
    points = np.array(mesh.GetPointsAttr().Get() or [], float).reshape(-1, 3)
    counts, corners = (
        np.array(each.Get() or [], int) for each in (mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr())
    )
    if (
        not np.all(np.abs(points) < _FAR)
        or counts.sum() != corners.size
        or (corners.size and not 0 <= corners.min() <= corners.max() < len(points))
    ):
        return None
    starts = np.cumsum(counts) - counts
    fans = [(s, s + k, s + k + 1) for s, count in zip(starts, counts, strict=True) for k in range(1, count - 1)]
    if not fans:
        return None
    a, b, c = (points[corners[list(each)]] for each in zip(*fans, strict=True))
    sixths = np.einsum("ij,ij->i", a, np.cross(b, c))
    volume = float(sixths.sum()) / 6
    if not abs(volume) > 0:
        return None
    centre = (sixths[:, None] * (a + b + c)).sum(axis=0) / 24 / volume
    parts = sum(np.einsum("i,ij,ik->jk", sixths, x, x) for x in (a, b, c, a + b + c)) / 120
    return Shape(abs(volume), centre, np.sign(volume) * (parts - volume * np.outer(centre, centre)))


def together(shapes: list[Shape], densities: list[float]) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre and inertia about it, of shapes with their densities."""
    masses = [density * shape.volume for density, shape in zip(densities, shapes, strict=True)]
    mass = float(sum(masses))
    if not mass > 0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    centre = np.array(masses) @ np.array([shape.centre for shape in shapes]) / mass
    moments = np.zeros((3, 3))
    for density, own, shape in zip(densities, masses, shapes, strict=True):
        moments += density * shape.moments + own * np.outer(shape.centre - centre, shape.centre - centre)
    return mass, centre, np.trace(moments) * np.eye(3) - moments
