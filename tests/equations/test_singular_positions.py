"""Singular positions: accelerations by the third-order condition where the velocity decides the branch, else refused.

The mechanisms are exact data (`truth.exact`) whose bodies follow a curve q = pose(s) through the position at s = 0,
known in closed form. Beside the position their equations are regular and solved to 50 digits; the truth at it is that
at s = 1e-20, which is off by that much.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import registry
from mpmath import mp
from truth import exact, scenes
from truth.exact import Driver, Revolute, Translational

import redundax as rx

R = rx.RESULTS
DISTANCES = (0.0, *(10.0**-k for k in range(16, 0, -1)))
LIMIT = mp.mpf(10) ** -20
RATE = "11/10"
GRAVITY = ("3/10", "-981/100")


@dataclass(frozen=True)
class Case:
    """A mechanism, its curve, and what is known of it.

    - `bodies`: mass, inertia and load.
    - `pose`: (x, y, turn) of every body over s.
    - `rank`: that beside the position.
    - `lost`: rows that the self-stress of the position alone touches.
    - `drivers`: over s.
    """

    bodies: tuple
    revolutes: tuple
    pose: Callable
    rank: int
    lost: tuple
    translationals: tuple = ()
    drivers: Callable = lambda s: ()

    @exact.exactly
    def truth(self, s, rate=RATE, mu_rho=MappingProxyType({})) -> exact.Mechanism:
        s, rate = mp.mpf(s), exact.exact(rate)
        bodies = (exact.Body(*exact.exact((mass, inertia)), exact.exact(load)) for mass, inertia, load in self.bodies)
        revolutes = (
            Revolute(j.name, j.i, j.j, *exact.exact((j.s_i, j.s_j, mu_rho.get(j.name, 0)))) for j in self.revolutes
        )
        guides = (
            Translational(j.name, j.i, j.j, *exact.exact((j.s_i, j.s_j, j.v_j)), mp.mpf(0)) for j in self.translationals
        )
        parts = (tuple(part) for part in (bodies, revolutes, guides, self.drivers(s)))
        state = scenes.on_curve(self.pose, s, rate)
        return exact.Mechanism(*parts, gravity=exact.exact(GRAVITY), rank=self.rank, **state)

    @exact.exactly
    def solution(self, s, rate=RATE, mu_rho=MappingProxyType({}), **options) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations and multipliers, under the minimum norm if no compliance is given."""
        found = self.truth(s, rate, mu_rho).solve(**options)
        return exact.floats(found.acceleration), exact.floats(found.multipliers)

    def build(self, s, rate=RATE, mu_rho=MappingProxyType({})) -> tuple[rx.Mechanism, rx.State]:
        def law(joint):
            return rx.Coulomb(float(Fraction(mu_rho[joint.name]))) if joint.name in mu_rho else None

        return registry.build(self.truth(s, rate), law)


def rows(*joints: str) -> tuple[str, ...]:
    return tuple(f"{joint}.x" for joint in joints)


def cranks(a, count=2, b="8/10", moment="2", antiparallel=False):
    """Equal cranks on one coupler, flat at s = 0, which stay parallel or, of two, cross."""
    o, half = "0", str(Fraction(a) / 2)
    bodies = tuple((str(1 + k), "1/100", (o, o, moment if k == 0 else o)) for k in range(count))
    joints, coupler = [], count + 1
    for k in range(count):
        pivot = str(k * Fraction(b))
        joints += [
            Revolute(f"A{k}", k + 1, 0, ("-" + half, o), (pivot, o)),
            Revolute(f"B{k}", coupler, k + 1, (pivot, o), (half, o)),
        ]

    def pose(s):
        arm, d = exact.exact(a), exact.exact(b)
        angles = [s] * count
        if antiparallel:
            angles[1] = -2 * mp.atan((d + arm) / (d - arm) * mp.tan(s / 2))
        tips = [(arm * mp.cos(x) + k * d, arm * mp.sin(x)) for k, x in enumerate(angles)]
        turn = mp.atan2(tips[1][1] - tips[0][1], tips[1][0] - tips[0][0])
        middle = [(arm / 2 * mp.cos(x) + k * d, arm / 2 * mp.sin(x), x) for k, x in enumerate(angles)]
        return [*middle, (*tips[0], turn)]

    lost = rows(*(joint.name for joint in joints))
    return Case((*bodies, ("2", "1/10", (o, o, o))), tuple(joints), pose, 3 * (count + 1) - 1, lost)


