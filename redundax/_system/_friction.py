"""Friction as slip plus law.

    F = E tau,   E = (ds/dq)^T,   tau = law(rho, rate, sense),   rho = lam[rows]          (25), (41), (42)

A friction group has slips s(q, t), one for each friction force or moment tau, and a law that reads a few
multipliers rho of its own joint. The sense of slip is an argument of the law, not a sgn inside it, so that
a joint at rest can be asked for either sense. F acts on the system as written in (25); a dissipative law has
the sign of tau opposite to the sense.
"""

import abc
import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from .._tools._errors import RedundaxError
from .._tools._functions import as_functions
from .._tools._module import (
    Numbers,
    as_parameters,
    check_callable,
    figure,
    floats,
    is_concrete,
    replace_fields,
)
from .._tools._numbers import Numeric, known, of_model, xp
from .._tools._value import AbstractModel
from ._axis import Axis, join
from ._state import State


class AbstractFriction(AbstractModel):
    """One group of friction forces of the same law."""

    rows: eqx.AbstractVar[Int[Array, "..."]]
    slips: eqx.AbstractVar[Axis]

    @property
    @abc.abstractmethod
    def has_sense(self) -> bool:
        """Whether the force depends on the sense of slip, so that it jumps where the slip reverses."""

    @property
    def has_direction(self) -> bool:
        """Whether slips of a joint share one friction, along their direction."""
        return False

    @property
    def width(self) -> int:
        """Slips of a joint."""
        return 1

    @property
    def arms(self) -> Float[Array, " p"]:
        """Velocities of the surfaces by unit rates of the slips."""
        return jnp.ones(len(self.slips))

    @property
    def has_convex_limits(self) -> bool:
        """Whether the size of each friction is a constant and a seminorm of its loads: outer bounds rest on it."""
        return False

    @property
    def may_bend(self) -> bool:
        """Whether its force under given loads, or the rate of its internal state, may bend as the state changes."""
        return True

    @abc.abstractmethod
    def slip(self, q: Float[Array, "..."], t: Float[Array, ""]) -> Float[Array, " p"]:
        """Slip coordinates: the relative displacement that each friction force opposes."""

    @abc.abstractmethod
    def force(
        self,
        loads: Float[Array, "..."],
        rate: Float[Array, " p"],
        sense: Float[Array, " p"],
        memory: PyTree,
        state: State,
    ) -> Float[Array, " p"]:
        """Friction forces or moments tau from the multipliers `lam[rows]`, slip rates, senses and internal state."""

    @abc.abstractmethod
    def largest_change(
        self, change: Float[Array, "..."], rate: Float[Array, " p"], memory: PyTree, state: State
    ) -> Float[Array, " p"]:
        """Bound of |change of tau| that a change of loads can cause at any loads; infinite where none is known."""

    @abc.abstractmethod
    def memory_size(self) -> PyTree:
        """Sizes of the internal state, which starts at zero; `None` without one."""

    @abc.abstractmethod
    def memory_rate(self, rate: Float[Array, " p"], memory: PyTree, state: State) -> PyTree:
        """Rate of change of the internal state; `None` without one."""

    @property
    @abc.abstractmethod
    def anonymous(self) -> Self:
        """The same group without names."""

    def apart(self, memory: PyTree) -> tuple[tuple["AbstractFriction", PyTree], ...]:
        """The group as smaller ones, each with its memory, in the order of the slips."""
        return ((self, memory),)


