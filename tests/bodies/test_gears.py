"""Gears with teeth: flanks that touch, forces, loss and load sharing by hand, and teeth that would have to pull."""

import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from turning import rotation, turned

import redundax as rx

G, ALPHA, MODULE = rx.GROUND, np.pi / 9, 0.002
pytestmark = pytest.mark.filterwarnings("error:Teeth pull")


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def across(v):
    return np.array([-v[1], v[0]])


# Geometry against the flanks themselves --------------------------------------------------------------


def flank_point(centre, turn, base, half, flank, along):
    """Where the involute flank of a tooth, the middle of which is at the angle `turn`, has the tangent of the base
    circle at the angle `along` as its normal; `half` is half the angle of the tooth at the base circle."""
    root = turn - flank * half  # the right flank is clockwise from the middle
    return centre + base * (unit(along) - (along - root) * across(unit(along)))


def penetration(teeth, module, alpha, flank, centres, turns):
    """How far a flank of i has gone into one of j along their common normal, modulo the base pitch; and that normal.

    The normal touches both base circles. A ring is a tooth of as many teeth that is not there.
    """
    base, line = module * np.abs(teeth) * np.cos(alpha) / 2, centres[1] - centres[0]
    external, theta = teeth[1] > 0, np.arctan2(line[1], line[0])
    lean = np.arccos((base[0] + base[1] if external else base[1] - base[0]) / np.hypot(*line))
    along = (theta if external else theta + np.pi) + flank * lean
    half = np.pi / (2 * np.abs(teeth)) + np.tan(alpha) - alpha
    other = turns[1] if external else turns[1] + np.pi / abs(teeth[1])
    here = flank_point(centres[0], turns[0], base[0], half[0], flank, along)
    there = flank_point(centres[1], other, base[1], half[1], flank, along + np.pi if external else along)
    force, pitch = flank * across(unit(along)), 2 * np.pi * base[0] / teeth[0]
    np.testing.assert_allclose(force @ across(there - here), 0.0, atol=1e-12)  # both are on the line of action
    depth = (there - here) @ force
    return depth - pitch * np.round(depth / pitch), force


def pose(r, phi):
    return rx.Pose(jnp.asarray(r), jnp.asarray(phi)).with_axes()


@pytest.mark.parametrize("flank", [1, -1])
@pytest.mark.parametrize(("teeth", "apart"), [((20, 33), 1.0), ((19, 40), 1.02), ((18, -61), 1.0), ((18, -60), 1.01)])
def test_row_and_its_gradient_are_those_of_the_flanks(teeth, apart, flank):
    """At any position, standard centre distance or not, and whatever the angles."""
    rng = np.random.default_rng(0)
    spots, angles, alpha = rng.normal(size=(2, 2)), rng.uniform(-9, 9, 4), 0.4
    mesh = rx.GearPair("M", "a", "b", *spots, teeth, 0.3, alpha, flank, *angles[2:])
    distance = apart * 0.3 * abs(sum(teeth)) / 2
    first = np.array([2.0, -1.0])
    for theta in (0.3, 2.9, -2.0):
        centres = np.array([first, first + distance * unit(theta)])
        i, j = (pose(c - rotation(a) @ s, a) for c, a, s in zip(centres, angles[:2], spots, strict=True))
        depth, force = penetration(np.array(teeth), 0.3, alpha, flank, centres, angles[:2] + angles[2:])
        np.testing.assert_allclose(mesh.residual(i, j, jnp.zeros(())), [depth], atol=1e-13)
        # A force f at a point of the line of action, -f at the same point of the other body
        base = flank * 0.3 * np.cos(alpha) / 2 * np.array(teeth)
        arms = centres - np.array([i.r, j.r])
        moments = base + np.array([-arms[0] @ across(force), arms[1] @ across(force)])
        expected = -np.array([[*force, moments[0], *-force, moments[1]]])
        np.testing.assert_allclose(mesh.jacobian(i, j, jnp.zeros(())), expected, atol=1e-12)


