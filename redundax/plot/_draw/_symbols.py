"""Symbols of joints, of the ground and of loads, as in textbooks on mechanisms.

A circle is a revolute joint and a block between rails a translational one; hatching is the ground, M a driven angle, a
cylinder a driven distance (a rod where it is constant), a black square a fixed joint, chain-dotted circles the wheels
of a coupling of angles or, with a line of action, of gears in mesh; a circle on a line is a wheel, a bar with pointed
ends a blade seen from above. Lower pairs are drawn by what they lock, so new
ones too; a diamond is a joint with rows of other names.
"""

from collections.abc import Callable
from typing import cast

import numpy as np

from ..._bodies._joints import (
    AngleCoupling,
    AngleDriver,
    Cable,
    DistanceDriver,
    GearPair,
    KnifeEdge,
    RackAndPinion,
    Wheel,
)
from ..._bodies._loads import AppliedForce, SpringDamper, TorsionSpring
from ._bodies import block_length, guide_reach, hull
from ._meshes import Mesh
from ._pen import HARD, OUTLINE, Pen, across, circle
from ._scene import Joint, Load, Scene, pitch_circles
from ._style import BLOCK, BLOCK_Z, BODY_Z, GROUND, GROUND_Z, INK, PIN, PIN_Z, body_colour, dark

_SIDES = np.array([[0.0, -1.0], [0.0, 1.0], [-1.0, 0.0], [1.0, 0.0]])


def draw_joints(pen: Pen, scene: Scene) -> None:
    """Draw the symbols of all joints, and the ground where they stand on it."""
    for point, away in _supports(pen, scene):
        _support(pen, point, away)
    for joint in scene.joints:
        symbol(joint)(pen, scene, joint)


def draw_springs(pen: Pen, scene: Scene) -> None:
    """Draw springs and dampers."""
    for load in scene.loads:
        if load.kind is SpringDamper:
            (_zigzag if load.stiff else _dashpot)(pen, load.on_i, load.on_j)
            pen.cover_line(load.on_i, load.on_j, 9.0, HARD)
        elif load.kind is TorsionSpring:
            angle = np.linspace(0.0, 4.5 * np.pi, 120)
            radius = (PIN + 1.0 + 7.0 * angle / angle[-1]) * pen.point
            spiral = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            pen.line(load.on_i + spiral, INK, PIN_Z - 0.1, linewidth=1.0)
            pen.cover(load.on_i, PIN + 8.0, HARD)


def applied_loads(scene: Scene) -> list[Load]:
    """Forces and moments on single bodies."""
    return [load for load in scene.loads if load.kind is AppliedForce]


def _supports(pen: Pen, scene: Scene) -> list[tuple[np.ndarray, np.ndarray]]:
    """Points that stand on the ground, each once, with the direction towards the ground."""
    found: list[tuple[np.ndarray, np.ndarray]] = []
    ends = [
        (joint.on_i if joint.i == scene.ground else joint.on_j, joint.i if joint.j == scene.ground else joint.j)
        for joint in scene.joints
        if scene.ground in (joint.i, joint.j) and joint.axis is None and joint.pointed and joint.mesh is None
    ]
    ends += [(load.on_j, load.i) for load in scene.loads if load.to_ground]
    for point, body in ends:
        if found and np.any(np.hypot(*(np.array([other for other, _ in found]) - point).T) < pen.point):
            continue
        towards = scene.joint_points(body).mean(axis=0) - point
        towards = towards / max(np.hypot(*towards), 1e-300)
        found.append((point, next(side for side in _SIDES if side @ towards < 0.6)))
    return found


def _support(pen: Pen, point: np.ndarray, away: np.ndarray) -> None:
    down, side = away * pen.point, across(away) * pen.point
    foot = point + 12.0 * down
    pen.polygon(np.array([point, foot + 7.5 * side, foot - 7.5 * side]), "#EEEEEE", GROUND, GROUND_Z + 0.5)
    pen.hatched(foot - 12.0 * side, foot + 12.0 * side, GROUND)
    pen.cover(point + 7.0 * down, 9.0, HARD)


def _revolute(pen: Pen, scene: Scene, joint: Joint) -> None:
    pen.circle(joint.spot, PIN, z=PIN_Z, linewidth=1.3)
    pen.cover(joint.spot, PIN + 2.0, HARD)


