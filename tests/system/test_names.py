"""Results, closures and guesses by name: the same entries as by place, and joint coordinates in closed form.

A bead slides without friction on a rod that turns about the origin at a rate w that it keeps, its inertia being
infinite beside the bead's. With r the travel and phi the angle,

    r'' = r w^2 - g sin(phi),   phi'' = 0.
"""

import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax.plot._draw._arrows import joint_arrows
from redundax.plot._draw._scene import scene

G, R, RATE, PHI, W = 9.81, 0.7, -0.4, 0.6, 3.0


def bead(names=("rod", "bead", "hub", "guide"), copies=1):
    """The rod's inertia is prescribed motion: the hub is driven."""
    rod, sliding, hub, guide = names
    joints = [
        rx.Revolute(hub, rod, rx.GROUND, (0.0, 0.0), (0.0, 0.0)),
        *(rx.Translational(f"{guide}{k}", sliding, rod, (0.0, 0.0), (0.0, 0.0), (0.0, 1.0)) for k in range(copies)),
        rx.AngleDriver("motor", rod, rx.GROUND, rx.Polynomial([PHI, W])),
    ]
    return rx.Mechanism([rx.Body(rod, 2.0, 0.3), rx.Body(sliding, 0.5, 0.1)], joints, gravity=(0.0, -G))


def bead_state(r=R, rate=RATE):
    c, s = np.cos(PHI), np.sin(PHI)
    q = jnp.stack([0.0, 0.0, r * c, r * s, PHI, PHI])
    return rx.State(q, jnp.stack([0.0, 0.0, rate * c - r * W * s, rate * s + r * W * c, W, W]))


def paper(rate=1.0, friction=True):
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02 if friction else None)
    return mechanism, mechanism.state(phi=0.8, rate=rate)


# Solutions and motions -------------------------------------------------------------------------------


def test_joint_coordinates_of_a_solution_are_those_in_closed_form():
    solution = rx.solve(bead(), bead_state())
    wanted = {"guide0.travel": R, "guide0.travel'": RATE, "guide0.travel''": R * W**2 - G * np.sin(PHI)}
    wanted |= {"hub.angle": PHI, "hub.angle'": W, "hub.angle''": 0.0, "rod.phi": PHI, "bead.x'": bead_state().qd[2]}
    for name, value in wanted.items():
        np.testing.assert_allclose(solution[name], value, rtol=1e-12, atol=1e-12, err_msg=name)
    # the guide holds the bead against its weight and Coriolis' force; its row has the sign of the force on the bead
    force = 0.5 * (2 * RATE * W + G * np.cos(PHI))
    np.testing.assert_allclose(solution["guide0.perpendicular"], force, rtol=1e-12)


def hanging(i="rod", j=rx.GROUND):
    """A rod of 3 kg that hangs by its end at rest; either of rod and ground may be body i."""
    points = {"rod": (-0.5, 0.0), rx.GROUND: (0.2, 0.1)}
    rod = rx.Mechanism([rx.Body("rod", 3.0, 0.25)], [rx.Revolute("A", i, j, points[i], points[j])], gravity=(0.0, -G))
    return rod, rx.State([0.2, -0.4, -np.pi / 2], [0.0, 0.0, 0.0])


@pytest.mark.parametrize("ends", [("rod", rx.GROUND), (rx.GROUND, "rod")])
def test_the_pin_holds_a_hanging_rod_up(ends):
    """The force on the rod is its weight, up; the multiplier is minus the force on body i, whichever that is."""
    mechanism, state = hanging(*ends)
    solution = rx.solve(mechanism, state)
    np.testing.assert_allclose(solution["A force y on rod"], 3.0 * G, rtol=1e-14)
    np.testing.assert_allclose(solution["A.y"], -3.0 * G if ends[0] == "rod" else 3.0 * G, rtol=1e-14)
    np.testing.assert_allclose([solution["A force x on rod"], solution["A moment on rod"]], 0.0, atol=1e-12)
    (arrow,) = joint_arrows(scene(mechanism, state), mechanism, state, np.asarray(solution.multipliers))
    assert arrow.body == "rod"
    np.testing.assert_allclose(arrow.force, [0.0, 3.0 * G, 0.0], rtol=1e-14)