def rider():
    """A flat parallelogram with a body on its coupler that two pins hold: their self-stress lasts."""
    case, o = cranks("3/10"), "0"
    bodies = (*case.bodies, ("1/2", "1/50", (o, "3", "1")))
    pins = Revolute("E", 4, 3, ("-1/10", o), ("3/10", "1/5")), Revolute("F", 4, 3, ("1/10", o), ("1/2", "1/5"))

    def pose(s):
        places = case.pose(s)
        return [*places, (places[2][0] + exact.exact("4/10"), places[2][1] + exact.exact("1/5"), 0 * s)]

    return Case(bodies, (*case.revolutes, *pins), pose, 11, case.lost)


def pendulum():
    """A flat parallelogram with a pendulum on its coupler."""
    case, o = cranks("3/10"), "0"
    bodies = (*case.bodies, ("1/2", "1/50", (o, o, o)))

    def pose(s):
        places, turn = case.pose(s), exact.exact("2/5") + exact.exact("17/10") * s
        pin = places[2][0] + exact.exact("1/2"), places[2][1] + exact.exact("1/10")
        arm = exact.exact("1/4")
        return [*places, (pin[0] + arm * mp.sin(turn), pin[1] - arm * mp.cos(turn), turn)]

    return Case(bodies, (*case.revolutes, Revolute("P", 4, 3, (o, "1/4"), ("1/2", "1/10"))), pose, 10, case.lost)


def folding_slider(a="2/5", driven=False):
    """Crank and rod of one length, the slider at the crank's pivot at s = 0; driven, and in two guides, or free."""
    half, o = str(Fraction(a) / 2), "0"
    bodies = (("1", "1/50", (o, o, o)), ("3/2", "3/100", (o, o, "1")), ("2", "1/20", ("5", o, o)))
    revolutes = (
        Revolute("O", 1, 0, ("-" + half, o), (o, o)),
        Revolute("P", 2, 1, ("-" + half, o), (half, o)),
        Revolute("Q", 3, 2, (o, o), (half, o)),
    )
    guides = [Translational("S", 3, 0, (o, o), (o, o), (o, "1"))]
    if driven:
        guides.append(Translational("T", 3, 0, (o, "1/10"), (o, "1/10"), (o, "1")))

    def drivers(s):
        return (Driver("M", 1, 0, mp.pi / 2 + s, exact.exact(RATE), exact.exact("3/5")),) if driven else ()

    def pose(s):
        phi = mp.pi / 2 + s
        x, y = exact.exact(a) * mp.cos(phi), exact.exact(a) * mp.sin(phi)
        return [(x / 2, y / 2, phi), (3 * x / 2, y / 2, -phi), (2 * x, 0 * x, 0 * x)]

    lost = ("O.y", "P.y", "Q.y", *(f"{guide.name}.perpendicular" for guide in guides))
    return Case(bodies, revolutes, pose, 9 if driven else 8, lost, tuple(guides), drivers)


def folding_kite(a="3/10", b="7/10"):
    """A four-bar of two pairs of equal lengths, whose coupler and rocker turn as one about a crank that rests."""
    o, ha, hb = "0", str(Fraction(a) / 2), str(Fraction(b) / 2)
    bodies = (("1", "1/50", (o, o, o)), ("3/2", "3/100", (o, o, o)), ("2", "1/20", (o, o, "1")))
    revolutes = (
        Revolute("O", 1, 0, ("-" + ha, o), (o, o)),
        Revolute("P", 2, 1, ("-" + hb, o), (ha, o)),
        Revolute("Q", 3, 2, (hb, o), (hb, o)),
        Revolute("R", 3, 0, ("-" + hb, o), (a, o)),
    )

    def pose(s):
        arm, x, y = exact.exact(a), exact.exact(b) * mp.cos(s), exact.exact(b) * mp.sin(s)
        return [(arm / 2 + 0 * s, 0 * s, 0 * s), (arm + x / 2, y / 2, s), (arm + x / 2, y / 2, s)]

    return Case(bodies, revolutes, pose, 8, rows(*"OPQR"))


