"""Pictures of what drives must give over time."""

from typing import TYPE_CHECKING

import numpy as np

from .._drive._run import Run
from .._system._units import with_unit
from ._solution_sets import COLOURS, DASHES, finish, legend_beside, stacked

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def drive(run: Run) -> "Figure":
    """Forces and power of drives over time, one panel for each kind.

    Where a joint rests bars show the forces between which the machine stays, and curves jump from the force with which
    the motion came to rest to that with which it goes on. Dotted curves are those that the closure decides, as the
    rigid machine leaves them open.

    ??? example

        ```python
        smooth = rx.mechanisms.wojtyra2020()
        run = rx.drive(smooth, {"A.angle": rx.Polynomial([0.8, 1.0])}, jnp.linspace(0.0, 1.0, 11), state.q)
        rx.plot.drive(run).savefig("drive.png")
        ```

    **Arguments:**

    - `run`: from `drive`.

    **Returns:** a matplotlib figure, with the units that the machine states.
    """
    units = run.names.units if run.names is not None else None
    kinds = [turns for turns in (True, False) if any(drive.turns is turns for drive in run.drives)]
    figure, panels = stacked([2.2] * (len(kinds) + 1), 0.4, with_unit("time", units.of("time") if units else ""))
    t, powers = np.asarray(run.t), np.asarray(run.powers)
    for k, drive in enumerate(run.drives):
        panel, (low, high) = panels[kinds.index(drive.turns)], np.asarray(run.stays)[:, k].T
        certain = np.asarray(run.determined)[:, k].all()
        style = {"color": COLOURS[k % len(COLOURS)], "linestyle": "-" if certain else DASHES[3], "linewidth": 1.6}
        panel.plot(*_curve(t, np.asarray(run.forces_before)[:, k], np.asarray(run.forces)[:, k], low), **style)
        panel.plot([], [], label=drive.name, **style)
        panel.fill_between(t, low, high, color=style["color"], alpha=0.25, linewidth=0)
        alone = np.convolve(np.isfinite(low), [1, 1, 1], mode="same") == 1
        panel.vlines(t[alone], low[alone], high[alone], color=style["color"], alpha=0.25, linewidth=2)
        panels[-1].plot(t, powers[:, k], label=drive.name, **style)
    for panel, turns in zip(panels, kinds, strict=False):
        word, kind = ("torque", "moment") if turns else ("force", "force")
        panel.set_ylabel(with_unit(word, units.of(kind) if units else ""), fontsize=9)
    is_si = units is not None and (units.of("force"), units.of("linear"), units.of("time")) == ("N", "m", "s")
    panels[-1].set_ylabel("power, W" if is_si else "power", fontsize=9)
    for panel in panels:
        finish(panel)
        panel.axhline(0.0, color="#999999", linewidth=0.6, zorder=0)
        legend_beside(panel)
    return figure


def _curve(t: np.ndarray, before: np.ndarray, after: np.ndarray, stays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of a curve that leaves out what lies between the first and the last instant of a rest."""
    rests = np.isfinite(stays)
    goes_on = np.append(rests[1:] & rests[:-1], False)
    came = np.insert(goes_on[:-1], 0, False)
    gap = np.where(goes_on | came, np.nan, before)
    values = np.stack([np.where(came, np.nan, before), gap, np.where(goes_on, np.nan, after)], axis=1)
    return np.repeat(t, 3), values.ravel()
