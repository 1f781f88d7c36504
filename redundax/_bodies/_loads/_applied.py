"""A force and a moment on one body, fixed in the global frame or following the body."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._tools._module import figure, one_number, part
from .._body import GROUND, name_of
from .._pose import Motion, Wrench
from ._base import AbstractLoad


class AppliedForce(AbstractLoad[Motion, Wrench]):
    """A constant force at a point of a body, and a moment.

    ??? example

        ```python
        rx.AppliedForce("lever", force=(0.0, -10.0), point=(0.2, 0.0))
        rx.AppliedForce("crank", moment=2.0)
        ```

    **Arguments:**

    - `i`: name of the body.
    - `force`: N, in global components, or in those of the body where `follows` is set.
    - `point`: point of action in the local frame, m.
    - `moment`: N m.
    - `follows`: whether the force turns with the body.
    """

    vectors: ClassVar[tuple[str, ...]] = ("force", "point")
    i: str = eqx.field(static=True, converter=name_of)
    force: Float[Array, "2"] = eqx.field(converter=figure("force"), default=(0.0, 0.0))
    point: Float[Array, "2"] = eqx.field(converter=figure("point"), default=(0.0, 0.0))
    moment: Float[Array, ""] = eqx.field(converter=figure("moment"), default=0.0)
    follows: bool = eqx.field(static=True, default=False)
    j: str = eqx.field(static=True, converter=name_of, default=GROUND)

    def __check_init__(self) -> None:
        with part(f"{type(self).__name__} on '{self.i}'"):
            one_number("moment", self.moment)

    def wrenches(self, i: Motion, j: Motion, t: Array) -> tuple[Wrench, Wrench]:
        wrench = i.wrench(i.pose.rotate(self.force) if self.follows else self.force, self.point)
        moment = wrench.moment + self.moment
        return Wrench(wrench.force, moment), Wrench(jnp.zeros_like(wrench.force), jnp.zeros_like(moment))
