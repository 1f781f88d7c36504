"""The motion as an ordinary differential equation.

    y = (q, qd, A):   q' = qd,   qd' = qdd(q, qd, t) of (25),   A' = qd . (Q + E tau) + Phi_t . lam + qd . M' qd / 2

with the rank held (`_held_rank`). A is the work of loads, friction and drivers, so that T - A, with T the kinetic
energy, is constant along the exact motion of any system. Forces of constraints that do not move do no work.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._closure import AbstractClosure
from ._friction import load_rows, slip_kinds
from ._friction_problem import FrictionProblem, Law
from ._held_rank import Held, Kinetics, held_inverse, kinetics, respond, stress_response
from ._kinematics import slip_motion
from ._scaling import Scaling
from ._solver import AbstractSolver, closed_root
from ._stabilisation import AbstractStabilisation
from ._state import State
from ._system import AbstractSystem


class Moving(NamedTuple):
    """Position, velocity and work done so far."""

    q: Float[Array, " n"]
    qd: Float[Array, " n"]
    work: Float[Array, ""]


class Context(NamedTuple):
    """What stays the same within a step: the held rank, and the friction forces that a solve starts from, if known."""

    held: Held
    tau: Float[Array, " p"] | None


class Solved(NamedTuple):
    """Accelerations, multipliers, friction forces and power at a state."""

    acceleration: Float[Array, " n"]
    multipliers: Float[Array, " m"]
    tau: Float[Array, " p"]
    power: Float[Array, ""]


class Equations(eqx.Module):
    """The equations of motion of a system.

    - `sense`: sense of slip of every frictional joint, held until an event changes it; shape (p,).
    - `scaling`: sizes of rows and coordinates and the length of the mechanism, for errors free of units.
    - `speed`: a velocity of the mechanism, length per time.
    """

    system: AbstractSystem
    closure: AbstractClosure
    solver: AbstractSolver
    stabilisation: AbstractStabilisation
    sense: Float[Array, " p"]
    scaling: Scaling
    speed: Float[Array, ""]

    def derivative(self, t: Array, y: Moving, context: Context) -> Moving:
        """y'."""
        solved = self.solved(State(y.q, y.qd, t), context)
        return Moving(y.qd, solved.acceleration, solved.power)

    def solved(self, state: State, context: Context) -> Solved:
        """Accelerations, multipliers and friction at a state."""
        system, held = self.system, context.held
        scale = held.row_scale
        parts = kinetics(system, state, held)
        force = system.load(state)
        gamma = self.stabilisation.gamma(parts.motion) / scale
        a, mu = (x[:, 0] for x in respond(parts, held, force[:, None], gamma[:, None]))
        pick = _pick(parts, held, *self.closure.compliance(system, state))
        if not system.friction:
            return Solved(a, pick(mu, 1.0) / scale, force[:0], self._power(state, force, mu / scale))
        rate, directions = slip_motion(system, state)
        unit, unit_mu = respond(parts, held, directions, jnp.zeros((gamma.size, rate.size), gamma.dtype))
        mu, unit_mu = pick(mu, 1.0), pick(unit_mu, 0.0)
        rows = load_rows(system.friction)
        angular_loads = jnp.asarray(system.rows.angular)[rows]
        angular_slips = jnp.asarray(slip_kinds(system.friction).angular)
        loads = (mu / scale)[rows], (unit_mu / scale[:, None])[rows]
        law = Law(system.friction, rate, self.sense, state)
        problem = FrictionProblem.make(*loads, law, angular_loads, angular_slips)
        tau = law(problem.rho0)
        if rows.size:
            tau = closed_root(problem, tau if context.tau is None else context.tau, self.solver).tau
        a, mu, force = a + unit @ tau, mu + unit_mu @ tau, force + directions @ tau
        return Solved(a, mu / scale, tau, self._power(state, force, mu / scale))

    def _power(self, state: State, force: Array, multipliers: Array) -> Float[Array, ""]:
        one, system = jnp.ones_like(state.t), self.system
        _, driven = jax.jvp(lambda t: system.constraint(state.q, t), (state.t,), (one,))
        _, mass_rate = jax.jvp(system.mass, (state.q, state.t), (state.qd, one))
        return state.qd @ force + driven @ multipliers + state.qd @ mass_rate @ state.qd / 2

    def kinetic_energy(self, t: Array, y: Moving) -> Float[Array, ""]:
        """T."""
        return y.qd @ self.system.mass(y.q, t) @ y.qd / 2


def _pick(parts: Kinetics, held: Held, compliance: Array, misfit: Array) -> Callable[[Array, float], Array]:
    """The closure: from any scaled multipliers, with a share of the misfit, to those that it picks."""
    scale = held.row_scale
    compliance = compliance / scale[:, None] / scale
    response, _ = stress_response(parts, held, compliance)
    constant = response @ (misfit / scale)

    def picked(mu: Array, share: float) -> Array:
        return mu + share * constant - response @ (compliance @ mu)

    return picked


def projected(system: AbstractSystem, t: Array, y: Moving, held: Held) -> tuple[Moving, Kinetics]:
    """y moved onto the manifold, positions then velocities, by least change in the norm of M, and its matrices."""
    q = _closed(system, held, y.q, t)
    parts = kinetics(system, State(q, y.qd, t), held)
    qd, rate = y.qd, parts.motion.rate / held.row_scale
    for _ in range(2):  # the second pass is refinement
        qd = qd - parts.response @ held_inverse(parts, held, rate + parts.rows @ (qd - y.qd))
    moved = system.load(State((q + y.q) / 2, y.qd, t)) @ (q - y.q)
    return Moving(q, qd, y.work + moved), parts


# Chord iterations of the position: a step leaves it off by e, each turns e^k into e^(k+1).
_CHORDS = 4


@eqx.filter_custom_jvp
def _closed(system: AbstractSystem, held: Held, q: Float[Array, " n"], t: Array) -> Float[Array, " n"]:
    """The position nearest to q that meets the held rows; its derivative is dq - B^+ (B dq + dPhi)."""
    parts = kinetics(system, State(q, jnp.zeros_like(q), t), held)

    def chord(_: Array, x: Array) -> Array:
        return x - parts.response @ held_inverse(parts, held, system.constraint(x, t) / held.row_scale)

    return jax.lax.fori_loop(0, _CHORDS, chord, q)


@_closed.def_jvp
def _closed_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    system, held, _, t = primals
    system_dot, _, q_dot, t_dot = tangents
    q = _closed(*primals)
    parts = kinetics(system, State(q, jnp.zeros_like(q), t), held)
    _, explicit = eqx.filter_jvp(lambda system, t: system.constraint(q, t), (system, t), (system_dot, t_dot))
    q_dot = jnp.zeros_like(q) if q_dot is None else q_dot
    off = parts.rows @ q_dot + (0.0 if explicit is None else explicit / held.row_scale)
    return q, q_dot - parts.response @ held_inverse(parts, held, off)
