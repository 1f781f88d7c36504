"""Events: a joint that slips comes to a stop, or joints that stick are let go.

A step goes on with the senses held, smoothly through the event. At its end the event is seen, and Newton's method on
the step's dense output, or halving of it, tells when it is (`look`). The step is not taken: the next one ends there,
and what interpolation left is made up by a step of Newton's method on the time (`landed`),

    dt = -h / h',   y <- y + y' dt

h a slip rate, or of a joint let go its slip acceleration with the friction of its sense. So the event has its own
derivative. Joints let go start from there; where a slip rate is zero it is asked which joints stick (`_stick`).

Where a joint has several slips with one friction h is the velocity of its surfaces along the
direction in which they slide as the step begins. Where they are let go, in the direction of what holds them, h is what
their friction lacks to hold them: accelerations turn otherwise than friction where masses differ. Beyond a stop
friction goes on as before it. Steps that end against that direction must pass a stop (`ends_well`). The first moments
after a release are those of `_release`.

A mechanism at rest is looked at from time to time: loads that change may let it go.
"""

from collections.abc import Callable
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from .._equations._kinematics import slip_rate
from .._system._directions import Directions
from .._system._state import State
from .._tools._module import batch_any, or_zeros
from .._tools._no_answer import without_derivative
from .._tools._numbers import chosen_of, tolerance_of, xp
from ._linear import AnyLinear, least_friction
from ._moving import NONE, STILL, Context, Equations, Moving, Solved, rechart
from ._stick import Mode, mode_at, mode_of

# Halvings of a step: the square of what is left is below rounding. Looks at rest, and in a motion at least; and in a
# step at least, which is what its dense output resolves.
_HALVINGS, LOOKS, _FEW = 30, 100, 8
# Part of the step to both sides over which h' is a difference, and that Newton's method on the time may have left of
# the way to a stop before its last step: its square is lost to curvature.
_APART = 2.0**-14
# Part of a step by which it passes the stop of surfaces that may turn: near its end its dense output is as good as it.
PAST = 0.005
# A step so short, in lengths of the mechanism, is as good in between: the eighth power is below rounding.
_SHORT = 1e-2
# Slip across the direction that comes to a stop, relative to the speed of the mechanism, at least so many roundings.
_BESIDE = 1e-8, 1e2


class Plan(NamedTuple):
    """The event that the next step ends at.

    - `time`: infinite where there is none.
    - `joint`: of which slip h is, negative if the event is where the step ends.
    - `slope`: rates of the slip accelerations where joints are let go, shape (p,).
    - `weights`: those of h among slip accelerations, where joints with several slips are let go; shape (p,).
    - `free`: which joints are let go, shape (p,).
    - `stops`: whether a joint comes to a stop.
    - `onward`: else how it goes on.
    """

    time: Float[Array, ""]
    joint: Array
    slope: Float[Array, " p"]
    weights: Float[Array, " p"]
    free: Bool[Array, " p"]
    stops: Bool[Array, ""]
    onward: Mode


def no_plan(mode: Mode) -> Plan:
    """No event ahead."""
    zero, none = xp.zeros((), mode.tau.dtype), xp.zeros((), bool)
    like = xp.zeros_like(mode.tau)
    return Plan(zero + xp.inf, xp.zeros((), int), like, like, mode.sense != mode.sense, none, mode)


class Seen(NamedTuple):
    """What is found at an instant.

    - `rate`, `solved`: slip rates and the equations solved.
    - `there`: what joints do, with the senses held.
    - `against`: slip rates against their sense, as lengths; shape (p,).
    - `yields`: accelerations and slip accelerations by unit friction, where joints have several slips.
    - `watch`: what else is watched.
    """

    rate: Float[Array, " p"]
    solved: Solved
    there: Mode
    against: Float[Array, " p"]
    yields: tuple[Array, Array] | None
    watch: PyTree


