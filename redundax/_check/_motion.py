"""States of a machine along a log: positions by its coordinates, time by time, then velocities and accelerations

Each position is that on the constraints which is nearest to the log's coordinates, from the one before. Rates and
accelerations that a log does not have are derivatives of splines through its columns.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from .._bodies._frame import AbstractPose
from .._bodies._joint_coordinates import coefficients
from .._bodies._joints import AbstractJoint
from .._bodies._mechanism import Mechanism
from .._equations._dense_closing import closing_at
from .._equations._kinematics import along_motion
from .._system._names import index_of
from .._system._state import State
from .._tools._computing import computing
from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._numbers import Numeric, of_model, or_one
from ._log import Log

_TOGETHER = 64  # times that a program takes at once, so that other numbers of them compile nothing
_STEP = 0.15  # rad, or lengths of the machine: what Newton's method does at once without another assembly mode
_STEPS = 30  # of Newton's method, which takes 3 to 6
_DONE = 1e-13  # a scaled step that is rounding
_OPEN = 1e-6  # relative: constraints of few digits close to that
_RANK = 1e-6  # singular values below, relative to the largest: numbers of files have no more digits
_DEGREE, _LOWER = 5, 3  # of splines, whose second derivatives are then smooth; and of what tells how good they are


class Drive(NamedTuple):
    """Coordinates that are driven: their places among those of `Models`; accelerations, (times, drives); and by how
    much these differ from those of a lower spline."""

    names: tuple[str, ...]
    places: np.ndarray
    accelerations: np.ndarray
    doubt: np.ndarray


class Scale(NamedTuple):
    """Of coordinates, (n,), and rows, (m,), so that lengths and angles compare; and a length of the machine, m."""

    coordinates: np.ndarray
    rows: np.ndarray
    length: float


class Path(NamedTuple):
    """States over time, (times, ...), the scales, what is driven, how far the log's coordinates are from those of the
    machine, rad or m, and columns whose derivatives are those of splines."""

    times: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    scale: Scale
    drive: Drive
    apart: float
    splined: tuple[str, ...]


class Models(NamedTuple):
    """The model at each time: q, Phi, Phi' and gamma, Phi_q, M, Q; slopes of coordinates by d, and what of their
    accelerations the velocity adds, where they are asked for."""

    q: Numeric
    value: Numeric
    rate: Numeric
    gamma: Numeric
    jacobian: Numeric
    mass: Numeric
    load: Numeric
    slopes: Numeric
    bend: Numeric


class Reactions(NamedTuple):
    """By stack, over time: reactions by the rows of each joint on a body, their points on it and on the other body,
    global, axes of the joint on body j; and the axes of all bodies and the ground."""

    by_rows: list[Numeric]
    points: list[Numeric]
    points_beyond: list[Numeric]
    turned: list[Numeric]
    axes: Numeric


T = TypeVar("T")


def in_batches(program: Callable[..., T], *arrays: np.ndarray) -> T:
    """What a program of one time gives at all, some at a time, the last ones filled up."""
    parts = []
    for first in range(0, len(arrays[0]), _TOGETHER):
        own = [np.asarray(x[first : first + _TOGETHER]) for x in arrays]
        size = len(own[0])
        full = [np.concatenate([x, np.repeat(x[-1:], _TOGETHER - size, 0)]) for x in own]
        found = program(*full)
        parts.append(jax.tree.map(lambda x, size=size: np.asarray(x)[:size], found))
    return jax.tree.map(lambda *x: np.concatenate(x), *parts)


def models(
    system: Mechanism, times: np.ndarray, q: np.ndarray, qd: np.ndarray, coordinates: bool, d: np.ndarray | None = None
) -> Models:
    """The model at all times, at q [+] d; of `coordinates` too, or without them."""
    moved = np.zeros_like(qd) if d is None else d
    return in_batches(lambda *x: _models(system.anonymous, coordinates, *x), times, q, qd, moved)


@of_model
def _models(system: Mechanism, coordinates: bool, times: Array, q: Array, qd: Array, d: Array) -> Models:
    return jax.vmap(lambda *given: _model(system, coordinates, *given))(times, q, qd, d)


def _model(system: Mechanism, coordinates: bool, t: Array, q: Array, qd: Array, d: Array) -> Models:
    q = system.retract(q, d)
    state, joints, none = State(q, qd, t), system.joint_coordinates, jnp.zeros_like(qd)
    motion = along_motion(system, state)
    slopes, bend = jnp.zeros((0, qd.size)), jnp.zeros(0)
    if coordinates:
        slopes = jax.jacfwd(lambda d: joints.positions(State(system.retract(q, d), none, t)))(none)
        bend = joints.motion(state, none).acceleration
        if system.adds:
            slopes, bend = jnp.concatenate([jnp.eye(qd.size), slopes]), jnp.concatenate([none, bend])
    model = system.jacobian(q, t), system.mass(q, t), system.load(state)
    return Models(q, motion.value, motion.rate, motion.gamma, *model, slopes, bend)


def reactions(system: Mechanism, path: "Path", other: bool) -> tuple[Reactions, Reactions]:
    """Reactions of joints on the body that is told of and, where they are asked for, on the other."""
    arrays = path.times, path.q, path.qd
    told = in_batches(lambda *x: _reactions(system.anonymous, False, *x), *arrays)
    if not other:
        return told, told
    if all(stack.element.point_on(end) is not None for stack in system.joints for end in "ij"):
        return told, _opposite(told)
    return told, in_batches(lambda *x: _reactions(system.anonymous, True, *x), *arrays)  # the ground may take a part


@of_model
def _reactions(system: Mechanism, other: bool, times: Array, q: Array, qd: Array) -> Reactions:
    joints = system.joint_coordinates.opposite if other else system.joint_coordinates

    def of_one(t: Array, q: Array, qd: Array) -> Reactions:
        poses = system.poses(q)
        of_j = (jnp.arange(poses.r.shape[0]) == poses.r.shape[0] - 1) != other
        found = [stack.over(_points, (poses, of_j)) for stack in system.joints]
        turned = [stack.over(_axes, poses) for stack in system.joints]
        own, beyond = ([points[which] for points in found] for which in (0, 1))
        return Reactions(
            [part for part, _ in coefficients(joints, State(q, qd, t))], own, beyond, turned, _matrix(poses)
        )

    return jax.vmap(of_one)(times, q, qd)


def _points(joint: AbstractJoint, i: tuple[AbstractPose, Array], j: tuple[AbstractPose, Array]) -> tuple[Array, Array]:
    """Where the points of a joint are, global, that on the body which its reaction is told of first."""
    (pose_i, of_j), pose_j = i, j[0]
    none = jnp.zeros_like(pose_i.r)
    on_i, on_j = (
        pose.point(none if (own := joint.point_on(end)) is None else own)
        for end, pose in (("i", pose_i), ("j", pose_j))
    )
    return jnp.where(of_j, on_j, on_i), jnp.where(of_j, on_i, on_j)


def _opposite(told: Reactions) -> Reactions:
    """Reactions on the other bodies, about the points there."""
    found = []
    for by_row, own, beyond in zip(told.by_rows, told.points, told.points_beyond, strict=True):
        d, arm = own.shape[-1], (own - beyond)[..., None]
        force, moment = by_row[:, :, :d], by_row[:, :, d:]
        if d == 3:
            moment = moment + np.cross(arm, force, axis=2)
        else:
            moment = moment + arm[:, :, :1] * force[:, :, 1:] - arm[:, :, 1:] * force[:, :, :1]
        found.append(-np.concatenate([force, moment], axis=2))
    return Reactions(found, told.points_beyond, told.points, told.turned, told.axes)


def _axes(joint: AbstractJoint, _: AbstractPose, j: AbstractPose) -> Array:
    """Axes of a joint on body j, global."""
    own = joint.axes_on("j")
    return _matrix(j) if own is None else _matrix(j) @ own


def _matrix(pose: PyTree) -> Array:
    """Axes of bodies as columns; in the plane they are a pair."""
    return jnp.stack(pose.axes, axis=-1) if isinstance(pose.axes, tuple) else pose.axes


def scale_by(system: Mechanism, jacobian: np.ndarray) -> Scale:
    """Scales by the constraints at a position: the length is the largest arm of a force."""
    angular = np.asarray(system.coordinates.angular)
    length = float(np.abs(jacobian[~np.asarray(system.rows.angular)][:, angular]).max(initial=0.0)) or 1.0
    coordinates = np.where(angular, 1 / length, 1.0)
    rows = np.linalg.norm(jacobian * coordinates, axis=1)
    return Scale(coordinates, or_one(rows), length)


def path_of(system: Mechanism, log: Log, q: Numeric, drives: Sequence[str] | None) -> Path:
    """The states along a log whose coordinates are columns.

    **Raises:** `RedundaxError` where coordinates of the log leave the machine free, `NoSolutionError` where there is
    no position.
    """
    names = list(log.positions)
    labels = (*system.names.coordinates.labels, *system.names.joint_coordinates.labels)
    for name in drives or ():
        index_of("drives", name, names, " of columns of coordinates")
    m = len(system.rows)
    places = np.array([m + index_of("log", name, labels) for name in names], int)
    none = np.zeros(len(system.coordinates), bool)
    wraps = np.concatenate([none, np.asarray(system.joint_coordinates.wraps, bool)])  # positions but for whole turns
    given = np.stack([log.positions[name] for name in names], axis=-1) if names else np.zeros((log.times.size, 0))
    with computing():
        slopes = closing_at(system.anonymous, q, np.zeros(len(system.coordinates)), log.times[0])[2]
        scale = scale_by(system, slopes[:m])
        found, apart = _followed(system, scale, log.times, given, places, wraps, q)
        return moving(system, scale, log, found, (names, places, drives), apart)


def moving(
    system: Mechanism, scale: Scale, log: Log, q: np.ndarray, known: tuple, apart: float, qd: np.ndarray | None = None
) -> Path:
    """Velocities and what drives, at positions; `known` are names of coordinates, their places, and which drive."""
    names, places, drives = known
    n, m = len(system.coordinates), len(system.rows)
    still = models(system, log.times, q, np.zeros((len(q), n)), bool(names))
    own = places - m - (0 if system.adds else n)
    slopes = still.slopes[:, own]
    rows = still.jacobian * scale.coordinates / scale.rows[:, None]
    freedom = n - _rank(rows[0])
    if drives is None:
        drives = [*log.drives] or (names if len(names) == freedom else [])
    both = np.concatenate([rows, slopes * scale.coordinates], axis=1)
    if qd is None and freedom and (left := n - _rank(both[0])):
        have = ", ".join(system.names.joint_coordinates.labels[:8])
        raise RedundaxError(
            f"Argument `log` must tell the motion, but with its coordinates {left} freedom{'s are' * (left > 1)}"
            f"{' is' * (left == 1)} left. Add columns of coordinates of joints, such as {have or 'none here'}."
        )
    splined: list[str] = []
    if qd is None:
        rates = np.stack([_rate(log, name, splined) for name in names], axis=-1) if names else np.zeros((len(q), 0))
        wanted = np.concatenate([-still.rate / scale.rows, rates], axis=1)
        qd = scale.coordinates * _least(both, wanted)
    else:
        miss = (-still.rate - np.einsum("tmn,tn->tm", still.jacobian, qd)) / scale.rows
        qd = qd + scale.coordinates * _least(rows, miss)
    chosen = [names.index(name) for name in drives]
    both = [[_acceleration(log, name, splined, degree) for name in drives] for degree in (_DEGREE, _LOWER)]
    found, other = (np.stack([np.zeros(len(q)), *columns], axis=-1)[:, 1:] for columns in both)
    drive = Drive(tuple(drives), own[chosen], found, other - found)
    return Path(log.times, q, qd, scale, drive, apart, tuple(dict.fromkeys(splined)))


def _least(matrices: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The least solution at each time, NaN where there are no numbers, as of a law that has no rate at its start."""
    none = np.full(matrices.shape[-1], np.nan)
    return np.stack(
        [
            np.linalg.lstsq(a, b, rcond=_RANK)[0] if np.all(np.isfinite(b)) else none
            for a, b in zip(matrices, values, strict=True)
        ]
    )


