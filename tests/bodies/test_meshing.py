"""Assembly of teeth: equally spaced planets between a sun and a ring, whatever their angles at the guess.

With planet k of N at the angle theta_k of its centre the teeth mesh where

    z_s (phi_s - theta_k) + z_p (phi_k - theta_k) = (z_p + 1) pi,   z_p (phi_k - theta_k) + z_r theta_k = c   (2 pi)

with one c for all k, which is so for every k where (z_s + z_r) / N is whole.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

MODULE = 0.002


def gear_set(planets: int, sun: int = 24, planet: int = 18):
    """A sun, a carrier and planets in a ring that stands; a guess with planets on their places and all angles 0."""
    distance, centre = MODULE * (sun + planet) / 2, (0.0, 0.0)
    names = [f"p{k}" for k in range(planets)]
    joints = [rx.Revolute("A", "sun", "ground", centre, centre), rx.Revolute("B", "carrier", "ground", centre, centre)]
    guess = {}
    for k, name in enumerate(names):
        place = distance * np.cos(2 * np.pi * k / planets), distance * np.sin(2 * np.pi * k / planets)
        guess |= {f"{name}.x": place[0], f"{name}.y": place[1]}
        shared = {"point_i": centre, "point_j": centre, "module": MODULE}
        joints += [
            rx.Revolute(f"C{k}", name, "carrier", centre, place),
            rx.GearPair(f"S{k}", "sun", name, teeth=(sun, planet), flank=-1, **shared),
            rx.GearPair(f"R{k}", name, "ground", teeth=(planet, -sun - 2 * planet), **shared),
        ]
    bodies = [rx.Body(name, 1.0, 1e-3) for name in ("sun", "carrier", *names)]
    return rx.Mechanism(bodies, joints, units=rx.units.SI), guess


@pytest.mark.parametrize("turned", [0.0, 0.4])
def test_planets_are_turned_into_mesh_whatever_their_angles(turned):
    """Four between 24 and 60 teeth: half of them must be turned by half a pitch, however the others stand."""
    mechanism, guess = gear_set(4)
    angles = np.random.default_rng(1).normal(size=5) if turned else np.zeros(5)
    guess |= dict(zip(("sun.phi", *(f"p{k}.phi" for k in range(4))), turned * angles, strict=True))
    state = rx.assemble(mechanism, guess)
    x, y, phi = *np.asarray(state.q[:12]).reshape(6, 2)[2:].T, np.asarray(state.q[12:])
    theta, own = np.arctan2(y, x), phi[2:]
    sun = 24 * (phi[0] - theta) + 18 * (own - theta) - 19 * np.pi
    ring = 18 * (own - theta) + 60 * theta
    np.testing.assert_allclose(np.cos(sun), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.cos(ring - ring[0]), 1.0, atol=1e-12)
    assert np.all(np.abs(own - turned * angles[1:]) < 2 * np.pi / 18)  # by less than a tooth


def test_a_guess_near_mesh_stays_as_it_is():
    mechanism, guess = gear_set(4)
    state = rx.assemble(mechanism, guess)
    near = state.q + 1e-3
    np.testing.assert_array_equal(mechanism.start(near, state.t), near)
    slope = jax.jacfwd(lambda q: mechanism.start(q, state.t))(jnp.zeros(18))
    np.testing.assert_array_equal(slope, np.eye(18))


def test_planets_that_do_not_divide_the_teeth_are_told():
    mechanism, guess = gear_set(5)
    words = r"teeth by .* m \(p\d on ground\).* 5 planets spaced evenly .* 5 does not divide 24 \+ 60 teeth"
    with pytest.raises(rx.NoSolutionError, match=words):
        rx.assemble(mechanism, guess)
