"""How a driven system moves at known positions, and which loads carry that

    Phi_q qd = -Phi_t,   Phi_q qdd = gamma,   Phi_q^T lam = Q - M qdd + E tau,   tau = law(rho)

Drives leave no freedom, so rates and accelerations follow from the constraints alone, and loads from the balance of
forces: inverse dynamics. The self-stress, within which drives that are more than the freedoms fight each other, is the
closure's. What a load depends on is told by structure: of the self-stress directly, or through friction that reads a
load which does.
"""

from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._closures._closure import AbstractClosure, elasticity
from .._equations._kinematics import along_motion, constraint_motion, slip_motion
from .._equations._scaling import Scaling
from .._solvers._friction_problem import FrictionProblem, Law
from .._solvers._iterate import Progress
from .._solvers._solver import AbstractSolver, closed_root
from .._system._friction import load_rows
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._numbers import custom_jvp, or_one, tolerance_of
from ._linear import Held

# Of an orthonormal self-stress, or relative to the largest coefficient, at least so many roundings.
_NOTHING = 1e-9, 1e3


class Moving(NamedTuple):
    """Velocity and acceleration; rates of all rows as drives prescribe them; slip rates, now, just before and just
    after; the least singular value over the size of K; how far accelerations contradict each other."""

    q: Float[Array, "..."]
    qd: Float[Array, " n"]
    acceleration: Float[Array, " n"]
    prescribed: Float[Array, " m"]
    slips: Float[Array, "3 p"]
    weakest: Float[Array, ""]
    contradiction: Float[Array, ""]


class Loads(NamedTuple):
    """Multipliers and friction, which of them depend on the self-stress without friction and with it, and whether the
    closure decides and friction has a solution."""

    multipliers: Float[Array, " m"]
    friction: Float[Array, " p"]
    direct: Bool[Array, " m"]
    depends: Bool[Array, " m"]
    decided: Bool[Array, ""]
    progress: Progress | None


@partial(custom_jvp, make=eqx.filter_custom_jvp)
def on_constraints(q: Array, system: AbstractSystem, scale: Scaling, t: Array) -> Array:
    """A position that meets the constraints; its derivative is the least displacement that keeps it so."""
    return q


@on_constraints.def_jvp
def _on_constraints_jvp(primals: tuple, tangents: tuple) -> tuple:
    q, system, scale, t = primals
    q = on_constraints(q, system, scale, t)
    by = tangents[1], tangents[3]
    _, change = eqx.filter_jvp(lambda system, t: system.constraint(q, t), (system, t), by)
    if change is None:
        return q, jnp.zeros_like(q)
    held = Held.of(scale.scaled(system.jacobian(q, t)))
    d = -scale.coordinates * held.least_squares(change / scale.rows)
    zero, one = jnp.zeros((), q.dtype), jnp.ones((), q.dtype)
    return q, jax.jvp(lambda s: system.retract(q, s * d), (zero,), (one,))[1]


def moving(
    system: AbstractSystem,
    scale: Scaling,
    q: Array,
    t: Array,
    beside: Float[Array, "2"],
    going: Float[Array, ""] | None = None,
) -> tuple[Moving, Held]:
    """How it moves at a position, and the equations there. `beside` are times before and after, at which laws are asked
    for senses of slip; where `going` is 0 it stands still."""
    q = on_constraints(q, system, scale, t)
    held, zero = Held.of(scale.scaled(system.jacobian(q, t))), jnp.zeros(len(system.coordinates), q.dtype)
    going = jnp.ones((), q.dtype) if going is None else going

    def rates(t: Array) -> tuple[Array, Array]:
        prescribed = -going * constraint_motion(system, State(q, zero, t))[1]
        return scale.coordinates * held.least_squares(prescribed / scale.rows), prescribed

    qds, prescribed = jax.vmap(rates)(jnp.concatenate([t[None], beside]))
    gamma = going * along_motion(system, State(q, qds[0], t)).gamma / scale.rows
    a = held.least_squares(gamma)
    size = jnp.max(jnp.abs(gamma)) + jnp.max(jnp.abs(qds[0] / scale.coordinates)) ** 2 / scale.size
    off = jnp.max(jnp.abs(gamma - held.matrix @ a)) / or_one(size)
    if system.friction:
        slips = jax.vmap(lambda qd: slip_motion(system, State(q, qd, t))[0])(qds)
    else:
        slips = jnp.zeros((3, 0), q.dtype)
    return Moving(q, qds[0], scale.coordinates * a, prescribed[0], slips, held.weakest, off), held


