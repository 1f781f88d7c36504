"""Stability under the joints' own compliance, against hand calculations and simulations of elastic joints."""

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from truth import paper

import redundax as rx

STABLE, FLUTTER, DIVERGENCE, _ = rx.Settling


def solve(system, state, closure):
    return rx.solve(system, state, closure=closure, solver=rx.Newton(), throw=False)


def rubbing(loads, rate, sense, memory, state, p):
    return -p["mu"] * loads.sum(axis=-1) * sense


def rod(mu, compliance):
    """Painleve's rod: its lower left end slides to the left on a rough floor, 60 degrees from it, given twice.

    m = 1, half length 1, J = 1/3. The contact force N lifts the end with the acceleration
    B N = (1/m + (l^2/J) cos a (cos a - mu sin a)) N.
    """
    a = np.pi / 3

    def floor(q, t, p):
        return jnp.stack([-(q[1] - jnp.sin(q[2]))] * 2)  # multipliers are the floor's push

    def slip(q, t, p):
        return jnp.stack([q[0] - jnp.cos(q[2])])

    group = rx.Friction(slip, rubbing, [[0, 1]], ["linear"], {"mu": mu})
    mass = jnp.array([1.0, 1.0, 1 / 3])
    kinds = ["linear", "linear", "angular"]
    load = jnp.array([0.0, -9.81, 0.0])
    system = rx.System(floor, mass, lambda q, qd, t, p: load, coordinates=kinds, rows="force", m=2, friction=group)
    state = rx.State([0.0, np.sin(a), a], [-1.0, 0.0, 0.0])
    closure = rx.Compliance(compliance * np.ones(2))
    B = 1 + 3 * np.cos(a) * (np.cos(a) - mu * np.sin(a))
    return system, state, closure, B


@pytest.mark.parametrize(("mu", "verdict"), [(0.5, STABLE), (2.0, DIVERGENCE)])
def test_painleve_s_rod_by_hand(mu, verdict):
    """s = 2 B / c on two contacts of compliance c; their self-stress is no motion."""
    compliance = 1e-6
    system, state, closure, B = rod(mu, compliance)
    solution = solve(system, state, closure)
    found = rx.stability(system, state, solution, closure)
    np.testing.assert_allclose(found.eigenvalues, [2 * B / compliance], rtol=1e-12)
    assert found.verdict is verdict
    assert found.growth == pytest.approx(np.sqrt(max(-2 * B / compliance, 0)), rel=1e-12)


def coupled(mu, a, b, compliance):
    """Two constraints y1 = y2 = 0 whose frictions act on each other: B = [[1, -mu b], [mu a, 1]]."""

    def slip(q, t, p):
        return jnp.stack([q[0] + p["a"] * q[2], q[0] - p["b"] * q[1]])

    parameters = {"mu": mu, "a": a, "b": b}
    group = rx.Friction(slip, rubbing, [[0], [1]], ["linear", "linear"], parameters)
    system = rx.System(
        lambda q, t, p: q[1:], jnp.ones(3), lambda q, qd, t, p: jnp.array([0.0, 5.0, 7.0]), friction=group
    )
    return system, rx.State(jnp.zeros(3), [1.0, 0.0, 0.0]), rx.Compliance(compliance)


def test_flutter_by_hand():
    """Eigenvalues of B W^-1: (1 +- i mu sqrt(a b)) / c for equal compliances, and with a or b turned round real."""
    mu, a, b, c = 0.5, 2.0, 0.5, 1e-4
    system, state, closure = coupled(mu, a, b, [c, c])
    found = rx.stability(system, state, solve(system, state, closure), closure)
    np.testing.assert_allclose(found.eigenvalues, (1 + np.array([-1j, 1j]) * mu * np.sqrt(a * b)) / c, rtol=1e-12)
    assert found.verdict is FLUTTER and "grows unless damped" in str(found)
    system, state, closure = coupled(mu, a, -b, [c, c])
    found = rx.stability(system, state, solve(system, state, closure), closure)
    np.testing.assert_allclose(found.eigenvalues, (1 + np.array([-1, 1]) * mu * np.sqrt(a * b)) / c, rtol=1e-12)
    assert found.verdict is STABLE


