"""The position and the velocity that an assembly looks for, whatever the storage of matrices

    r(d) = D^-1 Phi(q [+] S d),   K^+ r(d) = 0

in the scaled variables of `_scaling`, in which lengths and angles compare. Newton steps d = -K^+ r at the decided rank
end at rounding; the last of them carries the derivative: geometry moves q by the smallest displacement that keeps the
mechanism closed.

Points of few digits leave a misfit where constraints are redundant. The steps then end at K^T r = 0, as near as the
points allow: the rank is that of a tolerance above the misfit, so no step closes it along a direction that only the
rounding of the points constrains.
"""

from abc import abstractmethod
from collections.abc import Callable
from functools import partial
from typing import NamedTuple, Self

import equinox as eqx
from jaxtyping import Array, Float, Int

from .._system._axis import Axis, join
from .._system._names import Names
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._numbers import Numeric, custom_jvp, fori_loop, known, or_one, stop_gradient, take, xp
from .._tools._value import AbstractModule
from ._kinematics import AlongMotion
from ._misfit import Misfit, misfit_of, tolerance
from ._pseudoinverse import DensePseudoinverse, SparsePseudoinverse
from ._scaling import Scaling

_POLISHING_STEPS = 4


def given_axis(names: Names) -> Axis:
    """What can be given: coordinates, and those of joints."""
    return join([names.coordinates, names.joint_coordinates])


def beside(system: AbstractSystem, given: Array, wanted: Array, held: Array) -> Array:
    """How far held coordinates are from what they must be: an angle in space to the nearest turn."""
    gap = given - wanted
    if system.adds or not held.size:
        return gap
    whole = 2 * xp.pi * known(system.radian).astype(gap.dtype)
    turns = xp.where(take(given_axis(system.names).angular, held), xp.round(gap / whole), 0.0)
    return gap - whole * turns


def given_values(system: AbstractSystem, q: Array, t: Array, held: Array) -> Array:
    """Values of the coordinates that are held, of those of `_axis`."""
    if not held.size:
        return xp.zeros(0, q.dtype)
    none = xp.zeros(len(system.coordinates), q.dtype)
    own = q if q.shape == none.shape else none  # of another chart no coordinate is held
    return xp.concatenate([own, system.joint_coordinates.positions(State(q, none, t))])[held]


def row_scales(system: AbstractSystem, given: Array, scale: Scaling) -> Float[Array, " rows"]:
    """Those of constraints and of values that are given."""
    return xp.concatenate([scale.rows, xp.where(take(given_axis(system.names).angular, given), 1 / scale.length, 1.0)])


class Along(NamedTuple):
    """What a velocity is found from.

    - `motion`, `scale`: of the constraints at the position.
    - `slopes`: of values that are given, by the coordinates.
    - `inverse`: K^+ of the slopes, scaled, and the relative violation of the position.
    """

    motion: AlongMotion
    scale: Scaling
    slopes: Float[Array, "h n"]
    inverse: Callable[[Float[Array, "h n"], Float[Array, ""]], DensePseudoinverse | SparsePseudoinverse]


class AbstractClosing(AbstractModule):
    """The position problem: scaled residual r(d) of rows and held coordinates at q [+] S d."""

    system: AbstractSystem
    guess: State
    held: Int[Array, " h"]
    positions: Float[Array, " h"]
    scale: Scaling
    row_scale: Float[Array, " rows"]

    @classmethod
    def of(cls, system: AbstractSystem, guess: State, held: Array, positions: Array) -> Self:
        """That about a guess."""
        scale = cls.scaling(system, guess)
        return cls(system, guess, held, positions, scale, row_scales(system, held, scale))

    @staticmethod
    @abstractmethod
    def scaling(system: AbstractSystem, state: State) -> Scaling:
        """The scales at a state."""

    @abstractmethod
    def begun(self) -> Self:
        """The problem about the position from which a displacement reaches as far."""

    @abstractmethod
    def start(self) -> Float[Array, " n"]:
        """The displacement from where Newton steps begin."""

    @abstractmethod
    def moved(self, d: Float[Array, " n"]) -> Array:
        """q [+] S d."""

    @abstractmethod
    def residual(self, d: Float[Array, " n"]) -> Float[Array, " rows"]:
        """r(d)."""

    @abstractmethod
    def inverse(self, d: Float[Array, " n"]) -> DensePseudoinverse | SparsePseudoinverse:
        """K^+ of the residual."""

    @classmethod
    @abstractmethod
    def along(cls, system: AbstractSystem, state: State, driven: Int[Array, " h"]) -> Along:
        """What the velocity is found from, with values given of some coordinates."""