CASES = {
    "flat parallelogram": cranks("3/10"),
    "flat, three cranks": cranks("3/10", count=3),
    "flat, long coupler": cranks("3/10", b="5"),
    "flat, short cranks": cranks("1/50"),
    "antiparallelogram": cranks("3/10", antiparallel=True),
    "with a rider on two pins": rider(),
    "with a pendulum": pendulum(),
    "folding slider": folding_slider(),
    "driven and twice guided": folding_slider(driven=True),
    "folding kite": folding_kite(),
}
every_case = pytest.mark.parametrize("name", CASES)
MORE = "flat, three cranks", "with a rider on two pins", "with a pendulum"


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow if name in MORE else ()) for name in CASES])
def test_accelerations_are_right_or_refused_at_every_distance(name):
    case, refused = CASES[name], []
    for s in DISTANCES:
        found = rx.solve(*case.build(s), throw=False)
        if found.result != R.successful:
            assert np.all(np.isnan(found.acceleration))
            refused.append(s)
            continue
        true, _ = case.solution(s or LIMIT)
        assert np.max(np.abs(found.acceleration - true)) <= 1e-7 * np.max(np.abs(true)), f"at {s}"
    assert all(1e-15 < s < 1e-9 for s in refused), f"refused at {refused}"


@every_case
def test_loads_at_the_position_are_right_or_have_no_value(name):
    case = CASES[name]
    system, state = case.build(0)
    found, labels = rx.solve(system, state), np.array(system.rows.labels)
    assert set(labels[np.isnan(found.multipliers)]) == set(case.lost)
    _, true = case.solution(LIMIT)
    given = ~np.isin(labels, case.lost)
    np.testing.assert_allclose(found.multipliers[given], true[given], rtol=0, atol=1e-9)
    # Beside the position at the time t the others are growth / t.
    growth = true * float(LIMIT / exact.exact(RATE))
    branch = rx.factorize(system, state).branch
    np.testing.assert_allclose(branch.growth, growth, rtol=0, atol=1e-9 * np.max(np.abs(growth)))
    assert int(branch.count) == 1


def test_both_cranks_of_a_flat_parallelogram_turn_alike():
    """T phi'' = moment - g a (m_1 / 2 + m_2 + m_3 / 2) with T = 2 (m (a / 2)^2 + J) + m_2 a^2."""
    a, b, rate = 0.3, 0.8, 1.1
    joints = [
        rx.Revolute("A", "1", "ground", (-a / 2, 0.0), (0.0, 0.0)),
        rx.Revolute("B", "2", "1", (-b / 2, 0.0), (a / 2, 0.0)),
        rx.Revolute("C", "3", "2", (a / 2, 0.0), (b / 2, 0.0)),
        rx.Revolute("D", "3", "ground", (-a / 2, 0.0), (b, 0.0)),
    ]
    bodies = [rx.Body("1", 1.0, 0.01), rx.Body("2", 2.0, 0.1), rx.Body("3", 1.0, 0.01)]
    system = rx.Mechanism(bodies, joints, loads=[rx.AppliedForce("1", moment=2.0)], gravity=(0.0, -9.81))
    q, qd = [a / 2, 0, a + b / 2, 0, a / 2 + b, 0, 0, 0, 0], rate * np.array([0, a / 2, 0, a, 0, a / 2, 1, 0, 1])
    found = rx.solve(system, rx.State(q, qd)).acceleration
    expected = (2.0 - 9.81 * a * 3.0) / (2 * (a**2 / 4 + 0.01) + 2.0 * a**2)
    np.testing.assert_allclose(found[jnp.array([6, 8])], expected, rtol=1e-13)
    assert abs(expected + 27.8734694) < 1e-7


# Refused -------------------------------------------------------------------------------------


FREE = [name for name in CASES if name != "driven and twice guided"]


@pytest.mark.parametrize("name", FREE)
def test_rest_is_refused(name):
    with pytest.raises(rx.NoSolutionError, match="nothing decides"):
        rx.solve(*CASES[name].build(0, rate="0"))


