"""Pictures of spectra, of solution families and of bands."""

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from .._analysis._report import Report
from .._solution_sets._band._band import Bands
from .._solution_sets._family._solution_family import SolutionFamily
from .._system._names import index_of
from .._system._units import with_unit
from .._tools._table import apart

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = ("angular", "linear", "force", "moment")  # in the order of panels
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", "--", "-.", ":")
_MOST = {1: 15, 2: 6}  # outputs drawn along one or two states, if none are named
_NAMES = 4  # in a title, at most
_ROUNDING = 1e-9  # beside the largest of a kind, up to which values are the same
_NARROW = 0.02  # of an axis, of a bar that is hard to see
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
    title = f"rank {rank} of {len(report.rows)} constraints{gap}"
    finish(axes, title, "number of the singular value", "relative to the largest")
    legend_beside(axes)
    return figure


def family(family: SolutionFamily, outputs: Sequence[str] | None = None) -> "Figure":
    """Accelerations, multipliers and friction over the amplitude of the self-stress; constant ones are left out.

    Along one state: one panel for each quantity, whose axis is its own range; those that run together share a panel.
    Colours are connected pieces, dots folds, where a curve turns back; where the number of solutions is not one
    everywhere, a panel shows it. Along two states: one map for each quantity.

    ??? example

        ```python
        family = rx.solution_family(mechanism, state, along="A.x", samples=21)
        rx.plot.family(family, outputs=["1.phi''", "tau A"]).savefig("family.png")
        ```

    **Arguments:**

    - `family`: from `solution_family`.
    - `outputs`: names of what to draw; if not given those that change most beside the largest of their kind, some of
      each kind, 15 along one state and 6 along two at most.

    **Returns:** a matplotlib figure.

    **Raises:** `ValueError` for names that the family does not have.
    """
    for name in outputs or ():
        index_of("outputs", name, family.names, " of the family")
    return family_of(family, family.names) if outputs is None else family_of(family, outputs, len(outputs))


def family_of(family: SolutionFamily, names: Sequence[str], most: int | None = None) -> "Figure":
    """The same of those outputs that change most; as many as there is room for, if not given."""
    varying = _varying(family, names)
    if not varying or len(family.along) not in _MOST:
        return words("Nothing varies along the self-stress.")
    shown = _most(varying, _MOST[len(family.along)] if most is None else most)
    figure = _curves(family, shown) if len(family.along) == 1 else _maps(family, shown)
    if len(shown) < len(varying):
        figure.suptitle(f"the {len(shown)} that change most, of {len(varying)}", fontsize=10)
    return figure


def band(bands: Bands) -> "Figure":
    """Bands as bars, one panel for each kind: full bars are exact, hatched ones inner bounds, diamonds one value.

    Outer bounds are thin lines where they are known and apart from the inner ones. A bar that would be too narrow
    beside those of its kind has a panel of its own.

    ??? example

        ```python
        bands = rx.band(mechanism, state, ["A.x", "B.x"], rx.AmplitudeBox({"A.x": (-40.0, 40.0)}))
        rx.plot.band(bands).savefig("bands.png")
        ```

    **Arguments:**

    - `bands`: from `band`.

    **Returns:** a matplotlib figure.
    """
    kinds = np.array([kind.removeprefix("friction ") for kind in bands.kinds])
    groups = [panel for kind in KINDS for panel in _panels(bands, np.flatnonzero(kinds == kind).tolist())]
    size = np.fmax(np.abs(bands.lower), np.abs(bands.upper))
    heights = [0.3 * len(members) + 0.7 for members in groups]
    if bands.empty:
        return words("It cannot stand: proved." if bands.stands == "no" else "No solution within the bounds was found.")
    figure = new_figure(8.0, sum(heights) + 0.5)
    rows = figure.subplots(len(groups), 1, squeeze=False, height_ratios=heights)[:, 0]
    for axes, members in zip(rows, groups, strict=True):
        rounding = _ROUNDING * np.fmax.reduce(size[kinds == kinds[members[0]]])
        for place, k in enumerate(members):
            outer = bands.outer_lower[k], bands.outer_upper[k]
            if not bands.exact[k] and np.all(np.isfinite(outer)):
                axes.plot(outer, (place, place), "|-", color=COLOURS[0], linewidth=1.0, markersize=8)
            _bar(axes, place, bands.lower[k], bands.upper[k], bool(bands.exact[k]), rounding)
        axes.set_yticks(range(len(members)), [bands.names[k] for k in members])
        axes.set_ylim(len(members) - 0.5, -0.5)
        axes.use_sticky_edges = False
        axes.margins(x=0.18)
        finish(axes, "", bands.units[members[0]])
    about = "" if bands.solved == 1 else f"; {1 - bands.solved:.0%} of the cases have no solution"
    figure.supxlabel("full: exact; hatched: inner bound; line: outer bound; diamond: one value", fontsize=8)
    figure.suptitle(bands.title + about, fontsize=10, wrap=True)
    return figure


