"""Coordinates that joints have, c(q): the angle of a revolute, the travel of a slider, and how they move.

    c' = c_q qd,   c'' = c_q qdd + what the velocity adds

A result holds what they are computed from, and computes them when they are asked for: a solve pays nothing.
"""

import abc
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._tools._compilation import compiled
from ._state import State


class JointMotion(eqx.Module):
    """Joint coordinates, m or rad, their rates and their accelerations, shape (c,) each, with axes of a batch."""

    position: Float[Array, "..."]
    rate: Float[Array, "..."]
    acceleration: Float[Array, "..."]


class AbstractJointCoordinates(eqx.Module):
    """The coordinates that the joints of a system have, in the order of `names.joint_coordinates`."""

    @abc.abstractmethod
    def motion(self, state: State, acceleration: Float[Array, " n"]) -> JointMotion:
        """How they move at a state."""


class NoJointCoordinates(AbstractJointCoordinates):
    """Those of a system that has none."""

    def motion(self, state: State, acceleration: Array) -> JointMotion:
        none = jnp.zeros(0, state.qd.dtype)
        return JointMotion(none, none, none)


@compiled
def joint_motion(
    joints: AbstractJointCoordinates, state: State, acceleration: Array, *, times: bool = False
) -> JointMotion:
    """The motion of joints at a state, at all `times` of a motion if it has them, or in a batch of either."""

    def of_one(joints: AbstractJointCoordinates, *motion: Any) -> JointMotion:
        return jax.vmap(joints.motion)(*motion) if times else joints.motion(*motion)

    for _ in range(acceleration.ndim - 1 - times):
        of_one = jax.vmap(of_one)
    return of_one(joints, state, acceleration)
