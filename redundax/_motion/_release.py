"""The first moments after joints with several slips and one friction are let go by loads that change.

With the velocity w of their surfaces, 0 at the release and 0 its rate of change, the motion is

    y' = f(t, y, w),   w' = F(t, y, w),   w(t0) = 0,   F(t0) = 0

where friction turns w at a rate of mu N / (m |w|), which nothing bounds as w begins. But one solution leaves w = 0, and
it is smooth: w goes where the loads pull, turned by what the friction gives way. It is found by collocation, by one
polynomial over a span of time h whose slopes meet the equations at its start, its end and between (Lobatto),

    y_i = y_0 + h sum_j a_ij f_j,   w_i = h sum_j a_ij F_j

by Newton's method on the w_i, which alone are stiff, dw = (1 - h a dF/dw)^-1 (h a F - w); the rest follows by
iteration. The error falls with the last terms of the slopes; h does until these are below the tolerance, and no other
event is passed. Ordinary steps go on from there, where friction turns the slip at a rate that h bounds.

Derivatives pass the iteration at the h and the inverse found, which they do not change. Where no h is found the motion
goes on from the release by ordinary steps, and derivatives, which they lose, are NaN.
"""

from typing import NamedTuple, cast

import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from numpy.polynomial import legendre

from .._system._directions import Directions
from .._tools._module import batch_any, stop_gradient, without_derivative
from ._moving import Context, Equations, Moving, rechart, tolerance_of
from ._project import project
from ._slip import has_event
from ._stick import Mode

# Nodes after the first; iterations, and spans that are tried.
_NODES, _SWEEPS, _SPANS = 8, 10, 12
# Change of slip, relative to it, after which the iteration has settled, at least so many roundings.
_SETTLED = 1e-9, 1e4


