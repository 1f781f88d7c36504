"""The default solver of the frictional equations under a closure: Newton first, then continuation in the friction.

    H(y, s) = y - s l(y) = 0,   tau = T y,   l(y) = T^-1 law(rho0 + K T y),   T = diag(friction_size)

At s = 0 the only solution is y = 0, without friction, and s = 1 is the problem. The branch through it is followed
by pseudo-arclength steps z = (y, s): a predictor along the tangent t, then Newton's method on

    H(z) = 0,   t^T (z - z_predicted) = 0,

whose matrix [H_z; t^T] stays regular where the branch folds. With Coulomb friction s is a factor of all friction
coefficients. Where the branch folds back or runs to infinity before s = 1 it ends at the `fold`; past a fold it is
followed on, because it may come back.

Newton's end point is kept where friction contracts at it. Elsewhere it may lie on a branch of its own, so the
solution on the branch from zero friction is preferred. Where Newton converges and friction contracts, the loop of the
continuation does not run.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ._friction_problem import FrictionProblem
from ._iterate import Progress, iterate
from ._module import optional_float
from ._results import RESULTS
from ._solver import AbstractSolver, Newton, Root

_FIRST, _LONGEST, _SHORTEST = 0.05, 1e3, 1e-9  # arclength steps, in units of the first sweep's friction
_CORRECTIONS = 4
_STRAIGHT = 0.98  # least cosine between tangents of accepted steps, but for steps so short that it is a kink:
_KINK = 1e-5
_FAR = 1e9  # |y| that counts as infinite


class Continuation(AbstractSolver):
    """Newton's method, and where it does not settle the matter the branch from zero friction; the default.

    It ends with `RESULTS.no_solution_found` where neither finds a solution; `stats.fold` is then the fraction of the
    friction up to which there is one.

    **Arguments:**

    - `rtol`: relative tolerance on the residual, then on the step, each kind against its own size; 100
      times the rounding of the dtype if not given, and at least 10 times.
    - `max_steps`: Newton iterations at most.
    - `max_path`: steps along the branch at most.
    """

    rtol: Float[Array, ""] | None = eqx.field(default=None, converter=optional_float)
    max_steps: int = eqx.field(default=50, static=True)
    max_path: int = eqx.field(default=400, static=True)

    def run(self, problem: FrictionProblem, start: Array) -> Root:
        newton, rtol = Newton(self.rtol, self.max_steps), self.tolerance(start.dtype)
        root = newton.run(problem, start)
        settled = root.progress.converged(rtol) & (problem.contraction(root.tau) < 1)
        path = _follow(problem, ~settled, self.max_path)
        tau = jnp.where(path.arrived, path.here[:-1] * problem.friction_size, root.tau)
        problem = problem.sized_at(tau)
        begin = Progress.begin(start.dtype)
        begin = jax.tree.map(lambda new, old: jnp.where(path.arrived, new, old), begin, root.progress)
        tau, progress = iterate(lambda tau: newton.update(problem, tau), tau, rtol, self.max_steps, begin=begin)
        steps = jnp.where(path.arrived, root.progress.steps, 0) + path.steps + progress.steps
        progress = eqx.tree_at(lambda progress: progress.steps, progress, steps)
        reached = settled | (path.arrived & progress.converged(rtol))
        return Root(tau, progress, jnp.where(reached, jnp.inf, path.fold))

    def result(self, progress: Progress) -> RESULTS:
        converged = progress.converged(self.tolerance(progress.residual.dtype))
        return RESULTS.where(converged, RESULTS.successful, RESULTS.no_solution_found)


class _Path(NamedTuple):
    """A point z = (y, s) of the branch with its unit tangent, the next step, the largest s so far, and the outcome."""

    here: Float[Array, " p+1"]
    tangent: Float[Array, " p+1"]
    step: Float[Array, ""]
    fold: Float[Array, ""]
    steps: Int[Array, ""]
    arrived: Bool[Array, ""]
    ended: Bool[Array, ""]


def _follow(problem: FrictionProblem, wanted: Bool[Array, ""], max_path: int) -> _Path:
    """The branch from zero friction, up to s = 1 or its end; nothing where it is not wanted."""
    size = problem.friction_size

    def residual(z: Array) -> Array:
        return z[:-1] - z[-1] * problem.law(problem.loads(size * z[:-1])) / size

    def bordered(z: Array, tangent: Array) -> Array:
        rho = problem.loads(size * z[:-1])
        slope = problem.slope(rho) * size / size[:, None]
        by_s = -problem.law(rho) / size
        top = jnp.concatenate([jnp.eye(size.size, dtype=z.dtype) - z[-1] * slope, by_s[:, None]], axis=1)
        return jnp.concatenate([top, tangent[None]])

    def advance(path: _Path) -> _Path:
        guess = path.here + path.step * path.tangent

        def correct(_: Array, carry: tuple[Array, Array]) -> tuple[Array, Array]:
            z, _ = carry
            off = jnp.append(residual(z), path.tangent @ (z - guess))
            change = jnp.linalg.solve(bordered(z, path.tangent), off)
            return z - change, change

        z, change = jax.lax.fori_loop(0, _CORRECTIONS, correct, (guess, guess))
        last = jnp.zeros_like(z).at[-1].set(1.0)
        tangent = jnp.linalg.solve(bordered(z, path.tangent), last)
        tangent = tangent / jnp.linalg.norm(tangent)
        reach = 1 + jnp.linalg.norm(z)
        close = (jnp.linalg.norm(change) <= 1e-6 * reach) & (jnp.linalg.norm(z - guess) <= 0.5 * path.step)
        turn = tangent @ path.tangent
        good = close & (turn > jnp.where(path.step > _KINK * reach, _STRAIGHT, 0.0))
        return _accepted(path, z, tangent, turn, good)

    def going(path: _Path) -> Array:
        return wanted & ~path.arrived & ~path.ended & (path.steps < max_path)

    first = jnp.append(problem.law(problem.rho0) / size, 1.0)
    finite = jnp.all(jnp.isfinite(first)) & jnp.all(jnp.isfinite(problem.gain))
    begin = _Path(
        here=jnp.zeros_like(first),
        tangent=first / jnp.linalg.norm(first),
        step=jnp.full((), _FIRST, size.dtype),
        fold=jnp.zeros((), size.dtype),
        steps=jnp.zeros((), int),
        arrived=jnp.zeros((), bool),
        ended=~finite,
    )
    return jax.lax.while_loop(going, advance, begin)


def _accepted(path: _Path, z: Array, tangent: Array, turn: Array, good: Array) -> _Path:
    """The path after a step to z, or with half the step where z is not good."""
    s0, s1 = path.here[-1], z[-1]
    arrived = good & (s1 >= 1)
    share = jnp.where(arrived, (1 - s0) / jnp.where(arrived, s1 - s0, 1.0), 1.0)
    here = jnp.where(good, path.here + share * (z - path.here), path.here)
    slope0, slope1 = path.tangent[-1], tangent[-1]
    turned = good & (slope0 > 0) & (slope1 <= 0)  # the fold of the parabola with these slopes
    top = s0 + 0.5 * path.step * slope0**2 / jnp.where(turned, slope0 - slope1, 1.0)
    fold = jnp.maximum(path.fold, jnp.where(turned, jnp.maximum(top, s0), here[-1]))
    step = path.step * jnp.where(good, jnp.where(turn > 0.5 * (1 + _STRAIGHT), 2.0, 1.0), 0.5)
    far = jnp.linalg.norm(here)
    ended = (good & (s1 <= 0)) | (far > _FAR) | (step < _SHORTEST * (1 + far))
    step = jnp.minimum(step, _LONGEST * (1 + far))
    return _Path(here, jnp.where(good, tangent, path.tangent), step, fold, path.steps + 1, arrived, ended)
