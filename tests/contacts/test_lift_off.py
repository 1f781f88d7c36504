"""Which contact loses its load first as a load grows: against closed forms, and enumeration of all active sets."""

import jax.numpy as jnp
import numpy as np
import pytest
from test_contacts import G, enumerated, table, table_of_joints

import redundax as rx


def test_a_table_pushed_askew_lifts_the_foot_behind_first():
    """Equal legs carry m g / 4 and what the push of s (cx, cy) makes of them, s 0.7 (x cx / 0.8^2 + y cy / 0.6^2).

    Without the foot behind the other three are determined; it tips about two of them.
    """
    mechanism, (cx, cy) = table_of_joints(held_aside=True), (1.0, 0.5)
    legs = rx.ElasticJoints(mechanism, {f"f{k}": 1e-6 for k in range(1, 5)})
    found = rx.lift_off(mechanism, rx.assemble(mechanism), {"table.x": cx, "table.y": cy}, legs)
    first = 10 * G / 4 / (0.7 * (0.4 * cx / 0.64 + 0.3 * cy / 0.36))
    assert found.first == ("f1",) and found.amounts[0] == pytest.approx(first, rel=1e-10)
    # Then f2 + f3 = m g / 2 + s 0.7 cx / 0.8 and f3 + f4 = m g / 2 + s 0.7 cy / 0.6, of m g in all.
    tips = 10 * G * 0.4 / (0.7 * cx)
    assert found.tips == pytest.approx(tips, rel=1e-10) and found.tips == found.amounts[-1]
    assert found.contacts[-1] == {"f1": "lifts", "f2": "carries", "f3": "carries", "f4": "lifts"}
    assert found.loads[1]["f4"] == pytest.approx(10 * G / 2 - 0.7 * first * cx / 0.8, rel=1e-10)
    tipping = rx.limit_load(mechanism, rx.assemble(mechanism), {"table.x": cx, "table.y": cy})
    assert tipping.upper == pytest.approx(found.tips, rel=1e-7)
    assert f"From {first:.6g}: f1 touches; f2 " in str(found)


@pytest.mark.parametrize("feet", [4, pytest.param(6, marks=pytest.mark.slow)])
def test_amounts_against_all_active_sets(feet):
    """Between two amounts the same feet carry, of all sets the one that fits; loads are affine, so two of them tell the
    amount at which the next is none."""
    rng, mass, changes = np.random.default_rng(feet), np.array([10.0, 0.8, 1.1]), 0
    for _ in range(6):
        at = rng.uniform(-1, 1, (feet, 2))
        at[:4] = np.abs(at[:4]) * [[-1, -1], [1, -1], [1, 1], [-1, 1]]  # about the centre
        compliance, misfit = rng.uniform(0.5, 2, feet) * 1e-6, rng.normal(size=feet) * 1e-5
        weight, force = np.array([-98.1, 0.0, 0.0]), rng.normal(size=3)
        jacobian = -np.column_stack([np.ones(feet), at[:, 1], -at[:, 0]])
        closure = rx.Compliance(jnp.diag(jnp.asarray(compliance)), jnp.asarray(misfit))
        state = rx.State(jnp.zeros(3), jnp.zeros(3))
        found = rx.lift_off(table(at, weight), state, force, closure)
        ends = [0.0, *found.amounts]
        for k, (low, high) in enumerate(zip(ends, [*found.amounts, 2 * ends[-1] + 1.0], strict=True)):
            some = low + (high - low) * np.array([0.25, 0.75])
            (one, _, active), (two, *_) = (
                enumerated(jacobian, mass, weight + s * force, compliance, misfit) for s in some
            )
            assert tuple(j for j, does in enumerate(found.contacts[k].values()) if does == "carries") == active
            if k < len(found.amounts):
                after = [*found.contacts[k + 1].values()]
                for j in (j for j in active if after[j] != "carries"):
                    none = some[0] - one[j] * (some[1] - some[0]) / (two[j] - one[j])
                    assert none == pytest.approx(high, rel=1e-9)
                    changes += 1
            if np.isfinite(found.tips) and high == found.tips:
                break
    assert changes > 6


