"""Laws of time that drives follow, as functions of time that are differentiable by time and by their figures.

Moves from rest to rest are boxes laid over each other. With the ramps (t)_+ = max(t, 0) and lengths T_1, T_2, ... of
boxes, the move of order n is

    s(t) = A / n!  sum over subsets S of the lengths  (-1)^|S| (t - sum of S)_+^n,   A = stroke / (T_1 T_2 ... T_n)

Two boxes are the trapezoid of speed, whose acceleration jumps; three are limited in jerk. Where a derivative jumps, a
law gives that after the jump.
"""

import abc
import itertools
import math
from collections.abc import Sequence
from typing import cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._system._law import AbstractLaw
from .._tools._errors import RedundaxError
from .._tools._module import (
    Numbers,
    as_float,
    figure,
    finite,
    is_concrete,
    not_negative,
    on_device,
    optional_float,
    positive,
)
from .._tools._words import short

FEWEST = 3  # samples of a law
# Coefficients of s^5, s^4 and s^3 of the polynomial with these values, rates and accelerations at 1, and none at 0.
_ABOVE = (6.0, -3.0, 0.5), (-15.0, 7.0, -1.0), (10.0, -4.0, 0.5)


class AbstractMove(AbstractLaw):
    """A move from rest to rest, which goes back after a dwell where one is given, and rests before and after."""

    start: eqx.AbstractVar[Float[Array, ""]]
    stroke: eqx.AbstractVar[Float[Array, ""]]
    begin: eqx.AbstractVar[Float[Array, ""]]
    dwell: eqx.AbstractVar[Float[Array, ""] | None]

    @property
    @abc.abstractmethod
    def boxes(self) -> tuple[Float[Array, ""], ...]:
        """Lengths whose sums are the times from the beginning at which a derivative of the way there jumps, s."""

    @property
    def move(self) -> Float[Array, ""]:
        """Time of the way there, s."""
        return sum(self.boxes)  # pyright: ignore[reportReturnType]

    @property
    def instants(self) -> tuple[Float[Array, "..."], ...]:
        there = tuple(self.begin + sum(some) for some in _subsets(self.boxes))
        return there if self.dwell is None else (*there, *(t + self.move + self.dwell for t in there))

    @abc.abstractmethod
    def share(self, t: Float[Array, ""]) -> Float[Array, ""]:
        """The share of the way that is done t after its beginning, within `move`."""

    @property
    def duration(self) -> Float[Array, ""]:
        """Time from `begin` to the end of the last move, s."""
        return self.move if self.dwell is None else 2 * self.move + self.dwell

    def __call__(self, t: ArrayLike) -> Float[Array, ""]:
        t = jnp.asarray(t) - self.begin
        done = self._clipped(t)
        if self.dwell is not None:
            done = done - self._clipped(t - self.move - self.dwell)
        return self.start + self.stroke * done

    def _clipped(self, t: Array) -> Array:
        inside = self.share(jnp.where((t >= 0) & (t < self.move), t, 0.0))
        return jnp.where(t < 0, 0.0, jnp.where(t < self.move, inside, 1.0))


class Trapezoid(AbstractMove):
    """A move at constant acceleration to a speed, on at that speed, and to rest again: a trapezoid of speed.

    Where the stroke is too short for the speed it is a triangle.

    ??? example

        ```python
        law = rx.Trapezoid(0.3, speed=0.2, acceleration=2.0)  # m, m/s, m/s^2
        law.duration  # 1.6 s
        there_and_back = rx.Trapezoid(0.3, speed=0.2, acceleration=2.0, dwell=0.5)
        ```

    **Arguments:**

    - `stroke`: how far, m or rad; negative the other way.
    - `speed`, `acceleration`: the largest, m/s and m/s^2, or rad/s and rad/s^2; positive.
    - `start`: where it begins, m or rad.
    - `begin`: when it begins, s.
    - `dwell`: how long it rests before it goes back, s; it does not go back if not given.
    """

    stroke: Float[Array, ""]
    speed: Float[Array, ""]
    acceleration: Float[Array, ""]
    start: Float[Array, ""]
    begin: Float[Array, ""]
    dwell: Float[Array, ""] | None

    def __init__(
        self,
        stroke: Numbers,
        speed: Numbers,
        acceleration: Numbers,
        *,
        start: Numbers = 0.0,
        begin: Numbers = 0.0,
        dwell: Numbers | None = None,
    ):
        self.stroke, self.speed, self.acceleration = _figures(stroke=stroke, speed=speed, acceleration=acceleration)
        self.start, self.begin = _figures(start=start, begin=begin)
        self.dwell = _dwell_of(dwell)
        _check_positive(speed=self.speed, acceleration=self.acceleration)

    @property
    def boxes(self) -> tuple[Array, Array]:
        way, ramp = jnp.abs(self.stroke), self.speed / self.acceleration
        is_short = way < self.speed * ramp
        ramp = jnp.where(is_short, _root(way / self.acceleration, 2), ramp)
        return ramp, jnp.where(is_short, ramp, way / self.speed)

    def share(self, t: Array) -> Array:
        return _over_each_other(t, self.boxes)


