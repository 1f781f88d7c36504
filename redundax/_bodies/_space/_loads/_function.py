"""A load in space that the user writes as a function of state."""

import jax.numpy as jnp

from ..._loads._function import AbstractLoadFunction
from .._pose import Motion, Pose, Wrench
from ._base import AbstractLoad


class LoadFunction(AbstractLoadFunction[Motion, Wrench], AbstractLoad):
    """Any load between two bodies in space, written in jnp.

    ??? example

        ```python
        def drag(i, j, t, p):  # of a body in a fluid that turns with another
            return i.wrench(p["c"] * (j.velocity - i.velocity), jnp.zeros(3)), j.wrench(jnp.zeros(3), jnp.zeros(3))

        rx.spatial.LoadFunction("rotor", drag, "case", {"c": 20.0})
        ```

    **Arguments:**

    - `i`, `j`: the bodies or their names; the ground if `j` is not given.
    - `function`: `(motion_i, motion_j, t, parameters) -> (wrench_i, wrench_j)` with `rx.spatial.Motion` and
      `rx.spatial.Wrench`: forces and moments about the bodies' origins, global components.
    - `parameters`: any pytree; its numbers become arrays.
    """

    @staticmethod
    def still() -> Motion:
        return Motion(Pose(jnp.zeros(3), jnp.eye(3), jnp.zeros(3)), jnp.zeros(3), jnp.zeros(3))
