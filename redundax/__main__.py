"""The command.

    python -m redundax [--png FILE]              the paper's tables, printed and computed, and what is unique
    python -m redundax tables [--json]           the tables alone, as text or as JSON with full precision
    python -m redundax analyze FILE.py:NAME      what is unique in a mechanism of yours
    python -m redundax study FILE.py:NAME        how far it varies along its self-stress
    python -m redundax report FILE.py:NAME -o F  both as a page with pictures, F.html or F.md

It ends with 0, with 1 where a solve failed or a difference from the printed figures is unexplained, with 2 where the
arguments cannot be understood, a file of yours fails or cannot be written, and with 130 where you stop it. It computes
in float64.
"""

import argparse
import dataclasses
import functools
import hashlib
import json
import math
import os
import pathlib
import platform
import shlex
import signal
import sys
from collections.abc import Callable, Iterable, Sequence
from importlib import metadata
from typing import Any, NoReturn

import jax
import numpy as np

from . import _paper
from ._analysis._analyze import analyze
from ._analysis._report import Report
from ._closures._closure import AbstractClosure, MinimumNorm
from ._command._file import FileError, blaming, check_target, load, writing
from ._equations._factorisation import factorize
from ._pictures._page._contents import contents
from ._pictures._page._formats import FORMATS, write
from ._pictures._plots._plot import plot_family
from ._solution_sets._family._preload import in_words, unit_free_norm
from ._solution_sets._family._solution_family import SolutionFamily, solution_family
from ._solve._solve import solve
from ._system._state import State
from ._system._system import AbstractSystem
from ._tools._progress import progress
from .mechanisms import wojtyra2020

_KEYS = ("table2", "table3", "table4")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status.

    **Arguments:**

    - `argv`: arguments without the name of the command; those of the process if not given.
    """
    arguments = _parser().parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    try:
        if arguments.command == "tables":
            return _tables_as_json() if arguments.json else _tables_as_text()
        for target in filter(None, (getattr(arguments, name, None) for name in ("png", "output"))):
            check_target(target)
        if arguments.command is None:
            return _paper_study(arguments.png)
        with blaming(arguments.system):
            return _COMMANDS[arguments.command](*load(arguments.system), arguments)
    except FileError as error:
        print(f"redundax: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # the reader, `head` say, has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m redundax",
        description="Tables 2, 3 and 4 of Wojtyra, Pekal, Fraczek (Mech. Mach. Theory 153 (2020) 103999): printed "
        "and computed figures side by side, every difference marked and explained, and what of the mechanism's "
        "motion and joint loads is unique.",
        epilog="Exit status: 0 if all went well, 1 if a solve failed or a difference from the printed figures is "
        "unexplained, 2 if the arguments are wrong, your file fails or nothing can be written, 130 if you stop it.",
    )
    parser.add_argument("--png", metavar="FILE", type=_picture, help="also draw the mechanism's family of solutions")
    parser.add_argument("--version", action="version", version=f"redundax {_version()}")
    commands = parser.add_subparsers(dest="command", metavar="command", title="commands")
    tables = commands.add_parser(
        "tables",
        help="the tables alone",
        description="Tables 2, 3 and 4 alone: as text beside the printed figures, or computed figures as JSON.",
    )
    tables.add_argument(
        "--json",
        action="store_true",
        help="computed figures at full float64 precision: {table2, table3, table4}, lists of rows with u, h or "
        "x0, linear, angular, forces, moments and, with friction, tau, in the units of the row",
    )
    _own_mechanism(commands)
    return parser


def _own_mechanism(commands: Any) -> None:
    """Add the commands on a user's file."""
    analysis = commands.add_parser(
        "analyze",
        help="what is unique in a mechanism of yours",
        description="Rank, self-stress, and which multipliers and accelerations are unique, at a state.",
    )
    study = commands.add_parser(
        "study",
        help="how far a mechanism of yours varies along its self-stress",
        description="Solutions along every self-stress state: table of extremes, and a picture with --png.",
    )
    page = commands.add_parser(
        "report",
        help="both as a page with pictures",
        description="A page to read, print and pass on: the mechanism drawn, what is redundant, what is unique and "
        "why, what to release, motion and loads with their ranges, and how the page was made.",
    )
    for command in (analysis, study, page):
        command.add_argument(
            "system",
            metavar="FILE.py:NAME",
            help="a pair (system, state), a function that returns one, or a system beside a State named 'state'",
        )
    for command in (analysis, study):
        command.add_argument("--json", action="store_true", help="print JSON")
    page.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=_page_file,
        default="report.html",
        help=".html: one file with its pictures; .md: Markdown with its pictures beside it (default report.html)",
    )
    study.add_argument(
        "--png", metavar="FILE", type=_picture, help="draw the solutions; further states have their number in the name"
    )
    for command in (study, page):
        command.add_argument(
            "--amplitude",
            type=_size,
            help="largest self-stress added, in units of the multiplier that names it; by default as large as the "
            "largest joint load without friction, where a moment counts as a force at a length of the mechanism",
        )
        command.add_argument("--samples", type=_count, default=201, help="amplitudes looked at (default 201)")
        command.add_argument("--progress", action="store_true", help="tell how far the work is, even if it is short")


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 3:
        raise argparse.ArgumentTypeError(f"must be a whole number and at least 3, but is {text}")
    return int(text)


