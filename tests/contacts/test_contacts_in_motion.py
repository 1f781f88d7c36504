"""Contacts that open and close in motions, against closed forms and SciPy with events."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import redundax as rx

G = 9.81
EXACT = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}


def floor(q, t, g):
    return -q[1:]


def weight(q, qd, t, g):
    return jnp.stack([0.0 * g, -2.0 * g])


def ball(gravity=G):
    """A ball of 2 kg that falls on a floor and moves along it; all calls share its functions, and so their programs."""
    return rx.System(
        floor,
        mass=jnp.array([2.0, 2.0]),
        load=weight,
        parameters=jnp.asarray(gravity),
        rows="force",
        m=1,
        one_sided=[0],
    )


def dropped(height=1.0):
    return rx.State(jnp.array([0.0, height]), jnp.array([1.0, 0.0]))


def test_a_bouncing_ball():
    """Impacts at t_1 + 2 v / g (e + e^2 + ...), each of which leaves e^2 of the energy; then rest."""
    e, t1, v = 0.5, np.sqrt(2 / G), np.sqrt(2 * G)
    motion = rx.simulate(ball(), dropped(), 1.5, restitution={"0": e})
    impacts, k = motion.impacts, np.arange(12)
    times = t1 + 2 * v / G * np.cumsum(np.append(0.0, e ** k[1:]))
    np.testing.assert_allclose(impacts.t[:12], times, rtol=0, atol=1e-9)
    np.testing.assert_allclose(impacts.energy[:12], v**2 * e ** (2 * k) * (1 - e**2), rtol=1e-9)
    np.testing.assert_allclose(impacts.impulses[:12, 0], 2 * v * e**k * (1 + e), rtol=1e-9)
    # Rebounds end where they are slower than 1.4e-6 of the speed of the mechanism, which is sqrt(g m) here.
    at_rest = t1 + 2 * v / G * e / (1 - e)
    assert 20 <= impacts.t.size <= 22 and abs(float(impacts.t[-1]) - at_rest) < 1e-5
    assert float(jnp.sum(impacts.energy)) == pytest.approx(2 * G, rel=1e-10)
    words = motion.contacts["0"]
    assert set(words[motion.t < at_rest - 1e-5]) == {"open"} and set(words[motion.t > at_rest]) == {"carries"}
    ends = np.asarray(motion.t > at_rest)
    np.testing.assert_allclose(motion.multipliers[ends, 0], 2 * G, rtol=1e-10)
    np.testing.assert_allclose(motion.q[ends, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(motion.q[:, 0], motion.t, rtol=0, atol=1e-10)
    flight = np.asarray((motion.t > times[1]) & (motion.t < times[2]))
    since = motion.t[flight] - times[1]
    np.testing.assert_allclose(motion.q[flight, 1], v * e**2 * since - G / 2 * since**2, rtol=0, atol=1e-9)
    assert motion.stats.energy_error < 1e-12
    assert "impacts of 0 from t = 0.451524" in str(motion)
    *others, panel = rx.plot.trajectory(ball(), motion, ["1"]).axes
    assert [label.get_text() for label in panel.get_yticklabels()] == ["0"]
    assert sum(line.get_marker() == "v" for line in panel.lines) == impacts.t.size == len(others[0].lines) - 1
    (bar,) = (path.get_extents() for path in panel.collections[-1].get_paths())
    assert bar.x0 == pytest.approx(at_rest, abs=0.02) and bar.x1 == 1.5


def test_more_bounces_than_phases_say_so():
    with pytest.raises(rx.NoSolutionError, match=r"contacts opened or closed, `max_phases` times .* got to t ="):
        rx.simulate(ball(), dropped(), 1.5, restitution=0.9, max_phases=2)
    cut = rx.simulate(ball(), dropped(), 1.5, restitution=0.9, max_phases=2, throw=False)
    got_to = np.asarray(cut.t <= cut.stats.end)
    assert set(cut.contacts["0"][got_to]) == {"open"} and set(cut.contacts["0"][~got_to]) == {""}


def test_a_ball_that_lies_on_the_floor_and_one_that_begins_with_an_impact():
    lies = rx.simulate(ball(), dropped(0.0), 1.5)
    assert lies.impacts.t.size == 0 and set(lies.contacts["0"]) == {"carries"}
    thrown = rx.State(jnp.zeros(2), jnp.array([1.0, -2.0]))
    motion = rx.simulate(ball(), thrown, 1.5, restitution=0.5)
    np.testing.assert_allclose(motion.impacts.t[:3], [0.0, 2 / G, 3 / G], rtol=0, atol=1e-9)
    with pytest.raises(rx.NoSolutionError, match="does not satisfy the constraints"):
        rx.simulate(ball(), dropped(-0.1), 1.5)


def driven_and_stopped(q, t, law):
    return jnp.stack([q[0] - law[0] - law[1] * t - law[2] * t**2, q[1] - q[0], q[1]])


def sprung(q, qd, t, law):
    return jnp.stack([0.0 * t, 100.0 - 2e4 * q[1]])


def press(*law, constraint=driven_and_stopped):
    """A ram on c_0 + c_1 t + c_2 t^2 drives a plate of 3 kg, which 100 N and a spring of 2e4 N/m hold up to a stop."""
    return rx.System(
        constraint,
        mass=jnp.array([2.0, 3.0]),
        load=sprung,
        parameters=jnp.array(law),
        rows="force",
        m=3,
        one_sided=[1, 2],
    )


@pytest.mark.parametrize("restitution", [0.0, 0.3])
def test_a_driven_ram_strikes_a_plate_off_its_stop(restitution):
    """The ram's rate is prescribed and the plate takes it, with the rebound, so that the stop has no impulse."""
    e, v = restitution, 0.1
    start = rx.State(jnp.array([0.02, 0.0]), jnp.array([-v, 0.0]))
    motion = rx.simulate(press(0.02, -v, 0.0), start, 0.2001 if e else 0.3, restitution={"1": e})
    np.testing.assert_allclose(motion.impacts.t[0], 0.2, rtol=1e-12)
    np.testing.assert_allclose(motion.impacts.impulses[0], [3 * v * (1 + e), 0.0], rtol=0, atol=1e-12)
    # The driver gives the impulse at its rate v, of which the plate has the kinetic energy of v (1 + e).
    np.testing.assert_allclose(motion.impacts.work[0], 3 * v**2 * (1 + e), rtol=1e-12)
    np.testing.assert_allclose(motion.impacts.energy[0], 3 * v**2 * (1 - e**2) / 2, rtol=1e-12)
    assert motion.stats.energy_error < 1e-10
    if e:
        since = float(motion.t[-1]) - 0.2
        left = [-v, -v * (1 + e) + 100 / 3 * since]
        np.testing.assert_allclose(motion.qd[-1], left, rtol=0, atol=2e4 / 3 * v * since**2)
    else:
        after = np.asarray(motion.t > 0.2)
        depth = v * (motion.t[after] - 0.2)
        np.testing.assert_allclose(motion.q[after], -np.stack([depth, depth], 1), rtol=0, atol=1e-10)
        loads = np.stack([100 + 2e4 * depth, 0 * depth], 1)
        np.testing.assert_allclose(motion.multipliers[after, 1:], loads, rtol=1e-8, atol=1e-8)
        assert {name: str(words[-1]) for name, words in motion.contacts.items()} == {"1": "carries", "2": "open"}


