"""Progress on long work, told on standard error."""

import sys
import time
from collections.abc import Iterator, Sequence
from typing import TypeVar

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
