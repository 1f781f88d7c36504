"""Whether mechanisms at rest with several freedoms stick, joint by joint, against closed forms and enumeration."""

import itertools
import json

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog, lsq_linear

import redundax as rx

GRAVITY, MASS = 10.0, np.array([1.0, 2.0])
MU = np.array([0.3, 0.2])
slow = pytest.mark.slow


def guides(body, below, mu, normal=(0.0, 1.0)):
    """Two guides at the same place, which share the normal force as a preload has it."""
    return [
        rx.Translational(f"{body}{k}", body, below, (0, 0), (0, 0), normal, guide_length=0.1, friction=rx.Coulomb(mu))
        for k in (1, 2)
    ]


def mechanism(joints, forces, stiffness=0.0):
    """Two blocks at rest at the origin, pushed along x; a spring stretched by 0.5 m pulls b on."""
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
    drive = np.array([-4.0, 5.0])
    moves = (both + drive) / MASS
    np.testing.assert_allclose(moves, np.where(own < 0, -own * drive / MASS, 0.0), rtol=0, atol=1e-9)
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


@slow
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


def test_without_a_drive_all_stays_and_without_friction_nothing_does():
    still = rx.sticking(*side_by_side((0.0, 0.0)), preload((0.0, 40.0), (0.0, 40.0)))
    assert (still.verdict, still.proved) == ("must stick", True)
    assert np.all(still.margin == np.inf) and np.all(still.friction == 0.0)
    assert still.slip_verdicts == ("must stick",) * 4 and still.slip_proved.all()
    free = rx.System(lambda q, t, p: q[2:], jnp.ones(3), lambda q, qd, t, p: jnp.array([1.0, -2.0, 5.0]))
    found = rx.sticking(free, rx.State(jnp.zeros(3), jnp.zeros(3)))
    assert (found.verdict, found.proved, found.margin.tolist()) == ("must slip", True, [-1.0, -1.0])
    np.testing.assert_allclose(found.acceleration, [[1.0, -2.0, 0.0]] * 2, rtol=0, atol=1e-12)
    assert found.slip_verdicts == found.names == ()


def test_a_block_without_drive_sticks_beside_one_that_slips():
    found = rx.sticking(*side_by_side((4.0, 0.0)))
    assert (found.verdict, found.slip_verdicts) == ("must slip", ("must slip",) * 2 + ("must stick",) * 2)
    assert found.proved and found.slip_proved.all()


def test_bounds_that_no_case_meets():
    """The guides of a carry 10 N together."""
    ends = {f"{guide}.angle": (0.0, 0.0) for guide in ("a1", "b1")} | {"b1.perpendicular": (0.0, 40.0)}
    impossible = rx.PreloadBox(ends | {"a1.perpendicular": (0.0, 1.0), "a2.perpendicular": (50.0, 60.0)})
    found = rx.sticking(*side_by_side((4.0, 5.0)), impossible)
    assert (found.verdict, found.proved, found.solved) == ("undecided", False, 0.0)
    assert found.slip_verdicts == ("undecided",) * 4 and not found.slip_proved.any()
    assert found.margin.size == 0
    assert "UNDECIDED for 100% of the cases looked at, or their loads are beyond the bounds." in " ".join(
        str(found).split()
    )


def test_no_proof_where_nothing_is_known_of_the_law():
    """Friction that vanishes within a hair of one load, which no search finds."""

    def rubbing(loads, rate, sense, memory, state, p):
        return -(1.0 - jnp.exp(-(((loads[:, 0] - 20.021) / 1e-5) ** 2))) * jnp.abs(loads[:, 0]) * sense

    slides = rx.System(
        lambda q, t, p: jnp.concatenate([q[2:], -q[2:]]),
        jnp.ones(4),
        lambda q, qd, t, p: jnp.ones(4),
        rows=rx.Axis(("u0", "u1", "l0", "l1"), ("force",) * 4),
        friction=rx.Friction(lambda q, t, p: q[:2], rubbing, [[0], [1]], ["linear"] * 2),
    )
    bounds = rx.PreloadBox({"u0": (10.0, 40.0), "u1": (10.0, 40.0)})
    found = rx.sticking(slides, rx.State(jnp.zeros(4), jnp.zeros(4)), bounds)
    assert (found.verdict, found.proved) == ("must stick", False)
    assert not found.slip_proved.any()


D, P = 2, 3  # freedoms and slips


def walls(q, t, p):
    return jnp.concatenate([q[D:], -q[D:]])


def pushed(q, qd, t, p):
    return jnp.concatenate([p["force"], -p["weight"]])


def skew(q, t, p):
    return p["slips"].T @ q[:D] + p["coupling"].T @ q[D:]


def rubbing(loads, rate, sense, memory, state, p):
    return -p["mu"] * jnp.sum(jnp.abs(loads), axis=1) * sense


def between_walls(rng, coupling):
    """Points whose P slips depend on D coordinates and, by `coupling`, on those along which walls load them.

    Loads N_j below and N_j + W_j - C_j^T tau above give the limits mu_j (|N_j| + |N_j + W_j - C_j^T tau|).
    """
    spread, mass = rng.standard_normal((D, D)), np.eye(D + P)
    mass[:D, :D] = spread @ spread.T + D * np.eye(D)
    figures = {
        "mass": mass,
        "slips": rng.standard_normal((D, P)),
        "coupling": coupling * rng.standard_normal((P, P)),
        "weight": rng.uniform(5, 15, P),
        "mu": rng.uniform(0.05, 0.3, P),
        "force": 4 * rng.uniform(0.2, 3) * rng.standard_normal(D),
        "below": rng.uniform(5, 20, P),
    }
    given = {name: jnp.asarray(value) for name, value in figures.items()}
    sides = np.stack([np.arange(P), P + np.arange(P)], axis=1)
    names = tuple(f"{side}{k}" for side in ("below", "above") for k in range(P))
    friction = rx.Friction(skew, rubbing, sides, ["linear"] * P, given)
    system = rx.System(
        walls, given["mass"], pushed, given, rows=rx.Axis(names, ("force",) * (2 * P)), friction=friction
    )
    return system, figures


