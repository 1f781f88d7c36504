"""How much of what is drawn a text would cover, by sums over the picture

    F(x, y) = integral of the weights of all boxes left of x and below y
    covered by a text on [x0, x1] x [y0, y1]:  F(x1, y1) - F(x0, y1) - F(x1, y0) + F(x0, y0)

F is exact on a grid, of a quarter of a point or a million cells, and linear between its lines, so that a text costs
four values however much is drawn.
"""

import itertools

import numpy as np

_CELL, _CELLS = 0.25, 1e6  # points, least size of a cell, and how many there are at most


class Coverage:
    """F of boxes (boxes, 5), each x0, y0, x1, y1 and weight, on the picture between two corners (2,), points."""

    def __init__(self, boxes: np.ndarray, lower: np.ndarray, upper: np.ndarray):
        self.cell = max(_CELL, float(np.sqrt(np.prod(upper - lower) / _CELLS)))
        self.lower, self.cells = lower, np.maximum(np.ceil((upper - lower) / self.cell).astype(int), 1)
        boxes, shape = boxes[np.isfinite(boxes).all(axis=1)], self.cells + 3
        flat, weights = [], []  # second differences of F
        edges = [self._at(boxes[:, side]) for side in (slice(0, 2), slice(2, 4))]
        for a, b, i, j in itertools.product((0, 1), repeat=4):
            (x, f), (y, g) = (tuple(part[:, axis] for part in edges[end]) for axis, end in enumerate((a, b)))
            flat.append((x + 1 + i) * shape[1] + y + 1 + j)
            weights.append((-1) ** (a + b) * np.abs(1 - i - f) * np.abs(1 - j - g) * boxes[:, 4])
        sums = np.bincount(np.concatenate(flat), np.concatenate(weights), minlength=int(np.prod(shape))).reshape(shape)
        for axis in (0, 0, 1, 1):
            sums = np.cumsum(sums, axis=axis)
        self.sums = sums * self.cell**2

    def _at(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cells that places are in, and where in them."""
        grid = np.clip((places - self.lower) / self.cell, 0.0, self.cells)
        cell = np.floor(grid).astype(int)
        return cell, grid - cell

    def _up_to(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        (i, j), (f, g) = (part.T for part in self._at(np.stack([x, y], axis=-1)))
        below = (1 - f) * self.sums[i, j] + f * self.sums[i + 1, j]
        return (1 - g) * below + g * ((1 - f) * self.sums[i, j + 1] + f * self.sums[i + 1, j + 1])

    def of(self, centres: np.ndarray, size: np.ndarray) -> np.ndarray:
        """What texts of a size (2,) about centres (texts, 2) would cover, (texts,)."""
        (x0, y0), (x1, y1) = (centres - size / 2).T, (centres + size / 2).T
        return self._up_to(x1, y1) - self._up_to(x0, y1) - self._up_to(x1, y0) + self._up_to(x0, y0)
