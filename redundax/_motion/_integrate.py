"""A motion: its start, its phases, and what is given at the times asked for."""

import traceback
from functools import partial

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._closures._closure import AbstractClosure
from .._equations._gaps import model_of_all
from .._equations._kinematics import slip_motion
from .._equations._matrices import matrices_of
from .._equations._response import AbstractSolvedFactorisation
from .._equations._scaling import largest_violation, scaling
from .._solve._contacts import CLEAR, have_no_gap
from .._solve._play import at_sides
from .._solve._solve import solve_factorised
from .._solvers._continuation import Continuation
from .._solvers._solver import Corrector, with_rtol
from .._system._contact import UNKNOWN, Contact, code_of
from .._system._directions import directions_of
from .._system._friction import have_sense, memories
from .._system._results import RESULTS, chosen, differs, first_failure
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._derivatives import once, once_in_reverse
from .._tools._errors import RedundaxError
from .._tools._module import replace_fields
from .._tools._no_answer import cut_where, is_differentiated, nan_where, spoiled_where, without_derivatives
from .._tools._numbers import (
    LARGE,
    are_numbers,
    as_numbers,
    as_program,
    chosen_of,
    on_numbers,
    stop_gradient,
    take,
    tolerance_of,
    xp,
)
from .._tools._value import AbstractModule
from ._controller import Controller, told_apart
from ._held_rank import AnyHeld, hold
from ._moving import STILL, Equations, Moving, Touch, rechart
from ._phases import Contacts, ImpactLog, Options, PhaseState, from_rest, run, stretch
from ._project import project
from ._radau_solver import Radau
from ._slip import LOOKS, no_plan
from ._stabilisation import AbstractStabilisation
from ._stepper import at_start
from ._stick import Mode, next_mode, within_limits
from ._stiffness import STIFF, Watched
from ._tangent import in_tangent
from ._times import in_order, within
from ._touch import Hit
from ._trajectory import Impacts, Trajectory, TrajectoryStats

# Part of a motion with contacts that a step takes at most: in flight nothing else bounds steps, and in each gaps are
# looked at a few times.
_LONGEST = 1 / 64
# Part of the usual first step, where derivatives are taken of how surfaces slide: two steps later it is as long again.
_TURNED = 2.0**-6


class Course(AbstractModule):
    """What a motion runs through, and how it is integrated.

    - `t1`, `ts`: its end, and the times asked for.
    - `rtol`, `dt0`, `max_steps`, `max_phases`, `solver`, `stabilisation`, `adjoint`: as of `simulate`; no solver where
      it is chosen here.
    - `redundancy`: how many rows are redundant at the start, None where that is a traced number.
    - `singular`: whether the mass matrix may be singular.
    - `restitution`: of one-sided contacts; None where there are none.
    - `jump_ts`: instants at which steps end, None if none are given.
    """

    t1: Float[Array, ""]
    ts: Float[Array, " times"]
    rtol: Float[Array, ""] | None
    dt0: Float[Array, ""] | None
    solver: diffrax.AbstractSolver | Radau | None
    stabilisation: AbstractStabilisation
    adjoint: diffrax.AbstractAdjoint
    meter: diffrax.AbstractProgressMeter
    max_steps: int = eqx.field(static=True)
    max_phases: int = eqx.field(static=True)
    redundancy: int | None = eqx.field(static=True)
    singular: bool = eqx.field(static=True)
    restitution: Float[Array, " c"] | None = None
    jump_ts: Float[Array, " jumps"] | None = None


