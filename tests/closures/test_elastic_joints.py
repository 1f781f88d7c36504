"""Compliance and misfit of joints in the frames of bodies, and misfits from geometry, against hand calculations."""

import equinox as eqx
import jax
import numpy as np
import pytest
from turning import rotation, turned

import redundax as rx

PHI, RATE, NEWTON = 0.6, 2.0, rx.Newton()


def seats(on_ground=()):
    """Unequal, coupled compliances on moving bodies, misfits of a tenth of a millimetre and a milliradian."""
    rng, out = np.random.default_rng(1), []
    for name, body in zip("ABCDKL", ("1", "2", "3", "3", "4", "2"), strict=True):
        root = rng.normal(size=(3, 3)) * np.array([1e-4, 1e-4, 1e-3])[:, None]
        C = root @ root.T
        misfit = np.array([1e-4, 1e-4, 1e-3]) * rng.normal(size=3)
        point = 0.05 * rng.normal(size=2)
        given = {"coupling": C[:2, 2], "misfit": misfit, "point": point}
        given["frame"] = rx.GROUND if name in on_ground else body
        out.append(rx.JointCompliance(name, C[:2, :2], C[2, 2], **given))
    return out


def solve(mechanism, state, joints, actual=None, **options):
    """Under one kind of closure and by one solver always, so that a mechanism is compiled once."""
    closure = rx.AsBuilt(rx.ElasticJoints(mechanism, joints), mechanism if actual is None else actual)
    return rx.solve(mechanism, state, closure=closure, solver=NEWTON, **options)


@pytest.fixture(scope="module")
def paper():
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    return mechanism, mechanism.state(phi=PHI, rate=RATE)


def test_axes_turned_with_the_mechanism_change_nothing(paper):
    """All of it with gravity, by any angle: the same loads in turned axes; not so where W keeps its x, y rows."""
    mechanism, state = paper
    other, there = turned(mechanism, state, 1.1)
    R = rotation(1.1)
    whole = np.kron(np.eye(4), R)
    one, two = solve(mechanism, state, seats()), solve(other, there, seats())
    left = [solve(*at, seats(on_ground="AD")) for at in ((mechanism, state), (other, there))]
    expected = np.concatenate([whole @ one.acceleration[:8], one.acceleration[8:]])
    loads = np.concatenate([whole @ one.multipliers[:8], one.multipliers[8:]])
    assert np.max(np.abs(two.acceleration - expected)) < 1e-12 * np.max(np.abs(expected))
    assert np.max(np.abs(two.multipliers - loads)) < 1e-12 * np.max(np.abs(loads))
    change = left[1].multipliers[:8] - whole @ left[0].multipliers[:8]
    assert np.max(np.abs(change)) > 1e-2 * np.max(np.abs(loads))


def test_compliance_of_the_rows_by_hand(paper):
    """R C R^T for a revolute, n^T C n and the coupling with the guide moment for a translational joint."""
    mechanism, state = paper
    shift, cross, turn = np.array([[3.0, 1.0], [1.0, 2.0]]) * 1e-8, np.array([2e-8, 1e-8]), 5e-7
    joints = [
        rx.JointCompliance("B", shift, turn, coupling=cross, misfit=(1e-4, 2e-4, 3e-3), frame="1"),
        rx.JointCompliance("L", shift, turn, coupling=cross, misfit=(1e-4, 2e-4, 3e-3)),
    ]
    W, d = map(np.asarray, rx.ElasticJoints(mechanism, joints).compliance(mechanism, state))
    row = {name: k for k, name in enumerate(mechanism.rows.labels)}
    B, L, R = [row["B.x"], row["B.y"]], [row["L.perpendicular"], row["L.angle"]], rotation(PHI)
    np.testing.assert_allclose(W[np.ix_(B, B)], R @ shift @ R.T, rtol=1e-14)
    np.testing.assert_allclose(d[B], R @ [1e-4, 2e-4], rtol=1e-14)
    n = np.array([0.0, 1.0])
    expected = [[n @ shift @ n, -(n @ cross)], [-(n @ cross), turn]]
    np.testing.assert_allclose(W[np.ix_(L, L)], expected, rtol=1e-14)
    np.testing.assert_allclose(d[L], [-2e-4, 3e-3], rtol=1e-14)
    rest = [k for k in range(12) if k not in B + L]
    assert not W[rest].any() and not d[rest].any() and not W[np.ix_(B, L)].any()


