"""Verdicts: what is called unique is so along the whole family, and what is called not unique moves.

The oracle are solutions far along random self-stress states, found without `analyze`.
"""

import functools
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mechanisms import CASES, MORE

import redundax as rx
from redundax._analysis._release import releases
from redundax._bodies._reactions import joint_outputs

UNIQUE, ZERO, NO_CHANGE, NOT_UNIQUE, UNDECIDED = rx.Verdict


@functools.cache
def report(name, friction) -> rx.types.Report:
    case = CASES[name]
    return rx.analyze(case.rubbing if friction else case.smooth, case.state)


def family(system, state, stress, count=12):
    """Solutions [qdd, lam, tau] for random misfits along the self-stress states, a row each; failed ones left out."""
    rng = np.random.default_rng(20)
    base = rx.solve(system, state)
    n = len(system.coordinates)
    size = np.max(np.abs(base.multipliers)) / np.max(np.abs(stress), initial=1.0)
    h = np.zeros((count, n + len(system.rows)))
    h[1:, n:] = size * rng.normal(size=(count - 1, len(stress))) * 10 ** rng.uniform(-1, 1, (count - 1, 1)) @ stress
    found = jax.jit(jax.vmap(lambda h: rx.solve(system, state, closure=rx.MinimumNorm(h))))(jnp.asarray(h))
    values = np.concatenate([found.acceleration, found.multipliers, found.friction], axis=1)
    return values[~np.isnan(values).any(axis=1)]


def kinds(system) -> np.ndarray:
    slips = [kind for group in system.friction for kind in group.slips.kinds]
    return np.array([*system.coordinates.kinds, *system.rows.kinds, *(f"friction {kind}" for kind in slips)])


@pytest.mark.parametrize("name", [name for name in CASES if name not in MORE])
@pytest.mark.parametrize("friction", [False, True])
@pytest.mark.slow
def test_no_wrong_verdict_along_the_family(name, friction):
    case = CASES[name]
    system, found = case.rubbing if friction else case.smooth, report(name, friction)
    values, kind = family(system, case.state, found.self_stress), kinds(system)
    assert len(values) > 1
    judged = [j for what in ("acceleration", "multiplier", "friction") for j in found.verdicts[what]]
    assert len(judged) == values.shape[1]
    for k, each in enumerate(judged):
        size = np.max(np.abs(values[:, kind == kind[k]]))
        spread = np.ptp(values[:, k]) / max(size, 1e-6 * np.max(np.abs(values)))  # a kind may be all zeros
        verdict = each.with_friction if friction else each.without_friction
        if verdict is UNIQUE:
            assert spread <= 1e-9, each
            assert each.moved_by == ()
        elif verdict is NOT_UNIQUE:
            assert spread > 1e-7, each
            assert each.moved_by
        elif verdict is UNDECIDED:
            assert found.spectral_radius >= 1, each


