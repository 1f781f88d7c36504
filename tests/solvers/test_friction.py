"""Friction: the iterations are the paper's, their ends are solutions, and the laws of friction hold."""

import dataclasses
from typing import ClassVar
from unittest import mock

import equinox as eqx
import jax
import jax.numpy as jnp
import literal
import numpy as np
import pytest
import registry
from truth import exact, friction, paper, scenes

import redundax as rx
from redundax._solve import _solve
from redundax._solvers import _open_newton, _solver
from redundax._solvers._iterate import Progress

FRICTIONAL = [name for name in registry.EVERYTHING if registry.case(name).system.friction]
every_case = pytest.mark.parametrize("name", FRICTIONAL)
STEPS = 12  # of Newton; quadratic convergence needs fewer


def of(name):
    case = registry.case(name)
    return case.system, case.state, len(case.system.rows) - case.redundancy


def whole(solution):
    return np.concatenate([solution.acceleration, solution.multipliers])


def agree(x, reference, system, tolerance):
    kinds = [*system.coordinates.kinds, *system.rows.kinds]
    return registry.agree(x, reference, kinds, tolerance)


def paper_state(u, phi=np.pi / 4, rate=1.0):
    u = float(u)  # of one type, so that all are one program
    p = paper.Parameters(u=u)
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02, u=u)
    return mechanism, mechanism.state(phi=phi, rate=rate), p, paper.configuration(p, phi, rate)


@eqx.filter_jit
def literal_sweeps(system, state, rank, h, count):
    """x_1 .. x_count of (27), and its end."""
    e = literal.equations(system, state, rank)
    return literal.fixed_point_iterates(e, count, h), literal.fixed_point(e, h)


@eqx.filter_jit
def literal_newton(system, state, rank, x0):
    """x_1 .. of (38)."""
    return literal.newton_iterates(literal.equations(system, state, rank), x0, STEPS)


@eqx.filter_jit
def literal_end(system, state, rank, h, x):
    """The end of (27); A, A^+, and b at a given x."""
    e = literal.equations(system, state, rank)
    return literal.fixed_point(e, h), e.a, e.a_pinv, e.right_side(x)


@eqx.filter_jit
def library_iterates(loop, system, state, count, **options):
    """x after 0 .. count - 1 updates of the library's own iteration, whatever its stop would say.

    `loop` is the module whose `iterate` is put aside; the rest is `rx.solve` as it is.
    """

    def after(steps):
        def run(update, start, *_, **__):
            y = jax.lax.fori_loop(0, steps.astype(int), lambda _, y: update(y)[0], start)
            return y, Progress.done(jnp.float64)

        traced_anew = mock.patch.object(_solve, "_solved_dense", _solve._solved)
        as_it_is = mock.patch.object(rx.FixedPoint, "_finished", lambda solver, problem, tau: tau)
        open_as_it_is = mock.patch.object(_open_newton, "_finished", lambda problem, stress, tau: tau)
        with mock.patch.object(loop, "iterate", run), as_it_is, open_as_it_is, traced_anew:
            solution = rx.solve(system, state, **options)
        return jnp.concatenate([solution.acceleration, solution.multipliers])

    return jax.vmap(after)(jnp.arange(float(count)))  # numbers of no derivative may not be captured


# Fixed point (27) ---------------------------------------------------------------------------


