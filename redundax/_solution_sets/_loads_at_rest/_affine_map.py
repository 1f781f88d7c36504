"""Quantities that are linear in unknowns, with an offset."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class AffineMap(NamedTuple):
    """y = matrix x + offset."""

    matrix: np.ndarray
    offset: np.ndarray

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return self.matrix @ x + self.offset

    def along(self, ray: np.ndarray) -> np.ndarray:
        """The change of y along a ray."""
        return self.matrix @ ray

    def rows(self, rows: np.ndarray) -> "AffineMap":
        """Some of y."""
        return AffineMap(self.matrix[rows], self.offset[rows])

    def times(self, matrix: np.ndarray, offset: np.ndarray | float = 0.0) -> "AffineMap":
        """matrix y + offset."""
        return AffineMap(matrix @ self.matrix, matrix @ self.offset + offset)

    def over(self, sizes: np.ndarray) -> "AffineMap":
        """y in sizes of it."""
        return AffineMap(self.matrix / sizes[:, None], self.offset / sizes)

    def plus(self, other: "AffineMap") -> "AffineMap":
        """The sum of both."""
        return AffineMap(self.matrix + other.matrix, self.offset + other.offset)


def stacked(parts: Sequence[AffineMap]) -> AffineMap:
    """One below the other."""
    return AffineMap(np.concatenate([part.matrix for part in parts]), np.concatenate([part.offset for part in parts]))
