"""Play of joints, against enumeration of all sides at 50 digits, conditions of the convex minimum, and closed forms."""

import itertools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

import redundax as rx

MASS, INERTIA = 2.0, 0.5
X = np.array([-0.8, -0.3, 0.2, 0.9])


def beam(x, one_sided, force, at):
    """A rigid beam on supports at x, held along it, with a force across it at one place."""
    supports = [
        rx.PinInSlot(f"s{k}", "beam", "ground", (place, 0.0), (place, 0.0), (0.0, 1.0), one_sided=push)
        for k, (place, push) in enumerate(zip(x, one_sided, strict=True))
    ]
    held = rx.PinInSlot("held", "beam", "ground", (0.0, 0.0), (0.0, 0.0), (1.0, 0.0))
    load = rx.AppliedForce("beam", force=(0.0, force), point=(at, 0.0))
    return rx.Mechanism([rx.Body("beam", MASS, INERTIA)], [*supports, held], loads=[load])


def closure(mechanism, compliance, misfit, clearance):
    """Of supports; the residual of a support is minus the height of the beam."""
    soft = [
        rx.JointCompliance(f"s{k}", w, misfit=(0.0, -d, 0.0))
        for k, (w, d) in enumerate(zip(compliance, misfit, strict=True))
    ]
    return rx.ElasticJoints(mechanism, soft, play={f"s{k}": c for k, c in enumerate(clearance)})


def enumerated(x, one_sided, given, right):
    """Loads of the one set of sides that fits, of stiff joints whose stiffness grows without bound, by 50 digits."""
    mp.mp.dps, e = 50, mp.mpf(10) ** -25
    compliance, misfit, clearance = given
    m = len(x)
    arms = [(mp.mpf(-1), -mp.mpf(float(place))) for place in x]
    inverse = (1 / mp.mpf(MASS), 1 / mp.mpf(INERTIA))
    both = mp.matrix(m, m)
    for i, j in itertools.product(range(m), repeat=2):
        both[i, j] = sum(inverse[k] * arms[i][k] * arms[j][k] for k in range(2)) + (i == j) * e * mp.mpf(compliance[i])
    free = [sum(inverse[k] * arms[i][k] * mp.mpf(right[k]) for k in range(2)) + e * mp.mpf(misfit[i]) for i in range(m)]
    for sides in itertools.product((1, 0, -1), repeat=m):
        if any(push and side < 0 for push, side in zip(one_sided, sides, strict=True)):
            continue
        rows = [k for k in range(m) if sides[k]]
        loads, wanted = mp.matrix(m, 1), [free[k] - e * mp.mpf(clearance[k]) * sides[k] for k in range(m)]
        if rows:
            part = mp.matrix([[both[i, j] for j in rows] for i in rows])
            for k, load in zip(rows, mp.lu_solve(part, mp.matrix([wanted[k] for k in rows])), strict=True):
                loads[k] = load
        gap = both * loads - mp.matrix(free)
        play = [e * mp.mpf(c) for c in clearance]
        rests = all(gap[k] >= -play[k] and (one_sided[k] or gap[k] <= play[k]) for k in range(m) if not sides[k])
        if rests and all(loads[k] * sides[k] >= 0 for k in range(m)):
            return np.array(loads.tolist(), float)[:, 0], sides
    raise AssertionError("no sides fit")


def test_play_of_a_joint_whose_loads_are_unique_is_told():
    """One guide alone holds the beam along it, whatever the supports across it do."""
    mechanism = beam(X, (False,) * 4, -10.0, 0.3)
    rest, play, soft = rx.State(jnp.zeros(3), jnp.zeros(3)), {"s0": 1e-6, "held": 2e-5}, ("s0", "s1", "s2", "s3")
    with pytest.warns(UserWarning, match="^Play of held.perpendicular changes no load: its loads are unique") as told:
        rx.solve(mechanism, rest, closure=rx.ElasticJoints(mechanism, dict.fromkeys(soft, 1e-6), play=play))
    assert len(told) == 1


