"""A log of another program: columns by name over time

    t                        time, s
    A.angle                  a coordinate of a joint, or A of one that has no other; A.angle' its rate, A.angle'' its
                             acceleration
    A force x on crank       a component of what joint A does to a body; without "on" to the one that redundax tells
    A.fx, A_Mz, A.torque.z   the same in short
    A.angle torque           what drives that coordinate, or its force

A unit in brackets behind a name is left out; one that is known to be another than the model's is refused. Columns of
other names are not used.
"""

import csv
import dataclasses
import io
import pathlib
import re
from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np

from .._bodies._mechanism import Mechanism
from .._system._names import Names
from .._system._units import factor_of
from .._tools._errors import RedundaxError
from .._tools._module import Numbers
from .._tools._words import did_you_mean, ended, short

_LARGEST = 200_000_000  # bytes: more than a table that fits into memory as text and numbers
_LISTED = 6
TIMES = ("t", "time")
_PARTS = {"f": "force", "force": "force", "m": "moment", "t": "moment", "moment": "moment", "torque": "moment"}
_LOAD = re.compile(r"^(.+?)(?:[ ._/:]+)(force|moment|torque|f|m|t)[ ._]?([xyz]?)(?: on (.+))?$", re.IGNORECASE)
_UNIT = re.compile(r"\s*(\[[^\]]*\]|\([^)]*\))\s*$")


@dataclasses.dataclass(frozen=True, eq=False)
class Figure:
    """A column that is a load: its joint by number, its part, which component, on which of the joint's bodies, or None
    where that is not told, and the numbers, (times,); and the global point of a moment, (times, 3), or None for the
    joint's; and the body, once it is known."""

    name: str
    joint: int
    part: str
    component: int
    is_other: bool | None
    values: np.ndarray
    point: np.ndarray | None = None
    on: str = ""


@dataclasses.dataclass(frozen=True, eq=False)
class Log:
    """What a log has: times; coordinates, their rates and accelerations, by name; loads of joints; those of drives, by
    coordinate; and names of columns that are not used."""

    times: np.ndarray
    positions: dict[str, np.ndarray]
    rates: dict[str, np.ndarray]
    accelerations: dict[str, np.ndarray]
    figures: tuple[Figure, ...]
    drives: dict[str, np.ndarray]
    unused: tuple[str, ...]


def table_of(path: pathlib.Path, argument: str = "log") -> dict[str, np.ndarray]:
    """The columns of a file of CSV, by their names; separated by commas, semicolons or tabs."""

    def refuse(why: str) -> RedundaxError:
        return RedundaxError(f"Argument `{argument}`: '{path}' {ended(why)}")

    if not path.is_file():
        raise RedundaxError(
            f"Argument `{argument}`: there is no file '{path}'. Check the path and the folder that you are in."
        )
    if path.stat().st_size > _LARGEST:
        raise refuse(f"has {path.stat().st_size / 1e6:.0f} MB, {_LARGEST // 10**6} at most. Write fewer times.")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise refuse(f"cannot be read as text in UTF-8: {error}. Save it as CSV in UTF-8.") from error
    first = text.partition("\n")[0]
    mark = max(";\t,", key=first.count)
    rows = list(csv.reader(io.StringIO(text), delimiter=mark))
    rows = [(number, row) for number, row in enumerate(rows, 1) if any(cell.strip() for cell in row)]
    if len(rows) < 2:
        raise RedundaxError(
            f"Argument `{argument}`: '{path}' must have a line of names and then lines of numbers. Export it again."
        )
    names = [name.strip() for name in rows[0][1]]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise refuse(f"has the column {short(twice)} twice. Rename one.")
    found = np.empty((len(rows) - 1, len(names)))
    for place, (number, row) in enumerate(rows[1:]):
        if len(row) != len(names):
            raise refuse(f"has {len(row)} cells in line {number}, but {len(names)} names. Is it cut off?")
        for column, cell in enumerate(row):
            try:
                found[place, column] = float(cell) if mark == "," else float(cell.replace(",", "."))
            except ValueError as error:
                raise refuse(f"has {short(cell)} in line {number}, which is no number. Correct it.") from error
    return dict(zip(names, found.T, strict=True))


def read_log(mechanism: Mechanism, columns: Mapping[str, Numbers]) -> Log:
    """What the columns are to a mechanism.

    **Raises:** `RedundaxError` without times, without a load that has a name here, or for numbers that are not finite.
    """
    names, table = mechanism.names, {str(name): _numbers(str(name), columns[name]) for name in columns}
    time = next((name for name in table if _plain(name).lower() in TIMES), None)
    if time is None:
        raise RedundaxError(
            f"Argument `log` must have a column `t` of times, s, but has {listed_names(list(table))}. Rename one."
        )
    _check_unit(names, time, "time")
    times = table.pop(time)
    sizes = {name: column.size for name, column in table.items() if column.size != times.size}
    if times.ndim != 1 or not times.size or sizes or np.any(np.diff(times) <= 0):
        what = f"'{next(iter(sizes))}' has another size" if sizes else "they are not ascending, or none"
        raise RedundaxError(
            f"Argument `log` must have a number at each of its times, which ascend, but {what}. Mend it."
        )
    coordinates, found = _coordinates(names), Log(times, {}, {}, {}, (), {}, ())
    figures, unused = [], []
    for name, values in table.items():
        texts = dict.fromkeys((name, _plain(name)))
        known = next(filter(None, (_known(mechanism, coordinates, found, text, values) for text in texts)), None)
        if known:
            _check_unit(names, name, *_kind(names, coordinates, known, _plain(name)))
        figures += [known] if isinstance(known, Figure) else []
        unused += [] if known else [name]
    if not figures and not found.drives:
        near = did_you_mean(next(iter(unused), ""), names.reactions.labels)
        example = names.reactions.labels[0] if len(names.reactions) else "A force x"
        raise RedundaxError(
            f"Argument `log` must have a load of a joint by its name, such as '{example}', but has "
            f"{listed_names(unused)}. {near}Rename the columns."
        )
    return dataclasses.replace(found, figures=tuple(figures), unused=tuple(unused))


