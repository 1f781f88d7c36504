"""What a rule is made of: a function of arrays for an equation that JAX has traced."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.core

Entries: TypeAlias = Any  # NumPy's arrays and scalars, of which a type checker knows no common one
Computed = Callable[..., Any]
Parameters = dict[str, Any]
Shapes = list[jax.core.ShapedArray]  # of what an equation takes and gives, with types


class NoRuleError(Exception):
    """NumPy does not compute an equation."""


class AtPlaces(NamedTuple):
    """Where in an array are the places that an equation is given second, and what it does there."""

    places: Computed
    function: Computed


def clamped(place: Entries, last: int) -> int:
    """The nearest place from 0 to the last."""
    return min(max(int(place), 0), last)
