"""Bands against 50 digits, brute force and dense sweeps.

A band must hold every value that a sweep finds, and its ends must be attained by a solution within the bounds.
"""

import itertools
import json
from functools import cache

import jax
import jax.numpy as jnp
import literal
import numpy as np
import pytest
from truth import bands as truth
from truth import exact, scenes

import redundax as rx

STRESS = (1, 1, 1, 1, 1, 1, -1, -1, 0, 0, "4/5", "-4/5")
COMPLIANCE = [1e-8] * 10 + [1e-6] * 2
CARRIAGE = {"offset": 0.1, "mu": 0.05, "guide_length": 0.1}


@cache
def paper(mu_rho=None):
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    return mechanism, mechanism.state(phi=np.pi / 4, rate=1.0)


@cache
def carriage(**parameters):
    mechanism = rx.mechanisms.carriage(**{**CARRIAGE, **parameters})
    return mechanism, mechanism.state(0.0, rate=1.0)


def whole(solution):
    return jnp.concatenate([solution.acceleration, solution.multipliers, solution.friction])


def sweep(system, state, closures):
    """[qdd; lam; tau] under a batch of closures."""
    run = jax.jit(jax.vmap(lambda closure: whole(rx.solve(system, state, closure=closure))))
    return np.asarray(run(closures))


def along(system, state, stress, z):
    """Solutions at amplitudes z (b, k)."""
    h = np.concatenate([np.zeros((len(z), state.qd.size)), z @ stress], axis=1)
    return sweep(system, state, rx.MinimumNorm(jnp.asarray(h)))


def holds(bands, values, near=0.0):
    """Whether the bands hold the values (b, outputs), and reach no farther than `near` of their spread beyond."""
    spread, rounding = np.ptp(values, axis=0), 1e-12 * np.abs(values).max()
    least, largest = values.min(axis=0), values.max(axis=0)
    assert np.all(bands.lower <= least + 1e-9 * spread + rounding), (bands.lower - least) / spread
    assert np.all(bands.upper >= largest - 1e-9 * spread - rounding), (bands.upper - largest) / spread
    assert np.all(bands.lower >= least - near * spread - rounding), (bands.lower - least) / spread
    assert np.all(bands.upper <= largest + near * spread + rounding), (bands.upper - largest) / spread


def are_solutions(system, state, rank, values):
    """Whether [qdd; lam; tau] solve (25)."""
    equations, size = literal.equations(system, state, rank), state.qd.size + len(system.rows)
    for value in values:
        residual = equations.residual(jnp.asarray(value[:size]))
        assert np.abs(residual).max() <= 1e-9 * np.abs(value).max()


@cache
def paper_band() -> rx.types.Bands:
    return rx.band(*paper(0.02), None, rx.AmplitudeBox({"A.x": (-400.0, 400.0)}))


def test_acceleration_band_of_the_paper_against_50_digits():
    found, mechanism = paper_band(), scenes.wojtyra2020()
    crank = found.names.index("1.phi''")
    (z_low, low), (z_high, high) = truth.extremes(mechanism, STRESS, -400.0, 400.0, crank)
    assert found.lower[crank] == pytest.approx(low, rel=1e-10)
    assert found.upper[crank] == pytest.approx(high, rel=1e-10)
    assert found.lower_case[crank, 0] == pytest.approx(z_low, abs=1e-3)
    assert found.upper_case[crank, 0] == pytest.approx(z_high, abs=1e-3)


@pytest.mark.slow
def test_acceleration_band_of_the_paper_against_a_dense_sweep():
    found = paper_band()
    stress = exact.floats(exact.exact(STRESS))[None]
    values = along(*paper(0.02), stress, np.linspace(-400, 400, 20001)[:, None])[:, :12]
    holds(found, values, near=1e-6)
    are_solutions(*paper(0.02), 11, [*found.lower_solution, *found.upper_solution])
    assert found.solved == 1.0
    unique = found.exact
    assert {name for name, one in zip(found.names, unique, strict=True) if one} == {"4.x''", "2.phi''", "4.phi''"}
    assert np.array_equal(found.lower[unique], found.upper[unique])


