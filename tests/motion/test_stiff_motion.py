"""Stiff motions against closed forms and separately written equations of their freedoms."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from truth import press

import redundax as rx
from redundax._motion import _integrate
from redundax._motion._radau import RadauSteps

slow = pytest.mark.slow
MASS, STIFFNESS, DAMPING, RATE, T1 = 2.0, 1e9, 1e6, 3.0, 2.0
TIMES = np.linspace(0.0, T1, 9)


def pulling(i, j, t, p):
    """A spring with damper, one end of which moves to and fro."""
    x, v = i.pose.r[0], i.rate.r[0]
    force = jnp.stack([p["stiffness"] * (jnp.sin(p["rate"] * t) - x) - p["damping"] * v, 0.0 * t])
    return i.wrench(force, jnp.zeros(2)), j.wrench(0 * force, jnp.zeros(2))


def slider(stiffness=STIFFNESS, damping=DAMPING):
    """A slider in two guides, one of which is redundant, at rest."""
    body, across = rx.Body("slider", MASS, 0.1), (0.0, 1.0)
    guides = [
        rx.Translational(name, "slider", "ground", (x, 0.0), (x, 0.0), across) for name, x in (("A", 0.0), ("B", 0.5))
    ]
    load = rx.LoadFunction("slider", pulling, parameters={"stiffness": stiffness, "damping": damping, "rate": RATE})
    return rx.Mechanism([body], guides, loads=[load], gravity=(0.0, -9.81)), rx.State(jnp.zeros(3), jnp.zeros(3))


def pulled(times, stiffness=STIFFNESS, damping=DAMPING):
    """x of the slider: of M x'' + D x' + K x = K sin(w t), from rest."""
    roots = np.roots([MASS, damping, stiffness]).astype(complex)
    forced = stiffness / (stiffness - MASS * RATE**2 + 1j * damping * RATE)
    free = np.linalg.solve([[1, 1], roots], [-forced.imag, -(1j * RATE * forced).imag])
    return (forced * np.exp(1j * RATE * times)).imag + (free @ np.exp(np.outer(roots, times))).real


@slow
def test_an_implicit_solver_takes_over_where_springs_are_stiff_alone(monkeypatch):
    """An explicit one would take 200,000 steps; a spring a million times as soft is one program with it, and stays."""
    taken, made = [], _integrate.in_tangent
    monkeypatch.setattr(_integrate, "in_tangent", lambda *x, **named: taken.append(x) or made(*x, **named))
    for stiffness, damping, atol in ((STIFFNESS, DAMPING, 1e-8), (1e3, 1.0, 1e-7)):
        run = rx.simulate(*slider(stiffness, damping), T1, ts=TIMES)
        np.testing.assert_allclose(run.q[:, 0], pulled(TIMES, stiffness, damping), rtol=0, atol=atol)
        assert run.stats.steps + run.stats.rejected < 1500 and run.stats.phases == 1
        assert run.stats.energy_error < 1e-6 and run.stats.position_violation < 1e-13
        assert len(taken) == 1


@slow
@pytest.mark.parametrize("solver", [diffrax.Kvaerno3(), diffrax.Kvaerno5()], ids=lambda solver: type(solver).__name__)
def test_implicit_solvers_of_diffrax_take_stiff_springs_in_coordinates_of_the_freedoms(solver):
    times = np.linspace(0.0, 0.02, 3)
    run = rx.simulate(*slider(), 0.02, ts=times, solver=solver, rtol=1e-6)
    np.testing.assert_allclose(run.q[:, 0], pulled(times), rtol=0, atol=1e-7)
    assert run.stats.steps + run.stats.rejected < 300


def test_what_grows_beyond_all_bounds_in_a_step_is_no_motion():
    """The error of a step is taken of the velocities before it, too."""
    mechanism, state = slider()
    times = np.linspace(0.0, 1e-3, 9)  # as many as above, so that both are one program
    run = rx.simulate(mechanism, state, 1e-3, ts=times)
    np.testing.assert_allclose(run.q[:, 0], pulled(times), rtol=0, atol=1e-8)


