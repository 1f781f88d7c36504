"""Bands of what a drive must give, of joints that rub, have play and misfit, against one equation solved for each case.

A beam on two guides along x, 0.6 m to either side of its centre, of which one drive moves it. The guides share the load
across by the displacement y, and the moment by the turn of the beam: with the softness w, misfit d and play c of a row

    load = max(0, |x + d| - c) sign(x + d) / w,    sum of loads = what they must carry,

where friction, mu max(|F|, 2 |M| / L) of a guide, adds a moment by its arm.
"""

import itertools

import numpy as np
import pytest
from scipy.optimize import brentq

import redundax as rx

MU, LENGTH, ARMS, MASS = 0.1, 0.2, np.array([0.6, -0.6]), 40.0
PUSH, AT = (-60.0, -200.0), (0.3, 0.1)  # N, and where, m
SOFT = {"left": (1e-8, 1e-6), "right": (2e-8, 5e-7)}
PLAY = {"left.perpendicular": 2e-6, "right.angle": 2e-5}
MISFIT, RUBS = (-3e-6, 1e-6), (0.5, 2.0)  # m, of the right guide; of the friction of the left


def beam(mu=(MU, MU)):
    guides = [
        rx.Translational(
            name, "beam", "ground", (0.0, y), (0.0, y), (0.0, 1.0), guide_length=LENGTH, friction=rx.Coulomb(own)
        )
        for (name, y), own in zip((("left", ARMS[0]), ("right", ARMS[1])), mu, strict=True)
    ]
    push = rx.AppliedForce("beam", PUSH, AT)
    return rx.Mechanism([rx.Body("beam", MASS, 3.0)], guides, loads=[push], units=rx.units.SI)


def carried(softness, misfit, play, need):
    """The loads of two rows that carry together, where `need` may depend on them."""

    def loads(x):
        return np.maximum(0.0, np.abs(x + misfit) - play) * np.sign(x + misfit) / softness

    size = 1e3 * np.max(softness) + np.max(play) + np.max(np.abs(misfit))
    return loads(brentq(lambda x: np.sum(loads(x)) - need(loads(x)), -size, size, xtol=1e-22, rtol=1e-14))


def force(acceleration, sense, misfit=0.0, plays=(0.0, 0.0), multiple=1.0):
    """What the drive gives along x."""
    mu, soft = MU * np.array([multiple, 1.0]), np.array([SOFT["left"], SOFT["right"]])
    across = carried(soft[:, 0], np.array([0.0, misfit]), np.array([plays[0], 0.0]), lambda _: -PUSH[1])

    def friction(moments):
        return mu * np.maximum(np.abs(across), 2 * np.abs(moments) / LENGTH) * sense

    def need(moments):
        # about the centre: the push, friction at its arms and the drive, which acts at the left guide
        along = MASS * acceleration - PUSH[0] + friction(moments).sum()
        push = AT[0] * PUSH[1] - AT[1] * PUSH[0]
        return push + ARMS @ friction(moments) - ARMS[0] * along

    moments = carried(soft[:, 1], np.zeros(2), np.array([0.0, plays[1]]), need)
    return MASS * acceleration - PUSH[0] + friction(moments).sum()


@pytest.fixture(scope="module")
def run():
    rate, ts = 2 * np.pi, np.array([0.1, 0.25, 0.4])  # moves on, rests, moves back
    machine = beam()
    closure = rx.ElasticJoints(machine, SOFT)
    run = rx.drive(machine, {"left.travel": rx.Harmonic(0.05, frequency=1.0)}, ts, {}, closure=closure)
    return run, -0.05 * rate**2 * np.sin(rate * ts), np.array([1, -1, -1])


def test_the_force_by_hand(run):
    found, changes, senses = run
    wanted = [force(change, sense) for change, sense in zip(changes, senses, strict=True)]
    np.testing.assert_allclose(found["left.travel force"], wanted, rtol=1e-10)
    # where the motion turns round it is that after, as of the run itself
    path = rx.band_along(found.system, found.states, "left.travel drive", rx.ElasticJoints(beam(), SOFT))
    np.testing.assert_allclose(path.lower[:, 0], -np.array(wanted), rtol=1e-9)
    np.testing.assert_allclose(path.upper, path.lower, rtol=1e-9)


