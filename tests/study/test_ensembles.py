"""Bands of ensembles against percentiles of exact motions; their pictures."""

import diffrax
import jax
import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
from test_simulate import pendulum, pendulum_truth
from test_stick_slip import block, where

import redundax as rx
from redundax._study._ensemble import banded

matplotlib.use("Agg")
TIMES = np.linspace(0.0, 2.0, 9)
MUS = np.linspace(0.02, 0.06, 6)
PERCENTILES = (10.0, 50.0, 80.0)


def of_blocks(run):
    """Blocks of many friction coefficients; the last one is lifted off its guide, so that it has no motion."""
    samples = {"mu": [*MUS, 0.04], "lift": [*np.zeros(6), 0.5]}
    with pytest.warns(UserWarning, match=r"1 of 7 motions did not get to the end \(violated_constraints: 1\)"):
        return rx.ensemble(run, samples, system=block(0.04)[0], percentiles=PERCENTILES, chunk=4)


def slowing(mu, lift):
    """In place of a motion: what slows down by itself, the faster the rougher."""
    place = jnp.exp(-mu * jnp.asarray(TIMES))
    two = jnp.where(lift > 0, jnp.nan, jnp.stack([place, 0 * place], axis=-1))
    result = rx.RESULTS.where(lift > 0, rx.RESULTS.violated_constraints, rx.RESULTS.successful)
    both = dict.fromkeys(("q", "qd", "acceleration", "multipliers"), two)
    return {"t": jnp.asarray(TIMES), **both, "friction": two[:, :1], "sense": two[:, :1], "result": result}


@pytest.fixture(scope="module")
def blocks():
    return of_blocks(slowing)