def test_the_wall_holds_a_beam():
    """A beam of 2 kg, its centre 0.4 m to the right of where it is built in, turned by 30 degrees against its frame."""
    wall = rx.Fixed("W", "beam", rx.GROUND, (-0.4 * np.cos(0.5), 0.4 * np.sin(0.5)), (0.0, 0.0), 0.5)
    beam = rx.Mechanism([rx.Body("beam", 2.0, 0.1)], [wall], gravity=(0.0, -G))
    solution = rx.solve(beam, rx.State([0.4, 0.0, 0.5], [0.0, 0.0, 0.0]))
    np.testing.assert_allclose(solution.reactions, [0.0, 2.0 * G, 2.0 * G * 0.4], atol=1e-12)
    assert float(solution["W moment on beam"]) == solution.reactions[2]


@pytest.mark.slow
def test_the_guide_holds_the_bead_against_weight_and_coriolis_force():
    r, rates = jnp.array([0.5, 0.7, 0.9]), jnp.array([-1.0, 2.0])
    solve = jax.jit(jax.vmap(jax.vmap(lambda r, rate: rx.solve(bead(), bead_state(r, rate)), (None, 0)), (0, None)))
    force = np.broadcast_to(0.5 * (2 * rates * W + G * np.cos(PHI)), (3, 2))
    found = solve(r, rates)
    np.testing.assert_allclose(found["guide0 force x on bead"], -np.sin(PHI) * force, rtol=1e-11)
    np.testing.assert_allclose(found["guide0 force y on bead"], np.cos(PHI) * force, rtol=1e-11)
    np.testing.assert_allclose(found["guide0 moment on bead"], 0.0, atol=1e-11)
    # the motor turns the rod, against the bead's force on it, at the hub
    np.testing.assert_allclose(found["motor moment on rod"], force * r[:, None], rtol=1e-11)
    units = rx.units.Units(length=1000.0, mass=0.002, time=3.0)
    system, state = bead(), bead_state()
    there = rx.solve(rx.units.in_units(system, units), rx.units.state_in_units(state, system, units))
    moment = 0.5 * (2 * RATE * W + G * np.cos(PHI)) * R
    np.testing.assert_allclose(there["motor moment on rod"], 0.002 * 1e6 / 9 * moment, rtol=1e-11)


@pytest.mark.slow
def test_forces_of_a_batch_with_a_sample_without_solution_leave_gradients_alone():
    mechanism, _ = paper()

    def total(rates):
        solved = jax.vmap(lambda rate: rx.solve(mechanism, mechanism.state(phi=0.8, rate=rate)))(rates)
        forces = solved["A force x on 1"]
        return jnp.sum(jnp.where(jnp.isfinite(forces), forces, 0.0)), forces

    (_, forces), slope = jax.value_and_grad(total, has_aux=True)(jnp.array([1.0, 0.0]))  # at rest there is none
    assert np.isnan(forces[1])
    assert np.isfinite(slope).all()
    assert slope[0] != 0


def test_names_are_those_of_the_entries_in_order():
    mechanism, state = paper()
    solution = rx.solve(mechanism, state)
    for array, names in (
        (solution.acceleration, [f"{body}.{axis}''" for body in "1234" for axis in "xy"]),
        (solution.multipliers, [f"{joint}.{axis}" for joint in "ABCD" for axis in "xy"]),
        (solution.friction, [f"tau {joint}" for joint in "ABCD"]),
    ):
        assert [float(solution[name]) for name in names] == array[: len(names)].tolist()


