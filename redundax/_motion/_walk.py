"""Steps as diffrax's loop takes them, forward in time, where no derivative is taken in reverse.

A program of a motion is compiled for as long as a thousand steps take. In diffrax's loop a fifth of it are the hundred
numbers before the end, one by one, checks of times that are checked already, and buffers for reverse mode.
"""

from typing import NamedTuple, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

# Roundings by which a step that ends before the end is taken to it.
_NEAR = 100


class Walk(NamedTuple):
    """Steps so far: where they are, until when the next goes, states of solver and controller, how they ended, how many
    were taken and refused; and the times asked for, of which so many are passed, by what stands there."""

    t: Float[Array, ""]
    following: Float[Array, ""]
    y: PyTree
    inner: PyTree
    control: PyTree
    result: diffrax.RESULTS
    taken: Int[Array, ""]
    refused: Int[Array, ""]
    path: PyTree
    passed: Int[Array, ""]


def walk(
    terms: diffrax.ODETerm,
    solver: diffrax.AbstractSolver,
    controller: diffrax.AbstractAdaptiveStepSizeController,
    span: tuple[Array, Array, Array],
    y: PyTree,
    args: PyTree,
    ts: Float[Array, " times"],
    max_steps: int,
) -> Walk:
    """The steps from a time to another, given those and the length of the first."""
    if isinstance(solver, diffrax.AbstractRungeKutta) and solver.scan_kind is None:  # as of `diffrax.ForwardMode`
        solver = eqx.tree_at(lambda each: each.scan_kind, solver, "lax", is_leaf=lambda x: x is None)
    start, end, first = span
    order, successful = cast(Array, solver.error_order(terms)), diffrax.RESULTS.successful
    following, control = controller.init(terms, start, end, y, first, args, solver.func, order)
    following = jnp.minimum(following, end)
    near = end - _NEAR * jnp.finfo(end.dtype).eps * jnp.abs(end)

    def goes_on(now: Walk) -> Bool[Array, ""]:
        return (now.t < end) & diffrax.is_successful(now.result)

    def step(now: Walk) -> Walk:
        there, told, dense, inner, solved = solver.step(
            terms, now.t, now.following, now.y, args, now.inner, made_jump=True
        )
        told = jax.tree.map(lambda x: jnp.where(jnp.isnan(x), jnp.inf, x), told)
        keep, t, following, _, control, result = controller.adapt_step_size(
            now.t, now.following, now.y, there, args, told, order, now.control
        )

        def kept(a: PyTree, b: PyTree) -> PyTree:
            return jax.tree.map(lambda a, b: jnp.where(keep, a, b), a, b)

        t = jnp.minimum(t, end)
        following = jnp.where(following > near, jnp.where(keep, end, t + 0.5 * (end - t)), following)
        between = solver.interpolation_cls(t0=now.t, t1=now.following, **dense)
        path, passed = _passed(jnp.asarray(keep), between, now, ts)
        solved = diffrax.RESULTS.where(keep, solved, successful)
        ended = diffrax.RESULTS.where(diffrax.is_okay(now.result), solved, now.result)
        return Walk(
            t,
            following,
            kept(there, now.y),
            kept(inner, now.inner),
            control,
            diffrax.RESULTS.where(diffrax.is_okay(ended), result, ended),
            now.taken + jnp.where(keep, 1, 0),
            now.refused + jnp.where(keep, 0, 1),
            path,
            passed,
        )

    none, path = jnp.zeros((), int), jax.tree.map(lambda x: jnp.broadcast_to(x, (ts.size, *x.shape)), y)
    begin = Walk(
        start,
        following,
        y,
        solver.init(terms, start, following, y, args),
        control,
        diffrax.RESULTS.where(start == start, successful, successful),
        none,
        none,
        path,
        none,
    )
    done = jax.lax.while_loop(lambda now: goes_on(now) & (now.taken + now.refused < max_steps), step, begin)
    return done._replace(result=diffrax.RESULTS.where(goes_on(done), diffrax.RESULTS.max_steps_reached, done.result))


def _passed(
    keep: Bool[Array, ""], steps: diffrax.AbstractPath, now: Walk, ts: Float[Array, " times"]
) -> tuple[PyTree, Int[Array, ""]]:
    """The path with the times that a step passes, and how many are."""

    def time(place: Array) -> Array:
        return jax.lax.dynamic_index_in_dim(ts, place, keepdims=False)

    def note(found: tuple[PyTree, Array]) -> tuple[PyTree, Array]:
        path, place = found
        y = steps.evaluate(time(place))
        path = jax.tree.map(lambda a, b: jax.lax.dynamic_update_index_in_dim(a, b.astype(a.dtype), place, 0), path, y)
        return path, place + 1

    return jax.lax.while_loop(
        lambda found: keep & (found[1] < ts.size) & (time(found[1]) <= now.following), note, (now.path, now.passed)
    )
