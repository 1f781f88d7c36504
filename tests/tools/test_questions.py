"""Calls that decide something answer about known numbers, and say so where they are traced."""

import jax
import jax.numpy as jnp
import pytest

import redundax as rx

SIZES = rx.AmplitudeBox({"A.x": (-4.0, 4.0)})
CALLS = {
    "analyze": rx.analyze,
    "analyze_along": lambda system, state: rx.analyze_along(system, twice(state)),
    "band": lambda system, state: rx.band(system, state, "A.x", SIZES),
    "band_along": lambda system, state: rx.band_along(system, twice(state), ["A.x"], SIZES),
    "frictional_solutions": rx.frictional_solutions,
    "lift_off": lambda system, state: rx.lift_off(system, state, {"1.phi": 1.0}, rx.MinimumNorm()),
    "limit_load": lambda system, state: rx.limit_load(system, state, {"1.phi": 1.0}),
    "solution_family": rx.solution_family,
    "stability": lambda system, state: rx.stability(system, state, rx.solve(system, state), rx.MinimumNorm()),
    "sticking": rx.sticking,
    "draw": rx.plot.draw,
}


def twice(state):
    return jax.tree.map(lambda x: jnp.stack([x, x]), state)


@pytest.mark.parametrize("name", CALLS)
def test_traced_numbers_are_refused_with_the_argument_that_holds_them(name):
    def asked(angle):
        mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
        CALLS[name](mechanism, mechanism.state(phi=angle, rate=1.0))

    told = rf"`states?` must hold known numbers, .*by `jit`, `vmap` or `grad`\. (Call `{name}`|Draw) outside"
    for transformed, at in ((jax.jit(asked), 0.8), (jax.vmap(asked), jnp.array([0.8, 0.9]))):
        with pytest.raises(rx.RedundaxError, match=told):
            transformed(at)


@pytest.mark.parametrize("name", [name for name in CALLS if name != "draw"])
def test_a_system_of_traced_numbers_is_refused_too(name):
    def asked(radius):
        mechanism = rx.mechanisms.wojtyra2020(mu_rho=radius)
        CALLS[name](mechanism, mechanism.state(phi=0.8, rate=1.0))

    with pytest.raises(rx.RedundaxError, match=r"`system` must hold known numbers"):
        jax.jvp(asked, (0.02,), (1.0,))
