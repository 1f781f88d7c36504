"""Solving the index-1 equations (7), (25) for accelerations, multipliers and friction at a state.

The equations are reduced to the friction forces (`_reduced`), solved for them, and all else is recovered. Without
friction nothing iterates.
"""

import contextlib
import functools
import operator
from typing import Any, cast

import equinox as eqx
import jax
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, PyTree

from .._closures._closure import (
    AbstractClosure,
    Compliance,
    Elasticity,
    MinimumNorm,
    check_closure,
    elasticity,
    minimum_norm,
)
from .._closures._elastic_joints import ElasticJoints
from .._closures._play import warn_of_idle_play
from .._closures._unit_check import check_units
from .._equations._culprits import thrown
from .._equations._factorisation import Factorisation
from .._equations._factorize import dense_at, factorisation_at
from .._equations._matrices import matrices_of
from .._equations._response import AbstractSolvedFactorisation, Response, times
from .._solvers._continuation import Continuation
from .._solvers._friction_problem import AbstractFrictionProblem, FrictionProblem
from .._solvers._iterate import Progress
from .._solvers._open_newton import open_root
from .._solvers._open_problem import OpenProblem
from .._solvers._solver import AbstractSolver, Newton, Root, check_solver, closed_root, with_rtol
from .._system._names import ByName, vector
from .._system._results import RESULTS, differs, first_failure, is_one_of
from .._system._results import chosen as chosen_result
from .._system._state import State
from .._system._system import AbstractSystem, check_system_at
from .._tools._chunks import alike, in_chunks, with_derivative_of
from .._tools._compilation import compiled
from .._tools._computing import computing, is_computing
from .._tools._errors import RedundaxError
from .._tools._module import Numbers, as_float, is_concrete, replace_fields
from .._tools._no_answer import nan_where
from .._tools._numbers import are_known, as_arrays, as_numbers, each, is_number, on_numbers, stop_gradient, take, xp
from ._contacts import active_set, all_kept, of_rows
from ._play import at_sides, two_sided, with_play_of_contacts
from ._reduced import Reduced, reduce
from ._solution import Solution, Stats

_MINIMUM_NORM, _CONTINUATION, _NEWTON = MinimumNorm(), Continuation(), Newton()
# Failures that a solver is to blame for; those of the state and the closure come before them.
_OF_ITERATION = (RESULTS.diverged, RESULTS.no_contraction, RESULTS.max_steps_reached, RESULTS.no_solution_found)
_OF_FRICTION = (RESULTS.friction_at_rest, RESULTS.ambiguous_rest, *_OF_ITERATION)


