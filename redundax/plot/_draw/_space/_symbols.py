"""Symbols of spatial joints as solids whose sizes are points of print

A short cylinder along the axis is a revolute joint, one on a longer shaft a cylindrical one, a block on a square rail a
prismatic one, with a helix a screw; a ball is a spherical joint, on a rail a point on a line, on a plate a point on a
plane; a cross is universal, a ball between two stubs of constant velocity, a plate on a plate planar, two short rods
parallel axes, a dark cube fixed; a thin rod holds a distance, a dark drum drives an angle, a piston a travel; circles
are wheels in mesh, a tyre with spokes and a patch of floor a wheel, a plate on its edge a blade. Lower pairs are drawn
by what they lock, so new ones too: on a rail what slides along the axis, on a plate what slides square to it; a ball
where the axis may tilt, a block where it may not. An octahedron is a joint with rows of other names.
"""

import itertools
from collections.abc import Callable

import numpy as np

from ...._bodies._space._joints._distance import Cable, Distance
from ...._bodies._space._joints._drivers import AngleDriver, TravelDriver
from ...._bodies._space._joints._gear import Gear
from ...._bodies._space._joints._pairs import ConstantVelocity
from ...._bodies._space._joints._screw import Screw
from ...._bodies._space._joints._universal import Universal
from ...._bodies._space._joints._wheels import KnifeEdge, Wheel
from .._style import INK, body_colour, dark
from ._joint import SpaceJoint
from ._scene import SpaceScene
from ._solids import Solid, ball, box, cone, cylinder, hull_solids, path, ring, rod
from ._springs import spring
from ._stands import rail_ends, stands

_PLAIN, _UNIQUE, _NOT = "#F2F2F2", "#5FC9A8", "#F2814B"  # joints: as they are, and by the verdict on their load
_BAR = 2.9  # points, radius of a bar


def solids(scene: SpaceScene, point: float) -> list[Solid]:
    """All that is drawn of bodies, joints and springs; `point` is the size of a point of print in the model."""
    out: list[Solid] = []
    for body, (name, span) in enumerate(zip(scene.names, scene.spans, strict=True)):
        colour = body_colour(body, scene.ground)
        out += hull_solids(span, _BAR * point, colour, dark(colour, 0.8), f"body {name}")
    out += stands(scene, point)
    for joint in scene.joints:
        made = symbol(joint)(scene, joint, point)
        out += [_named(each, f"joint {joint.name}") for each in made]
    for load in scene.loads:
        out += spring(load, point)
    return out


def _named(solid: Solid, name: str) -> Solid:
    return Solid(solid.corners, solid.faces, solid.colour, solid.opacity, name)


def _colour(scene: SpaceScene, joint: SpaceJoint) -> str:
    if scene.not_unique is None:
        return _PLAIN
    return _NOT if joint.name in scene.not_unique else _UNIQUE


def _of_body(scene: SpaceScene, body: int) -> str:
    return "#A8A8A8" if body == scene.ground else dark(body_colour(body, scene.ground), 0.8)