def seen(
    equations: Equations,
    state: State,
    linear: AnyLinear,
    context: Context,
    trial: Float[Array, " p"],
    lands: Bool[Array, ""],
    watch: PyTree,
) -> Seen:
    """What is found at a state, friction with the senses of `trial`; `lands` says whether which joints stick is asked
    even if none do, and friction of surfaces that come to a stop is against the direction in which they did."""
    along, yields = context.along, None
    if along is not None:
        along = jnp.where(trial == equations.sense, along, trial)
        yields = linear.response.unit.acceleration, cast(Array, linear.yields)
    stops = lands & equations.still(linear.rate) & equations.directed
    felt = linear._replace(rate=jnp.where(stops, 0.0, linear.rate))
    solved = equations.with_sense(trial).solved(state, felt, context.tau, along)
    there = mode_at(equations, state, context.held, linear, jnp.any(equations.sticking) | lands)
    against = _against(equations, linear.rate, context.along) * equations.slip_size
    return Seen(linear.rate, solved, there, against, yields, watch)


def has_event(equations: Equations, state: State, linear: AnyLinear, along: Array | None) -> Bool[Array, ""]:
    """Whether a joint slips against its sense, or joints that stick do not any longer."""
    there = mode_of(equations, state, linear, jnp.any(equations.sticking))
    return _is_event(equations, there, _against(equations, linear.rate, along) * equations.slip_size)


def _is_event(equations: Equations, there: Mode, against: Float[Array, " p"]) -> Bool[Array, ""]:
    small = tolerance_of(NONE, against) * equations.speed
    return jnp.any(_released(equations, there)) | jnp.any(against > small)


def ends_well(equations: Equations, rate: Float[Array, " p"], along: Float[Array, " p"]) -> Bool[Array, ""]:
    """Whether joints with several slips that slide against the directions of the step's start did so past a stop, and
    not beside it, where they turn round."""
    if equations.directions is None:
        return jnp.ones((), bool)
    directions, slow = equations.directions, tolerance_of(_BESIDE, rate) * equations.speed
    ahead = directions.along(rate, along)
    beside = rate - ahead * along / directions.arms
    passed = directions.every(jnp.abs(beside) * equations.slip_size <= slow)
    return jnp.all((ahead >= 0) | passed | ~(directions.directed & equations.may_stick))


def _released(equations: Equations, there: Mode) -> Bool[Array, " p"]:
    """Which joints that stick are let go."""
    return equations.sticking & (there.sense != 0)


def _against(equations: Equations, rate: Float[Array, " p"], along: Float[Array, " p"] | None) -> Float[Array, " p"]:
    """Rates at which joints slip against their sense; of those with a direction as of the slip that moves most."""
    against = jnp.where(equations.may_stick, -rate * equations.sense, 0.0)
    if along is None or equations.directions is None:
        return against
    directions, sizes = equations.directions, equations.slip_size
    whole = -directions.along(rate, along) * directions.reach(sizes) / sizes
    return jnp.where(directions.directed & equations.may_stick, whole, against)


def _let_go(equations: Equations, there: Mode, tau: Float[Array, " p"]) -> Float[Array, " p"]:
    """Senses after joints are let go: of several slips with one friction the direction against what holds them."""
    go, directions = _released(equations, there), equations.directions
    sense = jnp.where(go, there.sense, equations.sense)
    if directions is None:
        return sense
    return jnp.where(directions.directed, jnp.where(go, directions.against(tau), there.sense), sense)


def chosen(equations: Equations, rates: Float[Array, " p"], joint: Array, sense: Float[Array, " p"]) -> Array:
    """The rate of a slip, or of the surfaces of its joint along its direction."""
    if equations.directions is None:
        return rates[joint]
    whole = equations.directions.along(rates, sense)
    return jnp.where(equations.directions.directed, whole, rates)[joint]


def turns(equations: Equations, plan: Plan) -> Bool[Array, ""]:
    """Whether what stops are surfaces that may turn as they slide."""
    directions = equations.directions
    return plan.stops & (False if directions is None else jnp.asarray(directions.directed)[plan.joint])


class Step(NamedTuple):
    """A step: its times, its end, and whether it is a rest, or ends at an event; `trial` are the senses of friction at
    that, `along` the directions in which surfaces slide, `apart` how far looks at joints are at most, and `may_stop`
    which surfaces may stop in it."""

    start: Array
    end: Array
    last: Moving
    rests: Bool[Array, ""]
    lands: Bool[Array, ""]
    trial: Float[Array, " p"]
    along: Float[Array, " p"] | None
    apart: Array
    may_stop: Bool[Array, " p"]


