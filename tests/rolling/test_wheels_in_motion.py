"""Wheels that lift off and land in motions, against closed forms."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import redundax as rx

pytestmark = pytest.mark.slow
G, R, MASS, INERTIA = 9.81, 0.3, 2.0, 0.1
PART = INERTIA / (MASS * R**2)
TOP = 2.0  # m, radius of a round crest


def test_a_wheel_lands_and_rolls():
    """What it hits takes its slip: m (v+ - v) = P and I (w+ - w) = R P, v+ = -R w+. A rebound is that of the height."""
    tyre = rx.Wheel("tyre", "disc", "ground", (0, 0), (0, 0), (0, 1), R, one_sided=True)
    disc = rx.Mechanism([rx.Body("disc", MASS, INERTIA)], [tyre], gravity=(0.0, -G))
    start = rx.assemble(disc, {"disc.y": R + 0.1}, {"disc.x": 1.0, "disc.phi": 2.0})
    fall = np.sqrt(0.2 / G)
    for restitution in (0.0, 0.5):
        motion = rx.simulate(disc, start, 0.25, restitution=restitution, ts=[0.1, 0.25], rtol=1e-10)
        rolls = (1.0 - PART * R * 2.0) / (1 + PART)
        rebound = restitution * G * fall
        np.testing.assert_allclose(motion.impacts.t, [fall], rtol=0, atol=1e-12)
        since = 0.25 - fall
        up = 0.0 if restitution == 0 else rebound - G * since
        np.testing.assert_allclose(motion.qd[-1], [rolls, up, -rolls / R], rtol=0, atol=1e-12)
        slip = (1.0 + R * 2.0) ** 2 * MASS * PART / (1 + PART) / 2
        lost = slip + MASS / 2 * ((G * fall) ** 2 - rebound**2)
        assert float(motion.impacts.energy[0]) == pytest.approx(lost, rel=1e-12)
        word = "carries" if restitution == 0 else "open"
        assert [str(x) for x in motion.contacts["tyre"]] == ["open", word]


class OnCrest(rx.AbstractJoint):
    """A disc of body i rolls on a circle about the origin of body j."""

    row_kinds = (("normal", "force"), ("along", "force"))
    pushing = ("normal",)
    velocity_rows = ("along",)
    one_sided = True
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)

    def residual(self, i, j, t):
        return jnp.stack([TOP + R - jnp.linalg.norm(i.r - j.r), jnp.zeros(())])

    def rolled(self, i, j, from_i, from_j):
        away = from_i.r - from_j.r
        n = away / jnp.linalg.norm(away)
        touches = from_i.r - R * n
        parted = i.point(from_i.local(touches)) - j.point(from_j.local(touches))
        return jnp.stack([jnp.zeros(()), jnp.stack([-n[1], n[0]]) @ parted])


def test_a_wheel_rolls_over_a_crest_and_takes_off():
    """From rest at an angle a_0: (1 + k) v^2 = 2 g L (cos a_0 - cos a), and v^2 = g L cos a where its load is zero."""
    disc = rx.Mechanism([rx.Body("disc", MASS, INERTIA)], [OnCrest("tyre", "disc", "ground")], gravity=(0.0, -G))
    first, length = 0.3, TOP + R
    leaves = np.arccos(2 * np.cos(first) / (3 + PART))
    rate = lambda a: np.sqrt(2 * G * (np.cos(first) - np.cos(a)) / (length * (1 + PART)))  # noqa: E731
    way = np.sqrt(leaves - first)  # a = a_0 + s^2 takes the root out
    time = quad(lambda s: 2 * s / rate(first + s * s), 0.0, way, epsabs=1e-13, epsrel=1e-13)[0]
    start = rx.State(length * jnp.array([np.sin(first), np.cos(first), 0.0]), jnp.zeros(3))
    motion = rx.simulate(disc, start, time + 0.3, ts=[time - 1e-7, time + 1e-7, time + 0.3], rtol=1e-11)
    assert [str(x) for x in motion.contacts["tyre"]] == ["carries", "open", "open"]
    assert motion.impacts.t.size == 0
    speed = length * rate(leaves)
    out, along = np.array([np.sin(leaves), np.cos(leaves)]), np.array([np.cos(leaves), -np.sin(leaves)])
    flown = length * out + speed * 0.3 * along - np.array([0.0, G * 0.3**2 / 2])
    np.testing.assert_allclose(motion.q[-1, :2], flown, rtol=0, atol=1e-8)
    np.testing.assert_allclose(motion.qd[-1], [speed * along[0], speed * along[1] - G * 0.3, -speed / R], atol=1e-8)
    assert motion.stats.energy_error < 1e-9


def test_a_wheel_lifts_off_a_table_that_shakes_and_lands_on_it():
    """A table at a sin w t: the wheel leaves it where a w^2 sin w t = g, and meets it as both are as high again."""
    peak, w = 0.05, 20.0
    guide = rx.Translational("guide", "table", "ground", (0.0, 0.0), (0.0, 0.0), (1.0, 0.0))
    drive = rx.DistanceDriver("drive", "table", "ground", (0.0, 0.0), (0.0, -2.0), lambda t: 2 + peak * jnp.sin(w * t))
    tyre = rx.Wheel("tyre", "disc", "table", (0, 0), (0, 0), (0, 1), R, one_sided=True)
    bodies = [rx.Body("table", 5.0, 0.1), rx.Body("disc", MASS, INERTIA)]
    machine = rx.Mechanism(bodies, [guide, drive, tyre], gravity=(0.0, -G))
    start = rx.assemble(machine, {"disc.y": R}, {"disc.x": 1.0, "disc.phi": -1.0 / R}, closed="tyre")
    motion = rx.simulate(machine, start, 0.3, rtol=1e-10, ts=np.linspace(0.0, 0.3, 31))
    off = np.arcsin(G / (peak * w**2)) / w
    table = lambda t: peak * np.sin(w * t)  # noqa: E731
    flies = lambda t: table(off) + peak * w * np.cos(w * off) * (t - off) - G * (t - off) ** 2 / 2  # noqa: E731
    lands = brentq(lambda t: flies(t) - table(t), off + 0.05, off + 0.3, xtol=1e-14)
    np.testing.assert_allclose(motion.impacts.t, [lands], rtol=0, atol=1e-9)
    t = np.asarray(motion.t)
    height = np.where((t > off) & (t < lands), flies(t), table(t))
    np.testing.assert_allclose(motion["disc.y"], R + height, rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion["disc.phi'"], -1.0 / R, rtol=1e-9)
    closing = peak * w * (np.cos(w * off) - np.cos(w * lands)) - G * (lands - off)
    assert float(motion.impacts.impulses[0, 0]) == pytest.approx(-MASS * closing, rel=1e-8)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_frame_on_a_wheel_strikes_a_wall_and_the_wheel_rolls_on(restitution):
    """Pulled by F from rest: x'' = F / (m + I / R^2) of both, and so in the impact, as the wheel cannot slip."""
    guides = [
        rx.Translational(n, "frame", "ground", (0.0, y), (0.0, y), (0.0, 1.0)) for n, y in (("A", 0.3), ("B", 0.5))
    ]
    hub = rx.Revolute("hub", "disc", "frame", (0.0, 0.0), (0.0, 0.0))
    tyre = rx.Wheel("tyre", "disc", "ground", (0.0, 0.0), (0.0, -R), (0.0, 1.0), R, rows=("along",))
    wall = rx.PinInSlot("wall", "frame", "ground", (0.2, 0.0), (1.0, 0.0), (-1.0, 0.0), one_sided=True)
    bodies, loads = (
        [rx.Body("frame", 5.0, 0.2), rx.Body("disc", MASS, INERTIA)],
        [rx.AppliedForce("frame", (20.0, 0.0))],
    )
    machine = rx.Mechanism(bodies, [*guides, hub, tyre, wall], loads=loads, gravity=(0.0, -G))
    motion = rx.simulate(machine, rx.assemble(machine, {}), 1.6, restitution=restitution)
    whole = 5.0 + MASS + INERTIA / R**2
    rate = 20.0 / whole
    strikes = np.sqrt(1.6 / rate)
    speed = rate * strikes
    np.testing.assert_allclose(motion.impacts.t, [strikes], rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion.impacts.impulses, [[whole * speed * (1 + restitution)]], rtol=1e-9)
    since = np.maximum(np.asarray(motion.t) - strikes, 0.0)
    back = -restitution * speed * since + rate * since**2 / 2 * (restitution > 0)
    way = rate * np.minimum(np.asarray(motion.t), strikes) ** 2 / 2
    np.testing.assert_allclose(motion["frame.x"], way + back, rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion["disc.phi"], -motion["frame.x"] / R, rtol=0, atol=1e-9)


def test_a_drive_of_speed_lifts_a_ram_off_its_foot_and_puts_it_down_if_steps_are_fine():
    """Up and down by 1 - cos of the time: foot and drive share the weight, and the drive alone bears m (g + v')."""
    rise, begins, turns, ends = 2 * np.pi / 0.4, 0.1, 0.5, 0.9

    def speed(t):
        once = lambda start: 1 - jnp.cos(rise * jnp.clip(t - start, 0.0, 0.4))  # noqa: E731
        return -0.25 * (once(begins) - once(turns))  # travel counts down

    sleeves = [
        rx.Translational(n, "ram", "ground", (x, 0.0), (x, 0.0), (1.0, 0.0)) for n, x in (("L", -0.3), ("R", 0.3))
    ]
    foot = rx.PinInSlot("foot", "ram", "ground", (0.1, -0.2), (0.0, -0.2), (0.0, 1.0), one_sided=True)
    motor = rx.SpeedDriver("motor", "L.travel", speed)
    ram = rx.Mechanism([rx.Body("ram", 10.0, 0.3)], [*sleeves, foot], couplers=[motor], gravity=(0.0, -G))
    start = rx.assemble(ram, {})
    motion = rx.simulate(ram, start, 1.2, rtol=1e-12)
    times = np.asarray(motion.t)
    up, down = (np.clip(times - at, 0.0, 0.4) for at in (begins, turns))
    height = 0.25 * (up - np.sin(rise * up) / rise - down + np.sin(rise * down) / rise)
    np.testing.assert_allclose(motion["ram.y"], height, rtol=0, atol=1e-11)
    flies, lies = (times > begins + 5e-3) & (times < ends - 5e-3), (times < begins) | (times > ends + 5e-3)
    assert set(motion.contacts["foot"][flies]) == {"open"} and set(motion.contacts["foot"][lies]) == {"carries"}
    change = 0.25 * rise * (np.sin(rise * up) - np.sin(rise * down))
    np.testing.assert_allclose(motion["motor.speed"][flies], 10.0 * (G + change)[flies], rtol=1e-9)
    np.testing.assert_allclose((motion["motor.speed"] + motion["foot.perpendicular"])[lies], 10.0 * G, rtol=1e-12)
    assert motion.impacts.t.size == 0


@pytest.mark.parametrize("one_sided", [False, True])
def test_a_motorcycle_on_a_third_support_rolls(one_sided):
    """One normal load is redundant, and no row of rolling: sum N = m g, sum x N = sum (m x g - m h a) - 2 I a / R."""
    bodies = [rx.Body("frame", 150.0, 20.0), rx.Body("rear", 10.0, 0.5), rx.Body("front", 10.0, 0.5)]
    places = {"rear": -0.6, "front": 0.8}
    hubs = [rx.Revolute(f"{k} hub", k, "frame", (0.0, 0.0), (x, -0.5)) for k, x in places.items()]
    tyres = [
        rx.Wheel(f"{k} tyre", k, "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), R, one_sided=one_sided) for k in places
    ]
    stand = rx.PinInSlot("stand", "frame", "ground", (0.1, -0.8), (0.0, 0.0), (0.0, 1.0), one_sided=one_sided)
    motor = rx.SpeedDriver("motor", "rear hub.angle", rx.Polynomial([0.0, -5.0]))
    machine = rx.Mechanism(bodies, [*hubs, *tyres, stand], couplers=[motor], gravity=(0.0, -G))
    guess = {"frame.y": 0.8, "rear.x": -0.6, "front.x": 0.8, "rear.y": R, "front.y": R}
    motion = rx.simulate(machine, rx.assemble(machine, guess), 0.4)
    rate, times = 5.0 * R, np.asarray(motion.t)
    np.testing.assert_allclose(motion["frame.x"], rate * times**2 / 2, rtol=0, atol=1e-10)
    np.testing.assert_allclose(motion["front.phi"], -motion["frame.x"] / R, rtol=0, atol=1e-10)
    loads = np.array([motion["rear tyre.normal"], motion["front tyre.normal"], motion["stand.perpendicular"]])
    assert loads.min() > 0
    np.testing.assert_allclose(loads.sum(axis=0), 170.0 * G, rtol=1e-10)
    moment = 2.0 * G - (150.0 * 0.8 + 20.0 * R) * rate - 2 * 0.5 * rate / R
    np.testing.assert_allclose(np.array([-0.6, 0.8, 0.1]) @ loads, moment, rtol=0, atol=1e-8)
