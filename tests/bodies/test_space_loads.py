"""Loads on bodies in space against NumPy: virtual work of what they stretch, and motions.

With a load's stretch x of a pose, written here with SciPy's rotations, its generalised force must be

    Q = -(dx/dv)^T (K (x - x0) + D x')
"""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import redundax as rx

rs, G = rx.spatial, "ground"
RNG = np.random.default_rng(5)
INERTIA = np.array([[0.5, 0.05, -0.02], [0.05, 0.7, 0.04], [-0.02, 0.04, 0.6]])
SET = Rotation.random(random_state=1).as_matrix()
A = rs.Body("a", 2.0, INERTIA, centre=(0.1, -0.2, 0.3), position=(0.4, 0.1, -0.3), orientation=SET)
B = rs.Body("b", 3.0, (0.4, 0.5, 0.6), centre=(-0.2, 0.1, 0.0), position=(-0.3, 0.2, 0.1), orientation=(3, 1, 0, 2))
X, TURNS = RNG.normal(size=(2, 3)), Rotation.random(2, random_state=2)
V = RNG.normal(size=12)
AXIS, MARK, POINT = np.array([0.3, -0.5, 0.8]), np.array([1.0, 0.2, 0.1]), np.array([0.2, 0.3, -0.1])
STIFF, DAMP = np.diag([3.0, 4.0, 5.0]) + 0.5, np.diag([0.3, 0.2, 0.1])


def state():
    q = np.concatenate([X.ravel(), 1.7 * TURNS.as_quat(scalar_first=True).ravel()])
    return rx.State(jnp.asarray(q), jnp.asarray(V), 0.4)


def poses(d):
    """Origin and rotation of both bodies and of the ground, moved by velocities times a short time."""
    out = []
    for k, body in enumerate((A, B)):
        turn = TURNS[k] * Rotation.from_rotvec(d[6 + 3 * k : 9 + 3 * k])
        out.append((X[k] + d[3 * k : 3 * k + 3] - turn.apply(np.array(body.centre)), turn))
    return {"a": out[0], "b": out[1], G: (np.zeros(3), Rotation.identity())}


def slopes(x):
    """dx/dv by differences of fourth order."""
    h, unit = 1e-3, np.eye(12)
    return np.stack([(8 * (x(h * e) - x(-h * e)) - (x(2 * h * e) - x(-2 * h * e))) / (12 * h) for e in unit], axis=1)


def local(body, point):
    """A global point at the reference pose, and what turns global directions, in the local frame."""
    if body == G:
        return point, np.eye(3)
    w, *v = np.asarray(body.orientation)
    turn = Rotation.from_quat([*v, w]).as_matrix().T
    return turn @ (point - np.asarray(body.position)), turn


def at(d, body, s):
    """Global position of a local point."""
    r, turn = poses(d)[body if body == G else body.name]
    return r + turn.apply(s)


