"""Friction as slip plus law.

    F = E tau,   E = (ds/dq)^T,   tau = law(rho, rate, sense),   rho = lam[rows]          (25), (41), (42)

A friction group has slips s(q, t), one for each friction force or moment tau, and a law that reads a few
multipliers rho of its own joint. The sense of slip is an argument of the law, not a sgn inside it, so that
a joint at rest can be asked for either sense. F acts on the system as written in (25); a dissipative law has
the sign of tau opposite to the sense.
"""

import abc
from collections.abc import Callable, Sequence
from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from ._axis import Axis
from ._module import Numbers, as_functions, as_parameters, replace
from ._state import State


class AbstractFriction(eqx.Module):
    """One group of friction forces of the same law."""

    rows: eqx.AbstractVar[Int[Array, "..."]]
    slips: eqx.AbstractVar[Axis]

    @property
    @abc.abstractmethod
    def has_sense(self) -> bool:
        """Whether the force depends on the sense of slip, so that it jumps where the slip reverses."""

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
    def largest_change(self, change: Float[Array, "..."]) -> Float[Array, " p"]:
        """Bound of |change of tau| that a change of loads can cause at any loads; infinite where none is known."""

    @abc.abstractmethod
    def anonymous(self) -> Self:
        """The same group without names."""


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
      `rows` and `memory` the law's internal state, `None` unless the state has some.
    - `rows`: indices of the multipliers that the law reads, any shape; empty for friction that does not
      depend on load, Eq. (24).
    - `kinds`: for each slip "linear" if it is a length (tau is a force) or "angular" if it is an angle (a moment).
      An `Axis` gives names too.
    - `parameters`: any pytree; its numbers become arrays.
    """

    rows: Int[Array, "..."]
    parameters: PyTree
    slips: Axis = eqx.field(static=True)
    _slip: Callable[..., Array]
    _force: Callable[..., Array]

    def __init__(
        self,
        slip: Callable[..., Array],
        force: Callable[..., Array],
        rows: Numbers,
        kinds: Axis | Sequence[str],
        parameters: PyTree = None,
    ):
        self._slip, self._force = as_functions(slip), as_functions(force)
        self.rows = jnp.asarray(rows, dtype=int)
        if isinstance(kinds, str):
            raise ValueError(
                f"Argument `kinds` must hold one kind for each slip, as in ['{kinds}'], but is '{kinds}'. "
                "Put it in a list."
            )
        self.slips = kinds if isinstance(kinds, Axis) else Axis(None, tuple(kinds))
        self.slips.check("kinds", ("linear", "angular"))
        self.parameters = as_parameters(parameters)

    @property
    def has_sense(self) -> bool:
        """Taken to be so: what the function does with the sense is not known."""
        return True

    def anonymous(self) -> Self:
        return replace(self, slips=self.slips.anonymous())

    def slip(self, q: Array, t: Array) -> Array:
        return self._slip(q, t, self.parameters)

    def force(self, loads: Array, rate: Array, sense: Array, memory: PyTree, state: State) -> Array:
        return self._force(loads, rate, sense, memory, state, self.parameters)

    def largest_change(self, change: Array) -> Array:
        return jnp.full(len(self.slips), jnp.where(jnp.any(change != 0), jnp.inf, 0.0), change.dtype)


def load_rows(groups: Sequence[AbstractFriction]) -> Int[Array, " l"]:
    """Indices of all multipliers that the laws read, group after group."""
    return jnp.concatenate([group.rows.ravel() for group in groups])


def slip_kinds(groups: Sequence[AbstractFriction]) -> Axis:
    """Names and kinds of all slips, group after group."""
    names = [group.slips.names for group in groups]
    kinds = tuple(kind for group in groups for kind in group.slips.kinds)
    known = all(part is not None for part in names)
    return Axis(tuple(name for part in names for name in part or ()) if known else None, kinds)


def largest_changes(groups: Sequence[AbstractFriction], loads: Float[Array, "l columns"]) -> Float[Array, "p columns"]:
    """Bounds of |change of tau| of all groups from each column of changes of their concatenated loads."""

    def of_one(change: Float[Array, " l"]) -> Float[Array, " p"]:
        out, row = [], 0
        for group in groups:
            out.append(group.largest_change(change[row : row + group.rows.size].reshape(group.rows.shape)))
            row += group.rows.size
        return jnp.concatenate(out)

    return jax.vmap(of_one, in_axes=1, out_axes=1)(loads)


def friction_force(
    groups: Sequence[AbstractFriction],
    loads: Float[Array, " l"],
    rate: Float[Array, " p"],
    sense: Float[Array, " p"],
    state: State,
) -> Float[Array, " p"]:
    """tau of all groups from their concatenated loads, slip rates and senses."""
    out, row, slip = [], 0, 0
    memories = state.memory or (None,) * len(groups)
    for group, memory in zip(groups, memories, strict=True):
        next_row, next_slip = row + group.rows.size, slip + len(group.slips)
        own = _shaped(loads[row:next_row], group.rows.shape)
        out.append(group.force(own, rate[slip:next_slip], sense[slip:next_slip], memory, state))
        row, slip = next_row, next_slip
    return jnp.concatenate(out)


def _shaped(loads: Float[Array, " l"], shape: tuple[int, ...]) -> Float[Array, "..."]:
    """`loads.reshape(shape)`; for joints entry by entry, which XLA sees through where `reshape` stops it."""
    if len(shape) != 2 or 0 in shape:
        return loads.reshape(shape)
    return jnp.stack([loads[k :: shape[1]] for k in range(shape[1])], axis=1)
