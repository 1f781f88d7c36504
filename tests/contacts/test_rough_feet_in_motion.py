"""Rough feet in space in motions: they stick, turn about one of them, slide, stop, tip and land.

The independent integration is of the plane motion of the body: its loads by moments, those of four feet of least
squares, friction against the slip of each foot, by a stiff method from just after feet are let go, and a body that
turns about one foot as a pin until that foot would slide.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, least_squares

import redundax as rx

MASS, SPIN, WEIGHT, HEIGHT, MU = 10.0, 1.5, 98.1, 0.5, 0.4
CORNERS = ((0.5, 0.4), (-0.5, 0.4), (-0.5, -0.4), (0.5, -0.4))
OBLIQUE = ((0.55, 0.3), (-0.45, 0.5), (-0.6, -0.3), (0.4, -0.45))
TRIPOD = ((0.5, 0.0), (-0.4, 0.4), (-0.3, -0.5))


def pushes(i, j, t, p):
    """p_0 N along (p_1, p_2) at the height p_3, and p_4 m times it about the vertical: half a sine, and p_5 t."""
    force = p[0] * jnp.sin(jnp.pi * jnp.clip(t - 0.1, 0.0, 1.0)) + p[5] * t
    x, y, rise = force * p[1], force * p[2], 0.0 * t
    moment = jnp.stack([-p[3] * y, p[3] * x, force * p[4]])
    return rx.spatial.Wrench(jnp.stack([x, y, rise]), moment), rx.spatial.Wrench(jnp.zeros(3), jnp.zeros(3))


def table(corners, mu, law, height=HEIGHT):
    top = rx.spatial.Body("top", MASS, inertia=(1.0, 1.2, SPIN), centre=(0.0, 0.0, height))
    rough = {"friction": rx.Coulomb(jnp.asarray(mu)), "one_sided": True}
    feet = [
        rx.spatial.PointOnPlane(f"f{k}", top, "ground", (*at, 0.0), (0, 0, 1), **rough) for k, at in enumerate(corners)
    ]
    loads = [rx.spatial.LoadFunction("top", pushes, parameters=jnp.asarray(law))]
    return rx.Mechanism([top], feet, gravity=(0.0, 0.0, -9.81), loads=loads)


def moved(mechanism, span, rates=(0.0, 0.0, 0.0), rise=0.0, start=0.0, **options):
    """The motion from a height above the floor and with velocities along x and y and about the vertical."""
    given = dict(zip(("top.x", "top.y", "top.phi_z"), rates, strict=True))
    state = rx.assemble(mechanism, t=start)
    if rise:
        state = rx.assemble(mechanism, state.q.at[2].add(rise), rates=given)
    elif any(rates):
        state = rx.assemble(mechanism, rates=given)
    return rx.simulate(mechanism, state, span, max_phases=100, **options)


class Feet:
    """A body on feet, pushed by (F_x, F_y, M_z) t at a height."""

    def __init__(self, at, mu, push=(0.0, 0.0, 0.0), lift=0.0, height=HEIGHT):
        self.at, self.mu, self.push, self.lift, self.height = np.array(at), mu, np.array(push), lift - height, height
        self.mass = np.array([MASS, MASS, SPIN])

    def places(self, turn):
        c, s = np.cos(turn), np.sin(turn)
        return self.at @ np.array([[c, s], [-s, c]])

    def wrench(self, places, force):
        return np.array([*force.sum(axis=0), (places[:, 0] * force[:, 1] - places[:, 1] * force[:, 0]).sum()])

    def loads(self, places, slides, t, pinned=None):
        """Normal loads with friction of unit slips, and those by unit forces of one foot."""
        level, none = (
            np.linalg.pinv(np.array([np.ones(len(places)), places[:, 1], -places[:, 0]])),
            np.zeros(len(places)),
        )
        rubs = self.mu * self.height * np.array([none, -slides[:, 1], slides[:, 0]])
        by = np.linalg.solve(np.eye(len(places)) + level @ rubs, level)
        given = by @ np.array([WEIGHT, self.lift * self.push[1] * t, -self.lift * self.push[0] * t])
        return given, by @ (self.height * np.array([[0.0, 0.0], [0.0, -1.0], [1.0, 0.0]]))

    def slides(self, places, rates):
        speeds = rates[:2] + rates[2] * np.stack([-places[:, 1], places[:, 0]], axis=1)
        return speeds / np.maximum(np.linalg.norm(speeds, axis=1), 1e-300)[:, None]

    def total(self, t, turn, rates):
        places = self.places(turn)
        slides = self.slides(places, rates)
        return self.wrench(places, -self.mu * self.loads(places, slides, t)[0][:, None] * slides) + t * self.push

    def slope(self, t, y):
        return np.concatenate([y[3:], self.total(t, y[2], y[3:]) / self.mass])

    def let_go(self):
        """When all feet begin to slide at once, and about what."""

        def lacks(x):
            return [*self.total(x[3], 0.0, x[:3]), x[:3] @ x[:3] - 1]

        way = self.push / self.mass / np.linalg.norm(self.push / self.mass)
        for k in range(30):
            begin = way + 0.5 * np.random.default_rng(k).normal(size=3) * (k > 0)
            found = least_squares(lacks, [*begin, 1.0], xtol=1e-15, ftol=1e-15, gtol=1e-15)
            if np.abs(found.fun).max() < 1e-9 and found.x[3] > 0:
                return found.x[3], found.x[:3]
        raise AssertionError

    def slid(self, times):
        goes, about = self.let_go()
        soon = goes + 1e-4
        rise = about @ self.push / (about @ (self.mass * about)) * 1e-8 / 2
        run = solve_ivp(
            self.slope,
            (soon, times[-1]),
            [0, 0, 0, *(rise * about)],
            "Radau",
            times[times > soon],
            rtol=1e-10,
            atol=1e-13,
        )
        return np.concatenate([np.zeros((len(times) - run.t.size, 6)), run.y.T])

    def pinned(self, t, turn, sense, foot, rate=0.0):
        """Angular acceleration, the force at a foot that the body turns about, and normal loads."""
        places = self.places(turn)
        x, y = places[foot]
        way = np.array([y, -x, 1.0])
        slides = self.slides(places, sense * way)
        slides[foot] = 0.0
        given, by = self.loads(places, slides, t)
        own = [-self.mu * column[:, None] * slides for column in by.T]
        for k in range(2):
            own[k][foot, k] += 1.0
        rest = self.wrench(places, -self.mu * given[:, None] * slides) + t * self.push
        columns = np.column_stack([self.mass * way, *(-self.wrench(places, force) for force in own)])
        turns, *force = np.linalg.solve(columns, rest - self.mass * rate**2 * np.array([x, y, 0.0]))
        return turns, np.array(force), given + by @ force

    def turned(self, foot, sense, times):
        """It turns about a foot, which then slides with the others; and when it begins to do either."""

        def room(t, y):
            _, force, loads = self.pinned(t, y[0], sense, foot, y[1])
            return self.mu * loads[foot] - np.hypot(*force)

        def slope(t, y):
            return [y[1], self.pinned(t, y[0], sense, foot, y[1])[0]]

        room.terminal, fine = True, {"rtol": 1e-12, "atol": 1e-14, "dense_output": True}
        goes = brentq(lambda t: self.pinned(t, 0.0, sense, foot)[0], 1e-3, 10.0, xtol=1e-15)
        assert room(goes, (0.0, 0.0)) > 0
        run = solve_ivp(slope, (goes, times[-1]), [0.0, 0.0], "DOP853", events=room, max_step=0.02, **fine)
        slips = run.t[-1]

        def whole(turn, rate):
            x, y = self.places(turn)[foot]
            return np.array([*(self.at[foot] - (x, y)), turn, rate * y, -rate * x, rate])

        _, force, _ = self.pinned(slips, run.y[0, -1], sense, foot, run.y[1, -1])
        begin = whole(*run.y[:, -1]) - 1e-9 * np.array([0, 0, 0, *(force / np.hypot(*force)), 0])
        later = solve_ivp(self.slope, (slips, times[-1]), begin, "Radau", rtol=1e-10, atol=1e-13, dense_output=True)
        path = [np.zeros(6) if t < goes else whole(*run.sol(t)) if t < slips else later.sol(t) for t in times]
        return np.array(path), goes, slips


def plane(motion):
    """Velocities along x and y and about the vertical."""
    return np.asarray(motion.qd)[:, [0, 1, 5]]


def ramp(push, lift):
    """The law of a load (F_x, F_y, M_z) t at a height."""
    size = np.hypot(*push[:2])
    return 0.0, push[0] / size, push[1] / size, lift, push[2] / size, size


@pytest.mark.slow
@pytest.mark.parametrize(
    ("at", "mu", "push", "lift"),
    [
        (CORNERS, 0.4, (18.0, 24.0, 3.0), HEIGHT),
        (CORNERS, 0.4, (3.0, 0.0, 20.0), HEIGHT),  # nearly a turn
        # About a place 0.03 m from a foot.
        (CORNERS, 0.5, (-11.0, 7.5, -20.0), 0.0),
        (OBLIQUE, 0.3, (-20.0, -6.0, 4.0), HEIGHT),
        (TRIPOD, 0.4, (-18.0, -24.0, 3.0), HEIGHT),
        (TRIPOD, 0.3, (-4.0, 8.0, 10.0), 0.2),
    ],
)
def test_feet_of_a_pushed_table_are_let_go_together(at, mu, push, lift):
    feet = Feet(at, mu, push, lift)
    motion = moved(table(at, mu, ramp(push, lift)), 1.3 * feet.let_go()[0])
    times = np.asarray(motion.t)
    path = feet.slid(times)
    np.testing.assert_allclose(plane(motion), path[:, 3:], rtol=0, atol=1e-7)
    np.testing.assert_allclose(motion.q[:, :2], path[:, :2], rtol=0, atol=1e-7)
    assert np.abs(path[-1, 3:]).max() > 0.01 and motion.stats.steps < 300
    assert {words for each in motion.contacts.values() for words in each} == {"carries"}


@pytest.mark.slow
def test_pushed_tables_of_a_batch_are_let_go_each_at_its_time():
    given = np.array([(-18.0, -24.0, 3.0), (-4.0, 8.0, 10.0)])
    times = np.linspace(0.0, 1.3 * max(Feet(TRIPOD, MU, push, 0.2).let_go()[0] for push in given), 41)
    laws = jnp.array([ramp(push, 0.2) for push in given])
    move = lambda law: moved(table(TRIPOD, MU, law), times[-1], ts=times, throw=False)  # noqa: E731
    motions = jax.jit(jax.vmap(move))(laws)
    for k, push in enumerate(given):
        path = Feet(TRIPOD, MU, push, 0.2).slid(times)
        np.testing.assert_allclose(motions.qd[k][:, [0, 1, 5]], path[:, 3:], rtol=0, atol=1e-7)
        np.testing.assert_allclose(motions.q[k][:, :2], path[:, :2], rtol=0, atol=1e-7)


def pushed(mu, *law, start=0.0):
    """A table at rest on four feet that a load of time pushes; all calls share its programs."""
    return moved(table(CORNERS, mu, (*law, 0.0)), 2.0, start=start)


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
    start = rx.assemble(table(CORNERS, MU, ramp((1.0, 0.0, 0.0), 0.0)))
    np.testing.assert_array_equal(motion.q[0], start.q)
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("at", "mu", "push", "foot", "sense"),
    [(CORNERS, 0.45, (17.0, 17.0, 30.0), 1, 1), (TRIPOD, 0.2, (9.0, -17.0, 30.0), 0, 1)],
)
def test_a_table_turns_about_a_foot_that_sticks_until_that_slides_too(at, mu, push, foot, sense):
    feet, lift = Feet(at, mu, push, HEIGHT), HEIGHT
    span = 1.2 * feet.turned(foot, sense, np.array([0.0, 8.0]))[2]
    motion = moved(table(at, mu, ramp(push, lift)), span)
    times = np.asarray(motion.t)
    path, goes, slips = feet.turned(foot, sense, times)
    np.testing.assert_allclose(plane(motion), path[:, 3:], rtol=0, atol=1e-7)
    sticks = np.all(np.asarray(motion.sense)[:, 2 * foot : 2 * foot + 2] == 0, axis=1)
    np.testing.assert_array_equal(sticks, times < slips)
    assert np.sum((times > goes) & sticks) > 3


@pytest.mark.slow
def test_a_foot_is_let_go_a_moment_after_the_others():
    """It hardly slides at first, as the others turn about it: friction turns its slip a million times a second."""
    feet = Feet(CORNERS, 0.5, (-17.2, -13.5, -32.9), HEIGHT)
    motion = moved(table(CORNERS, 0.5, ramp(feet.push, HEIGHT)), 1.3)
    path, goes, slips = feet.turned(1, -1, np.asarray(motion.t))
    assert 0 < slips - goes < 1e-3 and motion.stats.steps < 150
    np.testing.assert_allclose(plane(motion), path[:, 3:], rtol=0, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("rates", [(1.0, 0.0, 3.0), (0.3, -0.2, 0.7), (1.0, 0.3, 0.1)])
def test_a_table_stops_sliding_and_turning_at_once(rates):
    feet = Feet(OBLIQUE, 0.3)
    motion = moved(table(OBLIQUE, 0.3, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0)), 1.0, rates)
    times = np.asarray(motion.t)

    def stops(t, y):
        return np.linalg.norm(y[3:]) - 1e-6

    stops.terminal = True
    begin = [0.0, 0.0, 0.0, *rates]
    run = solve_ivp(feet.slope, (0.0, 1.0), begin, "Radau", events=stops, rtol=1e-11, atol=1e-14, dense_output=True)
    before = times < run.t[-1]
    np.testing.assert_allclose(plane(motion)[before], run.sol(times[before])[3:].T, rtol=0, atol=1e-6)
    np.testing.assert_allclose(motion.q[-1, :2], run.y[:2, -1], rtol=0, atol=1e-9)
    assert run.status == 1 and np.all(np.asarray(motion.sense)[~before][1:] == 0)
    np.testing.assert_allclose(plane(motion)[~before][1:], 0.0, atol=1e-11)
    assert motion.stats.energy_error < 1e-8


@pytest.mark.slow
def test_a_table_that_spins_alone_stops_as_a_ring_does():
    """All feet are as far from the middle: I omega' = -mu m g r."""
    motion = moved(table(CORNERS, 0.3, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0)), 1.0, (0.0, 0.0, 5.0))
    slows = 0.3 * WEIGHT * np.hypot(0.5, 0.4) / SPIN
    speed = np.maximum(5.0 - slows * np.asarray(motion.t), 0.0)
    np.testing.assert_allclose(plane(motion), np.outer(speed, [0, 0, 1]), rtol=0, atol=1e-9)