def test_the_implicit_solver_has_its_order():
    """At ends of steps order 5, between them 4, however stiff: y' = -k (y - sin t) + cos t beside a pendulum."""

    def rates(t, y, decay):
        return jnp.stack([y[1], -jnp.sin(y[0]), -decay * (y[2] - jnp.sin(t)) + jnp.cos(t)])

    start, times = jnp.array([1.0, 0.3, 0.0]), jnp.array([1.03, 2.0])
    truth = solve_ivp(lambda t, y: [y[1], -np.sin(y[0])], (0, 2), [1.0, 0.3], "DOP853", times, rtol=1e-12, atol=1e-13)

    def errors(steps, stiffness):
        found = diffrax.diffeqsolve(
            diffrax.ODETerm(rates),
            RadauSteps(1e-11),
            0.0,
            2.0,
            jnp.asarray(2 / steps),  # arrays, so that all four are one program
            start,
            jnp.asarray(stiffness),
            saveat=diffrax.SaveAt(ts=times),
        )
        return np.abs(np.asarray(found.ys) - np.stack([*truth.y, np.sin(times)], axis=1)).max(axis=1)

    for stiffness in (1.0, 1e8):
        coarse, fine = errors(10, stiffness), errors(20, stiffness)
        assert fine[0] < coarse[0] / 10 and fine[1] < coarse[1] / 20 and fine[1] < 1e-6


@slow
def test_a_slider_crank_presses_a_stiff_spring():
    """Its crank makes three turns in 2 s, and by radians per step moves what is stiff."""
    mechanism, state = press.mechanism()
    times = np.array([1.0, 2.0])
    phi, y, spin, _ = press.solved(times, 1e-9, 1e-11).y
    run = rx.simulate(mechanism, state, 2.0, ts=times)
    found = (run.q[:, 8], phi), (run.q[:, 6], y), (run.qd[:, 8], spin)
    for got, truth in found:
        np.testing.assert_allclose(got, truth, rtol=0, atol=2e-6 * np.abs(truth).max())
    assert run.stats.steps < 5000


@slow
def test_derivatives_of_a_stiff_motion():
    """By the damping of the spring, inside of transformations, where the solver is chosen by hand."""

    def end(damping):
        found = rx.simulate(*slider(damping=damping), 0.5, ts=[0.5], solver=rx.Radau(), adjoint=diffrax.ForwardMode())
        return found.q[0, 0]

    value, slope = jax.jvp(end, (DAMPING,), (1.0,))
    ahead, behind = (pulled(np.array([0.5]), damping=x)[0] for x in (1.01 * DAMPING, 0.99 * DAMPING))
    np.testing.assert_allclose(value, pulled(np.array([0.5]))[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(slope, (ahead - behind) / (0.02 * DAMPING), rtol=1e-4)


@slow
def test_derivatives_by_a_start_with_an_implicit_solver_of_diffrax():
    """A pendulum beside its upper position falls away as the start does: phi'' = 3/2 g sin(phi)."""
    pivot = rx.Revolute("A", "rod", "ground", (-0.5, 0.0), (0.0, 0.0))
    pendulum = rx.Mechanism([rx.Body("rod", 1.0, 1 / 12)], [pivot], gravity=(0.0, -9.81))

    def end(phi):
        state = rx.State(jnp.stack([-jnp.sin(phi) / 2, jnp.cos(phi) / 2, phi + jnp.pi / 2]), jnp.zeros(3))
        how = {"solver": diffrax.Kvaerno5(), "adjoint": diffrax.ForwardMode()}
        return rx.simulate(pendulum, state, 0.5, ts=[0.5], **how).q[-1, 2]

    def falls(t, y):
        return [y[1], 1.5 * 9.81 * np.sin(y[0]), y[3], 1.5 * 9.81 * np.cos(y[0]) * y[2]]

    truth = solve_ivp(falls, (0, 0.5), [0.3, 0.0, 1.0, 0.0], "DOP853", rtol=1e-12, atol=1e-12).y[2, -1]
    np.testing.assert_allclose(jax.jacfwd(end)(0.3), truth, rtol=1e-6)


def test_where_the_implicit_solver_is_refused():
    mechanism, state = slider()
    with pytest.raises(rx.RedundaxError, match="Kvaerno5"):
        rx.simulate(mechanism, state, 1.0, solver=rx.Radau(), stabilisation=rx.Baumgarte())