@pytest.mark.slow
def test_bands_over_friction_are_those_of_the_closed_form():
    def run(mu, lift):
        system, state = block(mu)
        state = rx.State(state.q.at[1].add(lift), state.qd)
        return rx.simulate(system, state, 2.0, ts=TIMES, max_phases=3, adjoint=diffrax.ForwardMode())

    blocks = of_blocks(run)
    truth = np.percentile([[where(mu, t) for t in TIMES] for mu in MUS], PERCENTILES, axis=0)
    found = blocks.q_band.sel(coordinate="0", percentile=[*PERCENTILES])
    np.testing.assert_allclose(found, truth, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(blocks.time, TIMES)


def test_a_motion_that_failed_is_counted(blocks):
    assert np.array_equal(blocks.solved, [True] * 6 + [False])
    assert dict(zip(blocks.outcome.values, blocks.outcomes.values, strict=True)) == {
        "successful": 6,
        "violated_constraints": 1,
    }
    assert np.all(blocks.q_count == 6)
    assert blocks.attrs["failed"] == 1
    assert np.all(np.isnan(blocks.q[-1]))


@pytest.mark.slow
def test_bands_over_drawn_rates_are_those_of_the_scalar_equation():
    system, _ = pendulum(0.7, 1.0)

    def run(rate):
        return rx.simulate(system, pendulum(0.7, rate)[1], 2.0, ts=[0.0, 1.0, 2.0])

    found = rx.ensemble(run, {"rate": rx.Normal(1.0, 0.2)}, system=system, size=8, percentiles=PERCENTILES)
    rates = found.rate.values
    assert len(set(rates)) == 8 and abs(rates.mean() - 1.0) < 0.1
    for place, t in ((1, 1.0), (2, 2.0)):
        truth = np.percentile([pendulum_truth(0.7, rate, t1=t) for rate in rates], PERCENTILES, axis=0)
        np.testing.assert_allclose(found.q_band[:, place], truth, rtol=0, atol=1e-6)
    assert found.attrs["failed"] == 0
    assert not found.q.attrs and not found.time.attrs  # no units are stated
    assert set(found.q_band.dims) == {"percentile", "time", "coordinate"}


def test_percentiles_of_what_is_there():
    values = np.random.default_rng(0).standard_normal((9, 4))
    values[3:, 1], values[:, 2] = np.nan, np.nan
    band, count = banded(values, PERCENTILES)
    assert list(count) == [9, 3, 0, 9]
    there = [0, 1, 3]
    np.testing.assert_allclose(band[:, there], np.nanpercentile(values[:, there], PERCENTILES, axis=0), rtol=1e-13)
    assert np.all(np.isnan(band[:, 2]))


def test_pictures_say_what_is_missing(blocks):
    figure = rx.plot.ensemble(blocks, ["0", "0'", "tau 0"])
    assert [axes.get_ylabel() for axes in figure.axes][1:] == ["0", "0'", "tau 0"]
    assert figure.axes[-1].get_xlabel() == "time"
    assert figure.get_suptitle() == "7 motions: 6 successful, 1 violated constraints"
    assert all(any(part.get_hatch() for part in axes.collections) for axes in figure.axes)
    assert len(rx.plot.ensemble(blocks).axes) == 1  # the other position does not vary
    with pytest.raises(rx.RedundaxError, match=r"Argument `outputs` must hold names .* but holds 'z'"):
        rx.plot.ensemble(blocks, ["z"])


@pytest.mark.slow
def test_picture_of_a_motion():
    mechanism = rx.mechanisms.parallelogram(3)
    motion = rx.simulate(mechanism, mechanism.state(0.5, rate=1.0), 0.2, ts=np.linspace(0, 0.2, 5))
    names = ["crank 1.phi", "crank 1.phi'", "A1.x", "A2.x"]
    figure = rx.plot.trajectory(mechanism, motion, names)
    assert [axes.get_ylabel() for axes in figure.axes] == ["rad", "rad/s", "N"]
    line = figure.axes[2].lines[1]
    np.testing.assert_array_equal(line.get_ydata(), motion.multipliers[:, mechanism.rows.names.index("A2.x")])
    assert line.get_label() == "A2.x" and figure.axes[2].get_xlabel() == "time, s"
    angles, _ = rx.plot.trajectory(mechanism, motion).axes  # the coupler does not turn, but for rounding
    assert [line.get_label() for line in angles.lines] == ["crank 1.phi", "crank 2.phi", "crank 3.phi"]
    report = rx.analyze_along(mechanism, jax.tree.map(lambda x: x[::2], motion.states))
    run = rx.ensemble(
        lambda rate: rx.simulate(mechanism, mechanism.state(0.5, rate=rate), 0.2, ts=jnp.linspace(0, 0.2, 5)),
        {"rate": [0.9, 1.1]},
        system=mechanism,
    )
    bands = rx.plot.ensemble(run, names, along=report)
    named = [axes.get_ylabel() for axes in bands.axes]
    assert named == ["crank 1.phi, rad", "crank 1.phi', rad/s", "A1.x, N", "A2.x, N"]
    assert bands.axes[-1].get_xlabel() == "time, s"
    assert run.multipliers_band.attrs == {"linear_unit": "N", "angular_unit": "N m"}
    labels = [axes.get_legend_handles_labels()[1] for axes in bands.axes]
    assert ["not unique" in one for one in labels] == [False, False, True, True]


def stub(rate, t=(0.0, 1.0), n=2):
    array = jnp.full((2, n), rate)
    names = ("q", "qd", "acceleration", "multipliers", "friction", "sense")
    return {"t": jnp.asarray(t), **dict.fromkeys(names, array), "result": jnp.zeros((), int)}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"size": 6}, r"Argument `size` must give a power of two points, but gives 6. 8 is one."),
        ({"percentiles": [101]}, r"Argument `percentiles` must hold two or more numbers from 0 to 100"),
        ({"run": lambda rate: stub(rate, n=3)}, r"Argument `system` must be the one whose motions `run` gives"),
        ({"run": lambda rate: {"x": rate}}, r"Argument `run` must give a `Trajectory`, but its result has no t, q"),
        (
            {"run": lambda rate: stub(rate, t=[0.0, rate])},
            r"Argument `run` must give all motions at the same times. Give `ts` to `simulate`.",
        ),
    ],
)
def test_errors_name_argument_and_fix(given, message):
    options = {"run": stub, "system": pendulum(0.7, 1.0)[0], "size": 2, **given}
    with pytest.raises(rx.RedundaxError, match=message):
        rx.ensemble(options.pop("run"), {"rate": rx.Uniform(0.9, 1.1)}, **options)
