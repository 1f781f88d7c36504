"""Couplers of joint coordinates, in the plane and in space: closed forms of gripper, cam and train."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax._equations._kinematics import model_at

rs = rx.spatial


def fingers(space, ratio=-1.5, of_hand=False, second="R.angle", first="L.angle"):
    """Two fingers on pins of a hand that is fixed or turns on a pin of its own."""
    if not space:
        bodies = [rx.Body(name, 1.0, inertia) for name, inertia in (("left", 0.2), ("right", 0.5), ("hand", 2.0))]
        on = "hand" if of_hand else "ground"
        joints = [
            rx.Revolute("L", "left", on, (0, 0), (-0.1, 0)),
            rx.Revolute("R", "right", on, (0, 0), (0.1, 0)),
            rx.Revolute("H", "hand", "ground", (0, 0), (0, 0)),
        ]
        return rx.Mechanism(
            bodies, joints, couplers=[rx.Coupler("C", first, second, ratio)],
            loads=[rx.AppliedForce("right", moment=3.0)],
        )  # fmt: skip
    left, right, hand = (
        rs.Body(name, 1.0, (1.0, 1.0, inertia), position=(x, 0, 0))
        for name, inertia, x in (("left", 0.2, -0.1), ("right", 0.5, 0.1), ("hand", 2.0, 0.0))
    )
    on = hand if of_hand else "ground"
    joints = [
        rs.Revolute("L", left, on, (-0.1, 0, 0)),
        rs.Revolute("R", right, on, (0.1, 0, 0)),
        rs.Revolute("H", hand, "ground", (0, 0, 0)),
    ]
    return rx.Mechanism(
        [left, right, hand], joints, couplers=[rx.Coupler("C", first, second, ratio)],
        loads=[rs.AppliedForce("right", moment=(0, 0, 3.0))],
    )  # fmt: skip


def closed(mechanism, of_space, **given):
    return (
        rx.assemble(mechanism, **given)
        if of_space
        else rx.assemble(mechanism, {"left.x": -0.1, "right.x": 0.1}, **given)
    )


@pytest.mark.parametrize("space", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_differential_shares_the_moment(space):
    """h = (l + r) / 2 of inertias 2, 0.2 and 0.5, and 3 N m on r: (J_l + J_h / 4) l" + J_h / 4 r" = 0, and likewise."""
    mechanism = fingers(space, 1.0, second={"L.angle": 0.5, "R.angle": 0.5}, first="H.angle")
    state = closed(mechanism, space, positions={"L.angle": 0.4, "R.angle": -0.2})
    found = rx.solve(mechanism, state)
    np.testing.assert_allclose(found["H.angle"], 0.1, rtol=1e-12)
    left, right = np.linalg.solve([[0.2 + 0.5, 0.5], [0.5, 0.5 + 0.5]], [0.0, 3.0])
    np.testing.assert_allclose([found["L.angle''"], found["R.angle''"]], [left, right], rtol=1e-12)
    np.testing.assert_allclose(abs(float(found["C.coupling"])), abs(2 * (left + right) / 2), rtol=1e-12)
    assert "H.angle, 0.5 L.angle + 0.5 R.angle" in str(mechanism)


@pytest.mark.slow
@pytest.mark.parametrize("space", [False, True])
def test_fingers_share_the_moment(space):
    """R turns by 3 / (J_R + ratio^2 J_L); the coupler holds ratio J_L times that as a moment on the left one."""
    mechanism = fingers(space)
    state = closed(mechanism, space, positions={"R.angle": 0.4}, rates={"R.angle": 2.0, "H.angle": 0.0})
    found = rx.solve(mechanism, state)
    expected = 3.0 / (0.5 + 1.5**2 * 0.2)
    np.testing.assert_allclose([found["L.angle"], found["L.angle'"]], [-0.6, -3.0], rtol=1e-12)
    np.testing.assert_allclose(found["R.angle''"], expected, rtol=1e-12)
    np.testing.assert_allclose(found["C.coupling"], -(-1.5 * 0.2 * expected), rtol=1e-12)
    assert mechanism.rows.kinds[list(mechanism.rows.labels).index("C.coupling")] == "moment"


@pytest.mark.slow
def test_both_joints_on_a_body_that_moves():
    """Columns that two joints share add up: planar and spatial agree, and with differences of the residual."""
    found = []
    for space in (False, True):
        mechanism = fingers(space, of_hand=True)
        given = {"positions": {"R.angle": 0.4, "H.angle": 0.3}, "rates": {"R.angle": 2.0, "H.angle": -1.0}}
        state = closed(mechanism, space, **given)
        solution = rx.solve(mechanism, state)
        found.append([float(solution[name]) for name in ("L.angle''", "R.angle''", "H.angle''", "C.coupling")])
        step, n = 1e-5, state.qd.size
        moved = [
            mechanism.constraint(mechanism.retract(state.q, s * step * e), state.t) for e in jnp.eye(n) for s in (1, -1)
        ]
        columns = [(forth - back) / (2 * step) for forth, back in zip(moved[::2], moved[1::2], strict=True)]
        np.testing.assert_allclose(mechanism.jacobian(state.q, state.t), np.stack(columns, 1), atol=1e-9)
    np.testing.assert_allclose(found[1], found[0], rtol=1e-11)


def train(coupler):
    """Two wheels and a rack in space, coupled."""
    one, two, rack = (rs.Body(name, 1.0, (0.1, 0.1, 0.2), position=(k, 0, 0)) for k, name in enumerate("abr"))
    joints = [
        rs.Revolute("A", one, "ground", (0, 0, 0)),
        rs.Revolute("B", two, "ground", (1, 0, 0)),
        rs.Prismatic("R", rack, "ground", (2, 0, 0), (0, 1, 0)),
    ]
    return rx.Mechanism([one, two, rack], joints, couplers=[coupler])


def turned_to(mechanism, a, b, travel):
    """The residual of the coupler with the wheels and the rack there."""
    pins = [[np.cos(angle / 2), 0, 0, np.sin(angle / 2)] for angle in (a, b, 0.0)]
    q = jnp.asarray(np.concatenate([np.ravel([[0, 0, 0], [1, 0, 0], [2, travel, 0]]), *pins]))
    return float(mechanism.constraint(q, jnp.zeros(()))[mechanism.rows.labels.index("C.coupling")])


@pytest.mark.parametrize("ratio", [-2.0, 1 / 3, -0.5])
def test_coupled_angles_in_space_go_round_and_round(ratio):
    """Closed at every angle of the second, and open by what the first is moved, whole turns counted or not."""
    for start, law in ((0.0, {"ratio": ratio}), (0.1, {"polynomial": (0.1, ratio, 0.0, 0.0, 0.0)})):
        mechanism = train(rx.Coupler("C", "A.angle", "B.angle", **law))
        for b in (-9.0, -3.2, 0.3, 3.1, 3.2, 6.4, 20.0):
            for moved in (0.0, 0.2, -0.3):
                np.testing.assert_allclose(turned_to(mechanism, start + ratio * b + moved, b, 0.0), moved, atol=1e-13)


def test_a_traced_ratio_goes_round_and_round_too():
    """The second angle shows less than half a turn after 9 rad, a third of a turn of the first too little."""

    @jax.jit
    def residual(ratio, moved):
        pins = [[jnp.cos(angle / 2), 0, 0, jnp.sin(angle / 2)] for angle in (3.0 + moved, 9.0, 0.0)]
        places = np.ravel([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
        q = jnp.concatenate([places, *map(jnp.asarray, pins)])
        mechanism = train(rx.Coupler("C", "A.angle", "B.angle", ratio))
        return mechanism.constraint(q, jnp.zeros(()))[mechanism.rows.labels.index("C.coupling")]

    np.testing.assert_allclose([residual(1 / 3, 0.0), residual(1 / 3, 0.2)], [0.0, 0.2], atol=1e-13)


def test_a_rack_in_space_goes_on_beyond_half_a_turn():
    """Closed at a travel of 0.02 b - 0.1, whatever turn b is at, and open by what the rack is moved."""
    rack = train(rx.Coupler("C", "R.travel", "B.angle", polynomial=(-0.1, 0.02)))
    for b in (-7.0, 3.1, 3.2, 50.0):
        for moved in (0.0, 0.01):
            np.testing.assert_allclose(turned_to(rack, 0, b, 0.02 * b - 0.1 + moved), moved, atol=1e-14)


@pytest.mark.slow
def test_a_half_speed_shaft_is_driven_round():
    """A motor takes the second through a whole turn and a quarter; the first goes half as far."""
    mechanism = train(rx.Coupler("C", "A.angle", "B.angle", 0.5))
    state = rx.assemble(mechanism, positions={"B.angle": 2.9}, rates={"B.angle": 2.0, "R.travel": 0.0})
    motion = rx.simulate(mechanism, state, 0.4, ts=jnp.linspace(0.0, 0.4, 5))
    np.testing.assert_allclose(np.unwrap(motion["B.angle"]), 2.9 + 2.0 * np.linspace(0.0, 0.4, 5), rtol=1e-6)
    np.testing.assert_allclose(motion["A.angle"], 1.45 + np.linspace(0.0, 0.4, 5), rtol=1e-6)


def lifted(b):
    """A follower of 2 kg on a cam that lifts it by z = 0.01 + 0.02 a + b a^2, at a = 0.8 and a' = 2."""
    shaft = rs.Body("shaft", 1.0, (0.3, 0.3, 0.4))
    follower = rs.Body("follower", 2.0, (0.1, 0.1, 0.1), position=(0.2, 0, 0))
    joints = [rs.Revolute("S", shaft, "ground", (0, 0, 0)), rs.Prismatic("F", follower, "ground", (0.2, 0, 0))]
    cam = rx.Coupler("cam", "F.travel", "S.angle", polynomial=jnp.stack([jnp.asarray(0.01), jnp.asarray(0.02), b]))
    mechanism = rx.Mechanism([shaft, follower], joints, couplers=[cam], gravity=(0, 0, -9.81))
    return rx.solve(mechanism, rx.assemble(mechanism, positions={"S.angle": 0.8}, rates={"S.angle": 2.0}))


