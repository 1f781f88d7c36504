"""More contacts than parts need: stops that are struck at once, feet between bodies on curved paths, and guides that
contacts hold at rest while another part of the machine moves."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import redundax as rx

G, UP, ORIGIN = 9.81, (0.0, 1.0), (0.0, 0.0)


@pytest.mark.parametrize("places", [pytest.param((-0.2, 0.2, 0.1), marks=pytest.mark.slow), (-0.15, 0.2)])
def test_a_ram_on_a_platform_that_sinks_rebounds_from_stops_that_it_strikes_at_once(places):
    """The platform is open from there on: its scales are not those of the rows that hold in the impact."""
    restitution, drop, force = 0.3, 0.1, 20.0
    upright = {"normal": (1.0, 0.0)}
    joints = [
        rx.Translational("G", "ram", "ground", ORIGIN, ORIGIN, **upright),
        rx.Translational("H", "low", "ground", ORIGIN, ORIGIN, **upright),
        rx.PinInSlot("lies", "ram", "low", ORIGIN, ORIGIN, UP, one_sided=True),
        *(rx.PinInSlot(f"stop {x}", "ram", "ground", (x, 0.0), (x, -drop), UP, one_sided=True) for x in places),
    ]
    bodies = [rx.Body("ram", 2.0, 1.0), rx.Body("low", 1.0, 1.0)]
    pushed = [rx.AppliedForce("low", force=(0.0, force))]
    mechanism = rx.Mechanism(bodies, joints, loads=pushed, gravity=(0.0, -G))
    falls = G - force / 3.0
    strikes = np.sqrt(2 * drop / falls)
    ts = np.array([strikes + 0.03])
    motion = rx.simulate(mechanism, rx.assemble(mechanism, {}), ts[0], restitution=restitution, ts=ts)
    np.testing.assert_allclose(motion.impacts.t, [strikes], rtol=0, atol=1e-12)
    np.testing.assert_allclose(motion.impacts.energy, [(1 - restitution**2) * (falls * strikes) ** 2], rtol=1e-9)
    np.testing.assert_allclose(motion["ram.y'"], [restitution * falls * strikes - G * 0.03], rtol=1e-9)
    np.testing.assert_allclose(motion["low.y'"], [-falls * strikes - (G - force) * 0.03], rtol=1e-9)


LONG, SHORT, HIGH, LOW = 1.0, 0.6, 2.0, 3.0  # m, kg
TURNED, LEANT = 0.5, -0.4  # rad


def on_arms():
    """A block on parallel rods that lies on three feet of a platform on shorter ones."""
    rods = [("a", "high", 0.2, LONG, TURNED, 0.0), ("b", "low", -0.1, SHORT, LEANT, 0.1)]
    joints = [
        rx.DistanceDriver(
            f"{name}{k}",
            body,
            "ground",
            (x, y),
            (x + shift - length * np.sin(turn), y - 2 * shift + length * np.cos(turn)),
            length,
        )
        for name, body, y, length, turn, shift in rods
        for k, x in enumerate((-0.4, 0.4))
    ]
    feet = {f"f{k}": x for k, x in enumerate((-0.3, 0.1, 0.35))}
    joints += [rx.PinInSlot(name, "high", "low", (x, -0.1), (0.0, 0.1), UP, one_sided=True) for name, x in feet.items()]
    return rx.Mechanism([rx.Body("high", HIGH, 0.5), rx.Body("low", LOW, 0.8)], joints, gravity=(0.0, -G))


@pytest.mark.slow
def test_redundant_feet_of_a_block_on_arms_carry_as_both_swing():
    mechanism = on_arms()
    start = rx.assemble(mechanism, {"low.x": 0.1, "low.y": -0.2}, rates={"high.x": 0.8})
    ts = np.linspace(0.0, 0.3, 7)
    motion = rx.simulate(mechanism, start, ts[-1], ts=ts, rtol=1e-10)

    def lean(turn):
        """That of the short rods, by the height that both have."""
        return -jnp.arccos((SHORT * jnp.cos(LEANT) + LONG * (jnp.cos(turn) - jnp.cos(TURNED))) / SHORT)

    def inertia(turn):
        return HIGH * LONG**2 + LOW * (SHORT * jax.grad(lean)(turn)) ** 2

    slope, pull = jax.jit(jax.grad(inertia)), (HIGH + LOW) * G * LONG
    turns = lambda t, y: [y[1], -(slope(y[0]) * y[1] ** 2 / 2 + pull * np.sin(y[0])) / inertia(y[0])]  # noqa: E731
    begin = [TURNED, 0.8 / (LONG * np.cos(TURNED))]
    turn, rate = solve_ivp(turns, (0.0, ts[-1]), begin, "DOP853", ts, rtol=1e-12, atol=1e-13).y
    np.testing.assert_allclose(motion["high.x"], LONG * (np.sin(turn) - np.sin(TURNED)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion["high.y'"], LONG * np.sin(turn) * rate, rtol=0, atol=1e-8)
    gains = np.array([turns(0.0, y)[1] for y in zip(turn, rate, strict=True)])
    across = HIGH * (LONG * gains / np.sin(turn) + G)  # feet push upwards alone, rods along themselves
    np.testing.assert_allclose(sum(motion[f"f{k}.perpendicular"] for k in range(3)), across, rtol=1e-7)
    does = {words for each in motion.contacts.values() for words in each}
    assert does <= {"carries", "touches"} and motion.stats.energy_error < 1e-9


PLACES, STOPS, HEAVY = (-0.25, 0.25), (-0.15, 0.15), 30.0  # m, kg


def beside_a_wheel(turns):
    """A ram that stands in two guides that rub, on two stops, and a wheel beside it or none; with a closure."""
    rubs = {"friction": rx.Coulomb(0.12), "guide_length": 0.12, "twist_radius": 0.03}
    ram = rx.spatial.Body("ram", HEAVY, inertia=(1.0, 1.0, 1.0), centre=(0.04, 0.0, 0.0))
    wheel = rx.spatial.Body("wheel", 3.0, inertia=(0.02, 0.02, 0.02), centre=(0.02, 0.0, 0.0))
    across = wheel, "ground", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    joints = [
        *(rx.spatial.Prismatic(f"G{x}", ram, "ground", (x, 0, 0), (0, 0, 1), **rubs) for x in PLACES),
        *(rx.spatial.PointOnPlane(f"s{x}", ram, "ground", (x, 0, -0.1), (0, 0, 1), one_sided=True) for x in STOPS),
    ]
    wheels = [rx.spatial.Revolute("A", *across), rx.spatial.AngleDriver("D", *across, angle=lambda t: 1.0 * t)]
    bodies, rates = ([ram, wheel], {"A.angle": 1.0}) if turns else ([ram], {})
    machine = rx.Mechanism(bodies, joints + wheels * turns, gravity=(0.0, 0.0, -G))
    stiff = {f"G{x}": (2e-8, 1e-6) for x in PLACES} | {f"s{x}": 1e-8 for x in STOPS}
    return machine, rx.assemble(machine, rates=rates), rx.ElasticJoints(machine, stiff)


@pytest.mark.slow
def test_guides_that_stops_hold_have_any_friction_while_a_wheel_beside_them_turns():
    """Which friction they have at rest must not depend on the rounding of velocities and accelerations of none."""
    asked = [*(f"s{x}.axial" for x in STOPS), "tau G-0.25"]
    alone, beside = (rx.band(m, state, asked, closure) for m, state, closure in map(beside_a_wheel, (False, True)))
    np.testing.assert_allclose(beside.lower, alone.lower, rtol=1e-9)
    np.testing.assert_allclose(beside.upper, alone.upper, rtol=1e-9)
    assert (beside.upper > beside.lower + 1.0).all()


@pytest.mark.slow
def test_guides_that_stops_hold_have_the_least_friction_in_a_motion_of_a_wheel_beside_them():
    """Slips that contacts forbid are not begun by what rounding leaves of the accelerations of weights."""
    machine, state, closure = beside_a_wheel(turns=True)
    motion = rx.simulate(machine, state, 0.5, closure=closure, ts=[0.0, 0.25, 0.5])
    np.testing.assert_array_equal([motion[f"tau G{x}"] for x in PLACES], 0.0)
    np.testing.assert_allclose(sum(motion[f"s{x}.axial"] for x in STOPS), HEAVY * G, rtol=1e-12)


@pytest.mark.parametrize(
    "feet, mu, height, force, moment",
    [
        ((-0.4, -0.25, -0.2), (0.35, 0.49, 0.21), 0.27, (24.0, 2.0), 0.4),  # its weight is beyond all feet
        ((-0.1, 0.01, 0.07), (0.37, 0.55, 0.57), 0.34, (0.9, 4.8), -1.6),  # friction tips it
    ],
)
def test_a_body_that_slides_on_three_feet_tips_over_the_first(feet, mu, height, force, moment):
    """Over a foot at r = (x, -h) with N: I a = moment + (x - mu h) N, (force_y + N)/m - g + x a = 0."""
    law = {"normal": (0.0, 1.0), "one_sided": True}
    joints = [
        rx.PinInSlot(f"f{k}", "body", "ground", (x, -height), (x, 0.0), friction=rx.Coulomb(own), **law)
        for k, (x, own) in enumerate(zip(feet, mu, strict=True))
    ]
    m, inertia = 3.0, 0.2
    loads = [rx.AppliedForce("body", force, moment=moment)]
    mechanism = rx.Mechanism([rx.Body("body", m, inertia)], joints, loads=loads, gravity=(0.0, -9.81))
    state = rx.State(jnp.array([0.0, height, 0.0]), jnp.array([1.0, 0.0, 0.0]))
    x, friction = feet[2], mu[2]
    arm = (x - friction * height) / inertia
    N = (9.81 - force[1] / m - x * moment / inertia) / (1 / m + x * arm)
    turn = moment / inertia + arm * N
    expected = [(force[0] - friction * N) / m, -x * turn, turn]
    assert N > 0 and all((x - other) * turn < 0 for other in feet[:2])  # the others lift
    for solved in (rx.solve, jax.jit(rx.solve)):
        found = solved(mechanism, state)
        np.testing.assert_allclose(found.multipliers, [0.0, 0.0, N], rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(found.acceleration, expected, rtol=1e-10)
    assert rx.solve(mechanism, state).contacts == {"f0": "lifts", "f1": "lifts", "f2": "carries"}
