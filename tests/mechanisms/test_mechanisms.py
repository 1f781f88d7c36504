"""Laws over `rx.mechanisms`: facts, motion, energy, order of joints, 50 digits, and the flat position.

Errors are relative to the largest entry of each kind. `python tests/test_mechanisms.py` prints them, and what
compiling costs.
"""

import contextlib
import dataclasses
import inspect
import json
import os
import subprocess
import sys
from functools import cache
from unittest import mock

import equinox as eqx
import jax
import jax.numpy as jnp
import mechanisms
import numpy as np
import pytest
import registry
import spaces
import wheels
from mpmath import mp
from truth import exact

import redundax as rx

CASES = mechanisms.CASES
TOLERANCE = 1e-13  # of the truth of 50 digits


def over(names):
    """Parametrise over cases; one of each builder or more by default."""
    return pytest.mark.parametrize(
        "name", [pytest.param(name, marks=pytest.mark.slow if name in mechanisms.MORE else ()) for name in names]
    )


every_case = over(CASES)
every_kind = over(name for name in CASES if name not in mechanisms.MORE)
free = [name for name, case in CASES.items() if case.freedom]
with_and_without_friction = pytest.mark.parametrize("friction", [False, True], ids=["smooth", "friction"])


@cache
def solution(name, friction=False):
    case = CASES[name]
    return rx.solve(case.rubbing if friction else case.smooth, case.state)


@cache
def factors(name):
    return rx.factorize(CASES[name].smooth, CASES[name].state)


@cache
def report(name):
    return rx.analyze(CASES[name].rubbing, CASES[name].state)


def close(value, truth, tolerance):
    return np.max(np.abs(np.asarray(value) - truth), initial=0.0) <= tolerance * np.max(np.abs(truth), initial=0.0)


def tangent(case, at=None):
    """First and second derivative of the coordinates with respect to the independent one."""
    at, one = jnp.asarray(float(case.at) if at is None else at), jnp.ones(())
    return jax.jvp(lambda x: jax.jvp(case.smooth.pose, (x,), (one,))[1], (at,), (one,))


# Facts --------------------------------------------------------------------------------------


def test_every_mechanism_has_a_case():
    makers = {name for name, make in vars(rx.mechanisms).items() if callable(make)}
    cases = [*CASES.values(), *spaces.CASES.values()]
    made = [*(getattr(case.make, "func", case.make) for case in cases), *wheels.MAKERS]
    assert makers <= {make.__name__ for make in made}


@every_case
def test_counts(name):
    case, found = CASES[name], report(name)
    assert (len(found.coordinates), len(found.rows)) == (case.n, case.m)
    assert (found.rank, found.redundancy, found.freedom) == (case.rank, case.redundancy, case.freedom)
    assert len(case.self_stress) == case.redundancy
    assert found.problem == "" and found.unique_accelerations
    assert found.gap > 1e10


@every_case
def test_self_stress_is_what_statics_says(name):
    case, found = CASES[name], report(name)
    if not case.redundancy:
        assert found.self_stress.shape == (0, case.m)
        assert found.unique_multipliers == found.rows
        return
    states = np.array([[float(state.get(row, 0)) for row in found.rows] for state in case.self_stress])
    projector = factors(name).self_stress
    assert np.linalg.matrix_rank(states) == case.redundancy
    assert close(states @ projector, states, 1e-13)
    assert close(found.self_stress @ projector, found.self_stress, 1e-13)
    loaded = np.any(states != 0, axis=0)
    assert found.unique_multipliers == tuple(np.array(found.rows)[~loaded])


@every_case
def test_projector_laws(name):
    case, f = CASES[name], factors(name)
    p = f.self_stress
    assert np.max(np.abs(p - p.T)) <= 1e-15
    assert np.max(np.abs(p @ p - p)) <= 1e-14
    assert abs(np.trace(p) - case.redundancy) <= 1e-13
    assert np.max(np.abs(p @ f.jacobian)) <= 1e-14 * case.n * np.max(np.abs(f.jacobian))


