"""A motion as phases: between events at which a sense of slip changes, and at rest.

Without friction, or with friction that knows no sense, there is one phase. The number of phases is bounded, so that
the motion can be differentiated in reverse mode; those that no sample of a batch needs are passed over.
"""

from typing import NamedTuple, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .._tools._module import batch_any
from ._held_rank import AnyHeld
from ._moving import Context, Equations, Moving
from ._release import Onward, Release, set_out
from ._slip import bracket_event, is_released, locate
from ._stepper import Carried, Diagnostics, Stepper
from ._stick import Mode
from ._times import within


class Options(NamedTuple):
    """Arguments of diffrax, the tolerance of a step, the end of the motion, and the times asked for."""

    solver: diffrax.AbstractSolver
    constant: bool
    controller: diffrax.AbstractStepSizeController
    adjoint: diffrax.AbstractAdjoint
    meter: diffrax.AbstractProgressMeter
    max_steps: int
    tolerance: Array
    first: Array
    end: Array
    ts: Float[Array, " times"]


class PhaseState(NamedTuple):
    """A motion so far.

    - `t`, `y`, `sense`, `tau`, `held`: where it is, and what is held from there on.
    - `resting`, `since`: whether it is at rest, and when the phase began.
    - `path`, `senses`, `rests`: at the times asked for, as far as it got.
    - `going`, `decided`: whether it goes on; whether it was found which joints stick.
    - `ended`: how the last phase ended.
    - `watch`, `steps`, `rejected`, `phases`: the evidence.
    """

    t: Array
    y: Moving
    sense: Float[Array, " p"]
    tau: Float[Array, " p"]
    held: AnyHeld
    resting: Bool[Array, ""]
    since: Array
    path: Moving
    senses: Float[Array, "times p"]
    rests: Bool[Array, " times"]
    going: Bool[Array, ""]
    decided: Bool[Array, ""]
    ended: diffrax.RESULTS
    watch: Diagnostics
    steps: Int[Array, ""]
    rejected: Int[Array, ""]
    phases: Int[Array, ""]


def run(start: PhaseState, equations: Equations, options: Options, max_phases: int) -> PhaseState:
    """The motion up to the end."""

    def phase(_: Array, now: PhaseState) -> PhaseState:
        def after() -> PhaseState:
            return jax.tree.map(lambda a, b: jnp.where(now.going, a, b), _phase(now, equations, options), now)

        return jax.lax.cond(batch_any(now.going), after, lambda: now)

    if not equations.has_sense:
        return _phase(start, equations, options)
    return jax.lax.fori_loop(0, max_phases, phase, start)


def _phase(now: PhaseState, equations: Equations, options: Options) -> PhaseState:
    equations = equations.with_sense(jax.lax.stop_gradient(now.sense))
    end = jnp.where(now.going & ~now.resting, options.end, now.t)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: args[0].derivative(t, y, args[1])),
        Stepper(options.solver, options.constant),
        now.t,
        end,
        jnp.minimum(options.first, end - now.t),
        now.y,
        (equations, Context(now.held, now.tau, None if equations.directions is None else equations.sense)),
        stepsize_controller=options.controller,
        saveat=diffrax.SaveAt(
            subs=[diffrax.SubSaveAt(ts=within(now.t, end, options.ts)), diffrax.SubSaveAt(t1=True)], solver_state=True
        ),
        event=diffrax.Event(lambda t, y, args, **_: y.event > 0) if equations.has_sense else None,
        adjoint=options.adjoint,
        max_steps=options.max_steps,
        progress_meter=options.meter,
        throw=False,
    )
    (path, last), (_, stop) = cast(tuple[Moving, Moving], solution.ys), cast(list, solution.ts)
    t, y = stop[0], jax.tree.map(lambda x: x[0], last)
    carried = cast(Carried, solution.solver_state)
    onward = Mode(now.sense, carried.context.tau, now.resting, now.decided)
    stopped, released = jnp.zeros((), bool), None
    if equations.has_sense:
        happened = solution.result == diffrax.RESULTS.event_occurred
        t, y, onward, stopped, released = _stopped(now, equations, options.end, happened, t, y, carried, onward)
    here = (options.ts >= now.t) & (options.ts <= t)
    done = PhaseState(
        t=t,
        y=y._replace(qd=jnp.where(onward.resting, 0.0, y.qd)),
        sense=onward.sense,
        tau=onward.tau,
        held=carried.context.held,
        resting=onward.resting,
        since=jnp.where(stopped, t, now.since),
        path=jax.tree.map(lambda new, old: jnp.where(like(here, new), new, old), path, now.path),
        senses=jnp.where(here[:, None], now.sense, now.senses),
        rests=jnp.where(here, now.resting, now.rests),
        going=stopped & onward.decided & (t < options.end),
        decided=onward.decided,
        ended=solution.result,
        watch=_join(now.watch, carried.watch),
        steps=now.steps + solution.stats["num_accepted_steps"],
        rejected=now.rejected + solution.stats["num_rejected_steps"],
        phases=now.phases + ~now.resting,
    )
    if released is None:
        return done
    release = Release(
        equations.with_sense(onward.sense), done.t, done.y, carried.context._replace(along=onward.sense), released
    )
    return _beyond(done, set_out(release, options.end, options.ts, options.tolerance), options)


