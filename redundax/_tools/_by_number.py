"""Small vectors and matrices number by number: a batch lays each number out in one piece, and XLA fuses what is done.

A batch of LAPACK calls or of reductions pays for every small matrix by itself.
"""

import functools
from collections.abc import Callable, Sequence

from jaxtyping import Array, Float

from ._numbers import Numeric, is_number, xp

FEW = 6  # unknowns, at most
_ENTRIES = 12  # of a vector, or along an axis, that are reduced, at most


def rows(matrix: Array) -> list[list[Array]]:
    """A matrix as numbers."""
    return [list(row) for row in matrix]


def dot(a: Sequence[Numeric], b: Sequence[Numeric]) -> Numeric:
    """Product of two vectors of numbers."""
    return sum(x * y for x, y in zip(a, b, strict=True))


def combine(pair: Callable[[Array, Array], Array], whole: Callable[[Array], Array], vector: Array) -> Array:
    """The entries combined pair by pair, of many and of known numbers by `whole`."""
    return functools.reduce(pair, vector) if 0 < vector.size <= _ENTRIES and not is_number(vector) else whole(vector)


def sum_few(array: Array, axis: int = -1) -> Array:
    """The sum along a short axis as one of whole arrays; XLA's own loops over the axis for every entry of the sum."""
    if not 0 < array.shape[axis] <= _ENTRIES:
        return xp.sum(array, axis)
    return functools.reduce(xp.add, xp.unstack(array, axis=axis))


def solve_few(matrix: Float[Array, "p p"], right: Float[Array, " p"]) -> Float[Array, " p"]:
    """The solution of matrix x = right, by elimination with partial pivoting; of many unknowns by LAPACK."""
    if not 0 < right.size <= FEW:
        return xp.linalg.solve(matrix, right)
    return xp.stack(eliminate(rows(matrix), list(right), pivots=True)[0])


def eliminate(matrix: list[list[Array]], *rights: list[Array], pivots: bool) -> list[list[Array]]:
    """Solutions of matrix x = right, each a list of numbers; without pivots for a matrix of dominant diagonal."""
    p = len(matrix)
    table = [[*row, *entries] for row, *entries in zip(matrix, *rights, strict=True)]
    for k in range(p):
        for i in range(k + 1, p) if pivots else ():
            larger = xp.abs(table[i][k]) > xp.abs(table[k][k])
            both = [(xp.where(larger, b, a), xp.where(larger, a, b)) for a, b in zip(table[k], table[i], strict=True)]
            table[k], table[i] = map(list, zip(*both, strict=True))
        for i in range(k + 1, p):
            ratio = table[i][k] / table[k][k]
            table[i] = [a - ratio * b for a, b in zip(table[i], table[k], strict=True)]
    solutions = []
    for right in range(p, p + len(rights)):
        x: list[Array] = []
        for k in reversed(range(p)):
            x.insert(0, (table[k][right] - dot(table[k][k + 1 : p], x)) / table[k][k])
        solutions.append(x)
    return solutions
