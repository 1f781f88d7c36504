"""The least solution of equations known by products, against eigenvectors that are given and complex steps."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from redundax._tools._least_solution import least_solution
from redundax._tools._linear_map import LinearMap


def times(matrix, x):
    return matrix @ x


def of_span(span, x):
    return span @ (span.T @ x)


@pytest.mark.parametrize(
    ("size", "eigenvalues", "unmet"),
    [
        (5, [3.0], 0.0),
        (40, [1.0, 0.5, 0.1], 0.0),
        (40, [1.0, 0.5, 0.1], 1e-6),
        (60, np.geomspace(1.0, 1e-6, 60), 0.0),
        (200, np.geomspace(1.0, 1e-2, 100), 1e-9),
        (40, [], 1.0),
    ],
)
def test_it_is_the_least_that_leaves_the_least_misfit(size, eigenvalues, unmet):
    rng = np.random.default_rng(size)
    vectors = np.linalg.qr(rng.normal(size=(size, size)))[0]
    rank = len(eigenvalues)
    parts = rng.normal(size=size)
    parts[rank:] *= unmet
    matrix = vectors[:, :rank] * np.asarray(eigenvalues) @ vectors[:, :rank].T
    found = least_solution(LinearMap(times, (matrix,)), jnp.asarray(vectors @ parts), jnp.ones(()))
    true = vectors[:, :rank] @ (parts[:rank] / np.asarray(eigenvalues))
    np.testing.assert_allclose(found, true, rtol=0, atol=1e-10 * np.abs(true).max(initial=0.0))


def basis(s, like):
    base = np.random.default_rng(7).normal(size=(12, 3))
    return like.asarray(base) * (1 + 0.1 * s * like.arange(12)[:, None]) + s**2 * like.asarray(base[::-1])


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_its_derivatives_follow_the_range_of_the_matrix(mode):
    given, step = np.array([1.0, 2.0, 3.0]), 1e-30

    def found(s):
        span = basis(s, jnp)
        return least_solution(LinearMap(of_span, (span,)), span @ given, jnp.ones(()))

    span = basis(0.3 + 1j * step, np)
    true = span @ np.linalg.solve(span.T @ span, given)
    np.testing.assert_allclose(found(0.3), true.real, rtol=1e-12)
    np.testing.assert_allclose(jax.jit(mode(found))(0.3), true.imag / step, rtol=0, atol=1e-11)


@pytest.mark.parametrize("outer", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("inner", [jax.jacfwd, jax.jacrev])
def test_its_second_derivatives_follow_the_range_of_the_matrix(outer, inner):
    def found(s):
        span, given = basis(s, jnp), jnp.asarray([1.0, 2.0, 3.0]) * jnp.cos(s)
        return least_solution(LinearMap(of_span, (span,)), span @ given, jnp.ones(()))

    def true(s):
        span, given = basis(s, jnp), jnp.asarray([1.0, 2.0, 3.0]) * jnp.cos(s)
        return span @ jnp.linalg.solve(span.T @ span, given)

    expected = jax.jit(lambda s: jax.jvp(lambda s: jax.jvp(true, (s,), (1.0,))[1], (s,), (1.0,))[1])(0.3)
    np.testing.assert_allclose(jax.jit(outer(inner(found)))(0.3), expected, rtol=0, atol=1e-11 * np.abs(expected).max())
