"""A force and a moment on one body in space, fixed in the global frame or following the body."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...._tools._module import Numbers
from ..._body import GROUND, name_of
from .._body import Body
from .._frame import SPACE
from .._placement import Placement, placed
from .._pose import Motion, Wrench
from ._base import AbstractLoad


class AppliedForce(AbstractLoad):
    """A constant force at a point of a body in space, and a moment.

    ??? example

        ```python
        door = rx.spatial.Body("door", 20.0, inertia=(6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0))
        rx.spatial.AppliedForce(door, force=(0.0, 30.0, 0.0), point=(0.9, 0.0, 1.0))  # at the handle
        rx.spatial.AppliedForce("door", moment=(0.0, 0.0, 2.0), follows=True)
        ```

    **Arguments:**

    - `i`: the body; its name does where `point` is not given.
    - `force`, `moment`: N and N m, global components, or those along the axes of the body where `follows` is set.
    - `point`: point of action, global, m, at the reference pose of the body.
    - `on_i`: in place of it that in the local frame, m; the body's origin if neither is given.
    - `follows`: whether force and moment turn with the body.
    """

    i: str = eqx.field(static=True)
    force: Float[Array, "3"]
    point: Float[Array, "3"]
    moment: Float[Array, "3"]
    follows: bool = eqx.field(static=True)
    j: str = eqx.field(static=True)

    def __init__(
        self,
        i: Body | str,
        force: Numbers = (0.0, 0.0, 0.0),
        *,
        point: Numbers | None = None,
        moment: Numbers = (0.0, 0.0, 0.0),
        on_i: Numbers | None = None,
        follows: bool = False,
    ):
        if point is None and on_i is None:
            on_i = (0.0, 0.0, 0.0)
        owner = f"AppliedForce on '{name_of(i)}'"
        given, own = (
            None if p is None else Placement(SPACE.vector(argument, p, owner))
            for argument, p in (("point", point), ("on_i", on_i))
        )
        place = placed("AppliedForce", i, GROUND, (given, given), (own, own), "load")
        self.i, self.j, self.point = place.i, place.j, place.on_i.point
        self.force, self.moment = SPACE.vector("force", force, owner), SPACE.vector("moment", moment, owner)
        self.follows = follows

    def wrenches(self, i: Motion, j: Motion, t: Array) -> tuple[Wrench, Wrench]:
        force, moment = (i.pose.rotate(v) if self.follows else v for v in (self.force, self.moment))
        wrench, none = i.wrench(force, self.point), jnp.zeros_like(force)
        return Wrench(force, wrench.moment + moment), Wrench(none, none)
