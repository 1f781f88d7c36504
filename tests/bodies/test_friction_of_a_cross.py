"""Friction of the two pins of a universal joint, each a bearing of its own."""

import numpy as np
import pytest

import redundax as rx

rs = rx.spatial
MU, RADIUS, LENGTH, THRUST, MASS = 0.2, 0.01, 0.06, 0.008, 2.0
ANGLES, RATES = {"cross.angle_1": 0.4, "cross.angle_2": -0.7}, {"cross.angle_1": 2.0, "cross.angle_2": -3.0}


def hung(friction=None, **given):
    """A body on a cross, with a force and a moment on it."""
    body = rs.Body("body", MASS, (0.03, 0.04, 0.05), centre=(0.1, -0.05, -0.3))
    rubs = {"pin_radius": RADIUS, "bearing_length": LENGTH, "thrust_radius": THRUST}
    rubs |= {"friction": rx.Coulomb(MU) if friction is None else friction, **given}
    cross = rs.Universal("cross", body, rx.GROUND, (0, 0, 0), axis_i=(0.6, 0.8, 0), axis_j=(-0.8, 0.6, 0), **rubs)
    push = rs.AppliedForce("body", (3.0, -12.0, 5.0), moment=(0.4, 0.2, 1.5))
    return rx.Mechanism([body], [cross], loads=[push], gravity=(0, 0, -9.81))


def pins(mechanism, found):
    """Directions of both pins and the normal of the cross, global components."""
    axes = np.asarray(mechanism.poses(found.state.q).axes)
    z_i, z_j = axes[0] @ [0.6, 0.8, 0.0], np.array([-0.8, 0.6, 0.0])
    return z_i, z_j, np.cross(z_i, z_j)


def pressed(force, moment, pin):
    """mu times radius times load of one pin by the force and moment on the body, global components."""
    radial, axial = force - (force @ pin) * pin, force @ pin
    c = np.cross(pin, moment) / LENGTH
    ends = sum(np.linalg.norm(radial / 2 + sign * c) for sign in (1, -1))
    return MU * (RADIUS * ends + THRUST * abs(axial))


@pytest.mark.slow
def test_each_pin_has_the_friction_of_its_own_load():
    """And work of friction is what the kinetic energy lacks."""
    mechanism = hung()
    found = rx.solve(mechanism, rx.assemble(mechanism, positions=ANGLES, rates=RATES))
    z_i, z_j, normal = pins(mechanism, found)
    force, moment = (
        np.array([found[f"cross {part} {axis} on body"] for axis in "xyz"]) for part in ("force", "moment")
    )
    moment = (moment @ normal) * normal  # of the constraint; friction is not in reactions
    expected = [-pressed(force, moment, z_j), pressed(force, moment, z_i)]
    np.testing.assert_allclose([found["tau cross.angle_1"], found["tau cross.angle_2"]], expected, rtol=1e-12)
    assert abs(expected[0]) > 0.1 and abs(expected[1] / expected[0] + 1) > 0.1
    smooth = rx.solve(hung(rx.ConstantFriction(0.0)), found.state)
    power = found.state.qd @ np.asarray(mechanism.mass(found.state.q, found.state.t))
    lost = power @ (found.acceleration - smooth.acceleration)
    np.testing.assert_allclose(lost, expected[0] * 2.0 + expected[1] * -3.0, rtol=1e-11)


@pytest.mark.slow
def test_bristles_of_the_pins_bend_apart():
    mechanism = hung(rx.Dahl(MU, 300.0))
    start = rx.assemble(mechanism, positions=ANGLES, rates=RATES)
    (group,) = mechanism.friction
    rates = group.memory_rate(
        np.array([2.0, -3.0]) + 0 * start.qd[:2], 1e-4 * np.ones((1, 2)) + 0 * start.qd[:2], start
    )
    own = [rx.Dahl(MU, 300.0).about(start.t + RADIUS).memory_rate(start.t + r, start.t + 1e-4) for r in (2.0, -3.0)]
    np.testing.assert_allclose(np.ravel(rates), own, rtol=1e-13)


@pytest.mark.parametrize(("moment", "verdict"), [(0.99, "must stick"), (1.01, "must slip")])
@pytest.mark.slow
def test_a_pin_gives_way_by_itself(moment, verdict):
    """Pulled along the normal of the cross by 500 N a pin holds mu R 500 N, whatever holds the other."""
    body = rs.Body("body", MASS, (0.03, 0.04, 0.05))
    rubs = {"pin_radius": RADIUS, "bearing_length": LENGTH, "thrust_radius": THRUST, "friction": rx.Coulomb(MU)}
    cross = rs.Universal("cross", body, rx.GROUND, (0, 0, 0), axis_i=(1, 0, 0), axis_j=(0, 1, 0), **rubs)
    pull = rs.AppliedForce("body", (0, 0, -500.0), moment=(0, moment * MU * RADIUS * 500.0, 0))
    mechanism = rx.Mechanism([body], [cross], loads=[pull])
    found = rx.sticking(mechanism, rx.assemble(mechanism))
    told = dict(zip(found.names, found.slip_verdicts, strict=True))
    assert told["cross.angle_1"] == verdict and told["cross.angle_2"] == "must stick"
    assert found.proved
