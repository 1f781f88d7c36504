"""Bodies in the plane: positions x, y and angles phi, which add, and whose rates are the velocities."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from .._system._state import State
from .._tools._errors import RedundaxError
from .._tools._module import check_position, moved
from ._frame import AbstractBody, AbstractFrame
from ._pose import Motion, Pose, poses


class Plane(AbstractFrame[AbstractBody, Pose, Motion]):
    """Bodies in the plane, local frames at their centres of mass."""

    word: ClassVar[str] = "planar"
    linear: ClassVar[tuple[str, ...]] = ("x", "y")
    angular: ClassVar[tuple[str, ...]] = ("phi",)
    reaction: ClassVar[tuple[tuple[str, str], ...]] = (("force x", "force"), ("force y", "force"), ("moment", "moment"))

    @property
    def adds(self) -> bool:
        return True

    @property
    def diagonal_mass(self) -> bool:
        return True

    def centres(self, body: AbstractBody) -> None:
        return None

    def check(self, q: Array, n: int) -> None:
        check_position(q, n)

    def poses(self, centres: Array | None, q: Array) -> Pose:
        return poses(q).with_axes()

    def motions(self, body: AbstractBody, state: State) -> Motion:
        return Motion(poses(state.q), poses(state.qd))

    def retract(self, q: Array, d: Array) -> Array:
        return moved(q, d)

    def velocity(self, q: Array, rate: Array) -> Array:
        return rate

    def reference(self, body: AbstractBody) -> Array:
        raise RedundaxError(
            "Argument `q` must be given for a planar mechanism, whose bodies have no reference poses. Give a guess, "
            'as in {"crank.phi": 0.5}.'
        )

    def mass(self, body: AbstractBody) -> Array:
        return jnp.diag(jnp.concatenate([jnp.repeat(body.mass, 2), body.inertia]))

    def masses(self, body: AbstractBody) -> Array:
        return jnp.stack([body.mass, body.mass, body.inertia], axis=-1)[:, None] * jnp.eye(3, dtype=body.mass.dtype)

    def load(self, body: AbstractBody, motion: Motion, force: Array, moment: Array) -> Array:
        return jnp.concatenate([force[:-1].ravel(), moment[:-1]])

    def reactions(self, pose: Pose, by_row: Array, point: Array) -> tuple[Array, Array, Array]:
        force, moment = jnp.split(by_row, [2])
        arm = pose.rotate(point)
        return force, moment + arm[1] * force[:1] - arm[0] * force[1:], arm

    def along(self, axes: Array, force: Array, moment: Array) -> Array:
        return jnp.concatenate([axes.T @ force, moment])


PLANE = Plane()
