"""Pictures of what another program printed over time, beside what the machine determines."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._check._report import OPEN, RIGHT, UNBALANCED, WRONG, LogReport
from .._system._names import index_of
from ._solution_sets import COLOURS, finish, shared_legend, stacked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST = 6  # loads that are drawn if none are named
_ORDER = (WRONG, UNBALANCED, OPEN, RIGHT)


def check(report: LogReport, loads: Sequence[str] | str | None = None) -> "Figure":
    """Loads of a log over time, one panel for each: the log, what is possible, and the share of it that is self-stress.

    Wrong loads come first. Where a load is determined, the dashed curve is what the machine determines; elsewhere it is
    the log's nearest possible load, and the grey area is what self-stress adds in it.

    ??? example

        ```python
        bar = rx.mechanisms.parallelogram()
        ts = jnp.linspace(0.0, 1.0, 21)
        run = rx.drive(bar, {"A1.angle": rx.Polynomial([0.8, 1.0])}, ts, bar.state(0.8).q)
        names = ["A1.angle", "A1.angle'", "A1.angle''", "A1 force x on crank 1"]
        rx.plot.check(rx.check(bar, {"t": ts, **{name: run[name] for name in names}}, q=run.q[0])).savefig("check.png")
        ```

    **Arguments:**

    - `report`: from `rx.check`.
    - `loads`: names of what to draw; the first six if not given, those that are wrong first.

    **Returns:** a matplotlib figure.

    **Raises:** `RedundaxError` for names that the log does not have.
    """
    stamps = list(report.stamps.values())
    if loads is None:
        sizes = np.abs(report.logged).max(axis=0)
        places = sorted(range(len(stamps)), key=lambda k: (_ORDER.index(stamps[k]), -sizes[k]))[:_MOST]
    else:
        names = [loads] if isinstance(loads, str) else loads
        places = [index_of("loads", name, report.names, " of the log") for name in names]
    figure, panels = stacked([1.9] * len(places), 0.9, "time, s")
    t, shown = report.t, report.judged
    for axes, k in zip(panels, places, strict=True):
        expected = np.where(shown, report.expected[:, k], np.nan)
        colour = COLOURS[1] if stamps[k] in (WRONG, UNBALANCED) else COLOURS[0]
        if stamps[k] in (OPEN, UNBALANCED):
            least = np.where(shown, report.expected[:, k] - report.stress[:, k], np.nan)
            axes.fill_between(t, least, expected, color="#999999", alpha=0.35, linewidth=0, label="self-stress")
        axes.plot(t, report.logged[:, k], color=colour, linewidth=1.6, label="log")
        axes.plot(t, expected, color="black", linewidth=1.0, linestyle=(0, (4, 3)), label="possible")
        finish(axes, f"{report.names[k]}: {stamps[k]}", "", report.units[k])
    shared_legend(figure, "outside upper center", 3)
    return figure
