"""Drives of speed: the rate of a coordinate of a joint as a function of time

    c' - f(t) = 0

A row of velocity: it asks for no position, so that assembly leaves the coordinate free. Its multiplier is minus the
driving force or moment along the coordinate.
"""

from collections.abc import Callable, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._system._names import Names, index_of
from .._tools._module import Numbers, check_word
from .._tools._value import AbstractModule
from ._coordinate import Coordinate, Place
from ._frame import AbstractFrame, AbstractPose
from ._joints._base import Row
from ._law_of_time import check_law, law_of_time
from ._stack import Stack, indices


class SpeedDriver(AbstractModule):
    """A speed that a coordinate of a joint has, whatever its position. Stands among `couplers`.

    Its multiplier "name.speed" is minus the driving moment, N m, or force, N, along the coordinate.

    ??? example

        ```python
        rx.SpeedDriver("motor", "hinge.angle", 2.0)  # 2 rad/s
        rx.SpeedDriver("feed", "guide.travel", rx.Polynomial([0.0, 0.1]))  # 0.1 m/s^2 from rest
        ```

    **Arguments:**

    - `name`: the row is called "name.speed".
    - `coordinate`: name of the coordinate, such as "hinge.angle" or "guide.travel".
    - `speed`: number, or function of time in jax.numpy, rad/s or m/s; `Polynomial` for one with parameters that compile
      nothing new.
    """

    name: str = eqx.field(static=True)
    coordinate: str = eqx.field(static=True)
    speed: Callable[[Array], Array]

    def __init__(self, name: str, coordinate: str, speed: Callable[[Array], Array] | Numbers):
        check_word("name", name)
        check_word("coordinate", coordinate)
        self.name, self.coordinate, self.speed = name, coordinate, law_of_time(speed, "speed")
        check_law("speed", name, self.speed)


class DrivenSpeed(AbstractModule):
    """One of them among the rows of a mechanism: row, and columns of both bodies, of which those beyond the last are of
    the ground."""

    driven: Coordinate
    speed: Callable[[Array], Array]
    rows: Int[Array, " 1"]
    columns: Int[Array, "1 columns"]

    def residuals(self, joints: Sequence[Stack], bodies: AbstractPose) -> Float[Array, "1 1"]:
        """None: it asks for no position."""
        return jnp.zeros_like(self.driven.value(joints, bodies))[:, None]

    def missed(
        self, joints: Sequence[Stack], bodies: AbstractPose, qd: Float[Array, " n"], t: Array, u: Array | None
    ) -> Float[Array, "1 1"]:
        """c' - f(t) u."""
        rate = self.slopes(joints, bodies) * qd.at[self.columns].get(mode="fill", fill_value=0.0)
        return jnp.sum(rate, axis=1, keepdims=True) - self.speed(t) * (1.0 if u is None else u)

    def slopes(self, joints: Sequence[Stack], bodies: AbstractPose) -> Float[Array, "1 columns"]:
        """Derivatives of c by the velocities of both bodies."""
        return self.driven.slopes(joints, bodies)

    def bodies(self, joints: Sequence[Stack]) -> np.ndarray:
        """Both bodies, (1, 2); concrete values."""
        return self.driven.bodies(joints)

    def words(self, names: Names, joints: Sequence[Stack]) -> list[tuple[str, str, str]]:
        """Name, kind and coordinate."""
        what = joints[self.driven.kind].element.coordinate_kinds[self.driven.column][0]
        joint = names.joints[self.driven.kind][int(np.asarray(self.driven.members)[0])]
        return [
            (names.rows.labels[int(np.asarray(self.rows)[0])].removesuffix(".speed"), "SpeedDriver", f"{joint}.{what}")
        ]


class SpeedRow:
    """What a drive of speed is among the rows of a mechanism."""

    pushing, one_sided, velocity_rows = (), False, ("speed",)

    def __init__(self, driver: SpeedDriver, places: dict[str, Place]):
        index_of("coordinate", driver.coordinate, list(places), " of joint coordinates")
        self.name = driver.name
        kind = "moment" if places[driver.coordinate][3] == "angular" else "force"
        self.row_kinds: tuple[Row, ...] = (("speed", kind),)


def driven_speeds(
    drivers: Sequence[SpeedDriver],
    places: dict[str, Place],
    rows: Sequence[int],
    joints: Sequence[Stack],
    frame: AbstractFrame,
    count: int,
) -> tuple[DrivenSpeed, ...]:
    """Drives of speed at the given rows of a mechanism of `count` bodies."""
    found = []
    for driver, row in zip(drivers, rows, strict=True):
        stack, column, member, _ = places[driver.coordinate]
        driven = Coordinate(stack, column, indices([member]))
        columns = indices(driven.columns(joints, frame, count))
        found.append(DrivenSpeed(driven, driver.speed, indices([row]), columns))
    return tuple(found)