@pytest.mark.parametrize("flank", [1, -1])
def test_row_of_a_rack_is_that_of_its_straight_flanks(flank):
    """The flank of a tooth of the rack leans by alpha from its middle at a quarter pitch."""
    rng, alpha, module, teeth = np.random.default_rng(1), 0.35, 0.3, 17
    spots, angles, normal = rng.normal(size=(2, 2)), rng.uniform(-9, 9, 3), unit(0.7)
    mesh = rx.RackAndPinion("M", "a", "b", *spots, 3.0 * normal, teeth, module, alpha, flank, angles[2])
    n = rotation(angles[1]) @ normal
    t, base = -across(n), module * teeth * np.cos(alpha) / 2
    force = flank * np.cos(alpha) * t + np.sin(alpha) * n
    for shift, height in ((0.37, 0.0), (-5.0, 0.02)):
        on_rack = np.array([2.0, -1.0])
        centre = on_rack + shift * t + (module * teeth / 2 + height) * n
        along = np.arctan2(force[1], force[0]) - flank * np.pi / 2
        half = np.pi / (2 * teeth) + np.tan(alpha) - alpha
        here = flank_point(centre, angles[0] + angles[2], base, half, flank, along)
        there = on_rack + flank * np.pi * module / 4 * t
        depth, pitch = (there - here) @ force, np.pi * module * np.cos(alpha)
        i, j = (
            pose(centre - rotation(angles[0]) @ spots[0], angles[0]),
            pose(on_rack - rotation(angles[1]) @ spots[1], angles[1]),
        )
        expected = depth - pitch * np.round(depth / pitch)
        np.testing.assert_allclose(mesh.residual(i, j, jnp.zeros(())), [expected], atol=1e-13)
        at = centre + base * unit(along)
        expected = [force @ across(at - r) * sign for r, sign in ((i.r, 1), (j.r, -1))]
        row = -np.array(mesh.jacobian(i, j, jnp.zeros(()))[0])
        np.testing.assert_allclose(row, [*force, expected[0], *-force, expected[1]], atol=1e-12)


# A pair by hand --------------------------------------------------------------------------------------


def pair(flank=-1, mu=None, module=MODULE, moments=(5.0, 10.0), distance=0.06, loads=()):
    """Teeth 20 and 40 on fixed axes; the pinion is driven counterclockwise."""
    rubs = None if mu is None else rx.Coulomb(mu)
    joints = [
        rx.Revolute("A", "pinion", G, (0, 0), (0, 0)),
        rx.Revolute("B", "wheel", G, (0, 0), (distance, 0)),
        rx.GearPair("mesh", "pinion", "wheel", (0, 0), (0, 0), (20, 40), module, flank=flank, friction=rubs),
    ]
    bodies = [rx.Body("pinion", 1.0, 1e-4), rx.Body("wheel", 3.0, 1e-3)]
    drives = [rx.AppliedForce(name, moment=value) for name, value in zip(("pinion", "wheel"), moments, strict=True)]
    return rx.Mechanism(bodies, joints, loads=loads or drives, units=rx.units.Units())


def running(mechanism, rate=10.0, **guess):
    return rx.assemble(mechanism, {"wheel.x": 0.06, **guess}, rates={"pinion.phi": rate})


@pytest.mark.slow
def test_forces_of_a_pair_by_name():
    mechanism = pair()
    found = rx.solve(mechanism, running(mechanism))
    tooth = 5.0 / (0.02 * np.cos(ALPHA))
    force = -tooth * np.array([np.sin(ALPHA), np.cos(ALPHA)])  # pushes the pinion away and back
    np.testing.assert_allclose(found["mesh.teeth"], tooth, rtol=1e-12)
    np.testing.assert_allclose([found[f"mesh force {x} on pinion"] for x in "xy"], force, rtol=1e-12)
    np.testing.assert_allclose([found[f"A force {x} on pinion"] for x in "xy"], -force, rtol=1e-12)
    np.testing.assert_allclose([found[f"B force {x} on wheel"] for x in "xy"], force, rtol=1e-12)
    np.testing.assert_allclose(found["mesh moment on pinion"], -5.0, rtol=1e-12)  # about its axis
    np.testing.assert_allclose(found["pinion.phi''"], 0.0, atol=1e-9)
    assert found.pulling == ()


