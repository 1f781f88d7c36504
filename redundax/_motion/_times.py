"""Times of a motion, which runs forward:

    t_0 <= ts_1 <= ts_2 <= ... <= t_1

Times that rounding puts beyond an end count as that end.
"""

import numpy as np
from jaxtyping import Array, Float

from .._tools._errors import RedundaxError
from .._tools._module import is_concrete, numpy_of
from .._tools._numbers import xp

_ROUNDINGS = 10

Times = np.ndarray | np.floating | Array


def in_order(start: Times, end: Times, ts: Times) -> np.bool_ | Array:
    """Whether all are finite and follow each other."""
    numpy = numpy_of(start, end, ts)
    start, end, ts = map(numpy.asarray, (start, end, ts))
    slack = _slack(start, end)
    times = numpy.hstack([start - slack, ts, end + slack])
    return (start <= end) & numpy.all(numpy.isfinite(times)) & numpy.all(times[:-1] <= times[1:])


def within(start: Array, end: Array, ts: Float[Array, " times"]) -> Float[Array, " times"]:
    """The times, those beyond an end at that end; where they touch it, the derivative is theirs."""
    ts = xp.where(ts < start, start, ts)
    return xp.where(ts > end, end, ts)


def check_times(start: Times, end: Times, ts: Times) -> None:
    """Refuse times that no motion runs through; those that are traced give a result of their own."""
    if ts.ndim != 1 or ts.size == 0:
        raise RedundaxError(
            f"Argument `ts` must be a vector of one time or more, but has shape {ts.shape}. "
            "Give `ts=[t1]` for the end of the motion alone."
        )
    ordered = in_order(start, end, ts)
    if not is_concrete(ordered) or ordered:
        return
    start, end, times = map(np.asarray, (start, end, ts))
    if not (start <= end and np.isfinite(start) and np.isfinite(end)):
        raise RedundaxError(
            f"Argument `t1` must be a finite time not before that of `state`, {start}, but is {end}. "
            "Motions run forward: give the earlier state."
        )
    slack = _slack(start, end)
    beyond = times[~((times >= start - slack) & (times <= end + slack))]
    wrong = [*(f"{t} lies elsewhere" for t in beyond), "some follow later ones"][0]
    raise RedundaxError(
        f"Argument `ts` must hold times in ascending order from that of `state`, {start}, to `t1`, {end}, but {wrong}. "
        "Sort them, and leave out what lies beyond."
    )


def _slack(start: Times, end: Times) -> Times:
    numpy = numpy_of(start, end)
    return _ROUNDINGS * numpy.finfo(end.dtype).eps * numpy.maximum(numpy.abs(start), numpy.abs(end))
