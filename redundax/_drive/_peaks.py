"""When drives give most, between the times that were asked."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._tools._errors import RedundaxError
from .._tools._module import Numbers, check_call, check_kind
from .._tools._numbers import are_known
from ._along import times_of
from ._run import Run

# Times between two neighbours of the largest, three times: 1/4096 of a step, and its square off.
_FINER, _ROUNDS = 33, 3


def with_peaks(run_at: Callable[[Array], Run], ts: Numbers) -> Run:
    """A run that also has the times between the others at which each drive gives most.

    `run.peak` and `run.peak_time` are then those of the whole motion. Their derivative by a design is that of the peak
    at `run.t`, since a change of its time changes no peak.

    ??? example

        ```python
        crank, law = rx.mechanisms.slider_crank(), rx.Harmonic(0.4, frequency=2.0, mean=0.5)
        q = crank.state(0.5).q
        run = rx.with_peaks(lambda ts: rx.drive(crank, {"A.angle": law}, ts, q), jnp.linspace(0.0, 0.5, 26))
        run.peak, run.peak_time
        ```

    **Arguments:**

    - `run_at`: gives the run at times, as `rx.drive` does.
    - `ts`: times, s, ascending; close enough together that each largest peak stands out among them.

    **Returns:** the `Run` at all of these.

    **Raises:** `RedundaxError` inside of `jit`, `vmap` and `grad`: look for the times outside, and give `run.t` there.
    """
    times = times_of(ts)
    check_call("run_at", run_at, times)
    run = run_at(times)
    check_kind("run_at", run, Run, "a function that gives a `Run`", "Return what `rx.drive` gives.")
    if not are_known(run.t, run.multipliers):
        raise RedundaxError(
            "Argument `run_at` must give known numbers, but they are traced by `jit`, `vmap` or `grad`. Call "
            "`with_peaks` outside of these, and `drive` at its `run.t` inside."
        )
    for _ in range(_ROUNDS):
        t = np.asarray(run.t)
        places = run.largest
        ends = t[np.maximum(places - 1, 0)], t[np.minimum(places + 1, t.size - 1)]
        run = run_at(_joined(times, np.linspace(*ends, _FINER)))
    return run_at(_joined(times, np.asarray(run.t)[run.largest]))


def _joined(times: Array, others: np.ndarray) -> Array:
    return jnp.asarray(np.union1d(np.asarray(times), others.ravel()))
