"""Friction of many joints by sparse matrices: the same answers as equations assembled and swept in NumPy."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import racks

import redundax as rx

MU, RADIUS = 0.1, 0.2


def rack(loops, mu=MU):
    """Cranks of 1 m and 1 kg, neighbours joined by couplers, pins rubbing, those of every third joint twice over."""
    rubs = {"friction": rx.Coulomb(mu), "pin_radius": RADIUS}
    bodies, pins = racks.parts(loops)
    pose = rx.mechanisms.n_four_bar(loops).pose
    mechanism = rx.Mechanism(bodies, [rx.Revolute(*pin, **rubs) for pin in pins], gravity=(0.0, -9.81), pose=pose)
    return mechanism.sparse(), pins


def swept(mechanism, pins, state, misfit, mu=MU):
    """Accelerations, multipliers and friction of dense equations of pins, end i less end j, lam = lam_min + P h."""
    labels, rows = list(mechanism.coordinates.labels), list(mechanism.rows.labels)
    n, m = len(labels), len(rows)
    q, qd = np.asarray(state.q), np.asarray(state.qd)
    slopes, gamma, turns, ends = np.zeros((m, n)), np.zeros(m), np.zeros((len(pins), n)), []
    for k, (name, *bodies, at_i, at_j) in enumerate(pins):
        own = [rows.index(f"{name}.{axis}") for axis in "xy"]
        ends.append(own)
        for sign, body, at in zip((1.0, -1.0), bodies, (at_i, at_j), strict=True):
            if body == "ground":
                continue
            x, y, phi = (labels.index(f"{body}.{c}") for c in ("x", "y", "phi"))
            c, s = np.cos(q[phi]), np.sin(q[phi])
            arm = np.array([c * at[0] - s * at[1], s * at[0] + c * at[1]])
            slopes[own[0], [x, phi]] = sign, -sign * arm[1]
            slopes[own[1], [y, phi]] = sign, sign * arm[0]
            gamma[own] += sign * arm * qd[phi] ** 2
            turns[k, phi] = sign
    mass, weight = np.zeros(n), np.zeros(n)
    for k, label in enumerate(labels):
        mass[k] = 1 / 12 if label.endswith("phi") else 1.0
        weight[k] = -9.81 if label.endswith(".y") else 0.0
    sign = np.sign(np.asarray(mechanism.jacobian(state.q, state.t))[ends[0][0], labels.index("c0.x")])
    slopes, gamma = sign * slopes, sign * gamma
    inverse = np.linalg.pinv(slopes / mass @ slopes.T, rcond=1e-11, hermitian=True)
    u, sigma, _ = np.linalg.svd(slopes)
    stress = u[:, np.sum(sigma > 1e-9) :]
    own, rate, tau = stress @ (stress.T @ misfit), turns @ qd, np.zeros(len(pins))
    for _ in range(40):
        force = weight + turns.T @ tau
        lam = inverse @ (slopes @ (force / mass) - gamma)
        lam = lam - stress @ (stress.T @ lam) + own
        tau = -mu * RADIUS * np.hypot(*lam[np.array(ends)].T) * np.sign(rate)
    return (force - slopes.T @ lam) / mass, lam, tau


@pytest.mark.slow
def test_friction_of_many_joints_is_that_of_sweeps_on_dense_equations():
    mechanism, pins = rack(40)
    state = mechanism.state(0.8, rate=1.0)
    misfits = 10 * np.random.default_rng(3).normal(size=(3, len(mechanism.rows)))
    found = jax.vmap(lambda h: rx.solve(mechanism, state, closure=rx.MinimumNorm(h)))(
        jnp.asarray(np.pad(misfits, ((0, 0), (len(mechanism.coordinates), 0))))
    )
    assert np.all(found.result == rx.RESULTS.successful)
    order = [list(mechanism.slips.labels).index(f"{pin[0]}") for pin in pins]
    for k, misfit in enumerate(misfits):
        a, lam, tau = swept(mechanism, pins, state, misfit)
        np.testing.assert_allclose(found.acceleration[k], a, atol=1e-10 * np.abs(a).max())
        np.testing.assert_allclose(found.multipliers[k], lam, atol=1e-10 * np.abs(lam).max())
        np.testing.assert_allclose(np.asarray(found.friction[k])[order], tau, atol=1e-10 * np.abs(tau).max())


@pytest.mark.slow
def test_friction_beyond_sweeps_is_followed_from_zero_friction_to_the_end_or_a_fold():
    for mu_rho, result in ((0.2, rx.RESULTS.successful), (0.5, rx.RESULTS.no_solution_found)):
        mechanism = rx.mechanisms.n_four_bar(2, mu_rho=mu_rho)
        state = mechanism.state(0.8, rate=1.0)
        dense, found = (rx.solve(each, state, throw=False) for each in (mechanism, mechanism.sparse()))
        assert dense.result == found.result == result
        np.testing.assert_allclose(found.friction, dense.friction, rtol=1e-10)
        if result == rx.RESULTS.no_solution_found:
            assert found.stats.fold == pytest.approx(float(dense.stats.fold), rel=0.05)


def friction_and_differences():
    """Friction by angle, mass and misfit; where; and its derivatives by differences."""
    mechanism, _ = rack(1)

    def friction(x):
        heavier = eqx.tree_at(lambda m: m.body.mass, mechanism, mechanism.body.mass * (1 + x[1] * jnp.arange(3)))
        closure = rx.MinimumNorm(5.0 * x[2])
        return rx.solve(heavier, mechanism.state(0.8 + x[0], rate=1.0), closure=closure, throw=False).friction

    x, step = jnp.array([0.0, 0.0, 1.0]), 1e-3

    def difference(k):
        ends = [friction(x.at[k].add(d * step)) for d in (-2, -1, 1, 2)]
        return (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * step)

    return friction, x, np.stack([difference(k) for k in range(3)], axis=1)


@pytest.mark.slow
def test_forward_derivatives_of_friction_are_those_of_differences():
    friction, x, true = friction_and_differences()
    change = jnp.array([0.7, -0.4, 0.5])
    found = jax.jvp(friction, (x,), (change,))[1]
    np.testing.assert_allclose(found, true @ change, rtol=1e-8, atol=1e-8 * np.abs(true).max())


@pytest.mark.slow
def test_reverse_derivatives_of_friction_are_those_of_differences():
    friction, x, true = friction_and_differences()
    pull = jnp.cos(jnp.arange(len(true)))
    found = jax.vjp(friction, x)[1](pull)[0]
    np.testing.assert_allclose(found, pull @ true, rtol=1e-8, atol=1e-8 * np.abs(true).max())


@pytest.mark.slow
def test_a_motion_with_friction_is_that_of_dense_matrices():
    """Pins twice over, which stop on the way and turn back."""
    mechanism, _ = rack(1)
    state = mechanism.state(0.8, rate=0.2)
    dense, found = (rx.simulate(each, state, 0.3, ts=[0.03, 0.3]) for each in (mechanism.sparse(False), mechanism))
    assert dense.stats.phases == found.stats.phases == 2
    for name in ("q", "qd", "acceleration", "multipliers", "friction", "sense"):
        true = np.asarray(getattr(dense, name))
        np.testing.assert_allclose(getattr(found, name), true, rtol=0, atol=1e-9 * np.abs(true).max())
    assert found.stats.energy_error < 1e-8
