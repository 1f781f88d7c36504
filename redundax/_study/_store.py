"""Where a study keeps what is done: in memory, or in a netCDF file to which every chunk is added.

A file has its full size from the start; its attribute `done` tells how many samples are in it, and `fingerprint` of
which study they are. All else beside the samples is what a new file of the study would hold. Variables lie in one
piece, without compression, so that chunks of any size can be added. What the disk can do to it is in `_disk`.
"""

import contextlib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._tools._optional import optional
from ._contents import contents
from ._disk import add_check, create_checks, damage, no_room, reserve, stored_contents, unreadable
from ._layout import SAMPLE, Layout, Variable

if TYPE_CHECKING:
    import netCDF4
    import xarray

_FINGERPRINT, _DONE = "attribute 'fingerprint'", "attribute 'done'"
# Files that datasets of this program read; closed before they are written, they open again when a value is asked for.
_READ: "dict[Path, xarray.Dataset]" = {}


class Memory:
    """The arrays of a study in memory."""

    def __init__(self, layout: Layout):
        self._layout, self.done, self.problem = layout, 0, ""
        self._arrays = {
            name: np.empty((layout.size, *variable.shape), variable.dtype)
            for name, variable in layout.variables.items()
        }

    def write(self, values: Mapping[str, np.ndarray]) -> None:
        """Add samples after those that are there."""
        first, done = self.done, self.done
        for name, array in values.items():
            done = first + len(array)
            self._arrays[name][first:done] = array
        self.done = done

    def difference(self, values: Mapping[str, np.ndarray]) -> str:
        """None: a study in memory starts anew."""
        return ""

    def dataset(self) -> "xarray.Dataset":
        """What is done."""
        layout = self._layout
        data = {
            name: ((SAMPLE, *variable.dims), self._arrays[name][: self.done], variable.attrs)
            for name, variable in layout.variables.items()
        }
        attrs = {"samples": layout.size, "done": self.done}
        labels = {name: (dim, list(names)) for name, (dim, names) in layout.labels.items()}
        return optional("xarray").Dataset(data, labels, attrs)

    def close(self) -> None:
        """Nothing is open."""


