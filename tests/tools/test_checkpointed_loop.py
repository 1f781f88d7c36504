"""Derivatives in reverse of a loop that keeps states of blocks of turns."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from redundax._tools._checkpointed_loop import checkpointed_loop


def grown(x, rate, turns, length):
    """x times the product of 1 + rate h over turns; `length` says the next h. Every third value is written."""

    def turn(now, written, rate):
        x, h, k = now
        x = x * (1 + rate * h)
        written = jnp.where((jnp.arange(written.size) == k // 3) & (k % 3 == 0), x, written)
        return (x, length(k), k + 1), written

    start = (x, length(jnp.array(-1)), jnp.array(0)), jnp.zeros(turns // 3 + 1)
    (x, _, _), written = checkpointed_loop(
        lambda now, _: now[2] < turns, turn, start, rate, 10 * turns + 1, lambda now: now[1]
    )
    return x, written


@pytest.mark.parametrize("turns", [0, 1, 256, 257, 700])
def test_derivatives_are_those_of_the_product(turns):
    x, rate, weights = 1.3, 0.4, np.cos(np.arange(turns // 3 + 1))
    lengths = 1 / (2 + np.arange(turns))

    def weighted(x, rate):
        end, written = grown(x, rate, turns, lambda k: 1 / (3.0 + k))
        return end + written @ weights

    products = x * np.cumprod(1 + rate * lengths)
    slopes = products * np.cumsum(lengths / (1 + rate * lengths))
    places = weights[: len(products[::3])]
    by_rate = np.sum(slopes[-1:]) + slopes[::3] @ places
    by_x = (products[-1] if turns else x) / x + products[::3] @ places / x
    found = jax.grad(weighted, argnums=(0, 1))(jnp.asarray(x), jnp.asarray(rate))
    np.testing.assert_allclose(found, (by_x, by_rate), rtol=1e-12)


def test_what_is_noted_of_turns_is_not_computed_again():
    """Lengths that differ whenever they are asked for: the derivative is that of the turns that were taken."""
    asked = itertools.count()

    def length(k):
        known = jax.lax.stop_gradient(k)
        return jax.pure_callback(lambda _: np.asarray(0.01 * np.sin(next(asked)) ** 2), jnp.zeros(()), known)

    end, slope = jax.value_and_grad(lambda x: grown(x, 0.4, 700, length)[0])(jnp.asarray(1.3))
    np.testing.assert_allclose(slope, end / 1.3, rtol=1e-12)
