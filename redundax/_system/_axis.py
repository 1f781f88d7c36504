"""Names and kinds of coordinates, constraint rows and slips.

A coordinate is linear (length unit) or angular (angle unit). A constraint row measured in length has a
force as its multiplier, a row measured in angle has a moment, because multiplier times row is work. Linear
coordinates stand before angular ones and force-type rows before moment-type ones, Eqs. (15), (60), (61).
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from .._tools._errors import RedundaxError
from .._tools._module import names_in


@dataclasses.dataclass(frozen=True)
class Axis:
    """Names and kinds along one axis of an array.

    ??? example

        ```python
        rx.Axis(("x", "y", "phi"), ("linear", "linear", "angular"))  # coordinates
        rx.Axis(("slot", "stop"), ("force", "moment"))  # rows
        ```

    **Arguments:**

    - `names`: one name for each entry, or `None` where names were left behind (inside compiled code).
    - `kinds`: for coordinates and slips "linear" or "angular", for constraint rows "force" or "moment".
    """

    names: tuple[str, ...] | None
    kinds: tuple[str, ...]

    def __post_init__(self) -> None:
        if self.names is not None and len(self.names) != len(self.kinds):
            raise RedundaxError(
                f"Argument `names` must have one name for each of the {len(self.kinds)} entries, "
                f"but has {len(self.names)}. Give as many."
            )
        if self.names is not None and len(set(self.names)) != len(self.names):
            twice = sorted({name for name in self.names if self.names.count(name) > 1})
            raise RedundaxError(
                f"Argument `names` must name each entry once, but {twice} occur more than once. Rename them."
            )

    def check(self, argument: str, allowed: tuple[str, ...]) -> None:
        """Refuse kinds that are not allowed on this axis."""
        wrong = sorted(set(self.kinds) - set(allowed), key=str)
        if wrong:
            raise RedundaxError(
                f"Argument `{argument}` must hold {' or '.join(map(repr, allowed))}, but holds {wrong}. "
                "Use these words alone."
            )

    def __len__(self) -> int:
        return len(self.kinds)

    @property
    def angular(self) -> np.ndarray:
        """Mask of the entries measured in angle (angular coordinates, moment-type rows), shape (len,)."""
        return np.array([kind in ("angular", "moment") for kind in self.kinds], dtype=bool)

    @property
    def labels(self) -> tuple[str, ...]:
        """The names, or the indices as text where there are none."""
        return self.names if self.names is not None else tuple(str(i) for i in range(len(self)))

    @property
    def anonymous(self) -> "Axis":
        """The same kinds without names, so that compiled programs do not depend on names."""
        return Axis(None, self.kinds)


def axis(argument: str, kinds: Axis | Sequence[str] | str, size: int) -> Axis:
    """An axis of `size` entries; one kind may be given for all."""
    if isinstance(kinds, Axis):
        return kinds
    kinds = (kinds,) * size if isinstance(kinds, str) else tuple(names_in(argument, kinds))
    if len(kinds) != size:
        raise RedundaxError(
            f"Argument `{argument}` must have {size} entries, but has {len(kinds)}. Give one for each, or one word for "
            "all."
        )
    return Axis(None, kinds)


def join(axes: Sequence[Axis]) -> Axis:
    """One axis after the other; without names unless all have some."""
    kinds = tuple(kind for axis in axes for kind in axis.kinds)
    known = all(axis.names is not None for axis in axes)
    return Axis(tuple(name for axis in axes for name in axis.names or ()) if known else None, kinds)
