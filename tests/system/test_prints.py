"""Prints and exports: names, units and figures by hand, on one screen whatever the size.

A uniform rod of 1 kg and 1 m falls about its end A at rest at the angle phi, g = 10 m/s^2:

    phi'' = -3/2 g cos(phi) / L,   (x'', y'') = L/2 phi'' (-sin(phi), cos(phi)),   A.y = m (y'' + g) on the rod, up
"""

import dataclasses
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax._system._pages import values_of

SCREEN, WIDTH = 33, 80
NEWTON, METRE = 0.224808943, 39.3700787  # lbf, in


def rod(units=None, drive=()):
    """The rod with its figures in units, and a load that they all have: its weight."""
    u = rx.units.SI if units is None else units
    pin = rx.Revolute("A", "rod", rx.GROUND, (-0.5 * u.length, 0.0), (0.0, 0.0))
    body = rx.Body("rod", u.mass, u.mass * u.length**2 / 12)
    return rx.Mechanism([body], [pin, *drive], gravity=(0.0, -10.0 * u.length / u.time**2), units=units)


def at(phi, length=1.0):
    return rx.State([0.5 * length * jnp.cos(phi), 0.5 * length * jnp.sin(phi), phi], [0.0, 0.0, 0.0])


def row(text, name):
    """What stands after a name on its line, up to where another table begins."""
    (line,) = (line for line in text.splitlines() if name in line.split())
    words = line.split()
    return words[words.index(name) + 1 :]


def on_a_screen(text):
    lines = text.splitlines()
    return len(lines) <= SCREEN and max(map(len, lines)) <= WIDTH


# Units that are ready --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "symbols", "mass", "length", "force", "gravity"),
    [
        ("SI", "m, rad, kg, s, N", 1.0, 1.0, 1.0, 9.80665),
        ("MM_TONNE", "mm, rad, t, s, N", 1e-3, 1e3, 1.0, 9806.65),
        ("MM_KG", "mm, rad, kg, s, mN", 1.0, 1e3, 1e3, 9806.65),
        ("MM_KG_MS", "mm, rad, kg, ms, kN", 1.0, 1e3, 1e-3, 9.80665e-3),
        ("INCH_POUND", "in, rad, slinch, s, lbf", 1 / 175.126835, METRE, NEWTON, 386.088583),
        ("FOOT_POUND", "ft, rad, slug, s, lbf", 1 / 14.5939029, 3.28083990, NEWTON, 32.1740486),
    ],
)
def test_ready_units_are_those_of_handbooks(name, symbols, mass, length, force, gravity):
    """A newton in their forces, and the weight of their mass in their accelerations."""
    units = getattr(rx.units, name)
    np.testing.assert_allclose([units.mass, units.length], [mass, length], rtol=1e-8)
    np.testing.assert_allclose(units.mass * units.length / units.time**2, force, rtol=1e-8)
    np.testing.assert_allclose(9.80665 * units.length / units.time**2, gravity, rtol=1e-8)
    assert str(units) == f"SI to {symbols}"


def test_unknown_units_are_refused_with_those_known():
    with pytest.raises(AttributeError, match=r"no 'CGS'. There are SI, MM_TONNE"):
        rx.units.CGS  # noqa: B018


# Prints ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "length", "metre", "force", "newton"),
    [("MM_TONNE", "mm", 1e3, "N", 1.0), ("INCH_POUND", "in", METRE, "lbf", NEWTON)],
)
def test_a_solution_is_a_table_with_units(name, length, metre, force, newton):
    units = getattr(rx.units, name)
    text = str(rx.solve(rod(units), at(0.0, units.length)))
    for heading in (
        f"position, {length}",
        f"velocity, {length}/s",
        f"acceleration, {length}/s²",
        "acceleration, rad/s²",
    ):
        assert heading in text
    assert f"multiplier, {force}" in text
    np.testing.assert_allclose([*map(float, row(text, "rod.y")[:3])], [0.0, 0.0, -7.5 * metre], rtol=1e-5)
    np.testing.assert_allclose([*map(float, row(text, "rod.x")[:3])], [0.5 * metre, 0.0, 0.0], rtol=1e-5)
    assert row(text, "rod.phi") == ["0", "0", "-15"]
    np.testing.assert_allclose(float(row(text, "A.y")[0]), -2.5 * newton, rtol=1e-5)
    assert on_a_screen(text)


