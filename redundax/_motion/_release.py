"""The first moments after joints with several slips and one friction are let go by loads that change.

With the slip rates w, of joints let go 0 at the release t0 as their rates of change are, the motion is

    y' = f(t, y, w),   w' = F(t, y, w),   w(t0) = w0

where friction turns w at a rate of mu N / (m |w|), which nothing bounds as w begins. But one solution leaves w = 0, and
it is smooth: w goes where the loads pull, turned by what the friction gives way. It is found by collocation, by one
polynomial over a span of time h whose slopes meet the equations at its start, its end and between (Lobatto),

    y_i = y0 + h sum_j a_ij f_j,   w_i = w0 + h sum_j a_ij F_j

by Newton's method on the w_i, which alone are stiff, dw = (1 - h a dF/dw)^-1 (w0 + h a F - w); the rest follows by
iteration. h is as long as the last terms of the slopes are below the tolerance, and no other event is passed. Where
friction still turns slips at a rate far above 1 / h, as of feet that are let go one after the other, or one near to
what the others turn about, the next span begins there. Ordinary steps go on from where they are as long.

Where loads just reach what friction holds, slips begin at the t0 and along the w at which F(t0, y, w) = 0. With l of
the left null space, l F_w = 0, t0 is a root of l F, however w turns beside it: so it has its derivative (`_at_limit`).

Derivatives pass the iteration at the h and the inverse found, which do not change its end. Where no h is found the
motion goes on from the release by ordinary steps, and derivatives, which they lose, are NaN.
"""

from typing import NamedTuple, cast

import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree
from numpy.polynomial import legendre

from .._system._directions import Directions
from .._tools._module import batch_any
from .._tools._no_answer import without_derivative
from .._tools._numbers import chosen_of, or_one, stop_gradient, tolerance_of
from ._linear import Linear, least_friction
from ._moving import NONE, Context, Equations, Moving, rechart
from ._project import project
from ._slip import has_event
from ._touch import margins

# Degree of the slopes, iterations, spans that are tried, and that follow each other.
_DEGREE, _SWEEPS, _SPANS, _FOLLOW = 8, 10, 16, 20
# Rate at which friction turns slips, by a span, from which ordinary steps would be many; and by what spans may grow.
_STIFF, _GROWS = 30.0, 4.0
# Accelerations from which iterations for slips that begin do, relative to those of the mechanism: directions settle at
# once where these are less than what comes out, but not so little that rounding of friction across them counts.
_SLOW = 1e-9
# Least tolerance, in roundings.
_ROUNDINGS = 100.0
# Newton's steps to a limit; slips there, in those that count as none; what slip accelerations miss there at most, as a
# part of what they are made of; what makes ways of joints alike where slips do not tie them together; and by how much
# it may be sooner or later, in times that the mechanism takes for its own length.
_TURNS, _FELT, _AGREES, _ALIKE, _SOON = 4, 1e4, (1e-8, 1e3), 1e-10, 1e-3


