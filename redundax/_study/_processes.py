"""Arrays and decisions that several processes share (`jax.distributed`); with one process nothing is sent."""

from collections.abc import Callable

import jax
import numpy as np
from jax.experimental import multihost_utils
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Array, PyTree


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


def fetched(values: Array) -> np.ndarray:
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
        raise ValueError(problem or "Process 0 refused the study: its error says why.")


def meet(place: str) -> None:
    """Wait until all processes are here."""
    if jax.process_count() > 1:
        multihost_utils.sync_global_devices(place)
