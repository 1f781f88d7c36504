"""Drives of machines with contacts that only push, and with joints that have play, against hand calculation."""

import itertools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq
from test_drive import BEAM, gantry

import redundax as rx

G = 9.81


def shaken(aside=0.0, couplers=(), **foot):
    """A block of 10 kg that lies on three feet on a tray of 2 kg, and a force of 50 N down on it, aside of its middle.

    The travel of the tray is down.
    """
    feet = [
        rx.PinInSlot(f"f{k}", "block", "tray", (x, -0.1), (x, 0.1), (0.0, 1.0), one_sided=True, **foot)
        for k, x in enumerate((-0.3, 0.0, 0.3))
    ]
    tray = rx.Translational("guide", "tray", "ground", (0.0, 0.0), (0.0, 0.0), (1.0, 0.0))
    side = rx.PinInSlot("side", "block", "tray", (0.0, 0.0), (0.0, 0.0), (1.0, 0.0))
    press = rx.AppliedForce("block", (0.0, -50.0), (aside, 0.0))
    bodies = [rx.Body("tray", 2.0, 0.1), rx.Body("block", 10.0, 0.4)]
    return rx.Mechanism(bodies, [tray, *feet, side], couplers=couplers, loads=[press], gravity=(0.0, -G))


def test_a_foot_that_would_pull_carries_nothing_and_one_that_lifts_ends_the_motion():
    """Of equally stiff feet one pulls where the load is more than 0.2 m aside; about the last it tips from 0.3 m on.

    All of the block lifts where the tray falls faster than 9.81 + 5 m/s^2.
    """
    rate, ts, start = 4 * np.pi, np.linspace(0.0, 0.5, 41), {"block.y": 0.2}
    falls = -0.01 * rate**2 * np.sin(rate * ts)
    run = rx.drive(shaken(0.78), {"guide.travel": rx.Harmonic(0.01, frequency=2.0)}, ts, start)
    load = 10 * (G - falls) + 50
    np.testing.assert_allclose(run["guide.travel force"], -(2 * (G - falls) + load), rtol=1e-12)
    last = 50 * 0.78 / 0.3
    feet = np.stack([np.asarray(run.multipliers)[:, k] for k in (1, 2, 3)])
    np.testing.assert_allclose(feet, [0 * load, load - last, 0 * load + last], rtol=0, atol=1e-9)

    wide = {"guide.travel": rx.Harmonic(0.12, frequency=2.0)}
    lifts = 0.25 + np.arcsin((G + 5) / (0.12 * rate**2)) / rate
    first = np.flatnonzero(ts > lifts)[0]
    with pytest.raises(rx.NoSolutionError, match=f"lift at t = {lifts:.6g}: f0, f1, f2.* or move more slowly"):
        rx.drive(shaken(), wide, ts, start)
    with pytest.raises(rx.NoSolutionError, match=f"lift at t = {lifts:.6g}: f0, f1, f2"):
        rx.drive(shaken(friction=rx.Coulomb(0.3)), wide, ts, start)  # feet that never slip
    run = rx.drive(shaken(), wide, ts, start, throw=False)
    assert np.all(np.isfinite(run.forces[:first])) and np.all(np.isnan(run.forces[first:]))
    assert "Contacts lift" in str(run)
    with pytest.raises(rx.NoSolutionError, match=r"lift at t = 0: f0, f1\. .* Press them together\. With"):
        rx.drive(shaken(1.0), {"guide.travel": rx.Harmonic(0.0, frequency=2.0)}, ts, start)  # at rest


def test_a_foot_that_would_pull_carries_nothing_beside_a_stop_that_is_open():
    ts, laws = np.linspace(0.0, 0.5, 5), {"guide.travel": rx.Harmonic(0.01, frequency=2.0)}
    machine = shaken(0.78, [rx.Stop("end", "guide.travel", least=-0.02, most=0.02)])
    run = rx.drive(machine, laws, ts, {"block.y": 0.2})
    load = 10 * (G + 0.01 * (4 * np.pi) ** 2 * np.sin(4 * np.pi * ts)) + 50
    last = 0 * load + 50 * 0.78 / 0.3
    names = "f0.perpendicular", "f1.perpendicular", "f2.perpendicular", "end.most"
    np.testing.assert_allclose([run[name] for name in names], [0 * load, load - last, last, 0 * load], atol=1e-9)


