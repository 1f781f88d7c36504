"""Stages of USD, opened after another process has read them: a binary file that is spoiled may crash its reader, or ask
for more memory or time than there is"""

import functools
import os
import pathlib
import subprocess
import sys

from .._tools._optional import optional
from ._content import refusal
from ._usd_types import UsdStage

FIRST = (b"#usda", b"PXR-USDC", b"PK\x03\x04")
_MEMORY, _MORE = 2 << 30, 50  # bytes, and for each of the file
_TIME, _SLOWEST = 15.0, 1e6  # s, and bytes a second
_READ = """
import sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_DATA, (int(sys.argv[2]),) * 2)
except (ImportError, ValueError, OSError):
    pass
from pxr import Usd
try:
    for prim in Usd.PrimRange.Stage(Usd.Stage.Open(sys.argv[1]), Usd.TraverseInstanceProxies()):
        for attribute in prim.GetAttributes():
            attribute.Get()
except Exception as error:
    sys.exit(3 if isinstance(error, MemoryError) or "alloc" in str(error) else 0)
"""


def stage_of(path: pathlib.Path) -> UsdStage:
    """The stage of a file."""
    Usd = optional("pxr.Usd", "usd")
    with path.open("rb") as file:
        is_binary = file.read(8).startswith(FIRST[1:])
    if is_binary and sys.executable and not _is_read(str(path.resolve()), path.stat().st_size, path.stat().st_mtime_ns):
        why = "it is spoiled, and its reader crashes, or does not end"
        raise refusal(path, f"cannot be read as USD: {why}. Export it again")
    return Usd.Stage.Open(str(path))


@functools.cache
def _is_read(path: str, size: int, _: int) -> bool:
    """Whether a process of its own reads a file to its end, in bounds of memory and time that its size sets."""
    arguments = [sys.executable, "-c", _READ, path, str(_MEMORY + _MORE * size)]
    try:
        done = subprocess.run(
            arguments,
            check=False,
            timeout=_TIME + size / _SLOWEST,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PXR_WORK_THREAD_LIMIT": "1"},
        )
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0
