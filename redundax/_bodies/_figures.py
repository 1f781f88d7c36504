"""Numbers of parts: finite where they are known, and in the plane points and directions of two components."""

import dataclasses
from collections.abc import Sequence

import equinox as eqx
from jaxtyping import Array

from .._tools._errors import RedundaxError
from .._tools._module import finite


def check_figures(part: eqx.Module, owner: str, but: Sequence[str]) -> None:
    """Refuse numbers of a part that are not finite, `but` some fields; `owner` is what the part is called."""
    for field in dataclasses.fields(part):
        value = getattr(part, field.name)
        if eqx.is_inexact_array(value) and field.name not in but:
            finite(field.name, value, owner)


def check_vectors(part: eqx.Module, names: Sequence[str], owner: str) -> None:
    """Refuse points and directions of a planar part that have other than two components."""
    for name in names:
        value: Array | None = getattr(part, name, None)
        if value is None or not eqx.is_inexact_array(value) or value.shape == (2,):
            continue
        way = {
            (): "A number is no point: give a moment by its name, as in moment=2.0.",
            (3,): "Give a pair of numbers, or take all parts from `rx.spatial`.",
        }.get(value.shape, "Give a pair of numbers.")
        raise RedundaxError(
            f"Argument `{name}` of {owner} must have two components (x, y), as it is planar, but has shape "
            f"{value.shape}. {way}"
        )
