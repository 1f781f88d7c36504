"""Joints in space: what each leaves free, what its rows mean, its coordinates; wheels, screws and shafts."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

rs, START = rx.spatial, jnp.zeros(())
HERE = rs.Placement((0, 0, 0))
ROD = rx.Mechanism([rx.Body("rod", 1.0, 0.1)], [rx.Revolute("A", "rod", "ground", (0, 0), (0, 0))])

# Kind, arguments, its own unknowns of motion: freedom of body i relative to body j.
PAIRS = {
    "Revolute": (rs.Revolute, {}, 1),
    "Prismatic": (rs.Prismatic, {}, 1),
    "Cylindrical": (rs.Cylindrical, {}, 2),
    "Spherical": (rs.Spherical, {}, 3),
    "Planar": (rs.Planar, {}, 3),
    "Screw": (rs.Screw, {"pitch": 0.05}, 1),
    "Fixed": (rs.Fixed, {}, 0),
    "PointOnLine": (rs.PointOnLine, {}, 4),
    "PointOnPlane": (rs.PointOnPlane, {}, 5),
    "ParallelAxes": (rs.ParallelAxes, {}, 4),
    "ConstantVelocity": (rs.ConstantVelocity, {}, 2),
    "AngleDriver": (rs.AngleDriver, {"angle": 0.0}, 5),
    "TravelDriver": (rs.TravelDriver, {"travel": 0.0}, 5),
}
POINT, AXIS, MARK = np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, -2.0]) / 3, np.array([0.0, 1.0, 0.3])


def turn(angle, axis):
    """Rotation matrix about a unit axis, by Rodrigues' formula."""
    K = np.cross(np.eye(3), np.asarray(axis, float))
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def bodies():
    a = rs.Body(
        "a", 2.0, (0.3, 0.4, 0.5), centre=(0.1, 0.2, -0.1), position=(0.4, 0.1, 0.0), orientation=turn(0.7, AXIS)
    )
    b = rs.Body(
        "b", 1.0, [[0.3, 0.02, 0.0], [0.02, 0.4, 0.01], [0.0, 0.01, 0.5]], position=(-0.3, 0.2, 0.1),
        orientation=turn(-1.1, (0.6, 0.0, 0.8)),
    )  # fmt: skip
    return a, b


def pair(kind):
    make, options, _ = PAIRS[kind]
    a, b = bodies()
    return rx.Mechanism(
        [a, b], [make("J", a, b, POINT, AXIS, MARK, **options), rs.PointOnPlane("base", b, "ground", POINT)]
    )


def joint_axes():
    x = MARK - (MARK @ AXIS) * AXIS
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(AXIS, x), AXIS], axis=1)


def global_rates(mechanism, rates):
    """Velocity of the point of the joint on both bodies, and their angular velocities, from velocities (12,)."""
    out = []
    for k, body in enumerate(bodies()):
        p = np.asarray(body.orientation)
        w, v = p[0], p[1:]
        R = np.eye(3) + 2 * (w * np.cross(np.eye(3), v) + np.cross(np.eye(3), v) @ np.cross(np.eye(3), v))
        omega = R @ rates[6 + 3 * k : 9 + 3 * k]
        com = np.asarray(body.position) + R @ np.asarray(body.centre)
        out.append((rates[3 * k : 3 * k + 3] + np.cross(omega, POINT - com), omega))
    return out


@pytest.mark.parametrize("kind", PAIRS)
def test_rows_are_rates_in_the_axes_of_the_joint(kind):
    """Closed at the reference pose; force-type rows are relative velocities of the point, moment-type ones relative
    angular velocities, in the axes of the joint; so a pair leaves the freedom that its name says."""
    mechanism = pair(kind)
    q = mechanism.reference
    np.testing.assert_allclose(mechanism.constraint(q, START), 0, atol=1e-15)
    jacobian = np.asarray(mechanism.jacobian(q, START))
    rows = [k for k, name in enumerate(mechanism.rows.labels) if name.startswith("J.")]
    assert np.linalg.matrix_rank(jacobian[rows]) == len(rows) == 6 - PAIRS[kind][2]
    parts = {"radial_1": 0, "radial_2": 1, "axial": 2, "bend_1": 3, "bend_2": 4, "twist": 5}
    axes, generator = joint_axes(), np.random.default_rng(3)
    for _ in range(3):
        rates = generator.normal(size=12)
        (v_a, w_a), (v_b, w_b) = global_rates(mechanism, rates)
        relative = np.concatenate([axes.T @ (v_a - v_b), axes.T @ (w_a - w_b)])
        if kind == "Screw":
            relative[2] -= 0.05 / (2 * np.pi) * relative[5]
        expected = [relative[parts[mechanism.rows.labels[k].removeprefix("J.")]] for k in rows]
        np.testing.assert_allclose(jacobian[rows] @ rates, expected, atol=1e-13)


