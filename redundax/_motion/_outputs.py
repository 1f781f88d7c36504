"""The entries of a motion by name: what is drawn, and in which unit.

1.phi    a position, m or rad          A.x      a multiplier, N or N m
1.phi'   a velocity                    tau A    friction, N or N m
1.phi''  an acceleration
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .._system._axis import Axis
from .._system._friction import slip_kinds
from .._system._system import AbstractSystem

_MOST = 6  # positions that are drawn where no outputs are named
_ROUNDING = 1e-9


class Quantity(NamedTuple):
    """An array of a `Trajectory`: axis and names of its entries, units of the linear and the angular ones."""

    axis: str
    pattern: str
    linear: str
    angular: str


QUANTITIES = {
    "q": Quantity("coordinate", "{}", "m", "rad"),
    "qd": Quantity("coordinate", "{}'", "m/s", "rad/s"),
    "acceleration": Quantity("coordinate", "{}''", "m/s²", "rad/s²"),
    "multipliers": Quantity("row", "{}", "N", "N m"),
    "friction": Quantity("slip", "tau {}", "N", "N m"),
}


class Output(NamedTuple):
    """One entry of a motion: its name, the array and the entry there, and its unit."""

    name: str
    array: str
    entry: int
    unit: str


def axes(system: AbstractSystem) -> dict[str, Axis]:
    """The axes of coordinates, rows and slips."""
    return {"coordinate": system.coordinates, "row": system.rows, "slip": slip_kinds(system.friction)}


def all_outputs(named: Mapping[str, Axis], *, positions: bool) -> list[Output]:
    """All entries of a motion whose arrays have these axes, those of q first where it has one for each coordinate."""
    return [
        Output(quantity.pattern.format(label), array, k, quantity.angular if angular else quantity.linear)
        for array, quantity in QUANTITIES.items()
        if quantity.axis in named and (positions or array != "q")
        for k, (label, angular) in enumerate(
            zip(named[quantity.axis].labels, named[quantity.axis].angular, strict=True)
        )
    ]


def chosen(
    known: Sequence[Output], names: Sequence[str] | None, values: Callable[[Output], np.ndarray]
) -> list[Output]:
    """The outputs of these names; if not given, the first six of the first array whose values vary, angles first."""
    if names is None:
        first = [output for output in known if output.array == known[0].array]
        positions = sorted(first, key=lambda output: not output.unit.startswith("rad"))
        found = {output: values(output) for output in positions}
        return [output for output in positions if _varies(output, found)][:_MOST]
    missing = [name for name in names if name not in {output.name for output in known}]
    if missing:
        some = ", ".join(output.name for output in known[:: max(1, len(known) // 4)])
        raise ValueError(
            f"Argument `outputs` must hold names of entries of the motion ({some}, ...), but holds {missing}. "
            "Names are those of coordinates, rows and slips."
        )
    return [output for name in names for output in known if output.name == name]


def _varies(output: Output, found: Mapping[Output, np.ndarray]) -> bool:
    """Whether values differ along the last axis by more than rounding of the largest position in the same unit."""
    largest = max(np.nanmax(np.abs(values), initial=0.0) for one, values in found.items() if one.unit == output.unit)
    own = found[output]
    change = np.nanmax(own, axis=-1, initial=-np.inf) - np.nanmin(own, axis=-1, initial=np.inf)
    return bool(np.any(change > _ROUNDING * largest))