class SCurve(AbstractMove):
    """A move limited in speed, acceleration and jerk, of up to seven phases.

    Limits that a short stroke does not reach count for nothing.

    ??? example

        ```python
        law = rx.SCurve(0.3, speed=0.2, acceleration=2.0, jerk=40.0)  # m, m/s, m/s^2, m/s^3
        ```

    **Arguments:** those of `Trapezoid`, and

    - `jerk`: the largest, m/s^3 or rad/s^3; positive.
    """

    stroke: Float[Array, ""]
    speed: Float[Array, ""]
    acceleration: Float[Array, ""]
    jerk: Float[Array, ""]
    start: Float[Array, ""]
    begin: Float[Array, ""]
    dwell: Float[Array, ""] | None

    def __init__(
        self,
        stroke: Numbers,
        speed: Numbers,
        acceleration: Numbers,
        jerk: Numbers,
        *,
        start: Numbers = 0.0,
        begin: Numbers = 0.0,
        dwell: Numbers | None = None,
    ):
        given = _figures(stroke=stroke, speed=speed, acceleration=acceleration, jerk=jerk)
        self.stroke, self.speed, self.acceleration, self.jerk = given
        self.start, self.begin = _figures(start=start, begin=begin)
        self.dwell = _dwell_of(dwell)
        _check_positive(speed=self.speed, acceleration=self.acceleration, jerk=self.jerk)

    @property
    def boxes(self) -> tuple[Array, Array, Array]:
        way, speed, most, jerk = jnp.abs(self.stroke), self.speed, self.acceleration, self.jerk
        soft = speed * jerk < most**2  # the speed is reached before the acceleration is
        rise = jnp.where(soft, _root(speed / jerk, 2), most / jerk)
        hold = jnp.where(soft, rise, speed / most)
        on = way / speed
        # Of a stroke too short for the speed: way = jerk rise hold (rise + hold).
        rise_short = most / jerk
        hold_short = (_root(rise_short**2 + 4 * way / most, 2) - rise_short) / 2
        shorter = hold_short < rise_short
        least = _root(way / (2 * jerk), 3)
        rise_short, hold_short = jnp.where(shorter, least, rise_short), jnp.where(shorter, least, hold_short)
        is_short = on < rise + hold
        rise, hold = jnp.where(is_short, rise_short, rise), jnp.where(is_short, hold_short, hold)
        return rise, hold, jnp.where(is_short, rise + hold, on)

    def share(self, t: Array) -> Array:
        return _over_each_other(t, self.boxes)


class Cycloidal(AbstractMove):
    """A move along a cycloid, s = t - sin(2 pi t) / (2 pi) of the whole way and time: acceleration is a sine.

    ??? example

        ```python
        law = rx.Cycloidal(0.5, move=0.2)  # rad, s
        ```

    **Arguments:**

    - `stroke`: how far, m or rad; negative the other way.
    - `move`: how long, s.
    - `start`, `begin`, `dwell`: as of `Trapezoid`.
    """

    stroke: Float[Array, ""]
    _move: Float[Array, ""]
    start: Float[Array, ""]
    begin: Float[Array, ""]
    dwell: Float[Array, ""] | None

    def __init__(
        self,
        stroke: Numbers,
        move: Numbers,
        *,
        start: Numbers = 0.0,
        begin: Numbers = 0.0,
        dwell: Numbers | None = None,
    ):
        self.stroke, self._move = _figures(stroke=stroke, move=move)
        self.start, self.begin = _figures(start=start, begin=begin)
        self.dwell = _dwell_of(dwell)
        _check_positive(move=self._move)

    @property
    def boxes(self) -> tuple[Array]:
        return (self._move,)

    def share(self, t: Array) -> Array:
        turn = 2 * jnp.pi
        return t / self._move - jnp.sin(turn * t / self._move) / turn


