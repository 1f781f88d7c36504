"""Factors of NumPy's matrices and of batches of them as JAX gives them: NaN, or infinity, where there are none."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import numpy as np


def or_nan(factor: Callable[..., Any]) -> Callable[..., Any]:
    """A decomposition that is NaN of a matrix that has none, and goes on with the others of a batch."""

    @functools.wraps(factor)
    def run(a: np.ndarray, *more: Any, **named: Any) -> Any:
        try:
            return factor(a, *more, **named)
        except np.linalg.LinAlgError:
            if a.ndim > 2:
                return jax.tree.map(lambda *x: np.stack(x), *[run(one, *more, **named) for one in a])
        shapes = factor(np.eye(*a.shape, dtype=a.dtype), *more, **named)
        return jax.tree.map(lambda x: np.full_like(x, np.nan), shapes)

    return run


cholesky, eigh, svd = (or_nan(factor) for factor in (np.linalg.cholesky, np.linalg.eigh, np.linalg.svd))


def solve(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a^-1 b, infinite where there is no factor."""
    try:
        return np.linalg.solve(a, b)
    except np.linalg.LinAlgError:
        if a.ndim == 2:
            return np.full_like(b, np.inf)
    batch = np.broadcast_shapes(a.shape[:-2], b.shape[:-2])
    many, rights = (np.broadcast_to(x, batch + x.shape[-2:]) for x in (a, b))
    out = np.empty(rights.shape, b.dtype)
    for place in np.ndindex(batch):
        out[place] = solve(many[place], rights[place])
    return out


def upper_solve(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a^-1 b of an upper triangle."""
    if np.diagonal(a, 0, -2, -1).all() and np.isfinite(a).all() and np.isfinite(b).all():
        return np.linalg.solve(a, b)  # it is its own factor
    x = np.empty_like(b)
    for k in reversed(range(a.shape[-1])):
        known = a[..., k : k + 1, k + 1 :] @ x[..., k + 1 :, :]
        x[..., k, :] = (b[..., k, :] - known[..., 0, :]) / a[..., k, k, None]
    return x


def lu(a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Both triangles in one, pivots and the order of rows, with the largest entry of a column as pivot. NumPy gives
    none of them, and SciPy is imported for longer."""
    *batch, m, n = a.shape
    out = np.array(a, order="C").reshape(-1, m, n)
    count, each = min(m, n), np.arange(len(out))
    pivots, order = np.empty((len(out), count), np.int32), np.tile(np.arange(m, dtype=np.int32), (len(out), 1))
    for k in range(count):
        pivots[:, k] = pivot = k + np.argmax(np.abs(out[:, k:, k]), axis=1)
        for x in (out, order):
            x[each, k], x[each, pivot] = x[each, pivot], x[each, k]
        first = out[:, k, k, None]
        out[:, k + 1 :, k] /= np.where(first != 0, first, 1)
        out[:, k + 1 :, k + 1 :] -= out[:, k + 1 :, k, None] * out[:, k, None, k + 1 :]
    return out.reshape(a.shape), pivots.reshape(*batch, count), order.reshape(*batch, m)
