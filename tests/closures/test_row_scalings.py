"""Inverses that weight rows by their own numbers: what they are, and what they fail beside a physical closure."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from turning import rotation, turned

import redundax as rx

ANGLE = 0.7
SEAT = ([[3e-8, 1e-8], [1e-8, 2e-8]], 1e-6)
CLOSURES = {
    "minimum norm": lambda mechanism: rx.MinimumNorm(),
    "row-normalised": lambda mechanism: rx.RowNormalised(),
    "unit-consistent": lambda mechanism: rx.UnitConsistent(),
    "elastic joints": lambda mechanism: rx.ElasticJoints(
        mechanism, [rx.JointCompliance(name, *SEAT, frame="4" if name in "KL" else None) for name in "ABCDKL"]
    ),
}
# What changes the loads: the unit of length, axes turned with the mechanism, another point for the coordinates.
FAILS = {
    "minimum norm": (True, False, False),
    "row-normalised": (True, True, True),
    "unit-consistent": (False, True, True),
    "elastic joints": (False, False, False),
}


@pytest.fixture(scope="module")
def paper():
    mechanism = rx.mechanisms.wojtyra2020()
    return mechanism, mechanism.state(phi=0.6)


def loads(system, state, closure):
    return np.asarray(rx.solve(system, state, closure=closure).multipliers)


def differ(one, other):
    change = np.max(np.abs(one - other)) / np.max(np.abs(one))
    assert change < 1e-10 or change > 1e-5
    return bool(change > 1e-5)


def in_decimetres(mechanism, state, closure):
    units = rx.units.Units(length=10.0)
    closure = rx.units.closure_in_units(closure) if isinstance(closure, rx.ElasticJoints) else closure
    there = rx.solve(
        rx.units.in_units(mechanism, units), rx.units.state_in_units(state, mechanism, units), closure=closure
    )
    return np.asarray(rx.units.solution_from_units(there, mechanism, units).multipliers)


def in_turned_axes(mechanism, state, closure):
    other, there = turned(mechanism, state, ANGLE)
    R = np.kron(np.eye(4), rotation(-ANGLE))
    found = loads(other, there, closure)
    return np.concatenate([R @ found[:8], found[8:]])


def with_other_points(mechanism, state, closure):
    """Body 1 described by the point (0.3, 0.2) of its frame instead of its centre of mass."""
    arm = jnp.array([0.3, 0.2])

    def shifted(q, sign):
        c, s = jnp.cos(q[8]), jnp.sin(q[8])
        return q.at[:2].add(sign * jnp.stack([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]]))

    def mass(q, t, p):
        T = jax.jacfwd(lambda q: shifted(q, -1.0))(q)
        return T.T @ mechanism.mass(q, t) @ T

    def load(q, qd, t, p):
        T = jax.jacfwd(lambda q: shifted(q, -1.0))(q)
        return T.T @ mechanism.load(rx.State(shifted(q, -1.0), qd, t))

    system = rx.System(
        lambda q, t, p: mechanism.constraint(shifted(q, -1.0), t),
        mass,
        load,
        coordinates=mechanism.coordinates,
        rows=mechanism.rows,
        n=12,
    )
    if isinstance(closure, rx.ElasticJoints):
        W, d = closure.compliance(mechanism, state)
        closure = rx.Compliance(W, d)
    return loads(system, rx.State(shifted(state.q, 1.0), state.qd), closure)


@pytest.mark.slow
@pytest.mark.parametrize("name", CLOSURES)
def test_what_changes_with_units_axes_and_points(paper, name):
    closure = CLOSURES[name](paper[0])
    here = loads(*paper, closure)
    found = tuple(differ(here, other(*paper, closure)) for other in (in_decimetres, in_turned_axes, with_other_points))
    assert found == FAILS[name]


@pytest.mark.slow
def test_unit_consistent_scaling_has_unit_geometric_means(paper):
    """Of the entries that are not zero in each row of diag(e) Phi_q diag(f), for some f."""
    W, _ = rx.UnitConsistent().compliance(*paper)
    matrix = np.asarray(rx.factorize(*paper).jacobian) / np.sqrt(np.diag(W))[:, None]
    logs = np.log(np.where(np.abs(matrix) > 1e-12, np.abs(matrix), np.nan))
    logs -= np.nanmean(logs, axis=0)
    np.testing.assert_allclose(np.nanmean(logs, axis=1), 0.0, atol=1e-12)


def test_row_normalised_is_the_minimum_norm_of_scaled_rows(paper):
    mechanism, state = paper
    factor = rx.factorize(mechanism, state)
    size = np.linalg.norm(factor.jacobian, axis=1)
    scaled = np.linalg.pinv((np.asarray(factor.jacobian) / size[:, None]).T)
    residual = np.asarray(factor.load - factor.mass @ factor.acceleration)
    expected = scaled @ residual / size
    np.testing.assert_allclose(
        loads(mechanism, state, rx.RowNormalised()), expected, atol=1e-10 * np.max(np.abs(expected))
    )
