"""The matrices that a system is solved with, dense or sparse: the one place that asks which.

What differs between them is a method here, of the factorisations that they make, or, where it belongs to a later part
of the program, a function that is registered there for each kind.
"""

import abc
from typing import Generic, NoReturn, TypeVar

import numpy as np
from jax.typing import ArrayLike

from .._system._results import RESULTS
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import RedundaxError
from .._tools._module import is_concrete
from ._closing import AbstractClosing
from ._dense_closing import DenseClosing
from ._factorisation import Factorisation, factorised
from ._response import AbstractSolvedFactorisation
from ._sparse_closing import SparseClosing
from ._sparse_factorisation import SparseFactorisation, sparse_factorised

T = TypeVar("T")
F = TypeVar("F", bound=AbstractSolvedFactorisation)
# Tolerance of friction by sparse matrices, in roundings: what their solutions leave of each other.
_ROUNDINGS = 1e4


class AbstractMatrices(abc.ABC, Generic[F]):
    """How a system is assembled, factorised and run.

    - `closing`: the position problem.
    - `on_numbers`: whether equations of known numbers are NumPy's.
    - `has_freedoms`: whether motions have coordinates of their freedoms.
    - `rtol`: relative tolerance of friction where a solver is given none; None if it knows one.
    - `unsettled`: the result where what closes a motion has not settled; None if it does not iterate.
    """

    closing: type[AbstractClosing]
    on_numbers: bool
    has_freedoms: bool
    rtol: float | None
    unsettled: RESULTS | None

    @abc.abstractmethod
    def run(self, dense: T, sparse: T) -> T:
        """Of two ways to run a function the one that is for these."""

    @abc.abstractmethod
    def factorised(self, system: AbstractSystem, state: State, rank: ArrayLike | None) -> F:
        """The equations at a state, singular or not."""

    @abc.abstractmethod
    def is_singular(self, system: AbstractSystem, state: State, factor: F) -> bool:
        """Whether the mass matrix at a state is known to be singular."""

    @abc.abstractmethod
    def redundancy(self, factor: F) -> int | None:
        """How many rows are redundant, where programs have that many columns for them."""

    @abc.abstractmethod
    def needs_dense(self, message: str) -> None:
        """Refuse what only dense matrices answer."""


class DenseMatrices(AbstractMatrices[Factorisation]):
    """Matrices of all rows and coordinates."""

    closing, on_numbers, has_freedoms, rtol, unsettled = DenseClosing, True, True, None, None

    def run(self, dense: T, sparse: T) -> T:
        return dense

    def factorised(self, system: AbstractSystem, state: State, rank: ArrayLike | None) -> Factorisation:
        return factorised(system, state, rank)

    def is_singular(self, system: AbstractSystem, state: State, factor: Factorisation) -> bool:
        mass = factor.mass if is_concrete(factor.mass) else system.mass(state.q, state.t)
        return is_concrete(mass) and _is_singular(np.asarray(mass))

    def redundancy(self, factor: Factorisation) -> int | None:
        rank = factor.spectrum.rank
        return factor.gamma.size - int(rank) if is_concrete(rank) else None

    def needs_dense(self, message: str) -> None:
        return


class SparseMatrices(AbstractMatrices[SparseFactorisation]):
    """Matrices by the bodies of joints, whose cost is that of joints."""

    closing, on_numbers, has_freedoms, unsettled = SparseClosing, False, False, RESULTS.ambiguous_closure
    rtol = _ROUNDINGS * float(np.finfo(float).eps)

    def run(self, dense: T, sparse: T) -> T:
        return sparse

    def factorised(self, system: AbstractSystem, state: State, rank: ArrayLike | None) -> SparseFactorisation:
        return sparse_factorised(system, state, rank)

    def is_singular(self, system: AbstractSystem, state: State, factor: SparseFactorisation) -> bool:
        return False  # bodies that lack mass are solved for by themselves

    def redundancy(self, factor: SparseFactorisation) -> None:
        return None

    def needs_dense(self, message: str) -> NoReturn:
        raise RedundaxError(message)


_DENSE, _SPARSE = DenseMatrices(), SparseMatrices()


def matrices_of(system: AbstractSystem) -> AbstractMatrices:
    """Those of a system."""
    return _DENSE if system.symbolic is None else _SPARSE


def _is_singular(mass: np.ndarray) -> bool:
    """Whether the mass matrix is, or is nearly, singular."""
    size = np.sqrt(np.where(np.diag(mass) > 0, np.diag(mass), 1.0))
    return bool(np.all(np.isfinite(mass))) and bool(np.linalg.eigvalsh(mass / size[:, None] / size)[0] < 1e-12)
