"""Pairs of bodies that hold all, and nothing."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from ..._body import name_of
from ..._joints._base import Row
from .._pose import Pose
from ._base import AbstractJoint, AbstractPlacedJoint
from ._rows import AXIAL, BEND, RADIAL, TWIST


class Fixed(AbstractPlacedJoint):
    """Two bodies as one. Rows radial_1, radial_2, axial, bend_1, bend_2, twist.

    ??? example

        ```python
        plate = rx.spatial.Body("plate", 2.0, inertia=(0.1, 0.1, 0.2))
        rx.spatial.Fixed("weld", plate, "ground", point=(0.0, 0.0, 0.0))
        ```
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (*RADIAL, AXIAL, *BEND, TWIST)
    free_axes: ClassVar[str] = "all"
    __init__ = AbstractPlacedJoint.__init__

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        relative = self.relative(i, j)
        return jnp.concatenate([relative.offset, relative.rotation])


class Free(AbstractJoint):
    """No hold at all: a body that floats. It has no rows.

    ??? example

        ```python
        ball = rx.spatial.Body("ball", 0.4, inertia=(1e-3, 1e-3, 1e-3))
        rx.spatial.Free("flight", ball, "ground")
        ```

    **Arguments:**

    - `name`: any word.
    - `i`, `j`: the body that floats, and any other or "ground"; their names do.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = ()
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True, converter=name_of)
    j: str = eqx.field(static=True, converter=name_of)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return jnp.zeros(0)
