"""Gaps and speeds that are small: what `solve` calls closed a motion begins with, and rounding is no impact."""

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx


def body_on_two_feet(gravity):
    """The feet are 1 m apart; it slides freely along x."""
    feet = [
        rx.PinInSlot(f"f{k}", "b", "ground", (x, 0.0), (x, 0.0), (0.0, 1.0), one_sided=True)
        for k, x in enumerate((0.0, 1.0))
    ]
    return rx.Mechanism([rx.Body("b", 1.0, 0.1)], feet, gravity=(0.0, -gravity))


@pytest.mark.parametrize("gap", [1e-13, 1e-9, 3e-7])
def test_a_motion_begins_with_the_contacts_that_are_closed(gap):
    mechanism, ts = body_on_two_feet(9.81), np.linspace(0.0, 0.05, 3)
    start = rx.State(jnp.array([0.0, gap, 0.0]), jnp.array([1.0, 0.0, 0.0]))
    assert rx.solve(mechanism, start).contacts == {"f0": "carries", "f1": "touches"}
    motion = rx.simulate(mechanism, start, 0.05, ts=ts)
    assert len(motion.impacts.t) == 0 and set(motion.contacts["f0"]) == {"carries"}
    np.testing.assert_allclose(motion.q, np.stack([ts, 0 * ts, 0 * ts], axis=1), rtol=1e-12, atol=1e-13)
    # The feet bear m g and the moment that keeps the body from turning as their load wanders along it.
    np.testing.assert_allclose(np.sum(np.asarray(motion.multipliers), axis=1), 9.81, rtol=1e-9)


@pytest.mark.parametrize(
    "velocity", [(0.0, -1e-96, 0.0), (0.0, 0.0, -1e-96), (0.0, -1e-20, 1e-20), (0.0, -1e-300, 0.0)]
)
def test_a_velocity_that_is_rounding_is_no_impact(velocity):
    mechanism = body_on_two_feet(0.0)  # nothing else gives a speed
    motion = rx.simulate(mechanism, rx.State(jnp.zeros(3), jnp.array(velocity)), 0.5, ts=[0.0, 0.2, 0.5])
    assert len(motion.impacts.t) == 0 and set(motion.contacts["f0"]) == set(motion.contacts["f1"]) == {"touches"}
    np.testing.assert_array_equal(motion.q, np.zeros((3, 3)))


def test_a_small_velocity_is_one():
    """1e-12 m/s, far below others but not below what moves it in the time given."""
    mechanism = body_on_two_feet(0.0)
    motion = rx.simulate(mechanism, rx.State(jnp.zeros(3), jnp.array([0.0, -1e-12, 0.0])), 0.5, ts=[0.5])
    np.testing.assert_allclose(motion.impacts.energy, [0.5e-24], rtol=1e-9)
    np.testing.assert_array_equal(motion.qd, np.zeros((1, 3)))
