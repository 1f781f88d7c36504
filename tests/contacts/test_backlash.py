"""Teeth with backlash: both flanks push alone, against the flank that one row has, and all sets of flanks."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_contacts import enumerated

import redundax as rx

MODULE, ALPHA, TEETH = 0.002, np.pi / 9, 20
BASE = MODULE * TEETH * np.cos(ALPHA) / 2
INERTIA = {"in": 1e-4, "one": 2e-4, "two": 3e-4, "out": 5e-4}


def train(torque=0.0, offsets=(0.0,) * 4, backlash=1e-4):
    """A gear drives another over two idlers beside each other, each with 20 teeth: one path more than needed."""
    spots = {"in": (0.0, 0.0), "one": (0.03, 0.0264575), "two": (0.03, -0.0264575), "out": (0.06, 0.0)}
    pins = [rx.Revolute(f"{name} pin", name, "ground", (0, 0), at) for name, at in spots.items()]
    pairs = (("in", "one"), ("in", "two"), ("one", "out"), ("two", "out"))
    meshes = [
        rx.GearPair(f"{i}-{j}", i, j, (0, 0), (0, 0), (TEETH, TEETH), MODULE, ALPHA, angle_i=at, backlash=backlash)
        for (i, j), at in zip(pairs, offsets, strict=True)
    ]
    bodies = [rx.Body(name, 0.5, inertia) for name, inertia in INERTIA.items()]
    couples = [
        rx.AppliedForce(name, moment=moment) for name, moment in zip(INERTIA, np.broadcast_to(torque, 4), strict=True)
    ]
    return rx.Mechanism(bodies, [*pins, *meshes], loads=couples)


GUESS = {"one.x": 0.03, "one.y": 0.0264575, "two.x": 0.03, "two.y": -0.0264575, "out.x": 0.06}
WORKS = ("in-one.right", "in-two.right", "one-out.left", "two-out.left")


def timed(**figures):
    """With teeth placed so that at angles 0 the input, turned clockwise, presses on all."""
    loose = train(**figures)
    q = [GUESS.get(name, 0.0) for name in loose.coordinates.labels]
    start = rx.State(jnp.array(q), jnp.zeros(12))
    gaps = -np.asarray(loose.constraint(start.q, start.t))
    gaps = [gaps[loose.rows.labels.index(name)] for name in WORKS]
    offsets = tuple(gap / BASE * (1 if name.endswith("left") else -1) for gap, name in zip(gaps, WORKS, strict=True))
    return offsets, start


def test_flanks_leave_the_backlash_between_them_and_one_is_that_of_a_row():
    """Their gaps add to the backlash, and 2 sin(alpha) for each metre of distance more, at the pitch circle."""
    backlash = 1e-4
    both = rx.GearPair("M", "a", "b", (0, 0), (0, 0), (TEETH, 40), MODULE, ALPHA, backlash=backlash)
    here = lambda x, y, phi: rx.Pose(jnp.array([x, y]), jnp.asarray(phi)).with_axes()  # noqa: E731
    for distance, turn in ((0.06, 0.02), (0.06 + 1e-6, 0.3)):
        i, j, t = here(0.0, 0.0, turn), here(distance, 0.0, 0.1), jnp.zeros(())
        gaps = -np.asarray(both.residual(i, j, t))
        assert gaps.sum() == pytest.approx(backlash + 2 * np.sin(ALPHA) * (distance - 0.06), abs=1e-10)
        for gap, flank in zip(gaps, (1, -1), strict=True):
            one = rx.GearPair("M", "a", "b", (0, 0), (0, 0), (TEETH, 40), MODULE, ALPHA, flank=flank)
            pitch = np.pi * MODULE * np.cos(ALPHA)
            off = (gap - backlash / 2 + np.asarray(one.residual(i, j, t))[0]) / pitch
            assert abs(off - np.round(off)) < 1e-9
    for mesh in (rx.GearPair, rx.RackAndPinion):
        more = {"normal": (0, 1), "teeth": TEETH} if mesh is rx.RackAndPinion else {"teeth": (TEETH, 40)}
        with pytest.raises(rx.RedundaxError, match="`flank` of 'M' must be left out where `backlash` is given"):
            mesh("M", "a", "b", (0, 0), (0, 0), module=MODULE, flank=-1, backlash=1e-4, **more)
        with pytest.raises(rx.RedundaxError, match="`backlash` must not be negative"):
            mesh("M", "a", "b", (0, 0), (0, 0), module=MODULE, backlash=-1e-4, **more)


def test_a_train_of_two_paths_against_all_sets_of_flanks():
    """Loads of stiff teeth, nearest in their compliance; input and output are turned at random, both ways."""
    offsets, start = timed()
    rng, seen = np.random.default_rng(2), set()
    bodies = list(INERTIA)
    jacobian = np.zeros((4, 4))
    for k, name in enumerate(WORKS):
        ends, way = name.split("."), -1 if name.endswith("right") else 1
        for end in ends[0].split("-"):
            jacobian[k, bodies.index(end)] = way * BASE
    for _ in range(6):
        torque = rng.normal(size=4) * 0.1 + [-1.0, 0.0, 0.0, -0.8]
        mechanism = train(torque, offsets)
        rows = [mechanism.rows.labels.index(name) for name in WORKS]
        compliance, misfit = np.zeros(len(mechanism.rows)), np.zeros(len(mechanism.rows))
        compliance[rows], misfit[rows] = rng.uniform(0.5, 2, 4) * 1e-8, rng.normal(size=4) * 3e-7
        closure = rx.Compliance(jnp.diag(jnp.asarray(compliance)), jnp.asarray(misfit))
        found = rx.solve(mechanism, start, closure=closure)
        own = compliance[rows], misfit[rows]
        truth = enumerated(jacobian, np.array(list(INERTIA.values())), torque, *own)
        np.testing.assert_allclose(found.multipliers[np.array(rows)], truth[0], rtol=0, atol=1e-8)
        np.testing.assert_allclose(found.acceleration[8:], truth[1], rtol=0, atol=1e-6)
        others = [word for name, word in found.contacts.items() if name not in WORKS]
        assert set(others) == {"open"}
        seen |= {str(found.contacts[name]) for name in WORKS}
    assert {"carries", "lifts"} <= seen


def test_a_rack_is_driven_on_one_flank_and_let_go_by_the_other_way():
    """Between its flanks by half the backlash, then laid on; J phi'' = T - b F with F = m b phi'' of the rack."""
    pinion, rack = rx.Body("pinion", 1.0, 1e-3), rx.Body("rack", 2.0, 1.0)

    def drive(torque):
        joints = [
            rx.Revolute("pin", "pinion", "ground", (0, 0), (0, 0.02)),
            rx.Translational("guide", "rack", "ground", (0, 0), (0, 0), (0, 1)),
            rx.RackAndPinion("mesh", "pinion", "rack", (0, 0), (0, 0), (0, 1), TEETH, MODULE, backlash=1e-4),
        ]
        return rx.Mechanism([pinion, rack], joints, loads=[rx.AppliedForce("pinion", moment=torque)])

    along = BASE / np.cos(ALPHA)  # the pitch radius
    for torque, word in ((-0.5, "carries"), (0.5, "lifts")):
        mechanism = drive(torque)
        laid = rx.assemble(mechanism, {"pinion.y": 0.02}, closed="mesh.right")
        found = jax.block_until_ready(rx.solve(mechanism, laid))
        assert found.contacts == {"mesh.right": word, "mesh.left": "open"}
        inertia = 1e-3 + (2.0 * along**2 if word == "carries" else 0.0)
        assert float(found["pinion.phi''"]) == pytest.approx(torque / inertia, rel=1e-9)
        gap = -float(mechanism.constraint(laid.q, laid.t)[mechanism.rows.labels.index("mesh.left")])
        assert gap == pytest.approx(1e-4, rel=1e-9)


@pytest.mark.parametrize("flank", ["right", "left"])
def test_teeth_that_stand_on_each_other_are_turned_to_the_flank_that_is_asked_for(flank):
    """From half a pitch off, either way: the other flank then has all of the backlash."""
    pins = [rx.Revolute("p", "a", "ground", (0, 0), (0, 0)), rx.Revolute("w", "b", "ground", (0, 0), (0.06, 0))]
    mesh = rx.GearPair("mesh", "a", "b", (0, 0), (0, 0), (20, 40), 0.002, backlash=1e-4)
    train = rx.Mechanism([rx.Body("a", 0.5, 1e-4), rx.Body("b", 1.0, 4e-4)], [*pins, mesh])
    state = rx.assemble(train, {"b.x": 0.06}, closed=f"mesh.{flank}")
    gaps = dict(zip(train.rows.labels, -np.asarray(train.constraint(state.q, state.t)), strict=True))
    assert gaps[f"mesh.{flank}"] == pytest.approx(0.0, abs=1e-12)
    assert sum(gaps[f"mesh.{side}"] for side in ("right", "left")) == pytest.approx(1e-4, abs=1e-12)