def test_a_state_is_assembled_into_the_nearest_teeth():
    mechanism, pitch = pair(), 2 * np.pi / 40
    for guess in (0.0, 0.31, 2.0 + 20 * np.pi):
        state = rx.assemble(mechanism, {"wheel.x": 0.06, "wheel.phi": guess, "pinion.phi": 0.2})
        turn = float(state.q[5])
        assert abs(turn - guess) < pitch / 2 + 1e-12
        np.testing.assert_allclose(np.cos(40 * turn + 20 * state.q[4] - np.pi), 1.0, atol=1e-10)  # 40 is even
    for distance in (0.05, 0.0):
        with pytest.raises(rx.NoSolutionError, match=r"mesh\.teeth"):
            rx.assemble(pair(distance=distance), {"wheel.x": distance})
    with pytest.raises(rx.NoSolutionError, match=r"Violated rows: mesh\.teeth"):
        rx.solve(pair(distance=0.05), rx.State([0.0, 0.0, 0.05, 0.0, 0.0, 0.0], np.zeros(6)))


def test_a_wider_centre_distance_has_another_pressure_angle():
    """And backlash: the flanks apart, the wheel is turned by it between them."""
    states = {flank: running(pair(flank, distance=0.061), **{"wheel.x": 0.061}) for flank in (1, -1)}
    found = rx.solve(pair(distance=0.061), states[-1])
    base, alpha = 0.02 * np.cos(ALPHA), np.arccos(0.06 * np.cos(ALPHA) / 0.061)
    np.testing.assert_allclose(found["mesh force x on pinion"], -5.0 / base * np.sin(alpha), rtol=1e-12)
    involute = [np.tan(a) - a for a in (alpha, ALPHA)]
    backlash = 2 * 3 * base * (involute[0] - involute[1])  # along the line of action, of both sides
    turns = [b.q[5] * 2 * base + b.q[4] * base for b in states.values()]
    np.testing.assert_allclose(np.mod(turns[1] - turns[0], 2 * np.pi * base / 20), backlash, rtol=1e-9)


def test_a_wheel_of_ever_more_teeth_is_a_rack():
    count = 10**7
    radius = MODULE * count / 2
    wheel = rx.GearPair("M", "a", "b", (0, 0), (0, -radius), (20, count), MODULE, angle_j=np.pi / 2)
    rack = rx.RackAndPinion("M", "a", "b", (0, 0), (0, 0), (0, 1), 20, MODULE)
    i, j = pose([0.001, 0.02], 0.3), pose([0.0, 0.0], 0.0)
    rows = [mesh.jacobian(i, j, jnp.zeros(())) for mesh in (wheel, rack)]
    np.testing.assert_allclose(*rows, atol=1e-5)
    np.testing.assert_allclose(*(mesh.residual(i, j, jnp.zeros(())) for mesh in (wheel, rack)), atol=1e-6)


# Change of flank -------------------------------------------------------------------------------------


def test_teeth_that_pull_are_flagged_and_the_other_flank_pushes():
    mechanism = pair(flank=1)
    state = running(mechanism)
    with pytest.warns(UserWarning, match=r"Teeth pull in mesh\.teeth: .* the opposite `flank`"):
        wrong = rx.solve(mechanism, state)
    right = rx.solve(pair(), state)
    assert wrong.pulling == ("mesh.teeth",) and right.pulling == ()
    np.testing.assert_allclose(wrong["mesh.teeth"], -right["mesh.teeth"], rtol=1e-12)
    np.testing.assert_allclose(wrong.acceleration, right.acceleration, atol=1e-9)
    np.testing.assert_allclose(wrong["A force y on pinion"], right["A force y on pinion"], rtol=1e-12)
    np.testing.assert_allclose(wrong["A force x on pinion"], -right["A force x on pinion"], rtol=1e-12)
    assert "\nTeeth pull in mesh.teeth" in str(wrong) and "pull" not in str(right)
    report = rx.analyze(mechanism, state)
    assert report.pulling == ("mesh.teeth",) and "CHANGE OF FLANK: Teeth pull in mesh.teeth" in str(report)
    said = rx.analyze(pair(), state)
    assert said.pulling == () and "FLANK" not in str(said)