@pytest.mark.parametrize("one_sided", [(False,) * 4, (True, False, True, False)])
def test_beams_against_all_sides(one_sided):
    rng, seen = np.random.default_rng(7), set()
    for _ in range(10):
        compliance, misfit = rng.uniform(0.5, 2, 4) * 1e-6, rng.normal(size=4) * 3e-5
        clearance, at, force = rng.uniform(0, 3e-5, 4), rng.uniform(-1, 1), rng.uniform(-40, 20)
        mechanism = beam(X, one_sided, force, at)
        truth, sides = enumerated(X, one_sided, (compliance, misfit, clearance), (force, force * at))
        solution = rx.solve(
            mechanism, rx.State(jnp.zeros(3), jnp.zeros(3)), closure=closure(mechanism, compliance, misfit, clearance)
        )
        found = [float(solution[f"s{k}.perpendicular"]) for k in range(4)]
        np.testing.assert_allclose(found, truth, rtol=0, atol=1e-10 * max(np.abs(truth).max(), 1.0))
        seen |= set(sides)
    assert seen == {-1, 0, 1}


PINS = np.array([[-0.5, 0.0], [0.3, 0.2], [0.6, -0.3]])


def plate(force=(20.0, -50.0), at=(0.1, 0.3)):
    """A plate on three pins, one and a half too many."""
    pins = [rx.Revolute(name, "plate", "ground", point, point) for name, point in zip("ABC", PINS, strict=True)]
    load = rx.AppliedForce("plate", force=force, point=at)
    return rx.Mechanism([rx.Body("plate", MASS, INERTIA)], pins, loads=[load])


PLATE, REST = plate(), rx.State(jnp.zeros(3), jnp.zeros(3))


FITS = np.zeros((3, 2))


def of_pins(clearance, misfit=FITS, mechanism=PLATE):
    soft = [
        rx.JointCompliance(name, w, misfit=jnp.concatenate([d, jnp.zeros(1)]))
        for name, w, d in zip("ABC", (1e-7, 2e-7, 1.5e-7), jnp.asarray(misfit), strict=True)
    ]
    return rx.ElasticJoints(mechanism, soft, play=dict(zip("ABC", clearance, strict=True)))


def test_discs_against_the_conditions_of_the_minimum():
    """r = d + Phi_q u - W lam is c lam/|lam| at pins with load, and within the disc at others: proof of the minimum."""
    rng, empty = np.random.default_rng(3), 0
    soft = np.repeat([1e-7, 2e-7, 1.5e-7], 2)
    jacobian = np.array([[[1, 0, -y], [0, 1, x]] for x, y in PINS]).reshape(6, 3)
    for _ in range(8):
        misfit, clearance = rng.normal(size=(3, 2)) * 1e-5, rng.uniform(0, 2e-5, 3)
        solution = rx.solve(PLATE, REST, closure=of_pins(clearance, misfit))
        loads = np.array([[solution[f"{pin}.{way}"] for way in "xy"] for pin in "ABC"])
        size = np.linalg.norm(loads, axis=1)
        carries = size > 1e-9 * size.max()
        np.testing.assert_allclose(jacobian.T @ loads.ravel(), [20.0, -50.0, 20 * -0.3 - 50 * 0.1], atol=1e-10)
        r = np.zeros((3, 2))
        r[carries] = clearance[carries, None] * (loads / np.where(size > 0, size, 1.0)[:, None])[carries]
        rows = np.repeat(carries, 2)
        gap = soft * loads.ravel() + r.ravel() - misfit.ravel()
        u = np.linalg.lstsq(jacobian[rows], gap[rows], rcond=None)[0]
        np.testing.assert_allclose(jacobian[rows] @ u, gap[rows], rtol=0, atol=1e-10 * 1e-5)
        left = (misfit.ravel() + jacobian @ u).reshape(3, 2)[~carries]
        assert (np.linalg.norm(left, axis=1) <= clearance[~carries]).all()
        empty += (~carries).sum()
    assert empty


