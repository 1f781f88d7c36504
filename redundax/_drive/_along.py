"""Positions and velocities of a machine whose drives follow laws, at many times."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._bodies._law_of_time import check_law, law_of_time
from .._equations._assemble import assemble
from .._equations._dense_closing import closing_at
from .._equations._kinematics import model_at
from .._equations._matrices import matrices_of
from .._equations._scaling import Scaling
from .._system._axis import Axis, join
from .._system._driven import Driven
from .._system._names import DRIVE, ByName, index_of
from .._system._state import State
from .._system._system import AbstractSystem, check_system
from .._tools._computing import computing
from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._module import Numbers, as_float, is_concrete, names_in, numpy_of, replace_fields
from .._tools._no_answer import nan_where
from .._tools._numbers import (
    are_known,
    as_arrays,
    as_numbers,
    as_program,
    chosen_of,
    on_numbers,
    stop_gradient,
    tolerance_of,
    xp,
)
from ._follow import begun, follow, follow_known
from ._loads import Moving, moving
from ._roll import velocity_at

T = TypeVar("T")
Laws = Mapping[str, Callable[[Array], Array] | ArrayLike]

# Times that a program takes at once, so that other numbers of them compile nothing; more where a call's own cost tells.
_TOGETHER, _MANY, _MOST = 64, 512, 4096
_NEAR = 2**17  # numbers in matrices of all of these that a core keeps near: twice as many take three times as long
_FREE = 1e-9, 1e3  # singular value, relative to the largest, at least so many roundings, where nothing is held
_NARROW = 0.05  # the same of a position that is told as near to a singular one where a motion ends
_DIP, _ROUNDS, _SINGULAR = 0.3, 4, 1e-5  # of the usual value: worth a look; 64 finer times each; and singular
_NAMED = 8  # free coordinates, at most
_BESIDE = 0.01  # of the way to the next time: where laws are asked which way joints at rest slip


class Path(NamedTuple):
    """A driven system, the scales of its first position, and its positions at all times; NaN where not reached."""

    system: AbstractSystem
    scale: Scaling
    t: Float[Array, " times"]
    q: Float[Array | np.ndarray, "times ..."]

    @property
    def given(self) -> tuple[AbstractSystem, Scaling]:
        """What of it stays the same."""
        return self.system.anonymous, self.scale

    @property
    def beside(self) -> Float[Array, "times 2"]:
        """Times just before and just after each."""
        return _beside(self.t)


def assemble_along(
    system: AbstractSystem,
    laws: Laws,
    ts: Numbers,
    q: ByName | None = None,
    *,
    hold: Sequence[str] = (),
    throw: bool | None = None,
) -> State:
    """The states of a machine whose drives follow laws of time, at successive times.

    Positions go on from time to time, in smaller steps where that is needed: the mode of assembly is kept and turns
    are counted.

    ??? example

        ```python
        smooth = rx.mechanisms.wojtyra2020()
        ts = jnp.linspace(0.0, 1.0, 11)
        states = rx.assemble_along(smooth, {"A.angle": rx.Polynomial([0.8, 1.0])}, ts, state.q)
        states.q  # shape (11, 12)
        ```

    **Arguments:**

    - `system`: a `Mechanism` or `System`, of at most 6000 coordinates and rows in all.
    - `laws`: a function of time for each coordinate that is driven, by its name as of a joint, "motor.angle" or
      "guide.travel", or of a body in the plane, "crank.phi"; a number stands for a coordinate that rests there. They
      come on top of drivers among the joints. `rx.Trapezoid`, `rx.SCurve`, `rx.Cycloidal`, `rx.Harmonic`,
      `rx.Polynomial` and `rx.Sampled` are ready.
    - `ts`: times, s, ascending.
    - `q`: guess of the position at the first of them, as of `assemble`.
    - `hold`: names of coordinates that rest where the first position has them.
    - `throw`: whether to raise an error where a position is not reached; by default outside of `jit` and `vmap`.

    **Returns:** a `State` with an axis for times in front. Positions that are not reached are NaN.

    **Raises:** `RedundaxError` for laws that leave coordinates free, with their names, and `NoSolutionError` with the
    time at which a motion ends, at a singular position or out of reach.
    """
    path = along(system, laws, ts, q, hold, throw)
    asked = path.q, path.t, path.beside
    known = are_known(path)
    found = in_batches(path, _moving_batch, path.given, asked) if known else _moving_of(*path.given, *asked)
    return as_arrays(State(found.q, found.qd, path.t))


def along(
    system: AbstractSystem,
    laws: Laws,
    ts: Numbers,
    q: ByName | None,
    hold: Sequence[str],
    throw: bool | None,
    start: State | None = None,
) -> Path:
    """What both calls need of the motion; it is assembled from `q` where no start is given."""
    check_system(system)
    system, times = system.whole, times_of(ts)
    driven = with_laws(system, laws)
    known = are_known(driven, times, q)
    if system.velocity_rows and not known:
        rows = [system.rows.labels[row] for row in system.velocity_rows]
        raise RedundaxError(
            f"Argument `system` has rows of velocity, {', '.join(rows[:_NAMED])}, so that positions depend on the way "
            "there, which has no derivative here. Call it outside of `jit`, `vmap` and `grad`, or `rx.simulate` the "
            "system with `SpeedDriver`s."
        )
    start = started(driven, laws, times, q, throw) if start is None else start
    if hold:
        driven = with_laws(system, laws_and_held(system, laws, hold, start))
    if known:
        scale, matrix = scaled(driven, start)
        _check_freedom(driven, scale, np.asarray(matrix), start)
        q, reached = _followed(driven.anonymous, scale, start, times)
        if throw is not False and not np.all(reached):
            raise _lost(driven, scale, start, q, times, reached)
        return Path(driven, scale, times, q)
    still, q0, at = stop_gradient((driven.anonymous, start.q, times))
    scale, _ = stop_gradient(scaled(still, stop_gradient(start)))
    track = follow(still, scale, begun(q0, at[0], len(system.coordinates)), at)
    return Path(driven, scale, times, nan_where(~track.reached[:, None], track.q))


def started(system: AbstractSystem, laws: Laws, ts: Numbers, q: ByName | None, throw: bool | None) -> State:
    """Where the motion of a system with laws begins, at their first values."""
    t, base = times_of(ts)[0], system.undriven if laws else system
    positions = {name: jnp.asarray(law_of_time(law, f"laws[{name!r}]")(t)) for name, law in laws.items()}
    traced = not are_known(system, t, q)
    if traced or are_known(positions):
        state = assemble(base, q, t=t, positions=positions, throw=throw)
        if traced or are_known(state):
            return state
    raise RedundaxError(
        "Argument `laws` must hold what `jit`, `vmap` or `grad` traces, but a function reads it from outside. "
        "Write `jax.tree_util.Partial(lambda size, t: size * jnp.sin(t), size)`, say, or take a ready law."
    )


def values_of(system: AbstractSystem, state: State) -> Array:
    """Where the coordinates that can follow a law are."""
    joints = system.joint_coordinates.positions(state)
    return jnp.concatenate([state.q, joints]) if system.adds else joints


@partial(on_numbers, jit=False)
def scaled(system: AbstractSystem, state: State) -> tuple[Scaling, Float[Array, "m n"]]:
    """The scales of a position, and K there, by programs that the system without its drives has anyway."""
    base, places = system.undriven, getattr(system, "places", ())
    still = replace_fields(state, qd=xp.zeros_like(state.qd))
    scale = matrices_of(base).closing.scaling(base.anonymous, still)
    slopes = closing_at(base.anonymous, still.q, still.qd, still.t)[2] * scale.coordinates
    m = len(base.rows)
    if base.velocity_rows:
        rolling = model_at(base.anonymous, still).jacobian * scale.coordinates
        slopes = xp.concatenate([rolling, slopes[m:]])
    own = slopes[m + np.array(places, int)]
    rows = xp.concatenate([scale.rows, xp.linalg.norm(own, axis=1)])
    return scale._replace(rows=rows), xp.concatenate([slopes[:m], own]) / rows[:, None]


def with_laws(system: AbstractSystem, laws: Laws) -> AbstractSystem:
    """The system with a drive for each law."""
    if not isinstance(laws, Mapping):
        raise RedundaxError(
            f"Argument `laws` must give a law of time by name of coordinate, but is {laws!r}. Write "
            '{"motor.angle": rx.Harmonic(0.1, 2.0)}, say.'
        )
    if not laws:
        return system
    known, functions, places, kinds = coordinates_of(system), [], [], []
    for name, law in laws.items():
        place = index_of("laws", name, known.labels, " of coordinates")
        functions.append(law_of_time(law, f"laws[{name!r}]"))
        check_law("laws", name, functions[-1])
        places.append(place if system.adds else place + len(system.coordinates))
        kinds.append("moment" if known.angular[place] else "force")
    drives = Axis(tuple(f"{name}{DRIVE}" for name in laws), tuple(kinds))
    return Driven(system, tuple(functions), tuple(places), drives)  # pyright: ignore[reportCallIssue]


def coordinates_of(system: AbstractSystem) -> Axis:
    """What can follow a law: coordinates, where they add, and those of joints."""
    own, joints = system.names.coordinates, system.names.joint_coordinates
    return join([own, joints]) if system.adds else joints


def times_of(ts: Numbers) -> Array:
    """Times, checked."""
    times = as_float(ts, "ts")
    known = is_concrete(times)
    if times.ndim != 1 or not times.size or (known and not np.all(np.isfinite(times))):
        raise RedundaxError(
            f"Argument `ts` must be a vector of one finite time or more, but has shape {times.shape}. "
            "Give `jnp.linspace(0.0, 1.0, 101)`, say."
        )
    if known and np.any(np.diff(np.asarray(times)) <= 0):
        raise RedundaxError("Argument `ts` must hold times in ascending order, but some do not. Sort them.")
    return times


def _beside(t: Array) -> Float[Array, "times 2"]:
    """Times just before and just after each, but before the first and after the last, where laws need say nothing."""
    xp = numpy_of(t)
    t = xp.asarray(t)
    way, none = _BESIDE * xp.diff(t), xp.zeros(1, t.dtype)
    return xp.stack([t - xp.concatenate([none, way]), t + xp.concatenate([way, none])], axis=1)


def laws_and_held(system: AbstractSystem, laws: Laws, hold: Sequence[str], start: State) -> Laws:
    """The laws, and those of coordinates that rest where the first position has them."""
    hold = names_in("hold", hold)
    if not hold:
        return laws
    labels = coordinates_of(system).labels
    places = [index_of("hold", name, labels, " of coordinates") for name in hold]
    if both := [name for name in hold if name in laws]:
        raise RedundaxError(
            f"Argument `hold` must name coordinates that have no law, but {', '.join(both)} has one in `laws`. Leave "
            "it out of one of them."
        )
    values = values_of(system, start)
    return dict(laws) | {name: values[place] for name, place in zip(hold, places, strict=True)}


def decide(system: AbstractSystem, start: State) -> bool:
    """Whether the constraints and laws of a driven system leave no freedom at its first position."""
    matrix = np.asarray(scaled(system, start)[1])
    return bool(np.all(np.isfinite(matrix))) and not _left_free(matrix)[0]


def _left_free(matrix: np.ndarray) -> tuple[int, np.ndarray]:
    """How many directions are left free, the last of those that are given."""
    with computing():
        values, axes = np.linalg.svd(matrix)[1:]
    return matrix.shape[1] - int(np.sum(values > tolerance_of(_FREE, values) * values[0])), axes


def _check_freedom(system: AbstractSystem, scale: Scaling, matrix: np.ndarray, start: State) -> None:
    """Refuse laws that leave coordinates free."""
    if not np.all(np.isfinite(matrix)):  # there is no position
        return
    with computing():
        left, axes = _left_free(matrix)
        if not left:
            return
        loose = np.asarray(scale.coordinates)[:, None] * axes[-left:].T
        q, t = as_numbers((start.q, start.t))
        slopes = closing_at(system.undriven.anonymous, q, np.zeros(len(loose)), t)[2][len(system.undriven.rows) :]
        moves = np.linalg.norm(slopes @ loose, axis=1)
    names, n = system.names, len(system.coordinates)
    parts = [(names.joint_coordinates, moves[n:]), *([(names.coordinates, moves[:n])] if system.adds else [])]
    free = [[k for k, move in zip(axis.labels, of, strict=True) if move > 0.1 * of.max()] for axis, of in parts]
    words = ", ".join(next(filter(None, free), [])[:_NAMED])
    raise RedundaxError(
        f"Argument `laws` must leave no freedom, but {left} {'is' if left == 1 else 'are'} left at the first position: "
        f"{words or 'bodies'} can move there. Give a law to one of them, or its name to `hold`; `rx.simulate` moves "
        "what is free, with drivers among the joints. If nothing should be free, the first position is a singular one: "
        "start beside it."
    )


def _followed(system: AbstractSystem, scale: Scaling, start: State, times: Array) -> tuple[np.ndarray, np.ndarray]:
    """Positions at known times, chunk after chunk; NaN where they are not reached."""
    track = begun(start.q, start.t, len(system.coordinates))
    found, reached, ts = [], [], np.asarray(times)
    size = together(ts.size)
    for first in range(0, ts.size, size):
        part = ts[first : first + size]
        full = np.pad(part, (0, size - part.size), mode="edge")
        out = follow_known(system, scale, track, jnp.asarray(full))
        ok = np.asarray(out.reached)[: part.size]
        found.append(chosen_of(ok, np.asarray(out.q)[: part.size], np.nan))
        reached.append(ok)
        track = out.end
        if not ok.all():
            left = ts.size - first - part.size
            found.append(np.full((left, *out.q.shape[1:]), np.nan))
            reached.append(np.zeros(left, bool))
            break
    return np.concatenate(found), np.concatenate(reached)


def together(count: int) -> int:
    """How many of as many times a program takes at once."""
    return next((size for size in (_TOGETHER, _MANY) if count <= 4 * size), _MOST)


def in_batches(path: Path, program: Callable[..., T], fixed: tuple, arrays: tuple) -> T:
    """A batched program on known numbers of a path, some at a time, the last ones filled up."""
    near = 2 ** int(np.log2(max(_NEAR / len(path.system.rows) ** 2, 1)))
    count, parts, size = len(arrays[0]), [], min(together(len(path.t)), near)
    arrays = jax.tree.map(np.asarray, arrays)
    for first in range(0, count, size):
        part = jax.tree.map(lambda x, first=first: x[first : first + size], arrays)
        own = len(part[0])
        full = part
        if own < size:
            full = jax.tree.map(lambda x, own=own: np.concatenate([x, np.repeat(x[-1:], size - own, 0)]), part)
        out = program(*fixed, *as_arrays(full))
        parts.append(jax.tree.map(lambda x, own=own: np.asarray(x)[:own], out))
    return jax.tree.map(lambda *x: np.concatenate(x), *parts)


def _moving_of(system: AbstractSystem, scale: Scaling, q: Array | np.ndarray, t: Array, beside: Array) -> Moving:
    return jax.vmap(lambda *at: moving(system, scale, *at)[0])(q, t, beside)


_moving_batch = as_program(_moving_of)


def narrow_places(path: Path, weakest: np.ndarray) -> tuple[str, ...]:
    """What is to be said of singular positions that lie between known times, found by finer and finer times."""
    reached = np.isfinite(np.asarray(path.q)).reshape(len(path.t), -1).all(axis=1)
    path, weakest = path._replace(t=np.asarray(path.t)[reached], q=np.asarray(path.q)[reached]), weakest[reached]
    t = np.asarray(path.t)
    if len(t) < 3 or not np.all(np.isfinite(weakest)):
        return ()
    usual, padded = float(np.median(weakest)), np.concatenate([[np.inf], weakest, [np.inf]])
    least = (weakest <= padded[:-2]) & (weakest <= padded[2:]) & (weakest < _DIP * usual)
    ends = [_narrowed(path, max(k - 1, 0), min(k + 1, len(t) - 1)) for k in np.flatnonzero(least)[:_NAMED].tolist()]
    found = [f"{at:.6g}" for at, value in ends if value < _SINGULAR * usual]
    if not found:
        return ()
    return (
        f"The motion passes a singular position at t = {', '.join(found)}: beside it loads may grow without bound, and "
        "branches of motion meet there.",
    )


def instant(path: Path, k: int, of: Callable[[Path], Callable[[int], bool]]) -> float:
    """When between a time and the one before it begins what is so at that time, to 1/63^4 of the way or less.

    - `of`: gives of a path what tells of each of its times whether it is so.
    """
    q, (low, high) = path.q[k - 1], np.asarray(path.t)[k - 1 : k + 1].tolist()
    for _ in range(_ROUNDS):
        finer = between(path, q, low, high, together(len(path.t)))
        is_so, first, last = of(finer), 0, len(finer.t) - 1
        while last - first > 1:
            middle = (first + last) // 2
            first, last = (first, middle) if is_so(middle) else (middle, last)
        q, low, high = finer.q[first], float(finer.t[first]), float(finer.t[last])
    return high


def between(path: Path, q: Array | np.ndarray, low: float, high: float, count: int = _TOGETHER) -> Path:
    """The path from a position of it on, at so many times between two."""
    times = jnp.linspace(low, high, count)
    track = begun(jnp.asarray(q), times[0], len(path.system.coordinates))
    return path._replace(t=times, q=follow_known(*path.given, track, times).q)


def _narrowed(path: Path, low: int, high: int) -> tuple[float, float]:
    """When between two of the times the least singular value is least, and that."""
    q, t = path.q[low], (float(path.t[low]), float(path.t[high]))
    at, value = t[0], np.inf
    for _ in range(_ROUNDS):
        finer = between(path, q, *t)
        values = np.asarray(_moving_batch(*path.given, finer.q, finer.t, finer.beside).weakest)
        j = int(np.argmin(np.where(np.isfinite(values), values, np.inf)))
        at, value = (float(finer.t[j]), float(values[j])) if values[j] < value else (at, value)
        q, t = finer.q[max(j - 1, 0)], (float(finer.t[max(j - 1, 0)]), float(finer.t[min(j + 1, _TOGETHER - 1)]))
    return at, value


def _lost(
    system: AbstractSystem, scale: Scaling, start: State, q: np.ndarray, times: Array, reached: np.ndarray
) -> NoSolutionError:
    """What to say of a motion that ends."""
    last = int(np.argmin(reached))
    t = np.asarray(times)
    at = (q[max(last - 1, 0)], t[last]) if last else (np.asarray(start.q), t[0])
    if system.velocity_rows and not velocity_at(system.anonymous, scale, *map(jnp.asarray, at))[1]:
        return NoSolutionError(
            f"The motion ends at t = {float(at[1]):.6g}: rows of velocity and laws prescribe speeds there that "
            "contradict each other. Give a law to fewer wheels, or laws that agree."
        )
    if last == 0:
        return NoSolutionError(f"The motion does not leave its first position, at t = {t[0]:.6g}.")
    track = begun(jnp.asarray(q[last - 1]), jnp.asarray(t[last - 1]), len(system.coordinates))
    end = follow_known(system.anonymous, scale, track, jnp.full(_TOGETHER, t[last])).end
    _, matrix = scaled(system, State(end.q, end.rate, end.t))
    values = np.linalg.svd(np.asarray(matrix), compute_uv=False)
    weakest = values[-1] / values[0]
    why = (
        f"there the position is all but singular (least singular value {weakest:.1e} of the largest): a dead centre, "
        "at which the drives no longer decide the motion or cannot take it further"
        if weakest < _NARROW
        else "from there on no position follows the laws"
    )
    return NoSolutionError(
        f"The motion ends at t = {float(end.t):.6g}: {why}. Change the laws or lengths, or let `throw=False` give the "
        "motion up to there, and NaN beyond."
    )
