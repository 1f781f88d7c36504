"""Coordinates and reactions of the joints of a mechanism.

Coordinates are what joints leave free and can tell: angles, travels, distances. The reaction of a joint is

    force = -(d Phi / d r_i)^T lam,   moment = -(d Phi / d phi_i)^T lam - (p - r_i) x force

on body i, by the position r_i of its centre of mass and its turn phi_i, in space about each of its axes; about the
joint's point p on it, or about the body's origin where it has none; with j for i where the ground is body i. Friction,
which acts along the joint's coordinate, is apart.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._system._joint_coordinates import AbstractJointCoordinates, JointMotion
from .._system._state import State
from .._tools._module import replace_fields
from .._tools._numbers import entries_set, known, of_model, tolerance_of, xp
from ._frame import AbstractFrame, AbstractPose
from ._joints import AbstractJoint
from ._stack import Stack

# Share of a coefficient's terms that is more than rounding and than how far a joint is from being closed: of a force
# along an axis that it is square to, and of the arm of one that passes through the joint's point; at least so many
# roundings.
_READ = 1e-9, 1e2


class JointCoordinates(AbstractJointCoordinates):
    """Those of stacks of joints; `source` is where the rows of the mechanism are among theirs, stack after stack.

    Reactions are those on the other body of each joint where `others` is set.
    """

    frame: AbstractFrame = eqx.field(static=True)
    centres: Float[Array, "bodies axes"] | None
    joints: tuple[Stack[AbstractJoint], ...]
    source: Int[Array, " m"]
    others: bool = eqx.field(static=True, default=False)

    @property
    def wraps(self) -> np.ndarray:
        kinds = [kind for joints in self._moving for kind in joints.i.shape[-1] * joints.element.coordinate_kinds]
        return np.array([kind == "angular" and not self.frame.adds for _, kind in kinds], bool)

    def motion(self, state: State, acceleration: Array) -> JointMotion:
        finite = jnp.all(jnp.isfinite(acceleration))
        qdd, (zero, one) = jnp.where(finite, acceleration, 0.0), (jnp.zeros_like(state.t), jnp.ones_like(state.t))

        def position(s: Array) -> Array:
            q = self.frame.retract(state.q, s * (state.qd + s / 2 * qdd))
            return self._at(q)

        def along(s: Array) -> tuple[Array, Array]:
            return jax.jvp(position, (s,), (one,))

        (found, rate), (_, change) = jax.jvp(along, (zero,), (one,))
        # What is not there is NaN, and NaN its derivatives, but a gradient passes nothing on to what is.
        return JointMotion(found, rate, jnp.where(finite, change, jnp.sum(acceleration)))

    @property
    def opposite(self) -> "JointCoordinates":
        return replace_fields(self, others=not self.others)

    @property
    def _moving(self) -> list[Stack[AbstractJoint]]:
        return [joints for joints in self.joints if joints.element.coordinate_kinds]

    def positions(self, state: State) -> Array:
        return self._at(state.q)

    def _at(self, q: Array) -> Array:
        poses = self.frame.poses(self.centres, q)
        parts = [joints.over(lambda joint, i, j: joint.coordinates(i, j), poses).ravel() for joints in self._moving]
        return jnp.concatenate([jnp.zeros(0, poses.r.dtype), *parts])

    def reactions(self, state: State, multipliers: Array) -> Array:
        given, out = xp.isfinite(multipliers), []
        none, source = xp.zeros_like(multipliers), known(self.source)
        flat, lost = (
            entries_set(none, source, x) for x in (xp.where(given, multipliers, 0.0), xp.where(given, 0.0, 1.0))
        )
        for matrix, reads in coefficients(self, state):
            size, _, rows = matrix.shape
            (own, flat), (gone, lost) = ((x[: size * rows].reshape(size, rows), x[size * rows :]) for x in (flat, lost))
            out.append((xp.einsum("swr,sr->sw", matrix, own), xp.einsum("swr,sr->sw", reads, gone) > 0))
        found, lost = (xp.concatenate([part.ravel() for part in parts]) for parts in zip(*out, strict=True))
        return xp.where(lost | ~xp.any(given), xp.sum(multipliers), found)


@of_model
def coefficients(of: JointCoordinates, state: State) -> list[tuple[Array, Array]]:
    """For each stack the reactions by the multipliers of each joint's own rows, (size, 3 or in space 6, rows), and
    which of them are more than rounding."""
    body = of.frame.poses(of.centres, state.q)
    is_ground = jnp.arange(body.r.shape[0]) == body.r.shape[0] - 1
    return [
        joints.over(lambda joint, i, j: _of_one(of.frame, joint, i, j, state.t), (body, is_ground != of.others))
        for joints in of.joints
    ]


def _of_one(
    frame: AbstractFrame, joint: AbstractJoint, i: tuple[AbstractPose, Array], j: tuple[AbstractPose, Array], t: Array
) -> tuple[Array, Array]:
    """`coefficients` of a joint, given poses of its bodies; with that of i whether j is told of."""
    (pose_i, of_j), pose_j = i, j[0]
    origin = jnp.zeros(len(frame.linear), pose_i.r.dtype)
    on_i, on_j = jnp.split(joint.jacobian(pose_i, pose_j, t).T, 2)
    points = (origin if own is None else own for own in (joint.point_on("i"), joint.point_on("j")))
    ends = zip((pose_i, pose_j), (on_i, on_j), points, strict=True)
    pose, by_row, point = jax.tree.map(lambda one, other: jnp.where(of_j, other, one), *ends)
    force, moment, arm = frame.reactions(pose, -by_row, point)
    whole = jnp.linalg.norm(force, axis=0)
    reach = jnp.linalg.norm(by_row[len(frame.linear) :], axis=0) + jnp.linalg.norm(arm) * whole
    limit = jnp.concatenate([jnp.broadcast_to(whole, force.shape), jnp.broadcast_to(reach, moment.shape)])
    both = jnp.concatenate([force, moment])
    return both, jnp.abs(both) > tolerance_of(_READ, both) * limit
