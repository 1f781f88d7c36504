"""Ensembles: motions of many mechanisms in one batch, and the bands that they fill over time.

    x_p(t) = the value that p percent of the motions do not exceed at t,

interpolated linearly between the motions in order. A motion counts as long as it goes on: one that jams or fails at t*
belongs to the bands before t* and not after, and `count` says at every instant how many motions a band rests on.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jax.sharding import Mesh

from .._motion._trajectory import Trajectory
from .._system._names import KEPT
from .._system._results import result_codes
from .._system._system import AbstractSystem, check_system
from .._tools._errors import RedundaxError
from .._tools._module import Numbers, check_kind
from .._tools._words import warn
from ._distributions import AbstractDistribution, check_percentiles, check_power, sobol
from ._layout import SAMPLE, outcomes
from ._study import study, whole

if TYPE_CHECKING:
    import xarray

_GOOD = ("successful", "stuck")  # of motions that did what they should


def ensemble(
    run: Callable[..., Trajectory],
    samples: Mapping[str, Numbers | AbstractDistribution],
    *,
    system: AbstractSystem,
    size: int = 256,
    percentiles: Sequence[float] = (5.0, 50.0, 95.0),
    seed: int = 0,
    chunk: int = 1024,
    path: str | Path | None = None,
    mesh: Mesh | None = None,
    progress: bool = False,
) -> "xarray.Dataset":
    """Run the motions of many samples in batches, and give the bands that they fill over time.

    What varies is up to `run`: misfit, preload and compliance of joints, friction coefficients, any number of a
    closure, initial states.

    ??? example

        ```python
        crank = rx.mechanisms.parallelogram(3)
        def run(rate):
            return rx.simulate(crank, crank.state(0.5, rate=rate), 0.2, ts=jnp.linspace(0.0, 0.2, 5))
        found = rx.ensemble(run, {"rate": rx.Normal(1.0, 0.1)}, system=crank, size=8)
        found.q_band  # dimensions percentile, time, coordinate
        ```

    **Arguments:**

    - `run`: function of one sample, written in jnp, with arguments named as in `samples`; it gives what `simulate`
      does, at times `ts` that are the same for all samples.
    - `samples`: for each argument its values, shape (N, ...), or the `Normal` or `Uniform` that they are drawn from,
      as Sobol points.
    - `system`: gives coordinates, rows and slips their names.
    - `size`: N, a power of two, where all are drawn; else N is that of the values.
    - `percentiles`: of the bands, two or more from 0 to 100.
    - `seed`: of the scrambling of the Sobol points.
    - `chunk`, `path`, `mesh`, `progress`: as in `study`; the file holds the motions, not the bands.

    **Returns:** an `xarray.Dataset` of the motions: `q`, `qd`, `acceleration`, `multipliers`, `friction` and `sense`
    along "sample", "time" and "coordinate", "row" or "slip" (`q` in a chart of its own along "q_1", ...), with `result`
    and `stats` of each sample; where the system states units, the attributes `linear_unit` and `angular_unit` give
    those of entries that `coordinate_kind` and its like tell apart. `q_band` and its like have "percentile" in place of
    "sample", and `q_count` says on how many motions they rest. `solved` is whether a motion got to the end or to rest
    for good, and `outcomes` how many motions ended in which way, along "outcome". Draw it with `rx.plot.ensemble`.

    **Raises:** `ValueError` where arguments do not fit, as in `study`; warns where motions did not get to the end.
    """
    check_system(system)
    drawn, sizes = _drawn(samples, size, percentiles)
    given = sobol(drawn, sizes, seed) if drawn else {}
    values = {name: given[name] if name in given else np.asarray(samples[name]) for name in samples}
    data = whole(study(run, values, system=system, chunk=chunk, path=path, mesh=mesh, progress=progress))
    motions = _named(data, system)
    bands = {}
    for array in KEPT:
        if array in motions:
            band, count = banded(motions[array].values, percentiles)
            _, *dims = motions[array].dims
            bands[f"{array}_band"] = (("percentile", *dims), band, motions[array].attrs)
            bands[f"{array}_count"] = (dims, count)
    ends = outcomes(motions["result"])
    solved = np.isin(motions["result"].values, [result_codes()[name] for name in _GOOD])
    found = motions.assign(bands | {"solved": (SAMPLE, solved), "outcomes": ("outcome", [*ends.values()])})
    found = found.assign_coords(percentile=[*percentiles], outcome=[*ends])
    found = found.assign_attrs(failed=int(np.sum(~solved)))
    found.set_close(data.close)
    if not solved.all():
        ended = ", ".join(f"{name}: {count}" for name, count in ends.items() if name not in _GOOD)
        text = f"{np.sum(~solved)} of {solved.size} motions did not get to the end ({ended})"
        warn(f"{text}: bands rest on the others from there on, `q_count` says how many.")
    return found


def _drawn(
    samples: Mapping[str, Numbers | AbstractDistribution], size: int, percentiles: Sequence[float]
) -> tuple[dict[str, AbstractDistribution], int]:
    """The distributions, and the number of samples."""
    check_kind("samples", samples, Mapping, "values by name", 'Write {"rate": rx.Normal(1.0, 0.1)}, say.')
    drawn = {name: one for name, one in samples.items() if isinstance(one, AbstractDistribution)}
    fixed = [np.shape(one)[0] for one in samples.values() if not isinstance(one, AbstractDistribution) and np.ndim(one)]
    count = fixed[0] if fixed else size
    if drawn:
        check_power("samples" if fixed else "size", count)
    check_percentiles(percentiles, 2)
    return drawn, count


def _named(data: "xarray.Dataset", system: AbstractSystem) -> "xarray.Dataset":
    """The motions with one time, and names and units along the other dimensions."""
    missing = [name for name in ("t", *KEPT, "sense", "result") if name not in data]
    if missing:
        raise RedundaxError(
            f"Argument `run` must give a `Trajectory`, but its result has no {', '.join(missing)}. "
            "Return what `simulate` gives."
        )
    times = data["t"].values
    if times.ndim != 2 or not np.array_equal(times, np.broadcast_to(times[0], times.shape), equal_nan=True):
        raise RedundaxError("Argument `run` must give all motions at the same times. Give `ts` to `simulate`.")
    unit = system.names.units.of("time")
    clock = {"units": unit} if unit else {}
    motions = data.drop_vars("t").assign_coords(time=("time", times[0], clock))
    motions = motions.assign(sense=data["sense"].rename({data["sense"].dims[1]: "time"}))
    for name, quantity in KEPT.items():
        size, chart = len(system.names.axes[quantity.axis]), name == "q" and not system.adds
        if data[name].shape[2] != size and not chart:
            raise RedundaxError(
                f"Argument `system` must be the one whose motions `run` gives, but has {size} {quantity.axis}s where "
                f"they have {data[name].shape[2]}. Give the one that `run` simulates."
            )
        renamed = data[name].rename({data[name].dims[1]: "time"})
        renamed = renamed.drop_attrs() if chart else renamed
        motions = motions.drop_vars(name) if size == 0 else motions.assign({name: renamed})
    return motions


def banded(values: np.ndarray, percentiles: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Percentiles over the first axis of those values that are not NaN, NaN where there are none; and their number."""
    count = np.sum(~np.isnan(values), axis=0)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN slice", RuntimeWarning)
        return np.nanpercentile(values, percentiles, axis=0), count