@pytest.mark.slow
def test_names_pass_through_jit_and_batches():
    system = bead()

    def solved(r, rate):
        return rx.solve(system, bead_state(r, rate))

    r, rate = jnp.array([0.5, 0.7, 0.9]), jnp.array([-1.0, 2.0])
    found = jax.jit(jax.vmap(jax.vmap(solved, (None, 0)), (0, None)))(r, rate)
    wanted = np.broadcast_to(r[:, None] * W**2 - G * np.sin(PHI), (3, 2))
    np.testing.assert_allclose(found["guide0.travel''"], wanted, rtol=1e-11)
    np.testing.assert_allclose(found["guide0.travel'"], np.broadcast_to(rate, (3, 2)), rtol=1e-12)
    assert found["hub.x"].shape == (3, 2)
    assert np.array_equal(found["hub.x"], found.multipliers[..., 0])


def test_gradients_of_named_entries_are_those_in_closed_form():
    system = bead()
    slope = jax.jit(jax.grad(lambda r: rx.solve(system, bead_state(r))["guide0.travel''"]))(R)
    np.testing.assert_allclose(slope, W**2, rtol=1e-11)


@pytest.mark.slow
def test_sample_without_solution_leaves_gradients_of_joint_coordinates_alone():
    mechanism, _ = paper()

    def total(rates):
        solved = jax.vmap(lambda rate: rx.solve(mechanism, mechanism.state(phi=0.8, rate=rate)))(rates)
        return jnp.sum(jnp.where(solved.result == rx.RESULTS.successful, solved["A.angle''"], 0.0)), solved

    (_, solved), slope = jax.value_and_grad(total, has_aux=True)(jnp.array([1.0, 0.0]))  # at rest there is none
    assert np.isnan(solved["A.angle''"][1])
    assert np.isfinite(slope).all()
    assert slope[0] != 0


@pytest.mark.slow
def test_names_of_a_motion_are_those_in_closed_form():
    """The bead starts at r with r' = 0: r = r_p + A cosh(w t) + B sinh(w t), r_p = g sin(phi + w t) / (2 w^2)."""
    motion = rx.simulate(bead(), bead_state(rate=0.0), 0.3, ts=jnp.linspace(0.0, 0.3, 7))
    t, part = np.linspace(0.0, 0.3, 7), G / (2 * W**2)
    free = (R - part * np.sin(PHI)) * np.cosh(W * t) - part * np.cos(PHI) * np.sinh(W * t)
    r = free + part * np.sin(PHI + W * t)
    np.testing.assert_allclose(motion["guide0.travel"], r, rtol=1e-6)
    np.testing.assert_allclose(motion["guide0.travel''"], r * W**2 - G * np.sin(PHI + W * t), rtol=1e-6)
    np.testing.assert_allclose(motion["hub.angle"], PHI + W * t, rtol=1e-9)
    np.testing.assert_allclose(motion["bead.x"], r * np.cos(PHI + W * t), rtol=1e-6)
    assert np.array_equal(motion["guide0.perpendicular"], motion.multipliers[:, 2])
    along = np.stack([motion["guide0 force x on bead"], motion["guide0 force y on bead"] - 0.5 * G])
    np.testing.assert_allclose(along, 0.5 * np.stack([motion["bead.x''"], motion["bead.y''"]]), rtol=1e-10, atol=1e-10)


@pytest.mark.slow
def test_names_of_a_motion_in_a_batch():
    system, ts = bead(), jnp.linspace(0.0, 0.05, 3)
    motions = jax.vmap(lambda r: rx.simulate(system, bead_state(r), 0.05, ts=ts))(jnp.array([0.5, 0.7]))
    np.testing.assert_allclose(motions["guide0.travel"], np.hypot(motions["bead.x"], motions["bead.y"]), rtol=1e-12)
    assert motions["guide0.travel''"].shape == (2, 3)