@every_case
def test_state_lies_on_the_manifold(name):
    violation = solution(name).stats.violation
    assert violation.position < 1e-14
    assert violation.velocity < 1e-14


@every_case
def test_state_is_the_exact_one(name):
    """Hand-written coordinates and velocities of 50 digits, on the manifold to 45."""
    case, truth = CASES[name], CASES[name].exact
    with mp.workdps(exact.DIGITS):
        rate = exact.jacobian(truth, truth.q) * mp.matrix(truth.qd) + exact.time_rate(truth, truth.t)
        assert mp.norm(exact.constraints(truth, truth.q, truth.t)) < mp.mpf(10) ** -45
        assert mp.norm(rate) < mp.mpf(10) ** -45
    assert close(case.state.q, exact.floats(truth.q), 1e-15)
    assert close(case.state.qd, exact.floats(truth.qd), 4e-15)
    assert close(case.state.t, float(truth.t), 0.0)


@pytest.mark.slow
def test_massless_bodies_leave_the_mass_matrix_singular():
    singular = {name for name in CASES if np.linalg.det(factors(name).mass) == 0}
    assert singular == {"swing on massless rods", "doubled four-bar, massless couplers"}


# Motion -------------------------------------------------------------------------------------


@every_case
@with_and_without_friction
def test_solve_succeeds(name, friction):
    case, found = CASES[name], solution(name, friction)
    assert found.result == rx.RESULTS.successful
    groups = case.rubbing.friction if friction else ()
    assert found.friction.shape == (sum(len(group.slips) for group in groups),)
    if friction:
        assert not close(found.acceleration, solution(name).acceleration, 1e-6) or not case.freedom


@every_case
def test_acceleration_is_that_of_lagrange(name):
    """p' phi'' + p'' phi'^2 for the pose p(phi), with phi'' written out by hand."""
    case = CASES[name]
    slope, bend = tangent(case)
    expected = slope * float(case.acceleration) + bend * float(case.rate) ** 2
    kinds = registry.kinds_of(case.smooth.coordinates)
    assert registry.agree(solution(name).acceleration, expected, kinds, 1e-13)


@over(free)
def test_constraints_do_no_work(name):
    """d'Alembert: along the motion that the pose allows, inertia balances the load without any multiplier."""
    case, f = CASES[name], factors(name)
    slope, _ = tangent(case)
    terms = slope * (f.mass @ solution(name).acceleration), slope * f.load
    assert abs(np.sum(terms[0]) - np.sum(terms[1])) <= 1e-13 * max(np.sum(np.abs(term)) for term in terms)