def _rank(matrix: np.ndarray) -> int:
    values = np.linalg.svd(matrix, compute_uv=False) if matrix.size else np.zeros(0)
    return int(np.sum(values > _RANK * values.max(initial=0.0)))


def _followed(
    system: Mechanism,
    scale: Scale,
    times: np.ndarray,
    given: np.ndarray,
    places: np.ndarray,
    wraps: np.ndarray,
    q: Numeric,
) -> tuple[np.ndarray, float]:
    """Positions at all times, and how far coordinates are from those given."""
    m, n = len(system.rows), len(system.coordinates)
    turns = wraps[places - m]
    unit = np.array([1.0 if turn else scale.length for turn in turns])
    q, out, apart = np.asarray(q), [], 0.0
    found = closing_at(system.anonymous, q, np.zeros(n), times[0])[1][places]
    t, last, base = times[0], found, None
    for k, (time, target) in enumerate(zip(times, given, strict=True)):
        change = np.where(turns, _turn(target - last), target - last) if k == 0 else target - last
        count = max(1, int(np.ceil(np.abs(change / unit).max(initial=0.0) / _STEP)))
        for step in range(1, count + 1):
            wish, then = last + change * step / count, t + (time - t) * step / count
            q, base, misfit, found = _newton(
                system, scale, q, then, (wish, places, turns, unit), base if count == 1 else None
            )
            if not misfit < _OPEN:
                raise NoSolutionError(
                    f"At t = {time:.6g} the loops do not close at the coordinates of the log, by {misfit:.1g} of the "
                    "size of the machine. Check units, signs and zeros of the columns, or give `q` near the first one."
                )
        apart = max(apart, float(np.abs(np.where(turns, _turn(found - target), found - target)).max(initial=0.0)))
        out.append(q)
        last, t = target, time
    return np.stack(out), apart


