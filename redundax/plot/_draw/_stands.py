"""What stands on the ground: a grey pyramid under each joint and spring that is fixed to it, two under a rail."""

from typing import NamedTuple

import numpy as np

from ..._bodies._body import GROUND
from ..._bodies._space._joints._drivers import TravelDriver
from ._scene import TORSION, Joint, Scene
from ._solids import Solid, axes_of, box, cone, unit

_STAND = 15.0  # points, height
_REACH = 17.0  # points, of a rail beyond the block on it


class Stand(NamedTuple):
    """Where it carries something, the direction to its foot, and its size beside a usual one."""

    at: np.ndarray
    away: np.ndarray
    size: float = 1.0

    def solids(self, point: float) -> list[Solid]:
        """A pyramid on a plate."""
        point, name, c = self.size * point, f"body {GROUND}", np.sqrt(0.5)
        foot = self.at + _STAND * point * self.away
        turned = axes_of(self.away) @ np.array([[c, -c, 0.0], [c, c, 0.0], [0.0, 0.0, 1.0]])  # corners below corners
        plate = box(foot, turned, (17 * point, 17 * point, 2.5 * point), "#8A8A8A", name=name)
        return [cone(foot, self.at, 8.5 * point, 1.5 * point, "#C9C9C9", 4, name=name), plate]


def stands(scene: Scene, point: float) -> list[Stand]:
    """One at each place that is fixed to the ground; in the plane rails and floors are hatched instead."""
    out: list[Stand] = []
    sides = scene.camera.sides or stand_sides(scene)
    for joint in scene.joints:
        if joint.name not in sides:
            continue
        own, away = joint.on_i if joint.i == scene.ground else joint.on_j, sides[joint.name]
        is_rail, lift = joint.slides and joint.j == scene.ground, 3.0 * on_table(joint)
        if scene.is_flat and (is_rail or (on_table(joint) and joint.j == scene.ground)):
            continue
        for at in rail_ends(scene, joint, point) if is_rail else (own,):
            out.append(Stand(at + lift * point * away, away, 0.7 if is_rail else 1.0))
    down = -np.eye(3)[scene.camera.view.vertical]
    out += [Stand(load.on_j, down) for load in scene.loads if load.to_ground and load.kind not in TORSION]
    places = np.array([stand.at for stand in out]).reshape(-1, 3)
    return [stand for k, stand in enumerate(out) if np.all(np.linalg.norm(places[:k] - stand.at, axis=1) >= point)]


def stand_sides(scene: Scene) -> dict[str, np.ndarray]:
    """For each joint that stands on the ground from where: square to its axis and away from the body, down if it may
    be, along one of the global axes.
    """
    view, out = scene.camera.view, {}
    down, ways = -np.eye(3)[view.vertical], np.eye(3)[: 2 if scene.is_flat else 3]
    sides = [down, *([-down] if scene.is_flat else []), *(sign * way for way in ways for sign in (-1.0, 1.0))]
    for joint in scene.joints:
        body = joint.i if joint.j == scene.ground else joint.j
        if scene.ground in (joint.i, joint.j) and joint.has_point and not joint.mesh.circles and joint.radius is None:
            axis = joint.axes_j[:, 2] * joint.has_axis
            away = unit(scene.spans[body].mean(axis=0) - joint.place) if body < scene.ground else -down
            free = [side for side in sides if abs(side @ axis) < 0.6 and side @ away < 0.6]
            out[joint.name] = -joint.axes_j[:, 2] if on_table(joint) else (free or [down])[0]
    return out


def on_table(joint: Joint) -> bool:
    """Whether it slides square to its axis."""
    across, along, _, _ = joint.locks
    return along and not across and joint.kind is not TravelDriver


def rail_ends(scene: Scene, joint: Joint, point: float) -> tuple[np.ndarray, np.ndarray]:
    """Ends of what a joint slides along, in space as far as its point on body j."""
    axis, place = joint.axes_j[:, 2], joint.place
    travel = 0.0 if scene.is_flat else (joint.on_j - place) @ axis
    along, reach = np.array([0.0, travel]), _REACH * point + block_length(joint, point) / 2
    return place + (along.min() - reach) * axis, place + (along.max() + reach) * axis


def block_length(joint: Joint, point: float) -> float:
    """Length of a slider: its own where it has one, as long as that looks well."""
    return float(np.clip(joint.length or 0.0, 19.0 * point, 90.0 * point))
