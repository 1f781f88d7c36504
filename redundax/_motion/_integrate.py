"""The compiled part of `simulate`: the start, the phases of the motion, and what is given at the times asked for."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._closures._closure import AbstractClosure
from .._factorisation import Factorisation, factorize
from .._friction import slip_kinds
from .._kinematics import slip_motion
from .._results import RESULTS, first_failure
from .._scaling import Scaling, scaling
from .._solve import solve
from .._solver import Newton
from .._state import State
from .._system import AbstractSystem
from ._held_rank import Held, hold
from ._moving import Context, Equations, Moving, projected
from ._phases import Options, Run, run
from ._slip import onward
from ._stabilisation import AbstractStabilisation
from ._stepper import at_start
from ._trajectory import Trajectory, TrajectoryStats


@eqx.filter_jit
def integrate(
    system: AbstractSystem,
    state: State,
    t1: Array,
    ts: Float[Array, " times"],
    closure: AbstractClosure,
    solver: diffrax.AbstractSolver,
    stabilisation: AbstractStabilisation,
    rtol: Array | None,
    dt0: Array | None,
    max_steps: int,
    max_phases: int,
    rank: Array | None,
    adjoint: diffrax.AbstractAdjoint,
    meter: diffrax.AbstractProgressMeter,
    *,
    singular: bool,
) -> Trajectory:
    """The motion; `singular` says whether M may be."""
    fixed = jax.lax.stop_gradient((system, state))  # what only decides how to compute has no derivative
    factor = factorize(*fixed, rank)
    rank = factor.spectrum.rank
    scale = scaling(*fixed, factor.jacobian)
    held, _ = hold(system, state, scale, rank, singular=singular)
    equations = _equations(system, state, factor, scale, closure, stabilisation)
    first = 0.01 * scale.size / equations.speed if dt0 is None else dt0
    options = Options(solver, _controller(rtol, first), adjoint, meter, max_steps, first, t1, ts)
    begin = _start(equations, state, factor, held, rank)
    done = run(_before(begin, state, held, ts, ~factor.singular_position), equations, options, begin.free, max_phases)
    solved, found = _solved(equations, done, ts, rank, singular)
    ended = _ended(done, ~factor.singular_position, found == rank, t1)
    ended = RESULTS.where(begin.result == RESULTS.successful, ended, begin.result)
    q, qd, acceleration, multipliers, friction = solved
    return Trajectory(ts, q, qd, acceleration, multipliers, friction, ended, _stats(done))


class _Start(eqx.Module):
    """How the motion starts: result, senses, friction, whether it sticks, whether it has one degree of freedom."""

    result: RESULTS
    sense: Float[Array, " p"]
    tau: Float[Array, " p"]
    stuck: Bool[Array, ""]
    free: Bool[Array, ""]


def _equations(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    scale: Scaling,
    closure: AbstractClosure,
    stabilisation: AbstractStabilisation,
) -> Equations:
    reach = jnp.max(jnp.abs(factor.acceleration) / scale.coordinates)
    speed = jnp.max(jnp.abs(state.qd) / scale.coordinates) + jnp.sqrt(reach * scale.size)
    speed = jax.lax.stop_gradient(jnp.where(speed > 0, speed, 1.0))
    angular = jnp.asarray(slip_kinds(system.friction).angular)
    sense = jnp.sign(slip_motion(system, state)[0]) if system.friction else state.qd[:0]
    return Equations(
        system,
        closure,
        Newton(),
        stabilisation,
        sense,
        scale,
        speed,
        jnp.where(angular, scale.length, 1.0),
        any(group.has_sense for group in system.friction),
    )


def _controller(rtol: Array | None, first: Array) -> diffrax.AbstractStepSizeController:
    """Of the relative errors that the stepper gives."""
    if rtol is None:
        return diffrax.ConstantStepSize()
    return diffrax.PIDController(rtol=0.0, atol=rtol, dtmin=1e-10 * first, force_dtmin=False)


def _start(equations: Equations, state: State, factor: Factorisation, held: Held, rank: Array) -> _Start:
    system, one_freedom, no = equations.system, factor.freedom == 1, jnp.zeros((), bool)
    sense, stuck = equations.sense, no
    if not system.friction:
        return _Start(factor.result, sense, sense, no, one_freedom)
    if equations.has_sense:
        here = Moving(state.q, state.qd, jnp.zeros_like(state.t))
        there = onward(*jax.lax.stop_gradient((equations, state.t, here, held, one_freedom)))
        sense, stuck = there.sense, there.stuck
    system, state, closure = jax.lax.stop_gradient((system, state, equations.closure))
    solution = solve(system, state, closure=closure, rank=rank, sense=sense)
    result = RESULTS.where(stuck, factor.result, solution.result)
    tau = jnp.where(stuck, 0.0, solution.friction)
    return _Start(result, sense, tau, stuck, one_freedom)


def _before(begin: _Start, state: State, held: Held, ts: Array, regular: Array) -> Run:
    """The run before its first phase."""
    y = Moving(state.q, state.qd, jnp.zeros_like(state.t))
    path = jax.tree.map(lambda x: jnp.full((ts.size, *x.shape), jnp.nan, x.dtype), y)
    none = jnp.zeros((), int)
    return Run(
        t=state.t,
        y=y,
        sense=begin.sense,
        tau=begin.tau,
        held=held,
        path=path,
        senses=jnp.broadcast_to(begin.sense, (ts.size, *begin.sense.shape)),
        going=(begin.result == RESULTS.successful) & regular & ~begin.stuck,
        stuck=begin.stuck,
        consistent=jnp.ones((), bool),
        ended=diffrax.RESULTS.successful,
        watch=at_start(jnp.zeros_like(state.t)),
        steps=none,
        rejected=none,
        phases=none,
    )


def _solved(equations: Equations, done: Run, ts: Array, rank: Array, singular: bool) -> tuple[tuple[Array, ...], Array]:
    """Position, velocity, acceleration, multipliers and friction at times; and the rank found at the end."""
    system = equations.system

    def at(point: tuple[Array, Moving, Array]) -> tuple[tuple[Array, ...], Array]:
        t, y, sense = point
        there = eqx.tree_at(lambda e: e.sense, equations, sense)
        held, found = hold(system, State(y.q, y.qd, t), equations.scaling, rank, singular=singular)
        if equations.stabilisation.projects:
            y, _ = projected(system, t, y, held)
        solved = there.solved(State(y.q, y.qd, t), Context(held, None))
        resting = done.stuck & (t >= done.t)
        rest = done.y.q, jnp.zeros_like(y.qd), jnp.zeros_like(y.qd)
        moving = y.q, y.qd, solved.acceleration
        motion = tuple(jnp.where(resting, a, b) for a, b in zip(rest, moving, strict=True))
        loads = tuple(jnp.where(resting, jnp.nan, x) for x in (solved.multipliers, solved.tau))
        return (*motion, *loads), found

    last = jax.tree.map(lambda a, b: jnp.concatenate([a, b[None]]), done.path, done.y)
    points = jnp.append(ts, done.t), last, jnp.concatenate([done.senses, done.sense[None]])
    solved, found = jax.lax.map(at, points)
    return tuple(x[:-1] for x in solved), found[-1]


def _ended(done: Run, regular: Array, same: Array, t1: Array) -> RESULTS:
    """The result of a motion; `same` says whether the rank is what it was."""
    reached = (done.t >= t1) | done.stuck
    events = done.ended == diffrax.RESULTS.event_occurred
    stopped = done.ended == diffrax.RESULTS.successful
    return first_failure(
        (
            (regular, RESULTS.rank_changed),
            (jnp.all(jnp.isfinite(done.y.q)) & jnp.all(jnp.isfinite(done.y.qd)), RESULTS.not_finite),
            (done.ended != diffrax.RESULTS.max_steps_reached, RESULTS.steps_exhausted),
            (done.consistent, RESULTS.joint_sticks),
            (reached | ~events, RESULTS.phases_exhausted),
            (events | stopped | same, RESULTS.rank_changed),
            (events | stopped, RESULTS.step_too_small),
            (~done.stuck, RESULTS.stuck),
        )
    )


def _stats(done: Run) -> TrajectoryStats:
    watch = done.watch
    return TrajectoryStats(
        steps=done.steps,
        rejected=done.rejected,
        phases=done.phases,
        end=done.t,
        position_violation=watch.position,
        velocity_violation=watch.velocity / jnp.where(watch.speed > 0, watch.speed, 1.0),
        kinetic_energy=watch.kinetic,
        energy_error=watch.energy / jnp.where(watch.kinetic > 0, watch.kinetic, 1.0),
        nearest_singularity=watch.nearest,
    )
