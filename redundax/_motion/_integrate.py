"""The compiled part of `simulate`: the start, the phases of the motion, and what is given at the times asked for."""

from functools import partial
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._closures._closure import AbstractClosure, elasticity
from .._equations._factorize import AnyFactorisation
from .._equations._sparse_factorisation import SparseFactorisation
from .._solve._solve import solve_factorised
from .._solvers._continuation import Continuation
from .._solvers._mixing import Mixing
from .._solvers._solver import Newton, of_large
from .._system._directions import directions_of
from .._system._friction import have_sense, memories
from .._system._results import RESULTS, first_failure
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._compilation import compiled
from .._tools._no_answer import cut_where, nan_where, spoiled_where
from .._tools._numbers import stop_gradient
from .._tools._value import AbstractModule
from ._held_rank import AnyHeld, held_by, hold
from ._held_sparse import hold_sparse
from ._moving import Equations, Moving, rechart
from ._phases import Options, PhaseState, like, run
from ._project import project
from ._stabilisation import AbstractStabilisation
from ._stepper import at_start, size_of
from ._stick import Mode, next_mode
from ._times import in_order, within
from ._trajectory import Trajectory, TrajectoryStats


def has_plan(system: AbstractSystem, *_: Any, **__: Any) -> bool:
    """Whether matrices are sparse."""
    return system.plan is not None


@partial(compiled, runs_long=True, is_large=has_plan)
def integrate(
    system: AbstractSystem,
    state: State,
    factor: AnyFactorisation,
    t1: Array,
    ts: Float[Array, " times"],
    closure: AbstractClosure,
    solver: diffrax.AbstractSolver,
    stabilisation: AbstractStabilisation,
    rtol: Array | None,
    dt0: Array | None,
    max_steps: int,
    max_phases: int,
    adjoint: diffrax.AbstractAdjoint,
    meter: diffrax.AbstractProgressMeter,
    *,
    redundancy: int | None,
    singular: bool,
) -> Trajectory:
    """The motion, given the factorisation at the start; `redundancy` is how many rows are redundant there, None where
    that is a traced number, and `singular` says whether M may be."""
    ordered, given = in_order(state.t, t1, ts), ts
    t1, ts = (jnp.where(ordered, t, state.t) for t in (t1, within(state.t, t1, ts)))
    state = eqx.tree_at(lambda state: state.q, state, jnp.where(ordered, state.q, jnp.nan))
    rank = factor.spectrum.rank
    if isinstance(factor, SparseFactorisation):
        held, _ = hold_sparse(system, state, rank)
    else:
        held = held_by(system, state, factor.scaling, factor.split.stress, redundancy, singular=singular)
    equations = _equations(system, state, factor, closure, stabilisation, t1)
    first = 0.01 * factor.scaling.size / equations.speed if dt0 is None else dt0
    tolerance = jnp.asarray(1e-8, first.dtype) if rtol is None else rtol
    options = Options(
        solver, rtol is None, _controller(rtol, first), adjoint, meter, max_steps, tolerance, first, t1, ts
    )
    begin = _start(equations, state, factor, held)
    result = RESULTS.where(ordered, begin.result, RESULTS.times_out_of_order)
    begin = eqx.tree_at(lambda begin: begin.result, begin, result)
    before = _before(begin, _moving(equations, state), state.t, held, ts)
    lost = begin.result != RESULTS.successful
    before, equations, options = cut_where(lost, (before, equations, options))
    done = run(before, equations, options, max_phases)
    solved, found = _solved(equations, done, options.ts, rank, redundancy, singular)
    solved = spoiled_where(lost, solved, (system, state, closure, t1, ts))
    ended = _ended(done, found == rank)
    ended = RESULTS.where(begin.result == RESULTS.successful, ended, begin.result)
    q, qd, acceleration, multipliers, friction, sense, memory = solved
    if isinstance(factor, SparseFactorisation):  # gradients that close it may not settle
        open_ = jnp.isfinite(acceleration).all(axis=1) & ~jnp.isfinite(multipliers).all(axis=1) & ~done.rests
        ended = RESULTS.where((ended == RESULTS.successful) & jnp.any(open_), RESULTS.ambiguous_closure, ended)
    return Trajectory(
        jnp.where(ordered, ts, given),
        q,
        qd,
        acceleration,
        multipliers,
        friction,
        sense,
        memory,
        ended,
        _stats(done),
    )


