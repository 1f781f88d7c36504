"""Assembly on points of few digits: the rank of the exact points, accelerations near theirs, and the misfit told."""

import itertools
import re
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

DIGITS = (16, 12, 10, 8, 6)
MASS, CRANK_MASS, CRANK_INERTIA, GRAVITY = 2.0, 0.5, 0.01, 9.81


def turned(angle, point):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1]])


def plate(digits, angle, twist, crank, along, shift=0.0):
    """A plate on parallel cranks, given in turned frames so that no point is a short number; its exact position.

    The plate only shifts, so that the energy gives phi'' in closed form. The last pivot can be beside its place.
    """
    ends = [turned(twist, (x, 0.1 * (-1) ** k)) for k, x in enumerate(along)]
    pivots = [turned(angle, end) for end in ends]

    def typed(point):
        return tuple(np.round(point, digits))

    bodies, joints = [rx.Body("plate", MASS, 0.2)], []
    misplaced = [*pivots[:-1], pivots[-1] + np.array([shift, 0.0])]
    for k, (end, pivot) in enumerate(zip(ends, misplaced, strict=True)):
        bodies.append(rx.Body(f"c{k}", CRANK_MASS, CRANK_INERTIA))
        joints += [
            rx.Revolute(f"G{k}", f"c{k}", "ground", typed((-crank / 2, 0.0)), typed(pivot)),
            rx.Revolute(f"P{k}", "plate", f"c{k}", typed(end), typed((crank / 2, 0.0))),
        ]

    def position(phi):
        u = turned(phi, (crank, 0.0))
        return np.r_[u, *(pivot + u / 2 for pivot in pivots), angle, [phi] * len(pivots)]

    return rx.Mechanism(bodies, joints, gravity=(0.0, -GRAVITY)), position


def crank_acceleration(phi, crank, cranks):
    inertia = MASS * crank**2 + cranks * (CRANK_INERTIA + CRANK_MASS * crank**2 / 4)
    return -GRAVITY * (MASS + cranks * CRANK_MASS / 2) * crank * np.cos(phi) / inertia


PLATES = {
    "three cranks": (0.3, 0.0, 0.3, (0.0, 0.5, 1.2)),
    "three cranks, turned": (-1.1, 0.7, 0.45, (0.1, 0.6, 1.7)),
    "four cranks": (2.0, -0.4, 0.37, (0.0, 0.4, 1.1, 1.6)),
}


SPARSE = [pytest.param(case, d, True, marks=pytest.mark.slow) for case in PLATES for d in (16, 6)]
SPARSE[1] = ("three cranks", 6, True)


@pytest.mark.parametrize(("case", "digits", "sparse"), [*itertools.product(PLATES, DIGITS, [False]), *SPARSE])
def test_points_of_few_digits_keep_rank_and_accelerations(case, digits, sparse):
    mechanism, position = plate(digits, *PLATES[case])
    cranks, phi = len(PLATES[case][3]), 1.0
    guess = position(phi) + 0.02 * np.sin(3.0 * np.arange(position(phi).size))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        state = rx.assemble(mechanism.sparse(sparse), guess, positions={"c0.phi": phi}, rates={"c0.phi": 1.0})
    solution = rx.solve(mechanism, state)
    assert int(solution.stats.spectrum.rank) == 3 * cranks + 2
    unit = 10.0 ** (3 - digits) + 1e-12
    assert np.abs(state.q - position(phi)).max() < unit
    truth = crank_acceleration(phi, PLATES[case][2], cranks)
    assert np.abs(solution.acceleration[-cranks:] - truth).max() < abs(truth) * unit
    assert bool(told) == (float(solution.stats.violation.position) > 1e-12)
    if digits <= 8:
        assert "cannot be met exactly" in str(told[0].message)


