"""The motion as an ordinary differential equation.

    y = (q, qd, A):   q' = qd,   qd' = qdd(q, qd, t) of (25),   A' = qd . (Q + E tau) + Phi_t . lam + qd . M' qd / 2

with the rank held (`_held_rank`), and the internal states of friction laws beside them. In a chart that does not add
q' is the derivative of q [+] s qd; a step leaves the chart by its error, and its end is put back to q_0 [+] d.

A is the work of loads, friction and drivers, so that T - A, with T the kinetic energy, is constant along the exact
motion of any system. Forces of constraints that do not move do no work.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from .._closures._closure import AbstractClosure, Elasticity, elasticity, without_rows
from .._closures._play import Play
from .._equations._factorisation import Factorisation, factorised
from .._equations._kinematics import chart_rate, displacement, prescribed_rate, slip_rate
from .._equations._response import LinearResponse, Response
from .._equations._scaling import Scaling
from .._solve._contacts import with_rows
from .._solve._play import at_own_sides, fitted, two_sided, with_play_of_contacts
from .._solvers._friction_problem import AbstractFrictionProblem, Law
from .._solvers._product_problem import friction_problem
from .._solvers._solver import AbstractSolver, closed_root
from .._system._directions import Directions
from .._system._friction import load_rows, memory_rates
from .._system._results import RESULTS
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import replace_fields
from .._tools._no_answer import nan_where
from .._tools._numbers import Numeric, are_numbers, as_numbers, or_one, stop_gradient, tolerance_of, xp
from .._tools._value import AbstractModule
from ._held_rank import AnyHeld, AnyHeldFactorisation, Held, factorize_held
from ._linear import AnyLinear, Asked, Linear
from ._stabilisation import AbstractStabilisation


class Moving(NamedTuple):
    """Position, velocity and work done so far.

    `base`, where coordinates do not add, is the position on the chart in which the last step ended. `memory` are the
    internal states of friction, group by group, `None` of those without one; a list, because Equinox takes an empty
    tuple for a leaf.
    """

    q: Float[Array, "..."]
    base: Float[Array, "..."] | None
    qd: Float[Array, " n"]
    work: Float[Array, ""]
    memory: list[PyTree]

    def at(self, t: Array) -> State:
        """The state at a time."""
        state = State(self.q, self.qd, t, tuple(self.memory))
        return as_numbers(state) if are_numbers(self, t) else state


# Slips at an event, relative to those of the mechanism, at least so many roundings.
STILL = 1e-6, 1e3
# Slips that count as none, relative to those of the mechanism, at least so many roundings.
NONE = 1e-9, 10


class Context(NamedTuple):
    """What stays the same within a step: the held rank, the friction forces that a solve starts from, whether all is at
    rest, and where joints have several slips with one friction the unit directions in which their surfaces slide as it
    begins, and the slip rates then of surfaces that stop in it, 0 of others."""

    held: AnyHeld
    tau: Float[Array, " p"]
    rests: Bool[Array, ""]
    along: Float[Array, " p"] | None = None
    stopping: Float[Array, " p"] | None = None


class Touch(NamedTuple):
    """What one-sided contacts do in a phase.

    - `kept`: the rows that hold: all but those of contacts that are open or touch alone; shape (m,).
    - `rests`: contacts that touch, held closed by others; shape (c,).
    - `rank`: that of the rows that hold.
    - `idle`: friction of contacts that do not hold, which has none until they do; shape (p,).
    - `overlap`: by how much those that do not hold overlap as steps begin, as contacts close together whose gaps differ
      by rounding; relative to the size of the mechanism, shape (c,).
    """

    kept: Bool[Array, " m"]
    rests: Bool[Array, " c"]
    rank: Int[Array, ""]
    idle: Bool[Array, " p"]
    overlap: Float[Array, " c"]


class Solved(NamedTuple):
    """Accelerations, multipliers, friction forces, rates of the slip rates and power at a state.

    `contraction` bounds that of friction at all loads, below 1 there is one solution; `size` is that of the friction.
    """

    acceleration: Float[Array, " n"]
    multipliers: Float[Array, " m"]
    tau: Float[Array, " p"]
    slip: Float[Array, " p"]
    power: Float[Array, ""]
    contraction: Float[Array, ""]
    size: Float[Array, " p"]

    def slip_by(self, tau: Float[Array, " p"], yields: Float[Array, "p p"]) -> Float[Array, " p"]:
        """Rates of the slip rates with other friction forces, given those by unit friction."""
        return self.slip + yields @ (tau - self.tau)


class Equations(AbstractModule):
    """The equations of motion of a system.

    - `sense`: sense of slip of every frictional joint, 0 of one that sticks, held until an event; shape (p,).
    - `scaling`: sizes of rows and coordinates and the length of the mechanism, for errors free of units.
    - `speed`: a velocity of the mechanism, length per time.
    - `slip_size`: the length by which slips are made lengths, 1 for those that are; shape (p,).
    - `directions`: which slips share one friction, `None` if none do; their sense is a unit direction together.
    - `sensed`: whose friction depends on the sense of slip, so that it can stick.
    - `touch`: what one-sided contacts do, `None` if there are none.
    """

    system: AbstractSystem
    closure: AbstractClosure
    solver: AbstractSolver
    stabilisation: AbstractStabilisation
    sense: Float[Array, " p"]
    scaling: Scaling
    speed: Float[Array, ""]
    slip_size: Float[Array, " p"]
    directions: Directions | None
    sensed: tuple[bool, ...] = eqx.field(static=True)
    touch: Touch | None = None

    @property
    def has_sense(self) -> bool:
        """Whether any friction depends on the sense of slip."""
        return any(self.sensed)

    @property
    def may_stick(self) -> Bool[Numeric, " p"]:
        """Whose friction depends on the sense of slip, if it has any."""
        sensed = np.asarray(self.sensed)
        return sensed if self.touch is None else sensed & ~self.touch.idle

    @property
    def directed(self) -> np.ndarray:
        """Which slips have a direction with others, shape (p,)."""
        return np.zeros(len(self.sensed), bool) if self.directions is None else self.directions.directed

    @property
    def sticking(self) -> Bool[Array, " p"]:
        """Which joints stick."""
        still = self.sense == 0
        return (still if self.directions is None else self.directions.every(still)) & self.may_stick

    def with_sense(self, sense: Float[Array, " p"]) -> "Equations":
        """The same equations with other senses."""
        return eqx.tree_at(lambda e: e.sense, self, sense)

    @property
    def touching(self) -> Touch:
        """What contacts do, where there are some."""
        return cast(Touch, self.touch)

    def with_touch(self, touch: Touch | None) -> "Equations":
        """The same equations with the rows of other contacts."""
        if touch is None:
            return self
        return replace_fields(self, system=self.system.opened(touch.kept), touch=touch)

    @property
    def play(self) -> Play | None:
        """That of the closure, of rows that push both ways."""
        return two_sided(self.closure.clearances(self.system), self.system.names.one_sided)

    def closing(self, state: State) -> Elasticity:
        """Compliance and misfit of the closure, in which contacts have their play."""
        chosen, clearances = (
            elasticity(self.closure, self.system, state, play=True),
            self.closure.clearances(self.system),
        )
        return with_play_of_contacts(chosen, clearances, self.system.names.one_sided)

    def elasticity(self, state: State) -> Elasticity:
        """The same of the rows that hold."""
        chosen = self.closing(state)
        return chosen if self.touch is None else without_rows(chosen, self.touch.kept)

    def derivative(self, t: Array, y: Moving, context: Context) -> Moving:
        """y', 0 at rest.

        The closure matters to it only through friction: a self-stress does no work.
        """
        slope = self.instant(t, y, context)[0]
        return jax.tree.map(lambda x: jnp.where(context.rests, 0.0, x), slope) if self.has_sense else slope

    def instant(
        self, t: Array, y: Moving, context: Context, felt: Float[Array, " p"] | None = None
    ) -> tuple[Moving, Float[Array, " p"], Float[Array, " p"]]:
        """y', the rates of the slip rates, and the slip rates; with friction by other slip rates, if given."""
        state = y.at(t)
        linear = self.linear(state, context.held, closed=self.loaded)
        own = linear if felt is None else linear._replace(rate=felt)
        if context.stopping is not None:
            own = own._replace(rate=self._stopping(own.rate, context.stopping))
        solved = self.solved(state, own, context.tau, context.along, felt is not None)
        return self.change(state, y, linear.rate, solved), solved.slip, linear.rate

    def _stopping(self, rate: Float[Array, " p"], begin: Float[Array, " p"]) -> Float[Array, " p"]:
        """Slip rates for friction, of which directions, where surfaces stop, change as at the begin of the step: what
        they change by from there on ends with the stop, but explicit steps would multiply it."""
        directions, (fixed, before) = cast(Directions, self.directions), stop_gradient((rate, begin))
        ahead, first = (directions.along(x, directions.unit(directions.arms * before)) for x in (fixed, before))
        return jnp.where(first > 0, fixed + ahead / or_one(first) * (begin - before), rate)

    def change(self, state: State, y: Moving, rate: Float[Array, " p"], solved: Solved) -> Moving:
        """y', of the equations solved."""
        base = jax.tree.map(jnp.zeros_like, y.base)
        memory = list(memory_rates(self.system.friction, rate, state))
        return Moving(chart_rate(self.system, state), base, solved.acceleration, solved.power, memory)

    @property
    def loaded(self) -> bool:
        """Whether any friction depends on loads."""
        return any(group.rows.size for group in self.system.friction)

    @property
    def bends(self) -> bool:
        """Whether friction or applied loads may bend."""
        return self.loaded or self.system.may_bend or self._rubs_bend

    @property
    def _rubs_bend(self) -> bool:
        return any(group.may_bend for group in self.system.friction)

    def bending(self, solved: "Solved | None", along: Float[Array, " p"] | None) -> list[Callable[[State], Array]]:
        """What may bend at given loads, as functions of the state: applied loads, free of units, and friction, given
        the equations solved at one and the directions in which surfaces slide."""
        found: list[Callable[[State], Array]] = []
        if self.system.may_bend:
            found.append(lambda state: self.scaling.coordinates * self.system.load(state))
        if self._rubs_bend:
            found.append(partial(self._rubbing, cast(Solved, solved).multipliers, along))
        return found

    def _rubbing(self, multipliers: Array, along: Float[Array, " p"] | None, state: State) -> Float[Array, "..."]:
        """Friction forces of slips that move, under given loads, and the rates of internal states relative to their
        sizes. Of surfaces that turn as they slide these alone: their friction turns fast before a stop."""
        groups, rate = self.system.friction, slip_rate(self.system, state)
        rate, sense = jnp.where(self.is_none(rate), 0.0, rate), self.sense
        sense = sense if along is None else jnp.where(self.directed, along, sense)
        tau = Law.of(self.system, rate, sense, state).force(multipliers[load_rows(groups)]) / self.slip_size
        may = np.array([group.may_bend for group in groups for _ in group.slips.kinds])
        rates, sizes = memory_rates(groups, rate, state), [group.memory_size() for group in groups]
        memory = jax.tree.map(lambda x, size: (x / size).ravel(), list(rates), sizes)
        return jnp.concatenate([jnp.where(may & ~self.directed & ~self.sticking, tau, 0.0), *jax.tree.leaves(memory)])

    def linear(
        self, state: State, held: AnyHeld, factor: AnyHeldFactorisation | None = None, *, closed: bool = True
    ) -> AnyLinear:
        """What load and unit friction cause, given the factorisation at the state if it is known.

        `closed` says whether the multipliers are the closure's, or some. Those of joints with play are linear at the
        sides at which these stand.
        """
        factor = factorize_held(self.system, state, held) if factor is None else factor
        return self.fitted(state, held, factor)[0] if closed else self._linear(state, factor, closed=False)

    def fitted(
        self, state: State, held: AnyHeld, factor: AnyHeldFactorisation
    ) -> tuple[AnyLinear, Callable[[Float[Array, " m"]], Elasticity]]:
        """`linear`, and the closure of all rows, open ones too, that multipliers have at the sides of play."""
        if self.play is None:
            return self._linear(state, factor, closed=True), lambda _: self.closing(state)
        linear, gamma = self._linear(state, factor, closed=False), self.stabilisation.gamma(factor.motion)
        fixed = stop_gradient((self, linear, gamma))
        rank = gamma.size - jnp.round(jnp.trace(cast(Held, held).projector)).astype(int)

        def solved(_: AbstractSystem, state: State, factor: Factorisation, chosen: Elasticity) -> _Loads:
            equations, linear, gamma = fixed
            loads = equations.solved(state, _closed(linear, gamma, factor, chosen), None).multipliers
            finite = jnp.all(jnp.isfinite(loads))
            return _Loads(loads, RESULTS.where(finite, RESULTS.successful, RESULTS.not_finite))

        whole = factorised(self.system, state, rank)
        given = self.system, state, whole, self.elasticity(state)
        without, chosen, settled, at = at_own_sides(self.play, solved, given)
        linear = _closed(linear, gamma, without, chosen._replace(misfit=nan_where(~settled, chosen.misfit)))

        def fits(multipliers: Float[Array, " m"]) -> Elasticity:
            own, every = fitted(chosen, *at, multipliers), self.closing(state)
            return own if self.touch is None else with_rows(own, self.touch.kept, every)

        return linear, fits

    @eqx.filter_jit  # traced once, for the places that it stands in
    def _linear(self, state: State, factor: AnyHeldFactorisation, *, closed: bool) -> AnyLinear:
        gamma, chosen = self.stabilisation.gamma(factor.motion), partial(self.elasticity, state) if closed else None
        return factor.linear(Asked(self.system, state, gamma, chosen, self.slip_size, self.has_sense))

    @eqx.filter_jit
    def solved(
        self,
        state: State,
        linear: AnyLinear,
        start: Float[Array, " p"] | None,
        along: Float[Array, " p"] | None = None,
        exact: bool = False,
    ) -> Solved:
        """Accelerations, multipliers and friction, from friction forces that the solver starts at, if known.

        Surfaces that slide against the directions `along` have friction as if they still slid the other way. Where slip
        rates are `exact`, none is rounding, however slow.
        """
        tau, problem = linear.rate, None
        if self.system.friction:
            rate, sense = linear.rate, self.sense
            if self.directions is not None:
                sense = sense if along is None else jnp.where(self.directions.directed, along, sense)
                rate = rate if exact else jnp.where(self.directions.directed & self.is_none(rate), 0.0, rate)
                rate = rate if along is None else self.directions.past(rate, along)
            tau, problem = self._friction(Law.of(self.system, rate, sense, state), linear, start)
        acceleration, multipliers = linear.response.at(tau)
        power = self._power(state, linear.load + linear.directions @ tau, multipliers)
        caused = linear.slips_caused(tau, acceleration)
        contraction, size = jnp.zeros_like(state.t), jnp.ones_like(linear.rate)
        if problem is not None:
            rho, size = multipliers[load_rows(self.system.friction)], problem.friction_size
            contraction = problem.contraction_on_way(rho)
        return Solved(acceleration, multipliers, tau, linear.slip + caused, power, contraction, size)

    def _friction(
        self, law: Law, linear: AnyLinear, start: Array | None
    ) -> tuple[Float[Array, " p"], AbstractFrictionProblem | None]:
        """Friction forces, those that hold the joints that stick and those of the law, NaN where none are found; and
        the equations of the latter."""
        system, stick = self.system, self.sticking
        holding, passed = jnp.zeros_like(linear.rate), None
        if self.has_sense:
            pull = linear.slip + self.speed / self.scaling.size * linear.rate  # what is left of slip rates dies away
            holding, passed = linear.hold(stick, pull, self.slip_size)
        rows = load_rows(system.friction)
        if rows.size == 0:
            tau, problem = law(law.rate[:0]), None
        else:
            rho0, gain = linear.response.free.multipliers[rows], linear.response.unit.gain(rows)
            if passed is not None:
                rho0, gain = linear.held_loads(rho0, gain, stick, holding), gain @ passed
            begin = law(rho0) if start is None else start
            problem = friction_problem(rho0, gain, law, jnp.asarray(system.rows.angular)[rows]).sized_at(begin)
            root = closed_root(problem, begin, self.solver)
            tau = nan_where(self.solver.result(root.progress) != RESULTS.successful, root.tau)
        return tau if passed is None else holding + passed @ tau, problem

    def whole(self, flags: Bool[Array, " p"]) -> Bool[Array, " p"]:
        """For each slip whether it is so for all that share its friction."""
        return flags if self.directions is None else self.directions.every(flags)

    def still(self, rate: Float[Array, " p"]) -> Bool[Array, " p"]:
        """Which joints slip by so little that they may stick."""
        slows = xp.abs(rate) <= tolerance_of(STILL, rate) * self.speed / self.slip_size
        return (self.whole(slows) | self.sticking) & self.may_stick

    def is_none(self, rate: Float[Array, " p"]) -> Bool[Array, " p"]:
        """Which joints slip by no more than rounding."""
        return self.whole(xp.abs(rate) * self.slip_size <= tolerance_of(NONE, rate) * self.speed)

    def sets_out(self, slow: Bool[Array, " p"], sense: Float[Array, " p"]) -> Bool[Array, " p"]:
        """Which slips of joints with several begin from rest, of those that are slow, in the senses of what follows."""
        slides = sense != 0 if self.directions is None else self.directions.any(sense != 0)
        return slow & slides & self.directed & self.may_stick

    def sense_of(
        self, rate: Float[Array, " p"], acceleration: Float[Array, " p"]
    ) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
        """Senses of joints that begin to slip, and of those that do."""
        if self.directions is None:
            return xp.sign(acceleration), xp.sign(rate)
        surface = self.directions.arms * xp.where(self.directions.directed & ~self.is_none(rate), rate, acceleration)
        return self.directions.unit(surface), self.directions.unit(self.directions.arms * rate)

    def turned(self, rate: Float[Array, " p"], along: Float[Array, " p"], event: Bool[Array, ""]) -> Float[Array, " p"]:
        """The directions in which surfaces slide as the next step begins; those of the last where it is an event."""
        return jnp.where(event | self.is_none(rate) | self.sticking, along, self.sense_of(rate, rate)[1])

    def _power(self, state: State, force: Array, multipliers: Array) -> Float[Array, ""]:
        one, system = jnp.ones_like(state.t), self.system
        power = state.qd @ force + prescribed_rate(system, state.q, state.t) @ multipliers
        if system.constant_mass:
            return power
        _, mass_rate = jax.jvp(system.mass, (state.q, state.t), (chart_rate(system, state), one))
        return power + state.qd @ mass_rate @ state.qd / 2

    def kinetic_energy(self, t: Array, y: Moving) -> Float[Array, ""]:
        """T."""
        return self.system.kinetic_energy(y.q, y.qd, t)


