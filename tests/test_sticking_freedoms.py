"""Whether mechanisms at rest with several degrees of freedom stick, joint by joint, against closed forms and enumeration."""

import itertools
import json

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

import redundax as rx

GRAVITY, MASS = 10.0, np.array([1.0, 2.0])
MU = np.array([0.3, 0.2])
slow = pytest.mark.slow


def guides(body, below, mu, normal=(0.0, 1.0)):
    """Two guides at the same place, which share the normal force as a preload has it."""
    return [
        rx.Translational(
            f"{body}{k}", body, below, (0, 0), (0, 0), normal, guide_length=0.1, friction=rx.Coulomb(mu)
        )
        for k in (1, 2)
    ]


def mechanism(joints, forces, stiffness=0.0):
    """Two blocks at rest at the origin, pushed along x; a spring of 1 m and free length 0.5 m pulls b away from a wall."""
    bodies = [rx.Body(name, mass, 0.1) for name, mass in zip("ab", MASS, strict=True)]
    loads = [rx.AppliedForce(name, (force, 0.0)) for name, force in zip("ab", forces, strict=True)]
    loads += [rx.SpringDamper("b", "ground", (0, 0), (1.0, 0.0), stiffness, 0.5)]
    whole = rx.Mechanism(bodies, joints, loads=loads, gravity=(0.0, -GRAVITY))
    return whole, rx.State(jnp.zeros(6), jnp.zeros(6))


def side_by_side(forces, stiffness=0.0):
    return mechanism([*guides("a", "ground", MU[0]), *guides("b", "ground", MU[1])], forces, stiffness)


def stacked(forces, angle=0.0):
    """b on a, on a plane of a at an angle, along which it slides."""
    normal = (-np.sin(angle), np.cos(angle))
    return mechanism([*guides("a", "ground", MU[0]), *guides("b", "a", MU[1], normal)], forces)


def preload(a, b):
    """Bounds of the forces of the first guides; guide moments are none."""
    ends = {"a1.angle": (0, 0), "b1.angle": (0, 0), "a1.perpendicular": a, "b1.perpendicular": b}
    return rx.PreloadBox(ends)


def limit(mu, first, both):
    """Of the friction of two guides that carry a force together."""
    return mu * (np.abs(first) + np.abs(both - first))


def held_apart(first, forces):
    """What friction of each block side by side can hold of its force, less 1."""
    return limit(MU, np.asarray(first), MASS * GRAVITY) / np.abs(forces) - 1


# Thresholds: 0.3 (2 N - 10) = 4, 0.2 (2 N - 20) = 5.
NEED_A, NEED_B = 35 / 3, 22.5


@pytest.mark.parametrize(
    ("least", "whole", "joints"),
    [
        ((NEED_A + 1e-3, NEED_B + 1e-3), "must stick", ("must stick", "must stick")),
        ((NEED_A + 1e-3, NEED_B - 1e-3), "may stick", ("must stick", "may stick")),
        ((NEED_A - 1e-3, NEED_B + 1e-3), "may stick", ("may stick", "must stick")),
        ((0.0, 0.0), "may stick", ("may stick", "may stick")),
    ],
)
def test_blocks_side_by_side_stick_where_their_own_preload_holds_them(least, whole, joints):
    """The friction of one guide is at its limit, or short of the force, where both hold."""
    forces = (-4.0, 3.0)  # and 2 N of the spring
    found = rx.sticking(*side_by_side(forces, 4.0), preload((least[0], 40.0), (least[1], 40.0)))
    assert (found.verdict, found.proved, found.solved) == (whole, True, 1.0)
    assert found.slip_verdicts == (joints[0],) * 2 + (joints[1],) * 2
    assert found.slip_proved.all()
    senses = [() if joint == "must stick" else (sense,) for joint, sense in zip(joints, (-1, 1), strict=True)]
    assert found.slip_senses == (senses[0],) * 2 + (senses[1],) * 2
    places = np.stack(np.meshgrid(*(np.linspace(start, 40.0, 401) for start in least)), axis=-1)
    margins = held_apart(places, (4.0, 5.0)).min(axis=-1)
    np.testing.assert_allclose(found.margin, [margins.min(), margins.max()], rtol=0, atol=1e-6)
    own = held_apart(found.case[:, [found.parameters.index(f"{name}1.perpendicular") for name in "ab"]], (4.0, 5.0))
    np.testing.assert_allclose(found.margin, own.min(axis=1), rtol=0, atol=1e-9)
    both = found.friction.reshape(2, 2, 2).sum(axis=2)
    moves = (both + [-4.0, 5.0]) / MASS
    np.testing.assert_allclose(moves, np.where(own < 0, (1 - (1 + own)) * [-4.0, 5.0] / MASS, 0.0), atol=1e-9)
    np.testing.assert_allclose(found.acceleration[:, [0, 2]], moves, rtol=0, atol=1e-9)


