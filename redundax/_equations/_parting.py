"""Closed contacts that a velocity opens.

Contacts that are closed hold as long as all other rows can be met beside them. Where they cannot, as where a rate that
is given takes a part off its stop, those open that are left in

    min over qd of |r|^2 + |max(r_c, 0)|^2,   r = Phi_q qd + Phi_t and what rates miss, r_c of closed contacts,

at r_c < 0. Sparse matrices give no least squares where rows contradict each other: of contacts those hold then that are
approached without. A guess that meets all other rows and approaches no contact is a velocity by itself: it opens those
that it leaves.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Bool, Int

from .._system._contact import rows_that_hold
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._numbers import take, while_loop, xp
from ._gaps import model_of_all
from ._misfit import Misfit
from ._scaling import largest_violation, scaling


class _Step(NamedTuple):
    """Contacts that hold, how often they were looked at, whether they are those that are approached, and final."""

    held: Bool[Array, " c"]
    turns: Int[Array, ""]
    grows: Bool[Array, ""]
    settled: Bool[Array, ""]


def rows_of_velocity(
    system: AbstractSystem,
    state: State,
    velocity: Callable[[AbstractSystem], tuple[Array, Misfit]],
    closed: Bool[Array, " c"],
) -> Bool[Array, " m"]:
    """The rows that hold a velocity: all but those of contacts that are open, and of closed ones that it opens.

    `state` has the guess, and `velocity(system)` is the nearest to it that the rows of a system allow.
    """
    names, rows = system.names, np.array(system.names.one_sided)
    model = model_of_all(system, state)
    scales, tolerance = scaling(system, model), largest_violation(state.qd.dtype)
    drift = model.motion.rate - model.jacobian @ state.qd

    def at(held: Array) -> tuple[Array, Array, Array, Misfit]:
        """The velocity, how contacts close with it, relative to its size, and by how much it misses."""
        qd, missed = velocity(system.opened(rows_that_hold(names, held, held)))
        speed = xp.max(xp.abs(qd / scales.coordinates)) + xp.max(missed.size / missed.scale)
        closes = take((model.jacobian @ qd + drift) / scales.rows, rows)
        return qd, xp.where(closed, closes, 0.0), tolerance * speed, missed

    qd, approach, least, missed = at(xp.zeros_like(closed))
    change = xp.max(xp.abs((qd - state.qd) / scales.coordinates), initial=0.0)
    admitted = (change <= least) & xp.all(approach <= least) & ~missed.refused
    approached = closed & (approach > least)

    def body(now: _Step) -> _Step:
        _, closes, least, missed = at(now.held)
        back = closed & ~now.held & (closes > least)
        parts = now.held & (closes < -least) & missed.refused & ~now.grows
        still = ~xp.any(back | parts)
        starts_again = still & missed.refused & ~now.grows
        held = xp.where(starts_again, approached, (now.held | back) & ~parts)
        return _Step(held, now.turns + 1, now.grows | starts_again, still & ~starts_again)

    none, no = xp.zeros((), int), xp.zeros((), bool)
    start = _Step(closed & (~admitted | (approach >= -least)), none, no, no)
    end = while_loop(lambda now: ~now.settled & (now.turns < 4 * rows.size + 4), body, start)
    return rows_that_hold(names, end.held, end.held)
