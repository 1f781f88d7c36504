"""Files of the command line: a user's Python file with a system and its state, and what is written."""

import contextlib
import importlib.util
import pathlib
import sys
import traceback
from collections.abc import Iterator

from .._system._state import State
from .._system._system import AbstractSystem

_PACKAGE = pathlib.Path(__file__).parents[1]


class FileError(Exception):
    """A file that does not give a system and a state, or cannot be written; the message says what to change."""


@contextlib.contextmanager
def writing(file: pathlib.Path) -> Iterator[None]:
    """Tell in a line why a file cannot be written."""
    try:
        yield
    except OSError as error:
        raise FileError(
            f"'{error.filename or file}' cannot be written: {error.strerror}. Choose another place."
        ) from error


def check_target(file: pathlib.Path) -> None:
    """Refuse a file that cannot be written; what it holds, or that it is absent, stays."""
    absent = not file.exists()
    with writing(file):
        file.open("ab").close()
    if absent:
        file.unlink()


@contextlib.contextmanager
def blaming(argument: str) -> Iterator[None]:
    """Tell in a line what fails in the file of `FILE.py:NAME`, or what the package does not take from it."""
    path = argument.rpartition(":")[0]
    try:
        yield
    except FileError:
        raise
    except Exception as error:
        line = _line(error, pathlib.Path(path))
        if not (line or _is_ours(error)):
            raise
        first = (str(error).strip() or "no message").splitlines()[0]
        where = f", line {line}," if line else ""
        raise FileError(f"'{path}'{where} fails with {type(error).__name__}: {first}") from error


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
    own = file.stem if file.stem not in sys.modules else f"{file.stem} of {file.resolve()}"  # no other is replaced
    spec = importlib.util.spec_from_file_location(own, file)
    if spec is None or spec.loader is None:
        raise FileError(f"'{path}' must be a Python file with the ending .py. Rename it.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[own] = module
    sys.path.insert(0, str(file.parent.resolve()))  # so that it can import its neighbours
    spec.loader.exec_module(module)
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


def _line(error: Exception, file: pathlib.Path) -> int | None:
    """Where in the file an error arose, if there."""
    places = [(frame.filename, frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    if isinstance(error, SyntaxError):
        places.append((error.filename or "", error.lineno))
    lines = [line for name, line in places if pathlib.Path(name).resolve() == file.resolve()]
    return lines[-1] if lines else None


def _is_ours(error: Exception) -> bool:
    """Whether the package itself refuses something."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    return isinstance(error, ValueError | RuntimeError) and pathlib.Path(last.filename).is_relative_to(_PACKAGE)


def _public(module: object) -> list[str]:
    return sorted(name for name, value in vars(module).items() if not name.startswith("_") and _usable(value))


def _usable(value: object) -> bool:
    return isinstance(value, AbstractSystem | tuple) or (callable(value) and not isinstance(value, type))
