"""How much of what is drawn a text would cover, by sums over the picture

    F(x, y) = integral of the weights of all boxes left of x and below y
    covered by a text on [x0, x1] x [y0, y1]:  F(x1, y1) - F(x0, y1) - F(x1, y0) + F(x0, y0)

F is exact on a grid and linear between its lines, so that a text costs four values however much is drawn.
"""

import numpy as np

_CELL = 1.0  # points


class Coverage:
    """F of boxes (boxes, 5), each x0, y0, x1, y1 and weight, on the picture between two corners (2,), points."""

    def __init__(self, boxes: np.ndarray, lower: np.ndarray, upper: np.ndarray):
        self.lower, self.cells = lower, np.maximum(np.ceil((upper - lower) / _CELL).astype(int), 1)
        shape = self.cells + 3
        second = np.zeros(int(np.prod(shape)))
        edges = [self._at(boxes[:, side]) for side in (slice(0, 2), slice(2, 4))]
        for a, x in enumerate(edges):
            for b, y in enumerate(edges):
                place, share = np.stack([x[0][:, 0], y[0][:, 1]], 1), np.stack([x[1][:, 0], y[1][:, 1]], 1)
                for i in (0, 1):
                    for j in (0, 1):
                        part = np.abs(1 - i - share[:, 0]) * np.abs(1 - j - share[:, 1])
                        flat = (place[:, 0] + 1 + i) * shape[1] + place[:, 1] + 1 + j
                        weights = (-1) ** (a + b) * part * boxes[:, 4]
                        second += np.bincount(flat, weights, minlength=second.size)
        sums = second.reshape(shape)
        for axis in (0, 0, 1, 1):
            sums = np.cumsum(sums, axis=axis)
        self.sums = sums * _CELL**2

    def _at(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cells that places are in, and where in them."""
        grid = np.clip((places - self.lower) / _CELL, 0.0, self.cells)
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
