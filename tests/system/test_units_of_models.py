"""Units that a model states: figures times what their symbols mean are the same in every unit, and none is invented."""

import dataclasses
import re

import jax
import numpy as np
import pytest

import redundax as rx
from redundax._system._units import stated

# What symbols mean in SI, written anew.
SI = {
    "m": 1.0,
    "mm": 1e-3,
    "µm": 1e-6,
    "in": 0.0254,
    "rad": 1.0,
    "s": 1.0,
    "ms": 1e-3,
    "kg": 1.0,
    "t": 1e3,
    "lb": 0.45359237,
}
SI |= {"N": 1.0, "mN": 1e-3, "kN": 1e3, "MN": 1e6}
MODELS = {
    "mm, t": rx.units.Units(length=1e3, mass=1e-3),
    "mm, kg": rx.units.Units(length=1e3),
    "mm, kg, ms": rx.units.Units(length=1e3, time=1e3),
    "inch, lb": rx.units.Units(length=1 / 0.0254, mass=1 / 0.45359237),
}
NAMED = {"mm, t": "N", "mm, kg": "mN", "mm, kg, ms": "kN", "inch, lb": "lb in/s²"}  # forces


def meaning(symbol):
    """The SI value of "kg mm²/s²", "rad/s", "N mm", ..."""
    above, _, below = symbol.partition("/")
    powers = [*((unit, 1) for unit in above.split()), *((unit, -1) for unit in below.split())]
    return np.prod([SI[unit.rstrip("²")] ** (sign * (1 + unit.endswith("²"))) for unit, sign in powers])


def pendulum(units=None, stated=True):
    """A pendulum whose figures are in `units`, at phi = 0.3, turning."""
    u = rx.units.Units() if units is None else units
    inertia, gravity = u.mass * u.length**2, u.length / u.time**2
    joint = rx.Revolute("A", "rod", rx.GROUND, (-0.5 * u.length, 0.0), (0.0, 0.0))
    guard = rx.AngleDriver("motor", "rod", rx.GROUND, rx.Polynomial([0.3, 2.0 / u.time]))
    bodies = [rx.Body("rod", 2.0 * u.mass, 0.3 * inertia)]
    mechanism = rx.Mechanism(bodies, [joint, guard], gravity=(0.0, -9.81 * gravity), units=u if stated else None)
    c, s = 0.5 * u.length * np.cos(0.3), 0.5 * u.length * np.sin(0.3)
    return mechanism, rx.State([c, s, 0.3], [-s * 2.0 / u.time, c * 2.0 / u.time, 2.0 / u.time])


def figures(solution):
    return {entry.name: float(solution.entry(entry)) * meaning(entry.unit) for entry in solution.entries}


@pytest.mark.parametrize("name", MODELS)
def test_figures_times_their_units_are_the_same_in_every_unit(name):
    mechanism, state = pendulum()
    here = figures(rx.solve(mechanism, state))
    np.testing.assert_allclose(here["motor.angle"], -9.81 * 2.0 * 0.5 * np.cos(0.3), rtol=1e-12)
    there = rx.solve(*pendulum(MODELS[name]))
    rescaled = rx.units.in_units(mechanism, MODELS[name])
    moved = rx.solve(rescaled, rx.units.state_in_units(state, mechanism, MODELS[name]))
    assert [entry.unit for entry in moved.entries] == [entry.unit for entry in there.entries if entry.array != "q"]
    assert {entry.unit for entry in there.entries if entry.name == "A.x" and entry.kind == "force"} == {NAMED[name]}
    for solution in (there, moved):
        for label, value in figures(solution).items():
            np.testing.assert_allclose(value, here[label], rtol=1e-11, atol=1e-11, err_msg=label)
    assert rx.units.solution_from_units(moved, mechanism, MODELS[name]).entries == rx.solve(mechanism, state).entries


@pytest.mark.parametrize(
    ("units", "kind", "symbol"),
    [
        (rx.units.Units(length=0.5), "linear", "(2 m)"),
        (rx.units.Units(length=1e6), "linear", "µm"),
        (rx.units.Units(mass=2.0, time=3.0), "force", "(0.5 kg) m/(0.3333 s)²"),
    ],
)
def test_units_without_a_name_say_what_they_are(units, kind, symbol):
    assert stated(units).of(kind) == symbol


