"""Exact extremes of outputs over sets of cases, where friction does not depend on the case.

Affine, box:        linear programme   min c^T theta,  theta in a box,  limits on lam
Affine, ellipsoid:  c^T theta over |v_0 + V theta| <= 1: theta_0 -+ r R^-1 w / |w|,  V = Q R,  w = R^-T c,
                    theta_0 = -R^-1 Q^T v_0,  r^2 = 1 - |v_0 + V theta_0|^2
Fractional:         the vertices of the box
"""

from typing import NamedTuple

import equinox as eqx
import numpy as np

from ._cases import Affine, Fractional, corners

_AT_ONCE = 4096  # vertices


class Ends(NamedTuple):
    """Extremes of outputs that were attained, (b,), bounds that none exceeds, (b,), and where: (b, q), (b, x).

    A value without end is infinite, and attained nowhere: NaN.
    """

    value: np.ndarray
    bound: np.ndarray
    case: np.ndarray
    solution: np.ndarray


def linear_extreme(cases: Affine, tau: np.ndarray, cost: np.ndarray) -> np.ndarray | None:
    """The case with the least cost^T lam under friction that does not depend on it; None if there is no case."""
    start, slope, lower, upper = cases.start + cases.unit @ tau, cases.slope, cases.lower, cases.upper
    rows, least, most, width = cases.rows, cases.least, cases.most, cases.width
    if cases.norm:
        return _over_ellipsoid(start[rows] / most, slope[rows] / most[:, None], cost @ slope)
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    at, by = (start[rows] + slope[rows] @ middle) / width, slope[rows] * half / width[:, None]
    objective = cost @ slope * half
    size = np.abs(objective).max(initial=0.0) or 1.0
    if not rows.size or not lower.size:
        return middle - half * np.sign(objective)
    from scipy.optimize import linprog  # here, because its import takes a second

    limits = np.concatenate([most / width - at, at - least / width])
    found = linprog(objective / size, np.concatenate([by, -by]), limits, bounds=(-1, 1))
    return middle + half * found.x if found.status == 0 else None


def _over_ellipsoid(start: np.ndarray, slope: np.ndarray, cost: np.ndarray) -> np.ndarray | None:
    q, r = np.linalg.qr(slope)
    centre = -np.linalg.solve(r, q.T @ start)
    room = 1 - np.sum((start + slope @ centre) ** 2)
    if room < 0:
        return None
    wanted = np.linalg.solve(r.T, cost)
    size = np.linalg.norm(wanted)
    return centre - np.sqrt(room) * np.linalg.solve(r, wanted / (size or 1.0))


def vertex_extremes(cases: Fractional, tau: np.ndarray, costs: np.ndarray) -> np.ndarray:
    """For each row of `costs` (b, m) the vertex with the least costs^T lam, shape (b, q)."""
    matters = cases.matters
    few = eqx.tree_at(
        lambda cases: (cases.lower, cases.upper, cases.least, cases.most, cases.rows),
        cases,
        (cases.lower[matters], cases.upper[matters], cases.least[matters], cases.most[matters], cases.rows[matters]),
    )
    all_of = corners(few.lower, few.upper)
    parts = np.array_split(all_of, -(-len(all_of) // _AT_ONCE))
    values = np.concatenate([few.multipliers(part, tau) @ costs.T for part in parts])
    out = np.tile(cases.lower, (len(costs), 1))
    out[:, matters] = all_of[np.argmin(values, axis=0)]
    return out
