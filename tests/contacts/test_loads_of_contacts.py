"""What contacts may carry, and how much they bear, as they only push: against closed forms and linear programmes."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog
from test_contacts import G, table_of_joints

import redundax as rx


def block(mu, feet, push=0.0):
    """A block of 10 kg on feet 0.3 m to either side, its centre 0.5 m up; they rub."""
    law = {"normal": (0.0, 1.0), "one_sided": True}
    joints = [
        rx.PinInSlot(f"f{k}", "block", "ground", (x, -0.5), (x, 0.0), friction=rx.Coulomb(own), **law)
        for k, (x, own) in enumerate(zip(np.linspace(-0.3, 0.3, feet), np.broadcast_to(mu, feet), strict=True))
    ]
    loads = [rx.AppliedForce("block", (push, 0.0))]
    mechanism = rx.Mechanism([rx.Body("block", 10.0, 1.0)], joints, loads=loads, gravity=(0.0, -G))
    return mechanism, rx.State(jnp.array([0.0, 0.5, 0.0]), jnp.zeros(3))


@pytest.mark.parametrize("mu", [0.3, 0.9])
def test_a_block_slides_or_tips(mu):
    """It slides from mu m g, and tips from m g 0.3/0.5, whichever is less."""
    found = rx.limit_load(*block(mu, 2), {"block.x": 1.0})
    least = 10 * G * min(mu, 0.6)
    assert (found.lower, found.upper) == pytest.approx((-least, least), rel=1e-7)
    assert found.outer_upper == pytest.approx(least, rel=1e-6)
    if mu == 0.3:
        assert found.slips == (("f0", "f1"),) * 2 and found.lifts == ((), ())
    else:
        assert found.lifts == (("f1",), ("f0",)) and found.carries == (("f0",), ("f1",))
        assert "above: f0 lifts, about f1 (moves" in str(found)


def test_three_feet_may_carry_what_pushing_and_rubbing_allow():
    """No stiffness and no preload: an outer foot half the weight, the middle one all of it.

    Its friction is against that of the others, mu (m g - N) at most, so that mu m g / 2 is the largest.
    """
    bands = rx.band(*block(0.3, 3), ["f0.perpendicular", "f1.perpendicular", "tau f1"])
    assert bands.exact.all() and bands.stands == "yes"
    np.testing.assert_allclose(bands.lower, [0, 0, -0.3 * 5 * G], rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(bands.upper, [5 * G, 10 * G, 0.3 * 5 * G], rtol=1e-7)


def test_a_table_tips_about_the_feet_that_are_named():
    mechanism = table_of_joints()
    found = rx.limit_load(mechanism, rx.assemble(mechanism), {"table.x": 1.0})
    assert found.upper == pytest.approx(10 * G * 0.4 / 0.7, rel=1e-9)
    assert found.lifts == (("f2", "f3"), ("f1", "f4"))
    assert "above: f1, f4 lift, about f2, f3" in str(found)


@pytest.mark.parametrize("height", [0.7, 0.85])
def test_a_table_stands_after_a_leg_has_lost_its_load(height):
    """It tips at m g 0.4 / height, whatever the legs are made of: a short one leaves its load to the others before."""
    mechanism = table_of_joints()
    push = {"table.x": 1.0, "table.phi_y": height - 0.7}
    legs = rx.ElasticJoints(mechanism, {"f1": 2e-6, "f2": 1e-6, "f3": 1e-6, "f4": 1e-6})
    state = rx.assemble(mechanism)
    for bounds in (rx.MinimumNorm(), rx.MisfitBox(legs, {"f1.axial": (-3e-5, -3e-5)})):
        found = rx.limit_load(mechanism, state, push, bounds)
        np.testing.assert_allclose([found.lower, found.upper], np.array([-1, 1]) * 10 * G * 0.4 / height, rtol=1e-9)
        np.testing.assert_allclose([found.outer_lower, found.outer_upper], [found.lower, found.upper], rtol=1e-6)
        assert found.lifts == (("f2", "f3"), ("f1", "f4")) and found.carries == (("f1", "f4"), ("f2", "f3"))


def test_a_table_that_tips_stands_under_a_load_against_its_push():
    mechanism, tips = table_of_joints(60.0), 10 * G * 0.4 / 0.7
    found = rx.limit_load(mechanism, rx.assemble(mechanism), {"table.x": 1.0})
    np.testing.assert_allclose([found.lower, found.upper], [-60.0 - tips, -60.0 + tips], rtol=1e-9)


@pytest.mark.parametrize("mu, carries, end", [(0.9, 3, 10 * G * 1.1 / 3), (1.2, 2, 1.2 * 10 * G / (1 + 1.1 / 0.6))])
def test_a_foot_of_three_that_loses_its_load_leaves_it_to_the_others(mu, carries, end):
    """Feet of equal stiffness, 0.1, mu and 0.1 rough, at -0.3, 0 and 0.3 m under a push s = sum mu_i N_i, 0.5 m up.

    A third of the weight each -s/1.2, 0, s/1.2, as long as the first, m g/3 - s/1.2, carries. From s = 0.4 m g on the
    others carry s/0.6 and the rest of the weight.
    """
    found = rx.limit_load(*block((0.1, mu, 0.1), 3), {"block.x": 1.0}, rx.MinimumNorm())
    assert (found.lower, found.upper) == pytest.approx((-end, end), rel=1e-7)
    assert found.outer_upper == pytest.approx(end, rel=1e-6)
    assert found.carries == (("f0", "f1", "f2")[:carries], ("f0", "f1", "f2")[-carries:])
    assert ("f0 has no load left" in str(found)) == (carries == 2)


def test_bands_of_legs_are_those_of_linear_programmes():
    push = 30.0
    mechanism = table_of_joints(push)
    legs = [f"f{k}.axial" for k in range(1, 5)]
    bands = rx.band(mechanism, rx.assemble(mechanism), legs)
    balance = np.array([[1, 1, 1, 1], [-0.4, 0.4, 0.4, -0.4], [-0.3, -0.3, 0.3, 0.3]])
    for k in range(4):
        for sign, found in ((1, bands.lower[k]), (-1, bands.upper[k])):
            truth = linprog(sign * np.eye(4)[k], A_eq=balance, b_eq=[10 * G, 0.7 * push, 0.0]).fun
            assert found == pytest.approx(sign * truth, abs=1e-7)
    assert bands.exact.all()
    box = rx.band(mechanism, rx.assemble(mechanism), legs[:1], rx.PreloadBox({"f1.axial": (20.0, 60.0)}))
    np.testing.assert_allclose([box.lower, box.upper], [[20.0], [5 * G - 0.7 * push / 0.8]], rtol=1e-7)


def test_pictures_say_what_does_not_carry():
    """Two feet of a pushed table lift; a foot above a lower floor is open by its gap. They have no arrows."""
    table = table_of_joints(60.0)
    law = {"normal": (0.0, 1.0), "one_sided": True}
    feet = [
        rx.PinInSlot(name, "block", "ground", (x, -0.5), (x, y), **law)
        for name, x, y in (("a", -0.3, 0.0), ("b", 0.1, 0.0), ("c", 0.3, -0.1))
    ]
    stool = rx.Mechanism([rx.Body("block", 10.0, 1.0)], feet, gravity=(0.0, -G), units=rx.units.SI)
    for mechanism, state, told in (
        (table, rx.assemble(table), {"f1 lifts", "f4 lifts", "f2", "f3"}),
        (stool, rx.assemble(stool, {"block.y": 0.5}), {"a", "b", "c open by 0.1 m"}),
    ):
        axes = rx.plot.draw(mechanism, state, multipliers=rx.solve(mechanism, state))
        texts = {text.get_text() for text in axes.texts}
        assert told <= texts
        loaded = {word for word in told if " " not in word}
        assert {text.split(":")[0] for text in texts if ": " in text} & {"f1", "f4", "c"} == set()
        assert all(any(text.startswith(f"{name}:") for text in texts) for name in loaded)


def test_feet_of_a_block_that_slides_with_friction_within_limits():
    """Equal feet carry N_i = m g/3 + B x_i with 0.18 B = 0.5 sum mu_i N_i, where none lifts; that of the middle is 0.4
    times 0.5 to 2. From 1 on the first has no load left: N_1 = 0.2 m g at 2, by 0.3 N_2 = 0.5 (0.8 N_1 + 0.4 N_2).
    """
    mechanism, state = block(0.4, 3)
    soft = rx.ElasticJoints(mechanism, {f"f{k}": 1e-6 for k in range(3)})
    names = ["f0.perpendicular", "f1.perpendicular"]
    moving = rx.State(state.q, jnp.array([1.0, 0.0, 0.0]))
    bands = rx.band(mechanism, moving, names, rx.MisfitBox(soft, {}, friction={"f1": (0.5, 2.0)}), samples=8)
    least = 10 * G / 3 - 0.3 * 0.5 * 0.4 * (2 / 3 + 0.5 / 3) * 10 * G / 0.18
    np.testing.assert_allclose([bands.lower, bands.upper], [[0.0, 2 * G], [least, 10 * G / 3]], rtol=1e-8, atol=1e-8)
    assert not bands.exact.any()


def test_contacts_stand_beside_a_slider_in_its_dead_centre():
    """It rests there and goes on, with friction against the way it slips; feet carry a third of the weight each."""
    a, b, rubs = 0.1, 0.3, {"guide_length": 0.05, "friction": rx.Coulomb(0.1)}
    bodies = [rx.Body("crank", 1.0, 1e-3), rx.Body("rod", 1.0, 1e-2), rx.Body("slider", 1.0, 0.01)]
    joints = [
        rx.Revolute("A", "crank", "ground", (-a / 2, 0.0), (0.0, 0.0)),
        rx.Revolute("B", "rod", "crank", (-b / 2, 0.0), (a / 2, 0.0)),
        rx.Revolute("C", "slider", "rod", (0.0, 0.0), (b / 2, 0.0)),
        *(rx.Translational(n, "slider", "ground", (0.0, y), (0.0, y), (0.0, 1.0), **rubs) for n, y in RAILS),
        *(rx.PinInSlot(f"f{k}", "block", "ground", (x, 0.0), (x, 0.0), (0.0, 1.0), one_sided=True) for k, x in FEET),
    ]
    mechanism = rx.Mechanism([*bodies, rx.Body("block", 10.0, 1.0)], joints, gravity=(0.0, -G))
    state = rx.assemble(mechanism, {"crank.x": a / 2, "rod.x": a + b / 2, "slider.x": a + b}, rates={"crank.phi": 1.0})
    soft = rx.ElasticJoints(mechanism, {"K1": (1e-8, 1e-6), "K2": (1e-8, 1e-6)} | {f"f{k}": 1e-6 for k, _ in FEET})
    bands = rx.band(mechanism, state, [f"f{k}.perpendicular" for k, _ in FEET], soft)
    np.testing.assert_allclose([bands.lower, bands.upper], 10 * G / 3, rtol=1e-9)
    with pytest.raises(rx.RedundaxError, match="`bounds` must be a closure or a `MisfitBox` where one-sided contacts"):
        rx.band(mechanism, state, "f0.perpendicular")


RAILS, FEET = (("K1", 0.1), ("K2", -0.1)), ((0, -0.3), (1, 0.0), (2, 0.3))


def test_what_may_move_is_refused():
    mechanism, state = block(0.3, 2)
    moving = rx.State(state.q, jnp.array([1.0, 0.0, 0.0]))
    with pytest.raises(rx.RedundaxError, match="beside joints with friction that move, but is left out"):
        rx.band(mechanism, moving, "f0.perpendicular")
    with pytest.raises(rx.RedundaxError, match="`bounds`"):
        rx.band(rx.mechanisms.wojtyra2020(), rx.mechanisms.wojtyra2020().state(phi=0.8, rate=0.0), "A.x")


def test_families_hold_the_solutions_in_which_feet_push():
    """The one self-stress of a table adds +1 to two feet and -1 to the others: each carries from 0 to half of all."""
    mechanism = table_of_joints()
    state, amounts = rx.assemble(mechanism), np.linspace(-40.0, 40.0, 9)
    family = rx.solution_family(mechanism, state, z=amounts)
    inside = np.abs(amounts) <= 10 * G / 4
    np.testing.assert_array_equal(family.count, inside)
    np.testing.assert_allclose(family.z[:, 0], amounts[inside], rtol=0, atol=1e-12)
    feet = np.stack([family[f"f{k}.axial"] for k in range(1, 5)])
    assert feet.min() > 0
    np.testing.assert_allclose(feet.sum(axis=0), 10 * G, rtol=1e-12)
    for call, asked in ((rx.band, "f1.axial"), (rx.limit_load, {"table.x": 1.0})):
        with pytest.raises(rx.RedundaxError, match="`rank` and `factor` must be left out where contacts are one-sided"):
            call(mechanism, state, asked, rank=3)


def test_a_block_on_feet_sticks_slips_or_tips():
    """By mu m g against the push: margin mu m g / push - 1. From m g 0.3/0.5 on a foot lifts, and that is said."""
    for mu, push, verdict in ((0.3, 20.0, "must stick"), (0.3, 40.0, "must slip"), (0.9, 70.0, None)):
        mechanism, state = block(mu, 2, push)
        if verdict is None:
            with pytest.raises(rx.NoSolutionError, match=r"Contacts would pull in f0\.perpendicular"):
                rx.sticking(mechanism, state)
            continue
        found = rx.sticking(mechanism, state)
        assert found.verdict == verdict and found.proved
        np.testing.assert_allclose(found.margin, mu * 10 * G / push - 1, rtol=0, atol=1e-6)