def _integrate(
    system: AbstractSystem, state: State, factor: AbstractSolvedFactorisation, closure: AbstractClosure, course: Course
) -> Trajectory:
    given, rank = course.ts, factor.spectrum.rank
    ordered = xp.asarray(in_order(state.t, course.t1, given))
    t1, ts = (xp.where(ordered, t, state.t) for t in (course.t1, within(state.t, course.t1, given)))
    state = replace_fields(state, q=xp.where(ordered, state.q, xp.nan))
    held = hold(system, state, factor, course.redundancy, singular=course.singular)
    state, speed = _speed(state, factor, t1)
    equations = _equations(system, speed, factor, closure, course.stabilisation)
    if course.restitution is not None:
        equations = replace_fields(equations, scaling=scaling(system, model_of_all(system, state)))
    whole = stop_gradient(t1 - state.t)
    first = 0.01 * factor.scaling.size / equations.speed if course.dt0 is None else course.dt0
    differentiated, directed = xp.zeros((), bool), equations.directions is not None
    if (directed or equations.bends) and course.rtol is not None:
        differentiated = is_differentiated(state, equations, course)
    if course.dt0 is None:  # as the shortest is a part of it, and nothing tells yet how surfaces turn
        first = xp.where(whole > 0, xp.minimum(first, whole), first)
        first = first * xp.where(differentiated & directed, _TURNED, 1.0)
    longest = None if course.restitution is None else _LONGEST * (t1 - state.t)
    tolerance = xp.asarray(1e-8, first.dtype) if course.rtol is None else course.rtol
    jumps = None if course.jump_ts is None else told_apart(course.jump_ts)
    options = Options(
        _solver(course, system, tolerance, known=are_numbers(state.q, state.t, course.t1)),
        course.rtol is None,
        Controller(_controller(course.rtol, first, longest), first, t1, jumps),  # pyright: ignore[reportCallIssue] (properties there)
        course.adjoint,
        course.meter,
        course.max_steps,
        course.max_phases,
        tolerance,
        ts,
        xp.where(whole > 0, whole, 1.0) / LOOKS,
        course.restitution,
        differentiated,
    )
    before = _before(equations, state, held, ts)
    if course.restitution is None:
        result, mode = _start(equations, state, factor, before, options)
        y = before.y._replace(qd=xp.where(mode.resting, 0.0, state.qd))
        released = from_rest(*stop_gradient((equations, y.at(before.t), mode.sense)))
        going = before.going & mode.decided
        before = before._replace(y=y, mode=mode, plan=no_plan(mode), going=going, released=released)
    else:
        before, result = _with_contacts(before, equations, state, rank, course.max_phases)
    result = chosen(ordered, result, RESULTS.times_out_of_order)
    lost = differs(result, RESULTS.successful)
    before = before._replace(going=before.going & ~lost)
    before, equations, options = cut_where(lost, (before, equations, options))
    done = _run(before, equations, options)
    if done.contacts is not None:
        result = chosen(lost, result, done.contacts.first)
        lost = differs(result, RESULTS.successful)
    solved, (found, does) = _solved(equations, done, options.ts, rank, course.redundancy)
    solved = spoiled_where(lost, solved, (system, state, closure, t1, ts))
    ended = chosen(lost, result, _ended(done, found, rank))
    q, qd, acceleration, multipliers, friction, sense, memory = solved
    # What closes a motion may not settle: gradients by sparse matrices, or sides of joints with play.
    failure = matrices_of(system).unsettled if equations.play is None else RESULTS.contacts_undecided
    if failure is not None:
        open_ = xp.all(xp.isfinite(acceleration), axis=1) & ~xp.all(xp.isfinite(multipliers), axis=1) & ~done.rests
        ended = chosen(differs(ended, RESULTS.successful) | ~xp.any(open_), ended, failure)
    scale = equations.scaling  # what loads do along the size of the mechanism
    usual = stop_gradient(xp.max(xp.abs(factor.load) * scale.coordinates) * scale.size)
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
        _stats(done, usual),
        does,
        _impacts(done),
    )


# By dense matrices and by sparse ones.
_usual = on_numbers(_integrate), as_program(_integrate, LARGE)
_forward, _reverse = (
    (on_numbers(_integrate, traced=traced), as_program(_integrate, LARGE, traced=traced))
    for traced in (once, once_in_reverse)
)


# What JAX says where derivatives are asked for in the other mode.
_OTHER_MODE = "custom_vjp", "Linearization failed", "Reverse-mode", "compiler_options"


def integrate(
    system: AbstractSystem, state: State, factor: AbstractSolvedFactorisation, closure: AbstractClosure, course: Course
) -> Trajectory:
    """The motion, given the factorisation at the start."""
    ways = _usual
    if isinstance(course.adjoint, diffrax.ForwardMode):
        ways = _forward
    elif isinstance(course.adjoint, diffrax.RecursiveCheckpointAdjoint):
        ways = _reverse
    try:
        return matrices_of(system).run(*ways)(system, state, factor, closure, course)
    except (AssertionError, TypeError, ValueError) as error:
        if isinstance(error, RedundaxError) or not _is_of_other_mode(error):
            raise
        raise RedundaxError(
            f"Argument `adjoint` must fit how derivatives are taken, but is {type(course.adjoint).__name__}. Give "
            "`diffrax.ForwardMode()` for `jax.jvp` and `jax.jacfwd`, and for second derivatives, by `jax.jacfwd` of "
            "`jax.jacfwd`; leave it out for `jax.grad`. Reverse mode takes first derivatives alone."
        ) from error


