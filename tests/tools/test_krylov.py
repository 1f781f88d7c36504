"""Solutions of equations known by products, against LU, and how many products they take."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from redundax._tools._krylov import krylov_solution


@pytest.mark.parametrize(("size", "radius", "most"), [(3, 0.5, 4), (50, 0.3, 25), (200, 0.2, 21), (40, 0.0, 2)])
def test_it_is_that_of_lu_in_few_products(size, radius, most):
    rng = np.random.default_rng(size)
    sweep = rng.normal(size=(size, size))
    matrix = np.eye(size) - radius / np.abs(np.linalg.eigvals(sweep)).max() * sweep
    right, pull = rng.normal(size=(2, size))
    products = []

    def product(x):
        jax.debug.callback(lambda: products.append(1))
        return jnp.asarray(matrix) @ x

    found = jax.jit(lambda right: krylov_solution(product, right))(right)
    jax.effects_barrier()
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=0, atol=1e-11 * np.abs(found).max())
    assert len(products) <= most
    across = jax.vjp(lambda right: krylov_solution(lambda x: jnp.asarray(matrix) @ x, right), right)[1](pull)[0]
    np.testing.assert_allclose(across, np.linalg.solve(matrix.T, pull), rtol=0, atol=1e-11 * np.abs(across).max())


@pytest.mark.slow
def test_equations_that_no_search_solves_have_none():
    turns = jnp.roll(jnp.eye(100), 1, axis=0) - jnp.eye(100)
    found = krylov_solution(lambda x: turns @ x, jnp.zeros(100).at[0].set(1.0))
    assert np.all(np.isnan(found))
