"""Driving constraints and laws of motion

    phi_i - phi_j - f(t) = 0,   |r_i + R_i s_i - r_j - R_j s_j| - f(t) = 0                    (2)

The multiplier is minus the driving moment on body i, or the tension between the two points.
"""

from collections.abc import Callable
from functools import partial
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from ..._tools._module import safe_norm
from .._body import name_of
from .._law_of_time import check_distance, check_law, law_of_time
from .._pose import Pose
from ._base import AbstractJoint, AbstractPointJoint, Row


class AngleDriver(AbstractJoint[Pose]):
    """Driving constraint (2), phi_i - phi_j = f(t). Its multiplier is minus the driving moment on body i, N m.

    ??? example

        ```python
        rx.AngleDriver("motor", "crank", "ground", rx.Polynomial([0.5, 2.0]))  # phi = 0.5 + 2 t
        ```

    **Arguments:**

    - `name`: the row is called "name.angle".
    - `i`, `j`: names of the bodies, or "ground".
    - `angle`: number, or function of time in jax.numpy, rad; `Polynomial` for one with parameters that compile nothing
      new.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("angle", "moment"),)
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True, converter=name_of)
    j: str = eqx.field(static=True, converter=name_of)
    angle: Callable[[Array], Array] = eqx.field(converter=partial(law_of_time, argument="angle"))

    def __check_init__(self) -> None:
        check_law("angle", self.name, self.angle)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return jnp.stack([i.phi - j.phi - self.angle(t)])


class AbstractDistance(AbstractPointJoint):
    """A joint of two points whose distance is given."""

    row_kinds: ClassVar[tuple[Row, ...]] = (("distance", "force"),)
    distance: Callable[[Array], Array] = eqx.field(converter=partial(law_of_time, argument="distance"))

    def __check_init__(self) -> None:
        check_distance(self.name, self.distance)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return jnp.stack([safe_norm(i.point(self.point_i) - j.point(self.point_j)) - self.distance(t)])


class DistanceDriver(AbstractDistance):
    """Driving constraint (2) on the distance of two points; with a constant law a massless rod.

    Its multiplier is the tension that holds the points together, N.

    ??? example

        ```python
        rx.DistanceDriver("rod", "lever", "ground", (0.2, 0.0), (0.0, 1.0), 0.6)
        ```

    **Arguments:**

    - `name`: the row is called "name.distance".
    - `i`, `j`: names of the bodies, or "ground".
    - `point_i`, `point_j`: the points in the local frames, m; they must not coincide.
    - `distance`: number, or function of time in jax.numpy, m; `Polynomial` for one with parameters that compile
      nothing new.
    """


class Cable(AbstractDistance):
    """A cable without mass between two points: it pulls where it is taut, and is slack where they are nearer.

    Its multiplier is its tension, N, positive or zero; `solve` tells in `contacts` whether it carries.

    ??? example

        ```python
        rx.Cable("rope", "lever", "ground", (0.2, 0.0), (0.0, 1.0), 0.6)
        ```

    **Arguments:** those of a `DistanceDriver`; `distance` is its length.
    """

    pushing: ClassVar[tuple[str, ...]] = ("distance",)

    @property
    def one_sided(self) -> bool:
        return True
