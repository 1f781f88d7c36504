"""Teeth in mesh as a picture shows them: pitch circles, pitch point and line of action.

The pitch point divides the line of centres by z_i : z_j; the line of action leans by the pressure angle of the mesh
from the common tangent there, to the side on which the force of the flank turns body i.
"""

import dataclasses
from typing import Any

import numpy as np

from ..._bodies._joints import AbstractMesh, GearPair, RackAndPinion
from ._pen import across


@dataclasses.dataclass(frozen=True)
class Mesh:
    """`line` is the direction of the force on body i, `rack` that of a rack's pitch line, `on_j` a point on body j."""

    pitch: np.ndarray
    line: np.ndarray
    circles: tuple[tuple[np.ndarray, float], ...]
    on_j: np.ndarray
    rack: np.ndarray | None = None

    @property
    def least_radius(self) -> float:
        """Radius of the smaller gear."""
        return min(radius for _, radius in self.circles)


def meshes_of(stack: Any, r: np.ndarray, phi: np.ndarray) -> list[Mesh | None]:
    """The meshes of stacked joints; None where they are no teeth."""
    element, i, j = stack.element, np.asarray(stack.i), np.asarray(stack.j)
    if not isinstance(element, AbstractMesh):
        return [None] * len(i)
    teeth, flank = np.asarray(element.teeth), np.asarray(element.flank, float)
    angle, module = np.asarray(element.pressure_angle, float), np.asarray(element.module, float)
    on_i = r[i] + turned(np.asarray(element.point_i), phi[i])
    on_j = r[j] + turned(np.asarray(element.point_j), phi[j])
    if isinstance(element, GearPair):
        return [_pair(*each) for each in zip(on_i, on_j, teeth, flank, module * np.cos(angle) / 2, strict=True)]
    if isinstance(element, RackAndPinion):
        normal = turned(np.asarray(element.normal), phi[j])
        return [_rack(*each) for each in zip(on_i, normal, module * teeth / 2, flank, angle, strict=True)]
    return [None] * len(i)


def _pair(on_i: np.ndarray, on_j: np.ndarray, teeth: np.ndarray, flank: float, base: float) -> Mesh:
    offset, whole = on_j - on_i, int(teeth.sum())
    distance = float(np.hypot(*offset)) or 1.0
    along, cosine = np.sign(whole) * offset / distance, min(abs(whole) * base / distance, 1.0)
    line = flank * cosine * across(along) - np.sqrt(1 - cosine**2) * along
    own, other = distance * np.abs(teeth / whole)
    return Mesh(on_i + offset * teeth[0] / whole, line, ((on_i, own), (on_j, other)), on_j)


def _rack(on_i: np.ndarray, normal: np.ndarray, radius: float, flank: float, angle: float) -> Mesh:
    pitch, line = on_i - radius * normal, np.sin(angle) * normal - flank * np.cos(angle) * across(normal)
    return Mesh(pitch, line, ((on_i, radius),), pitch, rack=across(normal))


def turned(v: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Stacked vectors in the global frame, from local ones."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1]], axis=1)
