"""Derivatives of motions of more steps than reverse mode keeps by itself."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx


@pytest.mark.slow
@pytest.mark.parametrize("stabilisation", [rx.Projection(), rx.Baumgarte(20.0, 20.0)], ids=["own loop", "diffrax's"])
def test_a_first_gradient_of_many_steps_is_that_of_forward_mode(stabilisation):
    """Going forth and back are computed apart there, and what is computed again must not differ."""
    mechanism = rx.mechanisms.wojtyra2020()

    def end(rate, **options):
        state, given = mechanism.state(phi=jnp.pi / 4, rate=rate), {"stabilisation": stabilisation, **options}
        motion = rx.simulate(mechanism, state, 3.0, ts=[1.5, 3.0], **given)
        return jnp.sum(motion.q[-1] ** 2) + jnp.sum(motion.qd[0])

    rate = jnp.ones(())
    forward = jax.jit(lambda rate: jax.jvp(lambda x: end(x, adjoint=diffrax.ForwardMode()), (rate,), (rate,))[1])
    np.testing.assert_allclose(jax.grad(end)(rate), forward(rate), rtol=1e-10)