def _revolute(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    axis = joint.axes_j[:, 2]
    return [
        cylinder(joint.place, axis, 9 * point, 5.4 * point, _colour(scene, joint)),
        cylinder(joint.place, axis, 13 * point, 1.2 * point, INK),
    ]


def _cylindrical(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    axis = joint.axes_j[:, 2]
    shaft = path(np.linspace(*rail_ends(scene, joint, point), 9), 2.2 * point, _of_body(scene, joint.j))
    return [*shaft, cylinder(joint.place, axis, 11 * point, 5.5 * point, _colour(scene, joint))]


def _prismatic(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    start, end = rail_ends(scene, joint, point)
    steps, length = np.linspace(start, end, 9), float(np.linalg.norm(end - start))
    size = (4 * point, 4 * point, length / 8)
    rail = [box((a + b) / 2, joint.axes_j, size, _of_body(scene, joint.j)) for a, b in itertools.pairwise(steps)]
    return [*rail, box(joint.place, joint.axes_j, (11 * point, 11 * point, 19 * point), _colour(scene, joint))]


def _screw(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    start, end = rail_ends(scene, joint, point)
    turns = float(np.linalg.norm(end - start)) / (7.0 * point)
    angle = np.linspace(0.0, 2 * np.pi * turns, max(int(12 * turns), 2))
    helix = start + np.linspace(0.0, 1.0, len(angle))[:, None] * (end - start)
    helix = helix + 3.6 * point * (
        np.cos(angle)[:, None] * joint.axes_j[:, 0] + np.sin(angle)[:, None] * joint.axes_j[:, 1]
    )
    colour = _of_body(scene, joint.j)
    half = 7 * point * joint.axes_j[:, 2]
    nut = cone(joint.place - half, joint.place + half, 7 * point, 7 * point, _colour(scene, joint), 6)
    return [*path(np.linspace(start, end, 9), 1.6 * point, colour), *path(helix, 0.7 * point, colour), nut]


def _spherical(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    return [ball(joint.place, 6.0 * point, _colour(scene, joint))]


def _point_on_line(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    rail = path(np.linspace(*rail_ends(scene, joint, point), 9), 1.8 * point, _of_body(scene, joint.j))
    return [*rail, ball(joint.place, 6.0 * point, _colour(scene, joint))]


def _table(scene: SpaceScene, joint: SpaceJoint, point: float) -> Solid:
    centre = joint.place - 3.0 * point * joint.axes_j[:, 2]
    return box(centre, joint.axes_j, (30 * point, 30 * point, 2.0 * point), _of_body(scene, joint.j))


def _point_on_plane(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    lifted = joint.place + 3.0 * point * joint.axes_j[:, 2]
    return [_table(scene, joint, point), ball(lifted, 5.0 * point, _colour(scene, joint))]


def _planar(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    size = (17 * point, 17 * point, 3.5 * point)
    return [_table(scene, joint, point), box(joint.place, joint.axes_j, size, _colour(scene, joint))]


def _universal(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    pins = (joint.axes_i[:, 2], joint.axes_j[:, 2])
    colour = _colour(scene, joint)
    arms = [cylinder(joint.place, pin, 10 * point, 2.4 * point, colour) for pin in pins]
    ends = [
        cylinder(joint.place + side * 9 * point * pin, pin, 2 * point, 3.6 * point, dark(colour, 0.75))
        for pin in pins
        for side in (-1, 1)
    ]
    return [*arms, *ends]


def _constant_velocity(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    stubs = [
        cylinder(joint.place + side * 8 * point * axes[:, 2], axes[:, 2], 6 * point, 3.2 * point, _of_body(scene, body))
        for side, axes, body in ((1, joint.axes_i, joint.i), (-1, joint.axes_j, joint.j))
    ]
    return [*stubs, ball(joint.place, 6.5 * point, _colour(scene, joint))]


def _parallel(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    axis, side = joint.axes_j[:, 2], 4.5 * point * joint.axes_j[:, 0]
    return [
        cylinder(joint.place + sign * side, axis, 10 * point, 2.0 * point, _colour(scene, joint)) for sign in (-1, 1)
    ]


def _fixed(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    colour = "#444444" if scene.not_unique is None else _colour(scene, joint)
    return [box(joint.place, joint.axes_j, (9.5 * point,) * 3, colour)]


def _distance(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    ends = [ball(end, 3.4 * point, _colour(scene, joint)) for end in (joint.on_i, joint.on_j)]
    return [*path(np.linspace(joint.on_i, joint.on_j, 13), 1.1 * point, INK), *ends]


def _angle_driver(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    axis = joint.axes_j[:, 2]
    drum = cylinder(joint.place - 13 * point * axis, axis, 5 * point, 8 * point, "#555555")
    return [drum, cylinder(joint.place - 4 * point * axis, axis, 5 * point, 2.5 * point, "#999999")]


def _travel_driver(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    axis = joint.axes_j[:, 2]
    travel = float((joint.on_i - joint.on_j) @ axis)
    sense = axis if travel >= 0 else -axis
    piston = [rod(joint.on_j, joint.on_i, 2.0 * point, "#999999")] if abs(travel) > point else []
    return [*piston, rod(joint.on_j - 22 * point * sense, joint.on_j, 6.0 * point, "#555555", 14)]


def _gear(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    out: list[Solid] = []
    for centre, axis, radius, body in pitch_circles(joint):
        out += ring(centre, axis, max(radius, 6 * point), 0.9 * point, _of_body(scene, body))
    return out


def pitch_circles(joint: SpaceJoint) -> list[tuple[np.ndarray, np.ndarray, float, int]]:
    """Centre, axis, radius and body of wheels in mesh that roll on each other."""
    number_i, number_j = (float(n) for n in np.asarray(joint.teeth))
    (p, z), (q, w) = (joint.on_i, joint.axes_i[:, 2]), (joint.on_j, joint.axes_j[:, 2])
    across = np.cross(z, w)
    if np.linalg.norm(across) < 1e-6:
        line = (q - p) - z * ((q - p) @ z)
        share = float(np.linalg.norm(line)) / abs(number_i + number_j) if number_i + number_j else 0.0
        return [(p, z, share * abs(number_i), joint.i), (p + line, w, share * abs(number_j), joint.j)]
    # Bevel wheels on the cones that share the apex, where the axes come nearest to each other.
    along_z, along_w, _ = np.linalg.solve(np.stack([z, -w, across], axis=1), q - p)
    tangent = np.linalg.norm(across) / (abs(number_j / number_i) + z @ w)
    other = np.linalg.norm(across) / (abs(number_i / number_j) + z @ w)
    return [(p, z, abs(along_z * tangent), joint.i), (q, w, abs(along_w * other), joint.j)]


def _patch(scene: SpaceScene, joint: SpaceJoint, point: float) -> Solid:
    centre = joint.on_j - 1.0 * point * joint.axes_j[:, 2]
    return box(centre, joint.axes_j, (34 * point, 34 * point, 1.5 * point), _of_body(scene, joint.j))


def _wheel(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    axis, radius, colour = joint.axes_i[:, 2], float(joint.radius or 0.0), _colour(scene, joint)
    inner = max(radius - 1.6 * point, 0.0)
    spokes = [
        rod(joint.on_i - inner * way, joint.on_i + inner * way, 0.8 * point, _of_body(scene, joint.i))
        for way in (joint.axes_i[:, 0], joint.axes_i[:, 1])
    ]
    return [_patch(scene, joint, point), *ring(joint.on_i, axis, inner, 1.6 * point, colour), *spokes]


def _blade(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    along, normal = joint.axes_i[:, 2], joint.axes_j[:, 2]
    axes = np.stack([along, np.cross(normal, along), normal], axis=1)
    edge = box(joint.on_i + 4 * point * normal, axes, (26 * point, 2 * point, 8 * point), _colour(scene, joint))
    return [_patch(scene, joint, point), edge]


def _composed(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    across, along, tilt, _ = joint.parts
    under = _prismatic(scene, joint, point)[:-1] if across and not along else []
    under += [_table(scene, joint, point)] if along and not across else []
    return [*under, *(_fixed if tilt else _spherical)(scene, joint, point)]


def _unknown(scene: SpaceScene, joint: SpaceJoint, point: float) -> list[Solid]:
    line = (
        path(np.stack([joint.on_i, joint.on_j]), 0.8 * point, INK)
        if np.linalg.norm(joint.on_i - joint.on_j) > point
        else []
    )
    return [*line, ball(joint.place, 7.0 * point, _colour(scene, joint), steps=2)]


Symbol = Callable[[SpaceScene, SpaceJoint, float], list[Solid]]
_PAIRS: dict[tuple[bool, bool, bool, bool], Symbol] = {  # by what they lock: across, along, tilt, twist
    (True, True, True, False): _revolute,
    (True, False, True, False): _cylindrical,
    (True, False, True, True): _prismatic,
    (True, True, False, False): _spherical,
    (True, False, False, False): _point_on_line,
    (False, True, False, False): _point_on_plane,
    (False, True, True, False): _planar,
    (False, False, True, False): _parallel,
    (True, True, True, True): _fixed,
    (False, False, False, False): _unknown,
}
_SYMBOLS: dict[type, Symbol] = {
    Screw: _screw,
    Universal: _universal,
    ConstantVelocity: _constant_velocity,
    Distance: _distance,
    Cable: _distance,
    AngleDriver: _angle_driver,
    TravelDriver: _travel_driver,
    Gear: _gear,
    Wheel: _wheel,
    KnifeEdge: _blade,
}


def symbol(joint: SpaceJoint) -> Symbol:
    """How a joint is drawn: as its kind is, or by what it locks."""
    return _SYMBOLS.get(joint.kind) or _PAIRS.get(joint.parts, _composed)
