"""Stick and slip of a large mechanism: pendulums that stop one after the other on cranks at rest."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from truth.swings import frictions, stop, swings

import redundax as rx
from redundax._equations._factorize import factorize
from redundax._motion._held_rank import hold
from redundax._motion._integrate import _equations, _speed
from redundax._motion._stick import next_mode


@pytest.mark.slow
def test_pendulums_on_a_mechanism_that_sticks_stop_as_each_alone():
    loops = 3
    mechanism, state = swings(loops)
    motion = rx.simulate(mechanism.sparse(), state, 1.0, ts=[0.9], rtol=1e-9, throw=False)
    times, angles = zip(*(stop(mu) for mu in frictions(loops)), strict=True)
    assert motion.result == rx.RESULTS.stuck
    assert motion.stats.phases == loops
    assert motion.stats.end == pytest.approx(max(times), abs=1e-8)
    start, end = (np.asarray(q)[-(3 * loops + 1) :] for q in (state.q, motion.q[0]))
    np.testing.assert_allclose(end, [*start[:-loops], *angles], rtol=0, atol=1e-8)


@pytest.mark.slow
def test_slow_slides_are_at_rest_where_they_stop():
    """Rounding of weights that guides bear is no acceleration, however slow they were: after v / (mu g)."""
    mu, gravity, speeds, angles = 0.3, 10.0, np.array([0.001, 0.0015]), np.array([0.3, 1.3])
    axes = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    places = [(3.0 * k, 0.0, 0.0) for k in range(2)]
    bodies = [rx.spatial.Body(f"slide {k}", 2.0, (1.0, 1.0, 1.0), position=place) for k, place in enumerate(places)]
    sizes = {"guide_length": 0.5, "twist_radius": 0.1, "friction": rx.Coulomb(mu)}
    guides = [
        rx.spatial.Prismatic(f"guide {k}", body, "ground", point=place, axis=axis, **sizes)
        for k, (body, place, axis) in enumerate(zip(bodies, places, axes, strict=True))
    ]
    mechanism = rx.Mechanism(bodies, guides, gravity=(0.0, 0.0, -gravity))
    begin = rx.State(mechanism.reference, jnp.asarray([*(speeds[:, None] * axes).ravel(), *6 * [0.0]]))
    run = rx.simulate(mechanism.sparse(), begin, 0.01, ts=[0.01])
    assert run.result == rx.RESULTS.stuck and not np.any(run.qd)
    np.testing.assert_allclose(run.stats.end, max(speeds) / (mu * gravity), rtol=1e-9)


def moving(mechanism, state):
    """The equations of motion, the state, and what is held from there on."""
    factor = factorize(mechanism, state)
    state, speed = _speed(state, factor, jnp.asarray(1.0))
    equations = _equations(mechanism, speed, factor, rx.MinimumNorm(), rx.Projection())
    return equations, state, hold(mechanism, state, factor)


@pytest.mark.slow
@pytest.mark.parametrize("mode", [jax.jvp, jax.vjp])
def test_derivatives_of_holding_friction_are_those_of_dense_matrices(mode):
    loops = 1

    def solved(sparse, x):
        mechanism, state = swings(loops, frictions(loops) * x[0])
        mechanism = eqx.tree_at(lambda m: m.body.mass, mechanism, mechanism.body.mass.at[0].multiply(x[1]))
        mechanism = mechanism.sparse(sparse)
        equations, state, held = moving(mechanism, state)
        equations = equations.with_sense(jnp.zeros_like(equations.sense).at[-loops:].set(-1.0))
        found = equations.solved(state, equations.linear(state, held), None)
        return jnp.concatenate([found.tau, found.acceleration, found.multipliers])

    x, change = jnp.ones(2), jnp.array([0.7, -0.4])
    true = jax.jvp(lambda x: solved(False, x), (x,), (change,))[1]
    if mode is jax.jvp:
        found = jax.jvp(lambda x: solved(True, x), (x,), (change,))[1]
    else:
        pull = jnp.cos(jnp.arange(true.size))
        found, true = jax.vjp(lambda x: solved(True, x), x)[1](pull)[0] @ change, pull @ true
    np.testing.assert_allclose(found, true, rtol=0, atol=1e-10 * np.abs(true).max())


def sizes(jaxpr):
    for equation in jaxpr.eqns:
        yield from (variable.aval.size for variable in equation.outvars)
        for inner in jax.tree.leaves(equation.params, is_leaf=lambda x: hasattr(x, "jaxpr") or hasattr(x, "eqns")):
            inner = getattr(inner, "jaxpr", inner)
            yield from sizes(inner) if hasattr(inner, "eqns") else ()


@pytest.mark.slow
def test_no_array_of_a_motion_grows_with_the_square_of_the_mechanism():
    def largest(loops):
        mechanism, state = swings(loops)
        arrays, rest = eqx.partition((mechanism.sparse(), state), eqx.is_array)

        def moved(arrays):
            return rx.simulate(*eqx.combine(arrays, rest), 1.0, ts=[1.0], throw=False).q

        return max(sizes(jax.make_jaxpr(moved)(arrays).jaxpr))

    assert largest(40) < 2.5 * largest(20)


@pytest.mark.parametrize("sparse", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_pins_of_a_rigid_triangle_on_a_moving_crank_stick(sparse):
    """They cannot slip, so that what they would is rounding."""
    rod, tip = {"mass": 1.0, "inertia": 1 / 12}, 3**0.5 / 2
    bodies = [rx.Body(name, **rod) for name in ("crank", "base", "left", "right")]
    pin = partial(rx.Revolute, friction=rx.Coulomb(0.2), pin_radius=0.05)
    joints = [
        pin("A", "crank", "ground", (-0.5, 0.0), (0.0, 0.0)),
        rx.Fixed("B", "base", "crank", (-0.5, 0.0), (0.5, 0.0)),
        pin("C", "left", "base", (-0.5, 0.0), (-0.5, 0.0)),
        pin("D", "right", "base", (-0.5, 0.0), (0.5, 0.0)),
        pin("E", "left", "right", (0.5, 0.0), (0.5, 0.0)),
    ]
    mechanism = rx.Mechanism(bodies, joints, gravity=(0.0, -9.81)).sparse(sparse)
    turns = np.array([0.0, 0.0, np.pi / 3, 2 * np.pi / 3])
    middles = np.array([(0.5, 0.0), (1.5, 0.0), (1.25, tip / 2), (1.75, tip / 2)])
    rates = 2.0 * np.stack([-middles[:, 1], middles[:, 0]], axis=1)
    state = rx.State(np.concatenate([middles.ravel(), turns]), np.append(rates.ravel(), np.full(4, 2.0)), 0.0)
    found = jax.jit(lambda state: next_mode(*moving(mechanism, state), jnp.asarray(True)))(state)
    assert found.decided
    np.testing.assert_array_equal(found.sense, [1.0, 0.0, 0.0, 0.0])
