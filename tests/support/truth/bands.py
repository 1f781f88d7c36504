"""Extremes of an output along the self-stress, at 50 digits.

y(z) is that of the solution of (25) with lam = lam_MP + z s, which is the misfit z s under unit compliance. Its
smallest and largest values lie at the ends of the range or where a golden-section search around the best of a coarse
grid ends; with `tolerance` delta in z the values are right to order delta^2.
"""

from collections.abc import Callable

import numpy as np

from . import exact
from .exact import exactly


@exactly
def output(mechanism: exact.Mechanism, stress, z, place: int) -> float:
    """Acceleration number `place` at the amplitude z."""
    z = exact.exact(z)
    misfit = tuple(z * entry for entry in exact.exact(stress))
    return float(exact.solve(mechanism, misfit=misfit).acceleration[place])


def extremes(mechanism: exact.Mechanism, stress, least: float, largest: float, place: int) -> list[tuple[float, float]]:
    """(z, y) of the smallest and of the largest value."""
    grid = np.linspace(least, largest, 17)
    values = np.array([output(mechanism, stress, float(z), place) for z in grid])
    out = []
    for sign in (1.0, -1.0):
        best = int(np.argmin(sign * values))
        bracket = grid[max(best - 1, 0)], grid[min(best + 1, grid.size - 1)]
        z = golden(lambda z, sign=sign: sign * output(mechanism, stress, z, place), *bracket)
        ends = [(y, x) for x, y in ((grid[best], values[best]), (z, output(mechanism, stress, z, place)))]
        y, z = min(ends, key=lambda end: sign * end[0])
        out.append((float(z), float(y)))
    return out


def golden(function: Callable[[float], float], a: float, b: float, tolerance: float = 1e-5) -> float:
    """Minimum of a function with one minimum between a and b."""
    ratio = (5**0.5 - 1) / 2
    c, d = b - ratio * (b - a), a + ratio * (b - a)
    at_c, at_d = function(c), function(d)
    while b - a > tolerance:
        if at_c < at_d:
            b, d, at_d = d, c, at_c
            c = b - ratio * (b - a)
            at_c = function(c)
        else:
            a, c, at_c = c, d, at_d
            d = a + ratio * (b - a)
            at_d = function(d)
    return (a + b) / 2
