"""Functions of users as pytrees, whose leaves are what is traced of all that they close over.

Programs inside of a transformation see these numbers then: what is traced outside of them alone has no derivative in a
loop of theirs, and is none of their own numbers where they run at once.
"""

import functools
import types
from collections.abc import Callable

import equinox as eqx
import jax
import jax.core
from jaxtyping import PyTree

from ._value import AbstractModule


class Function(AbstractModule):
    """A function, and what is traced of its parts, at their places among all leaves of these."""

    function: Callable[..., PyTree] = eqx.field(static=True)
    places: tuple[int, ...] = eqx.field(static=True)
    traced: tuple[PyTree, ...]

    def __call__(self, *arguments: PyTree, **named: PyTree) -> PyTree:
        return self.given()(*arguments, **named)

    def given(self) -> Callable[..., PyTree]:
        """The function that the user wrote, of the numbers that are the leaves now."""
        if not self.places:
            return self.function
        leaves, structure = jax.tree.flatten(_parts(self.function))
        for place, now in zip(self.places, self.traced, strict=True):
            leaves[place] = now
        return _made(self.function, jax.tree.unflatten(structure, leaves))


def as_functions(tree: PyTree) -> PyTree:
    """A function or a pytree that holds some, with functions that are no pytrees themselves as `Function`."""
    return jax.tree.map(lambda x: _function(x, ()) if callable(x) else x, tree)


def _function(function: Callable[..., PyTree], within: tuple[Callable[..., PyTree], ...]) -> Function:
    within = (*within, function)
    found = {}
    for place, part in enumerate(jax.tree.leaves(_parts(function))):
        if isinstance(part, jax.core.Tracer):
            found[place] = part
        elif callable(part) and not any(part is other for other in within):
            inner = _function(part, within)
            if inner.places:
                found[place] = inner
    return Function(function, tuple(found), tuple(found.values()))


def _parts(function: Callable[..., PyTree]) -> PyTree:
    """What a function has of its own: values that it closes over, and those given where arguments are not."""
    if isinstance(function, functools.partial):
        return function.func, function.args, function.keywords
    if not isinstance(function, types.FunctionType):
        return None
    return tuple(map(_content, function.__closure__ or ())), function.__defaults__, function.__kwdefaults__


def _content(cell: types.CellType) -> PyTree:
    try:
        return cell.cell_contents
    except ValueError:  # of a name that has no value yet
        return None


def _made(function: Callable[..., PyTree], parts: PyTree) -> Callable[..., PyTree]:
    """A function with other parts."""
    if isinstance(function, functools.partial):
        return functools.partial(parts[0], *parts[1], **parts[2])
    closed, defaults, named = parts
    code, within = function.__code__, function.__globals__
    made = types.FunctionType(code, within, function.__name__, defaults, tuple(map(types.CellType, closed)))
    made.__kwdefaults__ = named
    return made
