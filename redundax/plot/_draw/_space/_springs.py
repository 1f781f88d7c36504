"""Symbols of springs and dampers in space: a coil, a cylinder with a piston, a spiral, and a block for a bushing."""

import numpy as np

from ...._bodies._space._loads import Bushing, SpringDamper, TorsionSpring
from .._style import GROUND
from ._loads import SpaceLoad
from ._solids import Solid, axes_of, cylinder, path, rod


def spring(load: SpaceLoad, point: float) -> list[Solid]:
    """What is drawn of a load, nothing of a force; `point` is the size of a point of print in the model."""
    if load.kind is SpringDamper:
        return _coil(load, point) if load.is_stiff else _damper(load, point)
    if load.kind is TorsionSpring:
        angle = np.linspace(0.0, 4.5 * np.pi, 60)
        turn = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ load.axes[:, :2].T
        spiral = load.on_i + point * (7.0 + 7.0 * angle / angle[-1])[:, None] * turn
        return path(spiral, 0.8 * point, GROUND, name="spring")
    if load.kind is Bushing:
        axis = load.axes[:, 2]
        outer = cylinder(load.on_j, axis, 5 * point, 9 * point, "#6E6E6E", opacity=0.5, name="bushing")
        return [outer, cylinder(load.on_i, axis, 8 * point, 3.5 * point, "#BBBBBB", name="bushing")]
    return []


def _coil(load: SpaceLoad, point: float) -> list[Solid]:
    line, turns = load.on_j - load.on_i, 7
    angle = np.linspace(0.0, 2 * np.pi * turns, 12 * turns + 1)
    share = np.concatenate([[0.0], np.linspace(0.12, 0.88, len(angle)), [1.0]])
    swing = np.concatenate([[[0.0, 0.0]], np.stack([np.cos(angle), np.sin(angle)], axis=1), [[0.0, 0.0]]])
    points = load.on_i + share[:, None] * line + 4.5 * point * swing @ axes_of(line)[:, :2].T
    return path(points, 0.7 * point, GROUND, name="spring")


def _damper(load: SpaceLoad, point: float) -> list[Solid]:
    a, b = load.on_j + np.array([[0.35], [0.65]]) * (load.on_i - load.on_j)
    thin = rod(load.on_j, load.on_i, 1.0 * point, GROUND, name="damper")
    return [thin, rod(a, b, 5.0 * point, "#BBBBBB", 12, name="damper")]