class File:
    """The netCDF file of a study, new or half done.

    `problem` says why the file cannot be used, if so.
    """

    def __init__(self, path: Path, layout: Layout, fingerprint: str):
        self._path, self._layout, self.done, self.problem = path, layout, 0, ""
        self._data: Any = None
        if path in _READ:
            _READ[path].close()
        try:
            if path.exists():
                self._resume(fingerprint)
            else:
                self._create(fingerprint)
        except (OSError, RuntimeError) as error:  # netCDF4 raises either
            self._give_up()
            self.problem = unreadable(path, error)

    def _resume(self, fingerprint: str) -> None:
        found = stored_contents(self._path)
        if found.get(_FINGERPRINT) != fingerprint:
            if _FINGERPRINT in found and found.get(_DONE) == 0:  # a study that failed before anything was done
                self._create(fingerprint)
                return
            self.problem = (
                f"Argument `path`: {self._path} holds something else than this study: its samples, outputs, names or "
                "units differ. Give another path, or delete the file."
            )
            return
        wrong = self._difference_of_contents(found, fingerprint)
        if not wrong:
            self._data = optional("netCDF4").Dataset(self._path)
            self.done = int(self._data.done)
            wrong = damage(self._data, tuple(self._layout.variables), self.done)
        if wrong:
            self.close()
            self.problem = (
                f"Argument `path`: {self._path} was changed or damaged, or another version wrote it: it is not as it "
                f"was written at {wrong}. Delete the file, or give another path, and the study begins anew."
            )
            return
        if self.done < self._layout.size:
            self.close()
            self._data = optional("netCDF4").Dataset(self._path, "a")

    def _difference_of_contents(self, found: dict[str, object], fingerprint: str) -> str:
        """Which parts of the file beside its numbers are not those of a new file of this study."""
        with optional("netCDF4").Dataset("new", "w", diskless=True) as data:
            self._lay_out(data, fingerprint)
            new = contents(data) | {_DONE: found.get(_DONE)}
        wrong = [name for name in sorted(found.keys() | new.keys()) if found.get(name) != new.get(name)]
        if not isinstance(found.get(_DONE), int):
            wrong.append(_DONE)
        return ", ".join(wrong[:3]) + f" and {len(wrong) - 3} more" * (len(wrong) > 3)

    def _create(self, fingerprint: str) -> None:
        try:
            self._data = optional("netCDF4").Dataset(self._path, "w")
            self._lay_out(self._data, fingerprint)
            for name, variable in self._layout.variables.items():  # so that HDF5 gives each its place
                self._data[name][-1] = np.zeros(variable.shape, _stored(variable))
            self._data.sync()
            reserve(self._path)
        except (OSError, RuntimeError) as error:
            self._give_up()
            if not self._path.exists():
                raise
            self._path.unlink()
            self.problem = f"{no_room(self._path, self._size)} ({error})."

    def _lay_out(self, data: "netCDF4.Dataset", fingerprint: str) -> None:
        data.set_fill_off()
        sizes = {dim: len(labels) for dim, labels in self._layout.labels.values()}
        sizes[SAMPLE] = self._layout.size
        for variable in self._layout.variables.values():
            sizes |= dict(zip(variable.dims, variable.shape, strict=True))
        for dim, size in sizes.items():
            data.createDimension(dim, size)
        for name, (dim, labels) in self._layout.labels.items():
            data.createVariable(name, str, (dim,))[:] = np.array(labels, dtype=object)
        for name, variable in self._layout.variables.items():
            stored = data.createVariable(name, _stored(variable), (SAMPLE, *variable.dims))
            stored.setncatts(variable.attrs | ({"dtype": "bool"} if variable.dtype.kind == "b" else {}))
        coordinates = " ".join(name for name, (dim, _) in self._layout.labels.items() if name != dim)
        data.setncatts({"samples": self._layout.size, "done": 0, "fingerprint": fingerprint})
        if coordinates:
            data.coordinates = coordinates
        create_checks(data)

    @property
    def _size(self) -> int:
        """Bytes of all samples."""
        variables = self._layout.variables.values()
        return self._layout.size * sum(math.prod(one.shape) * _stored(one).itemsize for one in variables)

    def write(self, values: Mapping[str, np.ndarray]) -> None:
        """Add samples after those that are there."""
        variables, first = self._layout.variables, self.done
        stored = {name: array.astype(_stored(variables[name]), copy=False) for name, array in values.items()}
        done = first + len(next(iter(stored.values())))
        try:
            for name, array in stored.items():
                self._data[name][first:done] = array
            add_check(self._data, first, done, stored)
            self._data.sync()
            self._data.done = done  # after the samples, so that what is counted is there
            self._data.sync()
        except (OSError, RuntimeError) as error:
            self._give_up()
            raise OSError(
                f"{no_room(self._path, self._size)}, and call the study again: {first} of {self._layout.size} samples "
                f"are done ({error})."
            ) from error
        self.done = done

    def _give_up(self) -> None:
        with contextlib.suppress(OSError, RuntimeError):
            self.close()

    def difference(self, values: Mapping[str, np.ndarray]) -> str:
        """What tells these first samples from those in the file, by more than rounding.

        Stats are not looked at: some of them are rounding, which another chunk or mesh changes.
        """
        for name, array in values.items():
            if "stats" in name.split("."):
                continue
            array = array[: self.done]
            kept = np.ma.getdata(self._data[name][: len(array)])
            if not _agree(array, kept):
                return (
                    f"Argument `path`: {self._path} holds a study in which `run` gave other values of {name!r} for the "
                    "same samples. Give another path, or delete the file."
                )
        return ""

    def dataset(self) -> "xarray.Dataset":
        """What is done, read from the file when it is asked for."""
        self.close()
        return read(self._path)

    def close(self) -> None:
        """Close the file."""
        data, self._data = self._data, None
        if data is not None:
            data.close()


class Follower:
    """Stands for the file in the processes that do not write it."""

    def __init__(self, path: Path):
        self._path, self.done, self.problem = path, 0, ""

    def write(self, values: Mapping[str, np.ndarray]) -> None:
        """Process 0 does."""

    def difference(self, values: Mapping[str, np.ndarray]) -> str:
        """Process 0 tells."""
        return ""

    def dataset(self) -> "xarray.Dataset":
        """What is done."""
        return read(self._path)

    def close(self) -> None:
        """Nothing is open."""


Store = Memory | File | Follower


def read(path: Path) -> "xarray.Dataset":
    """The samples in the file of a study that are done; the file is opened when one is asked for."""
    xarray = optional("xarray")
    file = _READ[path] = _READ.get(path) or xarray.backends.NetCDF4DataStore.open(path)
    whole = xarray.open_dataset(file, cache=False)
    done = whole.isel({SAMPLE: slice(int(whole.attrs["done"]))})
    done.set_close(file.close)
    file.close()
    return done


def _stored(variable: Variable) -> np.dtype:
    """netCDF has no truth values; xarray reads small integers with the attribute dtype="bool" as such."""
    return np.dtype("i1") if variable.dtype.kind == "b" else variable.dtype


def _agree(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two arrays are the same but for rounding."""
    if one.dtype.kind != "f":
        return bool(np.array_equal(one, other))
    eps = float(np.finfo(one.dtype).eps)
    size = np.max(np.abs(one), where=np.isfinite(one), initial=0.0)
    return bool(np.allclose(one, other, rtol=0.0, atol=eps**0.5 * size + eps**0.75, equal_nan=True))
