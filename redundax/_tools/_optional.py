"""Packages that only some parts need."""

import importlib
from types import ModuleType


def optional(name: str, extra: str = "study") -> ModuleType:
    """A package of an extra, or a part of one."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(
            f'This needs the package {name.partition(".")[0]}: pip install "redundax[{extra}]".'
        ) from error
