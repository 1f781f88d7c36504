"""Names placed so that they cover nothing

    cost = ink of the picture below the text + distance from the preferred place

over candidates around each name's object, greedily in the order of the names and then three times more with all others
placed. A name that would still cover another one is left out. Everything is measured in points of print.
"""

import dataclasses
from typing import TYPE_CHECKING, cast

import numpy as np

from ._pen import Pen, circle
from ._style import FONT, GROUND, INK, LABEL_Z

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.text import Text

_BLACK = 20.0  # cost of covering a square point of black, as of moving the text by so many points
_LIGHT, _DARK = 0.2, 0.5  # shares of black of fills, which may be covered, and of what counts whole: lines and arrows
_TEXT = 100.0  # cost of covering another text: five times that of a symbol, so that none ever is
PATIENCE = 40.0 * _BLACK  # of a text that may be left out
_LEAST = 7.0  # points, the smallest font
_GAPS = (2.0, 7.0, 14.0, 24.0, 38.0)  # points from what is named, up to three lines of text
_PAD = np.array([5.0, 2.5])  # points around a text: a letter's space, and less between lines


@dataclasses.dataclass(frozen=True)
class Label:
    """A text to place: `anchors` (places, 2) with outward `normals` (places, 2), and what each costs, in points.

    `inside` are places where it may stand centred. Lower ranks come first. It is left out where every place costs more
    than `patience`.
    """

    text: str
    gid: str
    anchors: np.ndarray
    normals: np.ndarray
    costs: np.ndarray
    inside: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 2)))
    colour: str = INK
    weight: str = "normal"
    style: str = "normal"
    rank: int = 0
    patience: float = np.inf


