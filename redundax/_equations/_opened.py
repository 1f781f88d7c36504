"""A system of whose constraints some are left out: contacts that do not carry."""

from typing import Any, Self

from jaxtyping import Array, Float

from .._system._friction import AbstractFriction
from .._system._joint_coordinates import AbstractJointCoordinates
from .._system._names import Names
from .._system._state import State
from .._system._system import AbstractSystem, Path
from .._tools._module import replace_fields


class Opened(AbstractSystem):
    """The system `inner` where rows count as many times as `kept` says, once or not at all.

    A row that is left out is one of zeros, so that programs keep their shapes: it adds nothing to the rank, and its
    multiplier is a self-stress by itself, which a closure that couples it with no other sets to its misfit.
    """

    inner: AbstractSystem
    kept: Float[Array, " m"]

    def __init__(self, inner: AbstractSystem, kept: Float[Array, " m"]):
        self.inner, self.kept = inner, kept

    @property
    def _names(self) -> Names:
        return self.inner._names

    @property
    def friction(self) -> tuple[AbstractFriction, ...]:
        """That of the system."""
        return self.inner.friction

    @property
    def radian(self) -> Any:
        return self.inner.radian

    @property
    def constant_mass(self) -> bool:
        return self.inner.constant_mass

    @property
    def diagonal_mass(self) -> bool:
        return self.inner.diagonal_mass

    def mass(self, q: Array, t: Array) -> Array:
        return self.inner.mass(q, t)

    def constraint(self, q: Array, t: Array) -> Array:
        return self.kept * self.inner.constraint(q, t)

    def jacobian(self, q: Array, t: Array) -> Array:
        return self.kept[:, None] * self.inner.jacobian(q, t)

    def load(self, state: State) -> Array:
        return self.inner.load(state)

    def retract(self, q: Array, d: Array) -> Array:
        return self.inner.retract(q, d)

    def path(self, q: Array, rate: Array) -> Path | None:
        return self.inner.path(q, rate)

    def displacement(self, base: Array, q: Array) -> tuple[Array, Array] | None:
        return self.inner.displacement(base, q)

    def velocity(self, q: Array, rate: Array) -> Array | None:
        return self.inner.velocity(q, rate)

    def constraint_at(self, at: Any, t: Array) -> Array:
        return self.kept * self.inner.constraint_at(at, t)

    def slips_at(self, at: Any) -> Array:
        return self.inner.slips_at(at)

    def slip_directions(self, at: Any) -> Array:
        return self.inner.slip_directions(at)

    @property
    def adds(self) -> bool:
        return self.inner.adds

    @property
    def reference(self) -> Array:
        """Where the system is described."""
        return self.inner.reference

    @property
    def joint_coordinates(self) -> AbstractJointCoordinates:
        """Those of the system."""
        return self.inner.joint_coordinates

    @property
    def slips(self) -> Any:
        return self.inner.slips

    @property
    def anonymous(self) -> Self:
        return replace_fields(self, inner=self.inner.anonymous)

    @property
    def without_friction(self) -> Self:
        return replace_fields(self, inner=self.inner.without_friction)