def test_the_paper_s_mechanism():
    """Section 5: the self-stress, K and L perpendicular unique without friction; with friction next to nothing."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    found = rx.analyze(mechanism, mechanism.state(phi=np.pi / 4, rate=1.0))
    np.testing.assert_allclose(found.self_stress, [[1, 1, 1, 1, 1, 1, -1, -1, 0, 0, 0.8, -0.8]], atol=1e-13)
    unique = {j.name for j in found.verdicts["multiplier"] if j.without_friction is UNIQUE}
    assert unique == {"K.perpendicular", "L.perpendicular"}
    assert {j.name for j in found.verdicts["acceleration"] if j.with_friction is UNIQUE} == {
        "4.x''",
        "2.phi''",
        "4.phi''",
    }
    assert all(j.with_friction is NOT_UNIQUE for j in found.verdicts["friction"])
    reactions = {j.name: j for j in found.verdicts["reaction"]}
    assert reactions["A moment on 1"].with_friction is ZERO
    assert reactions["K force y on 4"].with_friction is ZERO
    assert reactions["A force x on 1"].without_friction is NOT_UNIQUE
    assert found.spectral_radius < 1
    state = mechanism.state(phi=np.pi / 4, rate=1.0)
    found = rx.analyze(mechanism, rx.State(state.q.at[9].set(4e-33), state.qd))  # rounding turns the coupler
    assert all(j.with_friction is ZERO for j in found.verdicts["reaction"] if j.name == "B moment on 2")


@pytest.mark.parametrize("ground_first", [False, True])
def test_a_coupling_with_the_ground_gives_its_moment_to_either_body(ground_first):
    """A wheel that a coupling holds against a moment of 3 N m bears -3 N m from it, whatever the ratio of the rates."""
    ends = ("ground", "wheel") if ground_first else ("wheel", "ground")
    joints = [rx.Revolute("pin", "wheel", "ground", (0, 0), (0, 0)), rx.AngleCoupling("mesh", *ends, ratio=2.5)]
    mechanism = rx.Mechanism([rx.Body("wheel", 2.0, 0.5)], joints, loads=[rx.AppliedForce("wheel", moment=3.0)])
    state = rx.State(np.zeros(3), np.zeros(3))
    names, wrenches = joint_outputs(mechanism, state)
    borne = wrenches[names.index("mesh moment on wheel")] @ rx.solve(mechanism, state).multipliers
    assert borne == pytest.approx(-3.0, rel=1e-12)


@pytest.mark.parametrize("kind", [rx.Revolute, rx.Translational, rx.PinInSlot, rx.Fixed])
def test_a_body_bears_the_virtual_work_of_its_joint_on_either_side(kind):
    """Force and moment of a joint to the ground do the work of -lam . Phi for any displacement of the body."""
    rng = np.random.default_rng(7)
    place, point, line = rng.normal(size=3), rng.normal(size=2), {"normal": (0.6, 0.8)}
    for ends in (("ground", "a"), ("a", "ground")):
        own = {"point_i": rng.normal(size=2), "point_j": rng.normal(size=2)}
        own["point_i" if ends[0] == "a" else "point_j"] = point
        joint = kind("J", *ends, **own, **(line if kind in (rx.Translational, rx.PinInSlot) else {}))
        mechanism = rx.Mechanism([rx.Body("a", 1.0, 1.0)], [joint])
        lam, step, zero = rng.normal(size=len(mechanism.rows)), 1e-6 * jnp.eye(3), jnp.zeros(())
        work = [lam @ (mechanism.constraint(place - d, zero) - mechanism.constraint(place + d, zero)) for d in step]
        _, wrenches = joint_outputs(mechanism, rx.State(place, np.zeros(3)))
        *force, moment = wrenches @ lam
        c, s = np.cos(place[2]), np.sin(place[2])
        arm = np.array([[c, -s], [s, c]]) @ point
        about_centre = moment + arm[0] * force[1] - arm[1] * force[0]
        np.testing.assert_allclose([*force, about_centre], np.array(work) / 2e-6, rtol=0, atol=1e-8)


def test_an_extremum_is_not_unique():
    """The crank's acceleration has an extremum along the family: its derivative is zero there, but it varies."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    state = mechanism.state(phi=np.pi / 4, rate=1.0)
    stress = jnp.array([1.0, 1, 1, 1, 1, 1, -1, -1, 0, 0, 0.8, -0.8])

    def crank(z):
        h = jnp.concatenate([jnp.zeros(12), z * stress])
        return rx.solve(mechanism, state, closure=rx.MinimumNorm(h)).acceleration[8]

    slope = jax.jit(jax.grad(crank))
    z = np.linspace(-400, 400, 81)
    signs = np.sign([float(slope(x)) for x in z])
    low = int(np.flatnonzero(np.diff(signs))[0])
    a, b = z[low], z[low + 1]
    for _ in range(60):
        middle = 0.5 * (a + b)
        a, b = (middle, b) if np.sign(float(slope(middle))) == signs[low] else (a, middle)
    closure = rx.MinimumNorm(jnp.concatenate([jnp.zeros(12), 0.5 * (a + b) * stress]))
    found = {j.name: j for j in rx.analyze(mechanism, state, closure=closure).verdicts["acceleration"]}
    assert found["1.phi''"].with_friction is NOT_UNIQUE
    assert found["1.phi''"].without_friction is UNIQUE