@pytest.mark.parametrize("name", ["flat parallelogram", "with a rider on two pins"])
def test_nothing_is_said_at_rest(name):
    system, state = CASES[name].build(0, rate="0")
    report = rx.analyze(system, state)
    assert report.singular_position and report.local_self_stress >= 1
    assert "SINGULAR POSITION" in str(report)
    assert not report.unique_accelerations
    assert report.unique_multipliers == report.undetermined == ()
    assert report.verdicts == {}
    for call in (
        lambda: rx.band(system, state, None, rx.AmplitudeBox({report.pivots[0]: (-1.0, 1.0)})),
        lambda: rx.solution_family(system, state),
        lambda: rx.sticking(system, state, rx.MinimumNorm()),
    ):
        with pytest.raises(rx.NoSolutionError, match="position is singular"):
            call()


def test_slow_motions_are_right_or_refused():
    case, ended = CASES["antiparallelogram"], {}
    for k in range(0, 20, 2):
        rate = Fraction(1, 10**k)
        found = rx.solve(*case.build(0, rate=rate), throw=False)
        ended[k] = found.result == R.successful
        if ended[k]:
            true, _ = case.solution(LIMIT, rate)
            assert np.max(np.abs(found.acceleration - true)) <= 1e-7 * np.max(np.abs(true)), k
        else:
            assert found.result in (R.singular_position, R.ambiguous_position)
    assert all(ended[k] for k in (0, 2, 4))
    assert not any(ended[k] for k in (16, 18))


def squares(*rates, powers=(2, 2)):
    """Pairs (u, v) with u^2 + u^3 = v^p each, unit masses and the forces 1, 2, 3, ..."""

    def constraint(q, t, p):
        return jnp.array([u**2 + u**3 - v**power for (u, v), power in zip(q.reshape(-1, 2), powers, strict=True)])

    n = 2 * len(powers)
    forces = jnp.arange(1.0, n + 1)
    system = rx.System(constraint, jnp.ones(n), lambda q, qd, t, p: forces)
    return system, rx.State(jnp.zeros(n), jnp.array(rates))


def test_positions_where_several_branches_cross():
    """v = +-u sqrt(1 + u): with v' = sign at 0 and v'' = sign,  2 u'' + u'^2 = f_u + sign f_v."""
    for rates in ((0.5, 0.5, 2.0, 2.0), (0.5, -0.5, 2.0, 2.0), (-0.5, 0.5, -1.0, -1.0)):
        found = rx.solve(*squares(*rates)).acceleration
        for k in range(2):
            rate, sign = rates[2 * k], np.sign(rates[2 * k] * rates[2 * k + 1])
            u = (2 * k + 1 + sign * (2 * k + 2) - rate**2) / 2
            np.testing.assert_allclose(found[2 * k : 2 * k + 2], [u, sign * (u + rate**2)], rtol=1e-12)


def test_where_branches_touch_or_one_rests_nothing_decides():
    for rates, powers in (((0.0, 1.0), (4,)), ((0.5, 0.5, 0.0, 1.0), (2, 4)), ((0.5, 0.5, 0.0, 0.0), (2, 2))):
        found = rx.solve(*squares(*rates, powers=powers), throw=False)
        assert found.result == R.singular_position
        assert np.all(np.isnan(found.acceleration))


def test_a_velocity_between_the_branches_is_refused():
    assert rx.solve(*squares(0.5, 0.4, powers=(2,)), throw=False).result == R.inadmissible_velocity


def test_a_rank_that_changes_with_time():
    """Rows y and y + t x: at t = 0 they are one, beside it two, and x stays 0 whatever the load."""
    system = rx.System(lambda q, t, p: jnp.stack([q[1], q[1] + t * q[0]]), jnp.ones(2), lambda q, qd, t, p: jnp.ones(2))
    for t in (0.0, 0.5):
        found = rx.solve(system, rx.State([0.0, 0.0], [0.0, 0.0], t))
        np.testing.assert_allclose(found.acceleration, 0.0, atol=1e-15)


# Friction ------------------------------------------------------------------------------------


