"""The linear equations (7): Penrose's conditions, the block form, the library against the literal.

Tolerances are relative to the largest entry of each kind, or of the matrix.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import literal
import numpy as np
import pytest
import registry
from truth import exact

import redundax as rx

FRICTIONLESS = [name for name in registry.EVERYTHING if not registry.case(name).system.friction]
every_case = pytest.mark.parametrize("name", FRICTIONLESS)
stress_response = eqx.filter_jit(lambda factor, compliance: factor.stress_response(compliance))


def literally(system, state, rank, h):
    """A, A^+, b and the solution (9) with h."""
    e = literal.equations(system, state, rank)
    return e.a, e.a_pinv, np.concatenate([e.load, e.gamma]), literal.solve(e, h)


def close(value, truth, tolerance=1e-12):
    scale = np.max(np.abs(truth))
    return np.max(np.abs(value - truth)) <= tolerance * (scale if scale > 0 else 1.0)


def of(name, h=0.0):
    """The case, n, and A, A^+, b and x of its literal form."""
    case = registry.case(name)
    h = h * np.ones(len(case.system.coordinates) + len(case.system.rows))
    parts = literally(case.system, case.state, len(case.system.rows) - case.redundancy, h)
    return case, case.state.qd.size, *(np.array(part) for part in parts)


def irregular(size, scale=10.0):
    return scale * np.random.default_rng(size).normal(size=size)


def satisfies_penrose(a, inverse):
    """The four conditions (8)."""
    return (
        close(a @ inverse @ a, a)
        and close(inverse @ a @ inverse, inverse)
        and close((a @ inverse).T, a @ inverse)
        and close((inverse @ a).T, inverse @ a)
    )


@every_case
def test_literal_pseudoinverse_satisfies_penrose(name):
    _, _, a, a_pinv, *_ = of(name)
    assert satisfies_penrose(a, a_pinv)


@every_case
def test_block_form_is_the_pseudoinverse(name):
    """(10), where M is regular."""
    case, n, a, a_pinv, *_ = of(name)
    if np.linalg.det(a[:n, :n]) == 0:
        pytest.skip("(10) needs the inverse of M")
    block = np.array(literal.block_form(case.system, case.state, len(a) - n - case.redundancy))
    assert satisfies_penrose(a, block)
    assert close(block, a_pinv)


@every_case
def test_accelerations_are_unique_and_multipliers_up_to_self_stress(name):
    """(11): A^+ A = diag(I, C^+ C), and I - C^+ C = P."""
    case, n, a, a_pinv, *_ = of(name)
    factor = rx.factorize(case.system, case.state)
    expected = np.eye(len(a))
    expected[n:, n:] -= factor.self_stress
    assert close(a_pinv @ a, expected)
    assert factor.determinate


@every_case
def test_right_side_lies_in_the_range(name):
    """Appendix A: d = (I - A A^+) b = 0 (32)."""
    _, _, a, a_pinv, b, _ = of(name)
    assert np.max(np.abs(b - a @ (a_pinv @ b))) <= 1e-12 * np.max(np.abs(b))


@every_case
@pytest.mark.parametrize("h", ["0", "50", "irregular"])
def test_solve_is_the_literal_solution(name, h):
    """(9) with h; the library never forms A."""
    size = len(registry.case(name).system.coordinates) + len(registry.case(name).system.rows)
    h = irregular(size) if h == "irregular" else float(h)
    case, n, *_, x = of(name, h)
    solution = registry.solve(case.system, case.state, h)
    kinds = registry.kinds_of(case.system.coordinates)
    assert registry.agree(solution.acceleration, x[:n], kinds, 1e-11)
    assert registry.agree(solution.multipliers, x[n:], registry.kinds_of(case.system.rows), 1e-11)


@every_case
def test_solution_satisfies_the_equations(name):
    """(7), term by term, and the acceleration in closed form or of exact geometry."""
    case = registry.case(name)
    solution = registry.solve(case.system, case.state)
    f = rx.factorize(case.system, case.state)
    terms = f.mass @ solution.acceleration, f.jacobian.T @ solution.multipliers, f.load
    size = max(np.max(np.abs(term)) for term in terms)
    assert np.max(np.abs(terms[0] + terms[1] - terms[2])) <= 1e-13 * size
    size = np.max(np.abs(f.jacobian)) * np.max(np.abs(solution.acceleration))
    assert np.max(np.abs(f.jacobian @ solution.acceleration - f.gamma)) <= 1e-13 * size
    kinds = registry.kinds_of(case.system.coordinates)
    assert registry.agree(solution.acceleration, case.acceleration, kinds, 1e-13)
    assert solution.stats.redundancy == case.redundancy
    assert solution.stats.freedom - solution.stats.redundancy == f.load.size - f.gamma.size


@every_case
def test_minimum_norm_is_orthogonal_to_the_self_stress(name):
    case = registry.case(name)
    f = rx.factorize(case.system, case.state)
    n, lam = f.load.size, registry.solve(case.system, case.state).multipliers
    assert np.max(np.abs(f.self_stress @ lam)) <= 1e-13 * np.max(np.abs(lam))
    h = irregular(n + lam.size)
    with_h = registry.solve(case.system, case.state, h).multipliers
    assert close(with_h - lam, f.self_stress @ h[n:], 1e-11)


@pytest.mark.parametrize("name", ["wojtyra2020", "parallelogram", "slider_crank"])
def test_a_doubled_joint_changes_no_acceleration(name):
    """Without friction. The two copies share their load evenly at minimum norm."""
    mechanism = registry.MECHANISMS[name]()
    twin = dataclasses.replace(mechanism.revolutes[0], name="twin")
    doubled = dataclasses.replace(mechanism, revolutes=(*mechanism.revolutes, twin), rank=mechanism.rank)
    single, twice = (registry.solve(*registry.build(x)) for x in (mechanism, doubled))
    assert twice.stats.rank == single.stats.rank
    assert twice.stats.redundancy == single.stats.redundancy + 2
    assert close(twice.acceleration, single.acceleration, 1e-12)
    first = [doubled.revolutes.index(joint) for joint in (mechanism.revolutes[0], twin)]
    copies = np.array(twice.multipliers)[[[2 * k, 2 * k + 1] for k in first]]
    assert close(copies[0], copies[1], 1e-12)  # of equal norm, they share the load


@pytest.mark.parametrize("name", registry.MECHANISMS)
def test_order_of_bodies_and_joints_does_not_matter(name):
    """Only the order of the rows and coordinates changes, and their names tell which is which."""
    mechanism, state = registry.build(registry.MECHANISMS[name]())
    reference = by_name(mechanism, registry.solve(mechanism, state))
    other, there = registry.build(reordered(registry.MECHANISMS[name]()))
    found = by_name(other, registry.solve(other, there))
    assert found.keys() == reference.keys()
    size = max(abs(value) for value in reference.values())
    assert all(abs(found[key] - reference[key]) <= 1e-12 * size for key in reference)


def by_name(mechanism, solution):
    names = (*mechanism.coordinates.labels, *mechanism.rows.labels)
    values = np.concatenate([solution.acceleration, solution.multipliers])
    return dict(zip(names, values, strict=True))


def reordered(mechanism: exact.Mechanism) -> exact.Mechanism:
    """The joints of each kind in reverse order."""
    return dataclasses.replace(
        mechanism,
        revolutes=mechanism.revolutes[::-1],
        translationals=mechanism.translationals[::-1],
    )


def test_projector_form_of_the_closure_is_the_basis_form():
    """N (N^T W N)^-1 N^T with N from 50 digits, for W spread over ten orders."""
    rng = np.random.default_rng(4)
    for name in registry.MECHANISMS:
        mechanism = registry.MECHANISMS[name]()
        basis = exact.floats(mechanism.selfstress).reshape(mechanism.m, mechanism.k)
        root = rng.normal(size=(mechanism.m, mechanism.m))
        scale = 10.0 ** rng.uniform(-5, 5, mechanism.m)
        factor = rx.factorize(*registry.build(mechanism))
        for compliance in (np.diag(scale), root @ root.T, np.eye(mechanism.m)):
            expected = basis @ np.linalg.solve(basis.T @ compliance @ basis, basis.T)
            response, definite = stress_response(factor, jnp.asarray(compliance))
            assert definite and close(response, expected, 1e-12)


def test_results_have_readable_names():
    mechanism, _ = registry.build(registry.MECHANISMS["wojtyra2020"](), registry.coulomb)
    assert mechanism.rows.names[:3] == ("A.x", "A.y", "B.x")
    assert mechanism.rows.names[-4:] == ("K.perpendicular", "L.perpendicular", "K.angle", "L.angle")
    assert mechanism.rows.kinds == registry.MECHANISMS["wojtyra2020"]().kinds
    assert [group.slips.names for group in mechanism.friction] == [("A", "B", "C", "D")]


def test_a_factor_of_another_state_is_refused():
    mechanism = rx.mechanisms.wojtyra2020()
    state = mechanism.state(phi=0.7, rate=1.3)
    factor = rx.factorize(mechanism, state)
    same = rx.State(np.array(state.q), np.array(state.qd), memory=(1.0,))
    expected = rx.solve(mechanism, state).multipliers
    np.testing.assert_array_equal(rx.solve(mechanism, same, factor=factor).multipliers, expected)
    others = [mechanism.state(phi=0.7, rate=1.4), mechanism.state(phi=0.8, rate=1.3), rx.State(state.q, state.qd, 1.0)]
    for other in others:
        for call in (rx.solve, rx.analyze, rx.solution_family):
            with pytest.raises(rx.RedundaxError, match=r"Argument `factor` must be .* comes from another"):
                call(mechanism, other, factor=factor)


def test_an_error_names_the_rows_of_the_declared_rank():
    """Rows that nearly agree are independent by their spectrum; a declared rank makes them redundant."""
    system = rx.System(
        lambda q, t, p: jnp.stack([q[0] - q[1], q[0] - q[1] + 1e-4 * q[2]]),
        np.ones(3),
        rows=rx.Axis(("a", "b"), ("force",) * 2),
    )
    state = rx.State(np.zeros(3), np.zeros(3))
    assert rx.factorize(system, state).redundancy == 0
    with pytest.raises(rx.NoSolutionError, match=r"Rows in self-stress: a, b\."):
        rx.solve(system, state, closure=rx.Compliance(np.zeros(2)), rank=1)