def test_a_push_at_a_point_is_a_load():
    """A weight of one beyond the corner is a force and its moments; it tips by its level where it pushes aside."""
    mechanism = table_of_joints(held_aside=True)
    still, legs = rx.assemble(mechanism), rx.ElasticJoints(mechanism, {f"f{k}": 1e-6 for k in range(1, 5)})
    top = rx.spatial.Body("table", 10.0, inertia=(1.0, 1.0, 1.5), centre=(0.0, 0.0, 0.7))
    down = rx.spatial.AppliedForce(top, force=(0.0, 0.0, -1.0), point=(0.6, 0.4, 0.0))
    np.testing.assert_allclose(mechanism.load_of(down, still), [0, 0, -1, -0.4, 0.6, 0], atol=1e-15)
    found = rx.lift_off(mechanism, still, down, legs)
    assert found.load == {"table.z": -1.0, "table.phi_x": -0.4, "table.phi_y": 0.6}
    aside = rx.spatial.AppliedForce(top, force=(1.0, 0.0, 0.0), point=(0.0, 0.0, 1.4))
    assert rx.limit_load(mechanism, still, aside).upper == pytest.approx(10 * G * 0.4 / 1.4, rel=1e-7)
    spinning = rx.State(still.q, jnp.arange(1.0, 7.0))  # inertia is no part of a load
    np.testing.assert_allclose(mechanism.load_of(aside, spinning)[:3], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(mechanism.load_of(aside, spinning)[3:], [0, 1.4 - 0.7, 0], rtol=1e-14)
    with pytest.raises(ValueError, match=r"Argument `load`: .* is planar and its first body spatial.*`rx.spatial`"):
        rx.limit_load(mechanism, still, rx.AppliedForce("table", force=(1.0, 0.0)))
    with pytest.raises(ValueError, match="desk"):
        rx.lift_off(mechanism, still, rx.spatial.AppliedForce(rx.spatial.Body("desk", 1.0, inertia=(1, 1, 1))))
    with pytest.raises(ValueError, match="must not be zero"):
        rx.limit_load(mechanism, still, rx.spatial.AppliedForce(top))
    with pytest.raises(ValueError, match="or a load of mechanisms"):
        rx.lift_off(mechanism, still, "table")


def test_what_has_no_order_is_refused():
    mechanism = table_of_joints(held_aside=True)
    state, push = rx.assemble(mechanism), {"table.x": 1.0}
    loose = rx.ElasticJoints(mechanism, {"f1": 1e-6}, play={"f1": 1e-5})
    with pytest.raises(rx.RedundaxError, match="`closure` must have no play"):
        rx.lift_off(mechanism, state, push, loose)
    feet = [
        rx.PinInSlot(name, "block", "ground", (x, 0.0), (x, 0.0), (0.0, 1.0), rx.Coulomb(0.3), one_sided=True)
        for name, x in (("a", -0.3), ("b", 0.3))
    ]
    block = rx.Mechanism([rx.Body("block", 10.0, 1.0)], feet, gravity=(0.0, -G))
    with pytest.raises(rx.RedundaxError, match="`system` must have no friction"):
        rx.lift_off(block, rx.State(jnp.zeros(3), jnp.zeros(3)), {"block.x": 1.0})
    rod = rx.Mechanism([rx.Body("rod", 1.0, 1.0)], [rx.Revolute("A", "rod", "ground", (0.0, 0.0), (0.0, 0.0))])
    with pytest.raises(rx.RedundaxError, match="`system` must have one-sided contacts"):
        rx.lift_off(rod, rx.State(jnp.zeros(3), jnp.zeros(3)), {"rod.phi": 1.0})


def standing(weight=10 * G, push=0.0):
    """A table on four feet at (±0.4, ±0.3) m, its centre of mass 0.7 m up, a block against x at one foot."""
    top = rx.spatial.Body("table", 10.0, inertia=(1.0, 1.0, 1.5), centre=(0.0, 0.0, 0.7))
    corners = {"f1": (-0.4, -0.3), "f2": (0.4, -0.3), "f3": (0.4, 0.3), "f4": (-0.4, 0.3)}
    feet = [rx.spatial.PointOnPlane(name, top, "ground", (*at, 0.0), one_sided=True) for name, at in corners.items()]
    block = rx.spatial.PointOnPlane("block", top, "ground", (0.4, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
    loads = [rx.spatial.AppliedForce(top, (push, 0.0, 0.0), point=(0.0, 0.0, 0.7))] if push else []
    return rx.Mechanism([top], [*feet, block], loads=loads, gravity=(0.0, 0.0, -weight / 10))


def test_a_table_that_rocks_comes_down_under_a_load_at_a_corner():
    """With f1 shorter by d = 0.1 mm, legs of c = 1e-6 m/N, f2 and f4 carry alone; s over f4 bends it by c s. The table
    stands on all four as that is d less 2 c 49.05 N, and f1 = f3 = (s - 1.9) / 4 from there on, until f2 has none."""
    mechanism = standing()
    legs = rx.Compliance(jnp.eye(5) * 1e-6, jnp.zeros(5).at[0].set(-1e-4))
    load = {"table.z": -1.0, "table.phi_x": -0.3, "table.phi_y": -0.4}
    found = rx.lift_off(mechanism, rx.assemble(mechanism), load, legs)
    np.testing.assert_allclose(found.amounts, [1.9, 10 * G + 100.0], rtol=1e-9)
    assert found.first == ("f2",) and found.first_amount == found.amounts[1] and np.isinf(found.tips)
    assert found.contacts[0] == {"f1": "touches", "f2": "carries", "f3": "touches", "f4": "carries"}
    np.testing.assert_allclose([found.loads[2][name] for name in ("f1", "f3")], 49.05, rtol=1e-9)


def test_without_weight_a_load_presses_or_takes_off():
    mechanism = standing(weight=0.0)
    state = rx.assemble(mechanism)
    assert rx.lift_off(mechanism, state, {"table.z": 1.0}).tips == 0
    pressed = rx.lift_off(mechanism, state, {"table.z": -1.0})
    assert np.isinf(pressed.tips) and set(pressed.contacts[-1].values()) == {"carries"}


def test_what_tips_already_is_refused():
    mechanism = standing(push=80.0)
    with pytest.raises(rx.NoSolutionError, match="lift without the load, f1, f4, so that it does not stand"):
        rx.lift_off(mechanism, rx.assemble(mechanism), {"table.x": 1.0})
