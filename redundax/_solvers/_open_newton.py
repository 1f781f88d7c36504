"""Newton's method without a closure, Eqs. (34) to (38), on the friction unknowns.

The paper's step is the minimum-norm solution of G_x s = -G. Every x with A x = b(tau) is

    x = x_p + X tau + [0; v],   X = [A_tau; Lam],   v = N z,   Lam^T N = 0,

x_p and X being the minimum-norm responses to load and to unit friction. With F linearised at the loads rho,
slope J = d law / d rho, Lam_R = Lam[rows], S = P[rows, rows] and B = I - J Lam_R, the step is

    min dtau^T X^T X dtau / 2 - r^T dtau + |dv|^2 / 2   subject to   B dtau - J dv[rows] = e,
    e = law(rho) - tau + J (loads of x - rho),

whose stationarity dv = -P[:, rows] J^T mu leaves, with g = tr(X^T X) / p,

    [ X^T X / g   -B^T      ] [ dtau   ]   [ r / g ]
    [ B           g J S J^T ] [ mu / g ] = [ e     ],

solved for Q^T dtau, Q from the singular value decomposition of X: the squares of singular values that differ by
1e8 and more, as in extreme units, then stand on the diagonal and keep their digits.

r and the second part of e differ from 0 in the first step only, where x0 need not satisfy A x = b. The
iterates are the paper's to rounding. The end point depends on x0, and its derivative is that of the
iterations, not an implicit one: the end point moves along the null vector of G_x too.

Where friction is proved to contract strongly `_quick_newton` takes the same steps, in programs for batches, and these
only where it fails.
"""

import functools
from typing import NamedTuple

import equinox as eqx
from jaxtyping import Array, Float

from .._tools._compilation import is_single
from .._tools._numbers import are_numbers, custom_jvp, take, xp
from ._iterate import iterate, run_unless
from ._open_problem import OpenEnd, OpenProblem
from ._quick_newton import quick_newton
from ._solver import Newton


class OpenIterate(NamedTuple):
    """Linearised friction tau, loads rho, and w of the self-stress v = P lam0 + P[:, rows] w."""

    tau: Float[Array, " p"]
    rho: Float[Array, " l"]
    w: Float[Array, " l"]


def first_step(open_problem: OpenProblem) -> OpenIterate:
    """The iterate x1, from any x0."""
    problem, rho = open_problem.problem, open_problem.first
    slope = problem.law.slope(rho)
    residual = problem.law(rho) + slope @ (problem.rho0 - rho)
    still = OpenIterate(xp.zeros_like(open_problem.pull), rho, xp.zeros_like(rho))
    return _step(open_problem, still, slope, residual, open_problem.pull)


def update(open_problem: OpenProblem, y: OpenIterate) -> tuple[OpenIterate, Array, Array]:
    """One later step, with relative residual G and relative step."""
    problem = open_problem.problem
    law = problem.law(y.rho)
    residual = law - y.tau
    new = _step(open_problem, y, problem.law.slope(y.rho), residual, xp.zeros_like(residual))
    return new, problem.change_of_friction(residual), problem.change_of_load(new.rho - y.rho)


def _step(open_problem: OpenProblem, y: OpenIterate, slope: Array, residual: Array, pull: Array) -> OpenIterate:
    p = residual.size
    stress, axes, gram = open_problem.stress, open_problem.axes, open_problem.gram
    lower = axes - slope @ (open_problem.problem.gain @ axes)
    size = xp.trace(gram) / p
    matrix = xp.block([[gram / size, -lower.T], [lower, size * slope @ stress @ slope.T]])
    step = xp.linalg.solve(matrix, xp.concatenate([pull / size, residual]))
    tau, w = y.tau + axes @ step[:p], y.w - slope.T @ (size * step[p:])
    return OpenIterate(tau, open_problem.problem.loads(tau) + stress @ w, w)


@functools.partial(custom_jvp, make=eqx.filter_custom_jvp)
def open_root(open_problem: OpenProblem, rtol: Float[Array, ""], max_steps: int) -> OpenEnd:
    """End of Newton (38) from x0; the derivative goes through the iterations."""

    def run(rho0: Array, first: Array) -> OpenEnd:
        changed = open_problem.problem.at(rho0), first
        given = eqx.tree_at(lambda given: (given.problem, given.first), open_problem, changed)
        return _run(given, rtol, max_steps, bounded=False)

    if is_single() or are_numbers(open_problem):
        return _run(open_problem, rtol, max_steps, bounded=False)
    end = quick_newton(open_problem, rtol, max_steps)
    return run_unless(end.progress.converged(rtol), end, run, open_problem.problem.rho0, open_problem.first)


@open_root.def_jvp
def _open_root_jvp(primals: tuple, tangents: tuple) -> tuple:
    _, rtol, max_steps = primals
    return eqx.filter_jvp(lambda problem: _run(problem, rtol, max_steps, bounded=True), primals[:1], tangents[:1])


def _run(open_problem: OpenProblem, rtol: Array, max_steps: int, *, bounded: bool) -> OpenEnd:
    end, progress = iterate(
        lambda y: update(open_problem, y), first_step(open_problem), rtol, max_steps, bounded=bounded
    )
    stress = open_problem.balance @ (open_problem.projector @ end.w)  # w is much larger than what is left of it
    tau = xp.where(progress.converged(rtol), _finished(open_problem, stress, end.tau), end.tau)
    return OpenEnd(tau, stress, progress)


def _finished(open_problem: OpenProblem, stress: Array, tau: Array) -> Array:
    """One step at the same self-stress: the law held to rounding of the loads as they were before they balanced."""
    problem = open_problem.problem
    kept = eqx.tree_at(lambda problem: problem.rho0, problem, problem.rho0 + take(stress, open_problem.rows))
    return Newton().update(kept, tau)[0]
