"""How much of its drive a mechanism at rest can be held by friction within given limits: a linear programme,

    lambda = max lambda   with   lambda g + S^T tau = 0,   lo <= tau <= hi.

At these limits the load may grow to lambda times its size, or the share 1 / lambda of the limits will do. The dual
names the motion w that is held least: for any w with w^T g = 1

    lambda <= sum_j max(-(S w)_j lo_j, -(S w)_j hi_j).

Joints are in one part where S_j . S_k joins them. Parts are held one by one, lambda being the least of theirs, and one
with a single freedom needs no programme. The programmes of many cases are one, block by block.

Where the slips of a joint share one friction its limits are a ball in f = tau / arms. The programme has planes that
touch it instead, more of them where its friction lies beyond, until that is no more than rounding (`_within_balls`);
its lambda is an upper bound all along, and all of its friction, made smaller until it fits, is a lower one. One such
joint alone needs no programme: the least friction that holds g is the least of all.
"""

from typing import NamedTuple

import numpy as np

from .._at_rest import NONE, ReducedForce

_BLOCKS = 64  # cases in one programme
_TOLERANCE = 1e-10
_CUTS, _CUT = 200, 1e-10  # planes at most, and relative distance of both bounds of lambda that is none


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
        rows = [_within_balls(part, low[k : k + 1], high[k : k + 1]) for k in range(len(low))]
        most, tau, bound = (np.concatenate(row) for row in zip(*rows, strict=True))
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
    """lambda, its friction and its bound of one case, by planes that touch the balls."""
    from scipy.optimize import linprog

    (s, p), planes, sides = low.shape, [], []
    radii = [_radius(part, ball, high)[0] for ball in part.balls]
    low, high = low[0].copy(), high[0].copy()
    for ball, radius in zip(part.balls, radii, strict=True):
        high[ball] = radius * part.arms[ball]
        low[ball] = -high[ball]
    size = np.where(np.maximum(-low, high) > 0, np.maximum(-low, high), 1.0)
    reach = (np.linalg.norm(part.slips, axis=1) * size).max()
    whole = np.linalg.norm(part.load)
    columns = part.slips.T * size / reach
    best, bound = (0.0, np.zeros(p)), np.inf
    for _ in range(_CUTS):
        found = linprog(
            np.append(-1.0, np.zeros(p)),
            A_ub=np.array(planes) if planes else None,
            b_ub=np.array(sides) if planes else None,
            A_eq=np.column_stack([part.load / whole, columns]),
            b_eq=np.zeros(part.load.size),
            bounds=[(0.0, None), *np.column_stack([low / size, high / size])],
            options={"primal_feasibility_tolerance": _TOLERANCE, "dual_feasibility_tolerance": _TOLERANCE},
        )
        if found.status != 0:
            return np.full(s, np.nan), np.full((s, p), np.nan), np.full(s, np.inf)
        tau, over = found.x[1:] * size, 1.0
        for ball, radius in zip(part.balls, radii, strict=True):
            force = tau[ball] / part.arms[ball]
            length = np.linalg.norm(force)
            over = max(over, length / radius if radius > 0 else 1.0)
            plane = np.zeros(p + 1)
            plane[1 + ball] = force / (length or 1.0) / part.arms[ball] * size[ball]
            planes.append(plane / (radius or 1.0))
            sides.append(1.0 if radius > 0 else 0.0)
        most = found.x[0] * reach / whole
        bound = min(bound, most)
        if most / over >= best[0]:
            best = most / over, tau / over
        if bound - best[0] <= _CUT * bound:
            break
    return np.array([best[0]]), best[1][None], np.array([bound * (1 + _TOLERANCE)])


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
