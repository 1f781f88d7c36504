"""How much of its drive a mechanism at rest can be held by friction within given limits: a linear programme,

    lambda = max lambda   with   lambda g + S^T tau = 0,   lo <= tau <= hi.

At these limits the load may grow to lambda times its size, or the share 1 / lambda of the limits will do. The dual
names the motion w that is held least: for any w with w^T g = 1

    lambda <= sum_j max(-(S w)_j lo_j, -(S w)_j hi_j).

The programmes of many cases are one, block by block.
"""

from typing import NamedTuple

import numpy as np

from ._at_rest import Drive

_BLOCKS = 64  # cases in one programme
_TOLERANCE = 1e-10


class Capacity(NamedTuple):
    """What friction can hold of the drive, case by case.

    - `most`: lambda, shape (s,), and `tau` that holds it, shape (s, p); NaN where the programme failed.
    - `bound`: an upper bound of lambda, shape (s,), by the dual: it holds even where the programme is not exact.
    """

    most: np.ndarray
    tau: np.ndarray
    bound: np.ndarray


def capacity(drive: Drive, low: np.ndarray, high: np.ndarray) -> Capacity:
    """The capacity at limits (s, p) that are finite; no friction must be within them."""
    parts = [_capacity(drive, low[k : k + _BLOCKS], high[k : k + _BLOCKS]) for k in range(0, len(low), _BLOCKS)]
    return Capacity(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _capacity(drive: Drive, low: np.ndarray, high: np.ndarray) -> Capacity:
    from scipy.optimize import linprog  # here, because its import takes a second
    from scipy.sparse import block_diag

    s, p = low.shape
    size, whole = np.maximum(np.abs(low), np.abs(high)), np.linalg.norm(drive.load)
    size = np.where(size > 0, size, 1.0)
    reach = (np.linalg.norm(drive.slips, axis=1) * size * ((low < 0) | (high > 0))).max(axis=1, initial=0.0)
    reach = np.where(reach > 0, reach, 1.0)  # unknowns and coefficients of size 1
    unit, columns = drive.load / whole, drive.slips.T * (size / reach[:, None])[:, None, :]
    blocks = np.concatenate([np.broadcast_to(unit[:, None], (s, unit.size, 1)), columns], axis=2)
    ends = np.stack([low / size, high / size], axis=2)
    bounds = np.concatenate([np.broadcast_to([0.0, np.inf], (s, 1, 2)), ends], axis=1)
    cost = np.tile(np.append(-1.0, np.zeros(p)), s)
    options = {"primal_feasibility_tolerance": _TOLERANCE, "dual_feasibility_tolerance": _TOLERANCE}
    found = linprog(
        cost, A_eq=block_diag(blocks), b_eq=np.zeros(s * unit.size), bounds=bounds.reshape(-1, 2), options=options
    )
    if found.status != 0:
        none = np.full(s, np.nan)
        return Capacity(none, np.full((s, p), np.nan), np.full(s, np.inf))
    at = found.x.reshape(s, 1 + p)
    motion = found.eqlin.marginals.reshape(s, -1)
    along = motion @ unit
    motion = motion / np.where(along != 0, along, 1.0)[:, None]
    against = -np.einsum("sd,sdp->sp", motion, columns)
    bound = np.maximum(against * ends[..., 0], against * ends[..., 1]).sum(axis=1)
    bound = np.where(along != 0, bound, np.inf)
    return Capacity(at[:, 0] * reach / whole, at[:, 1:] * size, bound * reach / whole)
