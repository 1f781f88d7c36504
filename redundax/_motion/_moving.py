"""The motion as an ordinary differential equation.

    y = (q, qd, A):   q' = qd,   qd' = qdd(q, qd, t) of (25),   A' = qd . (Q + E tau) + Phi_t . lam + qd . M' qd / 2

with the rank held (`_held_rank`). A is the work of loads, friction and drivers, so that T - A, with T the kinetic
energy, is constant along the exact motion of any system. Forces of constraints that do not move do no work.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._closures._closure import AbstractClosure
from .._friction import load_rows
from .._friction_problem import FrictionProblem, Law
from .._kinematics import slip_motion
from .._results import RESULTS
from .._scaling import Scaling
from .._solver import AbstractSolver, closed_root
from .._state import State
from .._system import AbstractSystem
from ._held_rank import Held, Kinetics, held_inverse, kinetics, respond, stress_response
from ._stabilisation import AbstractStabilisation


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
    - `slip_size`: the length by which slips are made lengths, 1 for those that are; shape (p,).
    - `has_sense`: whether any friction depends on the sense of slip.
    """

    system: AbstractSystem
    closure: AbstractClosure
    solver: AbstractSolver
    stabilisation: AbstractStabilisation
    sense: Float[Array, " p"]
    scaling: Scaling
    speed: Float[Array, ""]
    slip_size: Float[Array, " p"]
    has_sense: bool = eqx.field(static=True)

    def derivative(self, t: Array, y: Moving, context: Context) -> Moving:
        """y'.

        The closure matters to it only through friction: a self-stress does no work.
        """
        closed = any(group.rows.size for group in self.system.friction)
        solved = self.solved(State(y.q, y.qd, t), context, closed=closed)
        return Moving(y.qd, solved.acceleration, solved.power)

    @eqx.filter_jit  # traced once, for the many places that it stands in
    def solved(self, state: State, context: Context, *, closed: bool = True) -> Solved:
        """Accelerations, multipliers and friction at a state.

        `closed` says whether the multipliers are those that the closure picks, or some.
        """
        system, scale = self.system, context.held.row_scale
        parts = kinetics(system, state, context.held)
        force, rate, directions = system.load(state), state.qd[:0], jnp.zeros((state.qd.size, 0), state.qd.dtype)
        if system.friction:
            rate, directions = slip_motion(system, state)
        gamma = self.stabilisation.gamma(parts.motion) / scale
        columns = jnp.concatenate([force[:, None], directions], axis=1)
        a, mu = respond(parts, context.held, columns, jnp.pad(gamma[:, None], ((0, 0), (0, rate.size))))
        if closed:
            mu = _picked(parts, context.held, *self.closure.compliance(system, state), mu)
        mu = mu / scale[:, None]
        tau = force[:0]
        if system.friction:
            tau = self._friction(Law(system.friction, rate, self.sense, state), mu, context.tau)
        strengths = jnp.concatenate([jnp.ones_like(force[:1]), tau])
        multipliers = mu @ strengths
        return Solved(a @ strengths, multipliers, tau, self._power(state, columns @ strengths, multipliers))

    def _friction(self, law: Law, multipliers: Float[Array, "m columns"], start: Array | None) -> Float[Array, " p"]:
        """Friction forces from the multipliers to load and to unit friction; NaN where none are found."""
        rows = load_rows(self.system.friction)
        if rows.size == 0:
            return law(law.rate[:0])
        angular_loads = jnp.asarray(self.system.rows.angular)[rows]
        loads = multipliers[rows]
        problem = FrictionProblem.make(loads[:, 0], loads[:, 1:], law, angular_loads)
        root = closed_root(problem, law(problem.rho0) if start is None else start, self.solver)
        return jnp.where(self.solver.result(root.progress) == RESULTS.successful, root.tau, jnp.nan)

    def _power(self, state: State, force: Array, multipliers: Array) -> Float[Array, ""]:
        one, system = jnp.ones_like(state.t), self.system
        _, driven = jax.jvp(lambda t: system.constraint(state.q, t), (state.t,), (one,))
        _, mass_rate = jax.jvp(system.mass, (state.q, state.t), (state.qd, one))
        return state.qd @ force + driven @ multipliers + state.qd @ mass_rate @ state.qd / 2

    def kinetic_energy(self, t: Array, y: Moving) -> Float[Array, ""]:
        """T."""
        return y.qd @ self.system.mass(y.q, t) @ y.qd / 2


def _picked(parts: Kinetics, held: Held, compliance: Array, misfit: Array, mu: Array) -> Float[Array, "m columns"]:
    """The scaled multipliers that the closure picks, to load and misfit, and to unit friction."""
    scale = held.row_scale
    compliance = compliance / scale[:, None] / scale
    response, _ = stress_response(parts, held, compliance)
    return mu + response @ ((compliance @ -mu).at[:, 0].add(misfit / scale))


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