def test_other_units_change_joint_coordinates_alike():
    system, state, units = bead(), bead_state(), rx.units.Units(length=1000.0, time=2.0)
    there = rx.solve(rx.units.in_units(system, units), rx.units.state_in_units(state, system, units))
    np.testing.assert_allclose(there["guide0.travel'"], 1000 * RATE / 2, rtol=1e-12)
    np.testing.assert_allclose(there["guide0.travel''"], 1000 / 4 * (R * W**2 - G * np.sin(PHI)), rtol=1e-12)
    back = rx.units.solution_from_units(there, system, units)
    np.testing.assert_allclose(back["guide0.travel''"], R * W**2 - G * np.sin(PHI), rtol=1e-12)
    np.testing.assert_allclose(back["bead.x'"], state.qd[2], rtol=1e-12)


def test_band_of_a_joint_coordinate_that_no_self_stress_reaches():
    """The bead on two guides, one on the other: any preload of theirs leaves its acceleration alone."""
    bands = rx.band(bead(copies=2), bead_state(), "guide1.travel''", rx.AmplitudeBox({"guide0.perpendicular": (-9, 9)}))
    np.testing.assert_allclose([bands.lower[0], bands.upper[0]], R * W**2 - G * np.sin(PHI), rtol=1e-11)
    assert bands.exact.all()
    assert bands.kinds == ("linear",)


def test_band_of_a_joint_coordinate_is_that_of_the_body():
    """A crank on the ground: its joint turns as it does."""
    mechanism, state = paper()
    bounds = rx.AmplitudeBox({"A.x": (-40.0, 40.0)})
    bands = rx.band(mechanism, state, ["A.angle''", "1.phi''"], bounds, samples=8, starts=1)
    assert bands.lower[0] == bands.lower[1] < bands.upper[0] == bands.upper[1]


@pytest.mark.slow
def test_study_takes_names_from_its_results():
    system = bead()
    found = rx.study(lambda r: rx.solve(system, bead_state(r)), {"r": np.array([0.5, 0.7])}, chunk=2)
    np.testing.assert_allclose(found.acceleration.sel(coordinate="rod.phi"), 0.0, atol=1e-12)
    assert found.multipliers.sel(row="hub.x").shape == (2,)
    assert not [name for name in found if "state" in str(name) or "joint" in str(name)]
    travel = rx.study(lambda r: {"travel": rx.solve(system, bead_state(r))["guide0.travel"]}, {"r": np.array([0.5])})
    np.testing.assert_allclose(travel.travel, 0.5)


# What is given by name -------------------------------------------------------------------------------


def by_place(mechanism, given):
    out = np.zeros(len(mechanism.rows))
    for name, value in given.items():
        out[mechanism.rows.names.index(name)] = value
    return out


W_OF, D_OF = {"A.x": 1e-8, "D.x": 2e-8, "K.angle": 1e-6}, {"A.x": 1e-5, "L.angle": 2e-5}


@pytest.mark.parametrize(
    "closure",
    [
        lambda m: rx.Compliance(W_OF, misfit=D_OF),
        lambda m: rx.Compliance(by_place(m, W_OF), misfit=D_OF),
        lambda m: rx.Compliance(W_OF, misfit=by_place(m, D_OF)),
        lambda m: rx.Compliance.from_stiffness({name: 1 / value for name, value in W_OF.items()}, misfit=D_OF),
        lambda m: rx.AsBuilt(rx.Compliance(W_OF, misfit=D_OF), m),
    ],
)
def test_closures_by_name_are_those_by_place(closure):
    mechanism, state = paper(friction=False)
    by_name, given = closure(mechanism), rx.Compliance(by_place(mechanism, W_OF), by_place(mechanism, D_OF))
    wanted = rx.solve(mechanism, state, closure=given).multipliers
    np.testing.assert_allclose(rx.solve(mechanism, state, closure=by_name).multipliers, wanted, rtol=1e-12, atol=1e-12)
    assert not np.allclose(wanted, rx.solve(mechanism, state).multipliers)


