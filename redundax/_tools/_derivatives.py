"""Derivatives of calls outside transformations: what is asked for once waits for nothing but its own compiling.

JAX's transformations trace a call on known numbers for its derivative alone, with no program around it. Values with
tangents, and in reverse going forth and back, are functions of known numbers again (`as_program`), which NumPy computes
at first. The tangents of `jax.jacfwd` are traced in a batch, in which a function with a rule for batches reads them.
"""

import functools
from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from ._compilation import in_little_time as quickly
from ._compilation import quick_options
from ._numbers import FORWARD, REVERSE, are_known, as_program

T = TypeVar("T")

# Numbers that are moved, up to which derivatives by each are computed where the tangents are not known yet.
_FEW = 128


def is_staged() -> bool:
    """Whether this is traced as a part of a program, and not for a derivative or a batch alone."""
    return isinstance(jnp.zeros(()) + 1, jax.core.Tracer)


def once(function: Callable[..., T], *, in_little_time: bool = True) -> Callable[..., T]:
    """`eqx.filter_jit` of what is traced, with derivatives of known numbers in forward mode that NumPy computes at
    first. Batches, and functions that hold traced numbers, are compiled in little time, if not otherwise said."""
    inside = eqx.filter_jit(function)
    forth = functools.partial(_with_tangents, inside)
    linear = eqx.filter_jit(forth)
    alone, each = as_program(forth, FORWARD), as_program(functools.partial(_for_each, inside), FORWARD)

    @functools.cache
    def beside(function: Callable[..., PyTree]) -> Callable[..., PyTree]:
        options = quick_options() if in_little_time else None
        return eqx.filter_jit(function, compiler_options=options)  # pyright: ignore[reportCallIssue]

    @eqx.filter_custom_jvp
    def differentiated(given: tuple[PyTree, PyTree]) -> PyTree:
        return beside(function)(*given[0], **given[1])

    @differentiated.def_jvp
    def _forward(given: tuple[PyTree], tangents: tuple[PyTree]) -> tuple[PyTree, PyTree]:
        (given,), (tangents,) = given, tangents
        moved, fixed = eqx.partition(given, jax.tree.map(lambda x, t: t is not None, given, tangents))
        if not are_known(given) or _are_weak(given):
            return beside(forth)(moved, tangents, fixed)
        if are_known(tangents):
            return alone(moved, tangents, fixed)
        batch = _batch_of(tangents)
        if batch is None or not are_known(batch):
            if not 0 < sum(x.size for x in jax.tree.leaves(moved)) <= _FEW:
                return linear(moved, tangents, fixed)  # as for `jax.linearize`, whose programs take no options
            out, changes = each(moved, _one_by_one(moved), fixed)
            along = jnp.concatenate([jnp.ravel(x) for x in jax.tree.leaves(tangents)])
            return out, jax.tree.map(lambda x: jnp.tensordot(along.astype(x.dtype), x, 1), changes)
        out, changes = each(moved, batch, fixed)
        return out, _as_batch(changes, tangents)

    @functools.wraps(function)
    def run(*arguments: PyTree, **named: PyTree) -> T:
        if is_staged():
            return inside(*arguments, **named)
        with quickly(in_little_time):
            try:
                return differentiated((arguments, named))
            except jax.errors.UnexpectedTracerError:  # a function of the user holds a traced number
                return inside(*arguments, **named)

    return run


def _with_tangents(function: Callable[..., PyTree], moved: PyTree, tangents: PyTree, fixed: PyTree) -> PyTree:
    """Values, and their tangents by those of what is moved; None of those that have none."""

    def of_moved(moved: PyTree) -> PyTree:
        arguments, named = eqx.combine(moved, fixed)
        return function(*arguments, **named)

    return eqx.filter_jvp(of_moved, (moved,), (tangents,))


def _for_each(function: Callable[..., PyTree], moved: PyTree, batch: PyTree, fixed: PyTree) -> tuple[PyTree, PyTree]:
    """The same by each tangent of a batch."""
    out, changes = jax.vmap(lambda tangents: _with_tangents(function, moved, tangents, fixed))(batch)
    return jax.tree.map(lambda x: x[0], out), changes


def _one_by_one(moved: PyTree) -> PyTree:
    """Tangents of each number alone."""
    leaves, structure = jax.tree.flatten(moved)
    parts = np.split(np.eye(sum(x.size for x in leaves)), np.cumsum([x.size for x in leaves])[:-1], axis=1)
    both = zip(parts, leaves, strict=True)
    return jax.tree.unflatten(structure, [part.reshape(-1, *x.shape).astype(x.dtype) for part, x in both])


