"""Who of several drives takes which share, where a control decides it and not the stiffness of servos.

    least norm    sum (u_k / r_k)^2 least,   by ratings r
    least peak    max |u_k| / l_k least, by limits l, with s_k u_k >= p_k where a preload p keeps flanks in contact

over all forces u of the drives that make the same motion. The first is a closure whose drives give way by 1 / r^2 and
whose joints are stiff beside them. The second is a linear programme at each time, whose answer is the misfit of drive
rows that brings about its forces; where friction depends on the share it is repeated from there.
"""

from collections.abc import Callable, Mapping, Sequence

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._closures._closure import AbstractClosure, check_closure
from .._closures._play import Play
from .._system._names import index_of
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._module import as_float, check_kind, finite, positive
from .._tools._numbers import or_one, tolerance_of
from .._tools._value import AbstractModule

# Compliance of joints beside that of drives: a share is wrong by as much, relative, and rounding by the inverse of it.
_STIFF = 1e-7
_ROUNDS = 12  # of the programme where friction depends on the share: each leaves a mu of the error before, or less
_KEPT = 1e-6  # of a limit: what the stiffness of joints leaves of it
# Of the least peak, at least so many roundings: how far forces are beyond it, or below a preload, at the last step.
_SETTLED = 1e-7, 1e2
_STEP = 1e-3  # of a misfit, beside that which the largest force takes


