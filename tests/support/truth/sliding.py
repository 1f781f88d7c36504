"""A body that slides dryly in two or more directions: m_k s_k'' = Q_k(s, t) - f a_k v_k / |v|, v = a s', from event to
event.

At rest it stays while |Q / a| <= f, and sets out along n with W (Q / a - f n) parallel to n, W = a^2 / m. It uses none
of the library's code.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

_SLOW = 1e-8  # part of a speed that is as good as a stop: what is left of the way is its square


class Slide(NamedTuple):
    """Slips and their rates at the times asked for, (times, k) each, and the instants at which it stopped or set out."""

    slips: np.ndarray
    rates: np.ndarray
    events: list[float]


def direction(pull: np.ndarray, limit: float, ease: np.ndarray) -> np.ndarray:
    """n with ease (pull - limit n) = lambda n, lambda > 0."""

    def unit(value: float) -> np.ndarray:
        return ease * pull / (value + limit * ease)

    high = np.linalg.norm(ease * pull)
    return unit(brentq(lambda value: np.linalg.norm(unit(value)) - 1, 0.0, high, xtol=1e-15 * high))


def slide(
    mass: np.ndarray,
    arms: np.ndarray,
    limit: float,
    load: Callable[[np.ndarray, float], np.ndarray],
    start: np.ndarray,
    rates: np.ndarray,
    times: np.ndarray,
) -> Slide:
    """The motion up to the last of the times."""
    ease, events, found, t = arms**2 / mass, [], {}, 0.0
    s, v = np.array(start, float), np.array(rates, float) * arms

    def pull(s, t):
        return load(s, t) / arms

    def moves(t, y, along=None):
        s, v = np.split(y, 2)
        size = np.linalg.norm(v)
        turned = along if size == 0 else v / size
        return np.concatenate([v / arms, ease * (pull(s, t) - limit * turned)])

    def keep(run, upto, resting=False):
        for k in np.flatnonzero((times >= t) & (times <= upto)):
            s_k, v_k = (s, 0 * v) if resting else np.split(run.sol(times[k]), 2)
            found[k] = s_k, v_k / arms

    while t < times[-1]:
        if not v.any():
            lets_go = (lambda at: np.linalg.norm(pull(s, at)) - limit)
            looks = np.linspace(t, times[-1], 2001)
            over = [at for at in looks if lets_go(at) > 0]
            if not over:
                keep(None, times[-1], resting=True)
                break
            first = over[0]
            if first > t:
                first = brentq(lets_go, first - (looks[1] - looks[0]), first, xtol=1e-14)
                keep(None, first, resting=True)
                t = first
                events.append(t)
            n = direction(pull(s, t) * (1 + 1e-15), limit, ease)
            v = n * 1e-12
        size = max(np.linalg.norm(v), 1e-3)
        since = t

        def stops(at, y, since=since, size=size):
            fast = np.linalg.norm(y[len(s) :])
            return fast / size - _SLOW if at > since + 1e-7 else 1.0

        stops.terminal, stops.direction = True, -1
        run = solve_ivp(
            moves, (t, times[-1]), np.concatenate([s, v]), method="LSODA", rtol=1e-12, atol=1e-15, events=[stops],
            dense_output=True,
        )  # fmt: skip
        keep(run, run.t[-1])
        t = run.t[-1]
        s, v = np.split(run.y[:, -1], 2)
        if t < times[-1]:
            slows = -(v / np.linalg.norm(v)) @ moves(t, run.y[:, -1])[len(s) :]
            t, v = t + np.linalg.norm(v) / slows, 0 * v
            events.append(t)
    slips, speeds = zip(*(found[k] for k in range(len(times))), strict=True)
    return Slide(np.array(slips), np.array(speeds), events)