def test_teeth_that_pull_in_a_batch_are_flagged():
    mechanism = pair(moments=(5.0, 0.0))
    state = running(mechanism)

    def driven(moment):
        return rx.solve(pair(moments=(moment, 0.0)), state)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert jax.vmap(driven)(jnp.array([5.0, 3.0])).pulling == ()
        assert jax.vmap(driven)(jnp.array([5.0, -3.0])).pulling == ("mesh.teeth",)
        assert rx.solve(pair(flank=1), state, throw=False).pulling == ("mesh.teeth",)
    with pytest.raises(
        rx.RedundaxError, match=r"not inside of transformations.* signs of the multipliers mesh\.teeth there"
    ):
        jax.eval_shape(lambda moment: driven(moment).pulling, 5.0)


@pytest.mark.slow
def test_teeth_that_pull_in_a_motion_are_flagged():
    """A moment that turns at t = 0.01 s; angles in closed form."""

    def push(i, j, t, p):
        return rx.Wrench(jnp.zeros(2), p * (0.01 - t)), rx.Wrench(jnp.zeros(2), jnp.zeros(()))

    mechanism = pair(loads=[rx.LoadFunction("pinion", push, parameters=100.0)])
    with pytest.warns(UserWarning, match="Teeth pull"):
        motion = rx.simulate(mechanism, running(mechanism), 0.02)
    assert motion.pulling == ("mesh.teeth",)
    np.testing.assert_array_equal(motion["mesh.teeth"] < -1e-6, motion.t > 0.01 + 1e-9)
    t, inertia = np.asarray(motion.t), 1e-4 + 1e-3 / 4
    turned = 10.0 * t + 100.0 * (0.01 * t**2 / 2 - t**3 / 6) / inertia
    np.testing.assert_allclose(motion["pinion.phi"] - motion["pinion.phi"][0], turned, atol=1e-9)
    np.testing.assert_allclose(motion["wheel.phi"] - motion["wheel.phi"][0], -turned / 2, atol=1e-9)


# Friction of teeth -----------------------------------------------------------------------------------


def mean_arm(teeth, module, alpha=ALPHA):
    """Ohlendorf: H_v = pi (1 / z_1 + 1 / z_2) (1 - eps + eps_1^2 + eps_2^2) of the power is lost, times mu."""
    pitch, eps = np.pi * module * np.cos(alpha), []
    for z in teeth:
        r = module * z / 2
        eps.append((np.sqrt((r + module) ** 2 - (r * np.cos(alpha)) ** 2) - r * np.sin(alpha)) / pitch)
    loss = np.pi * (1 / teeth[0] + 1 / teeth[1]) * (1 - sum(eps) + eps[0] ** 2 + eps[1] ** 2)
    base = [module * z * np.cos(alpha) / 2 for z in teeth]
    return loss / (1 / base[0] + 1 / base[1])


def efficiency(teeth, module, mu):
    """(1 - mu arm / b_2) / (1 + mu arm / b_1) of a pair that runs evenly, driven by the first."""
    base, arm = [module * z * np.cos(ALPHA) / 2 for z in teeth], mu * mean_arm(teeth, module)
    return (1 - arm / base[1]) / (1 + arm / base[0])


def test_efficiency_of_a_pair():
    eta = efficiency((20, 40), MODULE, 0.06)
    assert 0.985 < eta < 0.995  # as of real gears
    np.testing.assert_allclose(1 - eta, 0.06 * mean_arm((20, 40), MODULE) * (1 / 0.02 + 1 / 0.04) / np.cos(ALPHA), 0.01)
    mechanism = pair(mu=0.06, moments=(5.0, 10.0 * eta))
    found = rx.solve(mechanism, running(mechanism))
    np.testing.assert_allclose(found["pinion.phi''"], 0.0, atol=1e-9)
    tooth = 5.0 / (0.02 * np.cos(ALPHA) + 0.06 * mean_arm((20, 40), MODULE))
    np.testing.assert_allclose(found["mesh.teeth"], tooth, rtol=1e-12)
    np.testing.assert_allclose(found["tau mesh"], -0.06 * mean_arm((20, 40), MODULE) * tooth, rtol=1e-12)