def test_a_driver_that_accelerates_takes_a_plate_off_its_stop():
    """From rest, by a load of 100 N and 0.5 m/s^2 of 3 kg."""
    system, rest = press(0.0, 0.0, -0.25), rx.State(jnp.zeros(2), jnp.zeros(2))
    solution = rx.solve(system, rest)
    assert solution.contacts == {"1": "carries", "2": "lifts"}
    np.testing.assert_allclose(solution.acceleration, [-0.5, -0.5], rtol=1e-12)
    np.testing.assert_allclose(solution.multipliers[1:], [100 + 3 * 0.5, 0.0], rtol=1e-12)


@pytest.mark.parametrize("power", [3, pytest.param(2, marks=pytest.mark.slow)])
def test_a_driver_that_sets_off_takes_a_plate_off_its_stop(power):
    """By (t - 0.1)^power from rest: the ram bears 100 + 2e4 d + 3 d''. Before, it and the stop share 100 N."""

    def constraint(q, t, law):
        return jnp.stack([q[0] + jnp.maximum(t - 0.1, 0.0) ** power, q[1] - q[0], q[1]])

    motion = rx.simulate(press(constraint=constraint), rx.State(jnp.zeros(2), jnp.zeros(2)), 0.3)
    since = np.maximum(np.asarray(motion.t) - 0.1, 0.0)
    moves = since > 1e-3
    np.testing.assert_allclose(motion.q, -np.stack([since**power] * 2, 1), rtol=0, atol=1e-9)
    bears = 100 + 2e4 * since**power + 3 * power * (power - 1) * since ** (power - 2)
    np.testing.assert_allclose(motion.multipliers[moves, 1], bears[moves], rtol=1e-6)
    assert set(motion.contacts["2"][moves]) == {"open"} and set(motion.contacts["2"][since == 0]) == {"carries"}
    assert motion.stats.phases == 2 and motion.impacts.t.size == 0


