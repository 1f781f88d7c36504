"""Derivatives past instants at which a joint begins to press its other side, where friction bends: closed form."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

MASS, MU, PULL, SIZE, SPEED, END = 2.0, 0.3, 4.0, 30.0, 2.0, 0.8


def slid(shift, rtol, adjoint=None):
    """How far a block is at the end, and how fast, whose guide bears N = SIZE (cos(6 t + 0.3) + shift)."""

    def wrench(i, j, t, shift):
        force = jnp.stack([PULL + 0.0 * t, -SIZE * (jnp.cos(6.0 * t + 0.3) + shift)])
        return rx.Wrench(force, 0.0 * t), rx.Wrench(0.0 * force, 0.0 * t)

    rubs = {"friction": rx.Coulomb(MU), "guide_length": 0.5}
    guide = rx.Translational("K", "block", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), **rubs)
    loads = [rx.LoadFunction("block", wrench, parameters=shift)]
    mechanism = rx.Mechanism([rx.Body("block", MASS, 0.3)], [guide], loads=loads)
    state = rx.State(jnp.zeros(3), jnp.array([SPEED, 0.0, 0.0]))
    run = rx.simulate(mechanism, state, END, ts=[END], rtol=rtol, adjoint=adjoint)
    return jnp.stack([run.q[0, 0], run.qd[0, 0]])


def slopes(shift):
    """Of x and v: those of the integrals of (END - t) v' and v' = (PULL - MU |N|) / MASS; the turns of N move."""
    turns = np.sort([(2 * np.pi * k + side * np.arccos(-shift) - 0.3) / 6 for k in range(3) for side in (-1, 1)])
    at = np.array([0.0, *turns[(turns > 0) & (turns < END)], END])
    sign = np.sign(np.cos(6 * (at[1:] + at[:-1]) / 2 + 0.3) + shift)
    parts = np.array([np.diff(-((END - at) ** 2) / 2), np.diff(at)])
    return -MU * SIZE / MASS * parts @ sign


@pytest.mark.parametrize("rtol", [1e-4, pytest.param(1e-8, marks=pytest.mark.slow)])
def test_forward_derivatives_pass_reversals_of_a_load(rtol):
    """They were off by 0.05 at 1e-4 and 5e-4 at 1e-8."""
    found = jax.jvp(lambda x: slid(x, rtol, diffrax.ForwardMode()), (0.3,), (1.0,))[1]
    np.testing.assert_allclose(found, slopes(0.3), rtol=0, atol=1e-8)


@pytest.mark.slow
def test_reverse_derivatives_pass_reversals_of_a_load():
    np.testing.assert_allclose(jax.jacrev(lambda x: slid(x, 1e-8))(0.3), slopes(0.3), rtol=0, atol=1e-8)


@pytest.mark.slow
def test_derivatives_of_batches_pass_reversals_each_at_its_own_time():
    shifts = np.array([0.3, 0.1, 0.8])
    found = jax.vmap(jax.jacfwd(lambda x: slid(x, 1e-7, diffrax.ForwardMode())))(shifts)
    np.testing.assert_allclose(found, [slopes(x) for x in shifts], rtol=0, atol=1e-8)
