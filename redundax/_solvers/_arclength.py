"""Pseudo-arclength continuation of a curve H(x) = 0, x = (y, s), from s = 0 until it arrives at s = 1 or ends.

    predictor  x_p = x + step t,   corrector  H(x) = 0,  t^T (x - x_p) = 0,   [H_x; t^T] dx = -[H; t^T (x - x_p)]

t is the unit tangent; the matrix [H_x; t^T] stays regular where the curve folds. Past a fold the curve is followed on:
it may turn again, or return to s = 0. A fold, where s is largest, is passed in a step so short that the tangents at its
ends intersect there to 1e-9; so no solution just below a fold at s > 1 is stepped over.
"""

from collections.abc import Callable
from typing import NamedTuple

from jaxtyping import Array, Bool, Float, Int

from .._tools._numbers import Numeric, chosen_of, fori_loop, solution, while_loop, xp

_FIRST, _LONGEST, _SHORTEST = 0.05, 1e3, 1e-9  # arclength steps, for y of size 1
_CORRECTIONS = 4
_STRAIGHT = 0.98  # least cosine between tangents of accepted steps, but for steps so short that it is a kink:
_KINK = 1e-5  # relative to 1 + |x|; folds too are passed in such steps
_FAR = 1e9  # |y| that counts as infinite


class Path(NamedTuple):
    """A point of the curve and how it was reached.

    - `here`, `tangent`: x = (y, s), d numbers, and the unit tangent there, shape (d,).
    - `step`: length of the next step.
    - `fold`: largest s so far.
    - `before_fold`: point of the curve before its last fold.
    - `steps`: steps done.
    - `arrived`, `returned`: whether it ended at s = 1, or at s = 0 again.
    - `ended`: whether it ended anywhere else: far away, or where no step is short enough.
    """

    here: Float[Array, "... d"]
    tangent: Float[Array, "... d"]
    step: Float[Array, "..."]
    fold: Float[Array, "..."]
    before_fold: Float[Array, "... d"]
    steps: Int[Array, "..."]
    arrived: Bool[Array, "..."]
    returned: Bool[Array, "..."]
    ended: Bool[Array, "..."]


def bordered_matrix(slope: Float[Array, "... e d"], row: Float[Array, "... d"]) -> Float[Array, "... d d"]:
    """[H_x; row]."""
    return xp.concatenate([slope, row[..., None, :]], axis=-2)


def follow(
    equations: Callable[[Float[Array, "... d"]], tuple[Float[Array, "... e"], Float[Array, "... e d"]]],
    start: Float[Array, "... d"],
    direction: Float[Array, "... d"],
    wanted: Bool[Array, "..."],
    max_path: int,
) -> Path:
    """The curve from `start` at s = 0 along `direction`, in which s grows; nothing where it is not wanted.

    `equations` are H and H_x; y should be of size 1.
    """

    def advance(path: Path) -> Path:
        guess = path.here + path.step[..., None] * path.tangent

        def correct(_: Numeric, carry: tuple[Array, Array]) -> tuple[Array, Array]:
            x, _ = carry
            (residual, slope), beside = equations(x), xp.sum(path.tangent * (x - guess), axis=-1, keepdims=True)
            off = xp.concatenate([residual, beside], axis=-1)
            change = solution(bordered_matrix(slope, path.tangent), off)
            return x - change, change

        x, change = fori_loop(0, _CORRECTIONS, correct, (guess, guess))
        last = xp.zeros_like(x) + (xp.arange(x.shape[-1]) == x.shape[-1] - 1)
        tangent = solution(bordered_matrix(equations(x)[1], path.tangent), last)
        tangent = tangent / _size(tangent)[..., None]
        reach = 1 + _size(x)
        close = _size(change) <= xp.minimum(1e-6 * reach, 0.1 * path.step)
        close = close & (_size(x - guess) <= 0.5 * path.step)
        turn = xp.sum(tangent * path.tangent, axis=-1)
        good = close & (turn > xp.where(path.step > _KINK * reach, _STRAIGHT, 0.0))
        inside = (x[..., -1] > 0) & (x[..., -1] < 1)
        good = good & (inside | (path.step <= _FIRST * reach))  # short steps end it, so that interpolation is near
        return _accepted(path, x, tangent, turn, good, reach)

    def going(path: Path) -> Array:
        return wanted & ~path.arrived & ~path.returned & ~path.ended & (path.steps < max_path)

    one = start.shape[:-1]
    begin = Path(
        here=start,
        tangent=direction / _size(direction)[..., None],
        step=xp.full(one, _FIRST, start.dtype),
        fold=xp.zeros(one, start.dtype),
        before_fold=start,
        steps=xp.zeros(one, int),
        arrived=xp.zeros(one, bool),
        returned=xp.zeros(one, bool),
        ended=~xp.all(xp.isfinite(start), axis=-1) | ~xp.all(xp.isfinite(direction), axis=-1),
    )
    return while_loop(going, advance, begin)


def _size(x: Float[Array, "... d"]) -> Float[Array, "..."]:
    return xp.linalg.norm(x, axis=-1)


def _accepted(path: Path, x: Array, tangent: Array, turn: Array, good: Array, reach: Array) -> Path:
    """The path after a step to x; with half the step where x is not good, and a step to the fold where x is beyond."""
    s0, s1, slope0, slope1 = path.here[..., -1], x[..., -1], path.tangent[..., -1], tangent[..., -1]
    turned = good & (slope0 > 0) & (slope1 <= 0)
    passed = turned & (path.step <= _KINK * reach)
    good = good & (passed | ~turned)
    arrived, returned = good & (s1 >= 1), good & (s1 <= 0)
    beyond = arrived | returned
    share = xp.where(beyond, (arrived - s0) / xp.where(beyond, s1 - s0, 1.0), 1.0)
    here = chosen_of(good, path.here + share[..., None] * (x - path.here), path.here)
    top = s0 + slope0 * (turn * (s1 - s0) - path.step * slope1) / xp.where(passed, turn * slope0 - slope1, 1.0)
    fold = xp.maximum(path.fold, xp.where(passed, xp.maximum(top, s0), here[..., -1]))
    to_fold = path.step * slope0 / xp.where(turned, slope0 - slope1, 1.0)  # where s is a parabola
    step = path.step * xp.where(good, xp.where(turn > 0.5 * (1 + _STRAIGHT), 2.0, 1.0), 0.5).astype(turn.dtype)
    step = xp.where(turned, xp.maximum(0.99 * to_fold, 0.5 * _KINK * reach), step)
    step = xp.where(passed, _FIRST * reach, step)
    far = _size(here)
    return Path(
        here=here,
        tangent=chosen_of(good, tangent, path.tangent),
        step=xp.minimum(step, _LONGEST * (1 + far)),
        fold=fold,
        before_fold=chosen_of(passed, path.here, path.before_fold),
        steps=path.steps + 1,
        arrived=arrived,
        returned=returned,
        ended=(far > _FAR) | (step < _SHORTEST * (1 + far)),
    )