@pytest.mark.parametrize(
    ("seed", "cases", "sparse"),
    [(3, 30, False), *(pytest.param(0, *case, marks=pytest.mark.slow) for case in ((1600, False), (1000, True)))],
)
def test_no_rank_is_one_too_high_where_rounded_points_close_at_an_isolated_position(seed, cases, sparse):
    """The rounding of the points is all that the last of twelve constraints says there, and their misfit is zero."""
    rng, successful, closed = np.random.default_rng(seed), 0, 0
    for case in range(cases):
        digits, along = int(rng.integers(5, 11)), np.sort(rng.uniform(0, 2, 3))
        turns, crank, phi = rng.uniform(-3, 3, 2), rng.uniform(0.1, 0.6), rng.uniform(-3, 3)
        mechanism, position = plate(digits, *turns, crank, tuple(along))
        mechanism = mechanism.sparse(sparse)
        guess = position(phi) + 0.02 * rng.standard_normal(12)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            held = {"c0.phi": phi} if case % 2 else None
            state = rx.assemble(mechanism, guess, rng.standard_normal(12), positions=held, throw=False)
        solution = rx.solve(mechanism, state, throw=False)
        rank, good = int(solution.stats.spectrum.rank), solution.result == rx.RESULTS.successful
        assert rank == 11 or not good
        successful += bool(good)
        closed += rank == 12 and float(solution.stats.violation.position) < 1e-12
    assert successful > 0.8 * cases
    assert closed > 0.002 * cases or sparse


@pytest.mark.parametrize("apart", [1e-3, 1e-6])
def test_pins_that_all_but_meet_are_told_from_points_of_few_digits_by_a_declared_rank(apart):
    """A short link between two pins `apart`, beside a long one: what holds it still could be rounding."""
    joints = [
        rx.Revolute(f"{body}{k}", body, "ground", (x, 0.0), (x, 0.0))
        for body, length in (("long", 1.0), ("short", apart))
        for k, x in enumerate((0.5, 0.5 + length))
    ]
    mechanism = rx.Mechanism([rx.Body("long", 1.0, 1.0), rx.Body("short", 1.0, 1.0)], joints)
    state = rx.State(np.zeros(6), np.zeros(6))
    found = rx.solve(mechanism, state, throw=False)
    assert int(found.stats.spectrum.rank) == 6
    assert found.result == (rx.RESULTS.successful if apart > 1e-4 else rx.RESULTS.ambiguous_rank)
    declared = rx.solve(mechanism, state, rank=6)
    np.testing.assert_allclose(declared.acceleration, 0.0, atol=1e-12)