def test_a_stop_that_is_passed_between_two_times_ends_the_motion_there():
    """phi = a sin(pi t)^2, whose most is at t = 0.5, beside a stop at 2 rad."""
    rod = rx.Mechanism(
        [rx.Body("rod", 2.0, 0.1)],
        [rx.Revolute("A", "rod", "ground", (-0.5, 0.0), (0.0, 0.0))],
        couplers=[rx.Stop("s", "A.angle", least=-0.1, most=2.0)],
    )

    def driven(most, count):
        law = jax.tree_util.Partial(lambda most, t: most * jnp.sin(jnp.pi * t) ** 2, most)
        return rx.drive(rod, {"A.angle": law}, np.linspace(0.0, 1.0, count), {"rod.x": 0.5})

    for most, count in ((2.001, 12), (2.3, 8)):
        t = np.arcsin(np.sqrt(2.0 / most)) / np.pi
        with pytest.raises(rx.NoSolutionError, match=rf"reached at t = {t:.6g}: s\.most\. End"):
            driven(most, count)
    for count in (11, 12):  # it touches the stop at one of the times, and between two
        rate = 2 * np.pi**2 * 2.0 * np.cos(2 * np.pi * np.linspace(0.0, 1.0, count))
        np.testing.assert_allclose(driven(2.0, count)["A.angle torque"][:5], 0.6 * rate[:5], rtol=1e-9)


@pytest.mark.slow
def test_laws_that_close_over_traced_numbers_are_refused_beside_contacts():
    def run(size):
        return rx.drive(shaken(), {"guide.travel": lambda t: size * t}, np.linspace(0.0, 0.1, 2), {"block.y": 0.2}).t

    with pytest.raises(rx.RedundaxError, match="does not open and close inside of `jit`, `vmap` and `grad`"):
        jax.vmap(run)(np.array([0.1, 0.2]))


@pytest.mark.parametrize("play", [2e-6, pytest.param(1e-3, marks=pytest.mark.slow)])
def test_guides_with_play_let_screws_out_of_step_turn_the_beam(play):
    """The gantry of two servos 20 um out of step; its guides resist a turn only beyond their play.

    By hand F_i = k_i (u_i - x + b_i turn) in balance with the load and with 1e7 N m/rad times the turn beyond the play
    of each guide. The band is over all plays up to that.
    """
    machine, laws = gantry(), dict.fromkeys(("left.travel", "right.travel"), rx.Harmonic(0.05, frequency=1.0))
    ts, k, error, b = np.linspace(0.0, 1.0, 9), np.array([2e7, 1e7]), 20e-6, np.array([0.6, -0.6])
    servos = {"left.travel": 1 / k[0], "right.travel": (1 / k[1], error)}
    rails = dict.fromkeys(("left", "right"), (1e-9, 1e-7))
    stiff = rx.ElasticJoints(machine, rails, drives=servos, play=dict.fromkeys(("left.angle", "right.angle"), play))
    run = rx.drive(machine, laws, ts, {}, closure=stiff)
    behind = k * np.array([0.0, -error])

    def forces(need, plays):
        """For plays of both guides, which turn as stiffly."""

        def across(turn):
            return (behind.sum() - need + (k @ b) * turn) / k.sum()

        def missed(turn):
            held = 1e7 * np.sum(np.sign(turn) * np.maximum(0.0, abs(turn) - np.array(plays)))
            return (k @ b**2) * turn - (k @ b) * across(turn) + held - 60 * 0.1 + behind @ b

        turn = brentq(missed, -0.1, 0.1, xtol=1e-18, rtol=1e-14)
        return behind - k * (across(turn) - b * turn)

    total = BEAM * np.asarray(run["beam.x''"]) + 60.0
    np.testing.assert_allclose(run.forces, [forces(need, (play, play)) for need in total], rtol=1e-9)
    path = rx.band_along(run.system, run.states, "left.travel drive", stiff)
    some = list(itertools.product(np.linspace(0.0, play, 5), repeat=2))
    all_plays = -np.array([[forces(need, plays)[0] for plays in some] for need in total])
    np.testing.assert_allclose(path.lower[:, 0], all_plays.min(axis=1), rtol=1e-6)  # to which both bounds meet
    np.testing.assert_allclose(path.upper[:, 0], all_plays.max(axis=1), rtol=1e-6)
    with pytest.raises(rx.RedundaxError, match="has play"):
        rx.drive(machine, laws, ts, {}, closure=rx.LeastPeak({"left.travel": 1.0, "right.travel": 1.0}, closure=stiff))