def test_friction_of_loads_that_grow_without_bound_is_refused():
    case, mu_rho = CASES["flat parallelogram"], {"A0": "3/1000"}
    with pytest.raises(rx.NoSolutionError, match="jams"):
        rx.solve(*case.build(0, mu_rho=mu_rho))
    assert rx.solve(*case.build(1e-9, mu_rho=mu_rho), throw=False).result == R.unbounded_friction
    for call in (rx.solution_family, rx.frictional_solutions):
        with pytest.raises(rx.NoSolutionError, match="position is singular"):
            call(*case.build(0, mu_rho=mu_rho))
    without = rx.solve(*case.build(0))
    none = rx.solve(*case.build(0, mu_rho={"A0": "0"}))
    np.testing.assert_allclose(none.acceleration, without.acceleration, rtol=1e-14)


def test_friction_of_other_loads_is_right():
    case, mu_rho = CASES["with a pendulum"], {"P": "1/20"}
    system, state = case.build(0, mu_rho=mu_rho)
    found = rx.solve(system, state)
    acceleration, multipliers = case.solution(LIMIT, mu_rho=mu_rho)
    np.testing.assert_allclose(found.acceleration, acceleration, rtol=0, atol=1e-12 * np.max(np.abs(acceleration)))
    given = ~np.isnan(np.asarray(found.multipliers))
    assert set(np.array(system.rows.labels)[~given]) == set(case.lost)
    np.testing.assert_allclose(found.multipliers[given], multipliers[given], rtol=1e-9)
    assert rx.analyze(system, state).unique_accelerations


# Self-stress that lasts ----------------------------------------------------------------------


def test_closures_pick_the_loads_that_lasting_self_stress_leaves_open():
    case = CASES["with a rider on two pins"]
    system, state = case.build(0)
    labels, compliance = np.array(system.rows.labels), tuple(str(1 + k) for k in range(12))
    _, true = case.solution(LIMIT, compliance=exact.exact(compliance))
    found = rx.solve(system, state, closure=rx.Compliance(np.arange(1.0, 13.0)))
    given = ~np.isin(labels, case.lost)
    np.testing.assert_allclose(found.multipliers[given], true[given], rtol=0, atol=1e-9)
    assert np.isnan(found["A0 force x on body 1"])
    np.testing.assert_allclose(found["A0 force y on body 1"], -found["A0.y"])
    coupled = np.eye(12)
    coupled[np.ix_(labels == "A0.x", labels == "E.x")] = coupled[np.ix_(labels == "E.x", labels == "A0.x")] = 0.5
    lost = np.isnan(rx.solve(system, state, closure=rx.Compliance(coupled)).multipliers)
    assert set(labels[lost]) == {*case.lost, "E.x", "F.x"}


def test_reports_bands_and_families_leave_out_what_has_no_value():
    case = CASES["with a rider on two pins"]
    system, state = case.build(0)
    report, solution = rx.analyze(system, state), rx.solve(system, state)
    assert (report.redundancy, report.local_self_stress, len(report.self_stress)) == (2, 1, 1)
    assert set(report.undetermined) == set(case.lost)
    assert set(np.array(report.rows)[np.any(report.self_stress != 0, axis=0)]) == {"E.x", "F.x"}
    assert report.unique_accelerations and "velocity decides" in " ".join(str(report).split())
    told = {one.name: one.with_friction for group in report.verdicts.values() for one in group}
    assert {told[name] for name in report.undetermined} == {rx.Verdict.UNDECIDED}
    assert told["E.x"] is rx.Verdict.NOT_UNIQUE and told["A0.y"] is told["body 1.phi''"] is rx.Verdict.UNIQUE
    (pivot,) = report.pivots
    box, value = rx.AmplitudeBox({pivot: (-5.0, 5.0)}), float(solution.multipliers[report.rows.index(pivot)])
    bands = rx.band(system, state, [pivot, "A0.y", "body 1.phi''"], box)
    np.testing.assert_allclose([bands.lower[0], bands.upper[0]], [value - 5, value + 5], rtol=1e-12)
    np.testing.assert_allclose(bands.lower[1:], bands.upper[1:], rtol=1e-12)
    np.testing.assert_allclose(bands.lower[2], solution.acceleration[8], rtol=1e-12)
    with pytest.raises(rx.RedundaxError, match=r"A0\.x"):
        rx.band(system, state, "A0.x", box)
    with pytest.raises(rx.RedundaxError, match=r"A0\.x"):
        rx.band(system, state, pivot, rx.PreloadBox({"A0.x": (-5.0, 5.0)}))
    family = rx.solution_family(system, state, samples=3)
    lost = np.isin(report.rows, case.lost)
    assert np.all(np.isnan(family.multipliers) == lost)
    np.testing.assert_allclose(np.ptp(family.acceleration, axis=0), 0.0, atol=1e-12)


