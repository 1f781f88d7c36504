"""What one-sided contacts do over time, as bars, and impacts as marks."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from .._motion._trajectory import Trajectory
from .._system._contact import Contact
from ._solution_sets import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BARS = ((Contact.carries, 0.7, 1.0), (Contact.touches, 0.7, 0.3))  # what it does, its height and opacity


def contacts_over_time(panel: "Axes", others: "Iterable[Axes]", trajectory: Trajectory) -> None:
    """A row for each contact: filled while it carries, pale while it touches alone; impacts are triangles in the rows
    of contacts that they load, and lines in the other panels."""
    t, contacts = np.asarray(trajectory.t), trajectory.contacts
    reached = t <= float(trajectory.stats.end)
    edges = np.concatenate([t[:1], (t[1:] + t[:-1]) / 2, t[-1:]])
    for row, words in enumerate(contacts.values()):
        for does, height, opacity in _BARS:
            held = np.flatnonzero((words == str(does)) & reached)
            for run in np.split(held, np.flatnonzero(np.diff(held) > 1) + 1):
                if run.size:
                    begin, end = float(edges[run[0]]), float(edges[run[-1] + 1])
                    panel.broken_barh(
                        [(begin, end - begin)], (row - height / 2, height), color=COLOURS[0], alpha=opacity, linewidth=0
                    )
    impacts = trajectory.impacts
    if impacts is not None:
        count = int(np.isfinite(np.asarray(impacts.t)).sum())
        for time, impulses in zip(np.asarray(impacts.t)[:count], np.asarray(impacts.impulses)[:count], strict=True):
            rows = np.flatnonzero(impulses > 1e-9 * np.max(impulses, initial=0.0))
            panel.plot([time] * rows.size, rows, "v", color=COLOURS[1], markersize=5)
            for other in others:
                other.axvline(time, color="0.8", linewidth=0.6, zorder=0)
    panel.set_yticks(range(len(contacts)), list(contacts), fontsize=8)
    panel.set_ylim(len(contacts) - 0.4, -0.6)
