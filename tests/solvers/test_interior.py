"""Friction of feet that hold or are let go, by the conditions that it must meet."""

import jax
import jax.numpy as jnp
import numpy as np

from redundax._solvers._interior import interior
from redundax._system._directions import Directions

CORNERS = np.array([(0.5, 0.4), (-0.5, 0.4), (-0.5, -0.4), (0.5, -0.4)])  # m
MASS, SPIN, WEIGHT, HEIGHT, MU = 10.0, 1.5, 98.1, 0.5, 0.5


def test_friction_is_found_about_the_push_at_which_a_foot_is_let_go():
    """Its multiplier and slack are both zero there, and slacks of the other feet far smaller than their multipliers."""
    slips = np.concatenate([[[1.0, 0.0, -y], [0.0, 1.0, x]] for x, y in CORNERS])
    matrix = slips @ (slips / np.array([MASS, MASS, SPIN])).T
    lean = np.stack([np.tile([HEIGHT / (4 * x), HEIGHT / (4 * y)], 4) for x, y in CORNERS])
    directions = Directions(jnp.ones(8), ((0, 1), (2, 3), (4, 5), (6, 7)))

    def limits(tau):
        most = jnp.repeat(MU * (WEIGHT / 4 - jnp.asarray(lean) @ tau) / jnp.sqrt(2.0), 2)  # of both slips of a foot
        return -most, most

    @jax.jit
    @jax.vmap
    def found(free):
        return interior(limits, free, jnp.asarray(matrix), jnp.zeros(8, bool), jnp.ones(8), directions)

    pulls = np.array([-1.3704717297812, -1.0756609505073, -17.476170496151])  # m/s^2, rad/s^2
    free = pulls @ slips.T * (1 - 5.812e-7 + np.linspace(-1e-7, 1e-7, 20001)[:, None])
    tau, well = found(jnp.asarray(free))
    assert np.all(well)
    most = np.sqrt(2) * np.asarray(jax.vmap(limits)(tau)[1])[:, ::2]
    alpha, tau = (np.asarray(x).reshape(-1, 4, 2) for x in (free + tau @ matrix, tau))
    slack, starts = most - np.linalg.norm(tau, axis=2), np.linalg.norm(alpha, axis=2)
    assert np.min(slack) > -1e-9 and np.max(np.minimum(slack, starts)) < 1e-8
    against = np.sum(alpha * tau, axis=2) + starts * np.linalg.norm(tau, axis=2)
    np.testing.assert_allclose(against, 0.0, atol=1e-8)
    assert np.all(starts[:, [0, 2, 3]] > 1e-3) and np.ptp(np.sign(slack[:, 1] - 1e-9)) == 2  # it holds, and is let go
