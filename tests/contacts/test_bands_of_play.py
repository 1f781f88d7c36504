"""Bands of joints whose play is at most so much, against linear programmes of all sides, closed forms and solves."""

import dataclasses
import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog
from test_play import PLATE, REST, X, beam, closure, of_pins

import redundax as rx

COMPLIANCE = np.array([1.0, 0.6, 1.7, 0.8]) * 1e-6


def by_all_sides(one_sided, misfit, clearance, force, at):
    """Least and largest load of each support over [u; lam; r]: r = d + J u - W lam, side by side of all of them."""
    J, k = np.stack([-np.ones(4), -X], axis=1), 4
    balance = np.hstack([np.zeros((2, 2)), J.T, np.zeros((2, k))])  # J^T lam is the load, as multipliers pull down
    fits = np.hstack([J, -np.diag(COMPLIANCE), -np.eye(k)])
    equal, right = np.vstack([balance, fits * 1e6]), np.r_[force, force * at, -misfit * 1e6]
    found = []
    for sides in itertools.product((1, -1), repeat=k):
        loads, gaps = [], []
        for push, side, c in zip(one_sided, sides, clearance, strict=True):
            if push:  # it carries, or is open
                loads.append((0, None) if side > 0 else (0, 0))
                gaps.append((0, c) if side > 0 else (None, c))
            else:
                loads.append((0, None) if side > 0 else (None, 0))
                gaps.append((0, c) if side > 0 else (-c, 0))
        bounds = [(None, None)] * 2 + loads + gaps
        for sign, row in itertools.product((1, -1), range(k)):
            cost = np.zeros(2 + 2 * k)
            cost[2 + row] = sign
            end = linprog(cost, A_eq=equal, b_eq=right, bounds=bounds)
            if end.status == 0:
                found.append((row, sign, sign * end.fun))
    return np.array(
        [
            [min(v for r, s, v in found if (r, s) == (row, 1)) for row in range(k)],
            [max(v for r, s, v in found if (r, s) == (row, -1)) for row in range(k)],
        ]
    )


@pytest.mark.parametrize(
    "one_sided",
    [(True, False, True, False), *(pytest.param((all_of,) * 4, marks=pytest.mark.slow) for all_of in (False, True))],
)
def test_bands_of_beams_against_programmes_of_all_sides(one_sided):
    rng, names = np.random.default_rng(5), [f"s{k}.perpendicular" for k in range(4)]
    touched = False
    for _ in range(2):
        misfit, clearance = rng.normal(size=4) * 2e-5, rng.uniform(0, 3e-5, 4)
        at, force = rng.uniform(-0.6, 0.7), rng.uniform(-40, -10)
        mechanism = beam(X, one_sided, force, at)
        bands = rx.band(mechanism, REST, names, closure(mechanism, COMPLIANCE, misfit, clearance))
        truth = by_all_sides(one_sided, misfit, clearance, force, at)
        np.testing.assert_allclose([bands.lower, bands.upper], truth, rtol=1e-6, atol=1e-5)
        assert bands.exact.all()
        touched |= bool((np.abs(truth) < 1e-9).any())
    assert touched


def test_a_closure_of_contacts_without_play_gives_what_solve_does():
    """A support that is too short carries nothing: the band of one case is its load."""
    mechanism = beam(X, (True,) * 4, -20.0, 0.2)
    misfit = np.array([0.0, -1e-3, 0.0, 0.0])
    joints = closure(mechanism, COMPLIANCE, misfit, np.zeros(4))
    names = [f"s{k}.perpendicular" for k in range(4)]
    bands, solution = rx.band(mechanism, REST, names, joints), rx.solve(mechanism, REST, closure=joints)
    expected = [float(solution[name]) for name in names]
    assert abs(min(expected)) < 1e-12
    np.testing.assert_allclose([bands.lower, bands.upper], [expected] * 2, rtol=1e-7, atol=1e-7)


def test_a_rod_that_is_too_long_takes_what_play_leaves():
    """Two pins, 30 um too far apart by more or less 5 um, with 0.5 um/N: (d - 2 c)/w at least, d/w at most."""
    pins = [rx.Revolute(name, "rod", "ground", (x, 0.0), (x, 0.0)) for name, x in (("A", -0.5), ("B", 0.5))]
    mechanism = rx.Mechanism([rx.Body("rod", 1.0, 0.1)], pins)
    soft = [rx.JointCompliance("A", 2e-7), rx.JointCompliance("B", 3e-7, misfit=(3e-5, 0.0, 0.0))]
    for play in (1e-5, 2e-5):
        joints = rx.ElasticJoints(mechanism, soft, play={"A": play, "B": play})
        bands = rx.band(mechanism, REST, "B.x", rx.MisfitBox(joints, {"B.x": (2.5e-5, 3.5e-5)}))
        least = max(2.5e-5 - 2 * play, 0.0) / 5e-7
        np.testing.assert_allclose([bands.lower[0], bands.upper[0]], [least, 70.0], rtol=1e-7, atol=1e-6)
        assert bands.parameters == ("B.x", "play A", "play B")
        np.testing.assert_allclose(bands.upper_case, [[3.5e-5, 0.0, 0.0]], atol=1e-12)
        assert f"play A 0 to {play:.4g}" in str(bands)


