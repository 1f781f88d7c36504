"""Section 3: what dependent rows and the minimum norm do under a change of units, against 50 digits."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import redundax as rx

FORCE, MOMENT = "force", "moment"
INDEPENDENT = (FORCE, FORCE, FORCE, MOMENT, MOMENT)
COORDINATES = ("linear",) * 4 + ("angular",) * 3
DECIMETRES, GRADIANS = rx.units.Units(length=10.0), rx.units.Units(angle=200 / np.pi)


def factors(kinds, units):
    """Exact factors of lengths and angles."""
    own = {FORCE: units.length, "linear": units.length, MOMENT: units.angle, "angular": units.angle}
    return mp.diag([mp.mpf(float(own[kind])) for kind in kinds])


@mp.workdps(50)
def direct(eta, basic, dependent, units):
    """eta', lam0', p' and the multipliers from the scaled Jacobian (16) and its pseudoinverse, in 50 digits."""
    rng = np.random.default_rng(4)
    rows = mp.matrix(rng.normal(size=(5, 7)).tolist())
    eta, basic = mp.matrix(eta.tolist()), mp.matrix(basic.tolist())
    whole = mp.matrix(5 + eta.rows, 7)
    whole[:5, :] = rows
    whole[5:, :] = eta * rows
    s, columns = factors(INDEPENDENT + dependent, units), factors(COORDINATES, units)
    energy = mp.mpf(float(units.length)) ** 2
    there = s * whole * columns**-1
    first, rest = there[:5, :], there[5:, :]
    eta_there = rest * first.T * (first * first.T) ** -1
    force = energy * columns**-1 * rows.T * basic  # the generalised force that the multipliers make
    basic_there = (first * first.T) ** -1 * first * force
    middle = mp.eye(5) + eta_there.T * eta_there  # least norm of [y; eta y'...]: lam = [I; eta] (I + eta^T eta)^-1 lam0
    least = mp.lu_solve(middle, basic_there)
    return eta_there, basic_there, least, eta_there * least


def floats(matrix):
    return np.array(matrix.tolist(), dtype=float)


@pytest.mark.parametrize("units", [rx.units.Units(), DECIMETRES, GRADIANS, rx.units.Units(length=1e-3)])
@pytest.mark.parametrize("dependent", [(FORCE,), (MOMENT,), (FORCE, MOMENT)])
def test_against_the_scaled_jacobian(units, dependent):
    rng = np.random.default_rng(5)
    eta, basic = rng.normal(size=(len(dependent), 5)), rng.normal(size=5)
    eta_there, basic_there, least, p = direct(eta, basic, dependent, units)
    found = rx.units.dependence_in_units(eta, dependent, INDEPENDENT, units)
    np.testing.assert_allclose(found, floats(eta_there), rtol=1e-13)
    here = rx.units.minimum_norm_parameters_in_units(eta, basic, dependent, INDEPENDENT, units)
    size = np.max(np.abs(floats(p)))
    np.testing.assert_allclose(here, floats(p)[:, 0], rtol=1e-12, atol=1e-14 * size)
    lam, parameters = rx.units.parametrised_multipliers(found, floats(basic_there)[:, 0], here)
    np.testing.assert_allclose(lam, floats(least)[:, 0], rtol=1e-11, atol=1e-13 * np.max(np.abs(lam)))
    assert parameters is here


@pytest.mark.parametrize(("kind", "other", "power"), [(FORCE, slice(3, 5), 1), (MOMENT, slice(0, 3), 2)])
def test_rows_that_depend_on_their_own_type_alone(kind, other, power):
    """eta_Ups = 0 gives p' = u p, eta_Phi = 0 of a moment-type row p' = u^2 p; not so otherwise."""
    rng = np.random.default_rng(6)
    eta, basic = rng.normal(size=(1, 5)), rng.normal(size=5)
    for mixes in (True, False):
        eta[:, other] *= mixes
        p = rx.units.minimum_norm_parameters(eta, basic)
        there = rx.units.minimum_norm_parameters_in_units(eta, basic, (kind,), INDEPENDENT, DECIMETRES)
        assert np.allclose(there, 10**power * p, rtol=1e-13) != mixes


def test_formulas_22_and_23_as_printed():
    u, rng = 10.0, np.random.default_rng(7)
    eta, basic = rng.normal(size=5), rng.normal(size=5)
    a, b = slice(0, 3), slice(3, 5)
    force = u * (basic[a] @ eta[a] + u**2 * basic[b] @ eta[b]) / (1 + eta[a] @ eta[a] + u**2 * eta[b] @ eta[b])
    if_moment = u**2 * (u**-2 * basic[a] @ eta[a] + basic[b] @ eta[b])
    if_moment /= 1 + u**-2 * eta[a] @ eta[a] + eta[b] @ eta[b]
    for kind, expected in ((FORCE, force), (MOMENT, if_moment)):
        found = rx.units.minimum_norm_parameters_in_units(eta[None], basic, (kind,), INDEPENDENT, DECIMETRES)
        np.testing.assert_allclose(found, [expected], rtol=1e-13)


