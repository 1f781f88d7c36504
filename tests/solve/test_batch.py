"""Sweeps: vmap agrees with the loop, compiles once, and compiles nothing new for new numbers."""

import contextlib
import dataclasses
from collections.abc import Callable
from functools import partial
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import registry

import redundax as rx

BUILD = rx.mechanisms.wojtyra2020
slow = partial(pytest.param, marks=pytest.mark.slow)
OPTIONS = {
    "smooth": {},
    "fixed point": {"solver": rx.FixedPoint()},
    "newton": {"solver": rx.Newton()},
    "open": {"closure": None, "x0": 1.0},
}


def whole(solution):
    return jnp.concatenate([solution.acceleration, solution.multipliers, solution.friction])


def data(options, **parameters):
    """The paper's mechanism; with friction if the options name a solver for it."""
    mechanism = BUILD(mu_rho=0.02 if options else None, **parameters)
    return mechanism, mechanism.state(phi=0.7, rate=1.3)


def assert_batch_is_loop(function, batch):
    """To rounding: a batched LAPACK call may round differently."""
    sweep = jax.jit(jax.vmap(function))
    together = np.array(sweep(batch))
    one_by_one = np.array([function(item) for item in batch])
    scale = np.max(np.abs(one_by_one), axis=0)
    assert np.all(np.abs(together - one_by_one) <= 1e-11 * np.max(scale))
    assert len({tuple(row) for row in np.round(one_by_one, 9)}) == len(batch)
    return sweep


@contextlib.contextmanager
def counted():
    """The numbers of programs that are traced and compiled inside."""
    events = {"jaxpr_trace_duration": 0, "backend_compile_duration": 0}

    def listen(name, duration, **_):
        for event in events:
            events[event] += name == f"/jax/core/compile/{event}"

    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        yield events
    finally:
        jax.monitoring.unregister_event_duration_listener(listen)


# vmap ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", ["newton", slow("fixed point")])
def test_over_h_and_compile_once(solver):
    mechanism, state = data(OPTIONS[solver])

    def function(h):
        return whole(rx.solve(mechanism, state, closure=rx.MinimumNorm(h), **OPTIONS[solver]))

    batch = 100 * np.random.default_rng(13).normal(size=(5, 24))
    sweep = assert_batch_is_loop(function, batch)
    with counted() as events:
        sweep(batch + 1.0)
    assert events["backend_compile_duration"] == events["jaxpr_trace_duration"] == 0


def test_over_starts():
    mechanism, state = data(OPTIONS["open"])

    def function(x0):
        return whole(rx.solve(mechanism, state, closure=None, x0=x0))

    assert_batch_is_loop(function, 50 * np.random.default_rng(14).normal(size=(5, 24)))


def test_over_units():
    mechanism, state = data(OPTIONS["newton"])

    def function(u):
        units = rx.units.Units(length=u)
        return whole(rx.solve(mechanism, state, closure=rx.MinimumNorm(50.0, units=units)))

    assert_batch_is_loop(function, np.array([0.1, 0.5, 1.0, 10.0]))


@pytest.mark.parametrize("options", ["smooth", "newton", slow("fixed point"), slow("open")])
def test_over_states(options):
    mechanism, _ = data(OPTIONS[options])

    def function(phi):
        return whole(rx.solve(mechanism, mechanism.state(phi=phi, rate=1.0), **OPTIONS[options]))

    assert_batch_is_loop(function, np.linspace(-1.2, 1.2, 7))


def test_over_lengths_and_friction():
    def function(parameters):
        mechanism = BUILD(length=parameters[0], mu_rho=parameters[1])
        return whole(rx.solve(mechanism, mechanism.state(phi=0.7, rate=1.0)))

    assert_batch_is_loop(function, np.array([[0.1, 0.02], [0.2, 0.03], [0.15, 0.01]]))


