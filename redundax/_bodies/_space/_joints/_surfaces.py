"""Where joints in space rub: surfaces, which loads press together, by the names of their sizes

A pin turns in a bearing, a sleeve turns and slides on a shaft, a guide slides on a rail, a ball turns in a socket, a
plate or the point of a foot slides on a table, and a thread along its helix.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypedDict

import jax.numpy as jnp
from jaxtyping import Array

from ...._tools._module import Numbers, safe_norm
from ..._friction_model import AbstractFrictionModel
from ..._joints._base import Row
from ..._joints._components import picked
from .._contact import AbstractContact, ContactLoad
from .._overlap import Overlap
from .._placement import Placement


def along_rows(multipliers: Array, rows: Sequence[Row]) -> ContactLoad:
    """Each row presses as it is called."""
    radial, bend = (picked(multipliers, rows, (f"{name}_1", f"{name}_2")) for name in ("radial", "bend"))
    axial, twist = picked(multipliers, rows, ("axial", "twist"))
    return ContactLoad(radial, axial, bend, twist)


def any_way(multipliers: Array, rows: Sequence[Row]) -> ContactLoad:
    """A ball or a bead is pressed by its force, wherever it points."""
    zero, none = jnp.zeros((), multipliers.dtype), jnp.zeros(2, multipliers.dtype)
    forces = [name for name, kind in rows if kind == "force"]
    return ContactLoad(picked(multipliers, rows, forces), zero, none, zero)


def on_a_point(multipliers: Array, rows: Sequence[Row]) -> ContactLoad:
    """A point is pressed by its force on the table alone."""
    zero, none = jnp.zeros((), multipliers.dtype), jnp.zeros(2, multipliers.dtype)
    (axial,) = picked(multipliers, rows, ("axial",))
    return ContactLoad(jnp.stack([axial, zero]), zero, none, zero)


def on_a_table(multipliers: Array, rows: Sequence[Row]) -> ContactLoad:
    """A plate is pressed so, and by moments at both sides, about any axis along the table."""
    point, bend = on_a_point(multipliers, rows), picked(multipliers, rows, ("bend_1", "bend_2"))
    return point._replace(bend=jnp.stack([point.twist, safe_norm(bend)]))


class Surfaces(NamedTuple):
    """Sizes of surfaces, by the names that they have as arguments and fields of a joint.

    - `radius`: at which they slide about the axis; friction needs it. It is a moment there if `is_moment`.
    - `bend`, `axial`, `twist`: sizes at which these loads press them; that of `bend` may change with the travel if
      `may_overlap`.
    - `pressed`: the loads of the contact, from the multipliers and their rows.
    - `arms`: velocities of surfaces that slide in several directions, by unit rates of the slips, from the radius, or
      from 1 where there is none.
    """

    radius: str = ""
    is_moment: bool = False
    bend: str = ""
    axial: str = ""
    twist: str = ""
    may_overlap: bool = False
    pressed: Callable[[Array, Sequence[Row]], ContactLoad] = along_rows
    arms: Callable[[Array], Sequence[Array]] = lambda radius: [jnp.ones_like(radius)]

    @property
    def sizes(self) -> tuple[str, ...]:
        """Names of all sizes."""
        return tuple(filter(None, (self.radius, self.bend, self.axial, self.twist)))


PIN = Surfaces("pin_radius", True, "bearing_length", "thrust_radius")
SLEEVE = Surfaces(
    "shaft_radius", bend="bearing_length", may_overlap=True, arms=lambda radius: [radius, jnp.ones_like(radius)]
)
GUIDE = Surfaces(bend="guide_length", twist="twist_radius", may_overlap=True)
BALL = Surfaces("ball_radius", True, pressed=any_way, arms=lambda radius: [jnp.ones_like(radius)] * 3)
PLATE = Surfaces(
    "spin_radius", bend="plate_length", pressed=on_a_table, arms=lambda radius: [*[jnp.ones_like(radius)] * 2, radius]
)
POINT = Surfaces(pressed=on_a_point, arms=lambda one: [one] * 2)
THREAD = Surfaces("thread_radius", bend="bearing_length")


class BallRubs(TypedDict, total=False):
    """Arguments of a joint for its placements, and for its friction: those of `BALL`."""

    on_i: Placement | None
    on_j: Placement | None
    ball_radius: Numbers | None
    friction: AbstractFrictionModel | None


class AbstractRubs(TypedDict, total=False):
    """The same of joints that have a contact law."""

    on_i: Placement | None
    on_j: Placement | None
    friction: AbstractFrictionModel | None
    contact: AbstractContact


class PinRubs(AbstractRubs, total=False):
    """Those of `PIN`."""

    pin_radius: Numbers | None
    bearing_length: Numbers | None
    thrust_radius: Numbers | None


class SleeveRubs(AbstractRubs, total=False):
    """Those of `SLEEVE`."""

    shaft_radius: Numbers | None
    bearing_length: Numbers | Overlap | None


class GuideRubs(AbstractRubs, total=False):
    """Those of `GUIDE`."""

    guide_length: Numbers | Overlap | None
    twist_radius: Numbers | None


class PlateRubs(AbstractRubs, total=False):
    """Those of `PLATE`."""

    plate_length: Numbers | None
    spin_radius: Numbers | None


class ThreadRubs(AbstractRubs, total=False):
    """Those of `THREAD`."""

    thread_radius: Numbers | None
    bearing_length: Numbers | None
