"""A motion as phases: between events at which a sense of slip changes, and at rest.

Without friction, or with friction that knows no sense, there is one phase. Steps end before one that passes an event;
the next phase begins with the step to there. The number of phases is bounded, so that the motion can be differentiated
in reverse mode; those that no sample of a batch needs are passed over.
"""

from typing import NamedTuple, cast

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._system._directions import Directions
from .._tools._compilation import is_single
from .._tools._module import batch_any
from .._tools._numbers import are_known, as_program, cond, xp
from ._held_rank import AnyHeld
from ._moving import Context, Equations, Moving
from ._release import Release, set_out
from ._slip import Plan
from ._stepper import Begin, Carried, Control, Controller, Diagnostics, Stepper
from ._stick import Mode
from ._times import within


class Options(NamedTuple):
    """Arguments of diffrax, the tolerance of a step, the end of the motion, and the times asked for."""

    solver: diffrax.AbstractSolver
    constant: bool
    controller: Controller
    adjoint: diffrax.AbstractAdjoint
    meter: diffrax.AbstractProgressMeter
    max_steps: int
    tolerance: Array
    ts: Float[Array, " times"]


class PhaseState(NamedTuple):
    """A motion so far.

    - `t`, `y`, `mode`, `held`: where it is and how it goes on, and what is held from there on.
    - `since`, `plan`: when the phase began, and the event at which it ends.
    - `path`, `senses`, `rests`: at the times asked for, as far as it got.
    - `going`: whether it goes on.
    - `released`: which joints with several slips have just been let go.
    - `ended`: how the last steps ended.
    - `begun`: how many phases began, rests too.
    - `watch`, `steps`, `rejected`, `phases`: the evidence.
    """

    t: Array
    y: Moving
    mode: Mode
    held: AnyHeld
    since: Array
    plan: Plan
    path: Moving
    senses: Float[Array, "times p"]
    rests: Bool[Array, " times"]
    going: Bool[Array, ""]
    released: Bool[Array, " p"]
    ended: diffrax.RESULTS
    begun: Int[Array, ""]
    watch: Diagnostics
    steps: Int[Array, ""]
    rejected: Int[Array, ""]
    phases: Int[Array, ""]

    def goes_on(self, max_phases: int) -> Bool[Array, ""]:
        """Whether it does, to the event at which the last phase ends."""
        return self.going & ((self.begun < max_phases) | (self.plan.time < xp.inf))


def run(start: PhaseState, equations: Equations, options: Options, max_phases: int) -> PhaseState:
    """The motion up to the end."""
    if not equations.has_sense:
        return stretch(start, equations, options, np.False_)

    def phase(now: PhaseState) -> PhaseState:
        done = stretch(now, equations, options, now.begun >= max_phases)
        if equations.directions is None:
            return done
        lets_go = batch_any(xp.any(done.released))
        return cond(lets_go, lambda: _set_out(done, equations, options), lambda: done)

    if are_known(start, equations, options):
        while start.goes_on(max_phases):
            start = phase(start)
        return start

    def after(_: Array, now: PhaseState) -> PhaseState:
        goes_on = now.goes_on(max_phases)

        def gone() -> PhaseState:
            return jax.tree.map(lambda a, b: jnp.where(goes_on, a, b), phase(now), now)

        return jax.lax.cond(batch_any(goes_on), gone, lambda: now)

    stretches = max_phases + 1 if equations.directions is None else 2 * max_phases + 1
    return jax.lax.fori_loop(0, stretches, after, start)