class Friction(AbstractFriction):
    """A friction group from functions that the user writes in jnp.

    An opaque generalised force F(lam, q, qd) is the case `slip=lambda q, t, p: q`, `rows=jnp.arange(m)`.

    ??? example

        ```python
        def drag(loads, rate, sense, memory, state, p):  # of the sum of two loads
            return -p["mu"] * jnp.sum(jnp.abs(loads)) * sense

        rx.Friction(lambda q, t, p: q[:1], drag, rows=[0, 1], kinds=["linear"], parameters={"mu": 0.1})
        ```

    **Arguments:**

    - `slip`: `(q, t, parameters) -> (p,)`.
    - `force`: `(loads, rate, sense, memory, state, parameters) -> (p,)`, with `loads = lam[rows]` in the shape of
      `rows` and `memory` the law's internal state, if it has one.
    - `rows`: indices of the multipliers that the law reads, any shape; empty for friction that does not
      depend on load, Eq. (24).
    - `kinds`: for each slip "linear" if it is a length (tau is a force) or "angular" if it is an angle (a moment).
      An `Axis` gives names too.
    - `parameters`: any pytree; its numbers become arrays.
    - `memory`: sizes of the internal state, which starts at zero: any pytree.
    - `memory_rate`: `(rate, memory, state, parameters) -> pytree`, the rate of change of the internal state.
    """

    rows: Int[Array, "..."]
    parameters: PyTree
    slips: Axis = eqx.field(static=True)
    _slip: Callable[..., Array]
    _force: Callable[..., Array]
    _memory: PyTree
    _memory_rate: Callable[..., PyTree] | None

    def __init__(
        self,
        slip: Callable[..., Array],
        force: Callable[..., Array],
        rows: Numbers,
        kinds: Axis | Sequence[str],
        parameters: PyTree = None,
        *,
        memory: PyTree = None,
        memory_rate: Callable[..., PyTree] | None = None,
    ):
        check_callable("slip", slip)
        check_callable("force", force)
        self._slip, self._force, self._memory_rate = map(as_functions, (slip, force, memory_rate))
        self._memory = jax.tree.map(figure("memory"), memory)
        if (memory is None) != (memory_rate is None):
            raise RedundaxError(
                "Arguments `memory` and `memory_rate` must be given together, but one is None. "
                "Give the sizes of the internal state and its rate of change."
            )
        given = floats(rows, "rows")
        if is_concrete(given) and np.any(given != np.round(given)):
            raise RedundaxError(
                f"Argument `rows` must hold indices of multipliers, but holds {given.tolist()}. Give whole numbers."
            )
        self.rows = jnp.asarray(rows, dtype=int)
        if isinstance(kinds, str) or not isinstance(kinds, Axis | Iterable):
            raise RedundaxError(
                f"Argument `kinds` must hold one kind for each slip, as in ['linear'], but is {kinds!r}. Give a list."
            )
        self.slips = kinds if isinstance(kinds, Axis) else Axis(None, tuple(kinds))
        self.slips.check("kinds", ("linear", "angular"))
        self.parameters = as_parameters(parameters)

    @property
    def has_sense(self) -> bool:
        """Taken to be so: what the function does with the sense is not known."""
        return True

    @property
    def anonymous(self) -> Self:
        return replace_fields(self, slips=self.slips.anonymous)

    def slip(self, q: Array, t: Array) -> Array:
        return self._slip(q, t, self.parameters)

    def force(self, loads: Array, rate: Array, sense: Array, memory: PyTree, state: State) -> Array:
        return self._force(loads, rate, sense, memory, state, self.parameters)

    def memory_size(self) -> PyTree:
        return self._memory

    def memory_rate(self, rate: Array, memory: PyTree, state: State) -> PyTree:
        return None if self._memory_rate is None else self._memory_rate(rate, memory, state, self.parameters)

    def largest_change(self, change: Array, rate: Array, memory: PyTree, state: State) -> Array:
        return jnp.full(len(self.slips), jnp.where(jnp.any(change != 0), jnp.inf, 0.0), change.dtype)


def load_rows(groups: Sequence[AbstractFriction]) -> Int[Array, " l"]:
    """Indices of all multipliers that the laws read, group after group."""
    return xp.concatenate([known(group.rows).ravel() for group in groups])


