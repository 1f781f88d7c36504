"""What a joint in space with friction is: surfaces that its loads press together by a contact law."""

import abc
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...._tools._errors import RedundaxError
from ...._tools._module import Numbers, as_float, check_kind, floats, optional_float, part, positive
from ..._friction_model import AbstractFrictionModel
from ..._joints._base import check_friction
from .._contact import AbstractContact, ContactLoad, ContactSize
from .._overlap import Overlap
from .._pose import Pose
from ._base import AbstractPlacedJoint

Ends = tuple[Pose, Pose]


class AbstractContactJoint(AbstractPlacedJoint):
    """A joint whose loads press its surfaces together, so that it can have friction."""

    friction: eqx.AbstractVar[AbstractFrictionModel | None]
    contact: eqx.AbstractVar[AbstractContact]

    @property
    def law(self) -> AbstractFrictionModel | None:
        """Friction as force or moment that does work on the slip, or of surfaces that slide in several directions."""
        return self.friction

    @property
    @abc.abstractmethod
    def size(self) -> ContactSize:
        """What the contact needs to know."""

    @property
    def has_convex_load(self) -> bool:
        """Whether the normal load is a seminorm of the multipliers."""
        return self.contact.is_seminorm

    def rub(
        self,
        friction: AbstractFrictionModel | None,
        contact: AbstractContact,
        needed: Mapping[str, Any],
        by_term: Mapping[str, tuple[str, Any]],
    ) -> None:
        """Set the friction of a joint that is being made.

        `needed` are lengths that friction needs, by name, `by_term` names and values of those that the terms of the
        contact need.
        """
        check_friction(self.name, friction)
        with part(f"joint '{self.name}'"):
            advice = "Give `rx.spatial.EndContacts()`, say."
            check_kind("contact", contact, AbstractContact, "a contact law", advice)
        self.friction, self.contact = friction, contact
        for name, value in (*needed.items(), *by_term.values()):
            if value is not None and name != "thrust_radius" and not isinstance(value, Overlap):
                positive(name, as_float(value))
        for name, value in needed.items():
            if friction is not None and value is None:
                raise RedundaxError(
                    f"Argument `{name}` of joint '{self.name}' must be given where it has friction, but is None: its "
                    "surfaces slide there. Give a length."
                )
        for term in contact.terms if friction is not None and friction.depends_on_load else ():
            name, value = by_term.get(term, ("", 0.0))
            if value is None:
                raise RedundaxError(
                    f"Argument `{name}` of joint '{self.name}' must be given where it has friction, but is None: its "
                    f"{term} load presses at that size. Give a length, or leave the term out, as in "
                    f"`contact=rx.spatial.{type(contact).__name__}({term}=False)`."
                )


class AbstractPressedJoint(AbstractContactJoint):
    """A joint with one normal load; `ends` are the poses of both bodies, for those whose contact depends on them."""

    def normal_load(self, multipliers: Float[Array, " rows"], ends: Ends | None = None) -> Float[Array, ""]:
        """Size of the load that presses the sliding surfaces together, N."""
        return self.contact.normal_load(*self._contact_at(multipliers, ends))

    def largest_change(self, change: Float[Array, " rows"], ends: Ends | None = None) -> Float[Array, ""]:
        """Bound of the change of the normal load by a change of the multipliers."""
        return self.contact.largest_change(*self._contact_at(change, ends))

    @property
    def reads_pose(self) -> bool:
        """Whether the normal load depends on the poses of both bodies."""
        return self.overlap is not None

    @property
    def overlap(self) -> Overlap | None:
        """What the length of the contact is, where it changes."""
        return None

    def _contact_at(self, multipliers: Array, ends: Ends | None) -> tuple[ContactLoad, ContactSize]:
        """Loads at the middle of the contact, and its size."""
        load, size = self.load(multipliers), self.size
        if self.overlap is None:
            return load, size
        if ends is None:
            raise RedundaxError(
                f"Argument `ends` must be the poses of both bodies of joint '{self.name}', but is None: its contact is "
                "as long as its parts overlap. Give a pair of `rx.spatial.Pose`."
            )
        length, middle = self.overlap.at(self.relative(*ends).travel)
        bend = load.bend - middle * jnp.stack([-load.radial[1], load.radial[0]])
        return load._replace(bend=bend), size._replace(length=length)

    def load(self, multipliers: Float[Array, " rows"]) -> ContactLoad:
        """What the multipliers are for the contact."""
        row, none = {name: k for k, (name, _) in enumerate(self.row_kinds)}, jnp.zeros(2, multipliers.dtype)
        axial, twist = (multipliers[row[name]] if name in row else none[0] for name in ("axial", "twist"))
        first = [row.get(f"{name}_1") for name in ("radial", "bend")]
        radial, bend = (none if k is None else multipliers[k : k + 2] for k in first)
        return ContactLoad(radial, axial, bend, twist)


class AbstractFrictionalJoint(AbstractPressedJoint):
    """A joint with one slip coordinate whose loads press its surfaces together, so that it can have friction."""

    slip_kind: eqx.AbstractClassVar[str]

    @abc.abstractmethod
    def slip(self, i: Pose, j: Pose) -> Float[Array, ""]:
        """Displacement of body i relative to body j that friction opposes; "linear" or "angular" by `slip_kind`."""


def pin_bearing(
    pin_radius: Numbers | None, bearing_length: Numbers | None, thrust_radius: Numbers | None
) -> tuple[Array | None, Array | None, Array | None]:
    """Radius of a pin, length of its bearing and the normal load of a unit axial force, as far as they are given."""
    share = None
    if thrust_radius is not None and pin_radius is not None:
        share = as_float(floats(thrust_radius) / floats(pin_radius))
    return optional_float(pin_radius), optional_float(bearing_length), share
