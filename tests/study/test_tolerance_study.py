"""Tolerance studies against closed forms, and on the paper's mechanism against 50 digits."""

from fractions import Fraction
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from truth import exact, scenes

import redundax as rx

SAMPLES = 1024
A, B, C = rx.Normal(2.0, 0.3), rx.Uniform(-1.0, 3.0), rx.Normal([0.0, 1.0], 0.1)


def line(a, b, c):
    """y has the variance 9 * 0.09 + 4 * 16 / 12 + 0.01; `bent` has half of its variance in a square."""
    u, v = (a - 2) / 0.3, (b - 1) / np.sqrt(4 / 3)
    return {"y": 3 * a - 2 * b + c[1], "bent": jnp.stack([u + (u**2 - 1) / jnp.sqrt(2.0), v]), "fixed": a * 0 + 7}


def test_closed_form(tmp_path):
    found = rx.tolerance_study(
        line, {"a": A, "b": B, "c": C}, samples=SAMPLES, percentiles=(5, 50, 95), chunk=300, path=tmp_path / "line.nc"
    )
    assert list(found.output.values) == ["bent[0]", "bent[1]", "fixed", "y"]
    assert list(found.parameter.values) == ["a", "b", "c[0]", "c[1]"]
    y = found.sel(output="y")
    np.testing.assert_array_equal(y["gradient"], [3, -2, 0, 1])
    assert y["nominal"] == 3 * 2 - 2 + 1
    variances = np.array([9 * 0.09, 4 * 16 / 12, 0, 0.01])
    np.testing.assert_allclose(y["mean"], 5, atol=1e-3)
    np.testing.assert_allclose(y["std"], np.sqrt(variances.sum()), rtol=2e-3)
    np.testing.assert_allclose(y["share"], variances / variances.sum(), atol=2e-3)
    np.testing.assert_allclose(found["share"].sel(output="bent[0]"), [0.5, 0, 0, 0], atol=0.02)
    np.testing.assert_allclose(
        found["percentiles"].sel(output="bent[1]"), np.sqrt(3) * np.array([-0.9, 0, 0.9]), atol=5e-3
    )
    assert not found["share"].sel(output="fixed").any()
    assert found["std"].sel(output="fixed") == 0
    assert (found.sizes["sample"], found.failed) == (SAMPLES, 0)


def test_samples_follow_their_distributions():
    found = rx.tolerance_study(line, {"a": A, "b": B, "c": C}, samples=SAMPLES, seed=3)
    quantiles = (np.arange(SAMPLES) + 0.5) / SAMPLES
    np.testing.assert_allclose(np.sort(found.a), stats.norm(2.0, 0.3).ppf(quantiles), atol=0.1)
    np.testing.assert_allclose(np.sort(found.b), stats.uniform(-1.0, 4.0).ppf(quantiles), atol=5e-3)
    assert abs(np.corrcoef(found.c.values.T)[0, 1]) < 0.02


def test_failed_samples_are_left_out_and_counted():
    """Above 2.3 without a number, below 1.7 with a result that says so: a standard deviation from the mean."""

    def build(a):
        result = rx.RESULTS.where(a > 1.7, rx.RESULTS.successful, rx.RESULTS.no_solution_found)
        return {"root": jnp.sqrt(2.3 - a), "whole": 1.0 * a, "result": result}

    with pytest.warns(UserWarning, match=r"samples have no solution.*no_solution_found: "):
        found = rx.tolerance_study(build, {"a": A}, samples=SAMPLES)
    good = np.abs(found.a - 2.0).values < 0.3
    np.testing.assert_array_equal(found.solved, good)
    assert found.failed == np.sum(~good) > 0.3 * SAMPLES
    np.testing.assert_allclose(found["mean"].sel(output="whole"), found.a[good].mean(), rtol=1e-14)
    np.testing.assert_allclose(found["std"].sel(output="root"), np.sqrt(2.3 - found.a[good]).std(), rtol=1e-12)
    text = rx.plot.tolerance(found).get_suptitle()
    assert f"{found.failed} have no solution" in text


