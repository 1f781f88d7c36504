"""Friction of joints with several slips, those of one kind and one model together.

    tau = forces(loads, rates, senses), c entries a joint

The joint says how: a sleeve has one friction force along its slip, a cross two pins apart.
"""

from collections.abc import Callable
from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from .._system._axis import Axis
from .._system._friction import AbstractFriction
from .._system._state import State
from .._tools._module import replace_fields, tree_take
from ._frame import AbstractFrame
from ._friction_model import AbstractFrictionModel
from ._slip_directions import scattered
from ._stack import Stack


class VectorFriction(AbstractFriction):
    """Friction of one model in joints of one kind with several slips each, between bodies of a frame."""

    frame: AbstractFrame = eqx.field(static=True)
    centres: Float[Array, "bodies axes"] | None
    joints: Stack[Any]
    model: AbstractFrictionModel
    rows: Int[Array, "p rows"]
    slips: Axis = eqx.field(static=True)

    @property
    def has_sense(self) -> bool:
        """As the model has."""
        return self.model.has_sense

    @property
    def has_direction(self) -> bool:
        """As the joints have."""
        return self.joints.element.has_direction

    @property
    def has_convex_limits(self) -> bool:
        """Where normal loads are seminorms, and the model proportional to them."""
        return self.model.is_proportional and self.joints.element.has_convex_load

    @property
    def width(self) -> int:
        """Slips of a joint."""
        return len(self.joints.element.slip_kinds)

    @property
    def arms(self) -> Float[Array, " p"]:
        """As the joints have."""
        return eqx.filter_vmap(lambda joint: joint.arms)(self.joints.element).ravel()

    @property
    def anonymous(self) -> Self:
        return replace_fields(self, slips=self.slips.anonymous)

    def apart(self, memory: PyTree) -> tuple[tuple[AbstractFriction, PyTree], ...]:
        def joint(k: int) -> tuple[AbstractFriction, PyTree]:
            parts, slips = (self.joints, self.model, self.rows, memory), slice(k * self.width, (k + 1) * self.width)
            joints, model, rows, own = jax.tree.map(lambda x: x[k : k + 1] if eqx.is_array(x) else x, parts)
            kinds = Axis(None, self.slips.kinds[slips])
            return replace_fields(self, joints=joints, model=model, rows=rows, slips=kinds), own

        return tuple(joint(k) for k in range(len(self.slips) // self.width))

    def slip(self, q: Array, t: Array) -> Array:
        return self.slip_at(self.frame.poses(self.centres, q))

    def slip_at(self, poses: Any, relative: Any = None) -> Float[Array, " p"]:
        """`slip` at poses of all bodies, or at what the joints are functions of."""
        return self.joints.over(lambda joint, i, j: joint.slip(i, j), poses, relative).ravel()

    def directions_at(self, poses: Any) -> Float[Array, "n p"]:
        """E at poses of all bodies."""
        own = self.joints.over(lambda joint, i, j: joint.by_velocities(joint.slip, i, j), poses)
        return scattered(self.frame, self.joints, own, poses)

    def force(self, loads: Array, rate: Array, sense: Array, memory: PyTree, state: State) -> Array:
        def of_one(joint: Any, *arguments: Any) -> Array:
            return joint.forces(*arguments)

        return self._over(of_one, state, loads, self._by_joint(rate), self._by_joint(sense), memory)

    def largest_change(self, change: Array, rate: Array, memory: PyTree, state: State) -> Array:
        def of_one(joint: Any, *arguments: Any) -> Array:
            return joint.largest_changes(*arguments)

        return self._over(of_one, state, change, self._by_joint(rate), memory)

    def memory_size(self) -> PyTree:
        sizes = eqx.filter_vmap(lambda model: model.memory_size())(self.model)
        return jax.tree.map(lambda x: jnp.repeat(x[:, None], self.width, axis=1), sizes)

    def memory_rate(self, rate: Array, memory: PyTree, state: State) -> PyTree:
        if memory is None:
            return None

        def of_one(joint: Any, *arguments: Any) -> PyTree:
            return joint.memory_rates(*arguments)

        return eqx.filter_vmap(of_one)(self.joints.element, self.model, self._by_joint(rate), memory)

    def _by_joint(self, slips: Array) -> Array:
        return slips.reshape(-1, self.width)

    def _over(self, function: Callable[..., Array], state: State, *arguments: Any) -> Array:
        """A function of joint, model, poses of both bodies where it reads them, and arguments of each joint."""
        ends = None
        if self.joints.element.reads_pose:
            bodies = self.frame.poses(self.centres, state.q)
            ends = tree_take(bodies, self.joints.i), tree_take(bodies, self.joints.j)
        return eqx.filter_vmap(function)(self.joints.element, self.model, ends, *arguments).ravel()
