"""Positions of a driven system from time to time, by prediction and Newton's method.

    q [+] S (h v + h^2 v' / 2),   then   u = -(K^T K)^-1 K^T r,   q <- q [+] S u    until u is rounding

with the scaled residual r and Jacobian K. A step is taken in one piece only where Newton's method starts close and
contracts, so that it stays on its branch: the mode of assembly is kept, and where angles turn, turns are counted. Else
it is halved. Where halving does not help the position ends: a singular one is near, or there is none beyond. Where laws
contradict each other corrections settle on a compromise, whose residual tells it. With rows of velocity positions
depend on the way there (`_roll`).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .._equations._scaling import Scaling, largest_violation
from .._system._system import AbstractSystem
from .._tools._numbers import as_program, chosen_of, tolerance_of
from ._roll import rolled

_MOVED = 0.5  # of the size, as radians: predicted and prescribed motion within a step, so that no turn is missed
_CLOSE, _CONTRACTS = 0.1, 0.3  # first correction within a step, and each later one by the one before
# A correction whose square, which Newton's method leaves, is rounding; at least so many roundings, which residuals of
# rounding bring about where the least singular value is a hundredth.
_SETTLED = 1e-9, 300
_CORRECTIONS = 6  # from 0.1 on, by squares, and two more
# Of the step to try, at least so many roundings: rates at the ends of a shorter one differ by rounding, if two times
# are almost the same.
_SLIVER = 1e-6, 1e3
# Of the way to the next time, at least so many roundings: the least step, within which a motion ends.
_HALVED = 2.0**-22, 2.0**9
_ADVANCES = 2.0  # roundings of the time that a step is longer than, so that the time goes on by it
_LOOKS = 4  # times within a step at which laws are asked how fast they are


class _Track(NamedTuple):
    """Position, scaled velocity and its rate, time, and the next step to try, which may go beyond the next time."""

    q: Array
    rate: Array
    bend: Array
    t: Array
    step: Array


class _Newton(NamedTuple):
    """A position, and the scaled velocity and the largest violation at the one before the last correction, which is all
    but that."""

    q: Array
    rate: Array
    off: Float[Array, ""]
    last: Float[Array, ""]
    steps: Int[Array, ""]
    good: Bool[Array, ""]


class Followed(NamedTuple):
    """Positions at times, whether they were reached, and how far the last one was: its position and time."""

    q: Float[Array, "times ..."]
    reached: Bool[Array, " times"]
    end: _Track


def begun(q: Array, t: Array, n: int) -> _Track:
    """The start of a track, whose velocity nobody has asked yet."""
    none = jnp.zeros(n, q.dtype)
    return _Track(q, none, none, t, jnp.full((), jnp.inf, q.dtype))


def follow(system: AbstractSystem, scale: Scaling, start: _Track, ts: Float[Array, " times"]) -> Followed:
    """The positions at times that follow each other, from one at the first of them or before."""

    def to_next(track: _Track, target: Array) -> tuple[_Track, tuple[Array, Array]]:
        if system.velocity_rows:
            q, rate, t, good = rolled(system, scale, track.q, track.t, target)
            good = good & (track.step > 0)  # none beyond one that was not reached
            return _Track(q, rate, track.bend, t, jnp.where(good, track.step, 0.0)), (q, good)
        way = target - track.t
        eps = jnp.finfo(way.dtype).eps
        least = jnp.maximum(tolerance_of(_HALVED, way) * way, _ADVANCES * eps * jnp.abs(target))

        def going(track: _Track) -> Array:
            return (track.t < target) & (track.step > least)

        def body(track: _Track) -> _Track:
            return _attempt(system, scale, track, target)

        end = jax.lax.while_loop(going, body, track)
        return end, (end.q, end.t >= target)

    end, (q, reached) = jax.lax.scan(to_next, start, ts)
    return Followed(q, reached, end)


follow_known = as_program(follow)


def _attempt(system: AbstractSystem, scale: Scaling, track: _Track, target: Array) -> _Track:
    h = jnp.minimum(track.step, target - track.t)
    t = jnp.where(track.t + h * (1 + 1e-9) >= target, target, track.t + h)  # no sliver of rounding is left
    ahead = h * track.rate + h**2 / 2 * track.bend
    found = _corrected(system, scale, system.retract(track.q, scale.coordinates * ahead), t)
    looks = track.t + (t - track.t) * jnp.arange(1, _LOOKS + 1) / _LOOKS
    prescribed = jax.vmap(lambda at: jnp.max(jnp.abs(_prescribed(system, scale, track.q, at))))(looks)
    moved = jnp.maximum(jnp.max(jnp.abs(ahead)), h * jnp.max(prescribed)) / scale.size
    good = found.good & (moved <= _MOVED)
    good = good & jnp.all(jnp.isfinite(found.rate)) & (h * jnp.max(jnp.abs(found.rate)) <= 2 * _MOVED * scale.size)
    bend = jnp.where(h > tolerance_of(_SLIVER, h) * track.step, (found.rate - track.rate) / h, track.bend)
    step = jnp.maximum(jnp.where(jnp.isinf(track.step), 0.0, track.step), 2 * h)
    further = _Track(found.q, found.rate, bend, t, step)
    return chosen_of(good, further, track._replace(step=h / 2))


def _corrected(system: AbstractSystem, scale: Scaling, q: Array, t: Array) -> _Newton:
    settled = tolerance_of(_SETTLED, q)

    def step(now: _Newton) -> _Newton:
        matrix = scale.scaled(system.jacobian(now.q, t))
        residual = system.constraint(now.q, t) / scale.rows
        u, rate = -_least_squares(matrix, jnp.stack([residual, _prescribed(system, scale, now.q, t)], axis=1)).T
        size = jnp.max(jnp.abs(u)) / scale.size
        begins = now.steps == 0
        limit = jnp.where(begins, _CLOSE, jnp.maximum(_CONTRACTS * now.last, settled))
        q, off = system.retract(now.q, scale.coordinates * u), jnp.max(jnp.abs(residual)) / scale.size
        return _Newton(q, rate, off, size, now.steps + 1, size <= limit)  # NaN is not

    def going(now: _Newton) -> Array:
        return now.good & (now.last > settled) & (now.steps < _CORRECTIONS)

    far, none = jnp.full((), jnp.inf, q.dtype), jnp.zeros(len(system.coordinates), q.dtype)
    end = jax.lax.while_loop(going, step, _Newton(q, none, far, far, jnp.zeros((), int), jnp.ones((), bool)))
    return end._replace(good=end.good & (end.last <= settled) & (end.off <= largest_violation(q.dtype)))


def _prescribed(system: AbstractSystem, scale: Scaling, q: Array, t: Array) -> Array:
    """Phi_t, scaled."""
    return jax.jvp(lambda t: system.constraint(q, t), (t,), (jnp.ones_like(t),))[1] / scale.rows


def _least_squares(matrix: Array, right: Array) -> Array:
    """By the normal equations, whose error the next step of Newton's method takes back."""
    factor = jnp.linalg.cholesky(matrix.T @ matrix)
    return jax.scipy.linalg.cho_solve((factor, True), matrix.T @ right)