def test_play_misfit_and_friction_within_limits_move_the_force_of_the_drive(run):
    found, changes, senses = run
    played = rx.ElasticJoints(beam(), SOFT, play=PLAY)
    bounds = rx.MisfitBox(played, {"right.perpendicular": MISFIT}, friction={"left": RUBS})
    moving = [0, 2]
    states = rx.State(*(x[np.array(moving)] for x in (found.q, found.qd, found.t)))
    path = rx.band_along(found.system, states, "left.travel drive", bounds, samples=64)
    assert path.bands[0].parameters == (
        "right.perpendicular",
        "play left.perpendicular",
        "play right.angle",
        "friction left",
    )
    grid = [np.linspace(*ends, 5) for ends in (MISFIT, *((0.0, c) for c in PLAY.values()), RUBS)]
    for k, bands in zip(moving, path.bands, strict=True):
        # of the multiplier, which is minus the force
        all_cases = [-force(changes[k], senses[k], d, (a, b), f) for d, a, b, f in itertools.product(*grid)]
        d, a, b, f = bands.lower_case[0]
        assert bands.lower[0] == pytest.approx(-force(changes[k], senses[k], d, (a, b), f), rel=1e-9)
        d, a, b, f = bands.upper_case[0]
        assert bands.upper[0] == pytest.approx(-force(changes[k], senses[k], d, (a, b), f), rel=1e-9)
        size = np.abs(all_cases).max()
        assert bands.lower[0] <= min(all_cases) + 1e-9 * size and bands.upper[0] >= max(all_cases) - 1e-9 * size
        assert bands.solved == 1.0 and not bands.exact[0]


def test_guides_that_turn_round_at_a_dead_centre_go_on():
    """The slider is farthest out at phi = 0, where it goes on inwards.

    There and at phi = pi the weights of crank and rod, 1 kg each, ask for a torque alone: their centres go up by half
    of the crank's length per radian. Each has an inertia of 1 kg a^2/3 about the crank's angle.
    """
    table = rx.mechanisms.slider_crank(crank=0.1, slider_mass=20.0, mu=0.05, guide_length=0.15, force=-50.0)
    closure = rx.ElasticJoints(table, {"K1": (1e-8, 1e-6), "K2": (1e-8, 1e-6)})
    times, law = np.array([0.5, np.pi - 0.1, 3.3]) / 3.0, {"A.angle": lambda t: 0.1 + 3.0 * t}
    run = rx.drive(table, law, times, table.state(0.1).q, closure=closure)
    path = rx.band_along(run.system, run.states, ["A.angle drive", "tau K1", "tau K2"], closure)
    assert path.motion == ("moves",) * 3 and path.stands == (None,) * 3
    assert path.bands[1].sense.tolist() == [1, 1] and np.all(path.lower[1, 1:] < 0)
    assert path.lower[1, 0] == pytest.approx(9.81 * 0.1, rel=1e-9)  # minus the torque
    assert path.directions(path.leading).tolist() == [-1, 0, 1]
    for phi, sense in ((0.0, -1), (np.pi, 1)):  # by its own impetus, where friction does not turn the crank
        bands = rx.band(table, table.state(phi=phi, rate=3.0), ["crank.phi''", "tau K1"], closure)
        assert bands.sense.tolist() == [sense, sense] and np.sign(bands.upper[1]) == -sense
        assert bands.lower[0] == pytest.approx(-9.81 * 0.1 * np.cos(phi) / (2 * 0.1**2 / 3), rel=1e-9)


