"""Armature of joint coordinates: closed forms of a double pendulum and of a slide that turns, and what is refused."""

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx


def pendulum(**armature):
    """Two rods of 1 m, 1 and 2 kg."""
    joints = [
        rx.Revolute("A", "1", "ground", (-0.5, 0), (0, 0)),
        rx.Revolute("B", "2", "1", (-0.5, 0), (0.5, 0)),
    ]
    given = {f"{joint}.angle": value for joint, value in armature.items()}
    bodies = [rx.Body("1", 1.0, 0.1), rx.Body("2", 2.0, 0.2)]
    return rx.Mechanism(bodies, joints, gravity=(0, -9.81), armature=given, units=rx.units.SI)


@pytest.mark.parametrize("second", [0.3, 0.0])
def test_a_double_pendulum_with_geared_drives(second):
    """Lagrange's equations in both angles from the horizontal, with a_1 w_1^2 / 2 + a_2 (w_2 - w_1)^2 / 2."""
    mechanism, (one, two), (w1, w2) = pendulum(A=0.1, B=second), (0.4, -0.7), (1.3, -2.1)
    along = np.array([[np.cos(x), np.sin(x)] for x in (one, two)])
    across = np.array([[-np.sin(x), np.cos(x)] for x in (one, two)])
    centres = along[0] / 2, along[0] + along[1] / 2
    rates = across[0] * w1 / 2, across[0] * w1 + across[1] * w2 / 2
    state = rx.State(jnp.array([*centres[0], *centres[1], one, two]), jnp.array([*rates[0], *rates[1], w1, w2]))
    found = rx.solve(mechanism, state)
    couple, spin = np.cos(one - two), np.sin(one - two)  # m_2 l_1 l_2 / 2 = 1
    mass = np.array([[0.1 + 0.25 + 2, couple], [couple, 0.2 + 0.5]])
    mass += np.array([[0.1 + second, -second], [-second, second]])
    force = np.array([-spin * w2**2 - 9.81 * 2.5 * np.cos(one), spin * w1**2 - 9.81 * np.cos(two)])
    np.testing.assert_allclose(found.acceleration[4:], np.linalg.solve(mass, force), rtol=1e-12)


def test_a_carriage_on_a_turning_guide_feels_its_rotor_along_the_guide():
    """T = (J w^2 + m (u'^2 + u^2 w^2) + a u'^2) / 2, so (m + a) u'' = m u w^2 and (J + m u^2) w' = -2 m u u' w.

    The carriage keeps the direction of the guide, so that J is that of both.
    """
    guide, carriage = rx.Body("guide", 1.0, 0.4), rx.Body("carriage", 2.0, 0.3)
    joints = [
        rx.Revolute("H", "guide", "ground", (0, 0), (0, 0)),
        rx.Translational("S", "carriage", "guide", (0, 0), (0, 0), (0, 1)),
    ]
    mechanism = rx.Mechanism([guide, carriage], joints, armature={"S.travel": 0.7})
    angle, w, u, rate = 0.6, 1.7, 0.8, -0.9
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    state = rx.State(
        jnp.array([0, 0, *(u * along), angle, angle]), jnp.array([0, 0, *(rate * along + u * w * across), w, w])
    )
    found = rx.solve(mechanism, state)
    expected = 2 * u * w**2 / 2.7, -2 * 2 * u * rate * w / (0.4 + 0.3 + 2 * u**2)
    np.testing.assert_allclose([found["S.travel''"], found["H.angle''"]], expected, rtol=1e-12)


def test_a_print_shows_the_armature_with_its_unit():
    assert "Armature: B.angle 0.3 kg m²\n" in str(pendulum(B=0.3))
    assert "Armature" not in str(pendulum())


def test_armature_is_refused_where_it_has_no_sense():
    with pytest.raises(rx.RedundaxError, match=r"`armature`.*'C\.angle'"):
        pendulum(C=0.1)
    for value in (-0.1, np.nan, (0.1, 0.2)):
        with pytest.raises(rx.RedundaxError, match=r"Argument `armature` must hold a number for 'A\.angle'"):
            pendulum(A=value)
    with pytest.raises(rx.RedundaxError, match="`armature` couples bodies"):
        pendulum(A=0.1).sparse()