def test_a_pair_of_pins_takes_heat_with_its_play_first():
    """Two pins on a line, 30 um too far apart: the load is what play and stiffness leave, (d - c1 - c2)/(w1 + w2)."""
    pins = [rx.Revolute(name, "rod", "ground", point, point) for name, point in (("A", (-0.5, 0)), ("B", (0.5, 0)))]
    mechanism = rx.Mechanism([rx.Body("rod", 1.0, 0.1)], pins)
    for play, load in ((1e-5, 20.0), (2e-5, 0.0), (0.0, 60.0)):
        soft = [rx.JointCompliance("A", 2e-7), rx.JointCompliance("B", 3e-7, misfit=(3e-5, 0.0, 0.0))]
        closure = rx.ElasticJoints(mechanism, soft, play={"A": play, "B": play})
        solution = rx.solve(mechanism, REST, closure=closure)
        assert float(solution["B.x"]) == pytest.approx(load, abs=1e-9)
        assert int(solution.stats.redundancy) == 1


def rod(end):
    """A rod from one pin to another on a line, with its end as it is."""
    ends = (("A", -0.5, -0.5), ("B", end, 0.5))
    pins = [rx.Revolute(name, "rod", "ground", (own, 0.0), (place, 0.0)) for name, own, place in ends]
    return rx.Mechanism([rx.Body("rod", 1.0, 0.1)], pins)


def test_parts_as_built_have_play():
    """A rod 30 um too long, with 10 um of play at each end: 10 um are left to 0.5 um/N."""
    joints = rx.ElasticJoints(rod(0.5), {"A": 2e-7, "B": 3e-7}, play={"A": 1e-5, "B": 1e-5})
    solution = rx.solve(rod(0.5), REST, closure=rx.AsBuilt(joints, rod(0.5 + 3e-5)))
    assert float(solution["B.x"]) == pytest.approx(20.0, abs=1e-6)


@pytest.mark.slow
def test_tolerances_of_play():
    """Beside a misfit of 30 um and play of 10 um: 2 N/um of the misfit, 4 N/um of play at both ends."""
    mechanism = rod(0.5)

    def build(misfit, play):
        gap = jnp.stack([misfit, 0.0, 0.0])
        soft = [rx.JointCompliance("A", 2e-7), rx.JointCompliance("B", 3e-7, misfit=gap)]
        closure = rx.ElasticJoints(mechanism, soft, play={"A": play, "B": play})
        return rx.solve(mechanism, REST, closure=closure)

    found = rx.tolerance_study(build, {"misfit": rx.Normal(3e-5, 1e-6), "play": rx.Uniform(5e-6, 15e-6)}, samples=64)
    own = found.sel(output="B.x")
    assert float(own["nominal"]) == pytest.approx(20.0, abs=1e-6)
    np.testing.assert_allclose(own["gradient"], [2e6, -4e6], rtol=1e-6)


def loads(numbers):
    """Of clearances, and of a force."""
    mechanism = plate(force=numbers[3:5])
    solution = rx.solve(mechanism, REST, closure=of_pins(numbers[:3], jnp.array([[1e-5, 0], [0, 2e-5], [0, 0]])))
    return solution.multipliers, solution.result


GIVEN = jnp.array([[1e-5, 2e-5, 5e-6, 20.0, -50.0], [3e-4, 1e-5, 1e-6, 20.0, -50.0], [0, 0, 0, 1.0, 2.0]])


@pytest.mark.slow
def test_batches_find_the_sides_of_each_sample():
    found, result = jax.jit(jax.vmap(loads))(GIVEN)
    assert (result == rx.RESULTS.successful).all()
    for row, own in zip(GIVEN, found, strict=True):
        np.testing.assert_allclose(loads(row)[0], own, atol=1e-9)
    assert np.linalg.norm(found[1, :2]) < 1e-9  # A, with much play