def test_a_driver_of_speed_that_runs_into_the_floor_is_told_with_the_contact():
    system = rx.System(
        floor,
        mass=jnp.array([2.0, 2.0]),
        load=weight,
        parameters=jnp.asarray(G),
        velocity_constraints=lambda q, qd, t, g: qd[1:] + 0.5,
        rows=["force", "force"],
        one_sided=[0],
    )
    start = rx.State(jnp.array([0.0, 1.0]), jnp.array([1.0, -0.5]))
    with pytest.raises(rx.NoSolutionError, match=r"Nearest to closing or opening at t = 1\.98: 0 \(.* apart\)"):
        rx.simulate(system, start, 3.0)


def table(peak):
    """A table of 98.1 N on four feet, tilted by a moment that grows to a peak and falls again."""
    feet = np.array([[-0.4, -0.3], [0.4, -0.3], [0.4, 0.3], [-0.4, 0.3]])
    return rx.System(
        lambda q, t, p: -(q[0] + feet[:, 1] * q[1] - feet[:, 0] * q[2]),
        mass=jnp.array([10.0, 0.8, 1.1]),
        load=lambda q, qd, t, p: jnp.stack([-98.1, 0.0 * t, p * 4 * t * (1 - t)]),
        parameters=jnp.asarray(peak),
        coordinates=["linear", "angular", "angular"],
        rows="force",
        m=4,
        one_sided=range(4),
    )


def test_feet_of_a_table_lift_under_a_load_of_time_and_land():
    """It tips about two feet by (1.1 + 10 0.4^2) phi'' = M - 98.1 0.4, and on landing all four take the impact."""
    motion = rx.simulate(table(45.0), rx.State(jnp.zeros(3), jnp.zeros(3)), 1.1, rtol=1e-10)
    inertia = 1.1 + 10 * 0.4**2
    moment = np.polynomial.Polynomial([-98.1 * 0.4, 180.0, -180.0])
    lifts = min(moment.roots().real)
    rate = moment.integ(lbnd=lifts) / inertia
    angle = rate.integ(lbnd=lifts)
    lands = max(x.real for x in angle.roots() if abs(x.imag) < 1e-9 and x.real < 1.2)
    (impact,) = motion.impacts.t
    assert float(impact) == pytest.approx(lands, abs=1e-9)
    assert float(motion.impacts.energy[0]) == pytest.approx(inertia * rate(lands) ** 2 / 2, rel=1e-9)
    flies = np.asarray((motion.t > lifts) & (motion.t < lands))
    np.testing.assert_allclose(motion.q[:, 2], np.where(flies, angle(np.asarray(motion.t)), 0.0), rtol=0, atol=1e-9)
    for foot, word in (("0", "open"), ("1", "carries"), ("2", "carries"), ("3", "open")):
        assert set(motion.contacts[foot][flies]) == {word}
        assert set(motion.contacts[foot][~flies]) == {"carries"}
    solved = rx.solve(table(45.0), rx.State(motion.q[5], motion.qd[5], motion.t[5]))
    np.testing.assert_allclose(motion.multipliers[5], solved.multipliers, rtol=1e-9)


def test_a_pendulum_against_a_stop():
    rod = rx.Body("rod", 1.5, 0.1)
    pin = rx.Revolute("A", "rod", "ground", (0.0, 0.4), (0.0, 0.0))
    stop = rx.Stop("stop", "A.angle", most=0.3)
    pendulum = rx.Mechanism([rod], [pin], couplers=[stop], gravity=(0.0, -G))
    begin = rx.State(jnp.array([0.4 * np.sin(-0.8), -0.4 * np.cos(0.8), -0.8]), jnp.zeros(3))
    motion = rx.simulate(pendulum, begin, 3.0, restitution={"stop": 0.6}, rtol=1e-10)

    def hits(t, y):
        return 0.3 - y[0]

    hits.terminal, hits.direction = True, -1
    slope = lambda t, y: [y[1], -1.5 * G * 0.4 * np.sin(y[0]) / (0.1 + 1.5 * 0.4**2)]  # noqa: E731
    t, y, impacts = 0.0, np.array([-0.8, 0.0]), []
    while True:
        run = solve_ivp(slope, (t, 3.0), y, events=hits, **EXACT)
        t, y = run.t[-1], run.y[:, -1]
        if run.status != 1:
            break
        impacts.append(t)
        y = np.array([0.3, -0.6 * y[1]])
    assert len(impacts) == 3
    np.testing.assert_allclose(motion.impacts.t, impacts, rtol=0, atol=1e-9)
    np.testing.assert_allclose([motion.q[-1, 2], motion.qd[-1, 2]], y, rtol=0, atol=1e-8)
    assert motion.stats.energy_error < 1e-9


