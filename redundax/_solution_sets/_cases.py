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
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._tools._compilation import compiled
from .._tools._numbers import xp

_WIDEST = 1e6  # ratio of compliances up to which the scale is one of logarithms


class AbstractCases(eqx.Module):
    """Box of cases, and the multipliers that each chooses.

    - `names`: what each entry of theta is.
    - `lower`, `upper`: the box, shape (q,).
    """

    names: eqx.AbstractVar[tuple[str, ...]]
    lower: eqx.AbstractVar[Float[Array, " q"]]
    upper: eqx.AbstractVar[Float[Array, " q"]]

    @abc.abstractmethod
    def chosen(self, theta: Float[Array, " q"]) -> tuple[Float[Array, " m"], Float[Array, "m p"]]:
        """base and U of a case."""

    @abc.abstractmethod
    def figures(self, theta: Float[Array, "... q"]) -> Float[Array, "... q"]:
        """What a case is, in the units of the bounds."""

    @property
    def box(self) -> Float[np.ndarray, "q 2"]:
        """Least and largest figures."""
        return np.stack([self.figures(self.lower), self.figures(self.upper)], axis=1)

    @abc.abstractmethod
    def excess(self, multipliers: Float[Array, " m"]) -> Float[Array, " c"]:
        """How far multipliers exceed their limits, relative to their widths; at most 0 within."""


class Affine(AbstractCases):
    """Cases that add to the multipliers in proportion.

    - `start`, `slope`, `unit`: B_0 (m,), B (m, q) and U (m, p).
    - `rows`, `least`, `most`: multipliers that have limits, and these, shape (c,).
    - `norm`: whether these limits are the half axes of an ellipsoid instead, `most`.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    lower: Float[Array, " q"]
    upper: Float[Array, " q"]
    start: Float[Array, " m"]
    slope: Float[Array, "m q"]
    unit: Float[Array, "m p"]
    rows: Int[Array, " c"]
    least: Float[Array, " c"]
    most: Float[Array, " c"]
    norm: bool = eqx.field(static=True, default=False)

    def chosen(self, theta: Array) -> tuple[Array, Array]:
        return self.start + self.slope @ theta, self.unit

    def figures(self, theta: Array) -> Array:
        return theta

    def excess(self, multipliers: Array) -> Array:
        own = multipliers[self.rows]
        if self.norm:
            return jnp.array([jnp.sum((own / self.most) ** 2) - 1.0])
        width = jnp.where(self.most > self.least, self.most - self.least, 1.0)
        return jnp.concatenate([(own - self.most) / width, (self.least - own) / width])


class Fractional(AbstractCases):
    """Cases of compliance.

    - `least`, `most`: bounds w_1 and w_2 of the diagonal entries `rows`, shape (q,).
    - `start`, `unit`: any multipliers (m,) that solve the equations without friction, and any response (m, p) to it.
    - `stress`: N, shape (m, k).
    - `compliance`, `misfit`: W, shape (m, m), with 0 for the diagonal entries `rows`, shape (q,), and d, shape (m,).
    """

    names: tuple[str, ...] = eqx.field(static=True)
    lower: Float[Array, " q"]
    upper: Float[Array, " q"]
    least: Float[Array, " q"]
    most: Float[Array, " q"]
    start: Float[Array, " m"]
    unit: Float[Array, "m p"]
    stress: Float[Array, "m k"]
    compliance: Float[Array, "m m"]
    misfit: Float[Array, " m"]
    rows: Int[Array, " q"]

    @property
    def matters(self) -> Bool[Array, " q"]:
        """Which compliances move the multipliers: those of rows in the self-stress."""
        return jnp.any(self.stress[self.rows] != 0, axis=1)

    def chosen(self, theta: Array) -> tuple[Array, Array]:
        compliance = self.compliance.at[self.rows, self.rows].add(self.figures(theta))
        given = jnp.concatenate([self.start[:, None], self.unit], axis=1)
        wanted = (-compliance @ given).at[:, 0].add(self.misfit)
        picked = given + self_stress_of(self.stress, compliance, wanted)
        return picked[:, 0], picked[:, 1:]

    def figures(self, theta: Array) -> Array:
        wide = self.most > self.least
        least = jnp.maximum(self.least, self.most / _WIDEST)
        power = jnp.log(jnp.where(wide, self.most / jnp.where(wide, least, 1.0), 2.0))
        return self.least + (self.most - self.least) * jnp.expm1(theta * power) / jnp.expm1(power)

    def excess(self, multipliers: Array) -> Array:
        return jnp.zeros(0, multipliers.dtype)


def self_stress_of(
    stress: Float[Array, "m k"], compliance: Float[Array, "m m"], misfit: Float[Array, "m c"]
) -> Float[Array, "m c"]:
    """N (N^T W N)^-1 N^T d: the self-stress that each column of misfits causes under a compliance."""
    return stress @ xp.linalg.solve(stress.T @ compliance @ stress, stress.T @ misfit)


def corners(cases: AbstractCases) -> Float[np.ndarray, "vertices q"]:
    """All vertices of the box."""
    q = cases.lower.size
    high = (np.arange(2**q)[:, None] >> np.arange(q)) & 1
    return np.where(high == 1, np.asarray(cases.upper), np.asarray(cases.lower))


@compiled
def multipliers_of(cases: AbstractCases, theta: Float[Array, "s q"], tau: Float[Array, " p"]) -> Float[Array, "s m"]:
    """Multipliers of many cases under one friction."""

    def one(theta: Array) -> Array:
        base, unit = cases.chosen(theta)
        return base + unit @ tau

    return jax.vmap(one)(theta)
