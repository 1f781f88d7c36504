"""Forces of drives against the equation of the one freedom, closed forms and hand calculation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize

import redundax as rx
from redundax._drive import _share

S = rx.spatial
TURNS = np.linspace(0.0, 1.0, 41)  # s: of a crank at 10 rad/s and more, 2.4 turns


def torque_of_one_freedom(mechanism, phi, rate, change):
    """q'(phi)^T (M qdd - Q) along the closed form of the position, for constant masses: the drive on phi alone.

    Of the generalised forces only weight and constant forces act; inertia is that of Newton at each body.
    """

    def of_one(phi, rate, change):
        def q(s):
            return mechanism.pose(phi + s * rate + s**2 / 2 * change)

        slope = jax.jvp(mechanism.pose, (phi,), (jnp.ones(()),))[1]

        def first(s):
            return jax.jvp(q, (s,), (jnp.ones(()),))[1]

        velocity, acceleration = jax.jvp(first, (jnp.zeros(()),), (jnp.ones(()),))
        load = mechanism.load(rx.State(q(0.0), velocity))
        return slope @ (mechanism.mass(q(0.0), jnp.zeros(())) @ acceleration - load)

    return jax.jit(jax.vmap(of_one))(phi, rate, change)


@pytest.mark.parametrize("name", ["slider-crank", "four-bar"])
def test_a_crank_that_turns_needs_the_torque_of_its_one_freedom(name):
    """Speeding up through more than two turns; the driven angle is counted on, and power is what energy takes."""
    if name == "slider-crank":
        mechanism, joint = rx.mechanisms.slider_crank(guides=2, force=-50.0), "A.angle"
    else:
        mechanism, joint = rx.mechanisms.doubled_four_bar(), "A.angle"
    law = rx.Polynomial([0.3, 10.0, 5.0])
    run = rx.drive(mechanism, {joint: law}, TURNS, mechanism.state(0.3).q)
    phi = 0.3 + 10 * TURNS + 5 * TURNS**2
    wanted = torque_of_one_freedom(mechanism, phi, 10 + 10 * TURNS, np.full_like(TURNS, 10.0))
    np.testing.assert_allclose(run[f"{joint} torque"], wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())
    np.testing.assert_allclose(run[joint], phi, atol=1e-12)
    np.testing.assert_allclose(run.q, jax.vmap(mechanism.pose)(phi)[:, : run.q.shape[1]], atol=1e-12)
    np.testing.assert_allclose(
        run[f"{joint} power"], wanted * (10 + 10 * TURNS), rtol=0, atol=1e-9 * run.peak[joint] * 20
    )
    assert np.all(run.determined)
    assert float(run.peak[joint]) == pytest.approx(np.abs(wanted).max(), rel=1e-10)
    assert "determined" in str(run) and joint in str(run)


# Ball screws and jacks ------------------------------------------------------------------------------------

PITCH, STROKE, SPEED, RATE = 0.01, 0.3, 0.2, 2.0
SLIDE = rx.Trapezoid(STROKE, SPEED, RATE, start=-STROKE / 2)


def motor(slide):
    """The angle of the spindle that moves the carriage along a law."""
    return lambda t: -2 * jnp.pi * (slide(t) + STROKE / 2) / PITCH


def stage(friction=0.0):
    """A carriage of 10 kg on four blocks of two rails, moved by a ball screw against 20 N: 26 rows, k = 15."""
    axis, rubs = (1.0, 0.0, 0.0), friction > 0
    carriage = S.Body("carriage", 10.0, inertia=(0.1, 0.1, 0.15), position=(-STROKE / 2, 0, 0.03))
    spindle = S.Body("spindle", 2.0, inertia=(2e-4, 0.02, 0.02))
    sleeve = {"shaft_radius": 0.008, "bearing_length": 0.03, "friction": rx.Coulomb(friction)} if rubs else {}
    thread = {"thread_radius": 0.008, "bearing_length": 0.04, "friction": rx.Coulomb(friction / 10)} if rubs else {}
    blocks = (("LF", 0.1, 0.1), ("LB", -0.1, 0.1), ("RF", 0.1, -0.1), ("RB", -0.1, -0.1))
    joints = [S.Cylindrical(k, carriage, "ground", (x - STROKE / 2, y, 0.0), axis, **sleeve) for k, x, y in blocks]
    joints.append(S.Revolute("bearing", spindle, "ground", point=(-0.3, 0, 0), axis=axis))
    joints.append(S.Screw("nut", carriage, spindle, point=(-STROKE / 2, 0, 0), axis=axis, pitch=PITCH, **thread))
    push = S.AppliedForce("carriage", force=(-20.0, 0, 0))
    return rx.Mechanism([carriage, spindle], joints, gravity=(0, 0, -9.81), units=rx.units.SI, loads=[push])


def elastic(mechanism, drives=None):
    figures = {name: (2e-8, 2e-5) for name in ("LF", "LB", "RF", "RB")} | dict.fromkeys(
        ("nut", "bearing"), (1e-8, 5e-5)
    )
    return rx.ElasticJoints(mechanism, figures, drives=drives)


@pytest.mark.slow
def test_a_ball_screw_needs_the_torque_by_hand_and_friction_differs_on_both_sides_of_rest():
    """Without friction (J 2 pi / p + m p / 2 pi) a + F p / 2 pi: 0.31499, 0.03183, 0.25133 N m; a stroke and back."""
    there_and_back = rx.Trapezoid(STROKE, SPEED, RATE, start=-STROKE / 2, dwell=0.2)
    ts = np.linspace(0.0, 3.4, 69)
    smooth = stage()
    run = rx.drive(smooth, {"bearing.angle": motor(there_and_back)}, ts)
    torque = np.asarray(run["bearing.angle torque"])
    inertia, push = 2e-4 * 2 * np.pi / PITCH * RATE + 10 * RATE * PITCH / (2 * np.pi), 20 * PITCH / (2 * np.pi)
    hand = np.array([inertia + push, push, push - inertia])
    np.testing.assert_allclose(hand.round(5), [0.31499, 0.03183, -0.25133])
    np.testing.assert_allclose(torque[[1, 10, 31]], -hand, rtol=1e-12)
    np.testing.assert_allclose(torque[[34, 68]], -push, rtol=1e-12)  # dwells
    np.testing.assert_allclose(run["bearing.angle"][32], -2 * np.pi * STROKE / PITCH, rtol=1e-13)  # 30 turns, counted
    assert np.all(run.determined)

    rough = stage(0.05)
    run = rx.drive(rough, {"bearing.angle": motor(there_and_back)}, ts, closure=elastic(rough))
    torque, before = (np.asarray(run[f"bearing.angle torque{side}"]) for side in ("", " before"))
    assert not np.any(run.determined) and np.all(run.determined_without_friction)
    assert "but for friction" in str(run)
    moves = (ts > 0) & (ts < 1.6 - 1e-9) | (ts > 1.8 + 1e-9) & (ts < 3.4 - 1e-9)
    np.testing.assert_array_equal(torque[moves], before[moves])
    # friction takes torque on the way out, |M| larger, and turns round for the way back
    assert np.all(np.abs(torque[5:30]) > np.abs(hand[1])) and np.abs(torque[34]) < np.abs(before[34])
    low, high = np.asarray(run.stays)[34, 0]
    np.testing.assert_allclose([low, high], [before[34], torque[34]], rtol=1e-12)  # at rest nothing else acts
    assert np.all(np.isnan(np.asarray(run.stays)[moves]))
    one = rx.solve(run.system, jax.tree.map(lambda x: x[10], run.states), closure=elastic(rough))
    np.testing.assert_allclose(one.multipliers, run.multipliers[10], rtol=0, atol=1e-9 * np.abs(one.multipliers).max())
    np.testing.assert_allclose(one.friction, run.friction[10], rtol=0, atol=1e-9 * np.abs(one.friction).max())


@pytest.mark.slow
def test_a_screw_jack_raises_and_lowers_a_load_by_the_angle_of_friction():
    """W r tan(friction angle +- lead) for a square thread, at rest between both; power is friction's and the load's."""
    mu, radius, pitch, weight = 0.12, 0.009, 0.005, 200.0
    nut = S.Body("nut", weight / 9.81, inertia=(0.1, 0.1, 0.1))
    spindle = S.Body("spindle", 1.0, inertia=(0.01, 0.01, 1e-4))
    up = (0.0, 0.0, 1.0)
    thread = {"thread_radius": radius, "bearing_length": 0.03, "friction": rx.Coulomb(mu)}
    joints = [
        S.Prismatic("guide", nut, "ground", point=(0, 0, 0), axis=up),
        S.Revolute("bearing", spindle, "ground", point=(0, 0, 0), axis=up),
        S.Screw("thread", nut, spindle, point=(0, 0, 0), axis=up, pitch=pitch, **thread),
    ]
    jack = rx.Mechanism([nut, spindle], joints, gravity=(0, 0, -9.81), units=rx.units.SI)
    law = rx.Trapezoid(0.02, speed=0.01, acceleration=0.1, dwell=0.5)
    ts = np.array([1.0, 2.2, 2.5, 4.0])  # up, rest, rest, down
    noise = 1e-14  # rad/s
    run = rx.drive(jack, {"bearing.angle": lambda t: -2 * jnp.pi / pitch * law(t) + noise * t}, ts)
    np.testing.assert_array_equal(run.qd[1:3], 0.0)
    lead, angle = np.arctan(pitch / (2 * np.pi * radius)), np.arctan(mu)
    raising, lowering = weight * radius * np.tan(angle + lead), weight * radius * np.tan(angle - lead)
    torque, before = run["bearing.angle torque"], run["bearing.angle torque before"]
    np.testing.assert_allclose(torque, [-raising, lowering, lowering, lowering], rtol=1e-10)
    np.testing.assert_allclose(before, [-raising, -raising, -raising, lowering], rtol=1e-10)
    np.testing.assert_allclose(run.stays[1, 0], [-raising, lowering], rtol=1e-10)
    rate = 2 * np.pi / pitch * 0.01
    np.testing.assert_allclose(
        run["bearing.angle power"], [raising * rate, 0, 0, lowering * rate], rtol=1e-10, atol=1e-12
    )


# Drives that are more than the freedoms ------------------------------------------------------------------

WIDTH, BEAM = 1.2, 40.0


def gantry(reach=0.1):
    """A beam on two guides `WIDTH` apart that both lead it along x, with a load of 60 N at the height `reach`."""
    guides = [
        rx.Translational(name, "beam", "ground", point_i=(0.0, y), point_j=(0.0, y), normal=(0.0, 1.0))
        for name, y in (("left", WIDTH / 2), ("right", -WIDTH / 2))
    ]
    pull = rx.AppliedForce("beam", force=(-60.0, 0.0), point=(0.0, reach))
    return rx.Mechanism([rx.Body("beam", BEAM, 3.0)], guides, loads=[pull], units=rx.units.SI)


def test_two_screws_of_a_gantry_that_are_out_of_step_fight():
    """Servos of 2e7 and 1e7 N/m, 20 um out of step, on guides that resist a turn of the beam with 2e7 N m/rad in all.

    By hand: F_i = k_i (u_i - x + b_i turn) with u = (0, -20 um), in balance with the load and the turned guides.
    """
    machine, laws = gantry(), dict.fromkeys(("left.travel", "right.travel"), rx.Harmonic(0.05, frequency=1.0))
    ts = np.linspace(0.0, 1.0, 9)
    k, error, b, turning = np.array([2e7, 1e7]), 20e-6, np.array([0.6, -0.6]), 2 / 1e-7
    servos = {"left.travel": 1 / k[0], "right.travel": (1 / k[1], error)}
    rails = dict.fromkeys(("left", "right"), (1e-9, 1e-7))
    run = rx.drive(machine, laws, ts, {}, closure=rx.ElasticJoints(machine, rails, drives=servos))
    total = BEAM * np.asarray(run["beam.x''"]) + 60.0
    stiffness = np.array([[k.sum(), -(k @ b)], [-(k @ b), k @ b**2 + turning]])  # of x and of the turn
    behind = k * np.array([0.0, -error])
    load = np.stack([behind.sum() - total, np.full_like(total, 60 * 0.1 - behind @ b)])
    x, turn = np.linalg.solve(stiffness, load)
    hand = behind[:, None] - k[:, None] * (x - b[:, None] * turn)
    np.testing.assert_allclose(run["left.travel force"], hand[0], rtol=1e-10)
    np.testing.assert_allclose(run["right.travel force"], hand[1], rtol=1e-10)
    assert np.ptp(hand[0] - hand[1]) > 10 and hand[0, 0] - hand[1, 0] > 150  # they fight, and the load adds to it
    assert not np.any(run.determined) and not np.any(run.determined_without_friction)
    assert "the closure decides" in str(run)
    np.testing.assert_allclose(np.sum(run.forces, axis=1), total, rtol=1e-12)
    # what the drives' rows are called, for all other questions
    assert rx.analyze(run.system, jax.tree.map(lambda x: x[1], run.states)).redundancy == 3
    with pytest.raises(rx.RedundaxError, match=r"right\.travel, which follow no law"):
        wrong = rx.ElasticJoints(machine, rails, drives=servos)
        rx.drive(machine, {"left.travel": rx.Harmonic(0.05, 1.0)}, ts, {}, closure=wrong)


def test_drives_share_by_ratings_and_by_limits_and_keep_a_preload():
    """A beam whose two drives may share as they like: r_1^2 : r_2^2 by least norm, l_1 : l_2 by least peak."""
    machine, laws = gantry(), dict.fromkeys(("left.travel", "right.travel"), rx.Harmonic(0.05, frequency=1.0))
    ts = np.linspace(0.0, 1.0, 9)
    rails = rx.ElasticJoints(machine, dict.fromkeys(("left", "right"), (1e-9, 1e-7)))
    sizes = {"left.travel": 200.0, "right.travel": 100.0}
    norm = rx.drive(machine, laws, ts, {}, closure=rx.LeastNorm(sizes, rails))
    total = np.asarray(norm.forces).sum(axis=1)
    np.testing.assert_allclose(total, BEAM * np.asarray(norm["beam.x''"]) + 60.0, rtol=1e-12)
    np.testing.assert_allclose(norm.forces, total[:, None] * [0.8, 0.2], rtol=0, atol=1e-5 * total.max())
    peak = rx.drive(machine, laws, ts, {}, closure=rx.LeastPeak(sizes, closure=rails))
    np.testing.assert_allclose(peak.forces, total[:, None] * [2 / 3, 1 / 3], rtol=0, atol=1e-5 * total.max())
    assert not peak.remarks
    preload = rx.LeastPeak({"left.travel": 100.0, "right.travel": 40.0}, preload={"right.travel": -20.0}, closure=rails)
    kept = rx.drive(machine, laws, ts, {}, closure=preload)
    np.testing.assert_allclose(kept["left.travel force"], np.maximum(total + 20.0, 100 / 140 * total), atol=1e-3)
    largest = (total + 20).max()
    (said,) = kept.remarks
    assert f"is {largest:.4g} % of them" in said and said in str(kept).replace("\n", " ")
    with pytest.raises(rx.RedundaxError, match="must name each drive"):
        rx.drive(machine, laws, ts, {}, closure=rx.LeastNorm({"left.travel": 200.0}, rails))


@pytest.mark.slow
def test_least_peak_is_that_of_drives_whose_share_presses_a_pin_that_rubs(monkeypatch):
    """A lever on a rough pin, level at t = 0, lifted at both ends. Where both drives are at the same share of their
    limits, p, u_right = p l_right and u_left = -p l_left, a balance of moments says p."""
    arm, lever, carriage, across, rough, spin, gain = 0.5, (4.0, 0.3), 0.7, 60.0, 0.04, 0.8, 5.0
    sides = {"left": -arm, "right": arm}
    joints = [rx.Revolute("pin", "lever", "ground", (0, 0), (0, 0), pin_radius=rough, friction=rx.Coulomb(0.5))]
    for name, x in sides.items():
        joints.append(rx.Translational(name, name, "ground", (0.0, 0.0), (x, 0.0), (-1.0, 0.0)))  # travel is upwards
        joints.append(rx.PinInSlot(f"{name} end", name, "lever", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0)))
    bodies = [rx.Body("lever", *lever), *(rx.Body(name, carriage, 0.1) for name in sides)]
    force = rx.AppliedForce("lever", (across, 0.0))
    machine = rx.Mechanism(bodies, joints, loads=[force], gravity=(0.0, -9.81))
    laws = {
        f"{name}.travel": jax.tree_util.Partial(lambda x, t: x * jnp.tan(spin * t + gain * t**2 / 2), x)
        for name, x in sides.items()
    }
    limits = {"left.travel": 20.0, "right.travel": 35.0}
    ts, guess = np.array([0.0, 0.1]), {"left.x": -arm, "right.x": arm}
    shares = [rx.LeastPeak({name: size * limit for name, limit in limits.items()}) for size in (1.0, 1e6)]
    run, ample = (rx.drive(machine, laws, ts, guess, closure=share) for share in shares)

    def ends(p):
        weight = carriage * np.array([9.81 - arm * gain, 9.81 + arm * gain])
        return p * np.array([-limits["left.travel"], limits["right.travel"]]) - weight

    def missing(p):
        left, right = ends(p)
        load = np.hypot(across, lever[0] * 9.81 - left - right)
        return lever[1] * gain - arm * (right - left) + 0.5 * rough * load

    p = scipy.optimize.root_scalar(missing, bracket=(0.0, 1.0), xtol=1e-14).root
    np.testing.assert_allclose(run.forces[0], [-20.0 * p, 35.0 * p], rtol=1e-6)
    np.testing.assert_allclose(ample.forces, run.forces, rtol=1e-6)  # limits far above the forces are as any others
    assert not run.remarks and not ample.remarks
    monkeypatch.setattr(_share, "_ROUNDS", 1)  # as friction depends on the share, one does not settle it
    with pytest.raises(rx.NoSolutionError, match="No share of the drives was found at 2 of 2 times"):
        rx.drive(machine, laws, ts, guess, closure=shares[0])
    unsettled = rx.drive(machine, laws, ts, guess, closure=shares[0], throw=False)
    assert np.all(np.isnan(unsettled.forces)) and "No share" in str(unsettled)


@pytest.mark.parametrize("size", [np.inf, np.nan])
def test_ratings_limits_and_preloads_of_drives_are_finite(size):
    for share in (rx.LeastNorm, rx.LeastPeak):
        with pytest.raises(rx.RedundaxError, match=r"`(ratings|limits)` must be finite"):
            share({"left.travel": size})
    with pytest.raises(rx.RedundaxError, match="`preload` must be finite"):
        rx.LeastPeak({"left.travel": 1.0}, preload={"left.travel": size})


# What is refused, and where a motion ends -----------------------------------------------------------------


def arm(friction=None):
    """Two links in the plane on a pin at the origin: two freedoms."""
    rubs = {} if friction is None else {"friction": friction, "pin_radius": 0.02}
    joints = [
        rx.Revolute("shoulder", "upper", "ground", point_i=(-0.5, 0.0), point_j=(0.0, 0.0), **rubs),
        rx.Revolute("elbow", "lower", "upper", point_i=(-0.5, 0.0), point_j=(0.5, 0.0), **rubs),
    ]
    return rx.Mechanism([rx.Body(name, 1.0, 0.1) for name in ("upper", "lower")], joints, gravity=(0.0, -9.81))


def test_coordinates_left_free_are_named_and_can_be_held():
    ts = np.linspace(0.0, 0.2, 5)
    start = {"upper.x": 0.5, "lower.x": 1.5}
    with pytest.raises(rx.RedundaxError, match=r"1 is left at the first position: .*elbow.angle.*`hold`"):
        rx.drive(arm(), {"shoulder.angle": rx.Harmonic(0.2, 1.0)}, ts, start)
    run = rx.drive(arm(), {"shoulder.angle": rx.Harmonic(0.2, 1.0)}, ts, start, hold=["elbow.angle"])
    with pytest.raises(rx.RedundaxError, match=r"`hold` must name coordinates that have no law, but shoulder\.angle"):
        rx.drive(arm(), {"shoulder.angle": 0.2}, ts, start, hold=["shoulder.angle", "elbow.angle"])
    np.testing.assert_allclose(run["elbow.angle"], 0.0, atol=1e-13)
    assert [each.name for each in run.drives] == ["shoulder.angle", "elbow.angle"]
    # as one rod of 2 kg: I a + m g l cos
    angle, change = np.asarray(run["shoulder.angle"]), np.asarray(run["shoulder.angle''"])
    np.testing.assert_allclose(
        run["shoulder.angle torque"], (0.2 + 0.25 + 2.25) * change + 9.81 * 2.0 * np.cos(angle), rtol=1e-11
    )
    for call, words in (
        (lambda: rx.drive(arm(), {"knee.angle": 0.0}, ts), "`laws`.*knee.angle"),
        (lambda: rx.drive(arm(), {}, ts, start), "shoulder.angle"),
        (lambda: rx.drive(arm(), {"elbow.angle": 0.0}, np.zeros(2)), "ascending"),
        (lambda: rx.drive(arm(), {"elbow.angle": 0.0}, 1.0), "vector"),
    ):
        with pytest.raises(rx.RedundaxError, match=words):
            call()


def test_a_motion_ends_with_its_time_where_the_drive_cannot_take_it_further():
    """A slider driven past its dead centre, 0.77 m from the crank's pin: x = 0.5 + t gets there at 0.27 s."""
    mechanism = rx.mechanisms.slider_crank(guides=1)
    ts = np.linspace(0.0, 0.4, 5)
    law, start = {"slider.x": rx.Polynomial([0.5, 1.0])}, mechanism.state(1.4).q
    with pytest.raises(rx.NoSolutionError, match=r"ends at t = 0.2(7|69999\d*): there .* all but singular"):
        rx.drive(mechanism, law, ts, start)
    run = rx.drive(mechanism, law, ts, start, throw=False)
    assert np.all(np.isfinite(run.multipliers[:3])) and np.all(np.isnan(run.multipliers[3:]))
    assert str(run.result) == "redundax.RESULTS<3 successful, 2 no_position>" or "no_position" in str(run)
    states = rx.assemble_along(mechanism, law, ts[:3], start)
    np.testing.assert_allclose(states.q, run.q[:3], rtol=1e-13, atol=1e-14)  # by NumPy or by a program