@pytest.mark.slow
def test_two_states_with_translational_friction():
    system, state = carriage()
    box = {"K1.perpendicular": (-20.0, 15.0), "K1.angle": (-0.5, 1.0)}
    found = rx.band(system, state, ["carriage.x''", "K2.angle", "tau K1", "carriage.y''"], rx.AmplitudeBox(box))
    stress = rx.analyze(system, state).self_stress
    z = np.array(list(itertools.product(np.linspace(-20, 15, 71), np.linspace(-0.5, 1.0, 76))))
    values = along(system, state, stress, z)
    holds(found, values[:, [0, 6, 7, 1]], near=2e-2)
    are_solutions(system, state, 2, [*found.lower_solution, *found.upper_solution])
    assert found.exact.tolist() == [False, False, False, True]


@cache
def exact_vertices() -> np.ndarray:
    """Multipliers at 50 digits for all vertices of a misfit box."""
    mechanism, rows = scenes.wojtyra2020(), list(MISFITS)
    names = paper()[0].rows.labels
    out = []
    for signs in itertools.product((0, 1), repeat=len(rows)):
        misfit = [0.0] * 12
        for row, side in zip(rows, signs, strict=True):
            misfit[names.index(row)] = MISFITS[row][side]
        solution = exact.solve(mechanism, tuple(COMPLIANCE), tuple(misfit), friction=False)
        out.append(exact.floats(solution.multipliers))
    return np.array(out)


MISFITS = {"A.x": (-1e-6, 3e-6), "B.y": (-2e-6, 1e-6), "K.angle": (-1e-5, 2e-5), "K.perpendicular": (-1e-3, 1e-3)}


def test_misfits_without_friction_against_all_vertices():
    names = paper()[0].rows.labels
    found = rx.band(*paper(), names, rx.MisfitBox(rx.Compliance(np.array(COMPLIANCE)), MISFITS))
    values = exact_vertices()
    assert np.all(found.exact)
    size = np.abs(values).max()
    np.testing.assert_allclose(found.lower, values.min(axis=0), rtol=0, atol=1e-10 * size)
    np.testing.assert_allclose(found.upper, values.max(axis=0), rtol=0, atol=1e-10 * size)
    assert found.upper[0] - found.lower[0] > 1.0


def family_of(system, state):
    """lam_MP and a basis of the self-stress, from the Jacobian alone."""
    factor = rx.factorize(system, state)
    u, sigma, _ = np.linalg.svd(np.asarray(factor.jacobian))
    basis = u[:, int(np.sum(sigma > 1e-9 * sigma[0])) :]
    lam = np.asarray(factor.multipliers)
    return lam - basis @ (basis.T @ lam), basis


PRELOAD = {
    "K1.perpendicular": (2.0, 9.0),
    "K2.perpendicular": (-5.0, 6.0),
    "K1.angle": (-0.3, 0.2),
    "K2.angle": (-1, 0.1),
}


def test_preload_without_friction_against_all_corners():
    """The polygon of possible self-stress, k = 2: its corners are among the crossings of pairs of limits."""
    system, state = carriage(mu=None)
    names = system.rows.labels
    found = rx.band(system, state, names, rx.PreloadBox(PRELOAD))
    lam, basis = family_of(system, state)
    limits = [(names.index(row), value) for row, ends in PRELOAD.items() for value in ends]
    corners = []
    for (i, a), (j, b) in itertools.combinations(limits, 2):
        if abs(np.linalg.det(basis[[i, j]])) > 1e-9:
            loads = lam + basis @ np.linalg.solve(basis[[i, j]], np.array([a, b]) - lam[[i, j]])
            if all(low - 1e-9 <= loads[names.index(row)] <= high + 1e-9 for row, (low, high) in PRELOAD.items()):
                corners.append(loads)
    assert len(corners) >= 3 and np.all(found.exact)
    np.testing.assert_allclose(found.lower, np.min(corners, axis=0), atol=1e-9)
    np.testing.assert_allclose(found.upper, np.max(corners, axis=0), atol=1e-9)