def _size(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"must be a positive number, but is {text}")
    return value


def _picture(text: str) -> pathlib.Path:
    return _target(text, (".png", ".pdf", ".svg"))


def _page_file(text: str) -> pathlib.Path:
    return _target(text, FORMATS)


def _target(text: str, endings: Sequence[str]) -> pathlib.Path:
    file = pathlib.Path(text)
    if file.suffix not in endings:
        raise argparse.ArgumentTypeError(f"must end in {', '.join(endings[:-1])} or {endings[-1]}, but is {text}")
    if not file.parent.is_dir():
        raise argparse.ArgumentTypeError(f"must lie in a folder that exists, but there is no {file.parent}")
    return file


def _analyze(system: AbstractSystem, state: State, arguments: argparse.Namespace) -> int:
    report = analyze(system, state, closure=unit_free_norm(factorize(system, state)))
    _show(report.to_json() if arguments.json else str(report))
    return 1 if report.problem else 0


def _study(system: AbstractSystem, state: State, arguments: argparse.Namespace) -> int:
    watch = functools.partial(progress, what="solving", wanted=arguments.progress)
    closure = unit_free_norm(factorize(system, state))
    report, families = _families(system, state, closure, arguments.amplitude, arguments.samples, watch)
    if arguments.json:
        _show(json.dumps({"report": report.to_dict(), "families": [family.to_dict() for family in families]}))
    else:
        _show("\n\n".join(str(part) for part in (report, *families)))
    if arguments.png:
        _draw(families, arguments.png)
    return 1 if report.problem or any(np.any(family.count == 0) for family in families) else 0


def _report(system: AbstractSystem, state: State, arguments: argparse.Namespace) -> int:
    watch = functools.partial(progress, what="solving", wanted=arguments.progress)
    closure = unit_free_norm(factorize(system, state))
    report, families = _families(system, state, closure, arguments.amplitude, arguments.samples, watch)
    solution = solve(system, state, closure=closure, throw=False)
    path, _, name = arguments.system.rpartition(":")
    title = f"{name} in {pathlib.Path(path).name}: what can be trusted"
    made = contents(title, system, state, report, solution, families, in_words(closure), _provenance(arguments))
    with writing(arguments.output):
        files = write(made, arguments.output)
    for file in files:
        print(f"written: {file}", file=sys.stderr)
    if report.problem:
        print(f"redundax: {report.problem}", file=sys.stderr)
    return 1 if report.problem or any(np.any(family.count == 0) for family in families) else 0


_COMMANDS = {"analyze": _analyze, "study": _study, "report": _report}


def _provenance(arguments: argparse.Namespace) -> str:
    """The command that makes the same page again, versions, and a check sum of the user's file."""
    words = ["python", "-m", "redundax", "report", arguments.system, "-o", str(arguments.output)]
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


