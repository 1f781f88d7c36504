"""Fields of stacked elements in NumPy, where they are there."""

from typing import Any

import numpy as np


def field(element: Any, name: str, shape: tuple[int, ...]) -> np.ndarray | None:
    """A field of stacked elements with a leading axis over them, if it is there in that shape."""
    value = getattr(element, name, None)
    return np.asarray(value, float) if value is not None and np.shape(value)[1:] == shape else None


def points_of(element: Any, name: str, bodies: np.ndarray, r: np.ndarray, axes: np.ndarray) -> np.ndarray | None:
    """Global points of bodies, of which the local ones are a field."""
    local = field(element, name, (3,))
    return None if local is None else r[bodies] + np.einsum("bij,bj->bi", axes[bodies], local)
