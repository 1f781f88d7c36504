"""Steps as diffrax's loop takes them, forward in time, outside of transformations and for derivatives alone.

A program of a motion is compiled for as long as a thousand steps take. In diffrax's loop a fifth of it are the hundred
numbers before the end, one by one, checks of times that are checked already, and buffers for reverse mode.
"""

from typing import NamedTuple, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from .._tools._checkpointed_loop import checkpointed_loop
from .._tools._numbers import chosen_of

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
    span: tuple[Array, Array, Array, Float[Array, " times"]],
    y: PyTree,
    args: PyTree,
    max_steps: int,
    in_reverse: bool = False,
) -> Walk:
    """The steps from a time to another, given those, the length of the first and the times asked for; with derivatives
    `in_reverse` or forward."""
    if isinstance(solver, diffrax.AbstractRungeKutta) and solver.scan_kind is None:  # as of `diffrax.ForwardMode`
        kind = "bounded" if in_reverse else "lax"
        solver = eqx.tree_at(lambda each: each.scan_kind, solver, kind, is_leaf=lambda x: x is None)
    start, end, first, ts = span
    order, successful = cast(Array, solver.error_order(terms)), diffrax.RESULTS.successful
    following, control = controller.init(terms, start, end, y, first, args, solver.func, order)
    following = jnp.minimum(following, end)
    held = solver, controller, args, ts, end

    def goes_on(now: Walk, held: PyTree) -> Bool[Array, ""]:
        return (now.t < held[-1]) & diffrax.is_successful(now.result) & (now.taken + now.refused < max_steps)

    def step(now: Walk, path: PyTree, held: PyTree) -> tuple[Walk, PyTree]:
        solver, controller, args, ts, end = held
        there, told, dense, inner, solved = solver.step(
            terms, now.t, now.following, now.y, args, now.inner, made_jump=True
        )
        told = jax.tree.map(lambda x: jnp.where(jnp.isnan(x), jnp.inf, x), told)
        keep, t, following, _, control, result = controller.adapt_step_size(
            now.t, now.following, now.y, there, args, told, order, now.control
        )

        t = jnp.minimum(t, end)
        near = end - _NEAR * jnp.finfo(end.dtype).eps * jnp.abs(end)
        following = jnp.where(following > near, jnp.where(keep, end, t + 0.5 * (end - t)), following)
        between = solver.interpolation_cls(t0=now.t, t1=now.following, **dense)
        path, passed = (_all_passed if in_reverse else _passed)(jnp.asarray(keep), between, now, path, ts)
        solved = diffrax.RESULTS.where(keep, solved, successful)
        ended = diffrax.RESULTS.where(diffrax.is_okay(now.result), solved, now.result)
        return Walk(
            t,
            following,
            *chosen_of(keep, (there, inner), (now.y, now.inner)),
            control,
            diffrax.RESULTS.where(diffrax.is_okay(ended), result, ended),
            now.taken + jnp.where(keep, 1, 0),
            now.refused + jnp.where(keep, 0, 1),
            None,
            passed,
        ), path

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
        None,
        none,
    )
    if in_reverse:
        done, path = checkpointed_loop(goes_on, step, (begin, path), held, max_steps, lambda now: now.following)
    else:
        done, path = jax.lax.while_loop(lambda now: goes_on(now[0], held), lambda now: step(*now, held), (begin, path))
    ended = (done.t < end) & diffrax.is_successful(done.result)
    return done._replace(path=path, result=diffrax.RESULTS.where(ended, diffrax.RESULTS.max_steps_reached, done.result))


def _passed(
    keep: Bool[Array, ""], steps: diffrax.AbstractPath, now: Walk, path: PyTree, ts: Float[Array, " times"]
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
        lambda found: keep & (found[1] < ts.size) & (time(found[1]) <= now.following), note, (path, now.passed)
    )


def _all_passed(
    keep: Bool[Array, ""], steps: diffrax.AbstractPath, now: Walk, path: PyTree, ts: Float[Array, " times"]
) -> tuple[PyTree, Int[Array, ""]]:
    """The same without a loop, which has no derivative in reverse: of all times at once."""
    here = keep & (jnp.arange(ts.size) >= now.passed) & (ts <= now.following)
    y = jax.vmap(steps.evaluate)(jnp.where(here, ts, now.t))
    path = chosen_of(here, jax.tree.map(lambda a, b: b.astype(a.dtype), path, y), path)
    return path, now.passed + jnp.sum(here)
