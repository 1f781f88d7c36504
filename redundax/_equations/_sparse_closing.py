"""The position problem of an assembly with sparse matrices

The descent of `_sparse_descent` finds where Newton steps begin, by a sparse factor, and the steps are
those of `SparsePseudoinverse`.
"""

from functools import partial
from typing import Self

import equinox as eqx
import jax
from jaxtyping import Array

from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import replace_fields
from .._tools._numbers import custom_jvp, stop_gradient, xp
from ._closing import AbstractClosing, Along, beside, given_values, with_own
from ._kinematics import along_motion, second_order, velocity
from ._pseudoinverse import SparsePseudoinverse, SparseRows, sparse_pseudoinverse, sparse_rows
from ._scaling import Scaling, sparse_scaling
from ._sparse_descent import sparse_descent


class SparseClosing(AbstractClosing):
    """The position problem of a large mechanism."""

    @staticmethod
    def scaling(system: AbstractSystem, state: State) -> Scaling:
        return sparse_scaling(system, *system.by_bodies(state.q, state.t), second_order(system, state)[2])

    def begun(self) -> Self:
        still = stop_gradient(self)
        size = still.scale.size
        reached = sparse_descent(
            still.guess.q,
            lambda q: still.residual_at(q) / size,
            still.rows_at,
            lambda q, d: self.system.retract(q, still.scale.coordinates * (size * d)),
        )
        return replace_fields(self, guess=replace_fields(self.guess, q=_carried(self.guess.q, self.system, reached)))

    def start(self) -> Array:
        return xp.zeros_like(self.guess.qd)

    def moved(self, d: Array) -> Array:
        step = self.scale.coordinates * d
        return self.guess.q + step if self.system.adds else self.system.retract(self.guess.q, step)

    def residual(self, d: Array) -> Array:
        return self.residual_at(self.moved(d))

    def inverse(self, d: Array) -> SparsePseudoinverse:
        violation = xp.max(xp.abs(self.residual(d))) / self.scale.size
        return sparse_pseudoinverse(self.rows_at(self.moved(d)), violation)

    @classmethod
    def along(cls, system: AbstractSystem, state: State, driven: Array) -> Along:
        scale = cls.scaling(system, state)

        def inverse(slopes: Array, violation: Array) -> SparsePseudoinverse:
            return sparse_pseudoinverse(sparse_rows(system, state.q, state.t, scale, slopes), violation)

        return Along(along_motion(system, state), scale, _slopes(system, state, driven), inverse)

    def residual_at(self, q: Array) -> Array:
        """r of a position."""
        given = beside(self.system, given_values(self.system, q, self.guess.t, self.held), self.positions, self.held)
        return xp.concatenate([self.system.constraint(q, self.guess.t), given]) / self.row_scale

    def rows_at(self, q: Array) -> SparseRows:
        """K at a position."""
        given = _slopes(self.system, replace_fields(self.guess, q=q), self.held)
        given = given * self.scale.coordinates / self.row_scale[len(self.scale.rows) :, None]
        return sparse_rows(self.system, q, self.guess.t, self.scale, given)


def _slopes(system: AbstractSystem, state: State, which: Array) -> Array:
    """How given values change with the coordinates."""
    still = xp.zeros_like(state.qd)
    if not which.size:
        return xp.zeros((0, still.size), still.dtype)
    slopes = jax.jacrev(lambda d: given_values(system, system.retract(state.q, d), state.t, which))(still)
    return with_own(which, slopes)


@partial(custom_jvp, make=eqx.filter_custom_jvp)
def _carried(guess: Array, system: AbstractSystem, reached: Array) -> Array:
    """The position reached; its derivative is that of the guess, velocity by velocity."""
    return reached


@_carried.def_jvp
def _carried_jvp(primals: tuple, tangents: tuple) -> tuple:
    (guess, system, reached), (change, *_) = primals, tangents
    if change is None or system.adds:
        return reached, change
    rate = velocity(system, guess, change)
    zero, one = xp.zeros((), reached.dtype), xp.ones((), reached.dtype)
    return reached, jax.jvp(lambda s: system.retract(reached, s * rate), (zero,), (one,))[1]
