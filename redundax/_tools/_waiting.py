"""A line on the terminal where compiling, or a search, takes long: what, why, and how long so far."""

import contextlib
import inspect
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import jax
import jax.monitoring

PATIENCE = 5.0  # seconds before a line: a wait that most take for a fault
_STAGES = "/jax/core/compile/"  # tracing, lowering, compiling
_LAST = _STAGES + "backend_compile"


class _Watch(threading.local):
    """What this thread has been compiling since when, over the stages of one program."""

    def __init__(self) -> None:
        self.depth, self.program, self.began, self.told = 0, "", 0.0, False
        self.alarm: threading.Timer | None = None


_watch = _Watch()


def _begin(event: str, value: float, **about: object) -> None:
    """A stage begins."""
    if not event.startswith(_STAGES):
        return
    _watch.depth += 1
    call = _call() if _watch.depth == 1 and sys.stderr.isatty() else ""
    if not call:
        return
    now, program = time.monotonic(), str(about.get("fun_name")).removeprefix("jit(").removesuffix(")")
    if program != _watch.program:
        _watch.program, _watch.began, _watch.told = program, now, False
    if not _watch.told:
        _watch.alarm = threading.Timer(max(0.0, _watch.began + PATIENCE - now), _tell, (call, _watch.__dict__))
        _watch.alarm.daemon = True
        _watch.alarm.start()


def _end(event: str, duration_secs: float, **about: object) -> None:
    """A stage ends."""
    if not event.startswith(_STAGES):
        return
    _watch.depth = max(0, _watch.depth - 1)
    if _watch.depth == 0 and _watch.alarm is not None:
        _watch.alarm.cancel()
        _watch.alarm = None
    if event.startswith(_LAST):
        _watch.program = ""


def _call() -> str:
    """The function of redundax that was called, from outside; none where another library compiles."""
    frame, name = inspect.currentframe(), ""
    while frame is not None:
        module = frame.f_globals.get("__name__", "")
        if module.startswith("redundax.") and not module.startswith(("redundax._command", "redundax._tools")):
            name = frame.f_code.co_name
        frame = frame.f_back
    return name


def _tell(call: str, watch: dict[str, Any]) -> None:
    watch["told"] = True
    seconds = time.monotonic() - watch["began"]
    text = f"redundax: {call}: compiling for {seconds:.0f} s so far, once for all calls of this kind in this process."
    if not getattr(jax.config, "jax_compilation_cache_dir", None):
        text += " rx.keep_programs() keeps programs for the next."
    print(text, file=sys.stderr, flush=True)


@contextlib.contextmanager
def telling_of(work: str) -> Iterator[None]:
    """Tell of other work that takes long; `work` says what it is, and what ends it."""
    call, patience = _call(), PATIENCE

    def tell() -> None:
        print(f"redundax: {call}: {patience:.0f} s so far: {work}.", file=sys.stderr, flush=True)

    alarm = threading.Timer(patience, tell)
    alarm.daemon = True
    if sys.stderr.isatty():
        alarm.start()
    try:
        yield
    finally:
        alarm.cancel()


def tell_of_long_compiling() -> None:
    """Begin to watch."""
    jax.monitoring.register_scalar_listener(_begin)
    jax.monitoring.register_event_duration_secs_listener(_end)
