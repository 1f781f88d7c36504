"""Building mechanisms: joints and loads against hand formulas, assembly, and refusal of bad input."""

import math
import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import registry

import redundax as rx
from redundax._bodies._names import check_kinds
from redundax._system._results import result_codes

G = "ground"


def one_body(*joints, loads=(), gravity=(0.0, -9.81)):
    return rx.Mechanism([rx.Body("a", 2.0, 0.1)], joints, loads=loads, gravity=gravity)


def residual(joint, q, t=0.0):
    mechanism = rx.Mechanism(
        [rx.Body("a", 1.0, 1.0), rx.Body("b", 1.0, 1.0)], [joint, rx.Fixed("W", "b", G, (0, 0), (0, 0))]
    )
    rows = [k for k, name in enumerate(mechanism.rows.names) if name.startswith(joint.name + ".")]
    return np.asarray(mechanism.constraint(jnp.asarray(q), jnp.asarray(t)))[rows]


class Roller(rx.AbstractJoint):
    """A joint of a user, with a field that joints of the library have for friction."""

    row_kinds = (("y", "force"),)
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    pin_radius: jax.Array = eqx.field(converter=jnp.asarray)

    def residual(self, i, j, t):
        return (i.r - j.r)[1:] - self.pin_radius


def test_joints_of_a_user_keep_all_their_fields():
    np.testing.assert_allclose(residual(Roller("J", "a", "b", 0.2), Q), [-0.2 - 0.7 - 0.2], rtol=1e-15)


Q = [0.3, -0.2, 1.1, 0.7, 0.4, -0.9]  # a.x a.y b.x b.y a.phi b.phi


def turn(phi, v):
    return np.array([np.cos(phi) * v[0] - np.sin(phi) * v[1], np.sin(phi) * v[0] + np.cos(phi) * v[1]])


PA = np.array(Q[:2]) + turn(Q[4], (0.1, 0.2))
PB = np.array(Q[2:4]) + turn(Q[5], (-0.3, 0.5))
NORMAL = turn(Q[5], (0.6, 0.8))


@pytest.mark.parametrize(
    ("joint", "expected"),
    [
        (rx.Revolute("J", "a", "b", (0.1, 0.2), (-0.3, 0.5)), PA - PB),
        (rx.Fixed("J", "a", "b", (0.1, 0.2), (-0.3, 0.5), 0.25), [*(PA - PB), 0.4 + 0.9 - 0.25]),
        (rx.Translational("J", "a", "b", (0.1, 0.2), (-0.3, 0.5), (3.0, 4.0), 0.25), [(PB - PA) @ NORMAL, 1.05]),
        (rx.PinInSlot("J", "a", "b", (0.1, 0.2), (-0.3, 0.5), (3.0, 4.0)), [(PB - PA) @ NORMAL]),
        (rx.AngleCoupling("J", "a", "b", 2.0, 0.1), [0.4 + 2.0 * -0.9 - 0.1]),
        (rx.AngleDriver("J", "a", "b", rx.Polynomial([0.1, 2.0])), [0.4 + 0.9 - (0.1 + 2.0 * 0.5)]),
        (rx.AngleDriver("J", "a", "b", lambda t: jnp.sin(t)), [0.4 + 0.9 - np.sin(0.5)]),
        (rx.DistanceDriver("J", "a", "b", (0.1, 0.2), (-0.3, 0.5), 0.6), [np.linalg.norm(PA - PB) - 0.6]),
        (
            rx.DistanceDriver("J", "a", "b", (0.1, 0.2), (-0.3, 0.5), rx.Polynomial([1.0, 0.0, 4.0])),
            [np.linalg.norm(PA - PB) - 2.0],
        ),
    ],
    ids=lambda x: type(x).__name__ if isinstance(x, rx.AbstractJoint) else "",
)
def test_residual_is_the_hand_formula(joint, expected):
    np.testing.assert_allclose(residual(joint, Q, t=0.5), expected, atol=1e-15)


