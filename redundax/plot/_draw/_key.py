"""The key above a drawing: what length is what force, and gravity.

It has a strip of its own at the top of the axes. Where they are narrow, gravity moves below the arrows and words
are left out.
"""

import numpy as np

from ._arrows import LONGEST, Arrows
from ._pen import Pen, arrow
from ._scene import Scene
from ._style import APPLIED, FONT, LABEL_Z, quantity

_ROW, _GRAVITY = 15.0, 26.0  # points, heights
_LETTER = 0.62 * FONT  # points, a bound on the mean width of a letter


def key_height(groups: list[Arrows], scene: Scene, room: float) -> float:
    """Points that the key takes in axes `room` points wide."""
    rows, weight = _ROW * len(_keys(groups)), _GRAVITY * (scene.weight > 0)
    height = max(rows, weight) if _abreast(groups, scene, room) else rows + weight
    return height + (8.0 if height else 0.0)


def draw_key(pen: Pen, groups: list[Arrows], scene: Scene) -> None:
    """Draw the key: a force of round size for each look at the upper left, gravity at the upper right."""
    (left, right), top = pen.axes.get_xlim(), pen.axes.get_ylim()[1]
    room = float(right - left) / pen.point
    keys, gravity = _keys(groups), scene.flat(scene.gravity)
    for row, group in enumerate(keys):
        size, look = round_size(0.6 * group.largest()), group.look
        start = np.array([left + 8.0 * pen.point, top - (12.0 + _ROW * row) * pen.point])
        end = start + np.array([size * (group.scale or 0.0), 0.0])
        corners = arrow(start, end, 2.4 * pen.point)
        pen.polygon(corners, z=LABEL_Z, gid=f"{look.gid} key", **look.style)
        text = look.text if _length(group) < room else look.text.split(" on ")[0]
        told = f"{quantity(size, scene.units.of('force'))}: {text}"
        pen.write(end + np.array([5.0 * pen.point, 0.0]), told, "key", "left")
    if scene.weight > 0:
        above = 0.0 if _abreast(groups, scene, room) else _ROW * len(keys)
        along = gravity / scene.weight * 11.0 * pen.point
        centre = np.array([right - 14.0 * pen.point, top - (17.0 + above) * pen.point])
        if np.hypot(*along) > pen.point:  # else it is seen end-on
            corners = arrow(centre - along, centre + along, 1.4 * pen.point)
            pen.polygon(corners, APPLIED, "none", LABEL_Z, gid="gravity")
        pen.write(centre - np.array([13.0 * pen.point, 0.0]), _weight(scene), "key", "right")


def _keys(groups: list[Arrows]) -> list[Arrows]:
    return [group for group in groups if group.look.text and group.largest() > 0]


def _abreast(groups: list[Arrows], scene: Scene, room: float) -> bool:
    """Whether gravity has room beside the arrows."""
    longest = max((_length(group) for group in _keys(groups)), default=0.0)
    return longest + (35.0 + _LETTER * len(_weight(scene)) if scene.weight > 0 else 0.0) < room


def _length(group: Arrows) -> float:
    return 13.0 + 0.6 * LONGEST + _LETTER * (len(group.look.text) + 8)


def _weight(scene: Scene) -> str:
    return f"g = {quantity(scene.weight, scene.units.of('linear', 2))}"


def round_size(size: float) -> float:
    """The largest of 1, 2, 5, 10, ... that is not above `size`."""
    power = 10.0 ** np.floor(np.log10(size))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= size * (1 + 1e-9)))