def test_a_norm_of_preload_without_friction_against_its_rim():
    system, state = carriage(mu=None)
    names, sizes = system.rows.labels, np.array([12.0, 12.0, 1.0, 0.7])
    found = rx.band(system, state, names, rx.PreloadNorm(dict(zip(names, sizes, strict=True))))
    lam, basis = family_of(system, state)
    angle = np.linspace(0, 2 * np.pi, 20001)
    # the largest t with |(lam + t N w) / size| = 1 from the point of least norm, over all directions w
    basis = basis @ np.linalg.inv(np.linalg.cholesky((basis / sizes[:, None]).T @ (basis / sizes[:, None]))).T
    scaled, start = basis / sizes[:, None], lam / sizes
    centre = -np.linalg.lstsq(scaled, start)[0]
    room = 1 - np.sum((start + scaled @ centre) ** 2)
    w = np.stack([np.cos(angle), np.sin(angle)])
    reach = np.sqrt(room) / np.linalg.norm(scaled @ w, axis=0)
    rim = lam[:, None] + basis @ (centre[:, None] + reach * w)
    np.testing.assert_allclose(found.lower, rim.min(axis=1), atol=1e-6)
    np.testing.assert_allclose(found.upper, rim.max(axis=1), atol=1e-6)
    assert np.all(found.exact)


COMPLIANCES = {"A.x": (1e-9, 1e-7), "C.y": (5e-9, 5e-8), "D.x": (1e-8, 2e-8), "K.angle": (1e-7, 1e-5)}


