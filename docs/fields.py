"""What the reference pages show beside the source: constructors of classes by their fields, and what examples print."""

import json
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


class Fields(griffe.Extension):
    """Gives every class of the package that has fields an `__init__` with them, base classes first."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Called once everything is read."""
        modules = [pkg]
        while modules:
            module = modules.pop()
            modules += module.modules.values()
            for own in module.classes.values():
                if own.is_alias or own.name.startswith("_"):
                    continue
                if "__init__" not in own.members:
                    self._add(own)
                elif own.members["__init__"].is_attribute:  # that of a base, by name
                    base = next(base for base in own.mro() if "__init__" in base.members)
                    own.set_member("__init__", base.members["__init__"])

    def _add(self, own: griffe.Class) -> None:
        fields = {}
        for base in [*reversed(own.mro()), own]:
            for attribute in base.attributes.values():
                if _is_field(attribute):
                    fields[attribute.name] = attribute
        if not fields:
            return
        made = griffe.Function("__init__", parameters=griffe.Parameters(*map(_parameter, fields.values())))
        own.set_member("__init__", made)


def _is_field(attribute: griffe.Attribute) -> bool:
    """Whether it is a value of instances that the class itself declares, not one that its heirs must."""
    own = "instance-attribute" in attribute.labels and attribute.annotation is not None
    left_open = re.match(r"Abstract(Class)?Var\b", str(attribute.annotation))
    return own and not left_open and not attribute.name.startswith("_")


def _parameter(attribute: griffe.Attribute) -> griffe.Parameter:
    value = None if attribute.value is None else str(attribute.value)
    if value is not None and "field(" in value:
        found = _DEFAULT.search(value)
        value = found.group(1) if found else None
    kind = griffe.ParameterKind.positional_or_keyword
    return griffe.Parameter(attribute.name, annotation=attribute.annotation, kind=kind, default=value)
