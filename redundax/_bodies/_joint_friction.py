"""Friction of the joints of a mechanism, those of one kind and one model together.

A mechanism keeps which joints have friction as indices; their geometry stays in the stacks of the joints.
"""

from collections.abc import Sequence
from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, PyTree

from .._system._axis import Axis
from .._system._friction import AbstractFriction
from .._system._state import State
from .._tools._module import as_functions, replace_fields
from ._body import poses
from ._friction_model import AbstractFrictionModel
from ._joints import AbstractFrictionalJoint, AbstractJoint
from ._stack import Stack, indices, kinds, stacked


class JointFriction(AbstractFriction):
    """Friction of one model in frictional joints of one kind."""

    joints: Stack[Any]
    model: AbstractFrictionModel
    rows: Int[Array, "p rows"]
    slips: Axis = eqx.field(static=True)

    @property
    def has_sense(self) -> bool:
        """As the model has."""
        return self.model.has_sense

    @property
    def has_convex_limits(self) -> bool:
        """As normal loads are seminorms, where the model is proportional to them."""
        return self.model.is_proportional

    def anonymous(self) -> Self:
        return replace_fields(self, slips=self.slips.anonymous())

    def apart(self, memory: PyTree) -> tuple[tuple[AbstractFriction, PyTree], ...]:
        def joint(k: int) -> tuple[AbstractFriction, PyTree]:
            group, own = jax.tree.map(lambda x: x[k : k + 1] if eqx.is_array(x) else x, (self, memory))
            return replace_fields(group, slips=Axis(None, self.slips.kinds[k : k + 1])), own

        return tuple(joint(k) for k in range(len(self.slips)))

    def slip(self, q: Array, t: Array) -> Array:
        return self.joints.over(lambda joint, i, j: joint.slip(i, j), poses(q).with_axes())

    def force(self, loads: Array, rate: Array, sense: Array, memory: PyTree, state: State) -> Array:
        return eqx.filter_vmap(lambda model, *args: model.force(*args))(
            self.model, self._normal(loads), rate, sense, memory
        )

    def largest_change(self, change: Array, rate: Array, memory: PyTree) -> Array:
        """A normal load is a seminorm of the joint's multipliers, so that its change is at most that of the change."""
        slope = eqx.filter_vmap(lambda model, *args: model.slope_bound(*args))(self.model, rate, memory)
        return slope * self._normal(change)

    def memory_size(self) -> PyTree:
        return eqx.filter_vmap(lambda model: model.memory_size())(self.model)

    def memory_rate(self, rate: Array, memory: PyTree, state: State) -> PyTree:
        return eqx.filter_vmap(lambda model, *args: model.memory_rate(*args))(self.model, rate, memory)

    def _normal(self, loads: Array) -> Array:
        if not self.model.depends_on_load:
            return jnp.zeros(loads.shape[:1], loads.dtype)
        return eqx.filter_vmap(lambda joint, own: joint.normal_load(own))(self.joints.element, loads)


class FrictionMembers(eqx.Module):
    """Which joints of a stack have friction of one model, `None` for all of them, and their rows."""

    kind: int = eqx.field(static=True)
    members: Int[Array, " p"] | None
    model: AbstractFrictionModel
    rows: Int[Array, "p rows"]
    slips: Axis = eqx.field(static=True)

    def of(self, joints: Sequence[Stack]) -> JointFriction:
        """The friction group, given the stacks of joints."""
        stack = joints[self.kind]
        some = stack if self.members is None else stack.take(self.members)
        return JointFriction(joints=some, model=self.model, rows=self.rows, slips=self.slips)


def friction_members(kind: int, joints: Sequence[AbstractJoint], places: np.ndarray) -> list[FrictionMembers]:
    """Members of one kind of joint that have friction, model by model; `places` are their rows, (members, rows)."""
    frictional = {
        k: (joint, as_functions(joint.law))
        for k, joint in enumerate(joints)
        if isinstance(joint, AbstractFrictionalJoint) and joint.friction is not None
    }
    out = []
    for group in kinds([model for _, model in frictional.values()]):
        members = [list(frictional)[k] for k in group]
        model = stacked([frictional[k][1] for k in members])
        rows = places[members] if model.depends_on_load else np.zeros((len(members), 0))
        names = tuple(joints[k].name for k in members)
        slips = Axis(names, (frictional[members[0]][0].slip_kind,) * len(members))
        some = None if members == list(range(len(joints))) else indices(members)
        out.append(FrictionMembers(kind, some, model, indices(rows), slips))
    return out
