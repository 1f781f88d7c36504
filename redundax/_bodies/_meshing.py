"""Teeth turned into mesh: where assembly starts of a guess whose teeth are somewhere.

The residual of a mesh counts to the nearest tooth, so that a descent ends at teeth which cannot all mesh where a guess
is half a pitch off. Bodies are turned one by one, from the ground and then from gears that were turned, until their
teeth mesh with the one before: what planets between a sun and a ring have in common comes out, whatever their angles.
The position stays as it is where every mesh is within a quarter of its pitch, as two planets close a path of four
meshes: what four of these miss together is less than a pitch, so that the nearest teeth are the right ones.
"""

import itertools
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from .._tools._compilation import compiled
from .._tools._module import is_concrete, tree_take
from .._tools._numbers import stop_gradient
from .._tools._value import AbstractModule
from ._body import GROUND
from ._joints import AbstractJoint, AbstractMesh, GearPair
from ._pose import poses
from ._stack import Stack, indices

_NEAR = 0.25  # of a pitch, see above


class Turns(AbstractModule):
    """Meshes of one stack in the order in which they are closed, and the bodies that are turned for it."""

    stack: int = eqx.field(static=True)
    members: Int[Array, " turns"]
    bodies: Int[Array, " turns"]


def turns_into_mesh(
    joints: Sequence[AbstractJoint], groups: Sequence[Sequence[int]], bodies: Sequence[str]
) -> tuple[Turns, ...]:
    """What closes the meshes along a tree of bodies from the ground on; nothing without teeth."""
    left = {
        (kind, member): (joints[k].i, joints[k].j)
        for kind, group in enumerate(groups)
        for member, k in enumerate(group)
        if isinstance(joints[k], AbstractMesh)
    }
    reached, order = {GROUND}, []
    while left:
        place = next((place for place, pair in left.items() if reached & {*pair}), None)
        if place is None:  # gears that no mesh joins to the ground: one of them stays
            reached.add(next(iter(left.values()))[0])
            continue
        i, j = left.pop(place)
        if not {i, j} <= reached:
            order.append((*place, bodies.index(i if j in reached else j)))
            reached |= {i, j}
    runs = [(kind, [*run]) for kind, run in itertools.groupby(order, key=lambda each: each[0])]
    return tuple(Turns(kind, *(indices([each[part] for each in run]) for part in (1, 2))) for kind, run in runs)


@compiled
def in_mesh(turns: tuple[Turns, ...], joints: tuple[Stack, ...], q: Array, t: Array) -> Array:
    """The position of planar bodies with their teeth in mesh; its derivative is that of q."""
    base = stop_gradient(q)
    angles = 2 * (q.size // 3)

    def turned(stack: Stack, q: Array, turn: tuple[Array, Array]) -> tuple[Array, None]:
        member, body = turn
        mesh = tree_take(stack, member)

        def residual(angle: Array) -> Array:
            at = poses(q.at[angles + body].add(angle))
            return _off(mesh.element.residual(tree_take(at, mesh.i), tree_take(at, mesh.j), t))

        off, slope = jax.jvp(residual, (jnp.zeros((), q.dtype),), (jnp.ones((), q.dtype),))
        turns = slope != 0  # not those that are too near to mesh, nor a rack
        return q.at[angles + body].add(jnp.where(turns, -off / jnp.where(turns, slope, 1.0), 0.0)), None

    def off(stack: Stack) -> Array:
        return stack.over(lambda mesh, i, j: jnp.abs(_off(mesh.residual(i, j, t))) / mesh.base_pitch, poses(base))

    far = [jnp.max(off(joints[k])) > _NEAR for k in sorted({each.stack for each in turns})]
    found = base
    for each in turns:
        stack = joints[each.stack]
        found, _ = jax.lax.scan(lambda q, turn, stack=stack: turned(stack, q, turn), found, (each.members, each.bodies))
    return q + stop_gradient(jnp.where(jnp.any(jnp.stack(far)), found - base, 0.0))


def _off(rows: Array) -> Array:
    """By how far teeth are from their mesh: from the flank that carries, or from the middle of the gap between two."""
    return rows[0] if len(rows) == 1 else (rows[0] - rows[1]) / 2


def teeth_in_doubt(joints: Sequence[Stack], bodies: Sequence[str]) -> str:
    """A sentence where N planets spaced evenly between sun and ring do not fit: (z_sun + z_ring) / N is not whole."""
    gears: dict[int, dict[int, int]] = {}  # of each gear those in mesh with it, and their teeth
    for stack in joints:
        if isinstance(stack.element, GearPair) and is_concrete(stack.element.teeth):
            for i, j, teeth in zip(*map(np.asarray, (stack.i, stack.j, stack.element.teeth)), strict=True):
                gears.setdefault(int(i), {})[int(j)] = int(teeth[1])
                gears.setdefault(int(j), {})[int(i)] = int(teeth[0])
    between: dict[tuple[tuple[int, int], ...], int] = {}
    for others in gears.values():
        if len(others) == 2 and min(others.values()) < 0:
            pair = tuple(sorted(others.items(), key=lambda each: -each[1]))
            between[pair] = between.get(pair, 0) + 1
    names = (*bodies, GROUND)
    return "".join(
        f" {count} planets spaced evenly between '{names[sun]}' and '{names[ring]}' cannot mesh, as {count} does not "
        f"divide {own} + {-other} teeth. Change their number, a number of teeth or the spacing."
        for ((sun, own), (ring, other)), count in between.items()
        if (own - other) % count
    )
