"""Pictures of sweeps along the self-stress."""

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from ._study import Sweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PANELS = (
    ("angular", "angular accelerations, rad/s²"),
    ("linear", "linear accelerations, m/s²"),
    ("force", "force-type multipliers, N"),
    ("moment", "moment-type multipliers, N m"),
    ("friction", "friction forces, N, and moments, N m"),
)
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_DASHES = ("-", "--", "-.", ":")
_POINTS = 2001  # of a curve at most


def plot_sweep(sweep: Sweep) -> "Figure":
    """One panel for each kind of quantity over the amplitude of the self-stress; constant quantities are left out.

    Quantities that run together share a line and a name.
    """
    from matplotlib.figure import Figure

    few = np.linspace(0, sweep.z.size - 1, min(sweep.z.size, _POINTS)).round().astype(int)
    sweep = dataclasses.replace(sweep, z=sweep.z[few], values=sweep.values[few])
    panels = []
    for kind, title in _PANELS:
        columns = np.array([k == kind for k in sweep.kinds])
        curves = _curves(sweep, columns)
        if curves:
            panels.append((title, curves))
    figure = Figure(figsize=(10, 3.2 * max(1, (len(panels) + 1) // 2)), layout="constrained", dpi=110)
    if not panels:
        figure.text(0.5, 0.5, "Nothing varies along this self-stress state.", ha="center")
        return figure
    for number, (title, curves) in enumerate(panels, 1):
        axes = figure.add_subplot((len(panels) + 1) // 2, min(2, len(panels)), number)
        for k, (label, values) in enumerate(curves):
            axes.plot(
                sweep.z,
                values,
                _DASHES[(k // len(_COLOURS)) % 4 if len(curves) > len(_COLOURS) else k % 4],
                color=_COLOURS[k % len(_COLOURS)],
                label=label,
            )
        axes.set_title(title, fontsize=10)
        axes.set_xlabel(f"self-stress added to {sweep.multiplier}")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


def _curves(sweep: Sweep, columns: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Curves that vary, those that coincide under one label."""
    names = np.array(sweep.names)[columns]
    values = sweep.values[:, columns]
    if np.isnan(values).all():
        return []
    size = np.nanmax(np.abs(values), initial=0.0)
    curves: list[tuple[str, np.ndarray]] = []
    for name, curve in zip(names, values.T, strict=True):
        if np.nanmax(curve) - np.nanmin(curve) <= 1e-9 * size:
            continue
        for k, (label, other) in enumerate(curves):
            if np.nanmax(np.abs(other - curve)) <= 1e-9 * size:
                curves[k] = (f"{label}, {name}", other)
                break
        else:
            curves.append((str(name), curve))
    return curves
