"""How long calls take: the first, which may compile, and later ones."""

import time
from collections.abc import Callable

import jax
import numpy as np


def timed(
    run: Callable, repeats: int = 3, clock: Callable[[], float] = time.perf_counter, warm: float = 0.0
) -> tuple[float, float, object]:
    """Seconds of the first call, median of the last ones, and the value; after so many seconds at least."""
    seconds, value = [], None
    while len(seconds) <= repeats or sum(seconds) < warm:
        start = clock()
        value = jax.block_until_ready(run())
        seconds.append(clock() - start)
    return seconds[0], float(np.median(seconds[-repeats:])), value
