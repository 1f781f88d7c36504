"""Under which settings of NumPy and of its libraries known numbers are computed."""

import contextlib
import functools
import threading
from collections.abc import Iterator

import numpy as np
from threadpoolctl import ThreadpoolController


@functools.cache
def _blas() -> ThreadpoolController:
    return ThreadpoolController().select(user_api="blas")


class _Inside:
    """How many calls are computing, in all threads and in each."""

    def __init__(self) -> None:
        self.lock, self.own, self.all, self.limits = threading.Lock(), threading.local(), 0, None

    def enter(self) -> None:
        self.own.depth = getattr(self.own, "depth", 0) + 1
        with self.lock:
            self.all += 1
            if self.all == 1:
                self.limits = _blas().limit(limits=1)

    def leave(self) -> None:
        self.own.depth -= 1
        with self.lock:
            self.all -= 1
            if self.all == 0 and self.limits is not None:
                self.limits.restore_original_limits()


_inside = _Inside()


def is_computing() -> bool:
    """Whether a call on known numbers is under way in this thread."""
    return getattr(_inside.own, "depth", 0) > 0


@contextlib.contextmanager
def computing() -> Iterator[None]:
    """NaN and infinity without a word, and small matrices on one thread: several take tens of times as long."""
    _inside.enter()
    try:
        with np.errstate(all="ignore"):
            yield
    finally:
        _inside.leave()
