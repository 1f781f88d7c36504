"""Joints that stick or start to slip, of which products alone are known, against their conditions."""

import jax.numpy as jnp
import numpy as np
import pytest

from redundax._equations._response import Response
from redundax._solvers._active_set import Effects, active_set


@pytest.mark.parametrize(("seed", "count", "rank"), [(0, 1, 1), (1, 12, 1), (2, 12, 4), (3, 30, 30), (4, 30, 7)])
@pytest.mark.parametrize("strength", [0.05, 0.5, 5.0])
@pytest.mark.parametrize("at_once", [0, 40])
def test_what_it_finds_meets_the_conditions(seed, count, rank, strength, at_once):
    rng = np.random.default_rng(seed)
    span, moves = rng.normal(size=(count, rank)), rng.normal(size=rank)
    matrix, free = span @ span.T, span @ moves
    gain = 0.02 * rng.normal(size=(count, count)) / count
    still = np.arange(count) % 5 != 4
    loads = strength * rng.uniform(0.5, 2.0, size=count) * (np.arange(count) % 7 != 3)
    wanted = jnp.asarray(True)

    def caused(tau):
        return Response(tau, gain @ tau), matrix @ tau

    def limits(changes):
        most = jnp.abs(loads + changes)
        return jnp.where(still, -most, most), most

    def hold(joints, change, rounding):
        both = joints[:, None] & joints
        held = jnp.linalg.pinv(jnp.where(both, matrix, 0.0), rtol=1e-10, hermitian=True)
        return held @ jnp.where(joints, change, 0.0)

    tau, _, found, settled = active_set(
        Effects(caused, limits, hold),
        jnp.asarray(free),
        jnp.asarray(still),
        jnp.ones(count),
        (1e-7, 1e-10),
        wanted,
        at_once,
    )
    assert settled
    most = np.abs(loads + gain @ np.asarray(tau))
    alpha = free + matrix @ np.asarray(tau)
    np.testing.assert_allclose(found, alpha, atol=1e-8)
    assert (np.abs(tau) <= most * (1 + 1e-8) + 1e-9).all()
    np.testing.assert_allclose(tau[~still], most[~still], rtol=0, atol=1e-9 * most.max())
    slips = still & (np.abs(alpha) > 1e-6 * np.abs(free).max())
    np.testing.assert_allclose(tau[slips], -np.sign(alpha[slips]) * most[slips], rtol=0, atol=1e-9 * most.max())
