"""Loads at rest of sleeves, balls and plates, whose friction is in a ball: closed forms and brute force in NumPy."""

import numpy as np
import pytest
from scipy.optimize import brentq, minimize, minimize_scalar

import redundax as rx

rs = rx.spatial
MU, MASS, WEIGHT, RADIUS, LENGTH = 0.1, 2.0, 30.0, 0.02, 0.05
Z = (0.0, 0.0, 1.0)


def pressed(force, moment, length=LENGTH):
    """|N_1| + |N_2| of a force and a moment square to z."""
    couple = np.array([-moment[1], moment[0]]) / length
    return sum(np.linalg.norm(np.asarray(force) / 2 + sign * couple) for sign in (1, -1))


# Limit loads of one joint, in closed form -----------------------------------------------------


def alone(joint, force, **at):
    body = rs.Body("body", MASS, (0.1, 0.1, 0.1))
    mechanism = rx.Mechanism([body], [joint(body)], loads=[rs.AppliedForce("body", force, **at)])
    return mechanism, rx.assemble(mechanism)


def sleeve(body, name="sleeve", height=0.0, mu=MU):
    sizes = {"shaft_radius": RADIUS, "bearing_length": LENGTH, "friction": rx.Coulomb(mu)}
    return rs.Cylindrical(name, body, rx.GROUND, point=(0, 0, height), axis=Z, **sizes)


def ball(body, name="ball", height=0.0):
    return rs.Spherical(name, body, rx.GROUND, point=(0, 0, height), ball_radius=RADIUS, friction=rx.Coulomb(MU))


def plate(body, name="plate", x=0.0):
    sizes = {"plate_length": 0.3, "spin_radius": 0.1, "friction": rx.Coulomb(MU)}
    return rs.Planar(name, body, rx.GROUND, point=(x, 0, 0), axis=Z, **sizes)


def limits(found, lower, upper):
    np.testing.assert_allclose([found.lower, found.upper], [lower, upper], rtol=1e-7)
    np.testing.assert_allclose([found.outer_lower, found.outer_upper], [lower, upper], rtol=1e-6)


@pytest.mark.parametrize("turn", [0.0, 4.0])
@pytest.mark.slow
def test_a_block_on_a_plane_pushed_from_the_side(turn):
    """mu N whatever the direction, and it sets out that way."""
    along = np.array([np.cos(turn), np.sin(turn)])
    found = rx.limit_load(*alone(plate, (0, 0, -WEIGHT)), dict(zip(("body.x", "body.y"), along, strict=True)))
    limits(found, -MU * WEIGHT, MU * WEIGHT)
    np.testing.assert_allclose(found.motion[1, :2], along, atol=1e-7)
    np.testing.assert_allclose(found.friction[1], [*(-MU * WEIGHT * along), 0], atol=1e-6)


@pytest.mark.slow
def test_a_block_pushed_beside_its_middle_and_up():
    """(F, F c / R) in the ball, and the push takes load from the plane: mu (W - F s) = F |(1, c / R)|."""
    aside, up = 0.04, 0.3
    found = rx.limit_load(*alone(plate, (0, 0, -WEIGHT)), {"body.x": 1.0, "body.z": up, "body.phi_z": aside})
    size = np.hypot(1, aside / 0.1)
    limits(found, -MU * WEIGHT / (size - MU * up), MU * WEIGHT / (size + MU * up))


@pytest.mark.slow
def test_a_ball_in_its_socket_turned_by_a_moment_and_by_a_push():
    """|moment| against mu R |F|, which the push changes; the motion has the power 1."""
    force, moment = np.array([12.0, -9.0, 20.0]), np.array([2.0, 3.0, 6.0])
    turned = dict(zip(("body.phi_x", "body.phi_y", "body.phi_z"), moment, strict=True))
    found = rx.limit_load(*alone(ball, force), turned)
    limits(found, -MU * RADIUS * 25 / 7, MU * RADIUS * 25 / 7)
    np.testing.assert_allclose(found.motion[1, 3:], moment / 49, atol=1e-6)
    assert found.slips[0] == ("ball.bend_1", "ball.bend_2", "ball.twist")

    def missing(amount, arm=0.5 * RADIUS):
        return MU * RADIUS * np.linalg.norm(force + np.array([amount, 0.0, 0.0])) - arm * abs(amount)

    found = rx.limit_load(*alone(ball, force), {"body.x": 1.0, "body.phi_z": 0.5 * RADIUS})
    limits(found, *(brentq(missing, 0.0, end, xtol=1e-13) for end in (-100.0, 100.0)))


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.0, 0.03, 1e3])
def test_a_sleeve_that_is_pulled_and_turned(turn):
    """(F, F c / R) against mu (|N_1| + |N_2|), pulled to the side above its middle."""
    side, arm = np.array([18.0, 24.0, 0.0]), np.array([0.0, 0.0, 0.07])
    most = MU * pressed(side[:2], np.cross(arm, side)[:2])
    found = rx.limit_load(*alone(sleeve, side, on_i=arm), {"body.z": 1.0, "body.phi_z": turn})
    amount = most / np.hypot(1, turn / RADIUS)
    limits(found, -amount, amount)


