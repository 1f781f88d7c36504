"""The nature of a position: which self-stress is there at this position only, and which loads are unique only here.

With K the scaled Jacobian, P and Z the projectors onto self-stress and motions, dK the change of K along a motion w,

    P dK(w) z   is zero for all motions w, z   where the rank is the same beside the position,
    dP = -P dK K^+ - (P dK K^+)^T              is the change of the self-stress.

The range of P dK(w) Z over all w is the self-stress that vanishes beside the position: to second order, so what is
found is there at least.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from .._equations._factorisation import Factorisation
from .._equations._kinematics import change_of_jacobian
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._compilation import compiled

_CHANGES = 1e-4  # relative change of a projector that is more than the blur of a state beside the manifold


class Position(NamedTuple):
    """`local`: self-stress states of this position alone; `unique_only_here`: multipliers unique here alone, (m,)."""

    local: Int[Array, ""]
    unique_only_here: Bool[Array, " m"]


@compiled
def position(system: AbstractSystem, state: State, factor: Factorisation) -> Position:
    """The nature of the position of a state."""
    inverse, stress, motion = factor.split
    columns = factor.scaling.coordinates

    def change(direction: Array) -> Array:
        moved = change_of_jacobian(system, state, columns * direction)
        return moved * columns / factor.row_scale[:, None]

    changes = jax.vmap(change)(motion)  # the rows of Z span the motions
    largest = jnp.max(jnp.abs(changes))
    seen = jnp.einsum("ab,wbc,cd->awd", stress, changes, motion).reshape(stress.shape[0], -1)
    values = jnp.linalg.svd(seen, compute_uv=False)
    local = jnp.where(factor.singular_position, jnp.sum(values > _CHANGES * jnp.max(values, initial=0.0)), 0)
    if factor.branch is not None:  # told apart, where `factor.split` has the others only
        local = jnp.where(factor.branch.count > 0, factor.branch.count, local)
    turned = jnp.einsum("ab,wbc,cd->wad", stress, changes, inverse)
    alters = jnp.max(jnp.linalg.norm(turned, axis=1), axis=0) > _CHANGES * largest
    return Position(local, factor.unique_multipliers & alters)
