"""What the reference pages show beside the source: constructors as they are called, and what examples print."""

import importlib
import inspect
import json
import operator
import re
from collections.abc import Iterator
from typing import Any

import griffe
from shown import SHOWN, with_shown

_DEFAULT = re.compile(r"\bdefault=(.+?)(?:, \w+=|\)$)")


class Shown(griffe.Extension):
    """Puts behind each example of a docstring what it prints and draws."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Called once everything is read."""
        shown = json.loads(SHOWN.read_text(encoding="utf8")) if SHOWN.exists() else {}
        for own in _inside(pkg):
            if own.docstring is not None:
                own.docstring.value = with_shown(own.docstring.value, shown)


def _inside(own: griffe.Object) -> Iterator[griffe.Object]:
    """The object and all that is defined in it."""
    yield own
    for member in own.members.values():
        if not member.is_alias:
            yield from _inside(member)


class Constructors(griffe.Extension):
    """Gives every class with fields the `__init__` that it is called by, and defaults the names that users know."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Called once everything is read."""
        for own in list(_inside(pkg)):
            if own.is_class and not own.name.startswith("_"):
                self._add(own)
        for own in _inside(pkg):
            if own.is_function:
                _name_defaults(own)

    def _add(self, own: griffe.Class) -> None:
        members = own.members
        if "__init__" in members and not members["__init__"].is_attribute:
            return
        if "__init__" in members:  # that of a base, by name
            base = next(base for base in own.mro() if "__init__" in base.members)
            own.set_member("__init__", base.members["__init__"])
            return
        fields: dict[str, griffe.Attribute] = {}
        for base in [*reversed(own.mro()), own]:
            fields |= {name: each for name, each in base.attributes.items() if each.annotation is not None}
        try:
            called = inspect.signature(_object_of(own)).parameters.values()
        except ValueError:  # of dictionaries
            return
        given = [_parameter(each, fields[each.name]) for each in called if each.name in fields]
        if given:
            own.set_member("__init__", griffe.Function("__init__", parameters=griffe.Parameters(*given)))


def _object_of(own: griffe.Object) -> Any:
    """What is defined there, of the package that is imported."""
    module = own.module.path
    return operator.attrgetter(own.path.removeprefix(f"{module}."))(importlib.import_module(module))


def _parameter(called: inspect.Parameter, field: griffe.Attribute) -> griffe.Parameter:
    """A field as an argument, whose default is written as in the source where it stands there by itself."""
    default = None if called.default is called.empty else repr(called.default)
    if default == "<factory>":
        default = f"{made[1]}()" if (made := re.search(r"default_factory=(\w+)", str(field.value))) else "..."
    if default is not None and field.value is not None and "field(" not in str(field.value):
        default = str(field.value)
    kind = griffe.ParameterKind[called.kind.name.lower()]
    return griffe.Parameter(called.name, annotation=field.annotation, kind=kind, default=default)


def _name_defaults(own: griffe.Function) -> None:
    """Names objects that stand for a default under a name of the source alone by what makes them."""
    for parameter in own.parameters:
        if re.fullmatch(r"_[A-Z_]+", str(parameter.default)):
            value = getattr(importlib.import_module(own.module.path), str(parameter.default))
            simple = isinstance(value, (int, float, str))
            parameter.default = repr(value) if simple else f"{type(value).__name__}()"