# Part of the step by which it ends later than the event found, so that no time asked for lies between.
_LATER = 2.0**-40
# What is done next: look, halve the bracket, see before a stop that Newton's method told whether joints were let go
# earlier, take h a little after and before, ask for the direction of what holds at the event, as looks find a release
# late by a tolerance, take h there, or see what stops there.
_LOOK, _HALVE, _EARLIER, _AT, _BEFORE, _HELD, _THERE, _CUT, _DONE = range(9)


class _Looking(NamedTuple):
    """What is done next, how often it was done, and with which senses of friction; the start of the bracket, when to
    look next in it, and what was found at its end; which joints slip against their sense at the end of the step, and if
    that ends well; slip accelerations beyond the event; whether the step is cut there; what was seen last."""

    stage: Array
    turn: Array
    trial: Float[Array, " p"]
    low: Array
    aim: Array
    plan: Plan
    over: Bool[Array, " p"]
    well: Array
    slip: Float[Array, " p"]
    cut: Array
    seen: Seen


def look(
    equations: Equations,
    step: Step,
    between: Callable[[Array], Moving],
    see: Callable[[Array, Moving, Array, Array], Seen],
) -> tuple[Seen, Plan, Bool[Array, ""], Bool[Array, ""]]:
    """What is seen at the end of a step, and the first event in it; whether the step ends well, and whether it is cut
    at the event, which was seen then: near a stop of surfaces that turn no step ends well, but one just past it.

    No error bounds a step by what joints that stick carry, nor by a stop that is made up for in it: those that do not
    turn are looked at in between too.
    """
    width, waits = step.end - step.start, step.rests & ~step.lands
    most, directed = _looks(equations, step, between), equations.directed

    def body(now: _Looking) -> _Looking:
        stage, high = now.stage, now.plan.time
        looks, halves, earlier = stage == _LOOK, stage == _HALVE, stage == _EARLIER
        last = now.turn + 1 >= most
        ends, within = looks & ~waits & last, looks & ~waits & ~last
        beyond, short = _beside(step, high)
        wait = step.start + width * ((now.turn + 1) / most)
        after, held, at_root, cut = (stage == kind for kind in (_AT, _HELD, _THERE, _CUT))
        t = jnp.select(
            [ends, looks, halves | earlier, held | at_root | cut, after], [step.end, wait, now.aim, high, beyond], short
        )
        y = chosen_of(ends, step.last, rechart(equations.system, between(t))[0])
        found = see(t, y, jnp.where(held, step.trial, now.trial), step.lands | cut)
        there, go = found.there, _released(equations, found.there)
        against = jnp.where(within & directed, 0.0, found.against)
        over = jnp.where(ends | within, against > 0, now.over)
        well = now.well
        if step.along is not None:
            well = jnp.where(ends, ends_well(equations, found.rate, step.along), well)
        late = jnp.where(over, found.against, 0.0)
        event = jnp.where(waits, ~there.resting, _is_event(equations, there, against)) & ~step.lands
        moves = waits & event & ~jnp.any(go)  # what no friction held
        stops = jnp.any(late > 0)
        later = jnp.where(looks, event, ((halves | earlier) & jnp.any(go)) | (halves & stops))
        joint = jnp.where(stops, jnp.argmax(late), jnp.argmax(go))
        mode = there._replace(sense=_let_go(equations, there, there.tau), resting=jnp.zeros((), bool))
        when = jnp.where(moves, now.low, t)
        plan = now.plan._replace(time=when, joint=joint, free=go & ~stops, stops=stops, onward=mode)
        plan = chosen_of(later, plan, now.plan)
        # Just beyond a limit some joints are not yet told apart from those that stick; a little later they are.
        others = after & (now.turn == 0) & jnp.any(plan.free) & jnp.any(go & ~plan.free)
        plan = chosen_of(others, plan._replace(free=go | plan.free, onward=mode), plan)
        plan = _turned(equations, plan, found, after, held)
        plan = _timed(equations, step, now._replace(plan=plan), found, t)
        after_look = jnp.where(event & ~moves, _HALVE, jnp.where(~event & ~last, _LOOK, _DONE))
        stop = jnp.where(turns(equations, plan) & _cuts(equations, step, plan), _CUT, _DONE)
        low = jnp.where((looks | halves) & ~later, t, now.low)
        aim, first, told, ahead = _by_newton(equations, plan, (t, found, over), (low, _APART * width))
        told = halves & told
        time, joint = jnp.where(told, aim, plan.time), jnp.where(told, first, plan.joint)
        plan, asks = plan._replace(time=time, joint=joint), told & (ahead > low)
        aim, halvable = jnp.where(asks, ahead, aim), now.turn + 1 < _HALVINGS
        after_half = jnp.select([asks, told, halvable], [_EARLIER, _THERE, _HALVE], jnp.where(plan.stops, stop, _AT))
        after_ask = jnp.where(later, _HALVE, _THERE)
        release = _THERE if equations.directions is None else _HELD
        nexts = [after_look, after_half, after_ask, jnp.where(others, _AT, _BEFORE), release, _THERE]
        following = jnp.select([looks, halves, earlier, after, stage == _BEFORE, held], nexts, _DONE)
        return _Looking(
            stage=following,
            turn=jnp.where(following == stage, now.turn + 1, 0),
            trial=jnp.where(((following == _AT) | (following == _THERE)) & plan.free, plan.onward.sense, now.trial),
            low=low,
            aim=aim,
            plan=plan,
            over=over,
            well=well,
            slip=found.solved.slip,
            cut=cut,
            seen=found,
        )

    begin = _nothing_seen(step, see)
    found = jax.lax.while_loop(lambda now: now.stage < _DONE, body, begin)
    return found.seen, found.plan, found.well, found.cut