@pytest.mark.slow
def test_a_cable_slackens_and_tightens():
    """A bob whirled too slowly: slack where its tension is zero, cos = -(v^2 - 2 g L) / (3 g L), then a parabola.

    There p.v = 0 and v^2 + p.a = 0, so that |p|^2 = L^2 again at t = -4 v.a / a^2, where v along the cable is lost.
    """
    length = 0.8
    cable = rx.Cable("rope", "bob", "ground", (0, 0), (0, 0), distance=length)
    bob = rx.Mechanism([rx.Body("bob", 2.0, 0.01)], [cable], gravity=(0, -G))
    speed = np.sqrt(3.5 * G * length)
    begin = rx.State(jnp.array([0.0, -length, 0.0]), jnp.array([speed, 0.0, 0.0]))
    motion = rx.simulate(bob, begin, 1.3, rtol=1e-10)

    def slack(t, y):
        return y[1] ** 2 * length + G * np.cos(y[0])

    slack.terminal = True
    slope = lambda t, y: [y[1], -G / length * np.sin(y[0])]  # noqa: E731
    run = solve_ivp(slope, (0.0, 2.0), [0.0, speed / length], events=slack, **EXACT)
    slackens, (angle, rate) = run.t[-1], run.y[:, -1]
    assert np.cos(angle) == pytest.approx(-0.5, abs=1e-10)
    v = length * rate * np.array([np.cos(angle), np.sin(angle)])
    tightens = slackens + 4 * v[1] / G
    np.testing.assert_allclose(motion.impacts.t, [tightens], rtol=0, atol=1e-9)
    loose = np.asarray((motion.t > slackens) & (motion.t < tightens))
    assert set(motion.contacts["rope"][loose]) == {"open"} and set(motion.contacts["rope"][~loose]) == {"carries"}
    since = np.asarray(motion.t)[loose] - slackens
    np.testing.assert_allclose(motion["bob.x"][loose], length * np.sin(angle) + v[0] * since, rtol=0, atol=1e-8)
    flight, down = tightens - slackens, np.array([0.0, -G])
    end = length * np.array([np.sin(angle), -np.cos(angle)]) + v * flight + down * flight**2 / 2
    along = (v + down * flight) @ end / length
    assert float(motion.impacts.impulses[0, 0]) == pytest.approx(2.0 * along, rel=1e-9)


@pytest.mark.slow
def test_a_block_tips_and_lands_on_two_feet():
    """It stands on one foot, slides without friction and lands on the other: the landing takes all of its velocity."""
    feet = [
        rx.PinInSlot(name, "block", "ground", (x, -0.5), (0, 0), (0, 1), one_sided=True)
        for name, x in (("f1", -0.3), ("f2", 0.3))
    ]
    block = rx.Mechanism([rx.Body("block", 3.0, 0.2)], feet, gravity=(0.0, -G))
    height = lambda phi: 0.3 * np.sin(phi) + 0.5 * np.cos(phi)  # noqa: E731
    lever = lambda phi: 0.3 * np.cos(phi) - 0.5 * np.sin(phi)  # noqa: E731
    begin = rx.State(jnp.array([0.0, height(0.1), 0.1]), jnp.zeros(3))
    motion = rx.simulate(block, begin, 0.3, rtol=1e-10)

    def slope(t, y):  # (I + m h'^2) phi'' = -m h' (g + h'' phi'^2)
        h1, h2 = lever(y[0]), -height(y[0])
        return [y[1], -3.0 * h1 * (G + h2 * y[1] ** 2) / (0.2 + 3.0 * h1**2)]

    def lands(t, y):
        return y[0]

    lands.terminal = True
    run = solve_ivp(slope, (0.0, 1.0), [0.1, 0.0], events=lands, **EXACT)
    np.testing.assert_allclose(motion.impacts.t, run.t[-1:], rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion.impacts.energy, [3.0 * G * (height(0.1) - 0.5)], rtol=1e-9)
    rate = run.y[1, -1]  # P_1 + P_2 = -m 0.3 phi', 0.3 (P_2 - P_1) = -I phi'
    both, apart = -3.0 * 0.3 * rate, -0.2 * rate / 0.3
    np.testing.assert_allclose(motion.impacts.impulses[0], [(both - apart) / 2, (both + apart) / 2], rtol=1e-8)
    np.testing.assert_allclose(motion.qd[-1], 0.0, atol=1e-12)
    assert {name: str(words[-1]) for name, words in motion.contacts.items()} == {"f1": "carries", "f2": "carries"}


