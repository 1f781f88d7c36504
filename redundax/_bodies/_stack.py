"""Joints or loads of one kind as stacked arrays, with body indices as data.

So compile time does not grow with their number, and one compiled program serves all mechanisms with the
same counts of each kind.
"""

import dataclasses
import functools
from collections.abc import Callable, Hashable, Sequence
from typing import TYPE_CHECKING, ClassVar, Generic, Self, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from .._tools._compilation import is_loopless
from .._tools._errors import RedundaxError
from .._tools._functions import as_functions
from .._tools._module import numpy_of, on_device, ones_at, replace_fields, tree_add, tree_pick, tree_take
from .._tools._value import AbstractModule
from ._body import GROUND
from ._figures import check_figures, check_vectors
from ._frame import AbstractFrame


class AbstractBetweenBodies(AbstractModule):
    """Something that acts between the bodies i and j, given by name."""

    if TYPE_CHECKING:  # for checkers of types, to whom the words of Equinox would make the first arguments of them
        i: ClassVar[str]
        j: ClassVar[str]
    else:
        i: eqx.AbstractVar[str]
        j: eqx.AbstractVar[str]
    frame: ClassVar[AbstractFrame]
    vectors: ClassVar[tuple[str, ...]] = ("point_i", "point_j")  # fields that have two components in the plane
    read_by_law: ClassVar[tuple[str, ...]] = ()  # fields of friction alone, of which NaN gives results that say so

    def __init_subclass__(cls) -> None:
        if "__init__" in cls.__dict__ and is_of_user(cls):
            cls.__init__ = _with_fields(cls.__init__)

    def __check_init__(self) -> None:
        name = getattr(self, "name", None)
        for argument, word in (("name", name), ("i", self.i), ("j", self.j)):
            if word is not None and not isinstance(word, str):
                shown = f"the {type(word).__name__} itself" if hasattr(word, "name") else repr(word)
                raise RedundaxError(
                    f"Argument `{argument}` of a {type(self).__name__} must be a name, but is {shown}. Give its name, "
                    f"as in {getattr(word, 'name', str(word))!r}."
                )
        owner = f"joint '{name}'" if name else f"{type(self).__name__} on '{self.i}'"
        check_figures(self, owner, self.read_by_law)
        if self.frame.word == "planar":
            check_vectors(self, self.vectors, owner)

    def point_on(self, end: str) -> Array | None:
        """Its point on a body, in the local frame: the field `point_i` or `point_j`, None where it has none."""
        return getattr(self, f"point_{end}", None)

    def axes_on(self, end: str) -> Array | None:
        """Its axes on a body in space, as columns in the local frame, likewise."""
        return getattr(self, f"axes_{end}", None)

    def bare(self) -> Self:
        """The same without names, and without what others of its kind need not share with it."""
        return replace_fields(self, i="", j="")


def is_of_user(kind: type) -> bool:
    """Whether a class is not one of this package."""
    return kind.__module__.split(".")[0] != __name__.split(".")[0]


def _with_fields(make: Callable[..., None]) -> Callable[..., None]:
    """An `__init__` that says how fields are declared where it sets one that is not."""

    @functools.wraps(make)
    def init(self: AbstractBetweenBodies, *arguments: PyTree, **named: PyTree) -> None:
        try:
            make(self, *arguments, **named)
        except dataclasses.FrozenInstanceError as error:
            raise RedundaxError(
                f"Class {type(self).__name__} must declare the fields that its `__init__` sets, but {error}. Write "
                "them above it, words as `name: str = eqx.field(static=True)` and numbers as `height: jax.Array = "
                "eqx.field(converter=jnp.asarray)`. Without an `__init__` the class takes them in this order."
            ) from error

    return init


E = TypeVar("E", bound=eqx.Module | tuple)
B = TypeVar("B", bound=AbstractBetweenBodies)
S = TypeVar("S")
T = TypeVar("T")


class Stack(AbstractModule, Generic[E]):
    """Elements of one kind between pairs of bodies; the ground has the index after the last body.

    - `element`: one element whose arrays have a leading axis over the stack.
    - `i`, `j`: indices of the bodies, shape (size,).
    """

    element: E
    i: Int[Array, " size"]
    j: Int[Array, " size"]

    def over(self, function: Callable[[E, S, S], T], bodies: S, relative: PyTree = None) -> T:
        """`function(element, i, j)` of every element and of what its bodies i and j have among all, the ground last;
        `relative` is what the poses of the bodies i have seen, if it is known."""
        on_i, on_j = tree_pick(bodies, self.i), tree_pick(bodies, self.j)
        if relative is not None:
            on_i = replace_fields(on_i, seen=relative)
        return eqx.filter_vmap(function)(self.element, on_i, on_j)

    def by_bodies(
        self, slopes: Float[Array, "size values columns"], count: int
    ) -> Float[Array, "size values s bodies"]:
        """Slopes by the velocities of bodies i, then of j, as those by each of `count` bodies; the ground has none."""
        ends, (size, values, columns) = ones_at(jnp.stack([self.i, self.j], axis=1), count, slopes.dtype), slopes.shape
        own = slopes.reshape(size, values, 2, columns // 2)
        if is_loopless():
            return jax.lax.dot_general(own, ends, (((2,), (1,)), ((0,), (0,))), precision="highest")
        return jnp.sum(own[..., None] * ends[:, None, :, None], axis=2)

    def onto_bodies(self, totals: Array, on_i: Array, on_j: Array) -> Array:
        """Totals of all bodies and the ground, with what the elements do to bodies i and j."""
        return tree_add(tree_add(totals, self.i, on_i), self.j, on_j)

    def take(self, members: Int[Array, " some"]) -> "Stack[E]":
        """The stack of the given members."""
        return tree_take(self, members)


def kinds(elements: Sequence[E]) -> list[list[int]]:
    """Positions of the elements that differ in their arrays alone, in order of first appearance."""
    groups: dict[Hashable, list[int]] = {}
    for position, element in enumerate(elements):
        arrays, rest = eqx.partition(element, eqx.is_array)
        shapes = tuple((x.shape, x.dtype) for x in jax.tree.leaves(arrays))
        key = (jax.tree.structure(arrays), tuple(jax.tree.leaves(rest)), shapes)
        groups.setdefault(key, []).append(position)
    return list(groups.values())


def stacked(elements: Sequence[E]) -> E:
    """One element whose arrays have a leading axis over the given elements of one kind."""
    return jax.tree.map(lambda *x: on_device(numpy_of(x).stack(x)) if eqx.is_array(x[0]) else x[0], *elements)


def stacks(elements: Sequence[B], bodies: Sequence[str]) -> tuple[tuple[Stack[B], ...], list[list[int]]]:
    """Stack elements kind by kind, bare as they are; and the positions of the members.

    `bodies` are the names of the moving bodies, in order.
    """
    index = {name: position for position, name in enumerate((*bodies, GROUND))}
    bare = [as_functions(element.bare()) for element in elements]
    groups = kinds(bare)
    return tuple(
        Stack(
            stacked([bare[k] for k in group]),
            indices([index[elements[k].i] for k in group]),
            indices([index[elements[k].j] for k in group]),
        )
        for group in groups
    ), groups


def indices(values: Sequence[int] | Sequence[Sequence[int]] | np.ndarray) -> Int[Array, "..."]:
    """Indices as data."""
    return on_device(np.array(values, dtype=np.int32))