@pytest.mark.slow
def test_a_collar_pulled_beside_its_shaft_wedges_itself():
    """From mu 2 a / L = 1 on a pull along the shaft at an arm a never moves it: most = mu 2 a / L of it."""
    found = [
        rx.limit_load(*alone(lambda body, mu=mu: sleeve(body, mu=mu), (1.0, 0, 0)), {"body.z": 1.0, "body.phi_y": -arm})
        for mu, arm in ((0.2, 0.1), (0.3, 0.1))
    ]
    assert np.isfinite(found[0].upper) and np.isinf(found[1].upper)
    limits(found[0], *(s * brentq(lambda f: 0.2 * pressed((1, 0), (0, -0.1 * f)) - f, 1e-3, 99.0) for s in (-1, 1)))


@pytest.mark.slow
def test_a_sleeve_that_turns_where_friction_along_it_presses_it():
    """A foot beside the shaft bears friction along it, which bends it: c / R = sqrt((mu N(f))^2 - f^2), most over f.

    It turns, though its friction is not square to the shaft at the limit.
    """
    side, arm, foot = np.array([18.0, 24.0, 0.0]), np.array([0.0, 0.0, 0.07]), np.array([0.1, 0.0, 0.0])
    body = rs.Body("body", MASS, (0.1, 0.1, 0.1))
    joints = [sleeve(body), rs.PointOnPlane("foot", body, rx.GROUND, point=foot, axis=Z)]
    mechanism = rx.Mechanism([body], joints, loads=[rs.AppliedForce("body", side, on_i=arm)])

    def squared(f):
        moment = np.cross(arm, side) + np.cross(foot, [0.0, 0.0, -f])
        return (MU * pressed(side[:2], moment[:2])) ** 2 - f**2

    best = minimize_scalar(lambda f: -squared(f), bounds=(-20.0, 20.0), method="bounded", options={"xatol": 1e-10})
    assert abs(best.x) > 0.2 * np.sqrt(-best.fun)
    found = rx.limit_load(mechanism, rx.assemble(mechanism), {"body.phi_z": 1.0})
    most = RADIUS * np.sqrt(-best.fun)
    limits(found, -most, most)
    np.testing.assert_allclose(found.friction[1], [-most, best.x], atol=1e-3 * most / RADIUS)  # a flat extreme
    assert found.slips == (("sleeve.angle",), ("sleeve.angle",))
    np.testing.assert_allclose(found.motion, [[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, 0, 1]], atol=1e-9)


@pytest.mark.slow
def test_a_ball_without_load_holds_nothing():
    found = rx.limit_load(*alone(ball, (0, 0, 0)), {"body.phi_z": 1.0})
    np.testing.assert_allclose([found.lower, found.upper], 0, atol=1e-9)
    assert found.slips == (("ball.twist",), ("ball.twist",))
    np.testing.assert_allclose(found.motion, [[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, 0, 1]], atol=1e-9)


# Bands of two joints that press each other, by brute force ------------------------------------

FORCE, MOMENT = np.array([18.0, 24.0, 2.0]), np.array([0.3, -0.2, 0.01])  # on the body, at the middle between both
HALF = 0.2  # m, from the middle to each joint


def two(make, along):
    body = rs.Body("body", MASS, (0.1, 0.1, 0.1))
    joints = [make(body, name, sign * HALF) for name, sign in (("one", -1), ("two", 1))]
    load = rs.AppliedForce("body", FORCE * along, moment=MOMENT)
    mechanism = rx.Mechanism([body], joints, loads=[load])
    return mechanism, rx.assemble(mechanism)


