"""What people give as a guess: numbers that are finite, and angles in radians."""

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from jax.typing import ArrayLike

from .._tools._errors import RedundaxError
from .._tools._module import is_concrete
from .._tools._words import warn


def check_finite(labels: Sequence[str], **arguments: ArrayLike | Mapping[str, ArrayLike]) -> None:
    """Refuse NaN and infinity in arguments, by the names of their entries: own ones, or labels."""
    for argument, value in arguments.items():
        wrong = [name for name, number in _numbers(labels, value).items() if not math.isfinite(number)]
        if wrong or (not isinstance(value, Mapping) and is_concrete(value) and not np.all(np.isfinite(value))):
            raise RedundaxError(
                f"Argument `{argument}` must be finite, but has NaN or infinity{' for ' if wrong else ''}"
                f"{', '.join(wrong)}. Give a number."
            )


def ask_for_radians(
    angles: Collection[str], labels: Sequence[str], q: ArrayLike, positions: Mapping[str, ArrayLike]
) -> None:
    """Ask about angles of more than a turn that have few decimals, as people write degrees and no motion has."""
    given = _numbers(labels, q) | _numbers(labels, positions)
    large = {
        name: value
        for name, value in given.items()
        if name in angles and 2 * math.pi < abs(value) < math.inf and round(value, 3) == value
    }
    if large:
        words = ", ".join(f"{name} = {value:g}" for name, value in large.items())
        warn(
            f"Angles are in radians, but those given are more than a turn: {words}. Are they degrees? "
            "jnp.deg2rad makes radians of them."
        )


def _numbers(labels: Sequence[str], value: ArrayLike | Mapping[str, ArrayLike]) -> dict[str, float]:
    """Numbers that are known, by name."""
    if isinstance(value, Mapping):
        return {name: float(np.asarray(number)) for name, number in value.items() if is_concrete(number)}
    if not is_concrete(value) or np.shape(value) != (len(labels),):
        return {}
    return dict(zip(labels, np.asarray(value).tolist(), strict=True))
