"""Solids painted on flat axes, the farthest faces first, with the directions of the axes in a corner

The projection is parallel and the scales of both axes of the picture are equal, so lengths are to scale along each
axis, and the arrows in the corner say by how much.
"""

import numpy as np

from .._bodies import hull
from .._key import round_size
from .._pen import HARD, OUTLINE, Pen, arrow
from .._style import BODY_Z, FONT, INK, LABEL_Z, PIN_Z, quantity
from ._scene import SpaceScene
from ._solids import Solid
from ._symbols import solids

_LIGHT = np.array([-0.35, 0.65, 0.67])  # right, up, towards the viewer
_CORNER, _ARM = 44.0, 36.0  # points, of the arrows of the axes
_NEARER = 5.0  # points by which joints are painted nearer than they are, so that bars leave them to be seen


def paint(pen: Pen, scene: SpaceScene) -> list[np.ndarray]:
    """Draw bodies and joints, and return the outlines of the bodies on the picture."""
    from matplotlib.collections import PolyCollection

    made = solids(scene, pen.point)
    polygons, colours, depths = [], [], []
    for solid in made:
        flat = scene.view.flat(solid.corners)
        depth = scene.view.depth(solid.corners) + _NEARER * pen.point * solid.name.startswith("joint")
        for face, normal in zip(solid.faces, solid.normals() @ scene.view.axes.T, strict=True):
            if normal[2] < 0 and solid.opacity == 1.0:
                continue
            polygons.append(flat[list(face)])
            depths.append(depth[list(face)].mean())
            colours.append((*_shade(solid.colour, normal), solid.opacity))
    order = np.argsort(depths, kind="stable")
    edges = [colour if colour[3] == 1.0 else (0.0, 0.0, 0.0, 0.0) for colour in colours]
    collection = PolyCollection(
        [polygons[k] for k in order],
        facecolors=[colours[k] for k in order],
        edgecolors=[edges[k] for k in order],
        linewidths=0.4,
        zorder=BODY_Z,
        gid="solids",
    )
    pen.axes.add_artist(collection)
    _cover(pen, scene, made)
    _centres(pen, scene)
    corners: dict[str, list[np.ndarray]] = {}
    for solid in made:
        corners.setdefault(solid.name, []).append(scene.view.flat(solid.corners))
    return [hull(np.concatenate(corners[f"body {name}"])) for name in scene.names]


def draw_axes(pen: Pen, scene: SpaceScene, places: np.ndarray, ceiling: float) -> None:
    """Arrows along x, y and z of a round length, in the corner with most room beside places (places, 2)."""
    lower, upper = (np.array(side) for side in zip(pen.axes.get_xlim(), pen.axes.get_ylim(), strict=True))
    upper[1] = ceiling
    inset = _CORNER * pen.point
    corners = [
        np.array([x, y]) for y in (lower[1] + inset, upper[1] - inset) for x in (lower[0] + inset, upper[0] - inset)
    ]
    origin = max(corners, key=lambda corner: min(np.hypot(*(places - corner).T).min() / pen.point, 90.0))
    length = round_size(_ARM * pen.point)
    for direction, axis in zip(np.eye(3), "xyz", strict=True):
        vector = scene.view.flat(direction * length)
        seen = float(np.hypot(*vector))
        if seen > 0.15 * length:
            pen.polygon(arrow(origin, origin + vector, 1.3 * pen.point), INK, "none", LABEL_Z, gid=f"axis {axis}")
        tip = origin + vector + (vector / seen if seen > 0.15 * length else np.zeros(2)) * 6.0 * pen.point
        pen.axes.text(*tip, axis, fontsize=FONT, ha="center", va="center", zorder=LABEL_Z, gid=f"axis {axis}")
        pen.cover_line(origin, tip, 10.0, HARD)
    tips = origin + scene.view.flat(np.eye(3) * length)
    below = np.array([origin[0], min(tips[:, 1].min(), origin[1]) - 18.0 * pen.point])
    text = f"axes: {quantity(length, scene.units.of('linear'))}"
    pen.axes.text(*below, text, fontsize=FONT, ha="center", va="center", zorder=LABEL_Z, gid="axis length")
    pen.cover(below, 22.0, HARD)


def _shade(colour: str, normal: np.ndarray) -> tuple[float, ...]:
    light = _LIGHT / np.linalg.norm(_LIGHT)
    share = 0.62 + 0.38 * max(float(normal @ light), 0.0)
    return tuple(share * int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))


def _cover(pen: Pen, scene: SpaceScene, made: list[Solid]) -> None:
    """Names keep clear of joints, springs and bars."""
    for joint in scene.joints:
        pen.cover(joint.spot, 9.0, HARD)
    for solid in made:
        flat = scene.view.flat(solid.corners)
        if solid.name.startswith("body") and solid.opacity == 1.0:
            sides = len(solid.faces[-1])
            pen.cover_line(flat[:sides].mean(axis=0), flat[-sides:].mean(axis=0), 8.0, 2.0 * OUTLINE)
        elif not solid.name.startswith("body"):
            low, high = flat.min(axis=0), flat.max(axis=0)
            pen.boxes.append((low[0], low[1], high[0], high[1], OUTLINE))


def _centres(pen: Pen, scene: SpaceScene) -> None:
    """Centres of mass, where no joint is."""
    spots = np.array([joint.spot for joint in scene.joints]).reshape(-1, 2)
    for centre in scene.view.flat(scene.centres):
        if np.all(np.hypot(*(spots - centre).T) > 12.0 * pen.point):
            pen.circle(centre, 2.4, edge=INK, z=PIN_Z, linewidth=0.8)
            pen.line(centre + np.outer([-2.4, 2.4], [pen.point, 0.0]), INK, PIN_Z, linewidth=0.8)
            pen.line(centre + np.outer([-2.4, 2.4], [0.0, pen.point]), INK, PIN_Z, linewidth=0.8)
            pen.cover(centre, 3.0, OUTLINE)
