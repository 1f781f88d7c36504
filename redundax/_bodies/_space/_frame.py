"""Bodies in space

    q = (x of the centres of mass; quaternions),   velocities = (x'; omega in body axes)
    M = diag(m I, J),   Q = (F; R^T (M_o - R c x F) - omega x J omega)

M is constant. The centre of mass is at c in the local frame, whose origin and axes are the user's: poses, points and
wrenches are given there.
"""

import abc
from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._system._state import State
from ..._tools._errors import RedundaxError
from ..._tools._module import numpy_of, on_device, replace_fields
from .._frame import AbstractBody, AbstractFrame
from ._pose import Motion, Pose
from ._rotation import angular_velocity, between, cross, multiplied, product, rotation, skew, times, turned


class AbstractSpatialBody(AbstractBody):
    """A body in space: its centre of mass in the local frame, and where that is at the reference pose."""

    centre: eqx.AbstractVar[Float[Array, "3"]]
    position: eqx.AbstractVar[Float[Array, "3"]]
    orientation: eqx.AbstractVar[Float[Array, "4"]]

    @property
    @abc.abstractmethod
    def inertia_matrix(self) -> Float[Array, "3 3"]:
        """The inertia as a matrix."""


class Space(AbstractFrame[AbstractSpatialBody, Pose, Motion]):
    """Bodies in space; `is_principal` says whether the axes of all are principal axes of their inertia."""

    word: ClassVar[str] = "spatial"
    linear: ClassVar[tuple[str, ...]] = ("x", "y", "z")
    angular: ClassVar[tuple[str, ...]] = ("phi_x", "phi_y", "phi_z")
    reaction: ClassVar[tuple[tuple[str, str], ...]] = (
        *((f"force {axis}", "force") for axis in "xyz"),
        *((f"moment {axis}", "moment") for axis in "xyz"),
    )
    is_principal: bool = True

    def of(self, bodies: Sequence[AbstractSpatialBody]) -> "Space":
        return Space(all(body.inertia.shape == (3,) for body in bodies))

    def alike(self, bodies: Sequence[AbstractSpatialBody]) -> Sequence[AbstractSpatialBody]:
        if self.is_principal:
            return bodies
        return [replace_fields(body, inertia=body.inertia_matrix) for body in bodies]

    @property
    def adds(self) -> bool:
        return False

    @property
    def diagonal_mass(self) -> bool:
        return self.is_principal

    def centres(self, body: AbstractSpatialBody) -> Array:
        return body.centre

    def check(self, q: Array, n: int) -> None:
        if q.shape != (n // 6 * 7,):
            raise RedundaxError(
                f"Argument `q` must have shape ({n // 6 * 7},), the positions of all centres of mass and then all "
                f"quaternions (w, x, y, z), but has {q.shape}. Leave it out of `assemble` to start from the reference "
                "poses, and use jax.vmap for many positions."
            )

    def poses(self, centres: Array, q: Array) -> Pose:
        x, p = _parts(q)
        axes = rotation(p)
        r = x - times(axes, centres)
        none = np.zeros((1, 3), q.dtype)
        ground = (none, np.eye(3, dtype=q.dtype)[None], none)  # constants, which XLA knows to be the same
        return Pose(*(jnp.concatenate(pair) for pair in zip((r, axes, centres), ground, strict=True)))

    def path(self, centres: Array, q: Array, rate: Array) -> tuple[Array, Pose]:
        """R' = R [omega]x and R'' = R [omega]x [omega]x, x'' = 0."""
        (x, p), (v, omega) = _parts(q), (part.reshape(-1, 3) for part in jnp.split(rate, 2))
        chart = jnp.concatenate([v.ravel(), product(p, omega / 2, 0.0).ravel()])
        axes, spin = rotation(p), skew(omega)
        turn = multiplied(axes, spin)
        axes = jnp.stack([axes, turn, multiplied(turn, spin)], axis=1)
        r = jnp.stack([x, v, jnp.zeros_like(v)], axis=1) - times(axes, centres[:, None])
        none, one = np.zeros((1, 3, 3), q.dtype), np.zeros((1, 3, 3, 3), q.dtype)
        one[0, 0] = np.eye(3)
        ground = (none, one, none)
        at_rest = jnp.pad(centres[:, None], ((0, 0), (0, 2), (0, 0)))
        return chart, Pose(*(jnp.concatenate(pair) for pair in zip((r, axes, at_rest), ground, strict=True)))

    def motions(self, body: AbstractSpatialBody, state: State) -> Motion:
        pose = self.poses(body.centre, state.q)
        none = jnp.zeros((1, 3), state.qd.dtype)  # of the ground
        v, omega = (jnp.concatenate([part.reshape(-1, 3), none]) for part in jnp.split(state.qd, 2))
        omega = times(pose.axes, omega)
        return Motion(pose, v - cross(omega, times(pose.axes, pose.centre)), omega)

    def retract(self, q: Array, d: Array) -> Array:
        x, p = _parts(q)
        shift, turn = jnp.split(d, 2)
        return jnp.concatenate([x.ravel() + shift, turned(p, turn.reshape(-1, 3)).ravel()])

    def displacement(self, base: Array, q: Array) -> tuple[Array, Array]:
        """By conj(p) p', whose scalar part half a turn makes zero."""
        (x, p), (there, turned) = _parts(base), _parts(q)
        w, v = jnp.split(between(p, turned), [1], axis=-1)
        found = jnp.all(w > 0)
        return jnp.concatenate([(there - x).ravel(), (2 * v / jnp.where(w > 0, w, 1.0)).ravel()]), found

    def reference(self, body: AbstractSpatialBody) -> Array:
        given = body.position, body.orientation, body.centre
        xp = numpy_of(*given)  # in NumPy, which compiles nothing, where they are known
        position, orientation, centre = map(xp.asarray, given)
        mass = position + xp.einsum("bij,bj->bi", rotation(orientation), centre)
        return on_device(xp.concatenate([mass.ravel(), orientation.ravel()]))

    def velocity(self, q: Array, rate: Array) -> Array:
        (_, p), (v, p_rate) = _parts(q), _parts(rate)
        return jnp.concatenate([v.ravel(), angular_velocity(p, p_rate).ravel()])

    def mass(self, body: AbstractSpatialBody) -> Array:
        heft = jnp.repeat(body.mass, 3)
        if self.is_principal:
            return jnp.diag(jnp.concatenate([heft, body.inertia.ravel()]))
        return jax.scipy.linalg.block_diag(jnp.diag(heft), *body.inertia)

    def masses(self, body: AbstractSpatialBody) -> Array:
        one = jnp.eye(3, dtype=body.mass.dtype)
        inertia = body.inertia[:, None] * one if self.is_principal else body.inertia
        none = jnp.zeros_like(inertia)
        return jnp.block([[body.mass[:, None, None] * one, none], [none, inertia]])

    def load(self, body: AbstractSpatialBody, motion: Motion, force: Array, moment: Array) -> Array:
        pose, omega = jax.tree.map(lambda x: x[:-1], (motion.pose, motion.angular_velocity))
        force, moment = force[:-1], moment[:-1]
        arm, back = times(pose.axes, pose.centre), jnp.swapaxes(pose.axes, -1, -2)
        about, spin = (times(back, vector) for vector in (moment - cross(arm, force), omega))
        momentum = body.inertia * spin if self.is_principal else times(body.inertia, spin)
        return jnp.concatenate([force.ravel(), (about - cross(spin, momentum)).ravel()])

    def reactions(self, pose: Pose, by_row: Array, point: Array) -> tuple[Array, Array, Array]:
        force, moment = jnp.split(by_row, 2)
        arm = pose.rotate(point - pose.centre)
        return force, pose.axes @ moment - jnp.cross(arm[:, None], force, axis=0), arm

    def along(self, axes: Array, force: Array, moment: Array) -> Array:
        return jnp.concatenate([axes.T @ force, axes.T @ moment])


def _parts(q: Array) -> tuple[Array, Array]:
    """Positions (b, 3) and quaternions (b, 4)."""
    count = q.shape[0] // 7
    return q[: 3 * count].reshape(count, 3), q[3 * count :].reshape(count, 4)


SPACE = Space()