def _fixed(pen: Pen, scene: Scene, joint: Joint) -> None:
    along = np.array([1.0, 0.0])
    pen.box(joint.spot, along, 9.0, 9.0, fill=INK, edge=INK, z=PIN_Z)
    for slope in (1.0, -1.0):
        arm = np.array([2.8, 2.8 * slope]) * pen.point
        pen.line([joint.spot - arm, joint.spot + arm], "white", PIN_Z + 0.1, linewidth=1.2)
    pen.cover(joint.spot, 7.0, HARD)


def _guide(pen: Pen, scene: Scene, joint: Joint, half: float) -> None:
    """Two rails along the joint's axis, `half` points from it; hatched where they belong to the ground."""
    axis = np.asarray(joint.axis)
    reach, side = guide_reach(joint.length, pen.point) * axis, across(axis) * half * pen.point
    if joint.j == scene.ground:
        pen.hatched(joint.on_i - reach - side, joint.on_i + reach - side, GROUND)
        pen.hatched(joint.on_i + reach + side, joint.on_i - reach + side, GROUND)
    else:
        colour = dark(body_colour(joint.j, scene.ground))
        for offset in (side, -side):
            ends = (joint.on_i - reach + offset, joint.on_i + reach + offset)
            pen.line(ends, colour, BODY_Z + 0.9, linewidth=1.8)
            pen.cover_line(*ends, 4.0, HARD)
    pen.line([joint.on_i - reach, joint.on_i + reach], GROUND, BODY_Z + 0.8, linewidth=0.7, linestyle="-.")


def _translational(pen: Pen, scene: Scene, joint: Joint) -> None:
    _guide(pen, scene, joint, BLOCK[1] / 2 + 1.8)
    colour, length = body_colour(joint.i, scene.ground), block_length(joint.length, pen.point)
    axis = np.asarray(joint.axis)
    pen.box(joint.on_i, axis, length, BLOCK[1], fill="white", edge="none", z=BLOCK_Z)
    pen.box(joint.on_i, axis, length, BLOCK[1], fill=colour, edge=dark(colour), z=BLOCK_Z, opacity=0.65)
    reach = axis * length / 2 * pen.point
    pen.cover_line(joint.on_i - reach, joint.on_i + reach, BLOCK[1] + 4.0, HARD)


def _floor(pen: Pen, scene: Scene, joint: Joint) -> None:
    """The side of a slot that pushes, under the pin as far as their gap; hatched where it belongs to the ground."""
    axis = np.asarray(joint.axis)
    foot = joint.on_j + axis * ((joint.on_i - joint.on_j) @ axis) - across(axis) * (PIN + 0.5) * pen.point
    reach = guide_reach(joint.length, pen.point) * axis
    if joint.j == scene.ground:
        pen.hatched(foot - reach, foot + reach, GROUND)
    else:
        pen.line([foot - reach, foot + reach], dark(body_colour(joint.j, scene.ground)), BODY_Z + 0.9, linewidth=1.8)
        pen.cover_line(foot - reach, foot + reach, 4.0, HARD)


def _pin_in_slot(pen: Pen, scene: Scene, joint: Joint) -> None:
    half, colour = PIN + 1.6, dark(body_colour(joint.i, scene.ground))
    if joint.one_sided:
        _floor(pen, scene, joint)
    elif joint.j == scene.ground:
        _guide(pen, scene, joint, half)
    else:
        axis = np.asarray(joint.axis)
        reach = axis * (guide_reach(None, pen.point) - half * pen.point)
        ring = half * pen.point * circle(48)
        slot = hull(np.concatenate([joint.on_i + reach + ring, joint.on_i - reach + ring]))
        pen.polygon(slot, "white", dark(body_colour(joint.j, scene.ground)), BODY_Z + 0.9)
        pen.cover_line(joint.on_i - reach, joint.on_i + reach, 2 * half, HARD)
    pen.circle(joint.on_i, PIN, fill=colour, z=PIN_Z, linewidth=1.0)
    pen.cover(joint.on_i, PIN + 2.0, HARD)


