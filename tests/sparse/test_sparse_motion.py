"""Motions of large mechanisms by sparse matrices: closed forms, and those of dense matrices."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import redundax as rx
from redundax._motion._held_sparse import hold_sparse


def crank_angle(loops, phi, rate, t1):
    """Of parallel cranks of 1 m and 1 kg."""
    k = 9.81 * ((loops + 1) / 2 + loops) / ((loops + 1) / 3 + loops)
    run = solve_ivp(lambda t, y: [y[1], -k * np.cos(y[0])], (0, t1), [phi, rate], "DOP853", rtol=1e-13, atol=1e-14)
    return run.y[0, -1]


@pytest.mark.slow
def test_a_motion_of_many_loops_is_that_of_a_pendulum():
    loops, t1 = 60, 0.5
    mechanism = rx.mechanisms.n_four_bar(loops).sparse()
    motion = rx.simulate(mechanism, mechanism.state(np.pi / 2, rate=-1.0), t1, ts=[t1])
    cranks = np.asarray(motion.q[0])[4 * loops + 2 : 5 * loops + 3]
    np.testing.assert_allclose(cranks, crank_angle(loops, np.pi / 2, -1.0, t1), atol=1e-8)
    assert motion.stats.position_violation < 1e-11
    assert motion.stats.energy_error < 1e-7


@pytest.mark.slow
def test_what_a_motion_holds_keeps_its_derivatives():
    def held_on(mass):
        mechanism = rx.mechanisms.doubled_four_bar(coupler_mass=(mass, 1.0)).sparse()
        state = mechanism.state(0.8, rate=1.0)
        held, _ = hold_sparse(mechanism, state, jnp.asarray(11))
        renewed, _ = held.factorised(mechanism, state).renewed()
        return jnp.max(renewed.inverse_mass[:, 0, 0])

    assert jax.grad(held_on)(0.1) == pytest.approx(-100.0, rel=1e-12)


def starts():
    yield "permanent redundancy", rx.mechanisms.parallelogram(4), lambda m: m.state(0.8, rate=1.0)
    yield "in space", rx.mechanisms.bricard(), lambda m: rx.assemble(m)


@pytest.mark.slow
@pytest.mark.parametrize("case", list(starts()), ids=lambda case: case[0])
def test_motions_are_those_of_dense_matrices(case):
    _, mechanism, start = case
    state = start(mechanism)
    dense, sparse = (rx.simulate(each, state, 0.3, ts=[0.1, 0.3]) for each in (mechanism, mechanism.sparse()))
    for name in ("q", "qd", "acceleration", "multipliers", "friction"):
        true, found = (np.asarray(getattr(each, name)) for each in (dense, sparse))
        np.testing.assert_allclose(found, true, rtol=1e-6, atol=1e-6 * np.abs(true).max(initial=1e-3))


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "adjoint"), [(jax.jacfwd, diffrax.ForwardMode()), (jax.jacrev, None)])
def test_derivatives_of_a_motion_are_those_of_its_pendulum(mode, adjoint):
    loops, t1, step = 4, 0.3, 1e-4
    mechanism = rx.mechanisms.n_four_bar(loops).sparse()

    def angle(x):
        heavier = eqx.tree_at(lambda m: m.gravity, mechanism, mechanism.gravity * x[1])
        motion = rx.simulate(heavier, mechanism.state(1.2 + x[0], rate=-1.0), t1, ts=[t1], adjoint=adjoint, rtol=1e-10)
        return motion.q[0, 4 * loops + 2]

    found = mode(angle)(jnp.array([0.0, 1.0]))
    ends = [crank_angle(loops, 1.2 + d, -1.0, t1) for d in (-step, step)]
    assert found[0] == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-6)
    # t -> t sqrt(x) turns gravity x into 1
    ends = [crank_angle(loops, 1.2, -1.0 / np.sqrt(x), t1 * np.sqrt(x)) for x in (1 - step, 1 + step)]
    assert found[1] == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-6)
