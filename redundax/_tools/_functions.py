"""Functions of users as pytrees, whose leaves are what is traced of all that they close over.

Programs inside of a transformation see these numbers then: what is traced outside of them alone has no derivative in a
loop of theirs, and is none of their own numbers where they run at once.
"""

import functools
import types
from collections.abc import Callable, Container, Sequence
from typing import TypeAlias

import equinox as eqx
import jax
import jax.core
import jax.stages
from jaxtyping import PyTree

from ._value import AbstractModule

AnyFunction: TypeAlias = Callable[..., PyTree]


class Function(AbstractModule):
    """A function, and what is traced of its parts and those of functions among them."""

    function: AnyFunction = eqx.field(static=True)
    traced: tuple[PyTree, ...]

    def __call__(self, *arguments: PyTree, **named: PyTree) -> PyTree:
        return self.given()(*arguments, **named)

    def given(self) -> AnyFunction:
        """The function that the user wrote, of the numbers that are the leaves now."""
        if not self.traced:
            return self.function
        holders, traced = _holders(self.function), iter(self.traced)
        made = {k: _empty(one, holders) for k, one in holders.items()}

        def now(leaf: PyTree) -> PyTree:
            return next(traced, leaf) if isinstance(leaf, jax.core.Tracer) else made.get(id(leaf), leaf)

        for k, one in holders.items():
            parts = [jax.tree.map(now, part) if _changes(part, holders) else part for part in _parts(one)]
            _fill(made[k], one, parts)
        return made[id(self.function)]


def as_functions(tree: PyTree) -> PyTree:
    """A function or a pytree that holds some, with functions that are no pytrees themselves as `Function`."""
    return jax.tree.map(lambda x: _function(x) if callable(x) else x, tree)


def _function(function: AnyFunction) -> Function:
    leaves = (leaf for one in _holders(function).values() for part in _parts(one) for leaf in _leaves(part))
    return Function(function, tuple(leaf for leaf in leaves if isinstance(leaf, jax.core.Tracer)))


def _holders(function: AnyFunction) -> dict[int, AnyFunction]:
    """A function and all among its parts, by their `id`, if they have a part that is traced, or is another of these."""
    found, waiting = {}, [function]
    for one in waiting:
        if id(one) not in found:
            found[id(one)] = one
            waiting += [leaf for part in _parts(one) for leaf in _leaves(part) if callable(leaf)]
    holders: dict[int, AnyFunction] = {}
    count = -1
    while len(holders) > count:
        count = len(holders)
        holders |= {k: one for k, one in found.items() if any(_changes(part, holders) for part in _parts(one))}
    return holders


def _changes(part: PyTree, holders: Container[int]) -> bool:
    return any(isinstance(leaf, jax.core.Tracer) or id(leaf) in holders for leaf in _leaves(part))


def _leaves(part: PyTree) -> list[PyTree]:
    """None of what is no pytree, as a dictionary whose keys have no order."""
    try:
        return jax.tree.leaves(part)
    except (TypeError, ValueError, RecursionError, SystemError):
        return []


def _parts(function: AnyFunction) -> Sequence[PyTree]:
    """What a function has of its own: values that it closes over, and those given where arguments are not."""
    if isinstance(function, types.FunctionType):
        return *map(_content, function.__closure__ or ()), function.__defaults__, function.__kwdefaults__
    if isinstance(function, functools.partial):
        return function.func, function.args, function.keywords
    if isinstance(function, types.MethodType):
        return function.__func__, (function.__self__,), {}
    compiled = getattr(function, "__wrapped__", None) if isinstance(function, jax.stages.Wrapped) else None
    return () if compiled is None else (compiled, (), {})


def _content(cell: types.CellType) -> PyTree:
    try:
        return cell.cell_contents
    except ValueError:  # of a name that has no value yet
        return None


def _empty(function: AnyFunction, holders: Container[int]) -> AnyFunction:
    """A function in place of another, whose parts that change are still to be given."""
    if not isinstance(function, types.FunctionType):
        return functools.partial(function)
    cells = (types.CellType() if _changes(_content(x), holders) else x for x in function.__closure__ or ())
    made = types.FunctionType(function.__code__, function.__globals__, function.__name__, None, tuple(cells))
    made.__dict__.update(function.__dict__)
    return made


def _fill(made: AnyFunction, function: AnyFunction, parts: Sequence[PyTree]) -> None:
    if isinstance(made, functools.partial):
        made.__setstate__((*parts, {}))  # pyright: ignore[reportAttributeAccessIssue]
    elif isinstance(made, types.FunctionType):
        *contents, made.__defaults__, made.__kwdefaults__ = parts
        for cell, was, content in zip(made.__closure__ or (), function.__closure__ or (), contents, strict=True):
            if cell is not was:
                cell.cell_contents = content
