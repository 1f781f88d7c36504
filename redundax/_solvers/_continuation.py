"""The default solver of the frictional equations under a closure: sweeps, Newton, then continuation in the friction.

    H(y, s) = y - s l(y) = 0,   tau = T y,   l(y) = T^-1 law(rho0 + K T y),   T = diag(friction_size)

At s = 0 the only solution is y = 0, without friction, and s = 1 is the problem. The branch through it is followed by
pseudo-arclength steps (`_arclength`). With Coulomb friction s is a factor of all friction coefficients. Where the
branch folds back or runs to infinity before s = 1 it ends at the `fold`; past a fold it is followed on, because it may
come back.

Where friction is proved to contract strongly at all loads there is one solution, and sweeps find it (`_quick_sweeps`);
nothing else runs then, in a batch neither. Otherwise Newton's end point is kept where friction contracts at it.
Elsewhere it may lie on a branch of its own, so the solution on the branch from zero friction is preferred. Where Newton
converges and friction contracts, the loop of the continuation does not run.

In large scenes nothing is proved: sweeps that settle are taken, and else the branch is followed to its first fold
(`_mixing`).
"""

from typing import NamedTuple, cast

import equinox as eqx
from jaxtyping import Array, Bool, Float

from .._system._results import RESULTS, chosen
from .._tools._module import check_whole, optional_figure
from .._tools._numbers import are_numbers, chosen_of, while_loop, xp
from .._tools._value import found_once
from ._arclength import Path, follow
from ._friction_problem import AbstractFrictionProblem, FrictionProblem
from ._iterate import Progress, iterate, run_unless
from ._quick_sweeps import quick_sweeps
from ._solver import AbstractSolver, Newton, Root


class Continuation(AbstractSolver):
    """Sweeps or Newton's method, and where they do not settle the matter the branch from zero friction; the default.

    It ends with `RESULTS.no_solution_found` where neither finds a solution; `stats.fold` is then the fraction of the
    friction up to which there is one, by sparse matrices that up to which it was followed.

    ??? example

        ```python
        solution = rx.solve(mechanism, state, solver=rx.Continuation(max_path=800))
        solution.stats.fold  # infinite: there is a solution with all of the friction
        ```

    **Arguments:**

    - `rtol`: relative tolerance on the residual, then on the step, each kind against its own size; 100
      times the rounding of the dtype if not given, by sparse matrices 10^4, and at least 10 times.
    - `max_steps`: Newton iterations at most.
    - `max_path`: steps along the branch at most.
    """

    rtol: Float[Array, ""] | None = eqx.field(default=None, converter=optional_figure("rtol"))
    max_steps: int = eqx.field(default=50, static=True)
    max_path: int = eqx.field(default=400, static=True)

    def __check_init__(self) -> None:
        check_whole(0, max_path=self.max_path)

    def run(self, problem: AbstractFrictionProblem, start: Array, *, in_batch: bool = False) -> Root:
        return problem.searched(
            lambda: self._run(cast(FrictionProblem, problem), start, in_batch=in_batch), self.rtol, start, near=False
        )

    def _run(self, problem: FrictionProblem, start: Array, *, in_batch: bool) -> Root:
        rtol = self.tolerance(start.dtype)

        def search(rho0: Array, start: Array) -> Root:
            return self._searched(problem.at(rho0), start)

        if are_numbers(problem.rho0, start):  # a batch alone gains by what comes first
            return self._searched(problem, start)
        root = quick_sweeps(problem, start, rtol, in_batch=in_batch)
        return run_unless(root.progress.converged(rtol), root, search, problem.rho0, start)

    @found_once
    def first(self) -> "FirstAttempt":
        """What the search begins with, alone."""
        return FirstAttempt(self.rtol, self.max_steps)

    def _searched(self, problem: FrictionProblem, start: Array) -> Root:
        """Newton's method from the start and, where the branch from zero friction arrives, from its end."""
        newton, rtol = Newton(self.rtol, self.max_steps), self.tolerance(start.dtype)

        def attempt(search: _Search) -> _Search:
            here = problem.sized_at(chosen_of(search.arrived, search.root.tau, problem.friction_size))
            tau, progress = iterate(lambda tau: newton.update(here, tau), search.root.tau, rtol, self.max_steps)
            settled = search.arrived | (problem.contraction(problem.loads(tau)) < 1)
            settled = progress.converged(rtol) & settled
            path = _follow(problem, ~settled & ~search.arrived, self.max_path)
            tau = chosen_of(path.arrived, path.here[..., :-1] * problem.friction_size, tau)
            steps = search.root.progress.steps + path.steps + progress.steps
            progress = eqx.tree_at(lambda progress: progress.steps, progress, steps)
            fold = xp.where(settled, xp.inf, xp.where(search.arrived, search.root.fold, path.fold))
            return _Search(Root(tau, progress, fold), path.arrived, ~path.arrived)

        no = xp.zeros((), bool)
        begin = _Search(Root(start, Progress.begin(start.dtype), xp.full((), xp.inf, start.dtype)), no, no)
        return while_loop(lambda search: ~search.ended, attempt, begin).root

    def result(self, progress: Progress) -> RESULTS:
        converged = progress.converged(self.tolerance(progress.residual.dtype))
        return chosen(converged, RESULTS.successful, RESULTS.no_solution_found)


class FirstAttempt(AbstractSolver):
    """Newton's method from the start, as the search of `Continuation` begins.

    The `fold` is infinite where its end point is kept, because friction contracts there, and 0 where the branch from
    zero friction must be followed.
    """

    rtol: Float[Array, ""] | None
    max_steps: int = eqx.field(static=True)

    def run(self, problem: AbstractFrictionProblem, start: Array, *, in_batch: bool = False) -> Root:
        return problem.searched(lambda: self._run(cast(FrictionProblem, problem), start), self.rtol, start, near=False)

    def _run(self, problem: FrictionProblem, start: Array) -> Root:
        root = Newton(self.rtol, self.max_steps).run(problem, start)
        contraction = problem.contraction(problem.loads(root.tau))
        kept = root.progress.converged(self.tolerance(start.dtype)) & (contraction < 1)
        return Root(root.tau, root.progress, xp.where(kept, xp.inf, 0.0).astype(start.dtype), contraction)

    def result(self, progress: Progress) -> RESULTS:
        return Continuation(self.rtol).result(progress)


class _Search(NamedTuple):
    """Where a search stands, whether the branch from zero friction arrived there, and whether it has ended."""

    root: Root
    arrived: Bool[Array, "..."]
    ended: Bool[Array, "..."]


def _follow(problem: FrictionProblem, wanted: Bool[Array, "..."], max_path: int) -> Path:
    """The branch from zero friction, up to s = 1 or its end; nothing where it is not wanted."""
    size = problem.friction_size

    def equations(x: Array) -> tuple[Array, Array]:
        force, by_tau = problem.linearised(problem.loads(size * x[..., :-1]))
        by_y = xp.eye(size.shape[-1], dtype=x.dtype) - x[..., -1:, None] * by_tau * size[..., None, :] / size[..., None]
        by_x = xp.concatenate([by_y, -(force / size)[..., None]], axis=-1)
        return x[..., :-1] - x[..., -1:] * force / size, by_x

    first = problem.law(problem.rho0) / size
    first = xp.concatenate([first, xp.ones_like(first[..., :1])], axis=-1)
    wanted = wanted & xp.all(xp.isfinite(problem.gain), axis=(-2, -1))
    return follow(equations, xp.zeros_like(first), first, wanted, max_path)
