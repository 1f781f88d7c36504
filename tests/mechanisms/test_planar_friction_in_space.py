"""Planar mechanisms with friction built of spatial parts: accelerations, friction, stick and slip, rest."""

import numpy as np
import pytest
import spaces
from mechanisms import CASES as PLANAR
from test_mechanisms import pieces

import redundax as rx


def in_space(state):
    return rx.State(spaces.position_in_space(state.q), spaces.velocity_in_space(state.qd), state.t)


def close(value, truth, tolerance):
    return np.max(np.abs(np.asarray(value) - truth)) <= tolerance * np.max(np.abs(truth))


# Planar mechanisms in space -----------------------------------------------------------------

RUBBING = ("doubled four-bar", "slider-crank, two guides", "wojtyra2020")


@pytest.mark.parametrize("name", [RUBBING[0], *(pytest.param(name, marks=pytest.mark.slow) for name in RUBBING[1:])])
def test_planar_friction(name):
    """Accelerations, friction, and the bound of contraction."""
    bodies, joints, rest = pieces(PLANAR[name], friction=True)
    gravity, state = np.asarray(rest["gravity"]), PLANAR[name].state
    planar, mechanism = rx.Mechanism(bodies, joints, gravity=gravity), spaces.lifted(bodies, joints, gravity)
    first, second = rx.solve(planar, state), rx.solve(mechanism, in_space(state))
    assert np.max(np.abs(first.friction)) > 1e-2
    assert close(second.acceleration, spaces.velocity_in_space(first.acceleration), 1e-11)
    friction = dict(zip(mechanism.slips.labels, second.friction, strict=True))
    assert close([friction[label] for label in planar.slips.labels], first.friction, 1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("model", [rx.Coulomb(0.2), rx.Stribeck(0.3, 0.2, 1e-3, 5.0), rx.LuGre(0.3, 0.2, 1e-2, 300.0)])
def test_planar_stick_slip(model):
    """Reversals of single joints are at the same times: all that follows hangs on them."""
    bodies, pins = spaces.rods(model)
    gravity = np.array([0.0, -9.81])
    planar, mechanism = rx.Mechanism(bodies, pins, gravity=gravity), spaces.lifted(bodies, pins, gravity)
    state = spaces.swinging(planar)
    times = np.linspace(0.0, 1.0, 6)
    first = rx.simulate(planar, state, 1.0, ts=times, rtol=1e-10)
    second = rx.simulate(mechanism, in_space(state), 1.0, ts=times, rtol=1e-10)
    assert first.stats.phases == second.stats.phases
    assert first.stats.phases > 4 or not model.has_sense
    assert close(second.qd, spaces.velocity_in_space(first.qd), 1e-8)
    assert close(second.friction, first.friction, 1e-7)


@pytest.mark.slow
def test_planar_rest():
    """It comes to rest for good at the same time."""
    bodies, joints, rest = pieces(PLANAR["wojtyra2020"], friction=True)
    gravity, state = np.asarray(rest["gravity"]), PLANAR["wojtyra2020"].state
    planar, mechanism = rx.Mechanism(bodies, joints, gravity=gravity), spaces.lifted(bodies, joints, gravity)
    first = rx.simulate(planar, state, 10.0, ts=[10.0], rtol=1e-10, throw=False)
    second = rx.simulate(mechanism, in_space(state), 10.0, ts=[10.0], rtol=1e-10, throw=False)
    assert first.result == second.result == rx.RESULTS.stuck
    assert first.stats.phases == second.stats.phases
    assert abs(first.stats.end - second.stats.end) < 1e-8