def solve(
    system: AbstractSystem,
    state: State,
    *,
    closure: AbstractClosure | None = _MINIMUM_NORM,
    solver: AbstractSolver | None = None,
    x0: Numbers | None = None,
    sense: ByName | None = None,
    rank: ArrayLike | None = None,
    factor: AbstractSolvedFactorisation | None = None,
    throw: bool | None = None,
) -> Solution:
    """Accelerations, multipliers and friction of a system at a state: (7), with friction (24) or (25).

    ??? example

        ```python
        solution = rx.solve(mechanism, state)
        solution.acceleration[8]  # of the crank, rad/s^2
        hs = jnp.linspace(-100.0, 100.0, 5)
        jax.vmap(lambda h: rx.solve(mechanism, state, closure=rx.MinimumNorm(h)).acceleration)(hs)
        ```

    **Arguments:**

    - `system`: a `Mechanism` or `System`.
    - `state`: position, velocity and time, on the constraint manifold.
    - `closure`: which of the multipliers to take where they are not unique; joints may have play. `None` leaves the
      choice to Newton's open iteration (38) from `x0`, whose end point depends on `x0`.
    - `solver`: used where friction depends on load: `Continuation()` if not given, `Newton()` or `FixedPoint()`;
      without a closure `Newton()`.
    - `x0`: initial guess [qdd; lam], shape (n + m,), a number stands for that many equal entries; the
      solution without friction if not given.
    - `sense`: senses of the impending slip of frictional joints at rest, shape (p,), of which the sign counts; of
      sleeves, balls, plates and points on planes the direction in which their surfaces begin to slide. Joints that move
      have the sign of their slip rate. 0 leaves a sense open: where the friction of a joint at rest depends on it, as
      Coulomb's does, the result is `RESULTS.friction_at_rest`. Give 1 or -1 there, or ask `sticking` whether the
      mechanism stays at rest.
    - `rank`: declared rank of the constraint Jacobian; decided from its spectrum if not given.
    - `factor`: what `factorize` gave at this state, where it is there already.
    - `throw`: whether to raise an error unless the result is successful. By default it does outside of
      transformations such as `jit` and `vmap`, and does not inside, so that one bad sample does not end a sweep.

    At a singular position, where the rank of the constraints is lower than beside it, branches of motion meet. Where
    the velocity decides the branch the accelerations are those of the motion along it; multipliers of the rows that the
    self-stress of this position alone touches have no value and are NaN. Nothing decides at rest and where branches
    touch, and where friction depends on such a multiplier there is no limit: refused. So is every singular position
    where a transformation such as `jit`, `vmap` or `grad` traces something of the equations.

    **Returns:** a `Solution`; its arrays are NaN unless `result` is `RESULTS.successful`, and so are their derivatives,
    in both modes. A sample masked by its result, `jnp.where(solution.result == rx.RESULTS.successful, value, 0.0)`,
    adds nothing to the gradient of its batch. Where teeth pull, `pulling` names them, and unless `throw` is False a
    warning too, outside of transformations.

    **Raises:** `ValueError` for arguments that do not fit the system; `RuntimeError` with the message of
    the result where `throw` says so.
    """
    if closure is not None:
        check_closure(closure)
    if solver is not None:
        check_solver(solver)
    _check_state(system, state)
    n, m = len(system.coordinates), len(system.rows)
    if solver is None:
        solver = _NEWTON if closure is None else _CONTINUATION
    matrices = matrices_of(system)
    if closure is not None:
        solver = with_rtol(solver, matrices.rtol)
    if closure is None and not (isinstance(solver, Newton) and x0 is not None):
        raise RedundaxError(
            "Argument `closure` may be None only with `solver=Newton()` and an initial guess `x0`: without a "
            "closure the end point of (38) is chosen by `x0`. Give both, or a closure such as `MinimumNorm()`."
        )
    if x0 is not None:
        x0 = _vector("x0", x0, n + m, "[qdd; lam]").astype(state.qd.dtype)
    if sense is not None:
        sense = vector("sense", sense, system.slips, " of slips")
    given = system, state, rank, closure, solver, x0, sense
    if system.names.one_sided or (closure is not None and closure.clearances(system) is not None):
        solution, factor = _with_contacts(system, state, rank, closure, solver, (x0, sense))
        play = None if system.names.one_sided or closure is None else closure.clearances(system)
        if play is not None and are_known(factor, closure):
            warn_of_idle_play(play, np.asarray(cast(Any, factor).in_self_stress), system.rows.labels)
        return _told(solution, system, state, throw, factor)
    if factor is None and not are_known(system, state, rank):
        solution = _solved_at_each(*given)
    else:
        known = are_known(given, factor) and matrices.on_numbers
        own, at, rank, picked, solver, x0, sense = as_numbers(given) if known else given
        with computing():
            own, factor, chosen = _closed(own, at, rank, picked, as_numbers(factor) if known else factor)
        solution = solve_factorised(own.anonymous, at, factor, chosen, solver, x0, sense)
        if chosen is not None and isinstance(closure, Compliance | ElasticJoints) and are_known(factor, chosen):
            check_units(system.names, factor.length, closure, chosen, solution.multipliers)
    return _told(solution, system, state, throw, factor)


def _told(
    solution: Solution,
    system: AbstractSystem,
    state: State,
    throw: bool | None,
    factor: AbstractSolvedFactorisation | None,
) -> Solution:
    """The solution with names, or an error."""
    solution = replace_fields(solution, names=system.names, state=state, joint_coordinates=system.joint_coordinates)
    return thrown(solution, throw, system, state, factor, RESULTS.successful)


