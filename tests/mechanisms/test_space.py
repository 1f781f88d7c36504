"""Mechanisms in space: ranks and freedoms, closed forms, planar ones among them, and other ways to state the same."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import spaces
from mechanisms import CASES as PLANAR
from test_mechanisms import pieces
from truth import governor

import redundax as rx
from redundax import spatial


def over(names, *quick):
    """All names, those that are not quick with the slow tests."""
    return pytest.mark.parametrize(
        "name", [pytest.param(n, marks=() if n in quick else pytest.mark.slow) for n in names]
    )


every_case = over(spaces.CASES, "door", "bennett", "bricard")


def close(value, truth, tolerance, size=None):
    size = np.max(np.abs(truth)) if size is None else size
    return np.max(np.abs(np.asarray(value) - truth)) <= tolerance * (size or 1.0)


# Facts --------------------------------------------------------------------------------------


@every_case
@pytest.mark.parametrize("place", [None, *(pytest.param(k, marks=pytest.mark.slow) for k in range(3))])
def test_counts(name, place):
    case = spaces.CASES[name]
    found = rx.analyze(case.mechanism, case.at(None if place is None else case.places[place]))
    assert (len(found.coordinates), len(found.rows)) == (case.n, case.m)
    assert (found.rank, found.redundancy, found.freedom) == (case.rank, case.m - case.rank, case.n - case.rank)
    assert found.problem == "" and found.unique_accelerations and found.gap > 1e10
    assert found.self_stress.shape[0] == case.m - case.rank


@pytest.mark.slow
def test_every_hinge_more_repeats_five_constraints():
    for count in (1, 3):
        door = rx.mechanisms.door(np.linspace(0.2, 1.8, count))
        assert rx.solve(door, rx.assemble(door)).stats.redundancy == 5 * (count - 1)


@pytest.mark.slow
def test_every_arm_of_sarrus_more_repeats_three_constraints():
    linkage = rx.mechanisms.sarrus((0.0, 1.0, 2.5))
    assert rx.solve(linkage, rx.assemble(linkage)).stats.redundancy == 4


def test_door_falls_as_a_plate_about_its_axis():
    door = rx.mechanisms.door(width=0.9, thickness=0.05, lean=0.1)
    for angle in (0.4, 2.0):
        found = rx.solve(door, rx.assemble(door, positions={"hinge 1.angle": angle}))
        expected = -9.81 * np.sin(0.1) * 0.45 * np.sin(angle) / (0.9**2 / 3 + 0.05**2 / 12)
        assert close(found["hinge 1.angle''"], expected, 1e-12)
        shown = next(line.split() for line in str(found).splitlines() if line.startswith("door.x "))
        assert abs(float(shown[1]) - 0.45 * np.cos(angle)) < 1e-6


def test_bennett_turns_as_bennett_says():
    alpha, beta, theta = 0.5, 1.1, 1.3
    linkage = rx.mechanisms.bennett(twist=alpha, other_twist=beta, angle=theta)
    ratio = np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2)
    phi = 2 * np.arctan(ratio / np.tan(theta / 2))
    for turn in (0.2, -0.5, 0.9):
        found = rx.solve(linkage, rx.assemble(linkage, positions={"A.angle": turn}, rates={"A.angle": 1.0}))
        first, second = np.tan((theta + turn) / 2), np.tan((phi + found["B.angle"]) / 2)
        assert abs(first * second - ratio) < 1e-12
        assert close(found["C.angle'"], -1.0, 1e-12) and close(found["D.angle'"], -found["B.angle'"], 1e-12)


def test_bricard_has_two_angles_of_bars_in_turn():
    """(1 + cos theta) (1 + cos phi) = 1 for the angles from bar to bar."""
    case = spaces.CASES["bricard"]
    for place in case.places:
        p = case.mechanism.poses(case.at(place).q).axes
        along = np.array([-np.asarray([0.0, 0.0, 1.0]), *np.asarray(p)[:-1, :, 0]])
        cosines = np.einsum("ij,ij->i", along, np.roll(along, -1, axis=0))
        assert np.ptp(cosines[::2]) < 1e-13 and np.ptp(cosines[1::2]) < 1e-13
        assert abs((1 + cosines[0]) * (1 + cosines[1]) - 1) < 1e-13 and abs(cosines[0]) > 0.05


def test_sarrus_folds_as_its_energy_says():
    linkage = rx.mechanisms.sarrus(length=0.3, angle=0.6, mass=0.5, platform_mass=2.0)
    found = rx.solve(linkage, rx.assemble(linkage, positions={"B1.angle": 0.2}))
    rise, rate = 0.6 - 0.1, 1.5  # the knee turns by twice as much as the bars
    found = rx.solve(linkage, rx.assemble(linkage, found.q, rates={"platform.z": 2 * 0.3 * np.cos(rise) * rate}))
    s, c = np.sin(rise), np.cos(rise)
    inertia = 0.3**2 * (4 * 2.0 * c**2 + 2 * 0.5 * (2 / 3 + 2 * c**2))
    slope = -(0.3**2) * c * s * (8 * 2.0 + 4 * 2 * 0.5)
    bend = -(9.81 * 0.3 * c * (2 * 2.0 + 2 * 2 * 0.5) + slope * rate**2 / 2) / inertia
    assert close(found["platform.z''"], 0.6 * (c * bend - s * rate**2), 1e-12)
    assert max(abs(found[f"platform.{x}''"]) for x in ("x", "y", "phi_x", "phi_y", "phi_z")) < 1e-12


@pytest.mark.parametrize(("other", "fork"), [(0.5, 0.0), (0.3, 0.0), (0.5, np.pi / 2), (0.3, 0.7)])
@pytest.mark.slow
def test_cardan_shaft_turns_in_closed_form(other, fork):
    drive = rx.mechanisms.double_cardan(0.5, other, fork)
    for angle in (0.4, -1.0):
        found = rx.solve(drive, rx.assemble(drive, positions={"inlet.angle": angle}, rates={"inlet.angle": 2.0}))

        def outlet(theta):
            psi = jnp.arctan(np.cos(0.5) * jnp.tan(theta)) + fork
            return jnp.arctan(jnp.tan(psi) / np.cos(other)) - np.arctan(np.tan(fork) / np.cos(other))

        value, rate = jax.jvp(outlet, (jnp.asarray(angle),), (jnp.asarray(2.0),))
        assert abs(np.sin(found["outlet.angle"] - value)) < 1e-13
        assert close(found["outlet.angle'"], float(rate), 1e-12)


@pytest.mark.slow
def test_the_rod_of_rssr_spins_idly():
    """The spin is a freedom, its acceleration 0, and the rest does not feel it."""
    case = spaces.CASES["rssr"]
    mechanism, still = case.mechanism, case.at(0.2)
    still = rx.assemble(mechanism, still.q, rates={"A.angle": 1.0, "rod.phi_x": 0.0})
    spun = rx.assemble(mechanism, still.q, rates={"A.angle": 1.0, "rod.phi_x": 5.0})
    first, second = (rx.solve(mechanism, state) for state in (still, spun))
    assert first.stats.freedom == 2
    assert close(second["A.angle''"], first["A.angle''"], 1e-2) and abs(second["rod.phi_x''"]) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("place", [None, *spaces.CASES["delta"].places])
def test_delta_shifts_without_turning(place):
    """Rank and freedoms by NumPy from velocities of points and angular velocities at a pose; lengths of rods."""
    case = spaces.CASES["delta"]
    state = case.at(place)
    pose = jax.tree.map(np.asarray, case.mechanism.poses(state.q))
    matrix = rates_across_joints(*spaces.parts(case.mechanism), pose)
    assert matrix.shape == (case.m, case.n)
    *_, values, motions = np.linalg.svd(matrix)
    assert np.sum(values > 1e-9) == case.rank and values[case.rank - 1] > 1e-3
    platform = motions[case.rank :, :6]
    assert np.max(np.abs(platform[:, 3:])) < 1e-12 and np.linalg.matrix_rank(platform[:, :3]) == 3
    assert np.max(np.abs(pose.axes[0] - np.eye(3))) < 1e-12
    found, up = rx.solve(case.mechanism, state), spaces.Z
    for k in range(3):
        angle, turn = 0.3 + found[f"shoulder {k + 1}.angle"], 2 * np.pi / 3 * k
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        line = pose.r[0] + (0.06 - 0.2 - 0.25 * np.cos(angle)) * out + 0.25 * np.sin(angle) * up
        assert abs(np.linalg.norm(line) - 0.55) < 1e-12


def rates_across_joints(bodies, joints, pose):
    """What revolutes and universal joints hold, by velocities of origins and angular velocities, global components."""
    at = {body.name: k for k, body in enumerate(bodies)}
    rows = []
    for joint in joints:
        i, j = at[joint.i], at.get(joint.j, -1)
        point = pose.r[i] + pose.axes[i] @ np.asarray(joint.point_i)
        axis_i, axis_j = pose.axes[i] @ np.asarray(joint.axes_i)[:, 2], pose.axes[j] @ np.asarray(joint.axes_j)[:, 2]
        held = (
            [np.cross(axis_i, axis_j)] if isinstance(joint, spatial.Universal) else np.linalg.svd(axis_j[None])[2][1:]
        )
        spin = np.concatenate([np.zeros((len(held), 3)), held], axis=1)
        own = np.zeros((3 + len(held), len(bodies), 6))
        for body, sign in ((i, 1.0), (j, -1.0)):
            if body >= 0:
                by_spin = np.cross(np.eye(3), point - pose.r[body]).T
                own[:, body] += sign * np.concatenate([np.concatenate([np.eye(3), by_spin], axis=1), spin])
        rows.append(own.reshape(len(own), -1))
    return np.concatenate(rows)


@pytest.mark.slow
def test_governor_speeds_up_as_by_its_three_freedoms():
    mechanism = rx.mechanisms.governor()
    for a, s, *rates in ((0.6, 0.55, 0.0, 0.0, 5.0), (0.4, 0.6, 0.3, -0.2, -3.0)):
        fall = a - governor.ANGLE
        places = {"axis.angle": 0.7, "pin 1.angle": fall, "pin 2.angle": -fall, "sleeve.travel": s - governor.L / 2}
        speeds = dict(zip(places, (rates[2], rates[0], -rates[0], rates[1]), strict=True))
        found = rx.solve(mechanism, rx.assemble(mechanism, positions=places, rates=speeds))
        truth = governor.accelerations(a, s, *rates)
        given = [found[f"{name}''"] for name in ("pin 1.angle", "sleeve.travel", "axis.angle")]
        assert close(given, truth, 1e-11) and close(found["pin 2.angle''"], -truth[0], 1e-11)


# Planar mechanisms built of spatial parts ---------------------------------------------------

FLAT = ("doubled four-bar", "slider-crank, two guides", "wojtyra2020")
every_plane = over(FLAT, "doubled four-bar")


def both(name):
    """The planar mechanism without loads, the same in space, and the planar state."""
    bodies, joints, rest = pieces(PLANAR[name])
    gravity = np.asarray(rest["gravity"])
    planar = rx.Mechanism(bodies, joints, gravity=gravity)
    return planar, spaces.lifted(bodies, joints, gravity), PLANAR[name].state


def in_space(state):
    return rx.State(spaces.position_in_space(state.q), spaces.velocity_in_space(state.qd), state.t)


@every_plane
def test_planar_accelerations_and_unique_loads(name):
    planar, mechanism, state = both(name)
    first, second = rx.solve(planar, state), rx.solve(mechanism, in_space(state))
    assert close(second.acceleration, spaces.velocity_in_space(first.acceleration), 1e-12)
    verdicts = rx.analyze(planar, state).verdicts["reaction"]
    unique = [load.name for load in verdicts if load.without_friction is rx.Verdict.UNIQUE]
    size = max(abs(first[label]) for label in unique)
    for label in unique:
        assert abs(second[label.replace("moment", "moment z")] - first[label]) <= 1e-12 * size


@pytest.mark.slow
def test_planar_motion():
    """Of pins and guides, these twice."""
    planar, mechanism, state = both("slider-crank, two guides")
    times = np.linspace(0.0, 2.0, 11)
    first = rx.simulate(planar, state, 2.0, ts=times, rtol=1e-11)
    second = rx.simulate(mechanism, in_space(state), 2.0, ts=times, rtol=1e-11)
    wanted, half = spaces.position_in_space(first.q), 3 * len(planar.names.bodies)
    assert close(second.q[:, :half], wanted[:, :half], 1e-9)
    turns = [q[:, half:].reshape(11, -1, 4) for q in (np.asarray(second.q), wanted)]
    assert np.max(1 - np.abs(np.einsum("tbp,tbp->tb", *turns))) < 1e-9
    assert close(second.qd, spaces.velocity_in_space(first.qd), 1e-9)


# The same stated in other ways --------------------------------------------------------------

MOVED = ("bennett", "sarrus", "double cardan")
every_moved = over(MOVED, "bennett")
TURN = np.array([[0.6, -0.8, 0.0], [0.48, 0.36, -0.8], [0.64, 0.48, 0.6]])


def solved(bodies, joints, gravity, name, sign=1.0):
    mechanism, coordinate = rx.Mechanism(bodies, joints, gravity=gravity), spaces.CASES[name].coordinate
    state = rx.assemble(mechanism, positions={coordinate: sign * 0.3}, rates={coordinate: sign})
    return rx.solve(mechanism, state)


def original(name):
    mechanism = spaces.CASES[name].mechanism
    bodies, joints = spaces.parts(mechanism)
    found = solved(bodies, joints, mechanism.gravity, name)
    verdicts = rx.analyze(mechanism, found.state).verdicts["reaction"]
    unique = [load.name for load in verdicts if load.without_friction is rx.Verdict.UNIQUE]
    return bodies, joints, mechanism.gravity, found, unique


def ends(joint):
    return (joint.point_i, joint.axes_i), (joint.point_j, joint.axes_j)


@every_moved
def test_turned_and_shifted(name):
    bodies, joints, gravity, first, _ = original(name)
    shift = np.array([1.0, -2.0, 0.5])
    turned = [
        spatial.Body(
            body.name,
            body.mass,
            body.inertia,
            centre=body.centre,
            position=TURN @ body.position + shift,
            orientation=TURN @ _matrix(body.orientation),
        )
        for body in bodies
    ]
    again = []
    for joint in joints:
        on = [
            (TURN @ point + shift, TURN @ axes) if end == rx.GROUND else (point, axes)
            for end, (point, axes) in zip((joint.i, joint.j), ends(joint), strict=True)
        ]
        again.append(spaces.joint(type(joint), joint.name, joint.i, joint.j, *on))
    second, count = solved(turned, again, TURN @ gravity, name), len(bodies)
    size = max(np.max(np.abs(first.acceleration)), np.max(np.abs(first.qd)) ** 2)  # that of their terms
    linear = np.asarray(first.acceleration)[: 3 * count].reshape(-1, 3) @ TURN.T
    assert close(second.acceleration[: 3 * count], linear.ravel(), 1e-12, size)
    assert close(second.acceleration[3 * count :], first.acceleration[3 * count :], 1e-12, size)
    forces = [np.asarray(found.reactions).reshape(-1, 2, 3) for found in (first, second)]
    assert close(forces[1], forces[0] @ TURN.T, 1e-11)  # the closure weighs rows, in axes of joints


def _matrix(p):
    w, v = p[0], np.asarray(p[1:])
    skew = np.cross(np.eye(3), v)
    return np.eye(3) + 2 * w * skew + 2 * skew @ skew


def by_name(found):
    labels = (*found.names.coordinates.labels, *found.names.reactions.labels)
    return dict(zip(labels, np.concatenate([found.acceleration, found.reactions]).tolist(), strict=True))


def same(first, second, names, tolerance=1e-11):
    first, second = by_name(first), by_name(second)
    size = max(map(abs, first.values()))
    return all(abs(first[name] - second[name]) <= tolerance * size for name in names)


@every_moved
def test_order_does_not_matter(name):
    bodies, joints, gravity, first, _ = original(name)
    second = solved(bodies[::-1], joints[::-1], gravity, name)
    assert same(first, second, by_name(first))


@every_moved
def test_another_mark_changes_no_load(name):
    bodies, joints, gravity, first, unique = original(name)
    about_z = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    again = [
        spaces.joint(
            type(joint), joint.name, joint.i, joint.j, *((point, axes @ about_z) for point, axes in ends(joint))
        )
        for joint in joints
        if isinstance(joint, spatial.Revolute)
    ]
    again += [joint for joint in joints if not isinstance(joint, spatial.Revolute)]
    second = solved(bodies, again, gravity, name)
    assert same(first, second, [*first.names.coordinates.labels, *unique])


@every_moved
def test_another_origin_changes_nothing(name):
    bodies, joints, gravity, first, _ = original(name)
    offset = {body.name: np.array([0.1, -0.3, 0.2]) * (k + 1) for k, body in enumerate(bodies)}
    offset[rx.GROUND] = np.zeros(3)
    shifted = [
        spatial.Body(
            body.name,
            body.mass,
            body.inertia,
            centre=body.centre - offset[body.name],
            position=body.position + _matrix(body.orientation) @ offset[body.name],
            orientation=body.orientation,
        )
        for body in bodies
    ]
    again = [
        spaces.joint(
            type(joint),
            joint.name,
            joint.i,
            joint.j,
            *((point - offset[end], axes) for end, (point, axes) in zip((joint.i, joint.j), ends(joint), strict=True)),
        )
        for joint in joints
    ]
    assert same(first, solved(shifted, again, gravity, name), by_name(first))


@every_moved
def test_bodies_of_joints_exchanged(name):
    """The unique forces on the bodies are the same, each the opposite of that on the other body."""
    bodies, joints, gravity, first, unique = original(name)
    again = [spaces.joint(type(joint), joint.name, joint.j, joint.i, *ends(joint)[::-1]) for joint in joints]
    second = solved(bodies, again, gravity, name, sign=-1.0)
    assert close(second.acceleration, first.acceleration, 1e-11)
    before, after = by_name(first), by_name(second)
    size = max(map(abs, before.values()))
    for label in unique:
        if " force " in label:
            here = next(other for other in after if other.startswith(label.rpartition(" on ")[0]))
            sign = 1 if here == label else -1
            assert abs(after[here] - sign * before[label]) <= 1e-11 * size


@every_moved
def test_millimetres(name):
    bodies, joints, gravity, first, unique = original(name)
    u = 1000.0
    larger = [
        spatial.Body(
            body.name,
            body.mass,
            body.inertia * u**2,
            centre=body.centre * u,
            position=body.position * u,
            orientation=body.orientation,
        )
        for body in bodies
    ]
    again = [
        spaces.joint(type(joint), joint.name, joint.i, joint.j, *((point * u, axes) for point, axes in ends(joint)))
        for joint in joints
    ]
    second, half = solved(larger, again, gravity * u, name), 3 * len(bodies)
    assert second.stats.rank == first.stats.rank
    assert close(second.acceleration[:half] / u, first.acceleration[:half], 1e-11, np.max(np.abs(first.acceleration)))
    assert close(second.acceleration[half:], first.acceleration[half:], 1e-11)
    size = max((abs(first[label]) for label in unique), default=0.0)
    for label in unique:
        assert abs(second[label] / u ** (2 if " moment " in label else 1) - first[label]) <= 1e-11 * size


# Derivatives --------------------------------------------------------------------------------

BY = {
    "bricard by length and mass": (lambda x: rx.mechanisms.bricard(length=x, mass=x**2), 1.1, "A.angle", 0.3),
    "sarrus by length": (lambda x: rx.mechanisms.sarrus(length=x), 0.3, "platform.z", None),
    "cardan by angle": (lambda x: rx.mechanisms.double_cardan(x, 0.4), 0.5, "inlet.angle", 0.4),
    "door by width": (lambda x: rx.mechanisms.door(width=x), 0.9, "hinge 1.angle", 0.4),
}


@over(BY)
def test_derivatives_are_those_of_differences(name):
    """With the mechanism assembled anew."""
    make, at, coordinate, place = BY[name]

    def accelerations(x):
        mechanism = make(x)
        positions = None if place is None else {coordinate: place}
        state = rx.assemble(mechanism, rates={coordinate: 1.3}, positions=positions)
        return rx.solve(mechanism, state).acceleration

    both, h = jax.jit(lambda x: jax.jvp(accelerations, (x,), (1.0,))), 1e-5
    slope, difference = both(at)[1], (both(at + h)[0] - both(at - h)[0]) / (2 * h)
    assert np.max(np.abs(difference)) > 1e-3
    assert np.max(np.abs(slope - difference)) <= 1e-7 * (1 + np.max(np.abs(slope)))