@pytest.mark.parametrize("kind", [kind for kind in PAIRS if PAIRS[kind][2] and "Driver" not in kind])
def test_coordinates_are_zero_at_the_reference_pose_and_move_with_the_joint(kind):
    mechanism = pair(kind)
    names = mechanism.names.joint_coordinates.labels
    own = [k for k, name in enumerate(names) if name.startswith("J.")]
    rates = np.random.default_rng(5).normal(size=12)
    motion = mechanism.joint_coordinates.motion(rx.State(mechanism.reference, rates), jnp.zeros(12))
    (v_a, w_a), (v_b, w_b) = global_rates(mechanism, rates)
    shift, spin = joint_axes().T @ (v_a - v_b), joint_axes().T @ (w_a - w_b)
    parts = {"angle": spin[2], "travel": shift[2], "travel_1": shift[0], "travel_2": shift[1]}
    np.testing.assert_allclose(np.asarray(motion.position)[own], 0, atol=1e-15)
    np.testing.assert_allclose(
        np.asarray(motion.rate)[own], [parts[names[k].removeprefix("J.")] for k in own], atol=1e-13
    )


@pytest.mark.parametrize("kind", ["Fixed", "Revolute", "Prismatic"])
@pytest.mark.slow
def test_no_false_closure_half_a_turn_away(kind):
    """Rows that vanish at a half turn would let assembly end there: all axes come back to where they were."""
    body = rs.Body("a", 1.0, (1.0, 1.0, 1.0))
    mechanism = rx.Mechanism([body], [PAIRS[kind][0]("J", body, "ground", (0, 0, 0), (0, 0, 1))])
    for axis in ((1.0, 0.0, 0.0), (0.6, 0.8, 0.0)):
        q = jnp.concatenate([jnp.zeros(3), jnp.array([np.cos(1.5), *np.sin(1.5) * np.array(axis)])])  # 3 rad
        found = rx.assemble(mechanism, q).q[3:]
        np.testing.assert_allclose((found[1:3] @ found[1:3]) / (found @ found), 0, atol=1e-24)


@pytest.mark.slow
def test_a_screw_travels_by_its_pitch():
    nut = rs.Body("nut", 2.0, (0.1, 0.1, 0.2))
    mechanism = rx.Mechanism([nut], [rs.Screw("S", nut, "ground", (0, 0, 0), pitch=0.3)], gravity=(0, 0, -9.81))
    state = rx.assemble(mechanism, positions={"S.angle": 1.2}, rates={"S.angle": 2.0})
    solution = rx.solve(mechanism, state)
    lead = 0.3 / (2 * np.pi)
    np.testing.assert_allclose([state.q[2], state.qd[2]], [1.2 * lead, 2.0 * lead], rtol=1e-12)
    np.testing.assert_allclose(solution["S.angle''"], -2.0 * 9.81 * lead / (0.2 + 2.0 * lead**2), rtol=1e-12)
    turns = rx.assemble(mechanism, mechanism.retract(mechanism.reference, jnp.array([0, 0, 0.6, 0, 0, 0])))
    np.testing.assert_allclose(turns.q[2], 0.6, rtol=1e-12)  # two whole pitches