def test_without_lasting_self_stress_there_is_no_band():
    system, state = CASES["flat parallelogram"].build(0)
    with pytest.raises(rx.RedundaxError, match="all vanishes"):
        rx.band(system, state, None, rx.AmplitudeBox({"A0.x": (-1.0, 1.0)}))
    assert rx.analyze(system, state).verdicts["acceleration"][0].with_friction is rx.Verdict.UNIQUE


# Transformations -----------------------------------------------------------------------------


@pytest.mark.slow
def test_batches_studies_and_derivatives_refuse_it():
    case = CASES["flat parallelogram"]
    system, _ = case.build(0)
    states = [case.build(s)[1] for s in (0.3, 0, 0.7)]
    q, qd = (jnp.stack([getattr(state, name) for state in states]) for name in ("q", "qd"))

    def run(q, qd):
        return rx.solve(system, rx.State(q, qd))

    solution = jax.vmap(run)(q, qd)
    assert list(solution.result == R.successful) == [True, False, True]
    assert bool((solution.result == R.singular_position)[1])
    assert np.array_equal(np.isnan(solution.acceleration).any(axis=1), [False, True, False])
    slope = jax.vmap(jax.jacfwd(lambda qd, q: run(q, qd).acceleration))(qd, q)
    assert np.array_equal(np.isnan(slope).any(axis=(1, 2)), [False, True, False])
    gradient = jax.grad(lambda qd: jnp.nansum(jax.jit(jax.vmap(run))(q, qd).acceleration))(qd)
    assert np.all(np.isfinite(gradient))  # a bad sample leaves the gradient of its neighbours alone
    assert np.all(gradient[1] == 0)
    found = rx.study(run, {"q": q, "qd": qd}, system=system)
    assert np.array_equal(np.isnan(np.asarray(found["acceleration"])).any(axis=1), [False, True, False])
    with pytest.raises(rx.NoSolutionError, match="position is singular"):
        rx.simulate(system, states[1], 0.1)


def test_batches_over_closures_are_right_where_the_state_is_known():
    system, state = CASES["with a rider on two pins"].build(0)
    found = jax.vmap(lambda h: rx.solve(system, state, closure=rx.MinimumNorm(h)))(jnp.array([0.0, 3.0]))
    alone = rx.solve(system, state, closure=rx.MinimumNorm(3.0))
    np.testing.assert_allclose(found.acceleration[1], alone.acceleration, rtol=1e-12)
    np.testing.assert_allclose(found.multipliers[1], alone.multipliers, rtol=1e-12)


@pytest.mark.parametrize(
    "name",
    [
        "flat parallelogram",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("folding slider", "folding kite")),
    ],
)
def test_compiled_solves_beside_are_as_right_as_they_tell(name):
    case = CASES[name]
    solve = jax.jit(lambda system, q, qd: rx.solve(system, rx.State(q, qd)))
    for s in DISTANCES:
        system, state = case.build(s)
        solution = solve(system, state.q, state.qd)
        if solution.result != R.successful:
            assert s < 1e-9, f"refused at {s}: {rx.RESULTS[solution.result]}"
            continue
        true, _ = case.solution(s)
        told = 1e-15 * 10 ** float(solution.stats.lost_digits)
        assert np.max(np.abs(solution.acceleration - true)) <= (1e-9 + 10 * told) * np.max(np.abs(true)), f"at {s}"


def test_lost_digits_tell_how_near_it_is():
    case = CASES["flat parallelogram"]
    (system, near), (_, far) = (case.build(s, rate="1") for s in (1e-8, 0.5))
    assert 8.0 <= float(rx.solve(system, near).stats.lost_digits) <= 9.5
    assert float(rx.solve(system, far).stats.lost_digits) <= 2.0
    assert "NEAR A SINGULAR POSITION" in str(rx.analyze(system, near))
    assert "SINGULAR POSITION" not in str(rx.analyze(system, far))