@pytest.mark.parametrize("u", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("h", [0.0, 50.0])
def test_fixed_point_makes_the_iterates_of_the_paper(u, h):
    """The literal form makes them all; the library from x_1 on, with three sweeps for one test."""
    mechanism, state, p, there = paper_state(u)
    *iterates, end = np.array(paper.fixed_point(p, *there, h))[1:]
    h = jnp.asarray(np.full(24, h))
    nameless = mechanism.anonymous  # and without units, so that all are one program
    literal_ones, literal_end = literal_sweeps(nameless, state, paper.RANK, h, 24)
    options = {"closure": rx.MinimumNorm(h), "solver": rx.FixedPoint()}
    library = library_iterates(_solver, nameless, state, 8, **options)
    for step, theirs in enumerate(iterates[:24]):
        assert agree(literal_ones[step], theirs, mechanism, 1e-11)
        if step % 3 == 0:
            assert agree(library[step // 3], theirs, mechanism, 1e-11)
    assert agree(literal_end, end, mechanism, 1e-10)


def closed_solvers():
    for name in FRICTIONAL:
        yield name, rx.Newton()
        dear = name.startswith(("parallelogram", "slider_crank"))
        yield pytest.param(name, rx.FixedPoint(), marks=pytest.mark.slow if dear else ())


@pytest.mark.parametrize(("name", "solver"), [*closed_solvers()])
@pytest.mark.parametrize("h", [0.0, 20.0])
def test_closed_solvers_end_where_the_literal_fixed_point_does(name, solver, h):
    """And there A x = b(x) (25) holds, so that Appendix A's d = (I - A A^+) b(x) = 0 (32)."""
    system, state, rank = of(name)
    h = np.full(len(system.coordinates) + len(system.rows), h)
    x = whole(registry.solve(system, state, h, solver=solver))
    end, a, a_pinv, b = (np.array(item) for item in literal_end(system, state, rank, h, x))
    assert agree(x, end, system, 1e-11)
    assert np.max(np.abs(a @ x - b)) <= 1e-12 * np.max(np.abs(b))
    assert np.max(np.abs(b - a @ (a_pinv @ b))) <= 1e-12 * np.max(np.abs(b))


# Open Newton (38) ---------------------------------------------------------------------------

STARTS = [(row.u, row.start) for row in paper.TABLE4] + [(1.0, "anywhere"), (10.0, "anywhere")]


NOT_QUICK = rx.Newton(max_steps=0)  # so that the iteration number by number hands over


def start_of(start):
    if start == "anywhere":
        return jnp.asarray(30 * np.random.default_rng(5).normal(size=24))
    return jnp.asarray(np.full(24, float(start)))


@pytest.mark.parametrize(("u", "start"), STARTS)
def test_open_newton_makes_the_iterates_of_the_paper(u, start):
    """Step by step: the paper's in NumPy, the literal full form, and the library's."""
    mechanism, state, p, there = paper_state(u)
    x0 = start_of(start)
    iterates = paper.newton(p, *there, np.array(x0))[1:]
    nameless = mechanism.anonymous
    full = literal_newton(nameless, state, paper.RANK, x0)
    library = library_iterates(_open_newton, nameless, state, STEPS, closure=None, x0=x0, solver=NOT_QUICK)
    for theirs, literally, mine in zip(iterates, full, library, strict=False):
        assert agree(literally, theirs, mechanism, 1e-9)
        assert agree(mine, theirs, mechanism, 1e-9)


@pytest.mark.parametrize(("u", "start"), STARTS)
def test_open_newton_ends_where_the_paper_does(u, start):
    mechanism, state, p, there = paper_state(u)
    end = paper.newton(p, *there, np.array(start_of(start)))[-1]
    solution = registry.solve(mechanism, state, closure=None, x0=start_of(start))
    assert agree(whole(solution), end, mechanism, 1e-9)
    tau = paper.friction(p, end[12:], there[1])[0]
    assert registry.agree(solution.friction, tau, ["angular"] * 4, 1e-9)
    assert solution.stats.steps > 0 and solution.stats.residual < 1e-13


def test_open_newton_of_weak_and_strong_friction_in_one_batch():
    """With mu_rho = 0.06 m and more nothing is proved beforehand, and the loop with pivots takes over."""
    radii, starts = np.repeat([0.02, 0.05, 0.06, 0.08], 2), 50 * np.random.default_rng(3).normal(size=(8, 24))

    def function(radius, x0):
        mechanism = rx.mechanisms.wojtyra2020(mu_rho=radius)
        return rx.solve(mechanism, mechanism.state(phi=np.pi / 4, rate=1.0), closure=None, x0=x0)

    ends = jax.jit(jax.vmap(function))(radii, starts)
    mechanism, _, p, there = paper_state(1.0)
    for k, (radius, x0) in enumerate(zip(radii, starts, strict=True)):
        own = dataclasses.replace(p, mu_rho=radius)
        end = paper.newton(own, *there, x0)[-1]
        assert agree(np.concatenate([ends.acceleration[k], ends.multipliers[k]]), end, mechanism, 1e-11)
        assert np.max(np.abs(ends.friction[k] - paper.friction(own, end[12:], there[1])[0])) <= 1e-11


class Proportional(rx.AbstractFrictionModel):
    """A user's model whose coefficient is a plain number."""

    depends_on_load: ClassVar[bool] = True
    has_sense: ClassVar[bool] = True
    radius: float

    def force(self, normal_load, rate, sense, memory):
        return -self.radius * normal_load * sense

    def slope_bound(self, rate, memory):
        return jnp.asarray(self.radius)


def falling(v):
    return 0.3 + 0.1 * np.exp(-((v / 0.02) ** 2))


# Models, and force and bristle rate of their surfaces from normal load, slip rate and deflection.
SURFACES = {
    "Coulomb": (rx.Coulomb(0.3, 5.0), lambda n, v, z: -0.3 * (n + 5.0) * np.sign(v)),
    "regularised": (rx.RegularisedCoulomb(0.3, 0.02), lambda n, v, z: -0.3 * n * np.tanh(v / 0.02)),
    "Stribeck": (
        rx.Stribeck(0.4, 0.3, velocity=0.02, viscous=7.0),
        lambda n, v, z: -falling(v) * n * np.sign(v) - 7.0 * v,
    ),
    "constant": (rx.ConstantFriction(6.0), lambda n, v, z: -6.0 * np.sign(v)),
    "Dahl": (rx.Dahl(0.3, 3000.0), lambda n, v, z: -3000.0 * n * z, lambda v, z: v - 3000.0 * abs(v) * z / 0.3),
    "LuGre": (
        rx.LuGre(0.4, 0.3, velocity=0.02, stiffness=3000.0, damping=2.0, viscous=0.5),
        lambda n, v, z: -n * (3000.0 * z + 2.0 * (v - 3000.0 * abs(v) * z / falling(v)) + 0.5 * v),
        lambda v, z: v - 3000.0 * abs(v) * z / falling(v),
    ),
}


@pytest.mark.parametrize("name", SURFACES)
def test_friction_of_a_pin_is_that_of_surfaces_at_its_radius(name):
    """A rod of 1 m and 1 kg swings through the bottom on a pin of 15 mm: phi'' / 3 = tau = r F(N, r w)."""
    model, force, *bend = SURFACES[name]
    r, w, z = 0.015, 2.0, 4e-5
    pin = rx.Revolute("A", "rod", "ground", (-0.5, 0.0), (0.0, 0.0), pin_radius=r, friction=model)
    rod = rx.Mechanism([rx.Body("rod", 1.0, 1 / 12)], [pin], gravity=(0.0, -10.0))
    state = rx.State([0.0, -0.5, -np.pi / 2], [w / 2, 0.0, w], memory=(jnp.array([z]),) if bend else ())
    solution = rx.solve(rod, state)
    normal = np.hypot(solution["rod.phi''"] / 2, 10.0 + w**2 / 2)
    np.testing.assert_allclose(solution["tau A"], r * force(normal, r * w, z), rtol=1e-12)
    np.testing.assert_allclose(solution["rod.phi''"] / 3, solution["tau A"], rtol=1e-12)
    for rate in bend:
        found = rod.friction[0].memory_rate(jnp.array([w]), jnp.array([z]), state)
        np.testing.assert_allclose(found, [rate(r * w, z)], rtol=1e-12)


def test_a_pin_with_friction_needs_its_radius():
    with pytest.raises(rx.RedundaxError, match="`pin_radius` of the revolute joint 'A'"):
        rx.Revolute("A", "rod", "ground", (-0.5, 0.0), (0.0, 0.0), friction=rx.Coulomb(0.3))


@pytest.mark.parametrize(
    "way",
    [{}, {"closure": None, "x0": 5.0}, pytest.param("motion", marks=pytest.mark.slow)],
    ids=["closed", "open", "motion"],
)
def test_a_model_of_the_user_may_hold_plain_numbers(way):
    """A rod of 1 m and 1 kg swings through the bottom: phi'' / 3 = -0.01 |R|, R = (phi'' / 2, g + w^2 / 2)."""
    pin = rx.Revolute("A", "rod", "ground", (-0.5, 0.0), (0.0, 0.0), pin_radius=1.0, friction=Proportional(0.01))
    rod = rx.Mechanism([rx.Body("rod", 1.0, 1 / 12)], [pin], gravity=(0.0, -10.0))
    state = rx.State([0.0, -0.5, -np.pi / 2], [1.0, 0.0, 2.0])
    if way == "motion":
        found = rx.simulate(rod, state, 0.1, ts=[0.0]).acceleration[0]
    else:
        found = rx.solve(rod, state, **way).acceleration
    np.testing.assert_allclose(found[2], -0.36 / np.sqrt(1 - 0.015**2), rtol=1e-12)


@pytest.mark.parametrize(("u", "start"), [(1e-4, -50), (1e2, 50)])
def test_open_newton_in_extreme_units(u, start):
    """Against 50 digits."""
    mechanism, state, *_ = paper_state(u)
    solution = registry.solve(mechanism, state, closure=None, x0=float(start))
    true = friction.open_newton(scenes.wojtyra2020(u=exact.exact(u)), [start] * 24)
    end = exact.floats((*true.acceleration, *true.multipliers))
    assert agree(whole(solution), end, mechanism, 1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["parallelogram", "slider_crank"])
def test_open_newton_from_anywhere_is_the_literal_one(name):
    system, state, rank = of(f"{name} with friction")
    for seed in range(3):
        size = len(system.coordinates) + len(system.rows)
        x0 = 30 * np.random.default_rng(seed).normal(size=size)
        iterates = literal_newton(system, state, rank, x0)
        library = library_iterates(_open_newton, system, state, STEPS, closure=None, x0=x0, solver=NOT_QUICK)
        for mine, literally in zip(library, iterates, strict=True):
            assert agree(mine, literally, system, 1e-9)
        solution = registry.solve(system, state, closure=None, x0=x0)
        assert agree(whole(solution), iterates[-1], system, 1e-9)


@pytest.mark.parametrize("name", ["wojtyra2020 with friction", "parallelogram with friction"])
def test_open_newton_from_a_solution_stays(name):
    system, state, _ = of(name)
    h = np.full(len(system.coordinates) + len(system.rows), 20.0)
    closed = registry.solve(system, state, h)
    again = registry.solve(system, state, closure=None, x0=whole(closed))
    assert agree(whole(again), whole(closed), system, 1e-12)


# Friction that does not depend on load (24) ------------------------------------------------


def constant(size: float):
    return lambda joint: rx.ConstantFriction(size * (1 + 0.5 * (joint.name == "B")))


@pytest.mark.parametrize("name", ["wojtyra2020", "parallelogram", "slider_crank"])
def test_constant_friction_is_an_applied_moment(name):
    mechanism = registry.MECHANISMS[name]()
    system, state = registry.build(mechanism, constant(0.5))
    bodies = list(mechanism.bodies)
    tau = [
        -float(constant(0.5)(joint).size) * sense
        for joint, sense in zip(mechanism.revolutes, mechanism.senses, strict=True)
    ]
    with exact.exactly:
        for joint, moment in zip(mechanism.revolutes, tau, strict=True):
            for body, sign in ((joint.i, 1), (joint.j, -1)):
                if body:
                    fx, fy, m = bodies[body - 1].load
                    load = (fx, fy, m + sign * exact.exact(moment))
                    bodies[body - 1] = dataclasses.replace(bodies[body - 1], load=load)
    truth = dataclasses.replace(mechanism, bodies=tuple(bodies)).solve(friction=False)
    solution = registry.solve(system, state)
    parts = exact.floats(truth.acceleration), exact.floats(truth.multipliers), np.array(tau)
    errors = registry.errors_of(solution, parts, system)
    assert max(errors.values()) <= 1e-13, errors
    assert solution.stats.steps == 0


@pytest.mark.parametrize("name", ["wojtyra2020", "parallelogram", "slider_crank"])
def test_accelerations_are_unique_where_friction_does_not_read_the_load(name):
    system, state = registry.build(registry.MECHANISMS[name](), constant(0.5))
    size = len(system.coordinates) + len(system.rows)
    reference = registry.solve(system, state)
    for seed in range(4):
        h = 100 * np.random.default_rng(seed).normal(size=size)
        solution = registry.solve(system, state, h)
        assert registry.agree(solution.acceleration, reference.acceleration, system.coordinates.kinds, 1e-12)
        assert np.max(np.abs(solution.multipliers - reference.multipliers)) > 1


def test_accelerations_are_unique_where_friction_reads_unique_multipliers():
    """(33): the wire force of the bead is unique, though its two multipliers are not."""
    case = registry.case("bead")
    for h in (0.0, 100.0, -30.0):
        solution = registry.solve(case.system, case.state, h * np.array([0, 0, 1.0, 0]))
        assert registry.agree(solution.acceleration, case.acceleration, ["linear"] * 2, 1e-13)
        assert registry.agree(solution.friction, case.friction, ["linear"], 1e-13)


# Laws of friction ---------------------------------------------------------------------------


def on_guides(mu: float, preload: float = 0.0, speed: float = 1.0):
    """The carriage with friction in both guides, of contact distances 1/5 and 3/10."""
    mechanism = registry.MECHANISMS["carriage"]()
    guides = zip(mechanism.translationals, (0.2, 0.3), strict=True)
    guides = [dataclasses.replace(joint, mu=mu, length=length) for joint, length in guides]
    rough = dataclasses.replace(mechanism, translationals=tuple(guides))
    system, state = registry.build(rough, lambda joint: rx.Coulomb(joint.mu, preload))
    return mechanism, system, rx.State(state.q, speed * state.qd)


@pytest.mark.parametrize("speed", [1.0, -2.0])
@pytest.mark.parametrize("preload", [0.0, 3.0])
def test_guides_rub_on_both_ends(speed, preload):
    """(25) by hand for one body: M qdd + Phi_q^T lam = Q + E tau, tau = -mu (|N1| + |N2| + N0) s."""
    mechanism, system, state = on_guides(0.15, preload, speed)
    solution = registry.solve(system, state)
    jac, load = exact.floats(mechanism.jacobian), exact.floats(mechanism.load)
    axis, lam = np.array([0.6, 0.8]), np.array(solution.multipliers)
    half, couple = lam[:2] / 2, lam[2:] / np.array([0.2, 0.3])
    normal = np.abs(half + couple) + np.abs(half - couple) + preload
    tau = -0.15 * normal * np.sign(speed)
    assert registry.agree(solution.friction, tau, ["linear"] * 2, 1e-13)
    arms = [exact.floats(joint.s_i) for joint in mechanism.translationals]
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    moments = [(turn @ arm) @ [axis[1], -axis[0]] for arm in arms]
    force = load + np.array([*(tau.sum() * axis), tau @ moments])
    balance = exact.floats(mechanism.mass_matrix) @ solution.acceleration + jac.T @ lam - force
    assert np.max(np.abs(balance)) <= 1e-12 * np.max(np.abs(force))
    assert np.max(np.abs(jac @ solution.acceleration)) <= 1e-12
    assert np.max(np.abs(exact.floats(mechanism.selfstress).T @ lam)) <= 1e-12 * np.max(np.abs(lam))


@every_case
def test_friction_takes_power(name):
    system, state, _ = of(name)
    solution = registry.solve(system, state)
    rate, _ = eqx.filter_jit(literal.slip_motion)(system, state)
    assert np.all(np.array(solution.friction) * np.array(rate) < 0)


@pytest.mark.parametrize("name", ["wojtyra2020", "parallelogram", "slider_crank"])
def test_no_coefficient_is_no_friction(name):
    mechanism = registry.MECHANISMS[name]()
    smooth = registry.solve(*registry.build(mechanism))
    rubbing = registry.solve(*registry.build(mechanism, lambda joint: rx.Coulomb(0.0)))
    for value, reference in ((rubbing.acceleration, smooth.acceleration),
                             (rubbing.multipliers, smooth.multipliers)):  # fmt: skip
        assert np.max(np.abs(value - reference)) <= 1e-13 * np.max(np.abs(reference))
    assert not np.any(np.array(rubbing.friction))


def test_a_preload_is_a_normal_load_that_is_always_there():
    """Coulomb friction of preload N alone is constant friction mu N."""
    mechanism = registry.MECHANISMS["parallelogram"]()

    def friction(joint):
        return rx.Coulomb(float(joint.mu_rho), preload=4.0)

    solution = registry.solve(*registry.build(mechanism, friction))
    lam = np.array(solution.multipliers).reshape(-1, 2)
    mu_rho = np.array([float(joint.mu_rho) for joint in mechanism.revolutes])
    tau = -mu_rho * (np.linalg.norm(lam, axis=1) + 4.0) * np.array(mechanism.senses)
    assert registry.agree(solution.friction, tau, ["angular"] * 6, 1e-13)


@pytest.mark.parametrize("rate", [1e-12, -1e-12])
def test_the_sign_of_a_given_sense_is_taken_where_a_joint_rests(rate):
    mechanism, slow, _, (_, qd) = paper_state(1.0, rate=rate)
    at_rest = rx.State(slow.q, 0 * slow.qd)
    given = registry.solve(mechanism, at_rest, sense=0.3 * paper.senses(qd))
    truth = scenes.wojtyra2020(rate=rate).solve()
    assert agree(whole(given), whole(registry.solve(mechanism, slow)), mechanism, 1e-13)
    parts = (truth.acceleration, truth.multipliers, truth.friction)
    errors = registry.errors_of(given, tuple(exact.floats(part) for part in parts), mechanism)
    assert max(errors.values()) <= 1e-13, errors


def test_a_joint_that_moves_has_the_sense_of_its_rate():
    mechanism, state, *_ = paper_state(1.0)
    told = registry.solve(mechanism, state, sense=np.full(4, -1.0))
    assert agree(whole(told), whole(registry.solve(mechanism, state)), mechanism, 1e-15)


def test_an_opaque_friction_force_is_the_same():
    """F(lam, q, qd) in one piece, slip = q: the case E = I."""
    mechanism, state, p, (_, qd) = paper_state(1.0)
    smooth = rx.mechanisms.wojtyra2020()
    spread = jnp.asarray(paper.DISTRIBUTION * (-p.pivot * paper.senses(qd)))
    friction = rx.Friction(
        lambda q, t, _: q,
        lambda loads, rate, sense, memory, state, _: spread @ jnp.linalg.norm(loads[:8].reshape(4, 2), axis=1),
        np.arange(12),
        mechanism.coordinates.kinds,
    )
    system = rx.System(
        lambda q, t, _: smooth.constraint(q, t),
        smooth.mass(state.q, state.t),
        lambda q, qd, t, _: smooth.load(rx.State(q, qd, t)),
        coordinates=mechanism.coordinates,
        rows=mechanism.rows,
        friction=friction,
    )
    for options in ({}, {"closure": None, "x0": 50.0}):
        opaque, joints = registry.solve(system, state, **options), registry.solve(mechanism, state, **options)
        assert agree(whole(opaque), whole(joints), mechanism, 1e-11)
        assert registry.agree(opaque.friction, paper.DISTRIBUTION @ joints.friction, ["angular"] * 12, 1e-11)


@pytest.mark.parametrize("mu_rho", [0.005, 0.02, 0.04])
def test_newton_agrees_with_the_fixed_point_wherever_that_contracts(mu_rho):
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    for phi in (-2.0, 0.2, 0.8, 2.4):
        for rate in (-1.0, 1.0, 3.0):
            state = mechanism.state(phi=phi, rate=rate)
            fixed = registry.solve(mechanism, state, solver=rx.FixedPoint(), throw=False)
            newton = registry.solve(mechanism, state, throw=False)
            if fixed.result == rx.RESULTS.successful:
                assert newton.result == rx.RESULTS.successful
                assert agree(whole(newton), whole(fixed), mechanism, 1e-11)
