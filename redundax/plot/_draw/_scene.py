"""What there is to draw: a mechanism at a state as points in the global frame, in NumPy.

    p = r + R(phi) s                                                                       (54)

for every joint point s of a body; a guide runs along R_j v_j turned by -90 degrees, Eq. (57). The ground has the
index after the last body. Joints without points of their own (drivers, couplings) are shown at the pin of their bodies.
"""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..._bodies._joints import AngleCoupling, AngleDriver, KnifeEdge, Revolute, Wheel
from ..._bodies._loads import AppliedForce, SpringDamper, TorsionSpring
from ..._bodies._mechanism import Mechanism
from ..._bodies._pose import poses
from ..._bodies._reactions import load_wrenches, moment_about
from ..._system._state import State
from ..._system._units import StatedUnits
from ._meshes import Mesh, meshes_of, turned

_SIDES = np.array([[0.0, -1.0], [0.0, 1.0], [-1.0, 0.0], [1.0, 0.0]])


@dataclasses.dataclass(frozen=True)
class Joint:
    """A joint: `on_i` and `on_j` are its points on the two bodies, `spot` is where its symbol and name belong.

    `axis` is the unit vector along its guide, `length` the guide's length and `ratio` that of a coupling of angles,
    where the joint has such a thing, `mesh` its teeth and `radius` that of a wheel on a line; `pointed` is whether it
    has a point, `one_sided` whether it only pushes. `locks` are the names of its rows. `group` and `member` say where
    in the mechanism's stacks it lies.
    """

    name: str
    kind: type
    locks: frozenset[str]
    group: int
    member: int
    i: int
    j: int
    on_i: np.ndarray
    on_j: np.ndarray
    spot: np.ndarray
    axis: np.ndarray | None
    length: float | None
    ratio: float | None
    pointed: bool
    mesh: Mesh | None = None
    one_sided: bool = False
    radius: float | None = None

    @property
    def loaded_at(self) -> np.ndarray:
        """Where the arrow of its force starts: on body i, of teeth at the pitch point."""
        return self.on_i if self.mesh is None else self.spot


@dataclasses.dataclass(frozen=True)
class Load:
    """A spring between two points, or (`kind` is AppliedForce) a force and a moment on a body at `on_i`."""

    kind: type
    i: int
    on_i: np.ndarray
    on_j: np.ndarray
    to_ground: bool
    stiff: bool = True
    force: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(2))
    moment: float = 0.0


@dataclasses.dataclass(frozen=True)
class Scene:
    """Bodies (`names`, `centres` and `turns`, the ground's last), joints, loads, gravity, and the model's units."""

    names: tuple[str, ...]
    centres: np.ndarray
    turns: np.ndarray
    joints: tuple[Joint, ...]
    loads: tuple[Load, ...]
    gravity: np.ndarray
    units: StatedUnits

    @property
    def ground(self) -> int:
        """Index of the ground."""
        return len(self.names)

    def joint_points(self, body: int) -> np.ndarray:
        """Points of a moving body by which it is connected, and its centre of mass, shape (points, 2)."""
        return np.array(self._connections[body])

    @functools.cached_property
    def _connections(self) -> list[list[np.ndarray]]:
        """`joint_points` of all bodies."""
        points = [[centre] for centre in self.centres]
        for joint in self.joints:
            points[joint.i].append(joint.on_i)
            points[joint.j].append(joint.on_j if joint.axis is None else joint.on_i)
        for load in self.loads:
            points[load.i].append(load.on_i)
        return points

    def points(self) -> np.ndarray:
        """All points that must be in the picture, shape (points, 2)."""
        ends = [joint.on_j for joint in self.joints if joint.axis is None]
        ends += [joint.on_i for joint in self.joints] + [joint.spot for joint in self.joints]
        for joint in self.joints:
            ends += [end + side * radius for end, radius in pitch_circles(joint) for side in _SIDES]
        ends += [end for load in self.loads for end in (load.on_i, load.on_j)]
        return np.array([*self.centres[: self.ground], *ends])

    @functools.cached_property
    def spacing(self) -> float:
        """Median distance of a joint's place from the next one; infinite where there is one place only."""
        return spacing(np.array([joint.spot for joint in self.joints]), self.points())

    @property
    def weight(self) -> float:
        """Size of the acceleration of gravity."""
        return float(np.hypot(*self.gravity))