@pytest.mark.slow
def test_a_rack_and_its_loss_by_hand():
    arm, base = 0.0021, 0.02 * np.cos(ALPHA)
    tooth = 2.0 / (base + 0.1 * arm)
    drive = rx.RackAndPinion(
        "M",
        "pinion",
        "rack",
        (0, 0),
        (0, 0.01),
        (0, 1),
        20,
        MODULE,
        flank=-1,
        sliding_arm=arm,
        friction=rx.Coulomb(0.1),
    )
    joints = [
        rx.Revolute("A", "pinion", G, (0, 0), (0, 0)),
        rx.Translational("K", "rack", G, (0, 0), (0, -0.03), (0, 1)),
        drive,
    ]
    loads = [rx.AppliedForce("pinion", moment=2.0), rx.AppliedForce("rack", (-tooth * np.cos(ALPHA), 0.0))]
    bodies = [rx.Body("pinion", 0.5, 1e-4), rx.Body("rack", 2.0, 0.01)]
    mechanism = rx.Mechanism(bodies, joints, loads=loads)
    for angle in (0.0, 0.8):
        there = rx.assemble(mechanism, {"rack.y": -0.03}, rates={"pinion.phi": 3.0})
        np.testing.assert_allclose(there.qd[2:4], [0.06, 0.0], atol=1e-15)
        R = rotation(angle)
        loads[1] = rx.AppliedForce("rack", R @ (-tooth * np.cos(ALPHA), 0.0))
        whole, there = turned(rx.Mechanism(bodies, joints, loads=loads), there, angle)
        found = rx.solve(whole, there)
        np.testing.assert_allclose(found["M.teeth"], tooth, rtol=1e-11)
        expected = R @ (tooth * np.array([-np.cos(ALPHA), np.sin(ALPHA)]))
        np.testing.assert_allclose([found[f"M force {x} on pinion"] for x in "xy"], expected, rtol=1e-11)
        np.testing.assert_allclose(found["K.perpendicular"], tooth * np.sin(ALPHA), rtol=1e-11)
        np.testing.assert_allclose(found.acceleration, 0.0, atol=1e-9)


# Two paths -------------------------------------------------------------------------------------------


def test_two_paths_loads_and_efficiency_by_hand():
    """Countershafts that give way alike share alike: bearings of input and output carry none, and each bearing of a
    countershaft both of its meshes."""
    eta = efficiency((20, 40), MODULE, 0.05) * efficiency((24, 36), MODULE, 0.05)
    load = -10.0 * eta * (40 * 36) / (20 * 24)
    train = rx.mechanisms.countershaft_train(mu=0.05, load=load, gravity=0.0)
    state = train.state(phi=0.3, rate=100.0)
    joints = rx.ElasticJoints(train, dict.fromkeys(("I1", "I2"), 2e-9) | dict.fromkeys(("C1", "C2"), 1e-8))
    found = rx.solve(train, state, closure=joints)
    np.testing.assert_allclose(found["input.phi''"], 0.0, atol=1e-8)
    np.testing.assert_allclose(
        [found[f"{x} force {y} on {on}"] for x, on in (("A", "input"), ("B", "output")) for y in "xy"], 0.0, atol=1e-9
    )
    base = [MODULE * z * np.cos(ALPHA) / 2 for z in (20, 40, 24, 36)]
    arms = [0.05 * mean_arm(teeth, MODULE) for teeth in ((20, 40), (24, 36))]
    first = 5.0 / (base[0] + arms[0])
    second = first * (base[1] - arms[0]) / (base[2] + arms[1])
    np.testing.assert_allclose([found[f"I{k}.teeth"] for k in (1, 2)], first, rtol=1e-12)
    np.testing.assert_allclose([found[f"O{k}.teeth"] for k in (1, 2)], second, rtol=1e-12)
    c, s = np.cos(ALPHA), np.sin(ALPHA)
    push = -np.array([s * (first + second), c * (first - second)])  # the bearing on shaft 1, which stands along x
    np.testing.assert_allclose([found[f"C1 force {x} on shaft 1"] for x in "xy"], push, rtol=1e-12)
    assert found.pulling == ()
    power_in, power_out = 10.0 * 100.0, -load * found["output.phi'"]
    np.testing.assert_allclose(power_out / power_in, eta, rtol=1e-12)


