"""A body that slides dryly in several directions, m_k s_k'' = Q_k(s, t) - f a_k v_k / |v| with v = a s', from stop to
stop.

At rest it stays while |Q / a| <= f; it sets out along n with W (Q / a - f n) = lambda n, W = a^2 / m, lambda > 0. The
equations are stiff where v is small. A load that grows lets it go at t0 along n = Q / a f, where
|v| n . W^-1 n = n . Q' / a (t - t0)^2 / 2 at first. None of the library's code is used.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

_SLOW = 1e-8  # m/s, as good as a stop: what is left of the way is its square


class Slide(NamedTuple):
    """Slips and their rates at the times asked for, (times, k), and the instants at which it stopped."""

    slips: np.ndarray
    rates: np.ndarray
    stops: list[float]


class Slider(NamedTuple):
    """The body: m, a, f and Q(s, t)."""

    mass: np.ndarray
    arms: np.ndarray
    limit: float
    load: Callable[[np.ndarray, float], np.ndarray]

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        """Of slips and velocities v."""
        s, v = np.split(y, 2)
        pull = self.load(s, t) / self.arms - self.limit * v / np.linalg.norm(v)
        return np.concatenate([v / self.arms, self.arms**2 / self.mass * pull])

    def sets_out(self, s: np.ndarray, t: float) -> np.ndarray | None:
        """n, or None where it stays."""
        pull, ease = self.load(s, t) / self.arms, self.arms**2 / self.mass
        if np.linalg.norm(pull) <= self.limit:
            return None

        def unit(value: float) -> np.ndarray:
            return ease * pull / (value + self.limit * ease)

        most = float(np.linalg.norm(ease * pull))
        return unit(brentq(lambda value: float(np.linalg.norm(unit(value))) - 1, 0.0, most, xtol=1e-15 * most))


def slide(slider: Slider, start: np.ndarray, rates: np.ndarray, times: np.ndarray) -> Slide:
    """The motion up to the last of the times; at rest it stays for good, or sets out at once."""
    t, s, v = 0.0, np.asarray(start, float), np.asarray(rates, float) * slider.arms
    slips, speeds, stops = np.tile(s, (len(times), 1)), np.zeros((len(times), len(s))), []
    while True:
        if not v.any():
            along = slider.sets_out(s, t)
            if along is None:
                break
            v = 1e-12 * along
        run = _until_stop(slider, t, np.concatenate([s, v]), times[-1])
        here = (times >= t) & (times <= run.t[-1])
        slips[here], v_here = np.split(run.sol(times[here]).T, 2, axis=1) if here.any() else (slips[here], speeds[here])
        speeds[here] = v_here / slider.arms
        t, (s, v) = run.t[-1], np.split(run.y[:, -1], 2)
        if t >= times[-1]:
            break
        size = np.linalg.norm(v)
        t = t - size**2 / (v @ slider.rates(t, run.y[:, -1])[len(s) :])
        stops.append(t)
        slips[times >= t], v = s, 0 * v
    return Slide(slips, speeds, stops)


def _until_stop(slider: Slider, t: float, y: np.ndarray, end: float):
    def moves(at: float, y: np.ndarray) -> float:
        return float(np.linalg.norm(y[len(slider.arms) :])) - _SLOW if at > t + 1e-7 else 1.0

    moves.terminal, moves.direction = True, -1
    options = {"method": "LSODA", "rtol": 1e-12, "atol": 1e-15}
    return solve_ivp(slider.rates, (t, end), y, events=[moves], dense_output=True, **options)


def let_go(slider: Slider, latest: float, times: np.ndarray) -> Slide:
    """The motion from rest, after loads that let it go before the latest time; at the times asked for, all of them
    later. The stop is the release."""
    rest, after = np.zeros(len(slider.arms)), 2e-4

    def pull(t: float) -> np.ndarray:
        return slider.load(rest, t) / slider.arms

    start = brentq(lambda t: float(np.linalg.norm(pull(t))) - slider.limit, 0.0, latest, xtol=1e-15, rtol=1e-15)
    along, grows = pull(start) / slider.limit, (pull(start + 1e-4) - pull(start - 1e-4)) / 2e-4
    speed = along @ grows / (along @ (along * slider.mass / slider.arms**2)) * after**2 / 2
    begin, options = np.concatenate([rest, speed * along]), {"method": "Radau", "rtol": 1e-11, "atol": 1e-14}
    run = solve_ivp(slider.rates, (start + after, times[-1]), begin, t_eval=times, **options)
    slips, speeds = np.split(run.y.T, 2, axis=1)
    return Slide(slips, speeds / slider.arms, [start])