@pytest.mark.slow
def test_a_table_in_space_falls_on_two_of_its_feet_and_rocks_to_rest():
    """Tilted about two feet 0.6 m from the others, it falls upright, as no floor holds it along; I + m 0.3^2 turns.

    The other two then take P = 2 0.3 phi' / (1 / m + 0.3^2 / I), and the first two lift.
    """
    mass, inertia, half, high = 10.0, 1.0, 0.3, 0.7
    top = rx.spatial.Body("table", mass, inertia=(inertia, 1.0, 1.5), centre=(0.0, 0.0, high))
    corners = {"f1": (-0.4, -half), "f2": (0.4, -half), "f3": (0.4, half), "f4": (-0.4, half)}
    feet = [
        rx.spatial.PointOnPlane(name, top, "ground", (x, y, 0.0), axis=(0.0, 0.0, 1.0), one_sided=True)
        for name, (x, y) in corners.items()
    ]
    table = rx.Mechanism([top], feet, gravity=(0.0, 0.0, -G))
    tilt = 0.05
    height = lambda phi: half * np.sin(phi) + high * np.cos(phi)  # noqa: E731
    q = [0.0, 0.0, height(tilt), np.cos(tilt / 2), np.sin(tilt / 2), 0.0, 0.0]
    motion = rx.simulate(table, rx.State(jnp.array(q), jnp.zeros(6)), 0.3, rtol=1e-10)

    def slope(t, y):
        arm = half * np.cos(y[0]) - high * np.sin(y[0])
        return [y[1], -mass * arm * (G - height(y[0]) * y[1] ** 2) / (inertia + mass * arm**2)]

    def lands(t, y):
        return y[0]

    lands.terminal = True
    run = solve_ivp(slope, (0.0, 1.0), [tilt, 0.0], events=lands, **EXACT)
    assert float(motion.impacts.t[0]) == pytest.approx(run.t[-1], abs=1e-9)
    closing, yields = 2 * half * run.y[1, -1], 1 / mass + half**2 / inertia
    np.testing.assert_allclose(motion.impacts.impulses[0, 2:], -closing / yields / 2, rtol=1e-8)
    np.testing.assert_allclose(motion.impacts.impulses[0, :2], 0.0, atol=1e-12)
    assert float(motion.impacts.energy[0]) == pytest.approx(closing**2 / yields / 2, rel=1e-8)
    np.testing.assert_allclose(motion.qd[-1], 0.0, atol=1e-10)
    assert {str(words[-1]) for words in motion.contacts.values()} == {"carries"}


@pytest.mark.slow
def test_the_closure_says_at_all_times_which_feet_carry():
    """A table that stands, one of its feet too short: no row opens, but feet carry and touch in turn, as in `solve`."""
    feet = np.array([[-0.4, -0.3], [0.4, -0.3], [0.4, 0.3], [-0.4, 0.3]])
    stands = rx.System(
        lambda q, t, p: -(q[0] + feet[:, 1] * q[1] - feet[:, 0] * q[2]),
        mass=jnp.array([10.0, 0.8, 1.1]),
        load=lambda q, qd, t, p: jnp.stack([-98.1 + 0.0 * t, 20.0 * jnp.sin(3.0 * t), 20.0 * jnp.sin(5.0 * t)]),
        coordinates=["linear", "angular", "angular"],
        rows="force",
        m=4,
        one_sided=range(4),
    )
    short = rx.Compliance(jnp.diag(jnp.array([1.0, 2.0, 1.5, 0.7])) * 1e-6, jnp.array([-6e-5, 0.0, 0.0, 0.0]))
    motion = rx.simulate(stands, rx.State(jnp.zeros(3), jnp.zeros(3)), 2.0, closure=short, ts=np.linspace(0, 2, 21))
    seen = set()
    for k, t in enumerate(motion.t):
        solved = rx.solve(stands, rx.State(jnp.zeros(3), jnp.zeros(3), t), closure=short)
        np.testing.assert_allclose(motion.multipliers[k], solved.multipliers, rtol=0, atol=1e-9 * 98.1)
        assert {name: words[k] for name, words in motion.contacts.items()} == solved.contacts
        seen |= set(solved.contacts.values())
    assert seen == {"carries", "touches"} and motion.impacts.t.size == 0
    assert motion.stats.energy_error < 1e-9


