"""Feet in space that rub on a floor and only push: they slide, tip or spin as closed forms say."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

MU, WEIGHT, HEIGHT = 0.4, 98.1, 0.5
CORNERS = {"f0": (0.5, 0.4), "f1": (-0.5, 0.4), "f2": (-0.5, -0.4), "f3": (0.5, -0.4)}
TRIPOD = {"f0": (0.5, 0.0), "f1": (-0.4, 0.4), "f2": (-0.3, -0.5)}


def table(corners, friction=None, push=()):
    top = rx.spatial.Body("top", 10.0, inertia=(1.0, 1.2, 1.5), centre=(0.0, 0.0, HEIGHT))
    feet = [
        rx.spatial.PointOnPlane(
            name, top, "ground", (*at, 0.0), (0, 0, 1), friction=friction or rx.Coulomb(MU), one_sided=True
        )
        for name, at in corners.items()
    ]
    loads = [rx.spatial.AppliedForce(top, push, point=(0.0, 0.0, HEIGHT + 1.0))] if push else []
    return rx.Mechanism([top], feet, gravity=(0.0, 0.0, -9.81), loads=loads)


@pytest.mark.parametrize(
    ("load", "amount"),
    [
        pytest.param(
            {"top.x": 0.6, "top.y": 0.8}, MU * WEIGHT, marks=pytest.mark.slow
        ),  # it slides before it tips, at 98.1 N
        ({"top.x": 1.0, "top.phi_y": 1.0}, WEIGHT * 0.5 / (HEIGHT + 1.0)),  # it tips about two feet, pushed 1 m higher
        # It spins: all feet are as far from the middle.
        pytest.param({"top.phi_z": 1.0}, MU * WEIGHT * np.hypot(0.5, 0.4), marks=pytest.mark.slow),
    ],
    ids=["slides", "tips", "spins"],
)
def test_how_hard_a_table_on_rough_feet_may_be_pushed(load, amount):
    mechanism = table(CORNERS)
    limits = rx.limit_load(mechanism, rx.assemble(mechanism), load)
    np.testing.assert_allclose([limits.lower, limits.upper], [-amount, amount], rtol=1e-6)


def test_a_tripod_slides_as_its_equations_say():
    """Its loads are unique: six accelerations and three loads from nine linear equations, written out by vectors."""
    mechanism, velocity, spin = table(TRIPOD), np.array([0.3, -0.2]), 0.7
    rates = {"top.x": velocity[0], "top.y": velocity[1], "top.phi_z": spin}
    solution = rx.solve(mechanism, rx.assemble(mechanism, rates=rates))
    system, right = np.zeros((9, 9)), np.zeros(9)
    system[:6, :6] = np.diag([10.0, 10.0, 10.0, 1.0, 1.2, 1.5])
    right[2] = -WEIGHT
    for k, at in enumerate(TRIPOD.values()):
        arm = np.array([*at, -HEIGHT])
        slip = velocity + spin * np.array([-arm[1], arm[0]])
        force = np.array([*(-MU * slip / np.linalg.norm(slip)), 1.0])
        system[:6, 6 + k] = -np.concatenate([force, np.cross(arm, force)])
        system[6 + k, :6] = np.concatenate([[0, 0, 1], np.cross(arm, [0, 0, 1])])  # no foot leaves the floor or dives
    found = np.linalg.solve(system, right)
    np.testing.assert_allclose(solution.acceleration, found[:6], atol=1e-9)
    np.testing.assert_allclose([solution[f"{name} force z on top"] for name in TRIPOD], found[6:], rtol=1e-10)
    assert set(solution.contacts.values()) == {"carries"} and np.all(found[6:] > 0)


def test_a_foot_that_is_pulled_up_rubs_no_more():
    """Pushed 1 m above its middle by twice what it takes, the table tips about two feet, and only those rub."""
    mechanism = table(CORNERS, push=(65.4, 0.0, 0.0))
    solution = rx.solve(mechanism, rx.assemble(mechanism, rates={"top.x": 0.2}))
    assert solution.contacts == {"f0": "carries", "f1": "lifts", "f2": "lifts", "f3": "carries"}
    friction = np.array([solution[f"tau {name}.travel_1"] for name in CORNERS])
    normal = np.array([solution[f"{name} force z on top"] for name in CORNERS])
    np.testing.assert_allclose(friction, -MU * normal, atol=1e-9)
    # About the middle: I phi'' = F 1 m - N 0.5 m + mu N 0.5 m, and the two feet stay down: z'' = 0.5 m phi''.
    turn = (65.4 - WEIGHT * (0.5 - MU * HEIGHT)) / (1.2 + 10.0 * 0.5 * (0.5 - MU * HEIGHT))
    np.testing.assert_allclose(solution["top.phi_y''"], turn, rtol=1e-10)
    np.testing.assert_allclose(normal.sum(), WEIGHT + 10.0 * 0.5 * turn, rtol=1e-10)


@pytest.mark.slow
def test_coefficients_have_derivatives():
    def braked(mu):
        mechanism = table(TRIPOD, rx.Coulomb(mu))
        return rx.solve(mechanism, state)["top.x''"]

    state = rx.assemble(table(TRIPOD), rates={"top.x": 1.0})
    np.testing.assert_allclose(jax.grad(braked)(jnp.asarray(MU)), -9.81, rtol=1e-9)