@pytest.mark.slow
def test_derivatives_at_sides():
    """Also where a pin carries nothing: those of the others."""
    step = np.diag([1e-9] * 3 + [1e-3] * 2)
    for row in GIVEN[:2]:
        slopes = [(loads(row + h)[0] - loads(row - h)[0]) / (2 * h.max()) for h in step]
        forward, reverse = (mode(lambda x: loads(x)[0])(row) for mode in (jax.jacfwd, jax.jacrev))
        np.testing.assert_allclose(forward, np.stack(slopes, axis=1), rtol=1e-5, atol=1e-3)
        np.testing.assert_allclose(reverse, forward, rtol=1e-8, atol=1e-6)


@pytest.mark.slow
def test_play_that_is_none_has_the_derivative_of_one_that_grows():
    """Of a rod 30 um too long between two pins, (d - c1 - c2)/(w1 + w2), in both modes; of NaN loads are NaN."""

    def load(play):
        joints = rx.ElasticJoints(rod(0.5), {"A": 2e-7, "B": 3e-7}, play={"A": play[0], "B": play[1]})
        return rx.solve(rod(0.5), REST, closure=rx.AsBuilt(joints, rod(0.5 + 3e-5)))["B.x"]

    for play in ([0.0, 0.0], [1e-5, 0.0]):
        for mode in (jax.jacfwd, jax.jacrev):
            np.testing.assert_allclose(mode(load)(jnp.array(play)), [-2e6, -2e6], rtol=1e-6)
    assert np.isnan(jax.jit(load)(jnp.array([np.nan, 0.0])))


def test_friction_reads_the_loads_of_joints_with_play():
    """The paper's four-bar with friction of all pins: loads under play are those under its forces as misfits."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    state = mechanism.state(phi=jnp.pi / 4, rate=1.0)
    soft = {name: (1e-8, 1e-6) for name in "ABCDKL"}
    solution = rx.solve(mechanism, state, closure=rx.ElasticJoints(mechanism, soft, play={"A": 1e-5, "D": 2e-5}))
    misfits = []
    for name, play in (("A", 1e-5), ("D", 2e-5)):
        load = -np.array([float(solution[f"{name} force {way} on {dict(A='1', D='3')[name]}"]) for way in "xy"])
        misfits.append(-play * load / np.linalg.norm(load))
    stiff, d = rx.ElasticJoints(mechanism, soft).compliance(mechanism, state)
    d = np.array(d)
    d[:2], d[6:8] = misfits
    same = rx.solve(mechanism, state, closure=rx.Compliance(stiff, jnp.asarray(d)))
    np.testing.assert_allclose(solution.multipliers, same.multipliers, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(solution.acceleration, same.acceleration, rtol=1e-10)


def test_what_takes_no_play_says_so():
    closure = of_pins((1e-5, 0.0, 0.0))
    report = rx.analyze(PLATE, REST, closure=closure)
    assert report.redundancy == 3
    with pytest.raises(rx.RedundaxError, match="`bounds` must have no play in a ComplianceBox"):
        rx.band(PLATE, REST, "A.x", rx.ComplianceBox(closure, {"A.x": (1e-8, 1e-7)}))
    with pytest.raises(rx.RedundaxError, match=r"must name each row once, but names A\.x twice"):
        rx.ElasticJoints(PLATE, {"A": 1e-8}, play={"A": 1e-5, "A.x": 1e-5})
    with pytest.raises(rx.RedundaxError, match="names of joints and rows"):
        rx.ElasticJoints(PLATE, {"A": 1e-8}, play={"E": 1e-5})
    guide = rx.mechanisms.wojtyra2020()
    with pytest.raises(rx.RedundaxError, match=r"Name its rows instead: K\.perpendicular, K\.angle"):
        rx.ElasticJoints(guide, {"K": (1e-8, 1e-6)}, play={"K": 1e-5})
