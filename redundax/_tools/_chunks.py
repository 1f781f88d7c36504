"""A batch in chunks that stay in the cache.

Under `vmap` every operation passes over the whole batch, which for 10^6 samples is memory traffic and little else; and
a loop runs until the last sample of the batch has ended. In chunks both are bounded.
"""

from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, PyTree

from ._compilation import is_single
from ._module import cores
from ._no_answer import nan_derivative_where, spoiled_where
from ._numbers import are_numbers, custom_jvp

T = TypeVar("T", bound=PyTree)

_CHUNK = 4096  # samples at most for a core, four times as many where cores share a device and its loops
_NUMBERS = 2**21  # that go into a chunk and come out of it, at most
_INSIDE = 2**14  # numbers of one kind, as of matrices, within a chunk: 128 KiB, as the cache of a core holds several
_ACCELERATOR = 64, 16, 256  # times as many elsewhere than on CPUs, for threads by the thousand


def limits() -> tuple[int, int, int]:
    """Samples of a chunk, numbers in and out of it, and numbers of one kind within it, at most."""
    if jax.default_backend() != "cpu":
        samples, numbers, inside = _ACCELERATOR
        return samples * _CHUNK, numbers * _NUMBERS, inside * _INSIDE
    return (_CHUNK if jax.local_device_count() >= cores() else 4 * _CHUNK), _NUMBERS, _INSIDE


def in_chunks(
    function: Callable[..., T],
    *arguments: PyTree,
    alone: Callable[..., T] | None = None,
    inside: int = 1,
    changing: PyTree = None,
) -> T:
    """`function(*arguments)`, arrays to arrays, whose batch under `vmap` runs chunk after chunk.

    It has no derivative: that is for a rule around it.

    **Arguments:**

    - `alone`: another way to the same, which takes its place where there is no batch: what is written out for the sake
      of a batch need not be compiled for a single sample.
    - `inside`: number of entries of the largest matrix that a sample has within.
    - `changing`: arrays of which one must change with the sample, or the batch runs at once: what its samples share is
      computed once then, and not in every chunk.
    """
    if is_single() or are_numbers(arguments):
        return (alone or function)(*arguments)
    closed = [_closed(way, *arguments) for way in (function, alone) if way]
    arrays, rest = eqx.partition((closed, arguments, changing), eqx.is_array)

    def plain(arrays: PyTree) -> T:
        (function, *_), arguments, _ = eqx.combine(arrays, rest)
        return function(*arguments)

    def single(arrays: PyTree) -> T:
        (*_, alone), arguments, _ = eqx.combine(arrays, rest)
        return alone(*arguments)

    run = jax.custom_batching.custom_vmap(single)

    @run.def_vmap
    def _(size: int, batched: list, arrays: PyTree) -> tuple[T, PyTree]:
        many = jax.vmap(plain, in_axes=(jax.tree.map(lambda along: 0 if along else None, batched[0]),))
        given = [x for x, along in zip(*map(jax.tree.leaves, (arrays, batched[0])), strict=True) if along]
        numbers = sum(x.size for x in (*given, *jax.tree.leaves(jax.eval_shape(many, arrays)))) // size
        samples, held, within = limits()
        most = min(samples, max(held // max(numbers, 1), 1), max(within // inside, 1))
        chunk = -(-size // -(-size // most)) if changing is None or any(jax.tree.leaves(batched[0][2])) else size
        out = many(arrays) if chunk == size else _looped(many, arrays, batched[0], size, chunk)
        return out, jax.tree.map(lambda _: True, out)

    return run(arrays)


def _closed(function: Callable[..., T], *arguments: PyTree) -> Callable[..., T]:
    """The function as a pytree of all numbers that it holds."""
    # Functions of the user may hold traced numbers. Equinox looks for them in closures only, hence the lambda.
    return eqx.filter_closure_convert(lambda *given: function(*given), *arguments)


def with_derivative_of(
    function: Callable[..., T], failed: Callable[[T], Bool[Array, ""]] | None = None
) -> Callable[[Callable[..., T]], Callable[..., T]]:
    """Gives a way to the same as `function`, in chunks, the derivative of that, which has rules of its own within.

    Where what it gives has `failed`, all derivatives are NaN in forward mode; in reverse mode they are NaN unless all
    cotangents are 0, and then 0, whatever infinities the linear map holds there.
    """

    def given(run: Callable[..., T]) -> Callable[..., T]:
        run = custom_jvp(run, eqx.filter_custom_jvp)

        @run.def_jvp
        def _(primals: tuple, tangents: tuple) -> tuple:
            if failed is None:
                out, change = eqx.filter_jvp(function, primals, tangents)
            else:
                out, change = _jvp_unless(failed, function, primals, tangents)
            return alike(out, eqx.filter(primals, eqx.is_array)), change

        return run

    return given


def _jvp_unless(failed: Callable[[T], Bool[Array, ""]], function: Callable[..., T], primals: tuple, tangents: tuple):
    """`eqx.filter_jvp` but where the function fails: there the linear map L, whose product with 0 may be NaN, is asked
    for L 0 alone, and what it gives is passed over."""
    moving, rest = eqx.partition(primals, jax.tree.map(lambda x: x is not None, tangents, is_leaf=lambda x: x is None))

    def parts(moving: PyTree) -> tuple[PyTree, T]:
        return eqx.partition(function(*eqx.combine(moving, rest)), eqx.is_inexact_array)

    figures, linear, others = jax.linearize(parts, moving, has_aux=True)
    out = eqx.combine(figures, others)
    lost = failed(out)
    change = linear(jax.tree.map(lambda x: jnp.where(lost, 0.0, x), tangents))
    return out, spoiled_where(lost, change, tangents, nan_derivative_where)


@custom_jvp
def alike(out: T, given: PyTree) -> T:
    """`out`, batched in every entry where any of `given` is, as `in_chunks` returns it: arrays to arrays.

    JAX takes the entries of a function and of its rule for a derivative to be batched alike.
    """
    return out if are_numbers(out, given) else _batched_alike(out, given)


@alike.defjvp
def _alike_jvp(primals: tuple, tangents: tuple) -> tuple:
    return alike(*primals), tangents[0]


@jax.custom_batching.custom_vmap
def _batched_alike(out: T, given: PyTree) -> T:
    return out


@_batched_alike.def_vmap
def _(size: int, batched: list, out: T, given: PyTree) -> tuple[T, PyTree]:
    whole = jax.tree.map(lambda x, is_one: x if is_one else jnp.broadcast_to(x, (size, *x.shape)), out, batched[0])
    return whole, jax.tree.map(lambda _: True, out)


def _looped(many: Callable[[PyTree], T], arrays: PyTree, batched: PyTree, size: int, chunk: int) -> T:
    """`many`, chunk after chunk; the last one reaches back, so that all are of one size."""

    def part(k: jax.Array | int) -> T:
        def cut(x: jax.Array, along: bool) -> jax.Array:
            return jax.lax.dynamic_slice_in_dim(x, k * chunk, chunk) if along else x

        return many(jax.tree.map(cut, arrays, batched))

    def body(k: jax.Array, out: T) -> T:
        return jax.tree.map(lambda x, new: jax.lax.dynamic_update_slice_in_dim(x, new, k * chunk, 0), out, part(k))

    shapes = jax.eval_shape(part, 0)
    empty = jax.tree.map(lambda x: jnp.zeros((size, *x.shape[1:]), x.dtype), shapes)
    return jax.lax.fori_loop(0, -(-size // chunk), body, empty)
