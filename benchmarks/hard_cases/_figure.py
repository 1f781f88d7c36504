"""The figure: error against bound, every line of the suite, flagged ones in a strip of their own."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ._run import ALLOWED, DTYPES, Line

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colours of Okabe and Ito; what differs in colour differs in shape and in grey too.
STYLES = {
    "ok": {"marker": "o", "s": 14, "facecolors": "none", "edgecolors": "#0072B2", "linewidths": 0.8},
    "flagged": {"marker": "|", "s": 60, "color": "#666666", "linewidths": 0.8},
    "false flag": {"marker": "x", "s": 40, "color": "#000000", "linewidths": 1.4},
    "SILENT WRONG": {"marker": "s", "s": 34, "facecolors": "#D55E00", "edgecolors": "#000000", "linewidths": 0.8},
}
LABELS = {
    "ok": "successful and right",
    "flagged": "flagged, with a reason",
    "false flag": "flagged without need",
    "SILENT WRONG": "successful but wrong",
}
LEFT, RIGHT, STRIP = 1e-17, 1e1, 1e4


def figure(lines: Sequence[Line]) -> "Figure":
    """One panel for each precision."""
    from matplotlib.figure import Figure

    dtypes = [dtype for dtype in DTYPES if any(line.dtype == dtype for line in lines)]
    out = Figure(figsize=(5.2 * len(dtypes), 4.8), layout="constrained", dpi=150)
    panels = out.subplots(1, len(dtypes), sharex=True, sharey=True, squeeze=False)[0]
    for axes, dtype in zip(panels, dtypes, strict=True):
        _panel(axes, [line for line in lines if line.dtype == dtype], dtype)
    panels[0].set_ylabel("largest error of any kind of quantity, relative")
    handles, labels = panels[0].get_legend_handles_labels()
    out.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return out


def _panel(axes, lines: Sequence[Line], dtype: str) -> None:
    x = np.array([LEFT, RIGHT])
    axes.fill_between(x, ALLOWED * x, 3e2, color="#D55E00", alpha=0.07, linewidth=0)
    axes.plot(x, ALLOWED * x, "-", color="#222222", linewidth=1.2, label="10 times the bound")
    axes.axhline(3e2, color="#BBBBBB", linewidth=0.8)
    for verdict, style in STYLES.items():
        chosen = [line for line in lines if line.verdict == verdict]
        points = np.array([_point(line) for line in chosen]).reshape(-1, 2)
        axes.scatter(*points.T, label=f"{LABELS[verdict]}", zorder=3, **style)
    axes.set(xscale="log", yscale="log", xlim=(LEFT, RIGHT), ylim=(1e-18, 3e5))
    axes.set_yticks(
        [10.0**k for k in range(-18, 1, 3)] + [STRIP], [*(f"$10^{{{k}}}$" for k in range(-18, 1, 3)), "flagged"]
    )
    axes.set_xlabel("bound: change of the exact answer by rounding of the inputs")
    counts = ", ".join(
        f"{sum(line.verdict == verdict for line in lines)} {word}"
        for verdict, word in (
            ("ok", "right"),
            ("SILENT WRONG", "wrong"),
            ("flagged", "flagged"),
            ("false flag", "without need"),
        )
    )
    axes.set_title(f"{dtype}: {counts}", fontsize=10)
    axes.grid(alpha=0.25, linewidth=0.5)
    axes.minorticks_off()


def _point(line: Line) -> tuple[float, float]:
    """Bound and error of the kind with the largest ratio; flagged lines in their strip."""
    if not line.errors:
        return RIGHT / 3, STRIP if line.result else 1e2
    kind = max(line.errors, key=lambda kind: _over(line.errors[kind], line.bounds[kind]))
    bound, error = line.bounds[kind], line.errors[kind]
    if line.verdict in ("flagged", "false flag"):
        error = STRIP
    return float(np.clip(bound, 2 * LEFT, RIGHT / 2)), float(np.clip(error, 2e-18, 1e2 if error < STRIP else STRIP))


def _over(error: float, bound: float) -> float:
    return math.inf if math.isinf(error) else error / bound
