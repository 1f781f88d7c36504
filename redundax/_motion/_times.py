"""Times of a motion, which runs forward:

    t_0 <= ts_1 <= ts_2 <= ... <= t_1

Times that rounding puts beyond an end count as that end.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._tools._compilation import compiled
from .._tools._module import is_concrete

_ROUNDINGS = 10


@compiled
def in_order(start: Array, end: Array, ts: Float[Array, " times"]) -> Bool[Array, ""]:
    """Whether all are finite and follow each other."""
    early, late = start - _slack(start, end), end + _slack(start, end)
    times = jnp.concatenate([early[None], ts, late[None]])
    return (start <= end) & jnp.all(jnp.isfinite(times)) & jnp.all(times[:-1] <= times[1:])


def within(start: Array, end: Array, ts: Float[Array, " times"]) -> Float[Array, " times"]:
    """The times, those beyond an end at that end; where they touch it, the derivative is theirs."""
    ts = jnp.where(ts < start, start, ts)
    return jnp.where(ts > end, end, ts)


def check_times(start: Array, end: Array, ts: Array) -> None:
    """Refuse times that no motion runs through; those that are traced give a result of their own."""
    if ts.ndim != 1 or ts.size == 0:
        raise ValueError(
            f"Argument `ts` must be a vector of one time or more, but has shape {ts.shape}. "
            "Give `ts=[t1]` for the end of the motion alone."
        )
    ordered = in_order(start, end, ts)
    if not is_concrete(ordered) or ordered:
        return
    if not (start <= end and np.isfinite(start) and np.isfinite(end)):
        raise ValueError(
            f"Argument `t1` must be a finite time not before that of `state`, {start}, but is {end}. "
            "Motions run forward: give the earlier state."
        )
    slack, times = _slack(start, end), np.asarray(ts)
    beyond = times[~((times >= start - slack) & (times <= end + slack))]
    wrong = [*(f"{t} lies elsewhere" for t in beyond), "some follow later ones"][0]
    raise ValueError(
        f"Argument `ts` must hold times in ascending order from that of `state`, {start}, to `t1`, {end}, but {wrong}. "
        "Sort them, and leave out what lies beyond."
    )


def _slack(start: Array, end: Array) -> Array:
    return _ROUNDINGS * jnp.finfo(end.dtype).eps * jnp.maximum(jnp.abs(start), jnp.abs(end))
