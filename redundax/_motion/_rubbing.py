"""The equations of one set of rows that hold, where contacts settle: at an instant, or of an impact.

An impact is an instant of accelerations without bound: its impulses stand for forces, velocities after it for
accelerations, and the slip rates that they have for those of slip rates. So Coulomb's law for impulses

    lo(P) <= T <= hi(P),   w+ > 0 only at T = lo,   w+ < 0 only at T = hi

is that of joints that stick or start to slip (`_stick`), of whatever slip rates there were. Friction that loads do not
cause has no impulse.

Surfaces that slide in any direction do so against w+, which turns with all that the impact depends on,

    s = a w+ / |a w+|,   w+ = w(s, x),   dw+ = (1 - dw/ds ds/dw+)^-1 dw/dx dx
"""

from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._closures._closure import Elasticity
from .._equations._factorisation import Factorisation
from .._equations._kinematics import slip_gamma, slip_motion
from .._equations._response import LinearResponse, Response
from .._solvers._friction_problem import FrictionProblem, Law
from .._system._directions import Directions
from .._system._friction import load_rows
from .._system._results import RESULTS
from .._system._results import chosen as chosen_result
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import replace_fields
from .._tools._no_answer import without_derivative
from .._tools._numbers import as_numbers, as_program, or_one, stop_gradient, xp
from ._linear import BLOCKED, Linear
from ._moving import Equations
from ._stick import Mode, mode_of

# Seconds that an impact takes, in which friction that loads do not cause has no impulse.
_INSTANT = 1e-12


class Instant(NamedTuple):
    """What is asked of the rows that hold: whether it is an impact, of which M v- and Phi_q v+ are given, and the
    equations of motion."""

    is_impact: Bool[Array, ""]
    momentum: Float[Array, " n"]
    right: Float[Array, " m"]
    equations: Equations


class AtInstant(NamedTuple):
    """Accelerations and multipliers, or velocities after an impact and impulses; which joints stick, where any can;
    whether they are found; and the bound of the contraction of friction."""

    acceleration: Float[Array, " n"]
    multipliers: Float[Array, " m"]
    mode: Mode | None
    result: RESULTS
    contraction: Float[Array, ""]


def at_instant(
    fixed: Instant,
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    chosen: Elasticity,
    given: Instant | None = None,
) -> AtInstant:
    """The solution of the rows of the system, as `at_sides` asks for it; of what is given, with its derivatives, or
    else of the same `fixed`."""
    asked = fixed if given is None else given
    impact, has_sense = asked.is_impact, asked.equations.has_sense
    brief = xp.where(impact, _INSTANT, 1.0)
    load = xp.where(impact, asked.momentum / _INSTANT, factor.load)
    right = xp.where(impact, asked.right / _INSTANT, factor.gamma)
    pick, definiteness = factor.close(chosen.compliance)
    caused, rate, directions = pick.caused(chosen.misfit), state.qd[:0], xp.zeros_like(load, shape=(load.size, 0))
    if system.friction:
        rate, directions = slip_motion(system, state)
    wanted = xp.concatenate([right[:, None], xp.zeros_like(right, shape=(right.size, rate.size))], axis=1)
    a, lam = factor.respond(xp.concatenate([load[:, None], directions], axis=1), wanted)
    lam = pick(lam)
    free, mode, decided = Response(a[:, 0], lam[:, 0] + caused), None, definiteness.is_yes
    contraction = xp.zeros_like(rate, shape=())
    if system.friction:
        response = LinearResponse(free, Response(a[:, 1:], lam[:, 1:]))
        slip, bent = directions.T @ a, -slip_gamma(system, state) if has_sense else 0.0
        begins, parts = rate - directions.T @ state.qd, xp.abs(rate) + xp.abs(directions.T) @ xp.abs(state.qd)
        begins = xp.where(xp.abs(begins) > BLOCKED * float(xp.finfo(rate.dtype).eps) * parts, begins, 0.0)
        drift = xp.where(impact, begins / _INSTANT, bent)
        linear = Linear(response, load, directions, xp.where(impact, 0.0, rate), slip[:, 0] + drift, slip[:, 1:], drift)
        mass = xp.diagonal(factor.mass)[:, None]
        alone = xp.sum(xp.where(mass > 0, directions**2 / or_one(mass), 0.0), axis=0)
        linear = linear.without_rounding(alone, right, factor.scaling.rows)
        own = replace_fields(asked.equations, system=system, touch=None)
        *free, mode, decided, contraction = _rubbing(own, state, linear, impact)
    a, lam = (brief * x for x in free)
    finite = xp.all(xp.isfinite(a)) & xp.all(xp.isfinite(lam))
    good, none, bad = as_numbers((RESULTS.successful, RESULTS.no_solution_found, RESULTS.not_finite))
    return AtInstant(a, lam, mode, chosen_result(finite, chosen_result(decided, good, none), bad), contraction)


