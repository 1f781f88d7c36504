"""Projection: a position and velocity beside the manifold moved onto it, by least change in the norm of M.

Phi(q [+] d, t) = 0,   Phi_q qd = -Phi_t     on the rows that are held

Rows of velocity ask nothing of positions: d is along the motions that they allow, A d = 0, so that the way that wheels
have rolled stays as it was. Where self-stress couples them with others they move with these.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._equations._kinematics import constraint_motion
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import or_zeros
from ._held_rank import AnyHeld, factorize_held
from ._moving import Moving


def project(system: AbstractSystem, t: Array, y: Moving, held: AnyHeld) -> Moving:
    """y moved onto the manifold, positions then velocities, by least change in the norm of M."""
    d, qd = _least_change(system, held, y.q, y.qd, t)
    q = system.retract(y.q, d)
    moved = system.load(State(system.retract(y.q, d / 2), y.qd, t)) @ d
    return y._replace(q=q, base=None if y.base is None else q, qd=qd, work=y.work + moved)


# Relative constraint residual after a projection beyond which it has failed, at least so many roundings.
CLOSED = 2e-10, 1e3
# Chord iterations: a step leaves position and velocity off by e, each turns e^k into e^(k+1), the velocity that of the
# position before; the last moves the velocity alone, as beside a singular position rounding moves positions by more.
_CHORDS = 5


@eqx.filter_custom_jvp
def _least_change(
    system: AbstractSystem, held: AnyHeld, q: Float[Array, "..."], qd: Float[Array, " n"], t: Array
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """The least displacement from q that meets the held rows, and the velocity nearest to qd that does so there."""
    factor = factorize_held(system, State(q, qd, t), held)

    def nearer(k: Array, now: tuple[Array, Array]) -> tuple[Array, Array]:
        d, qd = now
        off, rate = constraint_motion(system, State(system.retract(q, d), qd, t))
        moved = jnp.where(k < _CHORDS - 1, factor.nearest(factor.completed(system.velocity_rows, off)), 0.0)
        return d - moved, qd - factor.nearest(rate)

    return jax.lax.fori_loop(0, _CHORDS, nearer, (jnp.zeros_like(qd), qd))


@_least_change.def_jvp
def _least_change_jvp(primals: tuple, tangents: tuple) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """By the constraints at the new position: what the step is off by is small beside what moves."""
    system, held, q, qd, t = primals
    system_dot, _, q_dot, qd_dot, t_dot = tangents
    d, qd = _least_change(*primals)
    factor = factorize_held(system, State(system.retract(q, d), qd, t), held)
    of, off = eqx.filter_jvp(
        lambda system, q, t: system.constraint(system.retract(q, d), t), (system, q, t), (system_dot, q_dot, t_dot)
    )
    d_dot = -factor.nearest(factor.completed(system.velocity_rows, or_zeros(off, of)))
    both, (own, off) = eqx.filter_jvp(
        lambda system, q, d, qd, t: (qd, constraint_motion(system, State(system.retract(q, d), qd, t))[1]),
        (system, q, d, qd, t),
        (system_dot, q_dot, d_dot, qd_dot, t_dot),
    )
    own, off = or_zeros((own, off), both)
    return (d, qd), (d_dot, own - factor.nearest(off))
