"""Known numbers are computed by NumPy, by the same functions that are traced: few programs, the same answers."""

import copy
import sys
import threading
from collections.abc import Callable

import equinox as eqx
import jax
import jax.monitoring
import jax.numpy as jnp
import numpy as np
import pytest
import registry
from threadpoolctl import ThreadpoolController

import redundax as rx
from redundax._tools import _computing, _numbers
from redundax._tools._numbers import are_numbers, entries_set, is_number, xp

BOX = rx.AmplitudeBox({"A.x": (-40.0, 40.0)})
ELASTIC = rx.Compliance(np.full(12, 1e-8))


def at_rest(state):
    return rx.State(state.q, np.zeros(len(state.qd)))


def way(state):
    return [rx.State(state.q, rate * np.asarray(state.qd)) for rate in (0.1, 0.0, -0.1)]


# Calls of README's kind, in an order in which each needs what those before it have compiled, and programs at most.
PROGRAMS = {
    "assemble": (lambda m, s: rx.assemble(m, s.q), 3),
    "factorize": (lambda m, s: rx.factorize(m, s), 1),
    "solve": (lambda m, s: rx.solve(m, s), 2),
    "sweeps": (lambda m, s: rx.solve(m, s, solver=rx.FixedPoint()), 0),
    "open": (lambda m, s: rx.solve(m, s, closure=None, solver=rx.Newton(), x0=10.0), 0),
    "closure": (lambda m, s: rx.solve(m, s, closure=rx.Compliance(np.full(len(m.rows), 1e-8))), 0),
    "sense": (lambda m, s: rx.solve(m, s, sense=np.ones(len(m.slips))), 0),
    "analyze": (lambda m, s: str(rx.analyze(m, s)), 2),  # bounds of friction, reactions
    "band": (lambda m, s: rx.band(m, s, "A.x", BOX, samples=8), 2),  # the laws in batches of two sizes
    "band of compliances": (
        lambda m, s: rx.band(m, s, "A.x", rx.ComplianceBox(ELASTIC, {"A.x": (1e-9, 1e-7)}), samples=8),
        0,
    ),
    "family": (lambda m, s: str(rx.solution_family(m, s, along="A.x", samples=5)), 0),
    "solutions": (lambda m, s: rx.frictional_solutions(m, s), 1),  # in a larger one
    "stability": (lambda m, s: rx.stability(m, s, rx.solve(m, s, closure=ELASTIC), ELASTIC), 0),
    "sticking": (lambda m, s: str(rx.sticking(m, at_rest(s), BOX, samples=8)), 0),
    "band at rest": (lambda m, s: str(rx.band(m, at_rest(s), "A.x", BOX)), 0),
    "limit load": (lambda m, s: str(rx.limit_load(m, at_rest(s), {"1.phi": 1.0})), 0),
    "band along": (lambda m, s: str(rx.band_along(m, way(s), "A.x", BOX, samples=8)), 1),  # motions of joints
    # With a stop on its way: steps, what is given at the times asked for, the closure, and three of a few operations.
    "motion": (lambda m, s: rx.simulate(m, s, 0.05), 6),
    "another motion": (lambda m, s: rx.simulate(m, m.state(phi=0.7, rate=1.1), 0.1), 0),
    # Small ones of the law, and how positions follow each other.
    "drive": (lambda m, s: rx.drive(m, {"1.phi": rx.Polynomial([0.8, 1.0])}, np.linspace(0.0, 0.4, 5), s.q), 12),
}


class Programs:
    """How many programs have been compiled, or found in the cache."""

    def __init__(self):
        self.count = 0
        jax.monitoring.register_event_duration_secs_listener(self.hear)

    def hear(self, event: str, duration: float, **_) -> None:
        self.count += "backend_compile" in event


HEARD = Programs()


@pytest.mark.slow
def test_known_calls_trace_the_model_alone(programs_at_once):
    jax.clear_caches()
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    state = mechanism.state(phi=0.8, rate=1.0)
    for name, (call, most) in PROGRAMS.items():
        HEARD.count = 0
        call(mechanism, state)
        assert HEARD.count <= most, name


