"""One-sided contacts of a log: those that are closed hold all along, and push

    lam = lam_0 + N z,   p = lam_c >= 0.

Of all self-stress that lets them push the log carries that which leaves least of its figures, |B lam - y| summed up: a
linear programme, in which one wrong figure stays one.
"""

from typing import NamedTuple, cast

import numpy as np

from .._bodies._mechanism import Mechanism
from .._equations._gaps import overlaps
from .._equations._scaling import largest_violation
from .._solve._contacts import as_held
from .._system._contact import rows_that_hold
from .._system._state import State
from .._tools._computing import computing
from .._tools._errors import NoSolutionError, RedundaxError
from ._motion import Path, models

_MET = 1e-6  # of the size of the mechanism: positions of a log have no more digits


class Held(NamedTuple):
    """The mechanism whose closed contacts hold; rows of these, and of those that are open."""

    system: Mechanism
    pushing: tuple[int, ...] = ()
    open_rows: tuple[int, ...] = ()


def held_at(system: Mechanism, q: np.ndarray, t: float) -> Held:
    """With the contacts that have no gap at a position."""
    names = system.names
    if not names.one_sided:
        return Held(system)
    if names.velocity_rows:
        raise RedundaxError(
            "Argument `mechanism` must not have rows of velocity beside one-sided contacts, which a log does not tell "
            "apart. Give the wheels that carry alone, not one-sided."
        )
    with computing():
        state = State(q, np.zeros(len(system.coordinates)), np.asarray(t, q.dtype))
        closed = np.asarray(overlaps(system, state)) > -largest_violation(q.dtype)
    rows, kept = np.array(names.one_sided), np.asarray(rows_that_hold(names, closed, closed))
    return Held(cast(Mechanism, as_held(system, kept)), tuple(rows[closed].tolist()), tuple(rows[~closed].tolist()))


def check_open(held: Held, path: Path) -> None:
    """Refuse a motion along which contacts close that were open."""
    if not held.open_rows:
        return
    rows = list(held.open_rows)
    every = cast(Mechanism, as_held(held.system, np.ones(len(held.system.rows), bool)))
    found = models(every, path.times, path.q, path.qd, bool(path.drive.names))
    sizes = np.linalg.norm(found.jacobian[:, rows] * path.scale.coordinates, axis=2)
    over = found.value[:, rows] > _MET * path.scale.length * sizes
    if over.any():
        k = int(np.argmax(over.any(axis=1)))
        closing = ", ".join(held.system.rows.labels[row] for row, one in zip(rows, over[k], strict=True) if one)
        raise RedundaxError(
            f"Argument `log` must keep contacts open that are open at its start, but {closing} close by "
            f"t = {path.times[k]:.6g}. Give its parts before and after one by one."
        )


def pushed(
    z: np.ndarray, loads: tuple[np.ndarray, np.ndarray], fit: tuple[np.ndarray, np.ndarray], rtol: float, said: str
) -> np.ndarray:
    """Amounts of self-stress with which contacts push: those given, where they do.

    **Arguments:**

    - `z`: that which fits best.
    - `loads`: of contacts without self-stress, (c,), and by it, (c, k).
    - `fit`: B N and what figures of the log are beyond those of no self-stress, relative to what counts as right.
    - `said`: how an error begins where they cannot all push.
    """
    (own, by), (matrix, wanted) = loads, fit
    least = -rtol * np.abs(own + by @ z).max(initial=0.0)
    if np.all(own + by @ z >= least):
        return z
    from scipy.optimize import linprog  # here, because its import takes a second

    size, count = np.linalg.norm(by, axis=0), len(wanted)
    size = np.where(size > 0, size, 1.0)
    each, none = np.eye(count), np.zeros((len(own), count))
    left = np.block([[matrix / size, -each], [-matrix / size, -each], [-by / size, none]])
    cost, right = np.r_[np.zeros(len(z)), np.ones(count)], np.r_[wanted, -wanted, own - least]
    bounds = [(None, None)] * len(z) + [(0, None)] * count
    found = linprog(cost, left, right, bounds=bounds) if len(z) else None
    if found is None or found.status != 0:
        raise NoSolutionError(
            f"{said} cannot carry the motion of the log by pushing alone: one of them lifts before. Give the part of "
            "the log until then, and the rest for the mechanism without that contact."
        )
    return found.x[: len(z)] / size
