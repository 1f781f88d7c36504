"""Steps of any diffrax solver on the constraint manifold.

A step of the given solver is followed by the projection of positions and velocities. How far it moves the state is an
error of the step that the solver's own estimate need not see, and is added to it; where the projection does not close
the mechanism the step is rejected. So it is where friction changes by much that may have several solutions: the motion
follows its branch, and where the branch ends steps become too small. Solvers that reuse their last stage are told that
the state jumped.

Where friction has senses the end is looked at for events (`_slip`). A step that passes one is not taken, and steps end;
when they go on, the first ends at the event, beyond which senses are others.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float, PyTree

from .._equations._kinematics import slip_rate, velocity
from .._solvers._friction_problem import Law
from .._system._friction import load_rows
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import replace_fields
from .._tools._numbers import chosen_of, stop_gradient, tolerance_of, xp
from ._bend import Bent, ahead, before_opening, bend_in_time, bend_of_friction, nearness
from ._controller import Verdict, size_of
from ._crossing import Bend, Ends, crossed
from ._held_rank import AnyHeld, AnyHeldFactorisation, factorize_held
from ._moving import Context, Equations, Moving, Solved, rechart
from ._pace import Pace, no_pace, pace
from ._project import CLOSED, project
from ._scalars import Flag, Scalar
from ._slip import PAST, Plan, Seen, Step, landed, landing, look, seen, turns
from ._stick import Mode
from ._stiffness import Watched, stiff_steps
from ._touch import Hit, first_hit

# Largest change of friction in a step, relative to its size, where it may have several solutions.
_JUMP = 0.1
# By how much a step may raise the largest velocity: what grows more is no measure of its error, but unstable.
_FASTER = 10.0
# Part of the rows left out, in roots of the rounding, at which they are constraints of their own.
_SAME = 1e2
# Least part of its pivot that a step leaves; and of the largest pivot, at least so many cube roots of the rounding.
_LEFT, _BESIDE = 0.1, (1e-3, 10.0)


class Diagnostics(NamedTuple):
    """What is watched over the accepted steps.

    - `position`: largest violation, relative to the size of the mechanism.
    - `velocity`, `speed`: largest violation and largest velocity, both as lengths per time; `speed` begins with what
      the first accelerations reach over the length of the mechanism.
    - `kinetic`, `start`, `energy`: largest kinetic energy, T - A at the start, and its largest change.
    - `nearest`: smallest pivot of the constraints, mass-weighted: 0 in a singular position.
    - `contraction`: largest bound of that of friction at all loads.
    - `jump`: largest change of friction in a step, relative to its size, where that bound is 1 or more.
    - `stiff`: how many steps more are stiff than are not, where that is watched.
    """

    position: Float[Array, ""]
    velocity: Float[Array, ""]
    speed: Float[Array, ""]
    kinetic: Float[Array, ""]
    start: Float[Array, ""]
    energy: Float[Array, ""]
    nearest: Float[Array, ""]
    contraction: Float[Array, ""]
    jump: Float[Array, ""]
    stiff: Float[Array, ""]


def at_start(like: Float[Array, ""]) -> Diagnostics:
    """Nothing seen yet."""
    zero = xp.zeros_like(like)
    return Diagnostics(zero, zero, zero, zero, zero, zero, xp.full_like(zero, xp.inf), zero, zero, zero)


class Begin(NamedTuple):
    """How steps begin: how it moves and since when, what is held, and the event that the first step ends at; whether it
    is the last, the end of the motion, how far looks at joints are at most, and whether derivatives are taken."""

    mode: Mode
    since: Array
    held: AnyHeld
    plan: Plan
    lands: Array | np.bool_
    end: Array
    apart: Array
    differentiated: Bool[Array, ""]


class Carried(NamedTuple):
    """State: the solver's own; how it moves and since when, what is held, the directions in which surfaces slide; the
    event that the next step ends at, which joints with several slips were let go and if by loads that just reach what
    held them, and whether the last step was cut at an event; how far steps go where derivatives are taken; when loads
    were told last, and these; the watch, and pivots now and largest."""

    inner: PyTree
    mode: Mode
    since: Array
    held: AnyHeld
    along: Float[Array, " p"] | None
    plan: Plan
    released: Bool[Array, " p"]
    touches: Bool[Array, ""]
    cut: Bool[Array, ""]
    pace: Pace
    loads: tuple[Array, Float[Array, " m"]]
    watch: Diagnostics
    pivot: Float[Array, ""]
    largest: Float[Array, ""]

    @property
    def context(self) -> Context:
        """What stays the same within a step."""
        return Context(self.held, self.mode.tau, self.mode.resting, self.along)

    def mode_along(self, equations: Equations) -> Mode:
        """How it moves, with the directions in which surfaces slide by now for those of the first step."""
        if equations.directions is None or self.along is None:
            return self.mode
        return self.mode._replace(sense=jnp.where(equations.directions.directed, self.along, self.mode.sense))


class Stepper(diffrax.AbstractWrappedSolver):
    """The solver, followed by the stabilisation; `constant` steps are judged by where they end alone."""

    solver: diffrax.AbstractSolver
    constant: bool = eqx.field(static=True)

    @property
    def term_structure(self) -> PyTree:
        return self.solver.term_structure

    @property
    def interpolation_cls(self) -> Callable[..., diffrax.AbstractLocalInterpolation]:  # pyright: ignore
        return self.solver.interpolation_cls

    @property
    def term_compatible_contr_kwargs(self) -> PyTree:
        return self.solver.term_compatible_contr_kwargs

    @property
    def root_finder(self) -> optx.AbstractRootFinder:
        """Of an implicit solver."""
        return self.solver.root_finder  # pyright: ignore

    @property
    def scan_kind(self) -> PyTree:
        """Of a Runge-Kutta solver."""
        return self.solver.scan_kind  # pyright: ignore

    def always_jumps(self, equations: Equations) -> bool:
        """Whether the state jumps after each step."""
        return equations.stabilisation.projects or not equations.system.adds

    def order(self, terms: PyTree) -> int | None:
        return self.solver.order(terms)

    def error_order(self, terms: PyTree) -> Scalar | None:
        return self.solver.error_order(terms)

    def func(self, terms: PyTree, t0: Scalar, y0: PyTree, args: PyTree) -> Moving:
        return self.solver.func(terms, t0, y0, args)

    def init(self, terms: PyTree, t0: Scalar, t1: Scalar, y0: PyTree, args: PyTree) -> Carried:
        equations, context, begin = args
        inner = self.solver.init(terms, t0, t1, y0, (equations, context))
        watch = _begun(equations, t0, y0)
        zero = jnp.zeros_like(watch.kinetic)
        fixed = jax.lax.stop_gradient((watch, zero, zero))
        any_pace = no_pace(begin.mode.sense)  # until one is told no surfaces stop, if derivatives are taken
        any_pace = any_pace._replace(slow=any_pace.slow & ~begin.differentiated)
        unknown = zero + jnp.inf, jnp.zeros(len(equations.scaling.rows) if equations.loaded else 0, zero.dtype)
        none = begin.mode.sense != begin.mode.sense, zero > 0, zero > 0, any_pace, unknown
        return Carried(inner, begin.mode, begin.since, begin.held, context.along, begin.plan, *none, *fixed)

    def step(
        self, terms: PyTree, t0: Scalar, t1: Scalar, y0: PyTree, args: PyTree, solver_state: Carried, made_jump: Flag
    ) -> tuple[Moving, Verdict, PyTree, Carried, diffrax.RESULTS]:
        jumps = True if self.always_jumps(args[0]) else made_jump  # diffrax asks with one that is traced and without
        return self._step(terms, jnp.asarray(t0), jnp.asarray(t1), y0, args, solver_state, jumps)

    @eqx.filter_jit  # diffrax traces it three times
    def _step(
        self, terms: PyTree, t0: Array, t1: Array, y0: Moving, args: tuple, now: Carried, made_jump: Flag
    ) -> tuple[Moving, Verdict, PyTree, Carried, diffrax.RESULTS]:
        (equations, _, begin), system = args, args[0].system
        context, projects = now.context, equations.stabilisation.projects
        if context.along is not None:
            stopping = _stopping(system, y0.at(t0), now.pace.stops <= t1, begin.differentiated)
            context = context._replace(stopping=stopping)
        if equations.has_sense:
            equations = equations.with_sense(now.mode.sense)
        y, error, dense, inner, result = self.solver.step(terms, t0, t1, y0, (equations, context), now.inner, made_jump)
        raw, (y, settled) = y, rechart(system, y)
        if projects:
            y = project(system, t1, y, context.held)
        if equations.has_sense:
            y = chosen_of(context.rests, y0, y)
        # What is watched and what the next step starts from have no derivatives.
        fixed, there, begun_at, begun, t, before, path = stop_gradient((equations, y, y0, t0, t1, now, dense))
        between = self.solver.interpolation_cls(t0=begun, t1=t, **path).evaluate
        event, well = None, True
        if not equations.has_sense:
            found = _see(fixed, t, there, before)
        else:
            lands = before.plan.time <= t + 10 * jnp.finfo(t.dtype).eps * jnp.abs(t)
            trial = jnp.where(lands & before.plan.free, before.plan.onward.sense, fixed.sense)
            times = begun, t, there, context.rests, lands, trial, before.along
            step = Step(*times, stop_gradient(begin.apart), before.pace.slow)
            found, plan, well, cut = look(fixed, step, between, lambda *at: _seen(fixed, before, *at))
            event = step, plan, cut, found
        sight, carried, jump = _watched(fixed, now, found, inner, t)
        if isinstance(self.solver, Watched):
            stiff = stiff_steps(carried.watch.stiff, fixed, begun_at, path["k"], t - begun)
            carried = carried._replace(watch=carried.watch._replace(stiff=stiff))
        good = _may_end(sight.off, sight.excess, now, sight.pivot) if projects else jnp.isfinite(sight.off)
        good = good & settled & (jump <= _JUMP)
        size = jnp.zeros_like(t1)
        if error is not None and not self.constant:
            size = size_of(_relative(_error(error, y, raw, equations), t1 - t0, equations, y0, now, carried))
        hit = None
        if fixed.touch is not None:
            hit, stops = first_hit(fixed, (begun, t), there, between, before.context)
            good, size = good | (stops & ~begin.lands), jnp.where(stops & ~begin.lands, 0.0, size)
        seen_at = t if event is None else jnp.minimum(t, event[1].time)
        bends, crosses, over = _bend(fixed, found, (begun, seen_at, there.at(t)), between, before, begin, hit)
        y = crossed(Ends(equations, (t0, y0), (t1, y), context), over)
        if event is None:
            told = _without_slips(jnp.where(good, size, jnp.inf), bends, crosses, hit, begin)
            return y, told._replace(stiff=carried.watch.stiff), dense, carried, result
        step, plan, cut, found = event
        waits = step.lands | context.rests | (bends >= jnp.minimum(plan.time, _time_of(hit)))
        end, at, ahead, again = t1, now.plan, now.plan.time, jnp.zeros((), bool)
        if equations.directions is not None:
            steps = self.solver.interpolation_cls(t0=t0, t1=t1, **dense)
            y = chosen_of(cut, rechart(system, steps.evaluate(jnp.where(cut, plan.time, t1)))[0], y)
            end, at = chosen_of(cut, (plan.time, plan), (t1, at))
            step = step._replace(end=jnp.where(cut, plan.time, step.end), lands=step.lands | cut)
            again = turns(fixed, plan) & (plan.time < jnp.inf) & ~cut
            on = jax.lax.cond(begin.differentiated, lambda: pace(fixed, t, found), lambda: no_pace(fixed.sense))
            ahead, again = _ahead(step, plan, (before.pace.turns, jnp.minimum(ahead, on.ahead)), again, cut)
            carried = carried._replace(pace=on, cut=cut)
            plan = plan._replace(time=jnp.where(turns(fixed, plan), jnp.inf, plan.time))
        if hit is not None:
            plan, hit = _first_of(plan, hit, step.lands)
        ahead = jnp.where(waits, ahead, jnp.where(again, jnp.minimum(ahead, bends), bends))
        again = again | ~waits
        good = good & (well | step.lands) & ~again
        size = jnp.where(context.rests, 0.0, jnp.where(good, size, jnp.inf))
        y, carried, told = _landed(equations, (end, y, begin.end), now._replace(plan=at), carried, step, found)
        told = told._replace(
            size=size,
            plan=plan,
            lands=jnp.where(crosses, 1.0, told.lands),
            shift=end - t1 + told.shift,
            ahead=ahead,
            again=again.astype(t1.dtype),
            ends=jnp.where(step.lands & begin.lands, 1.0, told.ends),
            hit=hit,
            stiff=carried.watch.stiff,
        )
        return y, told, dense, carried, result


def _without_slips(size: Array, bends: Array, crosses: Array, hit: Hit | None, begin: Begin) -> Verdict:
    """What is told of a step where friction has no senses."""
    if hit is not None:
        hit = hit._replace(time=jnp.where(begin.lands, jnp.inf, hit.time))
    again, no = (bends < _time_of(hit)) & ~begin.lands, jnp.zeros_like(size)
    told = jnp.where(again, jnp.inf, size), None, crosses.astype(size.dtype), no, no, no, bends
    return Verdict(*told, again.astype(size.dtype), hit)


def _first_of(plan: Plan, hit: Hit, lands: Array) -> tuple[Plan, Hit]:
    """Of an event of slips and one of contacts the first, the other at no time."""
    first = (hit.time <= plan.time) & ~lands
    none = jnp.full_like(plan.time, jnp.inf)
    return plan._replace(time=jnp.where(first, none, plan.time)), hit._replace(time=jnp.where(first, hit.time, none))


def _time_of(hit: Hit | None) -> Array | float:
    return jnp.inf if hit is None else hit.time


def _stopping(
    system: AbstractSystem, state: State, stops: Bool[Array, " p"], differentiated: Bool[Array, ""]
) -> Float[Array, " p"]:
    """Slip rates, at the begin of a step, of surfaces that stop in it, 0 of others; where derivatives are taken."""
    begin = partial(slip_rate, system, state)
    return jnp.where(stops, jax.lax.cond(differentiated, begin, lambda: jnp.zeros(stops.shape, state.qd.dtype)), 0.0)


def _ahead(step: Step, plan: Plan, at: tuple[Array, Array], again: Array, cut: Array) -> tuple[Array, Array]:
    """Until when the next step goes, and whether it is this one again, as it passes a stop or goes on for longer than
    until when it follows how surfaces turn; `at` are that and the end of the next step where this is taken."""
    turns, ahead = at
    past, half = (1 + PAST) * plan.time - PAST * step.start, (step.start + plan.time) / 2
    near = jnp.where(turns < jnp.minimum(plan.time, step.end), turns, half)
    long = (step.end > turns) & (plan.time == jnp.inf) & ~cut & ~step.lands
    ahead = jnp.where(again, jnp.where(step.may_stop[plan.joint], past, near), ahead)
    return jnp.where(long, near, ahead), again | long


class Sight(NamedTuple):
    """What is watched at an instant: what is held from there on, how much the rows left out contribute, the watch, the
    violation of the position, and the least pivot."""

    held: AnyHeld
    excess: Array
    watch: Diagnostics
    off: Array
    pivot: Array


def _sight(equations: Equations, t: Array, y: Moving, now: Carried) -> tuple[State, AnyHeldFactorisation, Sight]:
    """The state at an instant, its factorisation, and what is watched."""
    state = y.at(t)
    factor = factorize_held(equations.system, state, now.held)
    held, excess = factor.renewed()
    sight = Sight(held, excess, *_diagnostics_after(now.watch, equations, t, y, factor), jnp.min(factor.pivots))
    return state, factor, sight


class Found(NamedTuple):
    """The equations solved at an instant, if there is friction, and what is watched."""

    solved: Solved | None
    watch: Sight


@eqx.filter_jit  # traced once
def _see(equations: Equations, t: Array, y: Moving, now: Carried) -> Found:
    """What is found at an instant where friction has no senses."""
    (state, factor, sight), solved = _sight(equations, t, y, now), None
    if equations.system.friction:
        linear = equations.linear(state, now.held, factor, closed=equations.loaded)
        solved = equations.solved(state, linear, now.mode.tau, now.along)
    return Found(solved, sight)


@eqx.filter_jit  # traced once
def _seen(equations: Equations, now: Carried, t: Array, y: Moving, trial: Array, lands: Array) -> Seen:
    """The same where it has, with those of `trial`; `lands` says whether an event is there."""
    state, factor, sight = _sight(equations, t, y, now)
    linear = equations.linear(state, now.held, factor, closed=equations.loaded)
    return seen(equations, state, linear, now.context, trial, lands, sight)


def _bend(
    equations: Equations,
    found: Seen | Found,
    step: tuple[Array, Array, State],
    between: Callable[[Array], Moving],
    now: Carried,
    begin: Begin,
    hit: Hit | None,
) -> tuple[Float[Array, ""], Bool[Array, ""], Bend]:
    """When a step should end for a bend of friction or loads, or a contact that opens, where derivatives are taken,
    infinite where there is none; whether it is the one that crosses a bend, and what. Given its begin, when it was seen
    last, as at an event in it, and its end."""
    (start, stop, state), solved, no = step, found.solved, jnp.zeros((), bool)
    system, loaded = equations.system, equations.loaded and found.solved is not None
    never = jnp.full_like(stop, jnp.inf), no, Bend(no, jnp.zeros_like(now.loads[1]), no)
    if not equations.bends:
        return never
    rate = found.rate if isinstance(found, Seen) else None

    def there(t: Array) -> State:
        return rechart(system, between(t))[0].at(t)

    def multipliers(t: Array) -> Float[Array, " m"]:
        state = there(t)
        return equations.solved(state, equations.linear(state, now.held), now.mode.tau, now.along).multipliers

    def first() -> tuple[Array, Array, Bend]:
        bent, known, near = Bent(never[0], never[2].weights, no), ~no, nearness(equations.play, begin.apart, stop)
        if loaded:
            sense = equations.sense if now.along is None else jnp.where(equations.directed, now.along, equations.sense)
            law = Law.of(system, slip_rate(system, state) if rate is None else rate, sense, state)
            (told, loads), rows = now.loads, load_rows(system.friction)
            known, ends = told == start, ((start, loads), (stop, cast(Solved, solved).multipliers))
            bent = bend_of_friction(law, rows, equations.play, multipliers, *ends, equations.sticking, near)
            bent = bent._replace(time=jnp.where(known, bent.time, jnp.inf))
        for function in equations.bending(found.solved, now.along):
            other = bend_in_time(lambda t, of=function: of(there(t)), start, stop, near)
            bent = bent._replace(time=jnp.minimum(bent.time, other), several=bent.several | (other <= bent.time))
        aim, crosses = ahead(bent.time, known, start, stop, near)
        if loaded and hit is not None:
            opens = jnp.any(hit.which & equations.touching.kept[np.array(system.names.one_sided)]) & ~begin.lands
            aim = jnp.minimum(aim, before_opening(jnp.where(opens, hit.time, -jnp.inf), start, near))
        return aim, crosses, Bend(crosses & (bent.time < jnp.inf), bent.weights, bent.several)

    return jax.lax.cond(begin.differentiated, first, lambda: never)


def _watched(
    equations: Equations, now: Carried, found: Seen | Found, inner: PyTree, t: Array
) -> tuple[Sight, Carried, Array]:
    """What was seen at the end of a step at a time, what is carried on from there, and how much friction jumps where it
    may have several solutions."""
    sight: Sight = found.watch
    mode, along, jump, watch, solved = now.mode, now.along, jnp.zeros_like(sight.off), sight.watch, found.solved
    loads = now.loads
    if solved is not None:
        change = jnp.where(equations.sticking, 0.0, jnp.abs(solved.tau - mode.tau) / solved.size)
        jump = jnp.where(solved.contraction < 1, 0.0, jnp.max(change))
        watch = watch._replace(
            contraction=jnp.maximum(watch.contraction, solved.contraction), jump=jnp.maximum(watch.jump, jump)
        )
        mode = mode._replace(tau=solved.tau)
        loads = t, solved.multipliers if equations.loaded else loads[1]
    if along is not None and isinstance(found, Seen):
        along = equations.turned(found.rate, along, jnp.zeros((), bool))
    held, pivot = replace_fields(now.held, **sight.held.rank), sight.pivot
    parts = {"inner": inner, "mode": mode, "held": held, "along": along, "loads": loads, "watch": watch}
    return sight, now._replace(**parts, pivot=pivot, largest=jnp.maximum(now.largest, pivot)), jump


def _landed(
    equations: Equations, at: tuple[Array, Moving, Array], now: Carried, after: Carried, step: Step, found: Seen
) -> tuple[Moving, Carried, Verdict]:
    """The end of a step that may be an event, and what is told of it; `at` are its time and state, and when the motion
    ends."""
    (t, y, last), context, plan = at, now.context, now.plan
    fixed, there = stop_gradient((equations, y))
    change = fixed.change(there.at(step.end), there, found.rate, found.solved)
    change = jax.tree.map(lambda x: jnp.where(context.rests, 0.0, x), change)
    end, onward = landing(fixed, step, plan, found, change, stop_gradient(last))
    shift, y = landed(equations, t, y, context, step.trial, found.rate, end)

    new = partial(chosen_of, step.lands)
    mode = new(onward, chosen_of(context.rests, now.mode, after.mode))
    y = y._replace(qd=jnp.where(mode.resting, 0.0, y.qd))
    carried = after._replace(
        mode=mode,
        since=new(t + shift, now.since),
        along=None if after.along is None else new(onward.sense, after.along),
        plan=new(plan._replace(time=jnp.full_like(plan.time, jnp.inf)), plan),
        released=step.lands & end.starts,
        touches=step.lands & end.free,
        loads=(new(jnp.full_like(t, jnp.inf), after.loads[0]), after.loads[1]),
        watch=chosen_of(context.rests, now.watch, after.watch),
    )
    ends = ~mode.decided if equations.directions is None else step.lands
    lands, rests, ends = (flag.astype(t.dtype) for flag in (step.lands, mode.resting, ends))
    return y, carried, Verdict(t, None, lands, rests, ends, shift, t, t)


def _may_end(off: Array, excess: Array, before: Carried, end: Array) -> Bool[Array, ""]:
    """Whether a step may end here: on the manifold, with the rank that is held, and not beside a singular position.

    A step passes a singular position; it does not end where less than a tenth of the pivot that it began with is left,
    nor where rounding, magnified by the cube of 1 / pivot, would tell in accelerations, unless it begins there.
    """
    eps = float(jnp.finfo(off.dtype).eps)
    beside = max(_BESIDE[0], _BESIDE[1] * eps ** (1 / 3)) * before.largest
    clear = (end >= _LEFT * before.pivot) & (end >= beside)
    return (off <= tolerance_of(CLOSED, off)) & (excess <= _SAME * eps**0.5) & (clear | (before.pivot < beside))


def _error(error: Moving, y: Moving, raw: Moving, equations: Equations) -> Moving:
    """The error of a step, and by how much its end was moved."""
    if not equations.stabilisation.projects and equations.system.adds:
        return error
    return jax.tree.map(lambda e, a, b: jnp.abs(e) + jnp.abs(a - b), error, y, raw)


def _relative(error: Moving, dt: Array, equations: Equations, begin: Moving, before: Carried, after: Carried) -> Moving:
    """The error of a step free of units, of which the tolerance is taken: positions relative to the size of the
    mechanism, velocities to the largest that it had, internal states to their sizes.

    At the pivot p, rounding is magnified by 1 / p in positions, its square in velocities, and its cube in
    accelerations, whatever the length of a step; that much is not counted.
    """
    sizes, speed = equations.scaling, jnp.minimum(after.watch.speed, _FASTER * before.watch.speed)
    pivot = jnp.minimum(jnp.where(before.pivot > 0, before.pivot, after.pivot), after.pivot)
    blur = 10 * jnp.finfo(speed.dtype).eps / pivot
    shift = speed * jnp.abs(dt) / sizes.size / pivot

    def counted(value: Array, size: Array, rounding: Array) -> Array:
        return jnp.maximum(jnp.abs(value) / size - rounding, 0.0)

    system, off = equations.system, error.q
    if not system.adds:
        off = velocity(system, jax.lax.stop_gradient(begin.q), off)
    position = counted(off, sizes.size * sizes.coordinates, blur * (1 + shift**2))
    return Moving(
        position if system.adds else jnp.full_like(error.q, jnp.max(position)),
        jax.tree.map(jnp.zeros_like, error.base),
        counted(error.qd, speed * sizes.coordinates, blur / pivot * (1 + shift)),
        jnp.zeros_like(error.work),
        [
            jax.tree.map(lambda e, size: jnp.abs(e) / size, own, group.memory_size())
            for own, group in zip(error.memory, system.friction, strict=True)
        ],
    )


def _begun(equations: Equations, t: Scalar, y: Moving) -> Diagnostics:
    """The watch from a state on."""
    kinetic = equations.kinetic_energy(jnp.asarray(t), y)
    return at_start(kinetic)._replace(speed=equations.speed, kinetic=kinetic, start=kinetic - y.work)


def seen_between(
    equations: Equations, held: AnyHeld, begin: tuple[Array, Moving], end: tuple[Array, Moving]
) -> Diagnostics:
    """The watch over a stretch without steps, by its ends."""
    equations, held, begin, (t, y) = stop_gradient((equations, held, begin, end))
    factor = factorize_held(equations.system, y.at(t), held)
    return _diagnostics_after(_begun(equations, *begin), equations, t, y, factor)[0]


def _diagnostics_after(
    watch: Diagnostics, equations: Equations, t: Array, y: Moving, factor: AnyHeldFactorisation
) -> tuple[Diagnostics, Float[Array, ""]]:
    """The watch after a step, and the violation of the position by this step."""
    sizes = equations.scaling
    position = jnp.max(jnp.abs(sizes.violations(factor.motion.value)))
    kinetic = equations.kinetic_energy(t, y)
    watch = watch._replace(
        position=jnp.maximum(watch.position, position),
        velocity=jnp.maximum(watch.velocity, jnp.max(jnp.abs(factor.motion.rate) / sizes.rows)),
        speed=jnp.maximum(watch.speed, jnp.max(jnp.abs(y.qd) / sizes.coordinates)),
        kinetic=jnp.maximum(watch.kinetic, kinetic),
        energy=jnp.maximum(watch.energy, jnp.abs(kinetic - y.work - watch.start)),
        nearest=jnp.minimum(watch.nearest, jnp.min(factor.pivots)),
    )
    return watch, position
