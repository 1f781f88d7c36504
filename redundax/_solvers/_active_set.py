"""Friction of many joints that stick or start to slip: what it causes is known by products alone.

The conditions are those of `_gauss_seidel`.

Each joint is held, alpha_j = 0, or at one of its limits. In turn

- friction of the joints that are held changes so that alpha is zero there, by the least that does it;
- a joint that is held by more than its limits goes to that limit, one that slips although it is held to the limit
  against its slip, and one at a limit that would slip the other way is held.

It ends where no joint changes, and limits follow the loads no further. Joints of which not all need be held could take
turns for ever. After some turns friction goes no further than the first limit that it meets, and where it meets none
one joint is held again, that which would slip most the other way: for given limits, what Gauss's principle makes least
does not rise.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .._equations._response import Response

_TURNS = 1000  # at most
_ROUNDING = 1e2  # of accelerations


class ActiveSet(NamedTuple):
    """Friction and what it causes, accelerations of the mechanism and of its slips, and whether they are found."""

    tau: Float[Array, " p"]
    caused: Response
    acceleration: Float[Array, " p"]
    settled: Bool[Array, ""]


class _Turn(NamedTuple):
    """Where it is: `side` is -1 of joints at their lower limit, 1 at the upper, 0 of those that are held; whether it is
    their turn, whether friction last changed as much as it should, and whether all is finite."""

    found: ActiveSet
    side: Float[Array, " p"]
    holds: Bool[Array, ""]
    whole: Bool[Array, ""]
    finite: Bool[Array, ""]
    turns: Int[Array, ""]


class Effects(NamedTuple):
    """What friction does, as functions of it.

    - `caused`: what it causes, and A tau.
    - `limits`: lo and hi at the multipliers that it causes.
    - `hold`: the least of some joints that gives them accelerations, known to a rounding as lengths.
    """

    caused: Callable[[Float[Array, " p"]], tuple[Response, Float[Array, " p"]]]
    limits: Callable[[Float[Array, " m"]], tuple[Float[Array, " p"], Float[Array, " p"]]]
    hold: Callable[[Bool[Array, " p"], Float[Array, " p"], Float[Array, ""]], Float[Array, " p"]]


def active_set(
    effects: Effects,
    free: Float[Array, " p"],
    still: Bool[Array, " p"],
    sizes: Float[Array, " p"],
    tolerance: tuple[float, float],
    wanted: Bool[Array, ""],
    at_once: int = 40,
) -> ActiveSet:
    """Friction of the conditions above; none where it is not wanted.

    **Arguments:**

    - `free`: alpha_0.
    - `still`: joints that may be held; of the others lo is hi.
    - `sizes`: the lengths by which slips are made lengths.
    - `tolerance`: of accelerations that are zero, relative to the largest sum of their parts, and of friction, to the
      largest limit.
    - `at_once`: turns in which all joints change that ask for it.
    """
    (caused, limits, hold), (zero, enough) = effects, tolerance

    def turn(now: _Turn) -> _Turn:
        tau = now.found.tau
        response, change = caused(tau)
        alpha = free + change
        low, high = limits(response.multipliers)
        size = jnp.max(jnp.maximum(jnp.abs(low), jnp.abs(high)) / sizes)
        parts = size_of_parts(jnp.abs(free) + jnp.abs(change), sizes, still, zero)
        slips = jnp.abs(alpha) * sizes > zero * parts
        least, is_held, slow = enough * size * sizes, now.side == 0, now.turns >= at_once
        meets = slow & (high - low > 4 * least)  # limits that are apart
        margin = jnp.where(meets, -least, least)
        beyond = (tau > high + margin) * 1.0 - (tau < low - margin)
        held = jnp.where(beyond != 0, beyond, jnp.where(slips & now.whole, -jnp.sign(alpha), 0.0))
        back = jnp.where(slips & (now.side * alpha > 0) & still, jnp.abs(alpha) * sizes, 0.0)
        back = jnp.where(slow, (back == jnp.max(back)) & now.whole, True) & (back > 0)
        asked = jnp.where(is_held, held, jnp.where(back, 0.0, now.side))
        at = jnp.where(asked < 0, low, jnp.where(asked > 0, high, tau))
        stays = (asked == now.side) & (jnp.abs(at - tau) <= least) & jnp.isfinite(alpha)
        settled = ~now.holds & now.whole & jnp.all(stays)
        holds = now.holds & jnp.any(is_held & (jnp.abs(alpha) * sizes > enough * parts))
        more = jax.lax.cond(
            holds, lambda: hold(is_held, jnp.where(holds, -alpha, 0.0), enough * parts), lambda: jnp.zeros_like(tau)
        )
        part = _part_within(tau, more, low, high, is_held & meets)
        after = jnp.where(now.holds, tau + part * more, jnp.where(settled, tau, at))
        side, whole = jnp.where(now.holds, now.side, asked), jnp.where(now.holds, part == 1, now.whole)
        return _Turn(
            ActiveSet(after, response, alpha, settled),
            side,
            ~now.holds,
            whole,
            jnp.all(jnp.isfinite(after + alpha)),
            now.turns + 1,
        )

    none, true = jnp.zeros_like(free), jnp.ones((), bool)
    nothing = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(caused, none)[0])
    begin = _Turn(
        ActiveSet(none, nothing, free, ~true), jnp.where(still, 0.0, 1.0), true, true, true, jnp.zeros((), int)
    )
    return jax.lax.while_loop(
        lambda now: wanted & ~now.found.settled & now.finite & (now.turns < _TURNS), turn, begin
    ).found


def _part_within(tau: Array, more: Array, low: Array, high: Array, counted: Array) -> Float[Array, ""]:
    """How much of a change of friction some joints can take."""
    room = jnp.where(more > 0, high - tau, low - tau) / jnp.where(more == 0, 1.0, more)
    return jnp.clip(jnp.min(jnp.where(counted & (more != 0), room, 1.0)), 0.0, 1.0)


def size_of_parts(
    parts: Float[Array, " p"], sizes: Float[Array, " p"], still: Bool[Array, " p"], zero: float
) -> Float[Array, ""]:
    """The largest of joints that may be held, as a length, of which a part `zero` is none; beside much larger ones of
    other joints at least their rounding."""
    rounding = _ROUNDING * float(jnp.finfo(parts.dtype).eps) / zero
    return jnp.max(parts * sizes * jnp.where(still, 1.0, rounding))
