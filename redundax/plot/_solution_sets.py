"""Pictures of spectra, of solution families and of bands."""

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from .._analysis._report import Report
from .._solution_sets._band._band import Bands
from .._solution_sets._family._solution_family import SolutionFamily
from .._system._names import index_of
from .._system._units import with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANELS = (
    ("angular", "angular accelerations"),
    ("linear", "linear accelerations"),
    ("force", "force-type multipliers"),
    ("moment", "moment-type multipliers"),
    ("friction", "friction"),
)
KINDS = ("angular", "linear", "force", "moment")  # in the order of panels
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", "--", "-.", ":")
_MAPS = 6  # outputs drawn over two amplitudes at most
_ZERO = 1e-17  # where a singular value of zero is drawn


def spectrum(report: Report) -> "Figure":
    """Singular values of the constraints, and the gap in them that decides the rank.

    Full dots are counted, hollow ones dropped; the dotted line is the tolerance between them. A wide shaded gap means
    that the rank is beyond doubt; values close to the line, that it has to be declared with `rank=`. Values of zero
    are drawn at 1e-17.

    ??? example

        ```python
        report = rx.analyze(mechanism, state)
        rx.plot.spectrum(report).savefig("spectrum.png")
        ```

    **Arguments:**

    - `report`: from `analyze`.

    **Returns:** a matplotlib figure.
    """
    from matplotlib.ticker import MaxNLocator

    values, rank = np.maximum(report.singular_values, _ZERO), report.rank
    number = np.arange(1, values.size + 1)
    figure = new_figure(max(4.5, 1.5 + 0.25 * values.size), 3.2)
    axes = figure.subplots()
    kept, dropped = number <= rank, number > rank
    axes.semilogy(number[kept], values[kept], "o", color=COLOURS[0], label="counted")
    axes.axhline(report.tolerance, color=COLOURS[-1], linestyle=":", linewidth=1.2, label="tolerance")
    if np.any(dropped):
        axes.semilogy(number[dropped], values[dropped], "o", mfc="none", color=COLOURS[1], label="dropped")
        if rank:
            axes.axhspan(values[rank], values[rank - 1], color=COLOURS[5], alpha=0.25, linewidth=0, label="gap")
    axes.set_ylim(_ZERO / 10, 10.0)
    axes.set_xlim(0.3, values.size + 0.7)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    gap = f"; gap {report.gap:.1g}" if np.isfinite(report.gap) else ""
    finish(axes, f"rank {rank} of {len(report.rows)} constraints{gap}", "number of the singular value")
    axes.set_ylabel("relative to the largest", fontsize=9)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


def family(family: SolutionFamily, outputs: Sequence[str] | None = None) -> "Figure":
    """Accelerations, multipliers and friction over the amplitude of the self-stress; constant ones are left out.

    Along one state: one panel for each kind of quantity; quantities that run together share a line and a name; dots are
    folds, where a curve turns back; where the number of solutions is not one everywhere, a panel shows it. Along two
    states: one map for each quantity.

    ??? example

        ```python
        family = rx.solution_family(mechanism, state, along="A.x", samples=21)
        rx.plot.family(family, outputs=["1.phi''", "tau A"]).savefig("family.png")
        ```

    **Arguments:**

    - `family`: from `solution_family`.
    - `outputs`: names of what to draw; all if not given, of two states the first six that differ.

    **Returns:** a matplotlib figure.

    **Raises:** `ValueError` for names that the family does not have.
    """
    for name in outputs or ():
        index_of("outputs", name, family.names, " of the family")
    groups = [(_title(family, kind, title), _together(family, kind, outputs)) for kind, title in _PANELS]
    groups = [(title, groups) for title, groups in groups if groups]
    if not groups or len(family.along) not in (1, 2):
        figure = new_figure(4.0, 1.0)
        figure.text(0.5, 0.5, "Nothing varies along the self-stress.", ha="center")
        return figure
    return _curves(family, groups) if len(family.along) == 1 else _maps(family, groups)