def test_pins_in_holes_carry_what_any_clearance_lets_them():
    """Discs: every solve of a clearance within is inside of the outer bounds, and inner and outer ones are near."""
    most, rng = np.array([1e-5, 2e-5, 1e-5]), np.random.default_rng(2)
    misfit = np.array([[1e-5, 0.0], [0.0, 2e-5], [0.0, -1e-5]])
    names = ["A.x", "B.y"]
    bands = rx.band(PLATE, REST, names, of_pins(most, misfit))
    width = bands.upper - bands.lower
    assert (bands.outer_upper - bands.upper < 1e-3 * width).all()
    assert (bands.lower - bands.outer_lower < 1e-3 * width).all()
    cases = [*itertools.product((0.0, 1.0), repeat=3), *rng.random((4, 3))]
    loads = []
    for case in cases:
        solution = rx.solve(PLATE, REST, closure=of_pins(most * np.array(case), misfit))
        loads.append([float(solution[name]) for name in names])
    assert (np.min(loads, axis=0) >= bands.outer_lower - 1e-9).all()
    assert (np.max(loads, axis=0) <= bands.outer_upper + 1e-9).all()
    for k, case in enumerate(bands.upper_case):
        solution = rx.solve(PLATE, REST, closure=of_pins(case, misfit))
        np.testing.assert_allclose(float(solution[names[k]]), bands.upper[k], rtol=1e-6)


def test_a_hole_that_is_off_to_any_side_bounds_loads_by_a_disc():
    """A plate on three pins of 1 um/N: springs between it and the ground, lam_i = (d_i - u - phi x p_i) / w.

    Loads are linear in misfits, lam = G d: those of a disc of 20 um and a box of 5 um add r |G_A| + 5 um |G_B|.
    """
    at, w = np.array([[-0.5, 0.0], [0.5, 0.0], [0.1, 0.4]]), 1e-6
    names = "ABC"
    pins = [rx.Revolute(name, "plate", "ground", tuple(p), tuple(p)) for name, p in zip(names, at, strict=True)]
    mechanism = rx.Mechanism([rx.Body("plate", 1.0, 0.1)], pins)
    rigid = np.concatenate([[[1.0, 0.0, -y], [0.0, 1.0, x]] for x, y in at])
    gain = (np.eye(6) - rigid @ np.linalg.pinv(rigid)) / w
    own = np.zeros((3, 3))
    own[0, :2] = 3e-6, -4e-6
    joints = rx.ElasticJoints(
        mechanism, [rx.JointCompliance(n, w, misfit=tuple(d)) for n, d in zip(names, own, strict=True)]
    )
    outputs = [f"{name}.{axis}" for name in names for axis in "xy"]
    bounds = rx.MisfitBox(joints, {"B.y": (-5e-6, 5e-6)}, radial={"A": 20e-6})
    bands = rx.band(mechanism, REST, outputs, bounds)
    middle = gain @ own[:, :2].ravel()
    reach = 20e-6 * np.linalg.norm(gain[:, :2], axis=1) + 5e-6 * np.abs(gain[:, 3])
    np.testing.assert_allclose([bands.lower, bands.upper], [middle - reach, middle + reach], rtol=1e-6)
    assert bands.exact.all() and "radial A 0 to 2e-05" in str(bands)
    at_most = bands.upper_case[0, 1:] - own[0, :2]  # of A.x, along its gradient
    np.testing.assert_allclose(at_most, 20e-6 * gain[0, :2] / np.linalg.norm(gain[0, :2]), atol=2e-8)
    with pytest.raises(rx.RedundaxError, match="`radial` must name pins and sleeves that `box` does not bound"):
        rx.band(mechanism, REST, "A.x", rx.MisfitBox(joints, {"A.x": (0.0, 1e-6)}, radial={"A": 20e-6}))
    with pytest.raises(rx.RedundaxError, match="`radial` must hold finite lengths"):
        rx.MisfitBox(joints, {}, radial={"A": -1e-6})


