"""Residuals and slopes of all joints, kind by kind, and the names of what joints have."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from .._system._axis import Axis
from .._system._system import Path
from .._tools._errors import RedundaxError
from .._tools._module import check_takes, tracing
from ._body import GROUND
from ._frame import AbstractFrame, AbstractPose
from ._joints import AbstractJoint
from ._stack import Stack, is_of_user


class Positions(NamedTuple):
    """Poses of all bodies; and for each stack of joints what the poses of bodies i have seen, `None` if nothing."""

    poses: AbstractPose
    relatives: tuple[PyTree, ...]

    @classmethod
    def path(cls, joints: tuple[Stack, ...], poses: AbstractPose, along: AbstractPose) -> list["Positions"]:
        """Positions, their rates and the rates of these, from poses, and stacked poses with theirs."""
        seen = [stack.over(lambda joint, i, j: joint.relatives(i, j), along) for stack in joints]
        orders = [poses, *(jax.tree.map(lambda x, k=k: x[:, k], along) for k in (1, 2))]
        return [cls(poses, tuple(each and each[k] for each in seen)) for k, poses in enumerate(orders)]


@eqx.filter_jit  # traced once for all that reads it
def path(frame: AbstractFrame, centres: Array | None, joints: tuple[Stack, ...], q: Array, rate: Array) -> Path | None:
    """q', and what joints are functions of with its rates along q [+] s rate, where they have a form of their own."""
    found = frame.path(centres, q, rate)
    return None if found is None else Path(found[0], *Positions.path(joints, frame.poses(centres, q), found[1]))


@eqx.filter_jit  # traced once for all derivatives in all programs
def residuals(joints: tuple[Stack, ...], at: Positions, t: Array) -> list[Array]:
    """Residuals of all joints, (joints, rows) each."""
    return [
        stack.over(lambda joint, i, j: joint.residual(i, j, t), at.poses, relative)
        for stack, relative in zip(joints, at.relatives, strict=True)
    ]


def check_residuals(joints: tuple[Stack, ...], names: Sequence[str], poses: Callable[[], AbstractPose]) -> None:
    """Refuse joints of a user whose residual has not one entry for each of their rows; `names` of the first of each."""
    for stack, name in zip(joints, names, strict=True):
        kind = type(stack.element)
        if not is_of_user(kind):
            continue
        check_takes(f"residual` of `{kind.__name__}", stack.element.residual, "i", "j", "t")
        with tracing(f"residual` of `{kind.__name__}"):
            given = jax.eval_shape(
                lambda stack=stack: residuals((stack,), Positions(poses(), (None,)), jnp.zeros(()))[0]
            )
        wanted, found = len(stack.element.row_kinds), getattr(given, "shape", None)
        if found is None or found[1:] != (wanted,):
            shown = f"has shape {found[1:]}" if found else f"is of the type {type(given).__name__}"
            raise RedundaxError(
                f"`residual` of {kind.__name__} '{name}' must have shape ({wanted},), one entry for each of "
                f"`row_kinds`, but {shown}. Write `jnp.stack([...])` with as many entries."
            )
        if not jnp.issubdtype(given.dtype, jnp.floating):
            raise RedundaxError(
                f"`residual` of {kind.__name__} '{name}' must be floating-point numbers of the poses, but is of type "
                f"{given.dtype}. Write it with the poses of `i` and `j`."
            )


@eqx.filter_jit
def missed_velocities(
    joints: tuple[Stack, ...], at: AbstractPose, rate: AbstractPose
) -> list[Float[Array, "joints rows"]]:
    """A qd of the rows of velocity of all joints and zeros of other rows, from poses and their rates."""

    def rolled(poses: AbstractPose) -> list[Array]:
        both = jax.tree.map(lambda *pair: jnp.stack(pair, axis=1), poses, at)

        def of_one(joint: AbstractJoint, i: AbstractPose, j: AbstractPose) -> Array:
            if not joint.velocity_rows:
                return jnp.zeros(len(joint.row_kinds), i.r.dtype)
            return joint.rolled(i[0], j[0], i[1], j[1])

        return [stack.over(of_one, both) for stack in joints]

    return jax.jvp(rolled, (at,), (rate,))[1]


@eqx.filter_jit
def slopes(joints: tuple[Stack, ...], bodies: AbstractPose, t: Array) -> list[Array]:
    """Their slopes by the velocities of both bodies, (joints, rows, columns) each."""
    return [stack.over(lambda joint, i, j: joint.jacobian(i, j, t), bodies) for stack in joints]


def coordinate_axis(joints: Sequence[AbstractJoint]) -> Axis:
    """Those of all joints that have some, which friction opposes where they have it."""
    named = [(f"{joint.name}.{name}", kind) for joint in joints for name, kind in joint.coordinate_kinds]
    return Axis(tuple(name for name, _ in named), tuple(kind for _, kind in named))


def reaction_axis(joints: Sequence[AbstractJoint], frame: AbstractFrame) -> Axis:
    """Force and moment of each joint on its body i, or on body j where i is the ground."""
    on = [(joint.name, joint.j if joint.i == GROUND else joint.i) for joint in joints]
    names = (f"{name} {part} on {body}" for name, body in on for part, _ in frame.reaction)
    return Axis(tuple(names), tuple(kind for _, kind in frame.reaction) * len(joints))
