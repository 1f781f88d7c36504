"""Loads at rest against closed forms, brute force and motions.

Brute force samples the self-stress and which share of its limit each friction takes, and solves for the share that
makes equilibrium, in NumPy.
"""

from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

G = 9.81


# Closed forms -------------------------------------------------------------------------------


@cache
def block_between_walls(mu=0.3, mass=2.0):
    """A block held by two walls at its middle; each carries any force across and mu times it along."""
    wall = {"normal": (1.0, 0.0), "friction": rx.Coulomb(mu)}
    mechanism = rx.Mechanism(
        [rx.Body("block", mass, 0.1)],
        [
            rx.Translational("L", "block", "ground", (0.0, 0.0), (0.0, 0.0), guide_length=0.2, **wall),
            rx.PinInSlot("R", "block", "ground", (0.0, 0.0), (0.0, 0.0), **wall),
        ],
        gravity=(0.0, -G),
    )
    return mechanism, rx.State(jnp.zeros(3), jnp.zeros(3))


@pytest.mark.slow
def test_a_block_between_walls():
    mechanism, rest = block_between_walls()
    weight, most, mu = 2.0 * G, 60.0, 0.3
    box = rx.AmplitudeBox({"L.perpendicular": (-most, most)})
    bands = rx.band(mechanism, rest, ["L.perpendicular", "tau L", "block.y''", "L.angle"], box)
    assert bands.stands == "yes" and bands.exact.all()
    # The slip counts downwards, so that friction that holds the block is negative.
    np.testing.assert_allclose(bands.lower, [-most, -mu * most, 0, 0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(bands.upper, [most, mu * most - weight, 0, 0], rtol=1e-12, atol=1e-12)
    found = rx.limit_load(mechanism, rest, {"block.y": 1.0}, box)
    assert found.upper == pytest.approx(weight + 2 * mu * most, rel=1e-12)
    assert found.lower == pytest.approx(weight - 2 * mu * most, rel=1e-12)
    assert found.slips == (("L", "R"), ("L", "R"))
    np.testing.assert_allclose(found.motion[1], [0, 1, 0], atol=1e-12)


def test_a_block_that_falls_between_walls():
    mechanism, rest = block_between_walls()
    bands = rx.band(mechanism, rest, "tau L", rx.AmplitudeBox({"L.perpendicular": (-32.0, 32.0)}))  # 0.6 * 32 < 19.62
    assert bands.stands == "no" and bands.empty
    assert "CANNOT STAND (proved)" in str(bands)


def incline(angle, mu, mass=3.0):
    along = np.array([np.cos(angle), np.sin(angle)])
    guide = {"normal": (-along[1], along[0]), "friction": rx.Coulomb(mu), "guide_length": 0.1, "angle": 0.0}
    mechanism = rx.Mechanism(
        [rx.Body("block", mass, 0.1)],
        [rx.Translational("K", "block", "ground", (0.0, 0.0), (0.0, 0.0), **guide)],
        gravity=(0.0, -G),
    )
    return mechanism, rx.State(jnp.zeros(3), jnp.zeros(3))


@pytest.mark.slow
def test_a_push_on_an_incline():
    angle, mu, weight = 0.3, 0.4, 3.0 * G
    found = rx.limit_load(*incline(angle, mu), {"block.x": 1.0})
    phi = np.arctan(mu)
    assert found.upper == pytest.approx(weight * np.tan(angle + phi), rel=1e-12)
    assert found.lower == pytest.approx(weight * np.tan(angle - phi), rel=1e-12)
    assert found.outer_upper == pytest.approx(found.upper, rel=1e-6)


@pytest.mark.slow
def test_a_screw_like_incline_locks_itself_where_its_angles_exceed_a_right_one():
    found = rx.limit_load(*incline(1.1, 1.0), {"block.x": 1.0})  # 1.1 + pi / 4 > pi / 2
    assert found.upper == np.inf
    assert "locks itself" in str(found)


@pytest.mark.parametrize("angle", [1.0, np.radians(74.7), np.radians(80)])
@pytest.mark.slow
def test_a_block_is_pulled_loose_before_a_larger_pull_jams_it(angle):
    """It stands up to mu W / (b + mu c), and where mu c > b again from mu W / (mu c - b) on."""
    mu, weight, b, c = 0.3, 3.0 * G, np.cos(angle), np.sin(angle)
    found = rx.limit_load(*incline(0.0, mu), {"block.x": b, "block.y": c})
    end, again = mu * weight / (b + mu * c), mu * weight / (mu * c - b) if mu * c > b else np.inf
    assert found.upper == pytest.approx(end, rel=1e-9)
    assert found.outer_upper == pytest.approx(end, rel=1e-6)
    assert end < found.looked[1] <= again


@pytest.mark.slow
def test_a_load_that_just_excludes_zero():
    system, state, _ = paper()
    bands = [
        rx.band(system, state, ["A.y", "tau A"], rx.PreloadBox({"A.x": (least, 400.0)})) for least in (0.0, 1e-9, 1e-3)
    ]
    for other in bands[1:]:
        assert other.stands == bands[0].stands == "yes"
        np.testing.assert_allclose(other.lower, bands[0].lower, rtol=1e-5)
        np.testing.assert_allclose(other.upper, bands[0].upper, rtol=1e-5)


@pytest.mark.parametrize("angle, stands", [(0.29, "yes"), (0.30, "no"), (np.arctan(0.3), "undecided")])
def test_a_block_stands_below_its_angle_of_friction(angle, stands):
    assert rx.band(*incline(angle, 0.3), "tau K", rx.MinimumNorm()).stands == stands


def test_a_rod_that_constant_friction_holds():
    pin = {"pin_radius": 0.02, "friction": rx.ConstantFriction(400.0)}
    joint = rx.Revolute("O", "rod", "ground", (-0.5, 0.0), (0.0, 0.0), **pin)
    rod = rx.Mechanism([rx.Body("rod", 1.0, 0.1)], [joint], gravity=(0.0, -G))
    rest = rx.State(jnp.array([0.5, 0.0, 0.0]), jnp.zeros(3))
    bands = rx.band(rod, rest, "tau O", rx.MinimumNorm())
    assert bands.stands == "yes" and bands.exact.all()
    np.testing.assert_allclose([bands.lower, bands.upper], G / 2, rtol=1e-12)
    found = rx.limit_load(rod, rest, {"rod.phi": 1.0})
    assert [found.lower, found.upper] == pytest.approx([G / 2 - 8.0, G / 2 + 8.0], rel=1e-12)


def test_a_ladder():
    """N_f, T_f at the foot, N_w, T_w at the wall; T_w = t leaves N_w = (w/2 - t) c, N_f = w - t, c = cot(angle)."""
    length, mass, angle, mu_f, mu_w = 4.0, 10.0, 1.0, 0.5, 0.3
    slot = {"point_j": (0.0, 0.0)}
    half = length / 2
    mechanism = rx.Mechanism(
        [rx.Body("ladder", mass, 1.0)],
        [
            rx.PinInSlot("F", "ladder", "ground", (half, 0.0), normal=(0.0, 1.0), friction=rx.Coulomb(mu_f), **slot),
            rx.PinInSlot("W", "ladder", "ground", (-half, 0.0), normal=(1.0, 0.0), friction=rx.Coulomb(mu_w), **slot),
        ],
        gravity=(0.0, -G),
    )
    rest = rx.State(jnp.array([half * np.cos(angle), half * np.sin(angle), -angle]), jnp.zeros(3))
    bands = rx.band(mechanism, rest, ["W.perpendicular", "F.perpendicular"], rx.MinimumNorm())
    weight, c = mass * G, 1 / np.tan(angle)
    most = mu_w * c * weight / 2 / (1 + mu_w * c)
    least = max(-mu_w * c * weight / 2 / (1 - mu_w * c), weight * (c / 2 - mu_f) / (c - mu_f))
    for name, low, high in (
        ("W", (weight / 2 - most) * c, (weight / 2 - least) * c),
        ("F", weight - most, weight - least),
    ):
        k = bands.names.index(f"{name}.perpendicular")
        assert sorted(np.abs([bands.lower[k], bands.upper[k]])) == pytest.approx([low, high], rel=1e-11)


@pytest.mark.slow
def test_a_wedge_under_a_load():
    """H = W (tan(a + phi) + tan phi) raises the load, H = W (tan(a - phi) - tan phi) lowers it; smooth guide."""
    a, mu, load = 0.25, 0.1, 500.0
    up = (-np.sin(a), np.cos(a))
    rub = {"friction": rx.Coulomb(mu)}
    mechanism = rx.Mechanism(
        [rx.Body("wedge", 1.0, 1.0), rx.Body("block", 1.0, 1.0)],
        [
            rx.Translational("floor", "wedge", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), guide_length=1e6, **rub),
            rx.Translational("guide", "block", "ground", (0.0, 0.0), (0.0, 0.0), (1.0, 0.0)),
            rx.PinInSlot("face", "block", "wedge", (0.0, 0.0), (0.0, 0.0), normal=up, **rub),
        ],
        loads=[rx.AppliedForce("block", force=(0.0, -load))],
    )
    found = rx.limit_load(mechanism, rx.State(jnp.zeros(6), jnp.zeros(6)), {"wedge.x": -1.0})
    phi = np.arctan(mu)
    assert found.upper == pytest.approx(load * (np.tan(a + phi) + np.tan(phi)), rel=1e-9)
    assert found.lower == pytest.approx(load * (np.tan(a - phi) - np.tan(phi)), rel=1e-9)
    assert set(found.slips[1]) == {"floor", "face"}


# Brute force --------------------------------------------------------------------------------


class Brute:
    """Equilibrium J^T lam = Q + E tau in NumPy: lam_MN(tau) + N z, and the limits by hand from the joints' data."""

    def __init__(self, system, state, limits):
        factor = rx.factorize(system, state)
        self.jacobian, self.load = np.asarray(factor.jacobian), np.asarray(factor.load)
        self.limits, self.rows = limits, list(system.names.rows.labels)
        self.slips = directions(system, state)
        inverse = np.linalg.pinv(self.jacobian.T, rcond=1e-9)
        _, sizes, vt = np.linalg.svd(self.jacobian)
        self.free = vt[np.sum(sizes > 1e-9 * sizes[0]) :].T
        self.start, self.effect = inverse @ self.load, inverse @ self.slips
        self.drive, self.ways = self.free.T @ self.load, self.free.T @ self.slips  # (1,), (1, p)

    def sampled(self, stress, z):
        """Samples (lam, tau) with amplitudes z (s, k) along the self-stress states (k, m)."""
        return self.balanced(self.start + z @ stress, np.broadcast_to(self.effect, (len(z), *self.effect.shape)))

    def closed(self, compliance, misfit):
        """Samples (lam, tau) under diagonal compliances (s, m) and misfits (s, m)."""
        _, sizes, vt = np.linalg.svd(self.jacobian.T)
        stress = vt[np.sum(sizes > 1e-9 * sizes[0]) :].T
        base, ways = [], []
        for w, d in zip(compliance, misfit, strict=True):
            response = stress @ np.linalg.solve(stress.T @ (w[:, None] * stress), stress.T)
            base.append(self.start + response @ (d - w * self.start))
            ways.append(self.effect - response @ (w[:, None] * self.effect))
        return self.balanced(np.array(base), np.array(ways))

    def balanced(self, base, ways, seed=0, rounds=45):
        """Samples of lam = base + ways tau that are in equilibrium."""
        random, (count, _, p) = np.random.default_rng(seed), ways.shape
        shares = np.where(
            random.random((count, p)) < 0.7, np.sign(random.random((count, p)) - 0.5), 2 * random.random((count, p)) - 1
        )
        way = np.sign(self.ways[0])
        low, high = np.full(count, -2.0), np.full(count, 2.0)
        for _ in range(rounds):
            t = (low + high) / 2
            tau, share = np.zeros((count, p)), np.clip(shares + t[:, None] * way, -1, 1)
            for _ in range(40):
                lam = base + np.einsum("smp,sp->sm", ways, tau)
                tau = share * self.limits(dict(zip(self.rows, lam.T, strict=True)))
            above = tau @ self.ways[0] + self.drive[0] > 0
            low, high = np.where(above, low, t), np.where(above, t, high)
        good = np.abs(tau @ self.ways[0] + self.drive[0]) < 1e-9 * (np.abs(self.drive[0]) + np.abs(tau @ self.ways[0]))
        lam = base + np.einsum("smp,sp->sm", ways, tau)
        good &= np.all(np.abs(tau) <= (1 + 1e-9) * self.limits(dict(zip(self.rows, lam.T, strict=True))), axis=1)
        return lam[good], tau[good]


def directions(system, state, step=1e-6):
    """E by central differences of the slips."""
    columns = []
    for k in range(state.q.size):
        shift = np.zeros(state.q.size)
        shift[k] = step
        ends = [
            np.concatenate([np.asarray(group.slip(state.q + sign * shift, state.t)) for group in system.friction])
            for sign in (1, -1)
        ]
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.round(np.array(columns), 9)


def revolutes(names, mu_rho):
    return lambda lam: np.stack([mu_rho * np.hypot(lam[f"{name}.x"], lam[f"{name}.y"]) for name in names], axis=1)


def press(*loads):
    pin = {"pin_radius": 0.02, "friction": rx.Coulomb(0.2)}
    guide = {"normal": (1.0, 0.0), "guide_length": 0.08, "friction": rx.Coulomb(0.1)}
    mechanism = rx.Mechanism(
        [rx.Body("crank", 2.0, 0.01), rx.Body("rod", 1.5, 0.02), rx.Body("ram", 10.0, 0.3)],
        [
            rx.Revolute("O", "crank", "ground", (-0.1, 0.0), (0.0, 0.0), **pin),
            rx.Revolute("P", "rod", "crank", (-0.25, 0.0), (0.1, 0.0), **pin),
            rx.Revolute("Q", "ram", "rod", (0.0, 0.1), (0.25, 0.0), **pin),
            rx.Translational("L", "ram", "ground", (-0.3, 0.0), (-0.3, 0.0), **guide),
            rx.Translational("R", "ram", "ground", (0.3, 0.0), (0.3, 0.0), **guide),
        ],
        loads=[rx.AppliedForce("crank", moment=-8.0), *loads],
        gravity=(0.0, -G),
    )
    guess = [0.0, 0.1, 0.1, -0.1, 0.0, -0.5, 0.8, -1.2, 0.0]
    state = rx.assemble(mechanism, guess, positions={"crank.phi": 0.6})

    def limits(lam):
        pins = revolutes("OPQ", 0.2 * 0.02)(lam)
        guides = [
            0.1 * np.maximum(np.abs(lam[f"{n}.perpendicular"]), 2 * np.abs(lam[f"{n}.angle"]) / 0.08) for n in "LR"
        ]
        return np.column_stack([pins, *guides])

    return mechanism, state, limits


def cranks(count):
    mechanism = rx.mechanisms.parallelogram(cranks=count, mu_rho=0.01)
    names = [f"{side}{k + 1}" for side in "AB" for k in range(count)]
    return mechanism, mechanism.state(phi=1.45, rate=0.0), revolutes(names, 0.01)


def paper():
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    return mechanism, mechanism.state(phi=np.pi / 4, rate=0.0), revolutes("ABCD", 0.02)


def carriage():
    mechanism = rx.mechanisms.carriage(mu=0.2, guide_length=0.1, offset=0.1)

    def limits(lam):
        ends = [(lam[f"K{k}.perpendicular"], lam[f"K{k}.angle"]) for k in (1, 2)]
        return np.column_stack([0.2 * np.maximum(np.abs(force), 2 * np.abs(moment) / 0.1) for force, moment in ends])

    return mechanism, mechanism.state(0.0, rate=0.0), limits


CASES = {
    "press": (press, [600.0, 60.0]),
    "paper": (paper, [500.0]),
    "carriage": (carriage, [100.0, 5.0]),
    "three cranks": (lambda: cranks(3), [400.0]),
    "five cranks": (lambda: cranks(5), [300.0, 200.0, 200.0]),
}


slow = [pytest.param(name, marks=pytest.mark.slow) for name in ("paper", "three cranks", "press", "five cranks")]


@pytest.mark.parametrize("name", ["carriage", *slow])
def test_bands_at_rest_hold_what_brute_force_finds(name):
    make, size = CASES[name]
    system, state, limits = make()
    report = rx.analyze(system, state)
    sizes = np.array(size)
    box = rx.AmplitudeBox({pivot: (-a, a) for pivot, a in zip(report.pivots, size, strict=True)})
    random = np.random.default_rng(1)
    z = np.where(
        random.random((3000, len(size))) < 0.5,
        np.sign(random.random((3000, len(size))) - 0.5),
        2 * random.random((3000, len(size))) - 1,
    )
    brute = Brute(system, state, limits)
    lam, tau = brute.sampled(np.asarray(report.self_stress), z * sizes)
    assert len(lam) > 100
    names = [*report.rows[:2], report.rows[-1], *(f"tau {label}" for label in system.slips.labels[:2])]
    bands = rx.band(system, state, names, box)
    values = np.column_stack([lam[:, [0, 1, -1]], tau[:, :2]])
    span = np.ptp(values, axis=0)
    assert bands.stands == "yes"
    assert np.all(bands.outer_lower <= values.min(axis=0) + 1e-6 * span)
    assert np.all(bands.outer_upper >= values.max(axis=0) - 1e-6 * span)
    assert np.all(bands.lower <= values.min(axis=0) + 0.01 * span)
    assert np.all(bands.upper >= values.max(axis=0) - 0.01 * span)
    for solutions in (bands.lower_solution, bands.upper_solution):
        stands(brute, solutions[:, state.qd.size :])


@pytest.mark.parametrize("kind", ["misfit", "compliance"])
@pytest.mark.slow
def test_bands_under_joints_that_give_way_hold_what_brute_force_finds(kind):
    system, state, limits = press(rx.AppliedForce("crank", moment=24.0))
    rows, random, count = list(system.names.rows.labels), np.random.default_rng(2), 2000
    compliance = np.tile([1e-8] * 8 + [1e-6] * 2, (count, 1))
    misfit = np.tile([0.0] * 6 + [2e-6, 0.0, 0.0, 0.0], (count, 1))
    given = rx.Compliance(W=jnp.asarray(compliance[0]), misfit=jnp.asarray(misfit[0]))
    if kind == "misfit":
        box = rx.MisfitBox(given, {"R.perpendicular": (-4e-6, 4e-6)})
        misfit[:, rows.index("R.perpendicular")] = random.choice([-4e-6, 4e-6, 0.0], count)
    else:
        box = rx.ComplianceBox(given, {"L.perpendicular": (1e-9, 1e-7), "R.angle": (1e-7, 1e-5)})
        for row, ends in (("L.perpendicular", (1e-9, 1e-7)), ("R.angle", (1e-7, 1e-5))):
            compliance[:, rows.index(row)] = random.choice([*ends, np.sqrt(ends[0] * ends[1])], count)
    brute = Brute(system, state, limits)
    lam, tau = brute.closed(compliance, misfit)
    assert len(lam) > 100
    names = ["O.x", "L.perpendicular", "tau L"]
    values = np.column_stack([lam[:, rows.index("O.x")], lam[:, rows.index("L.perpendicular")], tau[:, 3]])
    bands, span = rx.band(system, state, names, box), np.ptp(values, axis=0)
    assert bands.stands == "yes"
    assert np.all(bands.outer_lower <= values.min(axis=0) + 1e-6 * span)
    assert np.all(bands.outer_upper >= values.max(axis=0) - 1e-6 * span)
    assert np.all(bands.lower <= values.min(axis=0) + 0.01 * span)
    assert np.all(bands.upper >= values.max(axis=0) - 0.01 * span)
    ends = np.concatenate([bands.lower, bands.upper])
    solutions = np.concatenate([bands.lower_solution, bands.upper_solution])[:, state.qd.size :]
    np.testing.assert_array_equal(
        np.isnan(solutions).all(axis=1), np.isinf(ends)
    )  # a guide that takes all of the moment wedges
    stands(brute, solutions[np.isfinite(ends)])


def stands(brute, solutions):
    """Whether [lam; tau] is an equilibrium with friction within its limits."""
    lam, tau = np.split(solutions, [len(brute.rows)], axis=1)
    size = np.abs(lam).max()
    assert np.abs(lam @ brute.jacobian - tau @ brute.slips.T - brute.load).max() < 1e-9 * size
    most = brute.limits(dict(zip(brute.rows, lam.T, strict=True)))
    assert np.all(np.abs(tau) <= most + 1e-8 * most.max())


# Motions ------------------------------------------------------------------------------------


def rising(i, j, t, p):
    """A moment on the body that rises in proportion to time."""
    moment = p["start"] + p["rate"] * t
    return rx.Wrench(jnp.zeros(2), moment), rx.Wrench(jnp.zeros(2), -moment)


@pytest.mark.slow
def test_a_motion_under_a_slow_ramp_starts_at_the_limit_load(end="upper"):
    joints = rx.Compliance(W=jnp.array([1e-8] * 8 + [1e-6] * 2), misfit=jnp.array([0.0] * 6 + [5e-6, 0.0, 0.0, 0.0]))
    system, state, _ = press()
    found = rx.limit_load(system, state, {"crank.phi": 1.0}, joints)
    middle = (found.lower + found.upper) / 2
    ramp = {"start": middle, "rate": getattr(found, end) - middle}  # at the limit after 1 s
    system, state, _ = press(rx.LoadFunction("crank", rising, parameters=ramp))
    before, after = (rx.simulate(system, state, t1, closure=joints, throw=False) for t1 in (1 - 1e-6, 1 + 1e-6))
    assert before.result == rx.RESULTS.stuck
    assert after.result == rx.RESULTS.successful and after.stats.phases == 1
    assert abs(after.stats.end - 1 - 1e-6) < 1e-15 and np.any(after.qd[-1] != 0)
    grown = after.acceleration[-1] * 1e-6 / 2  # as accelerations grow from zero
    np.testing.assert_allclose(after.qd[-1], grown, rtol=1e-3, atol=1e-18)


# Parts that move, units ---------------------------------------------------------------------


def block_on_a_block(mu_below):
    """A block that slides on a block, which rests on the ground."""
    wide = {"normal": (0.0, 1.0), "guide_length": 1e6}
    mechanism = rx.Mechanism(
        [rx.Body("above", 2.0, 1.0), rx.Body("below", 5.0, 1.0)],
        [
            rx.Translational("slide", "above", "below", (0.0, 0.0), (0.0, 0.0), friction=rx.Coulomb(0.3), **wide),
            rx.Translational("foot", "below", "ground", (0.0, 0.0), (0.0, 0.0), friction=rx.Coulomb(mu_below), **wide),
        ],
        gravity=(0.0, -G),
    )
    return mechanism, rx.State(jnp.zeros(6), jnp.zeros(6).at[0].set(1.0))


@pytest.mark.slow
def test_a_block_that_rests_under_one_that_slides():
    bands = rx.band(*block_on_a_block(0.2), ["tau foot", "tau slide", "above.x''", "below.x''"], rx.MinimumNorm())
    push = 0.3 * 2.0 * G  # of the sliding block on the other; 0.2 * 7 * G holds more
    assert bands.stands == "yes" and bands.exact.all()
    np.testing.assert_allclose(np.abs(bands.lower), [push, push, 0.3 * G, 0.0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(bands.upper, bands.lower, rtol=1e-9, atol=1e-9)
    assert rx.band(*block_on_a_block(0.05), "tau foot", rx.MinimumNorm()).stands == "slips"  # 0.05 * 7 < 0.3 * 2


@pytest.mark.slow
def test_bands_at_rest_are_the_same_in_other_units():
    system, state, _ = paper()
    units = rx.units.Units(length=1e3, mass=1e-3)
    there = rx.units.in_units(system, units)
    factors = np.asarray(units.of_force(system.rows))
    rows = ["A.x", "A.y", "K.angle"]
    bands = rx.band(system, state, rows, rx.PreloadBox({"A.x": (-400.0, 400.0)}))
    scale = factors[list(system.rows.labels).index("A.x")]
    box = rx.PreloadBox({"A.x": (-400.0 * scale, 400.0 * scale)})
    other = rx.band(there, rx.units.state_in_units(state, system, units), rows, box)
    own = np.array([factors[list(system.rows.labels).index(row)] for row in rows])
    np.testing.assert_allclose(other.lower, bands.lower * own, rtol=1e-6)
    np.testing.assert_allclose(other.upper, bands.upper * own, rtol=1e-6)
    np.testing.assert_allclose(other.outer_upper, bands.outer_upper * own, rtol=1e-5)
