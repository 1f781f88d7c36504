"""Batches in chunks, and the sweeps that they run where friction contracts strongly."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp
from truth import exact, scenes

import redundax as rx
from redundax._solvers._friction_problem import FrictionProblem, Law
from redundax._solvers._quick_sweeps import quick_sweeps
from redundax._tools import _chunks
from redundax._tools._by_number import solve_few

MECHANISM = rx.mechanisms.wojtyra2020(mu_rho=0.02)
STATE = MECHANISM.state(jnp.pi / 4, rate=1.0)


def solve(h, solver=None):
    return rx.solve(MECHANISM, STATE, closure=rx.MinimumNorm(h), solver=solver)


@pytest.mark.slow
def test_a_batch_in_chunks_is_the_batch(monkeypatch):
    """The last chunk reaches back."""
    h = jnp.linspace(-100.0, 100.0, 10)
    whole = jax.vmap(solve)(h)
    monkeypatch.setattr(_chunks, "limits", lambda: (4, 2**21, 2**17))
    jax.clear_caches()
    parts = jax.vmap(solve)(h)
    for one, other in zip(jax.tree.leaves(whole), jax.tree.leaves(parts), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-10)
    jax.clear_caches()


@pytest.mark.slow
def test_a_batch_of_states_in_chunks_is_that_of_its_states(monkeypatch):
    """Three matrices of 144 entries a chunk; the last chunk reaches back."""
    angles = jnp.linspace(0.3, 1.2, 10)

    def accelerations(angle):
        solution = rx.solve(MECHANISM, MECHANISM.state(angle, rate=1.0), closure=rx.MinimumNorm(3.0))
        return solution.acceleration, solution.stats.spectrum.rank, solution.result

    monkeypatch.setattr(_chunks, "limits", lambda: (4096, 2**21, 3 * 144))
    jax.clear_caches()
    found, ranks, results = jax.vmap(accelerations)(angles)
    jax.clear_caches()
    np.testing.assert_allclose(found, [accelerations(angle)[0] for angle in angles], rtol=1e-11, atol=1e-10)
    assert set(ranks.tolist()) == {11} and jnp.all(results == rx.RESULTS.successful)


def test_a_batch_that_shares_what_must_change_runs_at_once():
    """A loop over chunks would compute anew in each what the samples share."""

    def loops(shared):
        def one(x, y):
            return _chunks.in_chunks(lambda x, y: x * jnp.sum(y), x, y, inside=2**16, changing=y)

        batch = jnp.arange(8.0), jnp.ones(3) if shared else jnp.ones((8, 3))
        return "scan" in str(jax.make_jaxpr(jax.vmap(one, in_axes=(0, None if shared else 0)))(*batch))

    assert loops(shared=False) and not loops(shared=True)


def test_chunks_are_larger_where_threads_share_a_device(monkeypatch):
    """A core of its own for each device asks for the smallest, an accelerator for the largest."""
    sizes = []
    for backend, devices in (("cpu", 8), ("cpu", 1), ("gpu", 1)):
        monkeypatch.setattr(jax, "default_backend", lambda backend=backend: backend)
        monkeypatch.setattr(jax, "local_device_count", lambda devices=devices: devices)
        monkeypatch.setattr(_chunks, "cores", lambda: 8)
        sizes.append(_chunks.limits())
    assert sizes == sorted(sizes) and len(set(sizes)) == 3


@pytest.mark.parametrize("size", range(1, 9))
def test_few_linear_equations(size):
    """Against 50 digits, also where the first pivots are zero."""
    rng = np.random.default_rng(size)
    for zeros in (0, size - 1):
        matrix, right = rng.normal(size=(size, size)), rng.normal(size=size)
        matrix[range(zeros), range(zeros)] = 0.0
        with mp.workdps(50):
            true = np.array(mp.lu_solve(mp.matrix(matrix.tolist()), mp.matrix(right.tolist())).T.tolist()[0], float)
        found = solve_few(jnp.asarray(matrix), jnp.asarray(right))
        assert np.max(np.abs(found - true)) <= 1e-14 * np.linalg.cond(matrix) * np.max(np.abs(true))
        each = jax.vmap(solve_few)(jnp.asarray([matrix, 2 * matrix]), jnp.asarray([right, right]))
        np.testing.assert_allclose(each, [found, found / 2], rtol=1e-13 * np.linalg.cond(matrix))


def test_what_does_not_depend_on_the_sample_stays_out_of_the_batch():
    alone = jax.vmap(lambda h: solve(h).stats.spectrum.singular_values, out_axes=None, axis_size=3)
    assert alone(jnp.zeros(3)).shape == (12,)


def test_factorisations_of_a_batch_hold_only_what_depends_on_the_sample():
    """Gravity enters the load, friction nothing; a sweep over them has one decomposition."""

    def parts(number):
        mechanism = rx.mechanisms.wojtyra2020(mu_rho=number, gravity=number)
        factor = rx.factorize(mechanism, mechanism.state(0.8, rate=1.0))
        return factor.load, factor.self_stress

    load, stress = jax.vmap(parts, out_axes=(0, None))(jnp.full(3, 0.1))
    assert load.shape == (3, 12) and stress.shape == (12, 12)


def test_one_bad_sample_leaves_the_others_alone():
    solutions = jax.vmap(solve)(jnp.array([0.0, jnp.nan, 50.0]))
    assert np.array_equal(solutions.result == rx.RESULTS.successful, [True, False, True])
    assert np.all(np.isfinite(solutions.acceleration[::2])) and np.all(np.isnan(solutions.acceleration[1]))


@pytest.mark.parametrize("mu_rho", [0.02, 0.05, 0.1])
def test_sweeps_end_where_newton_ends(mu_rho):
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    state = mechanism.state(jnp.pi / 4, rate=1.0)
    default, newton = rx.solve(mechanism, state), rx.solve(mechanism, state, solver=rx.Newton())
    np.testing.assert_allclose(default.acceleration, newton.acceleration, rtol=1e-12, atol=1e-11)
    np.testing.assert_allclose(default.multipliers, newton.multipliers, rtol=1e-12, atol=1e-11)


class Rubbing(rx.Friction):
    """tau = -mu (|load| + preload), one load each."""

    def largest_change(self, change, rate, memory, state):
        return self.parameters["mu"] * jnp.abs(change)


@pytest.mark.parametrize("joints", [2, 4])
@pytest.mark.parametrize("share", [0.45, 0.003])
@pytest.mark.parametrize("force", [1.0, 1e-9])
def test_moments_that_forces_of_friction_alone_cause(joints, share, force):
    """Guides under preload load pins that had no load: how small their moments are is not known beforehand.

    Every load is S = -sum tau, so that S = sum mu preload / (1 - sum mu).
    """
    angular = np.repeat([False, True], joints)
    mu = np.where(angular, share / joints, 1e-14)
    preload = np.where(angular, 0.0, force / mu)
    pins = Rubbing(
        lambda q, t, p: q,
        lambda loads, rate, sense, memory, state, p: -p["mu"] * (jnp.abs(loads) + p["preload"]),
        rows=np.arange(2 * joints),
        kinds=["linear"] * joints + ["angular"] * joints,
        parameters={"mu": mu, "preload": preload},
    )
    nothing = jnp.zeros(2 * joints)
    law = Law((pins,), nothing, nothing, rx.State(q=nothing, qd=nothing))
    problem = FrictionProblem.make(nothing, -jnp.ones((2 * joints, 2 * joints)), law, nothing != 0)
    rtol = jnp.asarray(2e-14)
    root = quick_sweeps(problem, law(nothing), rtol, in_batch=True)
    assert root.progress.converged(rtol)
    wanted = -mu * (np.sum(mu * preload) / (1 - np.sum(mu)) + preload)
    np.testing.assert_allclose(root.tau, wanted, rtol=1e-13)


@pytest.mark.slow
def test_many_joints_of_weak_and_strong_friction_in_one_batch():
    """Twelve joints against 50 digits; friction is proved to contract strongly in the first two samples alone.

    Sweeps come three by three, after pairs; Newton's method takes fewer steps.
    """
    mus = (0.005, 0.04, 0.09)

    def one(mu_rho):
        mechanism = rx.mechanisms.parallelogram(cranks=6, mu_rho=mu_rho)
        state = mechanism.state(np.arctan2(4.0, 3.0), rate=1.0)
        solution = rx.solve(mechanism, state, closure=rx.MinimumNorm(30.0))
        return (solution.acceleration, solution.multipliers, solution.friction), solution.stats.steps

    found, steps = jax.jit(jax.vmap(one))(jnp.array(mus))
    assert steps[1] > steps[0] > 6 > steps[2]
    for place, mu_rho in enumerate(mus):
        mechanism = scenes.parallel_cranks(6, mu_rho)
        true = mechanism.solve(misfit=[30] * mechanism.m)
        for part, wanted in zip(found, (true.acceleration, true.multipliers, true.friction), strict=True):
            wanted = exact.floats(wanted).ravel()
            assert np.max(np.abs(part[place] - wanted)) <= 1e-13 * np.max(np.abs(wanted))


@pytest.mark.slow
def test_numbers_that_a_function_of_the_user_holds_may_be_of_the_batch():
    def accelerations(mu):
        def force(loads, rate, sense, memory, state, p):
            return -mu * jnp.abs(loads[:1]) * sense

        friction = rx.Friction(lambda q, t, p: q[:1], force, rows=[0], kinds=["linear"])
        system = rx.System(
            lambda q, t, p: jnp.array([q[1], 2 * q[1]]),
            mass=jnp.ones(2),
            load=lambda q, qd, t, p: jnp.array([0.0, -10.0]),
            friction=[friction],
        )
        return rx.solve(system, rx.State(q=jnp.zeros(2), qd=jnp.array([1.0, 0.0])), throw=False).acceleration

    mus = jnp.array([0.1, 0.2])
    np.testing.assert_allclose(jax.vmap(accelerations)(mus), jnp.stack([accelerations(mu) for mu in mus]), rtol=1e-12)


@pytest.mark.slow
def test_derivatives_through_a_chunked_batch(monkeypatch):
    monkeypatch.setattr(_chunks, "limits", lambda: (2, 2**21, 2**17))
    h = jnp.linspace(-50.0, 50.0, 5)
    crank = eqx.filter_jit(lambda h: jnp.sum(jax.vmap(lambda h: solve(h).acceleration[8])(h)))
    along = jnp.ones(5)
    step = 1e-3
    slope = (crank(h + step) - crank(h - step)) / (2 * step)
    np.testing.assert_allclose(jax.jvp(crank, (h,), (along,))[1], slope, rtol=1e-5)
    np.testing.assert_allclose(jax.grad(crank)(h) @ along, slope, rtol=1e-5)
