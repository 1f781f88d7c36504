"""The command that asks which forces drives must give, of a model from a file."""

import argparse
import ast
import csv
import inspect
import pathlib
from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np

from .._bodies._law_of_time import Polynomial
from .._check._log import TIMES, table_of
from .._drive._along import coordinates_of, values_of
from .._drive._drive import drive
from .._drive._laws import AbstractLaw, AbstractMove, Cycloidal, Harmonic, Sampled, SCurve, Trapezoid
from .._drive._run import Run
from .._models._build import limited
from .._models._formats import MODELS
from .._models._model import Model, load_model
from .._system._names import index_of
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import RedundaxError
from .._tools._module import replace_fields
from .._tools._words import ended
from ..plot._drive import drive as picture
from ._file import FileError, check_system, load, writing
from ._output import show, tell

_TO_JOINTS = "Give the law to a joint, not to an actuator of the file."
Law: TypeAlias = AbstractLaw | Polynomial
_LAWS: dict[str, Callable[..., Law]] = {
    "trapezoid": Trapezoid,
    "scurve": SCurve,
    "cycloidal": Cycloidal,
    "harmonic": Harmonic,
    "polynomial": lambda *coefficients: Polynomial([*coefficients]),
    "constant": lambda value: Polynomial([value]),
}


def drive_file(arguments: argparse.Namespace) -> int:
    """Print what the drives of a model must give, and write it as a table and a picture; 1 without a solution."""
    system, state, model = _opened(arguments)
    here = dict(zip(coordinates_of(system).labels, np.asarray(values_of(system, state)).tolist(), strict=True))
    given = [_law(text, system, here) for text in arguments.law]
    begin, of_table = _of_table(arguments.table, system) if arguments.table else (0.0, {})
    given += of_table.items()
    laws = dict(given)
    if len(laws) < len(given):
        names = [name for name, _ in given]
        twice = next(name for name in names if names.count(name) > 1)
        raise FileError(f"Arguments `--law` and `--table` give '{twice}' two laws. Leave one of them.")
    hold = [_coordinate(name, system) for name in arguments.hold]
    end = begin + arguments.time if arguments.time else max(map(_duration, laws.values()), default=0.0)
    if not end > begin:
        raise FileError(
            "Argument `--time` must be given where no law has an end. Give the seconds to look at, --time 2 say."
        )
    ts = np.linspace(begin, end, arguments.samples)
    try:
        run = drive(system, laws, ts, state.q, hold=hold)
    except RuntimeError as error:
        tell(f"redundax: {error}")
        return 1
    except RedundaxError as error:
        raise FileError(str(error)) from error
    if model is not None and (beyond := [*_beyond(model, run)]):
        run = replace_fields(run, remarks=(*run.remarks, f"Beyond limits of the file: {'; '.join(beyond)} (rad or m)."))
    show(str(run))
    if arguments.csv:
        with writing(arguments.csv):
            _write(run, arguments.csv)
        tell(f"written: {arguments.csv}")
    if arguments.png:
        with writing(arguments.png):
            picture(run).savefig(arguments.png)
        tell(f"drawn: {arguments.png}")
    return 0


def _opened(arguments: argparse.Namespace) -> tuple[AbstractSystem, State, Model | None]:
    path = arguments.system
    if pathlib.Path(path).suffix.lower() not in MODELS:
        check_system(arguments)
        return *load(path), None
    try:
        model = load_model(path, arguments.closures, keyframe=arguments.keyframe)
    except (RedundaxError, OSError) as error:
        raise FileError(str(error)) from error
    return model.mechanism, model.state, model


def _beyond(model: Model, run: Run) -> Iterator[str]:
    """Joints that the motion leads beyond their limits, which bear no load in it, as the file counts them."""
    for part, coordinate, now in limited(model.described):
        values, slack = now + np.asarray(run[coordinate]), model.tree.slack(part)
        (low, high), least, most = part.limits or (-np.inf, np.inf), np.nanmin(values), np.nanmax(values)
        if least < low - slack or most > high + slack:
            yield f"{part.name} goes from {least:.4g} to {most:.4g}, limits are {low:.4g} and {high:.4g}"


