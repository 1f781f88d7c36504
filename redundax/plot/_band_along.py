"""Pictures of bands along a path: what friction does with the direction of motion."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._solution_sets._band._band_along import BandPath
from .._system._names import index_of
from .._system._units import with_unit
from .._tools._errors import RedundaxError
from ._solution_sets import COLOURS, finish, shared_legend, stacked

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST = 6  # outputs that are drawn if none are named
_WAYS = {1: COLOURS[1], -1: COLOURS[0], 0: COLOURS[2]}
_REST = "#555555"


def band_along(path: BandPath, outputs: Sequence[str] | str | None = None, *, against: str | None = None) -> "Figure":
    """Bands along a path, one panel for each output: in motion as areas, at rest as bars.

    Motion one way, the other way and rest have colours of their own; against a coordinate the areas of both ways lie
    over each other and show the hysteresis. Dotted lines are outer bounds that lie apart. Crosses at the lower edge are
    states that cannot stand, or have no solution.

    ??? example

        ```python
        states = [mechanism.state(phi=phi, rate=0.1) for phi in (0.6, 0.8)]
        states += [mechanism.state(phi=phi, rate=-0.1) for phi in (0.8, 0.6)]
        path = rx.band_along(mechanism, states, ["A.x"], rx.AmplitudeBox({"A.x": (-40.0, 40.0)}), samples=32)
        rx.plot.band_along(path, against="1.phi").savefig("hysteresis.png")
        ```

    **Arguments:**

    - `path`: from `rx.band_along`.
    - `outputs`: names of what to draw; the first six if not given.
    - `against`: name of a coordinate, of a joint too; time if not given.

    **Returns:** a matplotlib figure.

    **Raises:** `ValueError` for names that are not there.
    """
    names = path.names[:_MOST] if outputs is None else [outputs] if isinstance(outputs, str) else outputs
    places = [index_of("outputs", name, path.names, " of the path") for name in names]
    coordinate, x, label = _across(path, against)
    figure, panels = stacked([2.2] * len(places), 0.9, label)
    for axes, k in zip(panels, places, strict=True):
        for said, run in path.runs(coordinate):
            rests = path.motion[run.start] == "rests"
            _run(axes, path, k, x, run, said, _REST if rests else _WAYS[int(path.directions(coordinate)[run.start])])
        _flags(axes, path, k, x)
        finish(axes, path.names[k], "", path.units[k])
    shared_legend(figure, "outside upper center", 3)
    return figure


def _across(path: BandPath, against: str | None) -> tuple[int | None, np.ndarray, str]:
    """The coordinate that tells the direction, what is drawn across, and its label."""
    if against is None:
        return path.leading, path.t, with_unit("time", path.time_unit)
    found = index_of("against", against, path.coordinates.labels, " of coordinates")
    if np.isnan(path.q[:, found]).any():
        raise RedundaxError(
            f"Argument `against` must name a coordinate that has {against!r} as its rate, but none has. Name one of a "
            "joint, such as 'hinge.angle', or leave it out: the bands are drawn over time."
        )
    return found, path.q[:, found], with_unit(against, path.coordinate_units[found])


def _run(axes: "Axes", path: BandPath, k: int, x: np.ndarray, run: slice, said: str, colour: str) -> None:
    """Successive states that do the same: an area, or bars where they rest or are one."""
    x, lower, upper = x[run], path.lower[run, k], path.upper[run, k]
    outer = path.outer_lower[run, k], path.outer_upper[run, k]
    if path.motion[run.start] in ("rests", "lifts") or len(x) == 1:
        axes.vlines(x, lower, upper, color=colour, linewidth=2.0, label=said)
        for end in (lower, upper):
            axes.plot(x, end, "_", color=colour, markersize=8, markeredgewidth=2.0)
    else:
        axes.fill_between(x, lower, upper, color=colour, alpha=0.3, linewidth=0)
        axes.plot(x, lower, color=colour, linewidth=1.4, label=said)
        axes.plot(x, upper, color=colour, linewidth=1.4)
    size = np.nanmax(np.abs([lower, upper]), initial=0.0)
    for own, end in zip(outer, (lower, upper), strict=True):
        if np.all(np.isfinite(own)) and np.any(np.abs(own - end) > 1e-3 * size):
            axes.plot(x, own, ":" if len(x) > 1 else "_", color=colour, linewidth=1.2, alpha=0.6)


def _flags(axes: "Axes", path: BandPath, k: int, x: np.ndarray) -> None:
    """States without a band."""
    gone = np.isnan(path.lower[:, k])
    words = {"no": "cannot stand", "undecided": "undecided whether it stands", None: "no solution", "yes": ""}
    words["slips"] = words[None]
    for word in dict.fromkeys(np.array(path.stands, object)[gone]):
        here = gone & (np.array(path.stands, object) == word)
        low = axes.get_xaxis_transform()
        axes.plot(x[here], np.full(here.sum(), 0.04), "x", color="black", transform=low, label=words[word])
