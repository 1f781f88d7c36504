"""What there is to draw of a spatial mechanism at a state, in NumPy, and where it is on the picture

Points and axes are global. Loads of joints are those of `Mechanism.joint_coordinates`: about the joint's point on body
i, or on body j where body i is the ground.
"""

import dataclasses
import functools
from collections.abc import Mapping

import numpy as np

from ...._bodies._mechanism import Mechanism
from ...._bodies._space._joints._gear import Gear
from ...._bodies._space._joints._wheels import AbstractOnPlane
from ...._bodies._space._pose import Pose
from ...._system._state import State
from ...._system._units import StatedUnits
from ...._tools._compilation import compiled
from .._scene import by_body, spacing
from ._fields import points_of, stacked
from ._joint import SpaceJoint
from ._loads import SpaceLoad, space_loads
from ._view import View


@dataclasses.dataclass(frozen=True)
class SpaceScene:
    """Bodies (`names`, `centres` of mass (bodies, 3), and `spans`, the points that each holds together), joints, loads,
    and the view on them. `acceleration` is that of gravity, `sides` where from joints stand on the ground, by name.
    """

    names: tuple[str, ...]
    centres: np.ndarray
    spans: tuple[np.ndarray, ...]
    joints: tuple[SpaceJoint, ...]
    loads: tuple[SpaceLoad, ...]
    acceleration: np.ndarray
    units: StatedUnits
    view: View
    not_unique: frozenset[str] | None
    sides: Mapping[str, np.ndarray]

    @property
    def ground(self) -> int:
        """Index of the ground."""
        return len(self.names)

    @property
    def gravity(self) -> np.ndarray:
        """That of gravity as it is seen, (2,)."""
        return self.view.flat(self.acceleration)

    @property
    def weight(self) -> float:
        """Size of the acceleration of gravity."""
        return float(np.linalg.norm(self.acceleration))

    def joint_points(self, body: int) -> np.ndarray:
        """Places on the picture of what a body holds together, (points, 2)."""
        return self.view.flat(self.spans[body])

    def points(self) -> np.ndarray:
        """All places that must be in the picture, (points, 2)."""
        return self.view.flat(self.space_points())

    def space_points(self) -> np.ndarray:
        """All points that must be in the picture, (points, 3)."""
        ends = [end for each in (*self.joints, *self.loads) for end in (each.on_i, each.on_j)]
        for joint in self.joints:  # rims of wheels
            ends += [
                joint.on_i + side * axis for axis in (joint.radius or 0.0) * joint.axes_i.T[:2] for side in (-1, 1)
            ]
        return np.concatenate([*self.spans, np.array(ends).reshape(-1, 3)])

    @functools.cached_property
    def spacing(self) -> float:
        """Median distance of a joint from the next one, as it is seen."""
        return spacing(np.array([joint.spot for joint in self.joints]), self.points())


def space_scene(
    mechanism: Mechanism,
    state: State,
    view: View,
    shapes: Mapping[str, np.ndarray],
    not_unique: frozenset[str] | None,
    sides: Mapping[str, np.ndarray] | None = None,
) -> SpaceScene:
    """The scene of a mechanism at a state; `shapes` are corners in local frames, by body."""
    pose = _poses(mechanism.anonymous, state)
    r, axes, centre = (np.asarray(x, float) for x in (pose.r, pose.axes, pose.centre))
    centres = (r + np.einsum("bij,bj->bi", axes, centre))[:-1]
    joints = [
        joint for group in range(len(mechanism.joints)) for joint in _joints(mechanism, group, r, axes, centres, view)
    ]
    of_body = by_body(joints)
    loads = tuple(
        load for stack in mechanism.loads for load in space_loads(mechanism, stack, state, (r, axes, centres), of_body)
    )
    loaded: dict[int, list[SpaceLoad]] = {}
    for load in loads:
        loaded.setdefault(load.i, []).append(load)
    names = mechanism.names.bodies
    spans = tuple(
        r[k] + np.asarray(shapes[name], float) @ axes[k].T
        if name in shapes
        else _span(k, centres[k], of_body.get(k, []), loaded.get(k, []))
        for k, name in enumerate(names)
    )
    acceleration = np.asarray(mechanism.gravity, float)
    return SpaceScene(
        names, centres, spans, tuple(joints), loads, acceleration, mechanism.names.units, view, not_unique, sides or {}
    )