class _Loads(NamedTuple):
    multipliers: Float[Array, " m"]
    result: RESULTS


def _closed(linear: AnyLinear, gamma: Float[Array, " m"], factor: Factorisation, chosen: Elasticity) -> AnyLinear:
    """The same with multipliers of a closure, which a factorisation at the state has."""
    linear = cast(Linear, linear)
    free, unit = linear.response.free, linear.response.unit
    forces = jnp.concatenate([linear.load[:, None], linear.directions], axis=1)
    lam = factor.respond(forces, jnp.pad(gamma[:, None], ((0, 0), (0, linear.rate.size)))).multipliers
    lam = factor.close(chosen.compliance)[0].columns(lam, chosen.misfit)
    parts = Response(free.acceleration, lam[:, 0]), Response(unit.acceleration, lam[:, 1:])
    return linear._replace(response=LinearResponse(*parts))


def rechart(system: AbstractSystem, y: Moving) -> tuple[Moving, Bool[Array, ""]]:
    """y with its position put back on the chart, and whether that settled."""
    if y.base is None:
        return y, jnp.asarray(True)
    d, change = displacement(system, y.base, y.q)
    q = system.retract(y.base, d)
    return y._replace(q=q, base=q), change <= float(jnp.finfo(change.dtype).eps) ** 0.375
