"""Pictures of a motion over time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._motion._trajectory import Trajectory
from .._system._names import Entry
from .._system._system import AbstractSystem
from .._system._units import with_unit
from .._tools._module import replace_fields
from ._contacts import contacts_over_time
from ._outputs import chosen
from ._solution_sets import COLOURS, DASHES, finish, legend_beside, stacked, words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LINES = 9  # of a legend beside a panel, at most


def trajectory(system: AbstractSystem, trajectory: Trajectory, outputs: Sequence[str] | None = None) -> "Figure":
    """A motion over time, one panel for each kind of quantity.

    ??? example

        ```python
        crank = rx.mechanisms.parallelogram(3)
        motion = rx.simulate(crank, crank.state(0.5, rate=1.0), 0.2)
        figure = rx.plot.trajectory(crank, motion, ["crank 1.phi", "crank 1.phi'", "A1.x"])
        figure.savefig("motion.png")
        ```

    **Arguments:**

    - `system`, `trajectory`: as given to and by `simulate`.
    - `outputs`: names of what to draw, as in "1.phi", "1.phi'", "1.phi''", "A.x", "tau A"; the first six positions that
      vary, angles first, if not given. Positions have names where velocities are their rates; where not,
      velocities take their place.

    One-sided contacts have a panel of their own: a bar while one carries, a pale one while it touches alone, and a
    triangle for each impact that loads it, which is a line in the other panels.

    **Returns:** a matplotlib figure, with the units that the system states. Curves end where the motion did.

    **Raises:** `ValueError` for names that are not there.
    """

    named = replace_fields(trajectory, names=system.names)

    def values(entry: Entry) -> np.ndarray:
        return np.asarray(named.entry(entry))

    wanted = chosen(named.entries, outputs, values)
    groups = [[one for one in wanted if one.dimension == each] for each in dict.fromkeys(x.dimension for x in wanted)]
    contacts = named.contacts
    if not groups and not contacts:
        return words("Nothing moves.")
    heights = [2.0] * len(groups) + ([0.25 * len(contacts) + 0.25] if contacts else [])
    figure, panels = stacked(heights, 0.5, with_unit("time", system.names.units.of("time")))
    for panel, group in zip(panels, groups, strict=False):
        for k, output in enumerate(group):
            style = {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k % 4], "linewidth": 1.4}
            panel.plot(np.asarray(trajectory.t), values(output), label=output.name, **style)
        finish(panel, "", "", group[0].unit)
        legend_beside(panel, 1 + (len(group) - 1) // _LINES)
    if contacts:
        finish(panels[-1])
        contacts_over_time(panels[-1], panels[:-1], named)
    return figure