def lifted_by_hand(b):
    """Acceleration of its angle."""
    slope, bend, rate = 0.02 + 2 * b * 0.8, 2 * b, 2.0
    return -2.0 * slope * (9.81 + bend * rate**2) / (0.4 + 2.0 * slope**2)


@pytest.mark.slow
def test_a_cam_lifts_by_a_polynomial():
    found = lifted(jnp.asarray(0.03))
    np.testing.assert_allclose(found["F.travel"], 0.01 + 0.02 * 0.8 + 0.03 * 0.64, rtol=1e-12)
    np.testing.assert_allclose(found["S.angle''"], lifted_by_hand(0.03), rtol=1e-12)
    lift = found["F.travel''"]
    np.testing.assert_allclose(-found["cam.coupling"], 2.0 * (lift + 9.81), rtol=1e-12)


@pytest.mark.slow
def test_the_shape_of_a_cam_has_derivatives():
    slope, step = jax.jit(jax.grad(lambda b: lifted(b)["S.angle''"]))(jnp.asarray(0.03)), 1e-5
    expected = (lifted_by_hand(0.03 + step) - lifted_by_hand(0.03 - step)) / (2 * step)
    np.testing.assert_allclose(slope, expected, rtol=1e-6)


@pytest.mark.slow
def test_redundant_couplers_are_found_and_closed():
    """A third coupler round a ring of three is redundant: 2 x 3 = 6; a closure on rows settles it."""
    wheels = [rs.Body(name, 1.0, (0.1, 0.1, 0.2), position=(k, 0, 0)) for k, name in enumerate("abc")]
    joints = [rs.Revolute(body.name.upper(), body, "ground", (k, 0, 0)) for k, body in enumerate(wheels)]
    couplers = [
        rx.Coupler("ab", "A.angle", "B.angle", 2.0), rx.Coupler("bc", "B.angle", "C.angle", 3.0),
        rx.Coupler("ac", "A.angle", "C.angle", 6.0),
    ]  # fmt: skip
    mechanism = rx.Mechanism(wheels, joints, couplers=couplers, loads=[rs.AppliedForce("a", moment=(0, 0, 1.0))])
    state = rx.assemble(mechanism, rates={"C.angle": 1.0})
    report = rx.analyze(mechanism, state)
    assert (report.redundancy, report.freedom) == (1, 1)
    assert set(report.groups[0]) == {"ab.coupling", "bc.coupling", "ac.coupling"}
    stiff = rx.Compliance({f"{name}.coupling": 1e-6 for name in ("ab", "bc", "ac")})
    found = rx.solve(mechanism, state, closure=stiff)
    stress = np.array([1.0, 2.0, -1.0])  # ab + 2 bc - ac
    loads = np.array([found[f"{name}.coupling"] for name in ("ab", "bc", "ac")])
    np.testing.assert_allclose(loads @ stress, 0, atol=1e-12 * np.abs(loads).max())
    assert "Coupler" in str(mechanism)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: rx.Coupler("C", "L.angle", "R.angle"), "either `ratio` or `polynomial`"),
        (lambda: rx.Coupler("C", "L.angle", "R.angle", (1.0, 2.0)), "a number as `ratio`"),
        (lambda: rx.Coupler("C", {}, "R.angle", 1.0), "name of a coordinate, or weights of several"),
        (lambda: rx.Coupler("C", "L.angle", {"R.angle": np.nan}, 1.0), "`second` of coupler 'C' .* nan of 'R.angle'"),
        (lambda: rx.Coupler("C", {"L.angle": 1, "H.angle": 0}, "R.angle", 1.0), "`first` .* has 0 of 'H.angle'"),
        (lambda: rx.Coupler("C", {"L.angle": np.float32("inf")}, "R.angle", 1.0), "`first` .* has inf of 'L.angle'"),
        (lambda: rx.Coupler("C", "L.angle", {"R.angle": np.ones(2)}, 1.0), "name of a coordinate, or weights"),
        (lambda: rx.Coupler("C", "L.angle", "R.angle", np.nan), "`ratio` of coupler 'C' must be finite"),
        (lambda: rx.Coupler("C", "L.angle", "R.angle", polynomial=(0, np.inf)), "`polynomial` .* must be finite"),
        (lambda: rx.Stop("S", "L.angle", most=np.nan), "`most` of stop 'S' must be finite"),
        (lambda: fingers(False, second={"L.angle": 1.0, "Q.angle": 1.0}), "joint coordinates"),
        (lambda: fingers(True, ratio=jnp.ones(2)), "a number as `ratio`"),
        (lambda: fingers(True, second="R.travel"), "joint coordinates"),
    ],
)  # fmt: skip
def test_bad_couplers_say_what_to_do(make, words):
    with pytest.raises(rx.RedundaxError, match=words):
        make()


