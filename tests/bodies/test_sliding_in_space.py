"""Friction of joints whose surfaces slide in several directions: sleeve, ball and plate, against closed forms."""

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

rs = rx.spatial
MU, MASS, WEIGHT, RADIUS = 0.1, 2.0, 30.0, 0.02
DRY = rx.Coulomb(MU)
SMOOTH = rx.RegularisedCoulomb(MU, velocity=1e-5)  # m/s: of the whole friction but for e^-80 above 0.4 mm/s


def sleeve(friction=DRY, weight=WEIGHT, arm=(0.0, 0.0, 0.0), inertia=0.15):
    """A body on a vertical shaft, pulled to the side at an arm above the middle of the sleeve."""
    body = rs.Body("body", MASS, (0.1, 0.1, inertia))
    sizes = {"shaft_radius": RADIUS, "bearing_length": 0.05, "friction": friction}
    joint = rs.Cylindrical("sleeve", body, rx.GROUND, point=(0, 0, 0), axis=(0, 0, 1), **sizes)
    pull = rs.AppliedForce("body", (0.6 * weight, 0.8 * weight, 0.0), on_i=arm)
    return rx.Mechanism([body], [joint], loads=[pull])


def slides(mechanism, angle, travel):
    return rx.assemble(mechanism, rates={"sleeve.angle": angle, "sleeve.travel": travel})


@pytest.mark.parametrize("rates", [(3.0, 0.05), (-3.0, 0.05), (3.0, 0.0), (0.0, -0.05)])
def test_a_sleeve_rubs_against_the_velocity_of_its_surface(rates):
    mechanism = sleeve(arm=(0.0, 0.0, 0.07))
    found = rx.solve(mechanism, slides(mechanism, *rates))
    pressed = WEIGHT * (abs(0.5 + 0.07 / 0.05) + abs(0.5 - 0.07 / 0.05))
    velocity = np.array([RADIUS * rates[0], rates[1]])
    along = velocity / np.linalg.norm(velocity)
    np.testing.assert_allclose(found.friction, -MU * pressed * along * [RADIUS, 1.0], rtol=1e-12)
    np.testing.assert_allclose(found["sleeve.travel''"], -MU * pressed * along[1] / MASS, rtol=1e-12)


@pytest.mark.slow
def test_a_sleeve_slides_and_turns_along_a_line():
    """With the inertia of a thin tube of its radius it keeps its direction."""
    mechanism = sleeve(SMOOTH, inertia=MASS * RADIUS**2)
    slows, speed = MU * WEIGHT / MASS, np.hypot(RADIUS * 3.0, 0.2)
    times = np.array([0.3, 0.6, 0.9]) * speed / slows
    run = rx.simulate(mechanism, slides(mechanism, 3.0, 0.2), times[-1], ts=times, rtol=1e-10)
    way = times - slows * times**2 / 2 / speed
    np.testing.assert_allclose(run["sleeve.angle"], 3.0 * way, rtol=1e-8)
    np.testing.assert_allclose(run["sleeve.travel"], 0.2 * way, rtol=1e-8)


def test_a_sleeve_is_the_same_in_millimetres():
    mechanism, units = sleeve(arm=(0.0, 0.0, 0.07)), rx.units.Units(length=1000.0)
    state = slides(mechanism, 3.0, 0.05)
    found = rx.solve(rx.units.in_units(mechanism, units), rx.units.state_in_units(state, mechanism, units))
    back, known = rx.units.solution_from_units(found, mechanism, units), rx.solve(mechanism, state)
    np.testing.assert_allclose(back.friction, known.friction, rtol=1e-12)
    np.testing.assert_allclose(back.acceleration, known.acceleration, rtol=0, atol=1e-11)


def ball(friction, force=(12.0, -9.0, 20.0)):
    """A balanced ball in its socket, and what presses it."""
    body = rs.Body("ball", MASS, (0.1, 0.1, 0.1))
    socket = rs.Spherical("socket", body, rx.GROUND, point=(0, 0, 0), ball_radius=RADIUS, friction=friction)
    return rx.Mechanism([body], [socket], loads=[rs.AppliedForce("ball", force)])