@pytest.mark.parametrize("ratio", [1.0, 4.0, 0.0])
def test_a_rigid_constraint_leaves_one_vibration(ratio):
    """W = diag(c, ratio c): eigenvalues of B W^-1; with the second one rigid (B11 - B12 B21 / B22) / c."""
    mu, a, b, c = 0.5, 2.0, 0.5, 1e-4
    system, state, closure = coupled(mu, a, b, [c, ratio * c])
    found = rx.stability(system, state, solve(system, state, closure), closure)
    B = np.array([[1.0, mu * -b], [mu * a, 1.0]])
    if ratio:
        expected = np.sort_complex(np.linalg.eigvals(B @ np.diag([1 / c, 1 / (ratio * c)])))
    else:
        expected = [(B[0, 0] - B[0, 1] * B[1, 0] / B[1, 1]) / c]
    np.testing.assert_allclose(found.eigenvalues, expected, rtol=1e-12)


def test_the_paper_s_mechanism_against_its_own_matrices():
    """Nonzero eigenvalues of Phi_q M^-1 (Phi_q^T - F_lam) W^-1 from the paper's formulas; the self-stress drops out."""
    p = paper.Parameters()
    q, qd = paper.configuration(p, np.pi / 4, 1.0)
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    state = mechanism.state(phi=np.pi / 4, rate=1.0)
    rng = np.random.default_rng(3)
    W = np.diag(10 ** rng.uniform(-8, -6, 12))
    closure = rx.Compliance(W)
    solution = solve(mechanism, state, closure)
    found = rx.stability(mechanism, state, solution, closure)
    jac, lam = paper.jacobian(p, q), np.asarray(solution.multipliers)
    B = jac @ np.linalg.solve(paper.mass(p), jac.T - paper.friction_jacobian(p, lam, qd))
    whole = np.linalg.eigvals(B @ np.linalg.inv(W))
    expected = np.sort_complex(whole[np.argsort(np.abs(whole))[1:]])
    np.testing.assert_allclose(found.eigenvalues, expected, rtol=1e-7)
    assert found.verdict is STABLE and len(found.eigenvalues) == 11


@pytest.mark.parametrize("mu", [0.5, 2.0])
@pytest.mark.slow
def test_the_rod_on_an_elastic_floor_does_so(mu):
    """The elastic contact, integrated: loads beside the solution vibrate or run away at the rate found."""
    compliance, a0 = 1e-9, np.pi / 3
    system, state, closure, _ = rod(mu, compliance)
    solution = solve(system, state, closure)
    s = rx.stability(system, state, solution, closure).eigenvalues[0].real
    load = float(solution.multipliers.sum())

    def motion(t, y):
        _, h, a, vx, vh, va = y
        push = -2 * (h - np.sin(a)) / compliance
        rub = -mu * push * np.sign(vx + np.sin(a) * va)
        moment = -push * np.cos(a) + rub * np.sin(a)
        return [vx, vh, va, rub, push - 9.81, 3 * moment]

    start = [0.0, np.sin(a0) - compliance * load / 2 * 1.05, a0, -1.0, 0.0, 0.0]
    times = np.linspace(0, 1.5 / np.sqrt(abs(s)), 7)
    run = scipy.integrate.solve_ivp(motion, (0, times[-1]), start, "DOP853", times, rtol=1e-11, atol=1e-17)
    change = (-2 * (run.y[1] - np.sin(run.y[2])) / compliance - load) / (0.05 * load)
    expected = np.cos(np.sqrt(s) * times) if s > 0 else np.cosh(np.sqrt(-s) * times)
    np.testing.assert_allclose(change, expected, atol=1e-3)


def test_without_numbers_there_is_nothing_to_judge():
    system, state, closure, _ = rod(0.5, 1e-6)
    bad = solve(system, rx.State([0.0, 5.0, 1.0], [1.0, 0.0, 0.0]), closure)
    with pytest.raises(rx.RedundaxError, match="`solution` must be successful"):
        rx.stability(system, state, bad, closure)
    assert rx.stability(system, state, solve(system, state, closure), closure).to_dict()["growth"] == 0.0