def spacing(spots: np.ndarray, points: np.ndarray) -> float:
    """Median distance of a place from the next one, in a picture of points; infinite where there is one place only."""
    least = 1e-6 * float(np.linalg.norm(np.ptp(points, axis=0)))

    def gap(spot: np.ndarray) -> float:
        others = np.sqrt(np.sum((spots - spot) ** 2, axis=1))
        return float(np.min(others, where=others > least, initial=np.inf))

    return float(np.median([gap(spot) for spot in spots])) if len(spots) else np.inf


def scene(mechanism: Mechanism, state: State) -> Scene:
    """The scene of a mechanism at a state."""
    body = poses(state.q)
    r, phi = np.asarray(body.r, float), np.asarray(body.phi, float)
    joints = [joint for group in range(len(mechanism.joints)) for joint in _joints(mechanism, group, r, phi)]
    pins = by_body([joint for joint in joints if joint.kind is Revolute])
    return Scene(
        names=mechanism.names.bodies,
        centres=r,
        turns=phi,
        joints=tuple(_at_pin(joint, pins, r) for joint in joints),
        loads=tuple(load for stack in mechanism.loads for load in _loads(mechanism, stack, state, r, phi, pins)),
        gravity=np.asarray(mechanism.gravity, float),
        units=mechanism.names.units,
    )


def _joints(mechanism: Mechanism, group: int, r: np.ndarray, phi: np.ndarray) -> list[Joint]:
    stack = mechanism.joints[group]
    element, i, j = stack.element, np.asarray(stack.i), np.asarray(stack.j)
    ground = len(r) - 1
    meshes = meshes_of(stack, r, phi)
    on_i, on_j = (_points(element.point_on(end), body, r, phi) for end, body in (("i", i), ("j", j)))
    pointed = on_i is not None or on_j is not None
    # The ground has no centre to show a joint at; a point of the other body does.
    on_i = on_j if on_i is None and on_j is not None else on_i
    on_i = np.where((i == ground)[:, None], r[j], r[i]) if on_i is None else on_i
    on_j = np.where((j == ground)[:, None], on_i, r[j]) if on_j is None else on_j
    normal = _stacked(element.directions().get("j"), (2,))
    axis = None if normal is None else turned(np.stack([normal[:, 1], -normal[:, 0]], 1), phi[j])
    if isinstance(element, KnifeEdge):
        axis = turned(np.asarray(element.direction, float), phi[i])
    radius = np.asarray(element.radius, float) if isinstance(element, Wheel) else None
    length = _stacked(element.moment_arm(), ())
    ratio = _stacked(element.ratio, ()) if isinstance(element, AngleCoupling) else None
    names = mechanism.names.joints[group]
    return [
        Joint(
            name=names[k],
            kind=type(element),
            locks=frozenset(name for name, _ in element.row_kinds),
            group=group,
            member=k,
            i=int(i[k]),
            j=int(j[k]),
            on_i=on_i[k],
            on_j=on_j[k],
            spot=on_i[k],
            axis=None if axis is None else axis[k],
            length=None if length is None else float(length[k]),
            ratio=None if ratio is None else float(ratio[k]),
            pointed=pointed,
            mesh=meshes[k],
            one_sided=element.one_sided,
            radius=None if radius is None else float(radius[k]),
        )
        for k in range(len(i))
    ]


def _at_pin(joint: Joint, pins: dict[int, list[Joint]], r: np.ndarray) -> Joint:
    """Joints without points at the pins of their bodies, joints between two distant points halfway."""
    if joint.mesh is not None:
        return dataclasses.replace(joint, spot=joint.mesh.pitch, on_j=joint.mesh.on_j, axis=None)
    if joint.axis is not None:
        return joint
    if joint.pointed:
        return dataclasses.replace(joint, spot=(joint.on_i + joint.on_j) / 2)
    if joint.kind is AngleCoupling:
        ends = [pin(body, len(r) - 1, pins) for body in (joint.i, joint.j)]
        on_i, on_j = (r[body] if end is None else end for body, end in zip((joint.i, joint.j), ends, strict=True))
        return dataclasses.replace(joint, on_i=on_i, on_j=on_j, spot=(on_i + on_j) / 2)
    spot = pin(joint.i, joint.j, pins)
    if spot is None or (joint.kind is not AngleDriver and joint.j != len(r) - 1):
        spot = (joint.on_i + joint.on_j) / 2
    return dataclasses.replace(joint, spot=spot)


