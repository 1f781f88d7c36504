"""Proofs for a mechanism at rest with one degree of freedom: all joints that slip do so together.

With s the sense of slip of the start without friction and y a_0 the acceleration under the whole friction
tau = law(rho, s) against it, margin = -y = (what friction holds of the load's drive) - 1. Where margin >= 0 a share
t <= 1 of the friction holds: y falls from 1 at t = 0 without a jump. Where margin < 0 and, with
Gamma_ij = max |d law_i / d rho| |K_ij| and y = 1 + e^T tau,

    spectral radius of Gamma < 1   and   |e|^T Gamma (I - Gamma)^-1 <= |e|^T,

it slips (proved): with tau_j = sigma_j |law_j| the derivatives e^T (I - diag(sigma) law' K)^-1 |law| of y have the
signs of e, so that no friction holds more. That of a joint with several slips is along its slip then, if it puts no
load on friction. Verdicts on all cases are proved by cells that cover the bounds, because under this Gamma

    |change of y| <= |e|^T (I - Gamma)^-1 Lambda |change of the case|,   Lambda: bounds of the change of law.
"""

import numpy as np

from ..._analysis._verdict import spectral_radius
from .._at_rest import ReducedForce
from .._cases import AbstractCases, Affine
from .._descent import sample
from .._search import Search, largest_gamma
from .._solution_set import SolutionSet

CELLS = 4096  # cells of the bounds at most, in a proof


def most_holds(solutions: SolutionSet, cases: AbstractCases, drive: ReducedForce) -> bool:
    """Whether, of all friction, the whole friction against the start is proved to hold most."""
    gamma, effect = largest_gamma(solutions, cases), np.abs(drive.effect)
    if drive.directions is not None and gamma[:, drive.directions.directed].any():
        return False  # friction across the slip may load the others
    back = effect @ np.linalg.solve(np.eye(len(gamma)) - gamma, gamma) if gamma.size else effect
    return bool(spectral_radius(gamma) < 1 and np.all(back <= effect))


def is_covered(search: Search, drive: ReducedForce, sign: float) -> bool:
    """Whether cells prove that sign * margin >= 0 over the whole box, where each case has one solution."""
    solutions, cases = search.solutions, search.cases
    if not isinstance(cases, Affine) or solutions.law is None:
        return False
    gamma = largest_gamma(solutions, cases)
    change = solutions.law.largest_changes(cases.slope[solutions.rows])
    if not np.all(np.isfinite(change)):
        return False
    slope = np.abs(drive.effect) @ np.linalg.solve(np.eye(len(gamma)) - gamma, change)
    middle, half = (cases.lower + cases.upper)[None] / 2, (cases.upper - cases.lower)[None] / 2
    looked = 0
    while len(middle) and looked < CELLS:
        looked += len(middle)
        found = sample(solutions, cases, middle, search.factors)
        margin = sign * np.where(found.good[:, 0], -(found.values[:, 0] @ drive.output), np.nan)
        if not np.all(margin >= 0):
            return False
        left = margin < half @ slope
        middle, half = middle[left], half[left]
        middle, half = halve(middle, half, slope)
    return not len(middle)


def halve(middle: np.ndarray, half: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells (s, q), each cut in two across the side that is widest times its weight (q,)."""
    widest = (half * weight).argmax(axis=1)[:, None] == np.arange(len(weight))
    half = np.where(widest, half / 2, half)
    shift = np.where(widest, half, 0.0)
    return np.concatenate([middle - shift, middle + shift]), np.concatenate([half, half])
