"""What a joint in space with friction is: surfaces that its loads press together by a contact law

With several slips s friction is one force along them,

    v = a s',   tau = a f,   f = -(friction of N and |v|) v / |v|

with the arms a that make velocities of the surfaces of their rates: a length for an angle. Bristles bend along v.
"""

from collections.abc import Sequence
from typing import Any, ClassVar, TypeAlias, cast

import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from ...._tools._errors import RedundaxError
from ...._tools._module import Numbers, check_kind, floats, optional_float, part, positive, safe_norm
from ..._friction_model import AbstractFrictionModel
from ..._joints._base import check_friction
from ..._joints._components import values
from ..._joints._rubbing import AbstractOneSlip, AbstractRubbingJoint
from .._body import Body
from .._contact import AbstractContact, ContactLoad, ContactSize, EndContacts
from .._overlap import Overlap
from .._placement import Placement
from .._pose import Pose
from ._base import AbstractPlacedJoint
from ._components import FREE
from ._surfaces import GUIDE, PIN, Surfaces

Ends = tuple[Pose, Pose]
End: TypeAlias = Body | str
At: TypeAlias = Numbers | None
_ENDS = EndContacts()


class AbstractContactJoint(AbstractPlacedJoint, AbstractRubbingJoint[Pose]):
    """A joint whose loads press its `surfaces` together, so that it can have friction."""

    surfaces: ClassVar[Surfaces] = Surfaces()
    friction: AbstractFrictionModel | None
    contact: AbstractContact

    @property
    def law(self) -> AbstractFrictionModel | None:
        if self.friction is None or not self.surfaces.is_moment:
            return self.friction
        return self.friction.about(cast(Array, self._size(self.surfaces.radius)))

    def pin(self) -> Array | None:
        return self._size("pin_radius") if self.surfaces is PIN else None

    def moment_arm(self) -> Array | None:
        return self.size.length if self.surfaces is GUIDE else None

    @property
    def size(self) -> ContactSize:
        """What the contact needs to know."""
        share = self._size("thrust_share" if self.surfaces.axial else "")
        return ContactSize(self._size(self.surfaces.bend), share, self._size(self.surfaces.twist))

    @property
    def overlap(self) -> Overlap | None:
        """What the length of the contact is, where it changes."""
        length = getattr(self, self.surfaces.bend) if self.surfaces.bend else None
        return length if isinstance(length, Overlap) else None

    @property
    def has_convex_load(self) -> bool:
        return self.contact.is_seminorm

    def make(
        self,
        name: str,
        i: End,
        j: End,
        given: Sequence[Placement | None],
        on_i: Placement | None = None,
        on_j: Placement | None = None,
        **rubs: Any,
    ) -> None:
        """Set the fields of a joint that is being made, at global placements for both bodies or at those on them."""
        self.place_both(name, i, j, given, (on_i, on_j))
        self.rub(**rubs)

    def rub(
        self,
        friction: AbstractFrictionModel | None = None,
        contact: AbstractContact = _ENDS,
        **sizes: Numbers | Overlap | None,
    ) -> None:
        """Set the friction of a joint that is being made, and the sizes of its surfaces as far as they are given."""
        check_friction(self.name, friction)
        with part(f"joint '{self.name}'"):
            advice = "Give `rx.spatial.EndContacts()`, say."
            check_kind("contact", contact, AbstractContact, "a contact law", advice)
        self.friction, self.contact, own = friction, contact, self.surfaces
        unknown = sizes.keys() - set(own.sizes)
        if unknown:
            known = ", ".join((*own.sizes, "friction", "contact"))
            kind = type(self).__name__
            raise TypeError(f"{kind}() got an unexpected keyword argument '{min(unknown)}'. Give some of: {known}.")
        given: dict[str, Any] = {name: sizes.get(name) for name in own.sizes}
        for name, value in given.items():
            if name == own.axial:
                continue
            if not (own.may_overlap and isinstance(value, Overlap)):
                value = optional_float(value, name)
            if value is not None and not isinstance(value, Overlap):
                positive(name, value)
            setattr(self, name, value)
        if own.axial:
            thrust, radius = given[own.axial], given[own.radius]
            share = None if thrust is None or radius is None else floats(thrust, own.axial) / floats(radius, own.radius)
            self.thrust_share = optional_float(share)
        if friction is None:
            return
        if own.radius and given[own.radius] is None:
            raise RedundaxError(
                f"Argument `{own.radius}` of joint '{self.name}' must be given where it has friction, but is None: its "
                "surfaces slide there. Give a length."
            )
        for term in contact.terms if friction.depends_on_load else ():
            name = getattr(own, term)
            if name and given[name] is None:
                raise RedundaxError(
                    f"Argument `{name}` of joint '{self.name}' must be given where it has friction, but is None: its "
                    f"{term} load presses at that size. Give a length, or leave the term out, as in "
                    f"`contact=rx.spatial.{type(contact).__name__}({term}=False)`."
                )

    def _size(self, name: str) -> Array | None:
        """A size of the surfaces that is known and does not change."""
        value = getattr(self, name) if name else None
        return None if isinstance(value, Overlap) else value


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
        return self.overlap is not None

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
        return self.surfaces.pressed(multipliers, self.row_kinds)