def test_loads_are_the_hand_formulas():
    q, qd = jnp.array([0.3, -0.2, 0.4]), jnp.array([0.5, 0.6, -0.7])
    point, rate = turn(0.4, (0.1, 0.2)), np.array([0.5, 0.6])
    velocity = rate - 0.7 * np.array([-point[1], point[0]])
    end = np.array([0.3, -0.2]) + point
    offset = end - np.array([1.0, 1.0])
    length = np.linalg.norm(offset)
    tension = 50.0 * (length - 0.4) + 3.0 * velocity @ offset / length
    pull = -tension * offset / length

    def moment(force):
        return point[0] * force[1] - point[1] * force[0]

    follow = turn(0.4, (2.0, 3.0))
    cases = [
        (rx.AppliedForce("a", (2.0, 3.0), (0.1, 0.2), 0.5), [2.0, 3.0, moment((2.0, 3.0)) + 0.5]),
        (rx.AppliedForce("a", (2.0, 3.0), (0.1, 0.2), follows=True), [*follow, moment(follow)]),
        (rx.SpringDamper("a", G, (0.1, 0.2), (1.0, 1.0), 50.0, 0.4, 3.0), [*pull, moment(pull)]),
        (rx.TorsionSpring("a", G, 5.0, 0.1, 2.0), [0.0, 0.0, -5.0 * 0.3 + 2.0 * 0.7]),
        (
            rx.LoadFunction(
                "a",
                lambda i, j, t, p: (
                    rx.Wrench(-p["c"] * i.rate.r, -i.rate.phi * t),
                    rx.Wrench(jnp.zeros(2), jnp.zeros(())),
                ),
                parameters={"c": 0.3},
            ),
            [-0.15, -0.18, 0.7 * 2.0],
        ),
    ]
    for load, expected in cases:
        mechanism = one_body(rx.Revolute("A", "a", G, (0, 0), (0, 0)), loads=[load], gravity=(0.0, 0.0))
        np.testing.assert_allclose(mechanism.load(rx.State(q, qd, 2.0)), expected, atol=1e-14)


def test_a_load_between_bodies_does_no_work_on_a_rigid_motion():
    spring = rx.SpringDamper("a", "b", (0.1, 0.2), (0.3, 0.0), 7.0, 0.2, 3.0)
    joints = [rx.Revolute("A", "a", G, (0, 0), (0, 0)), rx.Revolute("B", "b", G, (0, 0), (0, 0))]
    mechanism = rx.Mechanism([rx.Body("a", 1, 1), rx.Body("b", 1, 1)], joints, loads=[spring])
    q = jnp.asarray(Q)
    turning = jnp.array([0.2, 0.3, -0.7, 1.1, 1.0, 1.0])  # both bodies turn about the origin
    force = mechanism.load(rx.State(q, jnp.zeros(6)))
    np.testing.assert_allclose(force @ turning, 0.0, atol=1e-14)
    np.testing.assert_allclose(force[:2] + force[2:4], 0.0, atol=1e-14)


def test_assemble_finds_the_nearest_state():
    mechanism = rx.mechanisms.wojtyra2020()
    exact = mechanism.state(0.7, rate=1.5)
    guess = exact.q + 0.03 * jnp.sin(3 * jnp.arange(12.0))
    state = rx.assemble(mechanism, guess, positions={"1.phi": 0.7}, rates={"1.phi": 1.5})
    np.testing.assert_allclose(state.q, exact.q, atol=1e-14)
    np.testing.assert_allclose(state.qd, exact.qd, atol=1e-13)


