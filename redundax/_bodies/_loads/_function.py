"""A load that the user writes as a function of state."""

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from ..._tools._module import as_functions, as_parameters, tracing
from .._body import GROUND, name_of
from .._pose import Motion, Pose
from ._base import AbstractLoad


class AbstractLoadFunction(AbstractLoad):
    """A load by a function, in the plane or in space."""

    i: str = eqx.field(static=True, converter=name_of)
    function: Callable[[Any, Any, Array, PyTree], tuple[Any, Any]] = eqx.field(converter=as_functions)
    j: str = eqx.field(static=True, converter=name_of, default=GROUND)
    parameters: PyTree = eqx.field(converter=as_parameters, default=None)

    @staticmethod
    @abc.abstractmethod
    def still() -> Any:
        """A motion on which the function is tried."""

    def __check_init__(self) -> None:
        def trial() -> tuple[Any, Any]:
            return self.wrenches(self.still(), self.still(), jnp.zeros(()))

        with tracing("function"):
            jax.eval_shape(trial)

    def wrenches(self, i: Any, j: Any, t: Array) -> tuple[Any, Any]:
        return self.function(i, j, t, self.parameters)


class LoadFunction(AbstractLoadFunction):
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

    @staticmethod
    def still() -> Motion:
        pose = Pose(jnp.zeros(2), jnp.zeros(()))
        return Motion(pose, pose)
