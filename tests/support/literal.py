"""The paper's forms, letter by letter, for any system: on the full unknown x = [qdd; lam].

They are the reference for the library's own routes, on systems of moderate units (the pseudoinverse
of A loses digits where the units are far apart). Of the library they use what `rx.factorize`
returns of (7) and the friction groups themselves. `rank` is that of the Jacobian, known beforehand. The linear forms
are computed by NumPy where the library's factors are, as of known numbers, and traced where those are.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import redundax as rx
from redundax._equations._kinematics import slip_motion


class Equations(NamedTuple):
    """A x = b(x), b(x) = [Q + F(lam); gamma], Eqs. (7) and (25), and A^+."""

    system: rx.AbstractSystem
    state: rx.State
    a: jax.Array
    a_pinv: jax.Array
    load: jax.Array
    gamma: jax.Array
    rank: int

    @property
    def n(self) -> int:
        return self.load.size

    def right_side(self, x):
        """b(x)."""
        return jnp.concatenate([self.load + force(self.system, self.state, x), self.gamma])

    def residual(self, x):
        """G(x) (34)."""
        return self.a @ x - self.right_side(x)


def functions(x):
    """NumPy, or that of JAX for what is traced."""
    return jnp if isinstance(x, jax.core.Tracer) else np


def pinv(a, rank: int):
    """Moore-Penrose inverse of a matrix of known rank: the cut lies in the gap of its spectrum."""
    xp = functions(a)
    s = xp.append(xp.linalg.svd(a, compute_uv=False), 0.0)
    below = xp.maximum(s[rank], np.finfo(a.dtype).tiny)
    return xp.linalg.pinv(a, rtol=xp.sqrt(s[rank - 1] * below) / s[0])


def factors(system, state):
    """Those of (7), known ones as arrays of NumPy."""
    f = rx.factorize(system, state)
    return jax.tree.map(np.asarray, f) if functions(f.mass) is np else f


def equations(system, state, rank: int) -> Equations:
    """A of (7) and its pseudoinverse."""
    f = factors(system, state)
    m, n = f.jacobian.shape
    a = functions(f.mass).block([[f.mass, f.jacobian.T], [f.jacobian, np.zeros((m, m), f.mass.dtype)]])
    return Equations(system, state, a, pinv(a, n + rank), f.load, f.gamma, rank)


def block_form(system, state, rank: int):
    """A^+ by (10), with C = B B^T (45), so B^T C^+ = B^+ (52), as C squares the condition number.

    Here B = Phi_q L^-T with M = L L^T, and M^-1 Phi_q^T C^+ = L^-T B^+.
    """
    f = factors(system, state)
    xp = functions(f.mass)
    root = xp.linalg.inv(xp.linalg.cholesky(f.mass))
    b = f.jacobian @ root.T
    b_pinv = pinv(b, rank)
    corner = root.T @ b_pinv
    free = np.eye(f.load.size, dtype=b.dtype) - b_pinv @ b
    motion = root.T @ free @ free @ root  # the square of a projector sheds its rounding
    return xp.block([[motion, corner], [corner.T, -b_pinv.T @ b_pinv]])


def moments(system, state, x):
    """tau of all friction groups (25), (41), and their directions E."""
    if not system.friction:
        return jnp.zeros(0, x.dtype), jnp.zeros((state.qd.size, 0), x.dtype)
    rate, directions = slip_motion(system, state)
    lam, tau, start = x[state.qd.size :], [], 0
    for group in system.friction:
        own = rate[start : start + len(group.slips)]
        tau.append(group.force(lam[group.rows], own, jnp.sign(own), None, state))
        start += len(group.slips)
    return jnp.concatenate(tau), directions


def force(system, state, x):
    """F(lam, q, qd) = E tau."""
    tau, directions = moments(system, state, x)
    return directions @ tau


def arbitrary(e: Equations, h):
    """(I - A^+ A) h, h a number or (n + m,)."""
    xp = functions(e.a)
    h = xp.broadcast_to(xp.asarray(h, e.a.dtype), e.a.shape[:1])
    return h - e.a_pinv @ (e.a @ h)


def solve(e: Equations, h=0.0):
    """x = A^+ b + (I - A^+ A) h without friction (9)."""
    return e.a_pinv @ functions(e.a).concatenate([e.load, e.gamma]) + arbitrary(e, h)


def fixed_point(e: Equations, h=0.0, tol_load=1e-12, tol_step=1e-11, max_steps=1000):
    """The end of (27) from the solution without friction, with the stop on b and then on x.

    Tolerances are relative to |b| and |x|.
    """
    shift = arbitrary(e, h)

    def unfinished(carry):
        x, old, b, older, steps = carry
        settled = jnp.linalg.norm(b - older) <= tol_load * jnp.linalg.norm(b)
        still = jnp.linalg.norm(x - old) <= tol_step * jnp.linalg.norm(x)
        return ~(settled & still) & (steps < max_steps)

    def step(carry):
        x, _, older, _, steps = carry
        b = e.right_side(x)
        return e.a_pinv @ b + shift, x, b, older, steps + 1

    x, infinite = solve(e, h), jnp.full(e.a.shape[0], jnp.inf)
    return jax.lax.while_loop(unfinished, step, (x, infinite, infinite, -infinite, 0))[0]


def fixed_point_iterates(e: Equations, count: int, h=0.0):
    """x_1 .. x_count of (27), from the solution without friction."""
    shift = arbitrary(e, h)

    def step(x, _):
        x = e.a_pinv @ e.right_side(x) + shift
        return x, x

    return jax.lax.scan(step, solve(e, h), None, length=count)[1]


def newton_iterates(e: Equations, x0, count: int):
    """x_1 .. x_count of (38): s = -G_x^+ G with G_x by automatic differentiation."""
    rank = e.n + e.rank

    def step(x, _):
        x = x - pinv(jax.jacfwd(e.residual)(x), rank) @ e.residual(x)
        return x, x

    x0 = jnp.broadcast_to(jnp.asarray(x0, e.a.dtype), e.a.shape[:1])
    return jax.lax.scan(step, x0, None, length=count)[1]