def test_shapes_and_kinds_that_do_not_fit_are_refused():
    with pytest.raises(rx.RedundaxError, match="`eta` must have a row for each of 1"):
        rx.units.dependence_in_units(np.ones((2, 5)), (FORCE,), INDEPENDENT, DECIMETRES)
    with pytest.raises(rx.RedundaxError, match="`dependent` must hold"):
        rx.units.dependence_in_units(np.ones((1, 5)), ("linear",), INDEPENDENT, DECIMETRES)


# The certificate ----------------------------------------------------------------------------


@functools.cache
def loaded(which):
    """Mechanisms whose loads have no symmetry, and a state."""
    if which == "paper":
        mechanism = rx.mechanisms.wojtyra2020()
        return mechanism, mechanism.state(phi=0.6, rate=2.0)
    offset = 0.3 if which == "offset guides" else 0.0
    mechanism = rx.mechanisms.carriage(offset=offset, force=(10.0, 3.0), at=(0.1, 0.2))
    return mechanism, mechanism.state(0.1, rate=1.0)


def picks(mechanism, state):
    """Multipliers of the minimum norm in metres, and in units 1/1000 and 1000 times as long, in SI."""
    closures = [rx.MinimumNorm(units=rx.units.Units(length=u)) for u in (1.0, 1e3, 1e-3)]
    return np.stack([rx.solve(mechanism, state, closure=closure).multipliers for closure in closures])


@pytest.mark.parametrize("which", [pytest.param("paper", marks=pytest.mark.slow), "guides", "offset guides"])
def test_what_the_certificate_says_is_so(which):
    mechanism, state = loaded(which)
    certificate = rx.units.unit_certificate(mechanism, state)
    values = picks(mechanism, state)
    changes = np.ptp(values, axis=0) / np.max(np.abs(values))
    for verdict, change in zip(certificate.multipliers, changes, strict=True):
        assert verdict.reason
        assert change < 1e-11 if verdict.invariant else change > 1e-4, verdict
    assert all(verdict.invariant for verdict in certificate.multipliers) == (which == "guides")
    assert all(verdict.invariant for verdict in certificate.accelerations)
    assert "CHANGE" not in str(certificate) or which != "guides"


@pytest.mark.slow
def test_with_friction_the_motion_depends_on_the_unit():
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    state = mechanism.state(phi=0.6, rate=2.0)
    certificate = rx.units.unit_certificate(mechanism, state)
    values = np.stack([
        rx.solve(mechanism, state, closure=rx.MinimumNorm(units=unit)).acceleration
        for unit in (rx.units.Units(), rx.units.Units(length=1e3))
    ])  # fmt: skip
    changes = np.ptp(values, axis=0) / np.max(np.abs(values))
    assert {v.name for v in certificate.accelerations if v.invariant} == {"4.x''", "2.phi''", "4.phi''"}
    for verdict, change in zip(certificate.accelerations, changes, strict=True):
        assert change < 1e-12 if verdict.invariant else change > 1e-6, verdict
    assert "friction depends on" in certificate.to_dict()["accelerations"][0]["reason"]


@pytest.mark.slow
def test_under_a_physical_closure_motion_and_loads_are_the_same_in_all_units():
    """wojtyra2020 with friction, built anew with lengths in other units, from u = 0.001 to 1000."""
    joints = [rx.JointCompliance(name, 1e-8, misfit=(1e-5, 2e-5, 0.0), frame="1") for name in "AB"]
    joints += [rx.JointCompliance(name, 3e-8) for name in "CD"]
    joints += [rx.JointCompliance(name, 2e-8, 1e-6, coupling=(3e-8, 5e-8), frame="4") for name in "KL"]

    def solution(u):
        mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02, u=u)
        closure = rx.ElasticJoints(mechanism, joints, rx.units.Units(length=1 / u))
        found = rx.solve(mechanism, mechanism.state(phi=jnp.pi / 4, rate=1.0), closure=closure, solver=rx.Newton())
        units = rx.units.Units(length=u)
        acceleration = found.acceleration / units.of(mechanism.coordinates)
        return acceleration, found.multipliers / units.of_force(mechanism.rows)

    acceleration, multipliers = jax.jit(jax.vmap(solution))(jnp.asarray(10.0 ** np.arange(-3.0, 3.5, 0.5)))
    parts = np.split(acceleration, [8], axis=1) + np.split(multipliers, [8, 10], axis=1)
    for part in parts:
        assert np.max(np.ptp(part, axis=0)) < 1e-10 * np.max(np.abs(part))
