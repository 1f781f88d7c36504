"""Motion: the index-1 equations (7), (25) integrated by diffrax and kept on the constraint manifold.

    q' = qd,   qd' = qdd(q, qd, t)

The rank is found once and held (`_held_rank`); each step is projected (`_stepper`). Accelerations, multipliers and
friction at the times asked for are computed with the held rank; at regular positions they are those of `solve`.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array

from .._closures._closure import AbstractClosure, MinimumNorm, check_closure, for_motion
from .._equations._culprits import thrown
from .._equations._matrices import matrices_of
from .._system._axis import Axis
from .._system._friction import have_direction
from .._system._law import instants_of
from .._system._names import ByName, vector
from .._system._results import RESULTS
from .._system._state import State
from .._system._system import AbstractSystem, check_system_at
from .._tools._errors import RedundaxError
from .._tools._module import (
    Numbers,
    as_float,
    check_kind,
    check_whole,
    floats,
    is_concrete,
    numpy_of,
    one_number,
    positive,
    replace_fields,
)
from .._tools._numbers import stop_gradient
from .._tools._words import short
from ._radau_solver import Radau
from ._stabilisation import AbstractStabilisation, Projection, check_stabilisation
from ._times import Times, check_times
from ._trajectory import Trajectory

if TYPE_CHECKING:
    import diffrax

_MINIMUM_NORM, _PROJECTION = MinimumNorm(), Projection()
# Steps that reverse mode keeps: a phase of more is computed anew once, of more than 560 twice, of more than 6,500 three
# times. diffrax keeps 446 for the most steps allowed, and fills memory for each of them, taken or not.
_CHECKPOINTS = 32


def simulate(
    system: AbstractSystem,
    state: State,
    t1: ArrayLike,
    *,
    closure: AbstractClosure = _MINIMUM_NORM,
    solver: "diffrax.AbstractSolver | Radau | None" = None,
    stabilisation: AbstractStabilisation = _PROJECTION,
    ts: Numbers | None = None,
    rtol: ArrayLike | None = 1e-8,
    dt0: ArrayLike | None = None,
    jump_ts: Numbers | None = None,
    max_steps: int = 100_000,
    max_phases: int = 32,
    rank: ArrayLike | None = None,
    restitution: ByName = 0.0,
    adjoint: "diffrax.AbstractAdjoint | None" = None,
    throw: bool | None = None,
    progress: bool = False,
) -> Trajectory:
    """The motion of a system from a state: (7) or (25) over time.

    ??? example

        ```python
        smooth = rx.mechanisms.wojtyra2020()
        motion = rx.simulate(smooth, smooth.state(phi=0.8, rate=1.0), 0.1)
        motion.q.shape, motion.multipliers.shape  # (101, 12) each
        ```

    **Arguments:**

    - `system`: a `Mechanism` or `System`; with a `retraction` of its own, too.
    - `state`: position, velocity and time at the start, on the constraint manifold and not in a singular position.
    - `t1`: time at the end, not before that of `state`: motions run forward.
    - `closure`: which of the multipliers to take where they are not unique; it matters to the motion where friction
      depends on load. Joints may have play, beside one-sided contacts too.
    - `solver`: of time, not of friction as in `solve`: `Radau()` for stiff loads, or any diffrax solver of ordinary
      differential equations; implicit ones take their steps as `Radau` does. If not given `diffrax.Dopri8()`, until
      stability bounds its steps and `Radau()` takes over: not inside of transformations such as `jit` and `grad`, with
      sparse matrices, one-sided contacts, rows of velocity or constant steps, nor if less than 3000 steps are left.
    - `stabilisation`: `Projection()`, `Baumgarte(alpha, beta)` or `NoStabilisation()`.
    - `ts`: times to give the motion at, one or more, ascending from start to end; 101 if not given. Between steps it
      is interpolated, some ten times less accurately than steps are, and projected. Whole turns of joints in space are
      counted by rates and accelerations at these times, so take several a turn.
    - `rtol`: tolerance of a step, of positions relative to the size of the mechanism and of velocities to the largest
      so far, of their root mean square, in space of the largest; `None` for constant steps `dt0`, shorter only where
      one would end beside a singular position.
    - `dt0`: first step; a small one from the velocities and accelerations at the start if not given.
    - `jump_ts`: instants at which loads or drivers jump or have a kink in time, in any order. Steps end there, and
      derivatives by these instants are as accurate as others. Without it steps that are not constant end at those of
      `Trapezoid`, `SCurve`, `Cycloidal` and `Sampled` laws whose figures are known, derivatives by a kink are as
      accurate as the root of `rtol`, and those by a jump are not had; by one of two instants that are equal they are
      NaN.
    - `max_steps`: steps of a phase at most, rejected ones included.
    - `max_phases`: phases at most; where friction depends on the sense of slip each stop, release and rest begins one.
      Reverse mode takes time and memory for each, reached or not.
    - `restitution`: of one-sided contacts, the speed at which they part after an impact over that before: from 0,
      plastic, to 1, one number or some by name, the others 0.
    - `rank`: declared rank of the constraint Jacobian; decided at the start if not given. It is held over the motion.
    - `adjoint`: how derivatives are taken, `diffrax.RecursiveCheckpointAdjoint(checkpoints=32)` (reverse mode) if not
      given: more checkpoints save time where a phase has more steps, and take memory in all. Outside of `jit` all steps
      of small mechanisms are kept, and with a sleeve, ball or plate inside, too. With several of these inside of `jit`
      give more checkpoints than a phase has steps: derivatives past a stop are off by a thousandth else.
      `diffrax.ForwardMode()` for `jax.jvp` and `jax.jacfwd`.
    - `throw`: whether to raise an error unless the result is successful; by default outside of `jit` and `vmap`.
    - `progress`: whether to print progress.

    Where friction depends on the sense of slip, instants at which a joint comes to a stop or is let go are located as
    events, with their derivatives. Which joints stick is decided for all together: a joint at its bound may be held by
    others. Sleeves, balls and plates in space stop, stick and are let go as wholes, in any direction; derivatives
    are NaN past a release that loads touch without growing. A mechanism at rest stays there until its loads let it
    go, which is asked at 100 instants up to `t1`; it ends as `RESULTS.stuck` if none does. Joints of a
    mechanism that moves are looked at as often: what stops one, or lets it go, for less time is not seen. Those of
    sleeves, balls and plates that slip are looked at as steps end.

    One-sided contacts open where their load passes zero and close where their gap does, with an impact: velocities
    after it are the nearest in the metric of the mass at which none approaches. Both are events of the same kind, and
    begin a phase. Rebounds slower than 1.4e-6 of the speed of the mechanism are none. A state at which closed contacts
    approach begins with an impact. Dry friction has an impulse, by the coefficient of a joint at rest and against the
    slip that the impact leaves; what rests beside contacts goes on as `RESULTS.successful`. Bristles, and friction of
    your own by loads, have no law of impulses: a motion ends as `RESULTS.impulse_unknown` at an impact that loads them.
    Matrices must be dense beside contacts.

    Of large mechanisms, whose matrices are sparse, friction that holds joints is sought among as many directions as
    they have freedoms, each of which costs one solution. Dry sleeves, balls, plates and points on planes need dense
    matrices: `mechanism.sparse(False)`.

    Internal states of friction (`Dahl`, `LuGre`) start as in `state`, at zero if it holds none.

    Where the frictional equations may have several solutions the motion follows its branch, and stops where that ends.

    **Returns:** a `Trajectory`. The motion passes singular positions on the branch that its velocity lies on. Where
    more joints stick than need to while others move, their friction is the least that holds, as of contacts equally
    compliant; where that is more than one can have, others have more, and derivatives of friction and loads are NaN. It
    is NaN at rest. `contacts` and `impacts` tell what one-sided contacts did. Where teeth pull at any of
    the times its `pulling` names them, and a warning does as in `solve`.

    **Raises:** `ValueError` for arguments that do not fit; `RuntimeError` with the message of the result where `throw`
    says so.
    """
    import diffrax  # here, as its import takes time that only motions need

    from ._integrate import Course, integrate

    check_system_at(system, state)
    check_closure(closure)
    check_stabilisation(stabilisation)
    if solver is not None:
        advice = "Give one of diffrax, as `diffrax.Dopri8()`. Solvers of friction go to `rx.solve`."
        check_kind("solver", solver, diffrax.AbstractSolver | Radau, "a solver of time", advice)
    if adjoint is not None:
        advice = "Give `diffrax.ForwardMode()`, say."
        check_kind("adjoint", adjoint, diffrax.AbstractAdjoint, "one of diffrax", advice)
    check_whole(1, max_steps=max_steps, max_phases=max_phases)
    _check(system, state, closure, rtol, dt0)
    if rtol is not None and not isinstance(solver, diffrax.AbstractAdaptiveSolver | Radau | None):
        raise RedundaxError(
            f"Argument `rtol` must be None with {type(solver).__name__}, which does not estimate its error, but it is "
            "given. Give `rtol=None` and a constant step `dt0`, or another solver."
        )
    t1 = cast(Array, floats(t1, "t1").astype(state.qd.dtype))
    one_number("t1", t1, "Give the end, and times of the motion as `ts`.")
    given = cast(Array, (_evenly(state.t, t1) if ts is None else floats(ts, "ts")).astype(t1.dtype))
    check_times(state.t, t1, given)
    bounces = _restitution(system, restitution, stabilisation, rank)
    decided = system
    if bounces is not None:  # all contacts open: the motion decides which are
        decided = system.opened(jnp.asarray(~system.names.is_one_sided))
    fixed = stop_gradient((decided, state))  # it only decides how to compute
    matrices = matrices_of(system)
    factor = matrices.factorised(*fixed, rank)
    course = Course(
        t1,
        given,
        None if rtol is None else cast(Array, floats(rtol)),
        None if dt0 is None else cast(Array, floats(dt0)),
        solver,
        stabilisation,
        diffrax.RecursiveCheckpointAdjoint(_CHECKPOINTS) if adjoint is None else adjoint,
        diffrax.TextProgressMeter() if progress else diffrax.NoProgressMeter(),
        max_steps,
        max_phases,
        redundancy=matrices.redundancy(factor) if bounces is None else None,
        singular=matrices.is_singular(system, state, factor),
        restitution=bounces,
        jump_ts=_instants(system, jump_ts, rtol, t1),
    )
    trajectory = integrate(decided.anonymous, state, factor, for_motion(closure, system, state), course)
    trajectory = replace_fields(trajectory, names=system.names, joint_coordinates=system.joint_coordinates)
    good, end = (RESULTS.successful, RESULTS.stuck), trajectory.stats.end
    return thrown(trajectory, throw, system, state, factor, *good, end=end)


def _restitution(
    system: AbstractSystem, restitution: ByName, stabilisation: AbstractStabilisation, rank: ArrayLike | None
) -> Array | None:
    """Restitution of each contact; None without contacts. Refuses what motions with contacts cannot be asked."""
    names = system.names
    if not names.one_sided:
        if isinstance(restitution, Mapping) and restitution:
            raise RedundaxError(
                "Argument `restitution` must be left out, but names contacts: the system has none that only push."
            )
        floats(0.0 if isinstance(restitution, Mapping) else restitution, "restitution")
        return None
    contacts = ", ".join(names.contacts)
    matrices_of(system).needs_dense(
        f"Argument `system` must have dense matrices, as it has one-sided contacts, {contacts}. Simulate "
        "`mechanism.sparse(False)`."
    )
    if not stabilisation.projects or rank is not None:
        raise RedundaxError(
            f"Arguments `stabilisation` and `rank` must be left out where there are one-sided contacts, {contacts}: "
            "each phase is projected, and has a rank of its own."
        )
    axis = Axis(names.contacts, ("force",) * len(names.contacts))
    values = jnp.broadcast_to(vector("restitution", restitution, axis, " of contacts"), (len(names.contacts),))
    if is_concrete(values) and not np.all((np.asarray(values) >= 0) & (np.asarray(values) <= 1)):
        raise RedundaxError(
            f"Argument `restitution` must be between 0, plastic, and 1, but is {np.asarray(values).tolist()}. Give the "
            "speed after an impact over that before."
        )
    return values


def _instants(system: AbstractSystem, jump_ts: Numbers | None, rtol: ArrayLike | None, like: Array) -> Array | None:
    """Instants at which steps end, those of laws if none are given; None if there are none."""
    if jump_ts is None:
        of_laws = None if rtol is None else instants_of(system)
        return None if of_laws is None else of_laws.astype(like.dtype)
    given = floats(jump_ts, "jump_ts")
    if given.ndim != 1 or (is_concrete(given) and not np.all(np.isfinite(np.asarray(given)))):
        raise RedundaxError(
            f"Argument `jump_ts` must be a vector of finite times, but is {short(jump_ts)}. Give "
            "`jump_ts=[0.1, 1.1]`, say."
        )
    return cast(Array, given.astype(like.dtype)) if given.size else None


def _evenly(start: Times, end: Times) -> Times:
    """Times from start to end."""
    first, last = map(numpy_of(start, end).asarray, (start, end))
    return first + (last - first) * np.linspace(0.0, 1.0, 101, dtype=end.dtype)


def _check(
    system: AbstractSystem, state: State, closure: AbstractClosure, rtol: ArrayLike | None, dt0: ArrayLike | None
) -> None:
    """Refuse what cannot be integrated."""
    check_system_at(system, state)
    directed = have_direction(system.friction).any()
    if directed:
        matrices_of(system).needs_dense(
            "Argument `system` must have no dry friction of sleeves, balls, plates or points on planes where matrices "
            "are sparse, but has. Simulate `mechanism.sparse(False)`."
        )
    if closure.clearances(system) is not None:
        matrices_of(system).needs_dense(
            "Argument `closure` may have play in motions of mechanisms with dense matrices alone. Simulate "
            "`mechanism.sparse(False)`, or give it without `play`."
        )
    n = len(system.coordinates)
    if state.qd.shape != (n,) or (system.adds and state.q.shape != (n,)):
        raise RedundaxError(
            f"Argument `state` must have one entry for each of the {n} coordinates, but its `q` has shape "
            f"{state.q.shape} and its `qd` {state.qd.shape}. Use jax.vmap for many motions."
        )
    if not system.adds:
        _check_chart(system, state)
    for name, value in (("rtol", rtol), ("dt0", dt0)):
        if value is not None:
            one_number(name, as_float(value, name), "Give one for the motion.")
            positive(name, as_float(value, name))
    if rtol is None and dt0 is None:
        raise RedundaxError(
            "Argument `dt0` must be given where `rtol` is None, but it is None: it is the constant step."
        )


def _check_chart(system: AbstractSystem, state: State) -> None:
    """Refuse positions that the retraction does not take and give back."""
    try:
        shape = jax.eval_shape(system.retract, state.q, state.qd).shape
    except (TypeError, ValueError, IndexError) as error:
        raise RedundaxError(_chart_message(state, f"raises: {error}")) from error
    if shape != state.q.shape:
        raise RedundaxError(_chart_message(state, f"gives shape {shape}"))


def _chart_message(state: State, what: str) -> str:
    return (
        f"Argument `state` must have a `q` that the system's retraction takes and gives back, but for `q` of shape "
        f"{state.q.shape} it {what}. Give the position as the constraints take it; use jax.vmap for many motions."
    )