@pytest.mark.slow
def test_cardan_and_constant_velocity_shafts():
    """tan a_2 = tan a_1 cos(beta) of a Cardan joint, whose rate varies; equal angles and rates of the other."""
    beta = 0.5
    out = np.array([0.0, np.sin(beta), np.cos(beta)])
    one = rs.Body("one", 1.0, (0.1, 0.1, 0.1))
    two = rs.Body("two", 1.0, (0.1, 0.1, 0.1), orientation=turn(-beta, (1, 0, 0)))
    bearings = [
        rs.Revolute("A", one, "ground", (0, 0, 0), (0, 0, 1)),
        rs.Cylindrical("B", two, "ground", (0, 0, 0), out, (1, 0, 0)),
    ]
    cross = rs.Universal("U", two, one, (0, 0, 0), axis_i=np.cross(out, (1, 0, 0)), axis_j=(1, 0, 0))
    even = rs.ConstantVelocity("U", two, one, (0, 0, 0), axis=(0, np.sin(beta / 2), np.cos(beta / 2)))
    for angle in (0.4, 1.1, -0.8):
        of_cross, of_even = (
            rx.solve(mechanism, rx.assemble(mechanism, positions={"A.angle": angle}, rates={"A.angle": 1.0}))
            for mechanism in (rx.Mechanism([one, two], [*bearings, joint]) for joint in (cross, even))
        )
        np.testing.assert_allclose(np.tan(of_cross["B.angle"]), np.tan(angle) * np.cos(beta), rtol=1e-12)
        ratio = np.cos(beta) / (1 - np.sin(beta) ** 2 * np.sin(angle) ** 2)
        np.testing.assert_allclose(of_cross["B.angle'"], ratio, rtol=1e-12)
        np.testing.assert_allclose([of_even["B.angle"], of_even["B.angle'"]], [angle, 1.0], rtol=1e-12)


def gear(a, point, axis, teeth, **options):
    """A gear of wheels on the z axis of body a, and elsewhere on the ground."""
    return rs.Gear("J", a, "ground", (0, 0, 0), (0, 0, 1), point, axis, teeth=teeth, **options)


def wheel(name, place=(0.0, 0.0, 0.0), **options):
    return rs.Body(name, 1.0, (0.1, 0.1, 0.2), position=place, **options)


@pytest.mark.slow
def test_spur_wheels_turn_by_their_teeth_and_press_tangentially():
    a, b = wheel("a"), wheel("b", (0.08, 0, 0))
    joints = [rs.Revolute("A", a, "ground", (0, 0, 0)), rs.Revolute("B", b, "ground", (0.08, 0, 0))]
    mesh = rs.Gear("mesh", a, b, (0, 0, 0), (0, 0, 1), (0.08, 0, 0), (0, 0, 1), teeth=(20, 60))
    motor = rs.AngleDriver("motor", a, "ground", (0, 0, 0), angle=rx.Polynomial([0.0, 0.0, 1.5]))
    mechanism = rx.Mechanism([a, b], [*joints, mesh, motor])
    state = rx.assemble(mechanism, t=0.8)
    found = rx.solve(mechanism, state)
    np.testing.assert_allclose([found["A.angle"], found["B.angle"]], [0.96, -0.32], rtol=1e-12)
    np.testing.assert_allclose(found["B.angle''"], -1.0, rtol=1e-12)
    force = 0.2 * 1.0 / 0.06  # turns b by its inertia, at the pitch point
    np.testing.assert_allclose([found["B force y on b"], found["A force y on a"]], [-force, force], rtol=1e-9)
    np.testing.assert_allclose(found["mesh.twist"], force * 0.02, rtol=1e-9)


@pytest.mark.slow
def test_bevel_wheels_and_a_planet_that_rolls():
    """A differential: cage c, side wheels 1 and 2 on the x axis, one planet: (w_1 + w_2) / 2 = w_c."""
    one, two, cage = wheel("one"), wheel("two"), wheel("cage")
    planet = wheel("planet")
    origin, x, y, above = (0, 0, 0), (1.0, 0, 0), (0, 1.0, 0), (0, 0.1, 0)
    joints = [
        rs.Revolute("one", one, "ground", origin, x), rs.Revolute("two", two, "ground", origin, x),
        rs.Revolute("cage", cage, "ground", origin, x), rs.Revolute("planet", planet, cage, origin, y),
        rs.Gear("left", one, planet, (-0.05, 0, 0), (-1.0, 0, 0), above, y, teeth=(30, 15)),
        rs.Gear("right", two, planet, (0.05, 0, 0), x, above, y, teeth=(30, 15)),
    ]  # fmt: skip
    mechanism = rx.Mechanism([one, two, cage, planet], joints)
    for angles in ((0.5, 1.2), (-0.4, 0.9)):
        positions = dict(zip(("one.angle", "two.angle"), angles, strict=True))
        state = rx.assemble(mechanism, positions=positions, rates={"one.angle": 2.0, "two.angle": -1.0})
        found = rx.solve(mechanism, state)
        np.testing.assert_allclose([found["cage.angle"], found["cage.angle'"]], [sum(angles) / 2, 0.5], rtol=1e-11)
        np.testing.assert_allclose(found["planet.angle'"], 3.0, rtol=1e-11)  # 1.5 rad/s at 0.1 m is 3 at 0.05 m
    assert rx.analyze(mechanism, state).freedom == 2


