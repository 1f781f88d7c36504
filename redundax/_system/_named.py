"""Results whose entries have names."""

from operator import attrgetter
from typing import TYPE_CHECKING

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from .._tools._errors import RedundaxError
from .._tools._module import is_concrete, on_device, replace_fields
from .._tools._value import AbstractModule
from ._export import dataset_of, frame_of
from ._joint_coordinates import AbstractJointCoordinates
from ._names import QUANTITIES, Entry, Names, entries, index_of

if TYPE_CHECKING:
    import pandas
    import xarray


class AbstractNamed(AbstractModule):
    """A result whose entries have names.

    - `names`: what is called how; None inside of the library.
    - `joint_coordinates`: what the motion of joints is computed from.
    """

    names: Names | None = eqx.field(static=True, default=None, repr=False, kw_only=True)
    joint_coordinates: AbstractJointCoordinates | None = eqx.field(default=None, repr=False, kw_only=True)

    @property
    def entries(self) -> tuple[Entry, ...]:
        """All entries that have names; positions have some where velocities are their rates."""
        if self.names is None:
            raise RedundaxError(
                "This result has no names: it does not come from `solve` or `simulate`. Index its arrays."
            )
        chart = "" if self.names.adds else "q"
        return tuple(entries(self.names.axes, [array for array in QUANTITIES if array != chart], self.names.units))

    def __getitem__(self, name: str) -> Float[Array, "..."]:
        """One entry by name, with the axes of batches and times."""
        known = self.entries
        labels = [each.name for each in known]
        told = None if self.names is None or name in labels else self.names.other_end(name)
        if told is None or self.joint_coordinates is None:
            more = [] if self.names is None or name in labels or told is not None else self.names.other_ends
            return self.entry(known[index_of("name", name, labels, also=more)])
        turned = replace_fields(self, joint_coordinates=self.joint_coordinates.opposite)
        return turned.entry(known[labels.index(told)])

    def entry(self, entry: Entry) -> Float[Array, "..."]:
        """The same, given one of `entries`."""
        array = attrgetter(entry.array)(self)
        return on_device(np.asarray(array)[..., entry.index]) if is_concrete(array) else array[..., entry.index]

    def to_pandas(self) -> "pandas.DataFrame":
        """All entries as columns by name: one row for each sample of a batch, or for each time of a motion.

        Units are in `attrs["units"]`, by name. `to_pandas().T` is one line for each entry. It needs pandas, which comes
        with the extra `study`.
        """
        return frame_of(self)

    def to_xarray(self) -> "xarray.Dataset":
        """The arrays `q`, `qd`, `acceleration`, `multipliers`, ... along "sample" or "time" and the names of entries.

        The attributes `linear_unit` and `angular_unit` are the units of entries that `coordinate_kind` and its like
        tell apart. It needs xarray, which comes with the extra `study`.
        """
        return dataset_of(self)