def _is_of_other_mode(error: Exception) -> bool:
    """Whether JAX says so; of the rule that batches derivatives, as in `jax.hessian`, by an assertion without words."""
    if isinstance(error, AssertionError):
        *_, (frame, _) = traceback.walk_tb(error.__traceback__)
        return frame.f_globals["__name__"].partition(".")[0] == "jax"
    return any(words in str(error) for words in _OTHER_MODE)


def _with_contacts(
    before: PhaseState, equations: Equations, state: State, rank: Array, most: int
) -> tuple[PhaseState, RESULTS]:
    """The run before its first phase, which begins with an event of the contacts that are closed; and whether none of
    them overlap."""
    system, ts = equations.system, before.path.work
    rows, none, model = np.array(system.names.one_sided), before.t != before.t, model_of_all(system, state)
    which = take(have_no_gap(model, equations.scaling), rows)
    gap = -take(equations.scaling.violations(model.motion.value), rows)
    holds = xp.asarray(~system.names.is_one_sided)
    touch = Touch(holds, which & none, rank, equations.sense != equations.sense, xp.zeros_like(gap))
    path = jax.tree.map(lambda x: xp.broadcast_to(x, (ts.size, *x.shape)), touch)
    impacts = ImpactLog(
        xp.zeros_like(state.t, int),
        *(xp.full((most + 1, *size), xp.nan, ts.dtype) for size in ((), rows.shape, (), ())),
    )
    good = as_numbers(RESULTS.successful)
    contacts = Contacts(touch, Hit(state.t, which), ~none, ~none, good, path, impacts)
    within = xp.all(gap >= -largest_violation(gap.dtype))
    plan = before.plan._replace(time=state.t)
    before = before._replace(contacts=contacts, begun=before.begun - 1, plan=plan)
    return before, chosen(within, good, RESULTS.violated_constraints)


def _speed(state: State, factor: AbstractSolvedFactorisation, t1: Array) -> tuple[State, Float[Array, ""]]:
    """The state, at rest where its velocity moves nothing up to the end but by rounding; a speed of the mechanism."""
    scale, qd = factor.scaling, stop_gradient(state.qd)
    reach = xp.max(xp.abs(factor.acceleration) / scale.coordinates)
    speed = stop_gradient(xp.max(xp.abs(qd) / scale.coordinates) + xp.sqrt(reach * scale.size))
    slow = stop_gradient(scale.size / xp.where(t1 > state.t, t1 - state.t, 1.0))
    moves = speed > float(xp.finfo(speed.dtype).eps) * slow
    return replace_fields(state, qd=state.qd - xp.where(moves, 0.0, qd)), xp.where(moves, speed, slow)


def _equations(
    system: AbstractSystem,
    speed: Float[Array, ""],
    factor: AbstractSolvedFactorisation,
    closure: AbstractClosure,
    stabilisation: AbstractStabilisation,
) -> Equations:
    scale = factor.scaling
    angular = np.asarray(system.slips.angular)
    return Equations(
        system,
        closure,
        with_rtol(Corrector(), matrices_of(system).rtol),
        stabilisation,
        xp.ones_like(scale.length, shape=angular.size),
        scale,
        speed,
        xp.where(angular, scale.length, 1.0),
        stop_gradient(directions_of(system.friction)),
        have_sense(system.friction),
    )


def _solver(course: Course, system: AbstractSystem, tolerance: Array, *, known: bool) -> diffrax.AbstractSolver:
    """The solver: an implicit one in coordinates of the freedoms, if they are had, the one not given watched."""
    # Rows of velocity leave positions more freedoms than velocities; contacts change their number.
    fixed = not system.velocity_rows and course.restitution is None
    solver, has_freedoms = course.solver, matrices_of(system).has_freedoms and fixed and course.stabilisation.projects
    if solver is None:
        watched = known and has_freedoms and course.redundancy is not None and course.rtol is not None
        return Watched() if watched else diffrax.Dopri8()
    if has_freedoms and isinstance(solver, (Radau, diffrax.AbstractImplicitSolver)):
        return in_tangent(solver, tolerance, known=course.redundancy is not None)
    if isinstance(solver, Radau):
        raise RedundaxError(
            "Argument `solver` must be another than `rx.Radau()` with matrices that are sparse, rows of velocity, "
            "one-sided contacts or a stabilisation other than `rx.Projection()`. Give `diffrax.Kvaerno5()`, say."
        )
    return solver


