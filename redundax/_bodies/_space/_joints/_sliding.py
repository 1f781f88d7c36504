"""What a joint in space is whose surfaces slide in several directions

    v = a s',   tau = a f,   f = -(friction of N and |v|) v / |v|

with the slips s and the arms a that make velocities of the surfaces of their rates: a length for an angle. So friction
is one force along the slip. Bristles bend along v.
"""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from ...._tools._module import safe_norm
from ..._friction_model import AbstractFrictionModel
from ..._joints._base import Row
from .._pose import Pose
from ._frictional import AbstractPressedJoint


class AbstractSlidingJoint(AbstractPressedJoint):
    """A joint whose surfaces slide in several directions, so that it can have friction along its slip.

    `slip_kinds` are names and kinds of its slips, as those of rows.
    """

    slip_kinds: eqx.AbstractClassVar[tuple[Row, ...]]
    has_direction: ClassVar[bool] = True

    @property
    @abc.abstractmethod
    def arms(self) -> Float[Array, " slips"]:
        """Velocities of the surfaces by unit rates of the slips."""

    @abc.abstractmethod
    def slip(self, i: Pose, j: Pose) -> Float[Array, " slips"]:
        """Slips of body i relative to body j; only their derivatives count."""

    def forces(
        self, model: AbstractFrictionModel, ends: Any, loads: Array, rate: Array, sense: Array, memory: PyTree
    ) -> Float[Array, " slips"]:
        """Friction forces and moments, one for each slip; at rest against the direction `sense`, as one of v."""
        velocity = self.arms * rate
        normal = self.normal_load(loads, ends) if model.depends_on_load else jnp.zeros((), velocity.dtype)
        if memory is not None:
            return self.arms * model.force(normal, velocity, sense, memory)
        size = model.force(normal, safe_norm(velocity), jnp.ones_like(normal), None)
        return self.arms * direction(velocity, sense) * size

    def largest_changes(
        self, model: AbstractFrictionModel, ends: Any, change: Array, rate: Array, memory: PyTree
    ) -> Float[Array, " slips"]:
        """Bounds of the changes of friction by a change of the multipliers."""
        velocity = self.arms * rate
        if memory is None:
            share = jnp.where(jnp.all(velocity == 0), 1.0, jnp.abs(direction(velocity, velocity)))
            slope = share * model.slope_bound(safe_norm(velocity), None)
        else:
            slope = model.slope_bound(velocity, memory)
        if not model.depends_on_load:
            return jnp.zeros_like(velocity)
        return jnp.where(slope == 0, 0.0, self.arms * slope * self.largest_change(change, ends))

    def memory_rates(self, model: AbstractFrictionModel, rate: Array, memory: PyTree) -> PyTree:
        """Rates of change of the internal state, of as many components as there are slips."""
        return model.memory_rate(self.arms * rate, memory)


def direction(velocity: Float[Array, " slips"], else_along: Float[Array, " slips"]) -> Float[Array, " slips"]:
    """Of a velocity, of something else where it is zero, and zero where that is too."""
    along = jnp.where(jnp.any(velocity != 0), velocity, else_along)
    size = safe_norm(along)
    return along / jnp.where(size > 0, size, 1.0)