@as_program
def stretch(now: PhaseState, equations: Equations, options: Options, lands: Array | np.bool_) -> PhaseState:
    """Steps up to the next event, or only to the one ahead."""
    controller = options.controller
    sense, mode = jax.lax.stop_gradient((now.mode.sense, now.mode))
    end = jnp.where(now.going, jnp.where(lands, now.plan.time, controller.end), now.t)
    first = jnp.where(now.plan.time < jnp.inf, now.plan.time - now.t, controller.first)
    first = jnp.where(mode.resting & (now.plan.time == jnp.inf), end - now.t, first)
    context = Context(now.held, mode.tau, mode.resting, None if equations.directions is None else sense)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: args[0].derivative(t, y, args[1])),
        Stepper(options.solver, options.constant),
        now.t,
        end,
        jnp.minimum(first, end - now.t),
        now.y,
        (equations.with_sense(sense), context, Begin(mode, now.since, now.held, now.plan, lands)),
        stepsize_controller=controller,
        saveat=diffrax.SaveAt(
            subs=[diffrax.SubSaveAt(ts=within(now.t, end, options.ts)), diffrax.SubSaveAt(t1=True)],
            solver_state=True,
            controller_state=True,
        ),
        adjoint=diffrax.ForwardMode() if is_single() else options.adjoint,  # of known numbers none are taken
        max_steps=options.max_steps,
        progress_meter=options.meter,
        throw=False,
    )
    (path, last), (_, stop) = cast(tuple[Moving, Moving], solution.ys), cast(list, solution.ts)
    t, y = stop[0], jax.tree.map(lambda x: x[0], last)
    carried, control = cast(Carried, solution.solver_state), cast(Control, solution.controller_state)
    here = (options.ts >= now.t) & (options.ts <= t)
    after = options.ts >= carried.since
    senses = jnp.where((now.plan.time < jnp.inf) & after[:, None], carried.mode.sense, sense)
    rests = jnp.where((now.plan.time < jnp.inf) & after, carried.mode.resting, mode.resting)
    plan = carried.plan if control.plan is None else control.plan
    # Surfaces that may turn take steps up to an event, and others from there.
    short = (now.plan.time < jnp.inf) & (equations.directions is not None)
    return PhaseState(
        t=t,
        y=y,
        mode=carried.mode,
        held=carried.held,
        since=carried.since,
        plan=plan,
        path=jax.tree.map(lambda new, old: jnp.where(like(here, new), new, old), path, now.path),
        senses=jnp.where(here[:, None], senses, now.senses),
        rests=jnp.where(here, rests, now.rests),
        going=carried.mode.decided & ((plan.time < jnp.inf) | short | carried.cut | lands) & (t < controller.end),
        released=carried.released,
        ended=solution.result,
        watch=_join(now.watch, carried.watch),
        steps=now.steps + solution.stats["num_accepted_steps"],
        rejected=now.rejected + solution.stats["num_rejected_steps"],
        begun=now.begun + ~short,
        phases=now.phases + (carried.cut | (carried.mode.decided & ~carried.mode.resting & ~short & ~lands)),
    )


@as_program
def _set_out(done: PhaseState, equations: Equations, options: Options) -> PhaseState:
    """What the motion is after the first moments past a release, if there was one."""
    release = _release(done, equations)
    onward = set_out(release, options.controller.end, options.ts, options.tolerance)
    here = (options.ts > done.t) & (options.ts <= onward.t)
    return done._replace(
        t=onward.t,
        y=onward.y,
        mode=done.mode._replace(sense=onward.sense),
        path=jax.tree.map(lambda new, old: jnp.where(like(here, new), new, old), onward.path, done.path),
        senses=jnp.where(here[:, None], done.mode.sense, done.senses),
        rests=done.rests & ~here,
        steps=done.steps + (onward.t > done.t),
        going=done.going & (onward.t < options.controller.end),
    )


def _release(done: PhaseState, equations: Equations) -> Release:
    """The release, in the directions against what holds."""
    held = jnp.where(done.released, 0.0, jax.lax.stop_gradient(done.mode.sense))
    state, directions = done.y.at(done.t), cast(Directions, equations.directions)
    before = equations.with_sense(held)
    linear = before.linear(state, done.held, closed=before.loaded)
    let_go = directions.against(before.solved(state, linear, done.mode.tau, held).tau)
    sense = jnp.where(done.released, let_go, held)
    context = Context(done.held, done.mode.tau, done.mode.resting, sense)
    return Release(equations.with_sense(sense), done.t, done.y, context, done.released)


def like(mask: Array, x: Array) -> Array:
    """A mask of times, shaped as an array that has them in front."""
    return mask.reshape(mask.shape + (1,) * (x.ndim - 1))


def _join(one: Diagnostics, two: Diagnostics) -> Diagnostics:
    """The watch over two phases."""
    joined = jax.tree.map(jnp.maximum, one, two)
    return joined._replace(nearest=jnp.minimum(one.nearest, two.nearest), start=one.start)