class _Start(AbstractModule):
    """How the motion starts."""

    result: RESULTS
    onward: Mode


def _equations(
    system: AbstractSystem,
    state: State,
    factor: AnyFactorisation,
    closure: AbstractClosure,
    stabilisation: AbstractStabilisation,
    t1: Array,
) -> Equations:
    scale = factor.scaling
    reach = jnp.max(jnp.abs(factor.acceleration) / scale.coordinates)
    speed = jnp.max(jnp.abs(state.qd) / scale.coordinates) + jnp.sqrt(reach * scale.size)
    slow = scale.size / jnp.where(t1 > state.t, t1 - state.t, 1.0)
    speed = jax.lax.stop_gradient(jnp.where(speed > 0, speed, slow))
    angular = jnp.asarray(system.slips.angular)
    return Equations(
        system,
        closure,
        Newton() if system.plan is None else of_large(Mixing(first=1.0)),
        stabilisation,
        jnp.ones(angular.size, state.qd.dtype),
        scale,
        speed,
        jnp.where(angular, scale.length, 1.0),
        stop_gradient(directions_of(system.friction)),
        have_sense(system.friction),
    )


def _controller(rtol: Array | None, first: Array) -> diffrax.AbstractStepSizeController:
    """Of the relative errors that the stepper gives; without tolerance steps are constant unless they cannot end so."""
    limits = {"rtol": 0.0, "dtmin": 1e-10 * first, "force_dtmin": False, "norm": size_of}
    if rtol is None:
        return diffrax.PIDController(atol=1.0, dtmax=first, **limits)
    return diffrax.PIDController(atol=rtol, **limits)


def _start(equations: Equations, state: State, factor: AnyFactorisation, held: AnyHeld) -> _Start:
    system, none = equations.system, jnp.zeros((), bool)
    start = Mode(equations.sense, equations.sense, none, ~none)
    if not system.friction:
        return _Start(factor.result, start)
    if equations.has_sense:
        start = next_mode(equations, state, held, ~none)
    fixed = stop_gradient((system, state, factor, elasticity(equations.closure, system, state)))
    solution = solve_factorised(
        *fixed, Continuation() if system.plan is None else of_large(Continuation()), None, start.sense
    )
    sticks = jnp.any(equations.with_sense(start.sense).sticking)
    result = RESULTS.where(sticks, factor.result, solution.result)
    tau = jnp.where(solution.result == RESULTS.successful, solution.friction, 0.0)  # else nothing moves
    return _Start(result, start._replace(tau=jnp.where(sticks, start.tau, tau)))


def _moving(equations: Equations, state: State) -> Moving:
    none = jnp.zeros_like(state.t)
    memory = list(memories(equations.system.friction, state))
    base = None if equations.system.adds else state.q
    return Moving(state.q, base, state.qd, none, none if equations.has_sense else None, memory)


def _before(begin: _Start, y: Moving, t: Array, held: AnyHeld, ts: Array) -> PhaseState:
    """The run before its first phase."""
    start = begin.onward
    y = y._replace(qd=jnp.where(start.resting, 0.0, y.qd))
    path = jax.tree.map(lambda x: jnp.full((ts.size, *x.shape), jnp.nan, x.dtype), y)
    none = jnp.zeros((), int)
    return PhaseState(
        t=t,
        y=y,
        sense=start.sense,
        tau=start.tau,
        held=held,
        resting=start.resting,
        since=t,
        path=path,
        senses=jnp.full((ts.size, *start.sense.shape), jnp.nan, t.dtype),
        rests=jnp.zeros(ts.shape, bool),
        going=(begin.result == RESULTS.successful) & start.decided,
        decided=start.decided,
        ended=diffrax.RESULTS.successful,
        watch=at_start(jnp.zeros_like(t)),
        steps=none,
        rejected=none,
        phases=none,
    )


