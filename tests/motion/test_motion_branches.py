"""Motions on one of several branches of friction: followed to the fold at which it ends, and not beyond."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import redundax as rx

STEEP, LARGE = 2.0, 3.0


def wedge() -> rx.System:
    """1 kg on a slope of 45 degrees, that stands there twice, pressed on by a growing load.

    With y = x and a friction force tau along x the load of the slope, lam + 2 lam', is -(g + tau) / 2. The law falls
    with the load, steeply enough that for some g there are three solutions.
    """

    def law(loads, rate, sense, memory, state, p):
        return -LARGE * jnp.tanh(STEEP * (loads[0] + 2 * loads[1]))[None]

    friction = rx.Friction(lambda q, t, p: q[:1], law, np.arange(2), ("linear",))
    return rx.System(
        lambda q, t, p: jnp.stack([q[1] - q[0], 2 * (q[1] - q[0])]),
        jnp.ones(2),
        lambda q, qd, t, p: jnp.stack([grown(t), 0.0 * t]),
        friction=friction,
    )


def grown(t):
    return t - 3.0


def remainder(tau, g):
    """tau - law, with the load -lam of x: x'' = g + tau - lam', lam' = (g + tau) / 2."""
    return tau - LARGE * np.tanh(STEEP * (g + tau) / 2)


@pytest.mark.slow
def test_a_motion_stops_where_its_branch_of_friction_ends():
    """tau = A tanh(B (g + tau) / 2) folds where A B (1 - (tau / A)^2) / 2 = 1, at a g, so at a time."""
    tau = -LARGE * np.sqrt(1 - 2 / (LARGE * STEEP))
    fold = 2 / STEEP * np.arctanh(tau / LARGE) - tau + 3.0
    state = rx.State([0.0, 0.0], [5.0, 5.0])
    run = rx.simulate(wedge(), state, 6.0, ts=[0.5 * fold, 6.0], throw=False)
    assert run.result == rx.RESULTS.step_too_small
    np.testing.assert_allclose(run.stats.end, fold, rtol=0, atol=1e-6)
    lower = brentq(remainder, -2 * LARGE, tau, args=(grown(0.5 * fold),), xtol=1e-15)
    np.testing.assert_allclose(run.friction[0, 0], lower, rtol=0, atol=1e-9)
    assert np.isnan(run.q[1]).all()
