"""Symbols of joints as solids whose sizes are points of print, as in textbooks on mechanisms

A short cylinder along the axis is a revolute joint, in the plane a circle; one on a longer shaft a cylindrical joint, a
block on a rail a prismatic one, with a helix a screw; a ball is a spherical joint, on a rail a point on a line or a pin
in a slot, on a plate a point on a plane; a cross is universal, a ball between two stubs of constant velocity, a plate
on a plate planar, two short rods parallel axes, a dark cube fixed; a thin rod holds a distance, with a cylinder drives
it, a dark drum with M drives an angle, a piston a travel; circles are wheels in mesh, a tyre with spokes and a patch of
floor a wheel, a plate on its edge a blade. Lower pairs are drawn by what they lock, so new ones too: on a rail what
slides along the axis, on a plate what slides square to it; a ball where the axis may tilt, a block where it may not. An
octahedron is a joint with rows of other names.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from ..._bodies import _joints as flat
from ..._bodies._loads._spring import AbstractSpringDamper
from ..._bodies._space._joints._distance import Cable, Distance
from ..._bodies._space._joints._drivers import AngleDriver, TravelDriver
from ..._bodies._space._joints._gear import Gear
from ..._bodies._space._joints._pairs import ConstantVelocity
from ..._bodies._space._joints._screw import Screw
from ..._bodies._space._joints._universal import Universal
from ..._bodies._space._joints._wheels import KnifeEdge, Wheel
from ..._bodies._space._loads import Bushing
from ._scene import TORSION, Joint, Load, Scene
from ._solids import Solid, axes_of, ball, box, cone, cylinder, hull_solids, path, ring, rod, unit
from ._stands import block_length, on_table, rail_ends, stands
from ._style import GROUND, INK, body_colour, dark

_PLAIN, _UNIQUE, _NOT = "#F2F2F2", "#5FC9A8", "#F2814B"  # joints: as they are, and by the verdict on their load
_BAR = 2.9  # points, radius of a bar
_M = np.array([[-3.2, -3.2], [-3.2, 3.4], [0.0, -1.2], [3.2, 3.4], [3.2, -3.2]])  # points


def solids(scene: Scene, point: float) -> list[Solid]:
    """All that is drawn of bodies, joints and springs; `point` is the size of a point of print in the model."""
    out: list[Solid] = []
    for body, (name, span) in enumerate(zip(scene.names, scene.spans, strict=True)):
        colour = body_colour(body, scene.ground)
        out += hull_solids(span, _BAR * point, colour, dark(colour, 0.8), f"body {name}")
    return out + [each for stand in stands(scene, point) for each in stand.solids(point)] + symbols(scene, point)


def symbols(scene: Scene, point: float) -> list[Solid]:
    """Joints and springs."""
    out = [
        dataclasses.replace(each, name=f"joint {joint.name}")
        for joint in scene.joints
        for each in symbol(joint)(_Place(scene, joint, point))
    ]
    return out + [each for load in scene.loads for each in spring(load, point)]


@dataclasses.dataclass(frozen=True)
class _Place:
    """A joint that is drawn: its solids, about its place and along its axis, of sizes in points of print."""

    scene: Scene
    joint: Joint
    point: float

    @property
    def axis(self) -> np.ndarray:
        return self.joint.axes_j[:, 2]

    @property
    def colour(self) -> str:
        """That of the verdict."""
        doubtful = self.scene.camera.not_unique
        return _PLAIN if doubtful is None else _NOT if self.joint.name in doubtful else _UNIQUE

    def of_body(self, body: int) -> str:
        """Colour of what belongs to a body."""
        return "#A8A8A8" if body == self.scene.ground else dark(body_colour(body, self.scene.ground), 0.8)

    def cylinder(
        self, half: float, radius: float, colour: str | None = None, *, at: float = 0.0, axis: np.ndarray | None = None
    ) -> Solid:
        along = self.axis if axis is None else axis
        centre = self.joint.place + at * self.point * along
        return cylinder(centre, along, half * self.point, radius * self.point, colour or self.colour)

    def box(self, size: Sequence[float], colour: str | None = None) -> Solid:
        return box(self.joint.place, self.joint.axes_j, np.asarray(size) * self.point, colour or self.colour)

    def ball(self, radius: float, at: float = 0.0, steps: int = 6) -> Solid:
        return ball(self.joint.place + at * self.point * self.axis, radius * self.point, self.colour, steps=steps)

    def line(self, start: np.ndarray, end: np.ndarray, radius: float, colour: str = INK) -> Solid:
        return rod(start, end, radius * self.point, colour, has_edge=False)

    def rail(self) -> list[Solid]:
        """A square one under what does not turn; in the plane one of the ground is hatched."""
        joint, (start, end) = self.joint, rail_ends(self.scene, self.joint, self.point)
        if self.scene.is_flat and joint.j == self.scene.ground:
            return []
        colour, steps = self.of_body(joint.j), np.linspace(start, end, 9)
        if not self.scene.is_flat and not joint.locks[3]:
            return [rod(start, end, 2.0 * self.point, colour)]
        size = (4 * self.point, 4 * self.point, float(np.linalg.norm(end - start)) / 8)
        return [box(middle, joint.axes_j, size, colour, has_edge=False) for middle in (steps[1:] + steps[:-1]) / 2]

    def table(self, at: np.ndarray, wide: float) -> Solid:
        """A plate of body j below a point."""
        size = (wide * self.point, wide * self.point, 2.0 * self.point)
        return box(at - 2.0 * self.point * self.axis, self.joint.axes_j, size, self.of_body(self.joint.j))


def _pair(s: _Place) -> list[Solid]:
    """What is locked: a ball where the axis may tilt, else a block, or a cylinder where it may turn."""
    joint = s.joint
    across, along, tilt, twist = joint.locks
    on_floor = on_table(joint)
    under = s.rail() if joint.slides else []
    under += [s.table(joint.place - s.axis * ((joint.place - joint.on_j) @ s.axis), 30.0)] if on_floor else []
    if not tilt:
        size = 4.2 if s.scene.is_flat else 6.0
        return [*under, s.ball(size, size - 1.0 if on_floor else 0.0)]
    if twist and not joint.slides:
        return [*under, s.box((9.5, 9.5, 9.5), None if s.scene.camera.not_unique is not None else "#444444")]
    if twist:
        return [*under, s.box((11, 11, block_length(joint, s.point) / s.point))]
    if across:
        return [*under, s.cylinder(11, 5.5)] if joint.slides else [s.cylinder(9, 5.4), s.cylinder(13, 1.2, INK)]
    if along:
        return [*under, s.box((17, 17, 3.5))]
    one, side = s.cylinder(10, 2), 4.5 * s.point * joint.axes_j[:, 0]
    return [dataclasses.replace(one, corners=one.corners + shift) for shift in (-side, side)]


def _screw(s: _Place) -> list[Solid]:
    (start, end), axes = rail_ends(s.scene, s.joint, s.point), s.joint.axes_j
    turns = float(np.linalg.norm(end - start)) / (7.0 * s.point)
    angle = np.linspace(0.0, 2 * np.pi * turns, max(int(12 * turns), 2))
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes[:, :2].T
    helix = start + np.linspace(0.0, 1.0, len(angle))[:, None] * (end - start) + 3.6 * s.point * around
    half, size = 7 * s.point * s.axis, 7 * s.point
    nut = cone(s.joint.place - half, s.joint.place + half, size, size, s.colour, 6)
    return [*s.rail(), *path(helix, 0.7 * s.point, s.of_body(s.joint.j)), nut]


def _universal(s: _Place) -> list[Solid]:
    pins = (s.joint.axes_i[:, 2], s.joint.axes_j[:, 2])
    ends = [s.cylinder(2, 3.6, dark(s.colour, 0.75), at=side, axis=pin) for pin in pins for side in (-9, 9)]
    return [*(s.cylinder(10, 2.4, axis=pin) for pin in pins), *ends]


def _constant_velocity(s: _Place) -> list[Solid]:
    ends = ((8, s.joint.axes_i, s.joint.i), (-8, s.joint.axes_j, s.joint.j))
    return [*(s.cylinder(6, 3.2, s.of_body(body), at=at, axis=axes[:, 2]) for at, axes, body in ends), s.ball(6.5)]


def _distance(s: _Place) -> list[Solid]:
    ends = s.joint.on_i, s.joint.on_j
    return [s.line(*ends, 1.1), *(ball(end, 3.4 * s.point, s.colour) for end in ends)]


def _distance_driver(s: _Place) -> list[Solid]:
    a, b = s.joint.on_j + np.array([[0.15], [0.6]]) * (s.joint.on_i - s.joint.on_j)
    return [*_distance(s), rod(a, b, 4.0 * s.point, "#DDDDDD", 12)]


def _angle_driver(s: _Place) -> list[Solid]:
    axis = s.axis if s.scene.is_flat else -s.axis  # behind the joint, but where it would not be seen there
    right = s.scene.camera.view.axes[0]
    right = unit(right - axis * (right @ axis))
    face = s.joint.place + s.point * (18.5 * axis + _M @ np.stack([right, np.cross(axis, right)]))
    drum = [s.cylinder(5, 2.5, "#999999", at=4, axis=axis), s.cylinder(5, 8, "#555555", at=13, axis=axis)]
    return [*drum, *path(face, 0.7 * s.point, "#FFFFFF")]


def _travel_driver(s: _Place) -> list[Solid]:
    joint, travel = s.joint, float((s.joint.on_i - s.joint.on_j) @ s.axis)
    sense = s.axis if travel >= 0 else -s.axis
    piston = [rod(joint.on_j, joint.on_i, 2.0 * s.point, "#999999")] if abs(travel) > s.point else []
    return [*piston, rod(joint.on_j - 22 * s.point * sense, joint.on_j, 6.0 * s.point, "#555555", 14)]


def _gear(s: _Place) -> list[Solid]:
    circles = () if s.scene.is_flat else s.joint.mesh.circles  # pitch lines are drawn as in textbooks
    rings = (ring(p, z, max(r, 6 * s.point), 0.9 * s.point, s.of_body(body)) for p, z, r, body in circles)
    return [each for made in rings for each in made]


def _wheel(s: _Place) -> list[Solid]:
    joint, radius = s.joint, float(s.joint.radius or 0.0)
    arms = max(radius - 1.6 * s.point, 0.0) * joint.axes_i.T
    spokes = [s.line(joint.on_i - arm, joint.on_i + arm, 0.8, s.of_body(joint.i)) for arm in arms[:2]]
    if s.scene.is_flat:  # whose rim is a line
        return [s.table(joint.on_j, max(34.0, 1.6 * radius / s.point)), *spokes]
    return [s.table(joint.on_j, 34.0), *ring(joint.on_i, joint.axes_i[:, 2], radius, 1.6 * s.point, s.colour), *spokes]


def _blade(s: _Place) -> list[Solid]:
    along = s.joint.axes_i[:, 2]
    axes = np.stack([along, np.cross(s.axis, along), s.axis], axis=1)
    edge = box(s.joint.on_i + 4 * s.point * s.axis, axes, np.array([26, 2, 8]) * s.point, s.colour)
    return [edge] if s.scene.is_flat else [s.table(s.joint.on_j, 34.0), edge]  # in the plane that is the paper


def _unknown(s: _Place) -> list[Solid]:
    ends = s.joint.on_i, s.joint.on_j
    line = [s.line(*ends, 0.8)] if np.linalg.norm(ends[0] - ends[1]) > s.point else []
    return [*line, s.ball(7.0, steps=2)]


def spring(load: Load, point: float) -> list[Solid]:
    """What is drawn of a load, nothing of a force."""
    if issubclass(load.kind, AbstractSpringDamper):
        return _coil(load, point) if load.is_stiff else _damper(load, point)
    if load.kind in TORSION:
        angle = np.linspace(0.0, 4.5 * np.pi, 60)
        turn = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ load.axes[:, :2].T
        spiral = load.on_i + point * (7.0 + 7.0 * angle / angle[-1])[:, None] * turn
        return path(spiral, 0.8 * point, GROUND, name="spring")
    if load.kind is Bushing:
        axis = load.axes[:, 2]
        outer = cylinder(load.on_j, axis, 5 * point, 9 * point, "#6E6E6E", opacity=0.5, name="bushing")
        return [outer, cylinder(load.on_i, axis, 8 * point, 3.5 * point, "#BBBBBB", name="bushing")]
    return []


def _coil(load: Load, point: float) -> list[Solid]:
    line, turns = load.on_j - load.on_i, 7
    angle = np.linspace(0.0, 2 * np.pi * turns, 12 * turns + 1)
    share = np.concatenate([[0.0], np.linspace(0.12, 0.88, len(angle)), [1.0]])
    swing = np.concatenate([[[0.0, 0.0]], np.stack([np.cos(angle), np.sin(angle)], axis=1), [[0.0, 0.0]]])
    points = load.on_i + share[:, None] * line + 4.5 * point * swing @ axes_of(line)[:, :2].T
    return path(points, 0.7 * point, GROUND, name="spring")


def _damper(load: Load, point: float) -> list[Solid]:
    a, b = load.on_j + np.array([[0.35], [0.65]]) * (load.on_i - load.on_j)
    thin = rod(load.on_j, load.on_i, 1.0 * point, GROUND, name="damper", has_edge=False)
    return [thin, rod(a, b, 5.0 * point, "#BBBBBB", 12, name="damper")]


Symbol = Callable[[_Place], list[Solid]]
_SYMBOLS: dict[type, Symbol] = {
    Screw: _screw,
    Universal: _universal,
    ConstantVelocity: _constant_velocity,
    Distance: _distance,
    Cable: _distance,
    flat.DistanceDriver: _distance_driver,
    flat.Cable: _distance_driver,
    flat.AngleDriver: _angle_driver,
    flat.AngleCoupling: _gear,
    flat.GearPair: _gear,
    flat.RackAndPinion: _gear,
    flat.Wheel: _wheel,
    flat.KnifeEdge: _blade,
    AngleDriver: _angle_driver,
    TravelDriver: _travel_driver,
    Gear: _gear,
    Wheel: _wheel,
    KnifeEdge: _blade,
}


def symbol(joint: Joint) -> Symbol:
    """How a joint is drawn: as its kind is, or by what it locks."""
    return _SYMBOLS.get(joint.kind, _pair if any(joint.locks) else _unknown)
