"""Strokes in data coordinates whose sizes are points of print

    1 point of print = `point` / `symbol` metres on the drawing

so symbols look alike at every scale of the mechanism. Where it is dense, all are drawn smaller by the factor `symbol`;
sizes below are points before that.
"""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from ._style import FONT, GROUND, GROUND_Z, INK, LABEL_Z

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Style(TypedDict):
    """Colours of a closed shape, and the width of its edge in points."""

    fill: str
    edge: str
    linewidth: float


@dataclasses.dataclass
class Pen:
    """Draws on matplotlib axes; `point` is the size of a point in data units, after the factor `symbol`."""

    axes: "Axes"
    point: float
    symbol: float = 1.0

    def polygon(
        self,
        corners: np.ndarray,
        fill: str | tuple[str, float] = "none",
        edge: str = INK,
        z: float = 1.0,
        *,
        linewidth: float = 1.0,
        linestyle: str = "-",
        gid: str | None = None,
    ) -> None:
        """A closed shape; `fill` may have an opacity beside its colour."""
        from matplotlib.patches import Polygon

        patch = Polygon(corners, closed=True, facecolor=fill, edgecolor=edge, zorder=z, linestyle=linestyle, gid=gid)
        patch.set(joinstyle="round", linewidth=self.symbol * linewidth)
        self.axes.add_artist(patch)

    def line(
        self,
        points: np.ndarray | Sequence[np.ndarray],
        colour: str = INK,
        z: float = 1.0,
        *,
        linewidth: float = 1.0,
        linestyle: str = "-",
        gid: str | None = None,
    ) -> None:
        """An open line."""
        from matplotlib.lines import Line2D

        (x, y), style = np.asarray(points).T, {"linestyle": linestyle, "solid_capstyle": "round", "gid": gid}
        self.axes.add_artist(Line2D(x, y, linewidth=self.symbol * linewidth, color=colour, zorder=z, **style))

    def circle(
        self,
        centre: np.ndarray,
        radius: float,
        fill: str = "white",
        edge: str = INK,
        z: float = 1.0,
        *,
        linewidth: float = 1.0,
        gid: str | None = None,
    ) -> None:
        """A circle; `radius` in points."""
        self.polygon(centre + radius * self.point * circle(48), fill, edge, z, linewidth=linewidth, gid=gid)

    def write(self, at: np.ndarray, text: str, gid: str, side: str = "center") -> None:
        """A text beside a place, or on it."""
        x, y = at.tolist()
        self.axes.text(x, y, text, fontsize=FONT, ha=side, va="center", zorder=LABEL_Z, gid=gid)

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

    def arrow(self, tail: np.ndarray, tip: np.ndarray, style: Style, z: float, gid: str) -> None:
        """A straight arrow; its polygon has the tip as fourth corner and the tail between the first and the last."""
        self.polygon(arrow(tail, tip, 2.4 * self.point), z=z, gid=gid, **style)

    def turn(self, centre: np.ndarray, radius: float, positive: bool, style: Style, z: float, gid: str) -> None:
        """A circular arrow of 270 degrees, counterclockwise where `positive`; `radius` in points."""
        self.polygon(turn(positive, radius) * self.point + centre, z=z, gid=gid, **style)


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


def hull(points: np.ndarray) -> np.ndarray:
    """Corners of the convex hull, counterclockwise (monotone chain)."""
    size = float(np.ptp(points, axis=0).max())
    unique = np.unique(np.round(points, 12 - int(np.floor(np.log10(size))) if size else 12), axis=0)
    if len(unique) < 3:
        return unique

    def chain(ordered: np.ndarray) -> list[np.ndarray]:
        corners: list[np.ndarray] = []
        for point in ordered:
            while len(corners) > 1:
                a, b = corners[-1] - corners[-2], point - corners[-2]
                if a[0] * b[1] - a[1] * b[0] > 1e-9 * size**2:
                    break
                corners.pop()
            corners.append(point)
        return corners[:-1]

    return np.array(chain(unique) + chain(unique[::-1]))