def bevel(angle, teeth, flipped=1.0):
    """Two bevel wheels at rest on axes at an angle in the plane z = 0, in bearings away from the pitch circles; of the
    first, of radius 0.05 m, 2 N m are held by the other."""
    r_i, r_j = 0.05, 0.05 * teeth[1] / teeth[0]
    z_i, z_j = np.array([1.0, 0, 0]), np.array([np.cos(angle), np.sin(angle), 0])
    m_i, m_j = np.array([0.0, 1.0, 0]), np.array([np.sin(angle), -np.cos(angle), 0])  # from the axes to the pitch point
    # L_i z_i + r_i m_i = L_j z_j + r_j m_j, from the apex
    l_i, l_j = np.linalg.solve(np.stack([z_i, -z_j], 1)[:2], (r_j * m_j - r_i * m_i)[:2])
    one, two = wheel("one"), wheel("two")
    joints = [
        rs.Revolute("1", one, "ground", (l_i + 0.1) * z_i, z_i),
        rs.Revolute("2", two, "ground", (l_j + 0.2) * z_j, z_j),
        rs.Gear("mesh", one, two, l_i * z_i, flipped * z_i, l_j * z_j, flipped * z_j, teeth=teeth),
    ]  # fmt: skip
    torques = 2.0 * z_i, 2.0 * teeth[1] / teeth[0] * z_j
    loads = [rs.AppliedForce(name, moment=moment) for name, moment in zip(("one", "two"), torques, strict=True)]
    return rx.Mechanism([one, two], joints, loads=loads), l_i * z_i + r_i * m_i


@pytest.mark.parametrize(
    ("angle", "teeth", "flipped"), [(np.pi / 2, (20, 20), 1.0), (np.pi / 3, (12, 30), -1.0), (0.9, (20, -60), 1.0)]
)
def test_bevel_teeth_press_on_the_bearings_at_the_pitch_point(angle, teeth, flipped):
    """2 N m at 0.05 m: 40 N along the common tangent, one way on each wheel; bearings hold it and its moment."""
    mechanism, pitch = bevel(angle, teeth, flipped)
    found = rx.solve(mechanism, rx.State(mechanism.reference, jnp.zeros(12)))
    np.testing.assert_allclose(found.acceleration, 0, atol=1e-12)
    for name, body, force in (("1", "one", [0, 0, 40.0]), ("2", "two", [0, 0, -40.0])):
        read = {kind: [found[f"{name} {kind} {axis} on {body}"] for axis in "xyz"] for kind in ("force", "moment")}
        np.testing.assert_allclose(read["force"], force, atol=1e-10)
        z = np.array([1.0, 0, 0]) if name == "1" else np.array([np.cos(angle), np.sin(angle), 0])
        seat = {"1": 0.1, "2": 0.2}[name] * z + (pitch @ z) * z
        about_seat = -np.cross(pitch - seat, force)  # of the teeth, with the torque along the axis
        moment = -(about_seat - (about_seat @ z) * z)
        np.testing.assert_allclose(read["moment"], moment, atol=1e-10)


def test_spur_wheels_of_opposite_axes_turn_opposite_ways_too():
    """Whichever way the axes of the wheels point, teeth outside turn them against each other: 3 w_b = -w_a."""
    for sense in (1.0, -1.0):
        a, b = wheel("a"), wheel("b", (0.08, 0, 0))
        joints = [rs.Revolute("A", a, "ground", (0, 0, 0)), rs.Revolute("B", b, "ground", (0.08, 0, 0))]
        mesh = rs.Gear("mesh", a, b, (0, 0, 0), (0, 0, 1), (0.08, 0, 0), (0, 0, sense), teeth=(20, 60))
        mechanism = rx.Mechanism([a, b], [*joints, mesh])
        row = np.asarray(mechanism.jacobian(mechanism.reference, START))[-1]
        np.testing.assert_allclose(row @ [*[0] * 6, 0, 0, 3.0, 0, 0, -1.0], 0, atol=1e-14)


