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