def rough(mu, *state, **more):
    """A block of 3 kg on two feet that rub, 0.6 m apart and 0.5 m below its centre."""
    feet = [
        rx.PinInSlot(name, "block", "ground", (x, -0.5), (0, 0), (0, 1), rx.Coulomb(mu), one_sided=True)
        for name, x in (("f1", -0.3), ("f2", 0.3))
    ]
    block = rx.Mechanism([rx.Body("block", 3.0, 0.2)], feet, gravity=(0.0, -G))
    return rx.simulate(block, rx.State(*map(jnp.asarray, state)), 1.0, rtol=1e-10, **more)


@pytest.mark.slow
def test_a_block_falls_slides_and_rocks_to_rest():
    """Friction has an impulse: mu that of the feet as long as they slide, and what holds a foot that sticks."""
    fallen = rough(0.2, [0.0, 0.6, 0.0], [1.0, 0.0, 0.0])
    fall = np.sqrt(2 * 0.1 / G)
    np.testing.assert_allclose(fallen.impacts.t, [fall], rtol=0, atol=1e-9)
    rate = 1.0 - 0.2 * G * fall  # dx' = -mu dy'
    lost = 3.0 / 2 * ((G * fall) ** 2 + 1.0 - rate**2)
    assert float(fallen.impacts.energy[0]) == pytest.approx(lost, rel=1e-9)
    assert float(fallen.q[-1, 0]) == pytest.approx(fall + rate**2 / (2 * 0.2 * G), abs=1e-9)
    np.testing.assert_allclose(fallen.friction[20], -0.2 * fallen.multipliers[20], rtol=1e-9)
    np.testing.assert_allclose(fallen.friction[-1], 0.0, atol=1e-9)
    # Housner's block: it turns about one foot, then the other, and each landing leaves one part of its rate.
    inertia = 0.2 + 3.0 * (0.3**2 + 0.5**2)
    part = (0.2 + 3.0 * (0.5**2 - 0.3**2)) / inertia
    turned = np.array([[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]]) @ [0.3, 0.5] - [0.3, 0.0]
    rocks = rough(0.9, [*turned, 0.1], [0.0, 0.0, 0.0], max_phases=100)

    def lands(t, y):
        return y[0]

    lands.terminal, lands.direction = True, -1
    slope = lambda t, y: [y[1], -3.0 * G * (0.3 * np.cos(y[0]) - 0.5 * np.sin(y[0])) / inertia]  # noqa: E731
    t, y, times, rates = 0.0, [0.1, 0.0], [], []
    for _ in range(4):
        run = solve_ivp(slope, (t, 2.0), y, events=lands, **EXACT)
        t, rate = run.t[-1], -run.y[1, -1]
        times.append(t)
        rates.append(rate)
        y = [0.0, part * rate]  # of the other foot, seen from behind
    np.testing.assert_allclose(rocks.impacts.t[:4], times, rtol=0, atol=1e-9)
    energy = inertia / 2 * np.array(rates) ** 2 * (1 - part**2)
    np.testing.assert_allclose(rocks.impacts.energy[:4], energy, rtol=1e-7)
    np.testing.assert_allclose(rocks.qd[-1], 0.0, atol=1e-9)
    assert {str(words[-1]) for words in rocks.contacts.values()} == {"carries"}
    assert rocks.stats.energy_error < 1e-8