def test_discs_beside_a_contact_reach_what_holes_at_their_edges_give():
    """A plate of two pins and a foot, all soft, of all places of both holes: ends are at their edges."""
    w, sizes = np.array([1.093, 1.093, 48.41, 48.41, 62.2]) * 1e-8, (12.71e-6, 13.22e-6)
    weight, normal = np.array([0.0, -4.354 * 9.81, 0.0]), np.array([0.8293, 0.5587])
    at = np.array([[-0.8646, 0.3455], [-0.0549, 0.3549], [-0.9207, -0.8976]])
    pins = [rx.Revolute(name, "plate", "ground", tuple(p), tuple(p)) for name, p in zip("AB", at[:2], strict=True)]
    foot = rx.PinInSlot("F", "plate", "ground", tuple(at[2]), tuple(at[2]), tuple(normal), one_sided=True)
    plate = rx.Mechanism([rx.Body("plate", 4.354, 0.9)], [*pins, foot], gravity=(0.0, -9.81))
    joints = rx.ElasticJoints(plate, dict(zip("ABF", w[[0, 2, 4]].tolist(), strict=True)))
    names = ["A.x", "A.y", "B.x", "B.y", "F.perpendicular"]
    found = rx.band(plate, REST, names, rx.MisfitBox(joints, {}, radial=dict(zip("AB", sizes, strict=True))))
    # Multipliers of pins are minus the forces on the plate, that of a contact is the force along its normal.
    ways = [*-np.concatenate([np.eye(2)] * 2), normal / np.linalg.norm(normal)]
    rigid = np.array([[a, b, x * b - y * a] for (a, b), (x, y) in zip(ways, at[[0, 0, 1, 1, 2]], strict=True)])

    def loads(misfits, rows):
        inner = np.linalg.inv((rigid[rows].T / w[rows]) @ rigid[rows])
        freely = misfits[..., rows] / w[rows]
        return freely - (freely @ rigid[rows] + weight) @ inner @ (rigid[rows].T / w[rows])

    angles = np.linspace(0.0, 2 * np.pi, 721)
    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    misfits = np.zeros((721, 721, 5))
    misfits[..., :2], misfits[..., 2:4] = sizes[0] * around[:, None], sizes[1] * around
    held, off = loads(misfits, np.arange(5)), np.zeros((721, 721, 5))
    off[..., :4] = loads(misfits, np.arange(4))
    held = np.where(held[..., 4:] >= 0, held, off).reshape(-1, 5)
    size = np.abs(held).max()
    np.testing.assert_allclose(found.lower, held.min(axis=0), atol=1e-4 * size)
    np.testing.assert_allclose(found.upper, held.max(axis=0), atol=1e-4 * size)
    assert found.exact.all()
    few = rx.band(plate, REST, names, rx.MisfitBox(joints, {}, radial=dict(zip("AB", sizes, strict=True))), nodes=2)
    assert np.isfinite([few.lower, few.upper]).all()
    assert np.all((few.outer_lower <= found.lower + 1e-6 * size) & (found.lower <= few.lower + 1e-6 * size))
    assert np.all((few.outer_upper >= found.upper - 1e-6 * size) & (found.upper >= few.upper - 1e-6 * size))


def test_what_loads_that_friction_holds_are_not_asked_of_discs():
    rubs = {"friction": rx.Coulomb(0.1), "pin_radius": 0.01}
    pins = [rx.Revolute(name, "rod", "ground", (x, 0.0), (x, 0.0), **rubs) for name, x in (("A", -0.5), ("B", 0.5))]
    rod = rx.Mechanism([rx.Body("rod", 1.0, 0.1)], pins)
    bounds = rx.MisfitBox(rx.ElasticJoints(rod, {"A": 2e-7, "B": 3e-7}), {}, radial={"A": 20e-6})
    with pytest.raises(rx.RedundaxError, match="`bounds` must hold no `radial`, except in `band`"):
        rx.band(rod, REST, "B.x", bounds)


def test_play_beside_friction_at_rest_is_refused_in_bands():
    pins = [
        rx.Revolute(name, "rod", "ground", (x, 0.0), (x, 0.0), 0.01, rx.Coulomb(0.1))
        for name, x in (("A", -0.5), ("B", 0.5))
    ]
    mechanism = rx.Mechanism([rx.Body("rod", 1.0, 0.1)], pins)
    joints = rx.ElasticJoints(mechanism, {"A": 1e-7, "B": 1e-7}, play={"A": 1e-5})
    with pytest.raises(rx.RedundaxError, match="`bounds` must have no play where joints with friction rest"):
        rx.band(mechanism, rx.State(jnp.zeros(3), jnp.zeros(3)), "B.x", joints)


