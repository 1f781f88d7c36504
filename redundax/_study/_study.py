"""Studies of many samples: one program, run chunk by chunk, over the devices of a mesh.

    outputs[s] = run(**{name: values[s]}),   s = 0 ... N - 1

A chunk is one call of jit(vmap(run)); over a mesh jit(shard_map(vmap(run))), so that each device works on its own
samples, and no device waits for the iterations of another.
"""

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

import jax
import numpy as np
from jax.sharding import Mesh
from jaxtyping import PyTree

from .._system._system import AbstractSystem, check_system
from .._tools._errors import RedundaxError
from .._tools._module import Numbers, check_call, check_kind, check_whole
from .._tools._optional import optional
from .._tools._progress import progress as told
from .._tools._words import warn
from ._layout import Layout, layout, named, storable
from ._processes import check_threads, fetch, meet, of_first, refuse, spread
from ._store import File, Follower, Memory, Store

if TYPE_CHECKING:
    import xarray


def study(
    run: Callable[..., PyTree],
    samples: Mapping[str, Numbers],
    *,
    system: AbstractSystem | None = None,
    chunk: int = 65536,
    path: str | Path | None = None,
    mesh: Mesh | None = None,
    progress: bool = False,
) -> "xarray.Dataset":
    """Run a function on many samples, chunk by chunk, and give the results with names.

    ??? example

        ```python
        def run(phi, h):
            return rx.solve(mechanism, mechanism.state(phi=phi, rate=1.0), closure=rx.MinimumNorm(h))

        samples = {"phi": jnp.linspace(0.2, 1.2, 1000), "h": jnp.linspace(-100.0, 100.0, 1000)}
        results = rx.study(run, samples, system=mechanism, path="study.nc")
        results.acceleration.sel(coordinate="1.phi").mean()
        ```

    **Arguments:**

    - `run`: function of one sample, written in jnp, with arguments named as in `samples`. It gives a `Solution`, a
      dict of arrays or any pytree of them.
    - `samples`: for each argument the values, shape (N, ...). NumPy arrays stay off the devices until their chunk's
      turn; `np.memmap` serves for those that do not fit memory.
    - `system`: names the entries of outputs that are called q, qd, acceleration, multipliers and friction; not needed
      where `run` returns a `Solution` or a `Trajectory`, which know their names.
    - `chunk`: number of samples that are on the devices at once; rounded up to a multiple of their number.
    - `path`: a netCDF file, ".nc", to which every chunk is written, so that memory does not grow with N. A study that
      was stopped goes on where it stopped if it is called again in the same way. So that `run` cannot have changed
      meanwhile, the first chunk is computed again and compared. Numbers in the file are compared with check sums, names
      and units with those of this call. Room on the disk is taken for all samples at the start.
    - `mesh`: devices over which the samples of a chunk are spread, along all axes of the mesh; JAX's default device
      if not given. The mesh may span processes (`jax.distributed`) that all make the same call: process 0 writes,
      and all read the file at the end. For the cores of a CPU let each be a device, by
      `jax.config.update("jax_num_cpu_devices", 4)` and the environment variable PJRT_NPROC=8, which gives XLA two
      threads for each.
    - `progress`: whether to tell how far the work is, even if it is short.

    **Returns:** an `xarray.Dataset` of the samples and outputs along the dimension "sample". Outputs that are nested
    have names such as "stats.redundancy"; a result is a number, named by its attributes `flag_values` and
    `flag_meanings`. The attributes `samples` and `done` are the number of samples in the study and of those done, which
    differ only after an interrupt from the keyboard: it ends a study of one process with a warning and what is done.
    With `path` values are read when they are asked for, and the file is open from then until `close()`.

    **Raises:** `ValueError` where samples and outputs do not fit, or where the file holds another study, is damaged,
    open elsewhere or too large for the disk; `OSError` where the disk fails later; `ImportError` where the packages of
    the extra `study` are missing.
    """
    optional("xarray")
    given = _given(samples)
    check_whole(1, chunk=chunk)
    if path is not None:
        check_kind("path", path, (str, os.PathLike), "the name of a file", 'Write "study.nc", say.')
    if system is not None:
        check_system(system)
    check_call("run", run, **given)
    one = jax.jit(lambda sample: run(**sample))  # traced once, for the shapes
    table = layout(given, jax.eval_shape(one, {name: values[0] for name, values in given.items()}), system)
    check_threads(mesh)
    devices = 1 if mesh is None else mesh.size
    chunk = -(-min(chunk, table.size) // devices) * devices
    program = spread(jax.vmap(lambda sample: named(one(sample))), mesh)

    def compute(first: int) -> dict[str, np.ndarray]:
        own = {name: values[first : first + chunk] for name, values in given.items()}
        found = program({name: _padded(values, chunk) for name, values in own.items()})
        count = min(chunk, table.size - first)
        return own | {name: fetch(values)[:count] for name, values in found.items()}

    store = _opened(None if path is None else Path(path).resolve(), table, given)
    try:
        _fill(store, table.size, chunk, compute, progress)
    finally:
        store.close()
    meet("study")
    return store.dataset()


def _given(samples: Mapping[str, Numbers]) -> dict[str, np.ndarray]:
    check_kind("samples", samples, Mapping, "values by name", 'Write {"mu": values}, say.')
    given = {name: np.asarray(values) for name, values in samples.items()}
    sizes = {name: values.shape[:1] for name, values in given.items()}
    if len(set(sizes.values())) != 1 or not all(size and size[0] for size in sizes.values()):
        raise RedundaxError(
            f"Argument `samples` must hold arrays of one length, at least 1, but holds {sizes or 'none'}. What is the "
            "same for all samples belongs into `run`."
        )
    for name, values in given.items():
        if not storable(values.dtype):
            raise RedundaxError(
                f"Argument `samples` must hold real numbers of at least 32 bits, but {name!r} has "
                f"dtype {values.dtype}. Convert it, say with `astype(float)`."
            )
    return given


def _opened(path: Path | None, table: Layout, given: Mapping[str, np.ndarray]) -> Store:
    if path is None:
        return Memory(table)
    if path.suffix != ".nc" or not path.parent.is_dir():
        raise RedundaxError(
            f"Argument `path` must end in .nc and lie in a folder that exists, but is {path}. "
            "Make the folder, or choose another."
        )
    store = File(path, table, table.fingerprint(given)) if jax.process_index() == 0 else Follower(path)
    refuse(store.problem)
    store.done = of_first(store.done)
    return store


def _fill(store: Store, size: int, chunk: int, compute: Callable[[int], dict[str, np.ndarray]], progress: bool) -> None:
    """Do what is not done."""
    try:
        if store.done:
            refuse(store.difference(compute(0)))
        with _interrupts() as interrupts:
            for first in told(range(store.done, size, chunk), "study", progress and jax.process_index() == 0):
                store.write(compute(first))
                if interrupts:
                    raise KeyboardInterrupt
    except KeyboardInterrupt:
        if jax.process_count() > 1:
            raise
        warn(f"The study was stopped after {store.done} of {size} samples.")


@contextlib.contextmanager
def _interrupts() -> Iterator[list[int]]:
    """Interrupts from the keyboard: one that comes while a library cleans up is printed by Python, and else lost."""
    came: list[int] = []
    python = signal.default_int_handler
    if signal.getsignal(signal.SIGINT) is not python or threading.current_thread() is not threading.main_thread():
        yield came
        return

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)
        python(number, frame)

    signal.signal(signal.SIGINT, note)
    try:
        yield came
    finally:
        signal.signal(signal.SIGINT, python)


def whole(data: "xarray.Dataset") -> "xarray.Dataset":
    """A study that was not stopped from the keyboard: statistics of a part would look like those of all."""
    if data.attrs["done"] < data.attrs["samples"]:
        data.close()
        raise KeyboardInterrupt
    return data


def _padded(values: np.ndarray, size: int) -> np.ndarray:
    """The last sample repeated, so that all chunks have one size and one program."""
    missing = size - len(values)
    return np.concatenate([values, np.repeat(values[-1:], missing, axis=0)]) if missing else values
