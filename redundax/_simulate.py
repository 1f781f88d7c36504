"""Motion: the index-1 equations (7), (25) integrated by diffrax and kept on the constraint manifold.

    q' = qd,   qd' = qdd(q, qd, t)

The rank is found once and held (`_held_rank`); each step is projected (`_stepper`). Accelerations, multipliers and
friction at the times asked for are those of `solve`.
"""

from typing import cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from ._closure import AbstractClosure, MinimumNorm
from ._culprits import culprits
from ._factorisation import Factorisation, factorize
from ._held_rank import hold
from ._kinematics import slip_motion
from ._module import Numbers, as_float, known
from ._moving import Context, Equations, Moving, projected
from ._results import RESULTS, first_failure
from ._scaling import scaling
from ._solve import solve
from ._solver import Newton
from ._stabilisation import AbstractStabilisation, Projection
from ._state import State
from ._stepper import Carried, Stepper, Watch
from ._system import AbstractSystem
from ._trajectory import Trajectory, TrajectoryStats

_MINIMUM_NORM, _PROJECTION, _DOPRI8 = MinimumNorm(), Projection(), diffrax.Dopri8()


def simulate(
    system: AbstractSystem,
    state: State,
    t1: ArrayLike,
    *,
    closure: AbstractClosure = _MINIMUM_NORM,
    solver: diffrax.AbstractSolver = _DOPRI8,
    stabilisation: AbstractStabilisation = _PROJECTION,
    ts: Numbers | None = None,
    rtol: ArrayLike | None = 1e-8,
    dt0: ArrayLike | None = None,
    max_steps: int = 100_000,
    rank: ArrayLike | None = None,
    adjoint: diffrax.AbstractAdjoint | None = None,
    throw: bool | None = None,
    progress: bool = False,
) -> Trajectory:
    """The motion of a system from a state.

    **Arguments:**

    - `system`: a `Mechanism` or `System` whose coordinates add: a `retraction` of one's own is not supported yet.
    - `state`: position, velocity and time at the start, on the constraint manifold and not in a singular position.
    - `t1`: time at the end.
    - `closure`: which of the multipliers to take where they are not unique; it matters to the motion where friction
      depends on load.
    - `solver`: any diffrax solver of ordinary differential equations; explicit ones suit stiff constraints, not stiff
      loads.
    - `stabilisation`: `Projection()`, `Baumgarte(alpha, beta)` or `NoStabilisation()`.
    - `ts`: times to give the motion at, ascending; 101 from start to end if not given.
    - `rtol`: tolerance of a step, of positions relative to the size of the mechanism and of velocities to the largest
      so far; `None` for constant steps `dt0`.
    - `dt0`: first step; a small one from the velocities and accelerations at the start if not given.
    - `max_steps`: steps at most, rejected ones included.
    - `rank`: declared rank of the constraint Jacobian; decided at the start if not given. It is held over the motion.
    - `adjoint`: how derivatives are taken, `diffrax.RecursiveCheckpointAdjoint()` (reverse mode) if not given;
      `diffrax.ForwardMode()` for `jax.jvp` and `jax.jacfwd`.
    - `throw`: whether to raise an error unless the result is successful; by default outside of `jit` and `vmap`.
    - `progress`: whether to print progress.

    **Returns:** a `Trajectory`. The motion passes singular positions on the branch that its velocity lies on.

    **Raises:** `ValueError` for arguments that do not fit; `RuntimeError` with the message of the result where `throw`
    says so.
    """
    n = len(system.coordinates)
    if state.q.shape != (n,) or state.qd.shape != (n,):
        raise ValueError(
            f"Argument `state` must have one coordinate for each of the {n} velocities to be simulated, but its `q` "
            f"has shape {state.q.shape}. Use coordinates that add; charts with a retraction are not supported."
        )
    if rtol is None and dt0 is None:
        raise ValueError("Argument `dt0` must be given where `rtol` is None, but it is None: it is the constant step.")
    if rtol is not None and not isinstance(solver, diffrax.AbstractAdaptiveSolver):
        raise ValueError(
            f"Argument `rtol` must be None with {type(solver).__name__}, which does not estimate its error, but it is "
            "given. Give `rtol=None` and a constant step `dt0`, or another solver."
        )
    dtype = state.qd.dtype
    t1 = as_float(t1).astype(dtype)
    ts = state.t + (t1 - state.t) * jnp.linspace(0, 1, 101, dtype=dtype) if ts is None else as_float(ts).astype(dtype)
    mass = system.mass(state.q, state.t)
    trajectory = _simulate(
        system.anonymous(),
        state,
        t1,
        ts,
        closure,
        solver,
        stabilisation,
        None if rtol is None else as_float(rtol),
        None if dt0 is None else as_float(dt0),
        max_steps,
        None if rank is None else jnp.asarray(rank),
        diffrax.RecursiveCheckpointAdjoint() if adjoint is None else adjoint,
        diffrax.TextProgressMeter() if progress else diffrax.NoProgressMeter(),
        singular=known(mass) and _singular(np.asarray(mass)),
    )
    failed = trajectory.result != RESULTS.successful
    if throw is False or (throw is None and not known(failed)):
        return trajectory
    if not known(failed):
        return trajectory.result.error_if(trajectory, failed)
    if failed:
        raise RuntimeError(RESULTS[trajectory.result] + culprits(system, state, trajectory.result))
    return trajectory


def _singular(mass: np.ndarray) -> bool:
    """Whether the mass matrix is, or is nearly, singular."""
    size = np.sqrt(np.where(np.diag(mass) > 0, np.diag(mass), 1.0))
    return bool(np.linalg.eigvalsh(mass / size[:, None] / size)[0] < 1e-12)