def test_a_machine_that_moves_is_not_told_that_it_cannot_stand():
    """A block that is pushed with more than friction holds, beside a wheel that turns."""
    guides = [
        rx.Translational(n, "b", "ground", (0, y), (0, y), (0, 1), friction=rx.Coulomb(0.1), guide_length=0.2)
        for n, y in (("l", 0.1), ("r", -0.1))
    ]
    bodies, push = [rx.Body("wheel", 1.0, 1.0), rx.Body("b", 10.0, 1.0)], rx.AppliedForce("b", (50.0, 0.0))
    axle = rx.Revolute("O", "ground", "wheel", (0, 0), (0, 0))
    machine = rx.Mechanism(bodies, [axle, *guides], loads=[push], gravity=(0.0, -9.81))
    closure = rx.ElasticJoints(machine, {"l": (1e-8, 1e-6), "r": (1e-8, 1e-6)})
    turning = rx.State(np.zeros(6), np.array([0.0, 0.0, 0.0, 0.0, 3.0, 0.0]))
    path = rx.band_along(machine, [turning], "b.x''", closure)
    assert path.motion == ("partly",) and path.stands == ("slips",) and np.isnan(path.lower).all()
    for text in (str(path), str(path.bands[0])):
        assert "NO SOLUTION with" in text and "proved" not in text and "STAND" not in text
    rx.plot.band_along(path)
    bands = rx.band(machine, turning, "b.x''", closure, sense=[1.0, 1.0])
    # push and friction have no moment about the middle, and so the guides share the weight
    assert bands.lower[0] == pytest.approx((50.0 - 0.1 * 10 * 9.81) / 10, rel=1e-9)


def test_play_of_joints_that_rub_is_refused_in_a_box_of_compliances(run):
    bounds = rx.ComplianceBox(rx.ElasticJoints(beam(), SOFT, play=PLAY), {"left.angle": (1e-7, 1e-6)})
    for box in (bounds, rx.ComplianceBox(bounds.closure, {})):
        with pytest.raises(rx.RedundaxError, match="`bounds` must have no play in a ComplianceBox"):
            rx.band_along(run[0].system, run[0].states, "left.travel drive", box)
    moving = rx.State(run[0].q[0], run[0].qd[0], run[0].t[0])
    with pytest.raises(rx.RedundaxError, match="`closure` has play, which this call does not take"):
        rx.frictional_solutions(run[0].system, moving, closure=bounds.closure)


def test_at_rest_friction_is_all_within_its_largest_limits():
    ts, found = np.array([0.0, 1.0]), []
    for mu in (MU, MU * RUBS[1]):
        machine = beam((mu, MU))
        closure = rx.ElasticJoints(machine, SOFT)
        run = rx.drive(machine, {"left.travel": 0.1}, ts, {}, closure=closure)
        bounds = rx.MisfitBox(closure, {}, friction={"left": RUBS}) if mu == MU else closure
        found.append(rx.band_along(run.system, run.states, "left.travel drive", bounds))
    for name in ("lower", "upper", "outer_lower", "outer_upper"):
        np.testing.assert_allclose(getattr(found[0], name), getattr(found[1], name), rtol=1e-9)
    assert np.all(found[0].upper - found[0].lower > 2 * MU * 200)
    assert found[0].bands[0].title == "MisfitBox: friction left 0.5 to 2" and found[0].bands[0].bounds == "MisfitBox"
    machine = beam()
    played = rx.ElasticJoints(machine, SOFT, play=PLAY)
    run = rx.drive(machine, {"left.travel": 0.1}, ts, {}, closure=rx.ElasticJoints(machine, SOFT))
    with pytest.raises(rx.RedundaxError, match="no play where joints with friction rest"):
        rx.band_along(run.system, run.states, "left.travel drive", played)
    for friction, words in (
        ({"K": (0.5, 2.0)}, "left, right"),
        ({"left": (2.0, 0.5)}, "must hold finite multiples"),
        ({"left": 2.0}, "`friction` must give the least and the largest value by name"),
    ):
        with pytest.raises(rx.RedundaxError, match=words):
            closure = rx.ElasticJoints(machine, SOFT)
            rx.band_along(run.system, run.states, "left.travel drive", rx.MisfitBox(closure, {}, friction=friction))