@pytest.mark.slow
def test_a_table_turns_as_it_falls_and_lands_turning():
    """Feet in the air slip any way. The impact takes mu r p of the spin, and friction mu r m g from then on."""
    rise, span, spin, mu, arm = 0.1, 0.3, 6.0, 0.3, np.hypot(0.5, 0.4)
    lands, speed = np.sqrt(2 * rise / 9.81), np.sqrt(2 * rise * 9.81)
    motion = moved(table(CORNERS, mu, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]), span, (0.0, 0.0, spin), rise, ts=[0.1, span])
    np.testing.assert_allclose(motion.impacts.t, [lands], rtol=1e-9)
    lost = mu * arm / SPIN * (MASS * speed + WEIGHT * (span - lands))
    np.testing.assert_allclose(motion["top.phi_z'"], [spin, spin - lost], rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "sticks"), [(0.3, False), (0.9, True)])
def test_a_table_that_falls_flat_slides_or_sticks_where_it_lands(mu, sticks):
    """Friction takes mu times the impulse of the floor from its velocity, or all."""
    low, fall, along = 0.2, 0.05, np.array([0.8, 0.6])
    speed, lands, strike = (0.5 if sticks else 1.0), np.sqrt(2 * fall / 9.81), np.sqrt(2 * fall * 9.81)
    law = (0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    motion = moved(table(CORNERS, mu, law, low), 1.0, (*(speed * along), 0.0), fall)
    times, left = np.asarray(motion.t), 0.0 if sticks else speed - mu * strike
    truth = np.where(times < lands, speed, np.maximum(left - mu * 9.81 * (times - lands), 0.0))
    np.testing.assert_allclose(motion.qd[:, :2], np.outer(truth, along), rtol=0, atol=1e-8)
    np.testing.assert_allclose(motion.impacts.t[0], lands, rtol=1e-9)
    np.testing.assert_allclose(motion.impacts.energy[0], MASS * (strike**2 + speed**2 - left**2) / 2, rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "speed"), [(0.3, 2.5), (0.3, 0.9)])
