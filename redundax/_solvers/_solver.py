"""Solvers of the frictional equations under a closure: fixed point (27) and Newton.

    fixed point:  tau <- law(rho0 + K tau)
    Newton:       tau <- tau - (I - law'(rho) K)^-1 (tau - law(rho))

Both end at a root of tau - law(rho0 + K tau); its derivative is implicit, whatever the iteration did:

    d tau = (I - law' K)^-1 (d law + law' (d rho0 + dK tau)).
"""

import abc
import functools
from typing import TypeVar, cast

import equinox as eqx
import jax
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Float

from .._system._results import RESULTS
from .._tools._chunks import in_chunks
from .._tools._module import check_kind, check_whole, not_negative, optional_figure
from .._tools._numbers import Numeric, custom_jvp, entries_set, known, product, xp
from .._tools._value import AbstractModule, value
from ._friction_problem import AbstractFrictionProblem, FrictionProblem
from ._iterate import Progress, iterate

Solver = TypeVar("Solver", bound="AbstractSolver")


@value
class Root:
    """Where a solver ended.

    - `tau`: friction forces, shape (p,).
    - `progress`: how the iteration went.
    - `fold`: largest fraction of the friction at which the branch from zero friction still exists; infinite if it
      reaches the whole friction, or was not followed.
    - `contraction`: bound of that of sweeps at `tau`, where the solver asks for it.
    """

    tau: Float[Numeric, "... p"]
    progress: Progress
    fold: Float[Numeric, "..."]
    contraction: Float[Numeric, "..."] | None = None


class AbstractSolver(AbstractModule):
    """A way to solve tau = law(rho0 + K tau), with its tolerance."""

    rtol: eqx.AbstractVar[Float[Array, ""] | None]
    max_steps: eqx.AbstractVar[int]

    def __check_init__(self) -> None:
        check_whole(0, max_steps=self.max_steps)
        if self.rtol is not None:
            not_negative("rtol", self.rtol)

    @abc.abstractmethod
    def run(self, problem: AbstractFrictionProblem, start: Float[Numeric, "... p"], *, in_batch: bool = False) -> Root:
        """Solve from a start; `in_batch` says whether it is written out for a batch, or for a single sample."""

    @abc.abstractmethod
    def result(self, progress: Progress) -> RESULTS:
        """The outcome as a value."""

    def tolerance(self, dtype: DTypeLike) -> Float[Array, ""]:
        """`rtol`, at least 10 times the rounding of the dtype; 100 times if not given."""
        eps = xp.finfo(dtype).eps
        return xp.asarray(100 * eps if self.rtol is None else xp.maximum(known(self.rtol), 10 * eps), dtype)


def with_rtol(solver: Solver, rtol: float | None) -> Solver:
    """The same solver with a tolerance, if any, where it is given none."""
    if rtol is None or solver.rtol is not None:
        return solver
    return eqx.tree_at(lambda solver: solver.rtol, solver, xp.asarray(rtol), is_leaf=lambda x: x is None)


# Fixed-point sweeps for one test of convergence; the test costs about as much as a sweep.
_SWEEPS = 3


