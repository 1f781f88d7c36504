"""A motion as phases: between events at which a sense of slip changes, and at rest.

Without friction, or with friction that knows no sense, there is one phase. The number of phases is bounded, so that
the motion can be differentiated in reverse mode; those that are not needed do nothing.
"""

from typing import Any, NamedTuple, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ._held_rank import Held
from ._moving import Context, Equations, Moving
from ._slip import back_to_event, onward, reversed_slip
from ._stepper import Carried, Stepper, Watch


class Options(NamedTuple):
    """Arguments of diffrax, the end of the motion, and the times asked for."""

    solver: diffrax.AbstractSolver
    controller: diffrax.AbstractStepSizeController
    adjoint: diffrax.AbstractAdjoint
    meter: diffrax.AbstractProgressMeter
    max_steps: int
    first: Array
    end: Array
    ts: Float[Array, " times"]


class Run(NamedTuple):
    """A motion so far.

    - `t`, `y`, `sense`, `tau`, `held`: where it is, and what is held from there on.
    - `path`, `senses`: at the times asked for, as far as it got.
    - `going`, `stuck`, `consistent`: whether it goes on; at rest for good; with senses that match.
    - `ended`: how the last phase ended.
    - `watch`, `steps`, `rejected`, `phases`: the evidence.
    """

    t: Array
    y: Moving
    sense: Float[Array, " p"]
    tau: Float[Array, " p"] | None
    held: Held
    path: Moving
    senses: Float[Array, "times p"]
    going: Bool[Array, ""]
    stuck: Bool[Array, ""]
    consistent: Bool[Array, ""]
    ended: diffrax.RESULTS
    watch: Watch
    steps: Int[Array, ""]
    rejected: Int[Array, ""]
    phases: Int[Array, ""]


def run(start: Run, equations: Equations, options: Options, one_freedom: Array, max_phases: int) -> Run:
    """The motion up to the end, or to rest."""

    def phase(now: Run, _: None) -> tuple[Run, None]:
        return jax.lax.cond(now.going, lambda: _phase(now, equations, options, one_freedom), lambda: now), None

    if not equations.has_sense:
        return _phase(start, equations, options, one_freedom)
    return jax.lax.scan(phase, start, None, length=max_phases)[0]


def _phase(now: Run, equations: Equations, options: Options, one_freedom: Array) -> Run:
    equations = eqx.tree_at(lambda e: e.sense, equations, jax.lax.stop_gradient(now.sense))
    end = jnp.where(now.going, options.end, now.t)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: args[0].derivative(t, y, args[1])),
        Stepper(options.solver),
        now.t,
        end,
        jnp.minimum(options.first, end - now.t),
        now.y,
        (equations, Context(now.held, now.tau)),
        stepsize_controller=options.controller,
        saveat=diffrax.SaveAt(
            subs=[diffrax.SubSaveAt(ts=jnp.clip(options.ts, now.t, end)), diffrax.SubSaveAt(t1=True)],
            solver_state=True,
        ),
        event=diffrax.Event(_slipped) if equations.has_sense else None,
        adjoint=options.adjoint,
        max_steps=options.max_steps,
        progress_meter=options.meter,
        throw=False,
    )
    (path, last), (_, stop) = cast(tuple[Moving, Moving], solution.ys), cast(list, solution.ts)
    t, y = stop[0], jax.tree.map(lambda x: x[0], last)
    carried = cast(Carried, solution.solver_state)
    sense, stuck, consistent, event = now.sense, now.stuck, now.consistent, jnp.zeros((), bool)
    if equations.has_sense:
        event = solution.result == diffrax.RESULTS.event_occurred
        at, there = back_to_event(equations, t, y, carried.context)
        t, y = jax.tree.map(lambda new, old: jnp.where(event, new, old), (at, there), (t, y))
        here = jax.lax.stop_gradient((equations, t, y, carried.context.held, one_freedom))
        next_sense, next_stuck, next_consistent = onward(*here)
        sense = jnp.where(event, next_sense, sense)
        stuck, consistent = event & next_stuck, ~event | next_consistent
    here = (options.ts >= now.t) & (options.ts <= t)
    return Run(
        t=t,
        y=y,
        sense=sense,
        tau=carried.context.tau,
        held=carried.context.held,
        path=jax.tree.map(lambda new, old: jnp.where(_like(here, new), new, old), path, now.path),
        senses=jnp.where(here[:, None], now.sense, now.senses),
        going=event & ~stuck & consistent & (t < options.end),
        stuck=stuck,
        consistent=consistent,
        ended=solution.result,
        watch=_joined(now.watch, carried.watch),
        steps=now.steps + solution.stats["num_accepted_steps"],
        rejected=now.rejected + solution.stats["num_rejected_steps"],
        phases=now.phases + 1,
    )


def _slipped(t: Array, y: Moving, args: Any, **_: Any) -> Bool[Array, ""]:
    return jnp.any(reversed_slip(args[0], t, y))


def _like(mask: Array, x: Array) -> Array:
    return mask.reshape(mask.shape + (1,) * (x.ndim - 1))


def _joined(one: Watch, two: Watch) -> Watch:
    """The watch over two phases."""
    joined = jax.tree.map(jnp.maximum, one, two)
    return joined._replace(nearest=jnp.minimum(one.nearest, two.nearest), start=one.start)
