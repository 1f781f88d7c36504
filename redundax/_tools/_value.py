"""Small immutable values that travel through programs, as Equinox's modules do, but whose fields are read at once.

An attribute of an Equinox module takes a microsecond, a method ten, which numbers feel where a program does not.
"""

import dataclasses
from collections.abc import Hashable, Iterable
from typing import TYPE_CHECKING, ClassVar, TypeVar, dataclass_transform

import equinox as eqx
import jax
import jax.core
import numpy as np
from jaxtyping import PyTree

T = TypeVar("T")


class AbstractModule(eqx.Module):
    """An Equinox module whose attributes are those of Python: a method is bound, not wrapped as a pytree of its own.

    It is shown with its figures, where these are few and known."""

    __slots__ = ("found_out",)  # of `found_once`

    if not TYPE_CHECKING:
        __getattribute__ = object.__getattribute__

    def __repr__(self) -> str:
        return eqx.tree_pformat(jax.tree.map(_shown, self))

    def __getstate__(self) -> dict[str, PyTree]:
        """Copies have the fields alone, and find out the rest by themselves."""
        return dict(vars(self))


class found_once(property):
    """A property of a module that does not change, found out when it is first asked for.

    It is kept beside the fields: Equinox takes a module with more in its `__dict__` for one of another structure."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: PyTree, owner: type | None = None) -> PyTree:
        if instance is None:
            return self
        try:
            found = instance.found_out
        except AttributeError:
            object.__setattr__(instance, "found_out", found := {})
        if self._name not in found:
            found[self._name] = property.__get__(self, instance, owner)
        return found[self._name]


class AbstractModel(AbstractModule):
    """A part of the model, whose numbers programs alone read; what depends on it alone is found out once."""

    is_model: ClassVar[bool] = True

    @found_once
    def is_known(self) -> bool:
        """Whether none of its numbers is traced."""
        return not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(self))

    @found_once
    def flat(self) -> tuple[list[PyTree], Hashable]:
        """Its arrays, and what programs of others like them are keyed by."""
        return flattened(self)


def is_model(x: object) -> bool:
    """Whether it is such a part; to ask for its class takes longer."""
    return getattr(type(x), "is_model", False)


def flattened(tree: PyTree) -> tuple[list[PyTree], Hashable]:
    """Arrays of a pytree, and all else that a program is keyed by."""
    leaves, structure = jax.tree.flatten(tree, is_leaf=lambda x: is_model(x) and x is not tree)
    arrays, key = [], [structure]
    for x in leaves:
        if is_model(x):
            own, kind = x.flat
            arrays += own
            key.append(kind)
        elif eqx.is_array(x):
            arrays.append(x)
            key.append((x.shape, x.dtype))
        else:
            key.append(x)
    return arrays, tuple(key)


def _shown(x: PyTree) -> PyTree:
    is_known = isinstance(x, np.ndarray | jax.Array) and not isinstance(x, jax.core.Tracer)
    return np.asarray(x).tolist() if is_known and x.ndim <= 2 and x.size <= 9 else x  # a matrix in space


@dataclass_transform(frozen_default=True)
def value(cls: type[T]) -> type[T]:
    """A frozen dataclass whose fields are the children of a pytree."""
    cls = dataclasses.dataclass(frozen=True, eq=False, repr=cls.__repr__ is object.__repr__)(cls)
    names = tuple(field.name for field in dataclasses.fields(cls))  # pyright: ignore[reportArgumentType]
    keys = tuple(map(jax.tree_util.GetAttrKey, names))

    def flatten(x: T) -> tuple[list[PyTree], None]:
        return [getattr(x, name) for name in names], None

    def flatten_with_keys(x: T) -> tuple[list[tuple[Hashable, PyTree]], None]:
        return list(zip(keys, flatten(x)[0], strict=True)), None

    def unflatten(_: None, children: Iterable[PyTree]) -> T:
        new = object.__new__(cls)
        new.__dict__.update(zip(names, children, strict=True))
        return new

    jax.tree_util.register_pytree_with_keys(cls, flatten_with_keys, unflatten, flatten)
    return cls