@pytest.mark.parametrize("digits", DIGITS)
def test_guides_of_few_digits(digits):
    """A carriage on two parallel guides slides by -g sin(slope); two of four rows are redundant, a moment too."""
    slope, angle = 0.37, np.pi / 7
    normal = tuple(np.round(turned(slope, (0.0, 1.0)), digits))

    def guide(name, x, y):
        end = turned(0.5, (x, y))
        points = np.round(end, digits), np.round(turned(angle, end) + turned(slope, (0.3, 0.0)), digits)
        return rx.Translational(name, "a", "ground", *points, normal, np.round(angle, digits))

    mechanism = rx.Mechanism(
        [rx.Body("a", 2.0, 0.3)], [guide("A", -0.4, 0.1), guide("B", 0.7, 0.2)], gravity=(0, -GRAVITY)
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        state = rx.assemble(mechanism, [0.31, 0.09, angle + 0.01], [1.0, 0.0, 0.0])
    solution = rx.solve(mechanism, state)
    assert int(solution.stats.spectrum.rank) == 2
    sliding = -GRAVITY * np.sin(slope) * np.array([np.cos(slope), np.sin(slope), 0.0])
    np.testing.assert_allclose(solution.acceleration, sliding, rtol=0, atol=10.0 ** (2 - digits) + 1e-12)


@pytest.mark.parametrize("skew", [False, True])
def test_bodies_without_load_in_two_guides_slide_or_stand(skew):
    """Nothing accelerates them, and of the guessed velocity skew guides leave nothing, not even its rounding."""
    rng = np.random.default_rng(skew)
    for _ in range(12):
        place, angle, ends = rng.normal(size=2), rng.normal(), rng.normal(size=(2, 2))
        first = rng.normal(size=2)
        normals = first, turned(rng.uniform(0.1, 3.0), first) if skew else first
        guides = [
            rx.Translational(name, "a", "ground", end, place + turned(angle, end), tuple(normal), angle)
            for name, end, normal in zip("KL", ends, normals, strict=True)
        ]
        mechanism = rx.Mechanism([rx.Body("a", 2.0, 0.3)], guides)
        state = rx.assemble(mechanism, [*place, angle], rng.normal(size=3))
        solution = rx.solve(mechanism, state)
        bent = float(np.max(np.abs(state.qd))) ** 2 * 1e-13
        assert np.abs(solution.acceleration).max() <= bent
        assert np.abs(solution.multipliers).max() <= 100 * bent
        assert np.any(state.qd) != skew


def test_misfit_is_told_by_size_and_joint():
    gap = 1e-7  # m
    mechanism, position = plate(16, *PLATES["three cranks"], shift=gap)
    with pytest.warns(UserWarning, match="nearest position misses") as told:
        state = rx.assemble(mechanism, position(1.0), rates={"c0.phi": 1.0})
    misfit = np.abs(mechanism.constraint(state.q, state.t))
    assert gap / 20 < misfit.max() < gap
    row, size = re.search(r"misses (\S+) by (\S+) in its unit", str(told[0].message)).groups()
    assert size == f"{misfit[mechanism.rows.labels.index(row)]:.2g}"
    solution = rx.solve(mechanism, state)
    np.testing.assert_allclose(solution.acceleration[-3:], crank_acceleration(1.0, 0.3, 3), rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("sparse", [False, True])
def test_derivatives_and_batches_on_points_of_few_digits(sparse):
    """Each centre moves by half the crank's end, or all of it; the plate does not turn."""
    mechanism, position = plate(8, *PLATES["three cranks, turned"])
    mechanism = mechanism.sparse(sparse)

    def assembled(phi):
        return rx.assemble(mechanism, position(1.0), positions={"c0.phi": phi}).q

    step = 1e-5
    truth = (position(1.0 + step) - position(1.0 - step)) / (2 * step)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for derivative in (jax.jacfwd, jax.jacrev):
            np.testing.assert_allclose(derivative(assembled)(1.0), truth, rtol=0, atol=1e-6)
    phis = np.array([0.9, 1.0, 1.1])
    np.testing.assert_allclose(jax.jit(jax.vmap(assembled))(phis), [position(phi) for phi in phis], rtol=0, atol=1e-6)


@pytest.mark.parametrize("gap", [1e-4, 1e-2])
@pytest.mark.parametrize("sparse", [False, True])
def test_parts_that_do_not_fit_are_refused(gap, sparse):
    """A plate on three cranks, one of which is held, with a pivot beside its place."""
    mechanism, position = plate(16, *PLATES["three cranks"], gap)
    given = mechanism.sparse(sparse), position(1.0)
    held = {"positions": {"c0.phi": 1.0}, "rates": {"c0.phi": 1.0}}
    with pytest.raises(rx.NoSolutionError, match="No position"):
        rx.assemble(*given, **held)
    assert np.isnan(rx.assemble(*given, **held, throw=False).q).all()


def test_arms_that_are_rounding_are_no_length_of_a_mechanism():
    """Two wheels on one pin through their centres, one off by rounding: their length is their radius of gyration."""
    one, two = (rx.spatial.Body(name, 2.0, (0.1, 0.1, 0.2)) for name in ("one", "two"))
    joints = [rx.spatial.Revolute(i.name, i, j, (0, 0, 0)) for i, j in ((one, "ground"), (two, one))]
    mechanism = rx.Mechanism([one, two], joints)
    for shift in (0.0, 1e-17):
        state = rx.State(mechanism.reference.at[0].set(shift), np.zeros(12))
        np.testing.assert_allclose(rx.factorize(mechanism, state).length, np.sqrt(0.8 / 12.0), rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("sparse", [False, True])
def test_bodies_in_space_turn_by_half_a_turn_and_more(sparse):
    """Angles beyond what one displacement reaches, at either side of half a turn and given by whole turns more; the
    quaternion is (cos, 0, 0, sin) of half the angle, and moves with it."""
    one, two = (rx.spatial.Body(name, 1.0, (0.1, 0.1, 0.2), position=(x, 0, 0)) for name, x in (("a", 0), ("b", 1)))
    joints = [rx.spatial.Revolute(body.name, body, "ground", body.position) for body in (one, two)]
    train = rx.Mechanism([one, two], joints, couplers=[rx.Coupler("c", "a.angle", "b.angle", 2.0)])
    train = train.sparse(sparse)

    def turned(angle):
        return rx.assemble(train, positions={"b.angle": angle}).q[6:].reshape(2, 4)

    for angle in (1.5, 1.6, 2.9, -2.5, 4.0):
        for p, expected in zip(turned(angle), (2 * angle, angle), strict=True):
            wanted = np.array([np.cos(expected / 2), 0, 0, np.sin(expected / 2)])
            np.testing.assert_allclose(np.abs(p @ wanted), 1.0, rtol=1e-13)
            np.testing.assert_allclose(np.outer(p, p), np.outer(wanted, wanted), atol=1e-12)
    p, rate = jax.jvp(turned, (2.9,), (1.0,))
    for k, speed in enumerate((2.0, 1.0)):
        np.testing.assert_allclose(rate[k], speed / 2 * np.array([-p[k, 3], 0, 0, p[k, 0]]), atol=1e-10)


@pytest.mark.parametrize("sparse", [False, True])
def test_guesses_of_single_precision_take_that_of_the_mechanism(sparse):
    mechanism, position = plate(16, *PLATES["three cranks"])
    mechanism, guess = mechanism.sparse(sparse), np.asarray(position(1.0), np.float32)
    held = {"positions": {"c0.phi": 1.0}, "rates": {"c0.phi": 1.0}}
    found = rx.assemble(mechanism, guess, np.zeros(12, np.float32), **held)
    assert found.q.dtype == found.qd.dtype == np.float64
    assert np.abs(mechanism.constraint(found.q, found.t)).max() < 1e-14


def test_rows_without_a_value_at_the_guess_are_named():
    """A hinge whose axes are opposite has no tilt; that at its own place and the others are not blamed."""
    wheel, at = rx.spatial.Body("wheel", 1.0, (0.1, 0.1, 0.2)), rx.spatial.Placement
    ends = {"on_i": at((0, 0, 0), (0, 0, -1)), "on_j": at((0, 0, 0))}
    mechanism = rx.Mechanism([wheel], [rx.spatial.Revolute("A", "wheel", "ground", **ends)])
    with pytest.raises(rx.NoSolutionError, match=r"no value at the guess: A.bend_1, A.bend_2\. Give another guess"):
        rx.assemble(mechanism)


@pytest.mark.slow
def test_a_machine_in_space_that_is_drawn_elsewhere_is_assembled_there():
    """The derivative of the position is that of the reference pose where this is closed, not the smallest way to it."""

    def position(x):
        rod = rx.spatial.Body(
            "rod", 1.0, (0.1, 0.1, 0.1), position=jnp.stack([x, 0.0 * x, 0.0 * x]), centre=(0.0, 0.5, 0.0)
        )
        pin = rx.spatial.Revolute("A", rod, "ground", point=jnp.stack([x, 0.0 * x, 0.0 * x]), axis=(0.0, 0.0, 1.0))
        return rx.assemble(rx.Mechanism([rod], [pin]), throw=False).q

    q, slope = jax.jvp(position, (jnp.asarray(0.3),), (jnp.asarray(1.0),))
    np.testing.assert_allclose(q, [0.3, 0.5, 0, 1, 0, 0, 0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(slope, [1, 0, 0, 0, 0, 0, 0], rtol=0, atol=1e-12)
