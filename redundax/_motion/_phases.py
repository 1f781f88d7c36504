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

from .._equations._kinematics import slip_motion
from .._system._directions import Directions
from .._system._results import RESULTS, chosen
from .._system._state import State
from .._tools._compilation import is_quick, is_single
from .._tools._module import batch_any
from .._tools._no_answer import without_second_derivatives
from .._tools._numbers import are_known, are_numbers, as_program, chosen_of, cond, stop_gradient, take, tolerance_of, xp
from ._controller import Controller
from ._held_rank import AnyHeld, Held, held_by
from ._impact import TOGETHER, After, Before, settle
from ._linear import Linear, least_friction
from ._moving import STILL, Context, Equations, Moving, Touch
from ._pace import turned_by
from ._project import project
from ._release import Release, set_out
from ._slip import Plan, no_plan
from ._stepper import Begin, Diagnostics, Stepper, seen_between
from ._stick import Mode
from ._times import within
from ._touch import Hit, arrived, no_hit, open_overlaps
from ._walk import Walk, walk

# Steps that are kept at most where going forth and back are computed apart, and of how many coordinates together.
_KEPT, _KEPT_NUMBERS = 8192, 2**17
# Coordinates of all stretches together of which `walk` keeps steps, which takes some 100 MB for the most steps allowed.
_MOST = 1024
# By how much friction may turn surfaces that begin to slide, in what they gain, so that ordinary steps follow: by ten
# times as much they do to 1e-9, and by twenty times to 1e-3.
_FOLLOWED = 4.0


class Options(NamedTuple):
    """Arguments of diffrax, the most steps and phases, the tolerance of a step, the times asked for, how far looks at
    joints are at most, the restitution of one-sided contacts, and if derivatives are taken of how surfaces slide."""

    solver: diffrax.AbstractSolver
    constant: bool
    controller: Controller
    adjoint: diffrax.AbstractAdjoint
    meter: diffrax.AbstractProgressMeter
    max_steps: int
    max_phases: int
    tolerance: Array
    ts: Float[Array, " times"]
    apart: Array
    restitution: Float[Array, " c"] | None
    differentiated: Bool[Array, ""]


class ImpactLog(NamedTuple):
    """Impacts so far: how many, when, the impulses of contacts, the energy that they took, and the work of drivers; NaN
    of the others."""

    number: Int[Array, ""]
    t: Float[Array, " impacts"]
    impulses: Float[Array, "impacts c"]
    lost: Float[Array, " impacts"]
    work: Float[Array, " impacts"]


class Contacts(NamedTuple):
    """One-sided contacts so far: what they do, the event ahead, whether it was found how they went on, and the friction
    of impacts known; what is wrong with the state in which they settled at first; what they do at the times asked for,
    and the impacts."""

    touch: Touch
    hit: Hit
    found: Bool[Array, ""]
    known: Bool[Array, ""]
    first: RESULTS
    path: Touch
    impacts: ImpactLog