def test_friction_is_told_with_the_body_on_which_it_acts():
    """That of a pin by its joint, and of both pins of a cross."""
    pin = rx.Revolute("A", "rod", rx.GROUND, (0, 0), (0, 0), pin_radius=0.01, friction=rx.Coulomb(0.1))
    names = rx.Mechanism([rx.Body("rod", 1.0, 1.0)], [pin]).names
    assert [each.rows for each in values_of(names, ("friction", [0.25]))][-1] == [("tau A (on rod)", "0.25")]
    shaft = rx.spatial.Body("shaft", 1.0, (1.0, 1.0, 1.0))
    bearing = {"pin_radius": 0.01, "bearing_length": 0.05, "thrust_radius": 0.01, "friction": rx.Coulomb(0.1)}
    cross = rx.spatial.Universal("K", rx.GROUND, shaft, (0, 0, 0), (1, 0, 0), (0, 1, 0), **bearing)
    names = rx.Mechanism([shaft], [cross]).names
    assert names.slips.labels == ("K.angle_1", "K.angle_2")
    assert names.carriers(names.slips.labels) == ["ground", "ground"]


def test_a_state_is_a_table():
    state = rx.State([0.25, -3.0, 1.5], [0.0, 2.0, -0.125], 0.5)
    assert [line.split() for line in str(state).splitlines()[2:]] == [
        ["0", "0.25", "0"],
        ["1", "-3", "2"],
        ["2", "1.5", "-0.125"],
    ]
    assert repr(state).endswith("print(mechanism.table(state))") and "q=f64[3]" in repr(state)
    text = rod(rx.units.SI).table(state)
    assert text.startswith("State at t = 0.5 s\nunits m, rad, kg, s, N\n")
    assert row(text, "rod.y") == ["-3", "2"] and row(text, "rod.phi") == ["1.5", "-0.125"]
    assert "velocity, m/s\n" in text and "velocity, rad/s\n" in text


def test_parts_are_shown_with_their_figures():
    assert str(rx.Body("rod", 2.0, 0.25)) == "Body(name='rod', mass=2.0, inertia=0.25)"
    pin = rx.Revolute("A", "rod", rx.GROUND, (0.5, 0.0), (0, 0), 0.01, rx.Coulomb(0.1))
    for figure in ("point_i=[0.5, 0.0]", "pin_radius=0.01", "Coulomb(mu=0.1"):
        assert figure in str(pin)
    assert str(rx.Polynomial(jnp.arange(99.0))) == "Polynomial(coefficients=f64[99])"
    told = []
    jax.make_jaxpr(lambda mass: told.append(str(rx.Body("rod", mass, mass))) or mass)(1.0)
    assert told == ["Body(name='rod', mass=f64[], inertia=f64[])"]


def test_a_sweep_has_least_largest_and_what_failed():
    """From the horizontal to 60 degrees, and one state that the pin does not allow."""
    mechanism = rod(rx.units.SI)
    states = jax.vmap(at)(jnp.array([0.0, np.pi / 3, 1.0]))
    states = rx.State(states.q.at[2, 0].add(0.1), states.qd, states.t)
    text = str(jax.vmap(lambda state: rx.solve(mechanism, state, throw=False))(states))
    assert text.startswith("3 solutions: 2 successful, 1 violated_constraints\n")
    np.testing.assert_allclose([*map(float, row(text, "rod.phi''"))], [-15.0, -7.5, 1.0], rtol=1e-4)
    # at 60 degrees x'' = 7.5 / 2 sin 60, y'' = -7.5 / 2 cos 60, and the pin carries what is left of the weight
    np.testing.assert_allclose([*map(float, row(text, "rod.x''")[:3])], [0.0, 3.75 * np.sqrt(0.75), 1.0], rtol=1e-4)
    np.testing.assert_allclose([*map(float, row(text, "A.y"))], [-8.125, -2.5, 1.0], rtol=1e-4)
    assert "acceleration, rad/s²" in text and "multiplier, N" in text and on_a_screen(text)


def motion():
    """The rod is driven at 2 rad/s from the horizontal on, for a second."""
    drive = rx.AngleDriver("motor", "rod", rx.GROUND, rx.Polynomial([0.0, 2.0]))
    state = rx.State([0.5, 0.0, 0.0], [0.0, 1.0, 2.0])
    return rx.simulate(rod(rx.units.SI, [drive]), state, 1.0, ts=jnp.linspace(0.0, 1.0, 3))


