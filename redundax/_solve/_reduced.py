"""The reduced formulation: (25) under a closure, written on the friction forces tau alone.

With F = E tau the equations (25) are linear in x = [qdd; lam] for given tau. One factorisation at the state gives
the response to the load and to each unit friction, and the closure (W, d) picks one multiplier vector from each
family, lam -> (I - G W) lam, with G d added once:

    qdd = qdd_0 + A tau,   lam = lam_0 + Lam tau,                                  G = N (N^T W N)^-1 N^T.

Friction reads a few multipliers rho = lam[rows] only, so that what is left to solve is

    tau = law(rho0 + K tau),   rho0 = lam_0[rows],   K = Lam[rows].

The paper's iterations (27) and (38) depend on x through F(lam) alone and are the same iterations on tau. All else is
recovered after convergence; nothing that is constant in a sweep over closures' misfits, h, x0 or friction
coefficients depends on the batch.
"""

from typing import cast

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._closures._closure import Elasticity
from .._equations._response import AbstractPick, AbstractSolvedFactorisation, LinearResponse, Response, total
from .._solvers._friction_problem import AbstractFrictionProblem, Law
from .._solvers._product_problem import friction_problem
from .._system._decision import Decision
from .._system._friction import have_direction, load_rows
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._numbers import cond, take, xp
from .._tools._value import value


@value
class Reduced:
    """The equations (25) of a system at a state under a closure, reduced to the friction forces.

    - `pick`, `definiteness`: the closure, and the decision whether it determines the multipliers.
    - `response`: x_0 and X.
    - `rows`, `problem`: the multipliers that friction reads, and the equations for tau; without friction none.
    - `motion`: the decision for each slip whether it moves, shape (p,); none without friction.
    - `free_size`: bound of the sum of |free|.
    - `undetermined`: multipliers that are none at a singular position, shape (m,); None where it is regular.
    """

    pick: AbstractPick
    definiteness: Decision
    response: LinearResponse
    rows: Int[Array, " l"]
    problem: AbstractFrictionProblem | None
    motion: Decision | None
    free_size: Float[Array, ""]
    undetermined: Bool[Array, " m"] | None

    @property
    def depends_on_undetermined(self) -> Bool[Array, ""]:
        """Whether friction depends on multipliers that are none here."""
        if self.undetermined is None or self.problem is None:
            return xp.zeros((), bool)
        reads = self.problem.law.largest_changes(xp.eye(self.rows.size, dtype=self.free_size.dtype)) > 0
        return xp.any(reads & take(self.undetermined, self.rows))

    def end_size(
        self, tau: Float[Array, " p"], stress: Float[Array, " m"] | None, end: Response | None = None
    ) -> Float[Array, ""]:
        """Bound of the sum of |x|: if it is finite all of them are; else one is not, or the bound overflows.

        By sparse matrices it is that of x at its end, or without friction.
        """
        size = self.free_size
        if self.problem is not None:
            size = size + self.response.unit.bound(tau, end)
        return size if stress is None else size + total(stress)

    def senseless(
        self, tau: Float[Array, " p"], stress: Float[Array, " m"] | None
    ) -> tuple[Bool[Array, ""], Bool[Array, ""]]:
        """Whether a joint at rest, and whether any joint, has no sense although its friction depends on it."""
        motion = cast(Decision, self.motion)
        problem = cast(AbstractFrictionProblem, self.problem)
        law = problem.law

        def depends() -> tuple[Bool[Array, ""], Bool[Array, ""]]:
            loads = problem.loads(tau) + (0.0 if stress is None else take(stress, self.rows))
            moving = eqx.tree_at(lambda law: law.sense, law, xp.where(law.is_open, 1.0, law.sense))
            lacking = law.is_open & (moving(loads) != law(loads))
            return xp.any(lacking & motion.is_no), xp.any(lacking)

        none = xp.zeros((), bool)
        return cond(xp.any(law.is_open), depends, lambda: (none, none))


def reduce(
    system: AbstractSystem,
    state: State,
    factor: AbstractSolvedFactorisation,
    elasticity: Elasticity,
    *,
    kept: Float[Array, " m"] | Float[Array, ""] | None = None,
    sense: Float[Array, " p"] | None = None,
) -> Reduced:
    """Close and reduce; the self-stress of `kept`, for a closure of minimum norm, is added to `free`."""
    compliance, misfit = elasticity
    pick, definiteness = factor.close(compliance)
    given = misfit if kept is None else misfit + kept
    picked, with_misfit = pick.closed(factor.multipliers, given)
    free = Response(factor.acceleration, with_misfit)
    free_size = total(factor.acceleration, picked) + pick.bound(given)
    ends = free_size, factor.undetermined(compliance)
    if not system.friction:
        none = Response(xp.zeros((state.qd.size, 0), picked.dtype), xp.zeros((picked.size, 0), picked.dtype))
        return Reduced(pick, definiteness, LinearResponse(free, none), xp.zeros(0, int), None, None, *ends)
    rate, unit = factor.to_friction(system, state, pick)
    response = LinearResponse(free, unit)
    angular_slips = xp.asarray(system.slips.angular)
    motion = factor.motion_of(rate * xp.where(angular_slips, factor.length, 1.0))
    directed = have_direction(system.friction)
    senses = _sense(rate, motion, sense, directed)
    if directed.any():  # rounding has a direction, rest has none
        rate = xp.where(directed & motion.is_no, 0.0, rate)
    law = Law.of(system, rate, senses, state)
    rows = load_rows(system.friction)
    angular_loads = take(xp.asarray(system.rows.angular), rows)
    rho0 = pick.loads((picked, with_misfit), given, rows)
    problem = friction_problem(rho0, unit.gain(rows), law, angular_loads)
    return Reduced(pick, definiteness, response, rows, problem, motion, *ends)


def _sense(rate: Array, motion: Decision, sense: Array | None, directed: np.ndarray) -> Array:
    """Sign of the slip rates of joints that move, or of the given sense, or that as a direction."""
    given = 0.0 if sense is None else xp.sign(sense.astype(rate.dtype))
    if sense is not None and directed.any():
        given = xp.where(directed, sense, given)
    return xp.where(motion.is_yes, xp.sign(rate), given)
