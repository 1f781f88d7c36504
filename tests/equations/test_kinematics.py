"""Jacobian, gamma, rank and self-stress, against hand formulas and exact geometry."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import registry
from truth import exact, paper

import redundax as rx

every_mechanism = pytest.mark.parametrize("name", registry.MECHANISMS)
every_case = pytest.mark.parametrize("name", [name for name in registry.EVERYTHING if "with friction" not in name])


def close(value, truth, tolerance):
    return np.max(np.abs(value - truth)) <= tolerance * (1 + np.max(np.abs(truth)))


@pytest.mark.parametrize("u", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("on_manifold", [True, False])
def test_appendix_b_is_what_automatic_differentiation_gives(u, on_manifold):
    p, rng = paper.Parameters(u=u), np.random.default_rng(1)
    for _ in range(10):
        q, qd = paper.configuration(p, rng.uniform(-3, 3), rng.normal())
        if not on_manifold:
            q, qd = q + rng.normal(size=12), qd + rng.normal(size=12)
        f = rx.factorize(rx.mechanisms.wojtyra2020(u=u), rx.State(q, qd))
        assert close(f.jacobian, paper.jacobian(p, q), 1e-13)
        assert close(f.gamma, paper.gamma(p, q, qd), 1e-13)
        assert close(f.mass, paper.mass(p), 1e-15)
        assert close(f.load, paper.load(p), 1e-15)


@every_mechanism
def test_jacobian_and_gamma_are_the_exact_ones(name):
    mechanism, rng = registry.MECHANISMS[name](), np.random.default_rng(2)
    system, state = registry.build(mechanism)
    for step in (0.0, 0.5, 1.0):  # on the manifold, and off it
        q = np.array(state.q) + step * rng.normal(size=mechanism.n)
        qd = np.array(state.qd) + step * rng.normal(size=mechanism.n)
        f = rx.factorize(system, rx.State(q, qd, state.t))
        there = exact.exact(tuple(q)), exact.exact(tuple(qd))
        assert close(f.jacobian, exact.floats(exact.jacobian(mechanism, there[0])), 1e-13)
        assert close(f.gamma, exact.floats(exact.gamma(mechanism, *there)), 1e-13)


@every_case
def test_gamma_is_minus_the_bend_along_the_motion(name):
    case = registry.case(name)
    system, state, step = case.system, case.state, 1e-4

    @jax.jit
    def along(s):
        return system.constraint(system.retract(state.q, s * state.qd), state.t + s)

    bend = (along(step) - 2 * along(0.0) + along(-step)) / step**2
    assert close(rx.factorize(system, state).gamma, -bend, 1e-6)


@every_case
@pytest.mark.parametrize("units", [None, rx.units.Units(length=1e3, mass=1e-3, time=10.0)], ids=["SI", "mm"])
def test_jacobian_is_the_slope_of_the_constraints(name, units):
    """By central differences along displacements of the chart; off the manifold too."""
    case = registry.case(name)
    system, q, t, rng = case.system, case.state.q, case.state.t, np.random.default_rng(3)
    if units is not None:
        there = rx.units.state_in_units(case.state, system, units)
        system, q, t = rx.units.in_units(system, units), there.q, there.t
    size = np.where(system.coordinates.angular, 1.0, 1.0 if units is None else units.length)
    q = system.retract(q, jnp.asarray(0.1 * size * rng.normal(size=len(size))))
    matrix = np.asarray(system.jacobian(q, t)) * size
    for direction in rng.normal(size=(3, len(size))):
        ends = [system.constraint(system.retract(q, jnp.asarray(step * size * direction)), t) for step in (1e-5, -1e-5)]
        slope = np.subtract(*ends) / 2e-5
        assert np.all(np.abs(matrix @ direction - slope) <= 1e-8 * (np.sum(np.abs(matrix), axis=1) + size.max()))


@pytest.mark.parametrize(
    "name",
    [name if name == "wojtyra2020" else pytest.param(name, marks=pytest.mark.slow) for name in registry.MECHANISMS],
)
def test_jacobian_joint_by_joint_has_the_derivatives_of_the_whole(name):
    """Forward and reverse, beside `jacfwd` of all constraints together."""
    mechanism, rng = registry.MECHANISMS[name](), np.random.default_rng(4)
    system, state = registry.build(mechanism)
    weight = jnp.asarray(rng.normal(size=(mechanism.m, mechanism.n)))
    direction = jnp.asarray(rng.normal(size=mechanism.n))

    def derivatives(jacobian):
        def both(q):
            forward = jax.jvp(lambda q: jacobian(q, state.t), (q,), (direction,))[1]
            return forward, jax.grad(lambda q: jnp.sum(weight * jacobian(q, state.t)))(q)

        return np.append(*jax.jit(both)(state.q))

    whole = derivatives(lambda q, t: rx.AbstractSystem.jacobian(system, q, t))
    assert close(derivatives(system.jacobian), whole, 1e-13)


@every_mechanism
def test_projector_is_that_of_the_exact_self_stress(name):
    mechanism = registry.MECHANISMS[name]()
    f = rx.factorize(*registry.build(mechanism))
    assert (f.spectrum.rank, f.redundancy) == (mechanism.rank, mechanism.k)
    basis = exact.floats(mechanism.selfstress).reshape(mechanism.m, mechanism.k)
    assert close(f.self_stress, basis @ basis.T, 1e-13)
    assert close(f.self_stress, exact.floats(mechanism.projector), 1e-13)
    unique = np.diag(f.self_stress) < 1e-12  # (13): the row of N is zero
    assert tuple(unique) == mechanism.unique


@every_case
def test_projector_is_orthogonal_and_carries_no_force(name):
    case = registry.case(name)
    f = rx.factorize(case.system, case.state)
    assert f.redundancy == case.redundancy
    assert close(f.self_stress, f.self_stress.T, 1e-13)
    assert close(f.self_stress @ f.self_stress, f.self_stress, 1e-13)
    assert close(f.jacobian.T @ f.self_stress, 0.0, 1e-13)
    assert abs(np.trace(f.self_stress) - case.redundancy) < 1e-12


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e6])
def test_rank_is_blind_to_mass_and_to_the_unit_of_length(factor):
    values = [
        np.array(rx.factorize(m, m.state(phi=0.9, rate=1.0)).spectrum.singular_values)
        for m in (
            rx.mechanisms.wojtyra2020(),
            rx.mechanisms.wojtyra2020(mass=factor),
            rx.mechanisms.wojtyra2020(u=factor),
        )
    ]
    assert close(values[1], values[0], 1e-14) and close(values[2], values[0], 1e-13)


@pytest.mark.parametrize("drift", [0.0, 1e-12, 1e-9, 1e-8])
def test_rank_survives_drift_off_the_manifold(drift):
    mechanism = rx.mechanisms.wojtyra2020()
    state = mechanism.state(phi=0.9, rate=1.0)
    off = drift * np.random.default_rng(3).normal(size=12)
    solution = rx.solve(mechanism, rx.State(state.q + off, state.qd))
    exact_one = rx.solve(mechanism, state)
    assert solution.stats.rank == 11
    assert close(solution.acceleration, exact_one.acceleration, 1e-12 + 1e3 * drift)
    assert close(solution.multipliers, exact_one.multipliers, 1e-12 + 1e3 * drift)


def test_a_declared_rank_is_taken():
    mechanism = registry.MECHANISMS["wojtyra2020"]()
    system, state = registry.build(mechanism)
    decided, declared = rx.solve(system, state), rx.solve(system, state, rank=mechanism.rank)
    assert declared.stats.rank == mechanism.rank
    assert close(declared.multipliers, decided.multipliers, 1e-14)


@pytest.mark.slow
def test_charts_of_rotations_are_equal():
    """Quaternions and rotation matrices, of other sizes of q, describe one body on two hinges."""
    first, second = (registry.door(chart) for chart in ("quaternion", "matrix"))
    assert first.state.q.size != second.state.q.size
    one, other = (rx.factorize(case.system, case.state) for case in (first, second))
    assert close(one.jacobian, other.jacobian, 1e-14) and close(one.gamma, other.gamma, 1e-13)
    assert one.redundancy == other.redundancy == 5
    solutions = [rx.solve(case.system, case.state) for case in (first, second)]
    assert close(solutions[0].acceleration, solutions[1].acceleration, 1e-13)
    assert close(solutions[0].multipliers, solutions[1].multipliers, 1e-13)


def test_state_of_the_pose_is_the_hand_made_one():
    for u in (0.1, 1.0, 10.0):
        state = rx.mechanisms.wojtyra2020(u=u).state(phi=0.7, rate=-1.3)
        q, qd = paper.configuration(paper.Parameters(u=u), 0.7, -1.3)
        assert close(state.q, q, 1e-15) and close(state.qd, qd, 1e-15)
    by_position = rx.mechanisms.wojtyra2020().state(jnp.asarray(0.7), rate=2.0)
    assert close(by_position.q, rx.mechanisms.wojtyra2020().state(phi=0.7).q, 1e-15)


def test_a_pose_moves_with_its_rate():
    """R s turns by perpendicular(R s) times the rate, whatever the derivative is taken with respect to."""
    still, s = rx.Pose(jnp.array([1.0, 2.0]), jnp.array(0.3)), jnp.array([0.5, -0.2])
    rate = rx.Pose(jnp.array([0.1, 0.0]), jnp.array(2.0))
    c, sine = np.cos(0.3), np.sin(0.3)
    arm = np.array([0.5 * c + 0.2 * sine, 0.5 * sine - 0.2 * c])
    np.testing.assert_allclose(still.point(s), np.array([1.0, 2.0]) + arm, rtol=1e-15)
    moved = jax.jvp(lambda pose: pose.point(s), (still,), (rate,))[1]
    np.testing.assert_allclose(moved, [0.1 - 2 * arm[1], 2 * arm[0]], rtol=1e-15)
    slope = jax.jacfwd(lambda pose: pose.with_axes().point(s))(still)
    np.testing.assert_allclose(slope.phi, [-arm[1], arm[0]], rtol=1e-15)
    several = rx.Pose(jnp.zeros((3, 2)), jnp.arange(3.0))
    assert several[-1].phi == 2.0