def _with_contacts(
    system: AbstractSystem,
    state: State,
    rank: ArrayLike | None,
    closure: AbstractClosure | None,
    solver: AbstractSolver,
    given: tuple[Array | None, Array | None],
) -> tuple[Solution, AbstractSolvedFactorisation]:
    """The solution with the one-sided contacts that carry and the sides of play, and its factorisation."""
    what = "`system` has one-sided contacts" if system.names.one_sided else "`closure` has play"
    refusal = (
        f"Argument {what}, for which `solve` takes a closure and dense matrices, and decides the rank itself. Give "
        "a closure, and leave out `rank` and `sparse()`."
    )
    if closure is None or rank is not None:
        raise RedundaxError(refusal)
    matrices_of(system).needs_dense(refusal)
    known = are_known(system, state, closure, solver, given)

    def alone(opened: AbstractSystem, state: State, factor: Factorisation, chosen: Elasticity, *of: PyTree) -> Solution:
        own = opened.anonymous, state, factor, chosen
        solution = solve_factorised(*own, solver, *(of or stop_gradient(given)))
        return solution if of or not system.friction else _swept_where_jammed(solution, *own, stop_gradient(given)[1])

    with computing() if known else contextlib.nullcontext():
        at, play = as_numbers((state, closure.clearances(system))) if known else (state, closure.clearances(system))
        rows = system.names.one_sided
        chosen = with_play_of_contacts(elasticity(closure, system, at, play=True), play, rows)
        of_set = of_rows(at_sides(two_sided(play, rows), alone), {} if known else None)
        found = active_set(system, at, chosen, of_set) if system.names.one_sided else all_kept(len(system.rows))
        factor, solution, _, is_found = of_set(system, at, chosen, found.kept, *given)
        settled = found.settled & is_found
    arrays = (solution.acceleration, solution.multipliers, solution.friction)
    lost = ~settled | differs(solution.result, RESULTS.successful)
    a, lam, tau = (nan_where(lost, x) for x in arrays)
    left = xp.sum(~found.kept)
    solution = replace_fields(
        solution,
        acceleration=a,
        multipliers=lam,
        friction=tau,
        contact=found.contacts,
        result=chosen_result(settled, solution.result, RESULTS.contacts_undecided),
        stats=replace_fields(
            solution.stats, spectrum=factor.spectrum, redundancy=factor.redundancy - left, freedom=factor.freedom
        ),
    )
    return (as_arrays(solution) if known and not is_computing() else solution), factor


def _swept_where_jammed(
    solution: Solution,
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    chosen: Elasticity,
    sense: Array | None,
) -> Solution:
    """With accelerations and loads of one sweep (27) where friction has no solution: under that of loads without it."""
    jams = ~differs(solution.result, RESULTS.no_solution_found)
    if is_concrete(jams) and not jams:
        return solution
    reduced = reduce(system, state, factor, chosen, sense=sense)
    problem = cast(AbstractFrictionProblem, reduced.problem)
    end = reduced.response.at(problem.law(problem.rho0))
    a = xp.where(jams, end.acceleration, solution.acceleration)
    return replace_fields(solution, acceleration=a, multipliers=xp.where(jams, end.multipliers, solution.multipliers))


def solve_factorised(
    system: AbstractSystem,
    state: State,
    factor: AbstractSolvedFactorisation,
    chosen: Elasticity | None,
    solver: AbstractSolver,
    x0: Array | None,
    sense: Array | None,
) -> Solution:
    """`solve`, given the factorisation at the state, and the compliance and misfit of the closure if there is one.

    Known numbers follow the branch from zero friction only where Newton's method alone does not settle the matter, so
    that programs need not hold it.
    """
    given = system, state, factor, chosen, x0, sense
    solved = matrices_of(system).run(_solved_dense, _solved_sparse)
    if isinstance(solver, Continuation) and are_known(given, solver):
        solution = solved(solver.first, *given)
        fold = solution.stats.fold
        if is_concrete(fold) and (float(fold) > 0 or not is_one_of(solution.result, RESULTS.successful, *_OF_FRICTION)):
            return solution
    return solved(solver, *given)


def _solved(
    solver: AbstractSolver,
    system: AbstractSystem,
    state: State,
    factor: AbstractSolvedFactorisation,
    chosen: Elasticity | None,
    x0: Array | None,
    sense: Array | None,
) -> Solution:
    end, root, contraction, result = _end_in_chunks(factor, system, state, chosen, solver, x0, sense)
    return _solution(factor, end, root, contraction, solver.tolerance(state.qd.dtype), result)


_solved_dense, _solved_sparse = on_numbers(_solved, repeats=True), compiled(_solved)


def _closed(
    system: AbstractSystem,
    state: State,
    rank: ArrayLike | None,
    closure: AbstractClosure | None,
    factor: AbstractSolvedFactorisation | None,
) -> tuple[AbstractSystem, AbstractSolvedFactorisation, Elasticity | None]:
    """The system as it is solved, and the factorisation, compliance and misfit that a solution rests on."""
    if closure is None:
        return *dense_at(system, state, rank, factor), None
    return system, factorisation_at(system, state, rank, factor), elasticity(closure, system, state)