class AbstractFrictionalJoint(AbstractPressedJoint, AbstractOneSlip[Pose]):
    """A joint with one slip coordinate whose loads press its surfaces together, so that it can have friction.

    The slip is its coordinate, if it does not say another.
    """

    def slip(self, i: Pose, j: Pose) -> Float[Array, ""]:
        return self.coordinates(i, j)[0]


class AbstractSlidingJoint(AbstractPressedJoint):
    """A joint whose surfaces slide in several directions, so that it can have friction along its slip."""

    has_direction: ClassVar[bool] = True

    @property
    def arms(self) -> Float[Array, " slips"]:
        """Velocities of the surfaces by unit rates of the slips."""
        name = self.surfaces.radius
        radius = jnp.asarray(self._size(name)) if name else jnp.ones_like(self.point_i[0])
        return jnp.stack(self.surfaces.arms(radius))

    def slips(self, i: Pose, j: Pose) -> Float[Array, " slips"]:
        """Slips of body i relative to body j; only their derivatives count."""
        return values(FREE, self.slip_kinds, f"a `{type(self).__name__}`", self.relative(i, j))

    def forces(
        self, model: AbstractFrictionModel, ends: Ends | None, loads: Array, rate: Array, sense: Array, memory: PyTree
    ) -> Float[Array, " slips"]:
        """Friction forces and moments, one for each slip; at rest against the direction `sense`, as one of v."""
        velocity = self.arms * rate
        normal = self.normal_load(loads, ends) if model.depends_on_load else jnp.zeros((), velocity.dtype)
        if memory is not None:
            return self.arms * model.force(normal, velocity, sense, memory)
        size = model.force(normal, safe_norm(velocity), jnp.ones_like(normal), None)
        return self.arms * direction(velocity, sense) * size

    def largest_changes(
        self, model: AbstractFrictionModel, ends: Ends | None, change: Array, rate: Array, memory: PyTree
    ) -> Float[Array, " slips"]:
        velocity = self.arms * rate
        if memory is None:
            share = jnp.where(jnp.all(velocity == 0), 1.0, jnp.abs(direction(velocity, velocity)))
            slope = share * model.slope_bound(safe_norm(velocity), None)
        else:
            slope = model.slope_bound(velocity, memory)
        if not model.depends_on_load:
            return jnp.zeros_like(velocity)
        return jnp.where(slope == 0, 0.0, self.arms * slope * self.largest_change(change, ends))

    def memory_rates(self, model: AbstractFrictionModel, rate: Array, memory: PyTree) -> PyTree:
        return model.memory_rate(self.arms * rate, memory)


def direction(velocity: Float[Array, " slips"], else_along: Float[Array, " slips"]) -> Float[Array, " slips"]:
    """Of a velocity, of something else where it is zero, and zero where that is too."""
    along = jnp.where(jnp.any(velocity != 0), velocity, else_along)
    size = safe_norm(along)
    return along / jnp.where(size > 0, size, 1.0)
