"""What a new user gets wrong in a call: refused in words that name the argument, the part and what to give instead."""

import os
import warnings

import equinox as eqx
import jax
import numpy as np
import pytest

import redundax as rx
from redundax._system._pushing import in_words
from redundax._tools._words import did_you_mean

rs, NAN, HERE = rx.spatial, float("nan"), (0.0, 0.0)
ROD, BAR = rx.Body("rod", 1.0, 0.1), rs.Body("bar", 1.0, (1.0, 1.0, 1.0))
PIN = rx.Revolute("A", "rod", "ground", HERE, HERE)
PENDULUM = rx.Mechanism([ROD], [PIN])
STATE = rx.State([0.0, 0.0, 0.3], np.zeros(3))
BOX = rx.PreloadBox({"A.x": (-1.0, 1.0)})
SOFT = rx.Compliance({"A.x": 1e-8})
MISFIT = rx.MisfitBox(SOFT, {"A.x": (0.0, 1e-5)})

KINDS = {
    "closure a word": (
        lambda: rx.solve(PENDULUM, STATE, closure="elastic"),
        "`closure` .* but is 'elastic'",
    ),
    "system and state": (
        lambda: rx.units.state_in_units(PENDULUM, STATE, rx.units.Units(length=0.1)),
        "`state` must be a state.*Give that first, then its system",
    ),
    "closure bounds": (lambda: rx.solve(PENDULUM, STATE, closure=MISFIT), "type MisfitBox.* go to `rx.band`"),
    "of a motion": (lambda: rx.simulate(PENDULUM, STATE, 1.0, closure=BOX), "`closure` .* type PreloadBox"),
    "of a report": (lambda: rx.analyze(PENDULUM, STATE, closure=1e-8), "`closure` .* but is 1e-08"),
    "of a family": (lambda: rx.solution_family(PENDULUM, STATE, closure=BOX), "`closure` .* type PreloadBox"),
    "of a search": (lambda: rx.frictional_solutions(PENDULUM, STATE, closure=BOX), "`closure` .* type PreloadBox"),
    "of parts": (lambda: rx.AsBuilt({"A.x": 1e-8}, PENDULUM), "`closure` .* type dict"),
    "of bounds": (lambda: rx.MisfitBox({"A.x": 1e-8}, {}), "`closure` .* type dict"),
    "in units": (lambda: rx.units.closure_in_units("soft"), "`closure` .* 'soft'"),
    "bounds a dict": (lambda: rx.band(PENDULUM, STATE, "A.x", {"A.x": (0, 1)}), "`bounds` .* type dict.*PreloadBox"),
    "of sticking": (lambda: rx.sticking(PENDULUM, STATE, "preload"), "`bounds` .* 'preload'"),
    "of a limit": (lambda: rx.limit_load(PENDULUM, STATE, {"rod.phi": 1.0}, 40.0), "`bounds` .* 40.0"),
    "solver a word": (lambda: rx.solve(PENDULUM, STATE, solver="newton"), "`solver` .* friction, but is 'newton'"),
    "solver of time": (lambda: rx.simulate(PENDULUM, STATE, 1.0, solver=rx.Newton()), "`solver` .* go to `rx.solve`"),
    "stabilisation": (lambda: rx.simulate(PENDULUM, STATE, 1.0, stabilisation="none"), "`stabilisation` .* 'none'"),
    "units a word": (lambda: rx.Mechanism([ROD], [PIN], units="mm"), "`units` .* 'mm'.*rx.units.MM_TONNE"),
    "of a closure": (lambda: rx.Compliance({"A.x": 1e-8}, units="mm"), "`units` .* 'mm'"),
    "of a norm": (lambda: rx.MinimumNorm(units="mm"), "`units` .* 'mm'"),
    "of a system": (lambda: rx.units.in_units(PENDULUM, "mm"), "`units` .* 'mm'"),
    "friction": (
        lambda: rx.Revolute("A", "rod", "ground", HERE, HERE, friction=0.1),
        r"joint 'A' .* but is 0\.1",
    ),
    "a class": (lambda: rs.Revolute("A", BAR, "ground", (0, 0, 0), friction=rx.Coulomb), "is the class Coulomb. Write"),
    "contact": (lambda: rs.Revolute("A", BAR, "ground", (0, 0, 0), contact="ends"), "`contact` of joint 'A' .* 'ends'"),
    "swapped": (lambda: rx.solve(STATE, PENDULUM), "`system` .* type State"),
    "a position": (lambda: rx.analyze(PENDULUM, STATE.q), "`state` .* `rx.assemble"),
    "to stick": (lambda: rx.sticking(PENDULUM, STATE.q), "`state` must be a state"),
    "coupler": (lambda: rx.Mechanism([ROD], [PIN], couplers=["gear"]), "`couplers` must hold couplers"),
    "pose": (lambda: rx.Mechanism([ROD], [PIN], pose=0.3), "`pose` must be a function"),
    "number for name": (lambda: rx.Body(1, 1.0, 0.1), "`name` must be a word"),
    "placement": (lambda: rs.Revolute("A", BAR, "ground", on_i=(0, 0, 0), on_j=(0, 0, 0)), "`on_i` of joint 'A'"),
    "figures": (
        lambda: rx.Revolute("A", "rod", "ground", HERE, HERE, 0.1, rx.Coulomb([0.1, 0.2])),
        r"one has shape \(2,\)",
    ),
    "radius": (
        lambda: rx.Revolute("A", "rod", "ground", HERE, HERE, -0.1),
        "`pin_radius` of joint 'A' must not be neg",
    ),
    "compliances": (lambda: rx.ElasticJoints(PENDULUM, ["A"]), "`joints` must be compliances of joints alone"),
    "compliances by name": (
        lambda: rx.ElasticJoints(PENDULUM, {"A": rx.JointCompliance("A", 1e-8)}),
        "`joints` must have numbers by name, but has a JointCompliance for 'A'. Give these as a list",
    ),
    "three of a drive": (
        lambda: rx.ElasticJoints(PENDULUM, {"A": 1e-8}, drives={"A.angle": (1e-6, 0.0, 0.0)}),
        "`drives` must have one compliance for 'A.angle', or a pair of it and its error, but has 3",
    ),
    "a load": (lambda: rx.limit_load(PENDULUM, STATE, 1.0), "`load` must be generalised forces by name"),
    "a load of a mechanism": (
        lambda: rx.limit_load(PENDULUM, STATE, [rx.AppliedForce("rod", (1.0, 0.0))]),
        "`load` must be generalised forces by name",
    ),
    "of a function": (
        lambda: rx.LoadFunction("rod", lambda i, j, t, p: t),
        "LoadFunction on 'rod' must give two wrenches",
    ),
    "no function": (lambda: rx.LoadFunction("rod", 3.0), "`function` of LoadFunction on 'rod' must be a function"),
    "factor": (lambda: rx.solve(PENDULUM, STATE, factor="lu"), "`factor` must be what `factorize` gives"),
    "of a state": (lambda: rx.mechanisms.parallelogram().state(angle=0.3), "Arguments of `state` must be phi, but"),
    "of equations": (
        lambda: rx.System(lambda q, t, p: q[:1], [1.0], friction=rx.Coulomb(0.1)),
        "`rx.Coulomb` go to joints",
    ),
    "a list": (lambda: rx.assemble([PENDULUM], {}), "`system` .* type list"),
    "parts by name": (lambda: rx.Mechanism([ROD], {"A": PIN}), "`joints` .* list of its values"),
    "without a name": (lambda: rx.Mechanism([ROD, rx.Body("", 1.0, 1.0)], [PIN]), "`bodies` must have names"),
    "coupled with itself": (
        lambda: rx.Coupler("c", "A.angle", "A.angle", 1.0),
        "'c' must .* 'A.angle' twice",
    ),
    "a law of two": (
        lambda: rx.AngleDriver("M", "rod", "ground", lambda t, p: p * t),
        r"`angle` of the driver 'M' must be a function of \(t\), but is one of \(t, p\)",
    ),
    "a law of text": (
        lambda: rx.AngleDriver("M", "rod", "ground", lambda t: "0.3"),
        "`angle` of the driver 'M' must give a number at a time, but gives '0.3'",
    ),
    "a compiled law of text": (
        lambda: rx.AngleDriver("M", "rod", "ground", jax.jit(lambda t: "0.3")),
        "`angle` of the driver 'M' must give numbers",
    ),
    "a law of lists": (
        lambda: rx.drive(PENDULUM, {"A.angle": lambda t: [t]}, np.linspace(0, 1, 3), {}),
        "`laws` of the driver 'A.angle' must give a number at a time, but gives an object of the type list",
    ),
    "a law of complex": (
        lambda: rx.AngleDriver("M", "rod", "ground", lambda t: 1j * t),
        r"`angle` of the driver 'M' must give .* of shape \(\) and type complex",
    ),
    "a law of Python": (
        lambda: rx.AngleDriver("M", "rod", "ground", lambda t: 0.3 if t > 1.0 else 0.0),
        "`angle` of the driver 'M' must be a function that JAX can trace",
    ),
    "a load of text": (
        lambda: rx.LoadFunction("rod", lambda i, j, t, p: (rx.Wrench("a", 0.0), rx.Wrench("a", 0.0))),
        "LoadFunction on 'rod' must give two wrenches",
    ),
    "a load of complex": (
        lambda: rx.LoadFunction("rod", lambda i, j, t, p: 2 * (rx.Wrench(1j * i.pose.r, 0.0 * t),)),
        "LoadFunction on 'rod' must give two wrenches",
    ),
    "a load of three": (lambda: rx.LoadFunction("rod", lambda i, j, t: None), r"\(motion_i, motion_j, t, parameters\)"),
    "no constraint": (lambda: rx.System(None, [1.0]), "`constraint` must be a function where there are no `velocity_"),
    "a constraint of one": (lambda: rx.System(lambda q: q[:1], [1.0]), r"`constraint` .* of \(q, t, parameters\)"),
    "a load of the state": (
        lambda: rx.System(lambda q, t, p: q[:1], [1.0], lambda q, qd: q),
        r"`load` must be a function of \(q, qd, t, parameters\)",
    ),
    "a sample of another name": (
        lambda: rx.study(lambda phi: phi, {"mu": np.ones(3)}),
        "Arguments of `run` must be phi, but: .*'phi'",
    ),
    "of tolerances": (lambda: rx.tolerance_study(lambda a: a, {"b": rx.Normal(0.0, 1.0)}), "Arguments of `build`"),
    "of a fit": (
        lambda: rx.identify(lambda a: a, 1.0, {"b": rx.Normal(0, 1)}, noise=1.0),
        "Arguments of `predict`",
    ),
    "misfit swapped": (
        lambda: rx.misfit(PENDULUM, STATE, PENDULUM),
        "`state` must be a state, but is of the type Mech",
    ),
    "actual": (lambda: rx.misfit(PENDULUM, SOFT, STATE), "`actual` must be a mechanism, .* type Compliance"),
    "as built": (lambda: rx.AsBuilt(SOFT, STATE), "`actual` must be a mechanism, .* type State"),
    "warm": (lambda: rx.heated(STATE, {"rod": 20.0}, 1e-5), "`mechanism` must be a mechanism, .* type State"),
    "no log": (lambda: rx.check(PENDULUM, 3), "`log` must be a log, but is 3"),
    "no file": (lambda: rx.load_model(None), "`path` must be the name of a file, but is None"),
    "no solution": (lambda: rx.grip(PENDULUM, STATE), "`solution` must be a solution, but is of the type State"),
    "rank a word": (lambda: rx.solve(PENDULUM, STATE, rank="full"), "`rank` must be a whole number from 0 to 2"),
    "rank too large": (lambda: rx.solve(PENDULUM, STATE, rank=3), "2 rows and 3 coordinates, but is 3"),
    "rank of a motion": (lambda: rx.simulate(PENDULUM, STATE, 1.0, rank=1.5), r"`rank` .* but is 1\.5"),
    "a sense": (lambda: rx.solve(PENDULUM, STATE, sense="left"), "`sense` must be a number"),
    "nodes a word": (lambda: rx.band(PENDULUM, STATE, "A.x", nodes="many"), "`nodes` must be a whole .* but is 'many'"),
    "no nodes": (lambda: rx.limit_load(PENDULUM, STATE, {"rod.phi": 1.0}, nodes=-3), "`nodes` .* from 1 on, but is -3"),
    "seed": (lambda: rx.sticking(PENDULUM, STATE, seed="x"), "`seed` must be a whole number from 0 on, but is 'x'"),
    "starts": (lambda: rx.frictional_solutions(PENDULUM, STATE, starts=2.5), r"`starts` .* but is 2\.5"),
    "samples": (lambda: rx.solution_family(PENDULUM, STATE, samples=0), "`samples` .* from 1 on, but is 0"),
    "steps": (lambda: rx.simulate(PENDULUM, STATE, 1.0, max_steps=[3]), r"`max_steps` .* but is \[3\]"),
    "two ends": (lambda: rx.simulate(PENDULUM, STATE, [1.0, 2.0]), r"`t1` must be a number, but has shape \(2,\)"),
    "outputs a number": (lambda: rx.band(PENDULUM, STATE, 3, SOFT), "`outputs` must hold names, but is 3"),
    "held a number": (
        lambda: rx.drive(PENDULUM, {"A.angle": rx.Harmonic(0.1, 1.0)}, [0.0, 1.0], STATE.q, hold=3),
        "`hold` must hold names, but is 3",
    ),
    "states a number": (lambda: rx.band_along(PENDULUM, 3, "A.x"), "`states` must be states, but is 3"),
    "no states": (lambda: rx.analyze_along(PENDULUM, [STATE, 3]), "`states` must be states alone, but is 3"),
    "positions": (lambda: rx.assemble(PENDULUM, positions=3), "`positions` must be numbers by name, but is 3"),
    "rates": (lambda: rx.assemble(PENDULUM, rates="fast"), "`rates` must be numbers by name, but is 'fast'"),
    "a position a word": (
        lambda: rx.assemble(PENDULUM, STATE.q, positions={"A.angle": "x"}),
        "`positions` must be a number",
    ),
    "two times": (lambda: rx.assemble(PENDULUM, STATE.q, t=[1.0, 2.0]), r"`t` must be a number, but has shape \(2,\)"),
    "no function to run": (lambda: rx.study(3, {"mu": np.ones(3)}), "`run` must be a function, but is 3"),
    "no samples": (lambda: rx.study(lambda mu: mu, 3), "`samples` must be values by name, but is 3"),
    "chunk": (lambda: rx.study(lambda mu: mu, {"mu": np.ones(3)}, chunk="x"), "`chunk` must be a whole number"),
    "no distributions": (lambda: rx.tolerance_study(lambda a: a, 3), "`parameters` must be distributions by name"),
    "percentiles": (
        lambda: rx.tolerance_study(lambda a: a, {"a": rx.Normal(0.0, 1.0)}, percentiles=5.0),
        "`percentiles` must hold numbers from 0 to 100",
    ),
    "size": (
        lambda: rx.ensemble(lambda a: a, {"a": rx.Normal(0.0, 1.0)}, system=PENDULUM, size=None),
        "`size` must be a whole number",
    ),
    "mean": (lambda: rx.Normal("x", 1.0), "`mean` must be a number"),
}
NUMBERS = {
    "compliance": (lambda: rx.ElasticJoints(PENDULUM, {"A": np.inf}), "`translation` of joint .A. must be finite"),
    "mass NaN": (lambda: rx.Body("rod", NAN, 0.1), "`mass` of body 'rod' must be finite, but is nan"),
    "mass infinite": (lambda: rx.Body("rod", np.inf, 0.1), "`mass` of body 'rod' must be finite"),
    "inertia NaN": (lambda: rs.Body("bar", 1.0, np.full((3, 3), NAN)), "`inertia` of body 'bar' must be finite"),
    "turned by NaN": (
        lambda: rs.Body("bar", 1.0, (1, 1, 1), orientation=(1, 0, 0, NAN)),
        "`orientation` of body",
    ),
    "point NaN": (lambda: rx.Revolute("A", "rod", "ground", (NAN, 0.0), HERE), "`point_i` of joint 'A' must be finite"),
    "in space": (lambda: rs.Spherical("A", BAR, "ground", (0, NAN, 0)), "`point` of joint 'A' must be finite"),
    "normal NaN": (lambda: rx.Translational("K", "rod", "ground", HERE, HERE, (NAN, 1.0)), "`normal` of joint 'K'"),
    "force NaN": (lambda: rx.AppliedForce("rod", (NAN, 0.0)), "`force` of AppliedForce on 'rod' must be finite"),
    "driver NaN": (lambda: rx.AngleDriver("M", "rod", "ground", NAN), "`angle` of the driver 'M' must be finite"),
    "3 in the plane": (lambda: rx.Revolute("A", "rod", "ground", (0, 0, 0), HERE), r"`point_i` of joint 'A' .*\(3,\)"),
    "force of 3": (lambda: rx.AppliedForce("rod", (0, 0, 1)), "`force` of AppliedForce on 'rod' must have two"),
    "normal of 3": (lambda: rx.Translational("K", "rod", "ground", HERE, HERE, (0, 0, 1)), "`normal` of joint 'K'"),
    "moment as point": (
        lambda: rx.AppliedForce("rod", (0, 1), 3.0),
        "`point` of Applied.* moment by its name",
    ),
    "2 in space": (lambda: rs.Revolute("A", BAR, "ground", (0, 0)), "`point` of joint 'A' must have 3 components"),
    "rod of 2": (lambda: rs.Distance("D", BAR, "ground", (0, 0, 0), (0, 1)), "`point_j` of joint 'D' must have 3"),
    "body of 2": (lambda: rs.Body("bar", 1.0, (1, 1, 1), centre=(0, 0)), "`centre` of body 'bar' must have 3"),
    "no length": (
        lambda: rx.DistanceDriver("D", "rod", "ground", HERE, (0, 1), 0.0),
        "`distance` of 'D' must be",
    ),
    "figures of a point": (lambda: rx.Revolute("A", "rod", "ground", "0, 0", HERE), "`point_i` must be a number"),
    "rows of two lengths": (lambda: rx.Body("rod", [[1.0], [1.0, 2.0]], 1.0), "`mass` must be a number"),
    "complex": (lambda: rx.Body("rod", 1j, 1.0), "`mass` must be a number"),
    "moment of 3": (lambda: rx.AppliedForce("rod", moment=(0, 0, 1)), r"`moment` of AppliedForce .*\(3,\)"),
    "guide of no length": (
        lambda: rx.Translational("K", "rod", "ground", HERE, HERE, (0, 1), guide_length=-1.0),
        "`guide_length` of joint 'K' must be positive",
    ),
    "no coefficients": (lambda: rx.Polynomial([]), r"`coefficients` must be a list .*\(0,\)"),
    "arm of sliding": (
        lambda: rx.GearPair("M", "rod", "ground", HERE, HERE, (20, 40), 0.002, sliding_arm=-1.0),
        "`sliding_arm` must not be negative",
    ),
    "planets that overlap": (lambda: rx.mechanisms.planetary(7), "`planets` must leave room .* 7 overlap"),
    "in space too": (
        lambda: rs.Distance("D", BAR, "ground", (0, 0, 0), (0, 0, 0)),
        "`distance` of 'D' must be",
    ),
}


