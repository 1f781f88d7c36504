"""A load that the user writes as a function of state."""

import abc
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from ..._tools._errors import RedundaxError
from ..._tools._functions import as_functions
from ..._tools._module import as_parameters, check_kind, check_takes, is_real, part, tracing
from .._body import GROUND, name_of
from .._pose import Motion, Pose, Wrench
from ._base import AbstractLoad, M, W


class AbstractLoadFunction(AbstractLoad[M, W]):
    """A load by a function, in the plane or in space."""

    i: str = eqx.field(static=True, converter=name_of)
    function: Callable[[M, M, Array, PyTree], tuple[W, W]] = eqx.field(converter=as_functions)
    j: str = eqx.field(static=True, converter=name_of, default=GROUND)
    parameters: PyTree = eqx.field(converter=as_parameters, default=None)

    @staticmethod
    @abc.abstractmethod
    def still() -> M:
        """A motion on which the function is tried."""

    def __check_init__(self) -> None:
        with part(f"{type(self).__name__} on '{self.i}'"):
            advice = "Give one of both motions, time and parameters."
            what = "a function"
            check_kind("function", self.function, Callable, what, advice)  # pyright: ignore[reportArgumentType]
            check_takes("function", self.function, "motion_i", "motion_j", "t", "parameters")
        with part(f"{type(self).__name__} on '{self.i}'"), tracing("function"):
            still = self.still(), self.still(), jnp.zeros(())
            given = eqx.filter_eval_shape(lambda i, j, t: self.function(i, j, t, self.parameters), *still)
        force, moment = (len(self.frame.linear),), (len(self.frame.angular),) if len(self.frame.angular) > 1 else ()
        pair = given if isinstance(given, tuple | list) else (given,)
        parts = (("force", force), ("moment", moment))
        if len(pair) != 2 or not all(is_real(getattr(one, name, None), shape) for one in pair for name, shape in parts):
            raise RedundaxError(
                f"Argument `function` of {type(self).__name__} on '{self.i}' must give two wrenches, on i and on "
                f"j, real numbers of shapes {force} and {moment}, but gives something else. Return `i.wrench(force, "
                "point), j.wrench(-force, point)`, say."
            )

    def wrenches(self, i: M, j: M, t: Array) -> tuple[W, W]:
        return jax.tree.map(jnp.asarray, self.function(i, j, t, self.parameters))


class LoadFunction(AbstractLoadFunction[Motion, Wrench]):
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
