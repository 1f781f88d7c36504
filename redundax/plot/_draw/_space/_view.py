"""From where a picture in space is seen: a parallel projection, in which equal lengths along an axis stay equal

    (right, up, towards) = R p

with the elevation over the horizontal plane and the azimuth about the vertical, as in other programs.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...._tools._errors import RedundaxError

_POINTS = 400
_ELEVATIONS = (22.0, 30.0, 42.0)
_AZIMUTHS = (-60.0, -50.0, -35.0, -70.0, 25.0, 40.0, 55.0, -120.0, -140.0, 120.0, 140.0)


class View:
    """A projection; `axes` has the directions to the right, up and towards the viewer as rows, (3, 3)."""

    def __init__(self, elevation: float, azimuth: float, vertical: int = 2):
        e, a = np.radians([elevation, azimuth])
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        order = [(vertical + 1 + k) % 3 for k in range(3)]  # z of the view is the vertical one
        self.axes = np.zeros((3, 3))
        self.axes[:, order] = [right, np.cross(towards, right), towards]
        self.elevation, self.azimuth, self.vertical = elevation, azimuth, vertical

    def flat(self, p: np.ndarray) -> np.ndarray:
        """Places on the picture, (..., 2), of points or directions (..., 3)."""
        return p @ self.axes[:2].T

    def depth(self, p: np.ndarray) -> Any:
        """How near points are to the viewer."""
        return p @ self.axes[2]


def checked_view(given: Any) -> tuple[float, float]:
    """Elevation and azimuth as they were given."""
    array = np.asarray(given, float)
    if array.shape != (2,) or not np.all(np.isfinite(array)):
        raise RedundaxError(
            f"Argument `view` must be elevation and azimuth in degrees, but is {given}. Give (25, -60), say, or leave "
            "it out for one that shows all joints."
        )
    return float(array[0]), float(array[1])


def best_view(places: Sequence[np.ndarray], gravity: np.ndarray, given: Any = None) -> View:
    """The view that was given, or that in which points, (points, 3) at each of some times, hide each other least."""
    vertical = int(np.argmax(np.abs(gravity))) if np.any(gravity) else 2
    if given is not None:
        return View(*checked_view(given), vertical)
    views = [View(elevation, azimuth, vertical) for elevation in _ELEVATIONS for azimuth in _AZIMUTHS]
    return max(views, key=lambda view: sum(_openness(view, points) for points in places))


def _openness(view: View, points: np.ndarray) -> float:
    """How well points, of many a sample, are told apart, with a preference for the usual views, which come first."""
    points = points[:: -(-len(points) // _POINTS)]
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
    size = gaps.max() or 1.0
    flat = view.flat(points)
    apart = gaps > 1e-2 * size
    seen = np.linalg.norm(flat[:, None] - flat[None], axis=2)[apart] / np.minimum(gaps[apart], 0.25 * size)
    spread = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False) / size
    rank = _AZIMUTHS.index(view.azimuth) + 4 * _ELEVATIONS.index(view.elevation)
    nearest = min(float(seen.min(initial=np.inf)), 0.6)
    return 0.4 * nearest + 0.3 * float(spread[-1]) / np.sqrt(len(points)) - 0.004 * rank
