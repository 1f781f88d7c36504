"""Who draws a mechanism: by its frame, one for the plane and one for space."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ..._analysis._report import Report
from ..._bodies._mechanism import Mechanism
from ..._bodies._plane import Plane
from ..._bodies._reactions import joint_wrenches
from ..._bodies._space._loads import AppliedForce
from ..._system._state import State
from ..._tools._errors import RedundaxError
from ._arrows import Arrow, Arrows, draw_arrows, on_bodies
from ._bodies import draw_bodies
from ._labels import Label
from ._pen import Pen
from ._scene import Scene, scene
from ._space._arrows import draw_space_arrows, joint_arrows, space_arrow
from ._space._paint import draw_axes, paint
from ._space._scene import SpaceScene, joint_places, space_scene
from ._space._stands import stand_sides
from ._space._view import View, best_view
from ._stage import Artist
from ._symbols import applied_loads, draw_joints, draw_springs


class PlaneArtist:
    """Draws planar mechanisms."""

    margins = (54.0, 40.0, 14.0, 10.0)  # with room for the ticks

    def scene(self, mechanism: Mechanism, state: State) -> Scene:
        return scene(mechanism, state)

    def loads(self, stage: Scene, mechanism: Mechanism, state: State, multipliers: np.ndarray) -> list[Arrow]:
        return on_bodies(stage, joint_wrenches(mechanism, state, multipliers))

    def applied(self, stage: Scene) -> list[Arrow]:
        return [Arrow("", "", load.on_i, load.on_i, load.force, load.moment) for load in applied_loads(stage)]

    def dress(self, axes: Any, stage: Scene) -> None:
        unit = stage.units.of("linear")
        axes.set(**{f"{x}label": f"{x} ({unit})" if unit else x for x in "xy"})
        axes.ticklabel_format(scilimits=(-3, 5))
        axes.spines[["top", "right"]].set_visible(False)

    def surround(self, pen: Pen, stage: Scene, places: np.ndarray, ceiling: float) -> None:
        pass

    def paint(self, pen: Pen, stage: Scene, groups: list[Arrows]) -> tuple[list[np.ndarray], list[Label]]:
        outlines = draw_bodies(pen, stage)
        draw_joints(pen, stage)
        draw_springs(pen, stage)
        return outlines, draw_arrows(pen, stage, groups)


class SpaceArtist:
    """Draws spatial mechanisms, all frames from one view and on the same stands, those that suit the first."""

    margins = (8.0, 8.0, 8.0, 8.0)

    def __init__(
        self,
        mechanism: Mechanism,
        first: State,
        view: View,
        shapes: Mapping[str, Any],
        not_unique: frozenset[str] | None,
    ):
        stage = space_scene(mechanism, first, view, shapes, not_unique)
        self.options = {"view": view, "not_unique": not_unique, "sides": stand_sides(stage)}
        self.shapes = shapes

    def scene(self, mechanism: Mechanism, state: State) -> SpaceScene:
        return space_scene(mechanism, state, shapes=self.shapes, **self.options)

    def loads(self, stage: SpaceScene, mechanism: Mechanism, state: State, multipliers: np.ndarray) -> list[Arrow]:
        return joint_arrows(stage, mechanism, state, multipliers)

    def applied(self, stage: SpaceScene) -> list[Arrow]:
        given = [load for load in stage.loads if load.kind is AppliedForce]
        return [space_arrow(stage, "", "", load.on_i, load.force, load.moment) for load in given]

    def dress(self, axes: Any, stage: SpaceScene) -> None:
        axes.set_axis_off()

    def surround(self, pen: Pen, stage: SpaceScene, places: np.ndarray, ceiling: float) -> None:
        draw_axes(pen, stage, places, ceiling)

    def paint(self, pen: Pen, stage: SpaceScene, groups: list[Arrows]) -> tuple[list[np.ndarray], list[Label]]:
        return paint(pen, stage), draw_space_arrows(pen, stage, groups)


def artist_of(
    mechanism: Mechanism,
    states: Sequence[State],
    *,
    view: Sequence[float] | None = None,
    shapes: Mapping[str, Any] | None = None,
    not_unique: frozenset[str] | None = None,
) -> Artist:
    """The artist for a mechanism at these states."""
    if isinstance(mechanism.frame, Plane):
        for argument, value in (("view", view), ("shapes", shapes)):
            if value is not None:
                raise RedundaxError(
                    f"Argument `{argument}` must be left out for a planar mechanism, but is {value}. It is for "
                    "mechanisms of `rx.spatial`."
                )
        return PlaneArtist()
    places = [joint_places(mechanism, state) for state in states[:: len(states) // 6 + 1]]
    seen = best_view(places, np.asarray(mechanism.gravity, float), view)
    return SpaceArtist(mechanism, states[0], seen, _checked(mechanism, shapes or {}), not_unique)


def not_unique(report: Report | Collection[str] | None) -> frozenset[str] | None:
    """Names of the joints whose load is not unique, by a report or as they are."""
    if report is None:
        return None
    if not isinstance(report, Report):
        return frozenset(report)
    joints = {row.rpartition(".")[0] for row in report.rows}
    return frozenset(joints - set(report.unique_reactions))


def _checked(mechanism: Mechanism, shapes: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Corners of shapes by body."""
    bodies, out = mechanism.names.bodies, {}
    for name, corners in shapes.items():
        array = np.asarray(corners, float)
        if name not in bodies or array.ndim != 2 or array.shape[1] != 3 or len(array) < 2:
            known = f"has shape {array.shape}" if name in bodies else f"there is no such body among {', '.join(bodies)}"
            raise RedundaxError(
                f"Argument `shapes` must hold corners (corners, 3) in the local frame of a body, but for '{name}' "
                f'{known}. Give {{"{bodies[0]}": corners}}; the body drawn is their convex hull.'
            )
        out[name] = array
    return out
