"""What friction of joints in space leaves open, against brute force: counts of solutions, bands, what stands."""

import numpy as np
import pytest
from scipy.optimize import brentq, minimize

import redundax as rx

rs = rx.spatial

# One guide whose friction presses it ----------------------------------------------------------

BESIDE, LENGTH, TWIST = np.array([0.0, 0.03, -0.02]), 0.05, 0.03  # m, the guide from the centre of mass
FORCE, MOMENT = np.array([2.0, 40.0, -30.0]), np.array([0.0, 3.0, 1.5])


def block(mu, rate=0.0, beside=BESIDE, moment=MOMENT, force=FORCE):
    """A block on a guide along x."""
    body = rs.Body("block", 2.0, (0.02, 0.03, 0.04))
    rubs = {"guide_length": LENGTH, "twist_radius": TWIST, "friction": rx.Coulomb(mu)}
    guide = rs.Prismatic("guide", body, rx.GROUND, point=beside, axis=(1, 0, 0), **rubs)
    mechanism = rx.Mechanism([body], [guide], loads=[rs.AppliedForce("block", force, moment=moment)])
    return mechanism, rx.assemble(mechanism, rates={"guide.travel": rate})


def pressed(tau, beside=BESIDE, moment=MOMENT, force=FORCE):
    """N where friction tau (s,) acts along the guide: forces and moments on the block vanish, but along x."""
    tau = np.asarray(tau, float)[..., None]
    held = -force * [0.0, 1.0, 1.0]
    couple = -np.cross(beside, held + tau * [1.0, 0.0, 0.0]) - moment
    c = np.stack([-couple[..., 2], couple[..., 1]], axis=-1) / LENGTH
    ends = (np.linalg.norm(held[1:] / 2 + sign * c, axis=-1) for sign in (1, -1))
    return sum(ends) + np.abs(couple[..., 0]) / TWIST


@pytest.mark.parametrize("rate", [1.0, -1.0])
@pytest.mark.parametrize("mu", [0.2, 0.6, 0.75, 0.9])
def test_the_number_of_solutions(mu, rate):
    """Friction can press the guide as much as it needs: one solution, two, or none, as it turns the block or holds it.

    Its share of itself is mu 2 |beside| / L, and below 1 the solution is proved to be the only one.
    """
    sizes = np.linspace(0.0, 3000.0, 100_001)

    def missing(size):
        return size - mu * pressed(-rate * size)

    changes = np.flatnonzero(np.diff(np.sign(missing(sizes))))
    truth = [-rate * brentq(missing, sizes[k], sizes[k + 1], xtol=1e-12) for k in changes]
    assert len(truth) == (1 if mu < 0.7 else 2 if rate < 0 else 0)
    mechanism, state = block(mu, rate)
    found = [float(each.friction[0]) for each in rx.frictional_solutions(mechanism, state)]
    np.testing.assert_allclose(found, truth, rtol=1e-10)
    radius = mu * 2 * np.linalg.norm(BESIDE) / LENGTH
    np.testing.assert_allclose(rx.analyze(mechanism, state).spectral_radius, radius, rtol=1e-12)


@pytest.mark.parametrize("arm", [(0.0, 0.0), (0.06, 0.08)])
@pytest.mark.slow
def test_how_hard_a_block_pushed_from_the_side_can_be_pulled(arm):
    """At an arm to the side and up the pull presses the guide too."""
    mechanism, rest = block(0.2, beside=np.zeros(3), moment=np.zeros(3), force=np.array([0.0, 40.0, -30.0]))
    pull = {"block.x": 1.0, "block.phi_y": arm[1], "block.phi_z": -arm[0]}

    def missing(size):
        moment = size * np.array([0.0, arm[1], -arm[0]])
        return size - 0.2 * pressed(0.0, np.zeros(3), moment, np.array([0.0, 40.0, -30.0]))

    found = rx.limit_load(mechanism, rest, pull)
    np.testing.assert_allclose([-found.lower, found.upper], brentq(missing, 0.0, 1e3, xtol=1e-12), rtol=1e-6)
    assert found.slips == (("guide",), ("guide",))


