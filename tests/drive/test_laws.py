"""Laws of time against what their names promise, phase by phase."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import BPoly, CubicSpline

import redundax as rx

EPS = np.finfo(float).eps
TABLE = [0.0, 1.0, 2.0], [0.0, 1.0, 0.0]


def derivatives(law, ts, order=2):
    """The law and its derivatives by time."""
    functions = [law]
    for _ in range(order):
        functions.append(jax.grad(functions[-1]))
    return np.asarray(jax.jit(jax.vmap(lambda t: jnp.stack([f(t) for f in functions])))(jnp.asarray(ts))).T


def test_a_trapezoid_speeds_up_goes_on_and_brakes():
    """0.3 m at 0.2 m/s and 2 m/s^2: ramps of 0.1 s and 1.4 s between; derivatives are those after each kink."""
    law = rx.Trapezoid(0.3, speed=0.2, acceleration=2.0, start=-0.15, begin=0.5)
    assert float(law.duration) == pytest.approx(1.6, rel=4 * EPS)
    ts = 0.5 + np.array([-1.0, 0.0, 0.05, 0.1, 0.8, 1.5, 1.55, 1.7])
    s, v, a = derivatives(law, ts)
    np.testing.assert_allclose(s, np.array([0, 0, 0.0025, 0.01, 0.15, 0.29, 0.2975, 0.3]) - 0.15, atol=4 * EPS)
    np.testing.assert_allclose(v, [0, 0, 0.1, 0.2, 0.2, 0.2, 0.1, 0], atol=1e-14)
    np.testing.assert_allclose(a[[0, 1, 2, 4, 6, 7]], [0, 2, 2, 0, -2, 0], atol=1e-12)


def test_a_short_stroke_is_a_triangle_and_a_negative_one_goes_the_other_way():
    law = rx.Trapezoid(-0.01, speed=0.2, acceleration=2.0)
    s, v, a = derivatives(law, [0.05, np.sqrt(0.005), 0.12, 1.0])
    assert float(law.duration) == pytest.approx(2 * np.sqrt(0.005), rel=1e-14)
    np.testing.assert_allclose(s, [-0.0025, -0.005, -0.01 + (2 * np.sqrt(0.005) - 0.12) ** 2, -0.01], atol=1e-15)
    np.testing.assert_allclose(v[1], -2 * np.sqrt(0.005), rtol=1e-12)
    np.testing.assert_allclose(a[[0, 2, 3]], [-2, 2, 0], atol=1e-12)


def test_a_dwell_leads_back():
    law = rx.Trapezoid(0.3, speed=0.2, acceleration=2.0, dwell=0.4)
    assert float(law.duration) == pytest.approx(3.6, rel=4 * EPS)
    s, v, _ = derivatives(law, [1.6, 1.8, 2.8, 3.6, 4.0])
    np.testing.assert_allclose(s, [0.3, 0.3, 0.15, 0, 0], atol=1e-15)
    np.testing.assert_allclose(v, [0, 0, -0.2, 0, 0], atol=1e-14)


@pytest.mark.parametrize(
    ("stroke", "phases"),
    [  # jerk phase, phase of constant acceleration with it, phase of speed with both: D = J T1 T2 T3
        (0.3, (0.05, 0.1, 1.5)),
        (0.016, (0.05, 0.1 / 2 * (np.sqrt(1 + 16 * 0.016 / 0.02) - 1) / 2, None)),
        (0.001, ((0.001 / 80) ** (1 / 3),) * 2 + (None,)),
    ],
)
def test_an_s_curve_keeps_its_limits(stroke, phases):
    """Speed 0.2, acceleration 2, jerk 40: all reached, no constant speed, and jerk alone."""
    law = rx.SCurve(stroke, speed=0.2, acceleration=2.0, jerk=40.0)
    rise, hold, on = phases
    on = rise + hold if on is None else on
    assert float(law.duration) == pytest.approx(rise + hold + on, rel=1e-12)
    ts = np.linspace(0.0, float(law.duration), 1001)
    s, v, a, j = derivatives(law, ts, 3)
    assert v.max() <= 0.2 * (1 + 1e-12) and np.abs(a).max() <= 2 * (1 + 1e-9) and np.abs(j).max() <= 40 * (1 + 1e-6)
    assert v.max() == pytest.approx(40 * rise * hold, rel=1e-4)
    np.testing.assert_allclose(s[[0, -1]], [0, stroke], atol=1e-15)
    np.testing.assert_allclose(s + s[::-1], stroke, atol=1e-14)  # braking mirrors speeding up


def test_a_cycloid_a_harmonic_and_a_spline():
    s, v, a = derivatives(rx.Cycloidal(0.5, move=0.2), [0.0, 0.05, 0.1, 0.2])
    np.testing.assert_allclose(s, [0, 0.125 - 0.5 / (2 * np.pi), 0.25, 0.5], atol=1e-15)
    np.testing.assert_allclose(v, [0, 2.5, 5, 0], atol=1e-13)
    np.testing.assert_allclose(a, [0, 25 * np.pi, 0, 0], atol=1e-11)
    s, v, _ = derivatives(rx.Harmonic(0.1, frequency=2.0, mean=0.3), [0.0, 0.125])
    np.testing.assert_allclose([s, v], [[0.3, 0.4], [0.4 * np.pi, 0]], atol=1e-15)
    times, values = np.array([0.0, 0.3, 0.7, 1.0]), np.array([0.0, 0.2, 0.1, 0.0])
    for ends in ("clamped", "periodic", "natural", "not-a-knot"):
        law, spline = rx.Sampled(times, values, ends=ends), CubicSpline(times, values, bc_type=ends)
        ts = np.array([0.0, 0.1, 0.3, 0.65, 0.99])
        found = derivatives(law, ts)
        np.testing.assert_allclose(found, [spline(ts, k) for k in range(3)], atol=1e-13)
    by_value = jax.jit(jax.grad(lambda x: rx.Sampled(times, jnp.array([0.0, x, 0.1, 0.0]))(0.3)))(0.2)
    assert float(by_value) == pytest.approx(1.0)


@pytest.mark.parametrize("ends", [None, "periodic"])
def test_a_law_has_the_rates_and_accelerations_of_its_samples(ends):
    times, values = np.array([0.0, 0.3, 0.7, 1.0]), np.array([0.1, 0.2, 0.1, 0.1])
    rates, accelerations = np.array([1.0, 0.5, -2.0, 1.0]), np.array([3.0, 0.0, -1.0, 3.0])
    law = rx.Sampled(times, values, rates=rates, accelerations=accelerations, ends=ends)
    truth = BPoly.from_derivatives(times, np.stack([values, rates, accelerations], axis=1))
    ts = np.array([0.0, 0.1, 0.3, 0.65, 0.99])
    np.testing.assert_allclose(derivatives(law, ts), [truth.derivative(k)(ts) if k else truth(ts) for k in range(3)])
    beyond = derivatives(law, [1.0 + 1e-9])[1, 0]
    assert beyond == pytest.approx(1.0, abs=1e-6)


def test_laws_are_multiplied_and_shifted():
    law = rx.Harmonic(0.1, frequency=2.0)
    for other in (np.float64(-2.0) * law / 4 - 0.3, -(law * jnp.asarray(0.5) + 0.3)):
        np.testing.assert_allclose(derivatives(other, [0.05], 1), -0.5 * derivatives(law, [0.05], 1) - [[0.3], [0.0]])


def test_laws_are_differentiable_by_their_figures():
    """The end of a stroke, and the time it takes, by hand."""
    by = jax.jit(jax.grad(lambda d: rx.Trapezoid(d, speed=0.2, acceleration=2.0).duration))
    assert float(by(0.3)) == pytest.approx(1 / 0.2)
    assert float(by(0.01)) == pytest.approx(1 / np.sqrt(2.0 * 0.01))
    assert float(jax.jit(jax.grad(lambda d: rx.SCurve(d, 0.2, 2.0, 40.0)(9.0)))(0.3)) == pytest.approx(1.0)


def test_figures_that_are_none_are_refused():
    for make, word in (
        (lambda: rx.Trapezoid(0.3, speed=0.0, acceleration=1.0), "speed"),
        (lambda: rx.SCurve(0.3, 1.0, 1.0, jerk=-1.0), "jerk"),
        (lambda: rx.Cycloidal([0.1, 0.2], move=1.0), "stroke"),
        (lambda: rx.Sampled([0.0, 1.0], [0.0, 1.0]), "times"),
        (lambda: rx.Sampled([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], ends="free"), "ends"),
        (lambda: rx.Sampled([0.0, np.nan, 2.0], [0.0, 1.0, 0.0]), "times"),
        (lambda: rx.Sampled([0.0, 1.0, 2.0], [0.0, np.nan, 0.0]), "values"),
        (lambda: rx.Sampled([0.0, 1.0, 2.0], [0.0, 1.0, 0.1], ends="periodic"), "values"),
        (lambda: rx.Sampled([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], rates=[0.0, 1.0, 0.0]), "accelerations"),
        (lambda: rx.Sampled(*TABLE, rates=TABLE[1], accelerations=TABLE[1], ends="natural"), "ends"),
        (lambda: rx.Sampled(*TABLE, rates=[0.0, 1.0], accelerations=[0.0, 1.0, 0.0]), "rates"),
        (lambda: rx.Trapezoid(0.3, speed=1.0, acceleration=1.0, dwell=-0.1), "dwell"),
        (lambda: rx.Cycloidal(0.3, move=1.0, dwell=-0.1), "dwell"),
    ):
        with pytest.raises(rx.RedundaxError, match=f"`{word}`"):
            make()
