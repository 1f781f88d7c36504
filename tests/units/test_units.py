"""A change of units (16) changes no physics; what it changes is the pick of the minimum norm."""

import numpy as np
import pytest
import registry
from truth import exact, paper, scenes

import redundax as rx

FACTORS = (1e-4, 1e-2, 0.1, 10.0, 1e3, 1e4)
every_factor = pytest.mark.parametrize("u", FACTORS)
rubbing_or_not = pytest.mark.parametrize("mu_rho", [None, 0.02], ids=["smooth", "rubs"])
BASE = rx.mechanisms.wojtyra2020


def data(mu_rho, u=1.0):
    mechanism = BASE(mu_rho=mu_rho, u=u)
    return mechanism, mechanism.state(phi=np.pi / 4, rate=1.0)


def mapped_back(solution, mechanism, units):
    """Accelerations, multipliers and friction in the units of the base mechanism."""
    angular = [True] * solution.friction.size
    friction = units.energy / np.where(angular, units.angle, units.length)
    return (
        np.array(solution.acceleration * units.time**2 / units.of(mechanism.coordinates)),
        np.array(solution.multipliers / units.of_force(mechanism.rows)),
        np.array(solution.friction) / friction,
    )


def assert_same(solution, parts, mechanism, tolerance=1e-11):
    """Relative per kind; moments no finer than the largest force times l = 0.1 m.

    In the units u = 1e3 and 1e4 the minimum norm leaves moments of 3e-5 and 3e-7 N m beside forces
    of 46 N, whose rounding alone is 1e-15 N m.
    """
    errors = registry.errors_of(solution, parts, mechanism)
    multipliers = np.abs(parts[1])
    force, moment = np.max(multipliers[:10]), np.max(multipliers[10:])
    errors["moment"] *= min(1.0, moment / (0.1 * force))
    assert max(errors.values()) <= tolerance, errors


@every_factor
@rubbing_or_not
@pytest.mark.parametrize("h", [0.0, 100.0])
def test_minimum_norm_in_other_units_needs_no_other_mechanism(u, mu_rho, h):
    """The pick in units u is a compliance and misfit in base units: one factorisation for a sweep."""
    units = rx.units.Units(length=u)
    base, state = data(mu_rho)
    there = registry.solve(*data(mu_rho, u), h=h)
    here = registry.solve(base, state, closure=rx.MinimumNorm(np.full(24, h), units=units))
    assert_same(here, mapped_back(there, base, units), base)


@pytest.mark.parametrize("u", [0.1, 10.0])
@rubbing_or_not
def test_minimum_norm_in_other_units_against_exact_geometry(u, mu_rho):
    mechanism = scenes.wojtyra2020(u=exact.exact(str(u)))
    truth = mechanism.solve(misfit=[50] * 12, friction=mu_rho is not None)
    base, state = data(mu_rho)
    solution = registry.solve(base, state, closure=rx.MinimumNorm(np.full(24, 50.0), units=rx.units.Units(length=u)))
    tau = exact.floats(truth.friction) / u**2 if mu_rho else np.zeros(0)
    parts = (
        exact.floats(truth.acceleration) / np.array([u] * 8 + [1.0] * 4),
        exact.floats(truth.multipliers) / np.array([u] * 10 + [u**2] * 2),
        tau,
    )
    assert_same(solution, parts, base, 1e-12)


@pytest.mark.parametrize("row", paper.TABLE3, ids=lambda row: f"u={row.u} h={row.start}")
def test_table_3_on_the_base_mechanism(row):
    base, state = data(0.02)
    units = rx.units.Units(length=row.u)
    p = paper.Parameters(u=row.u)
    x = paper.fixed_point(p, *paper.configuration(p, np.pi / 4, 1.0), row.start)[-1]
    solution = registry.solve(base, state, closure=rx.MinimumNorm(np.full(24, row.start), units=units))
    parts = (
        x[:12] / np.array([row.u] * 8 + [1.0] * 4),
        x[12:] / np.array([row.u] * 10 + [row.u**2] * 2),
        paper.friction(p, x[12:], np.array(state.qd))[0] / row.u**2,
    )
    assert_same(solution, parts, base, 1e-10)


@every_factor
@rubbing_or_not
def test_under_a_physical_closure_units_change_nothing(u, mu_rho):
    """W' = D W D / energy and d' = D d, with D the factors of the rows' own units."""
    base, state = data(mu_rho)
    rng, units = np.random.default_rng(9), rx.units.Units(length=u)
    root, misfit = rng.normal(size=(12, 12)), 1e-3 * rng.normal(size=12)
    compliance = 1e-3 * (root @ root.T + np.eye(12))
    own = np.array(units.of(base.rows))
    turned = rx.Compliance(own[:, None] * compliance * own / units.energy, own * misfit)
    here = registry.solve(base, state, closure=rx.Compliance(compliance, misfit))
    there = registry.solve(*data(mu_rho, u), closure=turned)
    assert_same(here, mapped_back(there, base, units), base)


@every_factor
def test_rank_and_spectrum_do_not_move_with_the_unit(u):
    stats = registry.solve(*data(None, u)).stats
    reference = registry.solve(*data(None)).stats
    assert stats.rank == 11
    assert np.allclose(stats.spectrum.singular_values, reference.spectrum.singular_values, rtol=0, atol=1e-14)


@pytest.mark.parametrize("unit", ["length", "angle", "mass", "time"])
def test_units_of_force_are_energy_over_the_unit(unit):
    units, rows = rx.units.Units(**{unit: 10.0}), BASE().rows
    energy = {"length": 100.0, "angle": 1.0, "mass": 10.0, "time": 0.01}[unit]
    own = {"length": (10.0, 1.0), "angle": (1.0, 10.0)}.get(unit, (1.0, 1.0))
    expected = [energy / own[0]] * 10 + [energy / own[1]] * 2
    assert np.allclose(units.of_force(rows), expected, rtol=1e-15)


def test_mass_and_time_units_change_no_pick_without_h():
    base, state = data(0.02)
    reference = registry.solve(base, state)
    for units in (rx.units.Units(mass=1e3), rx.units.Units(time=1e-3)):
        solution = registry.solve(base, state, closure=rx.MinimumNorm(np.zeros(24), units=units))
        parts = reference.acceleration, reference.multipliers, reference.friction
        assert_same(solution, parts, base, 1e-13)