def band(bands: Bands) -> "Figure":
    """Bands as bars, one panel for each kind: full bars are exact, hatched ones inner bounds, diamonds one value.

    Outer bounds are thin lines where they are known and apart from the inner ones.

    ??? example

        ```python
        bands = rx.band(mechanism, state, ["A.x", "B.x"], rx.AmplitudeBox({"A.x": (-40.0, 40.0)}))
        rx.plot.band(bands).savefig("bands.png")
        ```

    **Arguments:**

    - `bands`: from `band`.

    **Returns:** a matplotlib figure.
    """
    kinds = [kind.removeprefix("friction ") for kind in bands.kinds]
    groups = [[k for k, kind in enumerate(kinds) if kind == wanted] for wanted in KINDS]
    groups = [members for members in groups if members]
    heights = [0.3 * len(members) + 0.7 for members in groups]
    figure = new_figure(8.0, sum(heights) + 0.5)
    if bands.empty:
        nothing = "No solution within the bounds was found."
        figure.text(0.5, 0.5, "It cannot stand: proved." if bands.stands == "no" else nothing, ha="center")
        return figure
    rows = figure.subplots(len(groups), 1, squeeze=False, height_ratios=heights)[:, 0]
    for axes, members in zip(rows, groups, strict=True):
        largest = max(np.abs([bands.lower[k], bands.upper[k]]).max() for k in members)
        for place, k in enumerate(members):
            outer = bands.outer_lower[k], bands.outer_upper[k]
            if not bands.exact[k] and np.all(np.isfinite(outer)):
                axes.plot(outer, (place, place), "|-", color=COLOURS[0], linewidth=1.0, markersize=8)
            _bar(axes, place, bands.lower[k], bands.upper[k], bool(bands.exact[k]), 1e-9 * largest)
        axes.set_yticks(range(len(members)), [bands.names[k] for k in members])
        axes.set_ylim(len(members) - 0.5, -0.5)
        axes.use_sticky_edges = False
        axes.margins(x=0.18)
        finish(axes, "", bands.units[members[0]])
    about = "" if bands.solved == 1 else f"; {1 - bands.solved:.0%} of the cases have no solution"
    figure.supxlabel("full: exact; hatched: inner bound; line: outer bound; diamond: one value", fontsize=8)
    figure.suptitle(bands.title + about, fontsize=10, wrap=True)
    return figure


def _bar(axes: "Axes", place: int, lower: float, upper: float, exact: bool, rounding: float) -> None:
    if upper - lower <= rounding:
        middle = (lower + upper) / 2 if abs(lower + upper) > rounding else 0.0
        axes.plot(middle, place, "D", color=COLOURS[-1], markersize=5)
        axes.annotate(f"{middle:.4g}", (middle, place), (7, 0), textcoords="offset points", va="center", fontsize=8)
        return
    colour, hatch = (COLOURS[5], "") if exact else ("white", "////")
    axes.barh(place, upper - lower, 0.55, lower, color=colour, hatch=hatch, edgecolor=COLOURS[0], linewidth=1.2)
    for value, side, align in ((lower, -4, "right"), (upper, 4, "left")):
        text = f"{value if abs(value) > rounding else 0.0:.4g}"
        axes.annotate(text, (value, place), (side, 0), textcoords="offset points", ha=align, va="center", fontsize=8)


