"""Sets of cases over which an output is bounded: misfits, preloads or compliances that are possible.

A case is a vector theta in a box, and chooses one multiplier vector from the family,

    lam = base(theta) + U(theta) tau,   U tau being what friction tau adds.

`Affine`: base = B_0 + B theta and a constant U, with limits on some multipliers or on a norm of them. `Fractional`:
some diagonal entries of the compliance W lie between bounds,

    lam = lam_p + N (N^T W N)^-1 N^T (d - W lam_p),

in each of which lam is a ratio of linear functions, so monotone, and extreme at the ends of its range. What an entry
does depends on its ratio to the others, so theta, from 0 to 1, is the share of the range on a scale of logarithms:

    w = w_1 + (w_2 - w_1) (r^theta - 1) / (r - 1),   r = w_2 / w_1, or 10^6 where it is larger,   so w_1 r^theta else.
"""

import abc

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from .._tools._numbers import Numeric, product
from .._tools._value import AbstractModule

_WIDEST = 1e6  # ratio of compliances up to which the scale is one of logarithms


class AbstractCases(AbstractModule):
    """Box of cases, and the multipliers that each chooses.

    - `names`: what each entry of theta is.
    - `lower`, `upper`: the box, shape (q,).
    """

    names: eqx.AbstractVar[tuple[str, ...]]
    lower: eqx.AbstractVar[Float[Numeric, " q"]]
    upper: eqx.AbstractVar[Float[Numeric, " q"]]

    @abc.abstractmethod
    def chosen(self, theta: Float[Numeric, "... q"]) -> tuple[Float[Numeric, "... m"], Float[Numeric, "... m p"]]:
        """base and U of cases."""

    @abc.abstractmethod
    def slopes(self, theta: Float[Numeric, " q"], multipliers: Float[Numeric, " m"]) -> Float[Numeric, "m q"]:
        """Derivatives of the multipliers by the case, under friction that stays."""

    @abc.abstractmethod
    def figures(self, theta: Float[Numeric, "... q"]) -> Float[Numeric, "... q"]:
        """What a case is, in the units of the bounds."""

    @property
    def box(self) -> Float[np.ndarray, "q 2"]:
        """Least and largest figures."""
        return np.stack([self.figures(self.lower), self.figures(self.upper)], axis=1)

    @abc.abstractmethod
    def excess(self, multipliers: Float[Numeric, "... m"]) -> Float[Numeric, "... c"]:
        """How far multipliers exceed their limits, relative to their widths; at most 0 within."""

    @abc.abstractmethod
    def excess_slopes(self, multipliers: Float[Numeric, " m"], slopes: Float[Numeric, "m q"]) -> Float[Numeric, "c q"]:
        """Derivatives of that, given those of the multipliers."""

    def multipliers(self, theta: Float[Numeric, "... q"], tau: Float[Numeric, "... p"]) -> Float[Numeric, "... m"]:
        """Those of cases under friction."""
        base, unit = self.chosen(theta)
        return base + product(unit, tau)


