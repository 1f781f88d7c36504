"""What must be set before JAX starts, and batches over the devices that a benchmark has."""

import os
from collections.abc import Callable
from typing import Any

# On two-core CPUs independent LAPACK calls in one compiled step can wait for each other, see tests/conftest.py.
_SCHEDULER, _IN_ORDER = "--xla_cpu_scheduler_type", "CPU_SCHEDULER_TYPE_MEMORY_OPTIMIZED"


def prepare(devices: int = 1) -> None:
    """Set XLA's flags, which it reads once, when the first backend starts; and make that many devices of the CPU.

    They share a pool of threads, of which not all may wait for LAPACK calls of the others.
    """
    if _SCHEDULER not in os.environ.get("XLA_FLAGS", ""):
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {_SCHEDULER}={_IN_ORDER}".strip()
    if devices > 1:
        os.environ.setdefault("PJRT_NPROC", str(2 * devices))
        import jax

        jax.config.update("jax_num_cpu_devices", devices)


def batched(run: Callable) -> Callable:
    """A batch of runs, compiled, each device with its share."""
    import jax

    if jax.device_count() == 1:
        return jax.jit(jax.vmap(run))
    mesh, share = _mesh()
    return jax.jit(jax.shard_map(jax.vmap(run), mesh=mesh, in_specs=share, out_specs=share, check_vma=False))


def placed(values: Any) -> Any:
    """An array with a share of its leading axis on each device."""
    import jax

    return jax.device_put(values, jax.sharding.NamedSharding(*_mesh()))


def _mesh() -> tuple[Any, Any]:
    import jax

    return jax.sharding.Mesh(jax.devices(), "core"), jax.sharding.PartitionSpec("core")
