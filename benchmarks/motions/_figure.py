"""The diagram: time of one run against the error of the crank angle after 10 s."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ._works import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colours of Okabe and Ito; what differs in colour differs in shape too.
STYLES = {
    "redundax": {"marker": "o", "color": "#0072B2"},
    "Exudyn": {"marker": "s", "color": "#D55E00", "markerfacecolor": "white"},
    "MuJoCo, Euler": {"marker": "^", "color": "#009E73"},
    "MuJoCo, RK4": {"marker": "v", "color": "#222222", "markerfacecolor": "white"},
}


def figure(rows: Sequence[Row]) -> "Figure":
    """One panel for each N-four-bar."""
    from matplotlib.figure import Figure

    works = [work for work in dict.fromkeys(row.work for row in rows) if work.endswith("four-bar")]
    out = Figure(figsize=(1.0 + 3.4 * max(len(works), 1), 3.8), layout="constrained", dpi=150)
    panels = out.subplots(1, max(len(works), 1), sharex=True, sharey=True, squeeze=False)[0]
    for axes, work in zip(panels, works, strict=False):
        for program, style in STYLES.items():
            points = [(row.error, row.seconds) for row in rows if (row.work, row.program) == (work, program)]
            if points:
                axes.plot(*zip(*points, strict=True), label=program, linewidth=1.2, markersize=5, **style)
        axes.set(xscale="log", yscale="log", title=work, xlabel="error of the angle at 10 s, rad")
        axes.grid(alpha=0.3, linewidth=0.5)
    panels[0].set_ylabel("time of the run, s")
    handles, labels = panels[0].get_legend_handles_labels()
    if handles:
        out.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return out