@every_case
@with_and_without_friction
def test_power(name, friction):
    """Power of gravity, loads, friction and drivers is the rate of the kinetic energy; friction dissipates."""
    case, found = CASES[name], solution(name, friction)
    f, qd = factors(name), case.state.qd
    phi = qd[2 * (case.n // 3) :]
    powers = [f.load @ qd]
    if friction:
        work = found.friction * slip_rates(case)
        assert np.all(work < 0)
        powers.append(np.sum(work))
    for row, label in enumerate(case.smooth.rows.labels):
        if label.startswith("M"):
            powers.append(-found.multipliers[row] * phi[int(label[1]) - 1])
    energy = qd @ f.mass @ found.acceleration
    assert abs(energy - sum(powers)) <= 1e-12 * max(abs(energy), *(abs(power) for power in powers))


def slip_rates(case):
    """Relative rates of the revolutes, then velocities along the guides, from the exact data."""
    return np.array(case.exact.equations.slip_rate[0], float)


@over(name for name in free if CASES[name].motion)
def test_released_at_rest_it_moves_as_known(name):
    """Accelerations at states of the exact motion, released at rest, are its second derivatives."""
    case = CASES[name]
    mechanism = case.smooth
    for t in (0.0, 0.3, 1.1):
        with mp.workdps(30):
            x, rate, acceleration = (float(mp.diff(case.motion, t, order)) for order in range(3))
        along, bend = tangent(case, x)
        found = rx.solve(mechanism, mechanism.state(x, rate=rate)).acceleration
        assert close(found, along * acceleration + bend * rate**2, 1e-12)


# Order and number of joints -----------------------------------------------------------------


def pieces(case, friction=False):
    """Bodies, joints and the other arguments that the builder hands to `rx.Mechanism`."""
    seen = []

    def record(bodies, joints, **rest):
        seen.append((list(bodies), list(joints), {**rest, "pose": None}))
        return rx.Mechanism(bodies, joints, **rest)

    module = sys.modules[inspect.unwrap(case.make).__module__]
    with mock.patch.object(module, "Mechanism", record):
        case.make(**case.arguments(friction))
    return seen[0]


def by_name(mechanism, found):
    slips = [name for group in mechanism.friction for name in group.slips.labels]
    names = (*mechanism.coordinates.labels, *mechanism.rows.labels, *slips)
    values = np.concatenate([found.acceleration, found.multipliers, found.friction])
    return dict(zip(names, values.tolist(), strict=True))


@every_kind
@pytest.mark.parametrize("friction", [pytest.param(False, marks=pytest.mark.slow), True], ids=["smooth", "friction"])
def test_order_of_bodies_and_joints_does_not_matter(name, friction):
    case = CASES[name]
    bodies, joints, rest = pieces(case, friction)
    other = rx.Mechanism(bodies[::-1], joints[::-1], **rest)
    place = [case.smooth.coordinates.labels.index(label) for label in other.coordinates.labels]
    state = rx.State(case.state.q[jnp.array(place)], case.state.qd[jnp.array(place)], case.state.t)
    found = by_name(other, rx.solve(other, state))
    expected = by_name(case.rubbing if friction else case.smooth, solution(name, friction))
    assert found.keys() == expected.keys()
    size = max(abs(value) for value in expected.values())
    assert all(abs(found[key] - expected[key]) <= 1e-12 * size for key in expected)


@over(("three cranks", "driven twice", "swing on massless rods", "doubled four-bar", "slider-crank", "carriage"))
def test_doubled_joints_change_no_acceleration(name):
    """Without friction, every joint twice."""
    case = CASES[name]
    bodies, joints, rest = pieces(case)
    twins = [dataclasses.replace(joint, name=f"{joint.name} twin") for joint in joints]
    found = rx.solve(rx.Mechanism(bodies, [*joints, *twins], **rest), case.state)
    assert found.stats.rank == case.rank
    assert found.stats.redundancy == 2 * case.m - case.rank
    kinds = registry.kinds_of(case.smooth.coordinates)
    assert registry.agree(found.acceleration, np.array(solution(name).acceleration), kinds, 1e-12)


# 50 digits ----------------------------------------------------------------------------------


def errors(name, friction):
    case = CASES[name]
    truth = case.exact.solve(friction=friction)
    parts = exact.floats(truth.acceleration), exact.floats(truth.multipliers)
    tau = exact.floats(truth.friction) if friction and case.exact.slips else np.zeros(0)
    return registry.errors_of(solution(name, friction), (*parts, tau), case.rubbing if friction else case.smooth)


@every_case
@with_and_without_friction
def test_fifty_digits(name, friction, record_property):
    found = errors(name, friction)
    record_property("errors", found)
    assert max(found.values()) <= TOLERANCE, found


@every_case
def test_the_truth_satisfies_its_equations(name):
    truth = CASES[name].exact
    solved = truth.solve()
    with mp.workdps(exact.DIGITS):
        assert max(exact.residuals(truth, solved)) <= mp.mpf(10) ** -35 * mp.norm(solved.multipliers)


# Parallel cranks in line with their pivots --------------------------------------------------


def flat(count, rate=1.0, turn=0.0, crank_mass=1.0, phi=0.0):
    """A parallelogram at phi = 0, first crank at `rate`, coupler at `turn`; the other cranks follow."""
    spacing = [0.4, 0.6, 0.25][: count - 1]
    mechanism = rx.mechanisms.parallelogram(count, 0.5, spacing, crank_mass)
    state = mechanism.state(phi, rate=rate)
    if turn:
        pivots = np.cumsum([0.0, *spacing])
        rates = rate + turn * pivots / 0.5
        qd = np.zeros(3 * count + 3)
        qd[1 : 2 * count : 2] = rates * 0.25
        qd[2 * count + 1] = rate * 0.5 + turn * pivots[-1] / 2
        qd[2 * count + 2 :] = [*rates, turn]
        state = rx.State(state.q, qd)
    return mechanism, state


@pytest.mark.parametrize("phi", [0.0, np.pi])
@pytest.mark.parametrize("count", [2, 3, 4])
def test_flat_parallelogram_drops_in_rank(count, phi):
    """k = N - 1: axial forces in the cranks whose sum vanishes; their moment vanishes anyway."""
    found = rx.analyze(*flat(count, rate=0.0, phi=phi))
    assert (found.rank, found.redundancy, found.freedom) == (3 * count + 1, count - 1, 2)
    assert found.singular_position and found.local_self_stress == min(count - 1, 2)  # forms v w and w^2
    assert found.problem.startswith("The position is singular") and not found.unique_accelerations
    states = np.zeros((count - 1, len(found.rows)))
    for c in range(1, count):
        for joint in "AB":
            states[c - 1, found.rows.index(f"{joint}1.x")] = 1.0
            states[c - 1, found.rows.index(f"{joint}{c + 1}.x")] = -1.0
    both = np.concatenate([states, found.self_stress])
    assert np.linalg.matrix_rank(both, tol=1e-12) == count - 1


def test_near_the_flat_position_the_rank_is_that_of_any_other():
    for phi in (1e-3, 1e-6):
        mechanism, state = flat(3, phi=phi)
        assert rx.analyze(mechanism, state).rank == 11
        expected = -9.81 * np.cos(phi) * (1.5 + 4.0) / (0.5 * (1.0 + 4.0))
        assert abs(rx.solve(mechanism, state).acceleration[8] / expected - 1) <= 1e-15 / phi


@pytest.mark.parametrize("loops", [1, 3])
def test_flat_n_four_bar_drops_in_rank(loops):
    mechanism = rx.mechanisms.n_four_bar(loops)
    found = rx.analyze(mechanism, mechanism.state(0.0, rate=1.0))
    assert (found.rank, found.redundancy, found.freedom) == (5 * loops + 2, loops, loops + 1)


@pytest.mark.parametrize("count", [2, 3])
def test_drivers_on_all_cranks_keep_the_rank_in_the_flat_position(count):
    mechanism = rx.mechanisms.driven_parallelogram(count)
    found = rx.analyze(mechanism, mechanism.state(0.0, rate=1.0))
    assert (found.rank, found.redundancy, found.freedom) == (3 * count + 3, 2 * count - 3, 0)
    acceleration = rx.solve(mechanism, mechanism.state(0.0, rate=1.0)).acceleration
    assert close(acceleration[2 * count : 2 * count + 2], np.array([-0.5, 0.0]), 1e-13)


@pytest.mark.parametrize(("count", "turn"), [(2, 1.0), (2, -0.3), (3, 1.0), (3, 10.0), (4, 1.0)])
def test_generic_rates_in_the_flat_position_have_no_acceleration(count, turn):
    """The velocity satisfies the constraints, but (v + w X)^2 / l = w^2 X - a has no root a at all pivots X."""
    mechanism, state = flat(count, turn=turn)
    found = rx.solve(mechanism, state, throw=False)
    assert found.stats.violation.velocity < 1e-14
    assert found.stats.violation.acceleration > 1e-3
    assert found.result == rx.RESULTS.inadmissible_velocity
    assert np.all(np.isnan(found.acceleration))
    with pytest.raises(rx.NoSolutionError, match="N\\^T gamma = 0"):
        rx.solve(mechanism, state)


def test_two_cranks_have_a_second_branch_in_the_flat_position():
    """The antiparallelogram: w = 2 v / (l - d) with the tip's speed v = l phi'."""
    mechanism, state = flat(2, turn=2 * 0.5 / (0.5 - 0.4))
    found = rx.solve(mechanism, state)
    assert found.stats.violation.acceleration < 1e-14
    parallel = rx.solve(*flat(2))
    assert abs(found.acceleration[-1]) > 1 > 1e-12 > abs(parallel.acceleration[-1])  # of the coupler's turn


@pytest.mark.parametrize("count", [2, 3, 4])
@pytest.mark.parametrize("masses", ["equal", "unequal"])
def test_the_parallel_branch_is_right_flat_and_beside(count, masses):
    """Flat, (7) has two degrees of freedom and does not know that the coupler stays parallel; loads grow as 1 / phi."""
    m = np.ones(count) if masses == "equal" else np.arange(1.0, count + 1)
    found = rx.solve(*flat(count, crank_mass=m))
    assert found.stats.freedom == 2
    coupler, g, length = 4.0, 9.81, 0.5
    limit = -g * (np.sum(m) / 2 + coupler) / (length * (np.sum(m) / 3 + coupler))
    beside = {phi: rx.solve(*flat(count, crank_mass=m, phi=phi)) for phi in (1e-3, 1e-4)}
    np.testing.assert_allclose(found.acceleration[2 * count + 2 : -1], limit, rtol=1e-13)
    assert abs(beside[1e-4].acceleration[2 * count + 2] / limit - 1) <= 1e-7
    forces = [np.max(np.abs(solution.multipliers)) for solution in beside.values()]
    symmetric = masses == "equal" and count == 2
    assert symmetric or 9 < forces[1] / forces[0] < 11


# Arguments ----------------------------------------------------------------------------------


@every_kind
def test_all_numbers_may_be_tracers(name):
    """Those of friction too; that a solve of tracers is one of numbers is for tests of `solve`."""
    case = CASES[name]
    given = case.arguments(True)
    counts = {key: value for key, value in given.items() if isinstance(value, int)}
    numbers = {key: jax.tree.map(jnp.asarray, value) for key, value in given.items() if key not in counts}

    def parts(numbers, x, rate):
        mechanism = case.make(**counts, **numbers)
        state = mechanism.state(x, rate=rate, t=float(case.t))
        return mechanism.load(state), mechanism.constraint(state.q, state.t), mechanism.mass(state.q, state.t)

    shapes = [found.shape for found in jax.eval_shape(parts, numbers, jnp.ones(()), jnp.ones(()))]
    assert shapes == [(case.n,), (case.m,), (case.n, case.n)]


@pytest.mark.slow
def test_gradient_moves_the_pose_with_the_lengths():
    """Uniform cranks: phi'' is proportional to 1 / l, the acceleration of the coupler does not change."""

    def acceleration(length):
        mechanism = rx.mechanisms.parallelogram(3, length)
        return rx.solve(mechanism, mechanism.state(0.9, rate=0.0)).acceleration

    value, slope = jax.jvp(acceleration, (0.5,), (1.0,))
    assert abs(slope[8] + value[8] / 0.5) <= 1e-12 * abs(slope[8])
    assert np.max(np.abs(slope[:8])) <= 1e-12 * np.max(np.abs(value))


@pytest.mark.parametrize("length", range(4), ids=["crank", "coupler", "rocker", "ground"])
def test_gradient_of_a_closed_loop(length):
    def acceleration(lengths):
        crank, coupler, rocker, ground = lengths
        mechanism = rx.mechanisms.doubled_four_bar(crank=crank, coupler=coupler, rocker=rocker, ground=ground)
        return rx.solve(mechanism, mechanism.state(0.9, rate=2.0)).acceleration

    start, along = np.array([0.25, 0.52, 0.5, 0.33]), np.eye(4)[length]
    _, slope = jax.jvp(acceleration, (start,), (along,))
    step = 1e-5
    rough = (acceleration(start + step * along) - acceleration(start - step * along)) / (2 * step)
    assert close(slope, np.array(rough), 1e-6)


@pytest.mark.parametrize("name", ["three cranks", "doubled four-bar", "slider-crank, two guides"])
def test_single_precision(name, float32):
    case = CASES[name]
    mechanism = case.make(**case.arguments())
    found = rx.solve(mechanism, mechanism.state(float(case.at), rate=float(case.rate)))
    assert found.acceleration.dtype == np.float32
    assert found.stats.rank == case.rank
    truth = exact.floats(case.exact.solve(friction=False).acceleration)
    assert registry.agree(found.acceleration, truth, registry.kinds_of(mechanism.coordinates), 1e-4)


@pytest.mark.parametrize(
    ("make", "arguments", "message"),
    [
        ("parallelogram", {"cranks": 1}, "`cranks` must be at least 2, but is 1.* second crank"),
        ("driven_parallelogram", {"cranks": 0}, "`cranks` must be at least 2, but is 0"),
        ("swing", {"rods": 1}, "`rods` must be at least 2, but is 1.* second rod"),
        ("n_four_bar", {"loops": 0}, "`loops` must be at least 1, but is 0"),
        ("slider_crank", {"guides": 0}, "`guides` must be at least 1, but is 0"),
        ("carriage", {"guides": 0}, "`guides` must be at least 1, but is 0"),
        ("parallelogram", {"spacing": [0.1] * 3}, r"`spacing` must be a number or have 2 entries.*\(3,\)"),
        ("parallelogram", {"mu_rho": [0.1] * 3}, "`mu_rho` must be a number or have 6 entries, one for each joint"),
        ("doubled_four_bar", {"coupler_mass": [1.0]}, "`coupler_mass` must be a number or have 2 entries"),
        ("carriage", {"mu": 0.1}, "`guide_length` of the translational joint 'K1' must be given"),
    ],
)
def test_bad_arguments(make, arguments, message):
    with pytest.raises(rx.RedundaxError, match=f"^Argument {message}"):
        getattr(rx.mechanisms, make)(**arguments)


def test_a_loop_that_cannot_be_closed_is_flagged():
    mechanism = rx.mechanisms.doubled_four_bar(ground=5.0)
    state = mechanism.state(0.9, rate=1.0)
    assert np.any(np.isnan(state.q))
    assert rx.solve(mechanism, state, throw=False).result != rx.RESULTS.successful


# Compiled programs --------------------------------------------------------------------------


@contextlib.contextmanager
def compiled_programs():
    """Counts what XLA compiles, or takes from the cache on disk, meanwhile."""
    events = []

    def listen(event, duration, **_):
        if event.endswith("backend_compile_duration"):
            events.append(event)

    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        yield events
    finally:
        jax.monitoring.unregister_event_duration_listener(listen)


@pytest.mark.parametrize("friction", [pytest.param(False, marks=pytest.mark.slow), True], ids=["smooth", "friction"])
def test_second_mechanism_of_the_same_counts_compiles_nothing(friction, programs_at_once):
    """Other names, lengths and masses, and even other bodies on the joints; results by name neither."""
    jax.clear_caches()
    mu_rho = 0.001 if friction else None
    pairs = [
        (rx.mechanisms.n_four_bar(3, mu_rho=mu_rho), rx.mechanisms.n_four_bar(3, 0.7, [1, 2, 3], 2.0, mu_rho=mu_rho)),
        (rx.mechanisms.parallelogram(3, mu_rho=mu_rho), rx.mechanisms.doubled_four_bar(mu_rho=mu_rho)),
    ]
    for number, (first, second) in enumerate(pairs):
        states = first.state(0.9, rate=2.0), second.state(0.8, rate=1.0)
        with compiled_programs() as fresh:
            rx.solve(first, states[0])["A1.angle''"]
        assert fresh or number
        with compiled_programs() as again:
            rx.solve(second, states[1])["A.angle''" if number else "A1.angle''"]
        assert not again


COMPILE = """
import json, sys, time
import jax
jax.config.update("jax_enable_x64", True)
import equinox as eqx
import redundax as rx

def seconds(loops):
    mechanism = rx.mechanisms.n_four_bar(loops)
    state = mechanism.state(0.9, rate=1.0)
    mechanism = mechanism.anonymous
    jax.clear_caches()
    start = time.process_time()
    traced = eqx.filter_jit(lambda system, state: rx.solve(system, state)).lower(mechanism, state)
    middle = time.process_time()
    program = traced.compile()
    end = time.process_time()
    begin = time.perf_counter()
    jax.block_until_ready(eqx.filter(program(mechanism, state), eqx.is_array))
    return {"trace": middle - start, "compile": end - middle, "run": time.perf_counter() - begin}

seconds(1)  # what is imported or set up once
rounds = {loops: [seconds(loops) for _ in range(3)] for loops in (2, 40)}
print(json.dumps({n: {key: min(r[key] for r in rs) for key in rs[0]} for n, rs in rounds.items()}))
"""


def compile_seconds():
    """Processor time to trace and to compile a solve, for 2 and 40 loops, the best of three; no cache on disk."""
    environment = {key: value for key, value in os.environ.items() if key != "JAX_COMPILATION_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", COMPILE], env=environment, capture_output=True, text=True, timeout=1500, check=False
    )
    assert done.returncode == 0, done.stderr
    return {int(loops): times for loops, times in json.loads(done.stdout).items()}


@pytest.mark.slow
def test_compile_time_does_not_grow_with_the_number_of_loops(record_property):
    """20 times the loops: time that grew with them would be about 20 times as long."""
    times = compile_seconds()
    record_property("seconds", times)
    assert times[40]["compile"] <= 4 * times[2]["compile"], times
    assert times[40]["trace"] <= 4 * times[2]["trace"], times


@pytest.mark.slow
def test_large_scene():
    """40 loops: rank, exactness of the state and the acceleration of the pendulum."""
    mechanism = rx.mechanisms.n_four_bar(40)
    state = mechanism.state(0.9, rate=1.0)
    found = rx.solve(mechanism, state)
    assert (found.stats.rank, found.stats.redundancy, found.stats.freedom) == (242, 0, 1)
    assert found.stats.violation.position < 1e-14
    expected = -9.81 * np.cos(0.9) * (41 / 2 + 40) / (41 / 3 + 40)
    assert close(found.acceleration[162:203], expected, 1e-12)


FACTORIES = [value for value in vars(rx.mechanisms).values() if inspect.isfunction(value)]


@pytest.mark.slow
@pytest.mark.parametrize("factory", FACTORIES)
def test_numbers_of_mechanisms_may_be_traced(factory):
    for name, argument in inspect.signature(factory).parameters.items():
        if np.asarray(argument.default).dtype == float:
            made = eqx.filter_eval_shape(lambda x, n=name: factory(**{n: x}), jnp.asarray(argument.default))
            assert isinstance(made, rx.Mechanism)


@pytest.mark.skipif(os.environ.get("REDUNDAX_CHECKS") == "on", reason="types of calls are refused before")
@pytest.mark.parametrize("factory", FACTORIES)
def test_arguments_of_mechanisms_are_refused_by_name(factory):
    for name in inspect.signature(factory).parameters:
        for wrong in ("x", None, [1, 2, 3, 4, 5]):
            try:
                factory(**{name: wrong})
            except rx.RedundaxError as error:
                assert f"`{name}`" in str(error) or isinstance(wrong, list)


def main() -> None:
    """Print the errors of every case, and compile times."""
    jax.config.update("jax_enable_x64", True)
    for name in CASES:
        for friction in (False, True):
            try:
                found = errors(name, friction)
                line = "  ".join(f"{kind} {error:.0e}" for kind, error in found.items())
            except RuntimeError as reason:
                line = str(reason)[:80]
            print(f"{name:38s}{'friction' if friction else '':10s}{line}", flush=True)
    for loops, times in compile_seconds().items():
        print(f"{loops:3d} loops: " + ", ".join(f"{key} {value:.3f} s" for key, value in times.items()))


if __name__ == "__main__":
    main()