def test_reports_and_bands_take_closures_by_name():
    mechanism, state = paper()
    by_name, given = rx.Compliance(W_OF, D_OF), rx.Compliance(by_place(mechanism, W_OF), by_place(mechanism, D_OF))
    one, other = (rx.analyze(mechanism, state, closure=closure) for closure in (by_name, given))
    assert one.spectral_radius == other.spectral_radius
    bounds = [rx.MisfitBox(closure, {"A.x": (-1e-6, 1e-6)}) for closure in (by_name, given)]
    one, other = (rx.band(mechanism, state, "B.x", each, samples=8, starts=1) for each in bounds)
    assert one.lower == other.lower


@pytest.mark.slow
def test_families_and_motions_take_closures_by_name():
    mechanism, state = paper()
    by_name, given = rx.Compliance(W_OF, D_OF), rx.Compliance(by_place(mechanism, W_OF), by_place(mechanism, D_OF))
    one, other = (rx.solution_family(mechanism, state, closure=closure, samples=3) for closure in (by_name, given))
    assert np.array_equal(one.values, other.values)
    (one,), (other,) = (rx.frictional_solutions(mechanism, state, closure=c, starts=4) for c in (by_name, given))
    np.testing.assert_allclose(one["A.x"], other["A.x"], rtol=1e-12)
    one, other = (rx.simulate(mechanism, state, 0.01, closure=c, ts=[0.01]) for c in (by_name, given))
    np.testing.assert_allclose(one["A.x"], other["A.x"], rtol=1e-12)


def test_elastic_joints_by_name_are_those_one_by_one():
    mechanism, state = paper(friction=False)
    guides = [rx.JointCompliance.from_stiffness(name, 5e7, 1e6) for name in "KL"]
    listed = rx.ElasticJoints(mechanism, [*(rx.JointCompliance(name, 1e-8) for name in "ABCD"), *guides])
    named = rx.ElasticJoints(mechanism, dict.fromkeys("ABCD", 1e-8) | dict.fromkeys("KL", (2e-8, 1e-6)))
    one, other = (rx.solve(mechanism, state, closure=closure).multipliers for closure in (listed, named))
    np.testing.assert_allclose(one, other, rtol=1e-12)


def test_senses_by_name_are_those_by_place():
    mechanism, rest = paper(rate=0.0)
    named = rx.solve(mechanism, rest, sense={"D": 1, "B": -1, "A": 1, "C": 1})
    assert np.array_equal(named.acceleration, rx.solve(mechanism, rest, sense=[1, -1, 1, 1]).acceleration)
    left_out = rx.solve(mechanism, rest, sense={"A": 1, "B": -1, "C": 1}, throw=False)
    assert left_out.result == rx.RESULTS.friction_at_rest


