"""Poses of bodies in space, their rates, and wrenches on them."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from ..._tools._value import AbstractModule
from .._frame import AbstractPose
from ._rotation import cross, times


class Pose(AbstractPose):
    """Position (3,) and axes (3, 3) of a body's local frame in the global frame, of one body or stacked.

    - `r`: origin of the local frame, m.
    - `axes`: its axes as columns, the rotation matrix R.
    - `centre`: centre of mass in the local frame, m.

    ??? example

        ```python
        pose = rx.spatial.Pose(jnp.zeros(3), jnp.eye(3), jnp.zeros(3))
        pose.point(jnp.array([0.5, 0.0, 0.0]))  # [0.5, 0.0, 0.0]
        ```
    """

    r: Float[Array, "*bodies 3"]
    axes: Float[Array, "*bodies 3 3"]
    centre: Float[Array, "*bodies 3"]
    seen: PyTree = None  # placement of a joint on this body i as that on body j sees it, for one that has formed it

    def point(self, s: Float[Array, "3"]) -> Float[Array, "3"]:
        """Global position of the point s of the local frame: r + R s."""
        return self.r + self.rotate(s)

    def rotate(self, v: Float[Array, "3"]) -> Float[Array, "3"]:
        """Global components of the local vector v: R v."""
        return times(self.axes, v)

    def local(self, x: Float[Array, "3"]) -> Float[Array, "3"]:
        """Position in the local frame of the global point x: R^T (x - r)."""
        return times(self.axes.T, x - self.r)

    def unit_rates(self) -> "Pose":
        """Rates of a pose as the centre of mass moves along the global axes, and the body turns about its own."""
        one = np.eye(3, dtype=self.r.dtype)
        turns = cross(self.axes, one[:, None])
        none = jnp.zeros_like(turns)
        r = jnp.concatenate([one, -times(turns, self.centre)])
        return Pose(r, jnp.concatenate([none, turns]), jnp.zeros_like(r))


class Wrench(AbstractModule):
    """Force (3,), N, and moment about the local frame's origin (3,), N m, on a body, both in global components.

    ??? example

        ```python
        rx.spatial.Wrench(force=jnp.array([0.0, 0.0, -10.0]), moment=jnp.zeros(3))
        ```
    """

    force: Float[Array, "*bodies 3"]
    moment: Float[Array, "*bodies 3"]


class Motion(NamedTuple):
    """Pose of a body, the velocity of its origin (3,), m/s, and its angular velocity (3,), rad/s, global components.

    ??? example

        ```python
        still = rx.spatial.Pose(jnp.zeros(3), jnp.eye(3), jnp.zeros(3))
        turning = rx.spatial.Motion(still, jnp.zeros(3), jnp.array([0.0, 0.0, 3.0]))
        turning.point_velocity(jnp.array([0.2, 0.0, 0.0]))  # [0.0, 0.6, 0.0]
        ```
    """

    pose: Pose
    velocity: Float[Array, "*bodies 3"]
    angular_velocity: Float[Array, "*bodies 3"]

    def point_velocity(self, s: Float[Array, "3"]) -> Float[Array, "3"]:
        """Global velocity of the point s of the local frame."""
        return self.velocity + cross(self.angular_velocity, self.pose.rotate(s))

    def wrench(self, force: Float[Array, "3"], s: Float[Array, "3"]) -> Wrench:
        """Wrench of a force in global components at the point s of the local frame."""
        return Wrench(force, cross(self.pose.rotate(s), force))