def _newton(
    system: Mechanism, scale: Scale, q: np.ndarray, t: float, wish: tuple, start: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """The position on the constraints next to wanted coordinates, how far it is from q, the misfit left, and the
    coordinates there."""
    target, places, turns, unit = wish
    m, d = len(system.rows), np.zeros(len(system.coordinates)) if start is None else start
    which, alone = np.concatenate([np.arange(m), places]), False
    at, left, values = q, np.inf, np.zeros(0)
    for _ in range(_STEPS):
        at, values, slopes = closing_at(system.anonymous, q, scale.coordinates * d, t)
        apart = values[places] - target
        residual = np.concatenate([values[:m] / scale.rows, np.where(turns, _turn(apart), apart) / unit])
        matrix = slopes[which] * scale.coordinates / np.concatenate([scale.rows, unit])[:, None]
        if alone:
            residual, matrix = residual[:m], matrix[:m]
        if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(matrix))):  # as of a law of time that ends
            return at, d, np.inf, values[places]
        step = np.linalg.lstsq(matrix, -residual, rcond=_RANK)[0]
        left, size = float(np.abs(residual[:m]).max(initial=0.0)) / scale.length, float(np.abs(step).max(initial=0.0))
        d = d + step * min(1.0, 1.0 / max(size, 1.0))
        if size < _DONE * scale.length or (size < _OPEN and not np.any(residual)):
            break
        # more coordinates than freedoms, of few digits, do not all fit: the constraints have the last word
        alone = alone or (len(places) > 0 and size < _OPEN * scale.length)
    return at, d, left, values[places]


