"""Positions of a driven system some of whose rows constrain velocities alone: they depend on the way there.

    q' = v(q, t)   with   K v = b   of all rows

is integrated from time to time, and ends on the rows that have positions. Drives leave no freedom, so that all rows say
the velocity; where they contradict each other there is none, and the position ends.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._equations._kinematics import constraint_motion
from .._equations._scaling import Scaling
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._numbers import as_program

_RTOL = 1e-11  # of a step: a motion of a hundred steps is right to 1e-9
_LEAST = 1e-9  # of the way to the next time: shorter steps end at a singular position
_STEPS = 4096  # to the next time, at most
_ROUNDS = 3  # of Newton's method from a position that is off by the error of a step
_MET = 1e-9  # of the size, of what such a position misses: far above rounding
_RANK = 1e-9  # singular values of rows of position, relative to the largest, that are none
_CONTRADICTS = 1e-7  # of the prescribed speeds: what rounding of positions leaves of none


def velocity_of(
    system: AbstractSystem, scale: Scaling, q: Array, t: Array
) -> tuple[Float[Array, " n"], Bool[Array, ""]]:
    """S^-1 v of all rows by least squares, and whether it meets them. Normal equations, refined once."""
    matrix = scale.scaled(system.jacobian(q, t))
    still = State(q, jnp.zeros(len(system.coordinates), q.dtype), t)
    right = -constraint_motion(system, still)[1] / scale.rows
    factor = jnp.linalg.cholesky(matrix.T @ matrix), True
    first = jax.scipy.linalg.cho_solve(factor, matrix.T @ right)
    found = first + jax.scipy.linalg.cho_solve(factor, matrix.T @ (right - matrix @ first))
    off, size = (jnp.max(jnp.abs(x)) for x in (right - matrix @ found, right))
    return found, off <= max(_CONTRADICTS, 100 * float(jnp.finfo(q.dtype).eps)) * size


velocity_at = as_program(velocity_of)


def rolled(
    system: AbstractSystem, scale: Scaling, q: Array, t: Array, end: Array
) -> tuple[Array, Float[Array, " n"], Array, Bool[Array, ""]]:
    """Position, S^-1 v and time at the end, or as far as it goes, and whether it got there."""
    import diffrax  # here, as its import takes time that few need

    def rate(t: Array, q: Array, _: object) -> Array:
        found, agree = velocity_of(system, scale, q, t)
        along = jnp.where(agree, scale.coordinates * found, jnp.nan)  # steps end where laws contradict each other
        zero, one = jnp.zeros((), q.dtype), jnp.ones((), q.dtype)
        return jax.jvp(lambda s: system.retract(q, s * along), (zero,), (one,))[1]

    rtol = max(_RTOL, 20 * float(jnp.finfo(q.dtype).eps))
    steps = diffrax.PIDController(
        rtol, rtol * jnp.minimum(scale.length, 1.0), dtmin=_LEAST * (end - t), force_dtmin=False
    )

    def integrated() -> tuple[Array, Array, Array]:
        term, way = diffrax.ODETerm(rate), end - t  # pyright: ignore[reportArgumentType]
        found = diffrax.diffeqsolve(
            term, diffrax.Dopri8(), t, end, way, q, stepsize_controller=steps, max_steps=_STEPS, throw=False
        )
        ts, qs = found.ts, found.ys
        good = found.result == diffrax.RESULTS.successful
        return qs[-1], ts[-1], good  # pyright: ignore[reportOptionalSubscript]

    q, t, good = jax.lax.cond(end > t, integrated, lambda: (q, t, jnp.ones((), bool)))
    q, met = _on_rows(system, scale, q, t)
    along, agree = velocity_of(system, scale, q, t)
    return q, along, t, good & met & agree & jnp.all(jnp.isfinite(q))


def _on_rows(system: AbstractSystem, scale: Scaling, q: Array, t: Array) -> tuple[Array, Bool[Array, ""]]:
    """The position beside q that meets the rows of position, and whether it does."""
    rows = np.setdiff1d(np.arange(len(system.rows)), system.velocity_rows)
    if not rows.size:
        return q, jnp.ones((), bool)

    def missed(q: Array) -> Array:
        return system.constraint(q, t)[rows] / scale.rows[rows]

    for _ in range(_ROUNDS):
        matrix = system.jacobian(q, t)[rows] * scale.coordinates / scale.rows[rows, None]
        q = system.retract(q, -scale.coordinates * jnp.linalg.lstsq(matrix, missed(q), rcond=_RANK)[0])
    met = max(_MET, 100 * float(jnp.finfo(q.dtype).eps))
    return q, jnp.max(jnp.abs(missed(q))) <= met * scale.size
