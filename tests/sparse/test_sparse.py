"""Sparse matrices of large mechanisms: the same answers as NumPy's and closed forms, derivatives included."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax._sparse import _pick
from redundax._sparse._cholesky import factor, pivots, solution
from redundax._sparse._rows import Rows
from redundax._sparse._symbolic import symbolic

RNG = np.random.default_rng(5)


def rows_of_pairs(pairs, bodies, rows=2, size=3):
    """Random slopes of joints between these pairs of bodies, -1 for the ground; and the Jacobian whole."""
    joints = [np.arange(rows * k, rows * (k + 1)) for k in range(len(pairs))]
    row = np.repeat(np.arange(rows * len(pairs)), 2)
    body = np.repeat(np.where(np.array(pairs) < 0, bodies, pairs), rows, axis=0).ravel()
    columns = np.arange(size * bodies).reshape(bodies, size)
    found = symbolic(joints, (row, body), columns)
    each = np.append(RNG.normal(size=(row.size, size)), np.zeros((1, size)), axis=0)
    whole, moving = np.zeros((rows * len(pairs), size * bodies)), body < bodies
    np.add.at(whole, (row[moving][:, None], columns[body[moving]]), each[:-1][moving])
    half = RNG.normal(size=(bodies, size, size))
    masses = half @ half.transpose(0, 2, 1) + np.eye(size)
    return Rows(found, jnp.asarray(each[np.asarray(found.source)]), jnp.linalg.inv(masses)), whole, masses


def chain(length):
    return [(k - 1, k) for k in range(length)]


def grid(width):
    at = np.arange(width**2).reshape(width, width)
    sides = [
        *zip(at[:, 1:].ravel(), at[:, :-1].ravel(), strict=True),
        *zip(at[1:].ravel(), at[:-1].ravel(), strict=True),
    ]
    return [(-1, 0), *sides]


def star(arms):
    return [(-1, 0), *((0, k) for k in range(1, arms)), *((-1, k) for k in range(1, arms))]


@pytest.mark.parametrize(("pairs", "bodies"), [(grid(4), 16), (star(12), 12), ([*chain(3), (3, 4)], 5)])
def test_a_factor_on_a_plan_solves_what_numpy_solves(pairs, bodies):
    rows, whole, masses = rows_of_pairs(pairs, bodies)
    mass = np.zeros((3 * bodies, 3 * bodies))
    for k, each in enumerate(masses):
        mass[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = each
    matrix = whole @ np.linalg.solve(mass, whole.T) + np.eye(len(whole))
    right = RNG.normal(size=(len(whole), 2))

    @eqx.filter_jit
    def solved(rows, right):
        entries = rows.entries(jnp.ones(len(whole)), jnp.zeros(rows.symbolic.mates.shape).at[:, 0].set(1.0))
        found = factor(rows.symbolic, entries)
        return rows.gram(right) + right, solution(rows.symbolic, found, right), pivots(rows.symbolic, found)

    product, found, roots = solved(rows, jnp.asarray(right))
    np.testing.assert_allclose(product, matrix @ right, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), atol=1e-9)
    size = np.sum(np.log(roots))
    assert size == pytest.approx(np.linalg.slogdet(matrix)[1] / 2, rel=1e-10)


def test_the_plan_of_a_chain_is_linear_in_its_length():
    sizes = [rows_of_pairs(chain(length), length)[0].symbolic.size for length in (100, 400)]
    assert sizes[1] <= 5 * sizes[0]


def mechanisms():
    yield "cranks", rx.mechanisms.parallelogram(4), lambda m: m.state(0.8, rate=1.0)
    yield "in space", rx.mechanisms.bricard(), lambda m: rx.assemble(m)
    yield "frictional", rx.mechanisms.wojtyra2020(mu_rho=0.01), lambda m: m.state(phi=0.8, rate=1.0)


@pytest.fixture(
    params=[pytest.param(one, marks=pytest.mark.slow if one[0] != "frictional" else ()) for one in mechanisms()],
    ids=lambda case: case[0],
)
def case(request):
    _, mechanism, start = request.param
    return mechanism, start(mechanism)


def closures(mechanism):
    m = len(mechanism.rows)
    diagonal = RNG.uniform(1e-8, 3e-8, m)
    names = [name for members in mechanism.names.joints for name in members]
    return [
        rx.MinimumNorm(),
        rx.MinimumNorm(h=7.0, units=rx.units.Units(length=1000.0)),
        rx.Compliance(diagonal, 1e-6 * RNG.normal(size=m)),
        rx.Compliance(np.diag(diagonal)),
        rx.ElasticJoints(mechanism, dict.fromkeys(names, (1e-8, 1e-6))),
    ]


def test_solutions_are_those_of_dense_matrices(case):
    mechanism, state = case
    for closure in closures(mechanism):
        dense, sparse = (rx.solve(each, state, closure=closure) for each in (mechanism, mechanism.sparse()))
        for name in ("acceleration", "multipliers", "friction"):
            true, found = (np.asarray(getattr(each, name)) for each in (dense, sparse))
            np.testing.assert_allclose(found, true, rtol=1e-10, atol=1e-11 * np.abs(true).max(initial=1.0))
        assert sparse.stats.redundancy == dense.stats.redundancy
        assert sparse.stats.freedom == dense.stats.freedom


@pytest.mark.slow
def test_multipliers_balance_compliance_along_every_self_stress():
    mechanism = rx.mechanisms.parallelogram(12)
    state, m = mechanism.state(0.8, rate=1.0), len(mechanism.rows)
    compliance, misfit = RNG.uniform(1e-8, 3e-8, m), 1e-6 * RNG.normal(size=m)
    lam = np.asarray(rx.solve(mechanism.sparse(), state, closure=rx.Compliance(compliance, misfit)).multipliers)
    u, sigma, _ = np.linalg.svd(np.asarray(mechanism.jacobian(state.q, state.t)))
    stress = u[:, np.sum(sigma > 1e-9) :]
    assert stress.shape[1] == 10
    terms = np.abs(stress.T) @ (np.abs(compliance * lam) + np.abs(misfit))
    assert np.all(np.abs(stress.T @ (compliance * lam - misfit)) <= 1e-12 * terms)


def rack(loops, twice):
    """Cranks of 1 m and 1 kg, neighbours joined by couplers; pins of every third joint twice over."""
    rod = {"mass": 1.0, "inertia": 1 / 12}
    bodies = [*(rx.Body(f"c{k}", **rod) for k in range(loops + 1)), *(rx.Body(f"b{k}", **rod) for k in range(loops))]
    pins = [(f"A{k}", f"c{k}", "ground", (-0.5, 0.0), (float(k), 0.0)) for k in range(loops + 1)]
    for k in range(loops):
        pins += [
            (f"B{k}", f"b{k}", f"c{k}", (-0.5, 0.0), (0.5, 0.0)),
            (f"C{k}", f"b{k}", f"c{k + 1}", (0.5, 0.0), (0.5, 0.0)),
        ]
    joints = [rx.Revolute(*pin) for pin in pins]
    second = [rx.Revolute(f"{pin[0]}'", *pin[1:]) for pin in pins[::3]] if twice else []
    pose = rx.mechanisms.n_four_bar(loops).pose
    return rx.Mechanism([*bodies], [*joints, *second], gravity=(0.0, -9.81), pose=pose), [pin[0] for pin in pins[::3]]


@pytest.mark.slow
def test_many_loops_with_pins_twice_over_are_right_to_the_last_digits():
    loops = 60
    (single, _), (double, doubled) = rack(loops, False), rack(loops, True)
    single, double = single.sparse(), double.sparse()
    state = double.state(0.8, rate=1.0)
    alone, found = (rx.solve(each, state) for each in (single, double))
    k = 9.81 * ((loops + 1) / 2 + loops) / ((loops + 1) / 3 + loops)
    cranks = [found[f"c{c}.phi''"] for c in range(loops + 1)]
    np.testing.assert_allclose(cranks, -k * np.cos(0.8), rtol=1e-11)
    assert found.stats.redundancy == 2 * len(doubled)
    size = np.abs(np.asarray(alone.multipliers)).max()
    for name in single.rows.labels:
        pin, row = name.split(".")
        twice = [found[name], found[f"{pin}'.{row}"]] if pin in doubled else [found[name]]
        np.testing.assert_allclose(twice, alone[name] / len(twice), rtol=0, atol=1e-10 * size)
    unique = np.asarray(rx.factorize(double, state).unique_multipliers)
    assert {name.rstrip("'") for name in np.array([row.split(".")[0] for row in double.rows.labels])[~unique]} == set(
        doubled
    )


@pytest.mark.slow
def test_derivatives_in_both_modes_are_those_of_dense_matrices():
    mechanism = rx.mechanisms.parallelogram(5)
    m = len(mechanism.rows)
    compliance, misfit = RNG.uniform(1e-9, 3e-9, m), 1e-5 * RNG.normal(size=m)

    def figures(mechanism, x):
        state = mechanism.state(0.8 + x[0], rate=1.0 + x[1])
        heavier = eqx.tree_at(lambda m: m.body.mass, mechanism, mechanism.body.mass * (1 + x[2]))
        closure = rx.Compliance(compliance * (1 + x[3] * jnp.arange(m)), misfit)
        solution = rx.solve(heavier, state, closure=closure)
        return jnp.concatenate([solution.acceleration, 1e-3 * solution.multipliers])[::7]

    x = jnp.zeros(4)
    true = jax.jacfwd(lambda x: figures(mechanism, x))(x)
    sparse = mechanism.sparse()
    for mode in (jax.jacfwd, jax.jacrev):
        found = mode(lambda x: figures(sparse, x))(x)
        np.testing.assert_allclose(found, true, rtol=1e-9, atol=1e-10 * np.abs(true).max())


@pytest.mark.slow
def test_batches_are_as_one_by_one():
    sparse = rx.mechanisms.parallelogram(4).sparse()
    angles = jnp.linspace(0.3, 1.2, 3)
    found = jax.vmap(lambda phi: rx.solve(sparse, sparse.state(phi, rate=1.0)).multipliers)(angles)
    for phi, multipliers in zip(angles, found, strict=True):
        one = rx.solve(sparse, sparse.state(phi, rate=1.0)).multipliers
        np.testing.assert_allclose(multipliers, one, rtol=1e-11, atol=1e-10)


def test_what_cannot_be_answered_is_refused():
    sparse = rx.mechanisms.parallelogram(4).sparse()
    flat = rx.solve(sparse, sparse.state(0.0, rate=1.0), throw=False)
    assert flat.result == rx.RESULTS.singular_position
    state = sparse.state(0.8, rate=1.0)
    off = rx.State(state.q + 1e-3 * jnp.sin(jnp.arange(state.q.size)), state.qd, state.t)
    with pytest.raises(rx.NoSolutionError, match="Violated rows"):
        rx.solve(sparse, off)
    none = rx.Compliance(np.zeros(len(sparse.rows)))
    with pytest.raises(rx.NoSolutionError, match="closure"):
        rx.solve(sparse, state, closure=none)


@pytest.mark.parametrize("softest", [pytest.param(1e-8, marks=pytest.mark.slow), 1.0])
def test_compliance_that_couples_joints_is_refused_however_soft_another_is(softest):
    mechanism = rx.mechanisms.doubled_four_bar()
    state, sparse = mechanism.state(0.7, rate=2.0), mechanism.sparse()
    alone = np.diag([softest, *np.full(11, 1e-8)])
    coupled = alone.copy()
    coupled[6, 10] = coupled[10, 6] = 0.9e-8
    true, found = (rx.solve(each, state, closure=rx.Compliance(alone)).multipliers for each in (mechanism, sparse))
    rounding = 10 * 2.2e-16 * softest / 1e-8  # a zero of the self-stress at the softest row is none to rounding
    np.testing.assert_allclose(found, true, rtol=0, atol=max(1e-9, rounding) * np.abs(true).max())
    assert rx.solve(sparse, state, closure=rx.Compliance(coupled), throw=False).result != rx.RESULTS.successful


@pytest.mark.parametrize(("ratio", "rank"), [(-1.0, 5), (0.5, 5)])
@pytest.mark.slow
@pytest.mark.parametrize("inertia", [1.0, 1e-6])
def test_couplers_that_hold_a_body_twice_have_the_rank_of_their_sum(ratio, rank, inertia):
    bodies = [rx.Body("A", 1.0, inertia), rx.Body("B", 1.0, 1.0)]
    pins = [
        rx.Revolute("h1", "A", "ground", (0.0, 0.0), (0.0, 0.0)),
        rx.Revolute("h2", "B", "A", (0.0, 0.0), (0.0, 0.0)),
    ]
    coupler = rx.Coupler("c", "h2.angle", "h1.angle", ratio=ratio)
    dense = rx.Mechanism(bodies, pins, couplers=[coupler])
    mechanism, state = dense.sparse(), rx.State(np.zeros(6), np.zeros(6))
    found, true = (each.jacobian(state.q, state.t) for each in (mechanism, dense))
    np.testing.assert_allclose(found, true, rtol=0, atol=1e-15)
    factor = rx.factorize(mechanism, state)
    assert factor.result == rx.RESULTS.successful
    assert factor.spectrum.rank == rank
    rows = factor.gram.rows
    np.testing.assert_allclose(np.diag(rows.gram(jnp.eye(rows.count))), 1.0, rtol=1e-9)


def test_other_questions_are_answered_by_dense_matrices():
    mechanism = rx.mechanisms.parallelogram(4)
    state = mechanism.state(0.8, rate=1.0)
    dense, sparse = (rx.analyze(each, state) for each in (mechanism, mechanism.sparse()))
    assert str(sparse) == str(dense)
    np.testing.assert_array_equal(
        mechanism.sparse().sparse(False).jacobian(state.q, state.t), mechanism.jacobian(state.q, state.t)
    )


def test_the_jacobian_on_a_plan_is_that_of_dense_matrices():
    mechanism = rx.mechanisms.bricard()
    state = rx.assemble(mechanism)
    dense, sparse = (each.jacobian(state.q, state.t) for each in (mechanism, mechanism.sparse()))
    np.testing.assert_allclose(sparse, dense, rtol=0, atol=1e-15)


@pytest.mark.slow
def test_bodies_without_mass_are_taken_where_every_motion_has_some():
    swing = rx.mechanisms.swing(rods=5, length=2.0)
    state = swing.state(-1.2, rate=0.5)
    dense, sparse = (rx.solve(each, state) for each in (swing, swing.sparse()))
    turns = np.asarray(sparse.acceleration)[12:17]
    np.testing.assert_allclose(turns, -9.81 / 2.0 * np.cos(-1.2), rtol=1e-11)
    np.testing.assert_allclose(sparse.multipliers, dense.multipliers, atol=1e-10 * np.abs(dense.multipliers).max())
    assert sparse.stats.redundancy == 3
    bodies = [rx.Body("rod", 1.0, 1 / 12), rx.Body("wheel", 0.0, 0.0)]
    pins = [
        rx.Revolute("A", "rod", "ground", (-0.5, 0.0), (0.0, 0.0)),
        rx.Revolute("B", "wheel", "rod", (0.0, 0.0), (0.5, 0.0)),
    ]
    loose = rx.Mechanism(bodies, pins, gravity=(0.0, -9.81)).sparse()
    with pytest.raises(rx.NoSolutionError, match="accelerations are not unique"):
        rx.solve(loose, rx.State(jnp.array([0.5, 0.0, 1.0, 0.0, 0.0, 0.0]), jnp.zeros(6), 0.0))


def ladder(loops, twice=False):
    """Parallel cranks of 1 m and 1 kg in space on hinges along z, and their state at 0.8 rad and 1 rad/s."""
    tip, turned = np.array([np.cos(0.8), np.sin(0.8), 0.0]), (np.cos(0.4), 0.0, 0.0, np.sin(0.4))
    feet = [np.array([float(k), 0.0, 0.0]) for k in range(loops + 1)]
    rod = {"mass": 1.0, "inertia": (1e-3, 1 / 12, 1 / 12)}
    cranks = [
        rx.spatial.Body(f"c{k}", **rod, position=foot + tip / 2, orientation=turned) for k, foot in enumerate(feet)
    ]
    bars = [rx.spatial.Body(f"b{k}", **rod, position=feet[k] + tip + (0.5, 0.0, 0.0)) for k in range(loops)]
    hinges = [(f"A{k}", crank, "ground", feet[k]) for k, crank in enumerate(cranks)]
    hinges += [(f"{name}{k}", bars[k], cranks[at], feet[at] + tip) for k in range(loops)
               for name, at in (("B", k), ("C", k + 1))]  # fmt: skip
    hinges += [(f"{hinge[0]}'", *hinge[1:]) for hinge in hinges[::3]] if twice else []
    joints = [rx.spatial.Revolute(*hinge, axis=(0.0, 0.0, 1.0)) for hinge in hinges]
    mechanism = rx.Mechanism([*cranks, *bars], joints, gravity=(0.0, -9.81, 0.0))
    rates, along = np.zeros((2, 2 * loops + 1, 3)), np.array([-tip[1], tip[0], 0.0])
    rates[0, : loops + 1], rates[0, loops + 1 :], rates[1, : loops + 1, 2] = along / 2, along, 1.0
    return mechanism, rx.State(mechanism.reference, rates.ravel(), 0.0)


@pytest.mark.slow
def test_long_ladders_in_space_end_their_search_for_self_stress(monkeypatch):
    monkeypatch.setattr(_pick, "_STEPS", 2000)  # rounding of every step would add up
    loops = 250
    mechanism, state = ladder(loops)
    found = rx.solve(mechanism.sparse(), state)
    assert (found.stats.redundancy, found.stats.freedom) == (3 * loops, 1)
    turn = -9.81 * ((loops + 1) / 2 + loops) / ((loops + 1) / 3 + loops) * np.cos(0.8)
    turns = np.asarray(found.acceleration).reshape(2, -1, 3)[1, : loops + 1, 2]
    np.testing.assert_allclose(turns, turn, rtol=1e-11)
    rises = turn * np.cos(0.8) - np.sin(0.8)
    loads = dict(zip(found.names.reactions.labels, np.asarray(found.reactions).tolist(), strict=True))
    lifts = [loads[f"B{k} force y on b{k}"] for k in range(loops)]
    np.testing.assert_allclose(lifts, (9.81 + rises) / 2, rtol=1e-12)


@pytest.mark.parametrize("mass", [1.0, 1e-2, 1e-4, 1e-8])
def test_light_parts_leave_the_rank_right_or_undecided(mass):
    mechanism = rx.mechanisms.doubled_four_bar(coupler_mass=(mass, 1.0)).sparse()
    factor = rx.factorize(mechanism, mechanism.state(0.7, rate=2.0))
    assert np.any(factor.unique_multipliers) == (mass > 1e-6)
    if mass < 1e-6:
        assert factor.result == rx.RESULTS.ambiguous_rank
    else:
        assert factor.result == rx.RESULTS.successful
        assert factor.spectrum.rank == 11


@pytest.mark.parametrize("phi", [0.8, 1e-3, 1e-4])
def test_nearly_flat_parallelograms_keep_their_rank_or_leave_it_undecided(phi):
    mechanism = rx.mechanisms.parallelogram().sparse()
    factor = rx.factorize(mechanism, mechanism.state(phi, rate=0.0))
    assert bool(factor.spectrum.ambiguous) == (phi < 1e-3)
    assert factor.spectrum.ambiguous or factor.spectrum.rank == 11


def test_a_closed_chain_of_parallel_hinges_in_space_has_three_redundant_constraints():
    links, turns = 16, 2 * np.pi * np.arange(16) / 16
    points = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    middles = (points + np.roll(points, -1, axis=0)) / 2
    bodies = [rx.spatial.Body(f"b{k}", 1.0, (0.1, 0.1, 0.1), position=middles[k]) for k in range(links - 1)]
    ends = [*bodies, "ground"]
    joints = [rx.spatial.Revolute(f"j{k}", ends[k], ends[k - 1], points[k], axis=(0, 0, 1)) for k in range(links)]
    mechanism = rx.Mechanism(bodies, joints).sparse()
    factor = rx.factorize(mechanism, rx.State(mechanism.reference, np.zeros(6 * (links - 1))))
    assert factor.result == rx.RESULTS.successful
    assert (factor.redundancy, factor.freedom) == (3, links - 3)


@pytest.mark.slow
def test_single_precision_decides_the_rank(float32):
    mechanism = rx.mechanisms.doubled_four_bar().sparse()
    factor = rx.factorize(mechanism, mechanism.state(0.7, rate=2.0))
    assert factor.gamma.dtype == jnp.float32
    assert factor.result == rx.RESULTS.successful
    assert factor.spectrum.rank == 11


@pytest.mark.parametrize("where", ["in the plane", "in space"])
@pytest.mark.slow
def test_elastic_joints_twice_over_share_as_by_dense_matrices(where):
    if where == "in space":
        mechanism, state = ladder(2, twice=True)
    else:
        mechanism, _ = rack(4, True)
        state = mechanism.state(0.8, rate=1.0)
    names = [name for members in mechanism.names.joints for name in members]
    softness = 1e-8 * RNG.uniform(1.0, 4.0, (len(names), 2))
    elastic = rx.ElasticJoints(mechanism, {name: tuple(own) for name, own in zip(names, softness, strict=True)})
    m = len(mechanism.rows)
    for closure in (elastic, rx.Compliance(RNG.uniform(1e-8, 4e-8, m), 1e-6 * RNG.normal(size=m))):
        true, found = (np.asarray(rx.solve(each, state, closure=closure).multipliers)
                       for each in (mechanism, mechanism.sparse()))  # fmt: skip
        np.testing.assert_allclose(found, true, rtol=0, atol=1e-10 * np.abs(true).max())