def new_figure(width: float, height: float) -> "Figure":
    """A figure of a size in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained", dpi=110)


def _together(family: SolutionFamily, kind: str, outputs: Sequence[str] | None) -> list[tuple[str, np.ndarray]]:
    """Label and values of quantities of a kind that vary; those that run together have one label."""
    names = [name for name, k in zip(family.names, family.kinds, strict=True) if k.startswith(kind)]
    sizes = dict(zip(family.names, family.sizes, strict=True))
    out: list[tuple[str, np.ndarray]] = []
    for name in names:
        values, size = family[name], sizes[name]
        if (outputs is not None and name not in outputs) or np.ptp(values) <= 1e-9 * size:
            continue
        for k, (label, other) in enumerate(out):
            if np.abs(other - values).max() <= 1e-9 * size:
                out[k] = (f"{label}, {name}", other)
                break
        else:
            out.append((name, values))
    return out


def _curves(family: SolutionFamily, groups: list[tuple[str, list[tuple[str, np.ndarray]]]]) -> "Figure":
    counted = bool(np.any(family.count != 1))
    panels = len(groups) + counted
    rows, columns = (panels + 1) // 2, min(2, panels)
    figure = new_figure(5.5 * columns, 3.2 * rows)
    z, label = family.z[:, 0], _label(family, 0)
    for number, (title, curves) in enumerate(groups, 1):
        axes = figure.add_subplot(rows, columns, number)
        for k, (name, values) in enumerate(curves):
            dashes = DASHES[(k // len(COLOURS)) % 4 if len(curves) > len(COLOURS) else k % 4]
            for piece in range(family.branch.max(initial=-1) + 1):
                on = family.branch == piece
                style = {"color": COLOURS[k % len(COLOURS)], "linestyle": dashes, "linewidth": 1.4}
                axes.plot(z[on], values[on], label=fill(name, 36) if piece == 0 else None, **style)
            axes.plot(z[family.fold], values[family.fold], "o", color=COLOURS[k % len(COLOURS)], markersize=4)
        finish(axes, title, label)
        beside = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5), "ncols": 1 + len(curves) // 16}
        axes.legend(fontsize=7, frameon=False, **beside)
    if counted:
        axes = figure.add_subplot(rows, columns, panels)
        axes.step(family.axes[0], family.count, where="mid", color=COLOURS[-1], linewidth=1.4)
        axes.set_yticks(range(int(family.count.max()) + 1))
        finish(axes, "number of solutions" + (", proved" if family.proved else " found"), label)
    return figure


def _maps(family: SolutionFamily, groups: list[tuple[str, list[tuple[str, np.ndarray]]]]) -> "Figure":
    """Maps over two amplitudes; of several solutions the one with the least friction is drawn."""
    chosen = [curve for _, curves in groups for curve in curves][:_MAPS]
    columns = min(3, len(chosen))
    rows = -(-len(chosen) // columns)
    figure = new_figure(4.2 * columns, 3.4 * rows)
    first, second = family.axes
    for number, (name, values) in enumerate(chosen, 1):
        axes = figure.add_subplot(rows, columns, number)
        grid = np.full((first.size, second.size), np.nan)
        order = np.argsort(-np.abs(family.friction).max(axis=1, initial=0.0))
        for k in order[~family.fold[order]]:
            grid[np.searchsorted(first, family.z[k, 0]), np.searchsorted(second, family.z[k, 1])] = values[k]
        drawn = axes.pcolormesh(first, second, grid.T, cmap="cividis", shading="nearest")
        figure.colorbar(drawn, ax=axes, label=family.units[family.names.index(name.partition(", ")[0])])
        finish(axes, name, _label(family, 0))
        axes.set_ylabel(_label(family, 1), fontsize=9)
        axes.grid(visible=False)
    return figure


def _label(family: SolutionFamily, state: int) -> str:
    name = family.along[state]
    return with_unit(f"self-stress added to {name}", family.units[family.names.index(name)])


def _title(family: SolutionFamily, kind: str, title: str) -> str:
    units = [unit for unit, k in zip(family.units, family.kinds, strict=True) if k.startswith(kind)]
    return with_unit(title, " and ".join(dict.fromkeys(units)))


def finish(axes: "Axes", title: str, label: str) -> None:
    """Title, label and grid of a panel."""
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(label, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3)
