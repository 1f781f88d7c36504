"""Motions of joints that slide dryly in several directions: to rest, past it, and out of it, against closed forms and
an integration of their own."""

from functools import partial

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq
from truth.sliding import Slider, let_go, slide

import redundax as rx

rs = rx.spatial
pytestmark = pytest.mark.slow
MU, MASS, WEIGHT, RADIUS, SPIN, SPUN = 0.1, 2.0, 30.0, 0.02, 0.1, 0.1
LIMIT = MU * WEIGHT


def loads(i, j, t, p):
    """A force that grows and springs to the start, and a moment."""
    force = p["force"] + p["growth"] * t - p["stiffness"] * i.pose.r
    return rs.Wrench(force, p["moment"]), rs.Wrench(jnp.zeros(3), jnp.zeros(3))


def given(**loads):
    """Parameters of the loads, zero but for those given."""
    return {
        name: jnp.array(loads.get(name, jnp.zeros(3)), float) for name in ("force", "growth", "stiffness", "moment")
    }


def sleeve(inertia, **pushed):
    """A body on a vertical shaft, pulled to the side."""
    body = rs.Body("body", MASS, (0.1, 0.1, inertia))
    sizes = {"shaft_radius": RADIUS, "bearing_length": 0.05, "friction": rx.Coulomb(MU)}
    joint = rs.Cylindrical("joint", body, rx.GROUND, point=(0, 0, 0), axis=(0, 0, 1), **sizes)
    push = given(force=(0.6 * WEIGHT, 0.8 * WEIGHT, 0.0), **pushed)
    return rx.Mechanism([body], [joint], loads=[rs.LoadFunction("body", loads, parameters=push)])


def plate(force=(0.0, 0.0), mu=MU, load=None, **pushed):
    """A plate on a horizontal table, of equal inertia about all axes; with a load of its own, if given."""
    body = rs.Body("plate", MASS, (SPUN, SPUN, SPUN))
    sizes = {"plate_length": 0.3, "spin_radius": SPIN, "friction": rx.Coulomb(mu)}
    joint = rs.Planar("joint", body, rx.GROUND, point=(0, 0, 0), axis=(0, 0, 1), **sizes)
    push = rs.LoadFunction("plate", loads, parameters=given(force=(*force, -WEIGHT), **pushed))
    return rx.Mechanism([body], [joint], loads=[push if load is None else load])


def ran(mechanism, slips, start, rates, times):
    """The motion, and the slips and rates of the joint at all times."""
    at = {f"joint.{slip}": x for slip, x in zip(slips, start, strict=True)}
    rate = {f"joint.{slip}": x for slip, x in zip(slips, rates, strict=True)}
    state = rx.assemble(mechanism, positions=at, rates=rate)
    run = rx.simulate(mechanism, state, times[-1], ts=times, rtol=1e-10, max_steps=2000, throw=False)
    found = (np.stack([run[f"joint.{slip}{mark}"] for slip in slips], axis=1) for mark in ("", "'"))
    return run, *found


# Sleeves --------------------------------------------------------------------------------------

ON_SHAFT = ("angle", "travel")


def test_a_sleeve_slides_and_turns_to_rest_along_a_line():
    """With the inertia of a thin tube of its radius it keeps its direction."""
    slows, speed = LIMIT / MASS, np.hypot(RADIUS * 3.0, 0.2)
    stop = speed / slows
    times = np.array([0.3, 0.6, 0.9, 1.0, 1.2, 1.5]) * stop
    run, slips, rates = ran(sleeve(MASS * RADIUS**2), ON_SHAFT, (0, 0), (3.0, 0.2), times)
    moved = np.minimum(times, stop)
    way = moved - slows * moved**2 / 2 / speed
    np.testing.assert_allclose(slips, way[:, None] * [3.0, 0.2], rtol=1e-8)
    assert run.result == rx.RESULTS.stuck
    np.testing.assert_allclose(run.stats.end, stop, rtol=1e-9)
    assert np.all(rates[4:] == 0.0)
    np.testing.assert_allclose(run.sense[:3], np.tile([0.06, 0.2] / speed, (3, 1)), rtol=1e-9)
    assert np.all(run.sense[4:] == 0.0)


