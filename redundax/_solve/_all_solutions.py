"""All solutions of the frictional equations (25) under a closure that a search finds.

tau = law(rho0 + K tau) can have several solutions once friction no longer contracts. The search takes the default
solution and runs Newton's method from many random loads, of sizes from a tenth to a thousand times those without
friction, all in one batch, and keeps what differs. Finding no more is no proof that there are no more.
"""

import itertools
from collections.abc import Iterator
from typing import cast

import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float

from .._closures._closure import AbstractClosure, Elasticity, MinimumNorm, elasticity, without_rows
from .._equations._factorisation import Factorisation, factorised
from .._equations._factorize import dense_at
from .._solvers._continuation import Continuation
from .._solvers._friction_problem import FrictionProblem
from .._solvers._solver import AbstractSolver, Newton, Root
from .._system._contact import Contact, code_of, refuse_declared, rows_that_hold
from .._system._names import ByName, senses
from .._system._results import RESULTS, is_one_of
from .._system._state import State
from .._system._system import AbstractSystem, check_system
from .._tools._errors import RedundaxError
from .._tools._module import check_seed, check_whole, floats, replace_fields
from .._tools._numbers import Numeric, or_one, xp
from .._tools._questions import question
from ._contacts import CLEAR, as_held, contacts_at, signs, strains, with_rows
from ._reduced import reduce
from ._solution import Solution
from ._solve import solve, solve_factorised

SEARCH_STARTS = 1000  # random initial loads of a search
_MOST_CLOSED = 8  # contacts, of which 256 sets are tried
_MINIMUM_NORM = MinimumNorm()


