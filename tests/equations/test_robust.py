"""The default solver on strong friction: which solution it returns, and what it says where there is none.

wojtyra2020 at phi = pi/4 has one, two, four, two and no solutions as mu_rho grows; the truth about their number are the
16 paths of `truth.friction`.
"""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import registry
from truth import friction, scenes

import redundax as rx

PHI = np.pi / 4


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


def crank(mu_rho, rate=1.0):
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    return mechanism, mechanism.state(phi=PHI, rate=rate)


def solved(mu_rho, rate=1.0, **options):
    return rx.solve(*crank(mu_rho, rate), **options, throw=False)


def failed(solution) -> bool:
    assert bool(jnp.all(jnp.isnan(solution.acceleration))) == bool(solution.result != rx.RESULTS.successful)
    return bool(solution.result != rx.RESULTS.successful)


@cache
def truth(mu_rho, rate="1"):
    """Crank accelerations of all solutions, ascending."""
    found = friction.solutions(scenes.wojtyra2020(rate=rate, mu_rho=mu_rho))
    return sorted(float(solution.acceleration[8]) for solution in found)


def followed(mu_rho, rate=1.0) -> rx.types.Solution:
    """The solution on the branch from zero friction: Newton in small steps of the friction, each from the last."""
    x0, step = None, 0.0005
    for mu in [*np.arange(0.1, mu_rho - step / 2, step), mu_rho]:
        solution = solved(mu, rate, solver=rx.Newton(), x0=x0)
        assert not failed(solution)
        x0 = jnp.concatenate([solution.acceleration, solution.multipliers])
    return solution


@pytest.mark.parametrize(
    ("mu_rho", "rate", "count"),
    [
        ("0.1", "1", 1),
        slow("0.14", "1", 2),
        ("0.1445", "1", 4),
        slow("0.146", "1", 2),
        slow("0.15", "1", 0),
        ("0.139", "-1", 1),
        ("0.14", "-1", 0),
    ],
)
def test_the_search_finds_every_solution(mu_rho, rate, count):
    expected = truth(mu_rho, rate)
    assert len(expected) == count
    found = rx.frictional_solutions(*crank(float(mu_rho), float(rate)))
    accelerations = sorted(float(solution.acceleration[8]) for solution in found)
    np.testing.assert_allclose(accelerations, expected, rtol=1e-9)


@pytest.mark.parametrize("mu_rho", [slow(0.14), slow(0.143), slow(0.145), slow(0.1455)])
def test_the_default_stays_on_the_branch_from_zero_friction(mu_rho):
    solution = solved(mu_rho)
    assert not failed(solution)
    np.testing.assert_allclose(solution.acceleration, followed(mu_rho).acceleration, rtol=1e-9)


def test_newton_alone_leaves_the_branch():
    """What the default is for."""
    assert abs(solved(0.1455, solver=rx.Newton()).acceleration[8] - solved(0.1455).acceleration[8]) > 10


@pytest.mark.parametrize(("rate", "inside", "outside"), [slow(1.0, 0.1478, 0.148), (-1.0, 0.1398, 0.14)])
def test_beyond_the_fold_there_is_no_number_but_the_fold(rate, inside, outside):
    assert not failed(solved(inside, rate))
    for mu_rho in (outside, 0.3):
        solution = solved(mu_rho, rate)
        assert failed(solution)
        assert solution.result == rx.RESULTS.no_solution_found
        assert inside < mu_rho * solution.stats.fold < outside
        assert solution.stats.residual > 1e-3
        assert rx.frictional_solutions(*crank(mu_rho, rate)) == []
    with pytest.raises(rx.NoSolutionError, match="No solution of the frictional equations"):
        rx.solve(*crank(outside, rate))


