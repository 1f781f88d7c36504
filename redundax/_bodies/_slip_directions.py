"""E, from the slopes of the slips of joints by the velocities of both bodies."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from ._frame import AbstractFrame
from ._stack import Stack


def scattered(
    frame: AbstractFrame, joints: Stack, own: Float[Array, "joints slips columns"], poses: Any
) -> Float[Array, "n p"]:
    """Slopes by the velocities of all bodies, of which the ground has none."""
    bodies = jnp.arange(poses.r.shape[0] - 1)[:, None, None]
    on_i, on_j = jnp.split(own, 2, axis=-1)
    each = [
        jnp.where((end == bodies)[..., None], part, 0.0)
        for end, part in ((joints.i[:, None], on_i), (joints.j[:, None], on_j))
    ]
    whole = jnp.moveaxis(each[0] + each[1], -1, 1)  # bodies, velocities, joints, slips
    axes = len(frame.linear)
    parts = whole[:, :axes], whole[:, axes:]
    return jnp.concatenate([part.reshape(-1, own.shape[0] * own.shape[1]) for part in parts])
