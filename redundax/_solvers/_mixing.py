"""Sweeps (27) of a large scene, each one more right-hand side, and Anderson's mixing where they do not settle.

    g_s(tau) = s law(rho0 + K tau),   f = g_s(tau) - tau,   tau <- g - G c,   c = argmin |f - F c|

The columns of F and G are the last changes of f and g; near a solution this is GMRES on Newton's equations, at one
product with K a pass. The branch from zero friction is followed in s, a factor of the friction, in steps that are
halved where they do not settle: up to s = 1, or to where it folds back.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .._system._results import RESULTS
from .._tools._module import optional_figure
from ._friction_problem import AbstractFrictionProblem
from ._iterate import Progress, iterate, run_unless
from ._solver import AbstractSolver, Root

_SWEEPS = 60  # those that contract by a half reach rounding
_COLUMNS, _PASSES = 12, 60  # of F and G; passes of a step along the branch
_SHORTEST, _NEAR, _ON_THE_WAY = 1e-3, 0.5, 1e-6  # step; change of friction in one; tolerance before the last


class Mixing(AbstractSolver):
    """Sweeps, then mixing along the branch from zero friction; `first` is the first step along it.

    With 1 it mixes at once, with all of the friction and from the start that is given.
    """

    rtol: Float[Array, ""] | None = eqx.field(default=None, converter=optional_figure("rtol"))
    max_steps: int = eqx.field(default=2000, static=True)
    first: float = eqx.field(default=0.25, static=True)

    def run(self, problem: AbstractFrictionProblem, start: Array, *, in_batch: bool = False) -> Root:
        rtol, infinite = self.tolerance(start.dtype), jnp.full((), jnp.inf, start.dtype)
        if self.first == 1:
            return self._followed(problem, start, rtol)

        def sweep(tau: Array) -> tuple[Array, Array, Array]:
            new = problem.law(problem.loads(tau))
            change = problem.change_of_friction(new - tau)
            return new, change, change

        tau, progress = iterate(sweep, start, rtol, _SWEEPS)
        root = Root(tau, progress, infinite)

        def search(rho0: Array, start: Array) -> Root:
            return self._followed(problem.at(rho0), start, rtol)

        return run_unless(progress.converged(rtol), root, search, problem.rho0, start)

    def result(self, progress: Progress) -> RESULTS:
        converged = progress.converged(self.tolerance(progress.residual.dtype))
        return RESULTS.where(converged, RESULTS.successful, RESULTS.no_solution_found)

    def _followed(self, problem: AbstractFrictionProblem, start: Array, rtol: Array) -> Root:
        def going(way: _Way) -> Array:
            return ((way.reached < 1) & (way.step >= _SHORTEST)) & (way.passes < self.max_steps)

        def advance(way: _Way) -> _Way:
            g = way.s * problem.law(problem.loads(way.tau))
            f = g - way.tau
            residual = problem.change_of_friction(f)
            last = way.s >= 1
            settled = residual <= jnp.where(last, rtol, _ON_THE_WAY)
            near = problem.change_of_friction(g - way.begin) <= _NEAR
            good = settled & (near | (way.reached == 0))
            failed = ~good & (settled | ~jnp.isfinite(residual) | (way.tries >= _PASSES))
            reached = jnp.where(good, way.s, way.reached)
            there = jnp.where(good, g, way.there)
            step = jnp.where(failed, way.step / 2, jnp.where(good, 1.5 * way.step, way.step))
            s = jnp.where(good | failed, jnp.minimum(reached + step, 1.0), way.s)
            begin = jnp.where(reached > 0, s / jnp.where(reached > 0, reached, 1.0) * there, 0.0 * g)
            mixed = _mixed(way, f, g)
            anew = good | failed
            return _Way(
                tau=jnp.where(anew, begin, mixed.tau),
                begin=jnp.where(anew, begin, way.begin),
                there=there,
                s=s,
                reached=reached,
                step=step,
                residual=residual,
                tries=jnp.where(anew, 0, way.tries + 1),
                passes=way.passes + 1,
                last=mixed.last,
                changes=mixed.changes,
            )

        begin = start if self.first == 1 else 0.0 * start
        none, one = jnp.zeros((2, start.size, _COLUMNS), start.dtype), jnp.full((), self.first, start.dtype)
        zero, count = 0.0 * one, jnp.zeros((), int)
        way = _Way(begin, begin, begin, one, zero, one, one, count, count, none[:, :, 0], none)
        way = jax.lax.while_loop(going, advance, way)
        there = way.reached >= 1
        residual = jnp.where(there, way.residual, jnp.inf)
        progress = Progress(way.passes, residual, residual, residual, count)
        return Root(way.there, progress, jnp.where(there, jnp.inf, way.reached))


class _Way(NamedTuple):
    """A branch so far.

    - `tau`, `begin`: friction, and that which the step along the branch began with.
    - `there`, `reached`: the last solution on the branch, and its s; `s`, `step`: that which is sought, and the step.
    - `residual`: |f| of the last pass, relative.
    - `tries`, `passes`: passes of this step, and of all.
    - `last`, `changes`: f and g of the last pass; and F and G.
    """

    tau: Float[Array, " p"]
    begin: Float[Array, " p"]
    there: Float[Array, " p"]
    s: Float[Array, ""]
    reached: Float[Array, ""]
    step: Float[Array, ""]
    residual: Float[Array, ""]
    tries: Int[Array, ""]
    passes: Int[Array, ""]
    last: Float[Array, "two p"]
    changes: Float[Array, "two p columns"]


class _Mixed(NamedTuple):
    """The next friction, and what is kept for those after it."""

    tau: Float[Array, " p"]
    last: Float[Array, "two p"]
    changes: Float[Array, "two p columns"]


def _mixed(way: _Way, f: Float[Array, " p"], g: Float[Array, " p"]) -> _Mixed:
    now = jnp.stack([f, g])
    kept = jnp.where(way.tries <= 1, 0.0, way.changes)
    added = jnp.where(way.tries == 0, 0.0, now - way.last)
    changes = kept.at[:, :, way.passes % _COLUMNS].set(added)
    of_f = changes[0]
    size = jnp.linalg.norm(of_f, axis=0)
    size = jnp.where(size > 0, size, 1.0)
    unit = of_f / size
    blur = 10 * jnp.finfo(f.dtype).eps
    weights = jnp.linalg.solve(unit.T @ unit + blur * jnp.eye(_COLUMNS, dtype=f.dtype), unit.T @ f) / size
    return _Mixed(g - changes[1] @ weights, now, changes)
