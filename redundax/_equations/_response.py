"""What load, friction and misfit cause at a state: the one form of the equations that all else builds on.

    x(tau, d) = x_0 + X tau + [0; G d],   x = [a; lam],   G = N (N^T W N)^-1 N^T

under the compliance W of a closure. A factorisation makes it in two steps: `respond` gives a solution of

    M a + Phi_q^T lam = f,   Phi_q a = g

for each column of forces, its multipliers being one of many, and `close` the choice among them,

    lam -> (I - G W) lam + G d.

Who solves, judges or bounds takes these operators, and knows nothing of how they were made.
"""

import abc
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

import equinox as eqx
from jaxtyping import Array, Bool, Float, Int

from .._system._decision import Decision
from .._system._results import RESULTS
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._by_number import combine
from .._tools._linear_map import LinearMap
from .._tools._numbers import Numeric, take, xp
from .._tools._value import AbstractModule, value
from ._evidence import Violation
from ._kinematics import along_slips, slip_force
from ._rank import Spectrum
from ._scaling import Scaling

Evidence = TypeVar("Evidence")
Checks: TypeAlias = tuple[tuple[Bool[Array, ""], RESULTS], ...]  # what must hold, and what it is where it does not


class Response(NamedTuple):
    """Accelerations and multipliers, (n,) and (m,) to load or (n, p) and (m, p) to unit friction."""

    acceleration: Numeric
    multipliers: Numeric

    def __matmul__(self, tau: Array) -> "Response":
        """What friction forces cause, of the response to unit friction."""
        return Response(self.acceleration @ tau, self.multipliers @ tau)

    def gain(self, rows: Int[Array, " l"]) -> Float[Numeric, "l p"]:
        """K, what unit friction causes in the multipliers of these rows."""
        return take(self.multipliers, rows)

    def bound(self, tau: Float[Array, " p"], end: "Response | None") -> Float[Array, ""]:
        """Bound of the sum of |X tau|, which ends at `end`: not finite where that is not, or where it overflows."""
        return total(*self) * total(tau)


class FrictionResponse(AbstractModule):
    """X of a large mechanism, by products: one more right-hand side for each friction that is asked about.

    X tau = response to E tau,   E tau the generalised force of friction, of which no matrix is formed

    under a closure, or one response of many where there is none.
    """

    system: AbstractSystem
    state: State
    factor: "AbstractFactorisation"
    pick: "AbstractPick | None"

    def __matmul__(self, tau: Float[Array, " p"]) -> Response:
        a, lam = self.factor.respond(slip_force(self.system, self.state, tau)[:, None])
        return Response(a[:, 0], (lam if self.pick is None else self.pick(lam))[:, 0])

    def gain(self, rows: Int[Array, " l"]) -> LinearMap:
        """K, as of matrices."""
        return LinearMap(_loads, (self, rows))

    def bound(self, tau: Float[Array, " p"], end: Response | None) -> Float[Array, ""]:
        """That of the friction and of its end."""
        return total(tau, *(() if end is None else end))

    @property
    def forces(self) -> LinearMap:
        """E, from friction forces to generalised forces."""
        return LinearMap(slip_force, (self.system, self.state))

    def slips(self, acceleration: Float[Array, " n"]) -> Float[Array, " p"]:
        """E^T a, the rates of slip rates."""
        return along_slips(self.system, self.state, acceleration)

    @property
    def yields(self) -> LinearMap:
        """E^T X, from friction forces to the rates of slip rates that they cause."""
        return LinearMap(_slip_acceleration, (self,))


def _loads(unit: FrictionResponse, rows: Array, tau: Array) -> Float[Array, " l"]:
    return (unit @ tau).multipliers[rows]