def _run(before: PhaseState, equations: Equations, options: Options) -> PhaseState:
    """The motion up to the end; an implicit solver takes over where the explicit one finds it stiff."""
    done = run(before, equations, options)
    if not isinstance(options.solver, Watched) or not _is_stiff(done, options):
        return done
    done = done._replace(going=np.True_, begun=done.begun - 1, phases=done.phases - 1)
    solver = in_tangent(Radau(), options.tolerance, known=True)
    return run(done, equations, options._replace(solver=solver))


def _is_stiff(done: PhaseState, options: Options) -> bool:
    """Whether steps ended because they are stiff, and nothing else did end them."""
    ended = ~done.going & ~differs(done.ended, diffrax.RESULTS.event_occurred) & (done.plan.time == np.inf)
    goes_on = done.mode.decided & ~done.mode.resting & (done.t < options.controller.end)
    return bool(ended & goes_on & (done.watch.stiff >= STIFF))


def _controller(rtol: Array | None, first: Array, longest: Array | None) -> diffrax.PIDController:
    """Of errors by the tolerance; without tolerance steps are constant unless they cannot end so."""
    limits = {"rtol": 0.0, "dtmin": 1e-10 * first, "force_dtmin": False, "norm": jnp.abs}
    if rtol is None:
        return diffrax.PIDController(atol=1.0, dtmax=first, **limits)
    return diffrax.PIDController(atol=rtol, dtmax=longest, **limits)


def _start(
    equations: Equations, state: State, factor: AbstractSolvedFactorisation, before: PhaseState, options: Options
) -> tuple[RESULTS, Mode]:
    """Whether the motion starts, and how."""
    system, start = equations.system, before.mode
    if not system.friction:
        return factor.result, start
    if equations.has_sense:
        start = _first_mode(equations, state, before, options)
    fixed = stop_gradient((system, state, factor, equations.elasticity(state)))
    solver = with_rtol(Continuation(), matrices_of(system).rtol)
    solved = partial(solve_factorised, solver=solver, x0=None, sense=start.sense)
    solution, _, settled = at_sides(stop_gradient(equations.play), solved)(*fixed)
    result = chosen(settled, solution.result, RESULTS.contacts_undecided)
    sticks = xp.any(equations.with_sense(start.sense).sticking)
    tau = xp.where(differs(result, RESULTS.successful), 0.0, solution.friction)  # else nothing moves
    return chosen(sticks, factor.result, result), start._replace(tau=xp.where(sticks, start.tau, tau))


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
    memory = as_numbers(memory) if are_numbers(state) else memory
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
        touches=none > 0,
        ended=as_numbers(diffrax.RESULTS.successful),
        begun=none,
        watch=at_start(zero),
        steps=none,
        rejected=none,
        phases=none,
    )


