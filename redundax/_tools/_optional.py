"""Packages that only some parts need."""

import importlib
from types import ModuleType


def optional(name: str) -> ModuleType:
    """A package of the extra `study`."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f'This needs the package {name}: pip install "redundax[study]".') from error