class LeastNorm(AbstractClosure):
    """Drives share so that the sum of squares of their forces over their ratings is least.

    ??? example

        ```python
        beam = rx.Mechanism(
            [rx.Body("beam", 40.0, 3.0)],
            [rx.Translational(k, "beam", "ground", (0, y), (0, y), (0, 1)) for k, y in (("L", 0.6), ("R", -0.6))],
        )
        rails = rx.ElasticJoints(beam, {"L": (1e-9, 1e-7), "R": (1e-9, 1e-7)})
        laws = dict.fromkeys(("L.travel", "R.travel"), rx.Harmonic(0.05, 1.0))
        share = rx.LeastNorm({"L.travel": 200.0, "R.travel": 100.0}, rails)  # N
        rx.drive(beam, laws, jnp.linspace(0.0, 1.0, 9), {}, closure=share).rms
        ```

    **Arguments:**

    - `ratings`: by name of the coordinate, N or N m; of all drives that follow laws.
    - `closure`: that of the joints, which are taken as stiff beside the drives: shares are right to 1e-6. Needed only
      where joints are redundant without the drives.
    """

    ratings: dict[str, Array]
    closure: AbstractClosure | None

    def __init__(self, ratings: Mapping[str, ArrayLike], closure: AbstractClosure | None = None):
        self.ratings = _sizes("ratings", ratings)
        if closure is not None:
            check_closure(closure)
        self.closure = closure

    def by_place(self, system: AbstractSystem) -> "LeastNorm":
        return self if self.closure is None else LeastNorm(self.ratings, self.closure.by_place(system))

    def of_drives(self, names: Sequence[str]) -> tuple[Array, Array]:
        _check_all("ratings", self.ratings, names)
        softness = jnp.stack([self.ratings[name] ** -2 for name in names])
        return softness, jnp.zeros_like(softness)

    def clearances(self, system: AbstractSystem) -> Play | None:
        return None if self.closure is None else self.closure.clearances(system)

    def compliance(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        m = len(system.rows)
        if self.closure is None:
            return jnp.zeros((m, m)), jnp.zeros(m)
        W, d = self.closure.compliance(system, state)
        least = jnp.min(jnp.stack([rating**-2 for rating in self.ratings.values()]))
        share = _STIFF * least / jnp.max(jnp.diagonal(W))
        return share * W, share * d


class LeastPeak(AbstractModule):
    """Drives share so that the largest of their forces over their limits is least, at each time.

    ??? example

        ```python
        share = rx.LeastPeak({"L.travel": 100.0, "R.travel": 100.0}, preload={"L.travel": 5.0})  # N
        ```

    **Arguments:**

    - `limits`: by name of the coordinate, N or N m; of all drives that follow laws. A print of the run tells when they
      cannot be kept.
    - `preload`: for some of them, a force that they give at least, so that teeth and nuts stay on one flank; negative
      for the other flank.
    - `closure`: as of `LeastNorm`.
    """

    limits: dict[str, Array]
    preload: dict[str, Array]
    closure: AbstractClosure | None

    def __init__(
        self,
        limits: Mapping[str, ArrayLike],
        *,
        preload: Mapping[str, ArrayLike] | None = None,
        closure: AbstractClosure | None = None,
    ):
        preload = {} if preload is None else preload
        check_kind("preload", preload, Mapping, "forces by name of drive", 'Give {"motor": 5.0}, say.')
        self.limits = _sizes("limits", limits)
        self.preload = {name: as_float(force, "preload") for name, force in preload.items()}
        for name, force in self.preload.items():
            finite("preload", force)
            index_of("preload", name, list(self.limits), " of drives with limits")
        if closure is not None:
            check_closure(closure)
        self.closure = closure

    def shared(
        self,
        forces_of: Callable[[AbstractClosure], np.ndarray],
        without_friction: Callable[[AbstractClosure], np.ndarray],
        names: Sequence[str],
        ts: np.ndarray,
        throw: bool | None,
    ) -> tuple[AbstractClosure, tuple[str, ...]]:
        """The closure that brings it about, given what forces of drives one makes, and what is to be said; where none
        is found an error, or NaN and what that would say."""
        _check_all("limits", self.limits, names)
        norm = LeastNorm(self.limits, self.closure)
        limits = np.array([float(self.limits[name]) for name in names])
        least = np.array([float(self.preload.get(name, 0.0)) for name in names])
        errors, peaks = np.zeros((len(ts), len(names))), np.zeros(0)

        def by(forces_of: Callable[[AbstractClosure], np.ndarray], now: np.ndarray, ways: np.ndarray) -> np.ndarray:
            step = _STEP * (np.nanmax(np.abs(now / limits), initial=0.0) or 1.0)
            changes = [forces_of(_Misfits(norm, ts, errors + step * way)) - now for way in np.moveaxis(ways, 2, 0)]
            return np.stack(changes, axis=2) / step if changes else np.zeros((*now.shape, 0))

        unit = np.broadcast_to(np.diag(1 / limits), (len(ts), len(names), len(names)))
        ways = unit @ _ways(by(without_friction, without_friction(_Misfits(norm, ts, errors)), unit) / limits[:, None])
        beyond, settled = np.zeros(len(ts)), 0.0
        for _ in range(_ROUNDS):
            now = forces_of(_Misfits(norm, ts, errors))
            found = [_programme(*one, limits, least) for one in zip(now, by(forces_of, now, ways), strict=True)]
            steps, peaks = np.array([step for step, _ in found]), np.array([peak for _, peak in found])
            beyond, settled = _beyond(now / limits, least / limits, peaks), tolerance_of(_SETTLED, now)
            errors = errors + np.einsum("tdk,tk->td", ways, steps)
            if np.all(beyond <= settled):
                break
        said, lost = [], np.flatnonzero(beyond > settled)
        if lost.size:
            none = (
                f"No share of the drives was found at {lost.size} of {len(ts)} times, first t = {ts[lost[0]]:.6g}: "
                "joints that the drives press may wedge by their friction."
            )
            if throw is not False:
                raise NoSolutionError(
                    f"{none} Give less preload if there is any, or `LeastNorm`. With `throw=False` the other times are "
                    "given, and NaN at these."
                )
            errors[lost] = np.nan
            said.append(none)
        over = np.flatnonzero(peaks > 1 + _KEPT)
        if over.size:
            worst = int(np.nanargmax(peaks))
            said.append(
                f"The limits of the drives cannot be kept at {over.size} of {len(ts)} times, first t = "
                f"{ts[over[0]]:.6g}: at t = {ts[worst]:.6g} the least peak is {100 * peaks[worst]:.4g} % of them."
            )
        return _Misfits(norm, ts, errors), tuple(said)


class _Misfits(AbstractClosure):
    """A closure, and misfits of the drives at times."""

    closure: AbstractClosure
    ts: Float[Array | np.ndarray, " times"]
    errors: Float[Array | np.ndarray, "times d"]

    def of_drives(self, names: Sequence[str]) -> tuple[Array, Array]:
        return self.closure.of_drives(names)

    def by_place(self, system: AbstractSystem) -> "_Misfits":
        return _Misfits(self.closure.by_place(system), jnp.asarray(self.ts), jnp.asarray(self.errors))

    def compliance(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        return self.closure.compliance(system, state)

    def drive_errors(self, state: State) -> Array:
        return self.errors[jnp.argmin(jnp.abs(self.ts - state.t))]


def _beyond(share: np.ndarray, least: np.ndarray, peaks: np.ndarray) -> np.ndarray:
    """By how much forces over the limits are beyond the least peaks or below the preload, relative; 0 of none."""
    short = np.where(least != 0, np.abs(least) - np.sign(least) * share, 0.0)
    beyond = np.maximum(np.abs(share).max(axis=1) - peaks, short.max(axis=1))
    beyond = np.maximum(beyond, 0.0) / or_one(peaks)
    return np.where(np.all(np.isfinite(share), axis=1), np.where(np.isfinite(peaks), beyond, np.inf), 0.0)


def _ways(by: Float[np.ndarray, "times d d"]) -> Float[np.ndarray, "times d k"]:
    """Misfits over the limits that change forces, given by how much without friction: a projector, up to joints."""
    _, size, ways = np.linalg.svd(np.nan_to_num(by))
    ways = np.where(size[:, :, None] > 0.5, ways, 0.0)
    return np.swapaxes(ways, 1, 2)[:, :, : int((size > 0.5).sum(axis=1).max(initial=0))]


def _programme(forces: np.ndarray, by: np.ndarray, limits: np.ndarray, least: np.ndarray) -> tuple[np.ndarray, float]:
    """The change of misfits, along ways over the limits, that makes the peak over the limits least, and that peak."""
    from scipy.optimize import linprog

    none = np.zeros(by.shape[1])
    if not (np.all(np.isfinite(forces)) and np.all(np.isfinite(by))):
        return none, np.nan
    kept = least != 0
    signs = np.sign(least[kept])[:, None]
    ones, zeros = np.ones((len(limits), 1)), np.zeros((int(kept.sum()), 1))
    share = by / limits[:, None]
    rows = np.vstack([np.hstack([share, -ones]), np.hstack([-share, -ones]), np.hstack([-signs * share[kept], zeros])])
    size = max(np.abs([forces, least] / limits).max(), np.finfo(float).tiny)  # the solver's tolerances are absolute
    now, above = forces / limits / size, np.abs(least / limits / size)
    right = np.concatenate([-now, now, signs[:, 0] * now[kept] - above[kept]])
    cost = np.concatenate([none, [1.0]])
    found = linprog(cost, rows, right, bounds=[(None, None)] * len(none) + [(0, None)], method="highs")
    if found.status != 0:
        raise RedundaxError(
            "Argument `preload` of `LeastPeak` must be one that the drives can keep up, but no share of theirs does. "
            "Preload drives that work against each other."
        )
    return size * found.x[:-1], float(size * found.x[-1])


def _sizes(argument: str, given: Mapping[str, ArrayLike]) -> dict[str, Array]:
    if not isinstance(given, Mapping) or not given:
        raise RedundaxError(
            f"Argument `{argument}` must give a force by name of each drive, but is {given!r}. Write "
            '{"left.travel": 200.0}, say.'
        )
    sizes = {name: as_float(size, argument) for name, size in given.items()}
    for size in sizes.values():
        positive(argument, size)
        finite(argument, size)
    return sizes


def _check_all(argument: str, given: Mapping[str, Array], names: Sequence[str]) -> None:
    if set(given) != set(names):
        raise RedundaxError(
            f"Argument `{argument}` must name each drive that follows a law, {', '.join(names)}, but names "
            f"{', '.join(given)}. Give these, no more and no less."
        )
