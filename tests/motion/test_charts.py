"""Charts with a retraction of their own: a door on two hinges in quaternions or rotation matrices, a heavy top."""

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


@pytest.mark.parametrize("chart", ["quaternion", "matrix"])
@slow
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
    figure = rx.plot.trajectory(case.system, motion)
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
    assert "5'" in {panel.get_ylabel().split(",")[0] for panel in rx.plot.ensemble(found).axes}


TOP_MASS, TOP_CENTRE, SPIN = 2.0, np.array([0.4, 0.1, -0.3]), np.array([1.0, 2.0, -1.5])
TOP_INERTIA = np.diag([0.3, 0.4, 0.5])


def turned_about(axis, angle):
    across = np.cross(np.eye(3)[axis], np.eye(3)).T
    return jnp.eye(3) + jnp.sin(angle) * across + (1 - jnp.cos(angle)) * across @ across


def top():
    """A heavy top, its pivot held twice, in rotation matrices that turn about x, y and z one after the other.

    This retraction meets the exponential to first order only.
    """

    def frame(q):
        return q[3:].reshape(3, 3)

    def inertia(q):
        return frame(q) @ TOP_INERTIA @ frame(q).T

    def load(q, qd, t, p):
        return jnp.concatenate([jnp.array([0.0, 0.0, -9.81 * TOP_MASS]), -jnp.cross(qd[3:], inertia(q) @ qd[3:])])

    def constraint(q, t, p):
        off = q[:3] - frame(q) @ TOP_CENTRE
        return jnp.concatenate([off, 2 * off])

    def retraction(q, d):
        turn = turned_about(0, d[3]) @ turned_about(1, d[4]) @ turned_about(2, d[5])
        return jnp.concatenate([q[:3] + d[:3], (turn @ frame(q)).ravel()])

    system = rx.System(
        constraint,
        lambda q, t, p: jax.scipy.linalg.block_diag(TOP_MASS * jnp.eye(3), inertia(q)),
        load,
        coordinates=("linear",) * 3 + ("angular",) * 3,
        n=6,
        m=6,
        retraction=retraction,
    )
    q = jnp.concatenate([TOP_CENTRE, jnp.eye(3).ravel()])
    return system, rx.State(q, jnp.concatenate([np.cross(SPIN, TOP_CENTRE), SPIN]))


def top_rate(t, y):
    """Euler's equations about the pivot: frame, shape (9,), and angular velocity, shape (3,), in global components."""
    about = TOP_INERTIA + TOP_MASS * (TOP_CENTRE @ TOP_CENTRE * np.eye(3) - np.outer(TOP_CENTRE, TOP_CENTRE))
    frame = y[:9].reshape(3, 3)
    spin = frame.T @ y[9:]
    moment = np.cross(TOP_CENTRE, frame.T @ [0.0, 0.0, -9.81 * TOP_MASS]) - np.cross(spin, about @ spin)
    return np.concatenate([np.cross(y[9:], frame.T).T.ravel(), frame @ np.linalg.solve(about, moment)])


def test_a_retraction_of_first_order_gives_the_accelerations():
    exact = top_rate(0.0, np.concatenate([np.eye(3).ravel(), SPIN]))[9:]
    np.testing.assert_allclose(rx.solve(*top()).acceleration[3:], exact, rtol=0, atol=1e-13)


@slow
def test_a_retraction_of_first_order_gives_the_motion():
    start = np.concatenate([np.eye(3).ravel(), SPIN])
    path = solve_ivp(top_rate, (0.0, T1), start, "DOP853", t_eval=TIMES, rtol=1e-12, atol=1e-12).y
    motion = rx.simulate(*top(), T1, ts=TIMES, rtol=1e-9)
    np.testing.assert_allclose(motion.q[:, 3:], path[:9].T, rtol=0, atol=1e-6)
    np.testing.assert_allclose(motion.qd[:, 3:], path[9:].T, rtol=0, atol=1e-6)


@slow
def test_steps_of_nearly_half_a_turn_are_right():
    """Quaternions that are normalised do not get there in one step."""
    case, rate = registry.door("quaternion"), 3.1
    floating = eqx.tree_at(lambda system: system.parameters["gravity"], case.system, jnp.zeros(3))
    qd = case.state.qd * rate / case.state.qd[5]
    motion = rx.simulate(floating, rx.State(case.state.q, qd), 1.0, ts=[1.0], rtol=None, dt0=1.0)
    assert 2 * np.arctan2(motion.q[-1, 6], motion.q[-1, 3]) == pytest.approx(0.6 + rate, abs=1e-5)


def test_positions_that_the_retraction_refuses_are_told():
    case = registry.door("quaternion")
    for q in (case.state.q[:-1], jnp.stack([case.state.q] * 2)):
        with pytest.raises(rx.RedundaxError, match="Argument `state` must have a `q`"):
            rx.simulate(case.system, rx.State(q, case.state.qd), 1.0)
