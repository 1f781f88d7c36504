"""Many frictional joints: the sweep over h of parallel cranks on one coupler, whose 2 N revolutes all have friction."""

import dataclasses
from collections.abc import Callable, Sequence

import jax
import numpy as np
from truth import exact, scenes

import redundax as rx

from . import _truth
from ._measure import Program, Row, compare
from ._works import redundax

_MU_RHO = 0.005
_CHUNK = 1000  # samples at once, the fastest for NumPy
_RCOND = 1e-11


def over_h(cranks: int, size: int) -> list[Row]:
    """The null-space vector h; NumPy and redundax iterate on the friction moments alone."""
    h = np.linspace(-100.0, 100.0, size)
    mechanism = rx.mechanisms.parallelogram(cranks, mu_rho=_MU_RHO)
    state = mechanism.state(np.arctan2(4.0, 3.0), rate=1.0)
    exactly = scenes.parallel_cranks(cranks, _MU_RHO)
    truth = _truth.over_h(exactly)

    def solve(h: jax.Array) -> rx.types.Solution:
        return rx.solve(mechanism, state, closure=rx.MinimumNorm(h))

    def rows(found: Sequence, samples: np.ndarray) -> np.ndarray:
        return np.concatenate([np.asarray(part)[samples] for part in found], axis=1)

    programs = [
        Program("NumPy, reduced, in chunks", _numpy(exactly, h), h, truth, rows),
        dataclasses.replace(redundax("redundax, all", solve, h, truth), rows=rows),
    ]
    n, m = 3 * cranks + 3, 4 * cranks
    ends = {"linear": 2 * cranks + 2, "angular": n, "force": n + m, "friction": n + m + 2 * cranks}
    starts = [0, *ends.values()]
    kinds = {name: slice(start, end) for start, (name, end) in zip(starts, ends.items(), strict=False)}
    return compare(f"{2 * cranks} joints, {size:,}", programs, kinds=kinds)


def _numpy(exactly: exact.Mechanism, h: np.ndarray) -> Callable[[], tuple]:
    """Fixed point (27) with the loads alone in the loop, after the pseudoinverse of A."""
    mass, jacobian, load, gamma, directions = (
        exact.floats(part)
        for part in (exactly.mass_matrix, exactly.jacobian, exactly.load, exactly.gamma, exactly.distribution)
    )
    n, m = len(mass), len(jacobian)
    matrix = np.block([[mass, jacobian.T], [jacobian, np.zeros((m, m))]])
    inverse = np.linalg.pinv(matrix, rcond=_RCOND)
    base = (inverse @ np.concatenate([load, gamma]).ravel())[:, None]
    shift = (np.eye(n + m) - inverse @ matrix).sum(axis=1)[:, None]
    spread = inverse[:, :n] @ directions
    gain = -_MU_RHO * np.array(exactly.senses, float)[:, None]

    def chunk(h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        free = base[n:] + shift[n:] * h
        rho, tau = free, np.zeros((len(gain), h.size))
        for _ in range(1000):
            new = gain * np.sqrt(rho[0::2] ** 2 + rho[1::2] ** 2)
            rho = free + spread[n:] @ new
            if np.max(np.abs(new - tau)) < 1e-12:
                break
            tau = new
        return base + shift * h + spread @ new, new

    def run() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        out = tuple(np.empty((h.size, size)) for size in (n, m, len(gain)))
        for start in range(0, h.size, _CHUNK):
            part = slice(start, start + _CHUNK)
            x, tau = chunk(h[part])
            for place, value in zip(out, (x[:n], x[n:], tau), strict=True):
                place[part] = value.T
        return out

    return run
