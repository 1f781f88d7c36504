"""Pictures of a motion over time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..._motion._trajectory import Trajectory
from ..._system._names import Entry
from ..._system._system import AbstractSystem
from ..._tools._module import replace
from ._outputs import chosen
from ._plot import COLOURS, DASHES, finish, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_trajectory(system: AbstractSystem, trajectory: Trajectory, outputs: Sequence[str] | None = None) -> "Figure":
    """A motion over time, one panel for each unit.

    ??? example

        ```python
        crank = rx.mechanisms.parallelogram(3)
        motion = rx.simulate(crank, crank.state(0.5, rate=1.0), 0.2)
        figure = rx.plot_trajectory(crank, motion, ["crank 1.phi", "crank 1.phi'", "A1.x"])
        figure.savefig("motion.png")
        ```

    **Arguments:**

    - `system`, `trajectory`: as given to and by `simulate`.
    - `outputs`: names of what to draw, as in "1.phi", "1.phi'", "1.phi''" (m, rad and their rates), "A.x", "tau A" (N,
      N m); the first six positions that vary, angles first, if not given. Positions have names where there is one for
      each velocity; where not, velocities take their place.

    **Returns:** a matplotlib figure, which names SI units, also of a system `in_units`. Curves end where the motion
    did.

    **Raises:** `ValueError` for names that are not there.
    """

    named = replace(trajectory, names=system.names)

    def values(entry: Entry) -> np.ndarray:
        return np.asarray(named.entry(entry))

    wanted = chosen(named.entries, outputs, values)
    units = list(dict.fromkeys(output.unit for output in wanted))
    figure = new_figure(6.6, 2.0 * max(len(units), 1) + 0.5)
    if not units:
        figure.text(0.5, 0.5, "Nothing moves.", ha="center")
        return figure
    panels = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for panel, unit in zip(panels, units, strict=True):
        for k, output in enumerate(output for output in wanted if output.unit == unit):
            style = {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k % 4], "linewidth": 1.4}
            panel.plot(np.asarray(trajectory.t), values(output), label=output.name, **style)
        finish(panel, "", "")
        panel.set_ylabel(unit, fontsize=9)
        panel.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    panels[-1].set_xlabel("time, s", fontsize=9)
    return figure