def _looks(equations: Equations, step: Step, between: Callable[[Array], Moving]) -> Array:
    """How often a step is looked at: once where all joints slip, unless one has slipped back in between."""
    width, sticks = step.end - step.start, jnp.any(equations.sticking)
    most = jnp.clip(jnp.ceil(width / step.apart), jnp.where(sticks, 1, _FEW), LOOKS).astype(int)

    def slips_back(k: Array) -> Bool[Array, ""]:
        t = step.start + width * (k / most)
        y, _ = rechart(equations.system, between(t))
        against = _against(equations, slip_rate(equations.system, y.at(t)), step.along) * equations.slip_size
        return jnp.any((against > tolerance_of(NONE, against) * equations.speed) & ~equations.directed)

    asked = ~(step.lands | step.rests | sticks)
    first = jax.lax.while_loop(lambda k: asked & (k < most) & ~slips_back(k), lambda k: k + 1, jnp.ones((), most.dtype))
    looks = jnp.where(asked & (first == most), 1, most)
    return jnp.where(step.lands, 1, jnp.where(step.rests, LOOKS, looks))


def _cuts(equations: Equations, step: Step, plan: Plan) -> Bool[Array, ""]:
    """Whether a step may be cut at a stop: near its end, or as it is short."""
    width = step.end - step.start
    near = plan.time > step.start + (1 - 2 * PAST) * width
    return (near | (width * equations.speed < _SHORT * equations.scaling.size)) & step.may_stop[plan.joint]


def _beside(step: Step, t: Array) -> tuple[Array, Array]:
    """Times a little after another and before it."""
    little = _APART * (step.end - step.start)
    return t + little, jnp.maximum(t - little, step.start)


def _timed(equations: Equations, step: Step, now: _Looking, found: Seen, t: Array) -> Plan:
    """The plan, with h' and the time where h is zero as far as what was found at a time tells them."""
    plan, before = now.plan, now.stage == _BEFORE
    beyond, short = _beside(step, plan.time)
    slope = (now.slip - found.solved.slip) / jnp.where(beyond > short, beyond - short, 1.0)
    plan = plan._replace(slope=jnp.where(before, slope, plan.slope))
    root = _root(equations, plan, found, now.trial, t) + _LATER * (step.end - step.start)
    root = jnp.clip(root, step.start, jnp.minimum(beyond, step.end))
    return plan._replace(time=jnp.where(before | (now.stage == _THERE), root, plan.time))


