"""Contacts that push alone, as teeth do: which of them pull in a solution, and what that means."""

from collections.abc import Sequence

import jax
import numpy as np
from jaxtyping import Array, Bool, Float

from .._tools._errors import RedundaxError
from .._tools._module import is_concrete
from .._tools._words import warn
from ._names import Names

_ROUNDING = 1e-9  # relative to the largest force of a joint


def pulling(names: Names | None, multipliers: Float[Array | np.ndarray, "*batch m"]) -> tuple[str, ...]:
    """Names of the rows of pushing contacts that pull, in any sample of a batch or at any time; concrete values. Those
    that open do not."""
    rows = [] if names is None else sorted({*names.pushing} - {*names.one_sided})
    if names is None or not rows:
        return ()
    if not is_concrete(multipliers):
        raise RedundaxError(
            "What pulls is told where numbers are known, not inside of transformations. Look at the signs of the "
            f"multipliers {', '.join(names.rows.labels[row] for row in rows)} there."
        )
    pulls = np.moveaxis(pulls_of(jax.device_get(multipliers), rows, names.rows.angular), -1, 0)
    return tuple(names.rows.labels[row] for row, own in zip(rows, pulls, strict=True) if own.any())


def pulls_of(multipliers: np.ndarray, rows: Sequence[int], angular: np.ndarray) -> Bool[np.ndarray, "*batch rows"]:
    """Which of some rows pull, beyond rounding beside the largest force."""
    values = np.nan_to_num(multipliers)
    largest = np.abs(values[..., ~angular]).max(axis=-1, keepdims=True)
    return values[..., list(rows)] < -_ROUNDING * largest


def in_words(rows: tuple[str, ...]) -> str:
    """What it means that contacts pull, and the way out; empty where none does."""
    teeth, others = (tuple(row for row in rows if row.endswith(".teeth") is own) for own in (True, False))
    told = []
    if teeth:
        told.append(
            f"Teeth pull in {', '.join(teeth)}: their other flanks are in contact, with another line of action and "
            "other loads on the bearings. Give these joints the opposite `flank`, or, where loads are not unique, look "
            "for a closure under which all teeth push."
        )
    if others:
        told.append(
            f"Contacts pull in {', '.join(others)}, which can only push: they come apart. Leave these joints out "
            "there, or, where loads are not unique, look for a closure under which all contacts push. If they push in "
            "truth, turn the sign of their residual: a multiplier is positive where a contact pushes."
        )
    return " ".join(told)


def changing(rows: tuple[str, ...]) -> str:
    """What happens to contacts that pull, as a heading."""
    return "CHANGE OF FLANK" if all(row.endswith(".teeth") for row in rows) else "CONTACT LOST"


def warn_of_pulling(names: Names | None, multipliers: Float[Array, "*batch m"]) -> None:
    """Tell that contacts pull, where that is known and any does."""
    rows = pulling(names, multipliers) if is_concrete(multipliers) else ()
    if rows:
        warn(in_words(rows))