def _angle_driver(pen: Pen, scene: Scene, joint: Joint) -> None:
    pen.circle(joint.spot, 7.5, z=PIN_Z + 0.2, linewidth=1.3)
    letter = np.array([[-3.2, -3.2], [-3.2, 3.4], [0.0, -1.2], [3.2, 3.4], [3.2, -3.2]])
    pen.line(joint.spot + letter * pen.point, INK, PIN_Z + 0.3, linewidth=1.4)
    pen.cover(joint.spot, 9.5, HARD)


def _distance_driver(pen: Pen, scene: Scene, joint: Joint) -> None:
    line = joint.on_i - joint.on_j
    length = np.hypot(*line) / pen.point
    if length > 0:
        along = line / np.hypot(*line)
        pen.line([joint.on_j, joint.on_i], INK, BLOCK_Z, linewidth=1.6)
        middle = joint.on_j + 0.38 * line
        pen.box(middle, along, 0.45 * length, 8.0, fill="#DDDDDD", edge=INK, z=BLOCK_Z + 0.1)
        pen.cover_line(joint.on_j, joint.on_i, 8.0, HARD)
    for end in (joint.on_i, joint.on_j):
        pen.circle(end, 0.8 * PIN, z=PIN_Z, linewidth=1.1)
        pen.cover(end, PIN + 1.0, HARD)


def _angle_coupling(pen: Pen, scene: Scene, joint: Joint) -> None:
    """Pitch circles that touch for an external pair, two wheels and a belt for any other."""
    circles = pitch_circles(joint)
    for centre, radius in circles:
        corners = centre + radius * circle(96)
        pen.polygon(corners, "none", INK, BODY_Z - 0.5, linestyle="-.")
        pen.cover_path(corners, 2.0, OUTLINE)
    if circles and (joint.ratio or 1.0) < 0:
        (start, first), (end, second) = circles
        line, distance = end - start, np.hypot(*(end - start))
        tilt = (first - second) / distance
        for side in (1.0, -1.0):
            normal = (tilt * line + side * np.sqrt(1 - tilt**2) * across(line)) / distance
            pen.line([start + first * normal, end + second * normal], INK, BODY_Z - 0.5)


def _mesh(pen: Pen, scene: Scene, joint: Joint) -> None:
    """Pitch circles, or the circle and the line of a rack, and the line of action."""
    mesh = cast(Mesh, joint.mesh)
    for (centre, radius), body in zip(mesh.circles, (joint.i, joint.j), strict=False):
        corners = centre + radius * circle(96)
        pen.polygon(corners, "none", INK, BODY_Z - 0.5, linestyle="-.")
        pen.cover_path(corners, 2.0, OUTLINE)
        for side in _SIDES if body == scene.ground else ():
            foot, half = centre + radius * side, 12.0 * across(side) * pen.point
            pen.hatched(foot - half, foot + half, GROUND)
    reach = 0.4 * mesh.least_radius * mesh.line
    if mesh.rack is not None:
        half = 2 * mesh.least_radius * mesh.rack
        pen.line([mesh.pitch + half, mesh.pitch - half], INK, BODY_Z - 0.5, linestyle="-.")
        if joint.j == scene.ground:
            pen.hatched(mesh.pitch + half, mesh.pitch - half, GROUND)
    pen.line([mesh.pitch - reach, mesh.pitch + reach], INK, BODY_Z + 0.8, linewidth=1.0)
    pen.circle(mesh.pitch, 1.6, fill=INK, z=BODY_Z + 0.8)
    pen.cover(mesh.pitch, 3.0, HARD)


def _wheel(pen: Pen, scene: Scene, joint: Joint) -> None:
    """The disc with spokes, and the line on which it stands."""
    axis, radius, colour = np.asarray(joint.axis), float(joint.radius or 0.0), body_colour(joint.i, scene.ground)
    corners = joint.on_i + radius * circle(96)
    pen.polygon(corners, "none", dark(colour), BODY_Z + 0.5, linewidth=2.2)
    pen.cover_path(corners, 3.0, OUTLINE)
    foot, half = joint.on_i - radius * across(axis), np.maximum(0.8 * radius, 12.0 * pen.point) * axis
    if joint.j == scene.ground:
        pen.hatched(foot - half, foot + half, GROUND)
    else:
        pen.line([foot - half, foot + half], dark(body_colour(joint.j, scene.ground)), BODY_Z + 0.4, linewidth=1.8)
    turn = scene.turns[joint.i]
    for spoke in (np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])):
        pen.line([joint.on_i - radius * spoke, joint.on_i + radius * spoke], dark(colour), BODY_Z + 0.4, linewidth=0.9)
    pen.circle(joint.on_i, 0.7 * PIN, fill=dark(colour), z=PIN_Z - 0.1, linewidth=1.0)
    pen.cover(joint.on_i, PIN, HARD)


