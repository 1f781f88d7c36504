"""How much of its drive a mechanism at rest can be held by friction within given limits: a linear programme,

    lambda = max lambda   with   lambda g + S^T tau = 0,   lo <= tau <= hi.

At these limits the load may grow to lambda times its size, or the share 1 / lambda of the limits will do. The dual
names the motion w that is held least: for any w with w^T g = 1

    lambda <= sum_j max(-(S w)_j lo_j, -(S w)_j hi_j).

Joints are in one part where S_j . S_k joins them. Parts are held one by one, lambda being the least of theirs, and one
with a single freedom needs no programme. The programmes of many cases are one, block by block.

Where the slips of a joint share one friction its limits are a ball in f = tau / arms, and the dual is a sum of norms,

    lambda = min_w sum_j r_j |x_j| - c . S w,   x = arms S w,   w . g = 1,

with the radius r of each ball, and the middle c and half the length r of each interval. `_within_balls` finds w and f
together for all cases at once, by Newton's method on x sqrt(|x|^2 + eps^2)^-1 r + f = 0 as eps goes to 0 (Andersen,
Christiansen, Conn and Overton 2000, SIAM Journal on Scientific Computing 22, 243): each w is an upper bound, and each f
that holds, made smaller until it fits, a lower one. One such joint alone needs no programme: the least friction that
holds g is the least of all.
"""

from typing import NamedTuple

import numpy as np

from .._at_rest import NONE, ReducedForce

_BLOCKS = 64  # cases in one programme
_TOLERANCE = 1e-10
# Steps at most; the relative distance of both bounds of lambda that is none, and the one by what all friction can hold,
# with eps as small, which is what rounding leaves; and the distance from which on lambda is not known.
_STEPS, _CUT, _NOTHING, _MEETS = 60, 1e-10, 1e-12, 1e-8
_SMALL = 1e-4  # lambda, by that, below which friction need not hold its drive to _CUT of it
_FLAT = 1e-17  # curvature, relative to the largest, that is rounding
# Parts of a step that are tried, and of the way out of a ball; and a step, in sizes of w, at most.
_SHORTER, _WITHIN, _LONGEST = (1.0, 0.5, 0.2, 0.05, 0.01), 0.95, 10.0


class Part(NamedTuple):
    """Joints that move apart from the others: which, shape (p,); g, shape (d,), and S, shape (p, d), of them alone.

    `arms` are those of the slips, shape (p,), `balls` the slips of each joint that has several with one friction.
    """

    joints: np.ndarray
    load: np.ndarray
    slips: np.ndarray
    arms: np.ndarray
    balls: list[np.ndarray]


class Capacity(NamedTuple):
    """What friction can hold of the drive, case by case.

    - `most`: lambda, shape (s,); NaN where the programme failed.
    - `least`: friction that holds the drive, shape (s, p), within the least share of the limits, part by part.
    - `bound`: an upper bound of lambda, shape (s,), by the dual: it holds even where the programme is not exact.
    """

    most: np.ndarray
    least: np.ndarray
    bound: np.ndarray


def parts_of(drive: ReducedForce) -> list[Part]:
    """The parts that are driven, and one without joints where something drives a motion that slips nowhere."""
    from scipy.sparse.csgraph import connected_components  # here, because its import takes a second

    none, sizes, whole = drive.rounding, np.linalg.norm(drive.slips, axis=1), np.linalg.norm(drive.load)
    joined = np.abs(drive.slips @ drive.slips.T) > none * np.outer(sizes, sizes)
    found, rest, arms = [], drive.load, np.ones(len(sizes))
    if drive.directions is not None:
        joined, arms = joined | drive.directions.same, np.asarray(drive.directions.arms)
    count, labels = connected_components(joined) if len(sizes) else (0, sizes)
    for label in range(count):
        joints = labels == label
        balls = [] if drive.directions is None else drive.directions.joints
        own = [np.searchsorted(np.flatnonzero(joints), ball) for ball in balls if joints[ball[0]]]
        _, size, ways = np.linalg.svd(drive.slips[joints], full_matrices=False)
        ways = ways[size > none * max(size[0], none * sizes.max())]
        rest = rest - ways.T @ (ways @ drive.load)
        found.append(Part(joints, ways @ drive.load, drive.slips[joints] @ ways.T, arms[joints], own))
    found.append(Part(np.zeros(len(sizes), bool), rest, np.zeros((0, rest.size)), np.ones(0), []))
    return [part for part in found if np.linalg.norm(part.load) > none * whole]


