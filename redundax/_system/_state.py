"""The known state (q, qd, t) at which the index-1 equations (7), (25) are solved."""

import equinox as eqx
from jax.typing import ArrayLike
from jaxtyping import Array, Float, PyTree

from .._tools._module import Numbers, as_float


class State(eqx.Module):
    """Position, velocity and time.

    ??? example

        ```python
        rx.State(q=[0.0, -1.0], qd=[0.5, 0.0])
        ```

    **Arguments:**

    - `q`: coordinates, in the units of the system; planar mechanisms have x and y of every body first, then
      all angles, Eq. (60).
    - `qd`: velocities, shape (n,); for planar mechanisms the time derivative of `q`.
    - `t`: time.
    - `memory`: internal states of friction laws that have some, one entry for each friction group;
      zero if not given.
    """

    q: Float[Array, "..."]
    qd: Float[Array, "..."]
    t: Float[Array, "..."]
    memory: tuple[PyTree, ...]

    def __init__(self, q: Numbers, qd: Numbers, t: ArrayLike = 0.0, memory: tuple[PyTree, ...] = ()):
        self.q, self.qd = as_float(q), as_float(qd)
        self.t = as_float(t).astype(self.qd.dtype)
        self.memory = memory