def test_a_stop_that_is_open_bears_nothing_until_it_is_reached():
    """A rod of 2 kg and 0.1 kg m^2 about its middle 0.5 m from the pin: (0.1 + 2 0.25) 2 = 1.2 N m beside gravity's."""
    rod = rx.Mechanism(
        [rx.Body("rod", 2.0, 0.1)],
        [rx.Revolute("A", "rod", "ground", (-0.5, 0.0), (0.0, 0.0))],
        couplers=[rx.Stop("s", "A.angle", least=-0.1, most=2.0)],
        gravity=(0.0, -G),
    )
    ts = np.linspace(0.0, 1.0, 11)
    run = rx.drive(rod, {"A.angle": rx.Polynomial([0.0, 0.0, 1.0])}, ts, {"rod.x": 0.5})
    np.testing.assert_allclose(run["A.angle torque"], 1.2 + 2 * G * 0.5 * np.cos(ts**2), rtol=1e-9)
    assert not np.asarray(run["s.most"]).any()
    law = {"A.angle": rx.Polynomial([0.0, 0.0, 2.1])}
    reached = rf"reached at t = {np.sqrt(2 / 2.1):.6g}: s\.most"
    with pytest.raises(rx.NoSolutionError, match=rf"{reached}\. End the motion before"):
        rx.drive(rod, law, ts, {"rod.x": 0.5})
    run = rx.drive(rod, law, ts, {"rod.x": 0.5}, throw=False)
    assert np.isnan(run.forces[-1]).all() and np.isfinite(run.forces[:-1]).all()
    said = " ".join(str(run).split())
    assert re.search(reached, said) and "of the motion up to t = 0.9 alone" in said
    torque = 0.6 * 4.2 + 2 * G * 0.5 * np.cos(2.1 * ts[:-1] ** 2)
    assert run.peak["A.angle"] == pytest.approx(torque.max(), rel=1e-9) and run.peak_time["A.angle"] == 0
    assert run.rms["A.angle"] == pytest.approx(np.sqrt(np.trapezoid(torque**2, ts[:-1]) / 0.9), rel=1e-9)
    assert run.energy["A.angle"] == pytest.approx(np.trapezoid(torque * 4.2 * ts[:-1], ts[:-1]), rel=1e-9)


