"""The arguments of the command, as they are written and checked."""

import argparse
import math
import pathlib
from collections.abc import Callable
from importlib import metadata

from .._models._formats import MODELS, NAMES
from .._tools._cache import LIMIT
from ..plot._page._formats import FORMATS

_MODELS = ", ".join(MODELS)
_PICK = (
    "Figures with friction are about the minimum norm with the mechanism's own length as its unit, so that no unit "
    "changes them; rx.solve takes the unit of the model unless it is told."
)


def argument_parser() -> argparse.ArgumentParser:
    """What the command takes."""
    parser = argparse.ArgumentParser(
        prog="redundax",
        description="Which joint forces a model of a machine really determines, and what decides the rest. Without a "
        "command: an example on one page.",
        epilog="Exit status: 0 if all went well, 1 if a solve failed or a difference from the paper's printed figures "
        "is unexplained, 2 if the arguments are wrong, your file fails or nothing can be written, 130 if you stop it. "
        f"Compiled programs are kept, {LIMIT // 10**6} MB at most, so that later runs start sooner: in the folder "
        "redundax of the user's caches (XDG_CACHE_HOME or ~/.cache; ~/Library/Caches on macOS; LOCALAPPDATA on "
        "Windows). The variable REDUNDAX_CACHE names another folder, or is off; JAX_COMPILATION_CACHE_DIR goes first.",
    )
    parser.add_argument("--png", metavar="FILE", type=_PICTURE, help="also draw all solutions of the example")
    parser.add_argument("--version", action="version", version=f"redundax {version()}")
    commands = parser.add_subparsers(dest="command", metavar="command", title="commands")
    tables = commands.add_parser(
        "tables",
        help="the paper's tables, printed and computed",
        description="Tables 2, 3 and 4 of Wojtyra, Pekal, Fraczek (Mech. Mach. Theory 153 (2020) 103999): printed and "
        "computed figures side by side, every difference marked and explained; or computed figures as JSON.",
    )
    tables.add_argument(
        "--json",
        action="store_true",
        help="computed figures at full float64 precision: {table2, table3, table4}, lists of rows with u, h or "
        "x0, linear, angular, forces, moments and, with friction, tau, in the units of the row",
    )
    _own_mechanism(commands.add_parser)
    return parser


