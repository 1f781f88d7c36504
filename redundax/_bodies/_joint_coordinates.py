"""Coordinates of the joints of a mechanism: those that friction opposes, of all joints that can have some."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._system._joint_coordinates import AbstractJointCoordinates, JointMotion, NoJointCoordinates
from .._system._state import State
from ._body import Pose, poses
from ._stack import Stack


class JointCoordinates(AbstractJointCoordinates):
    """Those of stacks of joints."""

    joints: tuple[Stack[Any], ...]

    def motion(self, state: State, acceleration: Array) -> JointMotion:
        finite = jnp.all(jnp.isfinite(acceleration))
        moving = state.q, state.qd, jnp.where(finite, acceleration, 0.0)
        body = jax.tree.map(lambda *x: jnp.stack(x, axis=1), *map(poses, moving))
        parts = [joints.over(_moved, body) for joints in self.joints]
        found = jax.tree.map(lambda *x: jnp.concatenate(x), NoJointCoordinates().motion(state, acceleration), *parts)
        # What is not there is NaN, and NaN its derivatives, but a gradient passes nothing on to what is.
        return JointMotion(found.position, found.rate, jnp.where(finite, found.acceleration, jnp.sum(acceleration)))


def _moved(joint: Any, i: Pose, j: Pose) -> JointMotion:
    """The coordinate of a joint, given poses of its bodies, their rates and the rates of these, stacked."""

    def along(*at_and_rate: Pose) -> tuple[Array, Array]:
        return jax.jvp(lambda i, j: joint.slip(i.with_axes(), j.with_axes()), at_and_rate[:2], at_and_rate[2:])

    (position, rate), (_, change) = jax.jvp(along, (i[0], j[0], i[1], j[1]), (i[1], j[1], i[2], j[2]))
    return JointMotion(position, rate, change)
