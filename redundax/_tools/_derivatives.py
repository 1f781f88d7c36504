"""Derivatives of calls outside transformations: what is asked for once waits for nothing but its own compiling.

JAX's transformations trace a call on known numbers for its derivative alone, with no program around it. Forward it is
compiled in little time. In reverse, going forth and back are functions of known numbers again (`as_program`), which
NumPy computes at first.
"""

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from ._compilation import in_little_time, quick_options
from ._numbers import REVERSE, as_program

P = ParamSpec("P")
T = TypeVar("T")


def is_staged() -> bool:
    """Whether this is traced as a part of a program, and not for a derivative or a batch alone."""
    return isinstance(jnp.zeros(()) + 1, jax.core.Tracer)


def once(function: Callable[P, T]) -> Callable[P, T]:
    """`eqx.filter_jit` of what is traced, compiled in little time where no program is around it: a derivative that is
    asked for once waits for its compiling alone. For forward mode."""
    inside = eqx.filter_jit(function)

    @functools.cache
    def alone() -> Callable[P, T]:
        return eqx.filter_jit(function, compiler_options=quick_options())  # pyright: ignore[reportCallIssue]

    @functools.wraps(function)
    def run(*arguments: P.args, **named: P.kwargs) -> T:
        if is_staged():
            return inside(*arguments, **named)
        with in_little_time(True):
            return alone()(*arguments, **named)

    return run


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
        leaves = jax.tree.leaves(given)  # traced in a batch, say; NumPy knows no weak types
        is_beside = any(isinstance(x, jax.core.Tracer) or getattr(x, "weak_type", False) for x in leaves)
        return (beside if is_beside else alone)[way](*given)

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
