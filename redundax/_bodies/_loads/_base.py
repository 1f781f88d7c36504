"""What a load on planar bodies is: a wrench on body i and one on body j, from their poses and rates."""

import abc
from typing import NamedTuple

import equinox as eqx
from jaxtyping import Array, Float

from .._body import Pose, perpendicular
from .._stack import AbstractBetweenBodies


class Wrench(eqx.Module):
    """Force (2,) in global components, N, and moment about the local frame's origin, N m, on a body.

    ??? example

        ```python
        rx.Wrench(force=jnp.array([0.0, -10.0]), moment=jnp.array(2.0))
        ```
    """

    force: Float[Array, "*bodies 2"]
    moment: Float[Array, "*bodies"]


class Motion(NamedTuple):
    """Pose of a body and the time derivative of the pose.

    ??? example

        ```python
        still = rx.Pose(jnp.zeros(2), jnp.array(0.0))
        turning = rx.Motion(still, rx.Pose(jnp.zeros(2), jnp.array(3.0)))
        turning.point_velocity(jnp.array([0.2, 0.0]))  # [0.0, 0.6]
        ```
    """

    pose: Pose
    rate: Pose

    def point_velocity(self, s: Float[Array, "2"]) -> Float[Array, "2"]:
        """Global velocity of the point s of the local frame."""
        arm = self.pose.rotate(s)
        return self.rate.r + self.rate.phi * perpendicular(arm)

    def wrench(self, force: Float[Array, "2"], s: Float[Array, "2"]) -> Wrench:
        """Wrench of a force in global components at the point s of the local frame."""
        arm = self.pose.rotate(s)
        return Wrench(force, arm[0] * force[1] - arm[1] * force[0])


class AbstractLoad(AbstractBetweenBodies):
    """A load on the bodies i and j; a load on one body has the ground as j."""

    @abc.abstractmethod
    def wrenches(self, i: Motion, j: Motion, t: Float[Array, ""]) -> tuple[Wrench, Wrench]:
        """Wrenches on i and on j."""
