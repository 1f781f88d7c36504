"""Surfaces that may slide in several directions come to a stop and go on another way: motions and their derivatives.

A sleeve on a horizontal shaft, of mass m and, at its surface, m_r = I / r^2 as it turns, slides straight where

    m_i v_i' = h_i - L v_i / |v|,   h_i = s_i (L - c m_i)

with s = v / |v|: it slows down at c to a stop. Where |h| > L nothing holds it there: it goes on, as from rest, at a
rate of k along w, w_i = h_i / (L + k m_i). By a small force f across a slide along the shaft, without other loads, it
moves

    y = f |v|^2 m^2 / (2 m_r L^2 (p + 2)),   p = m / m_r - 1
"""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import redundax as rx

rs = rx.spatial
RADIUS, GRAVITY, MU = 0.05, 10.0, 0.2
SLIDES, SPEED = 2.0, 1.5


def sleeve(mass, turned, force):
    """A sleeve that turns with a mass at its surface, with forces there around the shaft and along it."""
    body = rs.Body("body", mass, inertia=(turned * RADIUS**2, 0.1, 0.1))
    sizes = {"shaft_radius": RADIUS, "bearing_length": 0.2, "friction": rx.Coulomb(MU)}
    joint = rs.Cylindrical("joint", body, rx.GROUND, point=(0, 0, 0), axis=(1, 0, 0), **sizes)
    load = rs.AppliedForce("body", jnp.array([1.0, 0, 0]) * force[1], moment=jnp.array([RADIUS, 0, 0]) * force[0])
    return rx.Mechanism([body], [joint], loads=[load], gravity=(0, 0, -GRAVITY))


def at_start(mechanism, velocity):
    """The state with a velocity of the surface."""
    return rx.assemble(mechanism, rates={"joint.angle": velocity[0] / RADIUS, "joint.travel": velocity[1]})


@pytest.mark.slow
def test_a_sleeve_stops_and_goes_on_another_way():
    masses, slows, stop = np.array([0.7, 3.5]), 7.0, 0.3
    limit, way = MU * masses[1] * GRAVITY, np.array([0.8, -0.6])
    force = way * (limit - slows * masses)
    gains = brentq(lambda k: np.sum((force / (limit + k * masses)) ** 2) - 1, 0, 1e4)
    onward = force / (limit + gains * masses)
    assert np.hypot(*force) > limit
    mechanism = sleeve(masses[1], masses[0], force)
    run = rx.simulate(mechanism, at_start(mechanism, way * slows * stop), 0.5, ts=[0.15, stop, 0.4, 0.5])
    past = np.maximum(run.t - stop, 0.0)
    truth = np.outer(np.where(run.t < stop, slows * (stop - run.t), 0.0), way) + np.outer(gains * past, onward)
    found = np.stack([RADIUS * run["joint.angle'"], run["joint.travel'"]], axis=1)
    np.testing.assert_allclose(found, truth, rtol=0, atol=1e-8)
    assert run.stats.phases == 2
    assert run.stats.steps < 40


@pytest.mark.slow
def test_a_sleeve_begins_under_loads_that_just_exceed_friction():
    """The velocity, and its derivatives by the forces, which friction turns by much more than the loads leave."""
    masses = np.array([0.7, 3.5])
    limit = MU * masses[1] * GRAVITY
    forces = 1.01 * limit * jnp.array([0.8, -0.6])

    def moved(force):
        mechanism = sleeve(masses[1], masses[0], force)
        state, how = at_start(mechanism, (0.0, 0.0)), {"ts": [0.0, 0.5], "adjoint": diffrax.ForwardMode()}
        run = rx.simulate(mechanism, state, 0.5, **how)
        return jnp.stack([RADIUS * run["joint.angle'"], run["joint.travel'"]], axis=1), run.stats

    def truth(force):
        gain = brentq(lambda k: np.sum((force / (limit + k * masses)) ** 2) - 1, 0, 1e4, xtol=1e-14, rtol=1e-15)
        return 0.5 * gain * force / (limit + gain * masses)

    velocity, slopes, stats = jax.jvp(moved, (forces,), (jnp.array([1.0, 0.0]),), has_aux=True)
    ahead, behind = (truth(forces + change * np.array([1.0, 0.0])) for change in (1e-5, -1e-5))
    np.testing.assert_allclose(velocity, [(0.0, 0.0), truth(forces)], rtol=1e-9)
    np.testing.assert_allclose(slopes, [(0.0, 0.0), (ahead - behind) / 2e-5], rtol=1e-6)
    kinetic = masses @ truth(forces) ** 2 / 2
    np.testing.assert_allclose(stats.kinetic_energy, kinetic, rtol=1e-9)
    assert stats.energy_error < 1e-9 and stats.nearest_singularity < 2


