"""Drives in single precision: a crank slider whose slider has two guides, against the powers of its parts

By the angle of the crank all places x of the parts are known, and without friction the torque is

    tau = sum M x' (x' angle'' + x'' angle'^2) + sum m g y',
"""

import numpy as np
import pytest

import redundax as rx

pytestmark = pytest.mark.usefixtures("float32")
CRANK, ROD = 0.1, 0.26
MASSES = {"crank": (1.0, 0.02), "rod": (1.0, 0.02), "slider": (2.0, 0.01)}
GUESS = {"crank.phi": 0.3, "rod.x": 0.35, "rod.phi": -0.06, "slider.x": 0.61}
TS = np.linspace(0.0, 2.0, 41)


def slider_crank(**rubs):
    guides = [
        rx.Translational(name, "slider", "ground", at, at, (0.0, 1.0), **rubs)
        for name, at in (("K", (0.0, 0.0)), ("L", (0.2, 0.0)))
    ]
    pins = [
        rx.Revolute("A", "crank", "ground", (0.0, 0.0), (0.0, 0.0)),
        rx.Revolute("B", "rod", "crank", (-ROD / 2, 0.0), (CRANK, 0.0)),
        rx.Revolute("C", "slider", "rod", (0.0, 0.0), (ROD / 2, 0.0)),
    ]
    bodies = [rx.Body(name, *weight) for name, weight in MASSES.items()]
    return rx.Mechanism(bodies, [*pins, *guides], gravity=(0.0, -9.81))


def torque(angle, rate, change):
    """In float64, with differences of places."""

    def places(angle):
        lean = -np.arcsin(CRANK * np.sin(angle) / ROD)
        x, y = CRANK * np.cos(angle), CRANK * np.sin(angle)
        along = [x + ROD / 2 * np.cos(lean), y + ROD / 2 * np.sin(lean), lean, x + ROD * np.cos(lean)]
        return np.stack([angle, *along])

    h, (rod, slider) = 1e-3, (MASSES["rod"], MASSES["slider"])
    masses = np.array([MASSES["crank"][1], rod[0], rod[0], rod[1], slider[0]])[:, None]
    ahead, here, behind = (places(angle + s) for s in (h, 0.0, -h))
    first, second = (ahead - behind) / (2 * h), (ahead - 2 * here + behind) / h**2
    return np.sum(masses * first * (first * change + second * rate**2), axis=0) + rod[0] * 9.81 * first[2]


def test_the_torque_of_a_crank_held_twice():
    run = rx.drive(slider_crank(), {"A.angle": rx.Polynomial([0.3, 3.0, 1.0])}, TS, GUESS)
    assert run["A.angle torque"].dtype == run.q.dtype == np.float32
    truth = torque(0.3 + 3.0 * TS + TS**2, 3.0 + 2.0 * TS, 2.0)
    np.testing.assert_allclose(run["A.angle torque"], truth, atol=2e-4 * np.abs(truth).max())
    assert run.determined.all()


def test_the_motor_gives_the_power_that_friction_takes():
    rubbing, law = slider_crank(friction=rx.Coulomb(0.1), guide_length=0.1), {"A.angle": rx.Polynomial([0.3, 3.0])}
    run, smooth = (rx.drive(each, law, TS, GUESS) for each in (rubbing, slider_crank()))
    given = 3.0 * np.asarray(run["A.angle torque"] - smooth["A.angle torque"])
    taken = np.abs(np.asarray(run["tau K"] + run["tau L"]) * np.asarray(run["slider.x'"]))
    np.testing.assert_allclose(given, taken, atol=1e-3 * taken.max())
    assert not run.determined.any() and run.determined_without_friction.all()


def test_coordinates_left_free_are_named():
    pins = [
        rx.Revolute("a", "one", "ground", (-0.5, 0.0), (0.0, 0.0)),
        rx.Revolute("b", "two", "one", (-0.5, 0.0), (0.5, 0.0)),
    ]
    arm = rx.Mechanism([rx.Body("one", 1.0, 0.1), rx.Body("two", 1.0, 0.1)], pins)
    with pytest.raises(rx.RedundaxError, match=r"1 is left at the first position: .*b\.angle"):
        rx.drive(arm, {"a.angle": rx.Harmonic(0.2, 1.0)}, TS, {"one.x": 0.5, "two.x": 1.5})


@pytest.mark.parametrize("begin", [0.0, 1e5])  # a clock of 128 steps a second, which smaller ones do not move
def test_a_motion_ends_at_the_dead_centre_alone(begin):
    """A rod that is shorter than the crank lets it turn to where its sine is their ratio."""
    rod = 0.08
    pins = [
        rx.Revolute("A", "crank", "ground", (0.0, 0.0), (0.0, 0.0)),
        rx.Revolute("B", "rod", "crank", (-rod / 2, 0.0), (CRANK, 0.0)),
        rx.Revolute("C", "slider", "rod", (0.0, 0.0), (rod / 2, 0.0)),
        rx.Translational("K", "slider", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0)),
    ]
    press = rx.Mechanism([rx.Body(name, *weight) for name, weight in MASSES.items()], pins)
    guess = {"rod.x": CRANK + rod / 2, "slider.x": CRANK + rod}
    ts = begin + np.linspace(0.0, 2.0, 101)
    run = rx.drive(press, {"A.angle": rx.Polynomial([-begin, 1.0])}, ts, guess, throw=False)
    reached = np.asarray(run.t)[np.isfinite(np.asarray(run.q)).all(axis=1)]
    assert abs(reached[-1] - begin - np.arcsin(rod / CRANK)) < 0.03
