"""Velocities that `assemble` finds beside closed contacts: which of these they open, by hand."""

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx


def hammer():
    arm = rx.Revolute("A", "hammer", "ground", (0.0, 0.4), (0.0, 0.0))
    stop = rx.Stop("anvil", "A.angle", least=0.0)
    return rx.Mechanism([rx.Body("hammer", 1.5, 0.1)], [arm], couplers=[stop], gravity=(0.0, -9.81))


def test_a_rate_leaves_a_stop_and_none_goes_through_it():
    mechanism, on_it = hammer(), {"positions": {"A.angle": 0.0}}
    for more in ({}, {"closed": "anvil"}):
        state = rx.assemble(mechanism, {}, rates={"A.angle": 2.0}, **on_it, **more)
        np.testing.assert_allclose(state.qd, [0.8, 0.0, 2.0], atol=1e-14)
        assert rx.solve(mechanism, state).contacts == {"anvil": "open"}
    np.testing.assert_allclose(rx.assemble(mechanism, {}, rates={"A.angle": 0.0}, **on_it).qd, 0.0, atol=1e-14)
    with pytest.raises(rx.NoSolutionError, match=r"anvil\.least and A\.angle as given cannot both be met"):
        rx.assemble(mechanism, {}, rates={"A.angle": -1.0}, **on_it)


def test_a_velocity_of_the_mechanism_is_what_it_is_guessed_and_one_into_a_stop_is_taken_out():
    mechanism = hammer()
    for rate, expected in ((1.0, [0.4, 0.0, 1.0]), (-1.0, [0.0, 0.0, 0.0])):
        state = rx.assemble(mechanism, [0.0, -0.4, 0.0], [0.4 * rate, 0.0, rate])
        np.testing.assert_allclose(state.qd, expected, atol=1e-14)


def test_a_follower_stays_on_its_cam():
    """Which a nearer velocity would leave: y = -x / 2 below it, and x is driven."""
    cam = rx.System(lambda q, t, p: jnp.stack([-q[1] - q[0] / 2]), mass=jnp.ones(2), rows="force", m=1, one_sided=[0])
    for rate in (1.0, -1.0):
        state = rx.assemble(cam, jnp.zeros(2), rates={"0": rate})
        np.testing.assert_allclose(state.qd, [rate, -rate / 2], atol=1e-14)


def test_a_block_in_a_corner_is_driven_up_its_slope():
    """Of the floor, y >= 0, and the slope, y >= x, x' = 1 leaves the floor alone, which without them it does not."""
    corner = rx.System(
        lambda q, t, p: jnp.stack([-q[1], q[0] - q[1]]), mass=jnp.ones(2), rows="force", m=2, one_sided=[0, 1]
    )
    for rate, expected in ((1.0, [1.0, 1.0]), (-1.0, [-1.0, 0.0])):
        state = rx.assemble(corner, jnp.zeros(2), rates={"0": rate})
        np.testing.assert_allclose(state.qd, expected, atol=1e-14)


@pytest.mark.parametrize("sparse", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_table_turns_about_two_of_its_feet(sparse):
    top = rx.spatial.Body("table", 10.0, inertia=(1.0, 1.0, 1.5), centre=(0.0, 0.0, 0.7))
    corners = {"f1": (-0.4, -0.3), "f2": (0.4, -0.3), "f3": (0.4, 0.3), "f4": (-0.4, 0.3)}
    feet = [
        rx.spatial.PointOnPlane(name, top, "ground", (x, y, 0.0), (0.0, 0.0, 1.0), one_sided=True)
        for name, (x, y) in corners.items()
    ]
    mechanism = rx.Mechanism([top], feet, gravity=(0.0, 0.0, -9.81)).sparse(sparse)
    state = rx.assemble(mechanism, rates={"table.phi_y": 1.0})
    np.testing.assert_allclose(state.qd[:6], [0.0, 0.0, 0.4, 0.0, 1.0, 0.0], atol=1e-12)
    with pytest.raises(rx.NoSolutionError, match=r"table\.z as given"):
        rx.assemble(mechanism, rates={"table.z": -1.0})


def test_a_wheel_rolls_while_it_is_not_taken_off():
    tyre = rx.Wheel("tyre", "disc", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), 0.3, one_sided=True)
    mechanism = rx.Mechanism([rx.Body("disc", 1.0, 0.1)], [tyre], gravity=(0.0, -9.81))
    for rates, expected in (({}, [-0.6, 0.0, 2.0]), ({"disc.y": 1.0}, [0.0, 1.0, 2.0])):
        state = rx.assemble(mechanism, {"disc.y": 0.3}, rates={"disc.phi": 2.0, **rates})
        np.testing.assert_allclose(state.qd, expected, atol=1e-14)