@question
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
    - `closure`, `sense`, `rank`, `factor`: as in `solve`. With one-sided contacts the search is made for every set of
      those that are closed, 8 at most, and keeps what pushes in it and does not close outside of it.
    - `starts`: number of random initial loads.
    - `seed`: of their random numbers.

    **Returns:** successful solutions that differ, by increasing largest friction; an empty list if none was found.

    **Raises:** `RuntimeError` where the equations cannot be trusted at all, whatever the friction, as `solve` does.
    """
    check_system(system)
    check_whole(0, starts=starts)
    check_seed(seed)
    if system.names.one_sided:
        refuse_declared(system.names, rank=rank, factor=factor)
        return _with_contacts(system, state, closure, senses(system.slips, sense), (starts, seed))
    system, factor = dense_at(system, state, rank, factor)
    options = {"closure": closure, "sense": sense, "factor": factor}
    first = solve(system, state, **options, throw=False)
    if not is_one_of(first.result, RESULTS.successful, RESULTS.no_solution_found):
        solve(system, state, **options, throw=True)
    if not system.friction:
        return [first]
    chosen = elasticity(closure, system, state)
    found = _searched(system, state, factor, chosen, senses(system.slips, sense), (starts, seed))
    batch = [solve(system, state, x0=guess, **options, solver=solver, throw=False) for guess, solver in found]
    return [solution for solution in batch if is_one_of(solution.result, RESULTS.successful)]


def _searched(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    chosen: Elasticity,
    slips: Array | None,
    effort: tuple[int, int],
) -> list[tuple[Array, Newton]]:
    """Guesses [qdd; lam] of solutions, and solvers that end at them, by increasing largest friction."""
    reduced = reduce(system.anonymous, state, factor, chosen, sense=slips)
    problem, response = cast(FrictionProblem, reduced.problem), reduced.response
    tau, found = search(problem.alone, start_factors(reduced.rows.size, *effort))
    size = xp.max(xp.abs(tau[0] / problem.friction_size), axis=1)
    rtol = 100 * xp.finfo(size.dtype).eps * xp.maximum(size, 1.0)
    order = [k for k in np.argsort(size) if found[0, k]]
    return [(xp.concatenate(response.at(tau[0, k])), Newton(rtol[k])) for k in order]


def _with_contacts(
    system: AbstractSystem, state: State, closure: AbstractClosure, slips: Array | None, effort: tuple[int, int]
) -> list[Solution]:
    """Those of all sets of closed contacts in which the ones that are kept push and the others do not close."""
    names = system.names
    first = solve(system, state, closure=closure, sense=slips, throw=False)
    if not is_one_of(first.result, RESULTS.successful, RESULTS.no_solution_found, RESULTS.contacts_undecided):
        solve(system, state, closure=closure, sense=slips, throw=True)
    if not system.friction:
        return [first]
    closed, at = contacts_at(system, state)
    every = elasticity(closure, system, state)
    if np.sum(closed) > _MOST_CLOSED:
        raise RedundaxError(
            f"Argument `system` must have at most {_MOST_CLOSED} closed contacts here, of which every set is tried, "
            f"but has {int(np.sum(closed))}. Ask `solve` for one solution, or hold contacts that carry in all of them."
        )
    rows, found = np.array(names.one_sided), list[Solution]()
    tied = np.array([bool(own) for own in names.tied] or [False] * rows.size)
    for loaded, rolling in _sets(np.asarray(closed), tied):
        kept = rows_that_hold(names, loaded, rolling)
        held, own = as_held(system, kept), without_rows(every, kept)
        factor = factorised(held, state, None)
        for guess, solver in _searched(held, state, factor, own, slips, effort):
            solution = solve_factorised(held.anonymous, state, factor, own, solver, guess, slips)
            if not is_one_of(solution.result, RESULTS.successful):
                continue
            whole = with_rows(own, kept, every)
            wrong, _, does, _ = signs(rows, closed, kept, at, (factor, solution, whole))
            touching = np.isin(does, [code_of(Contact.touches), code_of(Contact.carries)])
            beside, own_rows = touching & ~np.asarray(kept)[rows], np.array_equal(rolling, touching & tied)
            bent = whole.compliance @ solution.multipliers - whole.misfit
            left, free = (np.asarray(x)[beside] for x in strains(rows, kept, at[0], factor, bent))
            if not np.any(wrong > 0) and own_rows and _has_room(left / or_one(np.max(np.abs(bent))), free):
                redundancy = solution.stats.redundancy - np.sum(~kept)
                stats = replace_fields(solution.stats, redundancy=redundancy)
                found.append(replace_fields(solution, contact=does, stats=stats))
    found.sort(key=lambda solution: float(np.max(np.abs(solution.friction))))
    told = {"names": names, "state": state, "joint_coordinates": system.joint_coordinates}
    return [replace_fields(solution, **told) for solution in _different(found)]


def _has_room(strain: np.ndarray, free: np.ndarray) -> bool:
    """Whether contacts that touch stay clear of load somewhere along what the others leave free, as they give way."""
    from scipy.optimize import linprog  # here, because its import takes a second

    if np.all(strain >= -CLEAR):
        return True
    most = linprog(
        np.r_[np.zeros(free.shape[1]), -1.0],
        np.hstack([free, np.ones((len(free), 1))]),
        strain,
        bounds=[(None, None)] * free.shape[1] + [(None, 0.0)],
    )
    return most.status == 0 and -most.fun >= -CLEAR


def _sets(closed: np.ndarray, tied: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Which contacts carry and which hold their rows of velocity, for all that is possible among closed ones."""
    none, rolls = (False, False), (False, True)
    ways = [
        ([none, rolls, (True, True)] if has_tied else [none, (True, False)]) if is_closed else [none]
        for is_closed, has_tied in zip(closed, tied, strict=True)
    ]
    for chosen in itertools.product(*ways):
        loaded, rolling = zip(*chosen, strict=True)
        yield np.array(loaded, bool), np.array(rolling, bool)


def _different(solutions: list[Solution]) -> list[Solution]:
    """One of each that are the same, as where a contact that touches is kept or is not."""
    kept, near = list[Solution](), 10 * np.finfo(float).eps ** 0.5
    for solution in solutions:
        own = _arrays(solution)
        if all(np.max(np.abs(own - _arrays(other))) > near * np.max(np.abs(own)) for other in kept):
            kept.append(solution)
    return kept


def _arrays(solution: Solution) -> np.ndarray:
    return np.concatenate([solution.acceleration, solution.multipliers, solution.friction])


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
