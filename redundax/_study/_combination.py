"""Combinations of parameters that data do not determine, and the words for those of two.

What is predicted stays the same along directions d of the two parameters (a, b), J d = 0, and these tell what it is a
function of, if at every point

    d ~ (1, -1)   of a + b,      d ~ (1, 1)   of a - b,      d ~ (a, -b)   of a b,      d ~ (a, b)   of a / b.

One point does not tell a + b from a b.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

_DIRECTIONS = {"sum": (0, -1.0), "difference": (0, 1.0), "product": (1, -1.0), "quotient": (1, 1.0)}  # power, sign
_NOISE = 1.0  # effect of a standard deviation, in units of the noise, up to which there is none;
_PART = 0.01  # or as a part of the effects of both parameters


@dataclasses.dataclass(frozen=True)
class Combination:
    """Parameters that the data do not determine, changed together.

    - `names`: the parameters.
    - `changes`: how far each changes with hardly any change of what is predicted, in its own unit, at the estimate.
    - `uncertainty`: standard uncertainty of the combination, relative to that before the measurement; above 1.
    - `about`: "sum", "difference", "product" or "quotient" where that of two parameters is all that the data determine,
      by the sensitivities at the estimate and at points all over the ranges of the parameters; else "".
    """

    names: tuple[str, ...]
    changes: np.ndarray
    uncertainty: float
    about: str

    def __str__(self) -> str:
        if len(self.names) == 1:
            return f"{self.names[0]}: hardly any effect on what is measured"
        pairs = ", ".join(f"{name} by {x:+.2g}" for name, x in zip(self.names, self.changes, strict=True))
        rest = f"; the data determine their {self.about} only" if self.about else ""
        return f"{' and '.join(self.names)}: changing {pairs} has hardly any effect{rest}"


class Points(NamedTuple):
    """Values of two parameters at several points (k, 2), and sensitivities there (k, N, 2).

    Sensitivities are in units of the noise, and of the standard deviations of the parameters.
    """

    values: np.ndarray
    slopes: np.ndarray


def word(points: Points, scale: np.ndarray) -> str:
    """What is predicted is a function of this sum, difference, product or quotient of two parameters; else "".

    Parameters have the standard deviations `scale`, shape (2,).
    """
    fit = [name for name, (power, sign) in _DIRECTIONS.items() if _is_idle(points, scale, power, sign)]
    return fit[0] if len(fit) == 1 else ""


def _is_idle(points: Points, scale: np.ndarray, power: int, sign: float) -> bool:
    direction = points.values**power * [1.0, sign] / scale
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    effects = points.slopes * (direction / np.where(length > 0, length, 1.0))[:, None]
    size, left = np.linalg.norm(effects, axis=(1, 2)), np.linalg.norm(effects.sum(axis=2), axis=1)
    return bool(np.all((left <= np.maximum(_NOISE, _PART * size))[np.isfinite(size)]))