@as_program
def _solved(
    equations: Equations, done: PhaseState, ts: Array, rank: Array, redundancy: int | None
) -> tuple[tuple, tuple[Array, Array | None]]:
    """Position, velocity, acceleration, multipliers and friction at times; and the rank found at the end, and what
    contacts do at the times."""

    def at(point: tuple[Array, Moving, Array, Array, Touch | None]) -> tuple[tuple, tuple]:
        t, y, sense, resting, touch = point
        there = equations.with_sense(sense).with_touch(touch)
        system, declared = there.system, rank if touch is None else touch.rank
        held, found = done.held.anew(system, y.at(t), equations.scaling, declared, redundancy)
        y, _ = rechart(system, y)
        if equations.stabilisation.projects:
            y = chosen_of(resting, y, project(system, t, y, held))
        state = y.at(t)
        linear = there.linear(state, held)
        solved = there.solved(state, linear, None)
        if there.directions is not None:
            turned = there.turned(linear.rate, sense, jnp.zeros((), bool))
            sense = jnp.where(there.directions.directed, turned, sense)
        acceleration = jnp.where(resting, 0.0, solved.acceleration)
        multipliers, tau = (
            within_limits(there, state, linear, solved) if there.has_sense else (solved.multipliers, solved.tau)
        )
        loads = tuple(nan_where(resting, x) for x in (multipliers, tau))
        does = None if touch is None else _does(there, touch, multipliers)
        return (y.q, y.qd, acceleration, *loads, sense, tuple(y.memory)), (found, does)

    touch, touches = (None, None) if done.contacts is None else (done.contacts.touch, done.contacts.path)
    path = (ts, done.path, done.senses, done.rests, touches)
    here = (done.t, done.y, done.mode.sense, done.mode.resting, touch)
    lost = jax.vmap(lambda y: ~jnp.all(jnp.isfinite(jnp.append(y.q, y.qd))))(done.path)
    # Where the motion did not get to stands its end: 0 times the derivatives at NaN would be NaN in every gradient.
    path = chosen_of(lost, here, path)
    solved, found = jax.lax.map(at, jax.tree.map(lambda a, b: jnp.concatenate([a, b[None]]), path, here))
    solved = jax.tree.map(lambda x: nan_where(lost.reshape(-1, *[1] * (x.ndim - 1)), x[:-1]), solved)
    return solved, (found[0][-1], None if touch is None else jnp.where(lost[:, None], UNKNOWN, found[1][:-1]))


def _does(equations: Equations, touch: Touch, multipliers: Array) -> Int[Array, " c"]:
    """What contacts do, as numbers."""
    rows = np.array(equations.system.names.one_sided)
    force = equations.scaling.rows * multipliers
    holds, loaded = touch.kept[rows], force[rows] > CLEAR * jnp.max(jnp.abs(force))
    opened, touches, carries = map(code_of, (Contact.open, Contact.touches, Contact.carries))
    return jnp.where(holds & loaded, carries, jnp.where(holds | touch.rests, touches, opened))


def _impacts(done: PhaseState) -> Impacts | None:
    """The impacts, of known numbers as many as there are."""
    if done.contacts is None:
        return None
    count, *figures = done.contacts.impacts
    return Impacts(*(figure[: int(count)] if are_numbers(count) else figure for figure in figures))


def _ended(done: PhaseState, found: Array, rank: Array) -> RESULTS:
    """The result of a motion, given the rank found at its end and that at its start."""
    contacts = done.contacts
    same, settled, known = found == rank, True, True
    if contacts is not None:
        same, settled, known = found == contacts.touch.rank, contacts.found, contacts.known
    goes_on = ~differs(done.ended, diffrax.RESULTS.event_occurred) | ~differs(done.ended, diffrax.RESULTS.successful)
    return first_failure(
        (
            (xp.all(xp.isfinite(done.y.q)) & xp.all(xp.isfinite(done.y.qd)), RESULTS.not_finite),
            (differs(done.ended, diffrax.RESULTS.max_steps_reached), RESULTS.steps_exhausted),
            (xp.asarray(known), RESULTS.impulse_unknown),
            (xp.asarray(settled), RESULTS.contacts_undecided),
            (done.mode.decided, RESULTS.joint_sticks),
            (~done.going, RESULTS.phases_exhausted),
            (goes_on | same, RESULTS.rank_changed),
            (goes_on, RESULTS.step_too_small),
            (~done.mode.resting, RESULTS.stuck),
        )
    )


def _stats(done: PhaseState, usual: Array) -> TrajectoryStats:
    watch, most = done.watch, done.watch.kinetic
    most = xp.where(most > tolerance_of(STILL, most) ** 2 * usual, most, usual)  # what stands has none but of rounding
    watched = {
        "position_violation": watch.position,
        "velocity_violation": watch.velocity / xp.where(watch.speed > 0, watch.speed, 1.0),
        "kinetic_energy": watch.kinetic,
        "energy_error": watch.energy / xp.where(most > 0, most, 1.0),
        "nearest_singularity": watch.nearest,
        "contraction": watch.contraction,
        "jump": watch.jump,
    }
    counts = {"steps": done.steps, "rejected": done.rejected, "phases": done.phases}
    end = xp.where(done.mode.resting, done.since, done.t)
    return TrajectoryStats(**counts, end=end, **without_derivatives(watched, done.y))
