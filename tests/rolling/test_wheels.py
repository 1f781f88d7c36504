"""Wheels: a rolling disc at 50 digits and in motion, a cart against its equations written by hand, planar wheels."""

import equinox as eqx
import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg

import redundax as rx

RADIUS, MASS, G = 0.3, 2.0, 9.81


def rolling(axes, omega, sin_cos, number=float):
    """Accelerations of the centre and of the turn, and the force on a thin uniform disc that rolls on z = 0.

    `axes` are those of the disc as columns, y its axle; all is global. The velocity of the centre is -omega x r with
    r = -R e from the centre to the floor, for all times, so that its rate is a = -alpha x r - omega x r'; and
    m a = F + m g, I alpha + omega x I omega = r x F.
    """
    array = lambda x: np.array(x, dtype=object if number is mp.mpf else float)  # noqa: E731
    up, axle = array([number(0), number(0), number(1)]), axes[:, 1]
    cross = lambda a, b: array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])  # noqa: E731
    turned, across = cross(omega, axle), up - (axle @ up) * axle
    size = sin_cos(across @ across)
    e = across / size
    rate = -(turned @ up) * axle - (axle @ up) * turned
    e_rate = (rate - (e @ rate) * e) / size
    r, r_rate = -number(RADIUS) * e, -number(RADIUS) * e_rate
    m, unit = number(MASS), number(MASS) * number(RADIUS) ** 2 / 4
    inertia = unit * (array(np.eye(3).tolist()) + np.outer(axle, axle))
    skew = array([[0 * r[0], -r[2], r[1]], [r[2], 0 * r[0], -r[0]], [-r[1], r[0], 0 * r[0]]])  # r x
    # F = m (a - g) with a = r x alpha - omega x r':  (I - r x (m r x)) alpha = -omega x I omega + r x m (-w x r' - g)
    gravity = array([number(0), number(0), -number(G)])
    left = inertia - m * skew @ skew
    right = -cross(omega, inertia @ omega) + cross(r, m * (-cross(omega, r_rate) - gravity))
    if number is mp.mpf:
        alpha = np.array(list(mp.lu_solve(mp.matrix(left.tolist()), mp.matrix(right.tolist()))), dtype=object)
    else:
        alpha = np.linalg.solve(left, right)
    a = cross(r, alpha) - cross(omega, r_rate)
    return a, alpha, m * (a - gravity), -cross(omega, r)


def test_a_tilted_disc_against_50_digits():
    mp.mp.dps = 50
    tilt, own = mp.mpf("0.37"), [mp.mpf("0.6"), mp.mpf("7.5"), mp.mpf("-0.8")]  # about its own axes
    c, s = mp.cos(tilt), mp.sin(tilt)
    axes = np.array([[1, 0, 0], [0, c, -s], [0, s, c]], dtype=object)
    omega = axes @ np.array(own, dtype=object)
    a, alpha, force, speed = rolling(axes, omega, mp.sqrt, mp.mpf)
    disc = rx.mechanisms.rolling_disc(RADIUS, MASS, float(tilt), G)
    state = rx.State(disc.reference, jnp.array([float(x) for x in (*speed, *own)]))
    found = rx.solve(disc, state)
    # about axes that turn with the disc the rate of the angular velocity is that about fixed ones
    expected = np.array([float(x) for x in (*a, *(axes.T @ alpha))])
    np.testing.assert_allclose(found.acceleration, expected, rtol=0, atol=1e-11)
    along, across = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
    loads = [float(force[2]), *(np.array([float(x) for x in force]) @ way for way in (along, across))]
    np.testing.assert_allclose(found.multipliers, loads, rtol=0, atol=1e-11 * MASS * G)
    assert rx.analyze(disc, state).freedom == 3
    needed = float(rx.grip(disc, found)["rim"])
    assert abs(needed - np.hypot(loads[1], loads[2]) / loads[0]) < 1e-12


