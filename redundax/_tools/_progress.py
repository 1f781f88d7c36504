"""Progress on long work, told on standard error."""

import contextlib
import functools
import sys
import time
from collections.abc import Iterator, Sequence
from typing import TypeVar

import jax.monitoring

T = TypeVar("T")


def progress(steps: Sequence[T], what: str, wanted: bool) -> Iterator[T]:
    """The steps one by one, with a bar, or a line after each where tqdm is not installed.

    Unless `wanted`, nothing is shown in the first two seconds, nor where standard error is not a terminal.
    """
    if not (wanted or sys.stderr.isatty()):
        yield from steps
        return
    delay = 0.0 if wanted else 2.0
    try:
        from tqdm import tqdm
    except ImportError:
        begin = time.monotonic()
        for number, step in enumerate(steps, 1):
            yield step
            if time.monotonic() - begin >= delay:
                print(f"{what}: {number} of {len(steps)}", file=sys.stderr, flush=True)
    else:
        yield from tqdm(steps, what, delay=delay, file=sys.stderr)


@contextlib.contextmanager
def stage(what: str) -> Iterator[None]:
    """Tell on a terminal what is being done, and then how long it took and how much of that was compiling."""
    if not sys.stderr.isatty():
        yield
        return
    begin, compiled = time.monotonic(), sum(_compilations())
    print(f"{what} ... ", end="", file=sys.stderr, flush=True)
    try:
        yield
    finally:
        took, compiling = time.monotonic() - begin, sum(_compilations()) - compiled
        print(f"{took:.1f} s, of which {compiling:.1f} s compiling", file=sys.stderr, flush=True)


@functools.cache
def _compilations() -> list[float]:
    """Seconds that each step of compiling takes, from the first call on."""
    found: list[float] = []

    def note(event: str, duration_secs: float, **_: str | int) -> None:
        if event.startswith("/jax/core/compile/"):
            found.append(duration_secs)

    jax.monitoring.register_event_duration_secs_listener(note)
    return found
