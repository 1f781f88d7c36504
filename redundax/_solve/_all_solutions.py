"""All solutions of the frictional equations (25) under a closure that a search finds.

tau = law(rho0 + K tau) can have several solutions once friction no longer contracts. The search takes the default
solution and runs Newton's method from many random loads, of sizes from a tenth to a thousand times those without
friction, all in one batch, and keeps what differs. Finding no more is no proof that there are no more.
"""

from typing import cast

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float

from .._closures._closure import AbstractClosure, Elasticity, MinimumNorm, elasticity
from .._equations._factorisation import Factorisation
from .._equations._factorize import dense_at
from .._solvers._continuation import Continuation
from .._solvers._friction_problem import FrictionProblem
from .._solvers._solver import AbstractSolver, Newton, Root
from .._system._names import ByName, senses
from .._system._results import RESULTS, is_one_of
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._compilation import compiled
from .._tools._module import floats, on_device
from ._reduced import reduce
from ._solution import Solution
from ._solve import solve

SEARCH_STARTS = 1000  # random initial loads of a search
_MINIMUM_NORM = MinimumNorm()


def frictional_solutions(
    system: AbstractSystem,
    state: State,
    *,
    closure: AbstractClosure = _MINIMUM_NORM,
    sense: ByName | None = None,
    rank: ArrayLike | None = None,
    factor: Factorisation | None = None,
    starts: int = SEARCH_STARTS,
    seed: int = 0,
) -> list[Solution]:
    """Solutions of (25) at a state, under one closure: those that a search from many starts finds.

    ??? example

        ```python
        found = rx.frictional_solutions(mechanism, state)
        [solution.friction for solution in found]
        ```

    **Arguments:**

    - `system`, `state`: concrete values; not inside `jit` or `vmap`.
    - `closure`, `sense`, `rank`, `factor`: as in `solve`.
    - `starts`: number of random initial loads.
    - `seed`: of their random numbers.

    **Returns:** successful solutions that differ, by increasing largest friction; an empty list if none was found.

    **Raises:** `RuntimeError` where the equations cannot be trusted at all, whatever the friction, as `solve` does.
    """
    system, factor = dense_at(system, state, rank, factor)
    options = {"closure": closure, "sense": sense, "factor": factor}
    first = solve(system, state, **options, throw=False)
    if not is_one_of(first.result, RESULTS.successful, RESULTS.no_solution_found):
        solve(system, state, **options, throw=True)
    if not system.friction:
        return [first]
    factors = start_factors(sum(group.rows.size for group in system.friction), starts, seed)
    slips, chosen = senses(system.slips, sense), elasticity(closure, system, state)
    guesses, found, size = _guesses(system.anonymous, state, factor, chosen, slips, factors)
    order, rtol = np.argsort(np.asarray(size)), 100 * jnp.finfo(size.dtype).eps * jnp.maximum(size, 1.0)
    batch = [
        solve(system, state, x0=guesses[k], **options, solver=Newton(rtol[k]), throw=False) for k in order if found[k]
    ]
    return [solution for solution in batch if is_one_of(solution.result, RESULTS.successful)]


@compiled
def _guesses(
    system: AbstractSystem, state: State, factor: Factorisation, chosen: Elasticity, sense: Array | None, factors: Array
) -> tuple[Array, Array, Array]:
    """[qdd; lam] of what the search ends with, which of them are solutions that differ, and their largest friction."""
    reduced = reduce(system, state, factor, chosen, sense=sense)
    problem = cast(FrictionProblem, reduced.problem)
    tau, found = search(problem, factors, Continuation())
    ends = jax.vmap(lambda tau: jnp.concatenate(reduced.response.at(tau)))(tau)
    return ends, found, jnp.max(jnp.abs(tau / problem.friction_size), axis=1)


def start_factors(loads: int, starts: int, seed: int) -> Float[Array, "starts l"]:
    """Random loads relative to the largest of their kind."""
    random = np.random.default_rng(seed)
    scale = 10 ** random.uniform(-1, 3, (starts, 1))
    return on_device(floats(scale * random.standard_normal((starts, loads))))


def search(
    problem: FrictionProblem, factors: Float[Array, "starts l"], default: AbstractSolver
) -> tuple[Float[Array, "starts+1 p"], Bool[Array, " starts+1"]]:
    """Where a solver and Newton's method from random loads end, and which ends are solutions that differ.

    The `default` may be the first attempt of one, whose fold is 0 where it does not settle the matter.
    """
    if not problem.rho0.size:  # friction independent of load, (24)
        return problem.law(problem.rho0)[None], jnp.ones(1, bool)
    newton = Newton()
    first = default.run(problem, problem.law(problem.rho0))
    good = (default.result(first.progress) == RESULTS.successful) & (first.fold > 0)
    if not len(factors):
        return first.tau[None], good[None]

    def from_loads(factor: Array) -> Root:
        tau = newton.run(problem, problem.law(factor * problem.load_size)).tau
        return newton.run(problem.sized_at(tau), tau)

    others = jax.vmap(from_loads)(factors)
    tau = jnp.concatenate([first.tau[None], others.tau])
    found = jnp.append(good, jax.vmap(lambda p: p.converged(newton.tolerance(tau.dtype)))(others.progress))
    near = jax.vmap(lambda one: jax.vmap(lambda other: same(problem, one, other))(tau))(tau)
    before = jnp.tril(jnp.ones_like(near), -1)
    return tau, found & ~jnp.any(near & before & found, axis=1)


def same(problem: FrictionProblem, one: Float[Array, " p"], other: Float[Array, " p"]) -> Bool[Array, ""]:
    """Whether two solutions are one: nearer than the square root of rounding, as no fold can be told from."""
    size = jnp.max(jnp.abs(one) / problem.friction_size)
    near = 10 * float(jnp.finfo(one.dtype).eps) ** 0.5
    return problem.change_of_friction(one - other) <= near * jnp.maximum(size, jnp.finfo(one.dtype).tiny)