def _plain(name: str) -> str:
    return _UNIT.sub("", name).strip()


def _known(mechanism: Mechanism, coordinates: dict[str, str], log: Log, name: str, values: np.ndarray) -> Figure | bool:
    """A load by its name; of a coordinate or drive that the log now has, whether it is one."""
    coordinate, rates = _place(coordinates, name)
    if not coordinate:
        return _figure(mechanism, name, values) or False
    _keep((log.positions, log.rates, log.accelerations, log.drives)[rates], coordinate, name, values)
    return True


def _place(coordinates: dict[str, str], name: str) -> tuple[str, int]:
    """The coordinate that a column is of, if any, and how often it is differentiated by time; -1 of its drive."""
    own, (of, _, word) = name.rstrip("'"), name.rpartition(" ")
    if own in coordinates and len(name) - len(own) < 3:
        return coordinates[own], len(name) - len(own)
    is_drive = of in coordinates and word.lower() in ("torque", "force", "moment")
    return coordinates[of] if is_drive else "", -1


def _kind(names: Names, coordinates: dict[str, str], known: Figure | bool, name: str) -> tuple[str, int]:
    """The kind of unit of a column, and how often it is differentiated by time."""
    if isinstance(known, Figure):
        return known.part, 0
    coordinate, rates = _place(coordinates, name)
    for axis in (names.joint_coordinates, names.coordinates):
        if coordinate in axis.labels:
            kind = axis.kinds[axis.labels.index(coordinate)]
            return ("moment" if kind == "angular" else "force", 0) if rates < 0 else (kind, rates)
    return "", 0


def _check_unit(names: Names, name: str, kind: str, rates: int = 0) -> None:
    """Refuse a column in a unit that is known to be another than that of the model."""
    given, own = _UNIT.search(name), names.units.of(kind, rates) if kind else ""
    if given is None or not own:
        return
    stated, wanted = factor_of(given[1][1:-1]), factor_of(own)
    if stated and wanted and abs(stated / wanted - 1) > 1e-6:
        raise RedundaxError(
            f"Argument `log` must be in the units of the model, but has {short(name)} in place of {own}. Convert it."
        )


def _keep(columns: dict[str, np.ndarray], coordinate: str, name: str, values: np.ndarray) -> None:
    """Keep what a column says of a coordinate, which no other may say too."""
    if coordinate in columns:
        raise RedundaxError(
            f"Argument `log` must have one column for each figure, but {short(name)} is told by another column of "
            f"'{coordinate}' too. Leave one out."
        )
    columns[coordinate] = values


def listed_names(names: Sequence[str]) -> str:
    """Names of columns in a message; of many the first."""
    return ", ".join([*(short(name) for name in names[:_LISTED]), *["..."] * (len(names) > _LISTED)]) or "no other"


def _numbers(name: str, values: Numbers) -> np.ndarray:
    try:
        found = np.asarray(values, float)
    except (TypeError, ValueError) as error:
        raise RedundaxError(f"Argument `log` must hold numbers, but column {short(name)} does not. Mend it.") from error
    if not np.all(np.isfinite(found)):
        raise RedundaxError(f"Argument `log` must hold finite numbers, but column {short(name)} does not. Mend it.")
    return found


def _coordinates(names: Names) -> dict[str, str]:
    """Names of coordinates by what a column may call them."""
    labels = (
        (*names.coordinates.labels, *names.joint_coordinates.labels) if names.adds else names.joint_coordinates.labels
    )
    joints = [label.rpartition(".")[0] for label in labels]
    short_names = {
        joint: label for joint, label in zip(joints, labels, strict=True) if joint and joints.count(joint) == 1
    }
    return short_names | {label: label for label in labels}


def _figure(mechanism: Mechanism, name: str, values: np.ndarray) -> Figure | None:
    names, flat = mechanism.names, mechanism.names.joint_names
    found = _LOAD.match(name)
    if found is None or found[1].strip() not in flat:
        return None
    joint, part, axis, body = flat.index(found[1].strip()), _PARTS[found[2].lower()], found[3].lower(), found[4]
    axes = mechanism.frame.linear if part == "force" or len(mechanism.frame.linear) == 3 else ("",)
    if axis not in axes:
        return None
    pair = cast(tuple[str, str], names.bodies_at(flat[joint]))
    if body is not None and body not in pair:
        if _plain(name) != name:  # a unit stands behind
            return None
        raise RedundaxError(
            f"Argument `log` has the column {short(name)}, but '{flat[joint]}' joins '{pair[0]}' and '{pair[1]}'. "
            "Name one of these."
        )
    label = names.reactions.labels[joint * mechanism.frame.size]
    return Figure(
        name, joint, part, axes.index(axis), None if body is None else not label.endswith(f" on {body}"), values
    )
