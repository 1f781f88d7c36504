"""How far a system's accelerations and loads vary along its self-stress.

Each self-stress state s_i of `analyze` (scaled so that one multiplier is 1) is added to the minimum-norm
multipliers with amplitudes from -a to a: with friction every sample solves

    lam = lam_MP(F(lam)) + z s_i,                                                             (9), (27)

which is the paper's h = [0; z s_i]. Where a sample has no solution found, its figures are NaN. Samples are solved in
chunks of one size, so that any number of them needs one compiled program and little more memory than its figures.
"""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ._analyze import Report, analyze
from ._closure import MinimumNorm
from ._culprits import culprits
from ._friction import slip_kinds
from ._results import RESULTS
from ._solve import solve
from ._state import State
from ._system import AbstractSystem

_CHUNK = 8192  # samples solved at once


@dataclasses.dataclass(frozen=True)
class Sweep:
    """Solutions along one self-stress state.

    - `multiplier`: name of the multiplier that the state has as 1, and that `z` adds to.
    - `z`: amplitudes, shape (samples,), in units of that multiplier.
    - `names`: of accelerations, multipliers and friction, n + m + p.
    - `kinds`: "linear", "angular", "force", "moment" or "friction" for each name.
    - `values`: shape (samples, n + m + p), NaN where no solution was found.
    """

    multiplier: str
    z: np.ndarray
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    values: np.ndarray

    @property
    def failed(self) -> int:
        """Number of samples without a solution."""
        return int(np.sum(np.isnan(self.values).any(axis=1)))

    def to_dict(self) -> dict[str, Any]:
        """Plain Python data; figures of samples without a solution become None."""
        values = [[None if np.isnan(x) else float(x) for x in row] for row in self.values]
        return {"multiplier": self.multiplier, "z": self.z.tolist(), "names": list(self.names), "values": values}

    def __str__(self) -> str:
        size = max(len(name) for name in self.names) + 2
        middle = int(np.argmin(np.abs(self.z)))
        lines = [
            f"Along the self-stress state of {self.multiplier}, from {self.z[0]:.4g} to {self.z[-1]:.4g} about the "
            "minimum norm:",
            f"{'':{size}}{'at 0':>14}{'least':>14}{'largest':>14}",
        ]
        if self.failed == self.z.size:
            return "\n".join([*lines, "no sample has a solution"])
        least, largest = np.nanmin(self.values, axis=0), np.nanmax(self.values, axis=0)
        sizes = np.maximum(np.abs(least), np.abs(largest))
        for k, name in enumerate(self.names):
            size_of_kind = max(sizes[j] for j, kind in enumerate(self.kinds) if kind == self.kinds[k])
            same = largest[k] - least[k] <= 1e-9 * size_of_kind
            figures = (self.values[middle, k], least[k], largest[k])
            row = "".join(f"{x if abs(x) > 1e-12 * size_of_kind else 0.0:14.6g}" for x in figures)
            lines.append(f"{name:{size}}{row}  {'the same' if same else 'varies'}")
        if self.failed:
            lines.append(f"{self.failed} of {self.z.size} samples have no solution that was found.")
        return "\n".join(lines)


def sweep_self_stress(
    system: AbstractSystem,
    state: State,
    amplitude: float | None = None,
    samples: int = 201,
    watch: Callable[[Sequence[Any]], Iterable[Any]] = iter,
) -> tuple[Report, list[Sweep]]:
    """Report and one sweep for each self-stress state of a system at a state; none where it has a problem.

    **Arguments:**

    - `system`, `state`: concrete values.
    - `amplitude`: largest z; by default the largest multiplier at minimum norm over the largest entry of the
      self-stress state.
    - `samples`: number of amplitudes, odd ones include 0.
    - `watch`: passes the steps of the work on, one by one, and may tell how far it is.
    """
    report = analyze(system, state)
    if report.problem:
        return report, []
    slips = slip_kinds(system.friction)
    names = (
        *(f"{name}''" for name in system.coordinates.labels),
        *system.rows.labels,
        *(f"tau {name}" for name in slips.labels),
    )
    kinds = (*system.coordinates.kinds, *system.rows.kinds, *("friction" for _ in slips.kinds))
    pivots = [system.rows.labels[int(np.argmax(stress == 1.0))] for stress in report.self_stress]
    base = solve(system, state, throw=False)
    if base.result != RESULTS.successful:
        problem = RESULTS[base.result] + culprits(system, state, base.result)
        return dataclasses.replace(report, problem=problem), []
    largest = float(jnp.max(jnp.abs(base.multipliers)))
    reach = [amplitude or largest / np.abs(stress).max() for stress in report.self_stress]
    sweeps = [
        Sweep(pivot, np.linspace(-end, end, samples), names, kinds, np.empty((samples, len(names))))
        for pivot, end in zip(pivots, reach, strict=True)
    ]
    size, bare = min(samples, _CHUNK), system.anonymous()
    for number, start in watch([(k, start) for k in range(len(sweeps)) for start in range(0, samples, size)]):
        z = sweeps[number].z[start : start + size]
        padded = np.pad(z, (0, size - z.size), mode="edge")
        values = _solve_along(bare, state, jnp.asarray(report.self_stress[number]), jnp.asarray(padded))
        sweeps[number].values[start : start + size] = values[: z.size]
    return report, sweeps


@eqx.filter_jit
def _solve_along(system: AbstractSystem, state: State, stress: jax.Array, z: jax.Array) -> jax.Array:
    """Accelerations, multipliers and friction at all amplitudes."""

    def figures(z: jax.Array) -> jax.Array:
        h = jnp.concatenate([jnp.zeros_like(state.qd), z * stress])
        found = solve(system, state, closure=MinimumNorm(h), throw=False)
        return jnp.concatenate([found.acceleration, found.multipliers, found.friction])

    return jax.vmap(figures)(z)
