"""Second derivatives past a bend of friction.

There y' goes on as f+ where it was f-, and h, of loads, passes zero: f+ - f- is in the ratio of h. First derivatives do
not jump, but a bend that moves by dt = -dh / h' leaves the state another by

    (f+ - f-) h / (2 h'),   which has second derivatives alone

The tiny step that crosses the bend has f- where it begins and f+ where it ends.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._tools._module import batch_any, or_zeros
from .._tools._no_answer import without_second_derivatives
from ._moving import Context, Equations, Moving


class Bend(NamedTuple):
    """A bend of friction that a step crosses.

    - `crosses`: whether it crosses one.
    - `weights`: those of h among multipliers; shape (m,).
    - `several`: whether it crosses several, or sides of play change there, so that second derivatives are not known.
    """

    crosses: Bool[Array, ""]
    weights: Float[Array, " m"]
    several: Bool[Array, ""]


class Ends(NamedTuple):
    """A step: its equations, when and how it begins and ends, and what stays the same within it."""

    equations: Equations
    begin: tuple[Array, Moving]
    end: tuple[Array, Moving]
    context: Context


def crossed(ends: Ends, bend: Bend) -> Moving:
    """The state at the end of a step, with second derivatives past the bend that it crosses."""
    if ends.equations.loaded:
        return _crossed(ends, bend)
    y = ends.end[1]
    return without_second_derivatives(bend.crosses, y) if ends.equations.bends else y


@eqx.filter_custom_jvp
def _crossed(ends: Ends, bend: Bend) -> Moving:
    return ends.end[1]


@_crossed.def_jvp
def _crossed_jvp(primals: tuple, tangents: tuple) -> tuple[Moving, Moving]:
    return _crossed(*primals), _change(*primals, tangents[0])


@eqx.filter_custom_jvp
def _change(ends: Ends, bend: Bend, change: Ends) -> Moving:
    """That of the state at the end."""
    return or_zeros(change.end[1], ends.end[1])


@_change.def_jvp
def _change_jvp(primals: tuple, tangents: tuple) -> tuple[Moving, Moving]:
    ends, bend, one = primals
    other, _, both = tangents
    given = or_zeros(both.end[1], ends.end[1])

    def told(equations: Equations, t: Array, y: Moving, context: Context) -> tuple[Moving, Array]:
        state = y.at(t)
        linear = equations.linear(state, context.held)
        solved = equations.solved(state, linear, context.tau, context.along)
        return equations.change(state, y, linear.rate, solved), bend.weights @ solved.multipliers

    def changes(by: Ends) -> tuple[Moving, Array]:
        """Of f+ - f-, and of h."""
        (before, _), (after, h) = (
            eqx.filter_jvp(told, (ends.equations, *at, ends.context), (by.equations, *at_dot, by.context))[1]
            for at, at_dot in ((ends.begin, by.begin), (ends.end, by.end))
        )
        return jax.tree.map(jnp.subtract, or_zeros(after, given), or_zeros(before, given)), h

    def jump() -> Moving:
        t, y = ends.end
        flow, _ = told(ends.equations, t, y, ends.context)
        _, (_, slope) = jax.jvp(lambda t, y: told(ends.equations, t, y, ends.context), (t, y), (jnp.ones_like(t), flow))
        (by_one, h_one), (by_other, h_other) = changes(one), changes(other)
        return jax.tree.map(lambda x, a, b: x + (a * h_other + b * h_one) / (2 * slope), given, by_one, by_other)

    moved = jax.lax.cond(batch_any(bend.crosses), jump, lambda: given)
    moved = jax.tree.map(lambda a, b: jnp.where(bend.crosses, a, b), moved, given)
    return _change(*primals), jax.tree.map(lambda x: jnp.where(bend.crosses & bend.several, jnp.nan, x), moved)
