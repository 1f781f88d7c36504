"""What there is to draw of a mechanism at a state: points, axes and loads in space, in NumPy, and where they are seen

    p = r + R s                                                                            (54)

for every joint point s of a body. The ground has the index after the last body. A planar mechanism lies at z = 0: its
joints have the axis z, or that of their guide, and the plane itself locks what its rows do not name. Joints without
points of their own (drivers, couplings) are shown at the pin of their bodies.
"""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jax.typing import ArrayLike

from ..._bodies._joints import AbstractJoint, AngleCoupling, KnifeEdge, Wheel
from ..._bodies._loads import AppliedForce
from ..._bodies._loads import TorsionSpring as FlatTorsionSpring
from ..._bodies._loads._spring import AbstractSpringDamper
from ..._bodies._mechanism import Mechanism
from ..._bodies._plane import Plane
from ..._bodies._pose import Pose as FlatPose
from ..._bodies._reactions import load_wrenches
from ..._bodies._space._joints._gear import Gear
from ..._bodies._space._joints._wheels import AbstractOnPlane
from ..._bodies._space._loads import Bushing, TorsionSpring
from ..._bodies._space._pose import Pose
from ..._bodies._stack import AbstractBetweenBodies, Stack
from ..._system._state import State
from ..._system._units import StatedUnits
from ..._tools._compilation import compiled
from ._camera import OVER_PLANE, Camera
from ._meshes import Mesh, mesh_of

SPRINGS = (AbstractSpringDamper, FlatTorsionSpring, TorsionSpring, Bushing)
TORSION = (FlatTorsionSpring, TorsionSpring)
_WAYS = ({"radial_1", "radial_2"}, {"axial"}, {"bend_1", "bend_2"}, {"twist"})
_IN_PLANE: dict[frozenset[str], tuple[bool, bool, bool, bool]] = {  # the same of rows in the plane, which locks more
    frozenset({"x", "y"}): (True, True, True, False),
    frozenset({"x", "y", "angle"}): (True, True, True, True),
    frozenset({"perpendicular", "angle"}): (True, False, True, True),
    frozenset({"perpendicular"}): (True, False, False, False),
}
_NONE = (False, False, False, False)
_SLIDES = 1e-6  # of a travel, up to which a point is on the axis: joints are closed to 1e-10, files have six digits
_ROUNDING = 1e-6  # of force times arm, up to which a moment about the point of a force is none


class Bodies(NamedTuple):
    """Origins (bodies, 3), axes as columns (bodies, 3, 3), and centres of mass (bodies, 3), the ground's last."""

    r: np.ndarray
    axes: np.ndarray
    centres: np.ndarray

    def points(self, local: ArrayLike | None, bodies: np.ndarray) -> np.ndarray | None:
        """Global points of bodies, of which the local ones are given."""
        if local is None or np.shape(local)[1:] not in ((2,), (3,)):
            return None
        return self.r[bodies] + np.einsum("bij,bj->bi", self.axes[bodies], lifted(np.asarray(local, float)))


@dataclasses.dataclass(frozen=True)
class Joint:
    """A joint at the point `on_i` of body i and `on_j` of body j, with axes as columns, z along its own, on each.

    `place` is where its symbol and name are, `told` where its reaction is known about. `locks` says whether it locks
    offsets square to its axis, that along it, tilts of it, and turns about it; `has_point` whether it has points of its
    own, `has_axis` whether it reads the axis. `length` is that of a slider, `radius` that of a wheel on a floor, which
    touches it at `on_j`, 0 of a blade.
    """

    name: str
    kind: type
    i: int
    j: int
    on_i: np.ndarray
    on_j: np.ndarray
    axes_i: np.ndarray
    axes_j: np.ndarray
    place: np.ndarray
    told: np.ndarray
    locks: tuple[bool, bool, bool, bool]
    has_point: bool
    has_axis: bool
    length: float | None = None
    radius: float | None = None
    mesh: Mesh = dataclasses.field(default_factory=Mesh)

    @property
    def slides(self) -> bool:
        """Whether it is free along its axis alone."""
        across, along, _, _ = self.locks
        return across and not along


@dataclasses.dataclass(frozen=True)
class Load:
    """A spring between two points or about the axis z of `axes`, or (`kind` is AppliedForce) a force and a moment at
    `on_i`; `is_stiff` is false for a damper.
    """

    kind: type
    i: int
    on_i: np.ndarray
    on_j: np.ndarray
    axes: np.ndarray
    to_ground: bool = False
    is_stiff: bool = True
    force: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    moment: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))


