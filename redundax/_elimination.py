"""Linear equations in few unknowns, written on numbers, which a batch lays out in one piece each.

A batch of LAPACK calls pays for every small matrix by itself.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

_FEW = 6  # unknowns, at most


def solve_few(matrix: Float[Array, "p p"], right: Float[Array, " p"]) -> Float[Array, " p"]:
    """The solution of matrix x = right, by elimination with partial pivoting; of many unknowns by LAPACK."""
    if not 0 < right.size <= _FEW:
        return jnp.linalg.solve(matrix, right)
    return jnp.stack(eliminated([list(row) for row in matrix], list(right), pivots=True)[0])


def eliminated(matrix: list[list[Array]], *rights: list[Array], pivots: bool) -> list[list[Array]]:
    """Solutions of matrix x = right, each a list of numbers; without pivots for a matrix of dominant diagonal."""
    p = len(matrix)
    table = [[*row, *entries] for row, *entries in zip(matrix, *rights, strict=True)]
    for k in range(p):
        for i in range(k + 1, p) if pivots else ():
            larger = jnp.abs(table[i][k]) > jnp.abs(table[k][k])
            both = [(jnp.where(larger, b, a), jnp.where(larger, a, b)) for a, b in zip(table[k], table[i], strict=True)]
            table[k], table[i] = map(list, zip(*both, strict=True))
        for i in range(k + 1, p):
            ratio = table[i][k] / table[k][k]
            table[i] = [a - ratio * b for a, b in zip(table[i], table[k], strict=True)]
    solutions = []
    for right in range(p, p + len(rights)):
        x: list[Array] = []
        for k in reversed(range(p)):
            known = sum(a * b for a, b in zip(table[k][k + 1 : p], x, strict=True))
            x.insert(0, (table[k][right] - known) / table[k][k])
        solutions.append(x)
    return solutions
