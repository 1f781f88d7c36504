"""Steps of a motion: how long they are, where they end, and how they go on.

They go by the errors of verdicts, up to events of slips and contacts, and up to instants at which loads or drivers jump
or bend. There a step ends at the number before and the next begins at the one after, as in diffrax. Both move with the
instant in derivatives: so what comes after has those by it. Beyond either, steps go on as at first, however short the
last was.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import diffrax
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Float, PyTree

from .._tools._no_answer import without_derivative
from .._tools._numbers import are_numbers, chosen_of, stop_gradient
from ._moving import Moving
from ._scalars import Flag, Scalar
from ._slip import PAST, Plan, no_plan
from ._stiffness import is_worth
from ._touch import Hit, no_hit

# Part of a refused step before which an event found in it is none to aim at.
_AIMED = 0.01
# Times that a step is tried up to an instant ahead before it is halved: loads that jump have tangents that meet late.
_TRIES = 6
_ROUNDINGS = 8  # of an instant, below which a step has no room between two


class Verdict(NamedTuple):
    """What is told of a step, as numbers, in place of its error.

    - `size`: the error by the tolerance, infinite where the step may not end so.
    - `plan`: the event that it has passed; None where there are none.
    - `lands`, `rests`, `ends`: whether it ends at an event, at rest, and whether steps end there.
    - `shift`: how much later that event is.
    - `ahead`: until when the next step goes at most; `again` says that it goes there.
    - `hit`: the event of one-sided contacts that it has passed; None where there are none.
    - `stiff`: how many steps more are stiff than are not.
    """

    size: Array
    plan: Plan | None
    lands: Array
    rests: Array
    ends: Array
    shift: Array
    ahead: Array
    again: Array
    hit: Hit | None = None
    stiff: Array | float = 0.0


def _unused(*_: PyTree) -> None:
    """The vector field, which a first step that is given does not ask for."""


class Control(NamedTuple):
    """State of the controller: its own, how often the step is tried up to an instant ahead, and the event that ended
    the steps, one of slips or one of contacts."""

    inner: PyTree
    tries: Array
    plan: Plan | None
    hit: Hit | None = None


# Whether a step is taken, where the next begins and ends, whether it lands at an event, the state, and how it went.
Judged: TypeAlias = tuple[Flag, Scalar, Scalar, Flag, Control, diffrax.RESULTS]


class Controller(diffrax.AbstractAdaptiveStepSizeController):
    """Steps by the errors of verdicts, up to events, and from there on as at first.

    Where they end has no derivatives but at events: if all ends moved with the last event, a kink of a load in time
    would move through its step the other way, and derivatives be off by as much as one by the time of the kink is.
    """

    controller: diffrax.PIDController
    first: Float[Array, ""]
    end: Float[Array, ""]
    jumps: Float[Array, " jumps"] | None

    @property
    def rtol(self) -> Scalar:  # pyright: ignore
        return self.controller.rtol

    @property
    def atol(self) -> Scalar:  # pyright: ignore
        return self.controller.atol

    @property
    def norm(self) -> Callable[[Moving], Array]:  # pyright: ignore
        return size_of

    def wrap(self, direction: Scalar) -> "Controller":
        return self

    def init(
        self,
        terms: PyTree,
        t0: Scalar,
        t1: Scalar,
        y0: PyTree,
        dt0: Scalar | None,
        args: PyTree,
        func: Callable[..., PyTree],
        error_order: Scalar | None,
    ) -> tuple[Scalar, Control]:
        equations, begin = args[0], args[2]
        end, inner = self.controller.init(terms, t0, t1, y0, dt0, args, func, error_order)
        hit = None if equations.touch is None else no_hit(equations.touch, t0)
        control = Control(inner, jnp.zeros((), int), no_plan(begin.mode) if equations.has_sense else None, hit)
        return self.before_jump(stop_gradient(jnp.asarray(end)), t0), control

    def before_jump(self, end: Array, t: Scalar) -> Array:
        """An end of steps after a time, or the number before a jump that is earlier."""
        if self.jumps is None:
            return end
        before = _beside(self.jumps, -jnp.inf)
        return jnp.minimum(end, jnp.min(jnp.where(before > t, before, jnp.inf), initial=jnp.inf))

    def adapt_step_size(
        self,
        t0: Scalar,
        t1: Scalar,
        y0: PyTree,
        y1_candidate: PyTree,
        args: PyTree,
        y_error: PyTree,
        error_order: Scalar,
        controller_state: Control,
    ) -> Judged:
        zero = jnp.zeros_like(t1)
        told = zero, zero, args, y_error.size, error_order, controller_state.inner
        keep, t, following, _, inner, result = self.controller.adapt_step_size(t0, t1, *told)
        again = y_error.again > 0
        tries = jnp.where(again, controller_state.tries + 1, 0)
        half = jnp.where(tries > _TRIES, (t0 + t1) / 2, jnp.inf)
        y_error = y_error._replace(ahead=jnp.where(again, jnp.minimum(y_error.ahead, half), y_error.ahead))
        so_far = keep, t, following, False, controller_state._replace(inner=inner, tries=tries), result
        keep, t, following, lands, control, result = self._up_to_event(t0, t1, y_error, so_far)
        following = stop_gradient(jnp.asarray(following))
        if self.jumps is not None:
            at = stop_gradient(_beside(self.jumps, -jnp.inf)) == stop_gradient(t1)
            jumps = keep & jnp.any(at)
            t = jnp.where(jumps, _beside(self.jumps, jnp.inf)[jnp.argmax(at)], t)
            ahead = jnp.inf if control.plan is None else jnp.where(y_error.ahead > t, y_error.ahead, jnp.inf)
            following = jnp.where(jumps, stop_gradient(jnp.minimum(t + self.first, ahead)), following)
            short = jumps & (result == diffrax.RESULTS.dt_min_reached)
            result, lands = diffrax.RESULTS.where(short, diffrax.RESULTS.successful, result), lands | jumps
        if control.plan is not None or self.jumps is not None or args[0].bends:
            _, fresh = self.controller.init(None, t0, t1, zero, self.first, args, _unused, error_order)
            control = control._replace(inner=chosen_of(lands, fresh, inner))
        return keep, t, self.before_jump(following, t), lands, control, result

    def _up_to_event(self, t0: Scalar, t1: Scalar, verdict: Verdict, so_far: Judged) -> Judged:
        """The same, of which no step passes an event; one that ends there lands."""
        keep, t, following, lands, (inner, tries, plan, hit), result = so_far
        stiff = keep & is_worth(jnp.asarray(verdict.stiff), t1, t1 - t0, self.end)
        hits = None
        if verdict.hit is not None:
            found, hits = stop_gradient(verdict.hit), keep & jnp.isfinite(verdict.hit.time)
            hit = jax.tree.map(lambda a, b: jnp.where(hits, a.astype(b.dtype), b), found, hit)
        if verdict.plan is None:
            event = stiff if hits is None else hits | stiff
            if hits is not None:
                keep, t = keep & ~hits, jnp.where(hits, t0, t)
            following, lands = jnp.where(verdict.again > 0, verdict.ahead, following), keep & (verdict.lands > 0)
            following = jnp.where(lands, t + self.first, following)
            result = diffrax.RESULTS.where(event, diffrax.RESULTS.event_occurred, result)
            return keep, t, following, lands, Control(inner, tries, None, hit), result
        event = keep & jnp.isfinite(verdict.plan.time)
        event = event if hits is None else event | hits
        taken = keep & ~event
        lands = taken & (verdict.lands > 0)
        t = jnp.where(taken, t1 + verdict.shift, t0)
        again = verdict.again > 0
        # What is wrong beyond an event does not matter: a step that is refused is tried up to there, if that is less.
        goal = (1 + PAST) * verdict.plan.time - PAST * t0
        # One at its very start may be that of dense output which is off: a shorter step tells.
        aims = ~keep & (goal < t1 - 0.1 * (t1 - t0)) & (goal > t0 + _AIMED * (t1 - t0))
        following = jnp.where(
            aims, jnp.where(jnp.isfinite(verdict.size), jnp.minimum(following, goal), goal), following
        )
        following = jnp.where(again, verdict.ahead, jnp.minimum(following, verdict.ahead))
        following = jnp.where(lands, t + self.first, following)
        following = jnp.where(taken & (verdict.rests > 0), jnp.maximum(self.end, following), following)
        result = diffrax.RESULTS.where(lands | again, diffrax.RESULTS.successful, result)
        result = diffrax.RESULTS.where(
            event | (taken & ((verdict.ends > 0) | stiff)), diffrax.RESULTS.event_occurred, result
        )
        plan = jax.tree.map(lambda a, b: jnp.where(event, b.astype(a.dtype), a), plan, stop_gradient(verdict.plan))
        return taken, t, following, lands, Control(inner, tries, plan, hit), result


def told_apart(jumps: Float[Array, " jumps"]) -> Float[Array, " jumps"]:
    """The instants, without derivatives where two are one but for rounding: a step moves with one alone."""
    if are_numbers(jumps):
        return jumps
    fixed = stop_gradient(jumps)
    off = jnp.where(jnp.eye(fixed.size, dtype=bool), jnp.inf, jnp.abs(fixed[:, None] - fixed))
    near = _ROUNDINGS * jnp.finfo(fixed.dtype).eps * jnp.abs(fixed)
    return without_derivative(jnp.any(off <= near, axis=1), jumps)


def _beside(jumps: Float[Array, " jumps"], way: float) -> Float[Array, " jumps"]:
    """The numbers beside jumps, with the derivatives of these."""
    fixed = stop_gradient(jumps)
    return jumps + (jnp.nextafter(fixed, way) - fixed)


def size_of(error: Moving) -> Float[Array, ""]:
    """Root of the mean square of a step's errors; on a chart the largest, which coordinates that keep still do not
    dilute: in space most do."""
    return optx.rms_norm(error) if error.base is None else optx.max_norm(error)