@pytest.mark.skipif(os.environ.get("REDUNDAX_CHECKS") == "on", reason="types of calls are refused before")
@pytest.mark.parametrize("case", KINDS)
def test_objects_of_another_kind_are_refused_by_name(case):
    call, words = KINDS[case]
    with pytest.raises(rx.RedundaxError, match=words):
        call()


@pytest.mark.parametrize("case", NUMBERS)
def test_numbers_of_parts_are_refused_by_name(case):
    call, words = NUMBERS[case]
    with pytest.raises(rx.RedundaxError, match=words):
        call()


def test_known_numbers_alone_are_checked():
    """Within transformations, and of friction and gravity everywhere, NaN goes on to results that say so."""
    assert np.isnan(rx.Mechanism([ROD], [PIN], gravity=(0.0, NAN)).gravity[1])
    assert np.isnan(jax.jit(lambda x: rx.Body("rod", x, x).mass)(NAN))
    assert np.isnan(rx.Revolute("A", "rod", "ground", HERE, HERE, pin_radius=NAN, friction=rx.Coulomb(NAN)).pin_radius)
    rx.DistanceDriver("D", "rod", "ground", HERE, (0, 1), lambda t: 0.0 * t)  # a law of time may pass through 0
    with pytest.raises(TypeError):  # in space a moment by position would be a point
        rs.AppliedForce(BAR, (0, 0, 1), (0, 0, 1))


