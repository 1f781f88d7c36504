"""What the command prints, all of it: names and messages of files come from others, and must not act on a terminal."""

import sys
from typing import Protocol, runtime_checkable

from .._tools._words import printable


@runtime_checkable
class _Stream(Protocol):
    def write(self, text: str, /) -> object: ...
    def flush(self) -> object: ...


def show(text: str) -> None:
    """Print, so that a reader has it at once."""
    _write(text, sys.stdout)


def tell(text: str) -> None:
    """Print beside what was asked for: what went wrong, and what was written."""
    _write(text, sys.stderr)


def _write(text: str, stream: _Stream) -> None:
    """Signs that the stream has no bytes for are shown as their codes, as those are that would act on a terminal."""
    code = getattr(stream, "encoding", None) or "utf-8"
    print(printable(text).encode(code, "backslashreplace").decode(code), file=stream, flush=True)
