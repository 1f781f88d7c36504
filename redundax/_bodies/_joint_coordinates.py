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

_READ = 1e-9  # share of a coefficient's terms that is more than rounding


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
        given, body, out = jnp.isfinite(multipliers), poses(state.q).with_axes(), []
        sorted_rows = jnp.zeros_like(multipliers).at[self.source]
        flat, lost = sorted_rows.set(jnp.where(given, multipliers, 0.0)), sorted_rows.set(jnp.where(given, 0.0, 1.0))
        is_ground = jnp.arange(body.phi.size) == body.phi.size - 1
        for joints in self.joints:
            by_row, arm = joints.over(lambda joint, i, j: _of_one(joint, i, j, state.t), (body, is_ground))
            size, _, rows = by_row.shape
            (own, flat), (gone, lost) = ((x[: size * rows].reshape(size, rows), x[size * rows :]) for x in (flat, lost))
            turned = jnp.stack([by_row[:, 2], arm[:, 1:] * by_row[:, 0], -arm[:, :1] * by_row[:, 1]])
            by_row = by_row.at[:, 2].set(jnp.sum(turned, axis=0))
            terms = jnp.abs(by_row).at[:, 2].set(jnp.sum(jnp.abs(turned), axis=0))
            terms = terms.at[:, :2].set(jnp.linalg.norm(by_row[:, :2], axis=1, keepdims=True))
            reads = jnp.abs(by_row) > _READ * terms
            out.append((jnp.einsum("swr,sr->sw", by_row, own), jnp.einsum("swr,sr->sw", reads, gone) > 0))
        found, lost = (jnp.concatenate([part.ravel() for part in parts]) for parts in zip(*out, strict=True))
        return jnp.where(lost | ~jnp.any(given), jnp.sum(multipliers), found)


def _of_one(joint: AbstractJoint, i: tuple[Pose, Array], j: tuple[Pose, Array], t: Array) -> tuple[Array, Array]:
    """`loads_by_row` of the body that reactions are on, given poses and whether they are those of the ground."""
    on_i, on_j = loads_by_row(joint, i[0], j[0], t)
    return jax.tree.map(lambda own, other: jnp.where(i[1], other, own), on_i, on_j)


def loads_by_row(joint: AbstractJoint, i: Pose, j: Pose, t: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """For body i, then for body j: force and moment about its origin by the multipliers of the joint's own rows,
    (3, rows), and where the joint's point on it, if any, is from there, (2,)."""
    by_row = -joint.jacobian(i, j, t).T
    arms = (_arm(joint, "point_i", i), _arm(joint, "point_j", j))
    return (by_row[:3], arms[0]), (by_row[3:], arms[1])


def _arm(joint: AbstractJoint, name: str, pose: Pose) -> Array:
    local = getattr(joint, name, None)
    return jnp.zeros_like(pose.r) if local is None else pose.point(local) - pose.r


def _joint_motion(joint: Any, i: Pose, j: Pose) -> JointMotion:
    """The coordinate of a joint, given poses of its bodies, their rates and the rates of these, stacked."""

    def along(*at_and_rate: Pose) -> tuple[Array, Array]:
        return jax.jvp(lambda i, j: joint.slip(i.with_axes(), j.with_axes()), at_and_rate[:2], at_and_rate[2:])

    (position, rate), (_, change) = jax.jvp(along, (i[0], j[0], i[1], j[1]), (i[1], j[1], i[2], j[2]))
    return JointMotion(position, rate, change)
