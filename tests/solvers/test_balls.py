"""Friction in balls: sweeps against the conditions that they solve, and least values from elsewhere."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize

from redundax._solvers._balls import nearest
from redundax._solvers._gauss_seidel import gauss_seidel
from redundax._system._directions import Directions

ARMS = np.array([1.0, 0.03, 1.0, 0.4, 1.0, 1.0])
JOINTS = ((1, 2), (3, 4, 5))


@pytest.mark.parametrize("limit", [1e-3, 0.3, 2.0, 50.0])
@pytest.mark.parametrize("values", [(1.0, 2.0, 3.0), (1e-6, 1.0, 1e3), (0.0, 1.0, 2.0)])
def test_the_nearest_of_a_ball(values, limit):
    """f = -(B + lambda)^-1 g at the limit, with lambda >= 0, or within it without."""
    pull = np.array([0.3, -2.0, 5.0])
    force = np.asarray(nearest(jnp.array(values), jnp.array(pull), jnp.array(limit)))
    left = np.array(values) * force + pull
    if np.linalg.norm(force) < limit * (1 - 1e-12):
        np.testing.assert_allclose(left, 0.0, atol=1e-12)
    else:
        np.testing.assert_allclose(np.linalg.norm(force), limit, rtol=1e-14)
        more = -left @ force / limit**2
        assert more >= -1e-12
        np.testing.assert_allclose(left, -more * force, rtol=0, atol=1e-12 * np.abs(pull).max())


@pytest.mark.parametrize("seed", range(4))
def test_sweeps_find_the_least(seed):
    """A joint with one slip, a sleeve and a ball on a body: min tau^T A tau / 2 + alpha_0^T tau."""
    random = np.random.default_rng(seed)
    half = random.standard_normal((6, 5)) / ARMS[:, None]
    matrix, free = half @ half.T, random.standard_normal(6) / ARMS
    limits = np.array([0.4, 0.7, 1.1])
    high = ARMS * np.array([limits[0], *[limits[1] / np.sqrt(2)] * 2, *[limits[2] / np.sqrt(3)] * 3])
    swept = gauss_seidel(
        lambda tau: (-jnp.array(high), jnp.array(high)),
        jnp.array(free),
        jnp.array(matrix),
        jnp.array(np.diag(matrix)),
        jnp.array(1 / ARMS),
        (0.0, 1e-13),
        directions=Directions(jnp.array(ARMS), JOINTS),
    )
    assert swept.settled
    force = np.asarray(swept.tau) / ARMS
    own, pull = matrix * np.outer(ARMS, ARMS), free * ARMS
    sizes = [abs(force[0]), *(np.linalg.norm(force[list(joint)]) for joint in JOINTS)]
    assert np.all(np.array(sizes) <= limits * (1 + 1e-9))
    inside = [
        {"type": "ineq", "fun": lambda f, k=list(k), most=most: most**2 - f[k] @ f[k]}
        for k, most in zip(((0,), *JOINTS), limits, strict=True)
    ]
    truth = minimize(
        lambda f: f @ own @ f / 2 + pull @ f,
        np.zeros(6),
        jac=lambda f: own @ f + pull,
        constraints=inside,
        options={"ftol": 1e-15, "maxiter": 1000},
    )
    np.testing.assert_allclose(force @ own @ force / 2 + pull @ force, truth.fun, rtol=1e-9)
    np.testing.assert_allclose(own @ force, own @ truth.x, rtol=0, atol=1e-5)
