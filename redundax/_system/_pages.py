"""What a print of a result shows: its entries by name, those of one unit together under a heading that says which."""

import math
import textwrap
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from .._tools._numbers import Numeric
from .._tools._table import WIDTH, Group, figures, group
from ._axis import Axis
from ._names import QUANTITIES, Names, Quantity
from ._results import RESULTS
from ._units import with_unit

_WORDS = {
    "q": "position",
    "centres": "position",
    "joints.position": "joint",
    "joints.rate": "joint, rate",
    "qd": "velocity",
    "acceleration": "acceleration",
    "multipliers": "multiplier",
    "friction": "friction",
}


def by_unit(
    axis: Axis, heading: Callable[[bool], tuple[str, ...]], labels: Sequence[str], *columns: Sequence[str]
) -> list[Group]:
    """The rows of an axis, those of linear coordinates and forces before the others where headings differ."""
    if heading(False) == heading(True):
        return [group(heading(False), labels, *columns)]
    places = np.flatnonzero(~axis.angular), np.flatnonzero(axis.angular)
    return [
        group(heading(angular), *([column[k] for k in own.tolist()] for column in (labels, *columns)))
        for angular, own in zip((False, True), places, strict=True)
    ]


def values_of(names: Names, *arrays: tuple[str, Numeric]) -> list[Group]:
    """One column for each of these arrays by `Quantity`, which have the axis of the last, or the linear part of it; one
    alone has its own names."""
    quantity, alone = QUANTITIES[arrays[-1][0]], len(arrays) == 1
    axis = names.axes[quantity.axis]

    def heading(angular: bool) -> tuple[str, ...]:
        units = [_heading(array, angular, names) if len(x) == len(axis) or not angular else "" for array, x in arrays]
        return (*units, "") if alone else ("", *units)

    labels = _labels(quantity, names) if alone else axis.labels
    columns = [figures(np.asarray(values)) + [""] * (len(axis) - len(values)) for _, values in arrays]
    return by_unit(axis, heading, labels, *columns)


def spans_of(names: Names, *arrays: tuple[str, Numeric]) -> list[Group]:
    """The same for the least and the largest of these arrays over all axes but the last."""
    quantity = QUANTITIES[arrays[0][0]]
    axis = names.axes[quantity.axis]

    def heading(angular: bool) -> tuple[str, ...]:
        return ("", *(cell for array, _ in arrays for cell in (_heading(array, angular, names), "to")))

    return by_unit(axis, heading, axis.labels, *(column for _, values in arrays for column in _ends(values)))


def ranges_of(names: Names, array: str, values: Numeric, samples: str = "") -> list[Group]:
    """Least and largest of each entry over all axes but the last, and how many `samples`, in a word, have none."""
    quantity = QUANTITIES[array]
    axis, last = names.axes[quantity.axis], (samples,) if samples else ()
    columns = _ends(values)
    if samples:
        columns.append([str(count) for count in np.isnan(_flat(values)).sum(axis=0)])

    def heading(angular: bool) -> tuple[str, ...]:
        return (_heading(array, angular, names), "least", "largest", *last)

    return by_unit(axis, heading, _labels(quantity, names), *columns)


def _labels(quantity: Quantity, names: Names) -> list[str]:
    """Names of entries; of friction also the body on which it is told."""
    slips = names.slips.labels if quantity.axis == "slip" else ()
    on = {label: f" (on {body})" for label, body in zip(slips, names.carriers(slips), strict=True) if body}
    return [quantity.pattern.format(label) + on.get(label, "") for label in names.axes[quantity.axis].labels]


def _ends(values: Numeric) -> list[list[str]]:
    """Columns of the least and of the largest; NaN where there is none."""
    flat = _flat(values)
    missing = np.isnan(flat)
    ends = (
        np.where(missing, np.inf, flat).min(axis=0, initial=np.inf),
        np.where(missing, -np.inf, flat).max(axis=0, initial=-np.inf),
    )
    return [figures(np.where(missing.all(axis=0), np.nan, end), flat, 5) for end in ends]


def _flat(values: Numeric) -> np.ndarray:
    values = np.asarray(values)
    return values.reshape(math.prod(values.shape[:-1]), values.shape[-1])


def _heading(array: str, angular: bool, names: Names) -> str:
    return with_unit(_WORDS[array], QUANTITIES[array].unit(angular, names.units))


def outcome(result: RESULTS, what: str) -> list[str]:
    """How it ended, or of several results of a kind how many ended in which way."""
    return textwrap.wrap(f"{what}: {RESULTS[result]}", WIDTH)


def numbers_of(figures: Mapping[str, Numeric]) -> list[str]:
    """Numbers with what they count or measure; of several the least and the largest."""
    ends = {name: dict.fromkeys(f"{end(x):.4g}" for end in (np.min, np.max)) for name, x in figures.items()}
    return textwrap.wrap(", ".join(f"{name} {' to '.join(span)}" for name, span in ends.items()), WIDTH)


def notes(names: Names, words: str) -> list[str]:
    """The units that the model states, and what else must be told."""
    units = [f"units {names.units}"] if str(names.units) else []
    return [*units, *textwrap.wrap(words, WIDTH)]


def further(names: Names) -> list[str]:
    """What joints have, which is computed when it is asked for: an example each."""
    known = [f'["{axis.labels[0]}"]' for axis in (names.reactions, names.joint_coordinates) if len(axis)]
    return [f"Joints by name: {', '.join(known)}, ..."] if known else []
