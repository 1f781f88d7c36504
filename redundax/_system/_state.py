"""The known state (q, qd, t) at which the index-1 equations (7), (25) are solved."""

from collections.abc import Iterable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, PyTree

from .._tools._errors import RedundaxError
from .._tools._module import Numbers, as_float, check_kind, is_concrete
from .._tools._numbers import Numeric
from .._tools._table import are_known, figures, group, page
from .._tools._value import AbstractModule
from ._results import RESULTS, first_failure

_SEVERAL = "Give a list of them, or `Trajectory.states`."
_BY_NAME = "by name and with units: print(mechanism.table(state))"


class State(AbstractModule):
    """Position, velocity and time.

    ??? example

        ```python
        rx.State(q=[0.0, -1.0], qd=[0.5, 0.0])
        ```

    **Arguments:**

    - `q`: coordinates, in the units of the system; planar mechanisms have x and y of every body first, then
      all angles, Eq. (60). Mechanisms in space have x, y and z of every centre of mass first, then the quaternion
      (w, x, y, z) of every body, which takes its axes to the global ones: shape (7 bodies,). Quaternions have no names.
    - `qd`: velocities, shape (n,); for planar mechanisms the time derivative of `q`. In space velocities of all centres
      of mass first, in global components, then the angular velocity of every body about its own axes: "door.x'" and
      "door.phi_x'" in results, shape (6 bodies,).
    - `t`: time.
    - `memory`: internal states of friction laws that have some, one entry for each friction group;
      zero if not given.

    Its `result` says whether `assemble` found it, sample by sample of a batch. Of several states, each array with an
    axis for them in front, `states[1:-1]` and `states[0]` are some, and one.
    """

    q: Float[Array, "..."]
    qd: Float[Array, "..."]
    t: Float[Array, "..."]
    memory: tuple[PyTree, ...]

    def __init__(self, q: Numbers, qd: Numbers, t: ArrayLike = 0.0, memory: tuple[PyTree, ...] = ()):
        self.q, self.qd = as_float(q, "q"), as_float(qd, "qd")
        self.t = as_float(t, "t").astype(self.qd.dtype)
        self.memory = memory

    def __getitem__(self, which: Numeric | slice) -> "State":
        """Of several states those at some places along their first axis, as of an array."""
        if self.t.ndim == 0 or isinstance(which, str | tuple) or which is Ellipsis:
            raise RedundaxError(
                f"A `State` has its entries in `q`, `qd` and `t`, but is asked for [{which!r}]. Ask a solution or "
                "`system.table(state)` for names; places are those of several states, with an axis for them in front."
            )
        places = np.arange(len(self.t))[which] if is_concrete(which) else which
        return jax.tree.map(lambda x: x[places], self)

    @property
    def result(self) -> RESULTS:
        """`RESULTS.successful`, `no_position` or `no_velocity`: what is NaN of those of a batch.

        It is read off the numbers, and no field of its own: states that are built, stacked, mapped over or
        differentiated hold numbers alone, whoever made them.
        """

        def of_one(q: Array, qd: Array) -> RESULTS:
            found, moves = (jnp.all(jnp.isfinite(x)) for x in (q, qd))
            return first_failure(((found, RESULTS.no_position), (moves, RESULTS.no_velocity)))

        for _ in self.qd.shape[:-1]:
            of_one = jax.vmap(of_one)
        return of_one(self.q, self.qd)

    def __repr__(self) -> str:
        return f"{eqx.tree_pformat(self)}; {_BY_NAME}"

    def __str__(self) -> str:
        """A table without names, which `system.table(state)` has; shapes of several, and inside of transformations."""
        if not are_known((self.q, self.qd, self.t)) or self.q.ndim != 1 or self.q.shape != self.qd.shape:
            return eqx.tree_pformat(self)
        labels = [str(k) for k in range(self.q.size)]
        rows = group(("", "position", "velocity"), labels, *(figures(np.asarray(x)) for x in (self.q, self.qd)))
        head = f"State at t = {self.t:.6g}; {_BY_NAME}"
        return "\n".join([head, *page([rows], [], "All of them: state.q and state.qd")])


def states_of(states: State | Sequence[State]) -> list[State]:
    """Successive states, from a sequence, or the finite ones of a `State` with an axis for them in front."""
    if not isinstance(states, State):
        check_kind("states", states, Iterable, "states", _SEVERAL)
        each = list(states)
        for state in each:
            check_kind("states", state, State, "states alone", _SEVERAL)
        return _some(each)
    if states.qd.ndim != 2 or not states.q.shape[:1] == states.t.shape == states.qd.shape[:1]:
        raise RedundaxError(
            "Argument `states` must hold several states, each array with an axis for them in front, but has `q` of "
            f"shape {states.q.shape}, `qd` of {states.qd.shape} and `t` of {states.t.shape}. "
            "Use `Trajectory.states`, or the call for one state."
        )
    count = len(states.t)
    finite = [np.all(np.isfinite(x.reshape(count, -1)), axis=1) for x in (states.q, states.qd, states.t)]
    return _some([jax.tree.map(lambda x, k=k: x[k], states) for k in np.flatnonzero(np.all(finite, axis=0)).tolist()])


def _some(states: list[State]) -> list[State]:
    if not states:
        raise RedundaxError("Argument `states` must hold finite states, but has none. Simulate longer, or give states.")
    return states
