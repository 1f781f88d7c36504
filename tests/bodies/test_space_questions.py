"""What is asked of planar mechanisms, asked of a door on three hinges: against closed forms and differences."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

rs, G = rx.spatial, "ground"
C, GAP, MASS, SPRING = 1e-8, 1e-5, 20.0, 3.0
NAMES = ("bottom", "mid", "top")
WEIGHT = MASS * 9.81 / 3
ABOUT = 1.6 + MASS * 0.25  # moment of inertia about the hinges


def door(mass=MASS, spring=SPRING):
    body = rs.Body("door", mass, (6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0))
    hinges = [rs.Revolute(name, body, G, point=(0, 0, z)) for name, z in zip(NAMES, (0.2, 1.0, 1.8), strict=True)]
    closer = rs.TorsionSpring(body, G, axis=(0, 0, 1), stiffness=spring, free_angle=-0.3)
    return rx.Mechanism([body], hinges, loads=[closer], gravity=(0.0, 0.0, -9.81))


def seats(mechanism, gap=0.0, turn=0.0):
    """Hinges that give way alike, the middle one set too high and askew."""
    mid = rs.JointCompliance("mid", C, 100 * C, misfit=jnp.stack([0.0, 0.0, gap, turn, 0.0, 0.0]))
    return rx.ElasticJoints(mechanism, [*(rs.JointCompliance(name, C, 100 * C) for name in ("bottom", "top")), mid])


@pytest.fixture(scope="module")
def hung():
    mechanism = door()
    return mechanism, rx.assemble(mechanism, rates={"top.angle": 1.5})


@pytest.mark.slow
def test_a_band_over_misfits_is_that_of_three_springs(hung):
    mechanism, state = hung
    box = rx.MisfitBox(seats(mechanism), {"mid.axial": (-GAP, GAP)})
    found = rx.band(mechanism, state, ["top.axial", "mid.axial"], box)
    reach = np.array([1 / 3, 2 / 3]) * GAP / C
    np.testing.assert_allclose([found.lower, found.upper], [-WEIGHT - reach, -WEIGHT + reach], rtol=1e-8)


@pytest.mark.slow
def test_spread_of_loads_by_tolerances_is_the_linear_one(hung):
    """A turn of the middle hinge alone makes bending moments that a gap does not, and the other way round."""
    mechanism, state = hung
    parameters = {"gap": rx.Normal(0.0, GAP), "turn": rx.Normal(0.0, 1e-4)}
    data = rx.tolerance_study(
        lambda gap, turn: rx.solve(mechanism, state, closure=seats(mechanism, gap, turn)), parameters, samples=64
    )
    axial, bend = data.sel(output="mid.axial"), data.sel(output="mid.bend_1")
    np.testing.assert_allclose(axial["gradient"], [2 / (3 * C), 0.0], atol=1e-6 / C)
    np.testing.assert_allclose(axial["share"], [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(bend["share"], [0.0, 1.0], atol=1e-9)


def test_the_unit_certificate_tells_what_other_units_change(hung):
    """Loads that it calls the same are, under the minimum norm, and some of the others change."""
    mechanism, state = hung
    pushed = eqx.tree_at(lambda m: m.gravity, mechanism, jnp.array([1.0, 2.0, -9.81]))
    units = rx.units.Units(length=1000.0)
    there = rx.units.in_units(pushed, units), rx.units.state_in_units(state, pushed, units)
    one, two = rx.solve(pushed, state), rx.units.solution_from_units(rx.solve(*there), pushed, units)
    change = np.abs(np.array(two.multipliers - one.multipliers))
    invariant = np.array([verdict.invariant for verdict in rx.units.unit_certificate(pushed, state).multipliers])
    assert 0 < invariant.sum() < invariant.size
    assert np.max(change[invariant]) < 1e-9 * WEIGHT
    assert np.max(change[~invariant]) > 1e-2 * WEIGHT
    np.testing.assert_allclose(two.acceleration, one.acceleration, atol=1e-10)


@pytest.mark.slow
def test_derivatives_and_batches_over_mechanisms(hung):
    """Angular acceleration -0.3 k / J and axial load -m g / 3, J = 1.6 + m / 4: values and slopes by hand."""
    _, state = hung

    def asked(mass):
        mechanism = door(mass)
        solution = rx.solve(mechanism, state, closure=seats(mechanism))
        return jnp.stack([solution["top.angle''"], solution["mid.axial"]])

    masses = jnp.array([5.0, MASS])
    values, slopes = jax.vmap(lambda m: jax.jvp(asked, (m,), (jnp.ones(()),)))(masses)
    about = 1.6 + masses / 4
    np.testing.assert_allclose(values, np.stack([-0.3 * SPRING / about, -masses * 9.81 / 3], axis=1), rtol=1e-10)
    expected = np.stack([0.3 * SPRING / 4 / about**2, np.full(2, -9.81 / 3)], axis=1)
    np.testing.assert_allclose(slopes, expected, rtol=1e-9)
    np.testing.assert_allclose(jax.jacrev(asked)(masses[1]), expected[1], rtol=1e-9)


@pytest.mark.slow
def test_a_door_in_single_precision(hung, float32):
    mechanism = door()
    state = rx.assemble(mechanism, rates={"top.angle": 1.5})
    solution = rx.solve(mechanism, state, closure=seats(mechanism))
    assert solution.multipliers.dtype == jnp.float32
    np.testing.assert_allclose(solution["mid.axial"], -WEIGHT, rtol=1e-4)
    np.testing.assert_allclose(solution["top.angle''"], -0.3 * SPRING / ABOUT, rtol=1e-4)


@pytest.mark.slow
def test_a_motion_keeps_its_rank_and_its_loads_settle(hung):
    """At every state of a swing; and where the hinges give way the loads vibrate about their values."""
    mechanism, state = hung
    motion = rx.simulate(mechanism, state, 0.4, ts=jnp.linspace(0.0, 0.4, 3))
    report = rx.analyze_along(mechanism, motion.states)
    assert [each.rank for each in report.reports] == [5, 5, 5]
    closure = seats(mechanism)
    found = rx.stability(mechanism, state, rx.solve(mechanism, state, closure=closure), closure)
    assert found.verdict is rx.Settling.STABLE


@pytest.mark.slow
def test_a_pivot_moves_with_the_assembly():
    """Acceleration of a four-bar by the place of a pivot, the loop closed anew: forward, reverse and by differences."""
    inertia, at = (1e-3, 0.05, 0.05), rs.Placement

    def asked(shift):
        crank, coupler, rocker = (
            rs.Body(name, 1.0, inertia, centre=centre)
            for name, centre in (("crank", (0.1, 0.1, 0)), ("coupler", (0.5, 0.4, 0)), ("rocker", (0.85, 0.2, 0)))
        )
        joints = [
            rs.Revolute("A", crank, G, point=(0, 0, 0)),
            rs.Revolute("B", coupler, crank, point=(0.2, 0.3, 0)),
            rs.Revolute("C", coupler, rocker, point=(0.9, 0.45, 0)),
            rs.Revolute("D", "rocker", G, on_i=at((0.8, 0, 0)), on_j=at(jnp.stack([0.8 + shift, 0.0, 0.0]))),
        ]
        mechanism = rx.Mechanism([crank, coupler, rocker], joints, gravity=(0, -9.81, 0))
        state = rx.assemble(mechanism, mechanism.reference, positions={"A.angle": 0.2}, rates={"A.angle": 1.0})
        return rx.solve(mechanism, state)["D.angle''"]

    ask = jax.jit(asked)
    slope = (8 * (ask(1e-3) - ask(-1e-3)) - (ask(2e-3) - ask(-2e-3))) / 12e-3
    for derivative in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(derivative(asked)(0.0), slope, rtol=1e-7)


@pytest.mark.slow
def test_the_stiffness_of_a_spring_is_found_from_a_swing(hung):
    diffrax, (_, state) = pytest.importorskip("diffrax"), hung

    def predict(spring):
        mechanism = door(spring=spring)
        ts = jnp.linspace(0.0, 0.5, 6)
        return rx.simulate(mechanism, state, 0.5, ts=ts, adjoint=diffrax.ForwardMode()).q[:, 1]

    found = rx.identify(predict, predict(30.0), {"spring": rx.Uniform(10.0, 60.0)}, noise=1e-4, starts=2)
    np.testing.assert_allclose(found.estimate["spring"], 30.0, rtol=1e-4)


@pytest.mark.slow
def test_bands_along_a_door_are_told_by_its_angle():
    """Bodies in space have velocities that are no rates of coordinates; joints have coordinates."""
    door = rx.mechanisms.door()
    places = (0.1, 0.4, 0.8)
    states = [
        rx.assemble(door, positions={"hinge 1.angle": at}, rates={"hinge 1.angle": rate})
        for at, rate in zip(places, (0.5, 0.5, -0.5), strict=True)
    ]
    path = rx.band_along(door, states, "hinge 1 force z on door", rx.MinimumNorm())
    assert [said for said, _ in path.runs(path.leading)] == ["hinge 1.angle increases", "hinge 1.angle decreases"]
    figure = rx.plot.band_along(path, against="hinge 1.angle")
    assert figure.axes[-1].get_xlabel() == "hinge 1.angle, rad"
    np.testing.assert_allclose(path.q[:, path.leading], places, rtol=1e-12)
    with pytest.raises(rx.RedundaxError, match=r"Name one of a joint"):
        rx.plot.band_along(path, against="door.phi_z")
