"""Peaks between the times, and their derivatives, against the closed form of an arm."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import redundax as rx

LENGTH, INERTIA, G, SIZE, RATE = 0.5, 0.1, 9.81, 0.7, 2 * np.pi  # m, kg m^2, m/s^2, rad, rad/s
LAW = {"pin.angle": rx.Harmonic(SIZE, frequency=1.0)}
START = {"arm.x": LENGTH}


class Swing:
    """An object that hides what its law is of."""

    def __init__(self, size):
        self.size = size

    def at(self, t):
        return self.size * jnp.sin(RATE * t)


def arm(mass):
    pin = rx.Revolute("pin", "arm", "ground", (-LENGTH, 0.0), (0.0, 0.0))
    return rx.Mechanism([rx.Body("arm", mass, INERTIA)], [pin], gravity=(0.0, -G))


def torque(mass, t):
    angle = SIZE * np.sin(RATE * t)
    return -(INERTIA + mass * LENGTH**2) * RATE**2 * angle + mass * G * LENGTH * np.cos(angle)


def best():
    return minimize_scalar(lambda t: -abs(torque(2.0, t)), bounds=(0.5, 1.0), options={"xatol": 1e-12})


def run_at(ts, mass=2.0):
    return rx.drive(arm(mass), LAW, ts, START)


def test_figures_of_a_run_compile_nothing(programs):
    run = run_at(np.linspace(0.0, 1.0, 12))
    programs.clear()
    assert all((run.peak, run.peak_time, run.rms, run.power, run.energy, str(run)))
    assert run["pin.angle torque"].shape == run["pin.angle energy"].shape == run.t.shape
    assert not programs


def test_a_peak_between_the_times_is_found_with_its_time():
    ts = np.linspace(0.0, 1.0, 12)
    run, wanted = rx.with_peaks(run_at, ts), best()
    assert len(run.t) == 13
    assert float(run.peak_time["pin.angle"]) == pytest.approx(wanted.x, abs=1e-4)
    assert float(run.peak["pin.angle"]) == pytest.approx(-wanted.fun, rel=1e-8)
    assert float(run_at(ts).peak["pin.angle"]) < -0.999 * wanted.fun


@pytest.mark.slow
def test_the_derivative_of_a_peak_is_that_at_its_time():
    wanted = best()
    ts = np.array([0.0, wanted.x, 1.0])
    slope = jax.jacfwd(lambda mass: run_at(ts, mass).peak["pin.angle"])(jnp.asarray(2.0))
    angle = SIZE * np.sin(RATE * wanted.x)
    assert float(slope) == pytest.approx(-(LENGTH**2) * RATE**2 * angle + G * LENGTH * np.cos(angle), rel=1e-6)

    def given(law):
        return rx.drive(arm(2.0), {"pin.angle": law}, ts, START)["pin.angle torque"][1]

    slope = jax.jacfwd(lambda size: given(lambda t: size * jnp.sin(RATE * t)))(SIZE)
    wave = np.sin(RATE * wanted.x)
    wanted = -wave * ((INERTIA + 2.0 * LENGTH**2) * RATE**2 + 2.0 * G * LENGTH * np.sin(angle))
    assert float(slope) == pytest.approx(wanted, rel=1e-6)
    with pytest.raises(rx.RedundaxError, match="reads it from outside"):
        jax.jacfwd(lambda size: given(Swing(size).at))(SIZE)
    with pytest.raises(rx.RedundaxError, match="traced"):
        jax.jit(lambda mass: rx.with_peaks(lambda at: run_at(at, mass), ts).peak)(2.0)


@pytest.mark.slow
def test_figures_without_an_answer_have_derivatives_of_nan():
    """They were 0 of a peak and of forces that are NaN, as of an optimum: a rod pulls the arm out of its reach."""

    def figures(mass):
        rod = rx.DistanceDriver("rod", "arm", "ground", (LENGTH, 0.0), (2.0, 0.0), rx.Polynomial([1.5, 1.7]))
        pin = rx.Revolute("pin", "arm", "ground", (-LENGTH, 0.0), (0.0, 0.0))
        raised = rx.Mechanism([rx.Body("arm", mass, INERTIA)], [pin, rod], gravity=(0.0, -G))
        guess = {"arm.x": 0.4, "arm.y": 0.3, "arm.phi": 0.7}
        run = rx.drive(raised, {}, np.linspace(0.0, 1.0, 4), guess, throw=False)
        return jnp.append(run.forces[:, 0], run.peak["rod"])

    value, slope = jax.jit(lambda mass: jax.jvp(figures, (mass,), (1.0,)))(2.0)
    np.testing.assert_array_equal(np.isnan(value), [False, False, False, True, True])
    np.testing.assert_array_equal(np.isnan(slope), np.isnan(value))


def test_two_times_that_rounding_alone_tells_apart_have_one_answer():
    """Rates at the ends of such an interval say nothing of how they change."""
    ts = np.array([0.0, 0.1, 0.1 + 1e-16, 0.2, np.nextafter(0.2, 1.0), 0.3])
    run = run_at(ts)
    np.testing.assert_allclose(run["pin.angle torque"], torque(2.0, ts), rtol=1e-10)


def test_a_function_that_gives_no_run_is_refused_by_name():
    with pytest.raises(rx.RedundaxError, match="`run_at` must be a function that gives a `Run`, but is"):
        rx.with_peaks(lambda ts: run_at(ts).peak, [0.0, 1.0])
