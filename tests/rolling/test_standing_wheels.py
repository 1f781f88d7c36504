"""Wheels that stand on the ground and may lift: closed forms, and all sets of standing wheels one by one."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

import redundax as rx

G, R = 9.81, 0.3
BASE, AHEAD, ABOVE = 1.4, 0.6, 0.5  # of the hubs; of the frame's centre ahead of the rear hub and above it
M, J, M_WHEEL, J_WHEEL = 150.0, 20.0, 10.0, 0.5
GUESS = {"rear.y": R, "front.y": R, "front.x": BASE, "frame.x": AHEAD, "frame.y": R + ABOVE}


def motorcycle(rate, height=0.0, growth=0.0):
    """It starts with a motor that turns its rear wheel against the frame, clockwise, at a rate that grows, faster and
    faster if so."""
    bodies = [rx.Body("frame", M, J), *(rx.Body(name, M_WHEEL, J_WHEEL) for name in ("rear", "front"))]
    hubs = [
        rx.Revolute(f"{name} hub", name, "frame", (0, 0), (x - AHEAD, -ABOVE))
        for name, x in (("rear", 0.0), ("front", BASE))
    ]
    tyres = [
        rx.Wheel(f"{name} tyre", name, "ground", (0, 0), (0, height), (0, 1), R, one_sided=True)
        for name in ("rear", "front")
    ]
    motor = rx.SpeedDriver("motor", "rear hub.angle", rx.Polynomial([0.0, -rate, -growth / 2]))
    return rx.Mechanism(bodies, [*hubs, *tyres], couplers=[motor], gravity=(0.0, -G))


# About the rear contact: N_f BASE = (M AHEAD + M_WHEEL BASE) g - (M (ABOVE + R) + 2 M_WHEEL R + 2 J_WHEEL / R) a
LIFTS = (M * AHEAD + M_WHEEL * BASE) * G / (M * (ABOVE + R) + 2 * M_WHEEL * R + 2 * J_WHEEL / R) / R  # rad/s^2


def pitching(rate):
    """Angular acceleration of the frame once the front wheel is off the ground, and the load of the rear one.

    The rear hub has R (rate - theta'') ahead; the front wheel does not turn. Work along delta theta = 1, where the
    rear hub goes by -R.
    """
    ways = {"frame": (-R - ABOVE, AHEAD), "front": (-R, BASE), "rear": (-R, 0.0)}
    masses = {"frame": M, "front": M_WHEEL, "rear": M_WHEEL}
    inertia = sum(masses[k] * (x**2 + y**2) for k, (x, y) in ways.items()) + J + J_WHEEL
    driven = -sum(masses[k] * x for k, (x, _) in ways.items()) * R * rate + J_WHEEL * rate
    turn = (driven - G * sum(masses[k] * y for k, (_, y) in ways.items())) / inertia
    return turn, sum(masses[k] * (G + y * turn) for k, (_, y) in ways.items())


# In between it neither carries nor lifts: it takes less to hold down a frame that does not turn its front wheel.
SPUN = M * (ABOVE + R) + 2 * M_WHEEL * R + 2 * J_WHEEL / R
STAYS_UP = LIFTS * SPUN / (SPUN - J_WHEEL / R)


def test_a_motorcycle_lifts_its_front_wheel_at_the_rate_of_its_closed_form():
    between = (LIFTS + STAYS_UP) / 2
    for rate, word in ((0.999 * LIFTS, "carries"), (between, None), (1.001 * STAYS_UP, "lifts")):
        mechanism = motorcycle(rate)
        state = rx.assemble(mechanism, GUESS)
        found = rx.solve(mechanism, state, throw=False)
        if word is None:
            assert found.result == rx.RESULTS.contacts_undecided
        else:
            assert found.contacts == {"rear tyre": "carries", "front tyre": word}
    turn, pressed = pitching(rate)
    assert float(found["frame.phi''"]) == pytest.approx(turn, rel=1e-9)
    assert float(found["rear tyre.normal"]) == pytest.approx(pressed, rel=1e-12)
    assert abs(float(found["front.phi''"])) < 1e-10 and float(found["front tyre.along"]) == 0.0
    assert float(rx.grip(mechanism, found)["front tyre"]) == 0.0
    assert rx.analyze(mechanism, state).freedom == 2  # the frame pitches, and the front wheel spins
    assert "front tyre: lifts" in str(found)


@pytest.mark.slow
def test_a_motion_ends_where_the_front_wheel_would_slip():
    """At LIFTS its load is zero; off the ground it would fall back, as then it takes less to hold the frame down."""
    mechanism = motorcycle(0.9 * LIFTS, growth=40.0)
    motion = rx.simulate(mechanism, rx.assemble(mechanism, GUESS), 0.2, throw=False)
    assert motion.result == rx.RESULTS.contacts_undecided
    assert float(motion.stats.end) == pytest.approx(0.1 * LIFTS / 40.0, abs=1e-8)


@pytest.mark.slow
def test_a_batch_of_starts_and_its_derivative():
    mechanism = motorcycle(10.0)
    state, rates = rx.assemble(mechanism, GUESS), jnp.array([0.5, 0.9, 1.2, 2.0]) * LIFTS

    def turn(rate):
        law = lambda m: m.couplings[0].speed.coefficients  # noqa: E731
        at = eqx.tree_at(law, mechanism, law(mechanism).at[1].set(-rate))
        found = rx.solve(at, state)
        return found["frame.phi''"], found.contact

    turns, slopes, codes = jax.jit(jax.vmap(lambda x: jax.jvp(turn, (x,), (1.0,), has_aux=True)))(rates)
    expected = [0.0, 0.0, *(pitching(float(rate))[0] for rate in rates[2:])]
    np.testing.assert_allclose(turns, expected, rtol=0, atol=1e-9)
    slope = pitching(2.0)[0] - pitching(1.0)[0]
    np.testing.assert_allclose(slopes, [0.0, 0.0, slope, slope], rtol=0, atol=1e-9)
    assert np.asarray(codes)[:, 1].tolist() == [3, 3, 1, 1]


def test_a_wheel_rolls_only_while_it_touches():
    """Of a state: one above the ground has any spin, one on it rolls; both are told by name."""
    tyre = rx.Wheel("tyre", "disc", "ground", (0, 0), (0, 0), (0, 1), R, one_sided=True)
    disc = rx.Mechanism([rx.Body("disc", 2.0, 0.1)], [tyre], gravity=(0.0, -G))
    above = rx.assemble(disc, {"disc.y": R + 0.1}, {"disc.x": 1.0, "disc.phi": 2.0})
    np.testing.assert_allclose(above.qd, [1.0, 0.0, 2.0], rtol=0, atol=1e-12)
    found = rx.solve(disc, above)
    assert found.contacts == {"tyre": "open"}
    np.testing.assert_allclose(found.acceleration, [0.0, -G, 0.0], rtol=0, atol=1e-12)
    on = rx.assemble(disc, {"disc.y": R + 0.1}, {"disc.x": 1.0, "disc.phi": 2.0}, closed="tyre")
    assert abs(float(on.qd[0] + R * on.qd[2])) < 1e-12
    with pytest.raises(rx.RedundaxError, match='has no row "normal"'):
        rx.Wheel("w", "a", "ground", (0, 0), (0, 0), (0, 1), 0.3, rows=("along",), one_sided=True)


# A cart in space against all sets of standing wheels -----------------------------------------------------------

NAMES = ("front left", "front right", "rear left", "rear right")
TRACK, HEIGHT, RIM = 0.6, 0.5, 0.15
MASSES = np.array([30.0, 1.5])


def cart():
    chassis = rx.spatial.Body("chassis", MASSES[0], (1.0, 1.2, 1.5), position=(0.0, 0.0, HEIGHT))
    wheels, joints = [], []
    for name, (along, side) in zip(NAMES, ((1, 1), (1, -1), (-1, 1), (-1, -1)), strict=True):
        centre, axle = (along * 0.4, side * TRACK / 2, RIM), (0, 1, 0)
        wheels.append(rx.spatial.Body(name, MASSES[1], (0.01, 0.02, 0.01), position=centre))
        joints += [
            rx.spatial.Revolute(f"{name} hub", wheels[-1], chassis, centre, axle),
            rx.spatial.Wheel(name, wheels[-1], "ground", centre, axle, radius=RIM, one_sided=True),
        ]
    push = rx.spatial.AppliedForce(chassis, (1.0, 0.0, 0.0), point=(0.1, 0.05, 0.9))
    return rx.Mechanism([chassis, *wheels], joints, loads=[push], gravity=(0.0, 0.0, -G))


def least_energy(jacobian, right, compliance):
    """Loads with J^T lam = right of least lam W lam / 2, and how far rows give way beyond what the others do."""
    lam = np.linalg.lstsq(jacobian.T, right, rcond=1e-11)[0]
    stress = scipy.linalg.null_space(jacobian.T, rcond=1e-11)
    if stress.size:
        soft = stress.T @ (compliance[:, None] * stress)
        lam = lam - stress @ np.linalg.solve(soft, stress.T @ (compliance * lam))
    return lam, np.linalg.lstsq(jacobian, compliance * lam, rcond=1e-11)[0]


def standing(rows, normals, tied, mass, load, compliance):
    """What each wheel does, with loads and accelerations, of every set that fits: one that carries pushes, one that
    touches would not push and is held by the others, one that lifts opens and has no rows at all."""
    fits, gamma = [], np.zeros(len(rows))
    for words in itertools.product(("carries", "touches", "lifts"), repeat=len(normals)):
        kept = np.ones(len(rows), bool)
        for word, normal, own in zip(words, normals, tied, strict=True):
            kept[normal], kept[own] = word == "carries", word != "lifts"
        own = rows[kept]
        whole = np.block([[mass, own.T], [own, np.zeros((len(own),) * 2)]])
        a = np.linalg.lstsq(whole, np.concatenate([load, gamma[kept]]), rcond=1e-11)[0][: len(mass)]
        lam, u = least_energy(own, load - mass @ a, compliance[kept])
        loads = np.zeros(len(rows))
        loads[kept] = lam
        opens, rank = rows[normals] @ a < -1e-9, np.linalg.matrix_rank(own, 1e-9)
        for k, word in enumerate(words):
            beside = np.linalg.matrix_rank(np.vstack([own, rows[normals[k]]]), 1e-9) == rank
            good = {
                "carries": loads[normals[k]] > 0,
                "touches": beside and not opens[k] and -rows[normals[k]] @ u >= 0,
                "lifts": opens[k],
            }[word]
            if not good:
                break
        else:
            fits.append((words, loads, a))
    return fits


@pytest.mark.slow
def test_a_cart_stands_on_the_wheels_of_all_sets():
    mechanism = cart()
    state, labels = rx.assemble(mechanism), mechanism.rows.labels
    closure = rx.ElasticJoints(mechanism, {name: 1e-6 * (k + 1) for k, name in enumerate(NAMES)})
    rows, mass = np.asarray(mechanism.jacobian(state.q, state.t)), np.asarray(mechanism.mass(state.q, state.t))
    compliance = np.zeros(len(rows))
    for k, name in enumerate(NAMES):
        compliance[[labels.index(f"{name}.{row}") for row in ("normal", "along", "across")]] = 1e-6 * (k + 1)
    normals = [labels.index(f"{name}.normal") for name in NAMES]
    tied = [[labels.index(f"{name}.{row}") for row in ("along", "across")] for name in NAMES]
    rng, seen = np.random.default_rng(3), set()
    pushes = rng.normal(size=(16, 3)) * [80.0, 150.0, 60.0] + [0.0, 0.0, 40.0]
    for push in pushes:
        pushed = eqx.tree_at(lambda m: m.loads[0].element.force, mechanism, jnp.asarray(push)[None])
        fits = standing(rows, normals, tied, mass, np.asarray(pushed.load(state)), compliance)
        found = rx.solve(pushed, state, closure=closure)
        words = tuple(map(str, found.contacts.values()))
        seen.add(words)
        assert len(fits) == 1 and fits[0][0] == words, (push, words, [fit[0] for fit in fits])
        np.testing.assert_allclose(found.multipliers, fits[0][1], rtol=0, atol=1e-8)
        np.testing.assert_allclose(found.acceleration, fits[0][2], rtol=0, atol=1e-9)
    assert len(seen) > 4


@pytest.mark.slow
def test_a_cart_tips_sideways_about_the_wheels_that_are_named():
    """At its centre, HEIGHT up, by the weight times half the track; rows across hold, however large their force."""
    mechanism = eqx.tree_at(lambda m: m.loads[0].element.force, cart(), jnp.zeros((1, 3)))
    found = rx.limit_load(mechanism, rx.assemble(mechanism), {"chassis.y": 1.0})
    weight = (MASSES[0] + 4 * MASSES[1]) * G
    assert float(found.upper) == pytest.approx(weight * TRACK / 2 / HEIGHT, rel=1e-9)
    assert found.lifts[1] == ("front right", "rear right") and found.carries[1] == ("front left", "rear left")
