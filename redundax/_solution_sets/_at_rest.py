"""A mechanism at rest: what drives it, in which ways it can move, and states that are possible from there.

With V (n, d) a basis of the velocities that the constraints leave, V^T M V = I, and S = E^T V,

    a = V (g + S^T tau),   g = V^T M a_0,   alpha = S (g + S^T tau)

are the acceleration, a_0 being that without friction, and the rates of the slip rates. Neither g nor S depends on the
case: preload, misfit and compliance enter through the limits of friction alone.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array

from .._equations._factorisation import Factorisation
from .._equations._kinematics import slip_gamma, slip_motion
from .._system._directions import Directions, directions_of
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import RedundaxError
from .._tools._numbers import or_one, xp

T = TypeVar("T")

NONE = 1e-10  # relative size of a drive or of a slip that is rounding
LIMIT = 1e-9  # margin that is rounding
_HELD = 1e-6  # slip that constraints hold, beside a free one: what `solve` takes for met, relative to the size


class ReducedForce(NamedTuple):
    """The start without friction.

    - `sense`: of slip, shape (p,); a unit direction of the surfaces of a joint whose slips share one friction.
    - `output`: a as an output of [qdd; lam; tau], relative to the start and along it: a^T M a_0 / a_0^T M a_0.
    - `effect`: e, that output of unit friction, shape (p,).
    - `load`, `slips`: g, shape (d,), and S, shape (p, d).
    - `rounding`: relative size of what is none.
    - `directions`: which slips share one friction, `None` if none do.
    """

    sense: np.ndarray
    output: np.ndarray
    effect: np.ndarray
    load: np.ndarray
    slips: np.ndarray
    rounding: float
    directions: Directions | None

    def sizes(self, low: Array | np.ndarray, high: Array | np.ndarray) -> np.ndarray:
        """Largest |friction| of each slip within limits (s, p)."""
        low, high = np.asarray(low), np.asarray(high)
        return np.maximum(-low, high) if self.directions is None else ball_sizes(self.directions, high)

    @property
    def none(self) -> bool:
        """Whether nothing drives the mechanism."""
        return not self.output.any()


class Ends(NamedTuple):
    """States that are possible from rest, held or as slip begins, as arrays; and the share of cases decided.

    `sense` is that in which each slip starts, 0 where it sticks.
    """

    margin: np.ndarray
    theta: np.ndarray
    acceleration: np.ndarray
    multipliers: np.ndarray
    tau: np.ndarray
    share: np.ndarray
    sense: np.ndarray
    solved: float

    def beside(self, more: "Ends") -> "Ends":
        """With more states, of the same share of cases."""
        rows = (np.concatenate(pair) for pair in zip(self[:-1], more[:-1], strict=True))
        return Ends(*rows, solved=self.solved)


def drive(system: AbstractSystem, state: State, factor: Factorisation) -> ReducedForce:
    """What drives a system at rest; `ValueError` where it does not rest."""
    length, angular = np.asarray(factor.length), np.asarray(system.coordinates.angular)
    if not is_still(system, state, factor):
        raise RedundaxError(
            f"Argument `state` must be at rest, but has velocities up to {_largest_rate(system, state, factor):.3g}. "
            "Take `qd = 0`, or `simulate` to where it comes to rest."
        )
    none = _rounding(factor)
    a, mass, load = (np.asarray(x, float) for x in (factor.acceleration, factor.mass, factor.load))
    if _is_accelerated(factor):
        raise RedundaxError(
            "Argument `state` must be free to stay at rest, but a driver accelerates the mechanism. "
            "Lock the driver, or choose another time `t`."
        )
    force, lever = mass @ a, np.where(angular, 1 / length, 1.0)
    slips, p = system.slips, len(system.slips)
    size, directions = state.qd.size + len(system.rows), directions_of(system.friction)
    ways, turns = velocity_basis(system, factor), np.where(slips.angular, length, 1.0)
    loads = slip_motion(system.anonymous, state)[1] if p else np.zeros((a.size, 0))
    moved = loads.T @ ways
    reach = np.linalg.norm(moved, axis=1) * turns
    moved = np.where((reach > none * reach.max(initial=0.0))[:, None], moved, 0.0)
    if not np.abs(lever * force).max() > none * np.abs(lever * load).max():
        still = np.zeros(p), np.zeros(size + p), np.zeros(p), np.zeros(ways.shape[1])
        return ReducedForce(*still, moved, none, directions)
    output = np.concatenate([force / (a @ force), np.zeros(len(system.rows) + p)])
    slip = loads.T @ a
    shift = np.abs(slip) * turns
    slip = np.where(shift > none * shift.max(initial=0.0), slip, 0.0)
    sense = np.sign(slip) if directions is None else np.asarray(directions.unit(directions.arms * slip))
    return ReducedForce(sense, output, slip / (a @ force), ways.T @ force, moved, none, directions)


def ball_sizes(directions: Directions, high: np.ndarray) -> np.ndarray:
    """Largest |friction| of each slip within limits -high, high, those of joints with a direction by the ball there."""
    arms = np.asarray(directions.arms)
    return arms * np.sqrt((high / arms) ** 2 @ directions.same)


def _rounding(factor: Factorisation) -> float:
    return max(NONE, 100 * float(np.finfo(factor.load.dtype).eps))


def _is_accelerated(factor: Factorisation) -> bool:
    """Whether drivers accelerate it."""
    prescribed = np.abs(factor.jacobian @ np.asarray(factor.acceleration)).max(initial=0.0)
    return bool(np.abs(factor.gamma).max(initial=0.0) > _rounding(factor) * prescribed)


def sense_of_start(system: AbstractSystem, state: State, factor: Factorisation) -> np.ndarray | None:
    """Which way joints with friction slip from an instant of rest, where drives or a motion that goes on accelerate
    them whatever the forces; 0 of all others, None where there are no such joints."""
    if is_still(system, state, factor) and not _is_accelerated(factor):
        return None
    rates, slopes = (np.asarray(x) for x in slip_motion(system.anonymous, state))
    turns = np.where(system.slips.angular, np.asarray(factor.length), 1.0)
    a, gamma = np.asarray(factor.acceleration), np.asarray(slip_gamma(system.anonymous, state))
    begins = slopes.T @ a - gamma
    size = (np.abs(slopes).T @ np.abs(a) + np.abs(gamma)) * turns
    least = max(_HELD * size.max(initial=0.0), _rounding(factor) * _largest_acceleration(system, factor))
    starts, free = np.abs(begins) * turns > least, free_slips(system, state, factor)
    moves = np.asarray(factor.motion_of(xp.asarray(rates * turns)).is_yes)
    directions = directions_of(system.friction)
    if directions is not None:
        starts, free, moves = (np.asarray(directions.any(flags)) for flags in (starts, free, moves))
    sense = np.where(starts & ~free & ~moves, begins, 0.0)
    return sense if sense.any() else None


def _largest_acceleration(system: AbstractSystem, factor: Factorisation) -> float:
    """Of the mechanism and of its bodies by loads alone, as lengths."""
    mass, load, a = (np.asarray(x) for x in (np.diagonal(factor.mass), factor.load, factor.acceleration))
    parts = np.abs(a) + np.where(mass > 0, np.abs(load) / or_one(mass), 0.0)
    return (parts * np.where(system.coordinates.angular, np.asarray(factor.length), 1.0)).max(initial=0.0)


def free_slips(system: AbstractSystem, state: State, factor: Factorisation) -> np.ndarray:
    """Which slips the constraints leave free at a state."""
    if not system.friction:
        return np.zeros(0, bool)
    slopes = slip_motion(system.anonymous, state)[1] * factor.scaling.coordinates[:, None]
    left, whole = (np.linalg.norm(x, axis=0) for x in (factor.split.motion @ slopes, slopes))
    return left > _HELD * whole


def is_still(system: AbstractSystem, state: State, factor: Factorisation) -> bool:
    """Whether nothing moves."""
    return not bool(factor.motion_of(xp.asarray(_largest_rate(system, state, factor))).is_yes)


def _largest_rate(system: AbstractSystem, state: State, factor: Factorisation) -> float:
    turns = np.where(system.coordinates.angular, np.asarray(factor.length), 1.0)
    return (np.abs(np.asarray(state.qd)) * turns).max(initial=0.0)


def velocity_basis(system: AbstractSystem, factor: Factorisation, opened: Sequence[int] = ()) -> np.ndarray:
    """V, of what all constraints but those `opened` leave; without columns where no basis is orthonormal, which
    `analyze` complains of."""
    if not bool(factor.determinate & factor.finite):
        return np.zeros((factor.load.size, 0))
    scale = np.where(system.coordinates.angular, 1 / np.asarray(factor.length), 1.0)
    rows = np.asarray(factor.jacobian) * scale / np.asarray(factor.row_scale)[:, None]
    _, sizes, ways = np.linalg.svd(np.delete(rows, list(opened), axis=0))
    rank = int(np.sum(sizes > NONE * sizes.max(initial=0.0))) if opened else int(factor.spectrum.rank)
    free = scale[:, None] * ways[rank:].T
    inverse = np.linalg.inv(np.linalg.cholesky(free.T @ np.asarray(factor.mass) @ free))
    return free @ inverse.T


def in_batches(function: Callable[..., T], size: int, *arrays: ArrayLike) -> T:
    """A compiled function of rows, called with batches of one size, so that nothing is compiled anew."""
    arrays = tuple(np.asarray(array) for array in arrays)
    rows, parts = arrays[0].shape[0], []
    for first in range(0, rows, size):
        places = np.minimum(np.arange(first, first + size), rows - 1)
        out = jax.device_get(function(*(jnp.asarray(array[places]) for array in arrays)))
        parts.append(jax.tree.map(lambda x, first=first: x[: rows - first], out))
    return jax.tree.map(lambda *parts: np.concatenate(parts), *parts)