def capacity(parts: list[Part], low: np.ndarray, high: np.ndarray) -> Capacity:
    """The capacity at limits (s, p) that are finite; no friction must be within them."""
    whole = Capacity(np.full(len(low), np.inf), np.zeros_like(low), np.full(len(low), np.inf))
    for part in parts if len(low) else ():
        own = _of_part(part, low[:, part.joints], high[:, part.joints])
        whole.least[:, part.joints] = own.least
        whole = Capacity(np.minimum(whole.most, own.most), whole.least, np.minimum(whole.bound, own.bound))
    return whole


def _of_part(part: Part, low: np.ndarray, high: np.ndarray) -> Capacity:
    if not part.slips.size:
        most, tau, bound = np.zeros(len(low)), low, np.zeros(len(low))
    elif part.load.size == 1:
        effect = part.slips[:, 0] / part.load[0]
        tau = np.where(effect > 0, low, high)
        for ball in part.balls:
            pull, arms = part.arms[ball] * effect[ball], part.arms[ball]
            tau[:, ball] = -_radius(part, ball, high)[:, None] * arms * pull / (np.linalg.norm(pull) or 1.0)
        most = bound = -tau @ effect
    elif len(part.balls) == 1 and len(part.balls[0]) == len(part.arms):
        least = -np.linalg.lstsq((part.arms[:, None] * part.slips).T, part.load, rcond=None)[0]
        most = bound = _radius(part, part.balls[0], high) / np.linalg.norm(least)
        tau = most[:, None] * part.arms * least
    elif part.balls:
        most, tau, bound = _within_balls(part, low, high)
    else:
        blocks = [
            _solve_programme(part, low[k : k + _BLOCKS], high[k : k + _BLOCKS]) for k in range(0, len(low), _BLOCKS)
        ]
        most, tau, bound = (np.concatenate(block) for block in zip(*blocks, strict=True))
    return Capacity(most, tau / np.where(most > 0, most, 1.0)[:, None], bound)