def _panels(bands: Bands, members: list[int]) -> list[list[int]]:
    """Those of a kind whose bars can be seen on one axis, and each other alone."""
    if not members:
        return []
    whole = bands.upper[members].max() - bands.lower[members].min()
    width = bands.upper - bands.lower
    narrow = [k for k in members if _ROUNDING * whole < width[k] < _NARROW * whole]
    together = [k for k in members if k not in narrow]
    return [each for each in (together, *([k] for k in narrow)) if each]


def _bar(axes: "Axes", place: int, lower: float, upper: float, exact: bool, rounding: float) -> None:
    if np.isnan(upper - lower):
        axes.annotate(
            "not found", (0.5, place), xycoords=("axes fraction", "data"), ha="center", va="bottom", fontsize=8
        )
        return
    if upper - lower <= rounding:
        middle = (lower + upper) / 2 if abs(lower + upper) > rounding else 0.0
        axes.plot(middle, place, "D", color=COLOURS[-1], markersize=5)
        axes.annotate(f"{middle:.4g}", (middle, place), (7, 0), textcoords="offset points", va="center", fontsize=8)
        return
    colour, hatch = (COLOURS[5], "") if exact else ("white", "////")
    axes.barh(place, upper - lower, 0.55, lower, color=colour, hatch=hatch, edgecolor=COLOURS[0], linewidth=1.2)
    low, high = (0.0 if abs(value) <= rounding else value for value in (lower, upper))
    mark_ends(axes, place, (low, high), (lower, upper), 4)


def mark_ends(axes: "Axes", place: int, figures: tuple[float, float], ends: tuple[float, float], gap: int) -> None:
    """Figures at both ends of a bar, some points of print beside it."""
    for text, end, side, align in zip(apart(*figures, 4), ends, (-gap, gap), ("right", "left"), strict=True):
        axes.annotate(text, (end, place), (side, 0), textcoords="offset points", ha=align, va="center", fontsize=8)