class Wrenches:
    """Forces and moments of both joints on the body, 12, which balance its load with friction within its limits.

    `rows` and `slips` are those of six that the joint holds and in which it rubs, these over `arms` within a ball.
    """

    def __init__(self, place, rows, slips, arms, normal, along):
        self.places = np.outer((-HALF, HALF), place)
        self.rows, self.slips, self.arms, self.normal = rows, slips, np.array(arms), normal
        columns = []
        for at in self.places:
            for k in range(6):
                force, moment = np.eye(6)[k][:3], np.eye(6)[k][3:]
                columns.append([*force, *(moment + np.cross(at, force))])
        self.matrix = np.array(columns).T
        self.load = np.concatenate([FORCE * along, MOMENT])

    def left(self, x):
        """What is left of the squares of both limits."""
        out = []
        for wrench in x.reshape(2, 6):
            f = wrench[self.slips] / self.arms
            out.append((MU * self.normal(wrench)) ** 2 - f @ f)
        return np.array(out)

    def extreme(self, cost, box, starts=12):
        """The largest of cost @ x by quadratic programmes in a row from many starts; `box` of some of x by place."""
        random, best = np.random.default_rng(0), -np.inf
        bounds = [box.get(k, (-500.0, 500.0)) for k in range(12)]
        kinds = [
            {"type": "eq", "fun": lambda x: self.matrix @ x + self.load, "jac": lambda _: self.matrix},
            {"type": "ineq", "fun": self.left},
        ]
        for _ in range(starts):
            x = np.zeros(12)
            places = np.array(list(box))
            x[places] = [random.choice(ends) for ends in box.values()]
            others = np.setdiff1d(np.arange(12), places)
            x[others] = np.linalg.lstsq(self.matrix[:, others], -self.load - self.matrix @ x, rcond=None)[0]
            found = minimize(
                lambda x: -cost @ x,
                x,
                jac=lambda _: -cost,
                method="SLSQP",
                bounds=bounds,
                constraints=kinds,
                options={"ftol": 1e-13, "maxiter": 200},
            )
            good = np.abs(self.matrix @ found.x + self.load).max() < 1e-9 and self.left(found.x).min() > -1e-10
            best = max(best, cost @ found.x) if good else best
        return best


def of_sleeve(wrench):
    return pressed(wrench[:2], wrench[3:5])


def of_ball(wrench):
    return np.linalg.norm(wrench[:3])


def of_plate(wrench):
    return pressed((wrench[2], 0), (0, np.linalg.norm(wrench[3:5])), 0.3)


SLEEVES = (sleeve, (1, 1, 1), Wrenches(Z, [0, 1, 3, 4], [5, 2], [RADIUS, 1], of_sleeve, (1, 1, 1)))
BALLS = (ball, (1, 1, 1), Wrenches(Z, [0, 1, 2], [3, 4, 5], [RADIUS] * 3, of_ball, (1, 1, 1)))
PLATES = (plate, (0.02, 0.02, -15), Wrenches((1, 0, 0), [2, 3, 4], [0, 1, 5], [1, 1, 0.1], of_plate, (0.02, 0.02, -15)))
CASES = {
    "sleeves": (SLEEVES, {"radial_1": (-9, 30), "radial_2": (0, 20), "bend_1": (-1, 1), "bend_2": (-0.5, 1)}),
    "balls": (BALLS, {"axial": (-60, 40)}),
    "plates": (PLATES, {"axial": (-25, -5), "bend_1": (-1, 1.5), "bend_2": (-2, 2)}),
}
NAMES = ("radial_1", "radial_2", "axial", "bend_1", "bend_2", "twist")


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_bands_of_two_joints_that_press_each_other(name):
    """Multipliers are minus the forces on the body, friction is that on it."""
    (make, along, truth), limits = CASES[name]
    mechanism, rest = two(make, along)
    box = rx.PreloadBox({f"one.{row}": ends for row, ends in limits.items()})
    slips = [label for label in mechanism.slips.labels if label.startswith("one.")]
    asked = [f"tau {slips[0]}", f"tau {slips[-1]}", f"two.{NAMES[truth.rows[0]]}"]
    places, signs = [truth.slips[0], truth.slips[-1], 6 + truth.rows[0]], [1, 1, -1]
    found = rx.band(mechanism, rest, asked, box)
    assert found.stands == "yes"
    own = {NAMES.index(row): (-ends[1], -ends[0]) for row, ends in limits.items()}
    for k, (place, sign) in enumerate(zip(places, signs, strict=True)):
        cost = sign * np.eye(12)[place]
        least, most = -truth.extreme(-cost, own), truth.extreme(cost, own)
        rounding = 1e-6 * max(abs(least), abs(most))
        assert found.outer_lower[k] <= found.lower[k] <= least + rounding
        assert found.outer_upper[k] >= found.upper[k] >= most - rounding
        assert found.outer_upper[k] - found.upper[k] + found.lower[k] - found.outer_lower[k] <= 10 * rounding
    n, m = rest.qd.size, len(mechanism.rows)
    order = [mechanism.rows.labels.index(f"{joint}.{NAMES[k]}") for joint in ("one", "two") for k in truth.rows]
    for solution in (*found.lower_solution, *found.upper_solution):
        wrenches = np.zeros((2, 6))
        wrenches[:, truth.rows] = -solution[n : n + m][order].reshape(2, -1)
        wrenches[:, truth.slips] = solution[n + m :].reshape(2, -1)
        np.testing.assert_allclose(truth.matrix @ wrenches.ravel(), -truth.load, rtol=0, atol=1e-9)
        most = np.array([MU * truth.normal(wrench) for wrench in wrenches]) ** 2
        assert np.all(truth.left(wrenches) > -1e-8 * most)
