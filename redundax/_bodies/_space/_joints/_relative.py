"""The placement of a joint on body i as that on body j sees it

    B = R_j A_j,   (T, d) = B^T (R_i A_i, p_i - p_j),   W = B^T B'

with the turn T and the offset d, in the axes of the placement on j, which turn at W. With X = (T, d) and X_1, X_2 as
X of the first and second derivatives of what B^T stands before

    X' = X_1 - W X,   X'' = X_2 - W (X_1 + X')

Bodies move it, each at its velocity and its angular velocity in its own axes, by

    d' = B^T (v_i - v_j) + w_i x a_i - w_j x a_j,   [w_i - w_j]x = T' T^T

with w_i = B^T R_i omega_i, w_j = A_j^T omega_j and the arms a_i, a_j from the centres of mass to p_i in the same axes.
"""

from typing import NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._pose import Pose
from .._rotation import multiplied, skew, times


@runtime_checkable
class Placed(Protocol):
    """A joint or load with a point and axes on both bodies."""

    point_i: Array
    axes_i: Array
    point_j: Array
    axes_j: Array


class Relative(NamedTuple):
    """Offset and turn of a joint's placement on body i from that on body j, in the axes on j."""

    offset: Float[Array, "3"]
    turn: Float[Array, "3 3"]

    @classmethod
    def between(cls, placed: Placed, i: Pose, j: Pose) -> "Relative":
        """That of a joint or load with `point_i`, `axes_i`, `point_j` and `axes_j`."""
        return cls.of(multiplied(multiplied(j.axes, placed.axes_j).T, _there(placed, i, j)))

    @classmethod
    def along(cls, placed: Placed, i: Pose, j: Pose) -> tuple["Relative", "Relative", "Relative"]:
        """That, its rate and the rate of this, given poses with their rates and the rates of these."""
        own = multiplied(j.axes[:2], placed.axes_j)
        back = own[0].T
        seen, spin = multiplied(back, _there(placed, i, j)), multiplied(back, own[1])
        rate = seen[1] - multiplied(spin, seen[0])
        bend = seen[2] - multiplied(spin, seen[1] + rate)
        return cls.of(seen[0]), cls.of(rate), cls.of(bend)

    @classmethod
    def moved(cls, placed: Placed, i: Pose, j: Pose) -> tuple["Relative", "Relative"]:
        """That, and its rates by the velocities of body i, then of body j, stacked."""
        back = multiplied(j.axes, placed.axes_j).T
        seen = cls.of(multiplied(back, _there(placed, i, j)))
        turns = jnp.stack([multiplied(back, i.axes), placed.axes_j.T])  # of each body's axes
        end = placed.point_j + times(placed.axes_j, seen.offset)  # of the placement on i, in the axes of body j
        arms = jnp.stack([placed.point_i - i.centre, end - j.centre])
        shifts = jnp.concatenate([jnp.broadcast_to(back, turns.shape), -multiplied(turns, skew(arms))], axis=2)
        both = jnp.concatenate([shifts, jnp.pad(turns, ((0, 0), (0, 0), (3, 0)))], axis=1)
        shifts, turns = jnp.split(jnp.concatenate([both[0].T, -both[1].T]), 2, axis=1)
        return seen, cls(shifts, multiplied(skew(turns), seen.turn))

    @classmethod
    def of(cls, both: Float[Array, "3 4"]) -> "Relative":
        """Turn and offset side by side."""
        return cls(both[:, 3], both[:, :3])

    @property
    def shift(self) -> Float[Array, "2"]:
        """Offset square to the axis."""
        return self.offset[:2]

    @property
    def travel(self) -> Float[Array, ""]:
        """Offset along the axis."""
        return self.offset[2]

    @property
    def tilt(self) -> Float[Array, "2"]:
        """Tilt of the axis about x and y: 2 tan(half the angle), about the axis of the tilt."""
        x, y, z = self.turn[:, 2]
        return jnp.stack([-y, x]) * (2 / (1 + z))

    @property
    def rotation(self) -> Float[Array, "3"]:
        """Turn about x, y and z: 2 tan(half the angle), about the axis of the turn."""
        (_, xy, xz), (yx, _, yz), (zx, zy, _) = self.turn
        return jnp.stack([zy - yz, xz - zx, yx - xy]) * (2 / (1 + jnp.trace(self.turn)))

    @property
    def spin(self) -> Float[Array, "3"]:
        """Zero, with the relative angular velocity as its rate: not that of any coordinates."""
        return _spin(self.turn)

    @property
    def twist(self) -> tuple[Array, Array]:
        """Sine and cosine of the turn about the axis, both times the same positive number."""
        return self.turn[1, 0] - self.turn[0, 1], self.turn[0, 0] + self.turn[1, 1]

    @property
    def angle(self) -> Float[Array, ""]:
        """Turn about the axis, from -pi to pi."""
        return _angle(*self.twist)

    def angle_from(self, angle: Array) -> Float[Array, ""]:
        """Turn about the axis beyond an angle of any number of turns, from -pi to pi."""
        (sine, cosine), s, c = self.twist, jnp.sin(angle), jnp.cos(angle)
        return _angle(sine * c - cosine * s, cosine * c + sine * s)


@jax.custom_jvp
def _angle(sine: Float[Array, ""], cosine: Float[Array, ""]) -> Float[Array, ""]:
    return jnp.arctan2(sine, cosine)


@_angle.defjvp
def _angle_jvp(primals: tuple[Array, Array], tangents: tuple[Array, Array]) -> tuple[Array, Array]:
    """(c s' - s c') / (s^2 + c^2), which compiles to less than the derivative of `arctan2`."""
    (sine, cosine), (by_sine, by_cosine) = primals, tangents
    return _angle(*primals), (cosine * by_sine - sine * by_cosine) / (sine * sine + cosine * cosine)


@jax.custom_jvp
def _spin(turn: Float[Array, "3 3"]) -> Float[Array, "3"]:
    return jnp.zeros(3, turn.dtype)


@_spin.defjvp
def _spin_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    """[omega]x = T' T^T, whose derivatives are those of the angular velocity."""
    rate = multiplied(tangents[0], primals[0].T)
    omega = jnp.stack([rate[2, 1] - rate[1, 2], rate[0, 2] - rate[2, 0], rate[1, 0] - rate[0, 1]]) / 2
    return jnp.zeros(3, omega.dtype), omega


def _there(placed: Placed, i: Pose, j: Pose) -> Float[Array, "*orders 3 4"]:
    """R_i A_i and p_i - p_j."""
    on_i = jnp.concatenate([placed.axes_i, placed.point_i[:, None]], axis=1)
    apart = i.r - j.r - times(j.axes, placed.point_j)
    return multiplied(i.axes, on_i) + jnp.pad(apart[..., None], [(0, 0)] * apart.ndim + [(3, 0)])
