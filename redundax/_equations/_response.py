"""What load, friction and misfit cause at a state: the one form of the equations that all else builds on.

    x(tau, d) = x_0 + X tau + [0; G d],   x = [a; lam],   G = N (N^T W N)^-1 N^T

under the compliance W of a closure. A factorisation makes it in two steps: `respond` gives a solution of

    M a + Phi_q^T lam = f,   Phi_q a = g

for each column of forces, its multipliers being one of many, and `close` the choice among them,

    lam -> (I - G W) lam + G d.

Who solves, judges or bounds takes these operators, and knows nothing of how they were made.
"""

import abc
from typing import Any, Generic, NamedTuple, TypeVar

import equinox as eqx
from jaxtyping import Array, Bool, Float, Int

from .._system._decision import Decision
from .._tools._by_number import combine
from .._tools._linear_map import LinearMap
from .._tools._numbers import Numeric, take, xp
from .._tools._value import AbstractModule, value

Evidence = TypeVar("Evidence")


class Response(NamedTuple):
    """Accelerations and multipliers, (n,) and (m,) to load or (n, p) and (m, p) to unit friction."""

    acceleration: Numeric
    multipliers: Numeric

    def __matmul__(self, tau: Array) -> "Response":
        """What friction forces cause, of the response to unit friction."""
        return Response(self.acceleration @ tau, self.multipliers @ tau)


class AbstractPick(AbstractModule):
    """The multipliers that a closure picks from any that solve the equations."""

    @abc.abstractmethod
    def __call__(self, multipliers: Float[Array, "m ..."]) -> Float[Array, "m ..."]:
        """(I - G W) lam, as without misfit."""

    def closed(
        self, multipliers: Float[Array, " m"], misfit: Float[Array, " m"] | Float[Array, ""]
    ) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
        """(I - G W) lam, and the same with G d added."""
        picked = self(multipliers)
        return picked, picked + self.caused(misfit)

    def columns(
        self, multipliers: Float[Array, "m c"], misfit: Float[Array, " m"] | Float[Array, ""]
    ) -> Float[Array, "m c"]:
        """(I - G W) lam of each column, with G d added to the first."""
        return self(multipliers).at[:, 0].add(self.caused(misfit))

    @abc.abstractmethod
    def caused(
        self, misfit: Float[Array, " m"] | Float[Array, ""], rows: Int[Array, " l"] | None = None
    ) -> Float[Array, " l"]:
        """G d, the self-stress that a misfit causes, in some rows; a number stands for m equal misfits."""

    @abc.abstractmethod
    def bound(self, misfit: Float[Array, " m"] | Float[Array, ""]) -> Float[Array, ""]:
        """A bound of the sum of |G d|, not finite where an entry is not."""


class Pick(AbstractPick):
    """The pick by matrices.

    - `response`, `compliance`: G and W, shape (m, m).
    """

    response: Float[Array, "m m"]
    compliance: Float[Array, "m m"]

    def __call__(self, multipliers: Array) -> Array:
        for _ in range(2):  # the second is refinement
            multipliers = multipliers - self.response @ (self.compliance @ multipliers)
        return multipliers

    def caused(self, misfit: Array, rows: Array | None = None) -> Array:
        return times(self.response if rows is None else take(self.response, rows), misfit)

    def bound(self, misfit: Array) -> Array:
        return total(self.response) * total(misfit)


class AbstractFactorisation(AbstractModule, Generic[Evidence]):
    """The equations at a state, factorised."""

    @abc.abstractmethod
    def respond(self, forces: Float[Array, "n p"], gamma: Float[Array, "m p"] | None = None) -> Response:
        """What each column of forces, and of gamma, causes; the multipliers are one solution of many."""

    @abc.abstractmethod
    def close(self, compliance: Float[Array, "m m"]) -> tuple[AbstractPick, Evidence]:
        """The pick under a compliance, and the evidence that it determines the multipliers."""


class AbstractSolvedFactorisation(AbstractFactorisation[Decision]):
    """The equations at a state, factorised and solved for the load.

    - `acceleration`, `multipliers`: a solution without friction; the multipliers are one of many.
    - `length`: a length of the mechanism, which makes angles and lengths comparable.
    """

    acceleration: eqx.AbstractVar[Float[Array, " n"]]
    multipliers: eqx.AbstractVar[Float[Array, " m"]]
    length: eqx.AbstractVar[Float[Array, ""]]

    @abc.abstractmethod
    def motion_of(self, rates: Float[Array, "..."]) -> Decision:
        """Whether slip rates, m/s or L times an angular rate, are those of joints that move."""

    @abc.abstractmethod
    def undetermined(self, compliance: Float[Array, "m m"]) -> Bool[Array, " m"] | None:
        """Multipliers that have no value, whatever `close` picks; None where the position is regular."""


@value
class LinearResponse:
    """x_0 and X: `free`, the response to load and misfit, and `unit`, that to unit friction, p columns; of a large
    mechanism a map from friction forces to a response."""

    free: Response
    unit: Any  # Response or LinearMap

    def at(self, tau: Float[Array, " p"], stress: Float[Array, " m"] | None = None) -> Response:
        """Accelerations and multipliers at the friction tau, with a self-stress added."""
        caused = self.unit @ tau
        acceleration = self.free.acceleration + caused.acceleration
        multipliers = self.free.multipliers + caused.multipliers
        return Response(acceleration, multipliers if stress is None else multipliers + stress)

    def gain(self, rows: Int[Array, " l"]) -> Any:
        """K, what unit friction causes in the multipliers of these rows, (l, p) or a map."""
        if isinstance(self.unit, LinearMap):
            return LinearMap(_loads, (self.unit, rows))
        return take(self.unit.multipliers, rows)


def _loads(unit: LinearMap, rows: Array, tau: Array) -> Array:
    return (unit @ tau).multipliers[rows]


def times(matrix: Float[Array, "d m"], vector: Float[Array, " m"] | Float[Array, ""]) -> Float[Array, " d"]:
    """matrix @ vector; a number stands for m equal ones, so that a batch of numbers stays one."""
    return matrix @ vector if vector.ndim else xp.sum(matrix, axis=1) * vector


def total(*arrays: Array) -> Float[Array, ""]:
    """Sum of the sizes of all entries, which a NaN does not pass by."""
    return xp.asarray(sum(combine(xp.add, xp.sum, xp.abs(array).ravel()) for array in arrays))
