"""Coordinates that joints have, c(q): the angle of a revolute, the travel of a slider, how they move, and joint loads.

    c' = c_q qd,   c'' = c_q qdd + what the velocity adds

The load of a joint, its reaction, is what body j does to body i through its constraints: a force, and a moment. Where
the ground is body i it is what the ground does to body j.

A result holds what they are computed from, and computes them when they are asked for: a solve pays nothing. An angle
that a position gives but for whole turns is followed along a motion by its rate.
"""

import abc

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, PyTree

from .._tools._module import replace_fields
from .._tools._numbers import of_model, on_numbers
from .._tools._value import AbstractModel, AbstractModule
from ._state import State


class JointMotion(AbstractModule):
    """Joint coordinates, m or rad, their rates and their accelerations, shape (c,) each, with axes of a batch."""

    position: Float[Array, "..."]
    rate: Float[Array, "..."]
    acceleration: Float[Array, "..."]


class AbstractJointCoordinates(AbstractModel):
    """The coordinates and reactions of the joints of a system, in the order of the names of both."""

    @property
    @abc.abstractmethod
    def wraps(self) -> Bool[np.ndarray, " c"]:
        """Which of them are angles that a position gives but for whole turns."""

    @property
    def radian(self) -> ArrayLike:
        """One radian in the unit of angles."""
        return 1.0

    @property
    def opposite(self) -> "AbstractJointCoordinates":
        """The same with the reactions on the other body of each joint."""
        return self

    @abc.abstractmethod
    def positions(self, state: State) -> Float[Array, " c"]:
        """Them alone at a state."""

    @abc.abstractmethod
    def motion(self, state: State, acceleration: Float[Array, " n"]) -> JointMotion:
        """How they move at a state."""

    @abc.abstractmethod
    def reactions(self, state: State, multipliers: Float[Array, " m"]) -> Float[Array, " r"]:
        """Force and moment of each joint at a state, in global components: (x, y) and one moment in the plane, three
        of each in space."""


class NoJointCoordinates(AbstractJointCoordinates):
    """Those of a system that has none."""

    @property
    def wraps(self) -> np.ndarray:
        return np.zeros(0, bool)

    def positions(self, state: State) -> Array:
        return jnp.zeros(0, state.qd.dtype)

    def motion(self, state: State, acceleration: Array) -> JointMotion:
        none = jnp.zeros(0, state.qd.dtype)
        return JointMotion(none, none, none)

    def reactions(self, state: State, multipliers: Array) -> Array:
        return jnp.zeros(0, multipliers.dtype)


def joint_motion(
    joints: AbstractJointCoordinates | None, state: State, acceleration: Array, *, times: bool = False
) -> JointMotion:
    """The motion of joints at a state, at all `times` of a motion if it has them, or in a batch of either.

    Along times angles go on from the first, which is between -pi and pi, instead of jumping by a turn.
    """
    return _everywhere("motion", joints or NoJointCoordinates(), state, acceleration, times)


def joint_reactions(
    joints: AbstractJointCoordinates | None, state: State, multipliers: Array, *, times: bool = False
) -> Float[Array, "*batch r"]:
    """Their reactions, likewise."""
    if not times and multipliers.ndim == 1:
        return _at_state(joints or NoJointCoordinates(), state, multipliers)
    return _everywhere("reactions", joints or NoJointCoordinates(), state, multipliers, times)


@on_numbers
def _at_state(joints: AbstractJointCoordinates, state: State, multipliers: Array) -> Array:
    return joints.reactions(state, multipliers)


@of_model
def _everywhere(what: str, joints: AbstractJointCoordinates, state: State, values: Array, times: bool) -> PyTree:
    def of_one(joints: AbstractJointCoordinates, *given: PyTree) -> PyTree:
        function = getattr(joints, what)
        found = jax.vmap(function)(*given) if times else function(*given)
        return _followed(found, given[0].t, joints) if times and what == "motion" else found

    for _ in range(values.ndim - 1 - times):
        of_one = jax.vmap(of_one)
    return of_one(joints, state, values)


def _followed(motion: JointMotion, t: Float[Array, " times"], joints: AbstractJointCoordinates) -> JointMotion:
    """The same with the whole turns that rates and accelerations at both ends of an interval h say,

        h (c'_1 + c'_2) / 2 + h^2 (c''_1 - c''_2) / 12,

    which is exact where the rate is a parabola of time. Where friction stops a joint or turns it round between, rates
    change by far less than accelerations say: then fewer turns, of these and those that rates alone say.
    """
    if not joints.wraps.any():
        return motion
    h, turn = jnp.diff(t)[:, None], 2 * jnp.pi * jnp.asarray(joints.radian, t.dtype)
    first, last = h * motion.acceleration[:-1], h * motion.acceleration[1:]
    missed = jnp.abs(jnp.diff(motion.rate, axis=0) - (first + last) / 2)
    ways = h * (motion.rate[1:] + motion.rate[:-1]) / 2 - h * jnp.stack([last - first, jnp.zeros_like(first)]) / 12
    by_both, by_rates = jnp.round((ways - jnp.diff(motion.position, axis=0)) / turn)
    # 0.5 is where one end tells of a change and there is none; smooth motions seen four times a period are below.
    breaks = missed > 0.4 * (jnp.abs(first) + jnp.abs(last))
    turns = jnp.where(breaks & (jnp.abs(by_rates) < jnp.abs(by_both)), by_rates, by_both)
    followed = motion.position.at[1:].add(turn * jnp.cumsum(turns, axis=0))
    return replace_fields(motion, position=jnp.where(joints.wraps, followed, motion.position))