def test_teeth_that_are_late_leave_load_to_the_other_path():
    """The second pinion turned by delta on its shaft: O2 is off by its base radius times delta."""
    delta, give, ratio = 1e-5, 2e-9, 40 / 24
    train = rx.mechanisms.countershaft_train(gravity=0.0, load=-30.0)
    off = rx.JointCompliance("O2", give, misfit=(0.0, 0.0, delta))
    others = [rx.JointCompliance(name, give) for name in ("I1", "I2", "O1")]
    found = rx.solve(train, train.state(phi=0.3, rate=0.0), closure=rx.ElasticJoints(train, [*others, off]))
    # Along a path N gives way by c (1 + r^2) N at I, where a misfit at O counts r times; this one opens O2
    change = ratio * 0.024 * np.cos(ALPHA) * delta / (2 * give * (1 + ratio**2))
    even = 5.0 / (0.02 * np.cos(ALPHA))
    np.testing.assert_allclose([found["I1.teeth"], found["I2.teeth"]], [even + change, even - change], rtol=1e-12)


# Planets ---------------------------------------------------------------------------------------------

GIVE = 1e-8  # of the pins, m/N


def planets(module=MODULE, unit=1.0):
    """Three planets that balance their load without gravity, in a unit of length."""
    load = -10.0 * (24 + 60) / 24 * unit**2
    set_ = rx.mechanisms.planetary(module=module * unit, torque=10.0 * unit**2, load=load, gravity=0.0)
    return set_, set_.state(phi=0.4, rate=0.0)


def on_pins(mechanism, misfits, give=GIVE, meshes=0.0):
    """Pins that give way, their tangential misfits in the frame of the carrier; and meshes."""
    pins = []
    for k, off in enumerate(misfits):
        tangent = across(unit(2 * np.pi * k / 3))
        pins.append(rx.JointCompliance(f"C{k + 1}", give, misfit=(*(off * tangent), 0.0), frame="carrier"))
    teeth = [rx.JointCompliance(f"{x}{k + 1}", meshes) for x in "SR" for k in range(3) if meshes]
    return rx.ElasticJoints(mechanism, [*pins, *teeth])


def shares(found):
    return np.array([[found[f"{mesh}{k}.teeth"] for k in (1, 2, 3)] for mesh in "SR"])


@pytest.mark.parametrize("meshes", [0.0, 3e-9])
def test_planets_share_the_load_as_their_pins_fit(meshes):
    """F_k = F + (e_k - mean e) / (c (2 cos alpha)^2 + 2 c_mesh), e the misfit along both lines of action: a pin that
    sits behind by delta leaves 2 cos alpha delta between the teeth."""
    mechanism, state = planets()
    misfits = np.array([4e-7, -2e-7, 1e-6])
    found = rx.solve(mechanism, state, closure=on_pins(mechanism, misfits, meshes=meshes))
    even, lean = 10.0 / (3 * 0.024 * np.cos(ALPHA)), 2 * np.cos(ALPHA)
    expected = even + lean * (misfits - misfits.mean()) / (lean**2 * GIVE + 2 * meshes)
    np.testing.assert_allclose(shares(found), [expected, expected], rtol=1e-12)
    angle = float(found["carrier.phi"])
    for k in range(3):
        tangent = across(unit(angle + 2 * np.pi * k / 3))
        force = [found[f"C{k + 1} force {x} on planet {k + 1}"] for x in "xy"]
        np.testing.assert_allclose(force, -lean * expected[k] * tangent, rtol=0, atol=1e-10)