def test_assembly_takes_guesses_and_joint_coordinates_by_name():
    mechanism, state = paper()
    guess = {name: value + 0.01 for name, value in zip(mechanism.coordinates.names, state.q.tolist(), strict=True)}
    travel = rx.solve(mechanism, state)["K.travel"], rx.solve(mechanism, state)["K.travel'"]
    for name, value, rate in (("A.angle", 0.8, 1.0), ("K.travel", *travel)):
        closed = rx.assemble(mechanism, guess, positions={name: value}, rates={name: rate})
        np.testing.assert_allclose(closed.q, state.q, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(closed.qd, state.qd, rtol=1e-12, atol=1e-12)


MECHANISM, STATE = paper()


@pytest.mark.parametrize(
    ("call", "argument", "near"),
    [
        (lambda: rx.solve(MECHANISM, STATE)["A.z"], "`name`", "'A.x'"),
        (lambda: rx.solve(MECHANISM, STATE)["K.traval''"], "`name`", "\"K.travel''\""),
        (lambda: rx.solve(MECHANISM, STATE)["A force on 1"], "`name`", "'A force x on 1'"),
        (lambda: rx.solve(MECHANISM, STATE, sense={"a": 1}), "`sense`", "There are A, B, C, D"),
        (lambda: rx.solve(MECHANISM, STATE, closure=rx.Compliance({"A.xx": 1.0})), "`W`", "'A.x'"),
        (lambda: rx.solve(MECHANISM, STATE, closure=rx.Compliance(W_OF, {"K.angel": 1.0})), "`misfit`", "'K.angle'"),
        (lambda: rx.ElasticJoints(MECHANISM, {"M": 1e-8}), "`joints`", "There are A, B, C, D, K, L"),
        (lambda: rx.assemble(MECHANISM, {"1.fi": 0.8}), "`q`", "'1.phi'"),
        (lambda: rx.assemble(MECHANISM, STATE.q, positions={"K.trvel": 0.8}), "`positions`", "'K.travel'"),
        (lambda: rx.solution_family(MECHANISM, STATE, along="A.z"), "`along`", "A.x"),
        (lambda: rx.band(MECHANISM, STATE, "1.ph''", rx.AmplitudeBox({"A.x": (0, 1)})), "`outputs`", "\"1.phi''\""),
        (lambda: rx.heated(MECHANISM, {"5": 40.0}, 1e-5), "`warmer`", "There are 1, 2, 3, 4, ground"),
    ],
)
def test_wrong_names_are_refused_with_near_ones(call, argument, near):
    with pytest.raises(rx.RedundaxError) as caught:
        call()
    assert isinstance(caught.value, KeyError)
    assert argument in str(caught.value)
    assert near in str(caught.value)


def test_few_of_many_names_are_listed_after_near_ones():
    solution = rx.solve(MECHANISM, STATE)
    with pytest.raises(KeyError) as caught:
        solution["A force z on 1"]
    hint, rest = str(caught.value).split("? There are ")
    assert "'A force x on 1'" in hint
    listed, count = re.fullmatch(r"(.*) and (\d+) more: print\(solution\) shows what is called how\.", rest).groups()
    names = listed.split(", ")
    assert len(names) == 8 and set(names) <= {entry.name for entry in solution.entries}
    assert len(names) + int(count) == len(solution.entries)


def test_name_that_two_entries_have_is_refused():
    """A body and a joint of one name: A.x is a position and a multiplier."""
    pin = rx.Revolute("A", "A", rx.GROUND, (-0.5, 0.0), (0.0, 0.0))
    pendulum = rx.Mechanism([rx.Body("A", 1.0, 0.1)], [pin], gravity=(0.0, -G))
    solution = rx.solve(pendulum, rx.State([0.5, 0.0, 0.0], [0.0, 0.0, 0.0]))
    np.testing.assert_allclose(solution["A.phi''"], -G * 0.5 / (0.1 + 0.25), rtol=1e-12)
    with pytest.raises(rx.RedundaxError, match="names 2"):
        solution["A.x"]


def test_friction_that_is_put_in_afterwards_has_names():
    block = rx.System(lambda q, t, p: q[1:], [2.0, 2.0], lambda q, qd, t, p: jnp.array([0.0, -2.0 * G]), n=2)
    rough = rx.Friction(
        lambda q, t, p: q[:1], lambda loads, rate, sense, *_: -0.1 * jnp.abs(loads) * sense, [0], ["linear"]
    )
    block = eqx.tree_at(lambda system: system.friction, block, (rough,))
    solution = rx.solve(block, rx.State(np.zeros(2), [1.0, 0.0]))
    np.testing.assert_allclose(solution["tau 0"], -0.1 * 2.0 * G, rtol=1e-12)
    assert list(block.names.unknowns.kinds[-1:]) == ["friction force"]
