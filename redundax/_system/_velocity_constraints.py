"""Rows of velocity that a user writes, A(q, t) qd - b(q, t): how many there are, and whether they are affine in qd."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from .._tools._errors import RedundaxError
from .._tools._module import tracing
from .._tools._numbers import are_known

_AFFINE = 1e-4  # relative: float32 leaves 1e-6 of terms that cancel, and what is not affine is off by about 1


def no_positions(q: Array, t: Array, parameters: PyTree) -> Float[Array, " 0"]:
    """The residual of no constraint."""
    return jnp.zeros(0, q.dtype)


def rows_of_velocity(function: Callable[..., Array], parameters: PyTree, n: int) -> int:
    """How many rows it gives for n velocities; refused if not affine in them at a position of no symmetry."""
    numbers = np.arange(1.0, n + 1)
    one, two = np.sin(numbers), np.cos(3 * numbers)
    q, qds = jnp.asarray(np.cos(numbers**2)), jnp.asarray(np.stack([0 * numbers, one, two, one - 2 * two]))
    with tracing("velocity_constraints"):
        found = jax.eval_shape(function, jnp.zeros(n), jnp.zeros(n), jnp.zeros(()), parameters)
    if found.ndim != 1 or not found.shape[0]:
        raise RedundaxError(
            f"Argument `velocity_constraints` must return a vector of what the rows miss, but returns shape "
            f"{found.shape}. Return `jnp.stack([...])` with one entry for each row."
        )
    if are_known(function, parameters):
        still, one, two, mixed = np.asarray(_values(function, q, qds, parameters))
        terms = np.abs(still) + np.abs(one) + np.abs(two) + np.abs(mixed)
        wrong = np.flatnonzero(np.abs(mixed - one + 2 * two - 2 * still) > _AFFINE * terms)  # NaN is none
        if wrong.size:
            raise RedundaxError(
                "Argument `velocity_constraints` must be affine in the velocity, A(q, t) qd - b(q, t), but entry "
                f"{wrong[0]} is not. Write what the velocity misses, with no products or powers of `qd`."
            )
    return found.shape[0]


@eqx.filter_jit
def _values(
    function: Callable[..., Array], q: Float[Array, " n"], qds: Float[Array, "4 n"], parameters: PyTree
) -> Float[Array, "4 k"]:
    return jax.vmap(lambda qd: function(q, qd, jnp.full((), 0.3, q.dtype), parameters))(qds)