def test_a_program_that_has_run_for_long_is_optimised_and_gives_the_same(monkeypatch, programs_at_once):
    """The first call compiles and does not count; the second runs; from the third on the other takes over."""
    monkeypatch.setattr(_numbers, "LONG", 0.0)
    run, x, counts = _numbers.as_program(lambda x: jnp.sin(x) * jnp.arange(3)), np.array([0.1, 0.2, 0.3]), []
    for _ in range(4):
        HEARD.count = 0
        np.testing.assert_allclose(run(x), np.sin(x) * [0, 1, 2], rtol=1e-15)
        counts.append(HEARD.count > 0)
    assert counts == [True, False, True, False]


def test_an_edited_machine_of_the_same_structure_traces_nothing(programs_at_once):
    for mu in (0.02, 0.03):
        mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu)
        state = mechanism.state(phi=0.8, rate=1.0)
        HEARD.count = 0
        rx.analyze(mechanism, state)
        rx.solve(mechanism, state)
    assert HEARD.count == 0


def cases():
    """Mechanisms of the registry, rubbing where they can."""
    for name, make in registry.MECHANISMS.items():
        mechanism = make()
        if hasattr(mechanism, "structure"):
            yield name, registry.build(mechanism, registry.coulomb)


def figures(factor: rx.types.Factorisation, solution: rx.types.Solution) -> dict[str, np.ndarray]:
    return {
        "acceleration": solution.acceleration,
        "multipliers": solution.multipliers,
        "friction": solution.friction,
        "split": factor.split.stress,
        "motion": factor.split.motion,
        "response": factor.response,
    }


def both(system: rx.AbstractSystem, state: rx.State) -> tuple[dict, tuple]:
    factor = rx.factorize(system, state)
    solution = rx.solve(system, state, throw=False)
    decided = factor.spectrum.rank, factor.determinate, factor.singular_position, factor.unique_multipliers
    return figures(factor, solution), (solution.result, factor.result, *decided)


@pytest.mark.slow
def test_known_and_traced_answers_agree():
    for name, (system, state) in cases():
        known, decided = both(system, state)
        traced, inside = jax.jit(both)(system, state)
        for one, other in zip(jax.tree.leaves(decided), jax.tree.leaves(inside), strict=True):
            np.testing.assert_array_equal(one, other, err_msg=name)
        for key, value in known.items():
            size = np.max(np.abs(value), initial=0.0)
            np.testing.assert_allclose(
                value, traced[key], rtol=0, atol=1e-12 * max(size, 1e-12), err_msg=f"{name} {key}"
            )


def test_contacts_trace_the_model_alone(programs_at_once):
    feet = [
        rx.PinInSlot(name, "beam", "ground", (x, 0.0), (x, 0.0), (0.0, 1.0), one_sided=True)
        for name, x in (("a", -0.5), ("b", 0.1), ("c", 0.5))
    ]
    beam = rx.Mechanism([rx.Body("beam", 2.0, 0.5)], feet, gravity=(0.0, -9.81))
    jax.clear_caches()
    before = HEARD.count
    state = rx.assemble(beam, {"beam.y": 0.01}, closed=["a", "b"])
    assert HEARD.count - before <= 3
    assert set(rx.solve(beam, state, throw=False).contacts) == {"a", "b", "c"}
    assert HEARD.count - before <= 5


def test_programs_that_take_over_give_the_same(monkeypatch):
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    state = mechanism.state(phi=0.8, rate=1.0)
    known, decided = both(mechanism, state)
    monkeypatch.setattr(_numbers, "OFTEN", 0)
    program, other = both(mechanism, state)
    assert jax.tree.all(jax.tree.map(np.array_equal, decided, other))
    for key, value in known.items():
        np.testing.assert_allclose(value, program[key], rtol=0, atol=1e-12 * np.max(np.abs(value)), err_msg=key)


def _twice_redundant() -> tuple[rx.Mechanism, rx.State]:
    guides = {"normal": (0.0, 1.0), "guide_length": 0.1, "friction": rx.Coulomb(0.1)}
    joints = [rx.Translational(f"K{k}", "slider", "ground", (0.0, 0.1 * k), (0.0, 0.1 * k), **guides) for k in range(2)]
    mechanism = rx.Mechanism([rx.Body("slider", 2.0, 0.1)], joints, gravity=(1.0, -9.81))
    return mechanism, rx.State(np.zeros(3), np.array([1.0, 0.0, 0.0]))