@compiled
def _poses(mechanism: Mechanism, state: State) -> Pose:
    return mechanism.frame.motions(mechanism.body, state).pose


def joint_places(mechanism: Mechanism, state: State) -> np.ndarray:
    """Points of joints, and places within bodies, by which a view is chosen, (points, 3)."""
    stage = space_scene(mechanism, state, View(0.0, 0.0), {}, None)
    shares = (0.0, 0.35, 0.65)
    within = [span.mean(axis=0) + share * (span - span.mean(axis=0)) for span in stage.spans for share in shares]
    return np.concatenate([[joint.place for joint in stage.joints], *within])


def _joints(
    mechanism: Mechanism, group: int, r: np.ndarray, axes: np.ndarray, centres: np.ndarray, view: View
) -> list[SpaceJoint]:
    stack = mechanism.joints[group]
    element, bodies = stack.element, (np.asarray(stack.i), np.asarray(stack.j))
    ground = len(r) - 1
    on_i, on_j = (points_of(element.point_on(end), body, r, axes) for end, body in zip("ij", bodies, strict=True))
    if on_i is None or on_j is None:  # a joint of the user's: the bodies, or the one that moves, say where it is
        at = [centres[i if j == ground else j] for i, j in zip(*bodies, strict=True)]
        first = [centres[j if i == ground else i] for i, j in zip(*bodies, strict=True)]
        on_i, on_j = np.array(first if on_i is None else on_i), np.array(at if on_j is None else on_j)
    turns = [stacked(element.axes_on(end), (3, 3)) for end in "ij"]
    ends = [axes[body] if turn is None else axes[body] @ turn for turn, body in zip(turns, bodies, strict=True)]
    teeth, out = stacked(element.teeth, (2,)) if isinstance(element, Gear) else None, []
    radii = None
    if isinstance(element, AbstractOnPlane):
        radii = np.broadcast_to(np.asarray(getattr(element, "radius", 0.0), float), len(on_i))
        on_j = _touching(on_i, radii, *(end[:, :, 2] for end in ends))
    slides = "travel" in dict(element.coordinate_kinds)
    own = frozenset(name for name, _ in element.row_kinds), slides, bool(element.directions())
    for k, name in enumerate(mechanism.names.joints[group]):
        place = (on_i[k] + on_j[k]) / 2 if turns[0] is None or teeth is not None else on_i[k]
        out.append(
            SpaceJoint(
                name, type(element), int(bodies[0][k]), int(bodies[1][k]), on_i[k], on_j[k], ends[0][k], ends[1][k],
                place, view.flat(place), *own, None if teeth is None else teeth[k],
                None if radii is None else float(radii[k]),
            )
        )  # fmt: skip
    return out


def _touching(centres: np.ndarray, radii: np.ndarray, axles: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Lowest points of discs."""
    up = normals - np.sum(axles * normals, axis=1, keepdims=True) * axles
    return centres - radii[:, None] * up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-300)


def _span(body: int, centre: np.ndarray, joints: list[SpaceJoint], loads: list[SpaceLoad]) -> np.ndarray:
    """Points by which a moving body is connected, with its joints and loads, and its centre of mass."""
    points = [centre, *(joint.on_i for joint in joints if joint.i == body)]
    for joint in joints:
        if joint.j == body:  # what slides along an axis of the body is where it slides
            along = joint.axes_j[:, 2] * ((joint.on_i - joint.on_j) @ joint.axes_j[:, 2])
            slides = np.linalg.norm(joint.on_i - joint.on_j - along) <= 1e-6 * np.linalg.norm(along)
            points.append(joint.on_i if slides else joint.on_j)
    return np.array([*points, *(load.on_i for load in loads)])