def _lobatto(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes in [-1, 1] with both ends, coefficients in Legendre polynomials by values there, and powers of their
    integrals from -1."""
    last = np.eye(count + 1)[count]
    nodes = np.concatenate([[-1.0], np.sort(legendre.legroots(legendre.legder(last)).real), [1.0]])
    values = np.linalg.inv(legendre.legvander(nodes, count))
    powers = np.zeros((count + 2, count + 1))
    for k, one in enumerate(np.eye(count + 1)):
        whole = legendre.leg2poly(legendre.legint(one, lbnd=-1))
        powers[: whole.size, k] = whole
    return nodes, values, powers @ values


_AT, _VALUES, _INTEGRALS = _lobatto(_NODES)
# Twice a, nodes as parts of the span, and the last coefficients.
_TABLEAU, _TIMES, _LAST = np.vander(_AT, _NODES + 2, increasing=True) @ _INTEGRALS, (_AT + 1) / 2, _VALUES[-2:]


class Release(NamedTuple):
    """When and where joints let go set out: which, and what stays the same for a while."""

    equations: Equations
    t: Array
    y: Moving
    context: Context
    joints: Bool[Array, " p"]


class Onward(NamedTuple):
    """How it goes on: from when, where and how; and the path up to there at the times asked for."""

    t: Array
    y: Moving
    sense: Float[Array, " p"]
    path: Moving


class _Found(NamedTuple):
    """A span h, f and w at its nodes, the inverse of Newton's method; the error by the tolerance, and whether all is
    good."""

    span: Array
    slopes: Float[Array, "nodes size"]
    rates: Float[Array, "nodes p"]
    inverse: Float[Array, "unknowns unknowns"]
    error: Array
    good: Bool[Array, ""]


def set_out(release: Release, mode: Mode, end: Array, ts: Float[Array, " times"], tolerance: Array) -> Onward:
    """The motion from a release of joints with several slips on, for a while; as it is where there is none."""
    t, y, joints = release.t, release.y, release.joints
    release = release._replace(
        equations=release.equations.with_sense(mode.sense),
        context=release.context._replace(along=jax.lax.stop_gradient(mode.sense)),
    )

    none = Onward(t, y, mode.sense, jax.tree.map(lambda x: jnp.broadcast_to(x, (ts.size, *x.shape)), y))
    return jax.lax.cond(batch_any(jnp.any(joints)), lambda: _begun(release, end, ts, tolerance), lambda: none)


def _begun(release: Release, end: Array, ts: Float[Array, " times"], tolerance: Array) -> Onward:
    equations, t, y, _, joints = release
    found = _longest(stop_gradient(release), jax.lax.stop_gradient(end), tolerance)
    flat, unravel = jax.flatten_util.ravel_pytree(y)

    def sweep(carry: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], None]:
        slopes, slip = _slopes(release, found.span, *carry)
        return (slopes, carry[1] + _correction(found.inverse, found.span, slip, carry[1])), None

    (slopes, rates), _ = jax.lax.scan(sweep, (found.slopes, found.rates), None, length=_SWEEPS)
    at = 2 * (ts - t) / jnp.where(found.span > 0, found.span, 1.0) - 1
    weights = jnp.vander(jnp.where(jnp.abs(at) < 1.1, at, 0.0), _NODES + 2, increasing=True) @ jnp.asarray(_INTEGRALS, flat.dtype)
    path = jax.vmap(unravel)(flat + found.span / 2 * weights @ slopes)
    then = jnp.where(found.span < end - t, t + found.span, jnp.where(found.good, end, t))
    goes, lost = jnp.any(joints) & found.good, jnp.any(joints) & ~found.good
    there = jax.tree.map(lambda a, b: jnp.where(goes, a, b), _last(release, found.span, slopes), y)
    then, there = jax.tree.map(lambda x: without_derivative(lost, x), (then, there))
    return Onward(then, there, jnp.where(goes, _turned(release, rates[-1]), equations.sense), path)


def _turned(release: Release, rates: Float[Array, " p"]) -> Float[Array, " p"]:
    """The senses, of joints let go the directions of w."""
    directions = cast(Directions, release.equations.directions)
    return jnp.where(release.joints, directions.unit(directions.arms * rates), release.equations.sense)


def _last(release: Release, span: Array, slopes: Float[Array, "nodes size"]) -> Moving:
    """y at the end of a span."""
    (equations, t, y, context, _), (flat, unravel) = release, jax.flatten_util.ravel_pytree(release.y)
    y = unravel(flat + span / 2 * jnp.asarray(_TABLEAU[-1], flat.dtype) @ slopes)
    return project(equations.system, t + span, rechart(equations.system, y)[0], context.held)


def _slopes(
    release: Release, span: Array, slopes: Float[Array, "nodes size"], rates: Float[Array, "nodes p"]
) -> tuple[Float[Array, "nodes size"], Float[Array, "nodes p"]]:
    """f, and F of joints let go, at all nodes by f there before and w."""
    (equations, t, _, context, joints), (flat, unravel) = release, jax.flatten_util.ravel_pytree(release.y)

    def node(t: Array, flat: Array, rate: Array) -> tuple[Array, Array]:
        slope, slip, _ = equations.instant(t, unravel(flat), context, felt=(joints, rate))
        return jax.flatten_util.ravel_pytree(slope)[0], jnp.where(joints, slip, 0.0)

    there = flat + span / 2 * jnp.asarray(_TABLEAU, flat.dtype) @ slopes
    slopes, slip = jax.vmap(node)(t + span * jnp.asarray(_TIMES, flat.dtype), there, rates)
    return slopes, slip.at[0].set(0.0)


def _correction(
    inverse: Float[Array, "unknowns unknowns"],
    span: Array,
    slip: Float[Array, "nodes p"],
    rates: Float[Array, "nodes p"],
) -> Float[Array, "nodes p"]:
    """dw, by the inverse in units of the squares of times since the release."""
    squares = jnp.asarray(_TIMES[1:, None] ** 2, slip.dtype)
    off = (span / 2 * jnp.asarray(_TABLEAU, slip.dtype) @ slip - rates)[1:] / squares
    return jnp.zeros_like(rates).at[1:].set((inverse @ off.ravel()).reshape(off.shape) * squares)


def _longest(release: Release, end: Array, tolerance: Array) -> _Found:
    """The longest of some spans over which the polynomial is as good as the tolerance, and no other event is passed."""
    (equations, t, y, _, joints), zero = release, jnp.zeros_like(release.t)
    size, wanted = jax.flatten_util.ravel_pytree(y)[0].size, jnp.any(joints)
    slopes, rates = (jnp.zeros((_NODES + 1, size), t.dtype) for size in (size, joints.size))
    none = _Found(zero, slopes, rates, jnp.eye(_NODES * joints.size, dtype=t.dtype), zero, ~wanted)

    def attempt(carry: tuple[_Found, Array]) -> tuple[_Found, Array]:
        before, count = carry
        shrink = 0.8 * jnp.where(before.error > 1, before.error, 1.0) ** (-1 / _NODES)
        shrink = jnp.where(count > 0, jnp.clip(jnp.where(jnp.isfinite(shrink), shrink, 0.0), 0.1, 0.5), 1.0)
        return _over(release, none._replace(span=before.span * shrink), tolerance), count + 1

    span = jnp.minimum(end - t, equations.scaling.size / equations.speed)
    begin = none._replace(span=jnp.where(wanted, span, zero)), jnp.zeros((), int)
    found, _ = jax.lax.while_loop(lambda carry: ~carry[0].good & (carry[1] < _SPANS), attempt, begin)
    return jax.tree.map(lambda a, b: jnp.where(found.good, a, b), found, none._replace(good=found.good))


def _over(release: Release, given: _Found, tolerance: Array) -> _Found:
    """What is found over a span."""
    (equations, _, y, _, joints), span = release, given.span
    directions, tableau = cast(Directions, equations.directions), jnp.asarray(_TABLEAU, span.dtype)
    sizes, unknowns = _sizes(equations, y), given.inverse.shape[0]
    squares = np.repeat(_TIMES[1:] ** 2, joints.size)
    ratio = jnp.asarray(squares / squares[:, None], span.dtype)
    every = jnp.broadcast_to(jnp.eye(joints.size)[:, None], (joints.size, *given.rates.shape))

    def surface(rates: Array) -> Array:
        return jnp.linalg.norm(jnp.where(joints, directions.arms * rates, 0.0), axis=1)[1:]

    def sweep(carry: tuple[_Found, Array], count: Array) -> tuple[tuple[_Found, Array], None]:
        before, _ = carry

        def told(rates: Array) -> tuple[Array, Array]:
            return _slopes(release, span, before.slopes, rates)[::-1]

        slip, changes, slopes = jax.vmap(
            lambda one: jax.jvp(told, (before.rates,), (one,), has_aux=True), out_axes=(None, 0, None)
        )(every)
        coupled = span / 2 * tableau[1:, None, 1:, None] * jnp.moveaxis(changes[:, 1:], 0, 2).swapaxes(0, 1)
        inverse = jnp.linalg.inv(jnp.eye(unknowns, dtype=span.dtype) - coupled.reshape(unknowns, unknowns) * ratio)
        along = jax.vmap(lambda v: directions.along(v, equations.sense))(span / 2 * tableau @ slip)
        straight = jnp.where(joints, along * equations.sense / directions.arms, 0.0)
        rates = jnp.where(count == 0, straight, before.rates + _correction(inverse, span, slip, before.rates))
        turned = jnp.max(surface(rates - before.rates) / surface(rates)) / tolerance_of(_SETTLED, span)
        moved = span * jnp.max(jnp.abs(slopes - before.slopes) / sizes) / tolerance
        off = jnp.maximum(turned, moved)
        return (before._replace(slopes=slopes, rates=rates, inverse=inverse), off), None

    (found, off), _ = jax.lax.scan(sweep, (given, jnp.zeros_like(span)), jnp.arange(_SWEEPS))
    error = span * jnp.max(jnp.abs(jnp.asarray(_LAST, span.dtype) @ found.slopes) / sizes) / tolerance
    none = jnp.any(equations.is_none(found.rates[1]) & joints)
    good = (off <= 1) & (error <= 1) & ~none & ~_passes_event(release, found)
    return found._replace(error=error, good=good)


def _passes_event(release: Release, found: _Found) -> Bool[Array, ""]:
    """Whether another event has happened by the end."""
    _, t, _, context, _ = release
    state = _last(release, found.span, found.slopes).at(t + found.span)
    turned = _turned(release, found.rates[-1])
    equations = release.equations.with_sense(turned)
    return has_event(equations, state, equations.linear(state, context.held, closed=equations.loaded), turned)


def _sizes(equations: Equations, y: Moving) -> Float[Array, " size"]:
    """Sizes of velocities and internal states, of which errors are relative; infinite of the rest, that follows."""
    sizes = jax.tree.map(lambda x: jnp.full_like(x, jnp.inf), y)
    memory = [
        jax.tree.map(jnp.broadcast_to, group.memory_size(), jax.tree.map(jnp.shape, own)) if own is not None else None
        for own, group in zip(y.memory, equations.system.friction, strict=True)
    ]
    sizes = sizes._replace(qd=equations.speed * equations.scaling.coordinates, memory=memory)
    return jax.flatten_util.ravel_pytree(sizes)[0]
