"""Distance of two points in space: |p_i - p_j| - f(t) = 0, with a constant f a massless rod; or told alone."""

from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...._tools._errors import RedundaxError
from ...._tools._module import Numbers, as_float, safe_norm
from ..._friction_model import AbstractFrictionModel
from ..._joints._base import Row
from ..._law_of_time import check_distance, law_of_time
from .._body import Body
from .._placement import between_points
from .._pose import Pose
from ._base import AbstractJoint, refuse_friction


class AbstractSpan(AbstractJoint):
    """Two points and their distance."""

    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    point_i: Float[Array, "3"]
    point_j: Float[Array, "3"]

    def between(self, i: Pose, j: Pose) -> Array:
        """Their distance, shape (1,)."""
        return safe_norm(i.point(self.point_i) - j.point(self.point_j))[None]


class Span(AbstractSpan):
    """Two points whose distance nothing holds but a coupler: a part of a rope that runs over pulleys."""

    row_kinds: ClassVar[tuple[Row, ...]] = ()

    def __init__(self, name: str, i: str, j: str, on_i: Numbers, on_j: Numbers, distance: Numbers):
        del distance  # in the reference pose
        self.name, self.i, self.j = name, i, j
        self.point_i, self.point_j = as_float(on_i), as_float(on_j)

    @property
    def coordinate_kinds(self) -> tuple[Row, ...]:
        return (("distance", "linear"),)

    def coordinates(self, i: Pose, j: Pose) -> Array:
        return self.between(i, j)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return jnp.zeros(0)


class AbstractDistance(AbstractSpan):
    """A joint of two points whose distance is given: no coordinate, as its name is that of the row."""

    row_kinds: ClassVar[tuple[Row, ...]] = (("distance", "force"),)
    distance: Callable[[Array], Array]

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point_i: Numbers | None = None,
        point_j: Numbers | None = None,
        distance: Callable[[Array], Array] | Numbers | None = None,
        *,
        on_i: Numbers | None = None,
        on_j: Numbers | None = None,
        friction: AbstractFrictionModel | None = None,
    ):
        refuse_friction(name, friction)
        place = between_points(name, i, j, (point_i, point_j, on_i, on_j))
        self.name, self.i, self.j = name, place.i, place.j
        self.point_i, self.point_j = place.on_i.point, place.on_j.point
        if distance is None:
            if point_i is None or point_j is None:
                raise RedundaxError(
                    f"Argument `distance` of joint '{name}' must be given where its points are given in local "
                    "frames, but is None. Give a length."
                )
            distance = safe_norm(as_float(point_i) - as_float(point_j))
        self.distance = law_of_time(distance, "distance")
        check_distance(name, self.distance)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return self.between(i, j) - self.distance(t)


class Distance(AbstractDistance):
    """A rod between two points, or a driver of their distance. Its multiplier is the tension of the rod, N.

    ??? example

        ```python
        plate = rx.spatial.Body("plate", 2.0, inertia=(0.1, 0.1, 0.2))
        rx.spatial.Distance("rod", plate, "ground", (0.5, 0.0, 0.0), (0.5, 0.0, 1.0))  # as long as they are apart
        ```

    **Arguments:**

    - `name`: the row is called "name.distance".
    - `i`, `j`: the bodies, or "ground"; their names do where `on_i` and `on_j` are given.
    - `point_i`, `point_j`: the points, global, m, at the reference pose of the bodies; they must not coincide.
    - `distance`: m, a number or a function of time in jax.numpy; that of the points if not given.
    - `on_i`, `on_j`: in place of the points those in the local frames, m; `distance` must be given then.
    - `friction`: it has none.
    """

    __init__ = AbstractDistance.__init__


class Cable(AbstractDistance):
    """A cable without mass between two points: it pulls where it is taut, and is slack where they are nearer.

    Its multiplier is its tension, N, positive or zero; `solve` tells in `contacts` whether it carries.

    ??? example

        ```python
        plate = rx.spatial.Body("plate", 2.0, inertia=(0.1, 0.1, 0.2))
        rx.spatial.Cable("rope", plate, "ground", (0.5, 0.0, 0.0), (0.5, 0.0, 1.0))  # taut
        ```

    **Arguments:** those of a `Distance`, which is its length.
    """

    pushing: ClassVar[tuple[str, ...]] = ("distance",)
    __init__ = AbstractDistance.__init__

    @property
    def one_sided(self) -> bool:
        return True
