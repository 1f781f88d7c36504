"""The rows of a large mechanism at a state.

Bodies that lack mass get a little for the solution, A = 1e-3 of the mean mass, and of its moment at the length that
turns slopes of angles into those of points; no result depends on it (`_gram`).
"""

from typing import cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._sparse._rows import Rows
from .._sparse._symbolic import Symbolic
from .._system._state import State
from .._system._system import AbstractSystem

_ADDED = 1e-3


def rows_of(system: AbstractSystem, state: State) -> tuple[Rows, Array]:
    """Rows as they are, and the mass of each body."""
    slopes, masses = system.by_bodies(state.q, state.t)
    symbolic, whole = cast(Symbolic, system.symbolic), masses
    if symbolic.massless is not None:
        whole = masses + jax.lax.stop_gradient(_added(system, symbolic, slopes, masses))
    if system.diagonal_mass:
        inverse = jnp.eye(masses.shape[1]) / jnp.diagonal(whole, axis1=1, axis2=2)[:, None]
    else:
        inverse = jnp.linalg.inv(whole)
    return Rows(symbolic, slopes, inverse, None if symbolic.massless is None else masses), masses


def _added(system: AbstractSystem, symbolic: Symbolic, slopes: Array, masses: Array) -> Float[Array, "bodies s s"]:
    turns = jnp.asarray(system.coordinates.angular)[symbolic.columns]
    linear, angular = (jnp.mean(slopes**2, where=mask[symbolic.body]) for mask in (~turns, turns))
    square = jnp.where((linear > 0) & (angular > 0), angular / jnp.where(linear > 0, linear, 1.0), 1.0)
    mean = jnp.mean(jnp.diagonal(masses, axis1=1, axis2=2), where=~turns)
    added = _ADDED * jnp.where(mean > 0, mean, 1.0) * jnp.where(turns, square, 1.0)
    lacking = cast(Array, symbolic.massless)[:, None]
    return jnp.where(lacking, added, 0.0)[:, :, None] * jnp.eye(masses.shape[1])


def unit_rows(rows: Rows) -> Float[Array, " m"]:
    """D that makes the diagonal of S 1."""
    diagonal = jax.lax.stop_gradient(rows.diagonal())
    return jnp.sqrt(jnp.where(diagonal > 0, diagonal, 1.0))
