"""The planar four-bar of `spaces.four_bar` by its one freedom, the angle phi of the crank

With the moment of inertia I(phi) and the potential energy V(phi), I phi'' = -V' - I' phi'^2 / 2. Bars of 1 kg.
"""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

A, B, C, D = (np.array(p) for p in ((0.0, 0.0), (0.2, 0.3), (0.9, 0.45), (0.8, 0.0)))
GRAVITY = 0.8 * 9.81  # in the plane, which leans
_CRANK, _COUPLER, _ROCKER = (float(np.linalg.norm(q - p)) for p, q in ((A, B), (B, C), (C, D)))
START = float(np.arctan2(B[1], B[0]))


def corners(phi):
    """B and C, on the side where C starts."""
    b = _CRANK * jnp.stack([jnp.cos(phi), jnp.sin(phi)])
    line = D - b
    along = (line @ line + _COUPLER**2 - _ROCKER**2) / 2
    aside = jnp.sqrt(_COUPLER**2 * (line @ line) - along**2)
    return b, b + (along * line + aside * jnp.stack([-line[1], line[0]])) / (line @ line)


def _energies(phi):
    """I and V."""

    def bars(phi):
        b, c = corners(phi)
        ends = jnp.stack([jnp.stack([A, b]), jnp.stack([b, c]), jnp.stack([c, D])])
        return ends.mean(axis=1), ends[:, 1] - ends[:, 0]

    (centres, _), (moving, turning) = jax.jvp(bars, (phi,), (jnp.ones(()),))
    return jnp.sum(moving**2) + jnp.sum(turning**2) / 12, GRAVITY * jnp.sum(centres[:, 1])


@jax.jit
def _acceleration(phi, rate):
    (inertia, _), (bend, slope) = jax.jvp(_energies, (phi,), (jnp.ones(()),))
    return -(slope + bend * rate**2 / 2) / inertia


def turned(times: np.ndarray, rate: float = 1.0) -> np.ndarray:
    """Where C is, (times, 2) in the plane, from the reference pose and a rate of the crank."""
    run = solve_ivp(
        lambda _, y: [y[1], float(_acceleration(*y))],
        (0, times[-1]),
        [START, rate],
        "DOP853",
        times,
        rtol=1e-12,
        atol=1e-13,
    )
    return np.array([corners(jnp.asarray(phi))[1] for phi in run.y[0]])
