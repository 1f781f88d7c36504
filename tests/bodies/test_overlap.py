"""Guides that a slider leaves as it travels, against closed forms."""

import numpy as np
import pytest

import redundax as rx

rs = rx.spatial
MASS, MU, START = 4.0, 0.3, 0.4  # kg; m, that the drawer is in its rails at travel 0
RUNS = rs.Overlap(slider=(-0.25, 0.3), guide=(-0.6, 0.15))


def drawer(*loads, mu=MU, joint=rs.Prismatic, **at):
    """A drawer on rails along x, whose end is 0.15 beyond its middle: 0.4 - x of it are in them."""
    body = rs.Body("drawer", MASS, (0.1, 0.2, 0.3))
    sizes = {"friction": rx.Coulomb(mu)}
    if joint is rs.Prismatic:
        sizes |= {"guide_length": RUNS, "twist_radius": 0.1}
    else:
        sizes |= {"bearing_length": RUNS, "shaft_radius": 0.02}
    rails = joint("rails", body, rx.GROUND, point=(0, 0, 0), axis=(1, 0, 0), **sizes)
    mechanism = rx.Mechanism([body], [rails], loads=list(loads))
    at = {"travel": 0.0, "rate": 0.0, **at}
    state = rx.assemble(mechanism, positions={"rails.travel": at["travel"]}, rates={"rails.travel": at["rate"]})
    return mechanism, state


@pytest.mark.parametrize("travel", [-0.3, 0.1, 0.35])
@pytest.mark.parametrize("joint", [rs.Prismatic, pytest.param(rs.Cylindrical, marks=pytest.mark.slow)])
def test_a_weight_in_front_of_its_rails(travel, joint):
    """At the middle of what is in the rails: N = W (|1/2 + e / L| + |1/2 - e / L|)."""
    weight, front = 50.0, 0.2
    load = rs.AppliedForce("drawer", (0, 0, -weight), on_i=(front, 0, 0))
    mechanism, state = drawer(load, joint=joint, travel=travel, rate=0.5)
    first, last = max(-0.25, -0.6 - travel), min(0.3, 0.15 - travel)
    lever = (front - (first + last) / 2) / (last - first)
    pressed = weight * (abs(0.5 + lever) + abs(0.5 - lever))
    found = rx.solve(mechanism, state)
    np.testing.assert_allclose(found["rails.travel''"], -MU * pressed / MASS, rtol=1e-12)


@pytest.mark.parametrize("share", [1 - 1e-6, 1 + 1e-6])
def test_a_drawer_jams_where_too_little_of_it_is_in_its_rails(share):
    """Pulled at an arm a to the side it jams beyond mu = L / (2 a), that is from L = 2 mu a on."""
    arm = 0.25
    travel = START - 2 * MU * arm * share
    pull = rs.AppliedForce("drawer", (30.0, 0, 0), on_i=(0, 0.15, 0.2))
    found = rx.sticking(*drawer(pull, travel=travel))
    assert (found.verdict, found.proved) == ("must slip" if share > 1 else "must stick", True)


def test_what_is_out_of_its_rails_has_no_friction_that_is_known():
    load = rs.AppliedForce("drawer", (0, 0, -50.0), on_i=(0.2, 0, 0))
    mechanism, state = drawer(load, travel=0.5, rate=0.1)
    assert rx.solve(mechanism, state, throw=False).result == rx.RESULTS.not_finite


@pytest.mark.slow
def test_a_drawer_is_pulled_until_it_jams():
    """m v^2 / 2 = P (x - 2 mu a ln(L_0 / L)), to where that is none again."""
    pull, arm = 20.0, 0.25
    mechanism, state = drawer(rs.AppliedForce("drawer", (pull, 0, 0), on_i=(0, arm, 0)))
    times = np.linspace(0.0, 1.0, 11)[1:]
    run = rx.simulate(mechanism, state, 1.0, ts=times, rtol=1e-10, throw=False)
    way, speed = run["rails.travel"], run["rails.travel'"]
    energy = pull * (way - 2 * MU * arm * np.log(START / (START - way)))
    np.testing.assert_allclose(MASS * speed**2 / 2, energy, rtol=0, atol=1e-7)
    assert run.result == rx.RESULTS.stuck
    assert START - 2 * MU * arm < way[-1] < START and speed[-1] == 0


@pytest.mark.parametrize("ends", [(0.1, 0.1), (0.2, -0.2), (0.1, 0.2, 0.3)])
def test_ends_in_their_order(ends):
    with pytest.raises(rx.RedundaxError, match=r"`guide` must be two finite positions.*the smaller first"):
        rs.Overlap((-0.1, 0.1), ends)