def around(
    pen: Pen, centre: np.ndarray, clearance: float, towards: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Anchors, normals and costs on a circle of `clearance` points about a centre.

    Those `towards` a direction, the upper right if not given, cost least.
    """
    ring = circle(24)
    towards = np.array([0.6, 0.8]) if towards is None else towards / np.hypot(*towards)
    return centre + clearance * pen.point * ring, ring, 4.0 * (1.0 - ring @ towards)


class _Ink:
    """How dark the picture is between two corners (2,), points: sums over its pixels from the lower left on."""

    def __init__(self, pen: Pen, lower: np.ndarray, upper: np.ndarray):
        from matplotlib.backends.backend_agg import RendererAgg

        figure, window = cast("Figure", pen.axes.get_figure(root=True)), pen.axes.get_window_extent()
        renderer = RendererAgg(*figure.bbox.size, figure.dpi)
        pen.axes.draw(renderer)  # the axes alone: nobody is told of a drawing of the figure
        x0, y0, x1, y1 = np.maximum(np.round(window.extents).astype(int), 0)
        pixels = np.asarray(renderer.buffer_rgba())[::-1][y0:y1, x0:x1] / 255.0
        dark = pixels[..., 3] * (1.0 - pixels[..., :3] @ [0.2126, 0.7152, 0.0722])  # luminance of sRGB, Rec. 709
        self.lower, self.most = lower, np.array(dark.shape[::-1])
        self.pixel = (upper - lower) / self.most  # points
        weights = _BLACK * np.clip((dark.T - _LIGHT) / (_DARK - _LIGHT), 0.0, 1.0)
        self.sums = np.pad(np.cumsum(np.cumsum(weights, axis=0), axis=1), ((1, 0), (1, 0)))

    def below(self, centres: np.ndarray, size: np.ndarray) -> np.ndarray:
        """What texts of a size (2,) about centres (texts, 2) would cover, (texts,)."""
        low, high = (
            np.clip(np.round((centres + side * size / 2 - self.lower) / self.pixel).astype(int), 0, self.most)
            for side in (-1, 1)
        )
        (x0, y0), (x1, y1), sums = low.T, high.T, self.sums
        return (sums[x1, y1] - sums[x0, y1] - sums[x1, y0] + sums[x0, y0]) * np.prod(self.pixel)


def place(pen: Pen, labels: list[Label], ceiling: float) -> None:
    """Put the labels where they are out of the way, and below the height `ceiling`."""
    if not labels:
        return
    axes = pen.axes
    lower, upper = np.array([axes.get_xlim(), axes.get_ylim()]).T / pen.point
    ink = _Ink(pen, lower, upper)
    upper[1] = ceiling / pen.point
    texts = [_text(pen, label) for label in labels]
    sizes = [_size(pen, text) for text in texts]
    candidates = [_candidates(label, size, pen.point) for label, size in zip(labels, sizes, strict=True)]
    fixed = [_costs(found, size, ink, lower, upper) for found, size in zip(candidates, sizes, strict=True)]
    reach = np.array(
        [
            [*(centres.min(axis=0) - size / 2), *(centres.max(axis=0) + size / 2)]
            for (centres, _), size in zip(candidates, sizes, strict=True)
        ]
    ).reshape(-1, 4)
    # Joints, then bodies, and among them those first that have few good places; then values.
    freedom = [
        int((cost < cost.min() + 10.0).sum()) * (label.rank < 2) for cost, label in zip(fixed, labels, strict=True)
    ]
    order = sorted(range(len(labels)), key=lambda k: (labels[k].rank, freedom[k]))
    taken = np.full((len(labels), 4), np.nan)  # the boxes of texts; NaN of those that have no place
    for _ in range(4):
        for k in order:
            centres = candidates[k][0]
            near = np.all((taken[:, :2] < reach[k, 2:]) & (taken[:, 2:] > reach[k, :2]), axis=1)
            near[k] = False
            covered = _overlap(centres, sizes[k], taken[near])
            best = int(np.argmin(fixed[k] + covered))
            crowded = covered[best] > 0 or fixed[k][best] > labels[k].patience
            taken[k] = np.nan if crowded else [*(centres[best] - sizes[k] / 2), *(centres[best] + sizes[k] / 2)]
    for label, text, size, box in zip(labels, texts, sizes, taken, strict=True):
        centre = (box[:2] + box[2:]) / 2
        if np.isnan(centre[0]):
            text.remove()
            continue
        text.set_position(tuple(centre * pen.point))
        _leader(pen, label, centre, size)


def _text(pen: Pen, label: Label) -> "Text":
    from matplotlib.patheffects import withStroke

    text = pen.axes.text(
        0.0,
        0.0,
        label.text,
        fontsize=max(FONT * pen.symbol, _LEAST),
        color=label.colour,
        fontweight=label.weight,
        fontstyle=label.style,
        ha="center",
        va="center",
        zorder=LABEL_Z,
        gid=label.gid,
        parse_math=False,
    )
    text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    return text


def _size(pen: Pen, text: "Text") -> np.ndarray:
    extent = text.get_window_extent()
    return np.array([extent.width, extent.height]) * 72.0 / pen.axes.figure.dpi / pen.symbol + _PAD


def _candidates(label: Label, size: np.ndarray, point: float) -> tuple[np.ndarray, np.ndarray]:
    """Centres in points (candidates, 2) and what their distance costs (candidates,)."""
    slopes = np.maximum(np.abs(label.normals), 1e-9)
    near, clear = np.min(size / 2 / slopes, axis=1), (slopes * size / 2).sum(axis=1)
    centres, costs = [label.inside / point], [np.zeros(len(label.inside))]
    for gap in _GAPS:
        for reach in (near, clear):  # the box touches the anchor's ray, or the line across it
            centres.append(label.anchors / point + label.normals * (reach + gap)[:, None])
            costs.append(gap + 0.2 * (reach - near) + label.costs)
    return np.concatenate(centres), np.concatenate(costs)


def _costs(
    candidates: tuple[np.ndarray, np.ndarray], size: np.ndarray, ink: _Ink, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    centres, costs = candidates
    outside = np.maximum(lower - (centres - size / 2), 0) + np.maximum(centres + size / 2 - upper, 0)
    return costs + ink.below(centres, size) + 1e4 * outside.sum(axis=1)


def _overlap(centres: np.ndarray, size: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Weighted area that a text of `size` at each of the centres shares with other texts' boxes (texts, 4)."""
    shared = np.ones((len(centres), len(boxes)))
    for axis in (0, 1):
        middle, half = centres[:, axis, None], size[axis] / 2
        overlap = np.minimum(middle + half, boxes[:, 2 + axis]) - np.maximum(middle - half, boxes[:, axis])
        shared *= np.maximum(overlap, 0.0)
    return _TEXT * shared.sum(axis=1)


def _leader(pen: Pen, label: Label, centre: np.ndarray, size: np.ndarray) -> None:
    """A thin line to a name that had to go far away."""
    anchors = label.anchors / pen.point
    near = anchors[np.argmin(np.hypot(*(anchors - centre).T))]
    edge = np.clip(near, centre - size / 2, centre + size / 2)
    if np.hypot(*(near - edge)) > 12.0:
        pen.line(np.array([near, edge]) * pen.point, GROUND, LABEL_Z - 0.1, linewidth=0.6)
