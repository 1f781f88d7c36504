"""Joints that stick while others move, and loads that let them go, against equations of stick and slip written out."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import redundax as rx

GRAVITY, STIFFNESS, COUPLING = 10.0, 4.0, 3.0
slow = pytest.mark.slow


def blocks(mu, loads) -> rx.System:
    """Blocks of 1 kg in a row on rough guides that stand there twice; `loads(x, t)` along the guides."""
    count = len(mu)

    def rubbing(loads, rate, sense, memory, state, p):
        return -p * jnp.abs(loads[:, 0] + 2 * loads[:, 1]) * sense

    rows = np.stack([np.arange(count), count + np.arange(count)], axis=1)
    friction = rx.Friction(lambda q, t, p: q[:count], rubbing, rows, ("linear",) * count, jnp.asarray(mu))
    return rx.System(
        lambda q, t, p: jnp.concatenate([q[count:], 2 * q[count:]]),
        jnp.ones(2 * count),
        lambda q, qd, t, p: jnp.concatenate([loads(q[:count], t), -GRAVITY * jnp.ones(count)]),
        friction=friction,
    )


def slides(mu, loads, x, t1):
    """Positions at t1 from rest, and the instants at which a block began to slip or to stick."""
    limit, x, v, t = np.asarray(mu) * GRAVITY, np.array(x, float), np.zeros(len(x)), 0.0
    free = np.asarray(loads(x, t))
    mode, changes = np.where(np.abs(free) > limit, np.sign(free), 0.0), []
    while True:
        events = [margin(j, mode[j], limit[j], loads) for j in range(len(x))]
        rates = moved(mode, limit, loads)
        run = solve_ivp(rates, (t, t1), [*x, *v], method="DOP853", rtol=1e-12, atol=1e-13, events=events)
        t, (x, v) = run.t[-1], np.split(run.y[:, -1], 2)
        if t >= t1:
            return x, changes
        changes.append(t)
        j = next(j for j, found in enumerate(run.t_events) if len(found))
        free, v[j] = loads(x, t)[j], 0.0
        mode = mode.copy()
        mode[j] = np.sign(free) if mode[j] == 0 or abs(free) > limit[j] else 0.0


def moved(mode, limit, loads):
    """Blocks that slip in their mode, -1 or 1, and stand still in mode 0."""

    def rates(t, y):
        x, v = np.split(y, 2)
        return np.concatenate([v * np.abs(mode), np.where(mode == 0, 0.0, loads(x, t) - mode * limit)])

    return rates


def margin(j, mode, limit, loads):
    """What is left of friction that holds block j, or of its velocity."""

    def left(t, y):
        x, v = np.split(np.asarray(y), 2)
        return limit - abs(loads(x, t)[j]) if mode == 0 else v[j] * mode + 1e-13

    left.terminal, left.direction = True, -1
    return left


def chain(x, t):
    """Two blocks joined by a spring, the first on another spring at a wall."""
    pull = COUPLING * (x[1] - x[0])
    return pull * np.array([1.0, -1.0]) - STIFFNESS * x[0] * np.array([1.0, 0.0])


@pytest.mark.slow
def test_one_block_sticks_while_the_other_moves():
    """Each of the two sticks and is let go by the other again and again."""
    mu, start, t1 = (0.02, 0.12), [1.2, 0.0], 6.0
    truth, changes = slides(mu, chain, start, t1)
    run = rx.simulate(blocks(mu, chain), rx.State([*start, 0, 0], jnp.zeros(4)), t1, ts=[t1])
    assert len(changes) >= 4
    np.testing.assert_allclose(run.q[0, :2], truth, rtol=0, atol=1e-7)
    assert run.stats.phases == 1 + len(changes)
    assert run.stats.energy_error < 1e-8


@slow
def test_a_load_that_grows_lets_a_block_go():
    """At rest, let go where the load passes mu g, at rest again; one run of motion in each half period."""
    mu, force = 0.1, 1.25
    pushed = blocks([mu], lambda x, t: force * jnp.sin(t) * jnp.ones(1))
    t1 = 5.0
    truth, changes = slides([mu], lambda x, t: force * np.sin(t) * np.ones(1), [0.0], t1)
    run = rx.simulate(pushed, rx.State([0.0, 0.0], [0.0, 0.0]), t1, ts=[0.5, 3.0, t1])
    np.testing.assert_allclose(changes[0], np.arcsin(mu * GRAVITY / force), rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.q[2, 0], truth[0], rtol=0, atol=1e-8)
    assert run.q[0, 0] == 0.0
    assert np.isnan(run.friction[0, 0])
    assert np.array_equal(run.sense[:, 0], [0.0, 0.0, -1.0])
    ends = rx.simulate(pushed, rx.State([0.0, 0.0], [0.0, 0.0]), 3.0, ts=[1.0, 2.0, 3.0], throw=False)
    assert ends.result == rx.RESULTS.stuck
    np.testing.assert_allclose(ends.stats.end, changes[1], rtol=0, atol=1e-8)


@slow
def test_a_light_load_lets_a_block_go_beside_a_wheel_that_spins():
    """As in orbit: the speed of the wheel tells nothing of how little the block needs to set off."""
    mass, mu, gravity, force = 2.0, 0.2, 5e-6, 2.04e-6
    guide = rx.Translational(
        "guide", "block", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), guide_length=0.5, friction=rx.Coulomb(mu)
    )
    axle = rx.Revolute("axle", "wheel", "ground", (0.0, 0.0), (0.0, 0.0))
    pull = rx.AppliedForce("block", (force, 0.0))
    bodies = [rx.Body("block", mass, 1.0), rx.Body("wheel", 1.0, 1.0)]
    mechanism = rx.Mechanism(bodies, [guide, axle], gravity=(0.0, -gravity), loads=[pull])
    motion = rx.simulate(mechanism, rx.State(jnp.zeros(6), jnp.zeros(6).at[5].set(300.0)), 100.0, ts=[100.0])
    truth = (force / mass - mu * gravity) * 100.0**2 / 2
    np.testing.assert_allclose(motion["block.x"], [truth], rtol=1e-7)


@slow
def test_a_motion_out_of_phases_says_so():
    """The first phase is the rest."""
    pushed = blocks([0.1], lambda x, t: 1.25 * jnp.sin(t) * jnp.ones(1))
    run = rx.simulate(pushed, rx.State([0.0, 0.0], [0.0, 0.0]), 5.0, ts=[0.5, 2.0], max_phases=1, throw=False)
    assert run.result == rx.RESULTS.phases_exhausted
    np.testing.assert_allclose(run.stats.end, np.arcsin(0.8), rtol=0, atol=1e-8)
    assert run.acceleration[0, 0] == 0.0
    assert np.isnan(run.acceleration[1]).all()


@slow
def test_what_no_friction_holds_moves_though_another_block_sticks():
    """Both at rest; the load of the smooth block begins at zero and grows, that of the rough one is nothing."""
    pair = blocks([0.0, 0.1], lambda x, t: jnp.stack([jnp.sin(t), 0.0 * t]))
    run = rx.simulate(pair, rx.State(jnp.zeros(4), jnp.zeros(4)), 2.0, ts=[2.0])
    np.testing.assert_allclose(run.q[0, :2], [2.0 - np.sin(2.0), 0.0], rtol=0, atol=1e-7)


@slow
def test_the_derivative_through_release_and_stop():
    """Of the end position with respect to mu: the instants of release and stop move with it."""
    force, t1, h = 1.25, 5.0, 1e-4

    def end(mu):
        pushed = blocks(mu * jnp.ones(1), lambda x, t: force * jnp.sin(t) * jnp.ones(1))
        return rx.simulate(pushed, rx.State([0.0, 0.0], [0.0, 0.0]), t1, ts=[t1], max_phases=6).q[0, 0]

    def truth(mu):
        return slides([mu], lambda x, t: force * np.sin(t) * np.ones(1), [0.0], t1)[0][0]

    np.testing.assert_allclose(jax.jit(jax.grad(end))(0.1), (truth(0.1 + h) - truth(0.1 - h)) / (2 * h), rtol=1e-5)


@slow
def test_a_pendulum_with_a_seized_elbow_swings_as_one_body():
    """Two rods of 1 m and 1 kg, folded at a right angle, whose elbow a preload keeps from turning."""
    elbow = rx.Coulomb(0.01, preload=1e4)
    pendulum = rx.Mechanism(
        [rx.Body("upper", 1.0, 1 / 12), rx.Body("lower", 1.0, 1 / 12)],
        [
            rx.Revolute("O", "upper", "ground", (-0.5, 0.0), (0.0, 0.0)),
            rx.Revolute("E", "lower", "upper", (-0.5, 0.0), (0.5, 0.0), pin_radius=1.0, friction=elbow),
        ],
        gravity=(0.0, -9.81),
    )
    state = rx.assemble(
        pendulum, [0.5, 0.0, 1.0, 0.5, 0.0, np.pi / 2], positions={"upper.phi": 0.0, "lower.phi": np.pi / 2}
    )
    t1 = 3.0
    run = rx.simulate(pendulum, state, t1, ts=[t1])
    centre, inertia = np.array([0.75, 0.25]), 1 / 3 + 1 / 12 + 1.0**2 + 0.5**2

    def swing(t, y):
        c, s = np.cos(y[0]), np.sin(y[0])
        return [y[1], -2 * 9.81 * (centre[0] * c - centre[1] * s) / inertia]

    truth = solve_ivp(swing, (0, t1), [0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-12).y[0, -1]
    np.testing.assert_allclose(run.q[0, 4:], [truth, truth + np.pi / 2], rtol=0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("ramp", [0.08, 0.0004])
def test_a_driver_sets_off_a_guide_at_rest_however_soon_it_runs_at_its_speed(ramp):
    """What rests is looked at a hundred times: a ramp of 0.4 ms ends between two looks."""
    mass, mu, speed, begins, ends = 10.0, 0.1, 0.5, 0.1, 0.8

    def law(t):
        since = jnp.clip(t - begins, 0.0, ramp)
        return 2.0 + speed * (since**2 / 2 / ramp + jnp.maximum(t - begins - ramp, 0.0))

    rubs = {"friction": rx.Coulomb(mu), "guide_length": 0.5}
    joints = [
        rx.Translational("guide", "block", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), **rubs),
        rx.DistanceDriver("drive", "block", "ground", (0.0, 0.0), (-2.0, 0.0), law),
    ]
    block = rx.Mechanism([rx.Body("block", mass, 0.3)], joints, gravity=(0.0, -GRAVITY))
    ts = np.array([0.05, 0.3, 0.6, ends])
    motion = rx.simulate(block, rx.assemble(block, {}), ends, ts=ts)
    way = speed * (np.maximum(ts - begins - ramp, 0.0) + np.where(ts > begins, ramp / 2, 0.0))
    np.testing.assert_allclose(motion["block.x"], way, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.abs(motion["drive.distance"])[1:], mu * mass * GRAVITY, rtol=1e-9)