@pytest.mark.slow
def test_a_gear_train_with_backlash_is_reversed():
    """A torque T (t / t_0 - 1) turns round at t_0: the pinion flies through the backlash, and takes the wheel along."""
    base, torque, turn, light, heavy = 0.02 * np.cos(np.pi / 9), 1e-2, 0.02, 1e-4, 4e-4 / 2**2
    pins = [rx.Revolute("p", "a", "ground", (0, 0), (0, 0)), rx.Revolute("w", "b", "ground", (0, 0), (0.06, 0))]
    mesh = rx.GearPair("mesh", "a", "b", (0, 0), (0, 0), (20, 40), 0.002, backlash=1e-4)

    def turns(i, j, t, p):
        moment = p * (t / 0.02 - 1)
        return rx.Wrench(jnp.zeros(2), moment), rx.Wrench(jnp.zeros(2), -moment)

    motor = rx.LoadFunction("a", turns, parameters=torque)
    train = rx.Mechanism([rx.Body("a", 0.5, 1e-4), rx.Body("b", 1.0, 4e-4)], [*pins, mesh], loads=[motor])
    begin = rx.assemble(train, {"b.x": 0.06}, closed="mesh.right")
    motion = rx.simulate(train, begin, 0.06, ts=np.linspace(0, 0.06, 13), rtol=1e-10)
    flight = (6 * turn * light * 1e-4 / (torque * base)) ** (1 / 3)
    np.testing.assert_allclose(motion.impacts.t, [turn + flight], rtol=0, atol=1e-9)
    gained = torque * flight**2 / (2 * turn * light)
    lost = light * heavy / (light + heavy) * gained**2 / 2
    assert float(motion.impacts.energy[0]) == pytest.approx(lost, rel=1e-8)
    times = np.asarray(motion.t)
    together = np.select([times < turn, times > turn + flight], [-1, 1], 0)
    assert set(motion.contacts["mesh.right"][together == -1]) == {"carries"}
    assert set(motion.contacts["mesh.left"][together == 1]) == {"carries"}
    momentum = torque * ((0.06 - turn) ** 2 - turn**2) / (2 * turn)
    np.testing.assert_allclose(motion["a.phi'"][-1], momentum / (light + heavy), rtol=1e-9)
    np.testing.assert_allclose(motion["b.phi'"][-1], -momentum / (light + heavy) / 2, rtol=1e-9)


def bounced(figures, **more):
    """Height and velocity of a ball after one bounce, and when that was, by restitution, height and gravity."""
    e, height, gravity = figures
    begin = rx.State(jnp.stack([0.0 * height, height]), jnp.array([1.0, 0.0]))
    motion = rx.simulate(ball(gravity), begin, 0.9, ts=[0.9], restitution=e, max_phases=3, throw=False, **more)
    return jnp.stack([motion.q[0, 1], motion.qd[0, 1], motion.impacts.t[0]])


def by_hand(figures):
    e, height, gravity = figures
    first = jnp.sqrt(2 * height / gravity)
    rate, since = e * gravity * first, 0.9 - first
    return jnp.stack([rate * since - gravity / 2 * since**2, rate - gravity * since, first])


FIGURES = jnp.array([0.5, 1.0, G])


@pytest.mark.slow
def test_derivative_by_the_height_alone():
    """y = v (t - t_1) - g (t - t_1)^2 / 2 after the first impact, with v = g t_1 / 2 and t_1 = (2 h / g)^(1/2)."""

    def height(h):
        state = rx.State(jnp.stack([0.0 * h, h]), jnp.array([1.0, 0.0]))
        return rx.simulate(ball(), state, 0.5, restitution=0.5, adjoint=diffrax.ForwardMode(), ts=[0.5]).q[-1, 1]

    found = jax.jvp(height, (jnp.asarray(1.0),), (jnp.ones(()),))[1]
    t1 = np.sqrt(2 / G)
    np.testing.assert_allclose(found, (1.5 * (0.5 - t1) - 0.5 * t1) / t1, rtol=1e-9)


@pytest.mark.slow
def test_derivatives_through_an_impact():
    truth = jax.jacfwd(by_hand)(FIGURES)
    forward = jax.jacfwd(lambda x: bounced(x, adjoint=diffrax.ForwardMode()))(FIGURES)
    np.testing.assert_allclose(forward, truth, rtol=1e-9, atol=1e-9)
    reverse = jax.grad(lambda x: bounced(x)[0])(FIGURES)
    np.testing.assert_allclose(reverse, truth[0], rtol=1e-9)


