"""A system some coordinates of which follow laws of time: one row more for each

    c(q) - f(t) = 0,   an angle that a position gives but for whole turns to the nearest turn

whose multiplier is minus the force or moment of the drive, along the coordinate. A coordinate is one of the system, or
one of a joint. The rows stand behind those of the system and are called "name drive".
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._system._friction import AbstractFriction
from .._tools._module import replace_fields
from ._axis import Axis, join
from ._joint_coordinates import AbstractJointCoordinates, JointMotion
from ._names import Names
from ._state import State
from ._system import AbstractSystem


class Driven(AbstractSystem):
    """A system and the laws that named coordinates of it follow."""

    base: AbstractSystem
    laws: tuple[Callable[[Array], Array], ...]
    places: tuple[int, ...] = eqx.field(static=True)  # among the coordinates of the system, then of its joints
    drives: Axis = eqx.field(static=True)

    @property
    def _names(self) -> Names:  # pyright: ignore[reportIncompatibleVariableOverride]
        names = self.base.names
        return dataclasses.replace(names, rows=join([names.rows, self.drives]))

    @property
    def undriven(self) -> AbstractSystem:
        return self.base

    @property
    def friction(self) -> tuple[AbstractFriction, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.base.friction

    @property
    def slips(self) -> Axis:
        return self.base.slips

    @property
    def radian(self) -> ArrayLike:
        return self.base.radian

    @property
    def length(self) -> ArrayLike:
        return self.base.length

    @property
    def has_length(self) -> bool:
        return self.base.has_length

    @property
    def constant_mass(self) -> bool:
        return self.base.constant_mass

    @property
    def diagonal_mass(self) -> bool:
        return self.base.diagonal_mass

    def mass(self, q: Array, t: Array) -> Array:
        return self.base.mass(q, t)

    def constraint(self, q: Array, t: Array) -> Float[Array, " m"]:
        gap = self.given(q, t) - jnp.stack([law(t) for law in self.laws])
        turn = 2 * jnp.pi * jnp.asarray(self.radian, gap.dtype)
        wraps = np.array([self._wraps[place] for place in self.places], bool)
        gap = jnp.where(wraps, gap - turn * jnp.round(gap / turn), gap)
        return jnp.concatenate([self.base.constraint(q, t), gap])

    @property
    def _wraps(self) -> np.ndarray:
        return np.concatenate([np.zeros(len(self.coordinates), bool), self.base.joint_coordinates.wraps])

    def given(self, q: Array, t: Array) -> Float[Array, " d"]:
        """The driven coordinates at a position."""
        return _given(self.base, self.places, q, t)

    def jacobian(self, q: Array, t: Array) -> Float[Array, "m n"]:
        zero = jnp.zeros(len(self.coordinates), q.dtype)
        own = jax.jacrev(lambda d: _given(self.base, self.places, self.retract(q, d), t))(zero)
        return jnp.concatenate([self.base.jacobian(q, t), own])

    def velocity_constraint(self, q: Array, qd: Array, t: Array, u: Array | None = None) -> Float[Array, " m"]:
        return jnp.pad(self.base.velocity_constraint(q, qd, t, u), (0, len(self.laws)))

    def opened(self, kept: Array) -> Self:
        return replace_fields(self, base=self.base.opened(kept[: len(self.base.rows)]))

    @property
    def kept(self) -> Array | None:
        own = self.base.kept
        return None if own is None else jnp.pad(own, (0, len(self.laws)), constant_values=True)

    def rubbing(self, factors: Mapping[str, ArrayLike]) -> Self:
        return replace_fields(self, base=self.base.rubbing(factors))

    @property
    def may_bend(self) -> bool:
        return self.base.may_bend

    def load(self, state: State) -> Array:
        return self.base.load(state)

    def retract(self, q: Array, d: Array) -> Array:
        return self.base.retract(q, d)

    def start(self, q: Array, t: Array) -> Array:
        return self.base.start(q, t)

    @property
    def doubt(self) -> str:
        return self.base.doubt

    def displacement(self, base: Array, q: Array) -> tuple[Array, Array] | None:
        return self.base.displacement(base, q)

    def velocity(self, q: Array, rate: Array) -> Array | None:
        return self.base.velocity(q, rate)

    @property
    def adds(self) -> bool:
        return self.base.adds

    @property
    def reference(self) -> Array:
        return self.base.reference

    @property
    def joint_coordinates(self) -> AbstractJointCoordinates:
        return _Joints(self.base.joint_coordinates, len(self.base.rows))

    @property
    def whole(self) -> Self:
        return replace_fields(self, base=self.base.whole)

    @property
    def anonymous(self) -> Self:
        return replace_fields(self, base=self.base.anonymous, drives=self.drives.anonymous)

    @property
    def without_friction(self) -> Self:
        return replace_fields(self, base=self.base.without_friction)


@eqx.filter_jit  # traced once for all derivatives in all programs
def _given(system: AbstractSystem, places: tuple[int, ...], q: Array, t: Array) -> Float[Array, " d"]:
    none = jnp.zeros(len(system.coordinates), q.dtype)
    own = q if q.shape == none.shape else none
    joints = system.joint_coordinates.positions(State(q, none, t))
    return jnp.concatenate([own, joints])[np.array(places, int)]


class _Joints(AbstractJointCoordinates):
    """Those of a system, whose reactions read its own rows alone."""

    inner: AbstractJointCoordinates
    rows: int = eqx.field(static=True)

    @property
    def wraps(self) -> np.ndarray:
        return self.inner.wraps

    @property
    def radian(self) -> ArrayLike:
        return self.inner.radian

    @property
    def opposite(self) -> Self:
        return replace_fields(self, inner=self.inner.opposite)

    def positions(self, state: State) -> Array:
        return self.inner.positions(state)

    def motion(self, state: State, acceleration: Array) -> JointMotion:
        return self.inner.motion(state, acceleration)

    def reactions(self, state: State, multipliers: Array) -> Array:
        return self.inner.reactions(state, multipliers[: self.rows])
