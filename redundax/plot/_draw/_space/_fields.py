"""Numbers of stacked elements in NumPy, where they are there."""

from typing import Any

import numpy as np


def stacked(value: Any, shape: tuple[int, ...]) -> np.ndarray | None:
    """Values of stacked elements with a leading axis over them, if they are there in that shape."""
    return np.asarray(value, float) if value is not None and np.shape(value)[1:] == shape else None


def points_of(local: Any, bodies: np.ndarray, r: np.ndarray, axes: np.ndarray) -> np.ndarray | None:
    """Global points of bodies, of which the local ones are given."""
    local = stacked(local, (3,))
    return None if local is None else r[bodies] + np.einsum("bij,bj->bi", axes[bodies], local)