def test_parts_in_the_plane_take_a_body_or_its_name():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert rx.Revolute("A", ROD, "ground", HERE, HERE).i == rx.AppliedForce(ROD, moment=1.0).i == "rod"


def test_what_drives_give_is_asked_for_by_name_and_play_that_is_idle_told_where_it_is_given():
    ts, joints = np.linspace(0.0, 1.0, 3), rx.ElasticJoints(PENDULUM, {"A": 1e-8}, play={"A": 1e-6})
    with pytest.warns(UserWarning, match="Play of A changes no load") as told:
        run = rx.drive(PENDULUM, {"A.angle": 0.3}, ts, {}, closure=joints)
    if os.environ.get("REDUNDAX_CHECKS") != "on":  # whose calls stand between
        assert {each.filename for each in told} == {__file__}
    assert jax.tree.map(np.shape, run.peak) == {"A.angle": ()}
    for figures in (run.peak, run.energy, run.contacts):
        with pytest.raises(KeyError, match=r"`name` must hold names, but holds 'A'"):
            figures["A"]


def test_rates_have_the_names_of_coordinates_or_of_results():
    guess = {"rod.x": 0.5}
    swung = rx.Mechanism([ROD], [rx.Revolute("A", "rod", "ground", (-0.5, 0.0), HERE)])
    for rates in ({"rates": {"A.angle'": 1.0}}, {"rates": {"A.angle": 1.0}}, {"qd": {"rod.y'": 0.5, "rod.phi'": 1.0}}):
        np.testing.assert_allclose(rx.assemble(swung, guess, **rates).qd, [0.0, 0.5, 1.0], atol=1e-12)
    with pytest.raises(rx.RedundaxError, match=r"`rates` must name each rate once, but holds A\.angle twice"):
        rx.assemble(swung, guess, rates={"A.angle": 1.0, "A.angle'": 1.0})
    for argument in ("positions", "rates"):
        with pytest.raises(rx.RedundaxError, match=rf"`{argument}` must hold a number .* 'A\.angle' has"):
            rx.assemble(swung, guess, **{argument: {"A.angle": np.array([0.1, 0.2])}})