@pytest.mark.parametrize(
    "model",
    [
        pytest.param(lambda: _model(0.02), id="settled by Newton's method"),
        pytest.param(lambda: _model(0.4), id="followed from zero friction"),
        pytest.param(_twice_redundant, id="two states of self-stress"),
    ],
)
def test_single_precision_stays_so_inside(model):
    single = jax.tree.map(lambda x: x.astype(np.float32) if x.dtype == np.float64 else x, model())
    mechanism, state = single
    given = {"factor": rx.factorize(mechanism, state), "solution": rx.solve(mechanism, state, throw=False)}
    for path, leaf in jax.tree_util.tree_leaves_with_path(given):
        assert leaf.dtype != np.float64, jax.tree_util.keystr(path)


def _model(mu_rho: float = 0.02) -> tuple[rx.Mechanism, rx.State]:
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    return mechanism, mechanism.state(phi=0.8, rate=1.0)


def test_results_are_arrays_of_jax():
    mechanism, state = _model()
    for given in (state, jax.device_get(state)):
        solution, factor = rx.solve(mechanism, given), rx.factorize(mechanism, given)
        found = solution.acceleration, solution.multipliers, factor.acceleration, rx.assemble(mechanism, given.q).q
        assert all(isinstance(x, jax.Array) for x in found)


def test_a_declared_rank_that_cannot_be_is_told():
    mechanism, state = _model()
    for rank in (-3, 99):
        with pytest.raises(rx.RedundaxError, match=f"must be a whole number from 0 to 12.*but is {rank}"):
            rx.solve(mechanism, state, rank=rank, throw=False)


def test_compliances_of_a_box_may_be_those_of_a_minimum_norm():
    mechanism, state = _model()
    box = rx.ComplianceBox(rx.MinimumNorm(), {"A.x": (0.5, 2.0)})
    bands = rx.band(mechanism, state, "A.x", box, samples=4)
    assert bands.lower[0] < rx.solve(mechanism, state)["A.x"] < bands.upper[0]


def test_threads_of_linear_algebra_are_given_back():
    begun, both, ended = (threading.Event() for _ in range(3))

    def first():
        with _computing.computing():
            begun.set()
            both.wait(10)
        ended.set()

    def threads():
        return [library["num_threads"] for library in ThreadpoolController().select(user_api="blas").info()]

    before, other = threads(), threading.Thread(target=first)
    other.start()
    begun.wait(10)
    with _computing.computing():  # begins second and ends last
        both.set()
        ended.wait(10)
        assert _computing.is_computing()
    other.join()
    assert threads() == before and not _computing.is_computing()


def test_friction_reads_rows_that_are_there():
    friction = rx.Friction(lambda q, t, p: q[:1], lambda *given: -given[0], rows=[7], kinds=["linear"])
    with pytest.raises(rx.RedundaxError, match="1 constraint rows, but holds \\[7\\]"):
        rx.System(lambda q, t, p: q[1:], jnp.ones(2), rows="force", friction=friction)


class _Soft(rx.AbstractClosure):
    """A closure whose function holds what it needs."""

    softness: Callable = eqx.field(static=True)

    def compliance(self, system, state):
        return jnp.diag(jnp.array([self.softness(), 1.0])), jnp.zeros(2)


def _twice(mass=1.0) -> tuple[rx.System, rx.State]:
    """A weight on a rod that stands there twice, and its state at rest."""
    load = lambda q, qd, t, p: jnp.array([0.0, -1.0])  # noqa: E731
    rods = lambda q, t, p: jnp.stack([q[1], q[1]])  # noqa: E731
    system = rx.System(rods, lambda q, t, p: mass * jnp.eye(2), load, n=2, rows="force")
    return system, rx.State([0.0, 0.0], [0.0, 0.0])


@pytest.mark.slow
@pytest.mark.parametrize("often", [0, sys.maxsize])
def test_what_functions_of_the_user_hold_may_be_traced(monkeypatch, often):
    monkeypatch.setattr(_numbers, "OFTEN", often)
    system, state = _twice()
    share = lambda a: rx.solve(system, state, closure=_Soft(lambda: a)).multipliers[0]  # noqa: E731
    assert share(3.0) == pytest.approx(-0.25)  # springs side by side: 1 / (1 + a)
    assert jax.grad(share)(3.0) == pytest.approx(1 / 16)
    pulled = lambda mass: rx.solve(*_twice(mass), throw=False).acceleration[0] + mass  # noqa: E731
    assert jax.grad(pulled)(2.0) == pytest.approx(1.0)


