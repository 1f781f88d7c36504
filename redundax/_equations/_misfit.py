"""What an assembly leaves of rows and given values, and how it is told."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Bool, Float

from .._tools._numbers import stop_gradient, xp
from .._tools._words import warn
from ._scaling import largest_violation


class Misfit(NamedTuple):
    """What a position or velocity leaves of rows and given values, shape (m + h,).

    - `size`: of each, in its own unit.
    - `scale`: the size of each that is as large as the mechanism.
    - `beyond`: which are beyond rounding.
    - `refused`: whether this is not the nearest that can be, or farther than `solve` takes.
    - `weakest`: the least singular value that it relies on, relative to the largest.
    """

    size: Float[Array, " rows"]
    scale: Float[Array, " rows"]
    beyond: Bool[Array, " rows"]
    refused: Bool[Array, ""]
    weakest: Float[Array, ""]

    @property
    def relative(self) -> Float[Array | np.ndarray, " rows"]:
        """Sizes relative to the mechanism."""
        return self.size / self.scale


def tell(what: str, misfit: Misfit, labels: tuple[str, ...]) -> None:
    """Warn of what is met by rounding alone or not exactly."""
    worst, told = int(np.argmax(misfit.relative)), ""
    if misfit.refused:
        return
    if misfit.beyond.any():
        told = (
            f"The constraints cannot be met exactly: the nearest {what} misses {labels[worst]} by "
            f"{misfit.size[worst]:.2g} in its unit, {misfit.relative[worst]:.1g} relative to the mechanism. "
            "Give redundant points and values with all digits, unless they are measured."
        )
    elif misfit.weakest < largest_violation(misfit.relative.dtype):
        told = (
            f"The constraints fix the {what} along one direction so weakly, by a singular value of "
            f"{misfit.weakest:.1g}, that it may be the rounding of points of few digits. Give redundant points with "
            "all digits, or declare the `rank` to `solve`."
        )
    if told:
        warn(told)


def misfit_of(size: Array, scale: Array, settled: Array, weakest: Array, rounding: float) -> Misfit:
    """The misfit of rows by their sizes; `settled` says whether it is the least."""
    relative = size / scale
    beyond = ~(relative <= rounding)
    near = xp.all(relative <= max(rounding, largest_violation(relative.dtype)))
    return stop_gradient(Misfit(size, scale, beyond, xp.any(beyond) & ~(settled & near), weakest))


def tolerance(d: Array) -> float:
    """What rounding leaves of as many coordinates."""
    return 1000 * d.size * float(xp.finfo(d.dtype).eps)
