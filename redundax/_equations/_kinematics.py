"""Derivatives of the constraints along the motion, by forward mode alone.

    Phi(s) = Phi(q [+] s qd, t + s):   Phi_q qd + Phi_t = Phi'(0),   gamma = -Phi''(0)      (3), (4), (5)

so that Phi_q qdd = gamma, where the second derivative is that along the field q' = d/dr (q [+] r qd) at r = 0, which
a retraction need meet to first order only; two nested directional derivatives, no second-derivative tensor. A friction
slip s(q, t) gives in the same way its rate and its direction E = (ds/dq)^T.

Rows of velocity have no Phi. Their first derivative along a rate v of the position, with t' = u, is A v - b u, and the
second that of this along the same rate: of (qd, 1) they are A qd - b and A' qd - b'. A self-stress N that lasts has
N^T A' z = 0 for all motions z, as that of Phi_q has; but A' is not symmetric in its two directions, so that no
polarisation gives it.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._numbers import Numeric, of_model, or_one

_GAUSS_NEWTON = 6  # steps, whose error is squared each time from a turn of a radian on


class AlongMotion(NamedTuple):
    """Constraint residual (m,), its rate (m,) and gamma (m,), Eqs. (2) to (5)."""

    value: Float[Array, " m"]
    rate: Float[Array, " m"]
    gamma: Float[Array, " m"]


class Model(NamedTuple):
    """What the equations take of a system at a state.

    - `jacobian`, `mass`, `load`: Phi_q, M and Q.
    - `motion`, `explicit`, `turned`: those of `second_order`.
    """

    jacobian: Float[Array, "m n"]
    mass: Float[Array, "n n"]
    load: Float[Array, " n"]
    motion: AlongMotion
    explicit: Float[Array, " m"]
    turned: Float[Array, " m"]


@of_model
def model_at(system: AbstractSystem, state: State) -> Model:
    """All of it by one program."""
    jacobian = system.jacobian(state.q, state.t)
    return Model(jacobian, system.mass(state.q, state.t), system.load(state), *second_order(system, state))


def along_motion(system: AbstractSystem, state: State) -> AlongMotion:
    """Phi, Phi_q qd + Phi_t and gamma at a state."""
    return _along(system, state, state.qd, jnp.ones_like(state.t))


def constraint_motion(system: AbstractSystem, state: State) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
    """Phi, and Phi_q qd + Phi_t."""
    zero, one = jnp.zeros_like(state.t), jnp.ones_like(state.t)
    path = system.path(state.q, state.qd)

    def value(s: Array) -> Array:
        return system.constraint(system.retract(state.q, s * state.qd), state.t + s)

    if path is not None:
        phi, rate = jax.jvp(system.constraint_at, (path.poses, state.t), (path.rate, one))
    else:
        phi, rate = jax.jvp(value, (zero,), (one,))
    if system.velocity_rows:
        rate = rate + system.velocity_constraint(state.q, state.qd, state.t)
    return phi, rate


@of_model
def prescribed_rate(system: AbstractSystem, q: Array, t: Array) -> Float[Array, " m"]:
    """Phi_t, of rows of velocity -b: the work of the constraints in a unit of time is this times their multipliers."""
    rate = jax.jvp(lambda t: system.constraint(q, t), (t,), (jnp.ones_like(t),))[1]
    if not system.velocity_rows:
        return rate
    return rate + system.velocity_constraint(q, jnp.zeros(len(system.coordinates), rate.dtype), t)


def explicit_gamma(system: AbstractSystem, state: State) -> Float[Array, " m"]:
    """-Phi_tt, the part of gamma that prescribed motion alone is answerable for; where there is none it is free."""
    one = jnp.ones_like(state.t)
    return -jax.jvp(lambda t: prescribed_rate(system, state.q, t), (state.t,), (one,))[1]


@of_model
def second_derivative(
    system: AbstractSystem, state: State, rate: Float[Numeric, " n"], time: Numeric
) -> Float[Numeric, " m"]:
    """Phi'' along a constant rate, and t' = time."""
    return -_along(system, state, rate, time).gamma


def second_order(system: AbstractSystem, state: State) -> tuple[AlongMotion, Float[Array, " m"], Float[Array, " m"]]:
    """`along_motion`; `explicit_gamma`; and the second derivative of Phi as all angular coordinates turn.

    They turn each at another rate, so that no two cancel; where there are none, all coordinates move, each at another
    rate. Both directions go through one derivative.
    """
    angular, number = system.coordinates.angular, np.arange(len(system.coordinates))
    turning = np.where(angular, 1.0 + 0.5 * np.sin(number), 0.0) if angular.any() else np.cos(number**2)
    rates = jnp.stack([state.qd, jnp.asarray(turning, state.qd.dtype)])
    found = jax.vmap(lambda rate, time: _along(system, state, rate, time))(rates, jnp.array([1, 0], state.qd.dtype))
    motion, turned = (jax.tree.map(lambda x, k=k: x[k], found) for k in range(2))
    return motion, explicit_gamma(system, state), -turned.gamma


