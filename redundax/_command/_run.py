"""From the arguments of the command to its exit status, in a process of its own or within another."""

import argparse
import contextlib
import io
import os
import signal
import sys
import warnings
from collections.abc import Sequence
from typing import NoReturn

import jax

from .._tools._cache import keep_programs
from ._arguments import argument_parser
from ._audit import audit_file
from ._check import check_file
from ._drive import drive_file
from ._file import FileError, blaming, check_target, load
from ._output import tell
from ._own import COMMANDS
from ._page import first_page
from ._tables import tables_as_json, tables_as_text


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status.

    **Arguments:**

    - `argv`: arguments without the name of the command; those of the process if not given.
    """
    arguments = _parsed(argv)
    jax.config.update("jax_enable_x64", True)
    try:
        if arguments.command == "tables":
            return tables_as_json() if arguments.json else tables_as_text()
        for target in filter(
            None, (getattr(arguments, name, None) for name in ("png", "output", "html", "csv", "loads"))
        ):
            check_target(target)
        if arguments.command is None:
            return first_page(arguments.png)
        if arguments.command == "audit":
            return audit_file(arguments)
        if arguments.command == "check":
            return check_file(arguments)
        if arguments.command == "drive":
            return drive_file(arguments)
        with blaming(arguments.system):
            return COMMANDS[arguments.command](*load(arguments.system), arguments)
    except FileError as error:
        tell(f"redundax: {error}")
        return 2
    except BrokenPipeError:  # the reader, `head` say, has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _parsed(argv: Sequence[str] | None) -> argparse.Namespace:
    """The arguments; what is wrong with them may repeat names of files, and is told as other messages are."""
    told, parser = io.StringIO(), argument_parser()
    try:
        with contextlib.redirect_stderr(told):
            arguments, more = parser.parse_known_args(argv)
            if more:
                once = "give an option once for each name, as in --hold A --hold B"
                parser.error(f"{once}; unrecognized arguments: {' '.join(more)}")
            return arguments
    except SystemExit:
        if told.getvalue():
            tell(told.getvalue().rstrip())
        raise


def process() -> int:
    """Run the command in a process of its own.

    It runs most of its programs once, so it compiles them without optimisation, in less than half the time, unless
    `JAX_DISABLE_MOST_OPTIMIZATIONS` says otherwise, and keeps them for later runs. `XLA_FLAGS` are left as they are.
    Stopped from the keyboard it ends at once: a KeyboardInterrupt that comes while a library cleans up would be printed
    and lost.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not where it is ignored, as under nohup
        signal.signal(signal.SIGINT, _stop)
    if "JAX_DISABLE_MOST_OPTIMIZATIONS" not in os.environ:
        jax.config.update("jax_disable_most_optimizations", True)
    if jax.__version_info__ < (0, 11):  # XLA aborts at flags that it has dropped
        os.environ.setdefault("XLA_FLAGS", "--xla_cpu_use_fusion_emitters=false")  # its older code generator
    with warnings.catch_warnings(record=True) as told:
        keep_programs()
    for warning in told:
        tell(f"redundax: {warning.message}")
    return main()


def _stop(*_: object) -> NoReturn:
    os.write(sys.stderr.fileno(), b"redundax: stopped\n")  # a stream may be in the middle of a line
    os._exit(130)
