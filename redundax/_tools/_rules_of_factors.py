"""What NumPy does for factors of matrices: one by one where a batch has some without."""

import contextlib
from collections.abc import Callable

import numpy as np

from ._rule import Computed, Entries, NoRuleError, Parameters, Shapes


def or_nan(factor: Computed) -> Callable[..., Computed]:
    """A factor of a matrix; NaN where there is none, as JAX gives it."""

    def rule(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
        find, none = factor(parameters), [np.full(x.shape, np.nan, x.dtype) for x in to]
        if parameters.get("subset_by_index") is not None:
            raise NoRuleError

        def found(a: Entries) -> Entries:
            try:
                return find(a)
            except np.linalg.LinAlgError:
                if a.ndim == 2:
                    return none[0] if len(none) == 1 else none
            out = [x.copy() for x in none]
            for place in np.ndindex(a.shape[:-2]):
                with contextlib.suppress(np.linalg.LinAlgError):
                    one = find(a[place])
                    for x, y in zip(out, [one] if len(out) == 1 else one, strict=True):
                        x[place] = y
            return out[0] if len(out) == 1 else out

        return found

    return rule


def cholesky(parameters: Parameters) -> Computed:
    """The lower factor."""
    return np.linalg.cholesky


def eigh(parameters: Parameters) -> Computed:
    """Eigenvectors and eigenvalues of one half."""
    half = "L" if parameters["lower"] else "U"

    def find(a: Entries) -> Entries:
        values, vectors = np.linalg.eigh(a, half)
        return vectors, values

    return find


def svd(parameters: Parameters) -> Computed:
    """Singular values, and vectors if asked for."""
    if not parameters["compute_uv"]:
        return lambda a: np.linalg.svd(a, compute_uv=False)

    def find(a: Entries) -> Entries:
        left, values, right = np.linalg.svd(a, full_matrices=parameters["full_matrices"])
        return values, left, right

    return find


def qr(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    """An orthonormal basis of the columns, and an upper triangle."""
    if parameters["pivoting"]:
        raise NoRuleError
    mode = "complete" if parameters["full_matrices"] else "reduced"
    return lambda a: np.linalg.qr(a, mode)


_PIVOTS = 100  # rows that are eliminated one by one


def lu_factors(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    """With the largest entry of a column as pivot; NumPy gives no factors, and SciPy is imported for longer."""
    if max(of[0].shape[-2:]) > _PIVOTS:
        raise NoRuleError
    shapes, count = [x.shape for x in to], min(of[0].shape[-2:])

    def lu(a: Entries) -> Entries:
        a = np.array(a).reshape(-1, *a.shape[-2:])
        every, pivots = np.arange(len(a)), np.empty((len(a), count), np.int32)
        for k in range(count):
            pivots[:, k] = pivot = k + np.argmax(np.abs(a[:, k:, k]), axis=1)
            a[every, k], a[every, pivot] = a[every, pivot], a[every, k].copy()
            own = a[:, k, k, None]
            a[:, k + 1 :, k] /= np.where(own == 0, 1, own)
            a[:, k + 1 :, k + 1 :] -= a[:, k + 1 :, k, None] * a[:, None, k, k + 1 :]
        found = a, pivots, _order(pivots, a.shape[1])
        return tuple(x.reshape(shape) for x, shape in zip(found, shapes, strict=True))

    return lu


def lu_permutation(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    """The order of rows that pivots make."""
    size, shape = parameters["permutation_size"], to[0].shape
    return lambda pivots: _order(pivots.reshape(-1, pivots.shape[-1]), size).reshape(shape)


def _order(pivots: np.ndarray, size: int) -> np.ndarray:
    every, order = np.arange(len(pivots)), np.tile(np.arange(size, dtype=np.int32), (len(pivots), 1))
    for k, pivot in enumerate(pivots.T):
        order[every, k], order[every, pivot] = order[every, pivot], order[every, k].copy()
    return order


def triangular_solve(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    """The solution by one triangle, from either side."""
    left, turned, unit = (parameters[name] for name in ("left_side", "transpose_a", "unit_diagonal"))
    upper = parameters["lower"] == (turned == left)

    def solve(a: Entries, b: Entries) -> np.ndarray:
        if turned == left:
            a = a.T
        b = b if left else b.T
        a, b = (a, b) if upper else (a[::-1, ::-1], b[::-1])
        a = np.triu(a)
        if unit:
            np.fill_diagonal(a, 1)
        if np.diagonal(a).all() and np.isfinite(a).all() and np.isfinite(b).all():
            x = np.linalg.solve(a, b)  # an upper triangle is its own factor
        else:
            x = np.empty_like(b)
            for k in reversed(range(len(a))):
                x[k] = (b[k] - a[k, k + 1 :] @ x[k + 1 :]) / a[k, k]
        x = x if upper else x[::-1]
        return x if left else x.T

    def each(a: Entries, b: Entries) -> np.ndarray:
        x = np.empty_like(b)
        for place in np.ndindex(b.shape[:-2]):
            x[place] = solve(a[place], b[place])
        return x

    return solve if of[0].ndim == 2 else each