@pytest.mark.slow
def test_a_batch_of_bounces():
    many = jnp.array([[0.5, 1.0, G], [0.5, 1.2, G], [0.6, 1.0, 10.0], [0.5, 5.0, G]])
    found = jax.jit(jax.vmap(bounced))(many)
    np.testing.assert_allclose(found[:3], jax.vmap(by_hand)(many[:3]), rtol=1e-9)
    height, rate, first = found[3]  # still falls
    np.testing.assert_allclose([height, rate], [5.0 - G / 2 * 0.9**2, -G * 0.9], rtol=1e-10)
    assert jnp.isnan(first)


@pytest.mark.slow
def test_bristles_slide_and_lift_and_a_landing_on_them_is_not_answered():
    """v' = -N s z / m, z' = v - s |v| z / mu, N = m g - F; then a flight with v as it is."""
    mass, mu, stiffness, peak, w = 2.0, 0.3, 200.0, 30.0, 4.0
    lift = rx.LoadFunction(
        "b",
        lambda i, j, t, p: (
            rx.Wrench(jnp.stack([0.0 * t, peak * jnp.sin(w * t)]), 0.0 * t),
            rx.Wrench(jnp.zeros(2), 0.0 * t),
        ),
    )
    foot = rx.PinInSlot("foot", "b", "ground", (0, 0), (0, 0), (0, 1), rx.Dahl(mu, stiffness), one_sided=True)
    particle = rx.Mechanism([rx.Body("b", mass, 0.1)], [foot], loads=[lift], gravity=(0.0, -G))
    start = rx.State(jnp.zeros(3), jnp.array([1.0, 0.0, 0.0]))
    motion = rx.simulate(particle, start, 1.5, rtol=1e-10, ts=[0.1, 0.3, 1.4], throw=False)
    off = np.arcsin(mass * G / peak) / w

    def slope(t, y):
        force = (mass * G - peak * np.sin(w * t)) * stiffness * y[2]
        return [y[1], -force / mass, y[1] - stiffness * abs(y[1]) * y[2] / mu]

    x, v, _ = solve_ivp(slope, (0.0, off), [0.0, 1.0, 0.0], **EXACT).y[:, -1]
    np.testing.assert_allclose(motion["b.x"][1], x + v * (0.3 - off), rtol=0, atol=1e-9)
    flies = lambda t: (  # noqa: E731
        peak / mass / w * (np.cos(w * off) * (t - off) - (np.sin(w * t) - np.sin(w * off)) / w) - G / 2 * (t - off) ** 2
    )
    lands = brentq(flies, off + 0.1, 1.5, xtol=1e-14)
    assert motion.result == rx.RESULTS.impulse_unknown and np.isnan(motion.q[2, 0]) and motion.impacts.t.size == 0
    assert float(motion.stats.end) == pytest.approx(lands, abs=1e-9)


def test_what_motions_with_contacts_cannot_be_asked():
    with pytest.raises(rx.RedundaxError, match="`stabilisation` and `rank` must be left out"):
        rx.simulate(ball(), dropped(), 1.0, stabilisation=rx.NoStabilisation())
    with pytest.raises(rx.RedundaxError, match="`restitution` must be between 0, plastic, and 1"):
        rx.simulate(ball(), dropped(), 1.0, restitution=1.5)
    with pytest.raises(rx.RedundaxError, match="`restitution` must hold names of contacts, but holds 'floor'"):
        rx.simulate(ball(), dropped(), 1.0, restitution={"floor": 0.5})


@pytest.mark.parametrize("mu", [pytest.param(0.3, marks=pytest.mark.slow), 1.2])
def test_a_rod_that_strikes_says_whether_its_impact_is_the_only_one(mu):
    """By friction mu P a foot pulls itself into the floor if the rod leans: P = P_0 +- mu P n M^-1 t / n M^-1 n."""
    mass, inertia, across, high = 1.0, 0.02, 0.15, 0.3
    rod = rx.Body("rod", mass, inertia)
    foot = rx.PinInSlot(
        "foot", "rod", "ground", (across, -high), (0.0, 0.0), (0.0, 1.0), friction=rx.Coulomb(mu), one_sided=True
    )
    begin = rx.State([0.0, high + 0.02, 0.0], [4.0, 0.0, 0.0])
    motion = rx.simulate(rx.Mechanism([rod], [foot], gravity=(0.0, -G)), begin, 0.07, ts=[0.07], restitution=0.5)
    assert motion.impacts.t.size == 1
    adds = mu * across * high / inertia / (1 / mass + across**2 / inertia)
    np.testing.assert_allclose(motion.stats.contraction, adds, rtol=1e-9)
    assert (adds < 1) == (mu == 0.3)  # and of several, one is gone on with