@pytest.mark.parametrize("moment", [0.0, 0.02])
def test_a_sleeve_of_large_inertia_turns_from_its_line(moment):
    """Travel is braked first; a moment below the friction turns it on until it rests."""
    slider = Slider(np.array([0.01, MASS]), np.array([RADIUS, 1.0]), LIMIT, lambda s, t: np.array([moment, 0.0]))
    times = np.linspace(0.0, 1.2, 7)[1:]
    truth = slide(slider, np.zeros(2), np.array([3.0, 0.2]), times)
    run, slips, rates = ran(sleeve(0.01, moment=(0, 0, moment)), ON_SHAFT, (0, 0), (3.0, 0.2), times)
    np.testing.assert_allclose(slips, truth.slips, rtol=0, atol=1e-8)
    np.testing.assert_allclose(rates, truth.rates, rtol=0, atol=1e-8)
    assert len(truth.stops) == 1
    assert run.result == rx.RESULTS.stuck
    np.testing.assert_allclose(run.stats.end, truth.stops[0], rtol=0, atol=2e-8)


# Plates ---------------------------------------------------------------------------------------

ON_TABLE = ("travel_1", "travel_2", "angle")
SPRUNG = (40.0, 70.0, 0.0)
SLIDES = {  # force, stiffness, start, rates, end, number of stops
    "pushed from the side, to rest": ((1.0, 1.5), (0, 0, 0), (0, 0, 0), (0.5, -0.3, 0.0), 1.0, 1),
    "pushed, and spun": ((1.0, 1.5), (0, 0, 0), (0, 0, 0), (0.5, -0.3, 8.0), 1.0, 0),
    "pushed back beyond the cone, it turns round": ((2.9, 1.5), (0, 0, 0), (-0.5, -0.3, 0.0), (0, 0, 0), 1.0, 0),
    "springs along a line": ((0, 0), SPRUNG, (0.5, 0, 0), (0, 0, 0), 4.0, 3),
    "springs along a curve that misses its stops": ((0, 0), SPRUNG, (0.5, 0.3, 0), (0, 0, 0), 4.0, 1),
    "springs, thrown and spun": ((0, 0), SPRUNG, (0.5, 0.1, 0), (0, 1.0, 2.0), 4.0, 1),
}


@pytest.mark.parametrize("name", SLIDES)
def test_a_plate_slides(name):
    force, stiffness, start, rates, end, stops = SLIDES[name]
    slider = Slider(
        np.array([MASS, MASS, SPUN]),
        np.array([1.0, 1.0, SPIN]),
        LIMIT,
        lambda s, t: np.array([*force, 0.0]) - np.array(stiffness) * s,
    )
    times = np.linspace(0.0, end, 7)[1:]
    truth = slide(slider, np.array(start), np.array(rates), times)
    assert len(truth.stops) == stops
    run, slips, speeds = ran(plate(force, stiffness=stiffness), ON_TABLE, start, rates, times)
    np.testing.assert_allclose(slips, truth.slips, rtol=0, atol=1e-8)
    np.testing.assert_allclose(speeds, truth.rates, rtol=0, atol=2e-8)
    assert (run.result == rx.RESULTS.stuck) == (stops > 0)
    assert run.stats.phases <= stops + 1
    assert run.stats.energy_error < 1e-9
    if stops:  # from a millionth of the largest speed on it counts as one, unless it came along a line
        slow = 1e-6 * 10.0 / (LIMIT / MASS)
        straight = name == "springs along a line"
        np.testing.assert_allclose(run.stats.end, truth.stops[-1], rtol=0, atol=2e-8 if straight else slow)


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_plate_on_an_incline_pushed_across_it(share):
    """It stays while the push and the part of its weight downhill together are within the cone, and else goes their
    way."""
    downhill = 0.6 * LIMIT
    force = np.array([np.sqrt((share * LIMIT) ** 2 - downhill**2), -downhill])
    times = np.linspace(0.0, 1.0, 7)[1:]
    run, slips, _ = ran(plate(tuple(force)), ON_TABLE, (0, 0, 0), (0, 0, 0), times)
    speeds_up = max(share - 1, 0.0) * LIMIT / MASS
    truth = speeds_up * times[:, None] ** 2 / 2 * np.append(force / np.linalg.norm(force), 0.0)
    np.testing.assert_allclose(slips, truth, rtol=0, atol=1e-9)
    assert (run.result == rx.RESULTS.stuck) == (share < 1)


