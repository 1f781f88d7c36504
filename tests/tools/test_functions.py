"""Functions of users that close over numbers which a transformation traces."""

import functools
from typing import NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

import redundax as rx
from redundax._tools._functions import as_functions

slow = pytest.mark.slow
MASS, MU, SPEED, END = 2.0, 0.3, 3.0, 0.5


def by_closure(force):
    return lambda x: force * x


def by_inner_function(force):
    def inner(x):
        return force * x if x is not inner else None

    return lambda x: inner(x)


def by_default(force):
    def function(x, *, scale={"by": force, "unit": "N"}):  # noqa: B006
        return scale["by"] * x

    return function


def by_partial(force):
    return functools.partial(lambda force, x: force * x, force)


def by_functions_that_call_each_other(force):
    def one(x, times):
        return other(x, times - 1) if times else force * x

    def other(x, times):
        return one(x, times)

    return lambda x: one(x, 2)


def by_compiled_function(force):
    return jax.jit(lambda x: force * x)


class Weight(NamedTuple):
    force: Float[Array, ""]

    def of(self, x):
        return self.force * x


def by_method(force):
    return Weight(force).of


def by_function_beside_what_is_no_pytree(force):
    """JAX cannot sort keys of several kinds."""
    given = {1: 1.0, "N": 2.0}
    return lambda x: force * given[1] * x


WAYS = [
    by_closure,
    by_inner_function,
    by_default,
    by_partial,
    by_functions_that_call_each_other,
    by_compiled_function,
    by_method,
    by_function_beside_what_is_no_pytree,
]


@pytest.mark.parametrize("way", WAYS)
def test_what_is_traced_of_a_function_is_a_leaf_of_it(way):
    assert not jax.tree.leaves(as_functions(way(2.0)))

    def product(force):
        function = as_functions(way(force))
        assert [x is force for x in jax.tree.leaves(function)] == [True]
        return jax.tree.map(lambda x: 5.0 * x, function)(3.0)

    assert jax.jit(product)(2.0) == 30.0 and jax.grad(product)(2.0) == 15.0


@slow
@pytest.mark.parametrize(("way", "options"), [(by_closure, {"adjoint": diffrax.ForwardMode()}), (by_partial, {})])
def test_derivatives_of_rough_motions_by_what_loads_close_over(way, options):
    """JAX refused loops, or had no handler for constants of its own kinds."""

    def moved(force):
        law, nothing = way(force), jnp.zeros(2)

        def wrench(i, j, t, given):
            return i.wrench(law(jnp.array([0.0, -1.0])), nothing), j.wrench(nothing, nothing)

        at, rubs = ((0.0, 0.0), (0.0, 0.0), (0.0, 1.0)), rx.Coulomb(MU)
        joint = rx.Translational("g", "block", "ground", *at, guide_length=0.2, friction=rubs)
        block = rx.Mechanism([rx.Body("block", MASS, 0.1)], [joint], loads=[rx.LoadFunction("block", wrench)])
        start = rx.State(jnp.zeros(3), jnp.array([SPEED, 0.0, 0.0]))
        return rx.simulate(block, start, END, ts=[END], **options).q[0, 0]

    slope = jax.jit(jax.jacfwd(moved))(4.0) if options else jax.grad(moved)(4.0)
    np.testing.assert_allclose(slope, -MU / MASS * END**2 / 2, rtol=1e-9)