# A door on three hinges -----------------------------------------------------------------------

HEIGHTS, MASS, WIDTH, LEAN, MU = (0.2, 1.0, 1.8), 20.0, 1.0, 0.035, 0.2
RADIUS, BEARING, THRUST = 0.006, 0.06, 0.009  # m
INERTIA = np.array([7.0, 8.5, 1.7])
CENTRE = np.array([WIDTH / 2, 0.0, 1.0])
G = 9.81 * np.array([np.sin(LEAN), 0.0, -np.cos(LEAN)])
SPIN = 0.8
BOX = {"middle.axial": (-60.0, 90.0), "bottom.radial_1": (-150.0, 200.0)}  # N


def door():
    body = rs.Body("door", MASS, INERTIA, centre=CENTRE)
    rubs = {"pin_radius": RADIUS, "bearing_length": BEARING, "thrust_radius": THRUST, "friction": rx.Coulomb(MU)}
    hinges = [
        rs.Revolute(name, body, rx.GROUND, point=(0, 0, height), axis=(0, 0, 1), **rubs)
        for name, height in zip(("bottom", "middle", "top"), HEIGHTS, strict=True)
    ]
    return rx.Mechanism([body], hinges, gravity=G)


def open_door(rate):
    mechanism = door()
    return mechanism, rx.assemble(mechanism, positions={"middle.angle": np.pi / 2}, rates={"middle.angle": rate})


def hinge_loads(acceleration, spin, stress):
    """Minus forces and moments (3, 5) on the door, open by a right angle: least squares, and self-stress beside them.

    The centre of mass is at y = WIDTH / 2; its inertia about the axis through it does not load hinges.
    """
    centre = np.array([0.0, WIDTH / 2, 1.0])
    inertia = MASS * WIDTH / 2 * np.array([-acceleration, -(spin**2), 0.0])
    force = inertia - MASS * G  # on the door by its hinges
    moment = np.cross(centre, force)[:2]
    columns = []
    for height in HEIGHTS:
        for k in range(3):
            unit = np.eye(3)[k]
            columns.append([*unit, *np.cross([0, 0, height], unit)[:2]])
        columns += [[0, 0, 0, 1, 0], [0, 0, 0, 0, 1]]
    loads = -np.linalg.pinv(np.array(columns, float).T) @ [*force, *moment]
    axial, radial = stress
    loads[7] += axial
    loads[12] -= axial
    loads[0] += radial
    loads[10] -= radial
    loads[14] += radial * (HEIGHTS[2] - HEIGHTS[0])
    return loads.reshape(3, 5)


def held(loads):
    """Moment of friction of all hinges, N m."""
    c = np.stack([-loads[:, 4], loads[:, 3]], axis=1) / BEARING
    ends = sum(np.linalg.norm(loads[:, :2] / 2 + sign * c, axis=1) for sign in (1, -1))
    return MU * np.sum(RADIUS * ends + THRUST * np.abs(loads[:, 2]))


ABOUT, DRIVE = INERTIA[2] + MASS * WIDTH**2 / 4, MASS * G[0] * WIDTH / 2  # of its axis; the weight shuts the door


def friction(stress, spin, sense):
    """Moment of friction (N m) against the motion, at the loads that go with its acceleration: a fixed point."""
    moment = 0.0
    for _ in range(60):
        moment = held(hinge_loads((-DRIVE - sense * moment) / ABOUT, spin, stress))
    return moment


def slowing(stress):
    """Angular acceleration of the door as it opens."""
    return (-DRIVE - friction(stress, SPIN, 1)) / ABOUT


def margin(stress):
    """Friction at the door that shuts over the moment of its weight, less 1."""
    return friction(stress, 0.0, -1) / DRIVE - 1


def extremes(function):
    """Over the box, from a grid: the best points of it, and from there downhill."""
    ends = [BOX["middle.axial"], BOX["bottom.radial_1"]]
    grid = [(a, b) for a in np.linspace(*ends[0], 16) for b in np.linspace(*ends[1], 16)]
    values = np.array([function(point) for point in grid])
    out = []
    for sign, start in ((1, grid[values.argmin()]), (-1, grid[values.argmax()])):
        best = minimize(
            lambda x, sign=sign: sign * function(x),
            start,
            method="Nelder-Mead",
            bounds=ends,
            options={"xatol": 1e-9, "fatol": 1e-12, "maxiter": 1000},
        )
        out.append(sign * min(best.fun, sign * function(start)))
    return out