def _root(equations: Equations, plan: Plan, found: Seen, trial: Float[Array, " p"], t: Array) -> Array:
    """When h is zero, by a step of Newton's method from what was found at a time."""
    free, slip = jnp.any(plan.free), found.solved.slip
    of_event = jnp.where(free, slip, found.rate), jnp.where(free, plan.slope, slip)
    weighs = free & jnp.any(plan.weights != 0)
    h, rise = (jnp.where(weighs, plan.weights @ x, chosen(equations, x, plan.joint, trial)) for x in of_event)
    return t - h / jnp.where(rise != 0, rise, jnp.inf)


def _turned(equations: Equations, plan: Plan, found: Seen, after: Array, held: Array) -> Plan:
    """The plan, in which joints with several slips are let go against their friction a little after their limit, or
    against what holds them at it and is nearest to that.

    h is the power of what their friction lacks to hold them, in slips as they are let go: errors of their directions do
    not change it.
    """
    directions = equations.directions
    if directions is None:
        return plan
    free = plan.free & directions.directed
    wanted = (after | held) & jnp.any(free)
    beyond = jnp.where(after, found.there.tau, plan.onward.tau)
    lacks, slip = _lacking(equations, found, beyond, wanted)
    sense = directions.against(jnp.where(after, beyond, beyond - lacks @ slip))
    sense = jnp.where(wanted & free, sense, plan.onward.sense)
    weights = jnp.where(wanted & after, jnp.where(free, slip, 0.0) @ lacks, plan.weights)
    return plan._replace(weights=weights, onward=plan.onward._replace(sense=sense, tau=beyond))


def _lacking(
    equations: Equations, found: Seen, tau: Float[Array, " p"], wanted: Bool[Array, ""]
) -> tuple[Float[Array, "p p"], Float[Array, " p"]]:
    """From slip accelerations to the least friction that makes them at joints that stick, and those with a friction."""
    _, yields = cast(tuple[Array, Array], found.yields)
    lacks = jax.lax.cond(
        batch_any(wanted),
        lambda: least_friction(yields, equations.sticking, equations.slip_size),
        lambda: jnp.zeros_like(yields),
    )
    return lacks, found.solved.slip_by(tau, yields)


def _nothing_seen(step: Step, see: Callable[[Array, Moving, Array, Array], Seen]) -> _Looking:
    none, like = jnp.zeros((), int), jax.eval_shape(see, step.end, step.last, step.trial, step.lands)
    nothing = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), like)
    return _Looking(
        none,
        none,
        step.trial,
        step.start,
        step.end,
        no_plan(nothing.there),
        step.trial != step.trial,
        none == 0,
        jnp.zeros_like(step.trial),
        none > 0,
        nothing,
    )


def _by_newton(
    equations: Equations, plan: Plan, at: tuple[Array, Seen, Bool[Array, " p"]], known: tuple[Array, Array]
) -> tuple[Array, Array, Bool[Array, ""], Array]:
    """When to look next for an event before that of the plan: where Newton's method from what was seen at a time has
    the first of the joints that stop, or halfway where it leaves the bracket; that joint, and whether the time moves by
    little; and when it does not count as still yet. `known` are the start of the bracket and what is little."""
    (t, found, over), (low, little) = at, known
    rate, slip = found.rate, found.solved.slip
    roots = jnp.where(over, t - rate / jnp.where(slip != 0, slip, 1.0), jnp.inf)
    root, directions = jnp.min(roots), equations.directions
    crossed = over & (found.against > 0)
    sound = plan.stops & (root < jnp.inf) & jnp.all(jnp.where(over, (slip != 0) & (crossed == (roots < t)), True))
    if directions is not None:
        sound = sound & ~jnp.any(over & jnp.asarray(directions.directed))
    told = sound & (jnp.abs(root - t) <= little)
    aim = jnp.where(told | (sound & (low < root) & (root < plan.time)), root, (low + plan.time) / 2)
    first, slow = jnp.argmin(roots), tolerance_of(STILL, rate) * equations.speed / equations.slip_size
    near = 2 * slow[first] / jnp.where(slip[first] != 0, jnp.abs(slip[first]), 1.0)
    return aim, first, told, root - jnp.maximum(near, little)


