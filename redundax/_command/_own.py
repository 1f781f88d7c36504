"""Commands on a system and a state of the user's own."""

import argparse
import functools
import hashlib
import json
import pathlib
import platform
import shlex
from importlib import metadata

import numpy as np

from .._analysis._analyze import analyze
from .._equations._factorize import factorize_dense
from .._solution_sets._family._preload import in_words, unit_free_norm
from .._solve._solve import solve
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._progress import progress, stage
from ..plot._page._contents import contents
from ..plot._page._formats import write
from ._families import draw_families, report_with_families
from ._file import writing
from ._output import show, tell


def _analyze(system: AbstractSystem, state: State, arguments: argparse.Namespace) -> int:
    with stage("finding what is unique"):
        factor = factorize_dense(system, state)
        closure = unit_free_norm(factor)
        report = analyze(system, state, closure=closure, factor=factor)
    show(report.to_json() if arguments.json else f"{report}\nFigures with friction are about {in_words(closure)}.")
    return 1 if report.problem else 0


def _study(system: AbstractSystem, state: State, arguments: argparse.Namespace) -> int:
    watch = functools.partial(progress, what="solving", wanted=arguments.progress)
    factor = factorize_dense(system, state)
    closure, wish = unit_free_norm(factor), (arguments.amplitude, arguments.samples)
    report, families = report_with_families(system, state, closure, *wish, watch, factor)
    if arguments.json:
        show(json.dumps({"report": report.to_dict(), "families": [family.to_dict() for family in families]}))
    else:
        show("\n\n".join(str(part) for part in (report.heading, *families)))
    if arguments.png:
        draw_families(families, arguments.png)
    return 1 if report.problem or any(np.any(family.count == 0) for family in families) else 0


def _report(system: AbstractSystem, state: State, arguments: argparse.Namespace) -> int:
    watch = functools.partial(progress, what="solving", wanted=arguments.progress)
    factor = factorize_dense(system, state)
    closure, wish = unit_free_norm(factor), (arguments.amplitude, arguments.samples)
    report, families = report_with_families(system, state, closure, *wish, watch, factor)
    solution = solve(system, state, closure=closure, factor=factor, throw=False)
    path, _, name = arguments.system.rpartition(":")
    title = f"{name} in {pathlib.Path(path).name}: what can be trusted"
    made = contents(title, system, state, report, solution, families, in_words(closure), _provenance(arguments))
    with writing(arguments.output):
        files = write(made, arguments.output)
    for file in files:
        tell(f"written: {file}")
    if report.problem:
        tell(f"redundax: {report.problem}")
    return 1 if report.problem or any(np.any(family.count == 0) for family in families) else 0


COMMANDS = {"analyze": _analyze, "study": _study, "report": _report}


def _provenance(arguments: argparse.Namespace) -> str:
    """The command that makes the same page again, versions, and a check sum of the user's file."""
    words = ["redundax", "report", arguments.system, "-o", str(arguments.output)]
    words += [] if arguments.amplitude is None else ["--amplitude", str(arguments.amplitude)]
    words += ["--samples", str(arguments.samples)]
    path = arguments.system.rpartition(":")[0]
    versions = ", ".join(f"{package} {metadata.version(package)}" for package in ("redundax", "jax", "numpy"))
    return "\n".join(
        [
            shlex.join(words),
            f"{versions}, Python {platform.python_version()}, float64",
            f"SHA-256 of {path}: {hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()}",
        ]
    )
