"""A value that is NaN never comes with a gradient that looks right, and what a caller masks leaves the others alone.

Of each call a batch of samples, some of which have no answer. Its vector-Jacobian products are those of both sums that
a user may write: with cotangents of 1 the sum of all, and with 0 where the result is a failure the masked one.
"""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax._tools._no_answer import nan_where, spoiled_where, without_derivatives
from tests.project.test_success import at, block

R = rx.RESULTS


def products(values, given, good):
    """The values, the gradients of both sums by what all samples share, and the derivatives of all values by it."""

    @jax.jit
    def program(given):
        out, pull = jax.vjp(values, given)
        return out, pull(jnp.ones_like(out))[0], pull(jnp.where(good, 1.0, 0.0))[0]

    return program(given)


def assert_law(values, shared, good, slopes, *, forward=True):
    """`slopes` are the right derivatives of the good samples."""
    out, whole, masked = products(values, shared, good)
    np.testing.assert_array_equal(np.isnan(out), ~good)
    assert np.isnan(whole)
    np.testing.assert_allclose(masked, np.sum(slopes), rtol=1e-7)
    if forward:
        _, change = jax.jit(lambda shared: jax.jvp(values, (shared,), (1.0,)))(shared)
        np.testing.assert_array_equal(np.isnan(change), ~good)
        np.testing.assert_allclose(change[good], slopes, rtol=1e-7)


@pytest.mark.parametrize("lose", [nan_where, lambda lost, x: spoiled_where(lost, x, x)])
def test_a_lost_entry_has_a_derivative_of_nan_unless_its_cotangent_is_zero(lose):
    good, x = jnp.array([True, False, True]), jnp.array([1.0, 2.0, 3.0])
    values = jax.vmap(lambda scale, lost, x: lose(lost, scale * x), (None, 0, 0))
    assert_law(lambda scale: values(scale, ~good, x), 1.0, good, x[good])
    change = jax.jacfwd(jax.grad(lambda scale: jnp.sum(values(scale, ~good, x) ** 2)))(1.0)
    assert np.isnan(change)  # of what is not linear the second derivative too


def test_figures_that_are_found_without_derivatives_have_none_of_zero():
    """As the evidence beside a motion, `nearest_singularity` say: 0 looks like an optimum."""

    def both(x):
        return x**2, without_derivatives({"largest": jax.lax.stop_gradient(x)}, [x, jnp.zeros(2, int)])["largest"]

    value, slope = jax.jit(lambda x: jax.jvp(both, (x,), (1.0,)))(3.0)
    np.testing.assert_array_equal(value, [9.0, 3.0])
    np.testing.assert_array_equal(slope, [6.0, np.nan])
    at = jnp.array(3.0)
    assert jax.grad(lambda x: both(x)[0])(at) == 6.0 and np.isnan(jax.grad(lambda x: both(x)[1])(at))


@pytest.mark.slow
def test_evidence_beside_a_motion_has_no_derivatives_of_zero():
    def fallen(gravity):
        ball = rx.System(
            lambda q, t, p: q[:1], [2.0, 2.0], lambda q, qd, t, p: jnp.stack([p, -2.0 * p]), parameters=gravity
        )
        start = rx.State(jnp.zeros(2), jnp.zeros(2))
        run = rx.simulate(ball, start, 1.0, ts=[1.0], adjoint=diffrax.ForwardMode())
        return run.q[0, 1], run.stats

    slope, stats = jax.jvp(fallen, (9.81,), (1.0,))[1]
    np.testing.assert_allclose(slope, -0.5, rtol=1e-8)
    assert np.isnan(stats.kinetic_energy) and np.isnan(stats.nearest_singularity) and np.isnan(stats.contraction)


def test_of_a_peak_forward_mode_tells_what_reverse_mode_of_jax_does_not():
    """Inside `jit` JAX takes the gradient of a maximum that is NaN for 0, before redundax is asked."""
    good, x = jnp.array([True, False, True]), jnp.array([1.0, 2.0, 3.0])

    def peak(scale, masked=False):
        values = jax.vmap(nan_where)(~good, scale * x)
        return jnp.max(jnp.where(good, values, -jnp.inf) if masked else values)

    assert np.isnan(jax.jit(peak)(1.0)) and np.isnan(jax.jit(jax.jacfwd(peak))(1.0)) and np.isnan(jax.grad(peak)(1.0))
    assert jax.jit(jax.grad(lambda scale: jnp.max(scale + jnp.where(good, x, jnp.nan))))(1.0) == 0  # JAX by itself
    for derivative in (jax.grad, jax.jacfwd):
        assert jax.jit(derivative(lambda scale: peak(scale, masked=True)))(1.0) == 3


