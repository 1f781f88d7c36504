"""Everything again in JAX's default precision, against the truth in float64."""

import warnings
from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest
import registry
from truth import exact

import redundax as rx
from redundax._tools._module import _tell_of_single_precision

TOLERANCE = 1e-4
pytestmark = pytest.mark.usefixtures("float32")


slow = partial(pytest.param, marks=pytest.mark.slow)


@pytest.mark.parametrize("name", [slow(name) if name == "door" else name for name in registry.SYSTEMS])
def test_accelerations_and_friction_of_systems(name):
    case = registry.SYSTEMS[name]()
    solution = registry.solve(case.system, case.state)
    assert solution.acceleration.dtype == solution.multipliers.dtype == jnp.float32
    assert solution.stats.redundancy == case.redundancy
    kinds = registry.kinds_of(case.system.coordinates)
    assert registry.agree(solution.acceleration, case.acceleration, kinds, TOLERANCE)
    slips = [kind for group in case.system.friction for kind in group.slips.kinds]
    assert registry.agree(solution.friction, case.friction, slips, TOLERANCE)


@pytest.mark.parametrize(("name", "solver"), [
    *((name, None) if name == "carriage" else slow(name, None) for name in registry.MECHANISMS),
    ("wojtyra2020", rx.Newton), slow("parallelogram", rx.Newton), slow("slider_crank", rx.Newton),
    slow("wojtyra2020", rx.FixedPoint),
])  # fmt: skip
def test_mechanisms_against_exact_geometry(name, solver):
    mechanism = registry.MECHANISMS[name]()
    truth = mechanism.solve(misfit=[20] * mechanism.m, friction=solver is not None)
    system, state = registry.build(mechanism, registry.coulomb if solver else None)
    options = {"solver": solver()} if solver else {}
    solution = registry.solve(system, state, h=20.0, **options)
    assert solution.stats.redundancy == mechanism.k
    tau = exact.floats(truth.friction) if system.friction else np.zeros(0)
    parts = exact.floats(truth.acceleration), exact.floats(truth.multipliers), tau
    errors = registry.errors_of(solution, parts, system)
    assert max(errors.values()) <= TOLERANCE, errors


@pytest.mark.parametrize("u", [1e-3, 0.1, 10.0, 1e3])
def test_rank_in_other_units(u):
    mechanism = rx.mechanisms.wojtyra2020(u=u)
    assert registry.solve(mechanism, mechanism.state(phi=0.7, rate=1.0)).stats.rank == 11


def test_open_newton():
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    state = mechanism.state(phi=np.pi / 4, rate=1.0)
    solution = registry.solve(mechanism, state, closure=None, x0=1.0)
    assert solution.acceleration.dtype == jnp.float32
    assert abs(solution.acceleration[8] + 36.75) < 0.01  # printed in Table 4


@pytest.mark.slow
def test_a_motion_beside_singular_positions_is_right_or_stops():
    """The flat positions of a parallelogram magnify rounding by the cube of 1 / pivot."""
    mechanism = rx.mechanisms.parallelogram(2)
    for rtol in (1e-3, 1e-4, 1e-5, 1e-6):
        run = rx.simulate(mechanism, mechanism.state(0.7, rate=3.0), 10.0, rtol=rtol, throw=False)
        assert run.q.dtype == jnp.float32
        assert run.result in (rx.RESULTS.successful, rx.RESULTS.step_too_small)
        assert run.stats.energy_error < 3e-3
        assert run.stats.position_violation < 1e-5


def test_single_precision_that_nobody_asked_for_is_told_once():
    """Numbers that it holds exactly, and arrays of it, are no sign of that."""
    _tell_of_single_precision.cache_clear()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rx.Body("a", np.float32(0.1), 0.5)
    with pytest.warns(UserWarning, match="jax_enable_x64") as told:
        rx.Body("a", 0.1, 0.5)
        rx.State(np.array([0.1, 0.2]), [0.0, 0.3])
    assert len(told) == 1
    _tell_of_single_precision.cache_clear()
    with pytest.warns(UserWarning, match="jax_enable_x64"):
        rx.mechanisms.wojtyra2020()