def _lobatto(degree: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes in [-1, 1] with both ends; coefficients in Legendre polynomials, and powers of integrals from -1, by values
    there."""
    within = legendre.legroots(legendre.legder(np.eye(degree + 1)[degree]))
    nodes = np.concatenate([[-1.0], np.sort(within.real), [1.0]])
    coefficients = np.linalg.inv(legendre.legvander(nodes, degree))
    integrals = [legendre.leg2poly(legendre.legint(values, lbnd=-1)) for values in coefficients.T]
    return nodes, coefficients, np.array(integrals).T


_NODES, _COEFFICIENTS, _INTEGRALS = _lobatto(_DEGREE)
# As parts of the span: times of the nodes, and a.
_TIMES, _WEIGHTS = (_NODES + 1) / 2, np.vander(_NODES, _DEGREE + 2, increasing=True) @ _INTEGRALS / 2
# The slope at the end by values at the nodes.
_SLOPE = 2 * np.array([legendre.legval(1.0, legendre.legder(values)) for values in _COEFFICIENTS.T])


class Release(NamedTuple):
    """When and where joints are let go: which, what stays the same for a while, and whether loads just reach what
    friction holds; else slips begin with accelerations of their own. Slip rates, and their slopes as if still held."""

    equations: Equations
    t: Array
    y: Moving
    context: Context
    joints: Bool[Array, " p"]
    touches: Bool[Array, ""]
    rate: Float[Array, " p"]
    slip: Float[Array, " p"]

    @property
    def slides(self) -> Bool[Array, " p"]:
        """Which slips are of surfaces that slide in several directions."""
        directed = cast(Directions, self.equations.directions).directed
        return directed & self.equations.may_stick & ~self.equations.sticking


class Onward(NamedTuple):
    """From when and where the motion goes on, in which senses; and the path up to there at the times asked for."""

    t: Array
    y: Moving
    sense: Float[Array, " p"]
    path: Moving


class _Course(NamedTuple):
    """A span h, f and w at its nodes, and the inverse of Newton's method; the error by the tolerance, and the rate at
    which friction turns slips at the end."""

    span: Array
    slopes: Float[Array, "nodes size"]
    rates: Float[Array, "nodes p"]
    inverse: Float[Array, "unknowns unknowns"]
    error: Array
    turning: Array


class _Guess(NamedTuple):
    """Where a span begins: how long it may be, and slip rates and their slopes from which iterations begin."""

    span: Array
    rates: Float[Array, " p"]
    slopes: Float[Array, " p"]


def set_out(release: Release, end: Array, ts: Float[Array, " times"], tolerance: Array) -> Onward:
    """The motion from a release on, for a while; where it is if there is none."""
    if len(cast(Directions, release.equations.directions).joints) > 1:  # one goes against what holds it, known there
        release = jax.lax.cond(batch_any(release.touches), lambda: _at_limit(release, end), lambda: release)
    t, y, directions = release.t, release.y, cast(Directions, release.equations.directions)
    path = jax.tree.map(lambda x: jnp.broadcast_to(x, (ts.size, *x.shape)), y)
    tolerance = jnp.maximum(tolerance, _ROUNDINGS * jnp.finfo(t.dtype).eps)
    arms, equations = directions.arms, release.equations
    slow = _SLOW * equations.speed**2 / equations.scaling.size / directions.reach(equations.slip_size)
    slopes = jnp.where(release.joints, slow * equations.sense / arms, jnp.where(release.touches, release.slip, 0.0))
    rates = jnp.where(release.joints, 0.0, release.rate)
    whole = jnp.minimum(end - t, equations.scaling.size / equations.speed)
    guess = stop_gradient(_Guess(whole, rates, slopes))

    def follow(_: int | Array, now: tuple[Release, PyTree, _Guess, Array]) -> tuple[Release, PyTree, _Guess, Array]:
        return jax.lax.cond(batch_any(now[-1]), lambda: _followed(*now, (end, ts, tolerance)), lambda: now)

    first = release, path, guess, jnp.any(release.joints)
    release, path, *_ = jax.lax.fori_loop(0, _FOLLOW, follow, first)
    return Onward(release.t, release.y, release.equations.sense, path)


def _followed(
    release: Release, path: PyTree, guess: _Guess, wanted: Array, given: tuple[Array, Array, Array]
) -> tuple[Release, PyTree, _Guess, Array]:
    """Where one more span ends, if it is wanted; the path with what lies in it, and whether the next one follows."""
    (end, ts, tolerance), (t, y, equations) = given, (release.t, release.y, release.equations)
    course = _longest(stop_gradient(release), guess, wanted, tolerance)
    course = jax.lax.fori_loop(0, _SWEEPS, lambda _, now: _swept(release, now, renews=False), course)
    goes = wanted & (course.error <= 1)
    then = jnp.where(course.span < end - t, t + course.span, end)
    states = _along(release, course, jnp.append(ts, then))
    there = rechart(equations.system, jax.tree.map(lambda x: x[-1], states))[0]
    there = project(equations.system, then, there, release.context.held)
    then, there = chosen_of(goes, (then, there), (t, y))
    then, there = jax.tree.map(lambda x: without_derivative(jnp.any(release.joints) & wanted & ~goes, x), (then, there))
    here = goes & (ts > t) & (ts <= then)
    path = chosen_of(here, jax.tree.map(lambda x: x[:-1], states), path)
    course = stop_gradient(course)
    sense = jnp.where(goes, _directions(release, course), equations.sense)
    onward = release._replace(
        equations=equations.with_sense(sense),
        t=then,
        y=there,
        context=release.context._replace(along=sense),
        joints=release.joints & False,
        touches=release.touches & False,
    )
    slope = jnp.asarray(_SLOPE, t.dtype) @ course.rates / jnp.where(goes, course.span, 1.0)
    follows = goes & (course.turning * course.span > _STIFF) & (then < stop_gradient(end))
    most = jnp.minimum(_GROWS * course.span, jax.lax.stop_gradient(end - then))
    return onward, path, _Guess(most, course.rates[-1], slope), follows


def _at_limit(release: Release, end: Array) -> Release:
    """The release at the instant at which loads reach what friction holds, with the directions in which slips begin.

    (t0, w) by Newton's method, where F does not change with the size of w:

        F + F_w dw + F' dt = 0,   c dw = 0,   c = K w / (w K w),   T = F_w + w c:   dt = -l F / (l F'),   l T = c

    with F' along the motion with joints held, and K the least friction by slips.
    """
    equations, joints, context = release.equations, release.joints, release.context
    directions, wanted = cast(Directions, equations.directions), joints & release.touches
    fixed, t, y, context = stop_gradient((equations, release.t, release.y, context))
    before = fixed.with_sense(jnp.where(joints, 0.0, fixed.sense))
    linear = cast(Linear, before.linear(y.at(t), context.held, closed=fixed.loaded))
    solved = before.solved(y.at(t), linear, context.tau, before.sense)
    change = before.change(y.at(t), y, linear.rate, solved)
    holds = least_friction(linear.yields, before.sticking & ~joints, fixed.slip_size)
    yields = linear.yields - linear.yields @ holds @ linear.yields  # with those held that stay so
    yields = jnp.where(joints[:, None] & joints, yields, 0.0)
    lacks = least_friction(yields, joints, fixed.slip_size)
    part = yields @ lacks
    pull = jnp.max((jnp.abs(linear.slip) + jnp.abs(linear.yields) @ jnp.abs(solved.tau)) * fixed.slip_size)
    pull = or_one(pull)
    size = _FELT * tolerance_of(NONE, t) * fixed.speed
    one = jnp.eye(joints.size, dtype=t.dtype)

    def slips(given: Equations, t: Array, y: Moving, way: Array) -> Array:
        felt = jnp.where(joints, size * way, linear.rate)
        return jnp.where(joints, given.instant(t, y, context, felt)[1], 0.0)

    def sized(way: Array) -> Array:
        return way / jnp.maximum(jnp.max(jnp.abs(way * fixed.slip_size)), jnp.finfo(t.dtype).tiny)

    def turn(_: int | Array, now: tuple[Array, ...]) -> tuple[Array, ...]:
        way = now[0]
        slip, moved = jax.linearize(lambda t, y, way: slips(fixed, t, y, way), t, y, way)
        still = jax.tree.map(jnp.zeros_like, y)
        rise = moved(jnp.ones_like(t), change, jnp.zeros_like(way))
        turns = jax.vmap(lambda unit: moved(jnp.zeros_like(t), still, unit), out_axes=1)(one) @ part
        power = lacks @ way / (way @ lacks @ way)
        inverse = jnp.linalg.inv(turns / pull + jnp.outer(way, power) @ part + one - part)
        weights = power @ part @ inverse
        shift = -(weights @ slip) / (weights @ rise)
        missed = slip + shift * rise
        return sized(way - inverse @ missed / pull), weights, rise, jnp.max(jnp.abs(missed * fixed.slip_size)) / pull

    begin = sized(_together(directions, fixed, joints, part))
    way, weights, rise, missed = jax.lax.fori_loop(0, _TURNS, turn, (begin, begin, begin, t))
    slope, most = weights @ rise, _SOON * fixed.scaling.size / fixed.speed
    late = -(weights @ slips(fixed, t, y, way)) / jnp.where(slope == 0, 1.0, slope)
    soon = (jnp.abs(late) <= most) & (t + late <= stop_gradient(end))
    found = jnp.any(wanted) & (missed <= tolerance_of(_AGREES, t)) & soon & (slope != 0)
    weights, slope = jnp.where(found, weights, 0.0), jnp.where(found, slope, 1.0)
    shift = -(weights @ slips(equations, release.t, release.y, jnp.where(found, way, begin))) / slope
    shift = jnp.where(found, shift, 0.0)
    there = jax.tree.map(lambda x, slope: x + shift * slope, release.y, change)
    after, there = jax.tree.map(
        lambda x: without_derivative(jnp.any(wanted) & ~found, x), (release.t + shift, rechart(fixed.system, there)[0])
    )
    sense = jnp.where(wanted & found, directions.unit(directions.arms * way), fixed.sense)
    return release._replace(
        equations=equations.with_sense(sense), t=after, y=there, context=release.context._replace(along=sense)
    )


def _together(
    directions: Directions, equations: Equations, joints: Bool[Array, " p"], part: Float[Array, "p p"]
) -> Float[Array, " p"]:
    """Slips along the senses of joints as they go together."""
    same = np.unique(directions.same, axis=0).T
    ways = jnp.where(joints, equations.sense / directions.arms, 0.0)[:, None] * same
    off = equations.slip_size[:, None] * (ways - part @ ways)
    alike = jnp.ones(same.shape[1], part.dtype)
    return ways @ jnp.linalg.solve(off.T @ off + _ALIKE * jnp.diag(alike), alike)


def _longest(release: Release, guess: _Guess, wanted: Array, tolerance: Array) -> _Course:
    """The longest of some spans that do; a span of 0 if none does."""
    zero, size = jnp.zeros_like(release.t), jax.flatten_util.ravel_pytree(release.y)[0].size
    slopes, rates = (jnp.zeros((_DEGREE + 1, size), zero.dtype) for size in (size, release.joints.size))
    error = jnp.where(wanted, jnp.inf, zero)
    none = _Course(zero, slopes, rates, jnp.eye(rates.size, dtype=zero.dtype), error, zero)

    def attempt(carry: tuple[_Course, Array]) -> tuple[_Course, Array]:
        before, count = carry
        shrink = jnp.where(before.error > 1, jnp.clip(0.8 * before.error ** (-1 / _DEGREE), 0.1, 0.5), 0.5)
        span = before.span * jnp.where(count == 0, 1.0, shrink)
        begin = guess.rates + span * jnp.asarray(_TIMES, span.dtype)[:, None] * guess.slopes
        return _over(release, none._replace(span=span, rates=begin), tolerance), count + 1

    def goes_on(carry: tuple[_Course, Array]) -> Bool[Array, ""]:
        course, count = carry
        return ~(course.error <= 1) & (count < _SPANS)

    found, _ = jax.lax.while_loop(goes_on, attempt, (none._replace(span=guess.span), jnp.zeros((), int)))
    return chosen_of(wanted & (found.error <= 1), found, none)


def _over(release: Release, begin: _Course, tolerance: Array) -> _Course:
    """The course over a span, with its error: NaN where there is none or an event is passed."""
    equations = release.equations
    directions, sizes = cast(Directions, equations.directions), _sizes(equations, release.y)

    def sweep(course: _Course, _: None) -> tuple[_Course, Array]:
        after = _swept(release, course, renews=True)
        return after, jnp.max(jnp.abs(after.slopes - course.slopes) / sizes)

    course, changes = jax.lax.scan(sweep, begin, length=_SWEEPS)
    last = jnp.asarray(_COEFFICIENTS[-2:], begin.span.dtype) @ course.slopes
    error = begin.span * jnp.maximum(changes[-1], jnp.max(jnp.abs(last) / sizes)) / tolerance
    then = release.t + begin.span
    path = _along(release, course, then[None])
    state = jax.tree.map(lambda x: x[0], path).at(then)
    turned = _directions(release, course)
    linear = equations.linear(state, release.context.held, closed=equations.loaded)
    ahead = jax.vmap(lambda rate: directions.along(rate, equations.sense))(course.rates[1:])
    stops = jnp.any(release.slides & jnp.any(ahead <= 0, axis=0))
    event = stops | has_event(equations.with_sense(turned), state, linear, turned)
    if equations.touch is not None:
        there = rechart(equations.system, jax.tree.map(lambda x: x[0], path))[0]
        event = event | jnp.any(margins(equations.with_sense(turned), then, there, release.context).least < 0)
    return course._replace(error=jnp.where(event, jnp.nan, error))


def _swept(release: Release, course: _Course, *, renews: bool) -> _Course:
    """The next f and w at the nodes; with a new inverse, if so."""
    (equations, t, y, context, joints, touches, *_), span = release, course.span
    (flat, unravel), weights = jax.flatten_util.ravel_pytree(y), span * jnp.asarray(_WEIGHTS, span.dtype)

    begins = joints & touches  # held at the start

    def node(at: tuple[Array, Array, Array, Array]) -> tuple[Array, ...]:
        sense = jnp.where(begins & at[3], 0.0, equations.sense)
        there, along = equations.with_sense(sense), context._replace(along=sense)

        def told(felt: Array) -> tuple[Array, tuple[Array, Array]]:
            slope, slip, rate = there.instant(at[0], unravel(at[1]), along, felt)
            return slip, (jax.flatten_util.ravel_pytree(slope)[0], rate)

        if not renews:
            slip, aside = told(at[2])
            return slip, *aside
        slip, change, aside = jax.linearize(told, at[2], has_aux=True)
        return slip, *aside, jax.vmap(change, out_axes=1)(jnp.eye(joints.size, dtype=span.dtype))

    times = t + span * jnp.asarray(_TIMES, span.dtype)
    slip, slopes, rate, *changes = jax.lax.map(node, (times, flat + weights @ course.slopes, course.rates, times == t))
    slip = slip.at[0].set(jnp.where(begins, 0.0, slip[0]))
    inverse = course.inverse
    if renews:
        coupled = jnp.einsum("ij,jpq->ipjq", weights, changes[0]).reshape(inverse.shape)
        inverse = jnp.linalg.inv(jnp.eye(inverse.shape[0], dtype=span.dtype) - coupled)
        course = course._replace(turning=_turning(equations.slip_size[:, None] * changes[0][-1] / equations.slip_size))
    off = jnp.where(joints, 0.0, rate[0]) + weights @ slip - course.rates
    rates = course.rates + (inverse @ off.ravel()).reshape(off.shape)
    return course._replace(slopes=slopes, rates=rates, inverse=inverse)


def _turning(matrix: Float[Array, "p p"]) -> Array:
    """The largest rate that friction lets slips turn at, by powers: surfaces that can slide one way alone do not."""
    size = jnp.max(jnp.abs(matrix))
    part = matrix / or_one(size)
    power = part @ part @ part @ part
    least = jnp.finfo(size.dtype).tiny
    return size * jnp.max(jnp.abs(power @ part)) / jnp.maximum(jnp.max(jnp.abs(power)), least)


def _along(release: Release, course: _Course, times: Float[Array, " times"]) -> Moving:
    """y at times of the span; of no account elsewhere."""
    flat, unravel = jax.flatten_util.ravel_pytree(release.y)
    at = 2 * (times - release.t) / jnp.where(course.span > 0, course.span, 1.0) - 1
    powers = jnp.vander(jnp.where(jnp.abs(at) < 1.1, at, 0.0), _DEGREE + 2, increasing=True)
    return jax.vmap(unravel)(flat + course.span / 2 * powers @ jnp.asarray(_INTEGRALS, flat.dtype) @ course.slopes)


def _directions(release: Release, course: _Course) -> Float[Array, " p"]:
    """The senses at the end; of surfaces that slide the directions of w."""
    directions = cast(Directions, release.equations.directions)
    return jnp.where(release.slides, directions.unit(directions.arms * course.rates[-1]), release.equations.sense)


def _sizes(equations: Equations, y: Moving) -> Float[Array, " size"]:
    """Sizes of velocities and internal states, of which errors are relative; infinite of the rest, that follows."""
    sizes = jax.tree.map(lambda x: jnp.full_like(x, jnp.inf), y)
    memory = [
        jax.tree.map(jnp.broadcast_to, group.memory_size(), jax.tree.map(jnp.shape, own)) if own is not None else None
        for own, group in zip(y.memory, equations.system.friction, strict=True)
    ]
    sizes = sizes._replace(qd=equations.speed * equations.scaling.coordinates, memory=memory)
    return jax.flatten_util.ravel_pytree(sizes)[0]
