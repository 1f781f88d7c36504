"""Names: the one map from what a thing is called to where it stands, in systems and in results.

    crank.phi      a position         A.x                 the multiplier of a row, with the sign of the paper
    crank.phi'     a velocity         tau A               friction of a slip, on the joint's body i
    crank.phi''    an acceleration    A.angle, K.travel   a joint coordinate, with ' its rate, with '' its acceleration

    A force x on crank, A force y on crank, A moment on crank       what the joint does to the body that is named

Results know these on both bodies of a joint, but list those on one.

In space crank.x is the position of the centre of mass, and crank.phi_x' an angular velocity about the body's own axis.
A.angle of a pin, which leaves the turn free, is a joint coordinate; K.angle of a guide, which holds it, a moment.

Names never reach compiled programs: systems go there anonymous, and results get their names when they come back.
"""

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple, TypeVar

import jax
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float

from .._tools._errors import RedundaxError
from .._tools._module import Numbers, as_float, numpy_of
from .._tools._numbers import as_numbers
from .._tools._words import did_you_mean
from ._axis import Axis
from ._units import UNSTATED, StatedUnits

ByName = Numbers | Mapping[str, ArrayLike]  # a vector or a number for equal entries; or numbers by name
DRIVE = " drive"  # ends the name of the row that holds a coordinate to a law of time
_LISTED = 8  # names that an error lists
_NONE = Axis((), ())
T = TypeVar("T")


class Quantity(NamedTuple):
    """An array of a result: axis and names of its entries, how often they are differentiated by time, whether they are
    forces and moments, and whether the result keeps them or computes them when they are asked for."""

    axis: str
    pattern: str
    rates: int = 0
    is_force: bool = False
    is_kept: bool = True

    def kind(self, angular: bool) -> str:
        """Kind of an entry, angular or not: "linear", "angular", "force" or "moment"."""
        return ("force", "moment")[angular] if self.is_force else ("linear", "angular")[angular]

    def unit(self, angular: bool, units: StatedUnits) -> str:
        """Unit of an entry, angular or not."""
        return units.of(self.kind(angular), self.rates)

    def attributes(self, units: StatedUnits) -> dict[str, str]:
        """Both units, for the attributes of a data set; none where none are stated."""
        known = {"linear_unit": self.unit(False, units), "angular_unit": self.unit(True, units)}
        return known if str(units) else {}


QUANTITIES = {
    "q": Quantity("coordinate", "{}"),
    "centres": Quantity("centre", "{}", is_kept=False),
    "qd": Quantity("coordinate", "{}'", 1),
    "acceleration": Quantity("coordinate", "{}''", 2),
    "multipliers": Quantity("row", "{}", is_force=True),
    "friction": Quantity("slip", "tau {}", is_force=True),
    "reactions": Quantity("reaction", "{}", is_force=True, is_kept=False),
    "joints.position": Quantity("joint_coordinate", "{}", is_kept=False),
    "joints.rate": Quantity("joint_coordinate", "{}'", 1, is_kept=False),
    "joints.acceleration": Quantity("joint_coordinate", "{}''", 2, is_kept=False),
}
KEPT = {array: quantity for array, quantity in QUANTITIES.items() if quantity.is_kept}


