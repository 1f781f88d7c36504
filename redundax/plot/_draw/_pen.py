"""Strokes in data coordinates whose sizes are points of print, and a record of what they cover.

    1 point of print = `point` / `symbol` metres on the drawing

so symbols look alike at every scale of the mechanism, and names can keep clear of what is drawn already. Where a
mechanism is dense, all symbols are drawn smaller by the factor `symbol`; sizes below are points before that.
"""

import dataclasses
from typing import Any

import numpy as np

from ._style import GROUND, GROUND_Z, INK

Box = tuple[float, float, float, float, float]

HARD, OUTLINE = 20.0, 4.0


@dataclasses.dataclass
class Pen:
    """Draws on matplotlib axes. `boxes` are (x0, y0, x1, y1, weight), what a name should keep clear of.

    `point` is the size of a point in data units, after the factor `symbol`.
    """

    axes: Any
    point: float
    symbol: float = 1.0
    boxes: list[Box] = dataclasses.field(default_factory=list)

    def polygon(self, corners: np.ndarray, fill: str = "none", edge: str = INK, z: float = 1.0, **style: Any) -> None:
        """A closed shape; `opacity` is that of its fill."""
        from matplotlib.colors import to_rgba
        from matplotlib.patches import Polygon

        face = to_rgba(fill, style.pop("opacity", 1.0)) if fill != "none" else "none"
        style = {"joinstyle": "round", **style, "linewidth": self.symbol * style.get("linewidth", 1.0)}
        self.axes.add_artist(Polygon(corners, closed=True, facecolor=face, edgecolor=edge, zorder=z, **style))

    def line(self, points: Any, colour: str = INK, z: float = 1.0, **style: Any) -> None:
        """An open line."""
        from matplotlib.lines import Line2D

        points = np.asarray(points)
        style = {"solid_capstyle": "round", **style, "linewidth": self.symbol * style.get("linewidth", 1.0)}
        self.axes.add_artist(Line2D(points[:, 0], points[:, 1], color=colour, zorder=z, **style))

    def circle(self, centre: np.ndarray, radius: float, fill: str = "white", **style: Any) -> None:
        """A circle; `radius` in points."""
        self.polygon(centre + radius * self.point * circle(48), fill, **style)

    def box(self, centre: np.ndarray, along: np.ndarray, length: float, width: float, **style: Any) -> None:
        """A rectangle; `length` in direction `along` and `width` across it, in points."""
        a, b = along * length / 2 * self.point, across(along) * width / 2 * self.point
        self.polygon(np.array([centre + a + b, centre - a + b, centre - a - b, centre + a - b]), **style)

    def hatched(self, start: np.ndarray, end: np.ndarray, colour: str = GROUND) -> None:
        """A line of the ground from `start` to `end`, with hatching on its right side."""
        along = (end - start) / np.hypot(*(end - start))
        length = np.hypot(*(end - start)) / self.point
        step = length / max(round(length / 4.0), 1)
        slant = (-along - across(along)) * 4.0 * self.point
        for place in np.arange(step / 2, length, step):
            root = start + along * place * self.point
            self.line([root, root + slant], colour, GROUND_Z, linewidth=0.7)
        self.line([start, end], colour, GROUND_Z, linewidth=1.2)
        self.cover_line(start, end, 4.0, HARD)

    def arrow(self, tail: np.ndarray, tip: np.ndarray, width: float = 2.4, **style: Any) -> None:
        """A straight arrow; its polygon has the tip as fourth corner and the tail between the first and the last."""
        self.polygon(arrow(tail, tip, width * self.point), **style)
        self.cover_line(tail, tip, 6.0, HARD)

    def turn(self, centre: np.ndarray, radius: float, positive: bool, **style: Any) -> None:
        """A circular arrow of 270 degrees, counterclockwise where `positive`; `radius` in points."""
        self.polygon(turn(positive, radius) * self.point + centre, **style)
        self.cover(centre, radius + 3.0, HARD)

    def cover(self, centre: np.ndarray, radius: float, weight: float) -> None:
        """Names should keep clear of this circle; `radius` in points."""
        reach = 0.9 * radius * self.point
        self.boxes.append((centre[0] - reach, centre[1] - reach, centre[0] + reach, centre[1] + reach, weight))

    def cover_line(self, start: np.ndarray, end: np.ndarray, width: float, weight: float) -> None:
        """Names should keep clear of this line of `width` points."""
        step = 0.7 * width * self.point
        number = min(max(int(np.hypot(*(end - start)) / step), 1), 400)
        for share in np.linspace(0.0, 1.0, number + 1):
            self.cover(start + share * (end - start), width / 2, weight)

    def cover_path(self, corners: np.ndarray, width: float, weight: float) -> None:
        """Names should keep clear of this closed path of `width` points."""
        closed = np.concatenate([corners, corners[:1]])
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
        places = np.arange(0.0, lengths[-1], 0.8 * width * self.point)
        for place in zip(*(np.interp(places, lengths, values) for values in closed.T), strict=True):
            self.cover(np.array(place), width / 2, weight)


def circle(number: int) -> np.ndarray:
    """Corners on the unit circle, shape (number, 2)."""
    angle = np.linspace(0.0, 2 * np.pi, number, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def across(v: np.ndarray) -> np.ndarray:
    """v turned by +90 degrees."""
    return np.array([-v[1], v[0]])


def arrow(tail: np.ndarray, tip: np.ndarray, width: float) -> np.ndarray:
    """Corners of an arrow whose shaft has the given width, (7, 2); a short one is all head."""
    length = np.hypot(*(tip - tail))
    along = (tip - tail) / length
    head = min(4.0 * width, 0.8 * length)
    side, wing = across(along) * min(width, head / 3) / 2, across(along) * head * 0.4
    neck = tip - along * head
    return np.array([tail + side, neck + side, neck + wing, tip, neck - wing, neck - side, tail - side])


def turn(positive: bool, radius: float, width: float = 2.2) -> np.ndarray:
    """Corners of a circular arrow about the origin that leaves the quarter below open."""
    head = 7.0 / radius
    angle = np.linspace(-0.25 * np.pi, 1.25 * np.pi - head, 40)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    end = angle[-1]
    tip = radius * np.array([np.cos(end + head), np.sin(end + head)])
    wings = [(radius + side * 3.6) * ring[-1] for side in (1, -1)]
    corners = np.concatenate(
        [(radius + width / 2) * ring, [wings[0], tip, wings[1]], (radius - width / 2) * ring[::-1]]
    )
    return corners if positive else corners * np.array([-1.0, 1.0])
