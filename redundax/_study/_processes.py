"""Arrays and decisions that several processes share (`jax.distributed`); with one process nothing is sent."""

import os
from collections.abc import Callable

import jax
import numpy as np
from jax.experimental import multihost_utils
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Array, PyTree

from .._tools._errors import RedundaxError
from .._tools._module import check_kind, cores


def spread(function: Callable[[PyTree], PyTree], mesh: Mesh | None) -> Callable[[PyTree], PyTree]:
    """A compiled function of host arrays, each device taking its share of their leading axis."""
    if mesh is None:
        return jax.jit(function)
    spec = PartitionSpec(mesh.axis_names)
    sharding = NamedSharding(mesh, spec)
    # Nothing is sent between devices, so there is nothing for the check of what varies over them to find.
    program = jax.jit(jax.shard_map(function, mesh=mesh, in_specs=spec, out_specs=spec, check_vma=False))

    def placed(values: np.ndarray) -> Array:
        return jax.make_array_from_callback(values.shape, sharding, lambda index: values[index])

    return lambda tree: program(jax.tree.map(placed, tree))


def check_threads(mesh: Mesh | None) -> None:
    """Refuse CPU devices of this process whose batched LAPACK calls could wait for each other for ever.

    They split into tasks for the threads of XLA's pool, which all devices share, and wait for them in one of these.
    """
    if mesh is not None:
        check_kind(
            "mesh", mesh, Mesh, "a mesh of devices", "Give `jax.make_mesh((len(jax.devices()),), ('all',))`, say."
        )
    here = [] if mesh is None else [d for d in mesh.devices.flat if d.platform == "cpu"]
    count = sum(device.process_index == jax.process_index() for device in here)
    given = os.environ.get("PJRT_NPROC") or os.environ.get("NPROC")
    threads = int(given) if given and given.isdigit() else cores()
    if count > 1 and threads < 2 * count:
        raise RedundaxError(
            f"Argument `mesh` has {count} CPU devices of this process, but XLA's pool of {threads} threads could leave "
            f"them waiting for each other. Start Python anew with the environment variable PJRT_NPROC={2 * count}."
        )


def fetch(values: Array) -> np.ndarray:
    """All of an array, in every process."""
    if values.is_fully_addressable:
        return np.asarray(values)
    return np.asarray(multihost_utils.process_allgather(values, tiled=True))


def of_first(value: int) -> int:
    """The value that process 0 has."""
    if jax.process_count() == 1:
        return value
    high, low = multihost_utils.broadcast_one_to_all(np.array(divmod(value, 2**30), np.int32))
    return int(high) * 2**30 + int(low)


def refuse(problem: str) -> None:
    """Raise in every process where process 0 has a problem."""
    if of_first(bool(problem)):
        raise RedundaxError(problem or "Process 0 refused the study: its error says why.")


def meet(place: str) -> None:
    """Wait until all processes are here."""
    if jax.process_count() > 1:
        multihost_utils.sync_global_devices(place)
