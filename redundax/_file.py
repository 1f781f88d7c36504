"""A system and its state out of a user's Python file, for the command line."""

import importlib.util
import pathlib
import sys
import traceback

from ._state import State
from ._system import AbstractSystem


class FileError(Exception):
    """A file or name that does not give a system and a state; the message says what to change."""


def load(argument: str) -> tuple[AbstractSystem, State]:
    """The system and state that `FILE.py:NAME` stands for.

    NAME is a pair (system, state), a function without arguments that returns one, or a system; then the file
    must also hold its state under the name `state`.
    """
    path, colon, name = argument.rpartition(":")
    if not colon or not path or not name:
        raise FileError(
            f"'{argument}' must have the form FILE.py:NAME, as in crane.py:mechanism. "
            "Put a colon and a name after the file."
        )
    file = pathlib.Path(path)
    if not file.is_file():
        raise FileError(f"There is no file '{path}'. Check the path and the folder that you are in.")
    spec = importlib.util.spec_from_file_location(file.stem, file)
    if spec is None or spec.loader is None:
        raise FileError(f"'{path}' must be a Python file with the ending .py. Rename it.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[file.stem] = module
    sys.path.insert(0, str(file.parent.resolve()))  # so that it can import its neighbours
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise FileError(f"'{path}'{_line(error, file)} fails with {type(error).__name__}: {error}") from error
    if not hasattr(module, name):
        raise FileError(f"'{path}' has no '{name}'. It has {', '.join(_public(module)) or 'no public names'}.")
    value = getattr(module, name)
    if callable(value) and not isinstance(value, AbstractSystem):
        value = value()
    if isinstance(value, AbstractSystem):
        if not isinstance(getattr(module, "state", None), State):
            raise FileError(
                f"'{path}' must also hold a `State` named 'state' for the system '{name}'. "
                "Add one: `rx.assemble` finds it from a guess."
            )
        return value, module.state
    if isinstance(value, tuple) and len(value) == 2:
        system, state = value
        if isinstance(system, AbstractSystem) and isinstance(state, State):
            return system, state
    raise FileError(
        f"'{name}' in '{path}' must be a system, a pair (system, state), or a function that returns such a pair, "
        f"but is {type(value).__name__}. Return the pair from a function of that name."
    )


def _line(error: Exception, file: pathlib.Path) -> str:
    """Where in the file an error arose."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(file)]
    line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
    return f", line {line}," if line else ""


def _public(module: object) -> list[str]:
    return sorted(name for name, value in vars(module).items() if not name.startswith("_") and _usable(value))


def _usable(value: object) -> bool:
    return isinstance(value, AbstractSystem | tuple) or (callable(value) and not isinstance(value, type))