def test_a_table_that_bounces_flat_loses_speed_by_each_impact(mu, speed):
    """mu (1 + e) of the speed of the fall, as long as it slides; and mu g once it lies."""
    fall, part, along = 0.05, 0.5, np.array([0.8, 0.6])
    motion = moved(
        table(CORNERS, mu, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0), 0.2), 0.6, (*(speed * along), 0.0), fall, restitution=part
    )
    times, t, strike, way, left = np.asarray(motion.t), np.sqrt(2 * fall / 9.81), np.sqrt(2 * fall * 9.81), 0.0, speed
    ways, speeds, strikes = speed * times, np.full_like(times, speed), [t]
    way = speed * t
    while strike > 1e-9:
        left, later = max(left - mu * (1 + part) * strike, 0.0), times >= t
        ways[later], speeds[later] = way + left * (times[later] - t), left
        strike *= part
        way, t = way + left * 2 * strike / 9.81, t + 2 * strike / 9.81
        strikes.append(t)
    since = np.minimum(np.maximum(times - t, 0.0), left / (mu * 9.81))
    ways, speeds = ways - mu * 9.81 * since**2 / 2, speeds - mu * 9.81 * since
    rests = times >= t + left / (mu * 9.81)
    ways[rests] = way + left**2 / (2 * mu * 9.81)
    np.testing.assert_allclose(motion.qd[:, :2], np.outer(speeds, along), rtol=0, atol=1e-8)
    np.testing.assert_allclose(motion.q[:, :2], np.outer(ways, along), rtol=0, atol=1e-8)
    np.testing.assert_allclose(motion.impacts.t[:10], strikes[:10], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "height", "speed"), [(0.9, 0.8, 2.0), (0.8, 0.7, 3.0)])
