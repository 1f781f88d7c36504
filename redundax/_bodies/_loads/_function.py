"""A load that the user writes as a function of state."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from ..._tools._module import as_functions, as_parameters, tracing
from .._body import GROUND, Pose
from ._base import AbstractLoad, Motion, Wrench


class LoadFunction(AbstractLoad):
    """Any load between two bodies, written in jnp.

    ??? example

        ```python
        def magnet(i, j, t, p):  # pulls the origins of two bodies together
            force = p["c"] * (j.pose.r - i.pose.r)
            return i.wrench(force, jnp.zeros(2)), j.wrench(-force, jnp.zeros(2))

        rx.LoadFunction("left", magnet, "right", {"c": 20.0})
        ```

    **Arguments:**

    - `i`, `j`: names of the bodies; the ground if `j` is not given.
    - `function`: `(motion_i, motion_j, t, parameters) -> (wrench_i, wrench_j)` with `Motion` and `Wrench`.
    - `parameters`: any pytree; its numbers become arrays.
    """

    i: str = eqx.field(static=True)
    function: Callable[[Motion, Motion, Array, PyTree], tuple[Wrench, Wrench]] = eqx.field(converter=as_functions)
    j: str = eqx.field(static=True, default=GROUND)
    parameters: PyTree = eqx.field(converter=as_parameters, default=None)

    def __check_init__(self) -> None:
        def trial() -> tuple[Wrench, Wrench]:
            still = Pose(jnp.zeros(2), jnp.zeros(()))
            return self.wrenches(Motion(still, still), Motion(still, still), still.phi)

        with tracing("function"):
            jax.eval_shape(trial)

    def wrenches(self, i: Motion, j: Motion, t: Array) -> tuple[Wrench, Wrench]:
        return self.function(i, j, t, self.parameters)