class Harmonic(AbstractLaw):
    """To and fro for ever: mean + amplitude sin(2 pi frequency t + phase).

    ??? example

        ```python
        law = rx.Harmonic(0.1, frequency=2.0)  # rad, Hz
        ```

    **Arguments:**

    - `amplitude`: m or rad.
    - `frequency`: Hz.
    - `mean`: m or rad.
    - `phase`: rad.
    """

    amplitude: Float[Array, ""] = eqx.field(converter=figure("amplitude"))
    frequency: Float[Array, ""] = eqx.field(converter=figure("frequency"))
    mean: Float[Array, ""] = eqx.field(converter=figure("mean"), default=0.0)  # pyright: ignore[reportAssignmentType]
    phase: Float[Array, ""] = eqx.field(converter=figure("phase"), default=0.0)  # pyright: ignore[reportAssignmentType]

    def __call__(self, t: ArrayLike) -> Float[Array, ""]:
        return self.mean + self.amplitude * jnp.sin(2 * jnp.pi * self.frequency * t + self.phase)


class Sampled(AbstractLaw):
    """A law through samples: the cubic spline of `scipy.interpolate.CubicSpline`, or with rates and accelerations the
    polynomials of fifth degree that have them at both ends of each interval; differentiable by all of them.

    ??? example

        ```python
        law = rx.Sampled([0.0, 0.5, 1.0], [0.0, 0.2, 0.0])  # s, m or rad
        ```

    **Arguments:**

    - `times`: of the samples, s, ascending; known numbers.
    - `values`: there, m or rad.
    - `ends`: "clamped" for rest at both ends, outside of which the law rests, which is taken if none is given;
      "periodic" for a cycle that repeats, whose last value is the first; "not-a-knot" or "natural" for splines that say
      nothing of rates at the ends and go on beyond as they end. With rates, "periodic" or none: then it goes on beyond.
    - `rates`, `accelerations`: there, m/s and m/s^2, or rad/s and rad/s^2; both or none.
    """

    values: Float[Array, " samples"]
    rates: Float[Array, " samples"] | None
    accelerations: Float[Array, " samples"] | None
    _knots: Float[Array, " samples"]
    _maps: Float[Array, "4 intervals samples"] | None
    ends: str = eqx.field(static=True)

    def __init__(
        self,
        times: Numbers,
        values: Numbers,
        *,
        ends: str | None = None,
        rates: Numbers | None = None,
        accelerations: Numbers | None = None,
    ):
        try:
            knots = np.asarray(times, float)
        except (TypeError, ValueError):
            raise RedundaxError(f"Argument `times` must hold numbers, but is {short(times)}. Give a list.") from None
        self.values = as_float(values, "values")
        self.rates, self.accelerations = optional_float(rates, "rates"), optional_float(accelerations, "accelerations")
        self.ends = _ends(ends, rates, accelerations)
        finite("times", knots)
        for name, figures in (("values", self.values), ("rates", self.rates), ("accelerations", self.accelerations)):
            if figures is None:
                continue
            if knots.ndim != 1 or knots.size < FEWEST or np.any(np.diff(knots) <= 0) or figures.shape != knots.shape:
                raise RedundaxError(
                    f"Arguments `times` and `{name}` must hold three samples or more, at ascending times, but have "
                    f"shapes {knots.shape} and {figures.shape}. Sort them, and give a figure for each time."
                )
            finite(name, figures)
            if self.ends == "periodic":
                _check_closed(name, figures)
        self._knots, self._maps = on_device(knots), None if rates is not None else _spline(knots, self.ends)

    @property
    def instants(self) -> tuple[Float[Array, "..."], ...]:
        return (self._knots[..., 0], self._knots[..., -1]) if self.ends == "clamped" else ()

    @property
    def last(self) -> Float[Array, ""]:
        """The time of the last sample, s."""
        return self._knots[-1]

    def __call__(self, t: ArrayLike) -> Float[Array, ""]:
        t, first, last = jnp.asarray(t), self._knots[0], self.last
        if self.ends == "periodic":
            t = first + jnp.mod(t - first, last - first)
        elif self.ends == "clamped":
            t = jnp.where(t < first, first, jnp.where(t < last, t, last))
        place = jnp.clip(jnp.searchsorted(self._knots, t, side="right") - 1, 0, self._knots.size - 2)
        past = t - self._knots[place]
        if self._maps is not None:
            return jnp.polyval(self._maps[:, place] @ self.values, past)
        return jnp.polyval(self._quintic(place), past)

    def _quintic(self, place: Array) -> Float[Array, "6"]:
        """Coefficients of the polynomial within an interval, highest power first."""
        pair = jnp.stack([place, place + 1])
        (value, end), (rate, last), (bend, after) = (
            cast(Array, figures)[pair] for figures in (self.values, self.rates, self.accelerations)
        )
        h = self._knots[place + 1] - self._knots[place]
        missed = end - value - rate * h - bend * h**2 / 2, h * (last - rate - bend * h), h**2 * (after - bend)
        above = jnp.array(_ABOVE) @ jnp.stack(missed) / h ** jnp.array([5, 4, 3])
        return jnp.concatenate([above, jnp.stack([bend / 2, rate, value])])


