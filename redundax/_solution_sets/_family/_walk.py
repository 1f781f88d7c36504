"""Solutions along a straight piece of the self-stress, by continuation in it.

    H(y, s) = y - T^-1 law(rho0 + N_R (z_0 + s dz) + K T y),   tau = T y,   T = diag(friction_size)

From a solution at s = 0 the curve H = 0 is followed until it arrives at s = 1, or, past a fold, returns to s = 0 at
another solution; so one solution found anywhere brings the others of its curve. At the fold s has its largest value:

    H(y, s) = 0,   H_y v = 0,   c^T v = 1.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..._solve._all_solutions import search
from ..._solvers._arclength import bordered_matrix, follow
from ..._solvers._friction_problem import FrictionProblem
from ..._solvers._solver import Newton
from ..._tools._compilation import compiled
from ..._tools._numbers import Numeric
from .._solution_set import SolutionSet

_MAX_PATH = 400
_NEAR = 1e-2  # relative distance within which Newton's method may end from where the path ended
_FOLD_STEPS = 12


class Walk(NamedTuple):
    """End of a walk from z_0 to z_0 + dz.

    - `tau`: friction at the end, shape (p,).
    - `arrived`, `returned`: whether that is a solution at z_0 + dz, or another one at z_0.
    - `folded`, `fold_tau`, `fold`: whether a smooth fold was passed, friction there, and s.
    """

    tau: Float[Array, " p"]
    arrived: Bool[Array, ""]
    returned: Bool[Array, ""]
    folded: Bool[Array, ""]
    fold_tau: Float[Array, " p"]
    fold: Float[Array, ""]


def search_along(
    solutions: SolutionSet, z: Float[np.ndarray, "samples k"], factors: Float[np.ndarray, "starts l"]
) -> tuple[Float[np.ndarray, "samples starts+1 p"], Bool[np.ndarray, "samples starts+1"]]:
    """Friction of the solutions found at every z, and which of them are solutions that differ."""
    if solutions.law is None:
        return np.zeros((len(z), 1, 0)), np.ones((len(z), 1), bool)
    return search(_at(solutions, z), factors)


@compiled
def walk(
    solutions: SolutionSet, tau: Float[Numeric, "walks p"], z: Float[Numeric, "walks k"], dz: Float[Numeric, "walks k"]
) -> Walk:
    """Walks from solutions with the friction `tau` at z towards z + dz."""
    return jax.vmap(lambda *start: _walk(solutions, *start))(tau, z, dz)


def _at(solutions: SolutionSet, z: Numeric) -> FrictionProblem:
    return solutions.problem(solutions.along(z), solutions.response.unit.multipliers)


def _walk(solutions: SolutionSet, tau: Array, z: Array, dz: Array) -> Walk:
    problem = _at(solutions, z).sized_at(tau)
    size, push = problem.friction_size, (solutions.stress @ dz)[solutions.rows]

    def equations(x: Array) -> tuple[Array, Array]:
        force, by_load = problem.law.linearised(problem.loads(size * x[:-1]) + x[-1] * push)
        by_y = jnp.eye(size.size, dtype=x.dtype) - (by_load @ problem.gain) * size / size[:, None]
        return x[:-1] - force / size, jnp.concatenate([by_y, -(by_load @ push / size)[:, None]], axis=1)

    start = jnp.append(tau / size, 0.0)
    up = jnp.zeros_like(start).at[-1].set(1.0)
    along = jnp.linalg.solve(bordered_matrix(equations(start)[1], up), up)
    path = follow(equations, start, along, jnp.array(True), _MAX_PATH)
    end = path.here[:-1] * size
    there = _at(solutions, z + jnp.where(path.arrived, 1.0, 0.0) * dz).sized_at(end)
    newton = Newton()
    root = newton.run(there, end)
    near = there.change_of_friction(root.tau - end) <= _NEAR
    sound = near & root.progress.converged(newton.tolerance(end.dtype))
    # Of the walk's parts the fold runs last: it starts from Newton's end so that no two factorisations run at once.
    fold, folded = _fold(equations, path.before_fold + 0.0 * jnp.sum(jnp.nan_to_num(root.tau)), path.returned)
    return Walk(root.tau, sound & path.arrived, sound & path.returned, folded, fold[:-1] * size, fold[-1])


def _fold(equations: Callable[[Array], tuple[Array, Array]], near: Array, wanted: Array) -> tuple[Array, Array]:
    """The fold beside a point of the curve, and whether Newton's method has found it."""
    p = near.size - 1
    vector = jnp.linalg.svd(equations(near)[1][:, :-1])[2][-1]

    def missed(unknown: Array) -> Array:
        x, v = unknown[: p + 1], unknown[p + 1 :]
        residual, slope = equations(x)
        return jnp.concatenate([residual, slope[:, :-1] @ v, jnp.array([vector @ v - 1.0])])

    def step(_: Array, unknown: Array) -> Array:
        return unknown - jnp.linalg.solve(jax.jacfwd(missed)(unknown), missed(unknown))

    found = jax.lax.fori_loop(0, _FOLD_STEPS, step, jnp.concatenate([near, vector]))
    left = jnp.max(jnp.abs(missed(found)))
    x = found[: p + 1]
    good = (left <= 1e4 * jnp.finfo(near.dtype).eps) & (x[-1] >= 0) & (x[-1] <= 1)
    return x, wanted & good & (jnp.linalg.norm(x - near) <= 1 + jnp.linalg.norm(near))