def _solved(
    equations: Equations, done: PhaseState, ts: Array, rank: Array, redundancy: int | None, singular: bool
) -> tuple[tuple, Array]:
    """Position, velocity, acceleration, multipliers and friction at times; and the rank found at the end."""
    system = equations.system

    def at(point: tuple[Array, Moving, Array, Array]) -> tuple[tuple, Array]:
        t, y, sense, resting = point
        there = equations.with_sense(sense)
        held, found = hold(system, y.at(t), equations.scaling, rank, redundancy, singular=singular)
        y, _ = rechart(system, y)
        if equations.stabilisation.projects:
            y = jax.tree.map(lambda a, b: jnp.where(resting, a, b), y, project(system, t, y, held))
        state = y.at(t)
        linear = there.linear(state, held)
        solved = there.solved(state, linear, None)
        if there.directions is not None:
            turned = there.turned(linear.rate, sense, jnp.zeros((), bool))
            sense = jnp.where(there.directions.directed, turned, sense)
        acceleration = jnp.where(resting, 0.0, solved.acceleration)
        loads = tuple(nan_where(resting, x) for x in (solved.multipliers, solved.tau))
        return (y.q, y.qd, acceleration, *loads, sense, tuple(y.memory)), found

    path, here = (ts, done.path, done.senses, done.rests), (done.t, done.y, done.sense, done.resting)
    lost = jax.vmap(lambda y: ~jnp.all(jnp.isfinite(jnp.append(y.q, y.qd))))(done.path)
    # Where the motion did not get to stands its end: 0 times the derivatives at NaN would be NaN in every gradient.
    path = jax.tree.map(lambda a, b: jnp.where(like(lost, a), b, a), path, here)
    solved, found = jax.lax.map(at, jax.tree.map(lambda a, b: jnp.concatenate([a, b[None]]), path, here))
    return jax.tree.map(lambda x: nan_where(like(lost, x), x[:-1]), solved), found[-1]


def _ended(done: PhaseState, same: Array) -> RESULTS:
    """The result of a motion; `same` says whether the rank is what it was."""
    events = done.ended == diffrax.RESULTS.event_occurred
    stopped = done.ended == diffrax.RESULTS.successful
    return first_failure(
        (
            (jnp.all(jnp.isfinite(done.y.q)) & jnp.all(jnp.isfinite(done.y.qd)), RESULTS.not_finite),
            (done.ended != diffrax.RESULTS.max_steps_reached, RESULTS.steps_exhausted),
            (done.decided, RESULTS.joint_sticks),
            (~done.going, RESULTS.phases_exhausted),
            (events | stopped | same, RESULTS.rank_changed),
            (events | stopped, RESULTS.step_too_small),
            (~done.resting, RESULTS.stuck),
        )
    )


def _stats(done: PhaseState) -> TrajectoryStats:
    watch = done.watch
    return TrajectoryStats(
        steps=done.steps,
        rejected=done.rejected,
        phases=done.phases,
        end=jnp.where(done.resting, done.since, done.t),
        position_violation=watch.position,
        velocity_violation=watch.velocity / jnp.where(watch.speed > 0, watch.speed, 1.0),
        kinetic_energy=watch.kinetic,
        energy_error=watch.energy / jnp.where(watch.kinetic > 0, watch.kinetic, 1.0),
        nearest_singularity=watch.nearest,
        contraction=watch.contraction,
        jump=watch.jump,
    )