def test_laws_that_contradict_each_other_end_the_motion_where_all_of_it_rests_too():
    """One end of a beam moves on by a law, the other is held: all rests at both times, with no position between."""
    asked = gantry(), {"left.travel": rx.Cycloidal(0.05, move=1.0)}, [0.0, 1.0], {}
    with pytest.raises(rx.NoSolutionError, match="no position follows the laws"):
        rx.assemble_along(*asked, hold=["right.travel"])
    states = rx.assemble_along(*asked, hold=["right.travel"], throw=False)
    np.testing.assert_array_equal(np.isfinite(states.q).all(axis=1), [True, False])


def test_friction_of_a_joint_that_never_slips_is_told():
    """An arm held by its drive at the elbow, which rubs, while the shoulder turns."""
    mechanism = arm(rx.Coulomb(0.1))
    laws, start = {"shoulder.angle": rx.Harmonic(0.2, 1.0), "elbow.angle": 0.0}, {"upper.x": 0.5, "lower.x": 1.5}
    run = rx.drive(mechanism, laws, np.linspace(0.01, 0.2, 5), start)
    assert run.remarks == ("Friction of joints that do not slip at any of the times is taken as none: tau elbow.",)
    assert np.all(np.asarray(run["tau elbow"]) == 0) and np.all(np.asarray(run["tau shoulder"]) < 0)


def test_a_singular_position_between_two_times_is_named():
    """A parallelogram through its flat position, at the crank angle 0, which no time meets."""
    mechanism = rx.mechanisms.parallelogram(2)
    ts = np.linspace(0.0, 0.61, 12)
    run = rx.drive(mechanism, {"crank 1.phi": rx.Polynomial([-0.3, 1.0])}, ts, mechanism.state(-0.3).q)
    (said,) = run.remarks
    assert "singular position at t = 0.3:" in said and said.partition(":")[0] in " ".join(str(run).split())
    np.testing.assert_allclose(run["crank 2.phi"], ts - 0.3, atol=1e-10)  # on its branch
