"""The search for extremes of outputs over a set of cases: samples and vertices, then descents from the best of them."""

from typing import cast

import numpy as np

from .._analysis._analyze import Report
from .._analysis._verdict import spectral_radius
from .._tools._numbers import or_one
from ._cases import AbstractCases, Affine, Fractional, corners
from ._descent import Found, improve, sample
from ._extremes import linear_extreme, vertex_extremes
from ._solution_set import SolutionSet

_CORNERS = 8  # entries of a case up to which all vertices of the box are looked at
_VERTICES = 16  # compliances up to which all vertices are, where that is exact
_SEEDS = 3  # starts for each extreme
_APART = 0.1  # least distance of starts, relative to the box


def proved_single(solutions: SolutionSet, cases: AbstractCases, report: Report) -> bool:
    """Whether each case has one solution, by the spectral radius of its Gamma; see `_verdict`."""
    if solutions.law is None:
        return True
    if not isinstance(cases, Affine) and report.friction_reads:
        return False
    return spectral_radius(largest_gamma(solutions, cases)) < 1


def largest_gamma(solutions: SolutionSet, cases: AbstractCases) -> np.ndarray:
    """Gamma_ij = max |d law_i / d rho| |K_ij|, shape (p, p); infinite where a law has no known bound."""
    if solutions.law is None:
        return np.zeros((0, 0))
    return solutions.law.largest_changes(cases.chosen(cases.lower)[1][solutions.rows])


def few(cases: AbstractCases) -> bool:
    """Whether all vertices of the compliances that matter can be looked at."""
    return isinstance(cases, Fractional) and int(cases.matters.sum()) <= _VERTICES


Extreme = tuple[np.ndarray, np.ndarray, np.ndarray]  # values (b,), cases (b, q), solutions (b, x)


class Search:
    """The extremes of outputs over a set of cases."""

    def __init__(self, solutions: SolutionSet, cases: AbstractCases, factors: np.ndarray):
        self.solutions, self.cases, self.factors, self.solved = solutions, cases, factors, 1.0

    def exactly(self, matrix: np.ndarray, unique: np.ndarray) -> tuple[Extreme, Extreme]:
        """Where friction does not depend on the case; of unique outputs any case serves."""
        cases = self.cases
        tau = self._sampled(cases.lower[None]).tau[0]
        n, m = self.solutions.response.free.acceleration.size, self.solutions.stress.shape[0]
        out = []
        for sign in (1.0, -1.0):
            costs = sign * matrix[:, n : n + m]
            if isinstance(cases, Fractional):
                theta = vertex_extremes(cases, tau, costs)
            else:
                ends = [linear_extreme(cast(Affine, cases), tau, cost) for cost in costs]
                theta = np.array([np.full(cases.lower.size, np.nan) if end is None else end for end in ends])
            if out:
                theta = np.where(unique[:, None], out[0][1], theta)
            found = self._sampled(theta)
            values = np.where(found.within()[:, None], found.values, np.nan)
            out.append((np.sum(matrix * values, axis=1), theta, values))
        return out[0], out[1]

    def _sampled(self, theta: np.ndarray) -> Found:
        """The first solution of each case."""
        return Found(*(part[:, 0] for part in sample(self.solutions, self.cases, theta, self.factors[:0])))

    def found(self, matrix: np.ndarray, unique: np.ndarray, samples: int, seed: int) -> Found:
        """All solutions of a search for the extremes of outputs; sets `solved`."""
        found = sample(self.solutions, self.cases, self.sample(samples, seed), self.factors)
        self.solved = float(np.mean(found.good.any(axis=1)))
        found = Found(*(part.reshape(found.good.size, *part.shape[2:])[found.good.ravel()] for part in found))
        values = found.values @ matrix.T
        if not found.theta.size:
            return found
        spread, size = np.ptp(values, axis=0), np.abs(values).max(axis=0)
        moving = np.flatnonzero(~unique & (spread > 1e-12 * size))
        costs, starts = [], []
        for k in moving:
            for cost in (1 / spread[k], -1 / spread[k]):
                own = self._starts(found, cost * values[:, k])
                starts += own
                costs += [cost * matrix[k]] * len(own)
        if not starts:
            return found
        better = improve(self.solutions, self.cases, np.array(costs), Found(*(part[starts] for part in found)))
        return Found(*(np.concatenate(pair) for pair in zip(found, better, strict=True)))

    def sample(self, samples: int, seed: int) -> np.ndarray:
        """Middle and vertices of the box, and random cases."""
        lower, upper = self.cases.lower, self.cases.upper
        random, q = np.random.default_rng(seed), lower.size
        share = np.linspace(0.0, 1.0, samples)[:, None] if q == 1 else random.random((samples, q))
        ends = corners(lower, upper) if q <= _CORNERS else np.where(random.random((2**_CORNERS, q)) < 0.5, lower, upper)
        return np.concatenate([((lower + upper) / 2)[None], ends, lower + share * (upper - lower)])

    def _starts(self, found: Found, cost: np.ndarray) -> list[int]:
        """Solutions of little cost that lie apart, those within the limits first."""
        span = self.cases.upper - self.cases.lower
        largest = np.abs(found.tau).max(axis=0, initial=0.0)
        place = np.concatenate([found.theta / or_one(span), found.tau / or_one(largest)], axis=1)
        chosen: list[int] = []
        for k in np.argsort(cost + 10 * np.maximum(found.excess, 0.0)):
            if all(np.abs(place[k] - place[other]).max() > _APART for other in chosen):
                chosen.append(int(k))
            if len(chosen) == _SEEDS:
                break
        return chosen


def best(found: Found, matrix: np.ndarray, unique: np.ndarray, sign: float) -> Extreme:
    """Least (1) or largest (-1) value of each output over the solutions within the limits; any of unique ones."""
    within = Found(*(part[found.within()] for part in found))
    if not len(within.good):
        b = len(matrix)
        return np.full(b, np.nan), np.full((b, found.theta.shape[1]), np.nan), np.full((b, matrix.shape[1]), np.nan)
    values = within.values @ matrix.T
    best = np.where(unique, 0, np.argmin(sign * values, axis=0))
    least = values[best, np.arange(len(matrix))]
    return np.asarray(least), np.asarray(within.theta[best]), np.asarray(within.values[best])
