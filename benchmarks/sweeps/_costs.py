"""What a sweep costs besides: one call, compilation, the start of Python, small batches, float32, derivatives."""

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator

import jax
import jax.numpy as jnp
import numpy as np
from truth import paper

import redundax as rx

from .._devices import batched, placed
from .._programs import Programs, of_call, of_function
from . import _truth
from ._measure import MU_RHO, PHI, RATE, Program, Row, compare, whole
from ._works import FULL, lines, redundax_over_h


def single(frictional: bool) -> list[Row]:
    """One call at h = 0, compiled."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=MU_RHO if frictional else None)
    state = mechanism.state(PHI, rate=RATE)
    p = paper.Parameters()
    q, qd = paper.configuration(p, PHI, RATE)

    @jax.jit
    def solve(mechanism: rx.Mechanism, state: rx.State) -> list[jax.Array]:
        solution = rx.solve(mechanism, state)
        return [getattr(solution, name) for name in FULL]

    value, batch = np.array([0.1]), np.index_exp[None]  # the length
    truth = _truth.length if frictional else _truth.length_without_friction
    programs = [
        Program(
            "NumPy, (27)" if frictional else "NumPy, (9)",
            lambda: paper.fixed_point(p, q, qd)[-1] if frictional else paper.solve(p, q, qd),
            value,
            truth,
            lambda found, samples: lines(found[batch], samples),
        ),
        Program(
            "redundax, all",
            lambda: solve(mechanism, state),
            value,
            truth,
            lambda found, samples: whole(*(part[batch] for part in found)),
        ),
    ]
    return compare(f"one call{', friction' * frictional}", programs, repeats=301)


def sizes(largest: int) -> list[Row]:
    """The sweep over h in batches from 1 on."""
    out = []
    for size in (10**k for k in range(7) if 10**k <= largest and 10**k % jax.device_count() == 0):
        h = np.linspace(-100.0, 100.0, size)
        out += compare("h, batch size", redundax_over_h(h)[:1])
    return out


def single_precision(size: int) -> list[Row]:
    """The sweep over h in float32."""
    with _float32():
        return compare(f"h, float32, {size:,}", redundax_over_h(np.linspace(-100.0, 100.0, size)))


@contextlib.contextmanager
def _float32() -> Iterator[None]:
    jax.config.update("jax_enable_x64", False)
    try:
        yield
    finally:
        jax.config.update("jax_enable_x64", True)


def derivatives(size: int) -> list[Row]:
    """Accelerations in a batch, and their derivatives forward and, of one of them, reverse."""
    return [
        *_derivative("h", _with_h, np.linspace(-100.0, 100.0, size)),
        *_derivative("mu_rho", _with_mu_rho, np.linspace(0.01, 0.03, size)),
        *_derivative("length", _with_length, np.linspace(0.05, 0.2, size // 10)),
    ]


def _with_h(h: jax.Array) -> jax.Array:
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=MU_RHO)
    state = mechanism.state(PHI, rate=RATE)
    return rx.solve(mechanism, state, closure=rx.MinimumNorm(h)).acceleration


def _with_mu_rho(mu_rho: jax.Array) -> jax.Array:
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    return rx.solve(mechanism, mechanism.state(PHI, rate=RATE)).acceleration


def _with_length(length: jax.Array) -> jax.Array:
    mechanism = rx.mechanisms.wojtyra2020(length=length, mu_rho=MU_RHO)
    return rx.solve(mechanism, mechanism.state(PHI, rate=RATE)).acceleration


def _derivative(name: str, function: Callable, values: np.ndarray) -> list[Row]:
    crank = 8  # coordinate phi of the first body
    given = placed(values)

    def program(title: str, one: Callable, truth: Callable, rows: Callable) -> Program:
        run = batched(one)
        return Program(title, lambda: run(given), values, truth, rows)

    def all_rows(found: jax.Array, samples: np.ndarray) -> np.ndarray:
        return whole(np.asarray(found)[samples])

    def crank_rows(found: jax.Array, samples: np.ndarray) -> np.ndarray:
        out = np.full((len(samples), 28), np.nan)
        out[:, crank] = np.asarray(found)[samples]
        return out

    truth, slope = getattr(_truth, name), _truth.slope(name)
    programs = [
        program("accelerations", function, truth, all_rows),
        program("forward", jax.jacfwd(function), slope, all_rows),
        program("reverse, one of them", jax.grad(lambda x: function(x)[crank]), slope, crank_rows),
    ]
    return compare(f"derivatives, {name}, {len(values):,}", programs, repeats=3)


def compilation() -> dict[str, Programs]:
    """Programs of calls outside transformations, of one call inside, and of batches, compiled without a cache."""
    mechanism, rigid = rx.mechanisms.wojtyra2020(mu_rho=MU_RHO), rx.mechanisms.wojtyra2020()
    state, without = mechanism.state(PHI, rate=RATE), rigid.state(PHI, rate=RATE)
    factor = rx.factorize(mechanism, state)

    def one(h: jax.Array) -> rx.types.Solution:
        return rx.solve(mechanism, state, closure=rx.MinimumNorm(h))

    def open_end(x0: jax.Array) -> rx.types.Solution:
        return rx.solve(mechanism, state, closure=None, x0=x0)

    many = jnp.zeros(100_000)
    return {
        "factorize": of_call(lambda: rx.factorize(mechanism, state)),
        "solve": of_call(lambda: rx.solve(rigid, without)),
        "solve, friction": of_call(lambda: rx.solve(mechanism, state)),
        "the same, factorised": of_call(lambda: rx.solve(mechanism, state, factor=factor)),
        "analyze, friction": of_call(lambda: rx.analyze(mechanism, state).rank),
        "in jit: solve": of_function(lambda state: rx.solve(rigid, state), without),
        "in jit: solve, friction": of_function(lambda state: rx.solve(mechanism, state), state),
        "batch: h, 100,000": of_function(jax.vmap(one), many),
        "batch: x0, 100,000": of_function(jax.vmap(open_end), many),
        "batch: lengths, 100,000": of_function(jax.vmap(_with_length), many),
    }


_FIRST_ANSWER = """
import jax
jax.config.update("jax_enable_x64", True)
import redundax as rx
mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
rx.solve(mechanism, mechanism.state(0.785, rate=1.0)).acceleration.block_until_ready()
"""


def cold_start() -> list[Row]:
    """Seconds from the start of Python to the first answer, with an empty compilation cache and with a full one."""
    with tempfile.TemporaryDirectory() as folder:
        given = {"JAX_COMPILATION_CACHE_DIR": folder, "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
        out = []
        for name in ("import to first answer", "the same, cache filled"):
            start = time.perf_counter()
            subprocess.run([sys.executable, "-c", _FIRST_ANSWER], check=True, env={**os.environ, **given})
            out.append(Row("cold start", name, 1, time.perf_counter() - start, np.nan))
    return out