@dataclasses.dataclass(frozen=True)
class Scene:
    """Bodies (`names`, `centres` of mass (bodies, 3), and `spans`, the points that each holds together), joints, loads,
    the acceleration of gravity, units, and how it is seen.
    """

    names: tuple[str, ...]
    centres: np.ndarray
    spans: tuple[np.ndarray, ...]
    joints: tuple[Joint, ...]
    loads: tuple[Load, ...]
    gravity: np.ndarray
    units: StatedUnits
    camera: Camera

    @property
    def ground(self) -> int:
        """Index of the ground."""
        return len(self.names)

    @property
    def is_flat(self) -> bool:
        """Whether it is of the plane."""
        return self.camera.view.is_flat

    def flat(self, points: np.ndarray) -> np.ndarray:
        """Places on the picture, (..., 2), of points or directions (..., 3)."""
        return self.camera.view.flat(points)

    @functools.cached_property
    def spots(self) -> np.ndarray:
        """Places of joints on the picture, (joints, 2)."""
        return self.flat(np.array([joint.place for joint in self.joints]).reshape(-1, 3))

    @functools.cached_property
    def space_points(self) -> np.ndarray:
        """All points that must be in the picture, (points, 3)."""
        ends = [end for joint in self.joints for end in (joint.on_i, joint.on_j, joint.place)]
        ends += [end for load in self.loads for end in (load.on_i, load.on_j)]
        for joint in self.joints:  # rims of wheels
            rims = [joint.on_i + side * (joint.radius or 0.0) * joint.axes_i.T[:2] for side in (-1, 1)]
            rims += [
                circle.centre + side * circle.radius * (np.eye(3) - np.outer(circle.axis, circle.axis))
                for circle in joint.mesh.circles
                for side in (-1, 1)
            ]
            ends += [point for rim in rims for point in rim]
        return np.concatenate([*self.spans, np.array(ends).reshape(-1, 3)])

    @property
    def points(self) -> np.ndarray:
        """Their places on the picture, (points, 2)."""
        return self.flat(self.space_points)

    @functools.cached_property
    def spacing(self) -> float:
        """Median distance of a joint from the next one, as it is seen; infinite where all are at one place."""
        return spacing(self.spots, self.points)

    @property
    def weight(self) -> float:
        """Size of the acceleration of gravity."""
        return float(np.linalg.norm(self.gravity))


def spacing(spots: np.ndarray, points: np.ndarray) -> float:
    """Median distance of a place from the next one, in a picture of points; infinite where there is one place only."""
    least = 1e-6 * float(np.linalg.norm(np.ptp(points, axis=0)))

    def gap(spot: np.ndarray) -> float:
        others = np.sqrt(np.sum((spots - spot) ** 2, axis=1))
        return float(np.min(others, where=others > least, initial=np.inf))

    return float(np.median([gap(spot) for spot in spots])) if len(spots) else np.inf


def scene(mechanism: Mechanism, state: State, camera: Camera = OVER_PLANE) -> Scene:
    """The scene of a mechanism at a state."""
    bodies = _bodies(mechanism, state)
    stacks = [(stack.element, _joints(mechanism, group, bodies)) for group, stack in enumerate(mechanism.joints)]
    pins = by_body([each for _, some in stacks for each in some if each.has_point and each.locks[:2] == (True, True)])
    joints = tuple(_finished(each, element, k, pins, bodies) for element, some in stacks for k, each in enumerate(some))
    loads = tuple(load for stack in mechanism.loads for load in _loads(mechanism, stack, state, bodies, pins))
    of_body, names = by_body(joints), mechanism.names.bodies
    spans = tuple(
        bodies.r[k] + camera.shapes[name] @ bodies.axes[k].T
        if name in camera.shapes
        else _span(k, bodies.centres[k], of_body.get(k, []), [load for load in loads if load.i == k])
        for k, name in enumerate(names)
    )
    gravity = lifted(np.asarray(mechanism.gravity, float))
    return Scene(names, bodies.centres[:-1], spans, joints, loads, gravity, mechanism.names.units, camera)


def _bodies(mechanism: Mechanism, state: State) -> Bodies:
    pose = _poses(mechanism.anonymous, state)
    if isinstance(pose, FlatPose):
        r, phi = lifted(np.asarray(pose.r, float)), np.asarray(pose.phi, float)
        axes = np.broadcast_to(np.eye(3), (len(r), 3, 3)).copy()
        axes[:, :2, :2] = np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]]).transpose(2, 0, 1)
        return Bodies(r, axes, r)
    r, axes, centre = (np.asarray(x, float) for x in (pose.r, pose.axes, pose.centre))
    return Bodies(r, axes, r + np.einsum("bij,bj->bi", axes, centre))


@compiled
def _poses(mechanism: Mechanism, state: State) -> FlatPose | Pose:
    return mechanism.frame.motions(mechanism.body, state).pose


