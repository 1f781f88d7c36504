"""From where a mechanism is seen, and what pictures of one motion share

    (right, up, towards) = R p

A parallel projection, in which equal lengths along an axis stay equal: with the elevation over the horizontal plane and
the azimuth about the vertical, as in other programs. The plane is seen along z.
"""

import dataclasses
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from ..._analysis._report import Report
from ..._bodies._mechanism import Mechanism
from ..._tools._errors import RedundaxError
from ..._tools._module import Numbers

_POINTS = 400  # of a motion, by which a view is chosen: their distances are 400^2 numbers
_ELEVATIONS = (22.0, 30.0, 42.0)  # that are looked at: usual ones, the most usual first
_AZIMUTHS = (-60.0, -50.0, -35.0, -70.0, 25.0, 40.0, 55.0, -120.0, -140.0, 120.0, 140.0)


class View:
    """A projection; `axes` has the directions to the right, up and towards the viewer as rows, (3, 3)."""

    def __init__(self, elevation: float, azimuth: float, vertical: int = 2, is_flat: bool = False):
        e, a = np.radians([elevation, azimuth])
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        order = [(vertical + 1 + k) % 3 for k in range(3)]  # z of the view is the vertical one
        self.axes = np.zeros((3, 3))
        self.axes[:, order] = [right, np.cross(towards, right), towards]
        self.elevation, self.azimuth, self.vertical, self.is_flat = elevation, azimuth, vertical, is_flat

    def flat(self, p: np.ndarray) -> np.ndarray:
        """Places on the picture, (..., 2), of points or directions (..., 3)."""
        return p @ self.axes[:2].T

    def depth(self, p: np.ndarray) -> np.ndarray:
        """How near points are to the viewer."""
        return p @ self.axes[2]


PLANE = View(0.0, 0.0, vertical=1, is_flat=True)


@dataclasses.dataclass(frozen=True)
class Camera:
    """A view; corners of bodies by name, `shapes`; and joints whose load is not unique, None where nothing is said.

    `sides` are where from joints stand on the ground, by name, of the first state of a motion.
    """

    view: View
    shapes: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)
    not_unique: frozenset[str] | None = None
    sides: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)


OVER_PLANE = Camera(PLANE)


def not_unique(report: Report | Collection[str] | None) -> frozenset[str] | None:
    """Names of the joints whose load is not unique, by a report or as they are."""
    if report is None:
        return None
    if not isinstance(report, Report):
        return frozenset(report)
    joints = {row.rpartition(".")[0] for row in report.rows}
    return frozenset(joints - set(report.unique_reactions))


def refuse_in_plane(view: Sequence[float] | None, shapes: Mapping[str, Numbers] | None) -> None:
    """Refuse what pictures of planar mechanisms do not have."""
    for argument, value in (("view", view), ("shapes", shapes)):
        if value is not None:
            raise RedundaxError(
                f"Argument `{argument}` must be left out for a planar mechanism, but is {value}. It is for "
                "mechanisms of `rx.spatial`."
            )


def checked_shapes(mechanism: Mechanism, shapes: Mapping[str, Numbers]) -> dict[str, np.ndarray]:
    """Corners of shapes by body."""
    bodies, out = mechanism.names.bodies, {}
    for name, corners in shapes.items():
        array = np.asarray(corners, float)
        if name not in bodies or array.ndim != 2 or array.shape[1] != 3 or len(array) < 2:
            known = f"has shape {array.shape}" if name in bodies else f"there is no such body among {', '.join(bodies)}"
            raise RedundaxError(
                f"Argument `shapes` must hold corners (corners, 3) in the local frame of a body, but for '{name}' "
                f'{known}. Give {{"{bodies[0]}": corners}}; the body drawn is their convex hull.'
            )
        out[name] = array
    return out


def _checked_view(given: Sequence[float]) -> tuple[float, float]:
    """Elevation and azimuth as they were given."""
    array = np.asarray(given, float)
    if array.shape != (2,) or not np.all(np.isfinite(array)):
        raise RedundaxError(
            f"Argument `view` must be elevation and azimuth in degrees, but is {given}. Give (25, -60), say, or leave "
            "it out for one that shows all joints."
        )
    return float(array[0]), float(array[1])


def best_view(places: Sequence[np.ndarray], gravity: np.ndarray, given: Sequence[float] | None = None) -> View:
    """The view that was given, or that in which points, (points, 3) at each of some times, hide each other least."""
    vertical = int(np.argmax(np.abs(gravity))) if np.any(gravity) else 2
    if given is not None:
        return View(*_checked_view(given), vertical)
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