def test_nominal_without_a_solution_is_refused():
    def build(a):
        return {"y": a, "result": rx.RESULTS.where(a > 5, rx.RESULTS.successful, rx.RESULTS.no_solution_found)}

    for function, message in ((build, "jams"), (lambda a: {"y": jnp.log(a - 2)}, "not finite")):
        with pytest.raises(rx.NoSolutionError, match=f"At the means of the parameters there is no solution.*{message}"):
            rx.tolerance_study(function, {"a": A}, samples=4)


def test_too_few_solutions_are_refused():
    with pytest.raises(rx.NoSolutionError, match="Only 0 of 4 samples"):
        rx.tolerance_study(lambda a: {"y": jnp.where(a == 2, a, jnp.nan)}, {"a": A}, samples=4)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rx.Normal(0.0, 0.0), "`std` must be positive"),
        (lambda: rx.Normal([0.0, 1.0], [1.0, 1.0, 1.0]), "`mean` and `std` must have one shape"),
        (lambda: rx.Normal(np.nan, 1.0), "`mean` must be finite"),
        (lambda: rx.Uniform(1.0, 1.0), "`high` must be above `low`"),
        (lambda: rx.tolerance_study(line, {}), "`parameters` must hold.*holds none"),
        (lambda: rx.tolerance_study(line, {"std": A}), "`parameters` must not hold .'std'"),
        (lambda: rx.tolerance_study(lambda a: {"mean": a}, {"a": A}), "`build` must not call outputs .'mean'"),
        (lambda: rx.tolerance_study(lambda a: {"y": a}, {"a": A}, samples=1000), "power of two.*1024 is one"),
        (lambda: rx.tolerance_study(lambda a: {"y": a}, {"a": A}, percentiles=(5, 101)), "numbers from 0 to 100"),
        (lambda: rx.tolerance_study(lambda a: {"y": a > 0}, {"a": A}), "`build` must return arrays of real numbers"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(rx.RedundaxError, match=message):
        make()


# ------------------------------------------------------------------------ the paper's mechanism

SHIFT, TURN = 1e-8, 1e-6  # m/N, rad/(N m)
PHI = 0.7
PARAMETERS = {"misfit": rx.Normal(0.0, 2e-5), "mu_rho": rx.Uniform(0.015, 0.025), "length": rx.Normal(0.1, 1e-4)}


def build(misfit, mu_rho=None, length=0.1):
    mechanism = rx.mechanisms.wojtyra2020(length=length, mu_rho=mu_rho)
    joints = [rx.JointCompliance(name, SHIFT) for name in "BCD"]
    joints += [rx.JointCompliance(name, SHIFT, TURN) for name in "KL"]
    joints.append(rx.JointCompliance("A", SHIFT, misfit=jnp.stack([misfit, 0.0, 0.0]), frame=rx.GROUND))
    closure = rx.ElasticJoints(mechanism, joints)
    return rx.solve(mechanism, mechanism.state(phi=PHI, rate=1.0), closure=closure, solver=rx.Newton())


@cache
@exact.exactly
def truth(misfit, mu_rho=None, length=Fraction(1, 10)):
    """[qdd; lam; tau] with 50 digits."""
    mechanism = scenes.wojtyra(scenes.wojtyra_parameters(length, phi=Fraction(PHI), mu_rho=(mu_rho or 0,) * 4))
    compliance = exact.mp.diag([*exact.exact((SHIFT,) * 10), *exact.exact((TURN,) * 2)])
    solution = mechanism.solve(compliance, exact.exact((misfit, *(0,) * 11)), friction=mu_rho is not None)
    parts = [solution.acceleration, solution.multipliers, *([] if mu_rho is None else [solution.friction])]
    return [entry for part in parts for entry in part]


@exact.exactly
def slope(name, nominal, step=Fraction(1, 10**14)):
    """Derivative by one parameter, by central differences of 50 digits."""
    up, down = (truth(**{**nominal, name: nominal[name] + sign * step}) for sign in (1, -1))
    return np.array([float((a - b) / exact.exact(2 * step)) for a, b in zip(up, down, strict=True)])


def check(value, expected, tolerance):
    """Errors relative to the largest entry of accelerations, multipliers and friction."""
    for part in (slice(0, 12), slice(12, 24), slice(24, None)):
        size = np.max(np.abs(expected[part]), initial=0.0)
        assert np.max(np.abs(np.asarray(value)[part] - expected[part]), initial=0.0) <= tolerance * size


@pytest.fixture(scope="module")
def smooth():
    options = {"samples": 256, "system": rx.mechanisms.wojtyra2020()}
    return rx.tolerance_study(build, {"misfit": PARAMETERS["misfit"]}, **options)


def test_loads_are_linear_in_a_misfit_without_friction(smooth):
    by_hand = slope("misfit", {"misfit": Fraction(0)})
    check(smooth["gradient"].sel(parameter="misfit"), by_hand, 1e-12)
    loads = slice(12, 24)
    check(smooth["std"][loads], np.abs(by_hand[loads]) * smooth.misfit.values.std(), 1e-11)
    np.testing.assert_allclose(smooth.misfit.values.std(), 2e-5, rtol=0.01)
    share = smooth["share"].sel(output=["A.x", "K.angle", "1.phi''"], parameter="misfit")
    np.testing.assert_allclose(share, [1, 1, 0], atol=1e-12)


@pytest.mark.slow
def test_gradients_with_friction():
    system = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    found = rx.tolerance_study(build, PARAMETERS, samples=256, system=system)
    nominal = {"misfit": Fraction(0), "mu_rho": Fraction(1, 50), "length": Fraction(1, 10)}
    assert list(found.output.values[[0, 12, 24]]) == ["1.x''", "A.x", "tau A"]
    assert found.output_kind.values[24] == "friction moment"
    check(found["nominal"], np.array([float(entry) for entry in truth(**nominal)]), 1e-12)
    for name in PARAMETERS:
        check(found["gradient"].sel(parameter=name), slope(name, nominal), 1e-11)


def test_a_small_change_of_a_large_value_is_seen_beside_others():
    """Of a, b and c, which are 1e6, -50 and 0 and vary by 0.1 each: three bars over most of the axis."""
    parameters = {"x": rx.Uniform(-0.1, 0.1)}
    study = rx.tolerance_study(lambda x: {"a": 1e6 + x, "b": x - 50.0, "c": x}, parameters, samples=64)
    axes = rx.plot.tolerance(study).axes[0]
    widths = [bar.get_width() for bar in axes.patches]
    assert len(widths) == 3 and min(widths) > 0.5 * np.ptp(axes.get_xlim())
    low, high = (float(end) for end in study["percentiles"].sel(output="a")[[0, -1]])
    texts = [text.get_text() for text in axes.texts if text.get_text().startswith("1") or "99" in text.get_text()]
    assert len(set(texts)) == 2
    np.testing.assert_allclose([float(text) for text in texts], [low, high], rtol=1e-6)


def test_a_legend_names_what_is_drawn():
    """The variances of a and b / 1000 are 1 : 1e-6, that of c has no effect."""
    parameters = {name: rx.Normal(0.0, 1.0) for name in "abc"}
    figure = rx.plot.tolerance(rx.tolerance_study(lambda a, b, c: {"y": a + 1e-3 * b}, parameters, samples=64))
    assert [text.get_text() for text in figure.axes[1].get_legend().get_texts()] == ["a"]


def test_picture(smooth):
    """Forces and moments vary with the misfit, motion and the load of the guides do not."""
    figure = rx.plot.tolerance(smooth)
    bands, shares = figure.axes[::2], figure.axes[1::2]
    assert [axes.get_xlabel() for axes in bands] == ["change from nominal, N", "change from nominal, N m"]
    labels = [[label.get_text() for label in axes.get_yticklabels()] for axes in bands]
    assert labels == [[f"{joint}.{axis}" for joint in "ABCD" for axis in "xy"], ["K.angle", "L.angle"]]
    np.testing.assert_allclose([bar.get_width() for bar in shares[1].patches], [1, 1])
    low, _, high = smooth["percentiles"].sel(output="K.angle").values
    bar = bands[1].patches[0]
    nominal = float(smooth["nominal"].sel(output="K.angle"))
    np.testing.assert_allclose([bar.get_x(), bar.get_x() + bar.get_width()], [low - nominal, high - nominal])
    assert {text.get_text() for text in bands[1].texts} >= {f"{low:.4g}", f"{high:.4g}"}
    assert len(rx.plot.tolerance(smooth, ["A.x"]).axes) == 2
    with pytest.raises(rx.RedundaxError, match=r"but holds 'A\.z'"):
        rx.plot.tolerance(smooth, ["A.z"])