def test_a_worm_couples_angles_alone():
    """40 turns of a worm are one of its wheel; on bearings there is no force."""
    worm, disc = wheel("worm"), wheel("disc", (0.08, 0, 0))
    joints = [rs.Revolute("A", worm, "ground", (0, 0, 0)), rs.Revolute("B", disc, "ground", (0.08, 0, 0), (0, 1, 0))]
    mesh = rs.Gear("mesh", worm, disc, (0, 0, 0), (0, 0, 1), (0.08, 0, 0), (0, 1, 0), teeth=(1, 40))
    mechanism = rx.Mechanism([worm, disc], [*joints, mesh])
    assert mesh.axes == "skew"
    row = np.asarray(mechanism.jacobian(mechanism.reference, START))[-1]
    np.testing.assert_allclose(row[:6], 0, atol=1e-14)
    np.testing.assert_allclose(row[[8, 10]], [1.0, 40.0], atol=1e-12)


def test_wheels_close_where_whole_turns_of_both_bring_them():
    """8 and 12 teeth: half a turn of the first is what whole turns of the second allow, a tooth is not."""
    a, b = wheel("a"), wheel("b", (0.08, 0, 0))
    joints = [rs.Revolute("A", a, "ground", (0, 0, 0)), rs.Revolute("B", b, "ground", (0.08, 0, 0))]
    mesh = rs.Gear("mesh", a, b, (0, 0, 0), (0, 0, 1), (0.08, 0, 0), (0, 0, 1), teeth=(8, 12))
    mechanism = rx.Mechanism([a, b], [*joints, mesh])
    residuals = []
    for half in (np.pi / 2 - 1e-7, np.pi / 8):
        q = jnp.concatenate([mechanism.reference[:6], jnp.array([np.cos(half), 0, 0, np.sin(half), 1.0, 0, 0, 0])])
        residuals.append(mechanism.constraint(q, START)[-1])
    np.testing.assert_allclose(np.abs(residuals), [2e-7, np.pi / 4], atol=1e-12)


