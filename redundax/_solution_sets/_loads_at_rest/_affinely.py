"""Quantities that are linear in unknowns, with an offset."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Affinely(NamedTuple):
    """y = matrix x + offset."""

    matrix: np.ndarray
    offset: np.ndarray

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return self.matrix @ x + self.offset

    def rows(self, rows: np.ndarray) -> "Affinely":
        """Some of y."""
        return Affinely(self.matrix[rows], self.offset[rows])

    def times(self, matrix: np.ndarray, offset: np.ndarray | float = 0.0) -> "Affinely":
        """matrix y + offset."""
        return Affinely(matrix @ self.matrix, matrix @ self.offset + offset)

    def over(self, sizes: np.ndarray) -> "Affinely":
        """y in sizes of it."""
        return Affinely(self.matrix / sizes[:, None], self.offset / sizes)

    def plus(self, other: "Affinely") -> "Affinely":
        """The sum of both."""
        return Affinely(self.matrix + other.matrix, self.offset + other.offset)


def stacked(parts: Sequence[Affinely]) -> Affinely:
    """One below the other."""
    return Affinely(np.concatenate([part.matrix for part in parts]), np.concatenate([part.offset for part in parts]))