class Affine(AbstractCases):
    """Cases that add to the multipliers in proportion.

    - `start`, `slope`, `unit`: B_0 (m,), B (m, q) and U (m, p).
    - `rows`, `least`, `most`: multipliers that have limits, and these, shape (c,).
    - `norm`: whether these limits are the half axes of an ellipsoid instead, `most`.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    lower: Float[Numeric, " q"]
    upper: Float[Numeric, " q"]
    start: Float[Numeric, " m"]
    slope: Float[Numeric, "m q"]
    unit: Float[Numeric, "m p"]
    rows: Int[Numeric, " c"]
    least: Float[Numeric, " c"]
    most: Float[Numeric, " c"]
    norm: bool = eqx.field(static=True, default=False)

    def chosen(self, theta: Numeric) -> tuple[Numeric, Numeric]:
        return self.start + theta @ self.slope.T, self.unit

    def slopes(self, theta: Numeric, multipliers: Numeric) -> Numeric:
        return self.slope

    def figures(self, theta: Numeric) -> Numeric:
        return theta

    def excess(self, multipliers: Numeric) -> Numeric:
        own = multipliers[..., self.rows]
        if self.norm:
            return np.sum((own / self.most) ** 2, axis=-1, keepdims=True) - 1.0
        return np.concatenate([(own - self.most) / self.width, (self.least - own) / self.width], axis=-1)

    def excess_slopes(self, multipliers: Numeric, slopes: Numeric) -> Numeric:
        own = slopes[self.rows]
        if self.norm:
            return (2 * multipliers[self.rows] / self.most**2 @ own)[None]
        return np.concatenate([own, -own]) / np.tile(self.width, 2)[:, None]

    @property
    def width(self) -> Float[Numeric, " c"]:
        """Of the limits, 1 where there is none."""
        return np.where(self.most > self.least, self.most - self.least, 1.0)


class Fractional(AbstractCases):
    """Cases of compliance.

    - `least`, `most`: bounds w_1 and w_2 of the diagonal entries `rows`, shape (q,).
    - `start`, `unit`: any multipliers (m,) that solve the equations without friction, and any response (m, p) to it.
    - `stress`: N, shape (m, k).
    - `compliance`, `misfit`: W, shape (m, m), with 0 for the diagonal entries `rows`, shape (q,), and d, shape (m,).
    """

    names: tuple[str, ...] = eqx.field(static=True)
    lower: Float[Numeric, " q"]
    upper: Float[Numeric, " q"]
    least: Float[Numeric, " q"]
    most: Float[Numeric, " q"]
    start: Float[Numeric, " m"]
    unit: Float[Numeric, "m p"]
    stress: Float[Numeric, "m k"]
    compliance: Float[Numeric, "m m"]
    misfit: Float[Numeric, " m"]
    rows: Int[Numeric, " q"]

    @property
    def matters(self) -> Bool[Numeric, " q"]:
        """Which compliances move the multipliers: those of rows in the self-stress."""
        return np.any(self.stress[self.rows] != 0, axis=1)

    def chosen(self, theta: Numeric) -> tuple[Numeric, Numeric]:
        given, own, entries = self._given, self.stress[self.rows], self.figures(theta)
        wanted = self.stress.T @ (self.misfit[:, None] * (np.arange(given.shape[1]) == 0) - self.compliance @ given)
        wanted = wanted - np.einsum("...i,ia,ib->...ab", entries, own, given[self.rows])
        picked = given + self.stress @ np.linalg.solve(self._energy(entries), wanted)
        return picked[..., 0], picked[..., 1:]

    def slopes(self, theta: Numeric, multipliers: Numeric) -> Numeric:
        """-G e_i lam_i for each entry w_i."""
        own, power = self.stress[self.rows], self._power
        caused = self.stress @ np.linalg.solve(self._energy(self.figures(theta)), own.T)
        by_share = (self.most - self.least) * power * np.exp(theta * power) / np.expm1(power)
        return -caused * multipliers[self.rows] * by_share

    def figures(self, theta: Numeric) -> Numeric:
        power = self._power
        return self.least + (self.most - self.least) * np.expm1(theta * power) / np.expm1(power)

    def excess(self, multipliers: Numeric) -> Numeric:
        return multipliers[..., :0]

    def excess_slopes(self, multipliers: Numeric, slopes: Numeric) -> Numeric:
        return slopes[:0]

    @property
    def _given(self) -> Float[Numeric, "m c"]:
        return np.concatenate([self.start[:, None], self.unit], axis=1)

    @property
    def _power(self) -> Float[Numeric, " q"]:
        wide = self.most > self.least
        least = np.maximum(self.least, self.most / _WIDEST)
        return np.log(np.where(wide, self.most / np.where(wide, least, 1.0), 2.0))

    def _energy(self, entries: Numeric) -> Float[Numeric, "... k k"]:
        """N^T W N."""
        own = self.stress[self.rows]
        return self.stress.T @ self.compliance @ self.stress + np.einsum("...i,ia,ib->...ab", entries, own, own)


def corners(lower: Numeric, upper: Numeric) -> Float[np.ndarray, "vertices q"]:
    """All vertices of a box."""
    high = (np.arange(2**lower.size)[:, None] >> np.arange(lower.size)) & 1
    return np.where(high == 1, upper, lower)