def _along(system: AbstractSystem, state: State, rate: Array, time: Array) -> AlongMotion:
    """Phi, Phi' and -Phi'' at constant rate and t' = time."""
    found = _second(system, system.constraint, system.constraint_at, state, rate, time)
    if not system.velocity_rows:
        return found

    path = system.path(state.q, rate)
    if path is not None:
        slope, bend = jax.jvp(
            lambda poses, slope, t: system.velocity_constraint_at(poses, slope, rate, t, time),
            (path.poses, path.rate, state.t),
            (path.rate, path.bend, time),
        )
    else:
        slope, bend = jax.jvp(
            lambda d, t: system.velocity_constraint(system.retract(state.q, d), rate, t, time),
            (jnp.zeros_like(rate), state.t),
            (rate, time),
        )
    return AlongMotion(found.value, found.rate + slope, found.gamma - bend)


def _second(
    system: AbstractSystem,
    value: Callable[[Array, Array], Array],
    value_at: Callable[[PyTree, Array], Array],
    state: State,
    rate: Array,
    time: Array,
) -> AlongMotion:
    """A function of position and time, its first and minus its second derivative at constant rate and t' = time;
    `value_at` is the same at poses of bodies."""
    path = system.path(state.q, rate)
    if path is not None:
        (phi, slope), (_, bend) = jax.jvp(
            lambda poses, slope, t: jax.jvp(value_at, (poses, t), (slope, time)),
            (path.poses, path.rate, state.t),
            (path.rate, path.bend, time),
        )
        return AlongMotion(phi, slope, -bend)
    still, along = (jnp.zeros_like(rate), state.t), (rate, time)

    def first(d: Array, t: Array) -> tuple[Array, Array]:
        q = system.retract(state.q, d)
        return jax.jvp(lambda e, u: value(system.retract(q, e), u), (jnp.zeros_like(rate), t), along)

    (phi, slope), (_, bend) = jax.jvp(first, still, along)
    return AlongMotion(phi, slope, -bend)


@of_model
def change_of_jacobian(
    system: AbstractSystem, state: State, direction: Float[Numeric, " n"], time: Numeric
) -> Float[Numeric, "m n"]:
    """Derivative of Phi_q as the position moves along a direction, and t at the rate `time`.

    Up to combinations of its columns where coordinates do not add, which no self-stress sees.
    """
    still, along = (jnp.zeros_like(direction), state.t), (direction, time)
    return jax.jvp(lambda d, t: system.jacobian(system.retract(state.q, d), t), still, along)[1]


@of_model
def third_order(system: AbstractSystem, state: State) -> tuple[Float[Array, "m n"], Float[Array, " m"]]:
    """The rate of Phi_q along the motion, and Phi''' along its constant rate, t' = 1.

    Both up to combinations of the columns of Phi_q where coordinates do not add, which no self-stress sees.
    """
    zero, one = jnp.zeros_like(state.t), jnp.ones_like(state.t)

    def second(s: Array) -> Array:
        later = State(system.retract(state.q, s * state.qd), state.qd, state.t + s, state.memory)
        return second_derivative(system, later, state.qd, one)

    return change_of_jacobian(system, state, state.qd, one), jax.jvp(second, (zero,), (one,))[1]


def chart_rate(system: AbstractSystem, state: State) -> Float[Array, "..."]:
    """q', the rate of the coordinates: the derivative of q [+] s qd at s = 0."""
    path, zero = system.path(state.q, state.qd), jnp.zeros_like(state.t)
    if path is not None:
        return path.chart
    return jax.jvp(lambda s: system.retract(state.q, s * state.qd), (zero,), (jnp.ones_like(zero),))[1]


def velocity(system: AbstractSystem, q: Array, rate: Array) -> Float[Array, " n"]:
    """The velocity at which positions have a rate, by least squares."""
    own = system.velocity(q, rate)
    return _inverse(system, q, jnp.zeros(len(system.coordinates), q.dtype), rate) if own is None else own