def test_a_rod_leaves_its_foot_and_comes_down_on_it_again():
    """2 kg, and 0.1 kg m^2 about its middle, 0.5 m from the pin and from the foot.

    Where it lies, f on the foot, 19.62 - f on the pin and the torque 9.81 - f have the least norm for f = 9.81.
    """

    def rod_on(**foot):
        pin = rx.Revolute("A", "rod", "ground", (-0.5, 0.0), (0.0, 0.0))
        foot = rx.PinInSlot("foot", "rod", "ground", (0.5, 0.0), (0.0, 0.0), (0.0, 1.0), one_sided=True, **foot)
        return rx.Mechanism([rx.Body("rod", 2.0, 0.1)], [pin, foot], gravity=(0.0, -G))

    rod = rod_on()
    ts, size, rate = np.linspace(0.0, 2.0, 41), 0.4, np.pi
    moves = (ts > 0.5 + 1e-9) & (ts < 1.5 - 1e-9)

    def angle(t):
        return jnp.where((t > 0.5) & (t < 1.5), size * jnp.sin(rate * (t - 0.5)) ** 3, 0.0)

    run = rx.drive(rod, {"A.angle": angle}, ts, {"rod.x": 0.5})
    sine, cosine = np.sin(rate * (ts - 0.5)), np.cos(rate * (ts - 0.5))
    phi, acceleration = size * sine**3, size * rate**2 * (6 * sine * cosine**2 - 3 * sine**3)
    torque = np.where(moves, 0.6 * acceleration + 2 * G * 0.5 * np.cos(phi), 0.0)
    np.testing.assert_allclose(run["A.angle torque"], torque, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(run["foot force y on rod"], np.where(moves, 0.0, G), rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(run.determined[:, 0], moves)
    np.testing.assert_array_equal(run.contacts["foot"], np.where(moves, "open", "carries"))
    own = rx.solve(run.system, run.states[0])
    assert own.contacts["foot"] == "carries" and own["foot force y on rod"] == pytest.approx(G, rel=1e-9)
    rough = rx.drive(rod_on(friction=rx.Coulomb(0.3)), {"A.angle": angle}, ts, {"rod.x": 0.5})
    np.testing.assert_array_equal(rough.determined[:, 0], moves)
    np.testing.assert_allclose(rough["A.angle torque"][moves], torque[moves], rtol=1e-9)

    beyond = {"A.angle": lambda t: size * jnp.sin(rate * t)}
    with pytest.raises(rx.NoSolutionError, match=r"Contacts are reached at t = 1: foot"):
        rx.drive(rod, beyond, ts, {"rod.x": 0.5})
    run, up = rx.drive(rod, beyond, ts, {"rod.x": 0.5}, throw=False), (ts > 0) & (ts < 1 - 1e-9)
    torque = 2 * G * 0.5 * np.cos(size * np.sin(rate * ts)) - 0.6 * size * rate**2 * np.sin(rate * ts)
    np.testing.assert_allclose(run["A.angle torque"][up], torque[up], rtol=1e-9)
    assert np.isnan(run.forces[ts > 1 + 1e-9]).all() and not run.determined[ts > 1 + 1e-9].any()
    assert "singular" not in str(run)


def test_guides_of_given_stiffness_share_a_load_beside_a_stop_that_is_open():
    """The slider sinks by u and turns by w, until guides at x bear its weight: (u + x w) / c up and w / r against."""
    x, (c, r) = np.array([0.06, -0.06]), np.array([[1e-8, 3e-8], [2e-6, 1e-6]])  # m, m/N, rad/(N m)
    guides = [rx.Translational(f"K{k}", "s", "ground", (x[k], 0.0), (0.0, 0.0), (0.0, 1.0)) for k in range(2)]
    stop, laws = rx.Stop("end", "K0.travel", most=5.0), {"K0.travel": rx.Polynomial([0.0, 1.0])}
    machine = rx.Mechanism([rx.Body("s", 2.0, 0.01)], guides, couplers=[stop], gravity=(0.0, -G))
    stiff = rx.ElasticJoints(machine, {f"K{k}": (c[k], r[k]) for k in range(2)})
    balance = [[np.sum(1 / c), np.sum(x / c)], [np.sum(x / c), np.sum(x**2 / c + 1 / r)]]
    u, w = np.linalg.solve(balance, [2 * G, 0.0])
    run = rx.drive(machine, laws, np.linspace(0.0, 0.2, 3), {}, closure=stiff)
    np.testing.assert_allclose(run["K0 force y on s"], (u + x[0] * w) / c[0], rtol=1e-9)
    own = rx.solve(run.system, run.states[1], closure=stiff)
    np.testing.assert_allclose(own["K1 force y on s"], (u + x[1] * w) / c[1], rtol=1e-9)


def test_the_machine_of_a_run_has_its_contacts_as_they_are_at_each_state():
    """A ram lies on a driven platform, and a stop far below it takes no part."""
    up, none = (1.0, 0.0), (0.0, 0.0)
    joints = [
        rx.Translational("G", "ram", "ground", none, none, up),
        rx.Translational("H", "low", "ground", none, none, up),
        rx.PinInSlot("lies", "ram", "low", none, none, (0.0, 1.0), one_sided=True),
        rx.PinInSlot("stop", "ram", "ground", none, (0.0, -0.5), (0.0, 1.0), one_sided=True),
    ]
    press = rx.Mechanism([rx.Body("ram", 2.0, 1.0), rx.Body("low", 1.0, 1.0)], joints, gravity=(0.0, -9.81))
    law, ts = rx.Harmonic(0.05, frequency=1.0), np.linspace(0.0, 1.0, 5)
    run = rx.drive(press, {"H.travel": law}, ts, rx.assemble(press, {}).q)
    report = rx.analyze(run.system, run.states[2])
    assert report.redundancy == 0 and report.contacts == {"lies": "carries", "stop": "open"}
    fit = rx.MisfitBox(rx.ElasticJoints(press, {"lies": 1e-8, "stop": 1e-8}), {"stop.perpendicular": (-1e-5, 1e-5)})
    band = rx.band(run.system, run.states[2], ["stop.perpendicular", "lies.perpendicular"], fit)
    np.testing.assert_allclose(band.lower, band.upper, atol=1e-12)
    np.testing.assert_allclose(band.lower, [0.0, float(run["lies.perpendicular"][2])], atol=1e-12)
    assert set(run.contacts["lies"]) == {"carries"} and set(run.contacts["stop"]) == {"open"}