def test_a_compliance_may_be_given_about_any_point(paper):
    """Moment at another point = moment + arm x force: the same seat, so the same W and d."""
    mechanism, state = paper
    seat = next(seat for seat in seats() if seat.joint == "L")
    arm = np.array([0.3, -0.2])
    C = np.asarray(seat.compliance)
    shift = np.eye(3)
    shift[:2, 2] = [-arm[1], arm[0]]  # displacement at point + arm
    moved, misfit = shift @ C @ shift.T, shift @ np.asarray(seat.misfit)
    given = {"coupling": moved[:2, 2], "misfit": misfit, "frame": "2", "point": np.asarray(seat.point) + arm}
    other = rx.JointCompliance("L", moved[:2, :2], moved[2, 2], **given)
    values = [rx.ElasticJoints(mechanism, [x]).compliance(mechanism, state) for x in (seat, other)]
    for one, two in zip(*values, strict=True):
        np.testing.assert_allclose(two, one, atol=1e-14 * np.max(np.abs(one)))


def test_wrong_gauge_of_a_carriage_by_hand():
    """Two springs c1, c2 in series are stretched by the gap: force gap / (c1 + c2); its derivative by c1 too."""
    mechanism = rx.mechanisms.carriage(angle=0.4, force=(0.0, 0.0), gravity=0.0)
    state, c2, gap = mechanism.state(0.2), 3e-8, 1e-4

    def loads(c1):
        joints = [rx.JointCompliance("K1", c1, 1e-5, misfit=(0.0, gap, 0.0)), rx.JointCompliance("K2", c2, 1e-5)]
        return rx.solve(mechanism, state, closure=rx.ElasticJoints(mechanism, joints)).multipliers

    c1 = np.array([1e-8, 2e-8, 4e-8])
    values, slopes = jax.jit(jax.vmap(lambda c: jax.jvp(loads, (c,), (1.0,))))(c1)
    force = gap / (c1 + c2)
    for found, expected in ((values, force), (slopes, -force / (c1 + c2))):
        expected = expected[:, None] * [-1.0, 1.0, 0.0, 0.0]
        np.testing.assert_allclose(found, expected, atol=1e-11 * np.max(np.abs(expected)))


PINS, STEEL = 4e-8, 12e-6


def test_a_warm_crank_between_cold_ones_by_hand():
    """The middle one of three cranks pushes with l alpha dT / (3 c): two pins in each of forces (1/2, -1, 1/2).

    1/2 (2 c) (1/4 + 1 + 1/4) S^2 - S l alpha dT is least.
    """
    length, warmth = 0.5, 40.0
    mechanism = rx.mechanisms.parallelogram(crank=length, gravity=0.0)
    state = mechanism.state(phi=PHI)
    push = length * STEEL * warmth / (3 * PINS)
    axis = np.array([np.cos(PHI), np.sin(PHI)])
    expected = np.kron(np.array([0.5, -1, 0.5] * 2), push * axis)

    def loads(warmth, pins):
        joints = [rx.JointCompliance(f"{end}{c}", pins) for end in "AB" for c in (1, 2, 3)]
        found = solve(mechanism, state, joints, rx.heated(mechanism, {"crank 2": warmth}, STEEL)).multipliers
        return found, found

    (by_warmth, by_pins), found = jax.jit(jax.jacrev(loads, argnums=(0, 1), has_aux=True))(warmth, PINS)
    np.testing.assert_allclose(found, expected, atol=1e-10 * push)
    np.testing.assert_allclose(by_warmth, expected / warmth, atol=1e-9 * push / warmth)
    np.testing.assert_allclose(by_pins, -expected / PINS, atol=1e-9 * push / PINS)