def test_positions_of_bodies_have_no_names_in_space():
    door = rx.Mechanism([BAR], [rs.Revolute("A", BAR, "ground", (0, 0, 0))])
    with pytest.raises(rx.RedundaxError, match="`q` must be a vector in space"):
        rx.assemble(door, {"bar.x": 0.5})
    with pytest.raises(rx.RedundaxError, match=r"holds 'bar\.x'\. There are A\.angle\."):
        rx.assemble(door, positions={"bar.x": 0.5})


def test_the_load_on_either_body_of_a_joint_has_its_name():
    """A rod that hangs at rest pulls its pin down by its weight; an offset joint has other moments on its bodies."""
    beam = rx.Fixed("wall", "rod", "ground", (-0.5, 0.0), (-0.5, 0.0))
    hung = rx.Mechanism([ROD], [beam], loads=[rx.AppliedForce("rod", (0.0, -3.0), (0.5, 0.0))], gravity=(0.0, -9.81))
    solution = rx.solve(hung, rx.State(np.zeros(3), np.zeros(3)))
    weight, bending = 9.81 + 3.0, 0.5 * 9.81 + 3.0
    for part, value in (("force x", 0.0), ("force y", weight), ("moment", bending)):
        np.testing.assert_allclose(solution[f"wall {part} on rod"], value, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(solution[f"wall {part} on ground"], -value, rtol=1e-12, atol=1e-12)
    assert not any(name.endswith(" on ground") for name in (each.name for each in solution.entries))  # told once
    with pytest.raises(KeyError, match="Did you mean 'wall force y on ground'"):
        solution["wall force y on Ground"]


def test_near_names_are_those_of_the_same_joint():
    """`band` tells loads on one body of a joint; of another joint the same words are nearer."""
    known = ["rod.x''", "B force y on rod", "C force x on rocker", "C force y on rocker"]
    assert did_you_mean("C force y on rod", known).startswith("Did you mean 'C force y on rocker' or")
    assert did_you_mean("C", known) == "Did you mean 'C force x on rocker' or 'C force y on rocker'? "
    assert did_you_mean("base link", ["base plate", "base_link"]).startswith("Did you mean 'base_link'")
    assert did_you_mean("xyzzy", known) == ""
    assert did_you_mean("rod.z''", known).startswith("Did you mean \"rod.x''\"")


class Own(rx.AbstractJoint):
    row_kinds = (("y", "force"),)
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)

    def residual(self, i, j, t):
        return (i.r - j.r)[1:]


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (
            {"residual": lambda self, i, j, t: i.r[1]},
            r"Own 'own' must have shape \(1,\).* has shape \(\)",
        ),
        ({"residual": lambda self, i, j, t: i.r}, r"must have shape \(1,\).* has shape \(2,\)"),
        (
            {"residual": lambda self, i, j, t: np.sin(i.phi)},
            "`residual` of `Own` .* that JAX can trace",
        ),
        (
            {"residual": lambda self, i, j: i.r[1:]},
            r"`residual` of `Own` must be a function of \(i, j, t\)",
        ),
        ({"residual": lambda self, i, j, t: np.array([1])}, "Own 'own' must be floating-point .* type int64"),
        ({"row_kinds": ("y", "force")}, r"`row_kinds` of Own must give a name and a kind.*with both commas"),
        ({"row_kinds": (("y", "length"),)}, "'force' or 'moment'"),
        ({"pushing": ("z",)}, "`pushing` of Own must hold names of its rows, but holds 'z'"),
    ],
)
def test_a_joint_of_a_user_that_is_wrong_is_told_what_it_must_give(changed, words):
    given = {"__module__": __name__, "__annotations__": {}}
    kind = type(rx.AbstractJoint)("Own", (Own,), changed | given) if changed.keys() != {"residual"} else None
    kind = kind or type(rx.AbstractJoint)("Own", (rx.AbstractJoint,), _fields() | changed)
    with pytest.raises(rx.RedundaxError, match=words):
        rx.Mechanism([ROD], [PIN, kind("own", "rod", "ground")])


