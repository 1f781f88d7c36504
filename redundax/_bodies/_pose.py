"""Poses of planar bodies, their rates, and wrenches on them."""

from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._tools._value import AbstractModule
from ._frame import AbstractPose


class Pose(AbstractPose):
    """Position (2,) and angle of a body's local frame in the global frame, of one body or stacked.

    `axes`, of shape (2,) each, are those of the frame, where they are known already; constraints and slips are given
    poses with axes, loads without. To turn a pose make a new one: axes do not follow the angle.

    ??? example

        ```python
        pose = rx.Pose(jnp.array([1.0, 0.0]), jnp.array(jnp.pi / 2))
        pose.point(jnp.array([0.5, 0.0]))  # [1.0, 0.5]
        ```
    """

    r: Float[Array, "*bodies 2"]
    phi: Float[Array, "*bodies"]
    axes: tuple[Float[Array, "*bodies 2"], Float[Array, "*bodies 2"]] | None = None

    def point(self, s: Float[Array, "2"]) -> Float[Array, "2"]:
        """Global position of the point s of the local frame: r + R s."""
        return self.r + self.rotate(s)

    def rotate(self, v: Float[Array, "2"]) -> Float[Array, "2"]:
        """Global components of the local vector v: R v, Eq. (54)."""
        along, across = _axes(self.phi) if self.axes is None else self.axes
        return along * v[0] + across * v[1]

    def local(self, x: Float[Array, "2"]) -> Float[Array, "2"]:
        """Position in the local frame of the global point x: R^T (x - r)."""
        along, across = _axes(self.phi) if self.axes is None else self.axes
        return jnp.stack([along @ (x - self.r), across @ (x - self.r)])

    def with_axes(self) -> "Pose":
        """The same with its axes, computed once for all that reads them."""
        return Pose(self.r, self.phi, _axes(self.phi))

    def unit_rates(self) -> "Pose":
        """Rates of a pose with axes as x, y and phi change, stacked."""
        r, phi = jnp.eye(3, 2, dtype=self.r.dtype), jnp.eye(3, dtype=self.r.dtype)[2]
        along, across = cast(tuple[Array, Array], self.axes)
        return Pose(r, phi, (phi[:, None] * across, -phi[:, None] * along))


@jax.custom_jvp
def _axes(phi: Float[Array, "*bodies"]) -> tuple[Float[Array, "*bodies 2"], Float[Array, "*bodies 2"]]:
    """The axes of frames in the global frame, the columns of R."""
    along = jnp.stack([jnp.cos(phi), jnp.sin(phi)], axis=-1)
    # A product is computed once. Without it XLA computes sines anew for every entry that reads them.
    both = jnp.matmul(along, jnp.array([[1, 0, 0, 1], [0, 1, -1, 0]], along.dtype), precision="highest")
    return both[..., :2], both[..., 2:]


@_axes.defjvp
def _axes_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    along, across = _axes(*primals)  # each turns into the other: no sines in derivatives of any order
    rate = tangents[0][..., None]
    return (along, across), (rate * across, -rate * along)


def perpendicular(v: Float[np.ndarray | Array, "2"]) -> Float[Array, "2"]:
    """v turned by +90 degrees."""
    return jnp.stack([-v[1], v[0]])


def poses(values: Array) -> Pose:
    """Poses of all bodies and of the ground, stacked, from coordinates in the order of Eq. (1)."""
    count = values.shape[0] // 3
    r = jnp.concatenate([values[: 2 * count].reshape(count, 2), jnp.zeros((1, 2), values.dtype)])
    return Pose(r, jnp.concatenate([values[2 * count :], jnp.zeros(1, values.dtype)]))


class Wrench(AbstractModule):
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