@pytest.mark.parametrize("number", [np.float32, np.float64, np.int32, np.uint8, np.asarray, jnp.asarray, int])
def test_weights_are_numbers_of_any_library(number):
    assert rx.Coupler("C", {"L.angle": number(2)}, "R.angle", 1.0).first == (("L.angle", 2.0),)


def test_couplers_of_kinds_in_turn_have_residuals_and_slopes_in_the_same_rows():
    bodies = [rx.Body(name, 1.0, 0.1) for name in "abcd"]
    pins = [rx.Revolute(f"R{name}", name, "ground", (0.1, 0.0), (0.0, 0.0)) for name in "abc"]
    couplers = [
        rx.Coupler("1", "Ra.angle", "Rb.angle", 2.0),
        rx.SpeedDriver("4", "K.travel", 0.3),
        rx.Coupler("2", "K.travel", "Rb.angle", 0.3),
        rx.Coupler("3", "Rc.angle", "Rb.angle", 5.0),
    ]
    guide = rx.Translational("K", "d", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0))
    mechanism = rx.Mechanism(bodies, [*pins, guide], couplers=couplers)
    q, qd, t = jnp.linspace(0.1, 1.2, 12), jnp.linspace(-0.7, 1.0, 12), jnp.zeros(())
    model = model_at(mechanism.anonymous, rx.State(q, qd, t))
    motion, row = model.motion, mechanism.rows.labels.index("4.speed")
    np.testing.assert_allclose(model.jacobian @ qd - 0.3 * (np.arange(12) == row), motion.rate, rtol=0, atol=1e-14)
    np.testing.assert_allclose(motion.rate[row], qd[6] - 0.3, rtol=1e-14)  # of d along x