def _coordinate(name: str, system: AbstractSystem) -> str:
    """A coordinate by its name, or by that of a joint that has one."""
    labels = coordinates_of(system).labels
    own = [label for label in labels if label.rpartition(".")[0] == name]
    if name not in labels and len(own) == 1:
        return own[0]
    try:
        index_of("--law", name, labels, " of coordinates")
    except RedundaxError as error:
        raise FileError(f"{error} {_TO_JOINTS}") from error
    return name


def _law(text: str, system: AbstractSystem, here: dict[str, float]) -> tuple[str, Law]:
    """A coordinate and its law, from "motor=trapezoid(3.1, speed=2, acceleration=10)"; moves start where it is."""
    name, _, call = text.partition("=")
    form = "It has the form NAME=LAW(figures), as in motor=trapezoid(3.14, speed=2, acceleration=10)."
    try:
        tree = ast.parse(call.strip(), mode="eval").body
        if not (isinstance(tree, ast.Call) and isinstance(tree.func, ast.Name)):
            raise ValueError
        kind, given = tree.func.id, [float(ast.literal_eval(each)) for each in tree.args]
        named = {str(each.arg): float(ast.literal_eval(each.value)) for each in tree.keywords}
    except (SyntaxError, ValueError, TypeError) as error:
        raise FileError(f"The law '{text}' cannot be read. {form} Angles are in radians.") from error
    if kind not in _LAWS:
        raise FileError(f"The law '{text}' has an unknown kind '{kind}'. There are {', '.join(_LAWS)}.")
    coordinate, make = _coordinate(name.strip(), system), _LAWS[kind]
    first = "start" if kind in ("trapezoid", "scurve", "cycloidal") else "mean"
    if first in inspect.signature(make).parameters:
        named.setdefault(first, here[coordinate])
    try:
        inspect.signature(make).bind(*given, **named)  # whose words name no function
        return coordinate, make(*given, **named)
    except (RedundaxError, TypeError) as error:
        figures = ", ".join(name for name in inspect.signature(make).parameters)
        raise FileError(f"The law '{text}' does not fit: {ended(str(error))} Figures of {kind}: {figures}.") from error


def _of_table(path: pathlib.Path, system: AbstractSystem) -> tuple[float, dict[str, Law]]:
    """When a table of a motion begins, and the law of each coordinate that it has; other columns are not used."""
    try:
        columns = table_of(path, "--table")
    except RedundaxError as error:
        raise FileError(str(error)) from error
    time, labels = next((name for name in columns if name.lower() in TIMES), None), coordinates_of(system).labels
    if time is None:
        raise FileError(f"Argument `--table`: '{path}' has no column `t` of times, s. Rename one.")
    laws: dict[str, Law] = {}
    for label in filter(columns.__contains__, labels):
        rates, accelerations = columns.get(f"{label}'"), columns.get(f"{label}''")
        more = {} if accelerations is None else {"rates": rates, "accelerations": accelerations}
        try:
            laws[label] = Sampled(columns[time], columns[label], ends=None if more else "not-a-knot", **more)
        except RedundaxError as error:
            raise FileError(f"Argument `--table`: of '{label}' in '{path}'. {error}") from error
    if not laws:
        raise FileError(
            f"Argument `--table`: '{path}' has no coordinate. Call a column as one is: {', '.join(labels)}."
        )
    return float(columns[time][0]), laws


def _duration(law: Law) -> float:
    if isinstance(law, Sampled):
        return float(law.last)
    if isinstance(law, AbstractMove):
        return float(law.begin + law.duration)
    return float(1 / law.frequency) if isinstance(law, Harmonic) and law.frequency else 0.0


def _write(run: Run, file: pathlib.Path) -> None:
    """A table with a line for each time."""
    columns: dict[str, np.ndarray] = {"t": np.asarray(run.t)}
    joints = run.names.axes["joint_coordinate"].labels if run.names is not None else ()
    for k, each in enumerate(run.drives):
        if each.name in joints:
            columns |= {f"{each.name}{order}": np.asarray(run[f"{each.name}{order}"]) for order in ("", "'", "''")}
        columns[f"{each.name} rate"] = np.asarray(run.rates)[:, k]
        for what in (each.word, f"{each.word} before", "power", "energy"):
            columns[f"{each.name} {what}"] = np.asarray(run[f"{each.name} {what}"])
        columns[f"{each.name} determined"] = np.asarray(run.determined)[:, k].astype(int)
    with file.open("w", newline="", encoding="utf8") as stream:
        table = csv.writer(stream)
        table.writerow(columns)
        table.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