def _solved_at(system: AbstractSystem, state: State, *others: PyTree) -> Solution:
    """The solution at a state that is not factorised yet."""
    *of, solver, x0, sense = others
    own, factor, chosen = _closed(system, state, *of, factor=None)
    return solve_factorised(own.anonymous, state, factor, chosen, solver, x0, sense)


@with_derivative_of(_solved_at, failed=lambda solution: solution.result != RESULTS.successful)
def _solved_at_each(*arguments: PyTree) -> Solution:
    """`_solved_at`; a batch in which the constraints change goes chunk after chunk: matrices stay in the cache."""
    system, _, _, closure, *_ = arguments
    if closure is None:
        return _solved_whole(*arguments)
    return matrices_of(system).run(_solved_in_chunks, _solved_whole)(*arguments)


def _solved_whole(*arguments: PyTree) -> Solution:
    return alike(_solved_at(*arguments), eqx.filter(arguments, eqx.is_array))


def _solved_in_chunks(*arguments: PyTree) -> Solution:
    system, state, *_ = arguments
    rows = jax.lax.stop_gradient(system.constraint(state.q, state.t))
    return in_chunks(_solved_at, *arguments, inside=rows.size * state.qd.size, changing=rows)


def _end(
    factor: AbstractSolvedFactorisation,
    system: AbstractSystem,
    state: State,
    chosen: Elasticity | None,
    solver: AbstractSolver,
    x0: Array | None,
    sense: Array | None,
) -> tuple[Response, Root, Array, RESULTS]:
    """Accelerations and multipliers, friction, its contraction and the result."""
    kept = _kept(x0, state) if chosen is None else None  # Newton (38) keeps the self-stress of x0
    closing = minimum_norm(factor.gamma.size, state.qd.dtype) if chosen is None else chosen
    reduced = reduce(system, state, factor, closing, kept=kept, sense=sense)
    if reduced.problem is None:
        root, stress, contraction, friction_checks = _loadless(state.qd[:0]), None, 0.0 * state.t, ()
    else:
        root, stress = _solve_friction(factor, reduced, reduced.problem, solver, x0, is_open=chosen is None)
        contraction = root.contraction
        if contraction is None:
            contraction = reduced.problem.contraction(reduced.problem.loads(root.tau))
        friction_checks = _checks(reduced, stress, root, solver)
    end = reduced.response.at(root.tau, stress)
    finite = xp.isfinite(reduced.end_size(root.tau, stress, end))
    checks = (
        *factor.checks,
        (xp.isfinite(xp.sum(closing.compliance)), RESULTS.not_finite),
        (~reduced.definiteness.is_no, RESULTS.indeterminate_closure),
        (reduced.definiteness.is_yes, RESULTS.ambiguous_closure),
        *(() if reduced.undetermined is None else ((~reduced.depends_on_undetermined, RESULTS.unbounded_friction),)),
    )
    friction_checks = (*friction_checks, (finite, RESULTS.not_finite))
    # Of the flags alone: XLA would walk through the whole choice of a result again for every entry.
    good = functools.reduce(operator.and_, (passed for passed, _ in (*checks, *friction_checks)))
    end, tau = jax.tree.map(lambda x: nan_where(~good, x), (end, root.tau))
    if reduced.undetermined is not None:
        end = end._replace(multipliers=nan_where(reduced.undetermined, end.multipliers))
    # What friction is given only names a failure, so a sweep of accelerations alone does not compute it.
    given = True if is_number(good) and good else _is_given(reduced)
    result = first_failure((*checks, (good | given, RESULTS.not_finite), *friction_checks))
    return end, eqx.tree_at(lambda root: root.tau, root, tau), contraction, result


def _is_given(reduced: Reduced) -> Array:
    """Whether friction is given finite loads."""
    if reduced.problem is None:
        return xp.asarray(True)
    return xp.isfinite(reduced.end_size(reduced.problem.law(reduced.problem.rho0), None))


@with_derivative_of(_end)
def _end_in_chunks(*arguments: PyTree) -> tuple[Response, Root, Array, RESULTS]:
    """`_end` in chunks."""
    return in_chunks(_end, *arguments)