def programmed(figures):
    """Largest part of the force that friction can hold, less 1: where no wall is left, a linear programme."""
    slips, mu, coupling = figures["slips"], figures["mu"][:, None], figures["coupling"]
    sides = [np.hstack([np.zeros((P, 1)), sign * np.eye(P) + mu * coupling]) for sign in (1, -1)]
    most = figures["mu"] * (2 * figures["below"] + figures["weight"])
    balance = np.hstack([figures["force"][:, None], slips])
    bounds = [(0, None)] + [(None, None)] * P
    found = linprog(np.eye(P + 1)[0] * -1, np.vstack(sides), np.tile(most, 2), balance, np.zeros(D), bounds)
    assert np.all(figures["below"] + figures["weight"] - coupling @ found.x[1:] > 0)
    return found.x[0] - 1


def tried(figures):
    """Senses of the slips by trial of all patterns, of which one is right; all stick if the programme says so."""
    slips, mu, coupling = figures["slips"], figures["mu"][:, None], figures["coupling"]
    inverse = np.linalg.inv(figures["mass"][:D, :D])
    drive, matrix = slips.T @ inverse @ figures["force"], slips.T @ inverse @ slips
    most = figures["mu"] * (2 * figures["below"] + figures["weight"])
    right = [(0,) * P] if programmed(figures) >= 0 else []
    for pattern in itertools.product((-1, 0, 1), repeat=P):
        sense = np.array(pattern)[:, None]
        if (sense == 0).sum() > D:
            continue
        rows = np.where(sense != 0, np.eye(P) - sense * mu * coupling, matrix)
        tau = np.linalg.solve(rows, np.where(sense[:, 0] != 0, -sense[:, 0] * most, -drive))
        alpha, limits = drive + matrix @ tau, most - mu[:, 0] * (coupling @ tau)
        if np.all(np.where(sense[:, 0] != 0, alpha * pattern > 1e-9, np.abs(tau) <= limits + 1e-9)):
            right.append(pattern)
    assert len(set(right)) == 1
    return right[0]


@pytest.mark.parametrize("coupling", [0.0, 0.1])
@pytest.mark.slow
def test_coupled_slips_as_a_linear_programme_and_all_patterns_tried(coupling):
    seen = set()
    for seed in range(20):
        system, figures = between_walls(np.random.default_rng(seed), coupling)
        bounds = rx.PreloadBox({f"below{k}": (load, load) for k, load in enumerate(figures["below"])})
        found = rx.sticking(system, rx.State(jnp.zeros(D + P), jnp.zeros(D + P)), bounds, samples=1)
        np.testing.assert_allclose(found.margin, programmed(figures), rtol=1e-7, atol=1e-8)
        pattern = tried(figures)
        assert found.slip_senses == tuple((sense,) if sense else () for sense in pattern)
        assert (found.margin[0] < 0) == any(pattern) == (found.verdict == "must slip")
        seen.add(sum(sense != 0 for sense in pattern))
    assert seen == {0, 2, 3}  # two that stick leave no motion


def stacks(q, t, p):
    return q[1:] - q[:-1]  # from the floor, q[0], on


def constant(loads, rate, sense, memory, state, p):
    return -p * sense


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=slow)])
def test_a_high_stack_of_blocks_of_unlike_mass(seed):
    """Friction that accelerates least, and what it can hold, by scipy; masses from 0.01 to 100 kg."""
    count, rng = 10, np.random.default_rng(seed)
    mass = 10 ** rng.uniform(-2, 2, count)
    limits = 2 * rng.uniform(0.1, 1.0, count) * np.cumsum(mass[::-1])[::-1]
    force = 3 * mass * rng.standard_normal(count)
    friction = rx.Friction(stacks, constant, jnp.zeros(0, int), ["linear"] * count, limits)
    inertia = np.concatenate([[1.0], mass])
    system = rx.System(lambda q, t, p: q[:1], inertia, lambda q, qd, t, p: jnp.append(0.0, p), force, friction=friction)
    found = rx.sticking(system, rx.State(jnp.zeros(count + 1), jnp.zeros(count + 1)))
    slips = np.eye(count) - np.eye(count, k=-1)
    bounds = [(0, None), *zip(-limits, limits, strict=True)]
    most = linprog(-np.eye(count + 1)[0], A_eq=np.hstack([force[:, None], slips.T]), b_eq=0 * force, bounds=bounds)
    np.testing.assert_allclose(found.margin, most.x[0] - 1, rtol=0, atol=1e-9)
    scaled, drive = slips / np.sqrt(mass), force / np.sqrt(mass)
    tau = lsq_linear(scaled.T, -drive, (-limits, limits), method="bvls", tol=1e-14).x
    alpha = scaled @ (drive + scaled.T @ tau)
    senses = np.where(np.abs(alpha) > 1e-6, np.sign(alpha), 0.0).astype(int)
    assert 0 < np.abs(senses).sum() < count
    assert found.slip_senses == tuple((sense,) if sense else () for sense in senses.tolist())
    assert found.proved and found.slip_proved.all()
    np.testing.assert_allclose(np.diff(found.acceleration[0]), alpha, rtol=0, atol=1e-6)