@pytest.mark.slow
def test_nothing_redundant_is_not_enough():
    """k = 0: with little friction all is unique; with much it is undecided, as there can be several solutions."""
    case = CASES["slider-crank"]
    arguments = case.arguments(friction=True)
    assert report("slider-crank", True).redundancy == 0
    said = {j.with_friction for kind in report("slider-crank", True).verdicts.values() for j in kind}
    assert said == {UNIQUE, ZERO}
    strong = {key: 40 * np.asarray(value) if key.startswith("mu") else value for key, value in arguments.items()}
    found = rx.analyze(case.make(**strong), case.state)
    assert found.spectral_radius > 1
    assert {j.with_friction for j in found.verdicts["friction"]} <= {UNDECIDED}


def test_drives_that_fight_do_not_move_the_motion():
    """Redundant driving: the motion is prescribed, so that no friction can change it, but drive moments are free."""
    found = report("driven twice", True)
    assert found.freedom == 0 and found.redundancy > 0
    assert all(j.with_friction is UNIQUE for j in found.verdicts["acceleration"])
    assert any(j.with_friction is NOT_UNIQUE for j in found.verdicts["multiplier"])


def test_accelerations_that_nothing_determines():
    """A massless bead on a wire beside one with mass: only the massless one is not unique."""
    system = rx.System(lambda q, t, p: jnp.array([q[1], q[3]]), mass=jnp.array([1.0, 1.0, 0.0, 0.0]))
    state = rx.State(q=jnp.zeros(4), qd=jnp.zeros(4))
    found = rx.analyze(system, state)
    assert found.problem and found.verdicts == {}


def test_at_rest_nothing_is_decided():
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    found = rx.analyze(mechanism, mechanism.state(phi=0.7, rate=0.0))
    assert {j.with_friction for j in found.verdicts["friction"]} == {UNDECIDED}
    assert found.at_rest
    assert "at rest" in str(found) and "proved: spectral" not in str(found)
    assert found.verdicts["acceleration"][0].with_friction is UNDECIDED
    assert found.verdicts["acceleration"][0].without_friction is UNIQUE


@pytest.mark.slow
def test_a_carriage_that_cannot_turn_does_not():
    """Its angular acceleration is rounding, however it compares with other rounding."""
    mechanism = rx.mechanisms.carriage(
        angle=0.4, offset=0.3, mu=0.1, guide_length=0.2, force=(10.0, 3.0), at=(0.1, 0.2)
    )
    found = rx.analyze(mechanism, mechanism.state(0.1, rate=1.0)).verdicts["acceleration"]
    assert [judged.with_friction for judged in found] == [NOT_UNIQUE, NOT_UNIQUE, UNIQUE]


SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("three cranks", "slider-crank, three guides")]


@pytest.mark.slow
def test_at_rest_friction_without_load_is_undecided_too():
    body = rx.Body("bead", 1.0, 1.0)
    guide = rx.Translational(
        "G", "bead", rx.GROUND, (0, 0), (0, 0), (0, 1), guide_length=0.1, friction=rx.ConstantFriction(2.0)
    )
    mechanism = rx.Mechanism([body], [guide])
    for rate, verdict in ((1.0, UNIQUE), (0.0, UNDECIDED)):
        found = rx.analyze(mechanism, rx.State(jnp.zeros(3), jnp.array([rate, 0.0, 0.0])))
        assert found.verdicts["friction"][0].with_friction is verdict
        assert found.verdicts["acceleration"][0].with_friction is verdict
        assert found.verdicts["acceleration"][1].with_friction is UNIQUE


@pytest.mark.parametrize("name", ["wojtyra2020", "carriage", *SLOW])
def test_released_directions_leave_no_redundancy_and_the_rank(name):
    case, found = CASES[name], report(name, False)
    jacobian = np.asarray(rx.factorize(case.smooth, case.state).jacobian)
    assert found.releases
    for release in found.releases:
        assert 0 < release.determinant <= 1 + 1e-12
        kept, rows = jacobian, list(case.smooth.rows.labels)
        remove = np.zeros((len(release.directions), len(rows)))
        for k, (joint, shares) in enumerate(release.directions):
            for row, share in shares.items():
                assert row.startswith(f"{joint}.")
                remove[k, rows.index(row)] = share
        # rows that stay: combinations of rows that are orthogonal to what is released
        stay = np.linalg.svd(remove)[2][len(remove) :]
        assert np.linalg.matrix_rank(stay @ kept, tol=1e-9) == case.rank == len(stay)