def test_a_planet_that_fits_too_badly_carries_nothing_and_is_flagged():
    mechanism, state = planets()
    with pytest.warns(UserWarning, match=r"Teeth pull in S2\.teeth, R2\.teeth: .* another|closure"):
        found = rx.solve(mechanism, state, closure=on_pins(mechanism, np.array([0.0, -1e-5, 0.0])))
    assert found.pulling == ("S2.teeth", "R2.teeth")


def share_of_two(reach, **friction):
    """Two planets, each of which carries half, up to a share of which the one carries more, the other less."""
    load = -10.0 * (24 + 60) / 24
    mechanism = rx.mechanisms.planetary(2, module=MODULE, torque=10.0, load=load, gravity=0.0, **friction)
    half = 10.0 / (2 * 0.024 * np.cos(ALPHA))
    return mechanism, mechanism.state(phi=0.4, rate=0.0), rx.PreloadBox({"S1.teeth": (half, (1 + reach) * half)})


PULLS = pytest.mark.parametrize(("reach", "pulls"), [(0.9, ()), (1.1, ("S2.teeth", "R2.teeth"))])


@PULLS
def test_bands_tell_which_teeth_pull_though_they_are_of_something_else(reach, pulls):
    mechanism, state, bounds = share_of_two(reach)
    bands = rx.band(mechanism, state, ["A.x", "S1.teeth"], bounds)
    assert bands.names == ("A.x", "S1.teeth") and bands.lower.shape == bands.outer_upper.shape == (2,)
    assert bands.pulling == pulls
    assert ("CHANGE OF FLANK" in str(bands)) == bool(pulls)


@pytest.mark.slow
@PULLS
def test_bands_at_rest_and_limit_loads_tell_which_teeth_pull(reach, pulls):
    mechanism, state, bounds = share_of_two(reach, mu_rho=1e-7)
    path = rx.band_along(mechanism, [state], "sun.phi''", bounds)
    (bands,) = path.bands
    assert bands.stands == "yes" and bands.names == ("sun.phi''",) and bands.lower_solution.shape[0] == 1
    assert bands.pulling == pulls
    assert ("CHANGE OF FLANK" in str(path)) == bool(pulls)
    fixed = rx.PreloadBox({"S1.teeth": (bounds.box["S1.teeth"][1],) * 2}) if pulls else bounds
    assert rx.limit_load(mechanism, state, {"sun.phi": 1.0}, fixed).pulling == pulls


@pytest.mark.slow
def test_a_sun_that_floats_shares_the_load_by_itself():
    """Without its bearing nothing is redundant, and no misfit counts."""
    mechanism, state = planets()
    bodies = [
        rx.Body(name, m, j)
        for name, m, j in zip(mechanism.names.bodies, mechanism.body.mass, mechanism.body.inertia, strict=True)
    ]
    ends = [(f"S{k}", "sun", f"planet {k}", (24, 18), -1) for k in (1, 2, 3)]
    ends += [(f"R{k}", f"planet {k}", G, (18, -60), 1) for k in (1, 2, 3)]
    joints = [rx.Revolute("B", "carrier", G, (0, 0), (0, 0))]
    joints += [
        rx.Revolute(f"C{k + 1}", f"planet {k + 1}", "carrier", (0, 0), 0.042 * unit(2 * np.pi * k / 3))
        for k in range(3)
    ]
    joints += [rx.GearPair(name, i, j, (0, 0), (0, 0), teeth, MODULE, flank=flank) for name, i, j, teeth, flank in ends]
    loads = [rx.AppliedForce("sun", moment=10.0), rx.AppliedForce("carrier", moment=-35.0)]
    floating = rx.Mechanism(bodies, joints, loads=loads)
    found = rx.solve(floating, state, closure=on_pins(floating, np.array([0.0, 5e-5, -2e-5])))
    assert (found.stats.redundancy, found.stats.freedom) == (0, 1)
    np.testing.assert_allclose(shares(found), 10.0 / (3 * 0.024 * np.cos(ALPHA)), rtol=1e-11)


