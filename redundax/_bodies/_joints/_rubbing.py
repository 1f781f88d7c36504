"""What a joint that rubs tells of its friction, and one with a single slip, in the plane or in space

    tau = forces(model, loads, rates, senses),   one entry a slip

The joint says how: a hinge has one moment, a sleeve one force along its slip, a cross two pins apart.
"""

import abc
from typing import TYPE_CHECKING, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from .._frame import P
from .._friction_model import AbstractFrictionModel
from .._pose import Pose
from ._base import AbstractJoint, Row, check_friction


class AbstractRubbingJoint(AbstractJoint[P]):
    """A joint that can have friction; `ends` are the poses of both bodies where the contact `reads_pose`, else None.

    `slip_kinds` are names and kinds, "linear" or "angular", of its slips; the name of a single one is "".
    """

    if TYPE_CHECKING:  # as in `AbstractBetweenBodies`
        friction: ClassVar[AbstractFrictionModel | None]
    else:
        friction: eqx.AbstractVar[AbstractFrictionModel | None]
    slip_kinds: ClassVar[tuple[Row, ...]] = ()
    has_direction: ClassVar[bool] = False  # whether its slips share one friction, along their direction
    read_by_law: ClassVar[tuple[str, ...]] = ("friction",)

    @property
    def law(self) -> AbstractFrictionModel | None:
        """Friction as force or moment that does work on the slip, or of surfaces that slide in several directions."""
        return self.friction

    def pin(self) -> Array | None:
        """Radius of its pin, if it has one that is known."""
        return None

    @property
    def has_convex_load(self) -> bool:
        """Whether the normal load is a seminorm of the multipliers."""
        return True

    @property
    def reads_pose(self) -> bool:
        """Whether the normal load depends on the poses of both bodies."""
        return False

    @abc.abstractmethod
    def slips(self, i: P, j: P) -> Float[Array, " slips"]:
        """All its slips, of body i relative to body j."""

    @abc.abstractmethod
    def forces(
        self,
        model: AbstractFrictionModel,
        ends: tuple[P, P] | None,
        loads: Array,
        rate: Array,
        sense: Array,
        memory: PyTree,
    ) -> Float[Array, " slips"]:
        """Friction forces and moments, one for each slip, from the multipliers of its rows."""

    @abc.abstractmethod
    def largest_changes(
        self, model: AbstractFrictionModel, ends: tuple[P, P] | None, change: Array, rate: Array, memory: PyTree
    ) -> Float[Array, " slips"]:
        """Bounds of the changes of friction by a change of the multipliers."""

    @abc.abstractmethod
    def memory_rates(self, model: AbstractFrictionModel, rate: Array, memory: PyTree) -> PyTree:
        """Rates of change of the internal states of its slips."""


class AbstractOneSlip(AbstractRubbingJoint[P]):
    """A joint with one slip and one normal load."""

    slip_kind: eqx.AbstractClassVar[str]

    @abc.abstractmethod
    def slip(self, i: P, j: P) -> Float[Array, ""]:
        """Displacement of body i relative to body j that friction opposes; "linear" or "angular" by `slip_kind`."""

    @abc.abstractmethod
    def normal_load(self, multipliers: Float[Array, " rows"]) -> Float[Array, ""]:
        """Size of the load that presses the sliding surfaces together, N: a seminorm of the multipliers."""

    def largest_change(self, change: Float[Array, " rows"]) -> Float[Array, ""]:
        """Bound of the change of the normal load by a change of the multipliers: that of a seminorm is its own."""
        return self.normal_load(change)

    @property
    def slip_kinds(self) -> tuple[Row, ...]:
        """Its one slip, which has the joint's name."""
        return (("", self.slip_kind),)

    def slips(self, i: P, j: P) -> Array:
        return self.slip(i, j)[None]

    def forces(
        self,
        model: AbstractFrictionModel,
        ends: tuple[P, P] | None,
        loads: Array,
        rate: Array,
        sense: Array,
        memory: PyTree,
    ) -> Array:
        normal = jnp.zeros((), loads.dtype)
        if model.depends_on_load:
            normal = self.normal_load(loads, *self._at(ends))
        return model.force(normal, rate[0], sense[0], memory)[None]

    def largest_changes(
        self, model: AbstractFrictionModel, ends: tuple[P, P] | None, change: Array, rate: Array, memory: PyTree
    ) -> Array:
        slope = model.slope_bound(rate[0], memory)
        if not model.depends_on_load:
            return jnp.zeros_like(slope)[None]
        return jnp.where(slope == 0, 0.0, slope * self.largest_change(change, *self._at(ends)))[None]

    def memory_rates(self, model: AbstractFrictionModel, rate: Array, memory: PyTree) -> PyTree:
        return model.memory_rate(rate[0], memory)

    def _at(self, ends: tuple[P, P] | None) -> tuple[tuple[P, P] | None, ...]:
        return (ends,) if self.reads_pose else ()


class AbstractFrictionalJoint(AbstractOneSlip[Pose]):
    """A joint with one slip coordinate and a normal load, so that it can have friction."""

    def __check_init__(self) -> None:
        check_friction(self.name, self.friction)

    @property
    def coordinate_kinds(self) -> tuple[Row, ...]:
        """One: "angle" or "travel", as in "name.angle"."""
        return (("angle" if self.slip_kind == "angular" else "travel", self.slip_kind),)

    def coordinates(self, i: Pose, j: Pose) -> Array:
        return self.slip(i, j)[None]
