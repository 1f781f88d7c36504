"""Feet in space that rub on a floor and only push: they slide, tip or spin as closed forms say."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import redundax as rx

MU, WEIGHT, HEIGHT = 0.4, 98.1, 0.5
CORNERS = {"f0": (0.5, 0.4), "f1": (-0.5, 0.4), "f2": (-0.5, -0.4), "f3": (0.5, -0.4)}
TRIPOD = {"f0": (0.5, 0.0), "f1": (-0.4, 0.4), "f2": (-0.3, -0.5)}


def table(corners, friction=None, push=(), law=()):
    top = rx.spatial.Body("top", 10.0, inertia=(1.0, 1.2, 1.5), centre=(0.0, 0.0, HEIGHT))
    feet = [
        rx.spatial.PointOnPlane(
            name, top, "ground", (*at, 0.0), (0, 0, 1), friction=friction or rx.Coulomb(MU), one_sided=True
        )
        for name, at in corners.items()
    ]
    loads = [rx.spatial.AppliedForce(top, push, point=(0.0, 0.0, HEIGHT + 1.0))] if push else []
    loads += [rx.spatial.LoadFunction("top", pushes, parameters=jnp.array(law))] if law else []
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


def pushes(i, j, t, p):
    """p_0 N along (p_1, p_2) at the height p_3, and p_4 N m about the vertical, in half a sine from 0.1 to 1.1 s."""
    force = p[0] * jnp.sin(jnp.pi * jnp.clip(t - 0.1, 0.0, 1.0))
    x, y, rise = force * p[1], force * p[2], 0.0 * t
    return rx.spatial.Wrench(
        jnp.stack([x, y, rise]), jnp.stack([-p[3] * y, p[3] * x, force * p[4]])
    ), rx.spatial.Wrench(jnp.zeros(3), jnp.zeros(3))


def pushed(mu, *law, start=0.0):
    """A table at rest on four feet that a load of time pushes; all calls share its programs."""
    mechanism = table(CORNERS, rx.Coulomb(jnp.asarray(mu)), law=law)
    return rx.simulate(mechanism, rx.assemble(mechanism, t=start), 2.0, max_phases=100)


@pytest.mark.slow
def test_a_pushed_table_sticks_slides_and_sticks_again():
    """It is let go at mu m g, and stops where its momentum is spent: m v = the impulse beyond that."""
    motion = pushed(MU, 60.0, 0.6, 0.8, HEIGHT, 0.0)
    goes = 0.1 + np.arcsin(MU * WEIGHT / 60.0) / np.pi
    impulse = lambda t: 60.0 / np.pi * (np.cos(np.pi * (goes - 0.1)) - np.cos(np.pi * min(t - 0.1, 1.0)))  # noqa: E731
    speed = lambda t: (impulse(t) - MU * WEIGHT * (t - goes)) / 10.0  # noqa: E731
    stops = brentq(speed, 0.9, 1.9, xtol=1e-15)
    times, way = np.asarray(motion.t), quad(speed, goes, stops, points=[1.1], epsabs=1e-13)[0]
    slides = (times > goes) & (times < stops)
    truth = np.array([speed(t) for t in times]) * slides
    np.testing.assert_allclose(motion.qd[:, :2], np.outer(truth, [0.6, 0.8]), rtol=0, atol=1e-8)
    np.testing.assert_allclose(motion.q[-1, :2], way * np.array([0.6, 0.8]), rtol=0, atol=1e-9)
    np.testing.assert_array_equal(motion.sense[~slides], 0.0)
    np.testing.assert_allclose(motion.sense[slides], np.tile([0.6, 0.8], (slides.sum(), 4)), atol=1e-9)
    assert all(set(words) == {"carries"} for words in motion.contacts.values())
    assert motion.stats.phases == 3 and motion.stats.energy_error < 1e-12


@pytest.mark.slow
def test_a_table_that_nothing_holds_is_let_go_at_the_start():
    motion = pushed(MU, 60.0, 0.6, 0.8, HEIGHT, 0.0, start=0.5)
    times = np.asarray(motion.t)[:20]
    speed = 6.0 / np.pi * (np.cos(np.pi * 0.4) - np.cos(np.pi * (times - 0.1))) - MU * 9.81 * (times - 0.5)
    np.testing.assert_allclose(motion.qd[:20, :2], np.outer(speed, [0.6, 0.8]), rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion.sense[:20], np.tile([0.6, 0.8], (20, 4)), atol=1e-9)
    np.testing.assert_array_equal(motion.q[0], rx.assemble(table(CORNERS)).q)
    assert {words[0] for words in motion.contacts.values()} == {"carries"}


@pytest.mark.slow
def test_a_pushed_table_tips_about_two_feet_that_stick_and_rocks_to_rest():
    """About those feet (I + m b^2) phi'' = M, with the load at the floor of the table and its moment."""
    motion = pushed(0.8, 42.0, 1.0, 0.0, 1.5, 0.0)
    half, inertia = 0.5, 1.2 + 10.0 * (0.5**2 + HEIGHT**2)

    def slope(t, y):
        force, (c, s) = 42.0 * np.sin(np.pi * np.clip(t - 0.1, 0.0, 1.0)), (np.cos(y[0]), np.sin(y[0]))
        return [y[1], (force * (half * s + 1.5) - WEIGHT * (half * c - HEIGHT * s)) / inertia]

    def lands(t, y):
        return y[0]

    lands.terminal, lands.direction = True, -1
    lifts = 0.1 + np.arcsin(WEIGHT * half / 1.5 / 42.0) / np.pi
    run = solve_ivp(
        slope, (lifts, 2.0), [0, 0], events=lands, method="DOP853", rtol=1e-13, atol=1e-14, dense_output=True
    )
    times = np.asarray(motion.t)
    flies = (times > lifts) & (times < run.t[-1])
    np.testing.assert_allclose(2 * np.arcsin(motion.q[flies, 5]), run.sol(times[flies])[0], rtol=0, atol=1e-7)
    assert float(motion.impacts.t[0]) == pytest.approx(run.t[-1], abs=1e-6)
    # The feet that land take it: what they stick at turns on with its moment of momentum about them.
    rate, back = run.y[1, -1], (1.2 + 10.0 * (HEIGHT**2 - half**2)) / inertia
    assert float(motion.impacts.energy[0]) == pytest.approx(inertia * rate**2 * (1 - back**2) / 2, rel=1e-6)
    for foot, word in (("f0", "carries"), ("f1", "open"), ("f2", "open"), ("f3", "carries")):
        assert set(motion.contacts[foot][flies]) == {word} and motion.contacts[foot][-1] == "carries"
    np.testing.assert_array_equal(motion.sense[times < lifts], 0.0)
    np.testing.assert_array_equal(motion.sense[-1], 0.0)
    np.testing.assert_allclose(motion.qd[-1], 0.0, atol=1e-6)