def _fields():
    names = ("name", "i", "j")
    fields = {name: eqx.field(static=True) for name in names}
    return {"__module__": __name__, "__annotations__": dict.fromkeys(names, str), "row_kinds": Own.row_kinds} | fields


def test_a_plain_init_is_told_how_fields_are_declared():
    class Plain(rx.AbstractJoint):
        row_kinds = (("y", "force"),)

        def __init__(self, name, i, j):
            self.name, self.i, self.j = name, i, j

        def residual(self, i, j, t):
            return (i.r - j.r)[1:]

    with pytest.raises(rx.RedundaxError, match=r"Plain must declare .* `name: str = eqx\.field\(static=True\)`"):
        Plain("own", "rod", "ground")


def test_contacts_that_pull_are_told_in_their_own_words():
    assert "flank" in in_words(("mesh.teeth",)) and "Contacts" not in in_words(("mesh.teeth",))
    foot = in_words(("foot.floor",))
    assert foot.startswith("Contacts pull in foot.floor") and "teeth" not in foot.lower() and "flank" not in foot
    assert in_words(()) == ""


def test_bounds_are_told_as_they_were_given():
    """Three parallel cranks: one self-stress state, of which one row is the parameter and the others limit it."""
    mechanism = rx.mechanisms.parallelogram()
    given = {"A1.x": (-50.0, 50.0), "A2.x": (-30.0, 30.0), "B2.x": (-9.0, 9.0)}
    bands = rx.band(mechanism, mechanism.state(0.6, rate=1.0), "A1.x", rx.PreloadBox(given))
    assert bands.title == "PreloadBox: A1.x -50 to 50, A2.x -30 to 30, B2.x -9 to 9"
    assert len(bands.parameters) < 3


def test_some_of_several_states_and_what_has_no_places():
    many = rx.State(np.arange(6.0).reshape(3, 2), np.ones((3, 2)), np.arange(3.0))
    np.testing.assert_array_equal(many[1:-1].q, [[2.0, 3.0]])
    assert [float(one.t) for one in many] == [0.0, 1.0, 2.0]
    with pytest.raises(IndexError):
        many[3]
    for state, which in ((many, "A.x"), (rx.State([0.0], [0.0]), 0)):
        with pytest.raises(rx.RedundaxError, match=r"entries in `q`, `qd` and `t`.* names; places"):
            state[which]


def test_laws_and_loads_leave_no_tracers_behind():
    load = lambda i, j, t, p: 2 * (rx.Wrench(t * i.pose.r, 0.0 * t),)  # noqa: E731
    with jax.checking_leaks():
        rx.AngleDriver("M", "rod", "ground", lambda t: 0.3 * t)
        rx.LoadFunction("rod", load)