class FixedPoint(AbstractSolver):
    """Fixed-point iteration (27), written on the friction forces.

    It converges where friction contracts; that it does not says nothing about solutions.

    ??? example

        ```python
        rx.solve(mechanism, state, solver=rx.FixedPoint()).stats.steps
        ```

    **Arguments:**

    - `rtol`: relative tolerance on the change of friction, then of loads, each kind against its own size;
      100 times the rounding of the dtype if not given, by sparse matrices 10^4, and at least 10 times.
    - `max_steps`: iterations at most; convergence is tested after every third.
    """

    rtol: Float[Array, ""] | None = eqx.field(default=None, converter=optional_figure("rtol"))
    max_steps: int = eqx.field(default=1200, static=True)

    def run(self, problem: AbstractFrictionProblem, start: Numeric, *, in_batch: bool = False) -> Root:
        rtol, updates = self.tolerance(start.dtype), -(-self.max_steps // _SWEEPS)
        tau, progress = iterate(lambda tau: self.update(problem, tau), start, rtol, updates)
        progress = eqx.tree_at(lambda progress: progress.steps, progress, _SWEEPS * progress.steps)
        tau = xp.where(progress.converged(rtol), self._finished(problem, tau), tau)
        return Root(tau, progress, xp.full((), xp.inf, start.dtype))

    def _finished(self, problem: AbstractFrictionProblem, tau: Numeric) -> Numeric:
        """One Newton step: slow sweeps stop at a small change while the error is many times larger."""
        return Newton().update(problem, tau)[0]

    def result(self, progress: Progress) -> RESULTS:
        return progress.result(self.tolerance(progress.residual.dtype))

    def update(self, problem: AbstractFrictionProblem, tau: Numeric) -> tuple[Numeric, Numeric, Numeric]:
        """Next tau, relative change of friction and relative change of loads."""
        rho = problem.loads(tau)
        for _ in range(_SWEEPS - 1):
            tau = problem.law(rho)
            rho = problem.loads(tau)
        last_tau, last_rho = tau, rho
        tau = problem.law(rho)
        rho = problem.loads(tau)
        return tau, problem.change_of_friction(tau - last_tau), problem.change_of_load(rho - last_rho)


class Newton(AbstractSolver):
    """Newton's method on the friction forces.

    Under a closure the equations are square and regular away from folds; there is no safeguard. With `closure=None`
    and an initial guess `x0`, `solve` runs the paper's open iteration (38) instead.

    ??? example

        ```python
        rx.solve(mechanism, state, solver=rx.Newton())
        rx.solve(mechanism, state, closure=None, solver=rx.Newton(), x0=100.0)  # Eq. (38)
        ```

    **Arguments:**

    - `rtol`: relative tolerance on the residual, then on the step, each kind against its own size; 100
      times the rounding of the dtype if not given, by sparse matrices 10^4, and at least 10 times.
    - `max_steps`: iterations at most.
    """

    rtol: Float[Array, ""] | None = eqx.field(default=None, converter=optional_figure("rtol"))
    max_steps: int = eqx.field(default=50, static=True)

    def run(self, problem: AbstractFrictionProblem, start: Numeric, *, in_batch: bool = False) -> Root:
        rtol = self.tolerance(start.dtype)
        if start.ndim > 1:
            return self._of_batch(cast(FrictionProblem, problem), start, rtol)
        tau, progress = iterate(lambda tau: self.update(problem, tau), start, rtol, self.max_steps)
        return Root(tau, progress, xp.full((), xp.inf, start.dtype))

    def _of_batch(self, problem: FrictionProblem, start: np.ndarray, rtol: Float[Array, ""]) -> Root:
        """Samples along the first axis, on numbers: those that have ended are left out."""
        tau, left = np.array(start), np.arange(len(start))
        whole = jax.tree.map(lambda x: np.full(len(start), x), Progress.begin(start.dtype))
        while left.size:
            tau[left], residual, step = self.update(problem, tau[left])
            now = jax.tree.map(lambda x, left=left: x[left], whole).after(residual, step)
            whole = jax.tree.map(lambda x, own, left=left: entries_set(x, left, own), whole, now)
            going = now.unfinished(rtol, self.max_steps)
            if not np.all(going):
                left, problem = left[going], problem.of(going)
        return Root(tau, whole, np.full(len(start), np.inf, start.dtype))

    def result(self, progress: Progress) -> RESULTS:
        return progress.result(self.tolerance(progress.residual.dtype))

    def update(self, problem: AbstractFrictionProblem, tau: Numeric) -> tuple[Numeric, Numeric, Numeric]:
        """Next tau, relative residual and relative change of loads."""
        rho = problem.loads(tau)
        residual, change = problem.newton(rho, tau)
        moved = problem.change_of_load(product(problem.gain, change))
        return tau + change, problem.change_of_friction(residual), moved


class Corrector(AbstractSolver):
    """Newton's method to a root beside the start, as in a step of a motion."""

    rtol: Float[Array, ""] | None = eqx.field(default=None, converter=optional_figure("rtol"))
    max_steps: int = eqx.field(default=50, static=True)

    def run(self, problem: AbstractFrictionProblem, start: Numeric, *, in_batch: bool = False) -> Root:
        newton = Newton(self.rtol, self.max_steps)
        return problem.searched(lambda: newton.run(problem, start), self.rtol, start, near=True)

    def result(self, progress: Progress) -> RESULTS:
        return progress.result(self.tolerance(progress.residual.dtype))


@functools.partial(custom_jvp, make=eqx.filter_custom_jvp)
def closed_root(problem: AbstractFrictionProblem, start: Float[Numeric, "... p"], solver: AbstractSolver) -> Root:
    """Friction forces under a closure; their derivative is implicit."""

    def run(
        problem: AbstractFrictionProblem, start: Numeric, solver: AbstractSolver, *, in_batch: bool = False
    ) -> Root:
        return solver.run(problem, start, in_batch=in_batch)

    return in_chunks(functools.partial(run, in_batch=True), problem, start, solver, alone=run)


@closed_root.def_jvp
def _closed_root_jvp(primals: tuple, tangents: tuple) -> tuple:
    problem, start, solver = primals
    root = closed_root(problem, start, solver)
    _, explicit = eqx.filter_jvp(lambda p: p.law(p.loads(root.tau)), (problem,), (tangents[0],))
    explicit = xp.zeros_like(root.tau) if explicit is None else explicit  # of a law that reads none of what changes
    rho = problem.loads(root.tau)
    tau_dot = problem.solution(rho, explicit)
    still = jax.tree.map(lambda x: xp.zeros_like(x) if eqx.is_inexact_array(x) else None, root)
    return root, eqx.tree_at(lambda root: root.tau, still, tau_dot)


def check_solver(solver: object) -> None:
    """Refuse what is no solver of friction."""
    advice = "Give `rx.Continuation()`, `rx.Newton()` or `rx.FixedPoint()`. Solvers of time go to `rx.simulate`."
    check_kind("solver", solver, AbstractSolver, "a solver of friction", advice)