def test_a_load_that_grows_lets_a_plate_go_its_way():
    """At 2 N/s from 1.5 s on: (F - 3 N) / m."""
    times = np.array([0.5, 1.0, 1.6, 1.8, 2.0, 2.1])
    run, slips, _ = ran(plate(growth=(1.2, 1.6, 0.0)), ON_TABLE, (0, 0, 0), (0, 0, 0), times)
    way = 2.0 * np.maximum(times - 1.5, 0.0) ** 3 / (6 * MASS)
    np.testing.assert_allclose(slips, way[:, None] * [0.6, 0.8, 0.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.sense[-1], [0.6, 0.8, 0.0], rtol=0, atol=1e-12)
    assert np.all(run.sense[0] == 0.0)
    assert run.stats.steps < 10


def swings(i, j, t, p):
    force = p * jnp.sin(t) * jnp.array([0.6, 0.8, 0.0]) - WEIGHT * jnp.array([0.0, 0.0, 1.0])
    return rs.Wrench(force, jnp.zeros(3)), rs.Wrench(jnp.zeros(3), jnp.zeros(3))


def test_a_load_that_hardly_exceeds_the_limit_and_falls_leaves_no_wrong_figure():
    """m v' = F sin t - f from sin t0 = f / F on; it moves for less than 0.07 s."""
    most = 1.0002 * LIMIT
    mechanism = plate(load=rs.LoadFunction("plate", swings, parameters=np.array(most)))
    start = np.arcsin(LIMIT / most)

    def speed(t):
        return (most * (np.cos(start) - np.cos(t)) - LIMIT * (t - start)) / MASS

    stop = brentq(speed, np.pi - start, 1.7, xtol=1e-15)
    way = most * (np.cos(start) * (stop - start) - np.sin(stop) + np.sin(start)) - LIMIT * (stop - start) ** 2 / 2
    run, slips, _ = ran(mechanism, ON_TABLE, (0, 0, 0), (0, 0, 0), np.array([1.5, 2.0]))
    np.testing.assert_array_equal(slips[0], 0.0)
    if run.result == rx.RESULTS.stuck:
        np.testing.assert_allclose(run.stats.end, stop, rtol=0, atol=1e-5)
        np.testing.assert_allclose(slips[1], np.array([0.6, 0.8, 0.0]) * way / MASS, rtol=0, atol=1e-12)
    else:  # it may come to the stop, and not find in time that it is one
        assert run.result == rx.RESULTS.steps_exhausted
        assert np.all(np.isnan(slips[1]))


# Loads that turn as they grow -------------------------------------------------------------------


def turning(i, j, t, p):
    """A force that grows, turns and springs to the start, and a moment that grows: p = (mu, growth, ...)."""
    force = jnp.array([p[1] * t, p[2] * t**2, -WEIGHT]) - p[3] * jnp.array([1.0, 2.0, 0.0]) * i.pose.r
    return rs.Wrench(force, p[4] * t * jnp.array([0.0, 0.0, 1.0])), rs.Wrench(jnp.zeros(3), jnp.zeros(3))


TURNING, LATER = np.array([MU, 1.5, 0.9, 3.0, 0.02]), np.array([1.5, 1.6, 1.8, 2.2])  # let go at 1.4856 s


def turning_plate(parameters, adjoint):
    """Slips and rates of a plate on a table, and the motion."""
    body = rs.Body("plate", MASS, (SPUN, SPUN, SPUN))
    sizes = {"plate_length": 0.3, "spin_radius": SPIN, "friction": rx.Coulomb(parameters[0])}
    joint = rs.Planar("joint", body, rx.GROUND, point=(0, 0, 0), axis=(0, 0, 1), **sizes)
    mechanism = rx.Mechanism([body], [joint], loads=[rs.LoadFunction("plate", turning, parameters=parameters)])
    options = {"ts": LATER, "rtol": 1e-10, "max_phases": 3, "adjoint": adjoint, "throw": False}
    run = rx.simulate(mechanism, rx.State(mechanism.reference, jnp.zeros(6)), LATER[-1], **options)
    return jnp.stack([run[f"joint.{slip}{mark}"] for mark in ("", "'") for slip in ON_TABLE], axis=1), run.stats.steps


def turning_truth(parameters):
    mu, growth, bends, spring, moment = parameters

    def push(s, t):
        return np.array([growth * t, bends * t**2, moment * t]) - spring * np.array([1.0, 2.0, 0.0]) * s

    slider = Slider(np.array([MASS, MASS, SPUN]), np.array([1.0, 1.0, SPIN]), mu * WEIGHT, push)
    truth = let_go(slider, 10.0, LATER)
    return np.concatenate([truth.slips, truth.rates], axis=1)


def turning_slope(weights):
    """Derivative of the truth along parameters."""
    step = 1e-4
    near, far = (
        turning_truth(TURNING + k * step * weights) - turning_truth(TURNING - k * step * weights) for k in (1, 2)
    )
    return (8 * near - far) / (12 * step)


def test_a_load_that_turns_lets_a_plate_go_and_slopes_pass_the_release():
    parameters, slopes = jnp.asarray(TURNING), np.diag(TURNING)
    along = jax.jit(
        lambda p: jax.jvp(lambda p: turning_plate(p, diffrax.ForwardMode()), (parameters,), (p,), has_aux=True)
    )
    for direction in slopes:
        found, slope, steps = along(jnp.asarray(direction))
        want = turning_slope(direction)
        assert np.all(np.abs(slope - want) < 1e-6 * np.max(np.abs(want), axis=0))
    np.testing.assert_allclose(found, turning_truth(TURNING), rtol=0, atol=1e-10)
    assert steps < 100


def test_gradients_pass_the_release_by_a_load_that_turns():
    weights = np.random.default_rng(0).normal(size=(LATER.size, 6))
    gradient = jax.jit(jax.grad(lambda p: jnp.sum(weights * turning_plate(p, None)[0])))(jnp.asarray(TURNING))
    want = np.array([np.sum(weights * turning_slope(direction)) for direction in np.diag(TURNING)]) / TURNING
    np.testing.assert_allclose(gradient, want, rtol=1e-6)


# Balls ----------------------------------------------------------------------------------------


def test_a_ball_in_its_socket_spins_to_rest():
    """Its angular velocity keeps its axis and falls linearly."""
    axis, inertia = np.array([2.0, 3.0, 6.0]) / 7, 0.1
    body = rs.Body("ball", MASS, (inertia, inertia, inertia))
    socket = rs.Spherical("socket", body, rx.GROUND, point=(0, 0, 0), ball_radius=RADIUS, friction=rx.Coulomb(MU))
    mechanism = rx.Mechanism([body], [socket], loads=[rs.AppliedForce("ball", (12.0, -9.0, 20.0))])
    slows = MU * 25.0 * RADIUS / inertia
    times = np.array([0.3, 0.6, 0.9, 1.1, 1.2]) * 4.0 / slows
    start = rx.State(mechanism.reference, np.append(np.zeros(3), 4.0 * axis))
    run = rx.simulate(mechanism, start, times[-1], ts=times, rtol=1e-10, throw=False)
    truth = np.maximum(4.0 - slows * times, 0.0)[:, None] * axis
    np.testing.assert_allclose(run.qd[:, 3:], truth, rtol=0, atol=1e-9)
    assert run.result == rx.RESULTS.stuck
    np.testing.assert_allclose(run.stats.end, 4.0 / slows, rtol=1e-9)


# Pins of a cross --------------------------------------------------------------------------------


def test_pins_of_a_cross_stick_apart():
    """Pulled along the normal of the cross by 500 N; a small body turns about one pin and the other keeps still."""
    body = rs.Body("body", MASS, (0.1, 0.1, 0.1))
    sizes = {"pin_radius": 0.01, "bearing_length": 0.06, "thrust_radius": 0.008, "friction": rx.Coulomb(0.2)}
    cross = rs.Universal("cross", body, rx.GROUND, (0, 0, 0), axis_i=(1, 0, 0), axis_j=(0, 1, 0), **sizes)
    holds = 0.2 * 0.01 * 500.0
    turns = rs.AppliedForce("body", (0, 0, -500.0), moment=(0.9 * holds, 1.5 * holds, 0))
    mechanism = rx.Mechanism([body], [cross], loads=[turns])
    run = rx.simulate(mechanism, rx.assemble(mechanism), 0.1, ts=[0.05, 0.1], rtol=1e-10)
    assert set(np.abs(run.sense[-1])) == {0.0, 1.0}
    np.testing.assert_allclose(run["cross.angle_2"], 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.abs(run["cross.angle_1"]), 0.5 * holds / 0.1 * run.t**2 / 2, rtol=1e-5)


def test_a_slow_plate_is_at_rest_where_it_stops():
    """Rounding of the weight that the table bears is no acceleration, however slow it was: after v^2 / (2 mu g)."""
    speed, mu, gravity = 0.02, 0.3, 10.0
    body = rx.spatial.Body("body", 2.0, inertia=(1.0, 1.0, 1.0))
    sizes = {"plate_length": 0.5, "spin_radius": 0.1, "friction": rx.Coulomb(mu)}
    table = rx.spatial.Planar("table", body, "ground", point=(0, 0, 0), axis=(0, 0, 1), **sizes)
    mechanism = rx.Mechanism([body], [table], gravity=(0.0, 0.0, -gravity))
    begin = rx.State(mechanism.reference, speed * jnp.array([0.6, 0.8, 0, 0, 0, 0]))
    run = rx.simulate(mechanism, begin, 0.5, ts=[0.5])
    assert run.result == rx.RESULTS.stuck and not np.any(run.qd)
    np.testing.assert_allclose(run.stats.end, speed / (mu * gravity), rtol=1e-9)
    np.testing.assert_allclose(run.q[0, :2], speed**2 / (2 * mu * gravity) * np.array([0.6, 0.8]), rtol=1e-9)


def test_a_brake_stops_no_other_body():
    """A light slide that a strong brake holds, beside one that a small force moves: qd = f t / m."""
    light = rx.spatial.Body("light", 1e-3, (1e-3, 1e-3, 1e-3))
    free = rx.spatial.Body("free", 1.0, (1.0, 1.0, 1.0), position=(3.0, 0.0, 0.0))
    sizes = {"guide_length": 0.5, "twist_radius": 0.1, "friction": rx.ConstantFriction(1e6)}
    guides = [
        rx.spatial.Prismatic("brake", light, "ground", point=(0, 0, 0), axis=(1, 0, 0), **sizes),
        rx.spatial.Prismatic("guide", free, "ground", point=(3, 0, 0), axis=(1, 0, 0)),
    ]
    pull = rx.spatial.AppliedForce("free", (1e-4, 0.0, 0.0))
    mechanism = rx.Mechanism([light, free], guides, loads=[pull], gravity=(0.0, 0.0, -10.0))
    run = rx.simulate(mechanism, rx.State(mechanism.reference, jnp.zeros(12)), 1.0, ts=[1.0])
    assert run.result == rx.RESULTS.successful
    np.testing.assert_allclose(run["guide.travel"], 0.5e-4, rtol=1e-8)


# Batches and derivatives ------------------------------------------------------------------------


@jax.jit
@partial(jax.vmap, in_axes=(0, None, None, None))
def by_mu(mu, growth, rates, end):
    """Where a plate is at the end, and the derivative of that with respect to mu."""

    def where(mu):
        mechanism = plate(mu=mu, growth=growth)
        state = rx.State(mechanism.reference, jnp.concatenate([rates, jnp.zeros(3)]))
        options = {"ts": end[None], "max_phases": 3, "adjoint": diffrax.ForwardMode()}
        return rx.simulate(mechanism, state, end, throw=False, **options).q[0, :2]

    return jax.jvp(where, (mu,), (jnp.ones_like(mu),))


def test_where_a_plate_stops_and_how_that_depends_on_mu():
    """After v^2 / (2 mu g), for many mu at once."""
    speed, gravity = 0.5, WEIGHT / MASS
    mu = np.array([0.05, 0.1, 0.15, 0.2])
    where, slope = by_mu(mu, np.zeros(3), speed * np.array([0.6, 0.8, 0.0]), np.array(1.0))
    way = speed**2 / (2 * mu[:, None] * gravity) * [0.6, 0.8]
    np.testing.assert_allclose(where, way, rtol=1e-8)
    np.testing.assert_allclose(slope, -way / mu[:, None], rtol=1e-6)


def test_where_plates_are_that_are_let_go_and_how_that_depends_on_mu():
    """Moved by g (t - t0)^3 / (6 m) from t0 = mu N / g on, if they are let go at all, for many mu at once."""
    growth, end = 2.0, 2.0
    mu = np.array([0.05, 0.1, 0.13, 0.2])
    where, slope = by_mu(mu, growth * np.array([0.6, 0.8, 0.0]), np.zeros(3), np.array(end))
    left = np.maximum(end - mu * WEIGHT / growth, 0.0)[:, None]
    np.testing.assert_allclose(where, growth * left**3 / (6 * MASS) * [0.6, 0.8], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(slope, -WEIGHT * left**2 / (2 * MASS) * [0.6, 0.8], rtol=1e-8, atol=1e-12)
