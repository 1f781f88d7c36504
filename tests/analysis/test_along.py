"""What is unique along a motion."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

UNIQUE = rx.Verdict.UNIQUE


def turning(mechanism, start, rate, times, end=1.0):
    """States of a mechanism whose crank turns at a constant rate."""
    t = np.linspace(0.0, end, times)
    states = [mechanism.state(phi=start + rate * time, rate=rate) for time in t]
    q, qd = (jnp.stack([getattr(state, name) for state in states]) for name in ("q", "qd"))
    return rx.State(q, qd, t)


@pytest.fixture(scope="module")
def flat():
    """Three cranks through two flat positions, at t = (pi - 0.7) / 5 and (2 pi - 0.7) / 5."""
    mechanism = rx.mechanisms.parallelogram(cranks=3)
    return rx.analyze_along(mechanism, turning(mechanism, 0.7, 5.0, 21, end=1.2))


def test_positions_between_the_states_at_which_the_rank_drops(flat):
    assert np.all(flat.rank == 11)
    assert all(found.drops for found in flat.narrow)
    np.testing.assert_allclose([found.t for found in flat.narrow], [(k * np.pi - 0.7) / 5 for k in (1, 2)], atol=1e-5)
    np.testing.assert_allclose(flat.narrow[0].q[2 * 4], np.pi, atol=1e-4)
    assert "t = 0.488319: the rank drops" in str(flat)


def test_positions_are_found_between_states_of_one_time():
    """A sweep over configurations has no times."""
    mechanism = rx.mechanisms.parallelogram(cranks=2)
    states = [mechanism.state(phi, rate=1.0) for phi in (-0.5, -0.2, 0.3, 0.6)]
    found = rx.analyze_along(mechanism, jax.tree.map(lambda *x: jnp.stack(x), *states)).narrow
    assert [one.drops for one in found] == [True]
    assert abs(found[0].q[6]) < 1e-7


def test_a_pin_carries_no_moment_at_any_state(flat):
    pins = [name for name in flat.always("reaction", rx.Verdict.ZERO) if " moment " in name]
    assert len(pins) == 6
    assert flat.changes == ()


@pytest.mark.slow
def test_a_release_is_as_good_as_at_its_worst_position():
    mechanism = rx.mechanisms.wojtyra2020()
    found = rx.analyze_along(mechanism, turning(mechanism, np.pi / 4, 1.0, 4, end=0.6))
    assert found.narrow == ()
    assert {"K.perpendicular", "L.perpendicular"} == set(found.always("multiplier", UNIQUE))
    guide = (("K", {"K.angle": 1.0}),)
    listed = [release.determinant for r in found.reports for release in r.releases if release.directions == guide]
    ours = [release.determinant for release in found.releases if release.directions == guide]
    assert len(listed) == 4
    assert ours == pytest.approx([min(listed)])
    assert "Nothing changes." in str(found)


def test_coming_to_rest_changes_what_is_known():
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    states = [mechanism.state(phi=np.pi / 4, rate=rate) for rate in (0.1, 0.0)]
    q, qd = (jnp.stack([getattr(state, name) for state in states]) for name in ("q", "qd"))
    found = rx.analyze_along(mechanism, rx.State(q, qd, np.array([0.0, 0.1])))
    crank = [change for change in found.changes if change.name == "acceleration 1.phi''"]
    assert [(change.before, change.after) for change in crank] == [("not unique", "undecided")]
    assert any(change.name == "rest" for change in found.changes)
    assert found.to_dict()["changes"][0]["end"] == 0.1


def test_bad_states_are_told():
    mechanism = rx.mechanisms.parallelogram(cranks=3)
    one = mechanism.state(phi=0.7, rate=1.0)
    with pytest.raises(rx.RedundaxError, match="`states` must hold several states"):
        rx.analyze_along(mechanism, one)
    lost = jax.tree.map(lambda x: jnp.stack([x, jnp.full_like(x, jnp.nan)]), one)
    with pytest.raises(rx.RedundaxError, match="`states` must hold two finite states"):
        rx.analyze_along(mechanism, lost)
