"""One coordinate c of joints of one kind, its derivative J by the velocities of both bodies, and where these are; and
sums of such coordinates."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from .._tools._value import AbstractModule
from ._frame import AbstractFrame, AbstractPose
from ._joints import AbstractJoint
from ._stack import Stack

Place = tuple[int, int, int, str]  # stack, column, member and kind of a coordinate
SPIN = -1


class Coordinate(AbstractModule):
    """One coordinate of some members of a stack of joints; of ball joints, which have none, `column` is `SPIN`."""

    kind: int = eqx.field(static=True)
    column: int = eqx.field(static=True)
    members: Int[Array, " size"]

    def value(self, joints: Sequence[Stack], bodies: AbstractPose) -> Float[Array, " size"]:
        some = joints[self.kind].take(self.members)
        return some.over(lambda joint, i, j: joint.coordinates(i, j)[self.column], bodies)

    def slopes(self, joints: Sequence[Stack], bodies: AbstractPose) -> Float[Array, "rates columns"]:
        """Derivatives by the velocities of both bodies; of a spin in the axes of body i, three of each."""
        some = joints[self.kind].take(self.members)

        def of_one(joint: AbstractJoint, i: PyTree, j: PyTree) -> Array:
            if self.column == SPIN:
                none, one = jnp.zeros((3, 3), i.axes.dtype), jnp.eye(3, dtype=i.axes.dtype)
                return jnp.concatenate([none, one, none, -i.axes.T @ j.axes], axis=1)
            return joint.by_velocities(lambda i, j: joint.coordinates(i, j)[self.column : self.column + 1], i, j)

        found = some.over(of_one, bodies)
        return found.reshape(-1, found.shape[-1])

    def bodies(self, joints: Sequence[Stack]) -> np.ndarray:
        """Both bodies of each, (size, 2); concrete values."""
        stack, members = joints[self.kind], np.asarray(self.members)
        return np.stack([np.asarray(body)[members] for body in (stack.i, stack.j)], axis=1)

    def columns(self, joints: Sequence[Stack], frame: AbstractFrame, count: int) -> np.ndarray:
        """Where the velocities of both bodies are among those of `count`, and of the ground beyond the last."""
        outside = np.full(frame.size, frame.size * count)
        columns = [*(frame.columns(body, count) for body in range(count)), outside]
        return np.array(columns)[self.bodies(joints)].reshape(-1, 2 * frame.size)


class Total(AbstractModule):
    """Sums of coordinates, each times a weight."""

    parts: tuple[Coordinate, ...]
    weights: Float[Array, "size parts"]

    def value(self, joints: Sequence[Stack], bodies: AbstractPose) -> Float[Array, " size"]:
        first, *others = (self.weights[:, k] * part.value(joints, bodies) for k, part in enumerate(self.parts))
        return sum(others, first)

    def slopes(self, joints: Sequence[Stack], bodies: AbstractPose) -> Float[Array, "size columns"]:
        """Derivatives by the velocities of both bodies of each part, one after the other."""
        parts = [self.weights[:, k, None] * part.slopes(joints, bodies) for k, part in enumerate(self.parts)]
        return jnp.concatenate(parts, axis=1)

    def bodies(self, joints: Sequence[Stack]) -> np.ndarray:
        """These bodies, (size, 2 parts); concrete values."""
        return np.concatenate([part.bodies(joints) for part in self.parts], axis=1)

    def columns(self, joints: Sequence[Stack], frame: AbstractFrame, count: int) -> np.ndarray:
        """Where their velocities are, as of `Coordinate`."""
        return np.concatenate([part.columns(joints, frame, count) for part in self.parts], axis=1)


def coordinate_places(joints: Sequence[AbstractJoint], groups: Sequence[Sequence[int]]) -> dict[str, Place]:
    """Where the coordinates of joints are, by name."""
    return {
        f"{joints[k].name}.{name}": (stack, column, member, kind)
        for stack, group in enumerate(groups)
        for member, k in enumerate(group)
        for column, (name, kind) in enumerate(joints[k].coordinate_kinds)
    }


def ball_places(joints: Sequence[AbstractJoint], groups: Sequence[Sequence[int]]) -> dict[str, Place]:
    """The same of the relative angular velocity of ball joints, by their names."""
    return {
        joints[k].name: (stack, SPIN, member, "angular")
        for stack, group in enumerate(groups)
        for member, k in enumerate(group)
        if joints[k].has_spin
    }
