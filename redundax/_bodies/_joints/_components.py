"""Components of a relative pose by the names of the rows that lock them, or of the coordinates that they are."""

from collections.abc import Callable, Mapping, Sequence

import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from ..._tools._errors import RedundaxError
from ._base import Row

Components = Mapping[tuple[str, ...], Callable[..., Array]]


def values(known: Components, rows: Sequence[Row], owner: str, *of: PyTree) -> Float[Array, " rows"]:
    """Those that rows or coordinates name, in their order; what stands together in `known` is computed together.

    `owner` has the rows; the components are functions of what they are `of`.
    """
    names, parts = tuple(name for name, _ in rows), []
    while names:
        found = next((key for key in known if names[: len(key)] == key), None)
        if found is None:
            raise RedundaxError(
                f"Rows, coordinates and slips of {owner} must be among {'; '.join(map(', '.join, known))}, but one is "
                f"'{names[0]}'. Name these, or write `residual`, `coordinates` or `slips`."
            )
        parts.append(known[found](*of))
        names = names[len(found) :]
    return parts[0] if len(parts) == 1 else jnp.concatenate(parts or [jnp.zeros(0)])


def picked(multipliers: Array, rows: Sequence[Row], names: Sequence[str]) -> Float[Array, " names"]:
    """The multipliers of rows of these names, wherever they stand among `rows`; zero where there is no such row."""
    known = [name for name, _ in rows]
    at = [known.index(name) if name in known else None for name in names]
    if (first := at[0]) is not None and at == [*range(first, first + len(at))]:
        return multipliers[first : first + len(at)]  # compiles to less than what follows
    return jnp.stack([jnp.zeros((), multipliers.dtype) if k is None else multipliers[k] for k in at])
