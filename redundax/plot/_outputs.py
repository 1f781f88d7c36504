"""Which entries of a motion are drawn."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from .._system._names import Entry, indices_of

_MOST = 6  # positions that are drawn where no outputs are named
_ROUNDING = (
    1e-9  # of the largest, up to which values are the same: motions are integrated to 1e-8 unless told otherwise
)


def chosen(known: Sequence[Entry], names: Sequence[str] | None, values: Callable[[Entry], np.ndarray]) -> list[Entry]:
    """The entries of these names; if not given, the first six of the first array whose values vary, angles first."""
    if names is not None:
        labels = [entry.name for entry in known]
        return [known[k] for name in names for k in indices_of("outputs", name, labels, " of entries of the motion")]
    first = [entry for entry in known if entry.array == known[0].array]
    positions = sorted(first, key=lambda entry: entry.kind != "angular")
    found = {entry: values(entry) for entry in positions}
    return [entry for entry in positions if _varies(entry, found)][:_MOST]


def _varies(entry: Entry, found: Mapping[Entry, np.ndarray]) -> bool:
    """Whether values differ along the last axis by more than rounding of the largest position of the same kind."""
    largest = max(np.nanmax(np.abs(values), initial=0.0) for one, values in found.items() if one.kind == entry.kind)
    own = found[entry]
    change = np.nanmax(own, axis=-1, initial=-np.inf) - np.nanmin(own, axis=-1, initial=np.inf)
    return bool(np.any(change > _ROUNDING * largest))