def new_figure(width: float, height: float) -> "Figure":
    """A figure of a size in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained", dpi=110)


def words(text: str) -> "Figure":
    """A figure that says why there is nothing to draw."""
    figure = new_figure(4.0, 1.0)
    figure.text(0.5, 0.5, text, ha="center")
    return figure


def stacked(heights: Sequence[float], strip: float, label: str) -> tuple["Figure", "list[Axes]"]:
    """A figure of panels below each other of these heights, with a strip above, that share what is drawn across."""
    figure = new_figure(6.6, sum(heights) + strip)
    panels = list(figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0])
    panels[-1].set_xlabel(label, fontsize=9)
    return figure, panels


def gridded(
    count: int, most: int, size: tuple[float, float], more: tuple[float, float] = (0.0, 0.0)
) -> tuple["Figure", "list[Axes]"]:
    """A figure of panels of a size, as many as that `most` in a row, and a margin."""
    columns = min(most, count)
    rows = -(-count // columns)
    figure = new_figure(size[0] * columns + more[0], size[1] * rows + more[1])
    return figure, [figure.add_subplot(rows, columns, number) for number in range(1, count + 1)]


def shared_legend(
    figure: "Figure", place: Literal["outside upper center", "outside lower center"], columns: int
) -> None:
    """One legend of all panels, in which each name stands once."""
    known = {}
    for axes in figure.axes:
        known |= dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    figure.legend(known.values(), known.keys(), loc=place, ncols=columns, fontsize=8, frameon=False)


def legend_beside(axes: "Axes", columns: int = 1) -> None:
    """The legend of a panel to its right."""
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, ncols=columns)


class _Varying(NamedTuple):
    """Quantities of one kind that run together, how much they change beside the largest of their kind, and the unit."""

    names: list[str]
    values: np.ndarray
    kind: str
    change: float
    unit: str

    @property
    def title(self) -> str:
        more, whole = len(self.names) - _NAMES, (name.replace(" ", "\xa0") for name in self.names[:_NAMES])
        return fill(", ".join(whole) + (f" and {more} more" if more > 0 else ""), 30).replace("\xa0", " ")


def _varying(family: SolutionFamily, names: Sequence[str]) -> list[_Varying]:
    out: list[_Varying] = []
    for name in names:
        k, values = family.names.index(name), family[name]
        kind, size = family.kinds[k], family.sizes[k]
        if np.ptp(values) <= _ROUNDING * size:
            continue
        for one in out:
            if one.kind == kind and np.abs(one.values - values).max() <= _ROUNDING * size:
                one.names.append(name)
                break
        else:
            out.append(_Varying([name], values, kind, float(np.ptp(values) / size), family.units[k]))
    return out


def _most(varying: list[_Varying], most: int) -> list[_Varying]:
    """Those that change most, as many of each kind as there is room, in their order."""
    falling = sorted(range(len(varying)), key=lambda k: -varying[k].change)
    kinds = [varying[k].kind for k in falling]
    places = [kinds[:place].count(kind) for place, kind in enumerate(kinds)]
    return [varying[k] for _, k in sorted(sorted(zip(places, falling, strict=True))[:most], key=lambda pair: pair[1])]


def _curves(family: SolutionFamily, varying: list[_Varying]) -> "Figure":
    counted = bool(np.any(family.count != 1))
    figure, panels = gridded(len(varying) + counted, 3, (3.0, 1.9), (0.4, 0.5))
    z = family.z[:, 0]
    for axes, one in zip(panels, varying, strict=False):
        for piece in range(family.branch.max(initial=-1) + 1):
            on = family.branch == piece
            axes.plot(z[on], one.values[on], color=COLOURS[piece % len(COLOURS)], linewidth=1.4)
        axes.plot(z[family.fold], one.values[family.fold], "o", color=COLOURS[-1], markersize=4)
        finish(axes, one.title, "", one.unit)
        axes.ticklabel_format(useOffset=False)
        axes.locator_params(axis="x", nbins=5)
        axes.locator_params(axis="y", nbins=7)
    if counted:
        axes = panels[-1]
        axes.step(family.axes[0], family.count, where="mid", color=COLOURS[-1], linewidth=1.4)
        axes.locator_params(axis="x", nbins=5)
        axes.set_yticks(range(int(family.count.max()) + 1))
        finish(axes, "number of solutions" + (", proved" if family.proved else " found"), "")
    figure.supxlabel(_label(family, 0), fontsize=9)
    return figure


def _maps(family: SolutionFamily, varying: list[_Varying]) -> "Figure":
    """Maps over two amplitudes; of several solutions the one with the least friction is drawn."""
    (figure, panels), (first, second) = gridded(len(varying), 3, (4.2, 3.4)), family.axes
    for axes, one in zip(panels, varying, strict=True):
        grid = np.full((first.size, second.size), np.nan)
        order = np.argsort(-np.abs(family.friction).max(axis=1, initial=0.0))
        for k in order[~family.fold[order]]:
            grid[np.searchsorted(first, family.z[k, 0]), np.searchsorted(second, family.z[k, 1])] = one.values[k]
        drawn = axes.pcolormesh(first, second, grid.T, cmap="cividis", shading="nearest")
        figure.colorbar(drawn, ax=axes, label=one.unit)
        finish(axes, one.title, _label(family, 0), _label(family, 1))
        axes.grid(visible=False)
    return figure


def _label(family: SolutionFamily, state: int) -> str:
    name = family.along[state]
    return with_unit(f"self-stress added to {name}", family.units[family.names.index(name)])


def finish(axes: "Axes", title: str = "", label: str = "", upright: str = "") -> None:
    """Title, labels across and upright, and grid of a panel."""
    axes.set_title(title, fontsize=10)
    if label:
        axes.set_xlabel(label, fontsize=9)
    if upright:
        axes.set_ylabel(upright, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3)
