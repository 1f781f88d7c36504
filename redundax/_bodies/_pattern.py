"""The pattern of a mechanism's Jacobian, from the bodies of its joints and couplers."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._sparse._plan import Plan, plan
from ._coupler import Couplings
from ._frame import AbstractFrame
from ._speed_driver import DrivenSpeed
from ._stack import Stack

LARGE = 2000  # coordinates and rows from which on matrices are sparse: dense ones take seconds a solve there
LARGEST_DENSE = 6000  # coordinates and rows up to which dense ones answer in minutes and a few GB, by cubes and squares


class Pattern:
    """Rows and bodies of the slopes of all joints, then of couplers, in the order in which these are computed.

    `rows` are those of the joints of each stack, (joints, rows); all indices must be known.
    """

    def __init__(
        self,
        joints: Sequence[Stack],
        rows: Sequence[np.ndarray],
        couplers: Sequence[Couplings | DrivenSpeed],
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

    def plan(self, massless: Sequence[bool]) -> Plan:
        """That of its sparse matrices, given which bodies lack mass."""
        return plan(self.owners, (self.row, self.body), self.columns, massless)

    def entries(self) -> np.ndarray:
        """Where the Jacobian, (m, n), finds its entries among the slopes of joints, after a zero."""
        moving = np.flatnonzero(self.body[: self.of_joints] < len(self.columns))
        entries, size = np.zeros((sum(map(len, self.owners)), self.columns.size), int), self.columns.shape[1]
        places = 1 + size * moving[:, None] + np.arange(size)
        entries[self.row[moving][:, None], self.columns[self.body[moving]]] = places
        return entries


def _slopes(rows: np.ndarray, bodies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and body of each."""
    shape = (*rows.shape, bodies.shape[1])
    row, body = (np.broadcast_to(x, shape).ravel() for x in (rows[:, :, None], bodies[:, None]))
    return row, body


def dense(plan: Plan, slopes: Float[Array, "m w s"]) -> Float[Array, "m n"]:
    """The Jacobian whole."""
    row = jnp.arange(len(slopes))[:, None, None]
    return jnp.zeros((len(slopes), plan.columns.size), slopes.dtype).at[row, plan.columns[plan.body]].add(slopes)