@pytest.mark.parametrize("differentiated", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_own_joint_of_ten_lines(differentiated):
    """A point of body i on a sphere about a point of body j, with everything working on it."""

    class OnSphere(rs.AbstractPlacedJoint):
        row_kinds = (("radius", "force"),)

        def residual(self, i, j, t):
            offset = self.relative(i, j).offset
            return (offset @ offset - 0.25)[None]

    a = rs.Body("a", 1.0, (0.1, 0.1, 0.1))
    on = rs.Placement
    ball = OnSphere("S", "a", "ground", on_i=on((0, 0, 0)), on_j=on((0, 0, 0.5)))
    mechanism = rx.Mechanism([a], [ball], gravity=(0, 0, -9.81))
    state = rx.assemble(mechanism, jnp.array([0.5 * np.sin(0.3), 0, 0.5 - 0.5 * np.cos(0.3), 1, 0, 0, 0]))
    found = rx.solve(mechanism, state)
    np.testing.assert_allclose(found["a.x''"], -9.81 * np.sin(0.3) * np.cos(0.3), rtol=1e-12)
    if not differentiated:
        return
    grown = jax.grad(lambda g: rx.solve(mechanism_of(a, ball, g), state)["a.x''"])(-9.81)
    np.testing.assert_allclose(grown, np.sin(0.3) * np.cos(0.3), rtol=1e-9)


def test_rows_that_are_no_components_need_a_residual():
    class Lift(rs.AbstractPlacedJoint):
        row_kinds = (("axial", "force"), ("height", "force"))

    lift = Lift("L", "a", "ground", on_i=HERE, on_j=HERE)
    with pytest.raises(rx.RedundaxError, match=r"of a `Lift` must be among .* but one is 'height'.*write `residual`"):
        rx.Mechanism([rs.Body("a", 1.0, (0.1, 0.1, 0.1))], [lift])


def mechanism_of(a, ball, g):
    return rx.Mechanism([a], [ball], gravity=jnp.stack([jnp.zeros(()), jnp.zeros(()), g]))


@pytest.mark.parametrize("swapped", [False, True])
def test_a_joint_load_in_the_frame_that_is_asked_for(swapped):
    """A plate welded to the ground off its centre of mass: weight and its moment about the weld, in three frames; on
    the plate whichever body comes first."""
    R, axis, point = turn(0.7, AXIS), np.array([0.0, 0.6, 0.8]), np.array([0.3, 0.1, -0.2])
    plate = rs.Body("plate", 2.0, (0.1, 0.2, 0.25), centre=(0.5, 0.1, 0.0), position=(1.0, 0, 0), orientation=R)
    ends = ("ground", plate) if swapped else (plate, "ground")
    mechanism = rx.Mechanism([plate], [rs.Fixed("weld", *ends, point, axis, MARK)], gravity=(0, 0, -9.81))
    state = rx.assemble(mechanism)
    np.testing.assert_allclose(mechanism.point(state, "plate", (0.5, 0.1, 0.0)), state.q[:3], rtol=1e-14)
    multipliers = rx.solve(mechanism, state).multipliers
    force = np.array([0, 0, 2 * 9.81])
    moment = -np.cross(np.asarray(state.q[:3]) - point, [0, 0, -2 * 9.81])
    x = MARK - (MARK @ axis) * axis
    x /= np.linalg.norm(x)
    frames = {"global": np.eye(3), "body": R, "joint": np.stack([x, np.cross(axis, x), axis], 1)}
    for frame, axes in frames.items():
        found = rs.joint_wrench(mechanism, state, multipliers, "weld", frame)
        np.testing.assert_allclose(found.force, axes.T @ force, atol=1e-12)
        np.testing.assert_allclose(found.moment, axes.T @ moment, atol=1e-12)
    if not swapped:
        np.testing.assert_allclose(multipliers[:3], -frames["joint"].T @ force, atol=1e-12)


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 1, 0), (1, 1, 1)])
def test_rounding_of_an_axis_does_not_turn_the_joint(axis):
    """Directions that are equally far from the axis: the first of them marks it, whichever way components round."""
    exact = np.asarray(rs.Placement((0, 0, 0), axis).axes)
    for k in range(3):
        for step in (1e-16, -1e-16, 1e-12):
            near = rs.Placement((0, 0, 0), np.array(axis) + step * np.eye(3)[k]).axes
            np.testing.assert_allclose(near, exact, atol=1e-11)
    traced = jax.jit(lambda axis: rs.Placement((0, 0, 0), axis).axes)(jnp.asarray(axis, float))
    np.testing.assert_allclose(traced, exact, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda a: rs.Fixed("J", a, "ground", (0, 0, 0), friction=rx.Coulomb(0.1)), "is Coulomb: joints of"),
        (lambda a: rs.Revolute("J", "a", "ground", (0, 0, 0)), "Give the `Body`"),
        (lambda a: rs.Revolute("J", a, "ground"), "has neither"),
        (lambda a: rs.Revolute("J", a, "ground", axis=(1, 0, 0), on_i=HERE, on_j=HERE), "would count for nothing"),
        (lambda a: rs.Prismatic("J", a, "ground", mark=(1, 1, 0), on_i=HERE, on_j=HERE), "would count for nothing"),
        (lambda a: rs.Screw("J", a, "ground", axis=(1, 0, 0), pitch=0.1, on_i=HERE, on_j=HERE), "count for nothing"),
        (lambda a: rs.Universal("J", a, "ground", axis_i=(1, 0, 0), on_i=HERE, on_j=HERE), "would count for nothing"),
        (lambda a: rs.AngleDriver("J", a, "ground", axis=(1, 0, 0), angle=0, on_i=HERE, on_j=HERE), "for nothing"),
        (lambda a: rs.Distance("J", a, "ground", (0, 0, 1), distance=1.0), "only one of two"),
        (lambda a: rs.Distance("J", a, "ground", point_j=(0, 0, 1), distance=1.0), "only one of two"),
        (lambda a: rs.Gear("J", a, "ground", (0, 0, 0), teeth=(20, 60)), "only one of two"),
        (lambda a: rs.SpringDamper(a, "ground", (0, 0, 1), stiffness=5.0), "only one of two"),
        (lambda a: rs.Fixed("J", a, "ground", on_i=HERE), "only one of two"),
        (lambda a: rs.Bushing(a, "ground", axis=(1, 0, 0), on_i=HERE, on_j=HERE), "would count for nothing"),
        (lambda a: rs.Revolute("J", a, "ground", (0, 0)), "3 components"),
        (lambda a: rs.Revolute("J", a, "ground", (0, 0, 0), (0, 0, 0)), "not all zero"),
        (lambda a: rs.Revolute("J", a, "ground", (0, 0, 0), (0, 0, 1), (0, 0, 2)), "must not be along the axis"),
        (lambda a: rs.Gear("J", a, "ground", (0, 0, 0), point_j=(1, 0, 0), teeth=(3, 0)), "not 0"),
        (lambda a: rs.Revolute("J", a, "ground", (0, 0, 0), (0, 0, 1), (0, 0, 0)), "`mark` of joint 'J' must have"),
        (lambda a: rs.Revolute("J", a, "ground", (0, 0, 0), (np.inf, 0, 0)), "`axis` of joint 'J' must have"),
        (lambda a: rs.Revolute("J", a, "ground", (0, 0, 0), (0, 0, 1), (0, 1)), "`mark` of joint 'J' must have"),
        (lambda a: rs.Universal("J", a, "ground", (0, 0, 0), (1, 0, 0), (1, 1, 0)), "`axis_j` .* must be square"),
        (lambda a: rs.Universal("J", a, "ground", (0, 0, 0), (1, 0, 0), (1, 0, 0)), "`axis_j` .* must be square"),
        (lambda a: rs.Universal("J", a, "ground", (0, 0, 0), (0, 0, 0)), "`axis_i` must have three"),
        (lambda a: rs.TravelDriver("J", a, "ground", (0, 0, 0), travel=(1.0, 2.0)), "`travel` of a driver"),
        (lambda a: rs.joint_wrench(ROD, rx.State(jnp.zeros(3), jnp.zeros(3)), jnp.zeros(2), "A"), "but is planar"),
        (lambda a: rs.Screw("J", a, "ground", (0, 0, 0), pitch=0.0), "`pitch` of joint 'J' must not be 0"),
        (lambda a: rs.Screw("J", a, "ground", (0, 0, 0), pitch=(1.0, 2.0)), "`pitch` must be a number"),
        (lambda a: rs.Distance("J", a, "ground", (0, 0, 0), (0, 0, 0)), "`distance` of 'J' must be positive"),
        (lambda a: rs.Distance("J", a, "ground", (0, 0, 0), (0, 0, 1), -1.0), "`distance` of 'J' must be positive"),
        (lambda a: gear(a, (0.1, 0, 0), (0, 0, 1), (-20, -60)), "and the larger"),
        (lambda a: gear(a, (0.1, 0, 0), (0, 0, 1), (20, -20)), "and the larger"),
        (lambda a: gear(a, (0, 0, 0.1), (0, 0, 1), (20, 60)), "apart where axes are parallel"),
        (lambda a: gear(a, (0, 0, 0), (1, 0, 0), (20, 20)), "middles of the pitch circles"),
        (lambda a: gear(a, (-0.1, 0, 0.1), (-1, 0, 0), (20, 20)), "middles of the pitch circles"),
        (lambda a: gear(a, (-0.1, 0, 0.1), (1, 0, 0), (20, 40)), "middles of the pitch circles"),
        (lambda a: gear(a, (0.1, 0, 0), (0, 0, 1), (20, 60), axes="parallel"), "must be left out"),
        (lambda a: rs.Distance("J", a, "ground", on_i=(0, 0, 0), on_j=(0, 0, 1)), "Give a length"),
        (lambda a: rs.Body("b", 1.0, (1.0, 1.0)), "principal values"),
        (lambda a: rs.Body("b", 1.0, (1.0, 1.0, -1.0)), "no negative principal value"),
        (lambda a: rs.Body("b", 1.0, (1, 1, 1), orientation=np.diag([1.0, 1.0, -1.0])), "right-handed"),
        (lambda a: rx.Mechanism([a], [rs.Fixed("J", a, "ground", (0, 0, 0))]).poses(jnp.zeros(6)), r"shape \(7,"),
        (lambda a: rx.Mechanism([a], [rx.Revolute("J", "a", "ground", (0, 0), (0, 0))]), "all planar or all spatial"),
    ],
)  # fmt: skip
def test_bad_input_says_what_to_do(make, words):
    with pytest.raises(rx.RedundaxError, match=words):
        make(rs.Body("a", 1.0, (1.0, 1.0, 1.0)))


def test_no_body_has_one_moment_of_inertia_above_the_sum_of_the_others():
    with pytest.warns(UserWarning, match="about the centre of mass"):
        rs.Body("b", 1.0, (1.0, 1.0, 3.0))
