"""Closures: h, weights and physical compliance are one idea, and its laws hold."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import registry
from truth import exact

import redundax as rx

MECHANISMS = ("wojtyra2020", "parallelogram", "slider_crank")
beyond_physics = pytest.mark.filterwarnings("ignore:Argument `misfit` looks")
every_mechanism = pytest.mark.parametrize("name", MECHANISMS)
rubbing_or_not = pytest.mark.parametrize("friction", [None, registry.coulomb], ids=["smooth", "rubs"])


def data(name, friction=None):
    """Mechanism, state, and an irregular compliance and misfit, of a few mm/N and mm."""
    system, state = registry.build(registry.MECHANISMS[name](), friction)
    m, rng = len(system.rows), np.random.default_rng(6)
    root = rng.normal(size=(m, m))
    return system, state, 1e-3 * (root @ root.T + np.eye(m)), 1e-3 * rng.normal(size=m)


def same(solution, reference, system, tolerance=1e-11):
    parts = reference.acceleration, reference.multipliers, reference.friction
    errors = registry.errors_of(solution, parts, system)
    return all(error <= tolerance for error in errors.values())


@every_mechanism
@rubbing_or_not
def test_joints_deflect_compatibly(name, friction):
    """P (W lam - d) = 0, where stiff joints satisfy W lam = Phi_q dq + d."""
    system, state, compliance, misfit = data(name, friction)
    solution = registry.solve(system, state, closure=rx.Compliance(compliance, misfit))
    projector = exact.floats(registry.MECHANISMS[name]().projector)
    strain = compliance @ np.array(solution.multipliers) - misfit
    assert np.max(np.abs(projector @ strain)) <= 1e-12 * np.max(np.abs(strain))


@beyond_physics
@every_mechanism
@rubbing_or_not
def test_h_is_a_misfit_under_unit_compliance(name, friction):
    system, state, _, misfit = data(name, friction)
    n, m = len(system.coordinates), len(system.rows)
    h = np.concatenate([np.full(n, np.pi), 2e4 * misfit])
    reference = registry.solve(system, state, h)
    solution = registry.solve(system, state, closure=rx.Compliance(np.eye(m), h[n:]))
    assert same(solution, reference, system, 1e-13)


@rubbing_or_not
def test_short_forms_of_a_closure(friction):
    """A vector is a diagonal; no misfit is zero; no closure and no h are the minimum norm."""
    system, state, _, misfit = data("wojtyra2020", friction)
    diagonal = 1e-3 * np.arange(1.0, 13.0)
    full = registry.solve(system, state, closure=rx.Compliance(np.diag(diagonal), misfit))
    assert same(registry.solve(system, state, closure=rx.Compliance(diagonal, misfit)), full, system, 1e-13)
    reference = registry.solve(system, state)
    for options in ({"closure": rx.Compliance(np.ones(12))}, {"closure": rx.MinimumNorm()}, {}):
        assert same(rx.solve(system, state, **options), reference, system, 1e-13)


@every_mechanism
@rubbing_or_not
def test_the_misfit_of_a_displacement_is_none(name, friction):
    """d and d + Phi_q v strain the same: the parts only move."""
    system, state, compliance, misfit = data(name, friction)
    jac = exact.floats(registry.MECHANISMS[name]().jacobian)
    moved = misfit + 1e-3 * jac @ np.random.default_rng(7).normal(size=len(system.coordinates))
    reference = registry.solve(system, state, closure=rx.Compliance(compliance, misfit))
    assert same(registry.solve(system, state, closure=rx.Compliance(compliance, moved)), reference, system)


@beyond_physics
@every_mechanism
@rubbing_or_not
@pytest.mark.parametrize("factor", [1e-6, 1e9])
def test_only_ratios_of_compliance_and_misfit_matter(name, friction, factor):
    system, state, compliance, misfit = data(name, friction)
    reference = registry.solve(system, state, closure=rx.Compliance(compliance, misfit))
    scaled = rx.Compliance(factor * compliance, factor * misfit)
    assert same(registry.solve(system, state, closure=scaled), reference, system, 1e-12)


@every_mechanism
def test_without_friction_the_closure_moves_nothing(name):
    system, state, compliance, misfit = data(name)
    reference = registry.solve(system, state)
    solution = registry.solve(system, state, closure=rx.Compliance(compliance, 30 * misfit))
    assert registry.agree(solution.acceleration, reference.acceleration, system.coordinates.kinds, 1e-12)
    unique = np.array(registry.MECHANISMS[name]().unique)
    change = np.abs(np.array(solution.multipliers - reference.multipliers))
    assert np.max(change[unique], initial=0.0) <= 1e-11 < np.min(change[~unique])


def test_with_friction_it_does():
    system, state, compliance, misfit = data("parallelogram", registry.coulomb)
    values = [
        registry.solve(system, state, closure=rx.Compliance(compliance, factor * misfit)).acceleration
        for factor in (0.0, 30.0)
    ]
    assert np.max(np.abs(values[0] - values[1])) > 1e-3


@pytest.mark.parametrize("row", [0, 5, 10])
def test_compliance_of_one_row_alone_prescribes_its_multiplier(row):
    """W need be positive on the self-stress only; W lam = d there."""
    system, state, *_ = data("wojtyra2020", registry.coulomb)
    compliance, misfit = np.zeros((12, 12)), np.zeros(12)
    compliance[row, row], misfit[row] = 1e-4, 1e-4 * 12.5
    solution = registry.solve(system, state, closure=rx.Compliance(compliance, misfit))
    assert abs(solution.multipliers[row] - 12.5) < 1e-10


@pytest.mark.parametrize("name", ["wojtyra2020", "parallelogram"])
@pytest.mark.parametrize("joint", [0, 1])
def test_a_joint_listed_twice_with_twice_the_compliance_changes_nothing(name, joint):
    """Each copy has the same misfit and the same mu_rho: two springs side by side.

    The copies share the load evenly, so |R| / 2 + |R| / 2 rubs as |R| does.
    """
    mechanism = registry.MECHANISMS[name]()
    system, state = registry.build(mechanism, registry.coulomb)
    rng, count = np.random.default_rng(8), len(mechanism.revolutes)
    compliance, misfit = 1e-3 * rng.uniform(0.1, 3.0, mechanism.m), 1e-3 * rng.normal(size=mechanism.m)
    reference = registry.solve(system, state, closure=rx.Compliance(np.diag(compliance), misfit))

    twin = dataclasses.replace(mechanism.revolutes[joint], name="twin")
    doubled, _ = registry.build(
        dataclasses.replace(mechanism, revolutes=(*mechanism.revolutes, twin)), registry.coulomb
    )
    pair = slice(2 * joint, 2 * joint + 2)
    compliance[pair] *= 2
    twice = registry.solve(
        doubled,
        state,
        closure=rx.Compliance(
            np.diag(np.insert(compliance, 2 * count, compliance[pair])),
            np.insert(misfit, 2 * count, misfit[pair]),
        ),
    )
    assert twice.stats.redundancy == mechanism.k + 2
    kinds = system.coordinates.kinds
    assert registry.agree(twice.acceleration, reference.acceleration, kinds, 1e-11)
    together = np.array(twice.multipliers)
    together[pair] += together[2 * count : 2 * count + 2]
    together = np.delete(together, [2 * count, 2 * count + 1])
    assert registry.agree(together, reference.multipliers, system.rows.kinds, 1e-11)


def test_a_joint_listed_twice_may_change_motion_under_minimum_norm():
    """The flaw of that pick, which the physical closure cures."""
    mechanism = registry.MECHANISMS["parallelogram"]()
    twin = dataclasses.replace(mechanism.revolutes[0], name="twin")
    doubled = dataclasses.replace(mechanism, revolutes=(*mechanism.revolutes, twin))
    single, twice = (registry.solve(*registry.build(x, registry.coulomb)).acceleration for x in (mechanism, doubled))
    assert np.max(np.abs(single - twice)) > 1e-3


STIFF, SKEW = np.repeat([1e-8, 1e-6], (10, 2)), np.repeat([1e-4, 2e-2], (10, 2))  # SI units
MILLIMETRES = rx.units.Units(length=1000.0, mass=0.001)
DEGREES = rx.units.Units(angle=np.degrees(1.0))


def in_other(units, system):
    own = np.asarray(units.of(system.rows))
    return STIFF * own**2 / units.energy, SKEW * own


@pytest.mark.parametrize("units", [MILLIMETRES, DEGREES])
@rubbing_or_not
def test_data_in_other_units_are_the_same_closure(units, friction):
    system, state, *_ = data("wojtyra2020", friction)
    reference = rx.solve(system, state, closure=rx.Compliance(STIFF, SKEW))
    closure = rx.Compliance(*in_other(units, system), units=units)
    assert same(rx.solve(system, state, closure=closure), reference, system, 1e-13)


class Own(rx.AbstractClosure):
    misfit: object

    def compliance(self, system, state):
        return jnp.eye(len(system.rows)), self.misfit


def test_own_closures_give_a_number_or_a_vector():
    system, state, *_ = data("wojtyra2020", registry.coulomb)
    reference = rx.solve(system, state, closure=rx.MinimumNorm(3.0))
    for misfit in (3.0, jnp.full(12, 3.0)):
        assert same(rx.solve(system, state, closure=Own(misfit)), reference, system)
    with pytest.raises(rx.RedundaxError, match=r"Argument `closure` must give .* misfit .* shape \(12,\), but gives"):
        rx.solve(system, state, closure=Own(jnp.zeros(13)))


def test_suspect_units_are_no_matter_where_a_solution_alone_is_traced():
    """Its friction, say: mechanism and closure are known."""
    guides = [rx.Revolute(name, "a", "ground", (x, 0), (x, 0)) for name, x in (("B", -0.5), ("C", 0.5))]
    mechanism = rx.Mechanism([rx.Body("a", 1.0, 1.0)], guides, gravity=(0.0, -9.81))
    state, joints = rx.State(jnp.zeros(3), jnp.zeros(3)), rx.Compliance(jnp.full(4, 1e-8))
    found = jax.vmap(lambda x0: rx.solve(mechanism, state, closure=joints, x0=x0).multipliers)(jnp.zeros((2, 7)))
    np.testing.assert_allclose(found[:, jnp.array([1, 3])], np.full((2, 2), -9.81 / 2), rtol=1e-9)


def test_data_in_wrong_units_are_told_once():
    system, state, *_ = data("wojtyra2020")
    W, misfit = in_other(MILLIMETRES, system)
    closure = rx.Compliance(W, 10 * misfit)
    with pytest.warns(UserWarning) as told:
        rx.solve(system, state, closure=closure)
    rx.solve(system, state, closure=closure)
    assert len(told) == 2
    for warning, words in zip(
        told, (("`W`", " 1e-05 in", " 1e-09, most K.angle"), ("`misfit`", "A.x (1)")), strict=True
    ):
        assert all(word in str(warning.message) for word in (*words, "Units(length=1000.0, mass=0.001)"))
    with pytest.warns(UserWarning, match=r"`misfit` .* K.angle \(11\), .*angle=57.2958"):
        rx.solve(system, state, closure=rx.Compliance(STIFF, 10 * in_other(DEGREES, system)[1]))
    with pytest.warns(UserWarning, match=r"`W` .*length=0.001, mass=1000.0"):
        there = rx.units.state_in_units(state, system, MILLIMETRES)
        rx.solve(rx.units.in_units(system, MILLIMETRES), there, closure=rx.Compliance(STIFF))


def test_units_of_a_model_are_told_where_they_are_stated():
    system = rx.mechanisms.wojtyra2020()
    W, _ = in_other(MILLIMETRES, system)
    with pytest.warns(UserWarning, match=r"`W` .* 1e-05 m/N .* 1e-09 rad/\(N m\)"):
        rx.solve(system, system.state(phi=0.7, rate=1.0), closure=rx.Compliance(W))


def test_traced_data_are_not_checked():
    system, state, *_ = data("wojtyra2020")
    W, _ = in_other(MILLIMETRES, system)
    jax.jit(lambda W: rx.solve(system, state, closure=rx.Compliance(W)).acceleration)(W)


@pytest.mark.parametrize("closure", [
    lambda: rx.MinimumNorm(np.ones(12)),
    lambda: rx.MinimumNorm(np.ones((24, 1))),
    lambda: rx.Compliance(np.ones(11)),
    lambda: rx.Compliance(np.ones((12, 11))),
    lambda: rx.Compliance(np.ones(12), np.ones(11)),
    lambda: rx.Compliance(np.float64(1.0)),
])  # fmt: skip
def test_shapes_that_do_not_fit_are_refused(closure):
    system, state, *_ = data("wojtyra2020")
    with pytest.raises(rx.RedundaxError, match=r"Argument `.*` must"):
        registry.solve(system, state, closure=closure())


def test_no_closure_needs_newton_and_a_start():
    system, state, *_ = data("wojtyra2020", registry.coulomb)
    for options in ({}, {"x0": 1.0, "solver": rx.FixedPoint()}, {"solver": rx.Newton()}):
        with pytest.raises(rx.RedundaxError, match=r"Argument `closure` may be None only"):
            registry.solve(system, state, closure=None, **options)
    with pytest.raises(rx.RedundaxError, match=r"Argument `x0` must"):
        registry.solve(system, state, closure=None, x0=jnp.ones(12))


def test_derivatives_by_misfit_outside_of_jit():
    """Accelerations without friction do not depend on it, so that they are known while it is traced."""
    mechanism = rx.mechanisms.wojtyra2020()
    state = mechanism.state(phi=0.7, rate=1.0)
    W = jnp.array([1e-8] * 10 + [1e-6] * 2)
    d = 1e-4 * jnp.arange(12.0)

    def multipliers(d):
        return rx.solve(mechanism, state, closure=rx.Compliance(W, misfit=d)).multipliers

    slope = jax.jacfwd(multipliers)(0 * d)
    np.testing.assert_allclose(slope @ d, multipliers(d) - multipliers(0 * d), rtol=1e-9, atol=1e-9)