def test_compliances_without_friction_against_dense_samples_and_50_digits():
    system, state = paper()
    names = system.rows.labels
    misfit = 1e-6 * np.cos(np.arange(12))
    found = rx.band(system, state, names, rx.ComplianceBox(rx.Compliance(np.array(COMPLIANCE), misfit), COMPLIANCES))
    assert np.all(found.exact)
    rng, lam_and_basis = np.random.default_rng(5), family_of(system, state)
    lam, n = lam_and_basis[0], lam_and_basis[1][:, 0]
    W = np.tile(COMPLIANCE, (20000, 1))
    for row, (low, high) in COMPLIANCES.items():
        W[:, names.index(row)] = low * (high / low) ** rng.random(20000)
        W[:10000, names.index(row)] = rng.choice([low, high], 10000)
    values = lam + ((misfit - W * lam) @ n / (W @ n**2))[:, None] * n
    holds(found, values, near=1e-9)
    for row in (0, 10):
        for case, value in ((found.lower_case[row], found.lower[row]), (found.upper_case[row], found.upper[row])):
            chosen = list(COMPLIANCE)
            for name, entry in zip(found.parameters, case, strict=True):
                chosen[names.index(name)] = float(entry)
            solution = exact.solve(scenes.wojtyra2020(), tuple(chosen), tuple(map(float, misfit)), friction=False)
            assert float(solution.multipliers[row]) == pytest.approx(value, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("what", ["misfit", "compliance"])
def test_with_friction_against_a_dense_sweep(what):
    system, state = paper(0.02)
    outputs, places = ["1.phi''", "A.x", "tau A"], [8, 12, 24]
    closure = rx.Compliance(np.array(COMPLIANCE))
    if what == "misfit":
        box = {"A.x": (-1e-4, 1e-4), "K.angle": (-1e-4, 2e-4)}
        found = rx.band(system, state, outputs, rx.MisfitBox(closure, box))
    else:
        closure = rx.Compliance(np.array(COMPLIANCE), np.eye(12)[0] * 3e-5)
        box = {"A.x": (1e-9, 1e-6), "K.angle": (1e-7, 1e-5)}
        found = rx.band(system, state, outputs, rx.ComplianceBox(closure, box))
    axes = [np.linspace(*ends, 61) for ends in box.values()]
    grid = np.array(list(itertools.product(*axes)))
    W, d = np.tile(closure.W, (len(grid), 1)), np.tile(closure.misfit, (len(grid), 1))
    (W if what == "compliance" else d)[:, [0, 10]] = grid

    @jax.jit
    @jax.vmap
    def run(W, d):
        return whole(rx.solve(system, state, closure=rx.Compliance(W, d)))

    holds(found, np.asarray(run(jnp.asarray(W), jnp.asarray(d)))[:, places], near=1e-2)
    assert not found.exact.any()
    are_solutions(system, state, 11, [*found.lower_solution, *found.upper_solution])


@pytest.mark.slow
def test_compliance_over_decades_is_searched_evenly_by_its_logarithm():
    """Friction with a peak at loads that a thousandth of the range of w gives.

    y = x stands there twice, lam + 2 lam' = -(g + tau) / 2, and lam / lam' = w' / (2 w) shares it.
    """
    pull, height, place, width, other = 2.0, 0.002, 0.75, 0.002, 1e-8

    def law(loads, rate, sense, memory, state, p):
        return -height * jnp.exp(-(((loads[0] + place) / width) ** 2))[None]

    system = rx.System(
        lambda q, t, p: jnp.stack([q[1] - q[0], 2 * (q[1] - q[0])]),
        jnp.ones(2),
        lambda q, qd, t, p: jnp.stack([pull + 0.0 * t, 0.0 * t]),
        friction=rx.Friction(lambda q, t, p: q[:1], law, np.arange(2), ("linear",)),
    )
    box = (other / 20, 20 * other)
    bounds = rx.ComplianceBox(rx.Compliance(jnp.full(2, other)), {system.rows.labels[0]: box})
    names = [*system.rows.labels[:1], system.coordinates.labels[0] + "''"]
    found = rx.band(system, rx.State([0.0, 0.0], [5.0, 5.0]), names, bounds)
    share = 1 / (1 + 4 * np.geomspace(*box, 200_001) / other)
    tau = np.zeros(share.size)
    for _ in range(200):
        load = -share * (pull + tau) / 2
        tau = tau / 2 - height / 2 * np.exp(-(((load + place) / width) ** 2))
    holds(found, np.stack([load, pull + tau + (-(pull + tau) / 2)], axis=1), near=1e-3)
    assert np.all((found.lower_case >= box[0]) & (found.upper_case <= box[1]))
    np.testing.assert_allclose(found.box, [box], rtol=1e-15)
    assert "no outer bound" in str(found)


@pytest.mark.slow
@pytest.mark.parametrize("norm", [False, True])
def test_preload_with_friction_against_a_dense_sweep(norm):
    """Of a dense sweep of amplitudes those samples count whose multipliers are within the limits."""
    system, state = carriage()
    sizes = np.array([12.0, 12.0, 1.0, 0.7])
    bounds = rx.PreloadNorm(dict(zip(system.rows.labels, sizes, strict=True))) if norm else rx.PreloadBox(PRELOAD)
    found = rx.band(system, state, ["carriage.x''", "K2.perpendicular", "tau K2"], bounds)
    stress = rx.analyze(system, state).self_stress
    z = np.array(list(itertools.product(np.linspace(-20, 20, 401), np.linspace(-1.5, 1.5, 401))))
    values = along(system, state, stress, z)
    lam = values[:, 3:7]
    if norm:
        within = np.sum((lam / sizes) ** 2, axis=1) <= 1
    else:
        limits = np.array([PRELOAD[row] for row in system.rows.labels])
        within = np.all((lam >= limits[:, 0]) & (lam <= limits[:, 1]), axis=1)
    assert within.sum() > 500
    holds(found, values[within][:, [0, 4, 8]], near=5e-2)
    ends = np.concatenate([found.lower_solution, found.upper_solution])[:, 3:7]
    if norm:
        assert np.all(np.sum((ends / sizes) ** 2, axis=1) <= 1 + 1e-8)
    else:
        assert np.all((ends >= limits[:, 0] - 2e-8) & (ends <= limits[:, 1] + 2e-8))
    are_solutions(system, state, 2, [*found.lower_solution, *found.upper_solution])


@pytest.mark.slow
def test_bands_tell_where_there_is_no_solution():
    """mu_rho = 0.1445: no solution beyond the folds at -28 and 36 N; 0.15: none at all."""
    box = rx.AmplitudeBox({"A.x": (-40.0, 40.0)})
    found = rx.band(*paper(0.1445), ["1.phi''", "tau C"], box)
    family = rx.solution_family(*paper(0.1445), z=np.linspace(-40.0, 40.0, 161))
    holds(found, np.stack([family["1.phi''"], family["tau C"]], axis=1), near=1e-2)
    assert found.solved == pytest.approx((35.9282 + 28.1705) / 80, abs=0.02)
    assert "NO SOLUTION for 20% of the cases" in str(found)
    none = rx.band(*paper(0.15), ["1.phi''", "tau C"], box)
    assert none.empty and none.solved == 0.0 and np.isnan(none.upper).all()
    assert "NO SOLUTION within the bounds" in str(none)
    rx.plot.band(none)
    impossible = rx.band(*paper(), "A.x", rx.PreloadBox({"A.x": (0.0, 1.0), "A.y": (500.0, 501.0)}))
    assert impossible.empty and not impossible.exact.any()


@pytest.mark.slow
def test_many_bounds_are_told_together_where_they_are_equal():
    door = rx.mechanisms.door()
    hinges, state = [f"hinge {k}" for k in (1, 2, 3)], rx.assemble(door)
    box = {f"{hinge}.axial": (-2e-4, 2e-4) for hinge in hinges} | {f"{hinge}.bend_1": (0.0, 1e-3) for hinge in hinges}
    joints = rx.ElasticJoints(door, {hinge: (1e-6, 1e-3) for hinge in hinges})
    heading = str(rx.band(door, state, "hinge 1.axial", rx.MisfitBox(joints, box))).splitlines()[:3]
    assert heading == [
        "MisfitBox:",
        "  -0.0002 to 0.0002: hinge 1.axial, hinge 2.axial, hinge 3.axial",
        "  0 to 0.001: hinge 1.bend_1, hinge 2.bend_1, hinge 3.bend_1",
    ]


def test_text_data_and_picture(tmp_path):
    found = paper_band()
    text = str(found)
    assert text.startswith("AmplitudeBox: A.x -400 to 400")
    assert "inner estimate" in text and "exact" in text
    data = json.loads(json.dumps(found.to_dict()))
    assert data["lower"][8] == found.lower[8] and data["empty"] is False
    figure = rx.plot.band(found)
    assert [axes.get_xlabel() for axes in figure.axes] == ["rad/s²", "m/s²"]
    figure.savefig(tmp_path / "bands.png")


def test_unique_loads_have_a_band_without_width():
    load = jnp.array([3.0, 1.0])
    system = rx.System(lambda q, t, p: q[:1], np.ones(2), lambda q, qd, t, p: load, rows=rx.Axis(("wire",), ("force",)))
    state = rx.State([0.0, 0.0], [0.0, 1.0])
    for bounds in (rx.MinimumNorm(), rx.PreloadBox({"wire": (-5.0, 5.0)})):
        found = rx.band(system, state, ["wire"], bounds)
        assert found.exact.all() and found.lower == found.upper == found.outer_upper
        assert abs(found.lower) == pytest.approx(3.0, rel=1e-14)
    for bounds in (rx.PreloadBox({"wire": (-1.0, 1.0)}), rx.PreloadNorm({"wire": 1.0})):
        assert rx.band(system, state, ["wire"], bounds).empty


@pytest.mark.parametrize(
    ("pair", "outputs", "bounds", "words"),
    [
        (paper, "A.z", rx.AmplitudeBox({"A.x": (0.0, 1.0)}), "`outputs` must"),
        (paper, None, rx.AmplitudeBox({"A.y": (0.0, 1.0)}), "There are A.x"),
        (paper, None, rx.AmplitudeBox({"A.x": (1.0, 0.0)}), "those of A.x do not"),
        (paper, None, rx.PreloadBox({"K.perpendicular": (0.0, 1.0)}), "leave 1 of 1 without bounds"),
        (
            paper,
            None,
            rx.ComplianceBox(rx.Compliance(np.array(COMPLIANCE)), {"A.x": (-1.0, 1.0)}),
            "negative compliances",
        ),
    ],
)
def test_arguments_that_do_not_fit_are_refused(pair, outputs, bounds, words):
    with pytest.raises(rx.RedundaxError, match=words):
        rx.band(*pair(), outputs, bounds)


def test_bounds_without_redundancy_or_names_say_what_to_do():
    pin = rx.Revolute("A", "a", "ground", (0.0, 0.0), (0.0, 0.0))
    pair = rx.Mechanism([rx.Body("a", 1.0, 1.0)], [pin]), rx.State(jnp.zeros(3), jnp.zeros(3))
    with pytest.raises(rx.RedundaxError, match="no constraint is redundant here"):
        rx.band(*pair, "A.x", rx.AmplitudeBox({"A.x": (0.0, 1.0)}))
    for bounds, given in ((rx.PreloadNorm, 10.0), (rx.PreloadBox, {"A.x": 5.0}), (rx.AmplitudeBox, [(0.0, 1.0)])):
        with pytest.raises(rx.RedundaxError, match=r"must give .* by name, but is"):
            bounds(given)


def test_preload_that_leaves_self_stress_open_names_rows_that_close_it():
    pins = [rx.Revolute(name, "a", "ground", (x, 0.0), (x, 0.0)) for name, x in (("B", -0.5), ("C", 0.5))]
    plate = rx.Fixed("P", "a", "ground", (0.0, 0.0), (0.0, 0.0))
    pair = rx.Mechanism([rx.Body("a", 1.0, 1.0)], [plate, *pins]), rx.State(jnp.zeros(3), jnp.zeros(3))
    box = {"B.x": (0.0, 1.0)}
    with pytest.raises(
        rx.RedundaxError, match=r"leave 3 of 4 without bounds\. Add bounds of ([\w., ]+), say\."
    ) as caught:
        rx.band(*pair, "P.angle", rx.PreloadBox(box))
    named = str(caught.value).partition("bounds of ")[2].removesuffix(", say.").split(", ")
    assert len(named) == 3
    found = rx.band(*pair, "B.x", rx.PreloadBox(box | dict.fromkeys(named, (0.0, 1.0))))
    np.testing.assert_allclose([found.lower[0], found.upper[0]], [0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("width", [0.0, 1e-12, 1e-6])
def test_a_load_that_is_almost_known_stands_beside_wide_bounds(width):
    """A plate on three pins without load: A.x + B.x + C.x = 0."""
    places = {"A": (-0.5, 0.0), "B": (0.5, 0.0), "C": (0.1, 0.4)}
    pins = [rx.Revolute(name, "plate", "ground", at, at) for name, at in places.items()]
    plate = rx.Mechanism([rx.Body("plate", 1.0, 0.1)], pins)
    box = rx.PreloadBox({"A.x": (5.0, 5.0 + width), "A.y": (-1e3, 1e3), "B.x": (-1e3, 1e3)})
    found = rx.band(plate, rx.State(jnp.zeros(3), jnp.zeros(3)), ["A.x", "B.x", "C.x"], box)
    np.testing.assert_allclose(found.lower, [5.0, -1000.0, -1005.0 - width], rtol=1e-12)
    np.testing.assert_allclose(found.upper, [5.0 + width, 1000.0, 995.0], rtol=1e-12)
    assert found.exact.all()


@pytest.mark.parametrize("size", [0.0, -1.0, np.inf, np.nan])
def test_sizes_of_a_norm_are_above_zero(size):
    with pytest.raises(rx.RedundaxError, match=f"`sizes` must hold finite sizes above 0, but that of A.x is {size}"):
        rx.PreloadNorm({"B.x": 1.0, "A.x": size})


def test_a_closure_that_does_not_determine_the_loads_is_refused():
    with pytest.raises(rx.NoSolutionError, match="does not determine"):
        rx.band(*paper(), None, rx.MisfitBox(rx.Compliance(np.eye(12)[8]), {"A.x": (0.0, 1.0)}))
