"""All solutions of the frictional equations (25) under a closure that a search finds.

tau = law(rho0 + K tau) can have several solutions once friction no longer contracts. The search takes the default
solution and runs Newton's method from many random loads, of sizes from a tenth to a thousand times those without
friction, all in one batch, and keeps what differs. Finding no more is no proof that there are no more.
"""

from typing import cast

import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Bool, Float

from .._closures._closure import AbstractClosure, MinimumNorm, elasticity
from .._equations._factorisation import Factorisation
from .._equations._factorize import dense_at
from .._solvers._continuation import Continuation
from .._solvers._friction_problem import FrictionProblem
from .._solvers._solver import AbstractSolver, Newton, Root
from .._system._names import ByName, senses
from .._system._results import RESULTS, is_one_of
from .._system._state import State
from .._system._system import AbstractSystem, refuse_contacts
from .._tools._module import floats
from .._tools._numbers import Numeric, computed, xp
from ._reduced import reduce
from ._solution import Solution
from ._solve import solve

SEARCH_STARTS = 1000  # random initial loads of a search
_MINIMUM_NORM = MinimumNorm()


@computed
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
    refuse_contacts("frictional_solutions", system)
    system, factor = dense_at(system, state, rank, factor)
    options = {"closure": closure, "sense": sense, "factor": factor}
    first = solve(system, state, **options, throw=False)
    if not is_one_of(first.result, RESULTS.successful, RESULTS.no_solution_found):
        solve(system, state, **options, throw=True)
    if not system.friction:
        return [first]
    slips, chosen = senses(system.slips, sense), elasticity(closure, system, state)
    reduced = reduce(system.anonymous, state, factor, chosen, sense=slips)
    problem, response = cast(FrictionProblem, reduced.problem), reduced.response
    tau, found = search(problem.alone, start_factors(reduced.rows.size, starts, seed))
    size = xp.max(xp.abs(tau[0] / problem.friction_size), axis=1)
    rtol = 100 * xp.finfo(size.dtype).eps * xp.maximum(size, 1.0)
    order = [k for k in np.argsort(size) if found[0, k]]
    guesses = [xp.concatenate(response.at(tau[0, k])) for k in order]
    batch = [
        solve(system, state, x0=guess, **options, solver=Newton(rtol[k]), throw=False)
        for guess, k in zip(guesses, order, strict=True)
    ]
    return [solution for solution in batch if is_one_of(solution.result, RESULTS.successful)]


def start_factors(loads: int, starts: int, seed: int) -> Float[np.ndarray, "starts l"]:
    """Random loads relative to the largest of their kind."""
    random = np.random.default_rng(seed)
    scale = 10 ** random.uniform(-1, 3, (starts, 1))
    return np.asarray(floats(scale * random.standard_normal((starts, loads))))


def search(
    problem: FrictionProblem, factors: Float[np.ndarray, "starts l"]
) -> tuple[Float[np.ndarray, "s starts+1 p"], Bool[np.ndarray, "s starts+1"]]:
    """Where the default solver and Newton's method from random loads end, for each problem of a batch on numbers, and
    which ends are solutions that differ."""
    start = problem.law(problem.rho0)
    first, good = _default(problem, start)
    if not len(factors):
        return first[:, None], good[:, None]
    newton, count = Newton(), len(factors)
    many = problem.of(np.repeat(np.arange(len(start)), count))
    begin = np.tile(factors, (len(start), 1)) * many.load_size
    tau = newton.run(many, many.law(begin)).tau
    others = newton.run(many.sized_at(tau), tau)
    tau, found = (x.reshape(len(start), count, *x.shape[1:]) for x in (others.tau, _converged(newton, others)))
    tau, left = np.concatenate([first[:, None], tau], axis=1), np.concatenate([good[:, None], found], axis=1)
    out, each, near = np.zeros_like(left), np.arange(len(start)), 10 * xp.finfo(tau.dtype).eps ** 0.5
    while left.any():  # the first that is left of each, and all that are the same: no fold tells nearer ones apart
        one, some = left.argmax(axis=1), left.any(axis=1)
        out[each, one] |= some
        sizes = problem.friction_size[:, None]
        apart = np.max(np.abs(tau - tau[each, one][:, None]) / sizes, axis=2, initial=0.0)
        size = np.max(np.abs(tau[each, one][:, None]) / sizes, axis=2, initial=xp.finfo(tau.dtype).tiny)
        left &= ~(apart <= near * size)
        left[each, one] = False
    return tau, out


def _default(problem: FrictionProblem, start: Numeric) -> tuple[Numeric, Numeric]:
    """Friction of the solution on the branch from zero friction, and whether there is one."""
    if not problem.rho0.shape[1]:  # friction independent of load, (24)
        return start, np.ones(len(start), bool)
    newton, solver = Newton(), Continuation()
    root = newton.run(problem, start)
    tau, good = root.tau, _converged(newton, root) & (problem.contraction(problem.loads(root.tau)) < 1)
    if not np.all(good):  # the branch is followed
        rest = solver.run(problem.of(~good), start[~good])
        tau[~good], good[~good] = rest.tau, _converged(solver, rest)
    return tau, good


def _converged(solver: AbstractSolver, root: Root) -> Numeric:
    return root.progress.converged(solver.tolerance(root.tau.dtype))