@dataclasses.dataclass(frozen=True)
class Names:
    """Names and kinds of all that a system has.

    - `coordinates`, `rows`, `slips`, `joint_coordinates`, `reactions`: the axes of its arrays.
    - `centres`: positions of the centres of mass, which come first in `q`, where that has no names of its own.
    - `bodies`: those that move, in order.
    - `joints`: of each stack of joints of one kind.
    - `joined`: of each joint by name its bodies i, on which friction is told, and j.
    - `pushing`: indices of the rows whose multiplier is positive where contacts push, as teeth do.
    - `one_sided`: indices of those of them that open where contacts would pull.
    - `tied`: of each of `one_sided` the rows of velocity that open with it, as those of a wheel that lifts.
    - `velocity_rows`: indices of the rows that constrain velocities alone.
    - `units`: those that the model states.
    - `adds`: whether velocities are rates of positions, which then have the names of coordinates.
    """

    coordinates: Axis
    rows: Axis
    slips: Axis = _NONE
    joint_coordinates: Axis = _NONE
    reactions: Axis = _NONE
    centres: Axis = _NONE
    bodies: tuple[str, ...] = ()
    joints: tuple[tuple[str, ...], ...] = ()
    joined: tuple[tuple[str, str, str], ...] = ()
    pushing: tuple[int, ...] = ()
    one_sided: tuple[int, ...] = ()
    tied: tuple[tuple[int, ...], ...] = ()
    velocity_rows: tuple[int, ...] = ()
    units: StatedUnits = UNSTATED
    adds: bool = True

    @property
    def axes(self) -> dict[str, Axis]:
        """The axes of arrays, by what one entry is called."""
        return {
            "coordinate": self.coordinates,
            "row": self.rows,
            "slip": self.slips,
            "joint_coordinate": self.joint_coordinates,
            "reaction": self.reactions,
            "centre": self.centres,
        }

    @property
    def unknowns(self) -> Axis:
        """[qdd; lam; tau], of kinds "linear", "angular", "force", "moment", "friction force" and "friction moment"."""
        parts = entries(self.axes, ("acceleration", "multipliers", "friction"))
        friction = ("friction moment" if angular else "friction force" for angular in self.slips.angular)
        return Axis(tuple(each.name for each in parts), (*self.coordinates.kinds, *self.rows.kinds, *friction))

    @property
    def is_one_sided(self) -> Bool[np.ndarray, " m"]:
        """Of each row, whether it is that of a contact that opens."""
        return np.isin(np.arange(len(self.rows)), self.one_sided)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of joints in the order of their reactions."""
        return tuple(name for members in self.joints for name in members)

    def carriers(self, slips: Sequence[str]) -> list[str]:
        """The bodies on which the friction of slips acts as it is told; "" of a system without joints."""
        return [(self.bodies_at(slip) or ("", ""))[0] for slip in slips]

    def bodies_at(self, name: str) -> tuple[str, str] | None:
        """Bodies i and j of the joint that has a row, slip or coordinate of this name; None where none has."""
        joined = {joint: (i, j) for joint, i, j in self.joined}
        return joined.get(name, joined.get(name.rpartition(".")[0]))

    def other_end(self, name: str) -> str | None:
        """The reaction of a joint that is told where one is asked for on its other body; None where none is."""
        name = str(name)
        for joint, *bodies in self.joined:
            for asked, told in (bodies, bodies[::-1]):
                if name.startswith(f"{joint} ") and name.endswith(f" on {asked}"):
                    found = f"{name.removesuffix(asked)}{told}"
                    if found in self.reactions.labels:
                        return found
        return None

    @property
    def other_ends(self) -> list[str]:
        """Names of reactions on the other body of each joint, by which they are known too."""
        return [
            f"{label.removesuffix(told)}{other}"
            for joint, *bodies in self.joined
            for told, other in (bodies, bodies[::-1])
            for label in self.reactions.labels
            if label.startswith(f"{joint} ") and label.endswith(f" on {told}")
        ]

    @property
    def contacts(self) -> tuple[str, ...]:
        """Names of one-sided contacts: of their joints, where these have no other one, or of their rows."""
        rows = [self.rows.labels[row] for row in self.one_sided]
        joints = [row.rpartition(".")[0] for row in rows]
        return tuple(
            joint if joint and joints.count(joint) == 1 else row for row, joint in zip(rows, joints, strict=True)
        )

    @property
    def anonymous(self) -> "Names":
        """The same kinds, and rows that open, without names."""
        coordinates, rows, slips, joints, reactions, centres = (axis.anonymous for axis in self.axes.values())
        return Names(
            coordinates,
            rows,
            slips,
            joints,
            reactions,
            centres,
            one_sided=self.one_sided,
            tied=self.tied,
            velocity_rows=self.velocity_rows,
            adds=self.adds,
        )

    def with_slips(self, slips: Axis) -> "Names":
        """The same and those of friction."""
        return dataclasses.replace(self, slips=slips)


@dataclasses.dataclass(frozen=True)
class Entry:
    """One entry of a result: its name, the array and the index there, its kind as of a `Quantity`, and its unit.

    The unit is "" where the model states none.
    """

    name: str
    array: str
    index: int
    kind: str
    unit: str

    @property
    def dimension(self) -> tuple[str, int]:
        """Kind, and how often it is differentiated by time: entries with the same have the same unit."""
        return self.kind, QUANTITIES[self.array].rates


def entries(
    axes: Mapping[str, Axis], arrays: Collection[str] = tuple(QUANTITIES), units: StatedUnits = UNSTATED
) -> list[Entry]:
    """All entries of these arrays of a result whose arrays have these axes."""
    found = []
    for array, quantity in QUANTITIES.items():
        if array not in arrays or quantity.axis not in axes:
            continue
        axis = axes[quantity.axis]
        kinds = [(quantity.kind(angular), quantity.unit(angular, units)) for angular in (False, True)]
        for k, (label, angular) in enumerate(zip(axis.labels, axis.angular.tolist(), strict=True)):
            found.append(Entry(quantity.pattern.format(label), array, k, *kinds[angular]))
    return found


def unit_of(kind: str, units: StatedUnits) -> str:
    """Unit of an acceleration, multiplier, friction or joint load of a kind, as of `Names.unknowns`."""
    return units.of(kind, 2 if kind in ("linear", "angular") else 0)


class UnknownName(RedundaxError, KeyError):
    """A name that nothing has; the message gives near ones."""

    def __str__(self) -> str:  # of a KeyError it is quoted
        return ValueError.__str__(self)


def by_joint(names: Sequence[str]) -> str:
    """Names "joint.row" with the rows of a joint together, as in "A (x, y), K.angle"."""
    rows: dict[str, list[str]] = {}
    for name in names:
        joint, _, row = name.rpartition(".")
        rows.setdefault(joint or name, []).append(row if joint else "")
    words = (
        f"{joint} ({', '.join(own)})" if len(own) > 1 else ".".join(filter(None, (joint, *own)))
        for joint, own in rows.items()
    )
    return ", ".join(words)


def index_of(argument: str, name: str, known: Sequence[str], what: str = "", also: Sequence[str] = ()) -> int:
    """Index of a name among those known; an error where there are none or several, with near ones of `also` too."""
    found = indices_of(argument, name, known, what, also)
    if len(found) > 1:
        raise RedundaxError(
            f"Argument `{argument}` must name one entry, but {name!r} names {len(found)}. Rename one, or index arrays."
        )
    return found[0]


def indices_of(argument: str, name: str, known: Sequence[str], what: str = "", also: Sequence[str] = ()) -> list[int]:
    """Indices of all that have a name; an error with near names where nothing has."""
    found = [k for k, each in enumerate(known) if each == name]
    if found:
        return found
    more = f" and {len(known) - _LISTED} more: print(solution) shows what is called how" if len(known) > _LISTED else ""
    raise UnknownName(
        f"Argument `{argument}` must hold names{what}, but holds {name!r}. {did_you_mean(str(name), [*known, *also])}"
        f"There are {', '.join(known[:_LISTED]) or 'none'}{more}."
    )


class Named(dict[str, T]):
    """Values by name, of which one that is not there is refused with those that are."""

    def __missing__(self, name: str) -> T:
        return list(self.values())[index_of("name", name, list(self))]


jax.tree_util.register_pytree_node(
    Named,
    lambda named: (tuple(named.values()), tuple(named)),
    lambda names, values: Named(zip(names, values, strict=True)),
)


def vector(argument: str, value: ByName, axis: Axis, what: str) -> Array:
    """Numbers along an axis: given by name, 0 for those not named; else as given, a number for equal entries."""
    if isinstance(value, Mapping):
        found: list[ArrayLike] = [0.0] * len(axis)
        for name, number in value.items():
            found[index_of(argument, name, axis.labels, what)] = number
        return as_float(found, argument)
    array = as_float(value, argument)
    if array.shape not in ((), (len(axis),)):
        raise RedundaxError(
            f"Argument `{argument}` must be a number, have shape ({len(axis)},){what}, or give numbers by name, but "
            f"has shape {array.shape}. Give one number for all, or that many."
        )
    return array


def senses(slips: Axis, sense: ByName | None) -> Float[Array, " p"] | None:
    """Senses of the impending slip of all slips; 0 for those that are not named leaves a sense open."""
    if sense is None:
        return None
    given = as_numbers(vector("sense", sense, slips, " of slips"))
    return numpy_of(given).broadcast_to(given, (len(slips),))
