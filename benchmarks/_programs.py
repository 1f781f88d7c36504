"""How large compiled programs are and how long they take to make: kernels count, each costs milliseconds."""

import pathlib
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax


@dataclass(frozen=True)
class Programs:
    """What was compiled.

    - `seconds`: to trace and compile; of calls to run too, which is little.
    - `count`, `lines`: programs, and lines of their StableHLO.
    - `instructions`, `kernels`: instructions after optimisation, and fused ones among them; none where not looked at.
    """

    seconds: float
    count: int
    lines: int
    instructions: int | None = None
    kernels: int | None = None

    def __str__(self) -> str:
        parts = [f"{self.seconds:6.2f} s", f"{self.lines:6,} lines of HLO in {self.count}"]
        if self.instructions is not None:
            parts.append(f"{self.instructions:,} instructions, {self.kernels:,} kernels when optimised")
        return ", ".join(parts)


def of_function(function: Callable[..., Any], *arguments: Any) -> Programs:
    """One program, `jax.jit` of a function."""
    jax.clear_caches()
    start = time.perf_counter()
    lowered = jax.jit(function).lower(*arguments)
    optimised = lowered.compile().as_text() or ""
    seconds = time.perf_counter() - start
    return Programs(seconds, 1, _lines(lowered.as_text()), optimised.count(" = "), optimised.count(" fusion("))


def of_call(call: Callable[[], Any]) -> Programs:
    """All programs that a call outside transformations compiles."""
    jax.clear_caches()
    with tempfile.TemporaryDirectory() as folder:
        jax.config.update("jax_dump_ir_to", folder)
        try:
            start = time.perf_counter()
            jax.block_until_ready(call())
            seconds = time.perf_counter() - start
        finally:
            jax.config.update("jax_dump_ir_to", "")
        texts = [file.read_text() for file in pathlib.Path(folder).glob("*.mlir")]
    return Programs(seconds, len(texts), sum(map(_lines, texts)))


def _lines(text: str) -> int:
    return sum(not line.startswith("#loc") for line in text.splitlines())