def _inverse(system: AbstractSystem, base: Array, d: Array, change: Array) -> Float[Array, " n"]:
    """The change of d that changes base [+] d by a given one, by least squares."""
    slope = jax.jacfwd(lambda e: system.retract(base, e))(d).reshape(-1, d.size)
    return jax.scipy.linalg.solve(slope.T @ slope, slope.T @ change.ravel(), assume_a="pos")


def displacement(
    system: AbstractSystem, base: Float[Array, "..."], q: Float[Array, "..."]
) -> tuple[Float[Array, " n"], Float[Array, ""]]:
    """d with base [+] d nearest to q; by Gauss-Newton with its last relative change, as large turns need not settle,
    where it has no form of its own."""
    if system.adds:
        return q - base, jnp.zeros((), q.dtype)
    own = system.displacement(base, q)
    if own is not None:
        return own[0], jnp.where(own[1], 0.0, jnp.inf)

    def step(_: Array, found: tuple[Array, Array]) -> tuple[Array, Array]:
        change = _inverse(system, base, found[0], q - system.retract(base, found[0]))
        return found[0] + change, change

    none = jnp.zeros(len(system.coordinates), q.dtype)
    d, change = jax.lax.fori_loop(0, _GAUSS_NEWTON, step, (none, none))
    size = jnp.linalg.norm(jax.lax.stop_gradient(d))
    return d, jnp.linalg.norm(jax.lax.stop_gradient(change)) / or_one(size)


@of_model
def between(system: AbstractSystem, first: State, second: State, s: Float[Numeric, ""]) -> State:
    """The state at the fraction s of the way: displacement cubic in time, or linear between states of one time;
    internal states linear."""
    span = second.t - first.t
    whole, _ = displacement(system, first.q, second.q)

    def moved(s: Array) -> Array:
        bent = s**2 * (3 - 2 * s) * whole + span * (s * (1 - s) ** 2 * first.qd - s**2 * (1 - s) * second.qd)
        return jnp.where(span == 0, s * whole, bent)

    def linear(a: Array, b: Array) -> Array:
        return a + s * (b - a)

    d, slope = jax.jvp(moved, (s,), (jnp.ones_like(s),))
    qd = jnp.where(span == 0, linear(first.qd, second.qd), slope / jnp.where(span == 0, 1.0, span))
    return State(system.retract(first.q, d), qd, first.t + s * span, jax.tree.map(linear, first.memory, second.memory))


@of_model
def slip_motion(system: AbstractSystem, state: State) -> tuple[Float[Numeric, " p"], Float[Numeric, "n p"]]:
    """Slip rates and slip directions E of all friction groups: F = E tau, rate = E^T qd + s_t."""
    path = system.path(state.q, state.qd)
    if path is not None:
        directions = system.slip_directions(path.poses)
        return state.qd @ directions, directions

    def slip(d: Array, t: Array) -> Array:
        return _slips(system, system.retract(state.q, d), t)

    zero = jnp.zeros_like(state.qd)
    _, rate = jax.jvp(slip, (zero, state.t), (state.qd, jnp.ones_like(state.t)))
    return rate, jax.jacrev(slip)(zero, state.t).T


def slip_rate(system: AbstractSystem, state: State) -> Float[Array, " p"]:
    """E^T qd + s_t."""
    path = system.path(state.q, state.qd)
    if path is not None:
        return jax.jvp(system.slips_at, (path.poses,), (path.rate,))[1]
    return jax.jvp(
        lambda d, t: _slips(system, system.retract(state.q, d), t),
        (jnp.zeros_like(state.qd), state.t),
        (state.qd, jnp.ones_like(state.t)),
    )[1]


def along_slips(system: AbstractSystem, state: State, change: Float[Array, " n"]) -> Float[Array, " p"]:
    """E^T times a change of the coordinates."""
    return jax.jvp(lambda d: _slips(system, system.retract(state.q, d), state.t), (0.0 * change,), (change,))[1]


def slip_force(system: AbstractSystem, state: State, tau: Float[Array, " p"]) -> Float[Array, " n"]:
    """E tau."""
    still = jnp.zeros_like(state.qd)
    return jax.vjp(lambda d: _slips(system, system.retract(state.q, d), state.t), still)[1](tau)[0]


@of_model
def slip_gamma(system: AbstractSystem, state: State) -> Float[Numeric, " p"]:
    """gamma of the slips: the slip rates change by E^T qdd - gamma."""
    return _second(
        system,
        lambda q, t: _slips(system, q, t),
        lambda poses, t: system.slips_at(poses),
        state,
        state.qd,
        jnp.ones_like(state.t),
    ).gamma


def _slips(system: AbstractSystem, q: Array, t: Array) -> Float[Array, " p"]:
    return jnp.concatenate([group.slip(q, t) for group in system.friction])
