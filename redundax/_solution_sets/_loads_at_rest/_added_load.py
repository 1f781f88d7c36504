"""The load that is added to those of a mechanism at rest, as generalised forces."""

from collections.abc import Mapping

import numpy as np

from ..._bodies._loads import AbstractLoad
from ..._bodies._mechanism import Mechanism
from ..._system._names import ByName, unit_of, vector
from ..._system._state import State
from ..._system._system import AbstractSystem
from ..._tools._errors import RedundaxError
from ..._tools._module import finite
from ..._tools._numbers import Numeric, as_numbers
from ..._tools._words import short


def added_load(system: AbstractSystem, state: State, load: ByName | AbstractLoad) -> Numeric:
    """Generalised forces, shape (n,), of what is given for the argument `load`."""
    force = None
    if isinstance(load, AbstractLoad):
        force = system.load_of(load, state) if isinstance(system, Mechanism) else None
    elif isinstance(load, Mapping) or _is_vector(load):
        force = vector("load", load, system.coordinates, " of coordinates")
    if force is None:
        of_mechanism = ", or a load of mechanisms, such as an `AppliedForce`" if isinstance(system, Mechanism) else ""
        raise RedundaxError(
            f"Argument `load` must be generalised forces by name of coordinate or as a vector{of_mechanism}, but is "
            f"{short(load)}. Write {{{system.coordinates.labels[0]!r}: 1.0}}, say."
        )
    found: Numeric = as_numbers(force)
    finite("load", found)
    if not found.any():
        raise RedundaxError("Argument `load` must not be zero: multiples of it are asked for. Give a force, N or N m.")
    return found


def named_load(system: AbstractSystem, force: Numeric) -> tuple[dict[str, float], tuple[str, ...]]:
    """Generalised forces by name of coordinate, those that are not 0, and their units."""
    own = zip(system.coordinates.labels, system.coordinates.angular, force, strict=True)
    found = [(name, "moment" if angular else "force", float(amount)) for name, angular, amount in own if amount]
    units = tuple(unit_of(kind, system.names.units) for _, kind, _ in found)
    return {name: amount for name, _, amount in found}, units


def load_in_words(load: Mapping[str, float], units: tuple[str, ...]) -> str:
    """What `named_load` gives, in a line."""
    parts = (f"{name} {amount:.6g} {unit}".strip() for (name, amount), unit in zip(load.items(), units, strict=True))
    return f"Added load of amount 1: {', '.join(parts)}"


def _is_vector(load: object) -> bool:
    try:
        array = np.asarray(load)
    except ValueError:  # rows of different length
        return False
    return array.ndim == 1 and array.dtype != object
