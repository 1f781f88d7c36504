"""Compiled programs kept from one start of Python to the next, in the user's folder for caches."""

import os
import pathlib
import sys
import tempfile

import jax

from ._module import check_kind
from ._words import warn

LIMIT = 256 * 10**6  # bytes of the folder when a run starts


def keep_programs(folder: str | os.PathLike[str] | None = None) -> None:
    """Keep compiled programs on disk, so that a script that starts again compiles none of them.

    Call it before all else. Programs are known by what they compute, so those of an edited mechanism are compiled anew.
    The oldest are dropped beyond 256 MB. The command `redundax` does the same.

    **Example:**

    ```python
    import redundax as rx

    rx.keep_programs()
    ```

    **Arguments:**

    - `folder`: where. By default the environment variable REDUNDAX_CACHE says it, or is "off" for none; otherwise it is
      a folder `redundax` where the user's platform has caches.

    A cache that JAX has been told of is left as it is. Where a folder cannot be written to, programs are compiled
    again, and a warning says so if the folder was named.
    """
    if folder is not None:
        check_kind("folder", folder, (str, os.PathLike), "the name of a folder", 'Write "programs", say.')
    named = "REDUNDAX_CACHE" if folder is None else "`folder`"
    wish = os.environ.get("REDUNDAX_CACHE", "") if folder is None else os.fspath(folder)
    if (folder is None and wish == "off") or getattr(jax.config, "jax_compilation_cache_dir", None):
        return
    try:
        folder = (pathlib.Path(wish).expanduser() if wish else _default_folder()).absolute()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        _drop_oldest(folder)
    except (OSError, RuntimeError) as error:  # RuntimeError: of a user without a home
        if wish:
            warn(f"No programs are kept: {error}. Name another folder as {named}.")
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def _default_folder() -> pathlib.Path:
    """Where the user's platform has caches."""
    if sys.platform == "win32":
        local = os.environ.get("LOCALAPPDATA")
        return (pathlib.Path(local) if local else pathlib.Path.home() / "AppData" / "Local") / "redundax" / "Cache"
    if sys.platform == "darwin":
        return pathlib.Path.home() / "Library" / "Caches" / "redundax"
    base = pathlib.Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (base if base.is_absolute() else pathlib.Path.home() / ".cache") / "redundax"


def _drop_oldest(folder: pathlib.Path) -> None:
    """Bring the folder down to its limit; of what is not ours nothing is touched."""
    programs = [(about, file) for file in folder.glob("jit_*-cache") if (about := _about(file))]
    size = 0
    for about, file in sorted(programs, key=lambda program: program[0].st_mtime, reverse=True):
        size += about.st_size
        if size > LIMIT:
            file.unlink(missing_ok=True)


def _about(file: pathlib.Path) -> os.stat_result | None:
    """Size and time of a file; None where another run has dropped it."""
    try:
        return file.stat()
    except FileNotFoundError:
        return None
