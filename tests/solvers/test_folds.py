"""Where the branch from zero friction folds: `stats.fold`, whatever friction is asked for, against other ways."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import registry
from truth import scenes

import redundax as rx


def first_fold(rho0, gain, sense):
    """Least mu_rho at which tau = -mu_rho |rho0 + K tau| sense folds: bordered Newton's method on its equations

    G(tau, mu) = 0,   G_tau v = 0,   v . v = 1,

    from the last solution that steps in mu_rho find.
    """

    def equations(x):
        tau, v, mu = x[:4], x[4:8], x[8]
        rho = rho0 + gain @ tau
        size = np.linalg.norm(rho, axis=1)
        slope = np.einsum("ic,icj->ij", rho / size[:, None], gain)
        return np.r_[tau + mu * size * sense, v + mu * sense * (slope @ v), v @ v - 1], np.eye(4) + mu * sense[
            :, None
        ] * slope

    tau, mu, step = np.zeros(4), 0.0, 1e-3
    while step > 1e-7:
        trial = tau
        for _ in range(20):
            value, slope = equations(np.r_[trial, np.zeros(4), mu + step])
            trial = trial - np.linalg.solve(slope, value[:4])
        left = equations(np.r_[trial, np.zeros(4), mu + step])[0][:4]
        near = np.abs(left).max() < 1e-12 and np.abs(trial - tau).max() < 0.2 * (0.1 + np.abs(tau).max())
        tau, mu, step = (trial, mu + step, step) if near else (tau, mu, step / 2)
    x = np.r_[tau, np.linalg.svd(equations(np.r_[tau, np.zeros(4), mu])[1])[2][-1], mu]
    for _ in range(20):
        value = equations(x)[0]
        around = [(equations(x + e)[0] - equations(x - e)[0]) / 2e-6 for e in 1e-6 * np.eye(9)]
        x = x - np.linalg.solve(np.transpose(around), value)
    assert np.abs(equations(x)[0]).max() < 1e-11
    assert abs(x[8] - mu) < 1e-5
    return x[8]


@jax.jit
@jax.vmap
def fold(phi, mu_rho):
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    return rx.solve(mechanism, mechanism.state(phi=phi, rate=1.0)).stats.fold * mu_rho


@pytest.mark.slow
def test_the_fold_does_not_depend_on_the_friction_asked_for():
    shares = np.array([0.9, 0.9999, 1.0001, 1.001, 1.01, 1.1, 1.3, 2.0, 5.0])
    phis = np.array([0.6, 1.2])
    truth = np.array([first_fold(*registry.pins(scenes.wojtyra2020(phi))) for phi in phis])
    found = fold(np.repeat(phis, shares.size), np.outer(truth, shares).ravel()).reshape(2, -1)
    np.testing.assert_allclose(found, np.where(shares < 1, np.inf, truth[:, None]), rtol=1e-9)


def first(q, t, p):
    return q[:1]


def same_twice(q, t, p):
    return jnp.stack([q[1] - q[0], 2 * (q[1] - q[0])])


def unloaded(q, qd, t, p):
    return jnp.zeros(2)


def kinked(loads, rate, sense, memory, state, p):
    amount, steep = p
    return amount * (1 + steep * jnp.maximum(-2 * (loads[0] + 2 * loads[1]) - 1, 0.0))[None]


@pytest.mark.parametrize(("steep", "rtol"), [(1.5, 1e-9), (3.0, 1e-8)])  # at the steeper one the path ends
@pytest.mark.parametrize("amount", [1.02, 1.25, 2.0, 5.0])
def test_a_fold_at_a_kink(amount, steep, rtol):
    """tau = s A (1 + steep max(tau - 1, 0)): s = tau / A up to tau = 1, where it begins to fall."""
    friction = rx.Friction(first, kinked, np.arange(2), ("linear",), jnp.array([amount, steep]))
    system = rx.System(same_twice, jnp.ones(2), unloaded, friction=friction)
    solution = rx.solve(system, rx.State([0.0, 0.0], [5.0, 5.0]), throw=False)
    assert solution.result == rx.RESULTS.no_solution_found
    np.testing.assert_allclose(solution.stats.fold * amount, 1.0, rtol=rtol)
