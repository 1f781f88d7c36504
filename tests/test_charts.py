"""Motions in charts with a retraction of their own: a door on two hinges, with quaternions or rotation matrices."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import registry
from scipy.integrate import solve_ivp

import redundax as rx

T1 = 3.0
TIMES = np.linspace(0.0, T1, 13)
MASS, CENTRE = 2.0, np.array([0.4, 0.1])
INERTIA = 0.5 + MASS * CENTRE @ CENTRE
slow = pytest.mark.slow


def truth(gravity=9.81, brake=0.0):
    """Angle and rate of the door over time, from the equation of a pendulum with a brake; and the number of swings."""
    swings, y, t, path = 0, np.array([0.6, 1.7]), 0.0, np.full((2, TIMES.size), np.nan)
    while t < T1:
        sense = np.sign(y[1]) if t == 0 else np.sign(lever(y[0])) * -1.0

        def rate(t, y, sense=sense):
            return [y[1], (-MASS * gravity * lever(y[0]) - brake * sense) / INERTIA]

        def stop(t, y):
            return y[1]

        stop.terminal, stop.direction = True, -sense
        run = solve_ivp(rate, (t, T1), y, "DOP853", dense_output=True, events=stop, rtol=1e-13, atol=1e-13)
        path = np.where((t <= TIMES) & (run.t[-1] >= TIMES), run.sol(TIMES), path)
        swings += 1
        t, y = run.t[-1], run.y[:, -1] * [1.0, 0.0]
    return path, swings


def lever(angle):
    return CENTRE[0] * np.cos(angle) - CENTRE[1] * np.sin(angle)


@pytest.mark.parametrize("chart", ["quaternion", pytest.param("matrix", marks=slow)])
def test_a_door_swings_as_a_pendulum(chart):
    """k = 5; the chart is kept to rounding, its coordinates are not as many as its velocities."""
    case = registry.door(chart)
    motion = rx.simulate(case.system, case.state, T1, ts=TIMES, rtol=1e-10)
    (angle, rate), _ = truth()
    c, s = np.cos(angle), np.sin(angle)
    np.testing.assert_allclose(motion.q[:, 0], CENTRE[0] * c - CENTRE[1] * s, rtol=0, atol=1e-8)
    np.testing.assert_allclose(motion.qd[:, 5], rate, rtol=0, atol=1e-8)
    size = {"quaternion": 1.0, "matrix": np.sqrt(3.0)}[chart]
    np.testing.assert_allclose(np.linalg.norm(motion.q[:, 3:], axis=1), size, rtol=1e-14)
    assert max(motion.stats.position_violation, motion.stats.velocity_violation) <= 1e-13
    assert motion.stats.energy_error <= 1e-9
    figure = rx.plot_trajectory(case.system, motion)
    assert all(text.get_text().endswith("'") for text in figure.axes[0].get_legend().get_texts())


def braked(brake):
    """The door with a brake on its hinges, in quaternions."""

    def moment(loads, rate, sense, memory, state, p):
        return -p * sense

    def turned(q, t, p):
        return 2 * jnp.arctan2(q[6:], q[3:4])

    case = registry.door("quaternion")
    friction = rx.Friction(turned, moment, np.zeros((1, 0), int), ["angular"], jnp.atleast_1d(brake))
    return eqx.tree_at(lambda system: system.friction, case.system, (friction,)), case.state


@slow
def test_a_braked_door_and_its_derivative():
    """The brake turns round with every swing; the derivative by the brake passes these instants."""

    def end(brake):
        motion = rx.simulate(*braked(brake), T1, ts=TIMES, rtol=1e-10, adjoint=diffrax.ForwardMode())
        return motion.qd[-1, 5], motion

    (_, motion), (slope, _) = jax.jit(lambda b: jax.jvp(end, (b,), (1.0,)))(1.0)
    assert motion.result == rx.RESULTS.successful
    (_, rate), swings = truth(brake=1.0)
    assert motion.stats.phases == swings > 1
    np.testing.assert_allclose(motion.qd[:, 5], rate, rtol=0, atol=1e-8)
    first, second = (np.subtract(*(truth(brake=1 + s)[0][1, -1] for s in (h, -h))) / (2 * h) for h in (1e-2, 5e-3))
    np.testing.assert_allclose(slope, (4 * second - first) / 3, rtol=1e-6)


@slow
def test_ensembles_in_charts():
    """Bands of the rates are those of the ends; positions have no names."""
    case, weights = registry.door("quaternion"), np.array([0.0, 5.0, 9.81])

    def run(gravity):
        down = jnp.stack([0.0 * gravity, -gravity, 0.0 * gravity])
        door = eqx.tree_at(lambda system: system.parameters["gravity"], case.system, down)
        return rx.simulate(door, case.state, T1, ts=TIMES)

    found = rx.ensemble(run, {"gravity": weights}, system=case.system, percentiles=(0, 100))
    rates = np.stack([truth(weight)[0][1] if weight else np.full(TIMES.size, 1.7) for weight in weights])
    ends = np.stack([rates.min(axis=0), rates.max(axis=0)])
    np.testing.assert_allclose(found.qd_band.values[:, :, 5], ends, rtol=0, atol=1e-6)
    assert found.q_band.shape == (2, TIMES.size, 7)
    assert "5'" in {panel.get_ylabel().split(",")[0] for panel in rx.plot_ensemble(found).axes}
