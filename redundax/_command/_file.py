"""Files of the command line: a user's Python file with a system and its state, and what is written."""

import argparse
import contextlib
import importlib.util
import os
import pathlib
import sys
import traceback
from collections.abc import Iterator
from types import ModuleType

from .._models._formats import MODELS, not_a_model
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._words import ended

_PACKAGE = pathlib.Path(__file__).parents[1]


class FileError(Exception):
    """A file that does not give a system and a state, or cannot be written; the message says what to change."""


@contextlib.contextmanager
def writing(file: pathlib.Path) -> Iterator[None]:
    """Tell in a line why a file cannot be written; what a link leads to is not written over."""
    if file.is_symlink():
        raise FileError(f"'{file}' is a link to '{file.readlink()}', which would be overwritten. Choose another place.")
    try:
        yield
    except OSError as error:
        raise FileError(
            f"'{error.filename or file}' cannot be written: {error.strerror}. Choose another place."
        ) from error


def check_target(file: pathlib.Path) -> None:
    """Refuse a file that cannot be written; what it holds, or that it is absent, stays."""
    with writing(file):
        absent = not file.exists()
        file.open("ab").close()
    if absent:
        file.unlink()


def check_system(arguments: argparse.Namespace) -> None:
    """Refuse, of a system from `FILE.py:NAME`, options of files of models, which it would not follow."""
    options = {"--closures": "the loops of a URDF", "--keyframe": "a position of an MJCF file"}
    options |= {"--run": "a run of an MJCF file", "--stops": "the joint limits of a file of a model"}
    for option, what in options.items():
        if getattr(arguments, option[2:], None) not in (None, False):
            raise FileError(f"Argument `{option}` asks for {what}, but '{arguments.system}' is none. Leave it out.")


@contextlib.contextmanager
def blaming(argument: str) -> Iterator[None]:
    """Tell in a line what fails in the file of `FILE.py:NAME`, or what the package does not take from it."""
    path, _, name = argument.rpartition(":")
    try:
        yield
    except FileError:
        raise
    except (Exception, SystemExit) as error:
        line = _line(error, pathlib.Path(path))
        where = f", line {line}," if line else ""
        first = (str(error).strip() or "no message").splitlines()[0]
        if isinstance(error, SystemExit):
            advice = "Put what exits under `if __name__ == '__main__':`."
            raise FileError(
                f"'{path}'{where} exits with {error.code or 0} before it gives '{name}'. {advice}"
            ) from error
        if not (line or _is_ours(error)):
            raise
        raise FileError(f"'{path}'{where} fails with {type(error).__name__}: {first}") from error


def load(argument: str) -> tuple[AbstractSystem, State]:
    """The system and state that `FILE.py:NAME` stands for.

    NAME is a pair (system, state), a function without arguments that returns one, or a system; then the file
    must also hold its state under the name `state`.
    """
    path, _, name = argument.rpartition(":")
    if not path or not name:
        raise FileError(_no_name(argument))
    file = pathlib.Path(path)
    if not file.is_file():
        raise FileError(f"There is no file '{path}'. Check the path and the folder that you are in.")
    own = file.stem if file.stem not in sys.modules else f"{file.stem} of {file.resolve()}"  # no other is replaced
    spec = importlib.util.spec_from_file_location(own, file.absolute())
    if spec is None or spec.loader is None:
        raise FileError(
            f"'{path}' must be a Python file with the ending .py. {ended(not_a_model(path) or 'Rename it')}"
        )
    module = importlib.util.module_from_spec(spec)
    sys.modules[own] = module
    sys.path.insert(0, str(file.parent.resolve()))  # so that it can import its neighbours
    folder = pathlib.Path.cwd()
    try:
        spec.loader.exec_module(module)
        if not hasattr(module, name):
            raise FileError(f"'{path}' has no '{name}'. It has {', '.join(_public(module)) or 'no public names'}.")
        value = getattr(module, name)
        if callable(value) and not isinstance(value, AbstractSystem):
            value = value()
    finally:
        os.chdir(folder)  # other paths are told from here, wherever the file went
    return _pair(path, name, value, module)


def _no_name(argument: str) -> str:
    """What to write in place of an argument without a name."""
    file = argument.rstrip(":")
    if pathlib.Path(file).suffix.lower() in MODELS:
        return f"'{file}' is a model. Type `redundax audit {file}`, or load it in Python by rx.load_model."
    if what := not_a_model(file):
        return f"'{file}' {ended(what)}"
    return (
        f"'{argument}' must have the form FILE.py:NAME, as in crane.py:mechanism. "
        "Put a colon and a name behind the file."
    )


def _pair(path: str, name: str, value: object, module: ModuleType) -> tuple[AbstractSystem, State]:
    """The system and state that a name of a file holds."""
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


def _line(error: BaseException, file: pathlib.Path) -> int | None:
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
    own = {name: value for name, value in vars(module).items() if not name.startswith("_")}
    functions = {name for name, value in own.items() if callable(value) and not isinstance(value, type)}
    return sorted(functions | {name for name, value in own.items() if isinstance(value, AbstractSystem | tuple)})
