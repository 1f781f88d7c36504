"""A mechanism at rest with any number of degrees of freedom, case by case.

    lambda = max lambda   with   lambda g + S^T tau = 0,   lo(rho) <= tau <= hi(rho),   rho = rho_0 + K tau

is the largest part of its drive that friction can hold, at the loads that it has then, and margin = lambda - 1. With
one degree of freedom that is the margin of `_one_freedom`. Held, tau is within the share t of the limits at the loads
of that tau. Limits are those at the last friction, programme after programme (`_capacity`), until they stay; where they
do not, the margin is 1 / t - 1 of friction that holds, if any was found.

Limits that depend on tau make the set of tau no convex one, so that the search can miss friction that holds. Proofs do
without the search: with L = (I - Gamma)^-1 (limits at tau = 0 + c), no friction exceeds L and

    |limits - those at tau = 0 in the middle of a cell of cases| <= c + Gamma L,   c = Lambda |half the cell|,

where the spectral radius of Gamma is below 1. Over a cell

- nothing holds, if lambda < 1 at the largest of these limits, by the dual;
- nothing slips, if some tau* holds at the least of them: g and S do not depend on the case, and with any friction tau
  as slip begins a^T M a <= sum_j (|tau*_j| - limit_j) |alpha_j| <= 0;
- a joint slips, if its alpha at the limits in the middle exceeds the change of it that `_stick_slip` states.

Where friction puts no load on friction, Gamma = 0, cells get as small as the verdict needs.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..._analysis._verdict import spectral_radius
from ..._tools._numbers import Numeric
from .._at_rest import LIMIT, NONE, Ends, ReducedForce, in_batches
from .._cases import Affine
from .._climb import climb
from .._descent import sample, within
from .._search import Search, largest_gamma
from ._capacity import Capacity, Part, capacity, parts_of
from ._held import held
from ._one_freedom import CELLS, halve
from ._stick_slip import Limits, LimitSamples, least_accelerated, sample_limits, slipping_friction, started

_TURNS = 100  # programmes in a row
_SQUARES = 3  # least squares in a row
_STAYS = 1e-12  # relative change of limits that is none
_ENDLESS = 1e9  # lambda that has no end
_TRIED, _RADIUS = 16, 0.1  # random steps at a time to each extreme, and their first size, relative to the box


class _Turned(NamedTuple):
    """Friction tau (s, p) that programmes end with, at limits that give lambda (s,), and whether these are its own."""

    tau: np.ndarray
    low: np.ndarray
    high: np.ndarray
    most: np.ndarray
    stays: np.ndarray


class ManyFreedoms:
    """Cases of a mechanism at rest with any number of degrees of freedom.

    - `search`, `drive`: the cases, and what drives the mechanism.
    - `size`: how many cases are looked at in one batch.
    - `parts`: joints that are held together.
    - `limit`, `same`: a margin that is rounding, and a relative change of limits that is.
    - `gamma`, `change`: Gamma (p, p) and Lambda (p, q); infinite where no bound is known.
    """

    def __init__(self, search: Search, drive: ReducedForce, size: int, *, reads: bool):
        """`reads` says whether any load on friction depends on the case."""
        solutions, cases = search.solutions, search.cases
        self.search, self.drive, self.size, self.parts = search, drive, size, parts_of(drive)
        self.limit, self.same = max(LIMIT, drive.rounding), _STAYS * drive.rounding / NONE
        p = len(drive.slips)
        known = isinstance(cases, Affine) or not reads
        gamma = largest_gamma(solutions, cases) if known else np.full((p, p), np.inf)
        own = np.linalg.norm(drive.slips, axis=1)
        moves = np.broadcast_to(own[:, None] > 0, gamma.shape)
        effect = np.multiply(gamma, own[:, None], out=np.full_like(gamma, np.inf), where=moves)
        rounding = effect <= self.same * own
        self.gamma = np.where(rounding, 0.0, gamma)
        self.change = np.full((p, cases.lower.size), np.inf if reads else 0.0)
        if reads and isinstance(cases, Affine) and solutions.law is not None:
            change = solutions.law.largest_changes(cases.slope[solutions.rows])
            self.change = np.where(cases.upper > cases.lower, change, 0.0)

    @property
    def _is_one(self) -> bool:
        """Whether there is one freedom, along which friction acts."""
        return self.drive.load.size == 1 and self.search.solutions.law is not None

    def ends(self, theta: np.ndarray, seed: int) -> Ends:
        """States that are possible in cases, and in those to which random steps to extremes lead.

        Extremes are those of the margin and of what friction holds of each part.
        """
        ends, score = self._states(theta)
        one = not theta.shape[-1] or not len(score)
        if one or np.allclose(score, score[0], rtol=self.limit, atol=self.limit):
            return ends

        def look(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            nonlocal ends, score
            tried, others = self._states(theta.reshape(-1, theta.shape[-1]))
            ends, score = ends.beside(tried), np.concatenate([score, others])
            return best()

        def best() -> tuple[np.ndarray, np.ndarray]:
            return ends.theta[score.argmax(axis=0)], score.max(axis=0)

        climb(look, *best(), self.search.cases, _RADIUS, _TRIED, np.random.default_rng(seed))
        return ends

    def _states(self, theta: np.ndarray) -> tuple[Ends, np.ndarray]:
        """States that are possible in cases, held and as slip begins, and columns of what the largest is sought of."""
        drive, count, (which, tau) = self.drive, len(theta), self._started(theta)
        theta, (s, p) = theta[which], tau.shape
        holding, margin = self._held(theta, tau)
        at = self._looked(theta, holding.tau)
        sticks = within(holding.stays, at.excess)
        then = self._looked(theta, tau)
        slip, moves, sure, _ = started(drive, tau, then)
        slips = moves & within(sure, then.excess)
        left = np.ones(s) if drive.none else 1 + (tau @ drive.slips) @ drive.load / (drive.load @ drive.load)
        falls = np.where(~holding.stays & (margin < -self.limit), margin, -left)
        free, unit = self.search.solutions.response.free.acceleration, self.search.solutions.response.unit.acceleration
        moved = free + tau @ unit.T
        rows = [
            (falls[slips], margin[sticks]),
            (theta[slips], theta[sticks]),
            (moved[slips], np.zeros((sticks.sum(), moved.shape[1]))),
            (then.multipliers[slips], at.multipliers[sticks]),
            (tau[slips], holding.tau[sticks]),
            (np.ones(slips.sum()), 1 / holding.most[sticks]),
            (slip[slips], np.zeros((sticks.sum(), p))),
        ]
        solved = np.mean(np.bincount(which, slips | sticks, count) > 0)
        ends = Ends(*(np.concatenate(row) for row in rows), solved=float(solved))
        low, high = (
            np.concatenate([one[slips], two[sticks]]) for one, two in ((then.low, at.low), (then.high, at.high))
        )
        of_parts = [self._most(low, high, [part]).most for part in self.parts if len(self.parts) > 1]
        score = np.stack([ends.margin, *of_parts], axis=1)
        score = np.concatenate([score, -score], axis=1)
        return ends, np.where(np.isnan(score), -np.inf, score)

    def _held(self, theta: np.ndarray, slipping: np.ndarray) -> tuple[_Turned, np.ndarray]:
        """Friction that holds each case with the least share, if `stays`, and the margin, NaN where not known.

        With one freedom the margin is that of its `slipping` friction.
        """
        s, p = len(theta), len(self.drive.slips)
        none = np.zeros((s, p)), np.full((s, p), np.nan), np.full((s, p), np.nan), np.zeros(s)
        if self.drive.none:
            most = np.full(s, np.inf)
            return _Turned(*none[:3], most, np.ones(s, bool)), most
        if self._is_one:
            effect = self.drive.effect
            margin = -1 - slipping @ effect
            tau, share = held(self.search.solutions, self.search.cases, effect, theta, slipping)
            found = _Turned(tau, *none[1:3], 1 / share, share >= 0)
        else:
            whole = self._turned(theta, *none)
            margin = np.where(whole.stays, whole.most - 1, np.where(whole.most >= _ENDLESS, np.inf, np.nan))
            begin = whole.tau / np.where(whole.most > 0, whole.most, 1.0)[:, None]
            ended = np.where(whole.most < _ENDLESS, whole.most, 1.0)
            found = self._turned(theta, begin, whole.low, whole.high, ended, hold=True)
        stays = found.stays & self._holds(theta, found.tau) & (found.most >= 1 - self.limit)
        shown = stays & ~(margin >= -self.limit)
        return found._replace(stays=stays), np.where(shown, found.most - 1, margin)

    def _turned(
        self,
        theta: np.ndarray,
        tau: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
        most: np.ndarray,
        *,
        hold: bool = False,
    ) -> _Turned:
        """Programmes in turn, from friction found at limits: all of it, or the share that holds."""
        tau, low, high, most = (np.array(x) for x in (tau, low, high, most))
        stays = np.zeros(len(theta), bool)
        for _ in range(_TURNS):
            at = self._looked(theta, tau)
            size = np.maximum(-at.low, at.high).max(axis=1, initial=0.0)
            change = np.maximum(np.abs(at.low - low), np.abs(at.high - high)).max(axis=1, initial=0.0)
            stays = change <= self.same * size
            going = ~stays & np.isfinite(size) & (most < _ENDLESS)
            if not going.any():
                break
            low[going], high[going] = at.low[going], at.high[going]
            found = self._most(low[going], high[going])
            most[going] = found.most
            tau[going] = found.least * np.where(hold, 1.0, found.most)[:, None]
        return _Turned(tau, low, high, most, stays)

    def _holds(self, theta: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Whether friction leaves no acceleration and is within its limits; NaN is not."""
        at, drive = self._looked(theta, tau), self.drive
        rounding = self.limit * np.maximum(-at.low, at.high).max(axis=1, initial=0.0)[:, None]
        inside = (tau >= at.low - rounding) & (tau <= at.high + rounding)
        if drive.directions is not None:
            directed, beside = drive.directions.directed, 1 + self.limit
            inside = np.where(directed, drive.sizes(tau, tau) <= drive.sizes(at.low, at.high) * beside, inside)
        inside = np.all(inside, axis=1)
        return inside & (
            np.linalg.norm(drive.load + tau @ drive.slips, axis=1) <= self.limit * np.linalg.norm(drive.load)
        )

    def _looked(self, theta: np.ndarray, tau: np.ndarray) -> LimitSamples:
        return sample_limits(self.search.solutions, self.search.cases, theta, tau)

    def _started(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Friction as slip begins, and of which case it is.

        With one freedom all slip, in the sense of the start, in each solution found of a case; NaN where there is none.
        """
        if self._is_one:
            found = sample(self.search.solutions, self.search.cases, theta, self.search.factors)
            shown = found.good.copy()
            shown[:, 0] |= ~shown.any(axis=1)
            return np.nonzero(shown)[0], np.where(found.good[shown][:, None], found.tau[shown], np.nan)
        tau = self._settled(theta)
        for _ in range(_SQUARES):
            at = self._looked(theta, tau)
            left = ~started(self.drive, tau, at).sure
            if not left.any() or self.drive.directions is not None:
                break
            tau[left] = least_accelerated(self.drive, at.low[left], at.high[left])
        return np.arange(len(theta)), tau

    def _settled(self, theta: np.ndarray, *, own_loads: bool = True) -> np.ndarray:
        """Friction as slip begins, with or without the loads that friction puts on friction."""
        base, unit = self.search.cases.chosen(theta)
        unit = np.broadcast_to(float(own_loads) * unit, (len(base), *unit.shape[-2:]))

        def batch(base: Numeric, unit: Numeric) -> Numeric:
            drive = self.drive
            return slipping_friction(self.search.solutions, drive.load, drive.slips, base, unit, drive.directions)

        return in_batches(batch, self.size, base, unit)

    def proves(self, verdict: str, joint: int | None = None) -> bool:
        """Whether a verdict that states found support is proved, of the whole or of a joint."""
        own = [part for part in self.parts if joint is None or part.joints[joint]]
        together = np.any([part.joints for part in own], axis=0) if own else np.zeros(len(self.drive.slips), bool)
        if verdict == "must stick":
            return not own or self._covered(
                together, lambda _, low, high, less: self._most(low + less, high - less, own).most >= 1
            )
        if verdict == "must slip" and joint is None:
            return self._covered(
                together, lambda _, low, high, less: self._most(low - less, high + less).bound < 1 - self.limit
            )
        return verdict == "may stick" or (verdict == "must slip" and self._always_slips(joint, together))

    def _always_slips(self, joint: int | None, together: np.ndarray) -> bool:
        """Whether it is proved that a joint slips in every case."""
        own = np.linalg.norm(self.drive.slips, axis=1) * together

        def proves(middle: np.ndarray, low: np.ndarray, high: np.ndarray, less: np.ndarray) -> np.ndarray:
            tau = self._settled(middle, own_loads=False)
            at = started(self.drive, tau, Limits(low, high))
            alpha = (self.drive.load + tau @ self.drive.slips) @ self.drive.slips[joint]
            return at.sure & (at.sense[:, joint] != 0) & (np.abs(alpha) > own[joint] * (less @ own + at.error))

        return self._covered(together, proves)

    def _most(self, low: np.ndarray, high: np.ndarray, parts: list[Part] | None = None) -> Capacity:
        return capacity(self.parts if parts is None else parts, np.minimum(low, 0.0), np.maximum(high, 0.0))

    def _covered(self, joints: np.ndarray, proves: Callable[..., np.ndarray]) -> bool:
        """Whether `proves(middle, low, high, less)` holds in each of cells (s, q) that cover the box.

        Limits of friction in the cell are those without friction in its middle, low and high, give or take `less`;
        those of `joints` matter.
        """
        lower, upper = self.search.cases.lower, self.search.cases.upper
        if not np.all(np.isfinite(self.change)) or not spectral_radius(self.gamma) < 1:
            return False
        back = np.linalg.inv(np.eye(len(self.gamma)) - self.gamma)
        weight = (np.linalg.norm(self.drive.slips, axis=1) * joints) @ back @ self.change
        middle, half, count = (lower + upper)[None] / 2, (upper - lower)[None] / 2, 0
        while count < CELLS:
            count += len(middle)
            at = self._looked(middle, np.zeros((len(middle), len(back))))
            change = half @ self.change.T
            caused = (self.drive.sizes(at.low, at.high) + change) @ (self.gamma @ back).T
            left = ~proves(middle, at.low, at.high, change + caused)
            if not left.any():
                return True
            middle, half, low, high = middle[left], half[left], at.low[left], at.high[left]
            caused = self.drive.sizes(low, high) @ (self.gamma @ back).T
            if not (half * weight).any(axis=1).all() or not proves(middle, low, high, caused).all():
                return False  # no smaller cells help
            middle, half = halve(middle, half, weight)
        return False
