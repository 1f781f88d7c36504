"""Coordinates that joints have, c(q): the angle of a revolute, the travel of a slider, how they move, and joint loads.

    c' = c_q qd,   c'' = c_q qdd + what the velocity adds

The load of a joint, its reaction, is what body j does to body i through its constraints: a force, and a moment. Where
the ground is body i it is what the ground does to body j.

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
    """The coordinates and reactions of the joints of a system, in the order of the names of both."""

    @abc.abstractmethod
    def motion(self, state: State, acceleration: Float[Array, " n"]) -> JointMotion:
        """How they move at a state."""

    @abc.abstractmethod
    def reactions(self, state: State, multipliers: Float[Array, " m"]) -> Float[Array, " r"]:
        """Force (x, y) in global components, and moment, of each joint at a state."""


class NoJointCoordinates(AbstractJointCoordinates):
    """Those of a system that has none."""

    def motion(self, state: State, acceleration: Array) -> JointMotion:
        none = jnp.zeros(0, state.qd.dtype)
        return JointMotion(none, none, none)

    def reactions(self, state: State, multipliers: Array) -> Array:
        return jnp.zeros(0, multipliers.dtype)


def joint_motion(
    joints: AbstractJointCoordinates | None, state: State, acceleration: Array, *, times: bool = False
) -> JointMotion:
    """The motion of joints at a state, at all `times` of a motion if it has them, or in a batch of either."""
    return _everywhere("motion", joints or NoJointCoordinates(), state, acceleration, times)


def joint_reactions(
    joints: AbstractJointCoordinates | None, state: State, multipliers: Array, *, times: bool = False
) -> Float[Array, "*batch r"]:
    """Their reactions, likewise."""
    return _everywhere("reactions", joints or NoJointCoordinates(), state, multipliers, times)


@compiled
def _everywhere(what: str, joints: AbstractJointCoordinates, state: State, values: Array, times: bool) -> Any:
    def of_one(joints: AbstractJointCoordinates, *given: Any) -> Any:
        function = getattr(joints, what)
        return jax.vmap(function)(*given) if times else function(*given)

    for _ in range(values.ndim - 1 - times):
        of_one = jax.vmap(of_one)
    return of_one(joints, state, values)