@pytest.mark.parametrize("name", ["bead", slow("door")])
def test_over_the_parameters_of_a_users_system(name):
    case = registry.case(name)
    parameters = case.system.parameters
    batch = jax.tree.map(lambda x: jnp.stack([x, 1.1 * x, 0.9 * x]), parameters)
    if name == "door":  # the centre is that of the state
        batch["centre"] = jnp.stack([parameters["centre"]] * 3)

    def function(parameters):
        system = eqx.tree_at(lambda s: s.parameters, case.system, parameters)
        return whole(rx.solve(system, case.state))

    together = np.array(jax.vmap(function)(batch))
    for place in range(3):
        one = np.array(function(jax.tree.map(lambda x, k=place: x[k], batch)))
        assert np.max(np.abs(together[place] - one)) <= 1e-12 * np.max(np.abs(one))


def test_over_ranks():
    """Flat and open parallelograms in one batch: the rank is a value, and the flat one is refused alone."""
    systems, states = zip(*(registry.four_bar(phi, (1.0, 1.0)) for phi in (0.0, 0.3, 1.0)),
                          strict=True)  # fmt: skip
    states = jax.tree.map(lambda *x: jnp.stack(x), *states)
    solution = jax.vmap(lambda state: rx.solve(systems[0], state))(states)
    assert solution.stats.spectrum.rank.tolist() == [7, 8, 8]
    assert (solution.result == rx.RESULTS.singular_position).tolist() == [True, False, False]
    for place in (1, 2):
        one = rx.solve(systems[0], jax.tree.map(lambda x, k=place: x[k], states))
        assert np.allclose(solution.acceleration[place], one.acceleration, rtol=1e-12, atol=1e-12)
        assert np.allclose(solution.multipliers[place], one.multipliers, rtol=1e-12, atol=1e-11)


# Compilation --------------------------------------------------------------------------------


def test_the_count_counts():
    with counted() as events:
        jax.jit(lambda x: 2 * x + 17)(jnp.ones(3))
    assert events["backend_compile_duration"] >= 1 and events["jaxpr_trace_duration"] >= 1


@pytest.mark.parametrize("options", OPTIONS)
def test_new_numbers_compile_nothing(options, programs_at_once):
    """Lengths, masses, friction, gravity, units and states are data; so are names."""
    rx.solve(*data(OPTIONS[options]), **OPTIONS[options])
    other = data(OPTIONS[options], length=0.3, mass=2.0, gravity=9.81, u=2.0)
    with counted() as events:
        solution = rx.solve(*other, **OPTIONS[options])
    assert solution.result == rx.RESULTS.successful
    assert events["backend_compile_duration"] == 0


def renamed(joints):
    return tuple(dataclasses.replace(joint, name=f"the {joint.name}") for joint in joints)


@pytest.mark.parametrize("friction", [None, registry.coulomb], ids=["smooth", "rubs"])
def test_one_program_serves_all_mechanisms_with_the_same_counts(friction, programs_at_once):
    """Other names, and joints that join other bodies: nothing is compiled anew."""
    mechanism = registry.MECHANISMS["parallelogram"]()
    first = rx.solve(*registry.build(mechanism, friction))
    variants = [renamed(mechanism.revolutes), mechanism.revolutes[::-1]]
    built = [registry.build(dataclasses.replace(mechanism, revolutes=revolutes), friction) for revolutes in variants]
    with counted() as events:
        solutions = [rx.solve(*pair) for pair in built]
    assert events["backend_compile_duration"] == 0
    for solution in solutions:
        assert np.allclose(solution.acceleration, first.acceleration, rtol=0, atol=1e-12)


def text_of(options) -> str:
    mechanism, state = data(options)
    lowered = eqx.filter_jit(lambda m, s: whole(rx.solve(m, s, **options))).lower(mechanism, state)
    return lowered.as_text()


def loops(text: str) -> int:
    return text.count("stablehlo.while")


def test_without_friction_nothing_iterates():
    assert loops(text_of(OPTIONS["smooth"])) == 0
    assert loops(text_of(OPTIONS["newton"])) > 1
    assert loops(text_of(OPTIONS["fixed point"])) > 1