def slip_kinds(groups: Sequence[AbstractFriction]) -> Axis:
    """Names and kinds of all slips, group after group."""
    return join([group.slips for group in groups])


def memories(groups: Sequence[AbstractFriction], state: State) -> tuple[PyTree, ...]:
    """Internal states of all groups at a state, zero if it holds none."""
    if state.memory and len(state.memory) != len(groups):
        raise RedundaxError(
            f"Argument `state` must have a memory for each of {len(groups)} friction groups, but has "
            f"{len(state.memory)}. Leave `memory` out to start from zero."
        )
    return state.memory or tuple(jax.tree.map(jnp.zeros_like, group.memory_size()) for group in groups)


def memory_rates(groups: Sequence[AbstractFriction], rate: Float[Array, " p"], state: State) -> tuple[PyTree, ...]:
    """Rates of change of the internal states of all groups."""
    parts = zip(groups, _by_group(groups, rate), memories(groups, state), strict=True)
    return tuple(group.memory_rate(own, memory, state) for group, own, memory in parts)


def _by_group(groups: Sequence[AbstractFriction], slips: Float[Array, " p"]) -> list[Float[Array, "..."]]:
    """One entry for each slip as one part for each group."""
    ends = np.cumsum([0, *(len(group.slips) for group in groups)])
    return [slips[first:last] for first, last in itertools.pairwise(ends)]


@of_model
def largest_changes(
    groups: Sequence[AbstractFriction], loads: Float[Numeric, "l columns"], rate: Float[Numeric, " p"], state: State
) -> Float[Numeric, "p columns"]:
    """Bounds of |change of tau| of all groups from each column of changes of their concatenated loads."""

    def of_one(change: Float[Array, " l"]) -> Float[Array, " p"]:
        out, row = [], 0
        for group, own, memory in zip(groups, _by_group(groups, rate), memories(groups, state), strict=True):
            part = change[row : row + group.rows.size].reshape(group.rows.shape)
            out.append(group.largest_change(part, own, memory, state))
            row += group.rows.size
        return jnp.concatenate(out)

    return jax.vmap(of_one, in_axes=1, out_axes=1)(loads)


def have_sense(groups: Sequence[AbstractFriction]) -> tuple[bool, ...]:
    """For each slip whether its friction depends on the sense."""
    return tuple(group.has_sense for group in groups for _ in group.slips.kinds)


def have_direction(groups: Sequence[AbstractFriction]) -> np.ndarray:
    """For each slip whether it is one of several whose friction is along their direction, and jumps with it."""
    found = [group.has_direction and group.has_sense for group in groups for _ in group.slips.kinds]
    return np.array(found, bool)


@eqx.filter_jit  # traced once for all iterations and derivatives in all programs
def friction_force(
    groups: Sequence[AbstractFriction],
    loads: Float[Array, " l"],
    rate: Float[Array, " p"],
    sense: Float[Array, " p"],
    state: State,
    memory: Sequence[PyTree] | None = None,
) -> Float[Array, " p"]:
    """tau of all groups from their concatenated loads, rates and senses; `memory` is that of `state` if not given."""
    out, row = [], 0
    parts = _by_group(groups, rate), _by_group(groups, sense), memories(groups, state) if memory is None else memory
    for group, own_rate, own_sense, own_memory in zip(groups, *parts, strict=True):
        own = _shaped(loads[row : row + group.rows.size], group.rows.shape)
        out.append(group.force(own, own_rate, own_sense, own_memory, state))
        row += group.rows.size
    return jnp.concatenate(out)


def _shaped(loads: Float[Array, " l"], shape: tuple[int, ...]) -> Float[Array, "..."]:
    """`loads.reshape(shape)`; for joints entry by entry, which XLA sees through where `reshape` stops it."""
    if len(shape) != 2 or 0 in shape:
        return loads.reshape(shape)
    return jnp.stack([loads[k :: shape[1]] for k in range(shape[1])], axis=1)