def _ends(ends: str | None, rates: Numbers | None, accelerations: Numbers | None) -> str:
    """What a law does at its ends and beyond."""
    kinds = ("clamped", "periodic", "not-a-knot", "natural")
    if (rates is None) != (accelerations is None):
        missing = "rates" if rates is None else "accelerations"
        raise RedundaxError(f"Argument `{missing}` must be given with the other, but is None. Give both, or none.")
    if ends is None:
        return "clamped" if rates is None else "open"
    if ends not in kinds:
        raise RedundaxError(f"Argument `ends` must be one of {', '.join(kinds)}, but is {ends!r}. Choose one.")
    if rates is not None and ends != "periodic":
        raise RedundaxError(f"Argument `ends` must be 'periodic' with rates, but is {ends!r}. Leave it out.")
    return ends


def _spline(knots: np.ndarray, ends: str) -> Float[Array, "4 intervals samples"]:
    """Coefficients of the cubic spline of each value, highest power first."""
    from scipy.interpolate import CubicSpline

    unit = np.eye(knots.size)
    if ends == "periodic":
        unit[-1] = unit[0]
    return on_device(CubicSpline(knots, unit, bc_type=ends).c)


def _figures(**given: Numbers) -> list[Array]:
    figures = [as_float(value, name) for name, value in given.items()]
    for name, value in zip(given, figures, strict=True):
        if value.shape:
            raise RedundaxError(f"Argument `{name}` must be a number, but has shape {value.shape}. Give one.")
    return figures


def _dwell_of(dwell: Numbers | None) -> Array | None:
    """Refuse one that is negative: the way back would begin before the end of the way there."""
    if dwell is None:
        return None
    (value,) = _figures(dwell=dwell)
    not_negative("dwell", value)
    return value


def _check_positive(**given: Array) -> None:
    for name, value in given.items():
        positive(name, value)


def _check_closed(name: str, values: Array) -> None:
    """Refuse a cycle that does not end where it begins, by more than the last of three digits."""
    if is_concrete(values):
        off, size = abs(float(values[-1] - values[0])), float(np.ptp(np.asarray(values)))
        if off > 1e-3 * size:
            raise RedundaxError(
                f"Argument `{name}` of a periodic law must end with its first value {values[0]:.6g}, but ends "
                f"{off:.3g} off. Add the sample that closes the cycle, or give the last one the first value."
            )


def _root(x: Array, order: int) -> Array:
    """x^(1 / order), with the derivative 0 at 0, where a law moves nowhere."""
    some = x > 0
    return jnp.where(some, jnp.where(some, x, 1.0) ** (1 / order), 0.0)


def _over_each_other(t: Array, boxes: Sequence[Array]) -> Array:
    """The share of the way at t of boxes of these lengths over each other; none of a move that takes no time."""
    order = len(boxes)
    area = math.prod(boxes)
    total = jnp.zeros_like(t)
    for some in _subsets(boxes):
        past = t - sum(some)
        total = total + (-1) ** len(some) * jnp.where(past >= 0, past, 0.0) ** order
    return total / (math.factorial(order) * jnp.where(area > 0, area, 1.0))  # pyright: ignore[reportArgumentType]


def _subsets(boxes: Sequence[Array]) -> list[tuple[Array, ...]]:
    return [some for size in range(len(boxes) + 1) for some in itertools.combinations(boxes, size)]
