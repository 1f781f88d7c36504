"""Linear systems of known rank as exact data."""

from dataclasses import dataclass
from functools import cached_property

from mpmath import mp
from truth import exact
from truth.exact import exactly
from truth.scenes import Parameters


@dataclass(frozen=True, eq=False)
class Linear(exact.AbstractExact):
    """Phi(q, t) = [J; T J] q - [c; T c] t^2 / 2 at q = 0, qd = 0, t = 0: dependent rows are combinations T."""

    mass: tuple
    load_: tuple
    free: tuple
    combinations: tuple
    free_gamma: tuple

    @property
    def rank(self) -> int:
        """Number of independent rows."""
        return len(self.free)

    @property
    def kinds(self) -> tuple:
        """Kinds of the rows."""
        return ("force",) * (len(self.free) + len(self.combinations))

    @cached_property
    @exactly
    def mass_matrix(self):
        """M (n, n)."""
        return mp.diag(list(self.mass))

    @cached_property
    @exactly
    def load(self):
        """Q (n, 1)."""
        return mp.matrix(list(self.load_))

    @cached_property
    @exactly
    def jacobian(self):
        """Phi_q (m, n)."""
        return self._with_combinations(mp.matrix([list(row) for row in self.free]))

    @cached_property
    @exactly
    def gamma(self):
        """gamma (m, 1)."""
        return self._with_combinations(mp.matrix(list(self.free_gamma)))

    def _with_combinations(self, rows):
        whole = mp.zeros(self.m, rows.cols)
        whole[: self.rank, :] = rows
        if self.combinations:
            whole[self.rank :, :] = mp.matrix([list(row) for row in self.combinations]) * rows
        return whole

    @property
    def distribution(self):
        """No friction."""
        return mp.zeros(self.n, 0)


def linear(p: Parameters) -> Linear:
    """A linear system from its parameters."""
    return Linear(p["mass"], p["load"], p["free"], p["combinations"], p["gamma"])
