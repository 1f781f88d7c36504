"""Slider: no shift square to the axis and no turn

with friction mu N along the axis, N by the contact law.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...._tools._module import Numbers, optional_float
from ..._friction_model import AbstractFrictionModel
from ..._joints._base import Row
from .._body import Body
from .._contact import AbstractContact, ContactSize, EndContacts
from .._overlap import Overlap, length_or_overlap
from .._placement import Placement, at_reference
from .._pose import Pose
from ._frictional import AbstractFrictionalJoint
from ._rows import BEND, RADIAL, TRAVEL, TWIST

_ENDS = EndContacts()


class Prismatic(AbstractFrictionalJoint):
    """Slider: body i slides along an axis of body j. Rows radial_1, radial_2, bend_1, bend_2, twist; coordinate
    "travel".

    ??? example

        ```python
        ram = rx.spatial.Body("ram", 50.0, inertia=(1.0, 1.0, 1.0))
        rx.spatial.Prismatic("guide", ram, "ground", point=(0.2, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        rubs = {"guide_length": 0.1, "twist_radius": 0.03, "friction": rx.Coulomb(0.1)}
        rx.spatial.Prismatic("gib", ram, "ground", point=(0.2, 0.0, 0.0), axis=(0.0, 0.0, 1.0), **rubs)
        ```

    **Arguments:** those of the other pairs, `point` being the middle of the slider, which goes with body i, and

    - `guide_length`: distance of the slider's two contacts, which bending moments press, m, or an `Overlap` where it
      changes with the travel; needed for friction.
    - `twist_radius`: distance from the axis at which a twisting moment presses, m; needed for friction.
    - `friction`: `Coulomb` with its coefficient mu, or another model.
    - `contact`: the law for the normal load, and which terms it has.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (*RADIAL, *BEND, TWIST)
    free_axes: ClassVar[str] = "across"
    slip_kind: ClassVar[str] = "linear"
    guide_length: Float[Array, ""] | Overlap | None
    twist_radius: Float[Array, ""] | None
    friction: AbstractFrictionModel | None
    contact: AbstractContact

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point: Numbers | None = None,
        axis: Numbers | None = None,
        mark: Numbers | None = None,
        *,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
        guide_length: Numbers | Overlap | None = None,
        twist_radius: Numbers | None = None,
        friction: AbstractFrictionModel | None = None,
        contact: AbstractContact = _ENDS,
    ):
        self.place(name, i, j, at_reference(name, point, axis, mark), on_i, on_j)
        self.guide_length, self.twist_radius = length_or_overlap(guide_length), optional_float(twist_radius)
        by_term = {"bend": ("guide_length", guide_length), "twist": ("twist_radius", twist_radius)}
        self.rub(friction, contact, {}, by_term)

    @property
    def size(self) -> ContactSize:
        length = None if isinstance(self.guide_length, Overlap) else self.guide_length
        return ContactSize(length, twist_radius=self.twist_radius)

    @property
    def overlap(self) -> Overlap | None:
        return self.guide_length if isinstance(self.guide_length, Overlap) else None

    @property
    def coordinate_kinds(self) -> tuple[Row, ...]:
        return (TRAVEL,)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        relative = self.relative(i, j)
        return jnp.concatenate([relative.shift, relative.rotation])

    def coordinates(self, i: Pose, j: Pose) -> Array:
        return self.slip(i, j)[None]

    def slip(self, i: Pose, j: Pose) -> Array:
        return self.relative(i, j).travel