def _slip_acceleration(unit: FrictionResponse, tau: Array) -> Float[Array, " p"]:
    return unit.slips((unit @ tau).acceleration)


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

    def loads(
        self, closed: tuple[Array, Array], misfit: Float[Array, " m"] | Float[Array, ""], rows: Int[Array, " l"]
    ) -> Float[Array, " l"]:
        """Some rows of `closed` with G d: by matrices they cost less than all, which accelerations do not need."""
        return take(closed[0], rows) + self.caused(misfit, rows)

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

    - `state`, `gamma`, `load`: (q, qd, t); the right-hand sides of (5), shape (m,), and of (7), shape (n,).
    - `spectrum`, `violation`, `singularity`: the rank with its evidence; consistency of the state; whether the rank is
      higher beside this position.
    - `acceleration`, `multipliers`: a solution without friction; the multipliers are one of many.
    - `length`: a length of the mechanism, which makes angles and lengths comparable.
    - `rate_noise`: what rounding and violation make of a slip rate that is zero.
    """

    state: eqx.AbstractVar[State]
    gamma: eqx.AbstractVar[Float[Array, " m"]]
    load: eqx.AbstractVar[Float[Array, " n"]]
    spectrum: eqx.AbstractVar[Spectrum]
    violation: eqx.AbstractVar[Violation]
    singularity: eqx.AbstractVar[Decision]
    acceleration: eqx.AbstractVar[Float[Array, " n"]]
    multipliers: eqx.AbstractVar[Float[Array, " m"]]
    length: eqx.AbstractVar[Float[Array, ""]]
    rate_noise: eqx.AbstractVar[Float[Array, ""]]
    scaling: eqx.AbstractVar[Scaling]

    @property
    @abc.abstractmethod
    def shape(self) -> tuple[int, ...]:
        """(m, n)."""

    @property
    @abc.abstractmethod
    def dense(self) -> "AbstractSolvedFactorisation | None":
        """This where it has matrices, else None."""

    @property
    @abc.abstractmethod
    def local(self) -> Int[Array, ""] | int:
        """Number of self-stress states that are there at this position only."""

    @property
    @abc.abstractmethod
    def unique_multipliers(self) -> Bool[Array, " m"]:
        """Which multipliers are unique without friction."""

    @abc.abstractmethod
    def contradicting(self, gamma: Float[Array, " m"]) -> Float[Array, " m"]:
        """The part of gamma that no acceleration has."""

    @property
    @abc.abstractmethod
    def lost_digits(self) -> Float[Array, ""]:
        """Decimal digits that accelerations and multipliers lose to the smallest kept singular value."""

    @property
    @abc.abstractmethod
    def checks(self) -> Checks:
        """What must hold for the equations at this state to have a trustworthy solution, root causes first."""

    @property
    @abc.abstractmethod
    def result(self) -> RESULTS:
        """The first check that fails, or `RESULTS.successful`."""

    @property
    def redundancy(self) -> Int[Array, ""]:
        """k = m - r, number of redundant constraints."""
        return self.shape[0] - self.spectrum.rank

    @property
    def freedom(self) -> Int[Array, ""]:
        """n - r, number of degrees of freedom."""
        return self.shape[1] - self.spectrum.rank

    @property
    def singular_position(self) -> Bool[Array, ""]:
        """Whether the rank is lower at this position than beside it: P Phi_qq[w, w] is not zero for a motion w.

        There more multipliers are not unique than elsewhere, branches of motion meet, and (7) does not contain the
        condition of third order that keeps the accelerations on their branch: `branch` does, where there is one.
        """
        return self.singularity.is_yes

    def motion_of(self, rates: Float[Array, "..."]) -> Decision:
        """Whether slip rates, m/s or L times an angular rate, are those of joints that move.

        The noise is the rounding of the velocities and what violates the constraints of them, magnified by the
        Jacobian as in a part that the others hold still.
        """
        return Decision(xp.abs(rates) / self.rate_noise)

    @abc.abstractmethod
    def to_friction(
        self, system: AbstractSystem, state: State, pick: AbstractPick
    ) -> tuple[Float[Array, " p"], "Response | FrictionResponse"]:
        """Slip rates, and what unit friction causes under a closure."""

    @abc.abstractmethod
    def undetermined(self, compliance: Float[Array, "m m"]) -> Bool[Array, " m"] | None:
        """Multipliers that have no value, whatever `close` picks; None where the position is regular."""


@value
class LinearResponse:
    """x_0 and X: `free`, the response to load and misfit, and `unit`, that to unit friction, p columns or a map."""

    free: Response
    unit: Any  # Response, or FrictionResponse

    def at(self, tau: Float[Array, " p"], stress: Float[Array, " m"] | None = None) -> Response:
        """Accelerations and multipliers at the friction tau, with a self-stress added."""
        caused = self.unit @ tau
        acceleration = self.free.acceleration + caused.acceleration
        multipliers = self.free.multipliers + caused.multipliers
        return Response(acceleration, multipliers if stress is None else multipliers + stress)


def times(matrix: Float[Array, "d m"], vector: Float[Array, " m"] | Float[Array, ""]) -> Float[Array, " d"]:
    """matrix @ vector; a number stands for m equal ones, so that a batch of numbers stays one."""
    return matrix @ vector if vector.ndim else xp.sum(matrix, axis=1) * vector


def total(*arrays: Array) -> Float[Array, ""]:
    """Sum of the sizes of all entries, which a NaN does not pass by."""
    return xp.asarray(sum(combine(xp.add, xp.sum, xp.abs(array).ravel()) for array in arrays))