def _solve_friction(
    factor: AbstractSolvedFactorisation,
    reduced: Reduced,
    problem: AbstractFrictionProblem,
    solver: AbstractSolver,
    x0: Array | None,
    *,
    is_open: bool,
) -> tuple[Root, Array | None]:
    """Friction, and the self-stress added to that of the response."""
    if reduced.rows.size == 0:  # friction independent of load, (24)
        return _loadless(problem.law(problem.rho0)), None
    if is_open and x0 is not None:
        return _open_newton(cast(Factorisation, factor), reduced, problem, x0, solver)
    guess = problem.rho0 if x0 is None else _loads(x0, factor, reduced.rows)
    return closed_root(problem, problem.law(guess), solver), None


def _checks(reduced: Reduced, stress: Array | None, root: Root, solver: AbstractSolver) -> tuple:
    """What must hold for the friction."""
    ended, (rests, unclear) = solver.result(root.progress), reduced.senseless(root.tau, stress)
    return (
        (~rests, RESULTS.friction_at_rest),
        (~unclear, RESULTS.ambiguous_rest),
        *((differs(ended, failure), failure) for failure in _OF_ITERATION),
    )


def _loadless(tau: Array) -> Root:
    """Friction that needs no iteration."""
    return Root(tau, Progress.done(tau.dtype), xp.full((), xp.inf, tau.dtype))


def _open_newton(
    factor: Factorisation, reduced: Reduced, problem: AbstractFrictionProblem, x0: Array, solver: AbstractSolver
) -> tuple[Root, Array]:
    """Newton (38) from x0; `reduced` is at minimum norm, with the self-stress of x0 added."""
    pick, rows = reduced.pick, reduced.rows
    particular = xp.concatenate([factor.acceleration, pick(factor.multipliers)])
    basis = xp.concatenate(reduced.response.unit)
    axes = xp.linalg.svd(stop_gradient(basis), full_matrices=False)[2].T
    basis = basis @ axes
    unit = xp.eye(factor.multipliers.size, dtype=basis.dtype)
    open_problem = OpenProblem(
        cast(FrictionProblem, problem),
        rows,
        projector=each(pick.caused, take(unit, rows)).T,
        balance=each(factor.in_balance, unit).T,
        axes=axes,
        gram=basis.T @ basis,
        pull=times(basis.T, x0) - basis.T @ particular,
        first=_loads(x0, factor, rows),
    )
    end = open_root(open_problem, solver.tolerance(basis.dtype), solver.max_steps)
    return Root(end.tau, end.progress, xp.full((), xp.inf, basis.dtype)), end.stress


def _kept(x0: Array | None, state: State) -> Array:
    """The multipliers in x0 = [qdd; lam], a number if they are equal."""
    if x0 is None:
        raise RedundaxError(
            "Argument `x0` must be given with `closure=None`, but it is None. Give an initial guess [qdd; lam]."
        )
    return x0[state.qd.size :] if x0.ndim else x0


def _loads(x0: Array, factor: AbstractSolvedFactorisation, rows: Array) -> Array:
    """The loads in x0."""
    return x0[factor.acceleration.size + rows] if x0.ndim else xp.broadcast_to(x0, rows.shape)


def _solution(
    factor: AbstractSolvedFactorisation,
    end: Response,
    root: Root,
    contraction: Array,
    tolerance: Array,
    result: RESULTS,
) -> Solution:
    stats = Stats(
        redundancy=factor.redundancy,
        freedom=factor.freedom,
        spectrum=factor.spectrum,
        violation=factor.violation,
        singular_position=factor.singular_position,
        lost_digits=factor.lost_digits,
        steps=root.progress.steps,
        tolerance=tolerance,
        residual=root.progress.residual,
        step=root.progress.step,
        contraction=contraction,
        fold=root.fold,
    )
    return Solution(end.acceleration, end.multipliers, root.tau, result, stats)


def _check_state(system: AbstractSystem, state: State) -> None:
    check_system_at(system, state)
    n = len(system.coordinates)
    if state.qd.shape != (n,):
        raise RedundaxError(
            f"Argument `state` must have a velocity `qd` of shape ({n},), but it has {state.qd.shape}. "
            "Use jax.vmap to solve at many states."
        )


def _vector(name: str, value: Numbers, size: int, what: str) -> Array:
    """`value`, checked: a number stands for that many equal entries, and stays one until they are needed."""
    array = as_float(value, name)
    if array.shape not in ((), (size,)):
        raise RedundaxError(
            f"Argument `{name}` must be a number or have shape ({size},) for {what}, but has {array.shape}. "
            "Give one number for all, or that many."
        )
    return array