def axes():
    z = AXIS / np.linalg.norm(AXIS)
    x = MARK - (MARK @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def relative(d, i, j, frame):
    """Offset and turn of axes, which are `frame` at the reference poses, on body i from those on j, as j sees them."""
    (si, ti), (sj, tj) = local(i, POINT), local(j, POINT)
    pose = poses(d)
    on_i, on_j = (pose[b if b == G else b.name][1] * Rotation.from_matrix(t @ frame) for b, t in ((i, ti), (j, tj)))
    return on_j.inv().apply(at(d, i, si) - at(d, j, sj)), on_j.inv() * on_i


def length(d):
    return np.linalg.norm(at(d, A, local(A, POINT)[0]) - at(d, B, local(B, MARK)[0]))[None]


def angle(d):
    turn = relative(d, A, B, axes())[1].as_quat(canonical=True)
    return np.array([2 * np.arctan2(turn[2], turn[3])])


def stretch(d, j=B):
    offset, turn = relative(d, A, j, axes())
    way = turn.as_rotvec()
    size = np.linalg.norm(way)
    return np.concatenate([offset, 2 * np.tan(size / 2) / size * way])


def generalised(load):
    """Generalised force of a load alone."""
    joints = [rs.Spherical("A", A, G, point=(0, 0, 0)), rs.Spherical("B", B, G, point=(0, 0, 0))]
    with_it, without = (rx.Mechanism([A, B], joints, loads=loads) for loads in ([load], []))
    return np.asarray(with_it.load(state()) - without.load(state()))


def block(one, other):
    return np.block([[one, np.zeros((3, 3))], [np.zeros((3, 3)), other]])


@pytest.mark.parametrize(
    ("load", "x", "free", "K", "D"),
    [
        (
            rs.SpringDamper(A, B, POINT, MARK, stiffness=50.0, free_length=0.4, damping=3.0),
            length,
            0.4,
            np.eye(1) * 50.0,
            np.eye(1) * 3.0,
        ),
        (
            rs.SpringDamper("a", "b", on_i=local(A, POINT)[0], on_j=local(B, MARK)[0], stiffness=50.0),
            length,
            0.0,
            np.eye(1) * 50.0,
            np.zeros((1, 1)),
        ),
        (
            rs.TorsionSpring(A, B, AXIS, stiffness=5.0, free_angle=0.3, damping=2.0),
            angle,
            0.3,
            np.eye(1) * 5.0,
            np.eye(1) * 2.0,
        ),
        (
            rs.Bushing(
                A,
                B,
                POINT,
                AXIS,
                MARK,
                translation=STIFF,
                rotation=(1.0, 2.0, 3.0),
                translation_damping=0.7,
                rotation_damping=DAMP,
            ),
            stretch,
            0.0,
            block(STIFF, np.diag([1.0, 2.0, 3.0])),
            block(0.7 * np.eye(3), DAMP),
        ),
        (
            rs.Bushing(A, G, POINT, AXIS, MARK, translation=2.0, rotation=STIFF, rotation_damping=0.2),
            lambda d: stretch(d, G),
            0.0,
            block(2.0 * np.eye(3), STIFF),
            block(np.zeros((3, 3)), 0.2 * np.eye(3)),
        ),
    ],
    ids=("spring", "spring in local frames", "torsion", "bushing", "bushing on the ground"),
)
def test_springs_do_the_work_of_what_they_stretch(load, x, free, K, D):
    slope = slopes(x)
    expected = -slope.T @ (K @ (x(np.zeros(12)) - free) + D @ (slope @ V))
    np.testing.assert_allclose(generalised(load), expected, rtol=1e-9, atol=1e-9 * np.max(np.abs(expected)))


@pytest.mark.parametrize("follows", [False, True])
def test_an_applied_force_and_moment_do_their_work(follows):
    force, moment = np.array([2.0, -3.0, 1.0]), np.array([0.5, 0.2, -0.7])
    load = rs.AppliedForce(A, force, point=POINT, moment=moment, follows=follows)
    turn = TURNS[0].as_matrix()
    acting, twisting = (turn @ v if follows else v for v in (force, moment))
    expected = slopes(lambda d: at(d, A, local(A, POINT)[0])).T @ acting
    expected[6:9] += turn.T @ twisting
    np.testing.assert_allclose(generalised(load), expected, atol=1e-10)
    at_origin = generalised(rs.AppliedForce("a", force))
    np.testing.assert_allclose(at_origin, slopes(lambda d: at(d, A, np.zeros(3))).T @ force, atol=1e-10)


def test_a_function_of_both_motions_does_its_work():
    """A drag on the velocity of a point of i past that of j, and a moment on j that grows with time."""
    here, there = np.array([0.1, 0.4, -0.2]), np.array([-0.3, 0.2, 0.5])

    def drag(i, j, t, p):
        force = -p["c"] * (i.point_velocity(jnp.asarray(here)) - j.point_velocity(jnp.asarray(there)))
        on_j = j.wrench(-force, jnp.asarray(there))
        return i.wrench(force, jnp.asarray(here)), rs.Wrench(on_j.force, on_j.moment + t * p["m"])

    p = {"c": 0.3, "m": np.array([1.0, 2.0, 3.0])}
    slope = slopes(lambda d: at(d, A, here) - at(d, B, there))
    expected = -0.3 * slope.T @ (slope @ V)
    expected[9:] += TURNS[1].as_matrix().T @ (0.4 * p["m"])
    np.testing.assert_allclose(generalised(rs.LoadFunction(A, drag, "b", p)), expected, atol=1e-10)


TOPS = pytest.mark.parametrize("c", [np.zeros(3), np.array([0.2, -0.1, 0.3])], ids=("free of moments", "heavy"))
SPIN, FALL = np.array([1.0, 2.0, -1.5]), np.array([0.0, 0.0, -9.81])


def top(c):
    """A body with products of inertia on a ball at c from its centre of mass, spinning; and its Euler's equations."""
    end = np.array([0.5, 0.0, 0.0])
    body = rs.Body("top", 2.0, INERTIA, centre=end + c)
    mechanism = rx.Mechanism([body], [rs.Spherical("pivot", body, G, point=end)], gravity=FALL)
    about = INERTIA + 2.0 * (c @ c * np.eye(3) - np.outer(c, c))

    def euler(t, y):
        turn, omega = y[:9].reshape(3, 3), y[9:]
        rate = np.linalg.solve(about, 2.0 * np.cross(c, turn.T @ FALL) - np.cross(omega, about @ omega))
        return np.concatenate([(turn @ np.cross(np.eye(3), omega)).ravel(), rate])

    start = rx.State(mechanism.reference, jnp.asarray([*np.cross(SPIN, c), *SPIN]))
    return mechanism, start, euler, end


@TOPS
def test_a_top_turns_as_eulers_equations_say(c):
    mechanism, start, euler, _ = top(c)
    found = rx.solve(mechanism, start).acceleration[3:]
    np.testing.assert_allclose(found, euler(0.0, np.array([*np.eye(3).ravel(), *SPIN]))[9:], rtol=1e-12)


@pytest.mark.slow
@TOPS
def test_a_top_goes_on_as_eulers_equations_say(c):
    mechanism, start, euler, end = top(c)
    truth = solve_ivp(euler, (0, 1), [*np.eye(3).ravel(), *SPIN], "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    motion = rx.simulate(mechanism, start, 1.0, rtol=1e-10)
    np.testing.assert_allclose(motion.qd[-1, 3:], truth[9:], atol=2e-8)
    np.testing.assert_allclose(motion.q[-1, :3], end + truth[:9].reshape(3, 3) @ c, atol=2e-8)


@pytest.mark.slow
def test_springs_give_back_what_they_take():
    """A body on a ball, on springs of all kinds under gravity: kinetic, stored and potential energy add to one sum."""
    body = rs.Body("body", 2.0, INERTIA, centre=(0.3, 0.1, -0.2))
    end, fixed = np.array([0.6, 0.2, 0.1]), np.array([0.8, -0.3, 0.5])
    loads = [
        rs.SpringDamper(body, G, end, fixed, stiffness=80.0, free_length=0.4),
        rs.TorsionSpring(body, G, axis=(0, 1, 0), stiffness=6.0, free_angle=0.2),
        rs.Bushing(body, G, end, (1, 0, 0), (0, 1, 0), translation=(30.0, 20.0, 10.0), rotation=(5.0, 4.0, 3.0)),
    ]
    ball = rs.Spherical("ball", body, G, point=(0, 0, 0))
    mechanism = rx.Mechanism([body], [ball], loads=loads, gravity=(0, 0, -9.81))
    spin = np.array([2.0, -1.0, 3.0])
    start = rx.State(mechanism.reference, jnp.asarray([*np.cross(spin, body.centre), *spin]))
    motion = rx.simulate(mechanism, start, 1.0, rtol=1e-10)
    q, qd = np.asarray(motion.q), np.asarray(motion.qd)
    turn = Rotation.from_quat(q[:, 3:], scalar_first=True)
    turned = turn.as_quat()
    u = turn.apply(end) - end  # the body's point of reference stays
    r = 2 * turned[:, :3] / turned[:, 3:]
    stored = 40.0 * (np.linalg.norm(turn.apply(end) - fixed, axis=1) - 0.4) ** 2
    stored += 3.0 * (2 * np.arctan2(turned[:, 1], turned[:, 3]) - 0.2) ** 2
    stored += (u**2 @ [10.0, 30.0, 20.0] + r**2 @ [3.0, 5.0, 4.0]) / 2
    kinetic = np.sum(qd[:, :3] ** 2, axis=1) + np.einsum("ti,ij,tj->t", qd[:, 3:], INERTIA, qd[:, 3:]) / 2
    energy = kinetic + stored + 2.0 * 9.81 * q[:, 2]
    assert np.ptp(kinetic) > 1.0 and np.ptp(stored) > 1.0
    np.testing.assert_allclose(energy, energy[0], atol=1e-7)


def test_loads_that_say_too_little_or_too_much_are_refused():
    free = rs.Placement((0, 0, 0))
    for bad, words in (
        (
            lambda: rs.SpringDamper("a", G, (0, 0, 1), (0, 0, 0), stiffness=1.0),
            "`i` of load 'SpringDamper' must be",
        ),
        (lambda: rs.SpringDamper(A, G, (0, 0, 1), stiffness=1.0, on_i=(0, 0, 0)), "has both"),
        (lambda: rs.TorsionSpring(A, G, stiffness=1.0), "Load 'TorsionSpring' must be given by"),
        (lambda: rs.Bushing(A, G, on_i=free, on_j=free, rotation=(1.0, 2.0)), "`rotation` must be a number or"),
        (lambda: rs.Bushing(A, G, (0, 0, 0), translation=-1.0), "`translation` of a bushing must be symmetric"),
        (lambda: rs.Bushing(A, G, (0, 0, 0), rotation=[[1, 2, 0], [0, 1, 0], [0, 0, 1]]), "`rotation` of a bushing"),
        (lambda: rs.Bushing(A, G, (0, 0, 0), rotation_damping=(0, -1, 0)), "`rotation_damping` of a bushing"),
        (lambda: rs.SpringDamper(A, G, (0, 0, 1), (0, 0, 0), stiffness=(1.0, 2.0)), "`stiffness` must be a number"),
        (lambda: rs.TorsionSpring(A, G, (0, 0, 1), stiffness=1.0, damping=(1.0,)), "`damping` must be a number"),
        (lambda: rx.SpringDamper("a", G, (0, 0), (0, 1), stiffness=(1.0, 2.0)), "`stiffness` must be a number"),
        (lambda: rx.TorsionSpring("a", G, stiffness=1.0, free_angle=(1.0, 2.0)), "`free_angle` must be a number"),
        (lambda: rs.AppliedForce("a", force=(1.0, 2.0)), "`force` of AppliedForce on 'a' must have 3 components"),
        (
            lambda: rs.LoadFunction("a", lambda i, j, t, p: np.sin(i.velocity)),
            "`function` of LoadFunction on 'a' must be a function that JAX",
        ),
        (lambda: rx.Mechanism([A], [rs.Spherical("A", A, G, (0, 0, 0))], loads=[rx.AppliedForce("a")]), "all spatial"),
    ):
        with pytest.raises(rx.RedundaxError, match=words):
            bad()
