"""Identified parameters against closed forms, and against the values that noisy data were made with."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import binom
from test_simulate import pendulum
from test_stick_slip import block, where

import redundax as rx

T = np.linspace(0.0, 2.0, 21)
NOISE = 0.01 * np.random.default_rng(0).standard_normal(T.size)


def test_linear_models_have_the_closed_form():
    """(A^T A)^-1 A^T y and sigma^2 (A^T A)^-1, with a noise of its own for each measurement."""
    sigma = 0.01 * (1 + T)
    columns = np.stack([np.ones_like(T), T, T**2], axis=1)
    data = columns @ [1.0, 2.0, -0.5] + NOISE
    a, y = columns / sigma[:, None], data / sigma
    covariance = np.linalg.inv(a.T @ a)
    truth = covariance @ a.T @ y

    def predict(offset, slopes):
        return offset + slopes[0] * T + slopes[1] * T**2

    ranges = {"offset": rx.Normal(0.0, 2.0), "slopes": rx.Uniform([-3.0, -3.0], 3.0)}
    found = rx.identify(predict, data, ranges, noise=sigma)
    assert found.converged and found.names == ("offset", "slopes[0]", "slopes[1]")
    np.testing.assert_allclose(found.estimate["offset"], truth[0], rtol=0, atol=1e-3 * covariance[0, 0] ** 0.5)
    np.testing.assert_allclose(found.estimate["slopes"], truth[1:], rtol=1e-4)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-9)
    np.testing.assert_allclose(found.uncertainty["slopes"], np.sqrt(np.diag(covariance))[1:], rtol=1e-9)
    np.testing.assert_allclose(found.chi_square, np.sum((y - a @ truth) ** 2), rtol=1e-6)
    assert found.degrees == T.size - 3
    assert not found.undetermined and not found.rivals
    assert len(found.minima) == 1 and found.minima[0].searches == found.searches == 8


def swing(rate, gravity):
    system, state = pendulum(0.7, rate, gravity)
    return rx.simulate(system, state, 2.0, ts=T[1:], adjoint=diffrax.ForwardMode()).q[:, 0]


def swing_exactly(rate, gravity):
    motion = solve_ivp(
        lambda t, y: [y[1], -gravity * np.sin(y[0])], (0, 2), [0.7, rate], "DOP853", T[1:], rtol=1e-13, atol=1e-14
    )
    return np.sin(motion.y[0])


def ringing(rate, gravity):
    return jnp.exp(-rate * T) * jnp.sin(gravity * T)


@pytest.mark.parametrize(
    ("predict", "exact"), [(ringing, ringing), pytest.param(swing, swing_exactly, marks=pytest.mark.slow)]
)
def test_true_values_lie_within_the_stated_uncertainty(predict, exact):
    """Of 20 measurements: all within three, and about 68 % within one standard uncertainty."""
    truth = {"rate": 1.3, "gravity": 9.7}
    ranges = {"rate": rx.Uniform(0.5, 2.0), "gravity": rx.Uniform(9.0, 10.5)}
    clean, random, off = np.asarray(exact(**truth)), np.random.default_rng(5), []
    for _ in range(20):
        data = clean + 0.005 * random.standard_normal(clean.size)
        found = rx.identify(predict, data, ranges, noise=0.005, starts=2)
        assert found.converged and not found.undetermined and not found.rivals
        off.append([abs(found.estimate[name] - truth[name]) / found.uncertainty[name] for name in truth])
    assert np.max(off) < 3.0
    within = np.sum(np.array(off) < 1.0, axis=0)
    least, most = binom.ppf([0.0005, 0.9995], 20, 0.6827)  # a chance of 1 in 1000 to be outside
    assert np.all((least <= within) & (within <= most))


def test_what_acts_only_as_a_product_is_named():
    def predict(mu, load, rate):
        return mu * load * jnp.exp(-rate * T)

    truth = {"mu": 0.2, "load": 50.0, "rate": 0.5}
    ranges = {"mu": rx.Uniform(0.1, 0.4), "load": rx.Normal(40.0, 10.0), "rate": rx.Uniform(0.1, 1.0)}
    found = rx.identify(predict, predict(**truth) + NOISE, ranges, noise=0.01)
    (one,) = found.undetermined
    assert one.names == ("mu", "load") and one.about == "product"
    ratio = float(found.estimate["mu"] / found.estimate["load"])
    np.testing.assert_allclose(one.changes[0] / one.changes[1], -ratio, rtol=1e-5)
    assert one.uncertainty > 1e6 and found.degrees == T.size - 2
    assert found.rivals  # other points of the valley mu load = const
    for other in found.minima:
        np.testing.assert_allclose(other.values["mu"] * other.values["load"], 10.0, rtol=0.01)
    assert abs(found.estimate["rate"] - 0.5) < 3 * found.uncertainty["rate"] < 0.01
    page = str(found)
    assert "mu and load: changing" in page and "determine their product only" in page
    assert page.count("not determined") == 2 and "± " in page


BEYOND = {
    "sum": lambda a, b: a + b,
    "difference": lambda a, b: a - b,
    "product": lambda a, b: a * b,
    "quotient": lambda a, b: a / b,
    "": lambda a, b: a**2 / 4 + b,  # as a + b and as a b where a = b = 2
    " ": lambda a, b: a + 2 * b,
}


@pytest.mark.parametrize("noise", [1e-3, 1e-6])
@pytest.mark.parametrize("about", BEYOND)
def test_the_word_is_that_of_what_the_data_determine(about, noise):
    """Beside a parameter that is determined, and where a = b: a sum and a product have the same sensitivities."""

    def predict(rate, a, b):
        return BEYOND[about](a, b) * (1 + T) + rate * T**2

    ranges = {"rate": rx.Uniform(0.5, 1.5), "a": rx.Normal(2.0, 0.2), "b": rx.Normal(2.0, 0.3)}
    found = rx.identify(predict, predict(1.0, 2.0, 2.0), ranges, noise=noise, starts=4)
    (one,) = found.undetermined
    assert one.names == ("a", "b") and one.about == about.strip()
    assert ("the data determine their" in str(one)) == bool(one.about)


def test_sensitivities_that_tell_no_two_words_apart_give_none():
    """Ranges so narrow that a sum differs from a product by less than the noise."""
    ranges = {"a": rx.Normal(2.0, 0.002), "b": rx.Normal(2.0, 0.002)}
    found = rx.identify(lambda a, b: (a + b) * (1 + T), 4 * (1 + T), ranges, noise=1e-3)
    assert [one.about for one in found.undetermined] == [""]


def test_what_has_no_effect_and_what_acts_as_a_quotient():
    ranges = {name: rx.Uniform(1.0, 3.0) for name in ("a", "b", "idle")}
    found = rx.identify(lambda a, b, idle: a / b * T + 0.0 * idle, 1.5 * T + NOISE, ranges, noise=0.01)
    said = {one.names: one.about for one in found.undetermined}
    assert said == {("idle",): "", ("a", "b"): "quotient"}
    assert "idle: hardly any effect on what is measured" in str(found)


def test_minima_of_the_same_misfit_are_all_told_and_worse_ones_are_no_rivals():
    found = rx.identify(lambda a: a**2 * T, 4.0 * T + NOISE, {"a": rx.Uniform(-3.0, 3.0)}, noise=0.01)
    (rival,) = found.rivals
    np.testing.assert_allclose(rival.values["a"], -found.estimate["a"], rtol=1e-6)
    assert "NOT THE ONLY ONE" in str(found)
    wave = rx.identify(
        lambda w: jnp.sin(w * T), np.sin(9.0 * T) + NOISE, {"w": rx.Uniform(2, 16)}, noise=0.01, starts=16
    )
    assert len(wave.minima) > 1 and not wave.rivals
    assert abs(wave.estimate["w"] - 9.0) < 3 * wave.uncertainty["w"]
    assert wave.minima[1].chi_square > wave.chi_square + 4


def test_what_did_not_converge_is_no_estimate():
    def predict(w, d):
        return jnp.exp(-d * T) * jnp.sin(w * T)

    ranges = {"w": rx.Uniform(1.0, 4.0), "d": rx.Uniform(0.0, 1.0)}
    data = np.asarray(predict(3.0, 0.2)) + NOISE
    with pytest.raises(rx.NoSolutionError, match=r"None of 8 searches converged.* Raise `max_steps`"):
        rx.identify(predict, data, ranges, noise=0.01, max_steps=2)
    found = rx.identify(predict, data, ranges, noise=0.01, max_steps=2, throw=False)
    assert not found.converged and not found.minima
    assert np.isnan(found.estimate["w"]) and np.isnan(found.uncertainty["d"]) and np.isnan(found.chi_square)
    assert str(found).startswith("NOT CONVERGED: None of 8 searches converged")
    with pytest.raises(rx.NoSolutionError, match="what `predict` gives is not finite"):
        rx.identify(lambda w: jnp.log(-w) * T, T, {"w": rx.Uniform(1.0, 2.0)}, noise=0.01)


def test_a_model_that_does_not_fit_is_doubted():
    line = rx.identify(lambda a: a * T, np.sin(3 * T), {"a": rx.Uniform(-1.0, 1.0)}, noise=0.01)
    assert "DOUBTFUL: the misfit is too large: the model or `noise` is wrong" in str(line)
    exact = rx.identify(lambda a: a * T, 0.5 * T, {"a": rx.Uniform(-1.0, 1.0)}, noise=0.01)
    assert exact.chi_square < 1e-3  # 20 expected, with a standard deviation of 6.3
    assert "DOUBTFUL" not in str(exact)


@jax.custom_vjp
def backwards(a):
    return a


backwards.defvjp(lambda a: (a, None), lambda _, a: (a,))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"parameters": {}}, r"Argument `parameters` must hold .* but holds none"),
        ({"starts": 6}, r"Argument `starts` must give a power of two points, but gives 6. 8 is one."),
        ({"measured": [*T[1:], np.nan]}, r"Argument `measured` must be finite"),
        (
            {"measured": T[1:]},
            r"Argument `measured` must have the shape that `predict` gives, \(21,\), but has \(20,\)",
        ),
        ({"noise": 0.0}, r"Argument `noise` must be positive"),
        ({"noise": [1.0, 2.0]}, r"Argument `noise` must .* the shape of `measured`, \(21,\), but has \(2,\)"),
        ({"predict": lambda a: {"x": a * T}}, r"Argument `predict` must give an array, but gives a dict"),
        (
            {"predict": lambda a: backwards(a) * T},
            r"Argument `predict` must be differentiable in forward mode.*diffrax.ForwardMode\(\)",
        ),
    ],
)
def test_errors_name_argument_and_fix(given, message):
    options = {"predict": lambda a: a * T, "measured": T, "parameters": {"a": rx.Uniform(0, 2)}, "noise": 0.1, **given}
    with pytest.raises(rx.RedundaxError, match=message):
        rx.identify(**options)


@pytest.mark.slow
def test_friction_from_a_motion_that_reverses():
    """The friction coefficient of a block that slides back and forth, beside the stiffness of nothing else."""
    times = np.linspace(0.1, 2.5, 25)

    def predict(mu):
        return rx.simulate(*block(mu), 2.5, ts=times, max_phases=3, adjoint=diffrax.ForwardMode()).q[:, 0]

    data = [where(0.05, t) for t in times] + 1e-3 * np.random.default_rng(1).standard_normal(25)
    found = rx.identify(predict, data, {"mu": rx.Uniform(0.01, 0.1)}, noise=1e-3, starts=4)
    assert found.converged and not found.rivals
    assert abs(found.estimate["mu"] - 0.05) < 3 * found.uncertainty["mu"] < 1e-3
