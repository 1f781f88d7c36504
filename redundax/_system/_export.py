"""Results as tables of pandas and datasets of xarray, by name and with units in their attributes."""

import itertools
from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from .._tools._optional import optional
from ._names import QUANTITIES
from ._results import flags, result_codes

if TYPE_CHECKING:
    import pandas
    import xarray


def frame_of(found: Any) -> "pandas.DataFrame":
    """One column for each entry of a result with names, one row for each sample and time."""
    pandas, entries, arrays = optional("pandas"), found.entries, _arrays(found)
    columns = {str(k): arrays[entry.array][..., entry.index].reshape(-1) for k, entry in enumerate(entries)}
    frame = pandas.DataFrame(columns).set_axis([entry.name for entry in entries], axis="columns")
    dims, shape, times = _dims(found), found.acceleration.shape[:-1], getattr(found, "t", None)
    if times is not None and times.ndim == 1:
        frame.index = pandas.Index(np.asarray(times), name="t")
    elif dims:
        rows = itertools.product(*map(range, shape))
        frame.index = pandas.MultiIndex.from_tuples([*rows], names=dims) if len(dims) > 1 else frame.index.rename(*dims)
    if times is not None and times.ndim > 1:
        frame.insert(0, "t", np.asarray(times).reshape(-1))
    codes, words = np.asarray(jax.tree.leaves(found.result)[0]), {code: name for name, code in result_codes().items()}
    if codes.ndim:
        each = np.broadcast_to(codes.reshape(codes.shape + (1,) * (len(shape) - codes.ndim)), shape)
        frame["result"] = [words[code] for code in each.reshape(-1).tolist()]
    else:
        frame.attrs["result"] = words[int(codes)]
    units = {entry.name: entry.unit for entry in entries} | {"t": found.names.units.of("time")}
    frame.attrs["units"] = {name: unit for name, unit in units.items() if unit}
    return frame


def dataset_of(found: Any) -> "xarray.Dataset":
    """The arrays of a result with names, along samples, times and the names of their entries."""
    dims, names = _dims(found), found.names
    data: dict[str, object] = {}
    labels: dict[str, object] = {}
    for array, values in _arrays(found).items():
        quantity = QUANTITIES[array]
        axis = names.axes[quantity.axis]
        data[array] = ((*dims, quantity.axis), values, quantity.attributes(names.units))
        labels |= {quantity.axis: list(axis.labels), f"{quantity.axis}_kind": (quantity.axis, list(axis.kinds))}
    times, unit = getattr(found, "t", None), names.units.of("time")
    if times is not None:
        clock = (dims if times.ndim > 1 else "time", np.asarray(times), {"units": unit} if unit else {})
        labels["t" if times.ndim > 1 else "time"] = clock
    codes = np.asarray(jax.tree.leaves(found.result)[0])
    data["result"] = (dims[: codes.ndim], codes, flags(codes.dtype))
    return optional("xarray").Dataset(data, labels)


def bands_dataset(found: Any, dims: Sequence[str], labels: Mapping[str, object]) -> "xarray.Dataset":
    """Bands along these dimensions, the last of them that of the outputs."""
    arrays = ("lower", "upper", "exact", "outer_lower", "outer_upper")
    outputs = {name: (dims[-1], list(getattr(found, f"{name}s"))) for name in ("kind", "unit")}
    named = {dims[-1]: list(found.names), **outputs, **labels}
    return optional("xarray").Dataset({name: (dims, getattr(found, name)) for name in arrays}, named)


def _arrays(found: Any) -> dict[str, np.ndarray]:
    """The arrays whose entries have names, each computed once."""
    return {array: np.asarray(attrgetter(array)(found)) for array in dict.fromkeys(e.array for e in found.entries)}


def _dims(found: Any) -> tuple[str, ...]:
    """What the axes before the last are called."""
    count, time = found.acceleration.ndim - 1, ("time",) if hasattr(found, "t") else ()
    samples = count - len(time)
    return (*(["sample"] if samples == 1 else [f"sample_{k}" for k in range(samples)]), *time)
