"""Bands of rough feet that stand on surfaces askew, against linear programmes over the forces of all feet."""

import numpy as np
import pytest
from scipy.optimize import linprog

import redundax as rx

G = 9.81
# Of each foot: where it is, which way it leaves, m, and its friction coefficient. Their cones cannot hold each other.
IN_THE_PLANE = [
    ((-0.3, 0.05), (0.3, 1.0), 1.2),
    ((-0.1, -0.2), (-0.4, 1.0), 0.8),
    ((0.05, 0.1), (0.1, 1.0), 0.8),
    ((0.4, 0.0), (-0.5, 1.0), 0.3),
]
IN_SPACE = [
    ((0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.0), (0.3 * np.cos(3 * angle), 0.2 * np.sin(2 * angle), 1.0), mu)
    for angle, mu in zip(np.arange(5) * 2 * np.pi / 5, (0.5, 0.9, 0.2, 0.5, 0.9), strict=True)
]
SIDES = 128  # of the polygons in which friction is, about its circle and in it


def ends_of(weight, columns, cones):
    """Least and largest force of the first foot, of all that balance and are in cones: rows at most 0."""
    cost = np.eye(columns.shape[1])[0]
    found = [
        linprog(sign * cost, cones, np.zeros(len(cones)), columns, weight, (None, None), method="highs")
        for sign in (1.0, -1.0)
    ]
    return [sign * one.fun if one.status == 0 else sign * -np.inf for sign, one in zip((1.0, -1.0), found, strict=True)]


def test_feet_in_the_plane_bear_no_more_than_their_cones_allow():
    feet = [
        rx.PinInSlot(f"f{k}", "block", "ground", at, at, normal, friction=rx.Coulomb(mu), one_sided=True)
        for k, (at, normal, mu) in enumerate(IN_THE_PLANE)
    ]
    block = rx.Mechanism([rx.Body("block", 5.0, 1.0)], feet, gravity=(0.0, -G))
    columns, cones = [], np.zeros((8, 8))
    for k, ((x, y), normal, mu) in enumerate(IN_THE_PLANE):
        a, b = np.array(normal) / np.linalg.norm(normal)
        columns += [[a, b, x * b - y * a], [b, -a, -x * a - y * b]]
        cones[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[-mu, 1.0], [-mu, -1.0]]
    expected = ends_of([0.0, 5.0 * G, 0.0], np.transpose(columns), cones)
    assert np.all(np.isfinite(expected))
    found = rx.band(block, rx.assemble(block, {}), ["f0.perpendicular"])
    assert found.exact[0]
    np.testing.assert_allclose([found.lower[0], found.upper[0]], expected, rtol=1e-7, atol=1e-6)


def test_feet_in_space_bear_no_more_than_their_cones_allow():
    table = rx.spatial.Body("table", 5.0, inertia=(1.0, 1.0, 1.0), centre=(0.0, 0.0, 0.4))
    feet = [
        rx.spatial.PointOnPlane(f"f{k}", table, "ground", at, normal, friction=rx.Coulomb(mu), one_sided=True)
        for k, (at, normal, mu) in enumerate(IN_SPACE)
    ]
    mechanism = rx.Mechanism([table], feet, gravity=(0.0, 0.0, -G))
    columns, about, within = [], [], []
    turns = 2 * np.pi * np.arange(SIDES) / SIDES
    for k, (at, normal, mu) in enumerate(IN_SPACE):
        axis = np.array(normal) / np.linalg.norm(normal)
        across = np.linalg.svd(axis[None])[2][1:]
        columns += [[*force, *np.cross(np.array(at) - (0.0, 0.0, 0.4), force)] for force in (axis, *across)]
        for reach, rows in ((1.0, about), (np.cos(np.pi / SIDES), within)):
            part = np.zeros((SIDES, 15))
            part[:, 3 * k : 3 * k + 3] = np.stack([np.full(SIDES, -mu * reach), np.cos(turns), np.sin(turns)], axis=1)
            rows.append(part)
    weight, columns = [0.0, 0.0, 5.0 * G, 0.0, 0.0, 0.0], np.transpose(columns)
    outer, inner = (ends_of(weight, columns, np.concatenate(rows)) for rows in (about, within))
    assert np.all(np.isfinite(outer))
    found = rx.band(mechanism, rx.assemble(mechanism), ["f0.axial"])
    assert found.exact[0]
    assert outer[0] - 1e-5 < found.lower[0] < inner[0] + 1e-5
    assert inner[1] - 1e-5 < found.upper[0] < outer[1] + 1e-5


@pytest.mark.parametrize("mu", [0.5, 0.7, 0.8])
def test_feet_in_a_wedge_hold_each_other_where_friction_is_steep(mu):
    """Two feet on sides of a slot, at 35 degrees to its middle: any force from mu = tan 35 degrees = 0.7002 on."""
    a, b = np.cos(np.radians(35.0)), np.sin(np.radians(35.0))
    feet = [
        rx.PinInSlot(f"f{k}", "block", "ground", (-s, 0.0), (-s, 0.0), (s * a, b), rx.Coulomb(mu), one_sided=True)
        for k, s in enumerate((1.0, -1.0))
    ]
    block = rx.Mechanism([rx.Body("block", 5.0, 1.0)], feet, gravity=(0.0, -G))
    found = rx.band(block, rx.assemble(block, {}), ["f0.perpendicular"])
    # n b + t a = m g / 2 of each, |t| <= mu n, and the same n by the moment about the middle.
    assert found.exact[0]
    most = 5.0 * G / 2 / (b - mu * a) if mu * a < b else np.inf
    np.testing.assert_allclose([found.lower[0], found.upper[0]], [5.0 * G / 2 / (b + mu * a), most], rtol=1e-7)


@pytest.mark.parametrize("mu, stands", [(0.1, "no"), (0.25, "yes"), (0.5, "yes")])
def test_feet_that_a_motion_lifts_stand_where_friction_can_hold_them(mu, stands):
    """Two feet on sides that overhang by 0.2: they lift as it falls, or hold each other from mu = 0.2 on.

    With forces p along both normals (1, -0.2) / w and mu p up along the sides, 2 p (mu - 0.2) / w = m g at least.
    """
    feet = [
        rx.PinInSlot(f"f{k}", "block", "ground", (x, 0.0), (x, 0.0), normal, friction=rx.Coulomb(mu), one_sided=True)
        for k, (x, normal) in enumerate([(-0.3, (1.0, -0.2)), (0.3, (-1.0, -0.2))])
    ]
    block = rx.Mechanism([rx.Body("block", 5.0, 1.0)], feet, gravity=(0.0, -G))
    state = rx.assemble(block, {})
    assert set(rx.solve(block, state).contacts.values()) == {"lifts"}
    for bounds, most in ((None, np.inf), (rx.PreloadBox({"f0.perpendicular": (0.0, 1000.0)}), 1000.0)):
        found = rx.band(block, state, ["f0.perpendicular"], bounds)
        assert found.stands == stands
        assert found.empty == (stands == "no") == ("CANNOT STAND (proved)" in str(found))
        if stands == "yes":
            least = 5.0 * G * np.hypot(1.0, 0.2) / (2 * (mu - 0.2))
            np.testing.assert_allclose([found.lower[0], found.upper[0]], [least, most], rtol=1e-6)
            assert found.exact[0]
