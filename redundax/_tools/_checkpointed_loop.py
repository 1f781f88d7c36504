"""A loop with derivatives in reverse.

JAX's own loops have none. Equinox's ask which values move by linearising a turn up to four times, which takes longer
than NumPy takes for all else of a short motion; here all numbers of the state may move. The state is kept before every
block of turns, and before every turn of the last block. Going back, those within other blocks are computed again, but
for what is noted of each: lengths of steps differ by more than rounding, as errors do that are rounding.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, PyTree

_EVERY = 256  # turns of a block


def checkpointed_loop(
    going: Callable[[PyTree, PyTree], Bool[Array, ""]],
    turn: Callable[[PyTree, PyTree, PyTree], tuple[PyTree, PyTree]],
    start: tuple[PyTree, PyTree],
    held: PyTree,
    most: int,
    noted: Callable[[PyTree], Array],
) -> tuple[PyTree, PyTree]:
    """Turns, `most` at most, of a state and of what is written and never read, as long as it is `going`; both functions
    are given what is `held`, too. `noted` is the leaf of a state that is noted."""

    @eqx.filter_custom_vjp
    def loop(given: PyTree) -> PyTree:
        start, held = given
        return jax.lax.while_loop(lambda now: going(now[0], held), lambda now: turn(now[0], now[1], held), start)

    @loop.def_fwd
    def _forth(perturbed: PyTree, given: PyTree) -> PyTree:
        start, held = given

        def one(so_far: PyTree) -> PyTree:
            (now, written), states, k = so_far
            return turn(now, written, held), _put(states, k, now), k + 1

        def block(so_far: PyTree) -> PyTree:
            now, _, kept, count = so_far
            before = now, _none(_EVERY, now[0]), jnp.zeros_like(count)
            after, states, turns = jax.lax.while_loop(lambda x: going(x[0][0], held) & (x[2] < _EVERY), one, before)
            return after, states, _put(kept, count // _EVERY, (now[0], noted(states))), count + turns

        states = _none(_EVERY, start[0])
        before = start, states, _none(-(-most // _EVERY), (start[0], noted(states))), jnp.zeros((), int)
        done, *kept = jax.lax.while_loop(lambda x: going(x[0][0], held), block, before)
        return done, kept

    @loop.def_bwd
    def _back(residuals: PyTree, grad: PyTree, perturbed: PyTree, given: PyTree) -> PyTree:
        (start, written), held = given
        states, kept, count = residuals
        moved, fixed = eqx.partition(held, jax.tree.map(lambda x, p: p and eqx.is_inexact_array(x), held, perturbed[1]))
        like = eqx.filter((start, written), eqx.is_inexact_array)
        grad = jax.tree.map(lambda x, g: jnp.zeros_like(x) if g is None else g, like, grad)

        def one_back(so_far: PyTree) -> PyTree:
            states, grad, total, k = so_far
            floats, rest = eqx.partition(_at(states, k), eqx.is_inexact_array)

            def turned(floats: PyTree, written: PyTree, moved: PyTree) -> PyTree:
                out = turn(eqx.combine(floats, rest), written, eqx.combine(moved, fixed))
                return eqx.filter(out, eqx.is_inexact_array)

            _, back = eqx.filter_vjp(turned, floats, written, moved)
            *grad, own = back(grad)
            return states, tuple(grad), jax.tree.map(jnp.add, total, own), k - 1

        def block_back(so_far: PyTree) -> PyTree:
            states, grad, total, turns, block = so_far
            _, grad, total, _ = jax.lax.while_loop(lambda x: x[3] >= 0, one_back, (states, grad, total, turns - 1))
            now, notes = _at(kept, jnp.maximum(block - 1, 0))

            def again(so_far: PyTree) -> PyTree:
                states, k = so_far
                now, _ = turn(_at(states, k - 1), written, held)
                return _put(states, k, eqx.tree_at(noted, now, _at(notes, k))), k + 1

            before = _put(states, 0, now), jnp.ones_like(turns)
            states, turns = jax.lax.while_loop(lambda x: (block > 0) & (x[1] < _EVERY), again, before)
            return states, grad, total, turns, block - 1

        turns = (count - 1) % _EVERY + 1
        before = states, grad, jax.tree.map(jnp.zeros_like, moved), turns, (count - 1) // _EVERY
        _, *out, _, _ = jax.lax.while_loop(lambda x: x[4] >= 0, block_back, before)
        return tuple(out)

    return loop((start, held))


def _none(count: int, like: PyTree) -> PyTree:
    return jax.tree.map(lambda x: jnp.zeros((count, *jnp.shape(x)), jnp.result_type(x)), like)


def _put(many: PyTree, place: Array | int, one: PyTree) -> PyTree:
    return jax.tree.map(lambda a, x: jax.lax.dynamic_update_index_in_dim(a, x, place, 0), many, one)


def _at(many: PyTree, place: Array) -> PyTree:
    return jax.tree.map(lambda a: jax.lax.dynamic_index_in_dim(a, place, keepdims=False), many)
