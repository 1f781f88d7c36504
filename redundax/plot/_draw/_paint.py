"""Solids painted on flat axes, the farthest first: in space their faces, shaded; in the plane what is seen of each

The projection is parallel and the scales of both axes of the picture are equal, so lengths are to scale along each
axis, and in space arrows in a corner say by how much.
"""

import numpy as np

from ._bodies import centres_of_mass, draw_bodies
from ._key import round_size
from ._pen import Pen, across, arrow, circle, hull
from ._scene import Scene
from ._stands import on_table, rail_ends, stands
from ._style import BLOCK_Z, BODY_Z, GROUND, GROUND_Z, INK, LABEL_Z, PIN_Z, quantity
from ._symbols import solids, symbols

_LIGHT = np.array([-0.35, 0.65, 0.67])  # right, up, towards the viewer
_CORNER, _ARM = 44.0, 36.0  # points, of the arrows of the axes
_RAIL = 7.3  # points, of the sides of a guide from its middle: beside a block
_PIN_TOP = 6.0  # points, above the plane, that pins and motors reach, but not blocks
_NEARER = 5.0  # points by which joints are painted nearer than they are, so that bars leave them to be seen


def paint(pen: Pen, scene: Scene) -> list[np.ndarray]:
    """Draw bodies and joints, and return the outlines of the bodies on the picture."""
    outlines = _flat(pen, scene) if scene.is_flat else _faces(pen, scene)
    centres_of_mass(pen, scene)
    return outlines


def _flat(pen: Pen, scene: Scene) -> list[np.ndarray]:
    """Outlines of bodies, lines of wheels and of the ground, and what is seen of symbols, the highest on top."""
    outlines, made = draw_bodies(pen, scene), symbols(scene, pen.point)
    _ground(pen, scene)
    _pitch_lines(pen, scene)
    made.sort(key=lambda solid: solid.corners[:, 2].max())
    tops = [solid.corners[:, 2].max() for solid in made]
    shapes = [hull(scene.flat(solid.corners)) for solid in made]
    lower = sum(top <= _PIN_TOP * pen.point for top in tops)
    for part, z in ((slice(lower), BLOCK_Z), (slice(lower, None), PIN_Z)):  # pins are above the arrows on them
        fills = [solid.colour for solid in made[part]]
        edges = [INK if solid.has_edge else solid.colour for solid in made[part]]
        widths = [pen.symbol * (1.2 if solid.has_edge else 0.2) for solid in made[part]]
        _polygons(pen, shapes[part], fills, edges, widths, z)
    return outlines


def _ground(pen: Pen, scene: Scene) -> None:
    """Stands, and hatching under rails, floors and wheels of the ground."""
    for stand in stands(scene, pen.point):
        point, down = scene.flat(stand.at), scene.flat(stand.away) * pen.point
        side, foot = across(down), point + 12.0 * down
        pen.polygon(np.array([point, foot + 7.5 * side, foot - 7.5 * side]), "#EEEEEE", GROUND, GROUND_Z + 0.5)
        pen.hatched(foot - 12.0 * side, foot + 12.0 * side)
    for joint in scene.joints:
        ends = [line.ends for line in joint.mesh.lines if line.body == scene.ground]
        for centre, _, radius, body in joint.mesh.circles:
            for side in (*np.eye(2), *-np.eye(2)) if body == scene.ground else ():
                foot, half = scene.flat(centre) + radius * side, 12.0 * across(side) * pen.point
                pen.hatched(foot - half, foot + half)
        normal = joint.axes_j[:, 2]
        if joint.j == scene.ground and joint.slides:
            rail = np.array(rail_ends(scene, joint, pen.point))
            pen.line(scene.flat(rail), GROUND, BODY_Z + 0.8, linewidth=0.7, linestyle="-.")
            ends += [rail - _RAIL * pen.point * joint.axes_j[:, 0], rail[::-1] + _RAIL * pen.point * joint.axes_j[:, 0]]
        elif joint.j == scene.ground and (on_table(joint) or joint.radius):
            half = max(17.0 * pen.point, 0.8 * (joint.radius or 0.0)) * np.cross(normal, [0.0, 0.0, 1.0])
            foot = joint.place - normal * ((joint.place - joint.on_j) @ normal + 2.0 * pen.point)
            ends.append(np.array([foot - half, foot + half]))
        for pair in ends:
            pen.hatched(*scene.flat(pair))