@eqx.filter_jit
def _simulate(
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
    rank: Array | None,
    adjoint: diffrax.AbstractAdjoint,
    meter: diffrax.AbstractProgressMeter,
    *,
    singular: bool,
) -> Trajectory:
    factor = factorize(system, state, rank)
    rank = factor.spectrum.rank
    result, acceleration, tau = _start(system, state, factor, closure, rank)
    possible = (result == RESULTS.successful) & ~factor.singular_position
    scale = scaling(system, state, factor.jacobian)
    reach = jnp.max(jnp.abs(acceleration) / scale.coordinates)
    speed = jnp.max(jnp.abs(state.qd) / scale.coordinates) + jnp.sqrt(reach * scale.length)
    speed = jax.lax.stop_gradient(jnp.where(speed > 0, speed, 1.0))
    equations = Equations(system, closure, Newton(), stabilisation, _sense(system, state), scale, speed)
    held, _ = hold(system, state, scale, rank, singular=singular)
    first = 0.01 * scale.length / speed if dt0 is None else dt0
    end = jnp.where(possible, t1, state.t)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: args[0].derivative(t, y, args[1])),
        Stepper(solver),
        state.t,
        end,
        jnp.minimum(first, t1 - state.t),
        Moving(state.q, state.qd, jnp.zeros_like(state.t)),
        (equations, Context(held, jax.lax.stop_gradient(tau))),
        stepsize_controller=_controller(rtol, first),
        saveat=diffrax.SaveAt(
            subs=[diffrax.SubSaveAt(ts=jnp.clip(ts, state.t, end)), diffrax.SubSaveAt(t1=True)], solver_state=True
        ),
        adjoint=adjoint,
        max_steps=max_steps,
        progress_meter=meter,
        throw=False,
    )
    (path, last), (_, stop) = cast(tuple[Moving, Moving], solution.ys), cast(list, solution.ts)
    reached = jnp.append((ts <= stop) & possible, True)
    points = jnp.append(ts, stop), jax.tree.map(lambda a, b: jnp.concatenate([a, b]), path, last), reached
    solved, counted = _solved(equations, points, rank, singular)
    ended = _ended(solution.result, last, counted[-1] == rank)
    refused = RESULTS.where(result == RESULTS.successful, RESULTS.rank_changed, result)
    stats = _stats(cast(Carried, solution.solver_state).watch, solution.stats)
    q, qd, acceleration, multipliers, friction = (x[:-1] for x in solved)
    result = RESULTS.where(possible, ended, refused)
    return Trajectory(ts, q, qd, acceleration, multipliers, friction, result, stats)


def _start(
    system: AbstractSystem, state: State, factor: Factorisation, closure: AbstractClosure, rank: Array
) -> tuple[RESULTS, Array, Array]:
    """Result, accelerations and friction at the start."""
    if not system.friction:
        return factor.result, factor.acceleration, state.qd[:0]
    solution = solve(system, state, closure=closure, rank=rank)
    return solution.result, solution.acceleration, solution.friction


def _sense(system: AbstractSystem, state: State) -> Float[Array, " p"]:
    return jnp.sign(slip_motion(system, state)[0]) if system.friction else jnp.zeros(0, state.qd.dtype)


def _controller(rtol: Array | None, first: Array) -> diffrax.AbstractStepSizeController:
    """Of the relative errors that the stepper gives."""
    if rtol is None:
        return diffrax.ConstantStepSize()
    return diffrax.PIDController(rtol=0.0, atol=rtol, dtmin=1e-10 * first, force_dtmin=False)


def _solved(
    equations: Equations, points: tuple[Array, Moving, Array], rank: Array, singular: bool
) -> tuple[tuple[Array, ...], Array]:
    """Position, velocity, acceleration, multipliers and friction at times, and the rank found there."""
    system = equations.system

    def at(point: tuple[Array, Moving, Array]) -> tuple[tuple[Array, ...], Array]:
        t, y, valid = point
        y = jax.tree.map(lambda x: jnp.where(valid, x, jnp.nan), y)
        held, found = hold(system, State(y.q, y.qd, t), equations.scaling, rank, singular=singular)
        if equations.stabilisation.projects:
            y, _ = projected(system, t, y, held)
        solved = equations.solved(State(y.q, y.qd, t), Context(held, None))
        return (y.q, y.qd, solved.acceleration, solved.multipliers, solved.tau), found

    return jax.lax.map(at, points)


def _ended(result: diffrax.RESULTS, last: Moving, same: Array) -> RESULTS:
    """The result of an integration; `same` says whether the rank is what it was."""
    done = result == diffrax.RESULTS.successful
    return first_failure(
        (
            (jnp.all(jnp.isfinite(last.q)) & jnp.all(jnp.isfinite(last.qd)), RESULTS.not_finite),
            (result != diffrax.RESULTS.max_steps_reached, RESULTS.steps_exhausted),
            (done | same, RESULTS.rank_changed),
            (done, RESULTS.step_too_small),
        )
    )


def _stats(watch: Watch, steps: dict) -> TrajectoryStats:
    return TrajectoryStats(
        steps=jnp.asarray(steps["num_accepted_steps"]),
        rejected=jnp.asarray(steps["num_rejected_steps"]),
        position_violation=watch.position,
        velocity_violation=watch.velocity / watch.speed,
        kinetic_energy=watch.kinetic,
        energy_error=watch.energy / jnp.where(watch.kinetic > 0, watch.kinetic, 1.0),
        nearest_singularity=watch.nearest,
    )