@as_program
def _rubbing(
    equations: Equations, state: State, linear: Linear, impact: Bool[Array, ""]
) -> tuple[Float[Array, " n"], Float[Array, " m"], Mode | None, Bool[Array, ""], Float[Array, ""]]:
    """The equations solved, with those joints sticking that do, which has no derivative; if that is decided, and the
    bound of the contraction of friction if all slip."""
    if not equations.has_sense:  # of which none has an impulse that is known
        solved, (a, lam) = equations.solved(state, linear, None), linear.response.free
        a, lam = jnp.where(impact, a, solved.acceleration), jnp.where(impact, lam, solved.multipliers)
        return a, lam, None, jnp.ones((), bool), jnp.where(impact, 0.0, solved.contraction)
    mode = mode_of(*stop_gradient((equations, state, linear)), jnp.ones((), bool))
    sense = mode.sense
    if equations.directions is not None:
        sense = _against_slips(equations, state, linear, mode, impact)
    solved = equations.with_sense(sense).solved(state, linear, mode.tau)
    mode = mode._replace(tau=solved.tau, resting=jnp.zeros_like(mode.resting))
    # Where rows that would pull jam, the loads of one sweep tell which, as in `solve`.
    jams = ~jnp.all(jnp.isfinite(solved.tau))
    law = Law.of(*stop_gradient((equations.system, linear.rate, mode.sense, state)))
    rows = load_rows(equations.system.friction)
    rho0, gain = stop_gradient((linear.response.free.multipliers[rows], linear.response.unit.multipliers[rows]))
    problem = FrictionProblem.make(rho0, gain, law, jnp.asarray(equations.system.rows.angular)[rows])
    swept = linear.response.at(law(linear.response.free.multipliers[rows]))
    a, lam = (jnp.where(jams, *each) for each in zip(swept, (solved.acceleration, solved.multipliers), strict=True))
    return a, lam, mode, mode.decided & ~jams, problem.contraction_anywhere()


@eqx.filter_custom_jvp
def _against_slips(
    equations: Equations, state: State, linear: Linear, mode: Mode, impact: Bool[Array, ""]
) -> Float[Array, " p"]:
    """The senses of joints, of which the directions of those that an impact leaves sliding turn with its slips."""
    return mode.sense


@_against_slips.def_jvp
def _against_slips_jvp(primals: tuple, tangents: tuple) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
    equations, state, linear, mode, impact = primals
    directions, given = cast(Directions, equations.directions), primals[:3]
    slides = impact & directions.directed & directions.any(mode.sense != 0)

    def slips(equations: Equations, state: State, linear: Linear) -> Float[Array, " p"]:
        return equations.with_sense(mode.sense).solved(state, linear, mode.tau).slip

    def senses(slips: Float[Array, " p"]) -> Float[Array, " p"]:
        return jnp.where(slides, directions.unit(directions.arms * slips), mode.sense)

    def again(slips: Float[Array, " p"]) -> Float[Array, " p"]:
        return equations.with_sense(senses(slips)).solved(state, linear, mode.tau).slip

    after, turned = eqx.filter_jvp(slips, given, tangents[:3])
    turns = jnp.linalg.solve(jnp.eye(after.size, dtype=after.dtype) - jax.jacfwd(again)(after), turned)
    return mode.sense, without_derivative(jnp.any(slides), jax.jvp(senses, (after,), (turns,))[1])