@pytest.mark.slow
def test_a_disc_rolls_and_wobbles_as_its_equations_say():
    tilt, own, end = 0.2, np.array([0.3, 9.0, 0.4]), 1.5
    c, s = np.cos(tilt), np.sin(tilt)
    axes = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])

    def rate(t, y):
        turn, omega = y[3:12].reshape(3, 3), y[12:]
        _, alpha, _, speed = rolling(turn, omega, np.sqrt)
        return np.concatenate([speed, np.cross(omega, turn, axisb=0, axisc=0).ravel(), alpha])

    begin = np.concatenate([[0.0, -RADIUS * s, RADIUS * c], axes.ravel(), axes @ own])
    truth = scipy.integrate.solve_ivp(rate, (0.0, end), begin, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    disc = rx.mechanisms.rolling_disc(RADIUS, MASS, tilt, G)
    start = rx.assemble(disc, qd=jnp.array([*rate(0.0, begin)[:3], *own]))
    motion = rx.simulate(disc, start, end, rtol=1e-12)
    q, qd = (np.asarray(x)[-1] for x in (motion.states.q, motion.states.qd))
    np.testing.assert_allclose(q[:3], truth[:3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(qd[3:], truth[3:12].reshape(3, 3).T @ truth[12:], rtol=0, atol=1e-8)  # of 12 rad/s
    assert float(motion.stats.energy_error) < 1e-9
    assert float(motion.stats.position_violation) < 1e-12


# A cart, by hand -----------------------------------------------------------------------------

BASE, TRACK, R, M, M_WHEEL, HEIGHT = 0.8, 0.6, 0.15, 30.0, 1.5, 0.25
NAMES = ("front left", "front right", "rear left", "rear right")
CENTRES = np.array([[x, y, R] for x in (BASE / 2, -BASE / 2) for y in (TRACK / 2, -TRACK / 2)])
PUSH = np.array([20.0, 10.0, 0.0])


def cart_by_hand(driven=()):
    """Rows of Phi_q on twists (v, omega) of chassis and wheels, global components, their names, M and Q."""
    rows, names = [], []

    def twist(body, way, arm, turn):
        row = np.zeros(30)
        row[6 * body : 6 * body + 3], row[6 * body + 3 : 6 * body + 6] = way, np.cross(arm, way) + turn
        return row

    none, axes = np.zeros(3), np.eye(3)
    for k, (name, centre) in enumerate(zip(NAMES, CENTRES, strict=True), 1):
        arm = centre - [0, 0, HEIGHT]
        for axis in range(3):
            rows.append(twist(k, axes[axis], none, none) - twist(0, axes[axis], arm, none))
            names.append(f"{name} hub {'xyz'[axis]}")
        for axis in (0, 2):
            rows.append(twist(k, none, none, axes[axis]) - twist(0, none, none, axes[axis]))
            names.append(f"{name} hub about {'xyz'[axis]}")
        for row, axis in (("normal", 2), ("along", 0), ("across", 1)):
            rows.append(-twist(k, axes[axis], np.array([0, 0, -R]), none))
            names.append(f"{name} tyre.{row}")
    for name in driven:
        k = 1 + NAMES.index(name)
        rows.append(twist(k, none, none, axes[1]) - twist(0, none, none, axes[1]))
        names.append(f"{name} motor.speed")
    block = M / 12 * np.array([TRACK**2, BASE**2, BASE**2 + TRACK**2])
    disc = M_WHEEL * R**2 / 4 * np.array([1, 2, 1])
    mass = np.concatenate([np.full(3, M), block, *[np.concatenate([np.full(3, M_WHEEL), disc])] * 4])
    load = np.concatenate([PUSH - [0, 0, M * G], none, *[np.array([0, 0, -M_WHEEL * G, 0, 0, 0])] * 4])
    return np.array(rows), names, np.diag(mass), load


def statics_of(driven):
    """Rank, unique rows with their multipliers, and accelerations; the cart rolls straight on, so that gamma = 0."""
    rows, names, mass, load = cart_by_hand(driven)
    whole = np.block([[mass, rows.T], [rows, np.zeros((len(rows),) * 2)]])
    found = np.linalg.lstsq(whole, np.concatenate([load, np.zeros(len(rows))]), rcond=1e-11)[0]
    stress = scipy.linalg.null_space(rows.T, rcond=1e-11)
    unique = {n: x for n, x, own in zip(names, found[30:], stress, strict=True) if np.abs(own).max(initial=0.0) < 1e-9}
    return np.linalg.matrix_rank(rows, 1e-9), unique, found[:30]


@pytest.mark.parametrize(
    "driven",
    [
        pytest.param((), marks=pytest.mark.slow),
        ("rear left",),
        pytest.param(("rear left", "rear right"), marks=pytest.mark.slow),
        pytest.param(NAMES, marks=pytest.mark.slow),
    ],
    ids=len,
)
def test_a_cart_has_the_unique_loads_and_motors_of_brute_force(driven):
    rank, unique, acceleration = statics_of(driven)
    cart = rx.mechanisms.cart(BASE, TRACK, R, M, M_WHEEL, HEIGHT, PUSH, driven)
    state = rx.assemble(cart, qd={"chassis.x": 0.75})
    report, found = rx.analyze(cart, state), rx.solve(cart, state)
    rows, *_ = cart_by_hand(driven)
    assert (report.rank, report.redundancy, report.freedom) == (rank, len(rows) - rank, 30 - rank)
    assert (report.holonomic_rank, report.holonomic_redundancy) == (23, 1)
    ours = {name for name in report.unique_multipliers if "tyre" in name or "motor" in name}
    assert ours == {name for name in unique if "tyre" in name or "motor" in name}
    for name in ours:
        assert abs(float(found[name]) - unique[name]) < 1e-11 * M * G, name
    verdicts = {each.name: each.without_friction for each in report.verdicts["reaction"]}
    for wheel in NAMES:
        for axis in "xyz":
            verdict = verdicts[f"{wheel} hub force {axis} on {wheel}"]
            assert (verdict is not rx.Verdict.NOT_UNIQUE) == (f"{wheel} hub {axis}" in unique)
    np.testing.assert_allclose(found["chassis.x''"], acceleration[0], rtol=0, atol=1e-12)


@pytest.mark.slow
def test_tyres_of_equal_compliance_share_as_their_least_energy_says():
    rows, names, mass, load = cart_by_hand()
    acceleration = statics_of(())[2]
    tyres = [names.index(f"{name} tyre.{row}") for name in NAMES for row in ("normal", "along", "across")]
    start = np.linalg.lstsq(rows.T, load - mass @ acceleration, rcond=1e-11)[0]
    stress = scipy.linalg.null_space(rows.T, rcond=1e-11)
    loads = start - stress @ np.linalg.lstsq(stress[tyres], start[tyres], rcond=1e-11)[0]
    cart = rx.mechanisms.cart(BASE, TRACK, R, M, M_WHEEL, HEIGHT, PUSH)
    state = rx.assemble(cart)
    closure = rx.ElasticJoints(cart, {f"{name} tyre": 1e-6 for name in NAMES})
    found = rx.solve(cart, state, closure=closure)
    for k in tyres:
        assert abs(float(found[names[k]]) - loads[k]) < 1e-9 * M * G, names[k]
    grip = rx.grip(cart, found)
    for name in NAMES:
        normal, along, across = (loads[names.index(f"{name} tyre.{row}")] for row in ("normal", "along", "across"))
        assert abs(float(grip[f"{name} tyre"]) - np.hypot(along, across) / normal) < 1e-9
    both = jax.jit(lambda push: rx.grip(cart, rx.solve(_pushed(cart, push), state, closure=closure)))(2 * PUSH)
    assert float(both["front left tyre"]) > float(grip["front left tyre"])


def _pushed(cart, push):
    return eqx.tree_at(lambda cart: cart.loads[0].element.force, cart, jnp.asarray(push)[None])


# In the plane --------------------------------------------------------------------------------


def bicycle(*couplers, **rubs):
    bodies = [rx.Body("frame", 5.0, 0.5), rx.Body("front", 1.0, 0.05), rx.Body("rear", 1.0, 0.05)]
    pins = [rx.Revolute(name, name, "frame", (0, 0), (x, 0), **rubs) for name, x in (("front", 0.5), ("rear", -0.5))]
    tyres = [rx.Wheel(f"{name} tyre", name, "ground", (0, 0), (0, -1.0), (0, 1), R) for name in ("front", "rear")]
    slope = 0.1
    gravity = (G * np.sin(slope), -G * np.cos(slope))
    return rx.Mechanism(bodies, [*pins, *tyres], couplers=couplers, gravity=gravity)


GUESS = {"frame.y": R - 1.0, "front.y": R - 1.0, "rear.y": R - 1.0, "front.x": 0.5, "rear.x": -0.5, "front.phi": 3.0}


def test_a_bicycle_rolls_down_a_slope_with_the_inertia_of_its_wheels():
    mechanism = bicycle()
    state = rx.assemble(mechanism, GUESS)
    assert abs(float(state.q[mechanism.coordinates.names.index("front.phi")]) - 3.0) < 1e-12  # free of its way
    found = rx.solve(mechanism, state)
    acceleration = 7.0 * G * np.sin(0.1) / (7.0 + 2 * 0.05 / R**2)
    assert abs(float(found["frame.x''"]) - acceleration) < 1e-12
    assert abs(float(found["front.phi''"]) + acceleration / R) < 1e-11
    force = -0.05 * acceleration / R**2  # up the slope, on the wheel
    assert abs(float(found["front tyre.along"]) - force) < 1e-12
    assert abs(float(found["front tyre.normal"] + found["rear tyre.normal"]) - 7.0 * G * np.cos(0.1)) < 1e-11
    needed = rx.grip(mechanism, found)
    assert abs(float(needed["front tyre"]) + force / float(found["front tyre.normal"])) < 1e-12


def test_a_bicycle_whose_hubs_rub():
    """(7 + 2 J / R^2) a = 7 g sin - (M_1 + M_2) / R with the moments mu rho |F| of its pins."""
    mechanism = bicycle(pin_radius=0.02, friction=rx.Coulomb(0.3))
    found = rx.solve(mechanism, rx.assemble(mechanism, GUESS, rates={"frame.x": 1.0}))
    pins = [np.hypot(*(float(found[f"{name} force {axis} on {name}"]) for axis in "xy")) for name in ("front", "rear")]
    wanted = (7.0 * G * np.sin(0.1) - 0.3 * 0.02 * sum(pins) / R) / (7.0 + 2 * 0.05 / R**2)
    assert abs(float(found["frame.x''"]) - wanted) < 1e-11


@pytest.mark.slow
def test_two_drives_of_speed_of_wheels_that_roll_fight_each_other():
    one = bicycle(rx.SpeedDriver("motor", "front.angle", rx.Polynomial([-2.0, -1.0])))
    state = rx.assemble(one, GUESS)
    assert abs(float(state.qd[0]) - 2.0 * R) < 1e-12
    found = rx.solve(one, state)
    torque = -0.05 - 0.05 - R * (7.0 * R - 7.0 * G * np.sin(0.1))  # on the wheel: clockwise drives ahead
    assert abs(-float(found["motor.speed"]) - torque) < 1e-11
    two = bicycle(
        rx.SpeedDriver("motor", "front.angle", rx.Polynomial([-2.0, -1.0])),
        rx.SpeedDriver("other", "rear.angle", rx.Polynomial([-2.0, -1.0])),
    )
    report = rx.analyze(two, state)
    assert report.redundancy == 1 and {"motor.speed", "other.speed"} & set(report.unique_multipliers) == set()
    with pytest.raises(rx.NoSolutionError, match="No velocity satisfies the constraints"):
        rx.assemble(
            bicycle(rx.SpeedDriver("motor", "front.angle", 1.0), rx.SpeedDriver("other", "rear.angle", 2.0)), GUESS
        )


@pytest.mark.slow
def test_what_one_of_two_drives_may_carry_bounds_the_other():
    law = rx.Polynomial([-2.0, -1.0])
    two = bicycle(rx.SpeedDriver("motor", "front.angle", law), rx.SpeedDriver("other", "rear.angle", law))
    state = rx.assemble(two, GUESS)
    whole = 2 * 0.05 + R * (7.0 * R - 7.0 * G * np.sin(0.1))  # minus the torque of both
    found = rx.band(two, state, "other.speed", rx.PreloadBox({"motor.speed": (-1.0, 1.0)}))
    np.testing.assert_allclose(np.ravel([found.lower, found.upper]), [whole - 1.0, whole + 1.0], rtol=0, atol=1e-9)


def test_a_disc_that_only_stands_lifts_and_one_that_rolls_warns():
    def standing(g, **rows):
        tyre = rx.Wheel("tyre", "disc", "ground", (0, 0), (0, 0), (0, 1), R, **rows)
        return rx.Mechanism([rx.Body("disc", 2.0, 0.1)], [tyre], gravity=(0.0, -g))

    state = rx.State([0.0, R, 0.0], [0.0, 0.0, 0.0])
    one_sided = {"rows": ("normal",), "one_sided": True}
    found = rx.solve(standing(G, **one_sided), state)
    assert found.contacts == {"tyre": "carries"} and abs(float(found["tyre.normal"]) - 2.0 * G) < 1e-12
    found = rx.solve(standing(-G, **one_sided), state)
    assert found.contacts == {"tyre": "lifts"} and abs(float(found["disc.y''"]) - G) < 1e-12
    with pytest.warns(match="Contacts pull in tyre.normal, which can only push"):
        found = rx.solve(standing(-G), state)
    assert abs(float(found["tyre.normal"]) + 2.0 * G) < 1e-12


@pytest.mark.slow
def test_projection_keeps_positions_that_rows_of_velocity_repeat():
    """Two drives of speed repeat what a coupler of angle and travel says of positions."""
    crank = rx.Revolute("A", "crank", "ground", (0, 0), (0, 0))
    guide = rx.Translational("K", "slider", "ground", (0, 0), (0, 0), (0, 1))
    rate = rx.Polynomial([1.0, 0.4])
    angle = lambda t: t + 0.2 * t**2  # noqa: E731
    mechanism = rx.Mechanism(
        [rx.Body("crank", 1.0, 0.1), rx.Body("slider", 2.0, 0.1)],
        [crank, guide],
        couplers=[
            rx.Coupler("cam", "K.travel", "A.angle", polynomial=(0.0, 0.1, 0.3)),
            rx.SpeedDriver("motor", "A.angle", rate),
            rx.SpeedDriver("feed", "K.travel", lambda t: (0.1 + 0.6 * angle(t)) * rate(t)),
        ],
    )
    start = rx.assemble(mechanism, {"crank.phi": 0.0})
    assert rx.analyze(mechanism, start).redundancy == 1
    motion = rx.simulate(mechanism, start, 1.0, rtol=1e-3)
    assert float(motion.stats.position_violation) < 1e-13


def test_wheels_that_cannot_be_are_refused():
    with pytest.raises(rx.RedundaxError, match="must hold some of normal, along, but is"):
        rx.Wheel("w", "a", "ground", (0, 0), (0, 0), (0, 1), 0.3, rows=("across",))
    with pytest.raises(rx.RedundaxError, match="`radius` of joint 'w' must be positive"):
        rx.Wheel("w", "a", "ground", (0, 0), (0, 0), (0, 1), 0.0)
    disc = rx.spatial.Body("disc", 1.0, (1, 1, 1))
    with pytest.raises(rx.RedundaxError, match="must hold some of normal, along, across"):
        rx.spatial.Wheel("w", disc, "ground", (0, 0, 0.3), (0, 1, 0), radius=0.3, rows=("spin",))
    with pytest.raises(rx.RedundaxError, match=r"coordinate.*A\.angel.*A\.angle"):
        rx.Mechanism(
            [rx.Body("a", 1.0, 1.0)],
            [rx.Revolute("A", "a", "ground", (0, 0), (0, 0))],
            couplers=[rx.SpeedDriver("s", "A.angel", 1.0)],
        )
