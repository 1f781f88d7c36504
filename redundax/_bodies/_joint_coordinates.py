"""Coordinates and reactions of the joints of a mechanism.

Coordinates are those that friction opposes, of all joints that can have some. The reaction of a joint is

    force = -(d Phi / d r_i)^T lam,   moment = -(d Phi / d phi_i)^T lam - (p - r_i) x force

on body i, about the joint's point p on it, or about the body's origin where it has none; with j for i where the ground
is body i. Friction, which acts along the joint's coordinate, is apart.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from .._system._joint_coordinates import AbstractJointCoordinates, JointMotion, NoJointCoordinates
from .._system._state import State
from ._body import Pose, poses
from ._joints import AbstractFrictionalJoint, AbstractJoint
from ._stack import Stack

# Share of a coefficient's terms that is more than rounding and than how far a joint is from being closed: of a force
# along an axis that it is square to, and of the arm of one that passes through the joint's point.
_READ = 1e-9


class JointCoordinates(AbstractJointCoordinates):
    """Those of stacks of joints; `source` is where the rows of the mechanism are among theirs, stack after stack."""

    joints: tuple[Stack[Any], ...]
    source: Int[Array, " m"]

    def motion(self, state: State, acceleration: Array) -> JointMotion:
        finite = jnp.all(jnp.isfinite(acceleration))
        rates = state.q, state.qd, jnp.where(finite, acceleration, 0.0)
        body = jax.tree.map(lambda *x: jnp.stack(x, axis=1), *map(poses, rates))
        moving = [joints for joints in self.joints if isinstance(joints.element, AbstractFrictionalJoint)]
        parts = [joints.over(_joint_motion, body) for joints in moving]
        found = jax.tree.map(lambda *x: jnp.concatenate(x), NoJointCoordinates().motion(state, acceleration), *parts)
        # What is not there is NaN, and NaN its derivatives, but a gradient passes nothing on to what is.
        return JointMotion(found.position, found.rate, jnp.where(finite, found.acceleration, jnp.sum(acceleration)))

    def reactions(self, state: State, multipliers: Array) -> Array:
        given, out = jnp.isfinite(multipliers), []
        sorted_rows = jnp.zeros_like(multipliers).at[self.source]
        flat, lost = sorted_rows.set(jnp.where(given, multipliers, 0.0)), sorted_rows.set(jnp.where(given, 0.0, 1.0))
        for by_row, reads in self.by_row(state):
            size, _, rows = by_row.shape
            (own, flat), (gone, lost) = ((x[: size * rows].reshape(size, rows), x[size * rows :]) for x in (flat, lost))
            out.append((jnp.einsum("swr,sr->sw", by_row, own), jnp.einsum("swr,sr->sw", reads, gone) > 0))
        found, lost = (jnp.concatenate([part.ravel() for part in parts]) for parts in zip(*out, strict=True))
        return jnp.where(lost | ~jnp.any(given), jnp.sum(multipliers), found)

    def by_row(self, state: State) -> list[tuple[Array, Array]]:
        """For each stack the reactions by the multipliers of each joint's own rows, (size, 3, rows), and which of them
        are more than rounding."""
        body = poses(state.q).with_axes()
        is_ground = jnp.arange(body.phi.size) == body.phi.size - 1
        return [
            joints.over(lambda joint, i, j: _of_one(joint, i, j, state.t), (body, is_ground)) for joints in self.joints
        ]


def _of_one(joint: AbstractJoint, i: tuple[Pose, Array], j: tuple[Pose, Array], t: Array) -> tuple[Array, Array]:
    """`JointCoordinates.by_row` of a joint, given poses of its bodies and whether they are those of the ground."""
    jacobian, is_ground = joint.jacobian(i[0], j[0], t).T, i[1]
    force, moment = jnp.split(-jnp.where(is_ground, jacobian[3:], jacobian[:3]), [2])
    arm = jnp.where(is_ground, _arm(joint, "point_j", j[0]), _arm(joint, "point_i", i[0]))
    by_row = jnp.stack([*force, moment[0] + arm[1] * force[0] - arm[0] * force[1]])
    whole = jnp.linalg.norm(force, axis=0)
    reach = jnp.abs(moment[0]) + jnp.linalg.norm(arm) * whole
    return by_row, jnp.abs(by_row) > _READ * jnp.stack([whole, whole, reach])


def _arm(joint: AbstractJoint, name: str, pose: Pose) -> Array:
    local = getattr(joint, name, None)
    return jnp.zeros_like(pose.r) if local is None else pose.point(local) - pose.r


def _joint_motion(joint: Any, i: Pose, j: Pose) -> JointMotion:
    """The coordinate of a joint, given poses of its bodies, their rates and the rates of these, stacked."""

    def along(*at_and_rate: Pose) -> tuple[Array, Array]:
        return jax.jvp(lambda i, j: joint.slip(i.with_axes(), j.with_axes()), at_and_rate[:2], at_and_rate[2:])

    (position, rate), (_, change) = jax.jvp(along, (i[0], j[0], i[1], j[1]), (i[1], j[1], i[2], j[2]))
    return JointMotion(position, rate, change)