def _own_mechanism(add: Callable[..., argparse.ArgumentParser]) -> None:
    """Add the commands on a user's file; `add` is that of argparse."""
    analysis = add(
        "analyze",
        help="what is unique in a mechanism of yours",
        description=f"Rank, self-stress, and which multipliers and accelerations are unique, at a state. {_PICK}",
    )
    study = add(
        "study",
        help="how far a mechanism of yours varies along its self-stress",
        description=f"Solutions along every self-stress state: table of extremes, and a picture with --png. {_PICK}",
    )
    page = add(
        "report",
        help="both as a page with pictures",
        description="A page to read, print and pass on: the mechanism drawn, what is redundant, what is unique and "
        f"why, what to release, motion and loads with their ranges, and how the page was made. {_PICK}",
    )
    for command in (analysis, study, page):
        command.add_argument(
            "system",
            metavar="FILE.py:NAME",
            help="a pair (system, state), a function that returns one, or a system beside a State named 'state'",
        )
    examination, referee = _audit(add), _check(add)
    _drive(add)
    for command in (analysis, study, examination, referee):
        command.add_argument("--json", action="store_true", help="print JSON")
    page.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=_target(*FORMATS),
        default="report.html",
        help=".html: one file with its pictures; .md: Markdown with its pictures beside it (default report.html)",
    )
    study.add_argument(
        "--png",
        metavar="FILE",
        type=_PICTURE,
        default=argparse.SUPPRESS,  # or it would undo one given before the command
        help="draw the solutions; further states have their number in the name",
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


def _audit(add: Callable[..., argparse.ArgumentParser]) -> argparse.ArgumentParser:
    """Add the command on models from files."""
    examination = add(
        "audit",
        help=f"what is redundant in a model from a file: {NAMES} or yours",
        description="Closes the loops of a model and says how many constraints are redundant, which joint loads are "
        "unique, and what to release; at several positions, which must agree.",
        epilog="Exit status: 0 if nothing is redundant, or no more than allowed, 2 if the file cannot be read or "
        "closed, 3 if something is redundant, 4 if positions do not agree or cannot be decided, or a "
        "constraint of the file is left out.",
    )
    examination.add_argument("system", metavar="MODEL", help=f"{_MODELS}, or FILE.py:NAME as for analyze")
    examination.add_argument(
        "--closures",
        metavar="FILE",
        help="loops of a URDF, as YAML; by default the file of its name that ends in .yaml, if there is one",
    )
    examination.add_argument(
        "--keyframe",
        metavar="NAME",
        help="begin from a keyframe of an MJCF; by default the position of the file, or the first keyframe that closes "
        "within joint limits where that does not",
    )
    examination.add_argument(
        "--allow", metavar="K", type=_whole, default=0, help="so many redundant constraints are no fault (default 0)"
    )
    examination.add_argument("--all", action="store_true", help="list all releases that were found, too")
    examination.add_argument(
        "--stops",
        action="store_true",
        help="also what joint limits bear in this position as stops that only push, at rest and let go",
    )
    examination.add_argument(
        "--html",
        metavar="FILE",
        type=_target(".html", ".htm"),
        help="also write a page with the mechanism to turn in a browser, its joints in the colours of the verdict; it "
        'needs pip install "redundax[html]"',
    )
    examination.add_argument(
        "--loads",
        metavar="FILE",
        type=_target(".csv", ".inp"),
        help="also write what each body bears at rest in this position, joint by joint in its own axes, for a program "
        "of finite elements: a table, .csv, or cards of CalculiX, .inp; where loads are not unique those of least norm",
    )
    examination.add_argument(
        "--fix",
        metavar="FILE",
        type=pathlib.Path,
        help="also write a copy of the model that frees what takes off redundancy and adds no motion, as far as its "
        "format can say it: MJCF, SDF, ASMT, USD, and URDF with the loops in a .yaml beside it",
    )
    examination.add_argument(
        "--release",
        metavar="ROW,ROW",
        type=lambda text: tuple(text.split(",")),
        default=(),
        help="rows that --fix is to free, as the audit names them; by default what the audit marks",
    )
    return examination


def _check(add: Callable[..., argparse.ArgumentParser]) -> argparse.ArgumentParser:
    """Add the command on logs."""
    referee = add(
        "check",
        help="which joint loads of another program's log are determined, and whether those are right",
        description="Stamps each joint load of a log: determined by the machine and right, determined and wrong, or "
        "not determined, with the self-stress that it carries.",
        epilog="Columns are t, joint coordinates such as A.angle, with ' behind for rates and '' for accelerations, "
        "and loads such as 'A force x on crank' or A.fx, in N and N m about the joint's point. Exit status: 0 if no "
        "load is wrong, 2 if a file cannot be read or does not fit, 3 if a load is wrong, 4 if a constraint of the "
        "model is left out.",
    )
    referee.add_argument("system", metavar="MODEL", help=f"{_MODELS}, or FILE.py:NAME as for analyze")
    referee.add_argument("log", metavar="LOG", nargs="?", help="a file of CSV; by default the run that an .asmt stores")
    referee.add_argument("--run", metavar="S", type=_size, help="make the log by MuJoCo, so many seconds from rest")
    referee.add_argument("--axes", choices=("global", "body", "joint"), help="of components; by default what fits best")
    referee.add_argument("--drive", metavar="NAME", action="append", default=[], help="a coordinate that is driven")
    referee.add_argument("--rtol", type=_size, default=1e-3, help="what is right, of the joint's load (default 1e-3)")
    referee.add_argument(
        "--png", metavar="FILE", type=_PICTURE, default=argparse.SUPPRESS, help="also draw loads over time"
    )
    referee.add_argument("--closures", metavar="FILE", help="loops of a URDF, as of audit")
    referee.add_argument("--keyframe", metavar="NAME", help="of an MJCF, as of audit")
    return referee


def _drive(add: Callable[..., argparse.ArgumentParser]) -> None:
    """Add the command on driven machines."""
    motion = add(
        "drive",
        help="which torque the motors of a model must give: MJCF, URDF or yours",
        description="Moves coordinates of joints along laws of time and tells what their drives must give: peak, root "
        "mean square, power and energy, and whether the rigid machine determines it.",
        epilog="A law is NAME=KIND(figures), where NAME is a joint or its coordinate, in m, rad and s: "
        "trapezoid(stroke, speed, acceleration), scurve(stroke, speed, acceleration, jerk), cycloidal(stroke, move), "
        "harmonic(amplitude, frequency), polynomial(c0, c1, ...), constant(c0). The first three take dwell=, a rest "
        "before the way back. Moves begin where the model is. Exit status: 0 if all went well, 1 without a solution, 2 "
        "if arguments or the file are wrong.",
    )
    motion.add_argument("system", metavar="MODEL", help=f"{_MODELS}, or FILE.py:NAME as for analyze")
    motion.add_argument("--law", metavar="NAME=LAW", action="append", default=[], help="of a coordinate; once for each")
    motion.add_argument(
        "--table",
        metavar="FILE",
        type=pathlib.Path,
        help="laws from a table, as --csv writes it: a column t, s, and columns of coordinates, A.angle, beside which "
        "there may be their rates and accelerations, A.angle' and A.angle''",
    )
    motion.add_argument("--hold", metavar="NAME", action="append", default=[], help="a coordinate that rests")
    motion.add_argument("--time", metavar="S", type=_size, help="how long; by default until the last law ends")
    motion.add_argument("--samples", type=_count, default=201, help="times looked at (default 201)")
    motion.add_argument("--csv", metavar="FILE", type=pathlib.Path, help="also write a table with a line for each time")
    motion.add_argument(
        "--png", metavar="FILE", type=_PICTURE, default=argparse.SUPPRESS, help="also draw forces and power over time"
    )
    motion.add_argument("--closures", metavar="FILE", help="loops of a URDF, as of audit")
    motion.add_argument("--keyframe", metavar="NAME", help="of an MJCF, as of audit")


def _whole(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"must be a whole number, but is {text}")
    return int(text)


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


def _target(*endings: str) -> Callable[[str], pathlib.Path]:
    """What reads the name of a file to write, with one of some endings."""

    def target(text: str) -> pathlib.Path:
        file = pathlib.Path(text)
        if file.suffix not in endings:
            raise argparse.ArgumentTypeError(f"must end in {', '.join(endings[:-1])} or {endings[-1]}, but is {text}")
        if not file.parent.is_dir():
            raise argparse.ArgumentTypeError(f"must lie in a folder that exists, but there is no {file.parent}")
        return file

    return target


_PICTURE = _target(".png", ".pdf", ".svg")


def version() -> str:
    """Of the package."""
    return metadata.version("redundax")
