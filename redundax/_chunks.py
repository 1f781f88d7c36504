"""A batch in chunks that stay in the cache.

Under `vmap` every operation of a loop passes over the whole batch, which for 10^6 samples is memory traffic and little
else; and the loop runs until the last sample of the batch has ended. In chunks both are bounded.
"""

from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

T = TypeVar("T", bound=PyTree)

_CHUNK = 16384  # samples at most, enough for all threads
_NUMBERS = 2**21  # that go into a chunk and come out of it, at most


def in_chunks(function: Callable[..., T], *arguments: PyTree) -> T:
    """`function(*arguments)`, arrays to arrays, whose batch under `vmap` runs chunk after chunk.

    Its derivative is that of the function in one piece.
    """
    # Functions of the user may hold traced numbers. Equinox looks for them in closures only, hence the lambda.
    closed = eqx.filter_closure_convert(lambda *given: function(*given), *arguments)
    return _in_chunks(closed, arguments)


@eqx.filter_custom_jvp
def _in_chunks(closed: Callable[..., T], arguments: PyTree) -> T:
    arrays, rest = eqx.partition((closed, arguments), eqx.is_array)

    def plain(arrays: PyTree) -> T:
        function, arguments = eqx.combine(arrays, rest)
        return function(*arguments)

    run = jax.custom_batching.custom_vmap(plain)

    @run.def_vmap
    def _(size: int, batched: list, arrays: PyTree) -> tuple[T, PyTree]:
        given, depends = batched[0], _depends(plain, arrays, batched[0], size)
        axes = jax.tree.map(lambda along: 0 if along else None, (given, depends))
        many = jax.vmap(plain, in_axes=axes[:1], out_axes=axes[1], axis_size=size)
        every = jax.tree.leaves((arrays, jax.eval_shape(many, arrays))), jax.tree.leaves((given, depends))
        numbers = sum(x.size for x, along in zip(*every, strict=True) if along) // size
        chunk = min(_CHUNK, max(_NUMBERS // max(numbers, 1), 1))
        count = -(-size // chunk)
        if count == 1 or not any(jax.tree.leaves(depends)):
            return many(arrays), depends
        return _looped(plain, arrays, (given, depends), size, -(-size // count)), depends

    return run(arrays)


@_in_chunks.def_jvp
def _in_chunks_jvp(primals: tuple, tangents: tuple) -> tuple[T, T]:
    return eqx.filter_jvp(lambda closed, arguments: closed(*arguments), primals, tangents)


def _depends(function: Callable[[PyTree], PyTree], arrays: PyTree, batched: PyTree, size: int) -> PyTree:
    """Which outputs depend on inputs that are of the batch."""
    one = jax.tree.map(lambda x, along: x[0] if along else x, arrays, batched)
    jaxpr, out = jax.make_jaxpr(function, return_shape=True)(one)
    found = {id(v) for v, along in zip(jaxpr.jaxpr.invars, jax.tree.leaves(batched), strict=True) if along}
    for equation in jaxpr.jaxpr.eqns:
        if any(id(v) in found for v in equation.invars):
            found.update(map(id, equation.outvars))
    return jax.tree.unflatten(jax.tree.structure(out), [id(v) in found for v in jaxpr.jaxpr.outvars])


def _looped(
    function: Callable[[PyTree], PyTree], arrays: PyTree, batched: tuple[PyTree, PyTree], size: int, chunk: int
) -> PyTree:
    """The function, chunk after chunk; the last one reaches back, so that all are of one size."""
    axes = jax.tree.map(lambda along: 0 if along else None, batched)
    many = jax.vmap(function, in_axes=axes[:1], out_axes=axes[1], axis_size=chunk)

    def part(k: jax.Array | int) -> PyTree:
        def cut(x: jax.Array, along: bool) -> jax.Array:
            return jax.lax.dynamic_slice_in_dim(x, k * chunk, chunk) if along else x

        return many(jax.tree.map(cut, arrays, batched[0]))

    def body(k: jax.Array, out: PyTree) -> PyTree:
        def put(whole: jax.Array, new: jax.Array, along: bool) -> jax.Array:
            return jax.lax.dynamic_update_slice_in_dim(whole, new, k * chunk, 0) if along else new

        return jax.tree.map(put, out, part(k), batched[1])

    shapes = jax.eval_shape(part, 0)
    empty = jax.tree.map(
        lambda x, along: jnp.zeros((size, *x.shape[1:]) if along else x.shape, x.dtype), shapes, batched[1]
    )
    return jax.lax.fori_loop(0, -(-size // chunk), body, empty)
