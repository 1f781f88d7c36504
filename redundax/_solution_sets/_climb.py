"""A climb to extremes over a box by random steps, of a size that grows with success and shrinks without.

Laws of friction have corners, such as |N_1| + |N_2| of a guide at N_1 = 0, and extremes lie there, where derivatives
say nothing.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from ._cases import AbstractCases

_ROUNDS = 60
_LAST = 1e-10  # size of a step, relative to the box, from which on what is found moves by rounding
_GROWN, _SHRUNK = 1.5, 0.6
_NEWS = 1e-9  # relative gain that is no rounding, nor worth larger steps


def climb(
    look: Callable[[Float[np.ndarray, "k tries q"]], tuple[Float[np.ndarray, "k q"], Float[np.ndarray, " k"]]],
    place: Float[np.ndarray, "k q"],
    value: Float[np.ndarray, " k"],
    cases: AbstractCases,
    first: float,
    tries: int,
    random: np.random.Generator,
) -> None:
    """Steps from k places, each to a value that is larger; `look` tries cases and gives the best places so far.

    **Arguments:**

    - `first`: size of the first steps, relative to the box.
    """
    radius, span = np.full(len(place), first), cases.upper - cases.lower
    for _ in range(_ROUNDS):
        step = (radius[:, None, None] * span) * random.standard_normal((len(place), tries, span.size))
        place, best = look(np.clip(place[:, None] + step, cases.lower, cases.upper))
        radius, value = radius * np.where(best > value + _NEWS * np.abs(value), _GROWN, _SHRUNK), best
        if radius.max() < _LAST:
            break