def _batch_of(tangents: PyTree) -> PyTree | None:
    """Tangents along a first axis, of those that are traced in a batch and for no derivative; else None.

    Which they are is told by the rules of two functions that change nothing.
    """
    found, moved, tangents = list[PyTree](), list[bool](), jax.tree.map(jnp.asarray, tangents)

    @jax.custom_jvp
    def watched(tangents: PyTree) -> PyTree:
        return tangents

    @watched.defjvp
    def _watch(primals: tuple[PyTree], tangents: tuple[PyTree]) -> tuple[PyTree, PyTree]:
        moved.append(True)
        return primals[0], tangents[0]

    @jax.custom_batching.custom_vmap
    def looked_at(tangents: PyTree) -> PyTree:
        return tangents

    @looked_at.def_vmap
    def _look(size: int, batched: list[PyTree], tangents: PyTree) -> tuple[PyTree, PyTree]:
        whole = jax.tree.map(lambda x, has: x if has else jnp.broadcast_to(x, (size, *x.shape)), tangents, batched[0])
        found.extend([whole] * (size > 0))
        return tangents, batched[0]

    watched(tangents)
    if not moved:
        looked_at(tangents)
    return found[0] if found else None


def _as_batch(values: PyTree, tangents: PyTree) -> PyTree:
    """Known values along a first axis, as they are traced in the batch of tangents."""

    @jax.custom_batching.custom_vmap
    def traced(tangents: PyTree) -> PyTree:
        return jax.tree.map(lambda x: jnp.zeros(x.shape[1:], x.dtype), values)

    @traced.def_vmap
    def _given(size: int, batched: list[PyTree], tangents: PyTree) -> tuple[PyTree, PyTree]:
        return values, jax.tree.map(lambda x: True, values)

    return traced(tangents)


def _are_weak(tree: PyTree) -> bool:
    """Whether some numbers beside others of another type have a weak type, which NumPy knows nothing of."""
    leaves = [x for x in jax.tree.leaves(tree) if eqx.is_inexact_array(x)]
    return len({x.dtype for x in leaves}) > 1 and any(getattr(x, "weak_type", False) for x in leaves)


def once_in_reverse(function: Callable[..., T]) -> Callable[..., T]:
    """The same for reverse mode, which JAX cuts in two: going forth and back are functions of their own here, which
    NumPy computes at first where nothing is traced around them."""
    inside = eqx.filter_jit(function)
    forth = functools.partial(_forth, function)
    alone = as_program(forth, REVERSE), as_program(_back, REVERSE)
    beside = eqx.filter_jit(forth), eqx.filter_jit(_back)

    @eqx.filter_custom_vjp
    def differentiated(given: tuple[PyTree, PyTree]) -> PyTree:
        return inside(*given[0], **given[1])

    def gone(way: int, *given: PyTree) -> PyTree:
        is_alone = are_known(given) and not _are_weak(given)  # and not traced in a batch, say
        return (alone if is_alone else beside)[way](*given)

    @differentiated.def_fwd
    def _forward(perturbed: PyTree, given: PyTree) -> PyTree:
        moved, fixed = eqx.partition(given, perturbed)
        return gone(0, jax.tree.map(jnp.asarray, moved), fixed)

    @differentiated.def_bwd
    def _backward(residuals: PyTree, grad: PyTree, perturbed: PyTree, given: PyTree) -> PyTree:
        return gone(1, residuals, grad)

    @functools.wraps(function)
    def run(*arguments: PyTree, **named: PyTree) -> T:
        if is_staged():
            return inside(*arguments, **named)
        try:
            return differentiated((arguments, named))
        except jax.errors.UnexpectedTracerError:  # a function of the user holds a traced number
            return inside(*arguments, **named)

    return run


class _Zeros(eqx.Module):
    """What a cotangent is of results that are not asked for."""

    shape: tuple[int, ...] = eqx.field(static=True)
    dtype: np.dtype = eqx.field(static=True)


def _forth(function: Callable[..., PyTree], moved: PyTree, fixed: PyTree) -> tuple[PyTree, PyTree]:
    """Values, and what takes their cotangents back to those of what is moved."""

    def of_moved(moved: PyTree) -> PyTree:
        arguments, named = eqx.combine(moved, fixed)
        return function(*arguments, **named)

    out, back = eqx.filter_vjp(of_moved, moved)
    return out, (jax.tree.map(lambda x: _Zeros(x.shape, x.dtype), eqx.filter(out, eqx.is_inexact_array)), back)


def _back(residuals: tuple[PyTree, Callable[..., PyTree]], grad: PyTree) -> PyTree:
    """Cotangents of what is moved; of results that are not asked for, None, they are 0."""
    like, back = residuals

    def whole(like: PyTree, x: PyTree) -> PyTree:
        return jnp.zeros(like.shape, like.dtype) if x is None else x

    return back(jax.tree.map(whole, like, grad, is_leaf=lambda x: isinstance(x, _Zeros)))[0]