class PhaseState(NamedTuple):
    """A motion so far.

    - `t`, `y`, `mode`, `held`: where it is and how it goes on, and what is held from there on.
    - `since`, `plan`: when the phase began, and the event at which it ends.
    - `path`, `senses`, `rests`: at the times asked for, as far as it got.
    - `going`: whether it goes on.
    - `released`, `touches`: which joints with several slips have just been let go; whether by loads that just reach
      what held them.
    - `ended`: how the last steps ended.
    - `begun`: how many phases began, rests too; -1 before contacts have settled.
    - `watch`, `steps`, `rejected`, `phases`: the evidence.
    - `contacts`: the one-sided ones, if there are some.
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
    touches: Bool[Array, ""]
    ended: diffrax.RESULTS
    begun: Int[Array, ""]
    watch: Diagnostics
    steps: Int[Array, ""]
    rejected: Int[Array, ""]
    phases: Int[Array, ""]
    contacts: Contacts | None = None

    def goes_on(self, max_phases: int) -> Bool[Array, ""]:
        """Whether it does, to the event at which the last phase ends."""
        return self.going & ((self.begun < max_phases) | (self.plan.time < xp.inf))


def run(start: PhaseState, equations: Equations, options: Options) -> PhaseState:
    """The motion up to the end."""
    if not equations.has_sense and start.contacts is None:
        return stretch(start, equations, options, np.False_)
    max_phases = options.max_phases

    def phase(now: PhaseState) -> PhaseState:
        if equations.directions is not None:
            lets_go = batch_any(xp.any(now.released))
            now = cond(lets_go, lambda: _set_out(now, equations, options), lambda: now)
        if now.contacts is None:
            return stretch(now, equations, options, now.begun >= max_phases)
        lands = now.contacts.hit.time < xp.inf
        ends = lands | (now.begun >= max_phases)
        done = cond(now.begun < 0, lambda: now, lambda: stretch(now, equations, options, ends))
        any_lands = lands if are_numbers(lands) else batch_any(lands)
        return cond(any_lands, lambda: _struck(done, lands, equations, options), lambda: done)

    if are_known(start, equations, options):
        while start.goes_on(max_phases):
            start = phase(start)
        return start

    def after(_: Array, now: PhaseState) -> PhaseState:
        goes_on = now.goes_on(max_phases)

        return jax.lax.cond(batch_any(goes_on), lambda: chosen_of(goes_on, phase(now), now), lambda: now)

    return jax.lax.fori_loop(0, _stretches(equations, max_phases, touches=start.contacts is not None), after, start)


@as_program
def stretch(now: PhaseState, equations: Equations, options: Options, lands: Array | np.bool_) -> PhaseState:
    """Steps up to the next event, or only to the one ahead."""
    controller, contacts = options.controller, now.contacts
    if contacts is not None:
        equations = equations.with_touch(contacts.touch)
    sense, mode = jax.lax.stop_gradient((now.mode.sense, now.mode))
    end = jnp.where(now.going, jnp.where(lands, now.plan.time, controller.end), now.t)
    first = jnp.where(now.plan.time < jnp.inf, now.plan.time - now.t, controller.first)
    first = jnp.where(mode.resting & (now.plan.time == jnp.inf), end - now.t, first)
    context = Context(now.held, mode.tau, mode.resting, None if equations.directions is None else sense)
    stepper = Stepper(options.solver, options.constant)
    span, ts = (now.t, end, jnp.minimum(first, end - now.t)), within(now.t, end, options.ts)
    y = now.y
    if contacts is not None:  # rows that were let go may have held it off those that hold from here on
        y = project(equations.system, now.t, y, now.held)
        y = chosen_of(mode.resting, now.y, y)
        touch = contacts.touch._replace(overlap=open_overlaps(equations, now.t, y))
        contacts, equations = contacts._replace(touch=touch), equations.with_touch(touch)
    begin = Begin(mode, now.since, now.held, now.plan, lands, controller.end, options.apart, options.differentiated)
    args = equations.with_sense(sense), context, begin
    walked = _steps(stepper, options, span, y, args, ts)
    t, y, path, carried, control = walked.t, walked.y, walked.path, walked.inner, walked.control
    here = (options.ts >= now.t) & (options.ts <= t)
    after = options.ts >= carried.since
    senses = jnp.where((now.plan.time < jnp.inf) & after[:, None], carried.mode.sense, sense)
    rests = jnp.where((now.plan.time < jnp.inf) & after, carried.mode.resting, mode.resting)
    plan = carried.plan if control.plan is None else control.plan
    # Surfaces that may turn take steps up to an event, and others from there.
    short = (now.plan.time < jnp.inf) & (equations.directions is not None)
    begins = ~short
    if contacts is not None and control.hit is not None:
        begins, hits = ~jnp.asarray(lands), control.hit.time < jnp.inf
        ahead = no_plan(carried.mode)._replace(time=control.hit.time, joint=jnp.asarray(-1))
        slips = plan if equations.has_sense else plan._replace(time=jnp.full_like(plan.time, jnp.inf))
        plan = chosen_of(hits, ahead, slips)
        which = jnp.where(lands, contacts.hit.which, control.hit.which)  # those of the event that steps landed at
        contacts = contacts._replace(hit=control.hit._replace(which=which), path=_noted(here, contacts))
    return PhaseState(
        t=t,
        y=y,
        mode=carried.mode_along(equations),
        held=carried.held,
        since=carried.since,
        plan=plan,
        path=chosen_of(here, path, now.path),
        senses=jnp.where(here[:, None], senses, now.senses),
        rests=jnp.where(here, rests, now.rests),
        going=carried.mode.decided & ((plan.time < jnp.inf) | short | carried.cut | lands) & (t < controller.end),
        released=carried.released,
        touches=carried.touches,
        ended=walked.result,
        watch=_join(now.watch, carried.watch),
        steps=now.steps + walked.taken,
        rejected=now.rejected + walked.refused,
        begun=now.begun + begins,
        contacts=contacts,
        phases=now.phases + (carried.cut | (carried.mode.decided & ~carried.mode.resting & ~short & ~lands)),
    )


def _stretches(equations: Equations, max_phases: int, *, touches: bool) -> int:
    """How many there are at most."""
    if not equations.has_sense and not touches:
        return 1
    twice = equations.directions is not None or touches
    return (2 if twice else 1) * max_phases + 1 + touches  # contacts settle first


def _adjoint(options: Options, equations: Equations) -> diffrax.AbstractAdjoint:
    """How derivatives of steps are taken that `walk` leaves, as of large mechanisms and without projection.

    Where going forth and back are computed apart, what is computed again differs by rounding, and so do the lengths of
    steps, by as much as errors do that are rounding: derivatives were off by up to 2e-3. So all steps are kept there of
    motions of one phase; of others back alone computes a phase again, and then from its steps.
    """
    own, one = options.adjoint, not equations.has_sense and equations.touch is None
    if not (is_quick() and one and isinstance(own, diffrax.RecursiveCheckpointAdjoint)):
        return own
    kept = min(_KEPT, _KEPT_NUMBERS // equations.system.coordinates.angular.size)
    return diffrax.RecursiveCheckpointAdjoint(max(own.checkpoints or 0, kept))


def _steps(
    stepper: Stepper,
    options: Options,
    span: tuple[Array, Array, Array],
    y: Moving,
    args: tuple[Equations, Context, Begin],
    ts: Float[Array, " times"],
) -> Walk:
    """Steps over a span of time, whose first is given."""
    terms = diffrax.ODETerm(lambda t, y, args: args[0].derivative(t, y, args[1]))
    start, end, first = span
    plain = isinstance(options.meter, diffrax.NoProgressMeter) and stepper.always_jumps(args[0])
    plain = plain and not isinstance(stepper, diffrax.AbstractImplicitSolver)  # whose tolerances diffrax fills in
    adjoint = diffrax.ForwardMode() if is_single() else _adjoint(options, args[0])  # of known numbers none are taken
    stretches = _stretches(args[0], options.max_phases, touches=args[0].touch is not None)
    in_reverse = isinstance(adjoint, diffrax.RecursiveCheckpointAdjoint)
    in_reverse = in_reverse and stretches * args[0].system.coordinates.angular.size <= _MOST
    # Lengths of steps go with how friction turns surfaces: derivatives past a stop were off by a thousandth where steps
    # computed again had others.
    own = is_single() or is_quick() or (in_reverse and args[0].directions is not None)
    if plain and own and (in_reverse or isinstance(adjoint, diffrax.ForwardMode)):
        return walk(terms, stepper, options.controller, (*span, ts), y, args, options.max_steps, in_reverse)
    saved = [diffrax.SubSaveAt(ts=ts), diffrax.SubSaveAt(t1=True)]
    solution = diffrax.diffeqsolve(
        terms,
        stepper,
        start,
        end,
        first,
        y,
        args,
        stepsize_controller=options.controller,
        saveat=diffrax.SaveAt(subs=saved, solver_state=True, controller_state=True),
        adjoint=adjoint,
        max_steps=options.max_steps,
        progress_meter=options.meter,
        throw=False,
    )
    (path, last), (_, stop) = cast(tuple[Moving, Moving], solution.ys), cast(list, solution.ts)
    taken, refused = solution.stats["num_accepted_steps"], solution.stats["num_rejected_steps"]
    states, last = (solution.solver_state, solution.controller_state), jax.tree.map(lambda x: x[0], last)
    return Walk(stop[0], stop[0], last, *states, solution.result, taken, refused, path, jnp.zeros((), int))


def _noted(here: Bool[Array, " times"], contacts: Contacts) -> Touch:
    """What contacts do at the times asked for, with what they do at some of them."""
    return chosen_of(here, contacts.touch, contacts.path)


def _struck(done: PhaseState, lands: Array | np.bool_, equations: Equations, options: Options) -> PhaseState:
    """What the motion is after an event of contacts, if it has landed at one; its start is one."""
    contacts, starts = cast(Contacts, done.contacts), done.begun < 0
    touch, which = contacts.touch, contacts.hit.which
    there = equations.with_touch(touch).with_sense(stop_gradient(done.mode.sense))
    context = Context(done.held, done.mode.tau, done.mode.resting)
    t, y = cond(starts, lambda: (done.t, done.y), lambda: arrived(there, done.t, done.y, context, which))
    t, y = without_second_derivatives(jnp.asarray(lands) & ~starts, (t, y))
    loaded = take(touch.kept, np.array(there.system.names.one_sided))
    closed, near = loaded | touch.rests | which, tolerance_of(TOGETHER, done.t)
    before = Before(closed, loaded ^ which, loaded & which, near)
    after = settle(there, y.at(t), cast(Array, options.restitution), before)
    left = options.controller.end - done.since
    after = after._replace(found=after.found & (starts | ~_goes_round(done, after, there, (t, left))))
    onward = _settled(done._replace(t=t, y=y), after, there, starts)
    settled = cast(Contacts, onward.contacts)
    here = (starts | (options.ts > done.t)) & (options.ts <= t)  # as the step may end before the event
    onward = onward._replace(
        path=chosen_of(here, onward.y, done.path),
        senses=xp.where(here[:, None], onward.mode.sense, done.senses),
        rests=xp.where(here, onward.mode.resting, done.rests),
        contacts=settled._replace(path=_noted(here, settled)),
        going=onward.going & done.going & (starts | (t < options.controller.end)),
        begun=xp.maximum(onward.begun, 0),
    )
    return chosen_of(lands, onward, done)


def _goes_round(done: PhaseState, after: After, equations: Equations, times: tuple[Array, Array]) -> Bool[Array, ""]:
    """Whether nothing changes at an event, a moment after another: what opens would close, and what closes open; given
    its time and that to the end."""
    (t, left), touch = times, equations.touching
    moment = tolerance_of(STILL, t) * xp.minimum(equations.scaling.size / equations.speed, left)
    same = xp.all(after.touch.kept == touch.kept) & xp.all(after.touch.rests == touch.rests) & ~after.strikes
    if after.mode is not None:
        same = same & xp.all(after.mode.sense == done.mode.sense)
    return same & (t - done.since <= moment)


def _settled(now: PhaseState, after: After, equations: Equations, starts: Bool[Array, ""]) -> PhaseState:
    """The motion from an instant on at which contacts have settled."""
    contacts, factor = cast(Contacts, now.contacts), after.factor
    touch = stop_gradient(after.touch)
    equations = equations.with_touch(touch)
    system = equations.system
    held = held_by(
        system, after.state, factor.scaling, factor.split.stress, None, singular=cast(Held, now.held).singular
    )
    impacts = contacts.impacts
    strikes = after.strikes & after.known
    place = strikes & (xp.asarray(np.arange(len(impacts.t))) == impacts.number)
    noted = ImpactLog(
        impacts.number + strikes,
        xp.where(place, after.state.t, impacts.t),
        xp.where(place[:, None], after.impulses, impacts.impulses),
        xp.where(place, after.lost, impacts.lost),
        xp.where(place, after.work, impacts.work),
    )
    y = now.y._replace(qd=after.state.qd, work=now.y.work + after.work - after.lost)
    plan = now.plan._replace(time=xp.full_like(now.plan.time, xp.inf))
    contacts = contacts._replace(
        touch=touch,
        hit=no_hit(touch, now.t),
        found=after.found,
        known=after.known,
        first=chosen(starts, after.factor.result, contacts.first),
        impacts=noted,
    )
    mode, going = now.mode if after.mode is None else after.mode, now.going & after.found & after.known
    return now._replace(
        y=y,
        mode=mode,
        held=held,
        since=now.t,
        released=from_rest(equations, after.state, mode.sense),
        touches=now.touches & False,
        plan=plan,
        contacts=contacts,
        going=going,
        watch=now.watch._replace(contraction=xp.maximum(now.watch.contraction, after.contraction)),
    )


def from_rest(equations: Equations, state: State, sense: Float[Array, " p"]) -> Bool[Array, " p"]:
    """Which joints with several slips begin to slide from rest, in the senses of what follows."""
    if equations.directions is None:
        return sense != sense
    return equations.sets_out(equations.is_none(slip_motion(equations.system, state)[0]), sense)


@as_program
def _set_out(done: PhaseState, equations: Equations, options: Options) -> PhaseState:
    """What the motion is after the first moments past a release, if there was one."""
    if done.contacts is not None:
        equations = equations.with_touch(done.contacts.touch)
    release = _release(done, equations)
    end = options.controller.before_jump(options.controller.end, done.t)
    onward = set_out(release, end, options.ts, options.tolerance)
    onward = without_second_derivatives(jnp.any(release.joints), onward)
    here, contacts = (options.ts >= done.t) & (options.ts <= onward.t), done.contacts
    if contacts is not None:
        contacts = contacts._replace(path=_noted(here, contacts))
    watch = seen_between(equations, done.held, (done.t, done.y), (onward.t, onward.y))
    return done._replace(
        watch=_join(done.watch, watch),
        t=onward.t,
        contacts=contacts,
        y=onward.y,
        mode=done.mode._replace(sense=onward.sense),
        path=chosen_of(here, onward.path, done.path),
        senses=jnp.where(here[:, None], done.mode.sense, done.senses),
        rests=done.rests & ~here,
        steps=done.steps + (onward.t > done.t),
        going=done.going & (onward.t < options.controller.end),
    )


def _release(done: PhaseState, equations: Equations) -> Release:
    """The release, in the directions against what holds and is nearest to friction a little later; of no joints where
    ordinary steps follow how friction turns them."""
    held = jnp.where(done.released, 0.0, jax.lax.stop_gradient(done.mode.sense))
    state, directions = done.y.at(done.t), cast(Directions, equations.directions)
    before = equations.with_sense(held)
    linear = before.linear(state, done.held, closed=before.loaded)
    solved, tau = before.solved(state, linear, done.mode.tau, held), stop_gradient(done.mode.tau)
    yields = cast(Linear, linear).yields
    lacks = least_friction(yields, before.sticking, before.slip_size)
    slip = solved.slip_by(tau, yields)
    let_go = jnp.where(done.touches, directions.against(tau - lacks @ slip), stop_gradient(done.mode.sense))
    sense = jnp.where(done.released, let_go, held)
    turns = turned_by(before, tau, yields) > _FOLLOWED * directions.along(slip, sense)
    joints = done.released & (done.touches | jnp.any(done.released & turns))
    context = Context(done.held, done.mode.tau, done.mode.resting, sense)
    onward, rates = equations.with_sense(sense), stop_gradient((linear.rate, solved.slip))
    return Release(onward, done.t, done.y, context, joints, done.touches, *rates)


def _join(one: Diagnostics, two: Diagnostics) -> Diagnostics:
    """The watch over two phases."""
    joined = jax.tree.map(jnp.maximum, one, two)
    return joined._replace(nearest=jnp.minimum(one.nearest, two.nearest), start=one.start)