def loads(
    system: AbstractSystem,
    scale: Scaling,
    choices: tuple[AbstractClosure, AbstractSolver],
    at: Moving,
    held: Held,
    t: Array,
    senses: Float[Array, "s p"],
    rests: Bool[Array, " p"],
) -> Loads:
    """Loads of a motion, for each of some senses of slip where joints rest; batched by these."""
    (closure, solver), state = choices, State(at.q, at.qd, t)
    W, d = elasticity(closure, system, state, play=True)  # `drive` asks times with play again, one by one
    softness = held.softness(W / scale.rows[:, None] / scale.rows)
    misfit = jnp.broadcast_to(jnp.asarray(d, W.dtype), scale.rows.shape) / scale.rows
    need = scale.coordinates * (system.load(state) - system.mass(state.q, t) @ at.acceleration)
    given = held.carried(softness, misfit, need)[0] / scale.rows
    # Rows of contacts that are open are self-stress by themselves, and bear nothing.
    stress = held.stress if system.kept is None else held.stress * system.kept[:, None]
    direct = jnp.linalg.norm(stress, axis=1) > tolerance_of(_NOTHING, stress)
    if not system.friction:
        both = (jnp.broadcast_to(given, (len(senses), given.size)), jnp.zeros((len(senses), 0), given.dtype))
        return Loads(*both, direct, direct, softness.decides, None)
    rate, directions = slip_motion(system, state)
    rate = jnp.where(rests, 0.0, rate)  # rounding has a direction, rest has none
    pulls = scale.coordinates[:, None] * directions
    none = jnp.zeros_like(misfit)
    by_friction = jax.vmap(lambda pull: held.carried(softness, none, pull)[0], in_axes=1, out_axes=1)(pulls)
    by_friction = by_friction / scale.rows[:, None]
    rows = load_rows(system.friction)
    angular = jnp.asarray(system.rows.angular)[rows]

    def solved(sense: Array) -> tuple[Array, Array, Progress]:
        law = Law(system.friction, rate, sense, state)
        problem = FrictionProblem.make(given[rows], by_friction[rows], law, angular)
        root = closed_root(problem, law(problem.rho0), solver)
        return given + by_friction @ root.tau, root.tau, root.progress

    if rows.size:
        multipliers, friction, progress = jax.vmap(solved)(senses)
    else:
        friction = jax.vmap(lambda sense: Law(system.friction, rate, sense, state)(given[rows]))(senses)
        multipliers, progress = given + friction @ by_friction.T, None
    law = Law(system.friction, rate, jnp.ones_like(rate), state)
    least = held.across(jax.lax.stop_gradient(pulls))
    depends = direct | _through_friction(jax.lax.stop_gradient(law), stress, least, scale.rows, rows)
    return Loads(multipliers, friction, direct, depends, softness.decides, progress)


def _through_friction(law: Law, stress: Array, scaled: Array, row_scale: Array, rows: Array) -> Bool[Array, " m"]:
    """Which loads friction moves that reads, or depends on friction that reads, a load within the self-stress; given
    that and the least loads by unit friction, both scaled."""
    p, nothing = scaled.shape[1], tolerance_of(_NOTHING, stress)
    if not stress.shape[1] or not p or not rows.size:
        return jnp.zeros(stress.shape[0], bool)
    reads = law.largest_changes(jnp.eye(rows.size, dtype=stress.dtype)) > 0
    free = jnp.linalg.norm(stress[rows], axis=1) > nothing
    touched = (reads & free).any(axis=1)
    change = law.largest_changes((scaled / row_scale[:, None])[rows])
    moves = change > nothing * jnp.max(change, initial=0.0)
    for _ in range(p - 1):
        touched = touched | (moves & touched).any(axis=1)
    moved = jnp.abs(scaled) > nothing * jnp.linalg.norm(scaled, axis=0)
    return (moved & touched).any(axis=1)