def test_parts_all_warm_alike_fit_again():
    """Bodies and ground that grow together by the same share are only a larger mechanism: no load, at any closure."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.0, gravity=0.0)
    state = mechanism.state(phi=PHI)
    warm = rx.heated(mechanism, dict.fromkeys(("1", "2", "3", "4", "ground"), 50.0), STEEL)
    joints = [rx.JointCompliance(name, 1e-8, 1e-6) for name in "ABCDKL"]
    assert np.max(np.abs(solve(mechanism, state, joints, warm).multipliers)) < 1e-6
    one = rx.heated(mechanism, {"2": 50.0}, STEEL)
    assert np.max(np.abs(solve(mechanism, state, joints, one).multipliers)) > 100.0


def test_an_eccentric_hole_is_a_misfit_in_the_frame_of_its_body(paper):
    """A hole drilled beside its place in crank 1, as geometry and as a figure."""
    mechanism, state = paper
    hole = np.array([2e-5, -3e-5])
    k = mechanism.names.joints[0].index("B")
    point = mechanism.joints[0].element.point_j.at[k].add(hole)
    actual = eqx.tree_at(lambda m: m.joints[0].element.point_j, mechanism, point)
    compliant = [rx.JointCompliance(name, 1e-8, 1e-6) for name in "ACDKL"]
    B = {"translation": 1e-8, "rotation": 1e-6, "frame": "1"}
    one = solve(mechanism, state, [*compliant, rx.JointCompliance("B", **B, misfit=(*-hole, 0.0))])
    two = solve(mechanism, state, [*compliant, rx.JointCompliance("B", **B)], actual)
    np.testing.assert_allclose(two.multipliers, one.multipliers, rtol=1e-10)
    np.testing.assert_allclose(two.acceleration, one.acceleration, rtol=1e-10, atol=1e-10)
    d = rx.misfit(mechanism, actual, state)
    np.testing.assert_allclose(d[2:4], -rotation(PHI) @ hole, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("units", [rx.units.Units(length=1000.0, mass=0.001), rx.units.Units(angle=57.29577951308232)])
def test_figures_in_other_units(paper, units):
    mechanism, state = paper
    own = np.array([float(units.length)] * 2 + [float(units.angle)])
    converted = [
        rx.JointCompliance(
            seat.joint,
            C[:2, :2],
            C[2, 2],
            coupling=C[:2, 2],
            misfit=seat.misfit * own,
            frame=seat.frame,
            point=seat.point * own[0],
        )
        for seat in seats()
        for C in [seat.compliance * own[:, None] * own / units.energy]
    ]
    closure, other = rx.ElasticJoints(mechanism, seats()), rx.ElasticJoints(mechanism, converted, units)
    for one, two in zip(*(c.compliance(mechanism, state) for c in (closure, other)), strict=True):
        np.testing.assert_allclose(two, one, rtol=1e-12, atol=1e-16 * np.max(np.abs(one)))
    there = rx.solve(
        rx.units.in_units(mechanism, units),
        rx.units.state_in_units(state, mechanism, units),
        closure=rx.units.closure_in_units(closure),
        solver=NEWTON,
    )
    back, here = rx.units.solution_from_units(there, mechanism, units), solve(mechanism, state, seats())
    np.testing.assert_allclose(back.multipliers, here.multipliers, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(back.acceleration, here.acceleration, rtol=1e-11, atol=1e-12)


def test_joints_that_store_no_energy_or_do_not_exist_are_refused(paper):
    mechanism, state = paper
    for bad, words in (
        (lambda: rx.JointCompliance("A", -1e-8), "must not be negative"),
        (lambda: rx.JointCompliance("A", [[1.0, 2.0], [2.0, 1.0]]), "positive semidefinite"),
        (lambda: rx.JointCompliance("A", [1.0, 2.0, 3.0]), "`translation` of joint 'A'"),
        (lambda: rx.ElasticJoints(mechanism, [rx.JointCompliance("Z", 1e-8)]), "'Z'"),
        (lambda: rx.ElasticJoints(mechanism, {"A": (1e-8, 1e-8, 4e-8)}), "one compliance for 'A', or a pair"),
        (lambda: rx.ElasticJoints(mechanism, [rx.JointCompliance("A", 1e-8)] * 2), "twice"),
        (lambda: rx.ElasticJoints(mechanism, [rx.JointCompliance("A", 1e-8, frame="2")]), "`frame` of joint 'A'"),
        (lambda: rx.heated(mechanism, {"5": 1.0}, STEEL), "'5'"),
        (lambda: rx.misfit(mechanism, rx.mechanisms.carriage(), state), "`actual`"),
    ):
        with pytest.raises(rx.RedundaxError, match=words):
            bad()
    closure = rx.ElasticJoints(rx.mechanisms.parallelogram(), [])
    with pytest.raises(rx.RedundaxError, match="`closure` must be made with the mechanism"):
        rx.solve(mechanism, state, closure=closure)
    with pytest.raises(rx.RedundaxError, match="`closure` comes from"):
        rx.solve(mechanism, state, closure=rx.units.closure_in_units(rx.MinimumNorm()))
    rigid = solve(mechanism, state, [], throw=False)
    assert rigid.result == rx.RESULTS.indeterminate_closure


def test_joints_that_do_not_give_way_are_named():
    """Three pins of a plate hold it three times; one that gives way settles two of the states at most."""
    plates = [rx.Revolute(name, "a", "ground", point, point) for name, point in zip("PQR", np.eye(3, 2), strict=True)]
    mechanism = rx.Mechanism([rx.Body("a", 1.0, 1.0)], plates)
    rest = rx.State(np.zeros(3), np.zeros(3))
    with pytest.raises(rx.NoSolutionError) as caught:
        rx.solve(mechanism, rest, closure=rx.ElasticJoints(mechanism, {"P": 1e-8}))
    assert str(caught.value).endswith(" Rows in self-stress: P (x, y), Q (x, y), R (x, y).")
    assert rx.solve(mechanism, rest, closure=rx.ElasticJoints(mechanism, dict.fromkeys("PQR", 1e-8)))["P.x"] == 0.0


def test_figures_in_wrong_units_are_told():
    mechanism = rx.mechanisms.carriage()
    joints = [rx.JointCompliance(name, 1e-5, 1e-9) for name in ("K1", "K2")]  # mm/N and rad/(N mm)
    with pytest.warns(UserWarning, match=r"`W` looks .*length=1000.0, mass=0.001"):
        rx.solve(mechanism, mechanism.state(0.2), closure=rx.ElasticJoints(mechanism, joints))