def _beyond(done: PhaseState, onward: Onward, options: Options) -> PhaseState:
    """What the motion is after the first moments past a release."""
    here = (options.ts > done.t) & (options.ts <= onward.t)
    return done._replace(
        t=onward.t,
        y=onward.y,
        sense=onward.sense,
        path=jax.tree.map(lambda new, old: jnp.where(like(here, new), new, old), onward.path, done.path),
        senses=jnp.where(here[:, None], done.sense, done.senses),
        rests=done.rests & ~here,
        steps=done.steps + (onward.t > done.t),
        going=done.going & (onward.t < options.end),
    )


def _stopped(
    now: PhaseState,
    equations: Equations,
    end: Array,
    happened: Bool[Array, ""],
    t: Array,
    y: Moving,
    carried: Carried,
    onward: Mode,
) -> tuple[Array, Moving, Mode, Bool[Array, ""], Bool[Array, " p"] | None]:
    """Where an event of the last step ends a phase, or loads end a rest, how it goes on there, whether they do, and
    which joints with several slips are let go."""
    rests = now.resting & now.going
    (first, start), last = carried.start, y.at(jnp.where(now.resting, end, t))
    before = jax.tree.map(lambda a, b: jnp.where(now.resting, a, b), y.at(t), start.at(first))
    bracket = bracket_event(equations, before, last, carried.context, rests, happened)
    there = bracket.there
    moves = now.resting & ~there.resting & ~jnp.any(is_released(equations, there))  # what no friction held
    t = jnp.where(now.resting, jnp.where(moves, bracket.low, bracket.high), t)
    stopped = jnp.where(now.resting, ~there.resting, happened)
    event = stopped & ~moves
    goes_on = onward._replace(resting=now.resting & ~moves, decided=now.decided & (there.decided | ~moves))
    none = None if equations.directions is None else jnp.zeros(now.sense.shape, bool)
    located = locate  # of a large mechanism formed anew in reverse mode: what it keeps on the way would not fit
    if equations.system.plan is not None:
        located = eqx.filter_checkpoint(locate, prevent_cse=False)
    t, y, onward, released = jax.lax.cond(
        event, lambda: located(equations, bracket, t, y, carried.context, event), lambda: (t, y, goes_on, none)
    )
    return t, y._replace(event=jnp.zeros_like(t)), onward, stopped, released


def like(mask: Array, x: Array) -> Array:
    """A mask of times, shaped as an array that has them in front."""
    return mask.reshape(mask.shape + (1,) * (x.ndim - 1))


def _join(one: Diagnostics, two: Diagnostics) -> Diagnostics:
    """The watch over two phases."""
    joined = jax.tree.map(jnp.maximum, one, two)
    return joined._replace(nearest=jnp.minimum(one.nearest, two.nearest), start=one.start)