def leaning():
    """A body of 10 kg on a pin with play up to 30 um, two feet that push, and a wall."""
    parts = (("c1", (0.1, 0.0), (0.0, 1.0)), ("c2", (0.6, 0.0), (0.0, 1.0)), ("w", (0.7, 0.1), (1.0, 0.0)))
    joints = [rx.Revolute("r", "b", "ground", (-0.5, 0.0), (-0.5, 0.0))]
    joints += [rx.PinInSlot(k, "b", "ground", at, at, normal=n, one_sided=k != "w") for k, at, n in parts]
    loads = [rx.AppliedForce("b", (12.0, 0.0), moment=5.0)]
    return rx.Mechanism([rx.Body("b", 10.0, 1.0)], joints, loads=loads, gravity=(0.0, -9.81))


def elastic(mechanism, misfit, play):
    soft = {"r": 1e-6, "c1": 2e-6, "c2": 1.5e-6, "w": 3e-6}
    own = [rx.JointCompliance(k, w, misfit=(0.0, misfit if k == "c1" else 0.0, 0.0)) for k, w in soft.items()]
    return rx.ElasticJoints(mechanism, own, play={"r": play})


FEET = ["c1.perpendicular", "c2.perpendicular"]


def test_loads_that_leave_a_place_in_the_disc_open_are_found():
    """Least loads of the feet against one solve for each case of misfit and play."""
    mechanism = leaning()
    bands = rx.band(mechanism, REST, FEET, rx.MisfitBox(elastic(mechanism, 0.0, 3e-5), {FEET[0]: (-5e-5, 5e-5)}))
    cases = itertools.product((-5e-5, 0.0, 5e-5), (0.0, 1.5e-5, 3e-5))
    solutions = [rx.solve(mechanism, REST, closure=elastic(mechanism, *case)) for case in cases]
    loads = np.array([[float(solution[foot]) for foot in FEET] for solution in solutions])
    np.testing.assert_allclose([bands.lower, bands.upper], [loads.min(axis=0), loads.max(axis=0)], rtol=1e-6)
    assert bands.exact.all()


@pytest.mark.parametrize("figure", [np.nan, np.inf])
def test_figures_that_are_none_are_refused_by_name(figure):
    mechanism = leaning()
    with pytest.raises(rx.RedundaxError, match="`play` of 'r' must be finite, but is"):
        elastic(mechanism, 0.0, figure)
    with pytest.raises(rx.RedundaxError, match="`misfit` of the closure must be finite, but is"):
        rx.band(mechanism, REST, FEET, elastic(mechanism, figure, 1e-5))


def test_ends_that_were_not_found_are_told_line_by_line():
    """With no effort neither end is found, and what none exceeds is said; ends that were found stay."""
    mechanism = leaning()
    box = rx.MisfitBox(elastic(mechanism, 0.0, 3e-5), {FEET[0]: (-5e-5, 5e-5)})
    bands = rx.band(mechanism, REST, FEET, box, nodes=1)
    assert bands.empty and "NO SOLUTION" not in str(bands) and str(bands).count("not found; outer 0 to") == 2
    half = dataclasses.replace(bands, lower=np.array([np.nan, 20.0]), upper=np.array([40.0, 30.0]))
    assert not half.empty and " 20 " in str(half) and " 40 " in str(half) and str(half).count("not found; outer") == 1
    rx.plot.band(half)


def test_balls_have_play_to_all_sides():
    """A rod askew, 480 um too long between two balls: 300 N with all play, to 480 um / 0.8 um/N without."""
    along, rod = np.array([1.0, 2.0, -2.0]) / 3, rx.spatial.Body("rod", 1.0, inertia=(0.1, 0.1, 0.1))
    balls = [rx.spatial.Spherical(name, rod, "ground", point=x * along) for name, x in (("A", -0.5), ("B", 0.5))]
    mechanism = rx.Mechanism([rod], balls)
    joints = rx.ElasticJoints(mechanism, {"A": 5e-7, "B": 3e-7}, play={"A": 1.4e-4, "B": 1e-4})
    warm = rx.AsBuilt(joints, rx.heated(mechanism, {"rod": 40.0}, 12e-6))
    bands = rx.band(mechanism, rx.assemble(mechanism), [f"B force {axis} on rod" for axis in "xyz"], warm)
    ends = np.sort(-np.outer(along, [600.0, 300.0]), axis=1)
    np.testing.assert_allclose(np.stack([bands.lower, bands.upper], axis=1), ends, rtol=1e-6)