@pytest.mark.slow
def test_samples_beyond_the_fold_leave_their_neighbours_alone():
    mu_rho = jnp.linspace(0.13, 0.16, 31)
    batch = jax.jit(jax.vmap(solved))(mu_rho)
    good = np.asarray(batch.result == rx.RESULTS.successful)
    np.testing.assert_array_equal(good, np.asarray(mu_rho) < 0.1479)
    for k in (0, 12, 17):
        np.testing.assert_allclose(batch.acceleration[k], solved(mu_rho[k]).acceleration, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("mu_rho", [slow(0.02), slow(0.1), 0.14])
def test_contraction_bounds_the_work_of_the_fixed_point(mu_rho):
    """The error falls from 1 to 1e-15 in `steps` sweeps, each of which in the long run divides it by 1 / bound."""
    bound = float(solved(mu_rho).stats.contraction)
    fixed = solved(mu_rho, solver=rx.FixedPoint(max_steps=5000))
    assert not failed(fixed)
    assert bound < 1
    assert fixed.stats.steps <= 3 + 1.5 * np.log(1e-15) / np.log(bound)


def test_the_contraction_is_that_of_the_derivative():
    """Collatz-Wielandt bound against the eigenvalues of |d tau_i / d tau_j|, by differences of literal sweeps."""
    mechanism, state = crank(0.1)
    solution = rx.solve(mechanism, state)
    rows = np.concatenate([np.ravel(group.rows) for group in mechanism.friction])
    factor = rx.factorize(mechanism, state)
    rate = np.asarray(mechanism.friction[0].slip(state.q + 1e-7 * state.qd, state.t)) - np.asarray(
        mechanism.friction[0].slip(state.q, state.t)
    )
    directions = np.asarray(jax.jacrev(lambda q: mechanism.friction[0].slip(q, state.t))(state.q)).T
    unit = np.asarray(factor.respond(jnp.asarray(directions))[1])
    unit = unit - np.asarray(factor.self_stress) @ unit
    loads, gain = np.asarray(solution.multipliers)[rows].reshape(-1, 2), unit[rows].reshape(-1, 2, 4)
    pull = np.einsum("ic,icj->ij", loads / np.linalg.norm(loads, axis=1, keepdims=True), gain)
    slope = -0.1 * np.sign(rate)[:, None] * pull
    radius = np.max(np.abs(np.linalg.eigvals(np.abs(slope))))
    assert radius * (1 - 1e-6) <= float(solution.stats.contraction) <= 1.1 * radius


@pytest.mark.slow
def test_derivative_on_a_followed_branch():
    mu_rho, step = 0.143, 1e-6

    def crank_acceleration(mu_rho):
        return solved(mu_rho).acceleration[8]

    forward, reverse = jax.jacfwd(crank_acceleration)(mu_rho), jax.grad(crank_acceleration)(mu_rho)
    difference = (crank_acceleration(mu_rho + step) - crank_acceleration(mu_rho - step)) / (2 * step)
    np.testing.assert_allclose(forward, reverse, rtol=1e-9)
    np.testing.assert_allclose(forward, difference, rtol=1e-4)


@pytest.mark.parametrize("name", ["slider_crank", "wojtyra2020"])
@pytest.mark.slow
def test_default_and_newton_are_one_where_friction_contracts(name):
    mechanism, state = registry.build(registry.MECHANISMS[name](), registry.coulomb)
    default, plain = registry.solve(mechanism, state), registry.solve(mechanism, state, solver=rx.Newton())
    assert default.stats.contraction < 1
    assert default.stats.fold == jnp.inf
    # Sweeps and Newton's method end at the same solution, to rounding.
    largest = float(np.max(np.abs(plain.multipliers)))
    np.testing.assert_allclose(default.multipliers, plain.multipliers, rtol=0, atol=1e-14 * largest)


def test_rank_is_lower_only_here():
    mechanism = rx.mechanisms.parallelogram()
    solve = jax.jit(lambda phi: rx.solve(mechanism, mechanism.state(phi=phi, rate=1.0)))
    for phi, singular in ((0.0, True), (1e-6, False), (0.3, False)):
        solution = solve(phi)
        assert bool(solution.stats.singular_position) == singular
        assert (solution.result == rx.RESULTS.singular_position) == singular
    assert solve(1e-14).result == rx.RESULTS.ambiguous_rank
    report = rx.analyze(mechanism, mechanism.state(phi=0.0, rate=1.0))
    assert report.singular_position
    assert "SINGULAR POSITION" in str(report)


def test_a_multiplier_that_is_unique_only_here():
    """Two parallel guides and a crank: at the position where its lever vanishes a row of N is zero for a moment."""

    def constraint(q, t, p):
        return jnp.array([q[1], q[1] * (1 + q[0]), 2 * q[1] + q[2] * q[0], q[2]])

    system = rx.System(constraint, mass=jnp.ones(3))
    here = rx.analyze(system, rx.State(q=[0.0, 0.0, 0.0], qd=[0.0, 0.0, 0.0]))
    assert here.redundancy == 2
    assert not here.singular_position
    assert here.unique_only_here == ("3",)
    beside = rx.analyze(system, rx.State(q=[0.3, 0.0, 0.0], qd=[0.0, 0.0, 0.0]))
    assert beside.redundancy == 2
    assert beside.unique_multipliers == ()