def nearest(system: Mechanism, times: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, Scale]:
    """Positions on the constraints next to some that meet them but for digits, and the scales of the first."""
    none = np.zeros((len(q), len(system.coordinates)))
    d, left, scale = none, np.full(len(q), np.inf), None
    for _ in range(_STEPS):
        found = models(system, times, q, none, False, d)
        q, scale = found.q, scale or scale_by(system, found.jacobian[0])
        residual = found.value / scale.rows
        left = np.abs(residual).max(axis=1) / scale.length
        step = -_least(found.jacobian * scale.coordinates / scale.rows[:, None], residual)
        if not np.nanmax(np.abs(step)) > _DONE * scale.length:
            break
        d = scale.coordinates * step
    worst = int(np.argmax(np.where(np.isfinite(left), left, np.inf)))
    if scale is None or not left[worst] < _OPEN:
        raise NoSolutionError(
            f"At t = {times[worst]:.6g} the loops do not close at the positions of the log, by {left[worst]:.1g} of "
            "the size of the machine. Check that the log is of this model."
        )
    return q, scale


def _turn(angle: np.ndarray) -> np.ndarray:
    """Angles less whole turns."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def _rate(log: Log, name: str, splined: list[str]) -> np.ndarray:
    if name in log.rates:
        return log.rates[name]
    splined.append(name)
    return _slope(log, log.positions[name], 1, _DEGREE)


def _acceleration(log: Log, name: str, splined: list[str], degree: int) -> np.ndarray:
    if name in log.accelerations:
        return log.accelerations[name]
    splined.append(name)
    known = name in log.rates
    return _slope(log, log.rates[name] if known else log.positions[name], 1 if known else 2, degree)


def _slope(log: Log, values: np.ndarray, order: int, degree: int) -> np.ndarray:
    from scipy.interpolate import make_interp_spline

    if log.times.size <= _DEGREE:
        raise RedundaxError(
            f"Argument `log` must have more than {_DEGREE} times, or columns of rates and accelerations, but has "
            f"{log.times.size} times. Add columns with ' and '' behind the name of the coordinate."
        )
    return make_interp_spline(log.times, values, k=degree).derivative(order)(log.times)