AXIS = np.array([2.0, 3.0, 6.0]) / 7


@pytest.mark.slow
def test_a_ball_in_its_socket_turns_about_one_axis():
    """By more than half a turn."""
    mechanism, slows = ball(SMOOTH), MU * 25.0 * RADIUS / 0.1
    times = np.array([0.3, 0.6, 0.9]) * 4.0 / slows
    start = rx.State(mechanism.reference, np.append(np.zeros(3), 4.0 * AXIS))
    run = rx.simulate(mechanism, start, times[-1], ts=times, rtol=1e-10)
    np.testing.assert_allclose(run.qd[:, 3:], (4.0 - slows * times)[:, None] * AXIS, rtol=0, atol=1e-8)
    turned = 4.0 * times - slows * times**2 / 2
    assert turned[-1] > np.pi
    truth = np.concatenate([np.cos(turned / 2)[:, None], np.sin(turned / 2)[:, None] * AXIS], axis=1)
    p = run.q[:, 3:] / np.linalg.norm(run.q[:, 3:], axis=1, keepdims=True)
    np.testing.assert_allclose(p, truth, rtol=0, atol=1e-8)


def test_a_ball_that_turned_already_rubs_against_its_angular_velocity():
    """Its axes, those of its socket and the global ones are all others."""
    axes = np.array([[0.6, -0.8, 0.0], [0.48, 0.36, -0.8], [0.64, 0.48, 0.6]])
    body = rs.Body("ball", MASS, (0.1, 0.1, 0.1), orientation=axes)
    on_i, on_j = rs.Placement((0, 0, 0), (0, 0.6, 0.8)), rs.Placement((0, 0, 0), (0.8, 0, 0.6))
    socket = rs.Spherical(
        "socket", "ball", rx.GROUND, on_i=on_i, on_j=on_j, ball_radius=RADIUS, friction=rx.Coulomb(MU)
    )
    push = rs.AppliedForce("ball", (12.0, -9.0, 20.0))
    mechanism = rx.Mechanism([body], [socket], loads=[push])
    found = rx.solve(mechanism, rx.State(mechanism.reference, np.append(np.zeros(3), 4.0 * AXIS)))
    np.testing.assert_allclose(found.acceleration[3:], -MU * 25.0 * RADIUS / 0.1 * AXIS, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(found.friction), MU * 25.0 * RADIUS, rtol=1e-12)


def plate(friction, arm=0.0, weight=WEIGHT, push=(0.0, 0.0, 0.0)):
    """A plate with its weight at an arm above the table, of equal inertia about all axes, and a push and M / R."""
    body = rs.Body("plate", MASS, (0.1, 0.1, 0.1))
    sizes = {"plate_length": 0.3, "spin_radius": 0.1, "friction": friction}
    table = rs.Planar("table", body, rx.GROUND, point=(0, 0, 0), axis=(0, 0, 1), **sizes)
    pushed = rs.AppliedForce("plate", (push[0], push[1], 0.0), moment=(0.0, 0.0, 0.1 * push[2]))
    load = rs.AppliedForce("plate", (0.0, 0.0, -weight), on_i=(arm, 0.0, 0.0))
    return rx.Mechanism([body], [table], loads=[load, pushed])


def launched(mechanism, x, y, spin):
    rates = {"table.travel_1": x, "table.travel_2": y, "table.angle": spin}
    return rx.assemble(mechanism, rates=rates)


@pytest.mark.parametrize(("arm", "pressed"), [(0.1, WEIGHT), (0.2, WEIGHT * 4 / 3)])
@pytest.mark.slow
def test_a_plate_slides_and_spins(arm, pressed):
    """A weight beyond a side of the plate presses the other side from below."""
    mechanism = plate(rx.Coulomb(MU), arm)
    found = rx.solve(mechanism, launched(mechanism, 0.3, -0.4, 12.0))
    along = np.array([0.3, -0.4, 1.2]) / 1.3
    np.testing.assert_allclose(found.friction, -MU * pressed * along * [1.0, 1.0, 0.1], rtol=1e-12)