def _families(
    system: AbstractSystem,
    state: State,
    closure: AbstractClosure,
    amplitude: float | None,
    samples: int,
    watch: Callable[[Sequence[Any]], Iterable[Any]] = iter,
) -> tuple[Report, list[SolutionFamily]]:
    """The report, and the solutions along every self-stress state; none where there is a problem."""
    report = analyze(system, state, closure=closure)
    if report.problem:
        return report, []
    z = None if amplitude is None else np.linspace(-amplitude, amplitude, samples)
    options = {"z": z, "closure": closure, "samples": samples, "watch": watch}
    try:
        return report, [solution_family(system, state, along=name, **options) for name in report.pivots]
    except RuntimeError as error:
        return dataclasses.replace(report, problem=str(error)), []


def _draw(families: Sequence[SolutionFamily], file: pathlib.Path) -> None:
    for number, family in enumerate(families):
        target = file if number == 0 else file.with_stem(f"{file.stem}_{number}")
        with writing(target):
            plot_family(family).savefig(target)
        print(f"drawn: {target}", file=sys.stderr)


def _paper_study(png: pathlib.Path | None) -> int:
    comparisons = _tables()
    _show("What is unique\n==============\n")
    mechanism = wojtyra2020(mu_rho=_paper.MU_RHO)
    report = analyze(mechanism, mechanism.state(phi=_paper.PHI, rate=_paper.RATE))
    _show(f"{report}\n")
    _show(_paper.spread_text(*(comparison.table for comparison in comparisons)) + "\n")
    status = _verdict(comparisons)
    if png:
        state = mechanism.state(phi=_paper.PHI, rate=_paper.RATE)
        _draw(_families(mechanism, state, MinimumNorm(), amplitude=400.0, samples=401)[1], png)
    return 1 if report.problem else status


def _tables_as_text() -> int:
    return _verdict(_tables())


def _tables_as_json() -> int:
    comparisons = [_paper.compare(_paper.table(key)) for key in _KEYS]
    rows = {c.table.printed.key: c.table.rows() for c in comparisons}
    problems = [problem for comparison in comparisons for problem in comparison.problems]
    _show(json.dumps(_without_nan(rows), indent=1, allow_nan=False))
    for problem in problems:
        print(problem, file=sys.stderr)
    return 1 if problems else 0


def _tables() -> list[_paper.Comparison]:
    """Show the tables one after the other, each as soon as it is computed."""
    _show(_paper.heading(_version()) + "\n")
    comparisons = []
    for key in _KEYS:
        comparisons.append(_paper.compare(_paper.table(key)))
        _show(_paper.table_text(comparisons[-1]) + "\n")
    return comparisons


def _verdict(comparisons: list[_paper.Comparison]) -> int:
    _show("Result\n======\n\n" + _paper.verdict_text(comparisons))
    return 1 if any(comparison.problems for comparison in comparisons) else 0


def _without_nan(value: object) -> object:
    """JSON has no NaN: figures of a failed solve become null."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _version() -> str:
    return metadata.version("redundax")


def _show(text: str) -> None:
    print(text, flush=True)


def _stop(*_: object) -> NoReturn:
    os.write(sys.stderr.fileno(), b"redundax: stopped\n")  # a stream may be in the middle of a line
    os._exit(130)


def process() -> int:
    """Run the command in a process of its own.

    It runs most of its programs once, so it compiles them without optimisation, in less than half the time, unless
    `JAX_DISABLE_MOST_OPTIMIZATIONS` or `XLA_FLAGS` say otherwise. Stopped from the keyboard it ends at once: a
    KeyboardInterrupt that comes while a library cleans up would be printed and lost.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not where it is ignored, as under nohup
        signal.signal(signal.SIGINT, _stop)
    if "JAX_DISABLE_MOST_OPTIMIZATIONS" not in os.environ:
        jax.config.update("jax_disable_most_optimizations", True)
    if jax.__version_info__ < (0, 11):  # XLA aborts at flags that it has dropped
        os.environ.setdefault("XLA_FLAGS", "--xla_cpu_use_fusion_emitters=false")  # its older code generator
    return main()


if __name__ == "__main__":
    sys.exit(process())