DATA = {"mu": 0.1, "inertia": 1.0, "x": 0.5, "y": 0.0, "dx": 1.0, "soft": 1.0}
SAMPLES = [
    {},
    {"mu": 0.2, "dx": -2.0},
    {"dx": 0.0},  # at rest
    {"y": 0.1},  # off its guide
    {"inertia": 0.0},
    {"inertia": np.nan},
    {"mu": np.nan},
    {"x": np.inf},
    {"soft": np.nan},
]


def columns(data, samples):
    rows = [data | sample for sample in samples]
    return {name: jnp.array([row[name] for row in rows]) for name in data}


@pytest.mark.parametrize("options", [{}, pytest.param({"closure": None, "x0": 0.0}, marks=pytest.mark.slow)])
def test_a_solution_that_fails(options):
    """Of the block: x'' = push - x - mu gravity sgn x', of which gravity is 10 times what is differentiated by."""
    samples = columns(DATA, SAMPLES[: 9 if not options else 8])

    def solution(shared, mu, inertia, x, y, dx, soft):
        closure = {"closure": rx.Compliance(jnp.stack([soft, jnp.ones(())]))}
        return rx.solve(block(mu, inertia, gravity=10.0 + shared), at(x, y, dx), **(closure | options))

    def values(shared):
        return jax.vmap(lambda sample: solution(shared, **sample).acceleration[0])(samples)

    good = np.arange(len(samples["mu"])) < 2
    assert_law(values, 0.0, good, [-0.1, 0.2])


def circle(radius):
    """A point on a circle whose equation stands there twice."""
    return rx.System(
        lambda q, t, radius: jnp.stack([q @ q - radius**2] * 2),
        lambda q, t, radius: jnp.eye(2),
        parameters=radius,
        n=2,
    )


@pytest.mark.slow
def test_a_state_that_is_not_assembled():
    """y = sqrt(r^2 - x^2) and y' = -x / y; a point of x beyond r is nowhere, and of y' = 1 has no velocity."""
    samples = columns(
        {"radius": 1.0, "x": 0.6, "rate": -0.75},
        [{}, {"radius": 2.0, "x": 1.2}, {"x": 1.5}, {"radius": np.nan}, {"rate": 1.0}],
    )

    def state(shared, radius, x, rate):
        return rx.assemble(circle(radius + shared), [0.5, 0.7], positions={"0": x}, rates={"0": 1.0, "1": rate})

    found = jax.jit(jax.vmap(lambda sample: state(0.0, **sample)))(samples)
    expected = [R.successful, R.successful, R.no_position, R.no_position, R.no_velocity]
    for k, result in enumerate(expected):
        assert jax.tree.map(lambda x, k=k: x[k], found).result == result
    np.testing.assert_array_equal(found.result == R.no_position, [result is R.no_position for result in expected])
    assert str(found.result) == "redundax.RESULTS<2 successful, 2 no_position, 1 no_velocity>"

    def values(shared):
        return jax.vmap(lambda sample: state(shared, **sample).q[1])(samples)

    good = np.isfinite(found.q[:, 1])
    assert_law(values, 0.0, good, [1 / 0.8, 2 / 1.6, 1 / 0.8])


@pytest.mark.slow
def test_a_motion_that_fails_or_rests():
    """x = push' + (x_0 - push') cos t + x'_0 sin t, where push' is the push less friction; it sticks at 0.3 m/s."""
    samples = columns(
        {"mu": 0.1, "push": 3.0, "x": 0.5, "y": 0.0, "dx": 1.0},
        [{}, {"mu": 0.2}, {"mu": 0.3, "push": 0.5, "dx": 0.3}, {"y": 0.1}, {"mu": np.nan}],
    )

    def loads(shared, mu, push, x, y, dx):
        motion = rx.simulate(block(mu, push=push + shared), at(x, y, dx), 0.5, ts=[0.2, 0.5])
        return motion.q[-1, 0] + jnp.max(motion.multipliers)

    def values(shared):
        return jax.vmap(lambda sample: loads(shared, **sample))(samples)

    good = np.arange(5) < 2
    assert_law(values, 0.0, good, [1 - np.cos(0.5)] * 2, forward=False)
