"""What stands on the ground: a grey pyramid under each joint and spring that is fixed to it, two under a rail."""

import numpy as np

from ...._bodies._body import GROUND
from ...._bodies._space._joints._drivers import TravelDriver
from ...._bodies._space._loads import TorsionSpring
from ._joint import SpaceJoint
from ._scene import SpaceScene
from ._solids import Solid, axes_of, box, cone, unit

_STAND = 15.0  # points, height


def stands(scene: SpaceScene, point: float) -> list[Solid]:
    """A pyramid at each place that is fixed to the ground."""
    out: list[Solid] = []
    found: list[np.ndarray] = []
    sides = scene.sides or stand_sides(scene)
    for joint in scene.joints:
        if joint.name not in sides:
            continue
        own, away = joint.on_i if joint.i == scene.ground else joint.on_j, sides[joint.name]
        is_rail, lift = joint.slides and joint.j == scene.ground, 3.0 * _on_table(joint)
        for at in rail_ends(scene, joint, point) if is_rail else (own,):
            if np.all(np.linalg.norm(np.array(found).reshape(-1, 3) - at, axis=1) >= point):
                found.append(at)
                out += _stand(at + lift * point * away, away, point * (0.7 if is_rail else 1.0))
    for load in scene.loads:
        if load.to_ground and load.kind is not TorsionSpring:
            out += _stand(load.on_j, -np.eye(3)[scene.view.vertical], point)
    return out


def stand_sides(scene: SpaceScene) -> dict[str, np.ndarray]:
    """For each joint that stands on the ground from where: square to its axis and away from the body, down if it may
    be, along one of the global axes.
    """
    down, out = -np.eye(3)[scene.view.vertical], {}
    sides = [down, *(sign * way for way in np.eye(3) for sign in (-1.0, 1.0))]
    for joint in scene.joints:
        body = joint.i if joint.j == scene.ground else joint.j
        if scene.ground in (joint.i, joint.j) and joint.teeth is None and joint.radius is None:
            axis = joint.axes_j[:, 2] * joint.reads_axis
            away = unit(scene.spans[body].mean(axis=0) - joint.place) if body < scene.ground else -down
            free = [side for side in sides if abs(side @ axis) < 0.6 and side @ away < 0.6]
            out[joint.name] = -joint.axes_j[:, 2] if _on_table(joint) else (free or [down])[0]
    return out


def _on_table(joint: SpaceJoint) -> bool:
    across, along, _, _ = joint.parts
    return along and not across and joint.kind is not TravelDriver


def _stand(at: np.ndarray, away: np.ndarray, point: float) -> list[Solid]:
    foot, name = at + _STAND * point * away, f"body {GROUND}"
    plate = box(foot, _turned(away), (17 * point, 17 * point, 2.5 * point), "#8A8A8A", name=name)
    return [cone(foot, at, 8.5 * point, 1.5 * point, "#C9C9C9", 4, name=name), plate]


def _turned(axis: np.ndarray) -> np.ndarray:
    """Axes of a box whose corners are those of a pyramid of four sides."""
    axes, c = axes_of(axis), np.sqrt(0.5)
    return axes @ np.array([[c, -c, 0.0], [c, c, 0.0], [0.0, 0.0, 1.0]])


def rail_ends(scene: SpaceScene, joint: SpaceJoint, point: float) -> tuple[np.ndarray, np.ndarray]:
    """Ends of what a joint slides along."""
    axis, place = joint.axes_j[:, 2], joint.place
    along = np.array([0.0, (joint.on_j - place) @ axis])
    return place + (along.min() - 24 * point) * axis, place + (along.max() + 24 * point) * axis