def test_few_releases_are_listed_by_their_rows():
    """Of three equal guides two have to give way to the side and two to turns: 6 of these 9 choices, all as good, those
    in two guides first.

    |det N_S| is the product of the two for sides and turns, each 1/sqrt(3).
    """
    guides = [rx.Translational(name, "slide", "ground", (0, 0), (0, 0), (0, 1)) for name in "GKL"]
    mechanism = rx.Mechanism([rx.Body("slide", 1.0, 1.0)], guides)
    found = rx.analyze(mechanism, rx.State(np.zeros(3), np.zeros(3))).releases
    pairs = list(itertools.combinations("GKL", 2))
    choices = [
        {*(f"{name}.perpendicular" for name in sides), *(f"{name}.angle" for name in turns)}
        for sides in pairs
        for turns in pairs
    ]
    rows = [{row for _, shares in release.directions for row in shares} for release in found]
    assert len(rows) == 6 and all(each in choices for each in rows)
    assert {str(release) for release in found[:3]} == {
        f"{one} (perpendicular, angle) and {other} (perpendicular, angle): 0.333" for one, other in pairs
    }
    assert [release.determinant for release in found] == pytest.approx([1 / 3] * 6, rel=1e-9)


def test_dependent_rows_follow_from_the_others():
    found, case = report("wojtyra2020", True), CASES["wojtyra2020"]
    jacobian = np.asarray(rx.factorize(case.smooth, case.state).jacobian)
    place = {name: k for k, name in enumerate(found.rows)}
    for row, eta in found.dependencies():
        made = sum(share * jacobian[place[name]] for name, share in eta.items())
        np.testing.assert_allclose(made, jacobian[place[row]], atol=1e-12)
    assert found.groups == (tuple(row for row in found.rows if row not in found.unique_multipliers),)


@pytest.mark.parametrize(
    "name", ["carriage", *(pytest.param(name, marks=pytest.mark.slow) for name in ("wojtyra2020", "three cranks"))]
)
def test_what_depends_on_the_unit_of_length(name):
    """Minimum norm in metres and in millimetres: the rows that change are those that the report names."""
    case, found = CASES[name], report(name, name == "wojtyra2020")
    values = [
        np.asarray(rx.solve(case.smooth, case.state, closure=rx.MinimumNorm(units=unit)).multipliers)
        for unit in (rx.units.Units(), rx.units.Units(length=1e3))
    ]
    changed = np.abs(values[0] - values[1]) > 1e-9 * np.max(np.abs(values[0]))
    assert {row for row, changes in zip(found.rows, changed, strict=True) if changes} <= set(found.unit_dependent)
    assert bool(found.unit_dependent) == bool(changed.any())


def test_report_is_data():
    data = report("wojtyra2020", True).to_dict()
    assert data["verdicts"]["friction"][0]["with_friction"] == "not unique"
    assert data["releases"][0]["determinant"] > 0
    report("wojtyra2020", True).to_json()


def test_releases_of_many_are_found_by_exchange():
    """24 parallel rods carry a plate: 8 of 24 rows with generic directions would be 735,471 choices. What is found is a
    determinant that no single exchange enlarges, and near the largest of random choices."""
    generator = np.random.default_rng(4)
    basis = np.linalg.qr(generator.normal(size=(24, 8)))[0]
    rows = tuple(f"rod {k}.distance" for k in range(24))
    found = releases(basis, rows, ("force",) * 24, by_row=True)
    picked = [sorted(rows.index(row) for _, shares in release.directions for row in shares) for release in found]
    sizes = [abs(np.linalg.det(basis[pick])) for pick in picked]
    np.testing.assert_allclose([release.determinant for release in found], sizes, rtol=1e-9)
    tried = max(abs(np.linalg.det(basis[generator.choice(24, 8, replace=False)])) for _ in range(20000))
    assert sizes[0] >= max(sizes) * (1 - 1e-9) and sizes[0] > tried
    for place in range(8):
        for other in set(range(24)) - set(picked[0]):
            exchanged = [other if k == place else row for k, row in enumerate(picked[0])]
            assert abs(np.linalg.det(basis[exchanged])) <= sizes[0] * (1 + 1e-6)
