"""Pictures of ensembles: bands of motion over time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._analysis._along import MotionReport
from .._analysis._verdict import Verdict
from .._system._axis import Axis
from .._system._names import KEPT, Entry, entries
from .._system._units import with_unit
from ._outputs import chosen
from ._solution_sets import COLOURS, DASHES, finish, gridded, shared_legend, words

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FILL, _EDGE = COLOURS[5], COLOURS[0]


def ensemble(
    ensemble: "xarray.Dataset", outputs: Sequence[str] | None = None, *, along: MotionReport | None = None
) -> "Figure":
    """The bands of an ensemble over time, one panel for each output.

    The band reaches from the lowest to the highest percentile, with a line at each percentile between. It is hatched
    where motions are missing that have ended before, and rests on the others. The title says how all motions ended.

    ??? example

        ```python
        crank = rx.mechanisms.parallelogram(3)
        def run(rate):
            return rx.simulate(crank, crank.state(0.5, rate=rate), 0.2, ts=jnp.linspace(0.0, 0.2, 5))
        found = rx.ensemble(run, {"rate": rx.Normal(1.0, 0.1)}, system=crank, size=8)
        rx.plot.ensemble(found, ["crank 1.phi", "A1.x"]).savefig("bands.png")
        ```

    **Arguments:**

    - `ensemble`: from `ensemble`.
    - `outputs`: names of what to draw, as in "1.phi", "1.phi'", "1.phi''", "A.x", "tau A"; the first six positions that
      vary between the motions, angles first, if not given. Units are those that the mechanism states.
    - `along`: from `analyze_along` on one of the motions. A black bar below the band is where the output (of positions
      and velocities the acceleration) is not unique in that motion, a grey one where this is undecided.

    **Returns:** a matplotlib figure.

    **Raises:** `ValueError` for names that are not there.
    """
    percentiles = np.sort(ensemble.percentile.values)
    unnamed = () if ensemble.q_band.dims == ensemble.qd_band.dims else ("q",)
    known = entries(_axes(ensemble), [array for array in KEPT if array not in unnamed])
    drawn = chosen(known, outputs, lambda output: _values(ensemble, output).T)
    if not drawn:
        return words("No position varies between the motions.")
    (figure, panels), clock = gridded(len(drawn), 2, (5.2, 2.5), (0.0, 0.8)), ensemble.time.attrs.get("units", "")
    for number, (panel, output) in enumerate(zip(panels, drawn, strict=True), 1):
        _band(panel, ensemble, output, percentiles)
        if along is not None:
            _verdicts(panel, along, output)
        label = with_unit("time", clock) if number > len(drawn) - 2 else ""  # of the lowest ones
        finish(panel, "", label, with_unit(output.name, _unit(ensemble, output)))
    shared_legend(figure, "outside lower center", 4)
    figure.suptitle(_title(ensemble), fontsize=10, wrap=True)
    return figure


def _axes(ensemble: "xarray.Dataset") -> dict[str, Axis]:
    names = {quantity.axis for quantity in KEPT.values()} & set(ensemble.dims)
    return {
        str(name): Axis(tuple(map(str, ensemble[name].values)), tuple(map(str, ensemble[f"{name}_kind"].values)))
        for name in names
    }


def _unit(ensemble: "xarray.Dataset", output: Entry) -> str:
    which = "angular" if output.kind in ("angular", "moment") else "linear"
    return ensemble[output.array].attrs.get(f"{which}_unit", "")


def _values(ensemble: "xarray.Dataset", output: Entry) -> np.ndarray:
    """The band of an output, shape (percentiles, times), lowest first."""
    return ensemble[f"{output.array}_band"].values[np.argsort(ensemble.percentile.values), :, output.index]


def _band(panel: "Axes", ensemble: "xarray.Dataset", output: Entry, percentiles: np.ndarray) -> None:
    t, band = ensemble.time.values, _values(ensemble, output)
    missing = ensemble[f"{output.array}_count"].values[:, output.index] < ensemble.sizes["sample"]
    low, *between, high = [f"{value:g}" for value in percentiles]
    label = f"{low} to {high} % of the motions"
    panel.fill_between(t, band[0], band[-1], facecolor=_FILL, alpha=0.6, edgecolor=_EDGE, linewidth=0.8, label=label)
    if missing.any():
        style = {"facecolor": "none", "edgecolor": _EDGE, "hatch": "////", "linewidth": 0.0}
        panel.fill_between(t, band[0], band[-1], where=missing.tolist(), label="some have ended before", **style)
    for k, (name, values) in enumerate(zip(between, band[1:-1], strict=True)):
        name = "median" if name == "50" else f"{name} %"
        panel.plot(t, values, color=_EDGE, linestyle=DASHES[k % 4], linewidth=1.6, label=name)
    panel.set_xlim(t[0], t[-1])


def _verdicts(panel: "Axes", along: MotionReport, output: Entry) -> None:
    """Bars along the foot of a panel where an output is not unique, or where that is not known."""
    name = f"{output.name.rstrip(chr(39))}''" if output.array in ("q", "qd") else output.name
    kind = {"multipliers": "multiplier", "friction": "friction"}.get(output.array, "acceleration")
    found = [[one for one in report.verdicts.get(kind, ()) if one.name == name] for report in along.reports]
    said = [judged[0].with_friction if judged else Verdict.UNDECIDED for judged in found]
    edges = np.concatenate([along.t[:1], (along.t[1:] + along.t[:-1]) / 2, along.t[-1:]])
    for verdicts, colour, label in (
        ((Verdict.NOT_UNIQUE,), COLOURS[-1], "not unique"),
        ((Verdict.UNDECIDED, Verdict.NO_CHANGE), "#999999", "uniqueness undecided"),
    ):
        spans = [(a, b - a) for a, b, one in zip(edges, edges[1:], said, strict=False) if one in verdicts]
        if spans:
            style = {"transform": panel.get_xaxis_transform(), "facecolor": colour, "label": label, "zorder": 3}
            panel.broken_barh(spans, (0.0, 0.03), **style)


def _title(ensemble: "xarray.Dataset") -> str:
    outcomes = zip(ensemble.outcome.values, ensemble.outcomes.values, strict=True)
    return f"{ensemble.sizes['sample']} motions: " + ", ".join(
        f"{count} {name.replace('_', ' ')}" for name, count in outcomes
    )