def by_body(joints: Sequence[Any]) -> dict[int, list[Any]]:
    """The joints of each body, in order."""
    found: dict[int, list[Any]] = {}
    for joint in joints:
        for body in {joint.i, joint.j}:
            found.setdefault(body, []).append(joint)
    return found


def joining(i: int, j: int, joints: dict[int, list[Any]]) -> Any:
    """A joint of the bodies i and j, else the first of i; `None` if there is none."""
    own = joints.get(i, [])
    return next((joint for joint in own if j in (joint.i, joint.j)), own[0] if own else None)


def pin(i: int, j: int, pins: dict[int, list[Joint]]) -> np.ndarray | None:
    """Where the bodies i and j are pinned together, else where i is pinned to anything."""
    found = joining(i, j, pins)
    return None if found is None else found.on_i


def pitch_circles(joint: Joint) -> list[tuple[np.ndarray, float]]:
    """Centres and radii of gears in mesh, of a wheel on a line, or of the wheels of a coupling, which touch if they
    turn in opposite senses; else none.
    """
    if joint.mesh is not None:
        return list(joint.mesh.circles)
    if joint.radius is not None:
        return [(joint.on_i, joint.radius)]
    distance, ratio = float(np.hypot(*(joint.on_j - joint.on_i))), joint.ratio or 1.0
    if joint.kind is not AngleCoupling or distance == 0:
        return []
    whole = distance if ratio > 0 else 0.5 * distance
    return [(joint.on_i, whole / (1 + abs(ratio))), (joint.on_j, whole * abs(ratio) / (1 + abs(ratio)))]


def _loads(
    mechanism: Mechanism, stack: Any, state: State, r: np.ndarray, phi: np.ndarray, pins: dict[int, list[Joint]]
) -> list[Load]:
    kind, ground = type(stack.element), len(r) - 1
    bodies_i, bodies_j = np.asarray(stack.i), np.asarray(stack.j)
    on_i = _points(stack.element.point_on("i"), bodies_i, r, phi)
    on_j = _points(stack.element.point_on("j"), bodies_j, r, phi)
    if kind is SpringDamper and on_i is not None and on_j is not None:
        stiff = np.asarray(stack.element.stiffness) != 0
        return [
            Load(kind, int(bodies_i[k]), on_i[k], on_j[k], ground in (bodies_i[k], bodies_j[k]), bool(stiff[k]))
            for k in range(len(bodies_i))
        ]
    if kind is TorsionSpring:
        spots = [pin(int(i), int(j), pins) for i, j in zip(bodies_i, bodies_j, strict=True)]
        spots = [r[i] if spot is None else spot for i, spot in zip(bodies_i, spots, strict=True)]
        return [Load(kind, int(i), spot, spot, False) for i, spot in zip(bodies_i, spots, strict=True)]
    return _applied(mechanism, stack, state, r, phi)


def _applied(mechanism: Mechanism, stack: Any, state: State, r: np.ndarray, phi: np.ndarray) -> list[Load]:
    """Forces and moments of a load at this state, at its point if it has one, else at the body's centre."""
    ground, out = len(r) - 1, []
    for bodies, wrench in zip((stack.i, stack.j), load_wrenches(mechanism, stack, state), strict=True):
        bodies, force, moment = np.asarray(bodies), np.asarray(wrench.force), np.asarray(wrench.moment)
        points = _points(getattr(stack.element, "point", None), bodies, r, phi)
        for k, body in enumerate(bodies):
            if body == ground or not (np.any(force[k]) or moment[k]):
                continue
            at = r[body] if points is None else points[k]
            about = float(moment_about(moment[k], force[k], at - r[body]))
            about = about if abs(about) > 1e-6 * np.hypot(*force[k]) * np.hypot(*(at - r[body])) else 0.0
            out.append(Load(AppliedForce, int(body), at, at, False, force=force[k], moment=about))
    return out


def _stacked(value: Any, shape: tuple[int, ...]) -> np.ndarray | None:
    """Values of stacked elements as an array with a leading axis over them, if they are there in that shape."""
    return np.asarray(value, float) if value is not None and np.shape(value)[1:] == shape else None


def _points(local: Any, bodies: np.ndarray, r: np.ndarray, phi: np.ndarray) -> np.ndarray | None:
    local = _stacked(local, (2,))
    return None if local is None else r[bodies] + turned(local, phi[bodies])
