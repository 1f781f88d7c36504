"""Pictures of tolerance studies."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._system._names import index_of
from .._system._units import with_unit
from ._solution_sets import COLOURS, KINDS, finish, mark_ends, new_figure, words

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SEEN = 0.005  # share of a variance that is wide enough to be seen
_HATCHES = ("", "////", "....", "xxxx")


def tolerance(study: "xarray.Dataset", outputs: Sequence[str] | None = None) -> "Figure":
    """What varies with the tolerances, and which of them it is due to; outputs that do not vary are left out.

    On the left, one panel for each kind, how far from nominal: bars from the lowest to the highest percentile of the
    study with the values there, a line at each percentile between, a diamond where all is nominal. On the right the
    parameters' shares of the variance; what is left white is not linear in any of them.

    ??? example

        ```python
        sizes = {"width": rx.Normal(0.10, 1e-4), "height": rx.Uniform(0.19, 0.21)}
        found = rx.tolerance_study(lambda width, height: {"area": width * height}, sizes, samples=64)
        rx.plot.tolerance(found).savefig("tolerances.png")
        ```

    **Arguments:**

    - `study`: from `tolerance_study`.
    - `outputs`: names along its dimension "output"; all that vary if not given.

    **Returns:** a matplotlib figure.

    **Raises:** `ValueError` for names that the study does not have.
    """
    known = [str(name) for name in study.output.values]
    chosen = known if outputs is None else outputs
    wanted = [index_of("outputs", name, known, " of outputs of the study") for name in chosen]
    varies = (study["share"].sum("parameter") > 0).values
    kinds = [str(kind).removeprefix("friction ") for kind in study.output_kind.values]
    groups = [[k for k in wanted if varies[k] and kinds[k] == kind] for kind in (*KINDS, "")]
    groups = [members for members in groups if members]
    heights = [0.3 * len(members) + 0.7 for members in groups]
    if not groups:
        return words("Nothing varies with the parameters.")
    figure = new_figure(10.0, sum(heights) + 1.2)
    panels = figure.subplots(len(groups), 2, squeeze=False, height_ratios=heights, width_ratios=(3, 2))
    for (left, right), members in zip(panels, groups, strict=True):
        for place, k in enumerate(members):
            _band(left, place, study["percentiles"].values[k], float(study["nominal"][k]))
            _shares(right, place, study["share"].values[k])
        for axes in (left, right):
            axes.set_ylim(len(members) - 0.5, -0.5)
            axes.use_sticky_edges = False
        left.margins(x=0.2)
        left.set_yticks(range(len(members)), [known[k] for k in members])
        right.set_yticks([])
        right.set_xlim(0, 1)
        finish(left, "", with_unit("change from nominal", str(study.output_unit.values[members[0]])))
        finish(right)
    panels[-1, 1].set_xlabel("share of the variance; white: not linear", fontsize=9)
    largest = np.max([study["share"].values[k] for members in groups for k in members], axis=0)
    _legend(panels[0, 1], {k: str(study.parameter.values[k]) for k in np.flatnonzero(largest > _SEEN).tolist()})
    figure.suptitle(_title(study), fontsize=10, wrap=True)
    return figure


def _band(axes: "Axes", place: int, percentiles: np.ndarray, nominal: float) -> None:
    ends = np.sort(percentiles)
    low, *between, high = ends - nominal
    axes.barh(place, high - low, 0.55, low, color=COLOURS[5], edgecolor=COLOURS[0], linewidth=1.2)
    axes.vlines(between, place - 0.275, place + 0.275, color=COLOURS[0], linewidth=1.6)
    axes.plot(0.0, place, "D", color=COLOURS[-1], markersize=4)
    mark_ends(axes, place, (ends[0], ends[-1]), (low, high), 5)


def _shares(axes: "Axes", place: int, shares: np.ndarray) -> None:
    left = 0.0
    for k, share in enumerate(shares):
        axes.barh(place, share, 0.55, left, **_style(k))
        left += share


def _style(k: int) -> dict:
    hatch = _HATCHES[k // len(COLOURS) % len(_HATCHES)]
    return {"facecolor": COLOURS[k % len(COLOURS)], "hatch": hatch, "edgecolor": "white", "linewidth": 0.8}


def _legend(axes: "Axes", names: Mapping[int, str]) -> None:
    from matplotlib.patches import Patch

    handles = [Patch(label=name, **_style(k)) for k, name in names.items()]
    axes.legend(handles=handles, fontsize=7, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)


def _title(study: "xarray.Dataset") -> str:
    percentiles = ", ".join(f"{value:g}" for value in np.sort(study.percentile.values))
    failed = int(study.attrs["failed"])
    about = f"; {failed} have no solution and are left out" if failed else ""
    return f"percentiles {percentiles} of {study.sizes['sample']} samples{about}; diamond: nominal"
