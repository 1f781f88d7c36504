"""What an assembly leaves of rows and given values, and how it is told."""

import warnings
from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Bool, Float

from .._system._system import AbstractSystem
from .._tools._errors import NoSolutionError
from .._tools._module import stop_gradient
from .._tools._numbers import xp
from ._scaling import largest_violation


class Misfit(NamedTuple):
    """What a position or velocity leaves of rows and given values, shape (m + h,).

    - `size`: of each, in its own unit.
    - `relative`: the same relative to the mechanism.
    - `beyond`: which are beyond rounding.
    - `refused`: whether this is not the nearest that can be, or farther than `solve` takes.
    - `weakest`: the least singular value that it relies on, relative to the largest.
    """

    size: Float[Array, " rows"]
    relative: Float[Array, " rows"]
    beyond: Bool[Array, " rows"]
    refused: Bool[Array, ""]
    weakest: Float[Array, ""]


def check_rows(system: AbstractSystem, q: Array, t: Array) -> None:
    """Name the rows that have no value at the guess."""
    values = np.asarray(system.constraint(q, t))
    lost = [name for name, value in zip(system.rows.labels, values, strict=True) if not np.isfinite(value)]
    if lost:
        raise NoSolutionError(
            f"No position is found, as rows have no value at the guess: {', '.join(lost)}. Give another guess; of a "
            "joint whose axes on both bodies are opposite, turn one round."
        )


def tell(what: str, misfit: Misfit, labels: tuple[str, ...], throw: bool | None) -> None:
    """Raise what cannot be met, or warn of what is met by rounding alone or not exactly."""
    failing = sorted(np.flatnonzero(misfit.beyond), key=lambda k: not labels[k].endswith(" as given"))
    if misfit.refused and throw is not False:
        raise NoSolutionError(
            f"No {what} satisfies the constraints near the guess. What cannot be met together: "
            f"{', '.join(labels[k] for k in failing)}. Give a better guess, or change given values or lengths."
        )
    worst, told = int(np.argmax(misfit.relative)), ""
    if failing and not misfit.refused:
        told = (
            f"The constraints cannot be met exactly: the nearest {what} misses {labels[worst]} by "
            f"{misfit.size[worst]:.2g} in its unit, {misfit.relative[worst]:.1g} relative to the mechanism. "
            "Give redundant points and values with all digits, unless they are measured."
        )
    elif misfit.weakest < largest_violation(misfit.relative.dtype) and not misfit.refused:
        told = (
            f"The constraints fix the {what} along one direction so weakly, by a singular value of "
            f"{misfit.weakest:.1g}, that it may be the rounding of points of few digits. Give redundant points with "
            "all digits, or declare the `rank` to `solve`."
        )
    if told:
        warnings.warn(told, stacklevel=3)


def misfit_of(size: Array, relative: Array, settled: Array, weakest: Array, rounding: float) -> Misfit:
    """The misfit of rows by their sizes; `settled` says whether it is the least."""
    beyond = ~(relative <= rounding)
    near = xp.all(relative <= max(rounding, largest_violation(relative.dtype)))
    return stop_gradient(Misfit(size, relative, beyond, xp.any(beyond) & ~(settled & near), weakest))


def tolerance(d: Array) -> float:
    """What rounding leaves of as many coordinates."""
    return 1000 * d.size * float(xp.finfo(d.dtype).eps)
