"""Joints whose slips share one friction, along the velocity v of their surfaces:

    v = a s',   tau = a f,   |f| <= limit of the joint,   f = -limit v / |v| while it slips

with the slip rates s' and the arms a of the joint. At rest f is any vector of that ball, and slip begins against it.
"""

import itertools
from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float

from .._tools._numbers import Numeric, known, or_one, xp
from .._tools._value import AbstractModule
from ._friction import AbstractFriction


class Directions(AbstractModule):
    """Which slips belong together, beside those of joints with one slip.

    - `arms`: a, 1 of joints with one slip; shape (p,).
    - `joints`: slips of each joint that has several with one friction.
    """

    arms: Float[Array, " p"]
    joints: tuple[tuple[int, ...], ...] = eqx.field(static=True)

    @property
    def directed(self) -> np.ndarray:
        """Which slips have a direction with others, shape (p,)."""
        out = np.zeros(self.arms.size, bool)
        out[list(itertools.chain(*self.joints))] = True
        return out

    @property
    def same(self) -> np.ndarray:
        """Which slips are of one joint, shape (p, p)."""
        out = np.eye(self.arms.size, dtype=bool)
        for joint in self.joints:
            out[np.ix_(joint, joint)] = True
        return out

    def every(self, flags: Bool[Array, " p"]) -> Bool[Array, " p"]:
        """For each slip whether it is so for all slips of its joint."""
        return xp.all(flags | ~self.same, axis=1)

    def any(self, flags: Bool[Array, " p"]) -> Bool[Array, " p"]:
        """For each slip whether it is so for any slip of its joint."""
        return xp.any(flags & self.same, axis=1)

    def unit(self, surface: Float[Array, " p"]) -> Float[Array, " p"]:
        """Unit directions, joint by joint, of velocities or forces of the surfaces; 0 where they are."""
        largest = xp.max(xp.where(self.same, xp.abs(surface), 0.0), axis=1)
        scaled = surface / or_one(largest)
        squared = xp.sum(xp.where(self.same, scaled**2, 0.0), axis=1)
        return scaled / xp.sqrt(or_one(squared))

    def against(self, friction: Float[Array, " p"]) -> Float[Array, " p"]:
        """Unit directions against generalised forces of friction: in which joints slip that it holds no longer."""
        return self.unit(-friction / self.arms)

    def along(self, rate: Float[Array, " p"], direction: Float[Array, " p"]) -> Float[Array, " p"]:
        """Part of the velocity of each joint's surfaces along a unit direction."""
        return xp.sum(xp.where(self.same, self.arms * rate * direction, 0.0), axis=1)

    def reach(self, sizes: Float[Array, " p"]) -> Float[Array, " p"]:
        """The largest size of a slip by unit velocity of its joint's surfaces."""
        return xp.max(xp.where(self.same, sizes / self.arms, 0.0), axis=1)

    def whole(self, friction: Float[Numeric, "... p"]) -> Float[Numeric, "... p"]:
        """Sizes of frictions as they are along their joint's largest: none is small as its surfaces slide across it."""
        force = xp.abs(friction / self.arms)
        return self.arms * xp.max(xp.where(self.same, force[..., None, :], 0.0), axis=-1)

    def past(self, rate: Float[Array, " p"], direction: Float[Array, " p"]) -> Float[Array, " p"]:
        """Slip rates with those turned round that are against a direction: so friction goes on smoothly past a stop."""
        return xp.where(self.directed & (self.along(rate, direction) < 0), -rate, rate)


def directions_of(groups: Sequence[AbstractFriction]) -> Directions | None:
    """The slips of friction groups that share a friction which jumps with its direction; `None` where none do."""
    joints, arms, first = [], [], 0
    for group in groups:
        count, directed = len(group.slips), group.has_direction and group.has_sense
        if directed:
            starts = range(first, first + count, group.width)
            joints += [tuple(range(start, start + group.width)) for start in starts]
        arms.append(known(group.arms) if directed else xp.ones(count))
        first += count
    return Directions(xp.concatenate(arms), tuple(joints)) if joints else None