def test_a_traced_number_in_a_function_of_the_user_is_seen():
    def peak(length):
        system = rx.System(lambda q, t, p: jnp.stack([jnp.hypot(q[0], q[1]) - length]), jnp.ones(2), rows="force")
        return rx.solve(system, rx.State([0.6, 0.8], [0.8, -0.6]), throw=False).multipliers[0]

    assert jax.grad(lambda length: peak(length) * length)(1.0) == pytest.approx(1.0)  # |lam| = v^2 / L, at v = 1


def test_samples_of_a_batch_of_numbers_end_and_fail_one_by_one():
    def halved(x):
        return _numbers.while_loop(lambda x: x > 1.0, lambda x: x / 2, x)

    given = np.array([0.5, 3.0, 100.0])
    np.testing.assert_array_equal(halved(given), jax.vmap(halved)(jnp.asarray(given)))
    matrices, right = np.array([[[2.0, 0.0], [0.0, 4.0]], [[1.0, 1.0], [1.0, 1.0]]]), np.ones((2, 2))
    found = _numbers.solution(matrices, right)
    np.testing.assert_array_equal(found[0], [0.5, 0.25])  # beside one without a factor
    assert np.isinf(found[1]).all()
    np.testing.assert_array_equal(_numbers.product(matrices, right), [[2.0, 4.0], [2.0, 2.0]])


def test_a_function_is_that_of_its_arguments():
    known, traced = np.arange(3.0), jnp.arange(3.0)
    assert isinstance(xp.where(known > 1, known, 0.0), np.ndarray)
    assert isinstance(xp.where(traced > 1, known, 0.0), jax.Array)
    assert isinstance(xp.concatenate([known, traced]), jax.Array)
    assert xp.zeros(2).dtype == np.float64 and xp.asarray(1.0).dtype == np.float64
    assert np.isnan(xp.linalg.cholesky(-np.eye(2))).all() and np.isnan(xp.linalg.svd(np.full((2, 3), np.nan))[1]).all()
    assert not is_number([known, (traced,)]) and are_numbers({"a": known, "b": 1.0})
    np.testing.assert_array_equal(entries_set(known, [0], 5.0), entries_set(traced, np.array([0]), 5.0))
    np.testing.assert_array_equal(known, np.arange(3.0))


def _height(q, t, p):
    return q[1:] - p["height"]


def _pull(q, qd, t, p):
    return jnp.array([p["force"], 0.0])


def test_systems_of_one_structure_asked_in_turn_keep_their_own_numbers():
    """A point of mass 2 on a line has the acceleration F / 2, whichever F was asked for before."""
    systems = {
        force: rx.System(_height, mass=jnp.full(2, 2.0), load=_pull, parameters={"force": force, "height": 0.0})
        for force in (1.0, 5.0)
    }
    state = rx.State(jnp.zeros(2), jnp.zeros(2))
    for force in (1.0, 5.0, 1.0, 1.0, 5.0):
        assert rx.solve(systems[force], state).acceleration[0] == force / 2
    own = np.array(1.0)
    system = eqx.tree_at(lambda system: system.parameters["force"], systems[1.0], own)
    for own[...] in (1.0, 1.0, 7.0):
        assert rx.solve(system, state).acceleration[0] == own / 2


@pytest.mark.parametrize("often", [0, 10])
def test_arrays_are_put_on_the_device_alike_by_a_program(often, monkeypatch):
    monkeypatch.setattr(_numbers, "OFTEN_PUT", often)
    given = {"a": np.arange(3.0), "b": np.float64(2.0), "c": np.zeros((0, 2), np.int32), "d": np.array(True)}
    for name, x in _numbers.as_arrays(given).items():
        assert isinstance(x, jax.Array) and not x.committed and x.dtype == given[name].dtype
        np.testing.assert_array_equal(x, given[name])


def test_what_is_found_out_of_a_mechanism_is_no_part_of_its_structure():
    # Derivatives, and programs of users, would take the same mechanism for another one.
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    before, solver = jax.tree.structure(mechanism), rx.Continuation()
    rx.solve(mechanism, mechanism.state(phi=0.6, rate=-1.0), solver=solver)
    assert jax.tree.structure(mechanism) == before == jax.tree.structure(copy.deepcopy(mechanism))
    assert jax.tree.structure(solver) == jax.tree.structure(rx.Continuation())
