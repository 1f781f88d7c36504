"""A motion: its start, its phases, and what is given at the times asked for."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._closures._closure import AbstractClosure, elasticity
from .._equations._factorize import AnyFactorisation
from .._equations._kinematics import slip_motion
from .._equations._sparse_factorisation import SparseFactorisation
from .._solve._solve import solve_factorised
from .._solvers._continuation import Continuation
from .._solvers._mixing import Mixing
from .._solvers._solver import Newton, of_large
from .._system._directions import directions_of
from .._system._friction import have_sense, memories
from .._system._results import RESULTS, chosen, differs, first_failure
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._compilation import compiled
from .._tools._module import replace_fields
from .._tools._no_answer import cut_where, nan_where, spoiled_where
from .._tools._numbers import are_numbers, as_numbers, as_program, on_numbers, stop_gradient, xp
from .._tools._value import AbstractModule
from ._held_rank import AnyHeld, held_by, hold
from ._held_sparse import hold_sparse
from ._moving import Equations, Moving, rechart
from ._phases import Options, PhaseState, like, run, stretch
from ._project import project
from ._slip import no_plan
from ._stabilisation import AbstractStabilisation
from ._stepper import Controller, at_start
from ._stick import Mode, next_mode
from ._times import in_order, within
from ._trajectory import Trajectory, TrajectoryStats


class Course(AbstractModule):
    """What a motion runs through, and how it is integrated.

    - `t1`, `ts`: its end, and the times asked for.
    - `rtol`, `dt0`, `max_steps`, `max_phases`, `solver`, `stabilisation`, `adjoint`: as of `simulate`.
    - `redundancy`: how many rows are redundant at the start, None where that is a traced number.
    - `singular`: whether the mass matrix may be singular.
    """

    t1: Float[Array, ""]
    ts: Float[Array, " times"]
    rtol: Float[Array, ""] | None
    dt0: Float[Array, ""] | None
    solver: diffrax.AbstractSolver
    stabilisation: AbstractStabilisation
    adjoint: diffrax.AbstractAdjoint
    meter: diffrax.AbstractProgressMeter
    max_steps: int = eqx.field(static=True)
    max_phases: int = eqx.field(static=True)
    redundancy: int | None = eqx.field(static=True)
    singular: bool = eqx.field(static=True)


def _integrate(
    system: AbstractSystem, state: State, factor: AnyFactorisation, closure: AbstractClosure, course: Course
) -> Trajectory:
    given, rank = course.ts, factor.spectrum.rank
    ordered = xp.asarray(in_order(state.t, course.t1, given))
    t1, ts = (xp.where(ordered, t, state.t) for t in (course.t1, within(state.t, course.t1, given)))
    state = replace_fields(state, q=xp.where(ordered, state.q, xp.nan))
    if isinstance(factor, SparseFactorisation):
        held, _ = hold_sparse(system, state, rank)
    else:
        held = held_by(system, state, factor.scaling, factor.split.stress, course.redundancy, singular=course.singular)
    equations = _equations(system, state, factor, closure, course.stabilisation, t1)
    first = 0.01 * factor.scaling.size / equations.speed if course.dt0 is None else course.dt0
    tolerance = xp.asarray(1e-8, first.dtype) if course.rtol is None else course.rtol
    options = Options(
        course.solver,
        course.rtol is None,
        Controller(_controller(course.rtol, first), first, t1),  # pyright: ignore[reportCallIssue] (properties there)
        course.adjoint,
        course.meter,
        course.max_steps,
        tolerance,
        ts,
    )
    before = _before(equations, state, held, ts)
    result, mode = _start(equations, state, factor, before, options)
    result = chosen(ordered, result, RESULTS.times_out_of_order)
    lost = differs(result, RESULTS.successful)
    y = before.y._replace(qd=xp.where(mode.resting, 0.0, state.qd))
    before = before._replace(y=y, mode=mode, plan=no_plan(mode), going=~lost & mode.decided)
    before, equations, options = cut_where(lost, (before, equations, options))
    done = run(before, equations, options, course.max_phases)
    solved, found = _solved(equations, done, options.ts, rank, course.redundancy, course.singular)
    solved = spoiled_where(lost, solved, (system, state, closure, t1, ts))
    ended = chosen(lost, result, _ended(done, found == rank))
    q, qd, acceleration, multipliers, friction, sense, memory = solved
    if isinstance(factor, SparseFactorisation):  # gradients that close it may not settle
        open_ = jnp.isfinite(acceleration).all(axis=1) & ~jnp.isfinite(multipliers).all(axis=1) & ~done.rests
        ended = RESULTS.where((ended == RESULTS.successful) & jnp.any(open_), RESULTS.ambiguous_closure, ended)
    return Trajectory(
        xp.where(ordered, ts, given),
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


_dense, _forward = on_numbers(_integrate), on_numbers(_integrate, is_long=True)
_large = compiled(_integrate, runs_long=True, is_large=lambda *_: True)


def integrate(
    system: AbstractSystem, state: State, factor: AnyFactorisation, closure: AbstractClosure, course: Course
) -> Trajectory:
    """The motion, given the factorisation at the start."""
    if system.plan is not None:
        return _large(system, state, factor, closure, course)
    # JAX takes options of compiling for no program that is cut for reverse mode.
    forward = isinstance(course.adjoint, diffrax.ForwardMode)
    return (_forward if forward else _dense)(system, state, factor, closure, course)


def _equations(
    system: AbstractSystem,
    state: State,
    factor: AnyFactorisation,
    closure: AbstractClosure,
    stabilisation: AbstractStabilisation,
    t1: Array,
) -> Equations:
    scale = factor.scaling
    reach = xp.max(xp.abs(factor.acceleration) / scale.coordinates)
    speed = xp.max(xp.abs(state.qd) / scale.coordinates) + xp.sqrt(reach * scale.size)
    slow = scale.size / xp.where(t1 > state.t, t1 - state.t, 1.0)
    angular = np.asarray(system.slips.angular)
    return Equations(
        system,
        closure,
        Newton() if system.plan is None else of_large(Mixing(first=1.0)),
        stabilisation,
        xp.ones_like(scale.length, shape=angular.size),
        scale,
        stop_gradient(xp.where(speed > 0, speed, slow)),
        xp.where(angular, scale.length, 1.0),
        stop_gradient(directions_of(system.friction)),
        have_sense(system.friction),
    )


def _controller(rtol: Array | None, first: Array) -> diffrax.PIDController:
    """Of errors by the tolerance; without tolerance steps are constant unless they cannot end so."""
    limits = {"rtol": 0.0, "dtmin": 1e-10 * first, "force_dtmin": False, "norm": jnp.abs}
    if rtol is None:
        return diffrax.PIDController(atol=1.0, dtmax=first, **limits)
    return diffrax.PIDController(atol=rtol, **limits)


def _start(
    equations: Equations, state: State, factor: AnyFactorisation, before: PhaseState, options: Options
) -> tuple[RESULTS, Mode]:
    """Whether the motion starts, and how."""
    system, start = equations.system, before.mode
    if not system.friction:
        return factor.result, start
    if equations.has_sense:
        start = _first_mode(equations, state, before, options)
    fixed = stop_gradient((system, state, factor, elasticity(equations.closure, system, state)))
    solution = solve_factorised(
        *fixed, Continuation() if system.plan is None else of_large(Continuation()), None, start.sense
    )
    sticks = xp.any(equations.with_sense(start.sense).sticking)
    tau = xp.where(differs(solution.result, RESULTS.successful), 0.0, solution.friction)  # else nothing moves
    return chosen(sticks, factor.result, solution.result), start._replace(tau=xp.where(sticks, start.tau, tau))


def _first_mode(equations: Equations, state: State, before: PhaseState, options: Options) -> Mode:
    """How it goes on from the start. Of known joints that all slip nothing is asked; of others the program of a step,
    one that ends at once in an event."""
    if not are_numbers(state):
        return next_mode(equations, state, before.held, xp.ones_like(state.t, bool))
    rate, _ = slip_motion(equations.system, state)
    if not np.any(equations.still(rate)):
        sense = xp.where(np.asarray(equations.sensed), equations.sense_of(rate, rate)[1], 1.0)
        return before.mode._replace(sense=sense)
    at_once = 1e-9 * options.controller.first + 100 * xp.finfo(state.t.dtype).eps * xp.abs(state.t)
    plan = no_plan(before.mode)._replace(time=state.t + at_once, stops=np.True_, joint=np.asarray(-1))
    rests = before.mode._replace(resting=np.True_)
    return stretch(before._replace(mode=rests, plan=plan), equations, options, np.True_).mode


def _before(equations: Equations, state: State, held: AnyHeld, ts: Array) -> PhaseState:
    """The run before its first phase, with all joints in the sense 1."""
    memory = list(memories(equations.system.friction, state))
    zero, base = xp.zeros_like(state.t), None if equations.system.adds else state.q
    y, sense, none = Moving(state.q, base, state.qd, zero, memory), equations.sense, xp.zeros_like(state.t, int)
    mode = Mode(sense, xp.zeros_like(sense), none > 0, none == 0)
    return PhaseState(
        t=state.t,
        y=y,
        mode=mode,
        held=held,
        since=state.t,
        plan=no_plan(mode),
        path=jax.tree.map(lambda x: xp.full((ts.size, *x.shape), xp.nan, x.dtype), y),
        senses=xp.full((ts.size, sense.size), xp.nan, ts.dtype),
        rests=xp.zeros_like(ts, bool),
        going=none == 0,
        released=sense != sense,
        ended=as_numbers(diffrax.RESULTS.successful),
        begun=none,
        watch=at_start(zero),
        steps=none,
        rejected=none,
        phases=none,
    )


@as_program
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

    path, here = (ts, done.path, done.senses, done.rests), (done.t, done.y, done.mode.sense, done.mode.resting)
    lost = jax.vmap(lambda y: ~jnp.all(jnp.isfinite(jnp.append(y.q, y.qd))))(done.path)
    # Where the motion did not get to stands its end: 0 times the derivatives at NaN would be NaN in every gradient.
    path = jax.tree.map(lambda a, b: jnp.where(like(lost, a), b, a), path, here)
    solved, found = jax.lax.map(at, jax.tree.map(lambda a, b: jnp.concatenate([a, b[None]]), path, here))
    return jax.tree.map(lambda x: nan_where(like(lost, x), x[:-1]), solved), found[-1]


def _ended(done: PhaseState, same: Array) -> RESULTS:
    """The result of a motion; `same` says whether the rank is what it was."""
    goes_on = ~differs(done.ended, diffrax.RESULTS.event_occurred) | ~differs(done.ended, diffrax.RESULTS.successful)
    return first_failure(
        (
            (xp.all(xp.isfinite(done.y.q)) & xp.all(xp.isfinite(done.y.qd)), RESULTS.not_finite),
            (differs(done.ended, diffrax.RESULTS.max_steps_reached), RESULTS.steps_exhausted),
            (done.mode.decided, RESULTS.joint_sticks),
            (~done.going, RESULTS.phases_exhausted),
            (goes_on | same, RESULTS.rank_changed),
            (goes_on, RESULTS.step_too_small),
            (~done.mode.resting, RESULTS.stuck),
        )
    )


def _stats(done: PhaseState) -> TrajectoryStats:
    watch = done.watch
    return TrajectoryStats(
        steps=done.steps,
        rejected=done.rejected,
        phases=done.phases,
        end=xp.where(done.mode.resting, done.since, done.t),
        position_violation=watch.position,
        velocity_violation=watch.velocity / xp.where(watch.speed > 0, watch.speed, 1.0),
        kinetic_energy=watch.kinetic,
        energy_error=watch.energy / xp.where(watch.kinetic > 0, watch.kinetic, 1.0),
        nearest_singularity=watch.nearest,
        contraction=watch.contraction,
        jump=watch.jump,
    )
