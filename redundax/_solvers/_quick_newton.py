"""Newton's open iteration (38) on few unknowns where friction is proved to contract strongly, whatever the loads.

With V^T V = X^T X and one self-stress n that friction reads, v = n z, the step of `_open_newton` is

    dtau = c + d dz,   B c = e,   B d = J n[rows],   dz = (r^T d - (V c)^T V d) / (1 + |V d|^2).

The bound of `contraction_anywhere` asks for no sample. It makes B = I - J K diagonally dominant, up to scales of its
columns, so that elimination needs no pivots. A joint's friction reads loads of its own: J has few entries. As in
`_quick_sweeps` the unknowns are numbers, not vectors, which a batch lays out in one piece each.
"""

from functools import partial
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._tools._by_number import dot, eliminate, rows
from .._tools._numbers import Numeric
from ._friction_problem import Law
from ._iterate import Progress
from ._open_problem import OpenEnd, OpenProblem
from ._quick_sweeps import STRONG, few, largest

_STEPS = 15  # more than quadratic convergence takes

Slope = dict[int, Array]  # of a friction, by load


class Iterate(NamedTuple):
    """Friction tau and amplitude z of the self-stress."""

    tau: list[Array]
    z: Array


def quick_newton(open_problem: OpenProblem, rtol: Float[Array, ""], max_steps: int) -> OpenEnd:
    """The end, or progress that has not converged where friction does not contract strongly or reads more.

    The step of its progress is a bound of the change of the loads.
    """
    problem, infinite = open_problem.problem, jnp.full((), jnp.inf, rtol.dtype)
    if not few(problem):
        none = jnp.zeros_like(open_problem.balance[0])
        return OpenEnd(jnp.zeros_like(open_problem.pull), none, Progress.begin(rtol.dtype))
    stress, single = _single(open_problem)
    strong = single & (problem.contraction_anywhere() <= STRONG)
    law, rho0, gain, n = problem.law.apart(), list(problem.rho0), rows(problem.gain), list(stress[open_problem.rows])
    norm = rows(jnp.sqrt(jnp.diagonal(open_problem.gram))[:, None] * open_problem.axes.T)
    per_size = list(1 / problem.friction_size)
    columns = rows(problem.gain.T)
    per_z = largest(n, list(1 / problem.load_size))

    def step(residual: list, slope: list[Slope], pull: list | None = None) -> Iterate:
        by_tau = [[_read(row, column) for column in columns] for row in slope]
        lower = [[(i == j) - entry for j, entry in enumerate(row)] for i, row in enumerate(by_tau)]
        c, d = eliminate(lower, residual, [_read(row, n) for row in slope], pivots=False)
        of_d = [dot(row, d) for row in norm]
        against = dot([dot(row, c) for row in norm], of_d)
        dz = (-against if pull is None else dot(pull, d) - against) / (1 + dot(of_d, of_d))
        return Iterate([a + b * dz for a, b in zip(c, d, strict=True)], dz)

    def first() -> Iterate:
        rho = list(open_problem.first)
        force, slope = _linearised(law, rho)
        missing = [free - load for free, load in zip(rho0, rho, strict=True)]
        residual = [f + _read(row, missing) for f, row in zip(force, slope, strict=True)]
        pull = list(open_problem.pull)
        return step(residual, slope, [dot(row, pull) for row in rows(open_problem.axes)])

    def body(carry: tuple) -> tuple:
        steps, (tau, z), _, _ = carry
        rho = [free + dot(row, tau) + a * z for free, row, a in zip(rho0, gain, n, strict=True)]
        force, slope = _linearised(law, rho)
        residual = [f - t for f, t in zip(force, tau, strict=True)]
        by = step(residual, slope)
        change = largest(by.tau, per_size) + per_z * jnp.abs(by.z)
        return steps + 1, jax.tree.map(jnp.add, Iterate(tau, z), by), largest(residual, per_size), change

    def going(carry: tuple) -> Array:
        steps, _, residual, change = carry
        return strong & (steps < min(_STEPS, max_steps)) & ((residual > rtol) | (change > rtol))

    begin = (jnp.zeros((), int), first(), infinite, infinite)
    steps, (tau, z), residual, change = jax.lax.while_loop(going, body, begin)
    return OpenEnd(jnp.stack(tau), stress * z, Progress(steps, residual, change, residual, jnp.zeros((), int)))


def _single(open_problem: OpenProblem) -> tuple[Float[Array, " m"], Bool[Array, ""]]:
    """The self-stress n, and whether friction reads no other: P[:, rows] = n n[rows]^T."""
    stress, rounding = open_problem.stress, 100 * jnp.finfo(open_problem.stress.dtype).eps
    sizes = jnp.diagonal(stress)
    k = jnp.argmax(sizes)
    some = sizes[k] > 0
    columns, size = open_problem.balance @ open_problem.projector, jnp.sqrt(jnp.where(some, sizes[k], 1.0))
    n = jnp.where(some, columns[:, k] / size, 0.0)
    return n, jnp.all(jnp.abs(columns - n[:, None] * n[open_problem.rows]) <= rounding * size)


def _linearised(law: Law, rho: list) -> tuple[list, list[Slope]]:
    """Friction by a law written joint by joint, and its slopes."""
    tau, slope, row = [], [], 0
    for k, group in enumerate(law.groups):
        slips = slice(len(tau), len(tau) + len(group.slips))
        loads = slice(row, row + group.rows.size)
        memory, pushing = cast(tuple, law.memory)[k : k + 1], None if law.pushing is None else law.pushing[loads]
        alone = Law((group,), law.rate[slips], law.sense[slips], law.state, memory, pushing)
        force, own = partial(_force, alone), rho[loads]
        units = [[jnp.full_like(x, u) for x, u in zip(own, unit, strict=True)] for unit in np.eye(len(own))]
        columns = [jax.jvp(force, own, unit)[1] for unit in units]
        tau += force(*own)
        slope += [{row + j: column[i] for j, column in enumerate(columns)} for i in range(len(group.slips))]
        row += len(own)
    return tau, slope


def _force(law: Law, *loads: Array) -> list[Array]:
    return list(law(jnp.stack(loads) if loads else jnp.zeros(0, law.rate.dtype)))


def _read(slope: Slope, loads: list[Array]) -> Numeric:
    return sum(entry * loads[k] for k, entry in slope.items())
