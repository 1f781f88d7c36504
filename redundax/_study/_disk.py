"""What a disk does to the file of a study: too little room, damage, other programs.

Room for all samples is taken before the first is computed. Beside the samples lie check sums, one for each chunk that
was written, in the group `checks` of the file: (end, sum) of the samples from the end before.
"""

import errno
import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from . import _contents

if TYPE_CHECKING:
    import netCDF4

_SECONDS = 60  # for a look at a file that takes less than one; a loop in HDF5 is ended by its share of processor time
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_SIGNATURES = (b"\x89HDF", b"CDF")


def reserve(path: Path) -> None:
    """Take the room that the size of a file says it has; `OSError` where there is less."""
    if not hasattr(os, "posix_fallocate"):  # not Unix
        return
    with path.open("r+b") as file:
        try:
            os.posix_fallocate(file.fileno(), 0, path.stat().st_size)
        except OSError as error:
            if error.errno in _NO_ROOM:
                raise


def no_room(path: Path, size: int) -> str:
    """That samples of so many bytes cannot be written, with the room that is left."""
    free = shutil.disk_usage(path.parent).free
    return (
        f"Argument `path`: {path} cannot be written; it takes {_megabytes(size)}, and {_megabytes(free)} are free "
        "there, if no quota or limit is below. Make room, or choose another place"
    )


def stored_contents(path: Path) -> dict[str, object]:
    """What a file holds beside its numbers, as `contents` of it; `OSError` where that cannot be read.

    A process of its own reads it, since HDF5 may crash or never end on a damaged file.
    """
    path.open("rb").close()
    command = [sys.executable, "-P", _contents.__file__, str(path)]
    # Without a lock: this process may hold one, after a write that failed.
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "HDF5_USE_FILE_LOCKING": "FALSE"}
    try:
        process = subprocess.run(command, env=environment, capture_output=True, timeout=_SECONDS, check=True)
    except subprocess.SubprocessError as error:
        raise OSError(errno.EIO, "HDF5 finds errors in it") from error
    return json.loads(process.stdout)


def unreadable(path: Path, error: Exception) -> str:
    """Why a file cannot be opened, and what helps."""
    why = getattr(error, "strerror", None) or error
    if not path.is_file() or isinstance(error, PermissionError):
        return f"Argument `path`: {path} cannot be opened ({why}). Choose another place, or change permissions."
    with path.open("rb") as file:
        start = file.read(4)
    if not start.startswith(_SIGNATURES):
        return f"Argument `path`: {path} is no netCDF file, so no study. Give another path, or delete the file."
    if _is_locked(path):
        return f"Argument `path`: {path} is open in another program that reads or writes it. Close it there."
    return (
        f"Argument `path`: {path} cannot be read ({why}): it is cut off or damaged. Delete the file, or "
        "give another path, and the study begins anew."
    )


def _is_locked(path: Path) -> bool:
    """Whether another program holds the lock that HDF5 sets on its files, so far as this can be asked."""
    try:
        import fcntl
    except ImportError:  # not Unix
        return False
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
    return False


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.3g} MB"


# Check sums -----------------------------------------------------------------------------------


def create_checks(data: "netCDF4.Dataset") -> None:
    """Make the place of the check sums in a new file."""
    group = data.createGroup("checks")
    group.createDimension("chunk", None)
    for name, dtype in (("end", "i8"), ("sum", "u8")):
        group.createVariable(name, dtype, ("chunk",), chunksizes=(1024,))


def add_check(data: "netCDF4.Dataset", first: int, end: int, values: Mapping[str, np.ndarray]) -> None:
    """Add the check sum of samples after those of the samples before."""
    group = data["checks"]
    number = int(np.searchsorted(_ends(group), first, side="right"))
    group["end"][number], group["sum"][number] = end, _sum(values)


def damage(data: "netCDF4.Dataset", names: tuple[str, ...], done: int) -> str:
    """Which of the first samples are not as they were written, as "samples 0 to 9"; else ""."""
    first = 0
    try:
        group = data["checks"]
        for number, end in enumerate(_ends(group)[: np.searchsorted(_ends(group), done, side="right")]):
            kept = {name: np.ma.getdata(data[name][first:end]) for name in names}
            if _sum(kept) != int(group["sum"][number]):
                return f"samples {first} to {end - 1}"
            first = int(end)
    except (OSError, RuntimeError, LookupError):  # HDF5 cannot read them, or there is no check sum
        return f"samples {first} to {done - 1}"
    return "" if first == done else f"samples {first} to {done - 1}"


def _ends(group: "netCDF4.Group") -> np.ndarray:
    return np.ma.getdata(group["end"][:])


def _sum(values: Mapping[str, np.ndarray]) -> int:
    digest = hashlib.blake2b(digest_size=8)
    for name, array in sorted(values.items()):
        digest.update(f"{name} {array.shape} ".encode())
        digest.update(array.tobytes())
    return int.from_bytes(digest.digest(), "little")
