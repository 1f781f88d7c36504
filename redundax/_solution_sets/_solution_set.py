"""The set of all solutions of (25) at a state, reduced to the friction forces and the self-stress.

    lam = base + U tau,   tau = law(lam[rows]),   qdd = qdd_0 + A tau

whatever has chosen base (m,) and U (m, p): every base + N z in place of base is as good, N being a basis of the
self-stress. Along the pick lam_0, Lam of a closure, minimum norm unless said, z in R^k,

    base = lam_0 + N z,   U = Lam     so that     tau = law(rho0 + N_R z + K tau).

One factorisation at the state serves every z and every choice of base and U.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from .._closures._closure import AbstractClosure, Elasticity, MinimumNorm, elasticity
from .._equations._factorisation import Factorisation
from .._equations._response import LinearResponse
from .._solve._reduced import reduce
from .._solvers._friction_problem import FrictionProblem, Law
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import RedundaxError
from .._tools._numbers import Numeric, on_numbers, product, xp
from .._tools._value import AbstractModule

_MINIMUM_NORM = MinimumNorm()


class SolutionSet(AbstractModule):
    """Figures of all solutions at a state.

    - `response`: that to load and to unit friction, under the closure.
    - `stress`: N, shape (m, k), in units of the multipliers.
    - `law`: the friction laws; None without friction.
    - `rows`: multipliers that they read, shape (l,).
    - `angular_loads`, `angular_slips`: which loads and frictions are moments.
    - `undetermined`: multipliers that have no value at a singular position under the closure, (m,); None elsewhere.
    - `pushing`: rows of contacts, whose multipliers are not negative.
    """

    response: LinearResponse
    stress: Float[Numeric, "m k"]
    law: Law | None
    rows: Int[Numeric, " l"]
    angular_loads: Numeric
    angular_slips: Numeric
    undetermined: Bool[Numeric, " m"] | None = None
    pushing: tuple[int, ...] = eqx.field(static=True, default=())

    def along(self, z: Float[Numeric, "... k"]) -> Float[Numeric, "... m"]:
        """lam_0 + N z."""
        return self.response.free.multipliers + product(self.stress, z)

    def problem(self, base: Float[Numeric, "... m"], unit: Float[Numeric, "... m p"]) -> FrictionProblem:
        """tau = law(base[rows] + unit[rows] tau); on numbers of a batch too, with axes for it in front."""
        if self.law is None:
            raise RedundaxError(
                "Argument `system` must have friction here, but it has none. "
                "Without friction `solve` is all that is needed."
            )
        return FrictionProblem.make(base[..., self.rows], unit[..., self.rows, :], self.law, self.angular_loads)

    def shown(self, values: np.ndarray) -> np.ndarray:
        """[qdd; lam; tau], shape (..., n + m + p), with NaN for multipliers that have no value."""
        if self.undetermined is None:
            return values
        n, m = self.response.free.acceleration.size, self.undetermined.size
        lost = np.pad(np.asarray(self.undetermined), (n, values.shape[-1] - n - m))
        return np.where(lost, np.nan, values)

    def outputs(
        self, base: Float[Numeric, "... m"], unit: Float[Numeric, "... m p"], tau: Float[Numeric, "... p"]
    ) -> Numeric:
        """[qdd; lam; tau], shape (..., n + m + p)."""
        acceleration = self.response.free.acceleration + product(self.response.unit.acceleration, tau)
        return xp.concatenate([acceleration, base + product(unit, tau), tau], axis=-1)


def solution_set(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    stress: Float[Numeric, "k m"],
    sense: Float[Numeric, " p"] | None,
    closure: AbstractClosure = _MINIMUM_NORM,
) -> SolutionSet:
    """The set of solutions, given self-stress states."""
    return _solution_set(system.anonymous, state, factor, stress, sense, elasticity(closure, system, state))


@on_numbers
def _solution_set(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    stress: Numeric,
    sense: Numeric | None,
    chosen: Elasticity,
) -> SolutionSet:
    reduced = reduce(system, state, factor, chosen, sense=sense)
    problem, none = reduced.problem, xp.zeros(0, bool)
    if problem is None:
        return SolutionSet(reduced.response, stress.T, None, reduced.rows, none, none, reduced.undetermined)
    kinds = problem.angular_loads, problem.angular_slips
    return SolutionSet(reduced.response, stress.T, problem.law, reduced.rows, *kinds, reduced.undetermined)