@pytest.mark.slow
def test_the_band_of_a_door_that_opens():
    mechanism, state = open_door(SPIN)
    found = rx.band(mechanism, state, "door.phi_z''", rx.AmplitudeBox(BOX))
    np.testing.assert_allclose([found.lower[0], found.upper[0]], extremes(slowing), rtol=1e-6)
    assert found.lower[0] < 1.2 * found.upper[0] < 0
    one = rx.solve(mechanism, state)
    np.testing.assert_allclose(one["door.phi_z''"], slowing((0.0, 0.0)), rtol=1e-11)


@pytest.mark.slow
def test_whether_a_door_stays_open():
    mechanism, state = open_door(0.0)
    found = rx.sticking(mechanism, state, rx.AmplitudeBox(BOX))
    truth = extremes(margin)
    assert truth[0] < 0 < truth[1]
    assert (found.verdict, found.proved) == ("may stick", True)
    np.testing.assert_allclose(found.margin, truth, rtol=0, atol=2e-4)
    assert truth[0] - 1e-9 <= found.margin[0] and found.margin[1] <= truth[1] + 1e-9


PLACES = np.array([[0.5, 0.1], [-0.1, 0.6], [-0.5, -0.2], [0.2, -0.4]])
ROUGH, WEIGHT, PUSH = np.array([0.2, 0.5, 0.3, 0.4]), 80.0, np.array([12.0, -5.0, 7.0])


def plate():
    """A plate on four feet at the height of its centre, so that its friction loads none, pushed and turned."""
    body = rs.Body("plate", WEIGHT / 10, (1.0, 1.0, 1.0))
    feet = [
        rs.PointOnPlane(
            f"f{k}", body, rx.GROUND, point=(*place, 0), axis=(0, 0, 1), friction=rx.Coulomb(mu), one_sided=True
        )
        for k, (place, mu) in enumerate(zip(PLACES, ROUGH, strict=True))
    ]
    load = rs.AppliedForce(body, force=(*PUSH[:2], 0), moment=(0, 0, PUSH[2]))
    return rx.Mechanism([body], feet, loads=[load], gravity=(0, 0, -10.0))


def share_held(first):
    """The largest part of its push that friction holds, as the least work of friction over slips of which the push does
    1: w about the push, the rest free."""
    at = np.array([[1, 1, 1], *PLACES[1:].T]), np.array([WEIGHT - first, *(-first * PLACES[0])])
    limits = ROUGH * np.array([first, *np.linalg.solve(*at)])
    begin, free = PUSH / (PUSH @ PUSH), np.linalg.svd(PUSH[None])[2][1:]

    def work(change):
        x, y, turn = begin + change @ free
        return limits @ np.hypot(x - turn * PLACES[:, 1], y + turn * PLACES[:, 0])

    how = {"xatol": 1e-12, "fatol": 1e-14, "maxiter": 4000, "maxfev": 4000}
    return min(
        minimize(work, start, method="Nelder-Mead", options=how).fun for start in ([0.0, 0.0], [0.1, 0.1], [-0.1, 0.1])
    )


def test_a_plate_on_four_rough_feet_as_the_least_work_of_friction_has_it():
    mechanism = plate()
    found = rx.sticking(mechanism, rx.assemble(mechanism), rx.PreloadBox({"f0.axial": (5.0, 20.0)}))
    firsts = np.asarray(found.case)[:, 0]
    np.testing.assert_allclose(found.margin, [share_held(first) - 1 for first in firsts], rtol=1e-8)
    shares = [share_held(first) - 1 for first in np.linspace(5.0, 20.0, 7)]
    assert found.margin[0] <= min(shares) + 1e-8 and found.margin[1] >= max(shares) - 1e-8
    assert found.verdict == "must stick" and not found.proved
