"""All solutions of the frictional equations (25) under a closure that a search finds.

tau = law(rho0 + K tau) can have several solutions once friction no longer contracts. The search runs Newton's method
from the default solution and from many random loads, of sizes from a tenth to a thousand times those without
friction, all in one batch, and keeps what differs. Finding no more is no proof that there are no more.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array

from ._closure import AbstractClosure, MinimumNorm
from ._friction import slip_kinds
from ._module import Numbers
from ._reduced import reduce
from ._results import RESULTS
from ._solution import Solution
from ._solve import solve
from ._solver import Newton
from ._state import State
from ._system import AbstractSystem

_MINIMUM_NORM = MinimumNorm()
_SAME = 1e4  # roundings, relative to the largest friction of its kind, within which two solutions are one


def frictional_solutions(
    system: AbstractSystem,
    state: State,
    *,
    closure: AbstractClosure = _MINIMUM_NORM,
    sense: Numbers | None = None,
    rank: ArrayLike | None = None,
    starts: int = 1000,
    seed: int = 0,
) -> list[Solution]:
    """The solutions of a system with friction at a state, under one closure, that a search from many starts finds.

    **Arguments:**

    - `system`, `state`: concrete values; not inside `jit` or `vmap`.
    - `closure`, `sense`, `rank`: as in `solve`.
    - `starts`: number of random initial loads.
    - `seed`: of their random numbers.

    **Returns:** successful solutions that differ, by increasing largest friction; an empty list if none was found.

    **Raises:** `RuntimeError` where the equations cannot be trusted at all, whatever the friction, as `solve` does.
    """
    options = {"closure": closure, "sense": sense, "rank": rank}
    first = solve(system, state, **options, throw=False)
    if first.result not in (RESULTS.successful, RESULTS.no_solution_found):
        solve(system, state, **options, throw=True)
    guesses = _initial_loads(system, state, closure, rank, starts, seed)
    found = _solve_from(system.anonymous(), state, closure, sense, rank, guesses)
    batch = jax.tree.map(lambda one, many: jnp.concatenate([one[None], many]), first, found)
    good = np.flatnonzero(np.asarray(batch.result == RESULTS.successful))
    tau = np.asarray(batch.friction)[good]
    return [
        jax.tree.map(lambda x, k=good[k]: x[k], batch) for k in _different(tau, slip_kinds(system.friction).angular)
    ]


def _initial_loads(
    system: AbstractSystem, state: State, closure: AbstractClosure, rank: ArrayLike | None, starts: int, seed: int
) -> Array:
    """x0 of each start, shape (starts, n + m)."""
    declared = None if rank is None else jnp.asarray(rank)
    angular, size = np.asarray(system.rows.angular), np.abs(_frictionless(system.anonymous(), state, closure, declared))
    size = np.where(angular, size[angular].max(initial=0.0), size[~angular].max(initial=0.0))
    size = np.where(size > 0, size, 1.0)
    random = np.random.default_rng(seed)
    scale = 10 ** random.uniform(-1, 3, (starts, 1))
    loads = scale * size * random.standard_normal((starts, size.size))
    return jnp.asarray(np.concatenate([np.zeros((starts, state.qd.size)), loads], axis=1), state.qd.dtype)


@eqx.filter_jit
def _frictionless(system: AbstractSystem, state: State, closure: AbstractClosure, rank: Array | None) -> Array:
    """Multipliers under the closure."""
    return reduce(system, state, closure, rank=rank).free.multipliers


@eqx.filter_jit
def _solve_from(
    system: AbstractSystem,
    state: State,
    closure: AbstractClosure,
    sense: Numbers | None,
    rank: ArrayLike | None,
    guesses: Array,
) -> Solution:
    options = {"closure": closure, "sense": sense, "rank": rank, "solver": Newton()}
    return jax.vmap(lambda x0: solve(system, state, x0=x0, **options, throw=False))(guesses)


def _different(tau: np.ndarray, angular: np.ndarray) -> list[int]:
    """Indices of solutions no two of which are the same, by increasing friction."""
    if not tau.size:
        return list(range(min(len(tau), 1)))
    size = np.where(angular, *(np.abs(tau[:, kind]).max(initial=0.0) for kind in (angular, ~angular)))
    scaled = tau / np.where(size > 0, size, 1.0)
    out: list[int] = []
    for k in np.argsort(np.abs(scaled).max(axis=1)):
        largest = np.abs(scaled[k]).max()
        near = _SAME * np.finfo(tau.dtype).eps * max(largest, np.finfo(tau.dtype).tiny)
        if all(np.abs(scaled[k] - scaled[other]).max() > near for other in out):
            out.append(int(k))
    return out
