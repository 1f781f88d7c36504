"""The sweeps: over h, over x0, over the length unit u, over lengths; each with its peers and its truth."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from truth import paper

import redundax as rx

from .._devices import batched, placed
from . import _eigen, _naive, _numpy, _truth
from ._measure import MU_RHO, PHI, RATE, Program, Row, compare, whole

FULL = ("acceleration", "multipliers", "friction")
_RCOND = 1e-11  # between the two smallest singular values of A of the sweeps below


def redundax(name: str, solve: Callable, values: np.ndarray, truth: Callable, names: tuple[str, ...] = FULL) -> Program:
    """`solve` of each value under `jax.vmap` inside `jax.jit`, with some of its arrays as output."""
    given = placed(values)

    @batched
    def run(value: jax.Array) -> list[jax.Array]:
        solution = solve(value)  # once: XLA does not merge loops
        return [getattr(solution, name) for name in names]

    def rows(found: list, samples: np.ndarray) -> np.ndarray:
        return whole(**{name: part[samples] for name, part in zip(names, found, strict=True)})

    return Program(name, lambda: run(given), values, truth, rows)


def columns(found: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Samples of a result (24, batch)."""
    return lines(found.T, samples)


def lines(found: Any, samples: np.ndarray) -> np.ndarray:
    """Samples of a result (batch, 24)."""
    return whole(np.asarray(found)[samples, :12], np.asarray(found)[samples, 12:])


def over_h(size: int) -> list[Row]:
    """The null-space vector h, friction with mu_rho = 0.02 m."""
    h = np.linspace(-100.0, 100.0, size)
    few, values, naive = h[:: max(size // 20, 1)], jnp.asarray(h), _naive.sweep()
    programs = [
        Program("NumPy, loop of (27)", lambda: _numpy.looped(few), few, _truth.h, lines),
        Program("NumPy, vectorised", lambda: _numpy.vectorised(h), h, _truth.h, columns),
        Program("NumPy, reduced", lambda: _numpy.reduced(h), h, _truth.h, columns),
        Program("JAX, naive", lambda: naive(values), h, _truth.h, lines),
    ]
    for name, full, threads in [(n, f, t) for n, f in (("full", True), ("reduced", False)) for t in (1, 2)]:
        if not _eigen.missing():
            run = _eigen.sweep(h, threads, full)
            programs.append(
                Program(f"C++/Eigen, {name}, {threads} thread{'s' * (threads - 1)}", run, h, _truth.h, lines)
            )
    return compare(f"h, {size:,}", [*programs, *redundax_over_h(h)])


def redundax_over_h(h: np.ndarray) -> list[Program]:
    """All arrays or one of them by the default solver, and all by the fixed point."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=MU_RHO)
    state = mechanism.state(PHI, rate=RATE)

    def solve(solver: rx.AbstractSolver | None = None) -> Callable:
        return lambda h: rx.solve(mechanism, state, closure=rx.MinimumNorm(h), solver=solver)

    return [
        redundax("redundax, all", solve(), h, _truth.h),
        redundax("redundax, accelerations", solve(), h, _truth.h, ("acceleration",)),
        redundax("redundax, friction", solve(), h, _truth.h, ("friction",)),
        redundax("redundax, fixed point, all", solve(rx.FixedPoint()), h, _truth.h),
    ]


def over_x0(size: int) -> list[Row]:
    """Newton (38) from x0 times ones."""
    x0 = np.linspace(1.0, 100.0, size)
    few = x0[:: max(size // 200, 1)]
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=MU_RHO)
    state = mechanism.state(PHI, rate=RATE)
    ones = np.ones(24)
    programs = [
        Program("NumPy, batched pinv", lambda: _numpy.open_newton(few[:, None] * ones), few, _truth.x0, lines),
        redundax("redundax, all", lambda x0: rx.solve(mechanism, state, closure=None, x0=x0), x0, _truth.x0),
    ]
    return compare(f"x0, {size:,}", programs, repeats=15)


def over_u(size: int) -> list[Row]:
    """The length unit, no friction: all numbers of the mechanism change."""
    u = np.geomspace(0.1, 10.0, size)

    def solve(u: jax.Array) -> rx.types.Solution:
        mechanism = rx.mechanisms.wojtyra2020(u=u)
        return rx.solve(mechanism, mechanism.state(PHI, rate=RATE))

    def parameters(u: float) -> paper.Parameters:
        return paper.Parameters(u=u)

    return _over_matrices(f"u, {size:,}", u, parameters, solve, _truth.u, _numpy.frictionless)


def over_length(size: int, frictional: bool) -> list[Row]:
    """The length l, and the state with it."""
    lengths = np.linspace(0.05, 0.2, size)

    def solve(length: jax.Array) -> rx.types.Solution:
        mechanism = rx.mechanisms.wojtyra2020(length=length, mu_rho=MU_RHO if frictional else None)
        return rx.solve(mechanism, mechanism.state(PHI, rate=RATE))

    def parameters(length: float) -> paper.Parameters:
        return paper.Parameters(l=length)

    truth = _truth.length if frictional else _truth.length_without_friction
    work = f"lengths, {'friction, ' * frictional}{size:,}"
    peer = _numpy.fixed_point if frictional else _numpy.frictionless
    return _over_matrices(work, lengths, parameters, solve, truth, peer)


def _over_matrices(
    work: str,
    values: np.ndarray,
    parameters: Callable[[float], paper.Parameters],
    solve: Callable,
    truth: Callable,
    peer: Callable,
) -> list[Row]:
    """A new matrix A for every value; NumPy is given A and b, redundax makes them."""
    few = values[:: max(len(values) // 2000, 1)]
    matrices, rights = _numpy.equations([parameters(float(value)) for value in few])
    programs = [
        Program("NumPy, batched pinv of A", lambda: peer(matrices, rights, _RCOND), few, truth, lines),
        redundax("redundax, all", solve, values, truth),
        redundax("redundax, accelerations", solve, values, truth, ("acceleration",)),
    ]
    return compare(work, programs, repeats=3)
