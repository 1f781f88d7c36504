"""Pieces that rough jaws and locators hold, which only push: against closed forms and SciPy's linear programmes."""

import numpy as np
import pytest
from scipy.optimize import linprog

import redundax as rx


def test_a_block_between_jaws_that_wedges_just_so():
    """A jaw is pressed by F = 20 N against a block of half the width 50 mm, on pads 20 mm above and below the middle.

    With a coefficient of 0.4 = 20 / 50 friction at one side turns the block by as much as its pads can, so that bounds
    of friction by what presses it have no end. Each side holds 0.4 F, whatever the pads carry.
    """
    pads = {"l1": (-0.05, 0.02), "l2": (-0.05, -0.02), "r1": (0.05, 0.02), "r2": (0.05, -0.02)}
    joints = [
        rx.PinInSlot(
            name, "block", "ground" if x < 0 else "jaw", (x, y), (x, 0.0), (-np.sign(x), 0.0), rx.Coulomb(0.4), True
        )
        for name, (x, y) in pads.items()
    ]
    joints.append(rx.Translational("guide", "jaw", "ground", (0.0, 0.0), (0.0, 0.0), normal=(0.0, 1.0)))
    bodies, press = [rx.Body("block", 0.5, 1e-3), rx.Body("jaw", 0.2, 1e-4)], rx.AppliedForce("jaw", (-20.0, 0.0))
    held = rx.Mechanism(bodies, joints, loads=[press], gravity=(0.0, -9.81))
    bounds = rx.PreloadBox({f"{pad}.perpendicular": (0.0, 100.0) for pad in pads})
    found = rx.limit_load(held, rx.assemble(held, {}), {"block.y": 1.0}, bounds)
    np.testing.assert_allclose([found.lower, found.upper], 0.5 * 9.81 + np.array([-16.0, 16.0]), rtol=1e-8)
    np.testing.assert_allclose([found.outer_lower, found.outer_upper], [found.lower, found.upper], rtol=1e-6)
    bands = rx.band(held, rx.assemble(held, {}), ["r1.perpendicular"], bounds)
    np.testing.assert_allclose([bands.lower[0], bands.upper[0]], [0.0, 20.0], atol=1e-7)


MU, MIDDLE = 0.15, np.array([0.1, 0.05, 0.015])
LOCATORS = {
    "b1": ((0.02, 0.02, 0.0), (0.0, 0.0, 1.0)),
    "b2": ((0.18, 0.02, 0.0), (0.0, 0.0, 1.0)),
    "b3": ((0.1, 0.08, 0.0), (0.0, 0.0, 1.0)),
    "s1": ((0.04, 0.0, 0.015), (0.0, 1.0, 0.0)),
    "s2": ((0.16, 0.0, 0.015), (0.0, 1.0, 0.0)),
    "e1": ((0.0, 0.05, 0.015), (1.0, 0.0, 0.0)),
}
CLAMPS = [
    ((-150.0, 0.0, 0.0), (0.2, 0.05, 0.015)),
    ((0.0, -200.0, 0.0), (0.1, 0.1, 0.015)),
    ((0.0, 0.0, -300.0), (0.1, 0.05, 0.03)),
]
CUT = (1.0, 0.5, 0.8), (0.15, 0.08, 0.03)


def wrench(force, point):
    return np.concatenate([force, np.cross(np.array(point) - MIDDLE, force)])


def most_cut(share, sides=128):
    """The largest cut with friction within polygons about its discs, whose radius is a share of theirs."""
    n, columns, discs = len(LOCATORS), [], []
    for point, axis in LOCATORS.values():
        along = np.roll(axis, 1)
        columns.append([wrench(way, point) for way in (axis, along, np.cross(axis, along))])
    turns = 2 * np.pi * np.arange(sides) / sides
    for k in range(n):
        disc = np.zeros((sides, 3 * n + 1))
        disc[:, 3 * k : 3 * k + 3] = np.stack([np.full(sides, -MU * share), np.cos(turns), np.sin(turns)], axis=1)
        discs.append(disc)
    held = wrench((0.0, 0.0, -9.81 * 2.4), MIDDLE) + sum(wrench(*clamp) for clamp in CLAMPS)
    found = linprog(
        np.append(np.zeros(3 * n), -1.0),
        np.concatenate(discs),
        np.zeros(n * sides),
        np.column_stack([*np.concatenate(columns), wrench(*CUT)]),
        -held,
        [(0.0, None), (None, None), (None, None)] * n + [(0.0, None)],
    )
    return -found.fun


@pytest.mark.slow
def test_a_piece_on_six_rough_locators():
    """A cut away from the locators slides, one towards them locks: friction may be so many things that programmes in
    planes about its discs met none of them within minutes."""
    piece = rx.spatial.Body("piece", 2.4, inertia=(0.003, 0.008, 0.01), centre=tuple(MIDDLE))
    joints = [
        rx.spatial.PointOnPlane(name, piece, "ground", *at, friction=rx.Coulomb(MU), one_sided=True)
        for name, at in LOCATORS.items()
    ]
    loads = [rx.spatial.AppliedForce(piece, force, point=at) for force, at in CLAMPS]
    fixture = rx.Mechanism([piece], joints, loads=loads, gravity=(0.0, 0.0, -9.81))
    cut = rx.spatial.AppliedForce(piece, CUT[0], point=CUT[1])
    found = rx.limit_load(fixture, rx.assemble(fixture), cut)
    assert found.lower == -np.inf and "e1" in found.lifts[1]
    assert most_cut(np.cos(np.pi / 128)) - 1e-6 <= found.upper <= most_cut(1.0) + 1e-6
    assert found.outer_upper == pytest.approx(found.upper, rel=1e-5)
