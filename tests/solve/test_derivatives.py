"""Derivatives: forward and reverse mode agree with each other and with central differences.

Geometry moves the state with the lengths, so that they are derivatives of a mechanism that closes.
"""

from functools import partial

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
import pytest
import registry
from mechanisms import CASES

import redundax as rx

PARAMETERS = {"length": 0.1, "mass": 1.0, "mu_rho": 0.02, "gravity": 10.0, "rate": 1.3, "h": 50.0}
SIZES = np.array(list(PARAMETERS.values()))
WEIGHTS = np.random.default_rng(10).normal(size=28)
SOLVERS = {"newton": rx.Newton(), "fixed point": rx.FixedPoint()}
slow = partial(pytest.param, marks=pytest.mark.slow)


def values(relative, closure, solver="newton"):
    """Accelerations, multipliers and friction of the paper's mechanism at multiples of PARAMETERS.

    `h` is that of the minimum norm, the size of a misfit, or x0 of the open iteration.
    """
    *known, rate, h = SIZES * relative
    mechanism = rx.mechanisms.wojtyra2020(*known)
    compliance = rx.Compliance(jnp.arange(1.0, 13.0), h * jnp.arange(-5.0, 7.0))
    options = {
        "h": {"closure": rx.MinimumNorm(h)},
        "compliance": {"closure": compliance},
        "open": {"closure": None, "x0": h},
    }[closure]
    state = mechanism.state(phi=0.7, rate=rate)
    solution = rx.solve(mechanism, state, solver=SOLVERS[solver], **options)
    return jnp.concatenate([solution.acceleration, solution.multipliers, solution.friction])


def derivatives(function):
    """(x, direction, covector) -> value, its derivative along the direction, and the pulled covector."""

    @jax.jit
    def both(x, direction, covector):
        value, along = jax.jvp(function, (x,), (direction,))
        return value, along, jax.vjp(function, x)[1](covector)[0]

    return both


def difference(function, x, direction, step=1e-4):
    """Central difference of fourth order along a direction."""
    near, far = (np.asarray(function(x + k * step * direction)) - function(x - k * step * direction) for k in (1, 2))
    return (8 * near - far) / (12 * step)


def close(value, reference, tolerance):
    value, reference = np.asarray(value), np.asarray(reference)
    scale = np.max(np.abs(reference))
    return np.max(np.abs(value - reference)) <= tolerance * (scale if scale else 1.0)


def assert_consistent(both, x, directions, covector, tolerance=1e-8):
    """Forward mode is the difference, and reverse mode is forward mode."""
    for direction in directions:
        _, along, pulled = both(x, direction, covector)
        expected = difference(lambda y, v=direction: both(y, v, covector)[0], x, direction)
        assert np.all(np.isfinite(along)) and np.all(np.isfinite(pulled))
        assert close(along, expected, tolerance)
        assert abs(pulled @ direction - covector @ along) <= 1e-10 * np.sum(np.abs(covector * along))


@pytest.mark.parametrize(("closure", "solver"), [
    ("h", "newton"), slow("open", "newton"), slow("compliance", "fixed point"),
])  # fmt: skip
def test_forward_reverse_and_differences_agree(closure, solver):
    both = derivatives(lambda x: values(x, closure, solver))
    assert_consistent(both, np.ones(SIZES.size), np.eye(SIZES.size), WEIGHTS)


