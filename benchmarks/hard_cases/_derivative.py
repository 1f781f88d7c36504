"""Derivatives of accelerations, multipliers and friction by every parameter, times the size of the parameter.

The rank is the same along every parameter, so they exist; the truth is a central difference at 50 digits.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from mpmath import mp
from truth import exact
from truth.exact import exactly
from truth.scenes import Parameters

import redundax as rx

from ._library import Outcome, result_name

STEP = mp.mpf(10) ** -17


@dataclass(frozen=True, eq=False)
class Path:
    """Parameters that derivatives are taken by, with the exact and the library's mechanism of them."""

    parameters: Parameters
    exact: Callable
    library: Callable

    @property
    def count(self) -> int:
        """Number of parameters."""
        return len(flat(self.parameters))


def flat(x) -> list:
    """The numbers of a nested tuple or dictionary."""
    if isinstance(x, Mapping):
        x = tuple(x.values())
    return [number for item in x for number in flat(item)] if isinstance(x, tuple) else [x]


def shaped(numbers, like):
    """The reverse of `flat`, `numbers` an iterator."""
    if isinstance(like, Mapping):
        return {name: shaped(numbers, value) for name, value in like.items()}
    return tuple(shaped(numbers, item) for item in like) if isinstance(like, tuple) else next(numbers)


@exactly
def sizes(numbers) -> list:
    """|x|, or 1 for zeros."""
    return [abs(x) if x else mp.mpf(1) for x in numbers]


@exactly
def exact_derivative(path: Path, parameters: Parameters, friction: bool) -> dict:
    """Derivatives of each part, entry after entry for one parameter after the other."""
    numbers = flat(parameters)
    columns: dict = {"acceleration": [], "multipliers": [], "friction": []}
    for place, size in enumerate(sizes(numbers)):
        ends = []
        for sign in (1, -1):
            moved = [x + sign * STEP * size if k == place else x for k, x in enumerate(numbers)]
            ends.append(path.exact(shaped(iter(moved), parameters)).solve(friction=friction))
        for part, column in columns.items():
            values = [getattr(end, part) for end in ends]
            if part != "friction" or friction:
                column += [(a - b) / (2 * STEP) for a, b in zip(*values, strict=True)]
    return columns


@functools.cache
def _program(library: Callable, transform: Callable, shapes: tuple) -> Callable:
    """The derivative by a vector of numbers that become parameters of these shapes."""

    def solve(x):
        parameters, begin = {}, 0
        for name, shape in shapes:
            end = begin + int(np.prod(shape, dtype=int))
            parameters[name], begin = jnp.reshape(x[begin:end], shape), end
        solution = rx.solve(*library(parameters), throw=False)
        return (solution.acceleration, solution.multipliers, solution.friction), solution

    return jax.jit(transform(solve, has_aux=True))


def library_derivative(path: Path, transform: Callable) -> tuple[dict, rx.types.Solution]:
    """The same by `jax.jacfwd` or `jax.jacrev`."""
    numbers = jnp.asarray([float(x) for x in flat(path.parameters)])
    shapes = tuple((name, np.shape(exact.floats(value))) for name, value in path.parameters.items())
    parts, solution = _program(path.library, transform, shapes)(numbers)
    size = np.array([float(x) for x in sizes(flat(path.parameters))])
    values = {
        part: (np.asarray(value, np.float64) * size).T.ravel()
        for part, value in zip(("acceleration", "multipliers", "friction"), parts, strict=True)
    }
    return values, solution


def differentiated(transform: Callable) -> Callable:
    """A route through `solve` and a derivative."""

    def run(case, system, state) -> Outcome:
        values, solution = library_derivative(case.path, transform)
        spectrum = solution.stats.spectrum
        return Outcome(values, int(spectrum.rank), result_name(solution.result), np.nan, float(spectrum.gap))

    return run