def test_angles_in_degrees_have_moments_by_degree():
    mechanism, _ = pendulum()
    stated = rx.units.in_units(mechanism, rx.units.Units(angle=180 / np.pi)).names.units
    assert (stated.of("angular", 1), stated.of("moment")) == ("°/s", "N m/°")
    with pytest.raises(rx.RedundaxError, match="`units` must leave angles in radians"):
        joint = rx.Fixed("A", "rod", rx.GROUND, (0.0, 0.0), (0.0, 0.0))
        rx.Mechanism([rx.Body("rod", 1.0, 1.0)], [joint], units=rx.units.Units(angle=180 / np.pi))


def test_units_reach_texts_and_data():
    mechanism, state = pendulum(MODELS["mm, t"])
    assert "units mm, rad, t, s, N\n" in str(mechanism)
    assert "units mm, rad, t, s, N\n" in str(rx.solve(mechanism, state))
    assert "Units: mm, rad, t, s, N\n" in str(rx.analyze(mechanism, state))
    found = rx.study(lambda t: rx.solve(mechanism, rx.State(state.q, state.qd, t)), {"t": np.zeros(1)}, chunk=1)
    assert found.acceleration.attrs == {"linear_unit": "mm/s²", "angular_unit": "rad/s²"}
    assert found.multipliers.attrs == {"linear_unit": "N", "angular_unit": "N mm"}


@pytest.mark.slow
def test_units_reach_bands_families_and_pictures():
    mechanism = rx.mechanisms.wojtyra2020(u=1000.0)
    state = mechanism.state(phi=0.8, rate=1.0)
    bands = rx.band(mechanism, state, ["2.y''", "1.phi''", "A.x"], rx.AmplitudeBox({"A.x": (-40.0, 40.0)}))
    assert bands.units == ("mm/s²", "rad/s²", "mN")
    assert "A.x, mN" in str(bands)
    assert [axes.get_xlabel() for axes in rx.plot.band(bands).axes] == ["rad/s²", "mm/s²", "mN"]
    family = rx.solution_family(mechanism, state, z=np.array([-1.0, 1.0]))
    assert family.units[0] == "mm/s²"
    assert "\nA.x, mN " in str(family)
    figure = rx.plot.family(family)
    assert figure.get_supxlabel() == "self-stress added to A.x, mN"
    assert {axes.get_title(): axes.get_ylabel() for axes in figure.axes}["A.x"] == "mN"
    assumed = rx.solution_family(mechanism, state, samples=3)
    assert re.search(r"without friction, \S+ mN, where a moment .* at \S+ mm, a length", assumed.assumption)
    assert re.match(r"Along the self-stress of A\.x, a force, from \S+ to \S+ mN about", str(assumed))
    folded = dataclasses.replace(assumed, fold=np.array([True, *[False] * (len(assumed.z) - 1)]))
    assert f"; folds at {assumed.z[0, 0]:.6g} mN " in " ".join(str(folded).split())
    axes = rx.plot.draw(mechanism, state, multipliers=rx.solve(mechanism, state).multipliers)
    texts = [text.get_text() for text in axes.texts]
    assert axes.get_xlabel() == "x (mm)"
    assert any(re.fullmatch(r"g = \S+ mm/s²", text) for text in texts)
    assert any(" mN: joint load" in text for text in texts)


def test_no_unit_is_shown_where_none_is_stated():
    mechanism, state = pendulum(stated=False)
    solution = rx.solve(mechanism, state)
    assert {entry.unit for entry in solution.entries} == {""}
    assert "nits" not in f"{mechanism}{solution}{rx.analyze(mechanism, state)}"
    axes = rx.plot.draw(mechanism, state, multipliers=solution.multipliers)
    assert axes.get_xlabel() == "x"
    assert not [text.get_text() for text in axes.texts if re.search(r"\d (N|m)", text.get_text())]
    rescaled = rx.units.in_units(mechanism, MODELS["mm, t"])
    assert str(rescaled.names.units) == ""


def test_units_compile_nothing_anew_and_a_traced_factor_states_none():
    one, other = (pendulum(units)[0].anonymous for units in (None, MODELS["mm, t"]))
    assert jax.tree.structure(one) == jax.tree.structure(other)

    def traced(u):
        mechanism = rx.mechanisms.wojtyra2020(u=u)
        assert str(mechanism.names.units) == ""
        return mechanism.body.mass

    jax.jit(traced)(2.0)