@pytest.mark.slow
def test_a_motion_has_its_times_and_ranges():
    found = motion()
    text = str(found)
    assert text.startswith("Motion at 3 times from t = 0 to 1 s: successful\n") and on_a_screen(text)
    np.testing.assert_allclose([*map(float, row(text, "rod.phi")[:4])], [0.0, 2.0, 2.0, 2.0], rtol=1e-4, atol=1e-9)
    x, y = 0.5 * np.cos([2.0, 0.0]), 0.5 * np.sin([0.0, 1.0])
    np.testing.assert_allclose([*map(float, row(text, "rod.x")[:2])], x, rtol=1e-4)
    np.testing.assert_allclose([*map(float, row(text, "rod.y")[:2])], [y[0], 0.5 * np.sin(2.0)], rtol=1e-4, atol=1e-9)
    frame, data = found.to_pandas(), found.to_xarray()
    np.testing.assert_allclose(frame.index, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(frame["rod.phi"], [0.0, 1.0, 2.0], atol=1e-9)
    np.testing.assert_allclose(data.q.sel(coordinate="rod.phi", time=0.5), 1.0, atol=1e-9)
    assert frame.attrs["units"]["t"] == data.time.attrs["units"] == "s"


def test_a_mechanism_is_a_table_of_bodies_and_joints():
    """The friction radius of a revolute is its coefficient times the radius of its pin."""
    guide = rx.Translational(
        "K", "ram", rx.GROUND, (0, 0), (0, 0), (1, 0), guide_length=80.0, friction=rx.Coulomb(0.1, 25)
    )
    pin = rx.Revolute("A", "ram", "rod", (0, 0), (50, 0), pin_radius=10.0, friction=rx.Coulomb(0.3))
    end = rx.Revolute("O", "rod", rx.GROUND, (-50, 0), (0, 0), pin_radius=10.0, friction=rx.Stribeck(0.3, 0.2, 5.0))
    bodies = [rx.Body("rod", 2e-3, 1.5), rx.Body("ram", 0.0105, 30.0)]
    load = rx.AppliedForce("ram", force=(0.0, 7.0))
    mechanism = rx.Mechanism(bodies, [end, pin, guide], loads=[load], gravity=(0, -9810.0), units=rx.units.MM_TONNE)
    text = str(mechanism)
    assert "mass, t  inertia, t mm²" in text and "units mm, rad, t, s, N" in text
    assert "gravity (0, -9810) mm/s², AppliedForce on ram\n" in text
    assert row(text, "0.002") == ["1.5"]
    assert row(text, "A") == ["Revolute", "ram,", "rod", "Coulomb:", "friction", "radius", "3", "mm"]
    assert "0.1, preload 25 N" in text
    assert "static 0.3, kinetic 0.2, velocity 5 mm/s, radius 10 mm" in " ".join(text.split())
    assert on_a_screen(text)


def test_what_is_large_fits_a_screen_and_says_how_to_see_all():
    count = 1000
    names = rx.Axis(tuple(f"x{k}" for k in range(count)), ("linear",) * count)
    system = rx.System(
        lambda q, t, p: q[:1], np.ones(count), lambda q, qd, t, p: 1.0 + 0 * q,
        coordinates=names, rows=rx.Axis(("wall",), ("force",)), units=rx.units.SI,
    )  # fmt: skip
    text = str(rx.solve(system, rx.State(np.zeros(count), np.zeros(count))))
    assert on_a_screen(text) and "to_pandas()" in text
    assert row(text, "x0")[:3] == ["0", "0", "0"] and row(text, "x999") == ["0", "0", "1"]
    shown = sum(f" {word} ".strip().startswith("x") for line in text.splitlines() for word in line.split())
    assert f"... {count - shown} more" in text
    joints = [rx.Revolute(f"J{k}", f"bar {k}", rx.GROUND, (-0.5, 0.0), (k, 0.0)) for k in range(200)]
    large = str(rx.Mechanism([rx.Body(f"bar {k}", 1.0, 1.0) for k in range(200)], joints))
    assert on_a_screen(large) and "bar 199" in large and "J199" in large and "names.bodies" in large


def test_a_report_fits_a_terminal():
    """Ten redundant constraints, whose releases are long; rows of velocity, which are counted apart in one sentence."""
    door = rx.mechanisms.door()
    state = rx.assemble(door, rates={"hinge 1.angle": 1.0})
    report = rx.analyze(door, state)
    below, above = (dataclasses.replace(report, velocity_rows=rows).heading for rows in ((), report.rows))
    for text in (str(report), below, above):
        assert max(map(len, text.splitlines())) <= WIDTH
    assert len(above.splitlines()) > len(below.splitlines()) + 1
    lines = [line for line in above.splitlines() if not line.startswith(" ")]
    assert [line.split()[0] for line in lines] == ["6", "Least", "15", "Units:"]


def test_inside_of_transformations_shapes_are_printed():
    mechanism, told = rod(rx.units.SI), []

    def inside(phi, mechanism):
        state = at(phi)
        told.extend(map(str, (state, rx.solve(mechanism, state), mechanism, mechanism.table(state))))
        return state.q

    jax.make_jaxpr(inside)(0.3, mechanism)
    assert ["[3]" in text for text in told] == [True, True, False, True]
    assert told[2] == "Mechanism with 3 coordinates, 2 rows, bodies rod"
    pin = rx.Revolute("A", "a", rx.GROUND, (0.0, 0.0), (0.0, 0.0))
    several = jax.vmap(lambda m: rx.Mechanism([rx.Body("a", m, m)], [pin]))(jnp.ones(4))
    assert str(several) == "Mechanism with 3 coordinates, 2 rows, bodies a"


# Exports ---------------------------------------------------------------------------------------------


def test_solutions_become_tables_and_data_sets():
    mechanism, angles = rod(rx.units.SI), np.array([0.0, np.pi / 3])
    many = jax.vmap(lambda phi: rx.solve(mechanism, at(phi)))(jnp.asarray(angles))
    frame, data = many.to_pandas(), many.to_xarray()
    np.testing.assert_allclose(frame["rod.phi''"], -15.0 * np.cos(angles), rtol=1e-12)
    np.testing.assert_allclose(frame["A force y on rod"], [2.5, 8.125], rtol=1e-12)
    np.testing.assert_allclose(data.acceleration.sel(coordinate="rod.phi"), -15.0 * np.cos(angles), rtol=1e-12)
    np.testing.assert_allclose(data.multipliers.sel(row="A.y"), [-2.5, -8.125], rtol=1e-12)
    assert frame.index.name == "sample" and list(frame["result"]) == ["successful"] * 2
    units = frame.attrs["units"]
    assert [units[name] for name in ("rod.x", "rod.x'", "rod.phi''", "A.y", "A moment on rod")] == [
        "m", "m/s", "rad/s²", "N", "N m",
    ]  # fmt: skip
    assert data.acceleration.attrs == {"linear_unit": "m/s²", "angular_unit": "rad/s²"}
    assert list(data.coordinate_kind.values) == ["linear", "linear", "angular"]


def test_one_solution_is_one_row():
    one = rx.solve(rod(), at(0.0))
    assert one.to_pandas().shape == (1, len(one.entries)) and one.to_pandas().attrs["result"] == "successful"
    assert one.to_xarray().acceleration.dims == ("coordinate",)


@pytest.mark.slow
def test_a_batch_of_batches_has_an_index_of_both():
    mechanism, angles = rod(), np.array([0.0, np.pi / 3])
    grid = jax.vmap(jax.vmap(lambda phi: rx.solve(mechanism, at(phi))))(jnp.asarray([angles, angles]))
    assert grid.to_pandas().index.names == ["sample_0", "sample_1"]
    np.testing.assert_allclose(grid.to_pandas().loc[(1, 1), "rod.phi''"], -7.5, rtol=1e-12)
    assert grid.to_xarray().multipliers.dims == ("sample_0", "sample_1", "row")


def test_bands_become_tables_and_data_sets():
    """A wire that pulls a mass against a load of 3 N: its force is unique."""
    load = jnp.array([3.0, 1.0])
    wire = rx.Axis(("wire",), ("force",))
    system = rx.System(lambda q, t, p: q[:1], np.ones(2), lambda *_: load, rows=wire, units=rx.units.SI)
    state = rx.State([0.0, 0.0], [0.0, 1.0])
    bands = rx.band(system, state, "wire", rx.MinimumNorm())
    frame = bands.to_pandas()
    assert frame.loc["wire", ["lower", "upper", "exact", "unit"]].to_list() == [3.0, 3.0, True, "N"]
    assert row(str(bands), "wire,") == ["N", "3", "3", "exact"]
    path = rx.band_along(system, [state, rx.State([0.0, 1.0], [0.0, 1.0], 1.0)], "wire", rx.MinimumNorm())
    data = path.to_xarray()
    assert data.lower.dims == ("state", "output") and list(data.t) == [0.0, 1.0] and data.t.attrs == {"units": "s"}
    assert list(path.to_pandas().upper) == [3.0, 3.0]


@pytest.mark.parametrize("package", ["pandas", "xarray"])
def test_a_package_that_is_not_there_is_named(package, monkeypatch):
    solution = rx.solve(rod(), at(0.0))
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ImportError, match=rf'{package}: pip install "redundax\[study\]"'):
        getattr(solution, f"to_{package}")()
