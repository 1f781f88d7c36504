"""Machines at rest whose friction grows with the loads that it causes, against closed forms and linear programmes of
their own: they stand where a search from no friction ends in slip, and bear loads up to a gap and beyond it."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

import redundax as rx

REST = rx.State(jnp.zeros(3), jnp.zeros(3))


def ram(force, mu=0.2, moment=0.0, off=0.0, length=0.05):
    """A block in one guide along y, at `off` beside its centre of mass."""
    guide = {"normal": (1.0, 0.0), "guide_length": length, "friction": rx.Coulomb(mu)}
    joint = rx.Translational("G", "ram", "ground", (off, 0.0), (off, 0.0), **guide)
    return rx.Mechanism([rx.Body("ram", 1.0, 0.01)], [joint], loads=[rx.AppliedForce("ram", force, moment=moment)])


def test_a_block_in_a_guide_beside_its_centre_stands_as_its_guide_holds_it():
    """|P| <= mu max(|N|, 2 |M| / L); it may slip besides, in several ways, as the guide carries what slows it."""
    random = np.random.default_rng(0)
    for _ in range(20):
        off, length, mu = random.uniform(0.05, 0.4), random.uniform(0.03, 0.2), random.uniform(0.1, 0.4)
        (across, along), moment = random.normal(size=2) * 10, random.normal() * 2
        stands = abs(along) <= mu * max(abs(across), 2 * abs(moment - off * along) / length)
        found = rx.sticking(ram((across, along), mu, moment, off, length), REST)
        assert (found.verdict != "must slip") == stands


def ladder(angle, friction, force, moment, way):
    """A rod of 1 m between a floor and a wall with its normal at `way`, both of which hold it either way; whether
    friction can hold it, by the signs of both loads."""
    foot, normal = -np.array([np.cos(angle), np.sin(angle)]) / 2, np.array([np.cos(way), np.sin(way)])
    columns = []
    ends = ((foot, np.array([0.0, 1.0])), (-foot, normal))
    for place, out in ends:
        columns += [[*to, place[0] * to[1] - place[1] * to[0]] for to in (out, np.array([out[1], -out[0]]))]
    stands = False
    for signs in itertools.product((1, -1), repeat=2):
        rows = np.zeros((3, 2, 4))
        for k, (mu, sign) in enumerate(zip(friction, signs, strict=True)):
            rows[:, k, 2 * k] = -mu * sign, -mu * sign, -sign
            rows[:2, k, 2 * k + 1] = 1, -1
        given = np.transpose(columns), -np.append(force, moment)
        stands |= linprog(np.zeros(4), rows.reshape(6, 4), np.zeros(6), *given, bounds=(None, None)).status == 0
    joints = [
        rx.PinInSlot(name, "rod", "ground", (side, 0.0), tuple(place), tuple(out), friction=rx.Coulomb(mu))
        for name, side, (place, out), mu in zip("FW", (-0.5, 0.5), ends, friction, strict=True)
    ]
    rod = rx.Mechanism([rx.Body("rod", 1.0, 0.1)], joints, loads=[rx.AppliedForce("rod", tuple(force), moment=moment)])
    return rod, rx.State([0.0, 0.0, angle], np.zeros(3)), stands


@pytest.mark.slow
def test_ladders_stand_wherever_friction_can_hold_them():
    random = np.random.default_rng(0)
    for _ in range(26):
        angle, friction = random.uniform(-1.5, 1.5), random.uniform(0.1, 0.9, 2)
        force, moment, way = random.normal(size=2) * 10, random.normal() * 2, random.uniform(-3, 3)
        rod, state, stands = ladder(angle, friction, force, moment, way)
        assert (rx.sticking(rod, state).verdict != "must slip") == stands


def test_a_load_that_first_lifts_what_presses_is_borne_up_to_a_narrow_gap():
    """|9.8 + 0.1 s| <= 0.2 |100 + s| but for s from -102 to -298 / 3, between amounts without end."""
    found = rx.limit_load(ram((100.0, 9.8)), REST, {"ram.x": 1.0, "ram.y": 0.1})
    assert found.lower == pytest.approx(-298 / 3, rel=1e-9) and found.upper == np.inf
    assert -298 / 3 * (1 + 1e-6) < found.outer_lower <= found.lower
    assert -102 < found.looked[0] < -100