def test_blocks_side_by_side_that_must_slip_and_the_text():
    found = rx.sticking(*side_by_side((-4.0, 5.0)), preload((0.0, NEED_A - 1e-3), (30.0, 40.0)))
    assert (found.verdict, found.proved) == ("must slip", True)
    assert found.slip_verdicts == ("must slip",) * 2 + ("must stick",) * 2 and found.slip_proved.all()
    text = str(found)
    assert "MUST SLIP (proved)\n" in text
    assert text.endswith("\nslips that must slip (proved): a1 -, a2 -\nslips that must stick (proved): b1, b2")
    data = json.loads(json.dumps(found.to_dict()))
    assert data["slip_verdicts"][0] == "must slip" and data["slip_senses"] == [[-1], [-1], [], []]


def enumerated(forces, limits):
    """Senses of a and of b on a, and how much of the forces friction could hold, by trial of all patterns.

    a: M_a a = P_a + f_a - f_b, b: M_b (a + b) = P_b + f_b, with friction f against each sense, or no acceleration.
    """
    mass = np.array([[MASS.sum(), MASS[1]], [MASS[1], MASS[1]]])
    drive = np.array([sum(forces), forces[1]])
    right = []
    for pattern in itertools.product((-1, 0, 1), repeat=2):
        moves = np.array(pattern) != 0
        friction, alpha = -np.array(pattern) * limits, np.zeros(2)
        alpha[moves] = np.linalg.solve(mass[np.ix_(moves, moves)], (drive + friction)[moves])
        friction = np.where(moves, friction, mass @ alpha - drive)
        if np.all(np.where(moves, alpha * pattern > 0, np.abs(friction) <= limits)):
            right.append(pattern)
    assert len(right) == 1
    return right[0], np.min(limits / np.maximum(np.abs(drive), 1e-300)) - 1


PATTERNS = pytest.mark.parametrize(
    ("forces", "firsts"),
    [
        ((2.0, 1.0), (40.0, 30.0)),  # both stick
        ((20.0, 1.0), (20.0, 15.0)),  # a slips and takes b along
        ((-2.0, 12.0), (40.0, 15.0)),  # b slips on a
        ((20.0, -12.0), (16.0, 15.0)),  # both slip
    ],
)


def pressed(whole, firsts):
    """Unit compliance, with the misfit that gives the first guides these forces."""
    rows = jnp.array([whole.rows.labels.index(f"{name}.perpendicular") for name in ("a1", "a2", "b1", "b2")])
    share = np.array([GRAVITY * MASS.sum() / 2, GRAVITY * MASS[1] / 2])
    return rx.Compliance(
        jnp.ones(8), misfit=jnp.zeros(8).at[rows].set(np.repeat(firsts - share, 2) * np.array([1, -1, 1, -1]))
    )


@PATTERNS
def test_stacked_blocks_as_all_patterns_of_senses_tried(forces, firsts):
    """One case, that of a closure, so that all is proved."""
    limits = np.array([limit(MU[0], firsts[0], GRAVITY * MASS.sum()), limit(MU[1], firsts[1], GRAVITY * MASS[1])])
    pattern, margin = enumerated(forces, limits)
    whole, state = stacked(forces)
    found = rx.sticking(whole, state, pressed(whole, firsts))
    assert found.verdict == ("must slip" if any(pattern) else "must stick") and found.proved
    np.testing.assert_allclose(found.margin, margin, rtol=0, atol=1e-9)
    assert found.slip_senses == tuple((sense,) if sense else () for sense in np.repeat(pattern, 2))
    assert found.slip_proved.all()


@slow
@PATTERNS
def test_a_motion_starts_as_the_verdicts_on_the_joints_say(forces, firsts):
    whole, state = stacked(forces, angle=0.3)
    closure = pressed(whole, firsts)
    found = rx.sticking(whole, state, closure)
    run = rx.simulate(whole, state, 1e-3, ts=[1e-3], closure=closure, throw=False)
    assert found.slip_senses == tuple((sense,) if sense else () for sense in run.sense[0].astype(int).tolist())
    if found.verdict == "must slip":
        np.testing.assert_allclose(found.acceleration[0], run.acceleration[0], rtol=1e-5, atol=1e-9)


def test_a_block_on_a_slope_of_another_is_held_as_statics_has_it():
    """Friction on the slope moves the load of the guides below: proved away from the threshold, found at it."""
    angle, forces = 0.4, (9.0, 1.0)
    c, s = np.cos(angle), np.sin(angle)
    drawn = np.abs(forces[1] * c - GRAVITY * MASS[1] * s)
    pressed = forces[1] * s + GRAVITY * MASS[1] * c
    need = (drawn / MU[1] + pressed) / 2, (sum(forces) / MU[0] + GRAVITY * MASS.sum()) / 2
    whole, state = stacked(forces, angle)
    for off, verdict in ((1e-3, "must stick"), (-1e-3, "may stick")):
        found = rx.sticking(whole, state, preload((need[1] + 1e-3, 60.0), (need[0] + off, 60.0)), samples=64)
        assert found.verdict == verdict
        assert (found.margin[0] < 0) == (off < 0)
    bounds = preload((need[1] * 1.5, 60.0), (need[0] * 1.5, 60.0))
    assert rx.sticking(whole, state, bounds, samples=64).proved
    found = rx.sticking(*stacked((20.0, 1.0), angle), preload((10.0, 15.0), (5.0, 15.0)), samples=64)
    assert (found.verdict, found.proved) == ("must slip", True)