class Landing(NamedTuple):
    """What a step ends with that ends at an event.

    - `lands`, `free`: whether one does, and if joints are let go there.
    - `weights`, `along`, `slope`: those of h among slip rates, or slip accelerations; the directions in which joints
      slide; and h'.
    - `shift`: how much later the event is.
    - `change`, `slip`: y' and slip accelerations there.
    - `starts`: which joints with several slips start to slide there.
    - `halt`: the impulse that leaves those and joints that stick no slip, by slip rates, where joints have several.
    """

    lands: Bool[Array, ""]
    free: Bool[Array, ""]
    weights: Float[Array, " p"]
    along: Float[Array, " p"]
    slope: Float[Array, ""]
    shift: Float[Array, ""]
    change: Moving
    slip: Float[Array, " p"]
    starts: Bool[Array, " p"]
    halt: Float[Array, "n p"] | None


def landing(
    equations: Equations, step: Step, plan: Plan, seen: Seen, change: Moving, last: Array
) -> tuple[Landing, Mode]:
    """The end of a step, and how it goes on if that is an event, which lies in the step or not much later, and not past
    `last`, the end of the motion."""
    along = equations.sense if step.along is None else step.along
    along = jnp.where(step.trial == equations.sense, along, step.trial)
    free = jnp.any(plan.free)
    onward = chosen_of(plan.stops, seen.there, plan.onward)
    weights, starts, halt = jnp.zeros_like(along).at[plan.joint].set(1.0), plan.free & False, None
    if seen.yields is not None:
        unit, yields = seen.yields
        begins, sense = _begins(equations, seen, onward)
        stops = plan.stops & (plan.joint >= 0)  # else the motion begins
        starts = jnp.where(stops, begins, plan.free & equations.directed)
        onward = onward._replace(sense=jnp.where(stops, sense, onward.sense))
        still = jnp.where(free, equations.sticking, starts | equations.with_sense(onward.sense).sticking)
        inverse = jax.lax.cond(
            batch_any(step.lands),
            lambda: least_friction(yields, still, equations.slip_size),
            lambda: jnp.zeros_like(yields),
        )
        halt, weights = unit @ inverse, _weights(equations, plan, along, free, inverse)
    h = weights @ jnp.where(free, seen.solved.slip, seen.rate)
    slope = weights @ jnp.where(free, plan.slope, seen.solved.slip)
    good = step.lands & (plan.joint >= 0) & (plan.stops | free) & (slope != 0)
    slope = jnp.where(good, slope, 1.0)
    root, width = jnp.where(good, -h / slope, 0.0), step.end - step.start
    shift = jnp.clip(root, -width, jnp.minimum(_APART * width, jnp.maximum(last - step.end, 0.0)))
    return Landing(good, free, weights, along, slope, shift, change, seen.solved.slip, starts, halt), onward


def _begins(equations: Equations, seen: Seen, onward: Mode) -> tuple[Bool[Array, " p"], Float[Array, " p"]]:
    """Which joints with several slips start to slide where one stops, and senses of all: theirs are those of their
    accelerations, as what a stop leaves of their slips goes another way."""
    directions, (_, yields) = cast(Directions, equations.directions), cast(tuple[Array, Array], seen.yields)
    begins = equations.sets_out(equations.still(seen.rate), onward.sense)
    ahead = directions.unit(directions.arms * seen.solved.slip_by(onward.tau, yields))
    return begins, jnp.where(begins & directions.any(ahead != 0), ahead, onward.sense)


def _weights(equations: Equations, plan: Plan, along: Array, free: Array, inverse: Array) -> Float[Array, " p"]:
    """Of slip rates in the velocity of a joint's surfaces along a direction; of slip accelerations of one that is let
    go in what its friction lacks to hold it, of which the direction as it turns does not matter; of several those of
    the plan."""
    directions = cast(Directions, equations.directions)
    same, directed = jnp.asarray(directions.same)[plan.joint], jnp.asarray(directions.directed)[plan.joint]
    lacks = jnp.where(same, along / directions.arms, 0.0) @ inverse
    lacks = jnp.where(jnp.any(plan.free & ~same) & jnp.any(plan.weights != 0), plan.weights, lacks)
    one = jnp.zeros_like(along).at[plan.joint].set(1.0)
    return jnp.where(directed, jnp.where(free, lacks, jnp.where(same, directions.arms * along, 0.0)), one)