class _Closed(NamedTuple):
    """A displacement, the size of the last step to it, and the least singular value that the steps inverted."""

    d: Float[Array, " n"]
    step: Float[Array, ""]
    weakest: Float[Array, ""]


@partial(custom_jvp, make=eqx.filter_custom_jvp)
def _closed(closing: AbstractClosing) -> _Closed:
    """A displacement d with K^+ r(d) = 0; its derivative is dd = -K^+ dr, the smallest that keeps it so."""
    d = closing.start()

    def polished(_: Numeric, carry: _Closed) -> _Closed:
        inverse = closing.inverse(carry.d)
        step = -inverse(closing.residual(carry.d))
        return _Closed(carry.d + step, xp.max(xp.abs(step)), xp.minimum(carry.weakest, inverse.kept))

    infinite = xp.full((), xp.inf, d.dtype)
    return fori_loop(0, _POLISHING_STEPS, polished, _Closed(d, infinite, infinite))


@_closed.def_jvp
def _closed_jvp(primals: tuple, tangents: tuple) -> tuple:
    closed = _closed(*primals)
    _, change = eqx.filter_jvp(lambda closing: closing.residual(closed.d), primals, tangents)
    moved = None if change is None else -primals[0].inverse(closed.d)(change)  # None where nothing in r moves
    none = xp.zeros_like(closed.step)
    return closed, eqx.tree_at(lambda closed: closed.d, _Closed(none, none, none), moved)


def position(guess: AbstractClosing) -> tuple[Array, Misfit]:
    """The position nearest to the guess, and how far from closed it is."""
    closing = guess.begun()
    d, step, weakest = _closed(closing)
    left = xp.abs(closing.residual(d))
    settled = step <= xp.maximum(xp.max(left / closing.scale.size), tolerance(d))
    scale = closing.row_scale * closing.scale.size
    misfit = misfit_of(left * closing.row_scale, scale, settled, weakest, tolerance(d))
    return closing.moved(d), misfit


def velocity_of(
    kind: type[AbstractClosing],
    system: AbstractSystem,
    state: State,
    driven: Int[Array, " h"],
    rates: Float[Array, " h"],
) -> tuple[Array, Misfit]:
    """The velocity nearest to that of a state, and by how much it misses."""
    motion, scale, slopes, inverse_of = kind.along(system, state, driven)
    row_scale = row_scales(system, driven, scale)
    misfit = xp.concatenate([motion.rate, slopes @ state.qd - rates]) / row_scale
    drift = xp.max(xp.abs(scale.violations(motion.value)))
    inverse = inverse_of(slopes * scale.coordinates / row_scale[len(scale.rows) :, None], drift)
    change = -inverse(misfit)
    guess = state.qd / scale.coordinates
    found = guess + change
    given = (xp.max(xp.abs(guess)) + xp.max(xp.abs(misfit))) / xp.minimum(inverse.kept, 1.0)
    rests = xp.max(xp.abs(found)) <= 10 * found.size * xp.finfo(found.dtype).eps * given
    found = found - xp.where(rests, stop_gradient(found), 0.0)  # the rounding of none, which has no direction
    qd = scale.coordinates * found
    speed = xp.max(xp.abs(found)) + xp.max(xp.abs(misfit))
    left = xp.abs(misfit + inverse.times(change))
    size = row_scale * or_one(speed)
    return qd, misfit_of(left * row_scale, size, xp.asarray(True), xp.asarray(xp.inf), tolerance(qd))


def with_own(which: Int[Array, " h"], slopes: Float[Array, "h n"]) -> Float[Array, "h n"]:
    """Slopes of values that are given, with those of coordinates themselves."""
    size = slopes.shape[1]
    own = which[:, None] == xp.arange(size)  # of another chart too, whose positions are none of these
    return xp.where((which < size)[:, None], own.astype(slopes.dtype), slopes)
