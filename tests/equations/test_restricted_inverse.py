"""The inverse on a subspace that is known by its projector, against 50 digits, and its flag."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

from redundax._equations._rank import split
from redundax._equations._restricted_inverse import restricted_inverse


@pytest.mark.parametrize("smallest", [1.0, 1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("m", [4, 5])
def test_a_motion_without_mass_is_found_however_badly_conditioned(m, smallest):
    rng, jacobians, masses = np.random.default_rng(0), [], []
    for _ in range(100):
        massless = np.concatenate([rng.normal(size=2), np.zeros(4)])[:, None]
        right = np.linalg.qr(np.hstack([massless, rng.normal(size=(6, m))]))[0][:, 1:]
        left = np.linalg.qr(rng.normal(size=(m, m)))[0]
        jacobians.append(left * np.geomspace(1, smallest, m) @ right.T)
        masses.append(np.diag([0, 0, *10.0 ** rng.uniform(0, 3, 4)]))

    @jax.jit
    @jax.vmap
    def definite(jacobian, mass):
        parts, spectrum = split(jacobian, jnp.asarray(0.0), None)
        return restricted_inverse(mass, parts.motion, 6 - spectrum.rank, spectrum.kept)[1].is_yes

    jacobians, masses = jnp.array(jacobians), jnp.array(masses)
    assert not np.any(definite(jacobians, masses))
    assert np.all(definite(jacobians, masses + 1e-3 * jnp.eye(6)))


@pytest.mark.parametrize(("dtype", "spread"), [(jnp.float32, 4), (jnp.float64, 14)])
@pytest.mark.parametrize("dimension", [1, 2, 5, 10])
def test_masses_of_large_spread(dimension, dtype, spread):
    rng = np.random.default_rng(dimension)
    for _ in range(10):
        mass = np.asarray(10.0 ** rng.uniform(0, spread, 20), dtype).astype(float)
        with mp.workdps(50):
            v = mp.qr(mp.matrix(rng.normal(size=(20, dimension)).tolist()), mode="skinny")[0]
            exact = v * (v.T * mp.diag(mass.tolist()) * v) ** -1 * v.T
            projector, truth = (np.array(x.tolist(), float) for x in (v * v.T, exact))
        given = jnp.diag(jnp.asarray(mass, dtype)), jnp.asarray(projector, dtype)
        inverse, decision = jax.jit(restricted_inverse)(*given, jnp.asarray(dimension), jnp.ones((), dtype))
        assert decision.is_yes
        assert np.abs(inverse - truth).max() <= 100 * jnp.finfo(dtype).eps * np.abs(truth).max()


@pytest.mark.parametrize("dimension", [1, 3])
@pytest.mark.parametrize("spoiled", [np.nan, np.inf, -1.0, 0.0])
def test_what_has_no_inverse_is_flagged_and_leaves_value_and_gradient_finite(spoiled, dimension):
    rng = np.random.default_rng(3)
    v = np.linalg.qr(rng.normal(size=(6, dimension)))[0]
    good, projector = jnp.array(10.0 ** rng.uniform(0, 3, 6)), jnp.array(v @ v.T)

    @jax.jit
    @jax.vmap
    def run(mass):
        def one(mass, projector):
            given = jnp.asarray(dimension), jnp.ones(())
            inverse, decision = restricted_inverse(mass, projector, *given)
            return jnp.sum(inverse), (inverse, decision.is_yes)

        return jax.value_and_grad(one, argnums=(0, 1), has_aux=True)(mass, projector)

    (_, (inverse, definite)), gradients = run(jnp.stack([jnp.diag(spoiled * good), jnp.diag(good)]))
    assert list(definite) == [False, True]
    assert np.all(inverse[0] == 0)
    assert all(np.all(gradient[0] == 0) for gradient in gradients)
    (_, alone), _ = run(jnp.stack([jnp.diag(good), jnp.diag(good)]))
    assert np.array_equal(inverse[1], alone[0][1])