@eqx.filter_custom_jvp
def landed(
    equations: Equations, t: Array, y: Moving, context: Context, trial: Array, rate: Array, end: Landing
) -> tuple[Array, Moving]:
    """How much later the event is, and the state there."""
    y = jax.tree.map(lambda x, change: x + end.shift * change, y, end.change)
    if end.halt is not None:
        y = y._replace(qd=y.qd - jnp.where(end.lands, end.halt @ (rate + end.shift * end.slip), 0.0))
    return end.shift, y


@landed.def_jvp
def _landed_jvp(primals: tuple, tangents: tuple) -> tuple[tuple[Array, Moving], tuple[Array, Moving]]:
    equations, t, y, context, trial, _, end = primals
    none, given = jnp.zeros_like(end.shift), or_zeros(tangents[2], y)
    if context.along is not None:
        context = context._replace(along=end.along)
    at, at_dot = (equations, t, y, context), (*tangents[:2], given, tangents[3])
    changes = _changes if end.halt is None else _first_changes
    moved = jax.lax.cond(batch_any(end.lands), lambda: changes(end, trial, at, at_dot), lambda: (none, given))
    if end.halt is not None:
        moved = jax.tree.map(lambda x: without_derivative(end.lands, x), moved)
    return landed(*primals), moved


def _told(equations: Equations, t: Array, y: Moving, context: Context) -> tuple[Moving, Array, Array]:
    return equations.instant(t, y, context)


def _first_changes(end: Landing, trial: Array, at: tuple, at_dot: tuple) -> tuple[Array, Moving]:
    """Changes of the time of an event and of the state there, dt = -dh / h' as h stays 0; slip rates that are halted
    stay so. Given the equations, time, state and context where the step ends, and their changes."""
    _, (_, slip_dot, rate_dot) = eqx.filter_jvp(_told, (at[0].with_sense(trial), *at[1:]), at_dot)
    shift = jnp.where(end.lands, -(end.weights @ jnp.where(end.free, slip_dot, rate_dot)) / end.slope, 0.0)
    y_dot = jax.tree.map(lambda dot, change: dot + shift * change, at_dot[2], end.change)
    if end.halt is not None:
        y_dot = y_dot._replace(qd=y_dot.qd - jnp.where(end.lands, end.halt @ (rate_dot + shift * end.slip), 0.0))
    return shift, y_dot


_changes = eqx.filter_custom_jvp(_first_changes)


@_changes.def_jvp
def _changes_jvp(primals: tuple, tangents: tuple) -> tuple[tuple[Array, Moving], tuple[Array, Moving]]:
    """Second derivatives: the event moves, with h' and y', and the changes of the state grow until then."""
    end, trial = primals[:2]

    def exact(at: tuple, at_dot: tuple) -> tuple[Array, Moving]:
        equations, t, y, context = at
        shift, there = landed(equations, t, y, context, trial, jnp.zeros_like(trial), end)
        grow, beyond = or_zeros(eqx.filter_jvp(_told, at, at_dot)[1][0], y), equations.with_sense(trial)
        given = jax.tree.map(lambda dot, grow: dot + shift * grow, at_dot[2], grow)
        then, moved = (beyond, t + shift, there, context), (*at_dot[:2], given, at_dot[3])
        (change, *_), (_, slip_dot, rate_dot) = eqx.filter_jvp(_told, then, moved)
        flow = jnp.ones_like(t), change
        _, (_, *rise) = jax.jvp(lambda t, y: _told(beyond, t, y, context), (t + shift, there), flow)
        h_dot, slope = (end.weights @ jnp.where(end.free, *each) for each in ((slip_dot, rate_dot), rise))
        later = jnp.where(end.lands, -h_dot / jnp.where(end.lands, slope, 1.0), 0.0)
        return later, jax.tree.map(lambda dot, change: dot + later * change, given, change)

    return _changes(*primals), eqx.filter_jvp(exact, primals[2:], tangents[2:])[1]