def _blade(pen: Pen, scene: Scene, joint: Joint) -> None:
    along = np.asarray(joint.axis) * pen.point
    side = across(along)
    corners = [16 * along, 8 * along + 2.6 * side, -8 * along + 2.6 * side]
    corners += [-16 * along, -8 * along - 2.6 * side, 8 * along - 2.6 * side]
    pen.polygon(joint.on_i + np.array(corners), dark(body_colour(joint.i, scene.ground)), INK, PIN_Z, linewidth=1.0)
    pen.cover_line(joint.on_i - 16 * along, joint.on_i + 16 * along, 7.0, HARD)


def _unknown(pen: Pen, scene: Scene, joint: Joint) -> None:
    if np.hypot(*(joint.on_i - joint.on_j)) > pen.point:
        pen.line([joint.on_i, joint.on_j], INK, PIN_Z - 0.5, linewidth=1.0, linestyle="--")
        pen.cover_line(joint.on_i, joint.on_j, 3.0, HARD)
    diamond = np.array([[6.0, 0.0], [0.0, 6.0], [-6.0, 0.0], [0.0, -6.0]])
    pen.polygon(joint.spot + diamond * pen.point, "white", INK, PIN_Z, linewidth=1.3)
    pen.cover(joint.spot, 7.0, HARD)


def _zigzag(pen: Pen, start: np.ndarray, end: np.ndarray) -> None:
    line = end - start
    share = np.array([0.0, 0.15, *(0.15 + 0.7 * (np.arange(10) + 0.5) / 10), 0.85, 1.0])
    swing = np.array([0.0, 0.0, *np.where(np.arange(10) % 2, -4.5, 4.5), 0.0, 0.0])
    side = across(line) / max(np.hypot(*line), 1e-300) * pen.point
    pen.line(start + share[:, None] * line + swing[:, None] * side, INK, BLOCK_Z, linewidth=1.1)
    for point in (start, end):
        pen.circle(point, 1.8, fill=INK, z=PIN_Z - 0.2)


def _dashpot(pen: Pen, start: np.ndarray, end: np.ndarray) -> None:
    line = end - start
    side = across(line) / max(np.hypot(*line), 1e-300) * 5.0 * pen.point
    a, b, c = (start + share * line for share in (0.35, 0.5, 0.65))
    pen.line([start, a], INK, BLOCK_Z)
    pen.line([c + side, a + side, a - side, c - side], INK, BLOCK_Z)
    pen.line([b + 0.8 * side, b - 0.8 * side], INK, BLOCK_Z, linewidth=1.6)
    pen.line([b, end], INK, BLOCK_Z)
    for point in (start, end):
        pen.circle(point, 1.8, fill=INK, z=PIN_Z - 0.2)


Symbol = Callable[[Pen, Scene, Joint], None]
_PAIRS: dict[frozenset[str], Symbol] = {  # by what they lock
    frozenset({"x", "y"}): _revolute,
    frozenset({"perpendicular", "angle"}): _translational,
    frozenset({"perpendicular"}): _pin_in_slot,
    frozenset({"x", "y", "angle"}): _fixed,
}
_SYMBOLS: dict[type, Symbol] = {
    AngleDriver: _angle_driver,
    DistanceDriver: _distance_driver,
    Cable: _distance_driver,
    AngleCoupling: _angle_coupling,
    GearPair: _mesh,
    RackAndPinion: _mesh,
    Wheel: _wheel,
    KnifeEdge: _blade,
}


def symbol(joint: Joint) -> Symbol:
    """How a joint is drawn: as its kind is, or by what it locks, along a guide if it has a normal."""
    pair = _PAIRS.get(joint.locks, _unknown)
    pair = _unknown if "perpendicular" in joint.locks and joint.axis is None else pair
    return _SYMBOLS.get(joint.kind, pair)
