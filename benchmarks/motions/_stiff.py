"""Stiff motions beside SciPy's Radau on their own few equations, and Exudyn; all in CPU seconds.

A slider crank presses a plate by a spring of 1e9 N/m; one of its two guides is redundant. SciPy has the equations of
its two freedoms, with the place of the plate, as other programs have it, and with the elongation of the spring, along
which stiffness has no curvature: a choice of coordinates for this mechanism alone. A block is pulled on LuGre's
bristles, of 1e5 1/m: SciPy has its three equations. Exudyn has no such friction. SciPy at `rtol=1e-11` is the truth;
of the press it agrees with DOP853 at 1e-12 to 1e-11.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from truth import bristles, press

import redundax as rx

from . import _exudyn
from ._problems import Problem
from ._works import Row, ours, timed

LUGRE = {**bristles.LUGRE, "stiffness": 1e5, "damping": 50.0}


class Peer(NamedTuple):
    """Equations for SciPy, whose first unknown is compared: y' of t and y, y at the start, and sizes of y."""

    name: str
    rates: Callable
    start: list[float]
    sizes: tuple[float, ...]

    def ended(self, t1: float, rtol: float) -> tuple[float, int]:
        """The first unknown at the end, and steps."""
        atol = rtol * np.array(self.sizes)
        run = solve_ivp(self.rates, (0.0, t1), self.start, "Radau", rtol=rtol, atol=atol)
        return run.y[0, -1], run.t.size - 1


def stiff(quick: bool) -> Iterator[Row]:
    """Time against error of the block and of the press."""
    pulled = Peer("SciPy", partial(bristles.rates, values=LUGRE), [0.0] * 3, (1.0, 1.0, 1e-4))
    block = bristles.block(rx.LuGre(**LUGRE))
    yield from _beside("LuGre's block, 6 s", block, 0, 6.0, [pulled], quick)
    phi, place, spin, speed = press.begin()
    peers = [
        Peer("SciPy, elongation", press.elongated, [phi, 0.0, spin, 0.0], (1.0, 1e-5, 10.0, 1e-2)),
        Peer("SciPy, place", press.rates, [phi, place, spin, speed], (1e-2,) * 4),
    ]
    yield from _beside("stiff press, 2 s", press.mechanism(), 8, 2.0, peers, quick)


def _beside(
    name: str, model: tuple[rx.Mechanism, rx.State], place: int, t1: float, peers: list[Peer], quick: bool
) -> Iterator[Row]:
    truth, _ = peers[0].ended(t1, 1e-11)
    problem = Problem(name, *model, lambda q: abs(q[place] - truth), t1)
    tolerances = (1e-5, 1e-7) if quick else (1e-5, 1e-6, 1e-7, 1e-8)
    for solver in (None,) if quick else (None, rx.Radau()):
        for rtol in tolerances:
            yield ours(problem, rtol, solver, time.process_time)
    for peer in peers:
        for rtol in tolerances:
            _, seconds, (end, steps) = timed(partial(peer.ended, t1, rtol), 1, time.process_time)
            yield Row(name, peer.name, f"rtol {rtol:.0e}", 0.0, seconds, steps, abs(end - truth))
    if len(peers) > 1 and not _exudyn.missing():
        for steps in (1_000, 4_000) if quick else (1_000, 4_000, 16_000, 64_000):
            seconds, end = _exudyn.run_press(steps, t1)
            yield Row(name, _exudyn.NAME, f"{steps} steps", 0.0, seconds, steps, abs(end - truth))
