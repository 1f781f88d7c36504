"""Friction of the joints of a mechanism, those of one kind and one model together.

A mechanism keeps which joints have friction as indices; their geometry stays in the stacks of the joints.
"""

from collections.abc import Callable, Sequence
from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from .._system._axis import Axis
from .._system._friction import AbstractFriction
from .._system._state import State
from .._tools._module import as_functions, replace_fields, tree_take
from ._frame import AbstractFrame
from ._friction_model import AbstractFrictionModel
from ._joints import AbstractJoint
from ._slip_directions import scattered
from ._stack import Stack, indices, kinds, stacked
from ._vector_friction import VectorFriction


class JointFriction(AbstractFriction):
    """Friction of one model in frictional joints of one kind, between bodies of a frame with their centres of mass."""

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
    def has_convex_limits(self) -> bool:
        """Where normal loads are seminorms, and the model proportional to them."""
        return self.model.is_proportional and self.joints.element.has_convex_load

    @property
    def anonymous(self) -> Self:
        return replace_fields(self, slips=self.slips.anonymous)

    def apart(self, memory: PyTree) -> tuple[tuple[AbstractFriction, PyTree], ...]:
        def joint(k: int) -> tuple[AbstractFriction, PyTree]:
            parts = self.joints, self.model, self.rows, memory
            joints, model, rows, own = jax.tree.map(lambda x: x[k : k + 1] if eqx.is_array(x) else x, parts)
            slips = Axis(None, self.slips.kinds[k : k + 1])
            return replace_fields(self, joints=joints, model=model, rows=rows, slips=slips), own

        return tuple(joint(k) for k in range(len(self.slips)))

    def slip(self, q: Array, t: Array) -> Array:
        return self.slip_at(self.frame.poses(self.centres, q))

    def slip_at(self, poses: Any, relative: Any = None) -> Float[Array, " p"]:
        """`slip` at poses of all bodies, or at what the joints are functions of."""
        return self.joints.over(lambda joint, i, j: joint.slip(i, j), poses, relative)

    def directions_at(self, poses: Any) -> Float[Array, "n p"]:
        """E at poses of all bodies."""
        own = self.joints.over(
            lambda joint, i, j: joint.by_velocities(lambda *ends: joint.slip(*ends)[None], i, j), poses
        )
        return scattered(self.frame, self.joints, own, poses)

    def force(self, loads: Array, rate: Array, sense: Array, memory: PyTree, state: State) -> Array:
        return eqx.filter_vmap(lambda model, *args: model.force(*args))(
            self.model, self._normal(loads, state), rate, sense, memory
        )

    def largest_change(self, change: Array, rate: Array, memory: PyTree, state: State) -> Array:
        slope = eqx.filter_vmap(lambda model, *args: model.slope_bound(*args))(self.model, rate, memory)
        if not self.model.depends_on_load:
            return jnp.zeros_like(slope)
        load = self._of_loads(lambda joint, *own: joint.largest_change(*own), change, state)
        return jnp.where(slope == 0, 0.0, slope * load)

    def memory_size(self) -> PyTree:
        return eqx.filter_vmap(lambda model: model.memory_size())(self.model)

    def memory_rate(self, rate: Array, memory: PyTree, state: State) -> PyTree:
        return eqx.filter_vmap(lambda model, *args: model.memory_rate(*args))(self.model, rate, memory)

    def _normal(self, loads: Array, state: State) -> Array:
        if not self.model.depends_on_load:
            return jnp.zeros(loads.shape[:1], loads.dtype)
        return self._of_loads(lambda joint, *own: joint.normal_load(*own), loads, state)

    def _of_loads(self, function: Callable[..., Array], loads: Array, state: State) -> Array:
        """A function of joint and loads, and of the poses of both bodies where it reads them."""
        if not self.joints.element.reads_pose:
            return eqx.filter_vmap(function)(self.joints.element, loads)
        bodies = self.frame.poses(self.centres, state.q)
        ends = tree_take(bodies, self.joints.i), tree_take(bodies, self.joints.j)
        return eqx.filter_vmap(function)(self.joints.element, loads, ends)


class FrictionMembers(eqx.Module):
    """Which joints of a stack have friction of one model, `None` for all of them, and their rows."""

    kind: int = eqx.field(static=True)
    members: Int[Array, " p"] | None
    model: AbstractFrictionModel
    rows: Int[Array, "p rows"]
    slips: Axis = eqx.field(static=True)

    @property
    def is_scalar(self) -> bool:
        """Whether a joint has one slip."""
        return len(self.slips) == len(self.rows)

    @property
    def joints(self) -> list[str]:
        """Names of the joints."""
        labels = self.slips.labels[:: max(1, len(self.slips) // len(self.rows))]
        return [label if self.is_scalar else label.rpartition(".")[0] for label in labels]

    def of_stack(self, parts: Sequence[Any]) -> Any:
        """What these joints have, of parts that the stacks of joints have; None where theirs is."""
        own = parts[self.kind]
        return own if own is None or self.members is None else tree_take(own, self.members)

    def of(
        self, joints: Sequence[Stack], frame: AbstractFrame, centres: Array | None
    ) -> "JointFriction | VectorFriction":
        """The friction group, given the stacks of joints, and frame and centres of the bodies."""
        stack = joints[self.kind]
        some = stack if self.members is None else stack.take(self.members)
        kind = VectorFriction if hasattr(stack.element, "slip_kinds") else JointFriction
        return kind(frame=frame, centres=centres, joints=some, model=self.model, rows=self.rows, slips=self.slips)


def friction_members(kind: int, joints: Sequence[AbstractJoint], places: np.ndarray) -> list[FrictionMembers]:
    """Members of one kind of joint that have friction, model by model; `places` are their rows, (members, rows)."""
    frictional: dict[int, tuple[Any, AbstractFrictionModel]] = {
        k: (joint, as_functions(joint.law)) for k, joint in enumerate(joints) if joint.law is not None
    }
    out = []
    for group in kinds([model for _, model in frictional.values()]):
        members = [list(frictional)[k] for k in group]
        model = stacked([frictional[k][1] for k in members])
        rows = places[members] if model.depends_on_load else np.zeros((len(members), 0))
        slips = _slips([frictional[k][0] for k in members])
        some = None if members == list(range(len(joints))) else indices(members)
        out.append(FrictionMembers(kind, some, model, indices(rows), slips))
    return out


def _slips(joints: Sequence[Any]) -> Axis:
    """Names and kinds of the slips of joints of a kind: the name of a joint with one slip, "name.slip" of others."""
    kinds = getattr(joints[0], "slip_kinds", None)
    if kinds is None:
        return Axis(tuple(joint.name for joint in joints), (joints[0].slip_kind,) * len(joints))
    named = [(f"{joint.name}.{slip}", kind) for joint in joints for slip, kind in kinds]
    return Axis(tuple(name for name, _ in named), tuple(kind for _, kind in named))