def test_friction_without_load_does_not_iterate_either():
    model = rx.ConstantFriction(0.3)
    mechanism, state = registry.build(registry.MECHANISMS["wojtyra2020"](), lambda joint: model)
    lowered = eqx.filter_jit(lambda m, s: whole(rx.solve(m, s))).lower(mechanism, state)
    assert loops(lowered.as_text()) == 1


def test_mechanisms_are_arguments():
    """A mechanism passes through jit and vmap as a pytree."""
    mechanism, state = data(OPTIONS["newton"])
    direct = whole(rx.solve(mechanism, state))
    through = jax.jit(lambda m, s: whole(rx.solve(m, s)))(mechanism, state)
    assert np.allclose(direct, through, rtol=1e-13, atol=1e-13)


def bead(q, t, p):
    row = jnp.sin(p["speed"] * t) * q[0] - jnp.cos(p["speed"] * t) * q[1]
    return jnp.array([row, 2 * row])


def turn(t):
    return 0.3 + 2.0 * t


def wind(i, j, t, p):
    none = rx.Wrench(jnp.zeros(2), jnp.zeros(()))
    return rx.Wrench(-p * i.rate.r, jnp.zeros(())), none


def plain_system(speed):
    system = rx.System(bead, mass=jnp.ones(2), load=drag, parameters={"speed": speed})
    return system, rx.State([1.0, 0.0], [0.0, speed])


def path(t):
    return jnp.stack([0.1 * t, 0.0 * t])


def drag(q, qd, t, p):
    return -p["speed"] * qd


class Hinge(rx.AbstractJoint):  # a user's joint that keeps a plain function
    row_kinds: ClassVar = (("x", "force"), ("y", "force"))
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    along: Callable

    def residual(self, i, j, t):
        return i.point(jnp.array([-0.5, 0.0])) - j.point(self.along(t))


def plain_mechanism(strength):
    joints = [Hinge("A", "a", rx.GROUND, path), rx.AngleDriver("M", "a", rx.GROUND, turn)]
    loads = [rx.LoadFunction("a", wind, parameters=strength)]
    mechanism = rx.Mechanism([rx.Body("a", 1.0, 0.1)], joints, loads=loads)
    return mechanism, rx.assemble(mechanism, [0.5, 0.1, 0.3], rates={"a.phi": 2.0})


@pytest.mark.parametrize("make", [plain_system, plain_mechanism])
@pytest.mark.slow
def test_plain_functions_pass_through_jax_transformations(make):
    """As part of systems that are arguments; other parameters compile nothing new, and can be differentiated."""
    (one, state), (other, state_there) = make(1.5), make(2.5)
    solve = jax.jit(lambda system, state: whole(rx.solve(system, state)))
    assert np.allclose(solve(one, state), whole(rx.solve(one, state)), rtol=1e-13, atol=1e-13)
    with counted() as events:
        there = solve(other, state_there)
    assert events["backend_compile_duration"] == events["jaxpr_trace_duration"] == 0
    assert not np.allclose(there, solve(one, state))
    systems, states = jax.tree.map(lambda *x: jnp.stack(x), (one, state), (other, state_there))
    assert np.allclose(jax.vmap(solve)(systems, states)[1], there, rtol=1e-12, atol=1e-12)
    slopes = jax.tree.leaves(eqx.filter_grad(lambda system: solve(system, state).sum())(one))
    assert any(np.any(slope != 0) for slope in slopes)


def test_a_users_system_compiles_nothing_for_new_parameters(programs_at_once):
    case = registry.case("pendulum")
    direct = whole(rx.solve(case.system, case.state))
    through = eqx.filter_jit(lambda m, s: whole(rx.solve(m, s)))(case.system, case.state)
    assert np.allclose(direct, through, rtol=1e-13, atol=1e-13)
    heavier = {**case.system.parameters, "mass": jnp.asarray(4.0)}
    other = eqx.tree_at(lambda s: s.parameters, case.system, heavier)
    with counted() as events:
        rx.solve(other, case.state)
    assert events["backend_compile_duration"] == 0