@pytest.mark.slow
def test_assembly_moves_with_the_lengths():
    guess = rx.mechanisms.wojtyra2020().state(0.7).q

    def assembled(length):
        return rx.assemble(rx.mechanisms.wojtyra2020(length=length), guess, positions={"1.phi": 0.7}).q

    exact = jax.jacfwd(lambda length: rx.mechanisms.wojtyra2020(length=length).state(0.7).q)(0.1)
    np.testing.assert_allclose(jax.jacfwd(assembled)(0.1), exact, atol=1e-10)
    np.testing.assert_allclose(jax.jacrev(assembled)(0.1), exact, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("argument", ["rate", "t", "qd"])
def test_assembly_moves_with_rates_time_and_velocities(argument):
    """On a circle of radius 1 + t, alone among the arguments of `vmap`, `jacfwd` and `jacrev`, against closed forms."""
    circle = rx.System(lambda q, t, p: jnp.linalg.norm(q)[None] - 1 - t, jnp.ones(2), lambda q, qd, t, p: 0.0 * q)
    n, guess, t, qd, rate = np.array([0.6, 0.8]), [0.75, 1.0], 0.25, np.array([0.3, -0.2]), 0.5

    def found(x):
        at = {"t": t, "qd": qd, "rate": rate} | {argument: x}
        free = rx.assemble(circle, guess, at["qd"], at["t"])
        held = rx.assemble(circle, guess, 0.0, at["t"], rates={"0": at["rate"]})
        return jnp.concatenate([free.q, free.qd, held.qd])

    along = np.outer([0.8, -0.6], [0.8, -0.6])
    value = np.concatenate([1.25 * n, n + along @ qd, [rate, (1 - 0.6 * rate) / 0.8]])
    moves = {"rate": [0, 0, 0, 0, 1, -0.75], "t": [*n, 0, 0, 0, 0], "qd": np.vstack([0 * along, along, 0 * along])}
    x = jnp.asarray({"t": t, "qd": qd, "rate": rate}[argument])
    np.testing.assert_allclose(jax.vmap(found)(jnp.stack([x, x])), [value, value], atol=1e-13)
    for derivative in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(derivative(found)(x), moves[argument], atol=1e-13)


def pin(i="a", j=G, **change):
    return rx.Revolute(**{"name": "A", "i": i, "j": j, "point_i": (0, 0), "point_j": (0, 0), **change})


def driven(name, law):
    return rx.AngleDriver(name, "a", G, rx.Polynomial(law))


def rubbing():
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    return mechanism, mechanism.state(0.7, rate=1.0)


LAWS = {"slow": [0.0, 0.0, 1.0], "fast": [0.0, 0.0, 3.0]}  # of t, at t = 0 the same in angle and speed
NEAR = {"A": (0.5, 0.0), "B": (0.5 + 1e-13, 0.0)}
PLATE = rx.Fixed("P", "a", G, (-0.5, 0.0), (-0.5, 0.0))
PLATE_IN_MM = rx.Fixed("P", "a", G, (-500.0, 0.0), (-500.0, 0.0))
IN_MM = rx.Mechanism([rx.Body("a", 2e-3, 100.0)], [PLATE_IN_MM], units=rx.units.Units(length=1000.0, mass=0.001))
BODY = rx.Body("a", 1.0, 1.0)
STATE = rx.State([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
BAD = {
    "negative mass": (lambda: rx.Body("a", -1.0, 1.0), ["`mass`", "'a'", "negative"]),
    "mass not a number": (lambda: rx.Body("a", np.nan, 1.0), ["`mass`", "'a'"]),
    "negative friction": (lambda: rx.Coulomb(-0.1), ["`mu`", "negative"]),
    "negative inertia": (lambda: rx.Body("a", 1.0, -1.0), ["`inertia`", "negative"]),
    "mass of wrong shape": (lambda: rx.Body("a", [1.0, 2.0], 1.0), ["`mass`", "number"]),
    "point of wrong shape": (lambda: pin(point_i=(0, 0, 0)), ["`point_i`", "two components"]),
    "zero normal": (lambda: rx.PinInSlot("S", "a", G, (0, 0), (0, 0), (0, 0)), ["`normal`", "zero"]),
    "friction without guide length": (
        lambda: rx.Translational("T", "a", G, (0, 0), (0, 0), (0, 1), friction=rx.Coulomb(0.1)),
        ["`guide_length`", "'T'"],
    ),
    "unknown body": (lambda: rx.Mechanism([BODY], [pin(i="c")]), ["`joints`", "'A'", "'c'", "The bodies are"]),
    "joint of a body with itself": (lambda: rx.Mechanism([BODY], [pin(j="a")]), ["`joints`", "'A'", "itself"]),
    "two bodies of one name": (lambda: rx.Mechanism([BODY, BODY], [pin()]), ["`bodies`", "'a'", "more than once"]),
    "two joints of one name": (lambda: rx.Mechanism([BODY], [pin(), pin()]), ["`joints`", "'A'", "more than once"]),
    "a body called ground": (lambda: rx.Mechanism([rx.Body(G, 1, 1)], [pin()]), ["`bodies`", "'ground'"]),
    "disconnected body": (
        lambda: rx.Mechanism([BODY, rx.Body("b", 1, 1)], [pin()]),
        ["`bodies`", "'b'", "no joint"],
    ),
    "a driver of known numbers": (
        lambda: rx.AngleDriver("D", "a", G, lambda t: math.sin(t)),
        ["`angle`", "math.sin", "jnp.sin"],
    ),
    "a driver with branches": (
        lambda: rx.DistanceDriver("D", "a", G, (0, 0), (1, 0), lambda t: t if t > 0 else -t),
        ["`distance`", "`if`", "jnp.where"],
    ),
    "a driver of NumPy": (lambda: rx.AngleDriver("D", "a", G, lambda t: np.sin(t)), ["`angle`", "np.sin", "jnp.sin"]),
    "a driver of two numbers": (
        lambda: rx.AngleDriver("D", "a", G, [0.5, 2.0]),
        ["`angle`", "(2,)", "`rx.Polynomial`"],
    ),
    "a driver that gives two numbers": (
        lambda: rx.AngleDriver("D", "a", G, lambda t: jnp.stack([t, t])),
        ["`angle`", "'D'", "(2,)"],
    ),
    "a driver that forgets to return": (lambda: rx.AngleDriver("D", "a", G, lambda t: None), ["'D'", "None"]),
    "a load of known numbers": (
        lambda: rx.LoadFunction("a", lambda i, j, t, p: (rx.Wrench(np.zeros(2), math.sin(t)),) * 2),
        ["`function`", "math.sin", "jnp.sin"],
    ),
    "no joints": (lambda: rx.Mechanism([BODY], []), ["`joints`", "at least one"]),
    "load on an unknown body": (
        lambda: rx.Mechanism([BODY], [pin()], loads=[rx.AppliedForce("c")]),
        ["`loads`", "'c'"],
    ),
    "no pose": (lambda: rx.Mechanism([BODY], [pin()]).state(0.1), ["`pose`"]),
    "state of wrong shape": (lambda: rx.solve(one_body(pin()), rx.State([0.0], [0.0])), ["`state`", "(3,)", "vmap"]),
    "h of wrong shape": (
        lambda: rx.solve(one_body(pin()), STATE, closure=rx.MinimumNorm(jnp.ones(3))),
        ["`h`", "(5,)", "(3,)"],
    ),
    "compliance of wrong size": (
        lambda: rx.solve(one_body(pin()), STATE, closure=rx.Compliance(jnp.ones(3))),
        ["`W`", "2 constraint rows"],
    ),
    "misfit of wrong size": (lambda: rx.Compliance(jnp.ones(3), jnp.ones(2)), ["`misfit`", "(2,)"]),
    "negative compliance": (lambda: rx.Compliance([1e-8, -1e-8]), ["`W`", "-1e-08 in row 1", "sign"]),
    "compliance that is not symmetric": (
        lambda: rx.Compliance([[2.0, 0.5], [0.4, 1.0]]),
        ["`W`", "W[0, 1] = 0.5", "W[1, 0] = 0.4", "(W + W.T) / 2"],
    ),
    "indefinite compliance": (
        lambda: rx.Compliance([[1.0, 0.0, 2e-3], [0.0, 1.0, 0.0], [2e-3, 0.0, 1e-6]]),
        ["`W`", "eigenvalue -1", "rows [0, 2]"],
    ),
    "no closure and no x0": (lambda: rx.solve(one_body(pin()), STATE, closure=None), ["`closure`", "`x0`"]),
    "no closure and fixed point": (
        lambda: rx.solve(one_body(pin()), STATE, closure=None, x0=0.0, solver=rx.FixedPoint()),
        ["`closure`", "Newton"],
    ),
    "x0 of wrong shape": (lambda: rx.solve(one_body(pin()), STATE, x0=jnp.ones(3)), ["`x0`", "(5,)"]),
    "kinds that are no kinds": (
        lambda: rx.System(lambda q, t, p: q[:1], mass=[1.0], rows="linear"),
        ["`rows`", "'force' or 'moment'", "linear"],
    ),
    "mass of another size": (lambda: rx.System(lambda q, t, p: q[:1], mass=[1.0], n=2), ["`mass`", "(2,)"]),
    "constraint of another size": (
        lambda: rx.solve(rx.System(lambda q, t, p: q, mass=[1.0, 1.0], m=3), rx.State([0.0, 0.0], [0.0, 0.0])),
        ["`constraint`", "(3,)", "(2,)"],
    ),
    "one word for friction kinds": (
        lambda: rx.Friction(lambda q, t, p: q, lambda *a: a[1], [0], "linear"),
        ["`kinds`", "['linear']"],
    ),
    "state of a massless bar": (
        lambda: rx.solve(rx.Mechanism([rx.Body("a", 1.0, 0.0)], [pin()]), STATE),
        ["not unique", "Free without mass: a.phi", "Give mass or inertia"],
    ),
    "state off the constraints": (
        lambda: rx.solve(one_body(pin()), rx.State([0.1, 0.0, 0.0], [0.0, 0.0, 0.0])),
        ["Violated rows: A.x (0.1)", "rx.assemble"],
    ),
    "velocity that tears a joint": (
        lambda: rx.solve(one_body(pin()), rx.State([0.0, 0.0, 0.0], [0.0, 0.3, 0.0])),
        ["not admissible", "A.y (0.3)", "branches"],
    ),
    "velocity of no branch at a singular position": (
        lambda: rx.solve(*registry.four_bar(0.0, (1.0, 2.0))),
        ["singular", "A.x", "D.x", "branches"],
    ),
    "contradictory constraints": (
        lambda: rx.solve(one_body(pin(), *(driven(name, law) for name, law in LAWS.items())), STATE),
        ["contradict", "fast.angle (6)", "slow.angle (2)", "Remove or correct"],
    ),
    "nearly dependent constraints": (
        lambda: rx.solve(one_body(*(pin(name=n, point_i=p, point_j=p) for n, p in NEAR.items())), STATE),
        ["rank", "singular values", "`rank=`"],
    ),
    "closure without compliance": (
        lambda: rx.solve(one_body(pin(), pin(name="B")), STATE, closure=rx.Compliance(np.zeros(4))),
        ["holds rigid", "Give compliance", "Rows in self-stress: A (x, y), B (x, y)."],
    ),
    "a unit in a mass": (lambda: rx.Body("a", "20 kg", 1.0), ["`mass`", "'20 kg'", "`units=`"]),
    "a unit in an inertia in space": (
        lambda: rx.spatial.Body("a", 1.0, ("1 kg m^2", 1.0, 1.0)),
        ["`inertia`", "'1 kg m^2'", "`units=`"],
    ),
    "words for a point": (lambda: rx.Revolute("A", "a", G, ("x", "y"), (0, 0)), ["('x', 'y')", "`units=`"]),
    "words for gravity": (lambda: rx.Mechanism([BODY], [PLATE], gravity=("0", "-g")), ["`gravity`", "'-g'"]),
    "closure in other units": (
        lambda: rx.solve(one_body(PLATE), STATE, closure=rx.Compliance([1e-5, 1e-5, 1e-9])),
        ["`W`", "1e-05 in", "P.x", "1e-09, most", "P.angle", "units=rx.units.Units(length=1000.0, mass=0.001)"],
    ),
    "closure in units of a model in mm": (
        lambda: rx.solve(IN_MM, STATE, closure=rx.Compliance([1e-8, 1e-8, 1e-6])),
        ["`W`", "mm/N", "units=rx.units.Units(length=0.001, mass=1000.0)` for data in m and N"],
    ),
    "misfit in other units": (
        lambda: rx.solve(one_body(PLATE), STATE, closure=rx.Compliance([1e-8, 1e-8, 1e-6], [0.0, 0.6, 0.0])),
        ["`misfit`", "P.y (0.6)", "units=rx.units.Units(length=1000.0, mass=0.001)"],
    ),
    "misfit in degrees": (
        lambda: rx.solve(one_body(PLATE), STATE, closure=rx.Compliance([1e-8, 1e-8, 1e-6], [0.0, 0.0, 0.5])),
        ["`misfit`", "P.angle (0.5)", "0.25 rad", "`units=rx.units.Units(angle=57.2958)` for degrees"],
    ),
    "stiffness for compliance": (
        lambda: rx.solve(one_body(PLATE), STATE, closure=rx.Compliance([1e8, 2e8, 1e6])),
        ["`W`", "stiffness", "P.y (2e+08)", "`from_stiffness`"],
    ),
    "stiffness for compliance of parts that do not fit": (
        lambda: rx.solve(one_body(PLATE), STATE, closure=rx.Compliance([1e7, 1e7, 1e6], [0.0, 1e-4, 0.0])),
        ["`W`", "stiffness", "`from_stiffness`"],
    ),
    "friction at rest": (
        lambda: rx.solve(one_body(pin(pin_radius=1.0, friction=rx.Coulomb(0.1))), STATE),
        ["at rest", "At rest: A", "`rx.band`", "`rx.sticking`", "`sense=`"],
    ),
    "iteration that does not end": (
        lambda: rx.solve(*rubbing(), solver=rx.FixedPoint(max_steps=1)),
        ["`max_steps`", "Raise"],
    ),
    "position of an unknown coordinate": (
        lambda: rx.assemble(one_body(pin()), [0.0, 0.0, 0.0], positions={"b.phi": 1.0}),
        ["`positions`", "'b.phi'", "a.phi"],
    ),
    "NaN in a guess": (lambda: rx.assemble(one_body(pin()), [0.0, np.nan, 0.0]), ["`q`", "finite", "a.y"]),
    "NaN in a guess by name": (lambda: rx.assemble(one_body(pin()), {"a.y": np.nan}), ["`q`", "finite", "a.y"]),
    "infinite position": (
        lambda: rx.assemble(one_body(pin()), {}, positions={"a.phi": np.inf}),
        ["`positions`", "finite", "a.phi"],
    ),
    "NaN in rates": (lambda: rx.assemble(one_body(pin()), {}, rates={"a.phi": np.nan}), ["`rates`", "finite", "a.phi"]),
    "time that is NaN": (lambda: rx.assemble(one_body(pin()), {}, t=np.nan), ["`t`", "finite"]),
    "an entry too few": (
        lambda: rx.assemble(one_body(pin()), [0.0, 0.0], positions={"a.phi": 0.5}),
        ["`q`", "(3,)", "(2,)", "each coordinate"],
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_names_the_culprit(name):
    """And the fix; suspect units are warned of, which pyproject.toml makes an error here."""
    build, words = BAD[name]
    with pytest.raises((rx.RedundaxError, UserWarning)) as caught:
        build()
    for word in words:
        assert word in str(caught.value)


def warning(build):
    """What is warned of if anything."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        build()
    return " ".join(str(one.message) for one in caught)


@pytest.mark.parametrize(
    ("q", "positions", "told"),
    [
        ([0.0, 0.0, 45.0], None, "a.phi = 45"),
        ({"a.phi": -22.5}, None, "a.phi = -22.5"),
        ({}, {"a.phi": 33.7}, "a.phi = 33.7"),
        ({}, {"A.angle": 90}, "A.angle = 90"),
        ([0.0, 0.0, 0.8 + 2 * np.pi], None, ""),  # of a motion
        ({"a.phi": 6.0}, {"a.phi": -6.0}, ""),
        ({"a.x": 45.0}, None, ""),
    ],
)
def test_degrees_are_asked_about(q, positions, told):
    asked = warning(lambda: rx.assemble(one_body(pin()), q, positions=positions))
    assert bool(asked) == bool(told)
    assert told in asked and ("Are they degrees?" in asked or not told)


@pytest.mark.parametrize("unit", [1.0, 1e3, 1e-3])
@pytest.mark.parametrize(
    "friction",
    [
        rx.Coulomb(0.3),
        rx.RegularisedCoulomb(0.3, 1e-5),
        rx.Stribeck(0.3, 0.2, 1e-3),
        rx.Dahl(0.3, 3000.0),
        rx.LuGre(0.3, 0.2, 1e-3, 3000.0, 20.0),
    ],
    ids=lambda friction: type(friction).__name__,
)
def test_pins_larger_than_the_mechanism_are_asked_about(friction, unit):
    """A rod of 0.4 m between its pins, in any length unit."""

    def rod(radius):
        near = pin(point_i=(-0.2 * unit, 0.0), pin_radius=radius * unit, friction=friction)
        far = rx.Revolute("B", "b", "a", (0.0, 0.0), (0.2 * unit, 0.0))
        return rx.Mechanism([BODY, rx.Body("b", 1.0, 1.0)], [near, far])

    told = warning(lambda: rod(1.0))
    assert f"{0.3 * unit:g} in 'A'" in told and f"of {0.4 * unit:g}." in told and "`pin_radius`" in told
    assert not warning(lambda: rod(0.02))
    jax.eval_shape(rod, 1.0)  # not known yet


@pytest.mark.parametrize(
    ("lists", "words"),
    [
        (([BODY], [pin(), rx.AppliedForce("a")], []), ["`joints`", "AppliedForce 'a'", "Put it among `loads`"]),
        (([BODY], [pin()], [pin(name="B")]), ["`loads`", "Revolute 'B'", "Put it among `joints`"]),
        (([BODY], [pin(), BODY], []), ["`joints`", "Body 'a'", "Put it among `bodies`"]),
        (([BODY], ["A"], []), ["`joints`", "str 'A'", "`rx.AbstractJoint`"]),
        (([rx.Body], [pin()], []), ["`bodies`", "class Body", "`rx.Body`"]),
        (([BODY], pin(), []), ["`joints`", "Revolute 'A'", "[...]"]),
    ],
)
def test_parts_in_the_wrong_list_are_told_their_own(lists, words):
    """Asked of the check itself: the tests have types checked, which refuses them sooner."""
    with pytest.raises(rx.RedundaxError) as caught:
        check_kinds(*lists, ())
    for word in words:
        assert word in str(caught.value)


def test_a_traced_compliance_is_not_checked():
    assert jax.jit(lambda W: rx.Compliance(W).W)(jnp.array([1.0, -2.0]))[1] == -2.0


def test_an_impossible_assembly_names_rows():
    with pytest.raises(rx.NoSolutionError, match=r"No position .* A\.x and B\.x cannot both be met: "):
        rx.assemble(one_body(pin(), rx.Revolute("B", "a", G, (1, 0), (3, 0))), [0.0, 0.0, 0.1])
    with pytest.raises(rx.NoSolutionError, match=r"No velocity .* A\.x and a\.x as given cannot both be met: "):
        rx.assemble(one_body(pin()), [0.0, 0.0, 0.0], rates={"a.x": 1.0})


def test_every_result_says_what_to_do():
    codes = result_codes()
    assert sorted(codes.values()) == list(range(len(rx.RESULTS)))
    for name in codes:
        assert name == "successful" or len(rx.RESULTS[getattr(rx.RESULTS, name)]) > 60


def test_methods_may_be_compiled_as_they_are():
    crank = rx.mechanisms.slider_crank()
    state = crank.state(0.3)
    np.testing.assert_allclose(jax.jit(crank.constraint)(state.q, state.t), 0.0, atol=1e-14)
    rows = jax.jit(jax.jacfwd(crank.constraint))(state.q, state.t)
    np.testing.assert_allclose(rows, jax.jit(crank.jacobian)(state.q, state.t), atol=1e-14)
