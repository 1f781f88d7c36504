"""The pattern of a mechanism's Jacobian, from the bodies of its joints and couplers."""

from collections.abc import Callable, Sequence
from typing import Protocol, Self, TypeAlias, TypeVar, runtime_checkable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from .._sparse._symbolic import Symbolic, symbolic
from .._system._system import AbstractSystem
from .._tools._compilation import is_loopless
from .._tools._errors import RedundaxError
from .._tools._module import tree_take
from .._tools._value import AbstractModule
from ._coupler import Couplings
from ._frame import AbstractFrame
from ._speed_driver import DrivenSpeed
from ._stack import Stack, indices

Mechanism = TypeVar("Mechanism", bound="_Storable")
Coupled: TypeAlias = Couplings | DrivenSpeed

LARGE = 2000  # coordinates and rows from which on matrices are sparse: dense ones take seconds a solve there
LARGEST_DENSE = 6000  # coordinates and rows up to which dense ones answer in minutes and a few GB, by cubes and squares


@runtime_checkable
class _Storable(Protocol):
    def sparse(self, is_sparse: bool = True) -> Self: ...


class Pattern:
    """Rows and bodies of the slopes of all joints, then of couplers, in the order in which these are computed.

    `rows` are those of the joints of each stack, (joints, rows); all indices must be known.
    """

    def __init__(
        self,
        joints: Sequence[Stack],
        rows: Sequence[np.ndarray],
        couplers: Sequence[Coupled],
        frame: AbstractFrame,
        count: int,
    ):
        bodies = [np.stack([np.asarray(stack.i), np.asarray(stack.j)], axis=1) for stack in joints]
        pairs = list(zip(rows, bodies, strict=True))
        pairs += [(np.asarray(each.rows)[:, None], each.bodies(joints)) for each in couplers]
        self.owners = [own for rows, _ in pairs for own in rows]
        slopes = [_slopes(*pair) for pair in pairs]
        self.row, self.body = (np.concatenate(part) for part in zip(*slopes, strict=True))
        self.of_joints = sum(row.size for row, _ in slopes[: len(bodies)])
        self.columns = np.array([frame.columns(k, count) for k in range(count)])

    def sparse(self, massless: Sequence[bool]) -> "SparseEntries":
        """Those of sparse matrices, given which bodies lack mass."""
        return SparseEntries(symbolic(self.owners, (self.row, self.body), self.columns, massless))

    def dense(self) -> "DenseEntries":
        """Those of dense matrices."""
        moving = np.flatnonzero(self.body[: self.of_joints] < len(self.columns))
        entries, size = np.zeros((sum(map(len, self.owners)), self.columns.size), int), self.columns.shape[1]
        places = 1 + size * moving[:, None] + np.arange(size)
        entries[self.row[moving][:, None], self.columns[self.body[moving]]] = places
        return DenseEntries(indices(entries))


class DenseEntries(AbstractModule):
    """Where the Jacobian, (m, n), finds its entries among the slopes of joints, after a zero."""

    entries: Int[Array, "m n"]

    @property
    def symbolic(self) -> None:
        """None: nothing is sparse."""
        return None

    def whole(self, mechanism: Mechanism, size: int) -> Mechanism:
        """The mechanism with dense matrices, given how many coordinates and rows it has."""
        return mechanism

    def jacobian(
        self,
        own: Sequence[Array],
        couplers: Sequence[Coupled],
        joints: Sequence[Stack],
        body: PyTree,
        joined: Callable[[Sequence[Array]], Array],
    ) -> Float[Array, "m n"]:
        """The Jacobian, of slopes of joints and of couplers; `joined` is that of joints by products, where programs are
        without loops."""
        if is_loopless() and own:
            jacobian = joined(own)
        else:
            none = jnp.zeros(1, own[0].dtype if own else float)
            jacobian = tree_take(jnp.concatenate([none, *(slope.ravel() for slope in own)]), self.entries)
        for coupled in couplers:
            rows = jacobian.at[coupled.rows[:, None], coupled.columns]
            jacobian = rows.add(coupled.slopes(joints, body), mode="drop")
        return jacobian

    def kinetic_energy(self, mechanism: AbstractSystem, q: Array, qd: Array, t: Array) -> Float[Array, ""]:
        """T, by the mass matrix or by that of each body."""
        return qd @ mechanism.mass(q, t) @ qd / 2


class SparseEntries(AbstractModule):
    """The symbolic factorisation of sparse matrices, which tells where slopes go."""

    symbolic: Symbolic

    def whole(self, mechanism: Mechanism, size: int) -> Mechanism:
        if size > LARGEST_DENSE:
            raise RedundaxError(
                f"Argument `system` must have at most {LARGEST_DENSE} coordinates and rows in all for what dense "
                f"matrices answer, but has {size}. `assemble`, `solve` and `simulate` answer by sparse ones, and "
                "`factorize` tells rank, redundancy, freedom and which multipliers are unique. "
                "`mechanism.sparse(False)` takes dense ones all the same, with much time and memory."
            )
        return mechanism.sparse(False)

    def jacobian(
        self,
        own: Sequence[Array],
        couplers: Sequence[Coupled],
        joints: Sequence[Stack],
        body: PyTree,
        joined: Callable[[Sequence[Array]], Array],
    ) -> Float[Array, "m n"]:
        slopes, columns = self.by_bodies(own, couplers, joints, body), self.symbolic.columns
        row = jnp.arange(len(slopes))[:, None, None]
        return jnp.zeros((len(slopes), columns.size), slopes.dtype).at[row, columns[self.symbolic.body]].add(slopes)

    def by_bodies(
        self, own: Sequence[Array], couplers: Sequence[Coupled], joints: Sequence[Stack], body: PyTree
    ) -> Float[Array, "m w s"]:
        """Slopes by row and body."""
        each = [*own, *(coupled.slopes(joints, body) for coupled in couplers)]
        slopes = jnp.concatenate([slope.reshape(-1, self.symbolic.columns.shape[1]) for slope in each])
        return tree_take(jnp.pad(slopes, ((0, 1), (0, 0))), self.symbolic.source)

    def kinetic_energy(self, mechanism: AbstractSystem, q: Array, qd: Array, t: Array) -> Float[Array, ""]:
        own = qd[self.symbolic.columns]
        return jnp.einsum("bi,bij,bj->", own, mechanism.by_bodies(q, t)[1], own) / 2


def _slopes(rows: np.ndarray, bodies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and body of each."""
    shape = (*rows.shape, bodies.shape[1])
    row, body = (np.broadcast_to(x, shape).ravel() for x in (rows[:, :, None], bodies[:, None]))
    return row, body