def lifted(v: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of such ones, or of (..., 2) in the plane."""
    return np.concatenate([v, np.zeros((*v.shape[:-1], 3 - v.shape[-1]))], axis=-1)


def _joints(mechanism: Mechanism, group: int, bodies: Bodies) -> list[Joint]:
    stack = mechanism.joints[group]
    element, i, j, ground = stack.element, np.asarray(stack.i), np.asarray(stack.j), len(bodies.r) - 1
    own_i, own_j = (bodies.points(element.point_on(end), body) for end, body in (("i", i), ("j", j)))
    told = np.where(
        (i == ground)[:, None], bodies.r[j] if own_j is None else own_j, bodies.r[i] if own_i is None else own_i
    )
    # The ground has no centre to show a joint at; a point of the other body does.
    on_i = own_j if own_i is None and own_j is not None else own_i
    on_i = bodies.centres[np.where(i == ground, j, i)] if on_i is None else on_i
    on_j = np.where((j == ground)[:, None], on_i, bodies.centres[j]) if own_j is None else own_j
    axes_i, axes_j, is_placed = _axes(element, i, j, bodies)
    radii = None
    if isinstance(element, AbstractOnPlane | Wheel):
        radii = np.broadcast_to(np.asarray(getattr(element, "radius", 0.0), float), len(i))
        on_j = _touching(on_i, radii, axes_i[:, :, 2], axes_j[:, :, 2])
    on_axis = is_placed and not isinstance(element, Gear)
    length = element.moment_arm()
    length = None if length is None or np.shape(length) != (len(i),) else np.asarray(length, float)
    flat = isinstance(mechanism.frame, Plane)
    return [
        Joint(
            name, type(element), int(i[k]), int(j[k]), on_i[k], on_j[k], axes_i[k], axes_j[k],
            on_i[k] if on_axis else (on_i[k] + on_j[k]) / 2, told[k],
            _locked(element, flat, is_placed), own_i is not None or own_j is not None,
            flat or bool(element.directions()), None if length is None else float(length[k]),
            None if radii is None else float(radii[k]),
        )
        for k, name in enumerate(mechanism.names.joints[group])
    ]  # fmt: skip


def _locked(element: AbstractJoint, flat: bool, is_placed: bool) -> tuple[bool, bool, bool, bool]:
    """What a joint locks: offsets across its axis, along it, tilts of it and turns about it."""
    rows = frozenset(name for name, _ in element.row_kinds)
    if not flat:
        if not rows <= frozenset().union(*_WAYS):
            return _NONE
        across, along, tilt, twist = (way <= rows for way in _WAYS)
        return across, along, tilt, twist
    if "perpendicular" in rows and not is_placed:
        return _NONE
    return (False, True, False, False) if _is_floor(element) and len(rows) == 1 else _IN_PLANE.get(rows, _NONE)


def _is_floor(element: AbstractJoint) -> bool:
    """Whether a line of body j only pushes, square to it."""
    return isinstance(element, Wheel) or (element.one_sided and "perpendicular" in dict(element.row_kinds))


def _axes(
    element: AbstractBetweenBodies, i: np.ndarray, j: np.ndarray, bodies: Bodies
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Axes of joints on both bodies, and whether the joint has any; in the plane z is along guides and blades, and
    square to floors."""
    local: list[ArrayLike | None] = [element.axes_on(end) for end in "ij"]
    normal = element.directions().get("j") if isinstance(element, AbstractJoint) else None
    if isinstance(element, AbstractJoint) and normal is not None and np.shape(normal)[1:] == (2,):
        x = lifted(np.asarray(normal, float))
        local[1] = _upright(x if _is_floor(element) else np.cross(x, [0.0, 0.0, 1.0]))
    if isinstance(element, KnifeEdge):
        local[0] = _upright(lifted(np.asarray(element.direction, float)))
    turns = [None if each is None or np.shape(each)[1:] != (3, 3) else np.asarray(each, float) for each in local]
    ends = zip(turns, (bodies.axes[i], bodies.axes[j]), strict=True)
    on_i, on_j = (axes if turn is None else axes @ turn for turn, axes in ends)
    return on_i, on_j, any(turn is not None for turn in turns)


def _upright(z: np.ndarray) -> np.ndarray:
    """Axes whose y is that square to the plane."""
    y = np.broadcast_to([0.0, 0.0, 1.0], z.shape)
    return np.stack([np.cross(y, z), y, z], axis=-1)


def _touching(centres: np.ndarray, radii: np.ndarray, axles: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Lowest points of discs."""
    up = normals - np.sum(axles * normals, axis=1, keepdims=True) * axles
    return centres - radii[:, None] * up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-300)


def _finished(joint: Joint, element: AbstractJoint, k: int, pins: dict[int, list[Joint]], bodies: Bodies) -> Joint:
    """Member k of stacked joints with its wheels; one without points is at the pin of its bodies, if there is one."""
    ground, on_i, on_j, place = len(bodies.r) - 1, joint.on_i, joint.on_j, joint.place
    if joint.kind is AngleCoupling:
        on_i, on_j = (_pin(body, ground, pins, bodies) for body in (joint.i, joint.j))
        place = (on_i + on_j) / 2
    elif not joint.has_point:
        found = joining(joint.i, joint.j, pins)
        place = place if found is None or not {joint.j} & {found.i, found.j, ground} else found.on_i
    axes = joint.axes_i[:, 2], joint.axes_j[:, 2]
    mesh = mesh_of(element, k, (joint.i, joint.j), (on_i, on_j), axes, joint.axes_j[:, 0])
    place = place if mesh.pitch is None else mesh.pitch
    return dataclasses.replace(joint, on_i=on_i, on_j=on_j, place=place, mesh=mesh)


def by_body(joints: Sequence[Joint]) -> dict[int, list[Joint]]:
    """The joints of each body, in order."""
    found: dict[int, list[Joint]] = {}
    for joint in joints:
        for body in {joint.i, joint.j}:
            found.setdefault(body, []).append(joint)
    return found


def joining(i: int, j: int, joints: Mapping[int, Sequence[Joint]]) -> Joint | None:
    """A joint of the bodies i and j, else the first of i; `None` if there is none."""
    own = joints.get(i, [])
    return next((joint for joint in own if j in (joint.i, joint.j)), own[0] if own else None)


def _pin(i: int, j: int, pins: dict[int, list[Joint]], bodies: Bodies) -> np.ndarray:
    """Where the bodies i and j are pinned together, else where i is pinned to anything, or has its centre."""
    found = joining(i, j, pins)
    return bodies.centres[min(i, j)] if found is None else found.on_i


def _loads(
    mechanism: Mechanism, stack: Stack, state: State, bodies: Bodies, pins: dict[int, list[Joint]]
) -> list[Load]:
    """Springs of a stack, or the forces and moments of other loads."""
    element, i, j, ground = stack.element, np.asarray(stack.i), np.asarray(stack.j), len(bodies.r) - 1
    if not isinstance(element, SPRINGS):
        return _applied(mechanism, stack, state, bodies)
    _, axes, _ = _axes(element, i, j, bodies)
    on_i, on_j = (bodies.points(element.point_on(end), body) for end, body in (("i", i), ("j", j)))
    stiffness, out = getattr(element, "stiffness", None), []
    for k, (one, other) in enumerate(zip(i.tolist(), j.tolist(), strict=True)):
        spot = _pin(one, other, pins, bodies)
        a, b = spot if on_i is None else on_i[k], spot if on_j is None else on_j[k]
        is_stiff = stiffness is None or bool(stiffness[k] != 0)
        out.append(Load(type(element), one, a, b, axes[k], ground in (one, other), is_stiff))
    return out


def _applied(mechanism: Mechanism, stack: Stack, state: State, bodies: Bodies) -> list[Load]:
    """Forces and moments of a load at its point if it has one, else at the body's centre of mass."""
    out = []
    for which, wrench in zip((stack.i, stack.j), load_wrenches(mechanism, stack, state), strict=True):
        own, force = np.asarray(which), lifted(np.asarray(wrench.force, float))
        moment = np.asarray(wrench.moment, float)
        moment = moment[:, None] * [0.0, 0.0, 1.0] if moment.ndim == 1 else moment
        points = bodies.points(getattr(stack.element, "point", None), own)
        for k, body in enumerate(own.tolist()):
            if body == len(bodies.r) - 1 or not (np.any(force[k]) or np.any(moment[k])):
                continue
            at = bodies.centres[body] if points is None else points[k]
            about = moment[k] - np.cross(at - bodies.r[body], force[k])
            least = _ROUNDING * np.linalg.norm(force[k]) * np.linalg.norm(at - bodies.r[body])
            about = about if np.linalg.norm(about) > least else np.zeros(3)
            out.append(Load(AppliedForce, body, at, at, bodies.axes[body], force=force[k], moment=about))
    return out


def _span(body: int, centre: np.ndarray, joints: Sequence[Joint], loads: Sequence[Load]) -> np.ndarray:
    """Points by which a moving body is connected, with its joints and loads, and its centre of mass."""
    points = [centre, *(joint.on_i for joint in joints if joint.i == body)]
    for joint in joints:
        if joint.j == body:  # what slides along an axis of the body is where it slides
            along = joint.axes_j[:, 2] * ((joint.on_i - joint.on_j) @ joint.axes_j[:, 2])
            slides = np.linalg.norm(joint.on_i - joint.on_j - along) <= _SLIDES * np.linalg.norm(along)
            points.append(joint.on_i if slides else joint.on_j)
    return np.array([*points, *(load.on_i for load in loads)])
