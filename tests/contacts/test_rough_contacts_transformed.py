"""Motions with contacts that rub under `jit`, `vmap` and derivatives, against closed forms."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

import redundax as rx

pytestmark = pytest.mark.slow
G = 9.81


def thrown(figures, **more):
    """A particle of 2 kg is thrown along a rough floor: where it is after 0.5 s, how fast, when it strikes, and the
    energy that that takes, by coefficient, velocity and height."""
    mu, speed, height = figures
    foot = rx.PinInSlot("foot", "b", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), rx.Coulomb(mu), one_sided=True)
    particle = rx.Mechanism([rx.Body("b", 2.0, 0.1)], [foot], gravity=(0.0, -G))
    zero = 0.0 * mu
    start = rx.State(jnp.stack([zero, height, zero]), jnp.stack([speed, zero, zero]))
    motion = rx.simulate(particle, start, 0.5, ts=[0.5], rtol=1e-10, max_phases=4, throw=False, **more)
    return jnp.stack([motion.q[0, 0], motion.qd[0, 0], motion.impacts.t[0], motion.impacts.energy[0]])


def by_hand(figures):
    """The impact of m g t takes mu g t of the velocity, and friction the rest."""
    mu, speed, height = figures
    fall = jnp.sqrt(2 * height / G)
    after = speed - mu * G * fall
    since = jnp.minimum(0.5 - fall, after / (mu * G))
    lost = (G * fall) ** 2 + speed**2 - after**2
    return jnp.stack([speed * fall + after * since - mu * G * since**2 / 2, after - mu * G * since, fall, lost])


REST, SLIDE = jnp.array([0.4, 1.2, 0.1]), jnp.array([0.2, 1.5, 0.1])


def test_batches_and_derivatives_across_an_impact_and_to_rest():
    forward = diffrax.ForwardMode()
    many = jnp.stack([REST, SLIDE, jnp.array([0.4, 1.2, 0.2]), jnp.array([0.4, 1.2, 2.0])])

    def both(figures):
        change = lambda x: (thrown(x, adjoint=forward),) * 2  # noqa: E731
        return jax.jacfwd(change, has_aux=True)(figures)

    slopes, found = jax.jit(jax.vmap(both))(many)
    np.testing.assert_allclose(found[:3], jax.vmap(by_hand)(many[:3]), rtol=0, atol=1e-9)
    np.testing.assert_allclose(slopes[:3], jax.vmap(jax.jacfwd(by_hand))(many[:3]), rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(found[3, :2], [0.6, 1.2], rtol=1e-12)  # still falls
    assert jnp.isnan(found[3, 2])
    for one, figures in zip(found[:2], many, strict=False):  # known numbers
        np.testing.assert_allclose(thrown(figures), one, rtol=0, atol=1e-9)


def test_gradients_across_an_impact_and_to_rest():
    reverse = jax.jit(jax.grad(lambda x: thrown(x)[0]))(REST)
    np.testing.assert_allclose(reverse, jax.grad(lambda x: by_hand(x)[0])(REST), rtol=1e-8)


def test_derivatives_across_an_impact_at_which_feet_stick():
    """A block turns about one foot, and lands on the other, which holds it: Housner's law. By tilt and mass.

    Then (I + m 0.34) phi'^2 / 2 = m g (h - 0.5), of which the landing leaves a part.
    """

    def lands(tilt, mass):
        feet = [
            rx.PinInSlot(name, "block", "ground", (x, -0.5), (0, 0), (0, 1), rx.Coulomb(0.9), one_sided=True)
            for name, x in (("f1", -0.3), ("f2", 0.3))
        ]
        block = rx.Mechanism([rx.Body("block", mass, 0.2)], feet, gravity=(0.0, -G))
        place = jnp.stack([0.3 * jnp.cos(tilt) - 0.5 * jnp.sin(tilt) - 0.3, height(tilt), tilt])
        start = rx.State(place, jnp.zeros(3))
        forward = diffrax.ForwardMode()
        motion = rx.simulate(block, start, 0.4, ts=[0.4], rtol=1e-10, max_phases=6, throw=False, adjoint=forward)
        return jnp.stack([motion.impacts.t[0], motion.impacts.energy[0], *motion.impacts.impulses[0]])

    def height(tilt):
        return 0.3 * jnp.sin(tilt) + 0.5 * jnp.cos(tilt)

    def truth(tilt, mass):
        inertia = 0.2 + mass * 0.34
        part = (0.2 + mass * 0.16) / inertia
        rate = np.sqrt(2 * mass * G * (height(tilt) - 0.5) / inertia)
        # Time from rest at `tilt`, with phi = tilt - s^2 to take the root out.
        slope = lambda s: 2 * s / np.sqrt(2 * mass * G * (height(tilt) - height(tilt - s * s)) / inertia)  # noqa: E731
        time = quad(slope, 0.0, np.sqrt(tilt), epsabs=1e-13, epsrel=1e-13)[0]
        # Before it the centre falls by 0.3 phi', after it rises by a part of that: f1 lifts, f2 takes all of it.
        return np.array([time, inertia / 2 * rate**2 * (1 - part**2), 0.0, mass * 0.3 * rate * (1 + part)])

    at = 0.1, 3.0
    values, tangents = jax.jit(jax.vmap(lambda one: jax.jvp(lands, at, (one[0], one[1]))))(jnp.eye(2))
    np.testing.assert_allclose(values[0], truth(*at), rtol=1e-8, atol=1e-9)
    for k, found in enumerate(tangents):
        step = 1e-4 * np.eye(2)[k] * at[k]
        sides = [truth(*(np.array(at) + s * step)) for s in (-2, -1, 1, 2)]
        slope = (sides[0] - 8 * sides[1] + 8 * sides[2] - sides[3]) / (12 * step[k])
        np.testing.assert_allclose(found, slope, rtol=1e-6, atol=1e-7)


def test_derivatives_across_an_impact_that_slides_askew_in_space():
    """A particle that strikes a floor slides on the way it went, v (1 - mu g t / |v|), which turns with velocities."""

    def thrown(figures):
        mu, *velocity = figures
        body = rx.spatial.Body("b", 2.0, inertia=(0.1, 0.2, 0.3))
        rough = {"friction": rx.Coulomb(mu), "one_sided": True}
        foot = rx.spatial.PointOnPlane("foot", body, "ground", (0.0, 0.0, 0.0), (0, 0, 1), **rough)
        particle = rx.Mechanism([body], [foot], gravity=(0.0, 0.0, -G))
        start = rx.State(jnp.eye(7)[3].at[2].set(0.05), jnp.stack([*velocity, *[0.0 * mu] * 4]))
        forward = diffrax.ForwardMode()
        return rx.simulate(particle, start, 0.2, ts=[0.2], max_phases=3, throw=False, adjoint=forward).qd[0, :2]

    def by_hand(figures):
        mu, *velocity = figures
        velocity = jnp.stack(velocity)
        return velocity * (1 - mu * G * 0.2 / jnp.linalg.norm(velocity))

    at = jnp.array([0.3, 1.2, -0.7])
    slopes, found = jax.jit(jax.jacfwd(lambda x: (thrown(x),) * 2, has_aux=True))(at)
    np.testing.assert_allclose(found, by_hand(at), rtol=1e-8)
    np.testing.assert_allclose(slopes, jax.jacfwd(by_hand)(at), rtol=1e-7)