def _radius(part: Part, ball: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Of the ball of a joint with several slips, through its limits (s, p)."""
    return np.linalg.norm(high[:, ball] / part.arms[ball], axis=1)


def _within_balls(part: Part, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """lambda, its friction and its bound, of a part some of whose joints have balls; intervals are balls about c."""
    joints = np.arange(len(part.arms))
    for ball in part.balls:
        joints[ball] = ball[0]
    single = np.bincount(joints)[joints] == 1
    each = (joints[:, None] == np.unique(joints)).astype(float)
    middle = np.where(single, low + high, 0.0) / 2
    radius = np.sqrt(((high - middle) / part.arms) ** 2 @ each)
    size = np.where(radius.any(axis=1), radius.max(axis=1), 1.0)
    columns, sizes, turns = np.linalg.svd(part.arms[:, None] * part.slips, full_matrices=False)
    load = turns @ part.load / sizes  # by velocities of which each makes slips of size 1
    whole = np.linalg.norm(load)
    drive, reach = (load / whole, (middle / part.arms / size[:, None]) @ columns), size / whole
    most, force, bound = _least_norms(columns, drive, radius / size[:, None], each)
    most = np.where(most <= _NOTHING, 0.0, most)
    tau = np.where(most[:, None] > 0, middle + part.arms * force * size[:, None], 0.0)
    return most * reach, tau, bound * reach * (1 + _TOLERANCE)


def _least_norms(
    columns: np.ndarray, drive: tuple[np.ndarray, np.ndarray], radius: np.ndarray, each: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """lambda, f with S^T f + b + lambda u = 0, and the bound, of cases whose numbers are about 1.

    Where lambda and its bound do not meet it is NaN.

    Shapes: the columns S (p, d), the drive u (d,) and b (s, d), radii (s, j), and `each` (p, j), whose slips are whose.
    """
    (unit, given), s = drive, len(radius)
    across = np.linalg.svd(unit[None])[2][1:].T
    w, f, eps = np.tile(unit, (s, 1)), np.zeros((s, len(columns))), np.ones(s)
    most, force, bound = np.zeros(s), np.zeros_like(f), np.full(s, np.inf)
    for _ in range(_STEPS):
        k = np.flatnonzero(~(bound - most <= _CUT * bound + _NOTHING) | (bound == np.inf))
        if not k.size:
            break
        norms = _Norms(columns * (radius[k] @ each.T > 0)[:, :, None], unit, across, given[k], radius[k], each)
        change, moved = norms.changes(w[k], f[k], eps[k])
        held, holds = norms.held(f[k] + moved)
        better = held > most[k]
        most[k], force[k] = np.where(better, held, most[k]), np.where(better[:, None], holds, force[k])
        part, now, step = norms.inside(f[k], moved), norms.total(w[k], eps[k]), np.zeros(k.size)
        for shorter in _SHORTER:
            falls = norms.total(w[k] + shorter * change, eps[k]) <= now * (1 + 1e-14)
            step = np.where((step == 0) & falls, shorter, step)
        f[k], w[k] = f[k] + part[:, None] * moved, w[k] + step[:, None] * change
        w[k] += (1 - w[k] @ unit)[:, None] * unit
        bound[k] = np.minimum(bound[k], norms.total(w[k], np.zeros(k.size)))
        faster = np.where((step == 1) & (part > 0.7), 0.1, np.where(step >= 0.2, 0.5, 1.0))
        eps[k] = np.maximum(eps[k] * faster, _NOTHING)
    return np.where(np.abs(bound - most) <= _MEETS * bound + _NOTHING, most, np.nan), force, bound


class _Norms(NamedTuple):
    """The sum of norms of cases, by arguments of `_least_norms`; columns (s, p, d), 0 of balls without a radius, and a
    basis of what is across the drive, (d, d - 1)."""

    columns: np.ndarray
    unit: np.ndarray
    across: np.ndarray
    given: np.ndarray
    radius: np.ndarray
    each: np.ndarray

    def lengths(self, x: np.ndarray) -> np.ndarray:
        return np.sqrt(x**2 @ self.each)

    def total(self, w: np.ndarray, eps: np.ndarray) -> np.ndarray:
        """The sum, with sqrt(|x|^2 + eps^2) for |x|."""
        lengths = np.hypot(self.lengths(_times(self.columns, w)), eps[:, None])
        return (self.radius * lengths).sum(axis=1) - (self.given * w).sum(axis=1)

    def changes(self, w: np.ndarray, f: np.ndarray, eps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Newton's step of w and of f."""
        columns, across, each = self.columns, self.across, self.each
        x, radii, same = _times(columns, w), self.radius @ each.T, each @ each.T > 0
        norms = np.hypot(self.lengths(x), eps[:, None]) @ each.T
        turned = f[:, :, None] * x[:, None] + x[:, :, None] * f[:, None]
        bend = radii[:, :, None] * np.eye(len(same)) + np.where(same, turned / (2 * norms[:, :, None]), 0.0)
        bend = bend / norms[:, :, None]
        sizes, ways = np.linalg.eigh(across.T @ columns.transpose(0, 2, 1) @ bend @ columns @ across)
        sizes = np.maximum(sizes, np.maximum(_FLAT * sizes[:, -1:], np.finfo(float).tiny))
        slope = (_back(columns, radii * x / norms) - self.given) @ across
        change = -_times(ways, _back(ways, slope) / sizes) @ across.T
        most = _LONGEST * np.linalg.norm(w, axis=1) / np.maximum(np.linalg.norm(change, axis=1), np.finfo(float).tiny)
        change = np.minimum(most, 1.0)[:, None] * change
        return change, -f - radii * x / norms - _times(bend, _times(columns, change))

    def held(self, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """lambda of friction, made smaller until it is within all balls, and that; 0 where it does not hold."""
        over = (self.lengths(f) / np.where(self.radius > 0, self.radius, 1.0)).max(axis=1, initial=1.0)
        f = f / over[:, None]
        left = _back(self.columns, f) + self.given
        held = -left @ self.unit
        off = np.linalg.norm(left + held[:, None] * self.unit, axis=1)
        return np.where(off <= _CUT * np.maximum(held, _SMALL), held, 0.0), f

    def inside(self, f: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """The part of a change of f that keeps it within all balls."""
        each, radius = self.each, self.radius
        a, b, c = moved**2 @ each, (f * moved) @ each, f**2 @ each - radius**2
        moves = (radius > 0) & (a > 0)
        root = (-b + np.sqrt(np.maximum(b**2 - a * c, 0.0))) / np.where(moves, a, 1.0)
        return np.minimum(1.0, _WITHIN * np.where(moves, root, np.inf).min(axis=1))


def _times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return (matrices @ vectors[:, :, None])[:, :, 0]


def _back(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """The same of transposed ones."""
    return (vectors[:, None] @ matrices)[:, 0]


def _solve_programme(part: Part, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """lambda, its friction and its bound."""
    from scipy.optimize import linprog
    from scipy.sparse import block_diag, coo_array

    s, p = low.shape
    size, whole = np.maximum(-low, high), np.linalg.norm(part.load)
    reach = (np.linalg.norm(part.slips, axis=1) * size).max(axis=1)
    reach, size = np.where(reach > 0, reach, 1.0), np.where(size > 0, size, 1.0)
    unit, columns = part.load / whole, part.slips.T * (size / reach[:, None])[:, None, :]  # of size 1
    blocks = np.concatenate([np.broadcast_to(unit[:, None], (s, unit.size, 1)), columns], axis=2)
    ends = np.stack([low / size, high / size], axis=2)
    found = linprog(
        np.tile(np.append(-1.0, np.zeros(p)), s),
        A_eq=block_diag([*map(coo_array, blocks)]),
        b_eq=np.zeros(s * unit.size),
        bounds=np.concatenate([np.broadcast_to([0.0, np.inf], (s, 1, 2)), ends], axis=1).reshape(-1, 2),
        options={"primal_feasibility_tolerance": _TOLERANCE, "dual_feasibility_tolerance": _TOLERANCE},
    )
    if found.status != 0 and s > 1:  # one case may have spoilt the others
        rows = [_solve_programme(part, low[k : k + 1], high[k : k + 1]) for k in range(s)]
        most, tau, bound = (np.concatenate(row) for row in zip(*rows, strict=True))
        return most, tau, bound
    if found.status != 0:
        return np.full(s, np.nan), np.full((s, p), np.nan), np.full(s, np.inf)
    at, motion = found.x.reshape(s, 1 + p), found.eqlin.marginals.reshape(s, -1)
    along = (motion @ unit)[:, None]
    against = -np.einsum("sd,sdp->sp", motion / np.where(along != 0, along, 1.0), columns)
    bound = np.maximum(against * ends[..., 0], against * ends[..., 1]).sum(axis=1)
    bound = np.where(along[:, 0] != 0, bound, np.inf)
    tau = _even_out(part.slips, low, high, at[:, 1:] * size)
    return at[:, 0] * reach / whole, tau, bound * reach / whole


def _even_out(slips: np.ndarray, low: np.ndarray, high: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Friction that does the same, of which joints that slip in proportion take the same share of their limits."""
    tau, left = tau.copy(), np.linalg.norm(slips, axis=1) > 0
    while left.any():
        first = slips[left.argmax()]
        effect = slips @ first / (first @ first)
        same = left & (np.linalg.norm(slips - np.outer(effect, first), axis=1) <= NONE * np.abs(slips).max())
        left &= ~same
        given = tau[:, same] @ effect[same]
        limits = np.where(given[:, None] * effect[same] > 0, high[:, same], low[:, same])
        most = limits @ effect[same]
        tau[:, same] = limits * (given / np.where(most != 0, most, 1.0))[:, None]
    return tau