def test_a_table_tips_as_it_slides_until_its_feet_stick(mu, height, speed):
    """About its front feet, by its tilt and the way of its centre."""
    motion = moved(table(CORNERS, mu, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0), height), 0.3, (speed, 0.0, 0.0))

    def feet(y):
        c, s = np.cos(y[1]), np.sin(y[1])
        ahead, above = 0.5 * c - height * s, -0.5 * s - height * c
        return ahead, above, y[2] + y[3] * above

    def slope(t, y):
        ahead, above, _ = feet(y)
        lever = mu * above + ahead
        load = (9.81 + y[3] ** 2 * above) / (1 / MASS + lever * ahead / 1.2)
        return [y[2], y[3], -mu * load / MASS, -lever * load / 1.2]

    def stops(t, y):
        return feet(y)[2]

    stops.terminal = True
    run = solve_ivp(
        slope, (0, 0.3), [0, 0, speed, 0], "DOP853", events=stops, rtol=1e-12, atol=1e-13, dense_output=True
    )
    times = np.asarray(motion.t)
    slides = times < run.t[-1]
    path = run.sol(times[slides])
    np.testing.assert_allclose(motion.qd[slides][:, [0, 4]], path[2:].T, rtol=0, atol=1e-7)
    np.testing.assert_allclose(motion.q[slides, 0], path[0], rtol=0, atol=1e-8)
    assert run.status == 1 and np.all(np.asarray(motion.sense)[~slides][:, [0, 6]] == 0)
    for foot, word in (("f0", "carries"), ("f1", "open"), ("f2", "open"), ("f3", "carries")):
        assert set(motion.contacts[foot]) == {word}