def _pitch_lines(pen: Pen, scene: Scene) -> None:
    """Wheels, and those in mesh as textbooks draw them."""
    for joint in scene.joints:
        if joint.radius:
            corners = scene.flat(joint.on_i) + joint.radius * circle(96)
            pen.polygon(corners, "none", INK, BODY_Z + 0.5, linewidth=2.2)
        for centre, _, radius, _ in joint.mesh.circles:
            corners = scene.flat(centre) + radius * circle(96)
            pen.polygon(corners, "none", INK, BODY_Z - 0.5, linestyle="-.")
        for ends, _, dashed in joint.mesh.lines:
            pen.line(scene.flat(ends), INK, BODY_Z + 0.8, linestyle="-." if dashed else "-")
        if joint.mesh.pitch is not None:
            pen.circle(scene.flat(joint.mesh.pitch), 1.6, fill=INK, z=BODY_Z + 0.8)


def _faces(pen: Pen, scene: Scene) -> list[np.ndarray]:
    made, view = solids(scene, pen.point), scene.camera.view
    polygons, colours, depths = [], [], []
    corners: dict[str, list[np.ndarray]] = {}
    for solid in made:
        flat = view.flat(solid.corners)
        corners.setdefault(solid.name, []).append(flat)
        depth = view.depth(solid.corners) + _NEARER * pen.point * solid.name.startswith("joint")
        for face, normal in zip(solid.faces, solid.normals() @ view.axes.T, strict=True):
            if normal[2] < 0 and solid.opacity == 1.0:
                continue
            polygons.append(flat[list(face)])
            depths.append(depth[list(face)].mean())
            colours.append((*_shade(solid.colour, normal), solid.opacity))
    order = np.argsort(depths, kind="stable")
    edges = [colour if colour[3] == 1.0 else (0.0, 0.0, 0.0, 0.0) for colour in colours]
    shapes, fills, rims = ([each[k] for k in order] for each in (polygons, colours, edges))
    _polygons(pen, shapes, fills, rims, 0.4, BODY_Z)
    return [hull(np.concatenate(corners[f"body {name}"])) for name in scene.names]


def _polygons(pen: Pen, corners: list, fills: list, edges: list, widths: list[float] | float, z: float) -> None:
    from matplotlib.collections import PolyCollection

    style = {"linewidths": widths, "zorder": z, "gid": "solids", "joinstyle": "round"}
    pen.axes.add_artist(PolyCollection(corners, facecolors=fills, edgecolors=edges, **style))


def _shade(colour: str, normal: np.ndarray) -> tuple[float, ...]:
    light = _LIGHT / np.linalg.norm(_LIGHT)
    share = 0.62 + 0.38 * max(float(normal @ light), 0.0)
    return tuple(share * int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))


def dress(pen: Pen, scene: Scene, places: np.ndarray, ceiling: float) -> None:
    """In space arrows along x, y and z of a round length, in the corner with most room beside places (places, 2)."""
    if scene.is_flat:
        return
    lower, upper = (np.array(side) for side in zip(pen.axes.get_xlim(), pen.axes.get_ylim(), strict=True))
    upper[1] = ceiling
    inset = _CORNER * pen.point
    corners = [
        np.array([x, y]) for y in (lower[1] + inset, upper[1] - inset) for x in (lower[0] + inset, upper[0] - inset)
    ]
    origin = max(corners, key=lambda corner: min(np.hypot(*(places - corner).T).min() / pen.point, 90.0))
    length = round_size(_ARM * pen.point)
    for direction, axis in zip(np.eye(3), "xyz", strict=True):
        vector = scene.flat(direction * length)
        seen = float(np.hypot(*vector))
        if seen > 0.15 * length:
            pen.polygon(arrow(origin, origin + vector, 1.3 * pen.point), INK, "none", LABEL_Z, gid=f"axis {axis}")
        tip = origin + vector + (vector / seen if seen > 0.15 * length else np.zeros(2)) * 6.0 * pen.point
        pen.write(tip, axis, f"axis {axis}")
    tips = origin + scene.flat(np.eye(3) * length)
    below = np.array([origin[0], min(tips[:, 1].min(), origin[1]) - 18.0 * pen.point])
    pen.write(below, f"axes: {quantity(length, scene.units.of('linear'))}", "axis length")