MODELS = {
    "Stribeck": (rx.Stribeck(0.3, 0.1, 0.4, viscous=3.0), (0.1 + 0.2 * np.exp(-((0.5 / 0.4) ** 2))) * WEIGHT + 1.5),
    "regularised": (rx.RegularisedCoulomb(MU, 0.3, preload=4.0), MU * (WEIGHT + 4.0) * np.tanh(0.5 / 0.3)),
    "constant": (rx.ConstantFriction(5.0), 5.0),
}


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.slow
def test_models_are_of_the_speed_and_against_the_velocity(name):
    model, size = MODELS[name]
    mechanism = plate(model)
    found = rx.solve(mechanism, launched(mechanism, 0.3, -0.4, 0.0))
    np.testing.assert_allclose(found.friction, size * np.array([-0.6, 0.8, 0.0]), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("make", [sleeve, ball, plate])
@pytest.mark.parametrize("model", [rx.Coulomb(MU), rx.LuGre(0.3, 0.1, 0.2, 300.0, damping=0.5)])
@pytest.mark.slow
def test_no_change_of_friction_exceeds_its_bound(make, model):
    """And a change along the loads reaches it."""
    mechanism, random = make(model), np.random.default_rng(3)
    (group,), state = mechanism.friction, rx.State(mechanism.reference, np.zeros(6))
    rate, sense = jnp.asarray(random.standard_normal(len(group.slips))), jnp.ones(len(group.slips))
    memory = None if model.has_sense else jnp.asarray(1e-3 * random.standard_normal((1, len(rate))))
    for loads, change in jnp.asarray(random.standard_normal((20, 2, *group.rows.shape))):
        at, beside = (group.force(x, rate, sense, memory, state) for x in (loads, loads + change))
        bound = np.asarray(group.largest_change(change, rate, memory, state))
        assert np.all(np.abs(beside - at) <= bound * (1 + 1e-12))
        twice = group.force(2 * loads, rate, sense, memory, state)
        np.testing.assert_allclose(np.abs(twice - at), group.largest_change(loads, rate, memory, state), rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("model", [rx.Dahl(MU, 300.0), rx.LuGre(0.3, 0.1, 0.2, 300.0, damping=0.5)])
def test_bristles_bend_in_any_direction(model):
    """A plate goes in one direction as in another, and as a block on a guide goes in one."""
    mechanism = plate(model)
    times = np.array([0.1, 0.3, 0.6])
    runs = [
        rx.simulate(mechanism, launched(mechanism, 0.5 * x, 0.5 * y, 0.0), 0.6, ts=times, rtol=1e-9)
        for x, y in ((1.0, 0.0), (0.6, -0.8))
    ]
    first, second = (np.stack([run["table.travel_1"], run["table.travel_2"]]) for run in runs)
    np.testing.assert_allclose(second, first[0] * np.array([[0.6], [-0.8]]), rtol=0, atol=1e-8)
    body = rs.Body("block", MASS, (0.1, 0.1, 0.1))
    guide = rs.Prismatic(
        "guide", body, rx.GROUND, (0, 0, 0), (1, 0, 0), guide_length=0.3, twist_radius=0.1, friction=model
    )
    block = rx.Mechanism([body], [guide], gravity=(0, 0, -WEIGHT / MASS))
    alone = rx.simulate(block, rx.assemble(block, rates={"guide.travel": 0.5}), 0.6, ts=times, rtol=1e-9)
    np.testing.assert_allclose(first[0], alone["guide.travel"], rtol=0, atol=1e-8)


ROUNDED = (1 - 1e-6, 1 + 1e-6)


def holds(mechanism, share):
    """Whether it sticks where loads are a share of what can be held, proved, with the margin of that share."""
    found = rx.sticking(mechanism, rx.assemble(mechanism))
    assert (found.verdict, found.proved) == ("must stick" if share < 1 else "must slip", True)
    np.testing.assert_allclose(found.margin, 1 / share - 1, rtol=0, atol=1e-9)
    return found


@pytest.mark.parametrize("share", ROUNDED)
@pytest.mark.slow
def test_a_plate_holds_a_ball_of_force_and_moment(share):
    """|(F_1, F_2, M / R)| up to mu N, wherever it points."""
    push = share * MU * WEIGHT * np.array([2.0, -3.0, 6.0]) / 7
    found = holds(plate(rx.Coulomb(MU), push=push), share)
    np.testing.assert_allclose(found.friction[0], -push * [1, 1, 0.1] / max(share, 1.0), rtol=1e-5)


@pytest.mark.parametrize("share", [1 - 1e-6, 1 + 1e-3])
@pytest.mark.slow
def test_two_plates_hold_a_moment_by_force_and_spin(share):
    """Each has half of the weight and slides at an arm and spins: mu N / 2 times |(arm, R)|."""
    arm, radius = 0.4, 0.1
    body = rs.Body("plate", MASS, (0.1, 0.1, 0.1))
    sizes = {"axis": (0, 0, 1), "plate_length": 0.3, "spin_radius": radius, "friction": rx.Coulomb(MU)}
    tables = [
        rs.Planar(name, body, rx.GROUND, point=(x, 0, 0), **sizes) for name, x in (("left", -arm), ("right", arm))
    ]
    most = MU * WEIGHT * np.hypot(arm, radius)
    load = rs.AppliedForce("plate", (0, 0, -WEIGHT), moment=(0, 0, share * most))
    holds(rx.Mechanism([body], tables, loads=[load]), share)


@pytest.mark.parametrize("share", ROUNDED)
@pytest.mark.slow
def test_a_sleeve_on_a_thread_slips_along_it_alone(share):
    """One freedom: of friction what is along the thread counts, mu N |(R, pitch / 2 pi)| against the moment."""
    lead, body = 0.03, rs.Body("body", MASS, (0.1, 0.1, 0.15))
    on = {"point": (0, 0, 0), "axis": (0, 0, 1)}
    sizes = {"shaft_radius": RADIUS, "bearing_length": 0.05, "friction": rx.Coulomb(MU)}
    joints = [
        rs.Cylindrical("sleeve", body, rx.GROUND, **on, **sizes),
        rs.Screw("thread", body, rx.GROUND, **on, pitch=2 * np.pi * lead),
    ]
    most = MU * WEIGHT / 2 * np.hypot(RADIUS, lead)  # the thread takes half of the pull
    pull = rs.AppliedForce("body", (0.6 * WEIGHT, 0.8 * WEIGHT, 0.0), moment=(0, 0, share * most))
    holds(rx.Mechanism([body], joints, loads=[pull]), share)


def test_slip_that_sets_out_in_a_given_direction():
    mechanism = sleeve()
    found = rx.solve(mechanism, rx.assemble(mechanism), sense={"sleeve.angle": 1.5, "sleeve.travel": -2.0})
    np.testing.assert_allclose(found.friction, MU * WEIGHT * np.array([-0.6 * RADIUS, 0.8]), rtol=1e-12)


def test_where_it_rests_friction_is_not_known():
    mechanism = sleeve()
    assert rx.solve(mechanism, rx.assemble(mechanism), throw=False).result == rx.RESULTS.friction_at_rest


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (rs.Cylindrical, "`shaft_radius`"),
        (rs.Spherical, "`ball_radius`"),
        (rs.Planar, "`spin_radius`"),
    ],
)
def test_sizes_that_friction_needs(kind, words):
    with pytest.raises(rx.RedundaxError, match=words):
        kind("J", "a", rx.GROUND, on_i=rs.Placement((0, 0, 0)), on_j=rs.Placement((0, 0, 0)), friction=rx.Coulomb(MU))


def test_a_print_shows_the_law_of_a_joint_once():
    assert str(sleeve()).count("Coulomb: mu 0.1") == 1
