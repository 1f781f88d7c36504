"""Friction of the joints of a mechanism, those of one kind and one model together.

A mechanism keeps which joints have friction as indices; their geometry stays in the stacks of the joints.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, Int, PyTree

from .._system._axis import Axis
from .._system._friction import AbstractFriction
from .._system._state import State
from .._tools._functions import as_functions
from .._tools._module import as_float, replace_fields, tree_pick, tree_take
from .._tools._value import AbstractModule
from ._frame import AbstractFrame, AbstractPose
from ._friction_model import AbstractFrictionModel, Times
from ._joints import AbstractJoint, AbstractRubbingJoint
from ._stack import Stack, indices, kinds, stacked


class JointFriction(AbstractFriction):
    """Friction of one model in joints of one kind, between bodies of a frame with their centres of mass.

    An internal state has a leading axis over the joints, and another over the slips of each where they are several.
    """

    frame: AbstractFrame = eqx.field(static=True)
    centres: Float[Array, "bodies axes"] | None
    joints: Stack[AbstractRubbingJoint]
    model: AbstractFrictionModel
    rows: Int[Array, "joints rows"]
    slips: Axis = eqx.field(static=True)

    @property
    def has_sense(self) -> bool:
        """As the model has."""
        return self.model.has_sense

    @property
    def may_bend(self) -> bool:
        """As the model, and where a slider comes out of its guide."""
        return self.model.bends or self.joints.element.reads_pose

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
        """As the joints have, where their slips share one friction."""
        if not self.has_direction:
            return jnp.ones(len(self.slips))
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

    def slip_at(self, poses: AbstractPose, relative: PyTree = None) -> Float[Array, " p"]:
        """`slip` at poses of all bodies, or at what the joints are functions of."""
        return self.joints.over(lambda joint, i, j: joint.slips(i, j), poses, relative).ravel()

    def directions_at(self, poses: AbstractPose) -> Float[Array, "n p"]:
        """E at poses of all bodies, of which the ground has no velocities."""
        own = self.joints.over(lambda joint, i, j: joint.by_velocities(joint.slips, i, j), poses)
        whole = self.joints.by_bodies(own, poses.r.shape[0] - 1)
        return self.frame.by_velocities(whole.reshape(-1, *whole.shape[2:])).T

    def force(self, loads: Array, rate: Array, sense: Array, memory: PyTree, state: State) -> Array:
        rate, sense = self._by_joint(rate), self._by_joint(sense)
        return self._over(lambda joint, *own: joint.forces(*own), state, loads, rate, sense, memory)

    def largest_change(self, change: Array, rate: Array, memory: PyTree, state: State) -> Array:
        rate = self._by_joint(rate)
        return self._over(lambda joint, *own: joint.largest_changes(*own), state, change, rate, memory)

    def memory_size(self) -> PyTree:
        sizes = eqx.filter_vmap(lambda model: model.memory_size())(self.model)
        return sizes if self.width == 1 else jax.tree.map(lambda x: jnp.repeat(x[:, None], self.width, axis=1), sizes)

    def memory_rate(self, rate: Array, memory: PyTree, state: State) -> PyTree:
        if memory is None:
            return None
        over = eqx.filter_vmap(lambda joint, *own: joint.memory_rates(*own))
        return over(self.joints.element, self.model, self._by_joint(rate), memory)

    def _by_joint(self, slips: Array) -> Array:
        return slips.reshape(-1, self.width)

    def _over(self, function: Callable[..., Array], state: State, *arguments: PyTree) -> Array:
        """A function of joint, model, poses of both bodies where it reads them, and arguments of each joint."""
        ends = None
        if self.joints.element.reads_pose:
            bodies = self.frame.poses(self.centres, state.q)
            ends = tree_pick(bodies, self.joints.i), tree_pick(bodies, self.joints.j)
        return eqx.filter_vmap(function)(self.joints.element, self.model, ends, *arguments).ravel()


class FrictionMembers(AbstractModule):
    """Which joints of a stack have friction of one model, `None` for all of them, and their rows."""

    kind: int = eqx.field(static=True)
    members: Int[Array, " p"] | None
    model: AbstractFrictionModel
    rows: Int[Array, "p rows"]
    slips: Axis = eqx.field(static=True)

    @property
    def joints(self) -> list[str]:
        """Names of the joints."""
        width = len(self.slips) // len(self.rows)
        return [label if width == 1 else label.rpartition(".")[0] for label in self.slips.labels[::width]]

    def times(self, factors: Mapping[str, ArrayLike]) -> Self:
        """The same with friction of some joints, by name, as a multiple."""
        own = as_float(np.array([factors.get(name, 1.0) for name in self.joints]))
        return replace_fields(self, model=Times(self.model, own))

    def of_stack(self, parts: Sequence[PyTree]) -> PyTree:
        """What these joints have, of parts that the stacks of joints have; None where theirs is."""
        own = parts[self.kind]
        return own if own is None or self.members is None else tree_take(own, self.members)

    def of(self, joints: Sequence[Stack], frame: AbstractFrame, centres: Array | None) -> JointFriction:
        """The friction group, given the stacks of joints, and frame and centres of the bodies."""
        stack = joints[self.kind]
        some = stack if self.members is None else stack.take(self.members)
        return JointFriction(
            frame=frame, centres=centres, joints=some, model=self.model, rows=self.rows, slips=self.slips
        )


def friction_members(kind: int, joints: Sequence[AbstractJoint], places: np.ndarray) -> list[FrictionMembers]:
    """Members of one kind of joint that have friction, model by model; `places` are their rows, (members, rows)."""
    frictional: dict[int, tuple[AbstractRubbingJoint, AbstractFrictionModel]] = {
        k: (joint, as_functions(joint.law))
        for k, joint in enumerate(joints)
        if isinstance(joint, AbstractRubbingJoint) and joint.law is not None
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


def _slips(joints: Sequence[AbstractRubbingJoint]) -> Axis:
    """Names and kinds of their slips: the name of a joint with one slip, "name.slip" of others."""
    named = [(joint.name, *slip) for joint in joints for slip in joint.slip_kinds]
    return Axis(tuple(f"{name}.{slip}" if slip else name for name, slip, _ in named), tuple(k for *_, k in named))
