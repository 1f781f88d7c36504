"""The C++ peer, compiled on the spot where there are g++ and Eigen (`EIGEN_INCLUDE`, or the usual folders)."""

import ctypes
import functools
import os
import pathlib
import shutil
import subprocess
import tempfile
from collections.abc import Callable

import numpy as np

from . import _numpy

_FOLDERS = ("/usr/include/eigen3", "/usr/local/include/eigen3", "/opt/homebrew/include/eigen3")


def missing() -> str:
    """What the C++ peer lacks here; nothing if it can run."""
    if shutil.which("g++") is None:
        return "no g++"
    return "" if _include() else "no Eigen: set EIGEN_INCLUDE to its folder"


def sweep(h: np.ndarray, threads: int, full: bool) -> Callable[[], np.ndarray]:
    """A call that returns x (batch, 24) of all h."""
    d, library = _numpy.data(), _library()
    names = ("inverse", "right", "shift", "spread", "gain")
    kept = [np.asarray(d[name], np.float64).ravel(order="F") for name in names] + [np.ascontiguousarray(h)]

    def run() -> np.ndarray:
        out = np.empty((h.size, 24))
        library.sweep(*map(_pointer, kept), ctypes.c_long(h.size), threads, int(full), _pointer(out))
        return out

    return run


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


def _include() -> str | None:
    folders = (os.environ.get("EIGEN_INCLUDE", ""), *_FOLDERS)
    return next((folder for folder in folders if folder and pathlib.Path(folder, "Eigen", "Dense").exists()), None)


@functools.cache
def _library() -> ctypes.CDLL:
    source = pathlib.Path(__file__).with_name("sweep.cpp")
    with tempfile.TemporaryDirectory() as folder:
        target = pathlib.Path(folder, "sweep.so")
        flags = ["-O3", "-march=native", "-DNDEBUG", "-std=c++17", "-shared", "-fPIC", "-pthread"]
        subprocess.run(["g++", *flags, f"-I{_include()}", str(source), "-o", str(target)], check=True)
        return ctypes.CDLL(str(target))
