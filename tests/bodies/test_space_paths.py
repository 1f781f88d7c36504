"""Poses along a motion in space, and displacements, in closed form: by quotients of differences, and turns back."""

import jax
import jax.numpy as jnp
import numpy as np
import spaces

import redundax as rx
from redundax._equations._kinematics import along_motion, chart_rate, displacement, slip_gamma, slip_motion
from redundax._system._state import State


def rubbing():
    """A four-bar in space with dry hinges, off its manifold and moving as it likes."""
    pins = {"pin_radius": 0.01, "bearing_length": 0.05, "thrust_radius": 0.02, "friction": rx.Coulomb(0.2)}
    bodies = [rx.spatial.Body(name, 1.0, (0.1, 0.2, 0.3), centre=(0.1, -0.2, 0.3)) for name in "ab"]
    ends = (("a", rx.GROUND), ("b", "a"))
    place = rx.spatial.Placement((0.1, 0.2, -0.3), (1.0, 2.0, 2.0))
    other = rx.spatial.Placement((-0.2, 0.1, 0.2), (2.0, 1.0, 2.0))
    joints = [rx.spatial.Revolute(f"{i}{j}", i, j, on_i=place, on_j=other, **pins) for i, j in ends]
    return rx.Mechanism(bodies, joints)


def test_poses_along_a_motion():
    """Residuals, slips and their derivatives, from central differences of steps of a turn at constant velocity."""
    mechanism, random = rubbing(), np.random.default_rng(3)
    q, qd = jnp.asarray(random.normal(size=14)), jnp.asarray(random.normal(size=12))
    state, h = State(q, qd, jnp.zeros(())), 1e-4

    @jax.jit
    def at(q):
        return mechanism.constraint(q, jnp.zeros(())), jnp.concatenate(
            [group.slip(q, jnp.zeros(())) for group in mechanism.friction]
        )

    turn = jax.jit(lambda q, d: mechanism.retract(q, d))
    before, now, after = ([np.asarray(x) for x in at(turn(q, s * qd))] for s in (-h, 0.0, h))
    slopes, bends = ([f(a, b, c) for a, b, c in zip(before, now, after, strict=True)] for f in (
        lambda a, b, c: (c - a) / (2 * h), lambda a, b, c: (c - 2 * b + a) / h**2))  # fmt: skip
    motion = along_motion(mechanism, state)
    rate, directions = slip_motion(mechanism, state)
    np.testing.assert_allclose(motion.rate, slopes[0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(-motion.gamma, bends[0], rtol=0, atol=1e-5)
    np.testing.assert_allclose(rate, slopes[1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(directions.T @ qd, slopes[1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(-slip_gamma(mechanism, state), bends[1], rtol=0, atol=1e-5)
    moved = (np.asarray(turn(q, h * qd)) - np.asarray(turn(q, -h * qd))) / (2 * h)
    np.testing.assert_allclose(chart_rate(mechanism, state), moved, rtol=0, atol=1e-6)


def test_a_displacement_is_that_which_was_made():
    """Of turns by up to 2.7 rad, and beside the chart."""
    mechanism, random = spaces.four_bar(), np.random.default_rng(4)
    base, d = jnp.asarray(random.normal(size=21)), jnp.asarray(random.uniform(-5.0, 5.0, 18))
    q = mechanism.retract(base, d)
    longer = q.at[9:].multiply(1.01)
    for there in (q, longer):
        found, change = displacement(mechanism, base, there)
        np.testing.assert_allclose(found, d, rtol=0, atol=1e-12)
        assert change == 0.0
    _, change = displacement(mechanism, base, base.at[9:].multiply(-1.0))  # a whole turn: none
    assert np.isinf(change)
