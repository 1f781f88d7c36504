"""Steps that end at instants at which loads or drivers jump or bend, and go on beyond.

A step ends at the number before such an instant and the next begins at the one after, as in diffrax. Both move with the
instant in derivatives: so what comes after has those by it. Steps go on as at first, however short the last was.
"""

from typing import Any

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from .._tools._no_answer import without_derivative
from .._tools._numbers import are_numbers, stop_gradient
from ._stepper import Controller

_ROUNDINGS = 8  # of an instant, below which a step has no room between two


class Jumping(diffrax.AbstractAdaptiveStepSizeController):
    """A controller whose steps end at jumps."""

    controller: Controller
    jumps: Float[Array, " jumps"]

    @property
    def rtol(self) -> Any:  # pyright: ignore
        return self.controller.rtol

    @property
    def atol(self) -> Any:  # pyright: ignore
        return self.controller.atol

    @property
    def norm(self) -> Any:  # pyright: ignore
        return self.controller.norm

    def wrap(self, direction: Any) -> "Jumping":
        return self

    def init(
        self, terms: PyTree, t0: Any, t1: Any, y0: PyTree, dt0: Any, args: PyTree, func: Any, error_order: Any
    ) -> tuple[Any, PyTree]:
        end, state = self.controller.init(terms, t0, t1, y0, dt0, args, func, error_order)
        return jnp.minimum(end, next_jump(self.jumps, t0)), state

    def adapt_step_size(
        self,
        t0: Any,
        t1: Any,
        y0: PyTree,
        y1_candidate: PyTree,
        args: PyTree,
        y_error: PyTree,
        error_order: Any,
        controller_state: PyTree,
    ) -> tuple[Any, ...]:
        told = y1_candidate, args, y_error, error_order, controller_state
        keep, t, following, made_jump, state, result = self.controller.adapt_step_size(t0, t1, y0, *told)
        first = self.controller.first
        at = stop_gradient(_beside(self.jumps, -jnp.inf)) == stop_gradient(t1)
        jumped = keep & jnp.any(at)
        t = jnp.where(jumped, _beside(self.jumps, jnp.inf)[jnp.argmax(at)], t)
        _, fresh = self.controller.init(None, t0, t1, None, first, args, None, error_order)
        state = jax.tree.map(lambda a, b: jnp.where(jumped, a, b), state._replace(inner=fresh.inner), state)
        following = jnp.where(jumped, stop_gradient(t + first), following)
        short = jumped & (result == diffrax.RESULTS.dt_min_reached)
        result = diffrax.RESULTS.where(short, diffrax.RESULTS.successful, result)
        return keep, t, jnp.minimum(following, next_jump(self.jumps, t)), made_jump | jumped, state, result


def told_apart(jumps: Float[Array, " jumps"]) -> Float[Array, " jumps"]:
    """The instants, without derivatives where two are one but for rounding: a step moves with one alone."""
    if are_numbers(jumps):
        return jumps
    fixed = stop_gradient(jumps)
    off = jnp.where(jnp.eye(fixed.size, dtype=bool), jnp.inf, jnp.abs(fixed[:, None] - fixed))
    near = _ROUNDINGS * jnp.finfo(fixed.dtype).eps * jnp.abs(fixed)
    return without_derivative(jnp.any(off <= near, axis=1), jumps)


def next_jump(jumps: Float[Array, " jumps"], t: Array) -> Array:
    """The number before the first jump after a time; infinite if there is none."""
    before = _beside(jumps, -jnp.inf)
    return jnp.min(jnp.where(before > t, before, jnp.inf), initial=jnp.inf)


def _beside(jumps: Float[Array, " jumps"], way: float) -> Float[Array, " jumps"]:
    """The numbers beside jumps, with the derivatives of these."""
    fixed = stop_gradient(jumps)
    return jumps + (jnp.nextafter(fixed, way) - fixed)