def test_units_and_axes_change_no_load_of_teeth():
    """In millimetres, and turned as a whole."""
    mechanism, state = planets()
    misfits = np.array([4e-7, -2e-7, 1e-6])
    expected = shares(rx.solve(mechanism, state, closure=on_pins(mechanism, misfits)))
    small, there = planets(unit=1e3)
    # kg and s stay, and forces are in kg mm/s^2
    found = rx.solve(small, there, closure=on_pins(small, 1e3 * misfits))
    np.testing.assert_allclose(shares(found), 1e3 * expected, rtol=1e-12)
    other, there = turned(mechanism, state, 2.2)
    np.testing.assert_allclose(shares(rx.solve(other, there, closure=on_pins(other, misfits))), expected, rtol=1e-11)


@pytest.mark.slow
def test_a_change_of_units_changes_no_load_of_teeth():
    """Of length, angle, mass and time at once, with friction."""
    mechanism = rx.mechanisms.planetary(mu=0.05)
    state, units = mechanism.state(phi=0.4, rate=10.0), rx.units.Units(length=1e3, angle=57.3, mass=3.0, time=2.0)
    closure = on_pins(mechanism, np.array([4e-7, -2e-7, 1e-6]))
    expected = rx.solve(mechanism, state, closure=closure)
    there = rx.units.in_units(mechanism, units), rx.units.state_in_units(state, mechanism, units)
    found = rx.solve(*there, closure=rx.units.closure_in_units(closure))
    back = rx.units.solution_from_units(found, mechanism, units)
    assert found.pulling == back.pulling == ()
    np.testing.assert_allclose(shares(back), shares(expected), rtol=1e-11)
    np.testing.assert_allclose(back.friction, expected.friction, rtol=1e-11)


@pytest.mark.slow
def test_forces_of_teeth_follow_the_module():
    """N = T / b: forward and reverse derivatives through the whole solve, the state moving with the geometry."""

    def tooth(numbers):
        mechanism = rx.mechanisms.countershaft_train(module=numbers[0], gravity=0.0, load=-30.0)
        return rx.solve(mechanism, mechanism.state(phi=0.3, rate=0.0)).multipliers[-4:]

    expected = -np.asarray(tooth(jnp.array([MODULE]))) / MODULE
    for derivative in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(derivative(tooth)(jnp.array([MODULE]))[:, 0], expected, rtol=1e-9)


# Refusals --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"teeth": (20.5, 40)}, "Arguments such as `teeth` or `flank` must be whole numbers"),
        ({"teeth": (20, 0)}, "Argument `teeth` of 'mesh' must be two numbers"),
        ({"teeth": (-60, 20)}, "Argument `teeth` of 'mesh' must be two numbers.* Name the ring as `j`"),
        ({"teeth": (20, -20)}, "Argument `teeth` of 'mesh' must be two numbers"),
        ({"teeth": 20}, "Argument `teeth` of 'mesh' must be two numbers"),
        ({"flank": 0}, "Argument `flank` of 'mesh' must be 1 or -1, but is 0"),
        ({"module": 0.0}, "Argument `module` must be positive"),
        ({"pressure_angle": 20.0}, "Argument `pressure_angle` of 'mesh' must be below pi / 2.* pi / 9"),
    ],
)
def test_a_pair_that_cannot_be_is_refused(change, message):
    given = {"teeth": (20, 40), "module": MODULE} | change
    with pytest.raises(rx.RedundaxError, match=message):
        rx.GearPair("mesh", "a", "b", (0, 0), (0, 0), **given)


def test_a_rack_without_teeth_and_planets_that_do_not_fit_are_refused():
    with pytest.raises(rx.RedundaxError, match="Argument `teeth` of 'M' must be a positive number"):
        rx.RackAndPinion("M", "a", "b", (0, 0), (0, 0), (0, 1), 0, MODULE)
    with pytest.raises(rx.RedundaxError, match="Argument `planets` must divide the 78 teeth of sun and ring together"):
        rx.mechanisms.planetary(4, 22, 17)