def slid_across(turned, force, **how):
    """How far a sleeve that slides along its shaft to a stop has moved across it."""
    state = at_start(sleeve(SLIDES, turned, jnp.zeros(2)), (0.0, SPEED))
    mechanism = sleeve(SLIDES, turned, jnp.array([1.0, 0]) * force)
    return RADIUS * rx.simulate(mechanism, state, 1.0, ts=[1.0], **how)["joint.angle"][-1]


def by_a_force_across(turned):
    """The derivative of that."""
    return SPEED**2 / (2 * turned * (MU * GRAVITY) ** 2 * (SLIDES / turned + 1))


@pytest.mark.slow
@pytest.mark.parametrize(("turned", "mode"), [(2.0, "forward"), (0.4, "forward"), (0.1, "reverse")])
def test_a_force_across_a_slide_to_a_stop(turned, mode):
    if mode == "forward":
        slope = jax.jacfwd(lambda force: slid_across(turned, force, adjoint=diffrax.ForwardMode()))(0.0)
    else:
        slope = jax.grad(lambda force: slid_across(turned, force))(0.0)
    np.testing.assert_allclose(slope, by_a_force_across(turned), rtol=1e-7)


@pytest.mark.slow
def test_a_stop_and_what_follows_by_the_load_that_turns_a_sleeve():
    # Where the way of the slide changes with loads, by differences of the motion as it is.
    masses, way = np.array([0.7, 3.5]), np.array([np.cos(-0.4), np.sin(-0.4)])
    force = jnp.array([4.5, 10.5])
    state = at_start(sleeve(masses[1], masses[0], force), 2.1 * way)

    def moved(scale, **how):
        mechanism = sleeve(masses[1], masses[0], force * jnp.array([1.0, 0]) * scale + force * jnp.array([0, 1.0]))
        run = rx.simulate(mechanism, state, 0.5, ts=[0.5], **how)
        return jnp.stack([run["joint.travel"][-1], RADIUS * run["joint.angle"][-1]])

    slope = jax.jacfwd(lambda scale: moved(scale, adjoint=diffrax.ForwardMode()))(1.0)
    off = 1e-4
    difference = (moved(1 + off, rtol=1e-11) - moved(1 - off, rtol=1e-11)) / (2 * off)
    np.testing.assert_allclose(slope, difference, rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("before", [1e-8, 1e-5])
def test_a_step_that_ends_shortly_before_a_stop(before):
    turned, how = 0.4, {"adjoint": diffrax.ForwardMode(), "jump_ts": [SPEED / (MU * GRAVITY) - before]}
    slope = jax.jacfwd(lambda force: slid_across(turned, force, **how))(0.0)
    np.testing.assert_allclose(slope, by_a_force_across(turned), rtol=1e-7)


def by_scale_of_its_speed(turned, begins, **how):
    """How far a slide that turns goes along the shaft by a scale of its velocity, and the truth for 1.

    Velocities v_i go as exp(-L T / m_i) in T with dt = |v| dT. Slides are as long as the squares of their speeds.
    """
    begins, masses = np.array(begins), np.array([turned, SLIDES])
    mechanism = sleeve(masses[1], masses[0], jnp.zeros(2))

    def moves(at):
        rates = begins * np.exp(-MU * GRAVITY * SLIDES * at / masses)
        return rates[1] * np.hypot(*rates)

    def way(scale):
        return rx.simulate(mechanism, at_start(mechanism, scale * begins), 1.0, ts=[1.0], **how)["joint.travel"][0]

    return way, quad(moves, 0.0, np.inf, epsabs=1e-13)[0]


@pytest.mark.slow
def test_a_stop_of_a_slide_that_turns_by_its_speed():
    # What errors of steps leave across it is more than what is left along it: friction is as before all the same.
    way, truth = by_scale_of_its_speed(4.0, (0.8, 0.3), rtol=1e-9, adjoint=diffrax.ForwardMode())
    value, slope = jax.jvp(way, (1.0,), (1.0,))
    np.testing.assert_allclose(value, truth, rtol=1e-10)
    np.testing.assert_allclose(slope, 2 * truth, rtol=1e-7)


@pytest.mark.slow
def test_reverse_mode_inside_of_jit_past_a_stop_that_turns():
    """There are fewer checkpoints than steps, which would have other lengths if they were computed again."""
    how = {"max_phases": 2, "adjoint": diffrax.RecursiveCheckpointAdjoint(4)}
    way, truth = by_scale_of_its_speed(1.0, (0.5, 0.8), **how)
    value, slope = jax.jit(jax.value_and_grad(way))(1.0)
    np.testing.assert_allclose(value, truth, rtol=1e-7)
    np.testing.assert_allclose(slope, 2 * truth, rtol=1e-7)
