"""Bricard's mechanism, problem A04 of the multibody benchmark library, by its one freedom.

The angles from bar to bar are theta and phi in turn, with (1 + cos theta) (1 + cos phi) = 1. Along that curve, of the
speed u, Lagrange's equation is I u' = -dV/ds - dI/ds u^2 / 2. Bars are turned one after the other, without constraints.
"""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

WIDTH, GRAVITY = 0.1, 9.81
_INERTIA = np.array([WIDTH**2 / 6, (1 + WIDTH**2) / 12, (1 + WIDTH**2) / 12])


def _about(axis: int, angle):
    a, b = [(1, 2), (2, 0), (0, 1)][axis]
    turn = jnp.eye(3).at[a, a].set(jnp.cos(angle)).at[b, b].set(jnp.cos(angle))
    return turn.at[a, b].set(-jnp.sin(angle)).at[b, a].set(jnp.sin(angle))


def bars(angles):
    """Ends of the five bars from the origin on, (5, 3), and axes, (5, 3, 3), x along each, z along the joint at it."""
    frame = jnp.stack([jnp.array([0.0, 0.0, -1.0]), jnp.array([-1.0, 0.0, 0.0]), jnp.array([0.0, 1.0, 0.0])], axis=1)
    end, ends, frames = jnp.zeros(3), [], []
    for k in range(5):
        frame = frame @ _about(2, angles[k % 2])
        end = end + frame[:, 0]
        ends, frames = [*ends, end], [*frames, frame]
        frame = frame @ _about(0, jnp.pi / 2 * (-1) ** k)
    return jnp.stack(ends), jnp.stack(frames)


def _tangent(angles):
    theta, phi = angles
    t = jnp.stack([(1 + jnp.cos(theta)) * jnp.sin(phi), -jnp.sin(theta) * (1 + jnp.cos(phi))])
    return t / jnp.linalg.norm(t)


def _energies(angles):
    """Moment of inertia for the speed along the curve, and potential energy."""
    (_, frames), (_, turning) = jax.jvp(bars, (angles,), (_tangent(angles),))
    centres, rates = jax.jvp(lambda x: bars(x)[0] - bars(x)[1][:, :, 0] / 2, (angles,), (_tangent(angles),))
    spin = jnp.einsum("bji,bjk->bik", frames, turning)
    w = jnp.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    return jnp.sum(rates**2) + jnp.sum(_INERTIA * w**2), GRAVITY * jnp.sum(centres[:, 1])


@jax.jit
def _rate(y):
    angles, u = y[:2], y[2]
    t = _tangent(angles)
    (inertia, _), (bend, slope) = jax.jvp(_energies, (angles,), (t,))
    return jnp.append(u * t, -(slope + bend * u**2 / 2) / inertia)


def released(times: np.ndarray) -> np.ndarray:
    """Ends of the bars, (times, 5, 3), released at rest on the edges of a cube."""
    start = np.array([-np.pi / 2, -np.pi / 2, 0.0])
    run = solve_ivp(
        lambda _, y: np.asarray(_rate(jnp.asarray(y))),
        (0, times[-1]),
        start,
        "DOP853",
        times,
        rtol=1e-12,
        atol=1e-13,
    )
    return np.array([bars(jnp.asarray(angles))[0] for angles in run.y[:2].T])


@jax.jit
def accelerations(theta, rate):
    """Of the centres of the bars, (5, 3), at a first angle between 0 and -pi and its rate, on the cube's branch."""

    def centres(angles):
        ends, frames = bars(angles)
        return ends - frames[:, :, 0] / 2

    def velocity(y):
        return jax.jvp(centres, (y[:2],), (y[2] * _tangent(y[:2]),))[1]

    angles = jnp.stack([theta, -jnp.arccos(1 / (1 + jnp.cos(theta)) - 1)])
    y = jnp.append(angles, rate / _tangent(angles)[0])
    return jax.jvp(velocity, (y,), (_rate(y),))[1]