@pytest.mark.slow
@pytest.mark.parametrize("mu_rho", [0.0, 0.02])
@pytest.mark.parametrize("solver", [rx.Continuation(), slow(rx.Newton()), slow(rx.FixedPoint())])
def test_the_gradient_of_a_batch_is_the_batch_of_slopes(mu_rho, solver):
    """Without `jit` around them, where JAX batches and differentiates the compiled solution itself."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    state, hs = mechanism.state(phi=0.7, rate=1.3), jnp.array([-20.0, 5.0, 60.0])

    def value(h):
        solution = rx.solve(mechanism, state, closure=rx.MinimumNorm(h), solver=solver)
        return WEIGHTS[:24] @ jnp.concatenate([solution.acceleration, solution.multipliers])

    gradient = jax.grad(lambda hs: jnp.sum(jax.vmap(value)(hs)))(hs)
    slopes = [difference(value, h, 1.0, step=1.0) for h in hs]
    np.testing.assert_allclose(gradient, slopes, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(jax.vmap(jax.grad(value))(hs), gradient, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("closure", ["compliance", "open"])
def test_forward_over_reverse_is_the_difference_of_the_gradient(closure):
    gradient = jax.grad(lambda x: jnp.sum(WEIGHTS * values(x, closure) ** 2) / 1000)
    both = jax.jit(lambda x, direction: jax.jvp(gradient, (x,), (direction,)))
    x = np.ones(SIZES.size)
    columns = [both(x, direction)[1] for direction in np.eye(x.size)]
    for column, direction in zip(columns, np.eye(x.size), strict=True):
        expected = difference(lambda y, v=direction: both(y, v)[0], x, direction)
        assert np.all(np.isfinite(column)) and close(column, expected, 1e-7)
    assert close(np.array(columns), np.array(columns).T, 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wojtyra2020", "parallelogram", "slider_crank"])
def test_motion_depends_on_h_through_the_self_stress_alone(name):
    """d(qdd)/dh has rank k where friction drives the motion, and h_lam acts through N^T h_lam."""
    mechanism = registry.MECHANISMS[name]()
    system, state = registry.build(mechanism, registry.coulomb)
    n = mechanism.n

    def unknowns(h):
        solution = rx.solve(system, state, closure=rx.MinimumNorm(h))
        return jnp.concatenate([solution.acceleration, solution.multipliers])

    slope = np.asarray(jax.jit(jax.jacfwd(unknowns))(jnp.full(n + mechanism.m, 10.0)))
    assert not np.any(slope[:, :n])
    projector = np.array(rx.factorize(system, state).self_stress)
    assert close(slope[:, n:] @ projector, slope[:, n:], 1e-12)
    freedom = mechanism.n - mechanism.rank
    assert np.linalg.matrix_rank(slope[:n, n:], tol=1e-10) == min(mechanism.k, freedom)
    assert np.linalg.matrix_rank(slope[n:, n:], tol=1e-10) == mechanism.k


@pytest.mark.slow
def test_open_newton_depends_on_its_start():
    """The derivative is that of the iterations: an implicit one is wrong along the null vector."""

    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    state = mechanism.state(phi=jnp.pi / 4, rate=1.0)

    def end(x):
        solution = rx.solve(mechanism, state, closure=None, x0=x)
        return jnp.concatenate([solution.acceleration, solution.multipliers])

    both, rng = derivatives(end), np.random.default_rng(11)
    for x0 in (np.ones(24), np.full(24, 50.0), 20 * rng.normal(size=24)):
        direction = 10 * rng.normal(size=24)
        assert_consistent(both, x0, [direction], rng.normal(size=24))
        assert np.max(np.abs(both(x0, direction, np.ones(24))[1])) > 1e-2


# One for each kind of joint, drive and mass: pins of the paper are quick.
KINDS = (
    "driven twice",
    "swing on massless rods",
    "doubled four-bar",
    "slider-crank, two guides",
    "carriage, guides offset",
    "planetary set",
)


@pytest.mark.parametrize("name", ["wojtyra2020", *map(slow, KINDS)])
def test_consistent_assemblies(name):
    """All numbers that a mechanism of the registry is made of: they move the state too, so that it stays closed.

    P feeds the friction through the multipliers, and is among the values on its own.
    """
    case = CASES[name]
    arguments = case.arguments(friction=True)
    law = arguments.pop("angle", None)
    numbers = {key: np.asarray(value) for key, value in arguments.items() if not isinstance(value, int)}
    fixed = {key: value for key, value in arguments.items() if isinstance(value, int)}
    flat, unravel = jax.flatten_util.ravel_pytree(numbers)

    def everything(relative):
        drive = {} if law is None else {"angle": law}
        mechanism = case.make(**unravel(flat * relative), **fixed, **drive)
        state = mechanism.state(float(case.at), rate=float(case.rate), t=float(case.t))
        factor, solution = rx.factorize(mechanism, state), rx.solve(mechanism, state)
        parts = solution.acceleration, solution.multipliers, solution.friction
        # Not by the largest entry: of two equal ones a compiled program may round one otherwise and find neither.
        parts = (part / jnp.sqrt(part @ part + 1e-18) for part in parts)
        return jnp.concatenate([*parts, factor.self_stress.ravel()])

    rng = np.random.default_rng(13)
    directions = rng.normal(size=(2, flat.size)) / np.sqrt(flat.size)
    covector = rng.normal(size=jax.eval_shape(everything, jnp.ones(flat.size)).size)
    assert_consistent(derivatives(everything), np.ones(flat.size), directions, covector, tolerance=1e-7)


@pytest.mark.slow
def test_derivatives_of_assembled_states_and_units():
    """`assemble` and `in_units` in the chain, with a full compliance and a misfit."""
    rng = np.random.default_rng(14)
    half = rng.normal(size=(12, 12))

    def unknowns(x):
        length, mass, scale, stiff, off = x
        mechanism = rx.mechanisms.wojtyra2020(0.1 * length, mass, 0.02)
        guess = rx.mechanisms.wojtyra2020().state(phi=0.7, rate=1.3)
        state = rx.assemble(mechanism, guess.q, guess.qd, positions={"1.phi": 0.7}, rates={"1.phi": 1.3}, throw=False)
        units = rx.units.Units(length=3 * scale, mass=0.5)
        weights = jnp.asarray(half @ half.T) + stiff * jnp.eye(12)
        found = rx.solve(
            rx.units.in_units(mechanism, units),
            rx.units.state_in_units(state, mechanism, units),
            closure=rx.Compliance(weights, 100 * off * jnp.arange(12.0)),
        )
        solution = rx.units.solution_from_units(found, mechanism, units)
        return jnp.concatenate([solution.acceleration, solution.multipliers])

    both = derivatives(unknowns)
    assert_consistent(both, np.ones(5), np.eye(5), rng.normal(size=24), tolerance=1e-7)


@pytest.mark.parametrize("name", ["pendulum", "bead", slow("door")])
def test_parameters_of_a_users_system(name):
    """With respect to all parameters but the lengths, as q and qd are held."""
    case = registry.case(name)
    own = case.system.parameters
    fixed = {key: own[key] for key in ("length", "centre") if key in own} if _named(own) else None
    free = {key: own[key] for key in own if key not in fixed} if _named(own) else own
    flat, unravel = jax.flatten_util.ravel_pytree(free)

    def unknowns(x):
        parameters = {**fixed, **unravel(x)} if _named(own) else unravel(x)
        system = eqx.tree_at(lambda s: s.parameters, case.system, parameters)
        solution = rx.solve(system, case.state)
        return jnp.concatenate([solution.acceleration, solution.multipliers])

    rng = np.random.default_rng(12)
    size = len(case.system.coordinates) + len(case.system.rows)
    directions = rng.normal(size=(2, flat.size))
    assert_consistent(derivatives(unknowns), np.asarray(flat), directions, rng.normal(size=size))


def _named(parameters) -> bool:
    return isinstance(parameters, dict)


@pytest.mark.slow
def test_derivatives_at_joints_without_force_are_finite():
    """|R| = 0 has derivative 0, not NaN: nothing pulls on the mechanism and it barely moves."""
    mechanism, state = registry.build(registry.MECHANISMS["parallelogram"](), registry.coulomb)
    still = rx.State(state.q, 0 * state.qd)

    def unknowns(pull):
        gravity = pull * mechanism.gravity
        load = pull * mechanism.loads[0].element.force
        weightless = eqx.tree_at(
            lambda s: (s.gravity, s.loads[0].element.force, s.loads[0].element.moment),
            mechanism,
            (gravity, load, pull * mechanism.loads[0].element.moment),
        )
        solution = rx.solve(weightless, still, sense=jnp.ones(6))
        return jnp.concatenate([solution.acceleration, solution.multipliers])

    value, along, pulled = derivatives(unknowns)(0.0, 1.0, np.ones(24))
    assert not np.any(value) and np.any(along)
    assert np.all(np.isfinite(along)) and np.isfinite(pulled)
